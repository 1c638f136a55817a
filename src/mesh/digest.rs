//! A number that tells meshes apart, however they are split.

use super::Mesh;
use crate::session::Session;
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

/// Seeds that keep nodes, cells and facets apart.
const NODE: u64 = 1;
const CELL: u64 = 2;
const FACET: u64 = 3;

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

impl<const D: usize> Mesh<D> {
    /// The wrapping sum over ranks of the hashes of owned nodes (id and place), cells (ids and region) and named facets (ids
    /// and name). Collective.
    pub(super) fn find_digest(&self, session: &Session) -> u64 {
        session.total(self.own_digest() as usize) as u64
    }

    fn own_digest(&self) -> u64 {
        let mut sum = 0_u64;
        for (id, place) in self.node_ids[..self.owned].iter().zip(&self.nodes) {
            let mut bytes = Bytes::new();
            bytes.add(id.to_le_bytes());
            place.iter().for_each(|x| bytes.add(x.to_le_bytes()));
            sum = sum.wrapping_add(bytes.hash(NODE));
        }
        let regions: Vec<u64> = self.regions.iter().map(|name| xxh3_64(name.as_bytes())).collect();
        for (cell, id) in self.cell_ids.iter().enumerate() {
            let mut bytes = Bytes::new();
            bytes.add(id.to_le_bytes());
            bytes.add(regions[usize::from(self.cell_regions[cell])].to_le_bytes());
            self.cell(cell).iter().for_each(|&node| bytes.add(self.node_ids[node as usize].to_le_bytes()));
            sum = sum.wrapping_add(bytes.hash(CELL));
        }
        for boundary in &self.boundaries {
            let name = xxh3_64(boundary.name.as_bytes());
            for &facet in &boundary.facets {
                let mut bytes = Bytes::new();
                bytes.add(name.to_le_bytes());
                let nodes = self.facets[facet as usize];
                nodes.iter().for_each(|&node| bytes.add(self.node_ids[node as usize].to_le_bytes()));
                sum = sum.wrapping_add(bytes.hash(FACET));
            }
        }
        sum
    }
}
