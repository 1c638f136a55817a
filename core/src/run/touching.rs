//! The warning of bodies that touch or overlap and pass through each other, because there is no contact between them.

use crate::{
    job::{Contact, Job},
    mesh::{Meeting, Mesh, other_side, surface::Bodies},
    parallel::{agreement::Agreed, exchange::gather, session::Session},
};
use std::collections::{BTreeMap, BTreeSet};

/// Stands for the boundary of a facet that belongs to none.
const UNNAMED: u32 = u32::MAX;
/// Pairs of bodies that the warning names at most.
const MOST_PAIRS: usize = 3;

/// The boundaries of two bodies at which they meet.
type Names = [BTreeSet<u32>; 2];

/// The warning, if there are such bodies. Collective, the same on all ranks.
pub(super) fn warning<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
) -> Result<Option<String>, Agreed> {
    let pairs = unconnected(session, job, mesh)?;
    let Some(first) = pairs.values().next() else { return Ok(None) };
    let listed = |names: &BTreeSet<u32>| -> Vec<&str> {
        names.iter().map(|name| mesh.boundaries[*name as usize].name.as_str()).collect()
    };
    let words = |(bodies, names): (&[u32; 2], &Names)| {
        let of = |at: usize| match listed(&names[at]) {
            names if names.is_empty() => format!("body {}", bodies[at] + 1),
            names => names.join(", "),
        };
        format!("{} and {}", of(0), of(1))
    };
    let shown: Vec<String> = pairs.iter().take(MOST_PAIRS).map(words).collect();
    let more = match pairs.len() - shown.len() {
        0 => String::new(),
        more => format!("; {more} more pairs"),
    };
    let quoted = |names: &BTreeSet<u32>| match listed(names) {
        names if names.is_empty() => "...".into(),
        names => format!("\"{}\"", names.join("\", \"")),
    };
    Ok(Some(format!(
        "mesh: bodies touch or overlap, and pass through each other, because no contact is between them: {}{more}; add [[contact]] with \
         on = [{}] and against = [{}]; a body of layers is one block whose properties depend on the place, or a mesh whose parts share nodes; to \
         bodies that have no effect on each other give a distance",
        shown.join("; "),
        quoted(&first[0]),
        quoted(&first[1])
    )))
}

/// The pairs of bodies that meet without a contact between them, with the boundaries where they do. Collective, the same on all ranks.
fn unconnected<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
) -> Result<BTreeMap<[u32; 2], Names>, Agreed> {
    let Some((meetings, bodies)) = mesh.meetings(session)? else { return Ok(BTreeMap::new()) };
    let contacts = Contacts::of(session, job, (mesh, &bodies))?;
    let mut apart: Vec<[u32; 4]> = Vec::new();
    for meeting in meetings.iter().filter(|meeting| !contacts.connect(meeting)) {
        let [a, b] = meeting.bodies;
        let [one, other] =
            meeting.boundaries.each_ref().map(|names| names.first().map_or(UNNAMED, |name| *name));
        apart.push(if a < b { [a, b, one, other] } else { [b, a, other, one] });
    }
    apart.sort_unstable();
    apart.dedup();
    let mut pairs: BTreeMap<[u32; 2], Names> = BTreeMap::new();
    for [a, b, names @ ..] in gather(session.world(), apart.as_flattened())?.as_chunks::<4>().0 {
        let sides = pairs.entry([*a, *b]).or_default();
        sides.iter_mut().zip(names).filter(|(_, name)| **name != UNNAMED).for_each(|(side, name)| {
            side.insert(*name);
        });
    }
    // A name of both bodies tells nothing.
    for sides in pairs.values_mut() {
        let of_both = &sides[0] & &sides[1];
        sides.iter_mut().for_each(|side| side.retain(|name| !of_both.contains(name)));
    }
    Ok(pairs)
}

/// What the contacts of a job connect.
struct Contacts {
    /// The boundaries of both sides of each, by their places in the mesh.
    sides: Vec<Names>,
    /// The bodies of all ranks on these sides.
    bodies: Vec<Names>,
}

impl Contacts {
    /// Collective.
    fn of<const D: usize>(
        session: &Session,
        job: &Job,
        (mesh, bodies): (&Mesh<D>, &Bodies),
    ) -> Result<Self, Agreed> {
        let number = |name: &String| {
            let name = &mesh.boundary(name)?.name;
            Some(mesh.boundaries.iter().position(|boundary| boundary.name == *name)? as u32)
        };
        let sides = |contact: &Contact| {
            let across = contact.on.iter().map(|name| other_side(name));
            let against = if contact.against.is_empty() { across.collect() } else { contact.against.clone() };
            [&contact.on, &against].map(|names| names.iter().filter_map(number).collect())
        };
        let sides: Vec<Names> = job.contact.iter().map(sides).collect();
        let mut records: BTreeSet<[u32; 2]> = BTreeSet::new();
        for (number, boundaries) in (0..).zip(sides.as_flattened()) {
            let facets = boundaries.iter().flat_map(|name| &mesh.boundaries[*name as usize].facets);
            records.extend(
                facets.map(|&facet| [number, bodies.of_cell[mesh.facet_cells[facet as usize] as usize]]),
            );
        }
        let records: Vec<[u32; 2]> = records.into_iter().collect();
        let mut bodies = vec![Names::default(); sides.len()];
        for [number, body] in gather(session.world(), records.as_flattened())?.as_chunks().0 {
            bodies.as_flattened_mut()[*number as usize].insert(*body);
        }
        Ok(Self { sides, bodies })
    }

    /// Whether a contact acts where these bodies meet: between the boundaries of facets that lie on each other; where a facet lies inside
    /// another body, between any boundaries of the bodies.
    fn connect(&self, meeting: &Meeting) -> bool {
        let connects = |[one, other]: [&BTreeSet<u32>; 2]| {
            let [own, faced] = &meeting.boundaries;
            if meeting.is_inside {
                one.contains(&meeting.bodies[0]) && other.contains(&meeting.bodies[1])
            } else {
                own.iter().any(|name| one.contains(name)) && faced.iter().any(|name| other.contains(name))
            }
        };
        let sides = if meeting.is_inside { &self.bodies } else { &self.sides };
        sides.iter().any(|[on, against]| connects([on, against]) || connects([against, on]))
    }
}
