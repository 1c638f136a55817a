//! Forces and moments on a body: reactions of supports, contact, loads, damping by the mass, and the rate of momentum, which is their sum.

use super::{
    body::Body,
    coupling::Coupling,
    effect::{ContactAreas, Form, Supports, SurfaceForce},
    pairs::{Pair, is_exchanged, pair_of},
    space::{INDEPENDENT, axis},
    state::State,
};
use crate::{
    error::Result,
    job::Support,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, dot, dual_basis, norm, outside},
    },
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};
use mpi::{collective::SystemOperation, traits::CommunicatorCollectives};

/// The force and the moment of one source on the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resultant<const D: usize> {
    /// Force in N (N/m in the plane); of a body of revolution the sum of the radial forces all around, and the force along the axis.
    pub force: Vector<D>,
    /// Moment about the origin at the initial positions of the nodes in N m; in the plane only the last component, in N. That of forces
    /// on a body of revolution vanishes.
    pub moment: Vector<3>,
}

impl<const D: usize> Resultant<D> {
    /// Number of entries in an array of sums.
    const WIDTH: usize = D + 3;

    /// The moment about a point in N m; in the plane only the last component, in N.
    pub fn moment_about(&self, point: &Vector<D>) -> Vector<3> {
        add_scaled(&self.moment, -1.0, &moment_of(point, &self.force))
    }

    fn read(sums: &[f64]) -> Self {
        Self { force: std::array::from_fn(|i| sums[i]), moment: std::array::from_fn(|i| sums[D + i]) }
    }
}

/// What acts on a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// A support, by its position in the job.
    Support(usize),
    /// A contact with its adhesion and memory, by its position in the job.
    Contact(usize),
    /// What a contact between bodies does to the other body, by its position in the job.
    Against(usize),
    /// A traction, by its position in the job.
    Traction(usize),
    /// All body forces and the weight.
    BodyForce,
    /// Damping by the mass.
    Damping,
    /// Not a force: the rate of momentum and of angular momentum, the sum of all others.
    Momentum,
}

/// The motion at which the forces of the step just committed are balanced, with `(velocity - before) / length` as acceleration. Vectors
/// have ghosts.
#[derive(Debug, Clone, Copy)]
pub struct BalancedMotion<'a> {
    /// Time in s.
    pub time: f64,
    /// Displacement in m.
    pub displacement: &'a DistributedVector,
    /// Velocity in m/s.
    pub velocity: &'a DistributedVector,
    /// Velocity in m/s from which it has changed.
    pub before: &'a DistributedVector,
    /// In s.
    pub length: f64,
}

/// Computes the resultants of all sources after each step.
#[derive(Debug)]
pub struct Resultants<const D: usize> {
    /// The sources, in the order of the rows.
    pub sources: Vec<Source>,
    /// The directions in which supports hold local nodes, by node.
    holds: Vec<Hold<D>>,
    /// For each local node its share of the mass and of the first moments of mass of this rank's cells; empty without inertia.
    masses: Vec<(f64, Vector<D>)>,
    /// The same of the force on a body that moves at 1 m/s, where damping by the mass resists it.
    drags: Vec<(f64, Vector<D>)>,
    /// Resultants of the loads of this rank, once they are known and if they are the same at all times.
    steady: Option<Vec<f64>>,
    surface: Vec<SurfaceForce<D>>,
    /// Values of this rank and of all ranks: resultants of all sources, then areas of all contacts.
    sums: [Vec<f64>; 2],
    /// Largest pressure of each contact.
    largest: Vec<f64>,
}

impl<const D: usize> Resultants<D> {
    /// Prepares the sources of a job with these supports, and requests the forces at them of the body. Collective.
    pub fn new<const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        supports: &[Support],
    ) -> Result<Self, Agreed> {
        let mesh = &body.mesh;
        let holds = holds(session, body, state, supports)?;
        let has_held = |node: &u32| holds.binary_search_by_key(node, |hold| hold.node).is_ok();
        let cell_has_held = |cell: usize| mesh.cell_nodes(cell).any(|node| has_held(&node));
        let runs = body.geometry.runs.iter();
        body.request_support_forces(
            runs.map(|run| (run.first..run.first + run.count).any(cell_has_held)).collect(),
        );
        let mut sources: Vec<Source> = (0..supports.len()).map(Source::Support).collect();
        sources.extend((0..body.contacts.len()).map(Source::Contact));
        sources
            .extend((0..body.contacts.len()).filter(|at| body.contacts[*at].is_paired).map(Source::Against));
        sources.extend((0..body.load.tractions.len()).map(Source::Traction));
        if body.load.has_body_forces() {
            sources.push(Source::BodyForce);
        }
        let (mut masses, mut drags) = (Vec::new(), Vec::new());
        if body.has_drag() {
            sources.push(Source::Damping);
            drags = shares_of_nodes(&mesh.nodes, |x, forces| {
                body.add_drag(0..body.geometry.runs.len(), x, forces)
            });
        }
        if body.has_form(Form::Mass) {
            sources.push(Source::Momentum);
            masses = shares_of_nodes(&mesh.nodes, |x, forces| body.add_form(Form::Mass, x, forces));
        }
        let sums = vec![0.0; sources.len() * Resultant::<D>::WIDTH + body.contacts.len() * AREAS];
        Ok(Self {
            sources,
            holds,
            masses,
            drags,
            steady: None,
            surface: Vec::new(),
            sums: [sums.clone(), sums],
            largest: vec![0.0; body.contacts.len()],
        })
    }

    /// The resultants of the step last updated, with the areas of contacts.
    pub fn rows(&self) -> impl Iterator<Item = (Resultant<D>, Option<ContactAreas>)> {
        let sums = &self.sums[1];
        let (resultants, areas) = sums.split_at(self.sources.len() * Resultant::<D>::WIDTH);
        let of_source = self.sources.iter().zip(resultants.chunks_exact(Resultant::<D>::WIDTH));
        of_source.map(|(source, values)| {
            let areas = if let &Source::Contact(at) = source {
                let [touching, open, sticking, slipping, pressure] =
                    std::array::from_fn(|i| areas[at * AREAS + i]);
                let largest_pressure = self.largest[at];
                Some(ContactAreas { touching, open, sticking, slipping, pressure, largest_pressure })
            } else {
                None
            };
            (Resultant::read(values), areas)
        })
    }

    /// Computes the resultants of the step just committed, given the nodal loads in it. Collective.
    pub fn update<const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        motion: BalancedMotion<'_>,
        load: Option<&DistributedVector>,
    ) -> Result<(), Agreed> {
        session.agree(self.collect(body, state, motion, load))?;
        let [mine, all] = &mut self.sums;
        if !mine.is_empty() {
            session.world().all_reduce_into(&mine[..], &mut all[..], SystemOperation::sum());
        }
        self.largest.iter_mut().for_each(|largest| [*largest] = session.largest([*largest]));
        Ok(())
    }

    /// Writes the sums of this rank.
    fn collect<const S: usize>(
        &mut self,
        body: &Body<D, S>,
        state: &State,
        motion: BalancedMotion<'_>,
        load: Option<&DistributedVector>,
    ) -> Result<()> {
        let Self { sources, holds, masses, drags, steady, surface, sums, largest } = self;
        let mesh = &body.mesh;
        let (resultants, areas) = sums[0].split_at_mut(sources.len() * Resultant::<D>::WIDTH);
        resultants.fill(0.0);
        let mut sums = Sums { sources, holds, mesh, values: resultants };
        let BalancedMotion { time, displacement, velocity, before, length } = motion;
        let (displacement, velocity, before) = (displacement.local()?, velocity.local()?, before.local()?);
        if let Some(load) = load {
            let load = load.owned()?;
            if let Some(steady) = steady {
                sums.values.copy_from_slice(steady);
            } else {
                sums.add_loads(body, time, &load)?;
                if body.load.is_steady() {
                    *steady = Some(sums.values.to_vec());
                }
            }
            sums.react_to_all(&load);
        }
        if !holds.is_empty() {
            let velocities = [&velocity[..], &before[..]];
            body.with_support_forces(velocities, length, |forces| sums.react_to_all(forces));
        }
        if !body.elastic_support.points.is_empty() {
            let lag = if body.is_explicit() { length } else { 0.0 };
            body.elastic_support.forces(&displacement, &velocity, lag, |support, node, force| {
                sums.add_and_react(Source::Support(support), node, &force);
            });
        }
        let seen = body.seen_by_contacts(&velocity);
        for (at, contact) in body.contacts.iter().enumerate() {
            contact.forces(&seen, |node, force| sums.add_both(body, at, (node, &force)));
            let found = contact.areas(&seen);
            areas[at * AREAS..][..AREAS].copy_from_slice(&[
                found.touching,
                found.open,
                found.sticking,
                found.slipping,
                found.pressure,
            ]);
            largest[at] = found.largest_pressure;
        }
        surface.clear();
        body.write_surface_forces(state, surface)?;
        for SurfaceForce { contact, node, force, .. } in surface {
            sums.add_both(body, *contact, (*node, force));
        }
        let at = |node: usize, i: usize| velocity[node * D + i];
        sums.put_all(Source::Damping, drags, |node| std::array::from_fn(|i| at(node, i)));
        sums.put_all(Source::Momentum, masses, |node| {
            std::array::from_fn(|i| (at(node, i) - before[node * D + i]) / length)
        });
        Ok(())
    }
}

/// A direction in which a support holds a node and no support before it does.
#[derive(Debug)]
struct Hold<const D: usize> {
    /// Local number.
    node: u32,
    /// Position in the job.
    support: usize,
    /// Unit vector.
    direction: Vector<D>,
    /// The vector whose product with a force is the part along this direction of what supports take of it.
    dual: Vector<D>,
}

/// The directions in which supports hold local nodes: of each support its own, so that it takes no force in which it does not hold.
/// Collective.
fn holds<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
    supports: &[Support],
) -> Result<Vec<Hold<D>>, Agreed> {
    let Body { mesh, held, .. } = body;
    let mut directions = Vec::new();
    // Forces on the axis of a body of revolution across it are balanced all around.
    let on_axis = (0..mesh.nodes.len()).filter(|node| mesh.is_on_axis(&mesh.nodes[*node]));
    directions.extend(on_axis.map(|node| (node, None, axis(0))));
    for (at, support) in supports.iter().enumerate() {
        let alone = Supports::new(session, mesh, std::slice::from_ref(support), &state.velocity);
        let alone = session.agree(alone)?.held;
        for node in 0..mesh.nodes.len() {
            let (frame, free) = alone.frame(node);
            directions.extend(frame[free..].iter().map(|direction| (node, Some(at), *direction)));
        }
    }
    directions.sort_by_key(|(node, ..)| *node);
    let mut holds = Vec::new();
    for at_node in directions.chunk_by(|a, b| a.0 == b.0) {
        let (mut span, mut independent, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for (node, support, direction) in at_node {
            // Boundaries with one normal where they meet hold along this one.
            let part = add_scaled(direction, -1.0, &held.free_part(*node, direction));
            let length = norm(&part);
            let part = part.map(|x| x / length);
            if let Some(rest) = outside(&part, &span, INDEPENDENT).filter(|_| length > INDEPENDENT) {
                span.push(rest);
                independent.push(part);
                owners.push(support);
            }
        }
        let duals = dual_basis(&independent, 0.0).into_iter().flatten();
        holds.extend(owners.iter().zip(independent).zip(duals).filter_map(|((owner, direction), dual)| {
            Some(Hold { node: at_node[0].0 as u32, support: (**owner)?, direction, dual })
        }));
    }
    Ok(holds)
}

/// For each node its share of a sum that `add` makes of nodal vectors, and of its first moments.
fn shares_of_nodes<const D: usize>(
    nodes: &[Vector<D>],
    mut add: impl FnMut(&[f64], &mut [f64]),
) -> Vec<(f64, Vector<D>)> {
    let components = nodes.len() * D;
    let [mut sum, mut moment] = [vec![0.0; components], vec![0.0; components]];
    add(&vec![1.0; components], &mut sum);
    add(nodes.as_flattened(), &mut moment);
    let shares = sum.chunks_exact(D).zip(moment.chunks_exact(D));
    shares.map(|(sum, moment)| (sum[0], std::array::from_fn(|i| moment[i]))).collect()
}

/// Number of sums of each contact: areas by state and the integral of the pressure.
const AREAS: usize = 5;

/// The resultants of this rank while they are summed.
struct Sums<'a, const D: usize> {
    sources: &'a [Source],
    holds: &'a [Hold<D>],
    mesh: &'a Mesh<D>,
    values: &'a mut [f64],
}

impl<const D: usize> Sums<'_, D> {
    /// Adds a force and a moment.
    fn put(&mut self, source: Source, force: &Vector<D>, moment: &Vector<3>) {
        let Some(at) = self.sources.iter().position(|known| *known == source) else { return };
        let moment = if self.mesh.is_revolved { &[0.0; 3] } else { moment };
        let values = &mut self.values[at * Resultant::<D>::WIDTH..][..Resultant::<D>::WIDTH];
        values.iter_mut().zip(force.iter().chain(moment)).for_each(|(sum, value)| *sum += value);
    }

    /// Adds the sum over all nodes of their shares times nodal vectors, and its moment.
    fn put_all(&mut self, source: Source, shares: &[(f64, Vector<D>)], vector: impl Fn(usize) -> Vector<D>) {
        let (mut force, mut moment) = ([0.0; D], [0.0; 3]);
        for (node, (share, centre)) in shares.iter().enumerate() {
            let vector = vector(node);
            (0..D).for_each(|i| force[i] += share * vector[i]);
            let own = moment_of(centre, &vector);
            (0..3).for_each(|i| moment[i] += own[i]);
        }
        self.put(source, &force, &moment);
    }

    /// Adds a force at a node.
    fn add(&mut self, source: Source, node: u32, force: &Vector<D>) {
        let moment = moment_of(&self.mesh.nodes[node as usize], force);
        self.put(source, force, &moment);
    }

    /// Adds a force at a node, and the reactions of the supports that hold it.
    fn add_and_react(&mut self, source: Source, node: u32, force: &Vector<D>) {
        self.add(source, node, force);
        let first = self.holds.partition_point(|hold| hold.node < node);
        self.holds[first..]
            .iter()
            .take_while(|hold| hold.node == node)
            .for_each(|hold| self.react(hold, force));
    }

    /// The sides of a contact in the job: that of the nodes with the law, and the other one.
    fn sides<const S: usize>(body: &Body<D, S>, contact: usize) -> [Source; 2] {
        let mut sides = [Source::Contact(contact), Source::Against(contact)];
        if is_exchanged(&body.pairs, contact) {
            sides.reverse();
        }
        sides
    }

    /// Adds the force of a contact at a node that faces the bodies of several contacts: the part of each body to the contact with it.
    fn add_to_each<const S: usize>(
        &mut self,
        body: &Body<D, S>,
        (pair, coupling): (&Pair<D>, &Coupling<D>),
        (node, force): (u32, &Vector<D>),
    ) {
        let Some(paired) = pair.node(node as usize) else { return };
        let sides_at = |master: u32| Self::sides(body, pair.contact_with(master));
        let whole: f64 = paired.faced().map(|(_, share)| share).sum();
        for (faced, share) in paired.faced() {
            self.add_and_react(sides_at(*faced)[0], node, &force.map(|f| f * share / whole));
        }
        coupling.opposites(&body.held, node, force, |master, force| {
            let global = self.mesh.global_node(master);
            if !paired.is_beside(global) {
                return self.add_and_react(sides_at(global)[1], master, &force);
            }
            for (faced, share) in paired.faced() {
                self.add_and_react(sides_at(*faced)[0], master, &force.map(|f| f * share / whole));
            }
        });
    }

    /// Adds the force of a contact at a node, with the opposite ones on the body that it may face there, each to the side of the job.
    fn add_both<const S: usize>(
        &mut self,
        body: &Body<D, S>,
        contact: usize,
        (node, force): (u32, &Vector<D>),
    ) {
        let [own, other] = Self::sides(body, contact);
        let coupled = body.coupling.as_ref().zip(pair_of(&body.pairs, contact));
        if let Some((coupling, pair)) = coupled.filter(|(_, pair)| !pair.sharing.is_empty()) {
            return self.add_to_each(body, (pair, coupling), (node, force));
        }
        self.add_and_react(own, node, force);
        if let Some((coupling, pair)) = coupled {
            let paired = pair.node(node as usize);
            let is_own =
                |master: u32| paired.is_some_and(|paired| paired.is_beside(self.mesh.global_node(master)));
            coupling.opposites(&body.held, node, force, |master, force| {
                self.add_and_react(if is_own(master) { own } else { other }, master, &force);
            });
        }
    }

    /// Adds the reactions of all supports to nodal forces, of all local nodes or of the owned ones.
    fn react_to_all(&mut self, forces: &[f64]) {
        for hold in self.holds.iter().take_while(|hold| (hold.node as usize) * D < forces.len()) {
            self.react(hold, &std::array::from_fn(|i| forces[hold.node as usize * D + i]));
        }
    }

    /// Adds the reaction of a support to a force, along a direction in which it holds the node.
    fn react(&mut self, hold: &Hold<D>, force: &Vector<D>) {
        let reaction = -dot(&hold.dual, force);
        self.add(Source::Support(hold.support), hold.node, &hold.direction.map(|x| reaction * x));
    }

    /// Adds the tractions, the reactions that supports have taken over, and as body forces the rest of the nodal loads at owned nodes.
    fn add_loads<const S: usize>(&mut self, body: &Body<D, S>, time: f64, load: &[f64]) -> Result<()> {
        let has_body_forces = body.load.has_body_forces();
        for (at, traction) in body.load.tractions.iter().enumerate() {
            traction.forces(self.mesh, time, |node, force| {
                self.add(Source::Traction(at), node, &force);
                if has_body_forces {
                    self.add(Source::BodyForce, node, &force.map(|f| -f));
                }
            })?;
        }
        body.elastic_support.reaction_forces(|support, node, force| {
            self.add(Source::Support(support), node, &force);
            if has_body_forces {
                self.add(Source::BodyForce, node, &force.map(|f| -f));
            }
        });
        if has_body_forces {
            for (node, force) in load.chunks_exact(D).enumerate() {
                self.add(Source::BodyForce, node as u32, &std::array::from_fn(|i| force[i]));
            }
        }
        Ok(())
    }
}

/// The moment of a force at a point about the origin.
fn moment_of<const D: usize>(point: &Vector<D>, force: &Vector<D>) -> Vector<3> {
    let turn = |i: usize, j: usize| point[i] * force[j] - point[j] * force[i];
    if D == 2 { [0.0, 0.0, turn(0, 1)] } else { [turn(1, 2), turn(2, 0), turn(0, 1)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_about_the_origin() {
        assert_eq!(moment_of(&[2.0, 3.0], &[5.0, 7.0]), [0.0, 0.0, -1.0]);
        assert_eq!(moment_of(&[1.0, 2.0, 3.0], &[4.0, 5.0, 6.5]), [-2.0, 5.5, -3.0]);
        // A force at [3, 1] about [1, 1]: its arm is 2 m.
        let resultant = Resultant { force: [5.0, 7.0], moment: moment_of(&[3.0, 1.0], &[5.0, 7.0]) };
        assert_eq!(resultant.moment_about(&[1.0, 1.0]), [0.0, 0.0, 14.0]);
    }
}
