//! A digest of a mesh that does not depend on its partition.

use super::{Names, piece::Piece, shape::edges_of_cell};
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

/// Different seeds for nodes, cells, facets, curved edges and named points.
const NODE: u64 = 1;
const CELL: u64 = 2;
const FACET: u64 = 3;
const EDGE: u64 = 4;
const POINTS: u64 = 5;

/// Up to 48 bytes of numbers, little endian.
struct Bytes {
    bytes: [u8; 48],
    length: usize,
}

impl Bytes {
    fn new() -> Self {
        Self { bytes: [0; 48], length: 0 }
    }

    fn add<const N: usize>(&mut self, number: [u8; N]) {
        self.bytes[self.length..self.length + N].copy_from_slice(&number);
        self.length += N;
    }

    fn hash(&self, seed: u64) -> u64 {
        xxh3_64_with_seed(&self.bytes[..self.length], seed)
    }
}

impl<const D: usize> Piece<D> {
    /// The sum modulo 2^64 of the hashes of the owned nodes (id and position), the cells (ids and region), their curved edges and the
    /// named facets (ids and name) of this part, and in the first part of the named points and curves. The sum over all parts is the
    /// digest of the mesh.
    pub fn digest(&self, part: usize, names: &Names) -> u64 {
        let mut sum = 0_u64;
        let own = |node: &usize| self.owners[*node] as usize == part;
        for node in (0..self.nodes.len()).filter(own) {
            let mut bytes = Bytes::new();
            bytes.add(self.node_ids[node].to_le_bytes());
            self.nodes[node].iter().for_each(|x| bytes.add(x.to_le_bytes()));
            sum = sum.wrapping_add(bytes.hash(NODE));
        }
        let hashes = |names: &[String]| -> Vec<[u8; 8]> {
            names.iter().map(|name| xxh3_64(name.as_bytes()).to_le_bytes()).collect()
        };
        let (regions, boundaries) = (hashes(&names.regions), hashes(&names.boundaries));
        let add_nodes = |bytes: &mut Bytes, nodes: &[u32]| {
            nodes.iter().for_each(|&node| bytes.add(self.node_ids[node as usize].to_le_bytes()));
        };
        for (cell, nodes) in self.cells.chunks_exact(D + 1).enumerate() {
            let mut bytes = Bytes::new();
            bytes.add(self.cell_ids[cell].to_le_bytes());
            bytes.add(regions[usize::from(self.cell_regions[cell])]);
            add_nodes(&mut bytes, nodes);
            sum = sum.wrapping_add(bytes.hash(CELL));
        }
        let edges = edges_of_cell::<D>().len();
        for (at, middle) in self.curved.iter().enumerate() {
            let mut bytes = Bytes::new();
            bytes.add(self.cell_ids[at / edges].to_le_bytes());
            bytes.add([(at % edges) as u8]);
            middle.iter().for_each(|x| bytes.add(x.to_le_bytes()));
            sum = sum.wrapping_add(bytes.hash(EDGE));
        }
        for &[boundary, facet] in &self.named {
            let mut bytes = Bytes::new();
            bytes.add(boundaries[boundary as usize]);
            add_nodes(&mut bytes, &self.facets[facet as usize]);
            sum = sum.wrapping_add(bytes.hash(FACET));
        }
        for set in names.point_sets.iter().filter(|_| part == 0) {
            let places = set.places.as_flattened().iter().flat_map(|x| x.to_le_bytes());
            let bytes: Vec<u8> = set.name.bytes().chain(places).collect();
            sum = sum.wrapping_add(xxh3_64_with_seed(&bytes, POINTS));
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Cuboid, Grid};

    fn digest(parts: usize, change: impl Fn(usize, &mut Piece<3>)) -> u64 {
        let grid = Cuboid::new([1.0, 2.0, 3.0], [3, 2, 4], [1.0; 3]).unwrap();
        let of_part = |rank: usize| {
            let mut piece = grid.part(rank, parts).unwrap();
            change(rank, &mut piece);
            piece.digest(rank, &grid.names())
        };
        (0..parts).fold(0, |sum, rank| sum.wrapping_add(of_part(rank)))
    }

    #[test]
    fn a_mesh_has_the_same_digest_in_any_number_of_parts_and_any_change_shows() {
        let whole = digest(1, |_, _| {});
        (2..8).for_each(|parts| assert_eq!(digest(parts, |_, _| {}), whole, "{parts} parts"));
        assert_ne!(digest(1, |_, piece| piece.nodes[7][1] += 1e-15), whole);
        assert_ne!(digest(1, |_, piece| piece.cells.swap(0, 1)), whole);
        assert_ne!(digest(1, |_, piece| piece.cell_ids.swap(0, 1)), whole);
        assert_ne!(digest(1, |_, piece| piece.named.truncate(9)), whole);
        assert_ne!(digest(1, |_, piece| piece.named[0][0] = 5), whole);
    }
}
