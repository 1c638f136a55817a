//! Nodes and facets on the sides of several contacts between bodies.

use super::{
    parts::part_of,
    side_words::names_of_sides,
    sides::{Sides, meet, rubs},
};
use crate::{
    error::{Error, Result},
    fem::pairs::{Exchange, Pair, Sharing, pair_of},
    parallel::agreement::Agreed,
};
use std::collections::{BTreeMap, BTreeSet};

/// By what factor a part of the surface is larger than another one but for rounding errors.
const LARGER: f64 = 1.0 + 1e-9;

impl<const D: usize> Sides<'_, D> {
    /// Lets the nodes of facets that are on the slave side of several pairs face the other sides of all of them: each node carries the law of the
    /// pair that has the largest part of what it faces, where the laws allow it.
    pub(super) fn share(&self, pairs: &mut [Pair<D>]) -> Result<(), Agreed> {
        let Self { session, job, .. } = *self;
        for at in 0..pairs.len() {
            if job.contact[pairs[at].contact].against.is_empty() || !pairs[at].sharing.is_empty() {
                continue;
            }
            let mut group = vec![at];
            let mut seen = 0;
            while seen < group.len() {
                for other in at + 1..pairs.len() {
                    let (first, second) = (&pairs[group[seen]], &pairs[other]);
                    let is_apart = !meet(session, &first.on, &second.on);
                    if is_apart || group.contains(&other) || job.contact[second.contact].against.is_empty() {
                        continue;
                    }
                    let [one, two] = [first, second].map(|pair| &job.contact[pair.contact]);
                    let are_same =
                        one.has_the_laws_of(two) && first.exchange.is_some() == second.exchange.is_some();
                    let slide = [first.slides, second.slides];
                    let are_alike = one.is_without_scale()
                        && two.is_without_scale()
                        && one.redistribute_mass == two.redistribute_mass;
                    if are_same || (are_alike && slide == [false; 2]) {
                        group.push(other);
                    } else if slide == [true; 2] {
                        session.agree(Err(self.refusal_of_laws([first, second])))?;
                    }
                }
                seen += 1;
            }
            if group.len() > 1 {
                self.share_side(pairs, &group)?;
            }
        }
        Ok(())
    }

    /// Refuses two pairs that share a slave side and whose laws differ, where bodies slide.
    fn refusal_of_laws(&self, pairs: [&Pair<D>; 2]) -> Error {
        let [own, _] = names_of_sides(self.job, pairs[0]);
        let held = pairs.into_iter().find(|pair| pair.exchange == Some(Exchange::Held));
        let remedy = held.map_or_else(
            || "state the other `side` in both".into(),
            |pair| format!("let no support hold nodes of {}", names_of_sides(self.job, pair)[1]),
        );
        Error::Refused(format!(
            "contact.{} and contact.{}: nodes of {own} carry the laws of both, which differ, so that a node that slides from one body to the \
             other has no law of its own; {remedy}, or give both the same laws",
            pairs[0].contact, pairs[1].contact
        ))
    }

    /// The same for pairs, given by their positions, that have one slave side.
    fn share_side(&self, pairs: &mut [Pair<D>], group: &[usize]) -> Result<(), Agreed> {
        let Self { session, mesh, .. } = *self;
        // Of each node, the position of the pair of which it faces the largest part.
        let mut most: BTreeMap<u32, (usize, f64)> = BTreeMap::new();
        for &at in group {
            for node in pairs[at].nodes.iter().filter(|node| !node.masters.is_empty()) {
                let kept = most.entry(mesh.global_node(node.node)).or_insert((at, node.weight));
                // Halves of what a node faces differ by rounding errors.
                if node.weight > LARGER * kept.1 {
                    *kept = (at, node.weight);
                }
            }
        }
        let (mut sharing, mut carrying) = (Vec::new(), Vec::new());
        for &at in group {
            let Pair { contact, on, against, .. } = pairs[at].clone();
            let others = mesh.named(session, mesh.nodes_of_facets(&against))?;
            sharing.push(Sharing { contact, on, against, others, faced: BTreeSet::new() });
            let of_pair = most.iter().filter(|(_, (of, _))| *of == at);
            carrying.push(of_pair.map(|(node, _)| *node).collect::<BTreeSet<u32>>());
        }
        let of_all = |facets: fn(&Sharing) -> &Vec<u32>| -> Vec<u32> {
            sharing.iter().flat_map(facets).copied().collect::<BTreeSet<u32>>().into_iter().collect()
        };
        let (on, against) = (of_all(|sharing| &sharing.on), of_all(|sharing| &sharing.against));
        let own = mesh.named(session, mesh.nodes_of_facets(&on))?;
        let lawless: BTreeSet<u32> = group.iter().flat_map(|at| pairs[*at].lawless.clone()).collect();
        for (place, &at) in group.iter().enumerate() {
            let pair = &mut pairs[at];
            // Nodes that face nothing carry the law of the first pair.
            let others = carrying.iter().enumerate().filter(|(other, _)| *other != place);
            pair.of_others = match place {
                0 => others.flat_map(|(_, nodes)| nodes).copied().collect(),
                _ => &own - &carrying[place],
            };
            pair.lawless.clone_from(&lawless);
            pair.sharing.clone_from(&sharing);
            pair.on.clone_from(&on);
            pair.against.clone_from(&against);
            pair.leave(session, mesh, [])?;
        }
        Ok(())
    }

    /// Lets nodes of pairs whose law would act there, and that belong to other contacts, too, leave their part of the surface to neighbours,
    /// where the law allows it.
    pub(super) fn leave_shared_nodes(&self, pairs: &mut [Pair<D>]) -> Result<(), Agreed> {
        let Self { session, job, mesh, .. } = *self;
        let (mut slaves, mut both) = (Vec::new(), Vec::new());
        for pair in &*pairs {
            let own = pair.carrying(mesh);
            both.push(&own | &pair.faced(session, mesh)?);
            slaves.push(own);
        }
        let mut of_obstacles = Vec::new();
        for (number, contact) in job.contact.iter().enumerate() {
            if pair_of(pairs, number).is_none() {
                let on = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
                of_obstacles.extend(mesh.nodes_of_facets(&on));
            }
        }
        let of_obstacles = mesh.named(session, of_obstacles)?;
        for at in 0..pairs.len() {
            let contact = &job.contact[pairs[at].contact];
            if contact.against.is_empty() || !contact.is_without_scale() {
                continue;
            }
            let is_together = |other: usize| other == at || pairs[at].shares_with(&pairs[other]);
            let (own, others): (Vec<usize>, Vec<usize>) =
                (0..pairs.len()).partition(|other| is_together(*other));
            let is_shared = |node: &u32| {
                of_obstacles.contains(node) || others.iter().any(|other| both[*other].contains(node))
            };
            let shared: Vec<u32> =
                own.iter().flat_map(|own| &slaves[*own]).copied().filter(is_shared).collect();
            let pair = &mut pairs[at];
            if session.total(pair.lawless.len() + shared.len()) == 0 {
                continue;
            }
            pair.leave(session, mesh, shared)?;
            if !pair.sharing.is_empty() || session.total(pair.nodes.len()) > 0 {
                continue;
            }
            if let Some(mut other) = self.exchanged(pair, Exchange::Shared)? {
                other.leave(session, mesh, other.carrying(mesh).into_iter().filter(is_shared))?;
                *pair = other;
            }
            session.agree(if session.total(pair.nodes.len()) > 0 {
                Ok(())
            } else {
                Err(Error::Refused(format!(
                    "contact.{}: all nodes of the boundary {} belong to other contacts, too, so that none is left for the law; refine the mesh \
                     there",
                    pair.contact,
                    names_of_sides(job, pair)[0]
                )))
            })?;
        }
        Ok(())
    }

    /// Lets nodes with friction that supports hold along directions which are inclined to the boundary, as some of the nodes that they face,
    /// leave their part of the surface to neighbours, where the law allows it and each facet keeps a node with the law: a sliding of the
    /// bodies along the boundary need not be a motion of such a node.
    pub(super) fn leave_inclined_nodes(&self, pairs: &mut [Pair<D>]) -> Result<(), Agreed> {
        let Self { session, job, mesh, .. } = *self;
        for pair in pairs.iter_mut().filter(|pair| pair.sharing.is_empty()) {
            let contact = &job.contact[pair.contact];
            if contact.against.is_empty() || !rubs(contact) || !contact.is_without_scale() {
                continue;
            }
            let inclined = self.inclined(pair)?;
            let carrying = pair.carrying(mesh);
            let answer = |node: u32| {
                let is_inclined = f64::from(u8::from(inclined.contains(&node)));
                if carrying.contains(&node) { vec![is_inclined] } else { Vec::new() }
            };
            let answers = mesh.ask_owners(session, mesh.nodes_of_facets(&pair.on), answer)?;
            let mut kept = Vec::new();
            for facet in &pair.on {
                let nodes: Vec<u32> =
                    mesh.nodes_of_facets([facet]).filter(|node| !answers[node].is_empty()).collect();
                if nodes.iter().all(|node| answers[node] == [1.0]) {
                    kept.extend(nodes);
                }
            }
            let left = &inclined - &mesh.named(session, kept)?;
            if session.total(left.len()) > 0 {
                pair.leave(session, mesh, left)?;
            }
        }
        Ok(())
    }
}
