//! Bodies across ranks: cells that are connected through shared facets.

use super::{
    Mesh,
    surface::{Bodies, OUTSIDE, sorted},
};
use crate::mesh::shape::facet_of;
use crate::{
    error::Result,
    parallel::{
        agreement::Agreed,
        exchange::{exchange, gather},
        session::Session,
    },
};

impl Bodies {
    /// The body of each node of this rank that belongs to a cell of this rank.
    pub fn of_nodes<const D: usize>(&self, mesh: &Mesh<D>) -> Vec<Option<u32>> {
        let mut of_node = vec![None; mesh.nodes.len()];
        for (cell, number) in self.of_cell.iter().enumerate() {
            mesh.cell_nodes(cell).for_each(|node| of_node[node as usize] = Some(*number));
        }
        of_node
    }
}

impl<const D: usize> Mesh<D> {
    /// The bodies of the whole mesh, numbered by their first cells, and the body of each cell of this rank. Collective.
    ///
    /// Each rank finds the connected pieces of its own cells; the owner of a facet's first node finds the pieces that share the
    /// facet. Then all ranks store one number for each piece.
    pub fn bodies(&self, session: &Session) -> Result<Bodies, Agreed> {
        let topology = session.agree(self.topology())?;
        let Bodies { count, mut of_cell } = topology.bodies();
        let first = session.share_start(count) as u32;
        let mut records: Vec<Vec<u32>> = vec![Vec::new(); session.ranks()];
        for (place, _) in topology.neighbours.iter().enumerate().filter(|(_, other)| **other == OUTSIDE) {
            let (cell, opposite) = (place / (D + 1), place % (D + 1));
            let nodes = facet_of::<D>(self.cell(cell), opposite).map(|node| self.global_node(node));
            let key = sorted(nodes).0;
            let to = &mut records[self.owner(key[0])];
            to.extend(key);
            to.push(first + of_cell[cell]);
        }
        drop(topology);
        let pairs = meet::<D>(session, &records)?;

        let mut starts = vec![u32::MAX; count];
        for (&body, &id) in of_cell.iter().zip(&self.cell_ids) {
            starts[body as usize] = id.min(starts[body as usize]);
        }
        let starts = gather(session.world(), &starts)?;
        let (numbers, count) = joined(&starts, &gather(session.world(), &pairs)?);
        of_cell.iter_mut().for_each(|body| *body = numbers[(first + *body) as usize]);
        Ok(Bodies { count, of_cell })
    }
}

/// Pairs of pieces that share a facet whose first node this rank owns.
fn meet<const D: usize>(session: &Session, records: &[Vec<u32>]) -> Result<Vec<u32>, Agreed> {
    let counts: Vec<usize> = records.iter().map(Vec::len).collect();
    let (came, _) = exchange(session.world(), &records.concat(), &counts)?;
    let mut facets: Vec<&[u32]> = came.chunks_exact(D + 1).collect();
    facets.sort_unstable();
    let met = facets.windows(2).filter(|pair| pair[0][..D] == pair[1][..D]);
    let mut pairs: Vec<[u32; 2]> = met.map(|pair| [pair[0][D], pair[1][D]]).collect();
    pairs.sort_unstable();
    pairs.dedup();
    Ok(pairs.concat())
}

/// The body of each piece and the number of bodies, given the first cell of each piece and the pairs of connected pieces.
fn joined(starts: &[u32], pairs: &[u32]) -> (Vec<u32>, usize) {
    fn root(above: &mut [usize], mut piece: usize) -> usize {
        while above[piece] != piece {
            above[piece] = above[above[piece]];
            piece = above[piece];
        }
        piece
    }
    let mut above: Vec<usize> = (0..starts.len()).collect();
    for pair in pairs.chunks_exact(2) {
        let [a, b] = [pair[0], pair[1]].map(|piece| root(&mut above, piece as usize));
        // The piece with the smallest first cell is the root.
        let (upper, lower) = if starts[a] <= starts[b] { (a, b) } else { (b, a) };
        above[lower] = upper;
    }
    let roots: Vec<usize> = (0..starts.len()).map(|piece| root(&mut above, piece)).collect();
    let mut tops: Vec<usize> = (0..starts.len()).filter(|&piece| roots[piece] == piece).collect();
    tops.sort_by_key(|&piece| starts[piece]);
    let mut numbers = vec![0; starts.len()];
    tops.iter().zip(0..).for_each(|(&top, number)| numbers[top] = number);
    (roots.iter().map(|&top| numbers[top]).collect(), tops.len())
}

#[cfg(test)]
mod tests {
    use super::joined;

    #[test]
    fn pieces_that_share_facets_are_one_body_named_by_its_first_cell() {
        assert_eq!(joined(&[0, 3, 1, 2], &[]), (vec![0, 3, 1, 2], 4));
        assert_eq!(joined(&[5, 3, 1, 2, 9], &[0, 1, 4, 0]), (vec![2, 2, 0, 1, 2], 3));
        assert_eq!(joined(&[0, 1, 2], &[1, 2, 0, 1]), (vec![0, 0, 0], 1));
    }
}
