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

mod flowing;

use super::{
    StepOutcome,
    condensed_matrix::{CondensedMatrix, Motion, Subspace, Workspace},
    equations::{Floor, StepMatrix},
    flow::Flow,
    flow_corrections::FlowCorrections,
    frames::Frames,
    linear_solver::SolverSettings,
    newton::Newton,
    problem::{StepProblem, System},
    resistance::{resistances, resistances_of_body},
    springs::RowsWithSprings,
    substructuring::{Factors, Substructures},
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::ContactNode,
    },
    linear_algebra::petsc::{DistributedVector, Matrix, Precision, ProjectedKsp},
    parallel::session::Session,
};

/// Number of corrections after which single precision has failed.
const MAX_CORRECTIONS: usize = 12;
/// A correction that reduces the residual by less than this factor counts as divergence.
const LARGEST_REDUCTION: f64 = 0.5;
/// Share of the tolerance to which the contact system is solved. Later corrections start so close to their solution that Newton's
/// method would otherwise stop just below the tolerance, with velocity and pressure at that distance from their graph.
const CONTACT_SHARE: f64 = 0.1;

/// A solver for steps with a factor of their matrix.
pub(super) struct Condensed {
    newton: Newton,
    elimination: Elimination,
    /// The precision of factors: double after single precision has failed.
    pub precision: Precision,
    nodes: ContactNodes,
    /// The range of this rank in the unknowns of all ranks.
    own: std::ops::Range<usize>,
    /// Vectors of contact nodes: right-hand side, velocity, and velocity of the converged state.
    right_hand_side: DistributedVector,
    velocity: DistributedVector,
    converged: DistributedVector,
    /// Data for corrections, if factors are in single precision.
    refinement: Option<Refinement>,
    /// Data for cells that flow, if there are any.
    flowing: Option<Box<FlowCorrections>>,
}

/// A factored matrix.
pub(super) struct Factored {
    factors: Factors,
    condensed: CondensedMatrix,
    /// The parameters of each contact's graphs.
    scales: Vec<[f64; 2]>,
}

/// The factor in use, and its vector of the unknowns of this rank.
struct Elimination {
    factored: Option<Factored>,
    frames: Frames,
    substructures: Substructures,
    values: Vec<f64>,
    /// Half solves since the count of traffic was restarted.
    half_solves: u64,
}

/// The contact nodes of this rank, in the order of vectors of contact nodes, and the motions on which laws act.
struct ContactNodes {
    nodes: Vec<usize>,
    motions: Vec<Motion>,
}

/// Vectors of all nodes, and of contact nodes.
struct Refinement {
    /// The velocity from which the step was started.
    start: DistributedVector,
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
            start: nodes.like()?,
            residual: nodes.like()?,
            correction: nodes.like()?,
            before: contact.like()?,
            change: contact.like()?,
            product: contact.like()?,
        })
    }
}

impl Condensed {
    /// A solver for the contacts of a body, which numbers their unknowns; the matrix is set by [`Condensed::prepare`]. `velocities` has
    /// the layout of those of the body. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        velocities: &DistributedVector,
        settings: &SolverSettings,
        precision: Precision,
    ) -> Result<Self> {
        let contact: Vec<ContactNode<D>> = body.contact_nodes();
        let nodes = ContactNodes::new(&contact);
        body.contacts.iter_mut().for_each(|contact| contact.number_unknowns(|node| nodes.number(node)));
        let like = DistributedVector::ghosted(D, contact.len(), &[])?;
        let mut linear_solver = ProjectedKsp::new("", &like, D)?;
        linear_solver.linear_solver().set_method("cg")?;
        linear_solver.precondition_by_operator()?;
        let mut newton = Newton::new(&like, &body.contacts, linear_solver, settings)?;
        if body.only_surface_acts() {
            newton.flow = Some(Flow::at_nodes(velocities, &like, nodes.nodes.clone())?);
        }
        let frames = Frames::new(session, &body.mesh, &contact)?;
        let start = session.share_start(nodes.motions.len());
        let flowing =
            if body.only_cells_flow() { Some(Box::new(FlowCorrections::new(velocities, settings)?)) } else { None };
        Ok(Self {
            newton,
            elimination: Elimination {
                factored: None,
                substructures: Substructures::new(session, &body.mesh, &frames)?,
                frames,
                values: vec![0.0; body.mesh.owned * D],
                half_solves: 0,
            },
            precision,
            own: start..start + nodes.motions.len(),
            nodes,
            right_hand_side: like.like()?,
            velocity: like.like()?,
            converged: like.like()?,
            refinement: None,
            flowing,
        })
    }

    /// Factors the matrix with these rows on this rank, in the order of elimination in use, and chooses the parameters of contact
    /// graphs; returns whether this succeeded. Stiffness of springs in the rows is subtracted from products with the condensed
    /// matrix. With springs the condensed matrix has too little resistance to rigid motions to choose the parameters; then `matrix`
    /// of the whole body determines them, whose vectors have the layout of `like`. Collective.
    pub(super) fn prepare<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        rows: RowsWithSprings,
        matrix: &Matrix,
        like: &DistributedVector,
    ) -> Result<bool> {
        let RowsWithSprings { mut rows, springs } = rows;
        let Elimination { factored, frames, substructures, .. } = &mut self.elimination;
        frames.rotate_matrix(&mut rows);
        *factored = None;
        let Some(mut factors) = Factors::new(session.world(), substructures, &rows, self.precision)? else {
            return Ok(false);
        };
        self.precision = factors.precision();
        drop(rows);
        let Frames { unknowns, groups, .. } = frames;
        let has_springs = springs.is_some();
        let condensed = CondensedMatrix {
            lower: factors.take_last_factor(),
            positions: factors.positions(unknowns),
            nodes: groups.clone(),
            own: self.own.clone(),
            motions: self.nodes.motions.clone(),
            springs: springs.unwrap_or_default(),
            subspace: Subspace::whole(&self.velocity)?,
            workspace: Workspace::new(session, &self.nodes.motions, unknowns.len())?,
        };
        let scales = if has_springs || body.only_surface_acts() {
            resistances_of_body(session, &body.contacts, like, matrix)?
        } else {
            let (mut motion, mut product) = (self.velocity.like()?, self.velocity.like()?);
            resistances(session, &body.contacts, like, |nodal| {
                self.nodes.restrict::<D>(nodal, &mut motion)?;
                condensed.multiply(&motion, &mut product)?;
                motion.dot(&product)
            })?
        };
        self.newton.scales.clone_from(&scales);
        self.elimination.factored = Some(Factored { factors, condensed, scales });
        Ok(true)
    }

    /// The precision of the factor in use.
    pub(super) fn active_precision(&mut self) -> Result<Precision> {
        Ok(factored_mut(&mut self.elimination.factored)?.factors.precision())
    }

    /// Swaps the factored matrix with another.
    pub(super) fn swap_factored(&mut self, other: &mut Option<Factored>) {
        std::mem::swap(&mut self.elimination.factored, other);
        if let Some(factored) = &self.elimination.factored {
            self.newton.scales.clone_from(&factored.scales);
        }
    }

    /// `x = K^-1 b`. Collective.
    pub(super) fn solve_linear(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<()> {
        self.elimination.forward(right_hand_side)?;
        factored_mut(&mut self.elimination.factored)?.solve_contact();
        self.elimination.backward(solution)
    }

    /// Whether cells flow at the end of a step.
    pub(super) fn flows(&self) -> bool {
        self.flowing.is_some()
    }

    /// Restarts the count of traffic.
    pub(super) fn restart_traffic(&mut self) {
        self.elimination.half_solves = 0;
        self.elimination.factored.iter().for_each(|factored| factored.condensed.restart_traffic());
    }

    /// Least number of bytes that this rank has read since then: the factor for each half solve, its last block for each product;
    /// `None` where cells flow, which is not counted.
    pub(super) fn traffic(&self) -> Option<u64> {
        let Elimination { factored, half_solves, .. } = &self.elimination;
        let bytes =
            |factored: &Factored| half_solves * factored.factors.bytes() + factored.condensed.traffic();
        self.flowing.is_none().then(|| factored.as_ref().map_or(0, bytes))
    }

    /// Solves a step from the velocity in `trial` with a factor in double precision, and writes the new velocity there. `factor_is_own`
    /// states whether the factor is that of the matrix of the step; this is always so without flow. Collective.
    pub(super) fn solve<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        trial: &mut DistributedVector,
        factor_is_own: bool,
    ) -> Result<StepOutcome> {
        if let Some(mut flowing) = self.flowing.take() {
            let outcome = self.solve_flowing(&mut flowing, problem, system, (trial, factor_is_own));
            self.flowing = Some(flowing);
            return outcome;
        }
        let Self { newton, elimination, nodes, right_hand_side, velocity, converged, .. } = self;
        elimination.forward(system.right_hand_side)?;
        nodes.restrict::<D>(system.converged, converged)?;
        nodes.restrict::<D>(trial, velocity)?;
        let factored = factored_mut(&mut elimination.factored)?;
        factored.write_rest(right_hand_side)?;
        let contact = System { matrix: &factored.condensed, right_hand_side, converged, ..system };
        let outcome = newton.solve(problem, contact, velocity)?;
        factored.set_contact(velocity)?;
        elimination.backward(trial)?;
        nodes.prescribe::<D>(velocity, trial)?;
        trial.update_ghosts()?;
        Ok(outcome)
    }

    /// The same with a factor in single precision, by corrections. If these do not converge, it fails, and
    /// [`Condensed::restore_start`] resets `trial`. Collective.
    pub(super) fn refine<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let Self { newton, elimination, nodes, right_hand_side, velocity, converged, .. } = self;
        let refinement = match &mut self.refinement {
            Some(refinement) => refinement,
            none => none.insert(Refinement::new(trial, velocity)?),
        };
        let Refinement { start, residual, correction, before, change, product } = refinement;
        start.copy_from(trial)?;
        nodes.restrict::<D>(system.converged, converged)?;
        system.write_residual(trial, residual)?;
        let (mut sum, mut last) = (StepOutcome::default(), f64::INFINITY);
        for _ in 0..MAX_CORRECTIONS {
            // The contact system.
            nodes.extract_forces::<D>(residual, change)?;
            elimination.forward(residual)?;
            nodes.restrict::<D>(trial, velocity)?;
            before.copy_from(velocity)?;
            let factored = factored_mut(&mut elimination.factored)?;
            factored.write_rest(right_hand_side)?;
            right_hand_side.add_scaled(1.0, change)?;
            factored.condensed.multiply(before, product)?;
            right_hand_side.add_scaled(1.0, product)?;
            let tolerance = CONTACT_SHARE * system.tolerance;
            let matrix = &factored.condensed;
            // Below the floor, a factor in double precision takes its place.
            let floor = Floor::default();
            let contact = System { matrix, right_hand_side, tolerance, floor, converged };
            let outcome = newton.solve(problem, contact, velocity)?;
            sum = StepOutcome {
                newton_iterations: sum.newton_iterations + outcome.newton_iterations,
                linear_iterations: sum.linear_iterations + outcome.linear_iterations,
                indefinite_solves: sum.indefinite_solves + outcome.indefinite_solves,
                fell: sum.fell || outcome.fell,
                ..outcome
            };
            // All velocities.
            right_hand_side.add_scaled(-1.0, product)?;
            change.copy_from(velocity)?;
            change.add_scaled(-1.0, before)?;
            factored.condensed.multiply(change, product)?;
            factored.set_contact(change)?;
            elimination.backward(correction)?;
            trial.add_scaled(1.0, correction)?;
            nodes.prescribe::<D>(velocity, trial)?;
            // The residual `b - K v - C(v)`, with the forces `C(v)` of the last Newton iteration.
            system.write_residual(trial, residual)?;
            change.copy_from(right_hand_side)?;
            change.add_scaled(-1.0, product)?;
            correction.copy_from(residual)?;
            nodes.subtract::<D>(change, correction)?;
            let norm = correction.norm()?;
            if norm <= system.tolerance {
                trial.update_ghosts()?;
                return Ok(StepOutcome { residual: norm, ..sum });
            }
            if norm.is_nan() || norm > LARGEST_REDUCTION * last {
                break;
            }
            last = norm;
        }
        Err(Error::Failed("corrections with a factor in single precision do not converge".into()))
    }

    /// Resets `trial` to the start value of the last step with a factor in single precision.
    pub(super) fn restore_start(&self, trial: &mut DistributedVector) -> Result<()> {
        self.refinement.as_ref().map_or(Ok(()), |refinement| trial.copy_from(&refinement.start))
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

impl ContactNodes {
    fn new<const D: usize>(contact: &[ContactNode<D>]) -> Self {
        let motions = contact.iter().enumerate().flat_map(|(number, contact)| {
            let motion = move |direction: &[f64; D]| Motion { at: number * D, direction: direction.to_vec() };
            contact.frame[..contact.active].iter().map(motion)
        });
        Self { nodes: contact.iter().map(|contact| contact.node).collect(), motions: motions.collect() }
    }

    /// The position of a node in vectors of contact nodes.
    fn number(&self, node: usize) -> usize {
        self.nodes.partition_point(|other| *other < node)
    }

    /// Sets the values of contact nodes, and all others to zero.
    fn extend<const D: usize>(&self, from: &DistributedVector, to: &mut DistributedVector) -> Result<()> {
        let (from, mut to) = (from.owned()?, to.owned_mut()?);
        to.fill(0.0);
        let pairs = from.chunks_exact(D).zip(&self.nodes);
        pairs.for_each(|(from, &node)| to[node * D..][..D].copy_from_slice(from));
        Ok(())
    }

    /// Copies the values of contact nodes.
    fn restrict<const D: usize>(&self, from: &DistributedVector, to: &mut DistributedVector) -> Result<()> {
        let (from, mut to) = (from.owned()?, to.owned_mut()?);
        let pairs = to.chunks_exact_mut(D).zip(&self.nodes);
        pairs.for_each(|(to, &node)| to.copy_from_slice(&from[node * D..][..D]));
        Ok(())
    }

    /// Subtracts values of contact nodes.
    fn subtract<const D: usize>(
        &self,
        values: &DistributedVector,
        from: &mut DistributedVector,
    ) -> Result<()> {
        let (values, mut from) = (values.owned()?, from.owned_mut()?);
        for (&node, value) in self.nodes.iter().zip(values.chunks_exact(D)) {
            from[node * D..][..D].iter_mut().zip(value).for_each(|(from, value)| *from -= value);
        }
        Ok(())
    }

    /// Sets the velocities along the motions on which laws act to those of contact nodes: the solve for all velocities
    /// returns them with rounding errors.
    fn prescribe<const D: usize>(
        &self,
        velocity: &DistributedVector,
        trial: &mut DistributedVector,
    ) -> Result<()> {
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
    fn extract_forces<const D: usize>(
        &self,
        residual: &mut DistributedVector,
        forces: &mut DistributedVector,
    ) -> Result<()> {
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
