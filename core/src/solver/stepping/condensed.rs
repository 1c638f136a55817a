//! Steps condensed to the contact: the forward half of a linear solve eliminates all other velocities before Newton's method,
//! and the backward half computes them afterwards.
//!
//! With `K = L L^T` and the motions on which contact laws act ordered last, `L y = b` leaves `S v + C(v) = L_c y_c` for these
//! motions, where `S = L_c L_c^T` is the Schur complement; `L^T x = y` with `y_c = L_c^T v_c` gives all velocities. A step needs
//! one linear solve for any number of Newton iterations, whose residual is that of the contact alone.
//!
//! With a factor in single precision, `K = L L^T + E`, solutions are corrected until the residual in double precision is small. The
//! correction `d` of a velocity `v` solves `L L^T d + C(v + d) = r` with `r = b - K v`. The residual `r_c` along the motions on
//! which laws act contains the large contact forces and is not transformed. A forward solve is applied to the rest, `L y = r -
//! r_c`, and the contact system is `S (v + d) + C(v + d) = L_c y_c + r_c + S v`. The remaining error `-E d` is measured and
//! corrected in the same way.

use super::{
    condensed_matrix::{CondensedMatrix, ContactMotion, Subspace, Workspace},
    equations::{Floor, NodeByNode, StepMatrix},
    frames::Frames,
    problem::System,
    solver::{Assembled, LinearSolver, Reduced},
    springs::RowsWithSprings,
    substructuring::{Factors, Substructures},
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, effect::ContactNode},
    linear_algebra::petsc::{DistributedVector, Matrix, Precision, ProjectedKsp},
    parallel::session::Session,
};
use std::{cell::RefCell, rc::Rc};

/// Share of the tolerance to which the contact system is solved. Later corrections start so close to their solution that Newton's
/// method would otherwise stop just below the tolerance, with velocity and pressure at that distance from their graph.
pub(super) const CONTACT_SHARE: f64 = 0.1;

/// A factor of the matrix, and the system of the motions on which laws act.
pub(super) struct Condensed<const D: usize> {
    unknowns: Rc<Unknowns<D>>,
    krylov: ProjectedKsp,
    elimination: Elimination,
    /// Vectors of contact nodes: right-hand side, velocity, and velocity of the converged state.
    right_hand_side: DistributedVector,
    velocity: DistributedVector,
    converged: DistributedVector,
    /// Data for corrections, if the factor is in single precision.
    refinement: Option<Refinement>,
}

/// The unknowns of the contact, which the solvers for all matrices of a run have in common.
struct Unknowns<const D: usize> {
    nodes: ContactNodes<D>,
    /// The range of this rank in the unknowns of all ranks.
    own: std::ops::Range<usize>,
    frames: Rc<Frames>,
    /// With the order of elimination, once it is known.
    substructures: RefCell<Substructures>,
    /// Unknowns of this rank with those eliminated.
    owned: usize,
}

/// A factored matrix. It alone knows whether the substitutions of its factors include the contact unknowns.
struct Factored {
    factors: Factors,
    condensed: CondensedMatrix,
}

/// The factor, and its vector of the unknowns of this rank.
struct Elimination {
    factored: Option<Factored>,
    frames: Rc<Frames>,
    values: Vec<f64>,
    /// Half solves since the count of traffic was restarted.
    half_solves: u64,
}

/// The contact nodes of this rank, in the order of vectors of contact nodes, and the motions on which laws act.
struct ContactNodes<const D: usize> {
    nodes: Vec<usize>,
    motions: Vec<ContactMotion>,
}

/// Vectors of all nodes, and of contact nodes.
struct Refinement {
    residual: DistributedVector,
    correction: DistributedVector,
    /// The velocity of contact nodes before a correction.
    before: DistributedVector,
    change: DistributedVector,
    product: DistributedVector,
}

impl Refinement {
    fn new(nodes: &DistributedVector, contact: &DistributedVector) -> Result<Self> {
        Ok(Self {
            residual: nodes.like()?,
            correction: nodes.like()?,
            before: contact.like()?,
            change: contact.like()?,
            product: contact.like()?,
        })
    }
}

impl<const D: usize> Condensed<D> {
    /// A solver for the contacts of a body, whose unknowns it numbers. Collective.
    pub(super) fn new<const S: usize>(session: &Session, body: &mut Body<D, S>) -> Result<Self> {
        let contact: Vec<ContactNode<D>> = body.contact_nodes();
        let nodes = ContactNodes::new(&contact);
        body.contacts.iter_mut().for_each(|contact| contact.number_unknowns(|node| nodes.number(node)));
        let frames = Rc::new(Frames::new(session, &body.mesh, &contact)?);
        let start = session.share_start(nodes.motions.len());
        Self::of(Rc::new(Unknowns {
            own: start..start + nodes.motions.len(),
            nodes,
            substructures: RefCell::new(Substructures::new(session, &body.mesh, D, &frames)?),
            frames,
            owned: body.mesh.owned * D,
        }))
    }

    fn of(unknowns: Rc<Unknowns<D>>) -> Result<Self> {
        let like = DistributedVector::ghosted(D, unknowns.nodes.nodes.len(), &[])?;
        let mut krylov = ProjectedKsp::new("", &like, D)?;
        krylov.linear_solver().set_method("cg")?;
        krylov.precondition_by_operator()?;
        let frames = unknowns.frames.clone();
        Ok(Self {
            unknowns,
            krylov,
            elimination: Elimination { factored: None, frames, values: Vec::new(), half_solves: 0 },
            right_hand_side: like.like()?,
            velocity: like.like()?,
            converged: like,
            refinement: None,
        })
    }
}

impl<const D: usize> LinearSolver for Condensed<D> {
    fn another(&self, _like: &DistributedVector) -> Result<Box<dyn LinearSolver>> {
        Ok(Box::new(Self::of(self.unknowns.clone())?))
    }

    /// Stiffness of springs in the rows is subtracted from products with the condensed matrix.
    fn prepare(&mut self, session: &Session, assembled: Assembled<'_>) -> Result<bool> {
        let RowsWithSprings { mut rows, springs } = assembled.rows;
        let Unknowns { nodes, own, frames, substructures, owned } = &*self.unknowns;
        frames.rotate_matrix(&mut rows);
        (self.elimination.factored, self.refinement) = (None, None);
        let factors =
            Factors::new(session.world(), &mut substructures.borrow_mut(), &rows, assembled.precision)?;
        let Some(mut factors) = factors else { return Ok(false) };
        drop(rows);
        let condensed = CondensedMatrix {
            lower: factors.take_last_factor(),
            positions: factors.positions(&frames.unknowns),
            nodes: frames.groups.clone(),
            own: own.clone(),
            motions: nodes.motions.clone(),
            springs,
            subspace: Subspace::whole(&self.velocity, factors.take_complement())?,
            workspace: Workspace::new(session, &nodes.motions, frames.unknowns.len())?,
        };
        if factors.precision() == Precision::Single {
            assembled.matrix.multiply_often()?;
        }
        self.elimination.values.resize(*owned, 0.0);
        self.elimination.factored = Some(Factored { factors, condensed });
        Ok(true)
    }

    fn krylov(&mut self) -> &mut ProjectedKsp {
        &mut self.krylov
    }

    fn unknowns<'a>(&'a self, _velocities: &'a DistributedVector) -> &'a DistributedVector {
        &self.velocity
    }

    fn number(&self, node: usize) -> usize {
        self.unknowns.nodes.number(node)
    }

    fn precision(&self) -> Option<Precision> {
        Some(self.elimination.factored.as_ref().map_or(Precision::Double, |f| f.factors.precision()))
    }

    /// With springs the condensed matrix has too little resistance to rigid motions.
    fn power(&mut self, matrix: &Matrix, motion: &DistributedVector) -> Result<f64> {
        let Self { unknowns, elimination, right_hand_side, velocity, .. } = self;
        let condensed = &factored_mut(&mut elimination.factored)?.condensed;
        if condensed.springs.is_some() {
            return StepMatrix::power(matrix, motion);
        }
        unknowns.nodes.restrict(motion, velocity)?;
        condensed.multiply(velocity, right_hand_side)?;
        velocity.dot(right_hand_side)
    }

    fn start(&mut self, system: System<'_>, trial: &DistributedVector) -> Result<()> {
        self.unknowns.nodes.restrict(system.converged, &mut self.converged)?;
        self.unknowns.nodes.restrict(trial, &mut self.velocity)?;
        if self.precision() == Some(Precision::Double) {
            return Ok(());
        }
        let refinement = match &mut self.refinement {
            Some(refinement) => refinement,
            none => none.insert(Refinement::new(trial, &self.velocity)?),
        };
        system.write_residual(trial, &mut refinement.residual)
    }

    fn condense<'a>(
        &'a mut self,
        system: System<'a>,
        trial: &'a mut DistributedVector,
    ) -> Result<Reduced<'a>> {
        let Self { unknowns, krylov, elimination, right_hand_side, velocity, converged, refinement } = self;
        let Some(Refinement { residual, before, change, product, .. }) = refinement else {
            elimination.forward(system.right_hand_side)?;
            let factored = factored_mut(&mut elimination.factored)?;
            factored.write_rest(right_hand_side)?;
            let matrix = &factored.condensed;
            let system = System { matrix, right_hand_side, converged, ..system };
            return Ok(Reduced { system, krylov, velocity });
        };
        unknowns.nodes.extract_forces(residual, change)?;
        elimination.forward(residual)?;
        unknowns.nodes.restrict(trial, velocity)?;
        before.copy_from(velocity)?;
        let factored = factored_mut(&mut elimination.factored)?;
        factored.write_rest(right_hand_side)?;
        right_hand_side.add_scaled(1.0, change)?;
        let matrix = &factored.condensed;
        matrix.multiply(before, product)?;
        right_hand_side.add_scaled(1.0, product)?;
        let tolerance = CONTACT_SHARE * system.tolerance;
        // Below the floor, a factor in double precision takes its place.
        let floor = Floor::default();
        let system = System { matrix, right_hand_side, tolerance, floor, converged, ..system };
        Ok(Reduced { system, krylov, velocity })
    }

    fn expand(&mut self, system: System<'_>, trial: &mut DistributedVector) -> Result<Option<f64>> {
        let Self { unknowns, elimination, right_hand_side, velocity, refinement, .. } = self;
        let factored = factored_mut(&mut elimination.factored)?;
        let Some(Refinement { residual, correction, before, change, product }) = refinement else {
            factored.set_contact(velocity)?;
            elimination.backward(trial)?;
            unknowns.nodes.prescribe(velocity, trial)?;
            return Ok(None);
        };
        right_hand_side.add_scaled(-1.0, product)?;
        change.copy_from(velocity)?;
        change.add_scaled(-1.0, before)?;
        factored.condensed.multiply(change, product)?;
        factored.set_contact(change)?;
        elimination.backward(correction)?;
        trial.add_scaled(1.0, correction)?;
        unknowns.nodes.prescribe(velocity, trial)?;
        // The residual `b - K v - C(v)`, with the forces `C(v)` of the last Newton iteration.
        system.write_residual(trial, residual)?;
        change.copy_from(right_hand_side)?;
        change.add_scaled(-1.0, product)?;
        correction.copy_from(residual)?;
        unknowns.nodes.subtract(change, correction)?;
        correction.norm().map(Some)
    }

    fn solve(&mut self, forces: &DistributedVector, solution: &mut DistributedVector) -> Result<()> {
        self.elimination.forward(forces)?;
        factored_mut(&mut self.elimination.factored)?.solve_contact();
        self.elimination.backward(solution)
    }

    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        let Self { elimination, right_hand_side, velocity, .. } = self;
        elimination.forward(r)?;
        let factored = factored_mut(&mut elimination.factored)?;
        if factored.condensed.is_on_subspace() {
            factored.write_rest(right_hand_side)?;
            factored.condensed.precondition(right_hand_side, velocity)?;
            factored.set_contact(velocity)?;
        } else {
            factored.solve_contact();
        }
        elimination.backward(z)
    }

    fn set_subspace(&mut self, project: NodeByNode<'_>, work: &mut DistributedVector) -> Result<bool> {
        let nodes = &self.unknowns.nodes;
        factored_mut(&mut self.elimination.factored)?.condensed.set_subspace(&mut |column| {
            nodes.extend(column, work)?;
            project(work)?;
            nodes.restrict(work, column)
        })
    }

    fn restart_traffic(&mut self) {
        self.elimination.half_solves = 0;
        self.elimination.factored.iter().for_each(|factored| factored.condensed.restart_traffic());
    }

    /// The factor for each half solve, its last block for each product.
    fn traffic(&mut self, _ranks: usize, _product: u64) -> Result<Option<u64>> {
        let Elimination { factored, half_solves, .. } = &self.elimination;
        let bytes =
            |factored: &Factored| half_solves * factored.factors.bytes() + factored.condensed.traffic();
        Ok(Some(factored.as_ref().map_or(0, bytes)))
    }
}

impl Factored {
    /// Writes the forces along the motions of contact nodes that the forward substitution leaves of the right-hand side.
    fn write_rest(&mut self, forces: &mut DistributedVector) -> Result<()> {
        let Self { factors, condensed, .. } = self;
        if factors.solves_contact() {
            condensed.write_times_lower(factors.last_mut(), forces)
        } else {
            condensed.write(factors.last_mut(), forces)
        }
    }

    /// Starts the backward substitution with the motions of contact nodes. Collective.
    fn set_contact(&mut self, motions: &DistributedVector) -> Result<()> {
        let Self { factors, condensed, .. } = self;
        if factors.solves_contact() {
            condensed.read_times_upper(motions, factors.last_mut())
        } else {
            condensed.read_amounts(motions, factors.last_mut())
        }
    }

    /// Completes a forward substitution for the solution without contact forces.
    fn solve_contact(&mut self) {
        if !self.factors.solves_contact() {
            self.condensed.solve(self.factors.last_mut());
        }
    }
}

/// The factored matrix, which must exist.
fn factored_mut(factored: &mut Option<Factored>) -> Result<&mut Factored> {
    factored
        .as_mut()
        .ok_or_else(|| Error::Internal("a step was solved before its matrix was factored".into()))
}

impl Elimination {
    /// Solves `L y = b`. Collective.
    fn forward(&mut self, right_hand_side: &DistributedVector) -> Result<()> {
        self.values.copy_from_slice(&right_hand_side.owned()?);
        self.frames.rotate(&mut self.values, false);
        self.half_solves += 1;
        factored_mut(&mut self.factored)?.factors.forward(&self.values)
    }

    /// Solves `L^T x = y`.
    fn backward(&mut self, solution: &mut DistributedVector) -> Result<()> {
        self.half_solves += 1;
        factored_mut(&mut self.factored)?.factors.backward(&mut self.values)?;
        self.frames.rotate(&mut self.values, true);
        solution.owned_mut()?.copy_from_slice(&self.values);
        Ok(())
    }
}

impl<const D: usize> ContactNodes<D> {
    fn new(contact: &[ContactNode<D>]) -> Self {
        let motions = contact.iter().enumerate().flat_map(|(number, contact)| {
            let motion =
                move |direction: &[f64; D]| ContactMotion { at: number * D, direction: direction.to_vec() };
            contact.frame[..contact.active].iter().map(motion)
        });
        Self { nodes: contact.iter().map(|contact| contact.node).collect(), motions: motions.collect() }
    }

    /// The position of a node in vectors of contact nodes.
    fn number(&self, node: usize) -> usize {
        self.nodes.partition_point(|other| *other < node)
    }

    /// Sets the values of contact nodes, and all others to zero.
    fn extend(&self, from: &DistributedVector, to: &mut DistributedVector) -> Result<()> {
        let (from, mut to) = (from.owned()?, to.owned_mut()?);
        to.fill(0.0);
        let pairs = from.chunks_exact(D).zip(&self.nodes);
        pairs.for_each(|(from, &node)| to[node * D..][..D].copy_from_slice(from));
        Ok(())
    }

    /// Copies the values of contact nodes.
    fn restrict(&self, from: &DistributedVector, to: &mut DistributedVector) -> Result<()> {
        let (from, mut to) = (from.owned()?, to.owned_mut()?);
        let pairs = to.chunks_exact_mut(D).zip(&self.nodes);
        pairs.for_each(|(to, &node)| to.copy_from_slice(&from[node * D..][..D]));
        Ok(())
    }

    /// Subtracts values of contact nodes.
    fn subtract(&self, values: &DistributedVector, from: &mut DistributedVector) -> Result<()> {
        let (values, mut from) = (values.owned()?, from.owned_mut()?);
        for (&node, value) in self.nodes.iter().zip(values.chunks_exact(D)) {
            from[node * D..][..D].iter_mut().zip(value).for_each(|(from, value)| *from -= value);
        }
        Ok(())
    }

    /// Sets the velocities along the motions on which laws act to those of contact nodes: the solve for all velocities
    /// returns them with rounding errors.
    fn prescribe(&self, velocity: &DistributedVector, trial: &mut DistributedVector) -> Result<()> {
        let (velocity, mut trial) = (velocity.owned()?, trial.owned_mut()?);
        for motion in &self.motions {
            let velocity = &velocity[motion.at..][..D];
            let value = &mut trial[self.nodes[motion.at / D] * D..][..D];
            let difference: f64 = (0..D).map(|i| motion.direction[i] * (velocity[i] - value[i])).sum();
            (0..D).for_each(|i| value[i] += difference * motion.direction[i]);
        }
        Ok(())
    }

    /// Moves the forces along the motions on which laws act from a residual of all nodes into a vector of contact nodes.
    fn extract_forces(&self, residual: &mut DistributedVector, forces: &mut DistributedVector) -> Result<()> {
        let (mut residual, mut forces) = (residual.owned_mut()?, forces.owned_mut()?);
        forces.fill(0.0);
        for motion in &self.motions {
            let value = &mut residual[self.nodes[motion.at / D] * D..][..D];
            let component: f64 = motion.direction.iter().zip(&*value).map(|(n, r)| n * r).sum();
            for ((value, force), n) in value.iter_mut().zip(&mut forces[motion.at..]).zip(&motion.direction) {
                *value -= component * n;
                *force += component * n;
            }
        }
        Ok(())
    }
}
