//! Ghost nodes in addition to those of the cells of this rank.

use super::Mesh;
use crate::{
    linear_algebra::tensor::Vector,
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeMap;

impl<const D: usize> Mesh<D> {
    /// Adds ghosts: nodes of other ranks, by their global numbers, that no cell of this rank has. Local numbers of ghosts change.
    /// Collective.
    pub fn add_ghosts(&mut self, session: &Session, mut wanted: Vec<u32>) -> Result<(), Agreed> {
        wanted.retain(|&node| !self.owns(node) && self.ghosts.binary_search(&node).is_err());
        let new = self.ask_owners(session, wanted, |node| {
            let node = self.owned_node(node);
            std::iter::once(f64::from(self.node_ids[node])).chain(self.nodes[node]).collect()
        })?;
        if new.is_empty() {
            return Ok(());
        }
        // Each with its local number before, its id and its place.
        let known = self.ghosts.iter().zip(self.owned..);
        let known = known.map(|(ghost, at)| (*ghost, (Some(at), self.node_ids[at], self.nodes[at])));
        let mut ghosts: BTreeMap<u32, (Option<usize>, u32, Vector<D>)> = known.collect();
        ghosts.extend(new.into_iter().map(|(ghost, answer)| {
            (ghost, (None, answer[0] as u32, std::array::from_fn(|i| answer[1 + i])))
        }));
        let mut local: Vec<u32> = (0..self.nodes.len() as u32).collect();
        self.nodes.truncate(self.owned);
        self.node_ids.truncate(self.owned);
        for (before, id, place) in ghosts.values() {
            before.iter().for_each(|before| local[*before] = self.nodes.len() as u32);
            self.nodes.push(*place);
            self.node_ids.push(*id);
        }
        let lists = [&mut self.cells[..], &mut self.midsides, self.facets.as_flattened_mut()];
        lists.into_iter().flatten().for_each(|node| *node = local[*node as usize]);
        self.ghosts = ghosts.into_keys().collect();
        Ok(())
    }
}
