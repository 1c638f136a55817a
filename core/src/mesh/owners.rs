//! What ranks tell the owners of nodes, and ask them: no rank holds what belongs to the nodes of all.

use super::Mesh;
use crate::parallel::{
    agreement::Agreed,
    exchange::{exchange, exchange_lists},
    session::Session,
};
use std::collections::{BTreeMap, BTreeSet};

impl<const D: usize> Mesh<D> {
    /// What all ranks tell about nodes, by their global numbers, at the owners of these: in the order of the ranks. Collective.
    pub fn tell_owners<const N: usize>(
        &self,
        session: &Session,
        told: impl IntoIterator<Item = (u32, [f64; N])>,
    ) -> Result<Vec<(u32, [f64; N])>, Agreed> {
        let (mut nodes, mut values) = (vec![Vec::new(); session.ranks()], vec![Vec::new(); session.ranks()]);
        for (node, of_node) in told {
            let owner = self.owner(node);
            nodes[owner].push(node);
            values[owner].extend(of_node);
        }
        let nodes = exchange_lists(session.world(), &nodes)?;
        let values = if N > 0 { exchange_lists(session.world(), &values)? } else { Vec::new() };
        let value = |at: usize| std::array::from_fn(|i| values[at * N + i]);
        Ok(nodes.into_iter().enumerate().map(|(at, node)| (node, value(at))).collect())
    }

    /// The nodes owned here that any rank names, all by global numbers. Collective.
    pub fn named(
        &self,
        session: &Session,
        nodes: impl IntoIterator<Item = u32>,
    ) -> Result<BTreeSet<u32>, Agreed> {
        let nodes: BTreeSet<u32> = nodes.into_iter().collect();
        let named = self.tell_owners(session, nodes.into_iter().map(|node| (node, [])))?;
        Ok(named.into_iter().map(|(node, [])| node).collect())
    }

    /// What their owners answer about these nodes, by global numbers. Collective.
    pub fn ask_owners(
        &self,
        session: &Session,
        nodes: impl IntoIterator<Item = u32>,
        answer: impl Fn(u32) -> Vec<f64>,
    ) -> Result<BTreeMap<u32, Vec<f64>>, Agreed> {
        // In the order of their owners.
        let mut nodes: Vec<u32> = nodes.into_iter().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut counts = vec![0; session.ranks()];
        nodes.iter().for_each(|node| counts[self.owner(*node)] += 1);
        let (asked, askers) = exchange(session.world(), &nodes, &counts)?;
        let answers: Vec<Vec<f64>> = asked.into_iter().map(answer).collect();
        let lengths: Vec<u32> = answers.iter().map(|answer| answer.len() as u32).collect();
        let mut rest = &lengths[..];
        let values_of = |count: &usize| {
            let (of_rank, others) = rest.split_at(*count);
            rest = others;
            of_rank.iter().map(|length| *length as usize).sum()
        };
        let values: Vec<usize> = askers.iter().map(values_of).collect();
        let (lengths, _) = exchange(session.world(), &lengths, &askers)?;
        let (values, _) = exchange(session.world(), &answers.concat(), &values)?;
        let mut rest = &values[..];
        let answer = |length: u32| {
            let (answer, others) = rest.split_at(length as usize);
            rest = others;
            answer.to_vec()
        };
        Ok(nodes.into_iter().zip(lengths.into_iter().map(answer)).collect())
    }

    /// Those of these nodes that are in the sets of their owners, all by global numbers. Collective.
    pub fn among(
        &self,
        session: &Session,
        nodes: impl IntoIterator<Item = u32>,
        owned: &BTreeSet<u32>,
    ) -> Result<BTreeSet<u32>, Agreed> {
        let answers = self
            .ask_owners(session, nodes, |node| if owned.contains(&node) { vec![1.0] } else { Vec::new() })?;
        Ok(answers.into_iter().filter(|(_, answer)| !answer.is_empty()).map(|(node, _)| node).collect())
    }

    /// The nodes of these facets of this rank, by global numbers.
    pub fn nodes_of_facets<'a>(
        &'a self,
        facets: impl IntoIterator<Item = &'a u32, IntoIter: 'a>,
    ) -> impl Iterator<Item = u32> + 'a {
        let nodes = facets.into_iter().flat_map(|facet| self.facet_nodes(*facet));
        nodes.map(|node| self.global_node(node))
    }
}
