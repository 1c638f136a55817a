//! Ghost nodes in addition to those of the cells of this rank.

use super::Mesh;
use crate::parallel::{agreement::Agreed, exchange::exchange, session::Session};

impl<const D: usize> Mesh<D> {
    /// Adds ghosts: nodes of other ranks, by their global numbers, that no cell of this rank has. Local numbers of ghosts change.
    /// Collective.
    pub fn add_ghosts(&mut self, session: &Session, mut wanted: Vec<u32>) -> Result<(), Agreed> {
        wanted
            .retain(|&node| self.owner(node) != session.rank() && self.ghosts.binary_search(&node).is_err());
        wanted.sort_unstable();
        wanted.dedup();
        let mut counts = vec![0; session.ranks()];
        wanted.iter().for_each(|&node| counts[self.owner(node)] += 1);
        let (asked, askers) = exchange(session.world(), &wanted, &counts)?;
        let owned = asked.iter().map(|&node| self.owned_node(node));
        let (ids, places): (Vec<u32>, Vec<f64>) = {
            let owned: Vec<usize> = owned.collect();
            let ids = owned.iter().map(|&node| self.node_ids[node]).collect();
            (ids, owned.iter().flat_map(|&node| self.nodes[node]).collect())
        };
        let (ids, _) = exchange(session.world(), &ids, &askers)?;
        let by_axis = askers.iter().map(|count| count * D).collect::<Vec<_>>();
        let (places, _) = exchange(session.world(), &places, &by_axis)?;
        if wanted.is_empty() {
            return Ok(());
        }
        let known = self.ghosts.iter().enumerate().map(|(at, &ghost)| (ghost, Some(self.owned + at), 0));
        let new = wanted.iter().enumerate().map(|(at, &ghost)| (ghost, None, at));
        let mut all: Vec<(u32, Option<usize>, usize)> = known.chain(new).collect();
        all.sort_unstable_by_key(|(ghost, ..)| *ghost);
        let mut local: Vec<u32> = (0..self.nodes.len() as u32).collect();
        let (mut nodes, mut node_ids) =
            (self.nodes[..self.owned].to_vec(), self.node_ids[..self.owned].to_vec());
        for (before, at) in all.iter().map(|(_, before, at)| (before, *at)) {
            match *before {
                Some(before) => {
                    local[before] = nodes.len() as u32;
                    nodes.push(self.nodes[before]);
                    node_ids.push(self.node_ids[before]);
                }
                None => {
                    nodes.push(std::array::from_fn(|i| places[at * D + i]));
                    node_ids.push(ids[at]);
                }
            }
        }
        let lists = [&mut self.cells[..], &mut self.midsides, self.facets.as_flattened_mut()];
        lists.into_iter().flatten().for_each(|node| *node = local[*node as usize]);
        self.ghosts = all.into_iter().map(|(ghost, ..)| ghost).collect();
        (self.nodes, self.node_ids) = (nodes, node_ids);
        Ok(())
    }
}
