//! A self-contained part of a mesh: its cells and all of their nodes.

use super::{Boundary, GlobalMesh, Names, partition::Partition, shape::edges_of_cell};
use crate::{
    error::{Error, Result},
    linear_algebra::tensor::Vector,
};

/// Marker, in place of a position, of a node or facet that is not in the piece.
const ABSENT: u32 = u32::MAX;

/// Cells with their nodes, and their facets on the surface. Original ids are positions in the
/// whole mesh; nodes, cells and facets are sorted by them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Piece<const D: usize> {
    /// Original ids of the nodes.
    pub node_ids: Vec<u32>,
    /// The part that owns each node.
    pub owners: Vec<u32>,
    /// Coordinates in m.
    pub nodes: Vec<Vector<D>>,
    /// Original ids of the cells.
    pub cell_ids: Vec<u32>,
    /// Positions of nodes in this piece, `D + 1` a cell.
    pub cells: Vec<u32>,
    /// Coordinates in m of the nodes on the edges of the cells, as in [`GlobalMesh::curved`].
    pub curved: Vec<Vector<D>>,
    /// Index into the mesh's regions, one a cell.
    pub cell_regions: Vec<u16>,
    /// Positions of the facets among those of the whole mesh.
    pub facet_ids: Vec<u32>,
    /// Positions of nodes in this piece, ordered so that the normal points outward.
    pub facets: Vec<[u32; D]>,
    /// Positions in this piece of the cells behind the facets.
    pub facet_cells: Vec<u32>,
    /// The boundary, as an index into those of the mesh, and the position of each named facet; ascending.
    pub named: Vec<[u32; 2]>,
}

/// Numbers of what other meshes have before.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Offsets {
    pub nodes: u32,
    pub cells: u32,
    pub facets: u32,
    pub regions: u16,
    pub boundaries: u32,
}

impl<const D: usize> Piece<D> {
    /// Appends a piece of another mesh with straight edges, whose ids, regions and boundaries follow those `before`.
    pub(super) fn append(&mut self, other: Self, before: Offsets) {
        let [nodes, cells, facets] =
            [self.nodes.len(), self.cell_ids.len(), self.facets.len()].map(|count| count as u32);
        self.node_ids.extend(other.node_ids.iter().map(|id| id + before.nodes));
        self.owners.extend(other.owners);
        self.nodes.extend(other.nodes);
        self.cell_ids.extend(other.cell_ids.iter().map(|id| id + before.cells));
        self.cells.extend(other.cells.iter().map(|node| node + nodes));
        self.cell_regions.extend(other.cell_regions.iter().map(|region| region + before.regions));
        self.facet_ids.extend(other.facet_ids.iter().map(|id| id + before.facets));
        self.facets.extend(other.facets.iter().map(|facet| facet.map(|node| node + nodes)));
        self.facet_cells.extend(other.facet_cells.iter().map(|cell| cell + cells));
        let named =
            other.named.iter().map(|[boundary, facet]| [boundary + before.boundaries, facet + facets]);
        self.named.extend(named);
    }

    /// Merges pieces; nodes, cells and facets that several of them have are kept once.
    pub fn merged(pieces: &[Self]) -> Self {
        let mut out = Self::default();
        let (nodes, node_places) = union(pieces, |piece| &piece.node_ids);
        for (at, piece, position) in nodes {
            out.node_ids.push(at);
            out.owners.push(pieces[piece].owners[position]);
            out.nodes.push(pieces[piece].nodes[position]);
        }
        let (cells, cell_places) = union(pieces, |piece| &piece.cell_ids);
        for (at, piece, position) in cells {
            let nodes = &pieces[piece].cells[position * (D + 1)..(position + 1) * (D + 1)];
            out.cell_ids.push(at);
            out.cells.extend(nodes.iter().map(|&node| node_places[piece][node as usize]));
            out.cell_regions.push(pieces[piece].cell_regions[position]);
            out.curved.extend_from_slice(sides(&pieces[piece].curved, position));
        }
        let (facets, facet_places) = union(pieces, |piece| &piece.facet_ids);
        for (at, piece, position) in facets {
            let of = &pieces[piece];
            out.facet_ids.push(at);
            out.facets.push(of.facets[position].map(|node| node_places[piece][node as usize]));
            out.facet_cells.push(cell_places[piece][of.facet_cells[position] as usize]);
        }
        for (piece, places) in pieces.iter().zip(&facet_places) {
            out.named.extend(piece.named.iter().map(|&[boundary, facet]| [boundary, places[facet as usize]]));
        }
        out.named.sort_unstable();
        out
    }

    /// The fault of a piece that was read, one of `parts`; `None` for a valid piece.
    pub fn check(&self, parts: usize, names: &Names) -> std::result::Result<(), &'static str> {
        let below = |numbers: &[u32], limit: usize| numbers.iter().all(|&number| (number as usize) < limit);
        let ascending = |ids: &[u32]| ids.is_sorted_by(|a, b| a < b);
        let (nodes, cells, facets) = (self.nodes.len(), self.cell_ids.len(), self.facets.len());
        let named = |&[boundary, facet]: &[u32; 2]| {
            (boundary as usize) < names.boundaries.len() && (facet as usize) < facets
        };
        let regions = |&region: &u16| usize::from(region) < names.regions.len();
        if !(ascending(&self.node_ids) && ascending(&self.cell_ids) && ascending(&self.facet_ids)) {
            Err("ids are not in order")
        } else if !below(&self.owners, parts) {
            Err("a node has an owner that is not a part")
        } else if !self.nodes.iter().chain(&self.curved).flatten().all(|x| x.is_finite()) {
            Err("a coordinate is not finite")
        } else if !(below(&self.cells, nodes) && below(self.facets.as_flattened(), nodes)) {
            Err("a cell or facet has a node that does not exist")
        } else if !below(&self.facet_cells, cells) {
            Err("a facet lies on a cell that does not exist")
        } else if !(self.cell_regions.iter().all(regions) && self.named.iter().all(named)) {
            Err("a name belongs to a region, boundary or facet that does not exist")
        } else {
            Ok(())
        }
    }

    /// The whole mesh, which this piece must contain completely; refused if ids are missing.
    pub fn into_whole(self, names: Names) -> Result<GlobalMesh<D>> {
        let whole = |ids: &[u32]| ids.iter().zip(0..).all(|(&id, place)| id == place);
        if !(whole(&self.node_ids) && whole(&self.cell_ids) && whole(&self.facet_ids)) {
            return Err(Error::Refused("the parts of the mesh lack nodes, cells or facets".into()));
        }
        let mut boundaries: Vec<Boundary> =
            names.boundaries.into_iter().map(|name| Boundary { name, facets: Vec::new() }).collect();
        for [boundary, facet] in self.named {
            boundaries[boundary as usize].facets.push(facet);
        }
        Ok(GlobalMesh {
            nodes: self.nodes,
            cells: self.cells,
            is_second_order: !self.curved.is_empty(),
            curved: self.curved,
            cell_regions: self.cell_regions,
            regions: names.regions,
            facets: self.facets,
            facet_cells: self.facet_cells,
            boundaries,
            point_sets: names.point_sets,
            inner_groups: names.inner_groups,
            inner_facets: Vec::new(),
        })
    }
}

/// The nodes on the edges of a cell; none where edges are straight.
fn sides<const D: usize>(curved: &[Vector<D>], cell: usize) -> &[Vector<D>] {
    let edges = edges_of_cell::<D>().len();
    curved.get(cell * edges..(cell + 1) * edges).unwrap_or(&[])
}

/// The ids of all pieces, ascending, each with a piece that contains it and its position there; and for each piece the positions of
/// its ids among them.
type Union = (Vec<(u32, usize, usize)>, Vec<Vec<u32>>);

fn union<const D: usize>(pieces: &[Piece<D>], ids: impl Fn(&Piece<D>) -> &Vec<u32>) -> Union {
    let mut all: Vec<(u32, usize, usize)> = Vec::new();
    for (at, piece) in pieces.iter().enumerate() {
        all.extend(ids(piece).iter().enumerate().map(|(position, &id)| (id, at, position)));
    }
    all.sort_unstable();
    let mut places: Vec<Vec<u32>> = pieces.iter().map(|piece| vec![0; ids(piece).len()]).collect();
    let mut once: Vec<(u32, usize, usize)> = Vec::with_capacity(all.len());
    for (id, piece, position) in all {
        if once.last().is_none_or(|last| last.0 != id) {
            once.push((id, piece, position));
        }
        places[piece][position] = once.len() as u32 - 1;
    }
    (once, places)
}

/// Cuts a whole mesh into the pieces of a partition.
pub struct Cutter<'a, const D: usize> {
    mesh: &'a GlobalMesh<D>,
    partition: &'a Partition,
    cells: Vec<Vec<u32>>,
    facets: Vec<Vec<u32>>,
    named: Vec<Vec<[u32; 2]>>,
    /// Scratch: the position of each node of the mesh in the piece being cut.
    places: Vec<u32>,
}

impl<'a, const D: usize> Cutter<'a, D> {
    /// Sorts cells and facets by part.
    pub fn new(mesh: &'a GlobalMesh<D>, partition: &'a Partition, parts: usize) -> Self {
        let mut cells = vec![Vec::new(); parts];
        for (cell, &part) in partition.cell_ranks.iter().enumerate() {
            cells[part as usize].push(cell as u32);
        }
        let part_of = |facet: usize| partition.cell_ranks[mesh.facet_cells[facet] as usize] as usize;
        let mut facets: Vec<Vec<u32>> = vec![Vec::new(); parts];
        let mut positions = vec![0; mesh.facets.len()];
        for facet in 0..mesh.facets.len() {
            let here = &mut facets[part_of(facet)];
            positions[facet] = here.len() as u32;
            here.push(facet as u32);
        }
        let mut named = vec![Vec::new(); parts];
        for (number, boundary) in mesh.boundaries.iter().enumerate() {
            for &facet in &boundary.facets {
                named[part_of(facet as usize)].push([number as u32, positions[facet as usize]]);
            }
        }
        Self { mesh, partition, cells, facets, named, places: vec![ABSENT; mesh.nodes.len()] }
    }

    /// The piece of a part; each can be cut once.
    pub fn piece(&mut self, part: usize) -> Piece<D> {
        let mesh = self.mesh;
        let cell_ids = std::mem::take(&mut self.cells[part]);
        let facet_ids = std::mem::take(&mut self.facets[part]);
        let mut node_ids = Vec::new();
        for &cell in &cell_ids {
            for &node in mesh.cell(cell as usize) {
                if std::mem::replace(&mut self.places[node as usize], 0) == ABSENT {
                    node_ids.push(node);
                }
            }
        }
        node_ids.sort_unstable();
        node_ids.iter().zip(0..).for_each(|(&node, place)| self.places[node as usize] = place);
        let local = |&node: &u32| self.places[node as usize];
        let cell_nodes = cell_ids.iter().flat_map(|&cell| mesh.cell(cell as usize));
        let behind =
            |&facet: &u32| cell_ids.partition_point(|&cell| cell < mesh.facet_cells[facet as usize]) as u32;
        let piece = Piece {
            owners: node_ids.iter().map(|&node| self.partition.node_ranks[node as usize]).collect(),
            nodes: node_ids.iter().map(|&node| mesh.nodes[node as usize]).collect(),
            cells: cell_nodes.map(local).collect(),
            curved: cell_ids.iter().flat_map(|&cell| sides(&mesh.curved, cell as usize)).copied().collect(),
            cell_regions: cell_ids.iter().map(|&cell| mesh.cell_regions[cell as usize]).collect(),
            facets: facet_ids.iter().map(|&f| mesh.facets[f as usize].map(|node| local(&node))).collect(),
            facet_cells: facet_ids.iter().map(behind).collect(),
            named: std::mem::take(&mut self.named[part]),
            node_ids,
            cell_ids,
            facet_ids,
        };
        piece.node_ids.iter().for_each(|&node| self.places[node as usize] = ABSENT);
        piece
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{
        generate::{Diagonal, box_mesh, rectangle},
        partition::{Method, divide},
    };

    fn cut<const D: usize>(mesh: &GlobalMesh<D>, parts: usize) -> Vec<Piece<D>> {
        let partition = divide(mesh, parts, Method::Recursive).unwrap();
        let mut cutter = Cutter::new(mesh, &partition, parts);
        (0..parts).map(|part| cutter.piece(part)).collect()
    }

    fn comes_back<const D: usize>(mesh: &GlobalMesh<D>) {
        for parts in 1..8 {
            let pieces = cut(mesh, parts);
            assert!(pieces.iter().all(|piece| piece.check(parts, &mesh.names()).is_ok()));
            let whole = Piece::merged(&pieces).into_whole(mesh.names()).unwrap();
            assert!(whole == *mesh, "{parts} parts");
            for piece in &pieces {
                for (position, &cell) in piece.cell_ids.iter().enumerate() {
                    let nodes = &piece.cells[position * (D + 1)..(position + 1) * (D + 1)];
                    let ids: Vec<u32> = nodes.iter().map(|&node| piece.node_ids[node as usize]).collect();
                    assert_eq!(ids, mesh.cell(cell as usize));
                }
            }
        }
    }

    #[test]
    fn the_pieces_of_a_mesh_merged_are_the_mesh() {
        let mut plate = rectangle([2.0, 1.0], [6, 5], Diagonal::Alternating, [1.0; 2]).unwrap();
        // A facet with two names, and cells of two regions.
        let shared = plate.boundaries[0].facets[2];
        plate.boundaries[3].facets.insert(0, shared);
        plate.regions.push("other".into());
        plate.cell_regions[7] = 1;
        comes_back(&plate);
        comes_back(&box_mesh([1.0; 3], [3, 2, 4], [1.0; 3]).unwrap());
    }

    #[test]
    fn a_part_alone_is_not_the_whole() {
        let mesh = rectangle([2.0, 1.0], [6, 5], Diagonal::Right, [1.0; 2]).unwrap();
        let error = cut(&mesh, 2).remove(1).into_whole(mesh.names()).unwrap_err().to_string();
        assert!(error.contains("lack"), "{error}");
    }

    #[test]
    fn a_piece_that_contradicts_itself_is_found() {
        let mesh = rectangle([2.0, 1.0], [6, 5], Diagonal::Right, [1.0; 2]).unwrap();
        let fault = |change: fn(&mut Piece<2>)| {
            let mut piece = cut(&mesh, 2).remove(0);
            change(&mut piece);
            piece.check(2, &mesh.names()).unwrap_err()
        };
        assert!(fault(|piece| piece.node_ids.swap(0, 1)).contains("order"));
        assert!(fault(|piece| piece.owners[3] = 2).contains("owner"));
        assert!(fault(|piece| piece.nodes[0][1] = f64::NAN).contains("finite"));
        assert!(fault(|piece| piece.cells[5] = 1000).contains("node"));
        assert!(fault(|piece| piece.facets[1] = [0, 1000]).contains("node"));
        assert!(fault(|piece| piece.facet_cells[0] = 1000).contains("facet lies"));
        assert!(fault(|piece| piece.cell_regions[0] = 1).contains("a name belongs to a region"));
        assert!(fault(|piece| piece.named[0] = [4, 0]).contains("a name belongs to"));
    }
}
