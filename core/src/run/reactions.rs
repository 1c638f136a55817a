//! The reactions that elastic supports of a stage take over from supports of the stage before.

use super::{build::given_resistances, parts::part_of};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{ELASTIC, Form, Step, Supports},
        space::{Held, SurfacePoint, facets, surface_points},
        state::State,
    },
    job::Support,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, dot, larger, norm},
    },
    mesh::{Mesh, other_side},
    parallel::session::Session,
};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// Unbalanced or released forces, as a share of all forces or of the loads, above which a warning is given.
const OUT_OF_BALANCE: f64 = 1e-3;
/// Errors of forces as a share of those of the cells that cancel.
const ROUNDING: f64 = 1e-9;
/// Inertia of a moving body over the share of its velocity in that of a free oscillation.
const MOVING: f64 = 3.0;

/// What became of the forces of supports and contacts of the stage before, in N: sums of magnitudes over the nodes.
pub(super) struct Handover {
    /// Taken over.
    taken: f64,
    /// Of supports and contacts that nothing replaces.
    released: f64,
    /// Of all loads at the start.
    loads: f64,
}

impl Handover {
    /// The end of a line of the log.
    pub(super) fn words(&self) -> String {
        if self.taken == 0.0 {
            return String::new();
        }
        format!("; supports take over reactions of {:.4e} N", self.taken)
    }

    /// A warning if the start state is out of balance.
    pub(super) fn warning(&self) -> Option<String> {
        let Self { released, loads, .. } = *self;
        let share = released / loads;
        let is_balanced = released == 0.0 || share <= OUT_OF_BALANCE;
        let of_loads = if loads > 0.0 {
            format!(", {:.1} % of the loads at its start", 100.0 * share)
        } else {
            String::new()
        };
        (!is_balanced).then(|| {
            format!(
                "initial.from: the start state is out of balance: the job has none of the supports or contacts that exerted nodal forces of \
                 {released:.3e} N in total{of_loads}, and the body will move; keep them, replace supports by ones with `stiffness`, \
                 `damping` or `absorbing`, which take over the reaction, or apply the forces as tractions"
            )
        })
    }
}

/// The forces of a start state, in N: sums of magnitudes over the nodes.
struct Balance {
    /// What internal forces, loads, contacts and supports leave over, beyond the inertia of the last step if that is less.
    open: f64,
    /// The largest of the sums of loads, reactions of supports and contact forces.
    forces: f64,
    /// What remains open in a body in motion, changes of its inertia and of its internal forces in a step, and by rounding.
    moving: f64,
}

impl Balance {
    /// A warning if the state is out of balance and does not move accordingly.
    fn warning(&self, has_inertia: bool) -> Option<String> {
        let Self { open, forces, moving } = *self;
        let is_balanced = open <= OUT_OF_BALANCE * forces + moving;
        let of_forces = if forces > 0.0 {
            format!(", {:.1} % of the forces", 100.0 * open / forces)
        } else {
            String::new()
        };
        let happens = if has_inertia { "it starts to oscillate" } else { "it jumps in the first step" };
        (!is_balanced).then(|| {
            format!(
                "initial.from: the start state is out of balance: internal forces, loads and reactions leave over nodal forces of \
                 {open:.3e} N in total{of_forces}, so that the body does not remain as it was: {happens}; if that is not intended, start with \
                 the loads, supports, materials and `redistribute_mass` of the job that wrote the state and change loads gradually (`t` in \
                 their expressions), or let that job come to rest"
            )
        })
    }
}

/// The warning about a start state that is out of balance with the loads, supports, contacts and materials of its new body, given the
/// acceleration in m/s^2 with which it was reached and the length of a step in s. Collective.
pub(super) fn imbalance<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
    (acceleration, length): (&DistributedVector, f64),
) -> Result<Option<String>> {
    let sum_of = |values: &[f64], part: &dyn Fn(usize, &Vector<D>) -> Vector<D>| -> f64 {
        let (nodes, _) = values.as_chunks::<D>();
        nodes.iter().enumerate().map(|(node, force)| norm(&part(node, force))).sum()
    };
    let sum = |field: &DistributedVector, part: &dyn Fn(usize, &Vector<D>) -> Vector<D>| -> Result<f64> {
        Ok(sum_of(&field.owned()?, part))
    };
    let of_form = |form: Form, of: &dyn Fn(usize) -> f64| -> Result<DistributedVector> {
        let mut forces = session.agree(state.velocity.like())?;
        let add = |forces: &mut DistributedVector| {
            let mut values = forces.local_mut()?;
            values.fill(0.0);
            if body.has_form(form) {
                let field: Vec<f64> = (0..values.len()).map(of).collect();
                body.add_form(form, &field, &mut values);
            }
            Ok::<_, Error>(())
        };
        session.agree(add(&mut forces))?;
        session.agree(forces.add_ghosts_to_owners())?;
        Ok(forces)
    };
    let local = |field: &DistributedVector| Ok::<_, Error>(field.local()?.to_vec());
    let velocity = session.agree(local(&state.velocity))?;
    let displacement = session.agree(local(&state.displacement))?;
    let mut open = residual(session, body, state)?;
    session.agree(open.add_scaled(-1.0, &of_form(Form::Viscosity, &|at| velocity[at])?))?;
    let mut viscous = session.agree(state.velocity.like())?;
    let add = |forces: &mut DistributedVector| body.add_forces_of_formulas(state, &mut forces.local_mut()?);
    session.agree(add(&mut viscous))?;
    session.agree(viscous.add_ghosts_to_owners())?;
    session.agree(open.add_scaled(1.0, &viscous))?;
    let change = of_form(Form::Elasticity, &|at| length * velocity[at])?;
    let mass = of_form(Form::Mass, &|at| velocity[at])?;
    let acceleration = session.agree(local(acceleration))?;
    let mut beyond_inertia = of_form(Form::Mass, &|at| -acceleration[at])?;
    session.agree(beyond_inertia.add_scaled(1.0, &open))?;
    // The size of the forces of the cells, which cancel where the body is not strained.
    let cells = of_form(Form::Elasticity, &|at| {
        displacement[at].abs() * if (at / D).is_multiple_of(2) { 1.0 } else { -1.0 }
    })?;
    let mut loads = session.agree(state.velocity.like())?;
    session.agree(body.write_loads(0.0, &mut loads))?;
    let whole = |_: usize, force: &Vector<D>| *force;
    let free = |node: usize, force: &Vector<D>| body.held.free_part(node, force);
    let held = |node: usize, force: &Vector<D>| add_scaled(force, -1.0, &body.held.free_part(node, force));
    let left_over = |field: &DistributedVector| -> Result<f64> {
        let mut forces = field.owned()?.to_vec();
        bear(body, &displacement, &mut forces);
        Ok(sum_of(&forces, &free))
    };
    let sums = [
        left_over(&open),
        left_over(&beyond_inertia),
        sum(&loads, &whole),
        sum(&open, &held),
        sum(&change, &free),
        sum(&cells, &whole),
    ];
    let sums = sums.into_iter().collect::<Result<Vec<f64>>>();
    // Twice the kinetic energy, and the stored energy.
    let energies = || -> Result<[f64; 2]> {
        let mass = mass.owned()?;
        let kinetic = mass.iter().zip(velocity.iter()).map(|(m, v)| m * v).sum();
        let rest = Step { time: state.time, ..Step::default() };
        Ok([kinetic, body.energy(state, rest)?.0[ELASTIC]])
    };
    let (sums, [kinetic, stored]) = (session.agree(sums)?, session.agree(energies())?);
    let [open, beyond, loads, reactions, change, cells, kinetic, stored] =
        session.sum([sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], kinetic, stored]);
    let forces = larger(larger(loads, reactions), open);
    let open = if beyond < open { beyond } else { open };
    // Of a body that oscillates, inertia is a share of the forces as its velocity is of the largest one.
    let share = if kinetic > 0.0 { (kinetic / (kinetic + stored)).sqrt() } else { 0.0 };
    let moving = change + MOVING * share * forces + ROUNDING * cells;
    Ok(Balance { open, forces, moving }.warning(body.has_form(Form::Mass)))
}

/// Takes from nodal forces on the body, at its owned nodes, what obstacles bear that it touches at the start, in the directions that
/// supports leave free; displacements have ghosts.
fn bear<const D: usize, const S: usize>(body: &Body<D, S>, displacement: &[f64], forces: &mut [f64]) {
    for (node, force) in forces.chunks_exact_mut(D).enumerate() {
        let free = body.held.free_part(node, &std::array::from_fn(|i| force[i]));
        force.copy_from_slice(&free);
    }
    let seen = body.seen_by_contacts(displacement);
    body.contacts.iter().for_each(|contact| contact.bear(0.0, &seen, forces));
}

/// Lets elastic supports take over the forces at the start state of what the job with the keys `earlier` had in their place: the
/// reaction of what it held, the forces of its springs beyond those of the own ones, and reactions that it had taken over itself. `body`
/// has the latter. Collective.
pub(super) fn take_over<const D: usize, const S: usize>(
    session: &Session,
    earlier: &BTreeMap<String, String>,
    body: &mut Body<D, S>,
    state: &State,
) -> Result<Handover> {
    let carried = std::mem::take(&mut body.elastic_support.reactions);
    body.elastic_support.has_reactions = false;
    let [supports, contacts] =
        ["support", "contact"].map(|table| session.agree(boundaries_of(earlier, table)));
    let (supports, contacts) = (supports?, contacts?);
    let before = Supports::new(session, &body.mesh, &supports, &state.velocity);
    let before = session.agree(before)?.held;
    let springs = session.agree(given_resistances(session, &supports, &body.mesh, &before))?;
    let against = session.agree(faced_before(earlier))?;
    let lost = lost_contact(session, (&contacts, &against), body)?;
    let residual = residual(session, body, state)?;
    let mut loads = session.agree(state.velocity.like())?;
    session.agree(body.write_loads(0.0, &mut loads))?;
    let (residual, loads) = (session.agree(residual.owned())?, session.agree(loads.owned())?);

    let displacement = session.agree(state.displacement.local())?;
    let mut change = vec![0.0; displacement.len()];
    springs.add_start_forces(&displacement, &mut change);
    change.iter_mut().for_each(|force| *force = -*force);
    body.elastic_support.add_start_forces(&displacement, &mut change);

    let gives_way: BTreeSet<u32> = body.elastic_support.points.iter().map(|at| at.point.node).collect();
    let held = &body.held;
    let mut reactions = vec![0.0; body.mesh.owned * D];
    let (mut taken, mut dropped, mut is_changed) = (0.0, reactions.clone(), false);
    for (node, reaction) in reactions.chunks_exact_mut(D).enumerate() {
        let at = |values: &[f64]| -> Vector<D> { std::array::from_fn(|i| values[node * D + i]) };
        let free = held.free_part(node, &at(&residual));
        let is_lost = lost.contains(&(node as u32));
        let held_before =
            if is_lost { free } else { add_scaled(&free, -1.0, &before.free_part(node, &free)) };
        let mut force = held.free_part(node, &held_before).map(|x| -x);
        if !is_lost {
            let springs = before.free_part(node, &at(&change));
            force = add_scaled(&force, -1.0, &held.free_part(node, &springs));
        }
        if !carried.is_empty() {
            force = add_scaled(&force, 1.0, &held.free_part(node, &at(&carried)));
        }
        if gives_way.contains(&(node as u32)) {
            is_changed |= is_lost || before.free_count(node) < held.free_count(node) || norm(&force) > 0.0;
            reaction.copy_from_slice(&force);
            taken += norm(&force);
        } else {
            dropped[node * D..][..D].copy_from_slice(&force.map(|x| -x));
        }
    }
    bear(body, &displacement, &mut dropped);
    let released: f64 = dropped.as_chunks::<D>().0.iter().map(norm).sum();
    let size = loads.chunks_exact(D).map(|load| load.iter().map(|x| x * x).sum::<f64>().sqrt()).sum::<f64>();
    let [taken, released, loads] = session.sum([taken, released, size]);
    if session.total(usize::from(is_changed)) > 0 {
        body.elastic_support.reactions = reactions;
        body.elastic_support.has_reactions = true;
    }
    Ok(Handover { taken, released, loads })
}

/// The directions along which supports of the job with the keys `earlier` moved nodes. Collective.
pub(super) fn moved_before<const D: usize>(
    session: &Session,
    earlier: &BTreeMap<String, String>,
    mesh: &Mesh<D>,
    layout: &DistributedVector,
) -> Result<Held<D>> {
    let supports = session.agree(boundaries_of(earlier, "support"))?;
    let moves = |number: &usize| {
        let is_motion = |key: &String| {
            let of_support = key.strip_prefix(&format!("support.{number}."));
            of_support.is_some_and(|key| key.starts_with("displacement") || key.starts_with("velocity"))
        };
        earlier.keys().any(is_motion)
    };
    let moved = supports.into_iter().enumerate().filter(|(number, _)| moves(number));
    let moved: Vec<Support> = moved.map(|(_, support)| support).collect();
    Ok(Supports::new(session, mesh, &moved, layout)?.held)
}

/// The nodal forces at the start state on owned nodes, zero in directions that are free in a balance without motion. Collective.
fn residual<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
) -> Result<DistributedVector> {
    let mut forces = session.agree(state.velocity.like())?;
    let add = |forces: &mut DistributedVector| {
        let mut values = forces.local_mut()?;
        values.fill(0.0);
        body.add_forces_at_rest(state, &mut values)?;
        if let Some(traction) = &state.contact_traction {
            let traction = traction.owned()?;
            for node in body.pairs.iter().flat_map(|pair| &pair.nodes) {
                let of_node = std::array::from_fn(|i| traction[node.node as usize * D + i]);
                let force = node.whole_traction(&body.held, &of_node).map(|value| -node.weight * value);
                body.add_contact_force((node.node, &force), &mut values);
            }
        }
        let rest = vec![0.0; values.len()];
        for contact in body.contacts.iter().filter(|contact| contact.normal.needs_ghosts) {
            contact.forces(&rest, |node, force| {
                let sums = &mut values[node as usize * D..][..D];
                sums.iter_mut().zip(force).for_each(|(sum, force)| *sum += force);
            });
        }
        Ok::<_, Error>(())
    };
    session.agree(add(&mut forces))?;
    session.agree(forces.add_ghosts_to_owners())?;
    let mut loads = session.agree(state.velocity.like())?;
    session.agree(body.write_loads(0.0, &mut loads))?;
    session.agree(forces.add_scaled(1.0, &loads))?;
    let mut of_node: BTreeMap<u32, Vec<SurfacePoint<D>>> = BTreeMap::new();
    let nodal = body.contacts.iter().filter(|contact| !contact.normal.needs_ghosts && !contact.is_paired);
    for contact in nodal {
        for point in contact.normal.boundary().surface_points() {
            of_node.entry(point.node).or_default().push(point);
        }
    }
    let add_tractions = |forces: &mut DistributedVector| {
        let Some(traction) = &state.contact_traction else { return Ok(()) };
        let (traction, mut values) = (traction.owned()?, forces.owned_mut()?);
        for points in of_node.values() {
            for point in points {
                // On an edge each face has the part of the sum along its normal.
                let sum = point.value(&traction);
                let along = dot(&sum, &point.normal);
                let own = if points.len() == 1 { sum } else { point.normal.map(|n| n * along) };
                point.add(-point.weight, &own, &mut values);
            }
        }
        Ok::<_, Error>(())
    };
    session.agree(add_tractions(&mut forces))?;
    Ok(forces)
}

/// The owned nodes of contacts of the stage before, given with the boundaries that they were against, where this body has no contact.
/// Collective.
fn lost_contact<const D: usize, const S: usize>(
    session: &Session,
    (contacts, against): (&[Support], &[String]),
    body: &Body<D, S>,
) -> Result<BTreeSet<u32>> {
    let nodes_of = |facets: &[u32]| -> Result<BTreeSet<u32>> {
        let points = session.agree(surface_points(session, &body.mesh, facets))?;
        Ok(points.into_iter().map(|point: SurfacePoint<D>| point.node).collect())
    };
    let mut nodes = BTreeSet::new();
    for contact in contacts {
        let facets = part_of(session, &body.mesh, ("contact", &contact.on), contact.part.as_ref())?;
        nodes.extend(nodes_of(&facets)?);
    }
    nodes.extend(nodes_of(&facets(&body.mesh, against))?);
    let own = body.contacts.iter().map(|contact| &*contact.facets);
    for facets in own.chain(body.pairs.iter().map(|pair| &pair.against[..])) {
        for node in nodes_of(facets)? {
            nodes.remove(&node);
        }
    }
    Ok(nodes)
}

/// The boundaries that contacts of a job with these keys are against; of a fault its other side.
fn faced_before(keys: &BTreeMap<String, String>) -> Result<Vec<String>> {
    #[derive(Deserialize)]
    struct Names {
        names: Vec<String>,
    }
    let names = |text: &String| -> Result<Vec<String>> {
        let found: Names = toml::from_str(&format!("names = {text}")).map_err(|error| {
            Error::Refused(format!(
                "initial.from: the boundaries of a contact of the job that wrote the state can't be read ({error}); write the state again \
                 with this version"
            ))
        })?;
        Ok(found.names)
    };
    let mut all = Vec::new();
    for number in (0..).take_while(|number| keys.contains_key(&format!("contact.{number}.on"))) {
        let of = |key: &str| keys.get(&format!("contact.{number}.{key}")).map_or(Ok(Vec::new()), names);
        let (on, against) = (of("on")?, of("against")?);
        all.extend(if against.is_empty() {
            on.iter().map(|name| other_side(name)).collect()
        } else {
            against
        });
    }
    Ok(all)
}

/// The boundaries of the tables of this name in a job with these keys, with what supports hold and their springs.
fn boundaries_of(keys: &BTreeMap<String, String>, table: &str) -> Result<Vec<Support>> {
    let has_table = |number: &usize| keys.contains_key(&format!("{table}.{number}.on"));
    let read = |number: usize| {
        let kept = ["on", "where", "fix", "stiffness.normal", "stiffness.tangential"];
        let line = |key: &str| Some(format!("{key} = {}\n", keys.get(&format!("{table}.{number}.{key}"))?));
        let text: String = kept.into_iter().filter_map(line).collect();
        toml::from_str(&text).map_err(|error| {
            Error::Refused(format!(
                "initial.from: {table}.{number} of the job that wrote the state can't be read ({error}); write the state again with \
                 this version"
            ))
        })
    };
    (0..).take_while(has_table).map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Fix, FixedDirections};

    #[test]
    fn supports_of_another_job_are_read_from_its_keys() {
        let keys = [
            ("support.0.on", r#"["left", "right"]"#),
            ("support.0.fix", r#""normal""#),
            ("support.0.displacement.0.table", r#""motion.csv""#),
            ("support.1.on", r#"["top"]"#),
            ("support.1.where", r#""x < 1""#),
            ("support.1.stiffness.normal", "2e6"),
            ("support.1.stiffness.tangential", "0.0"),
            ("traction.0.on", r#"["bottom"]"#),
        ];
        let keys = keys.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        let found = boundaries_of(&keys, "support").expect("supports");
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].on, ["left", "right"]);
        assert_eq!(found[0].fix, Some(Fix::Keyword(FixedDirections::Normal)));
        assert!(found[1].part.is_some());
        assert_eq!(found[1].stiffness.map(|s| [s.normal, s.tangential]), Some([2e6, 0.0]));
        assert!(boundaries_of(&keys, "contact").expect("none").is_empty());
    }

    #[test]
    fn released_forces_are_compared_with_the_loads() {
        let of = |released, loads| Handover { taken: 0.0, released, loads }.warning();
        assert!(of(0.0, 0.0).is_none() && of(1e-4, 1.0).is_none());
        assert!(of(0.05, 1.0).is_some_and(|words| words.contains("5.0 % of the loads")));
        assert!(of(1.0, 0.0).is_some() && of(f64::NAN, 1.0).is_some());
    }
}
