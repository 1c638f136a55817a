//! What the readers of all formats find in a file.

use crate::error::{Error, Result};
use std::collections::BTreeMap;

/// The contents of a mesh file.
#[derive(Debug, Default)]
pub(super) struct Document {
    /// Names of groups by dimension and number.
    pub(super) names: BTreeMap<(usize, u32), String>,
    /// Groups of each entity, by dimension and tag.
    pub(super) groups: BTreeMap<(usize, i32), Vec<u32>>,
    pub(super) node_tags: Vec<u64>,
    pub(super) points: Vec<[f64; 3]>,
    pub(super) blocks: Vec<Block>,
    /// Names of sets of nodes, with the tags of the nodes.
    pub(super) node_sets: Vec<(String, Vec<u64>)>,
    /// What the user should know about the way in which the file was read; without its name.
    pub(super) notes: Vec<String>,
}

/// The elements of one kind on one entity.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) shape: Shape,
    /// Number of nodes of an element: its corners, followed by others if it is of second order. Those of simplices are on the edges,
    /// of a tetrahedron on 01, 12, 20, 03, 23, 13.
    pub(super) nodes_per_element: usize,
    pub(super) entity: i32,
    pub(super) tags: Vec<u64>,
    /// Node tags, element by element. Corners are in the order of Gmsh, VTK and Abaqus.
    pub(super) nodes: Vec<u64>,
}

impl Block {
    pub(super) fn new(shape: Shape, nodes_per_element: usize, entity: i32) -> Self {
        Self { shape, nodes_per_element, entity, tags: Vec::new(), nodes: Vec::new() }
    }

    /// The tag and the node tags of each element.
    pub(super) fn elements(&self) -> impl Iterator<Item = (u64, &[u64])> {
        self.tags.iter().copied().zip(self.nodes.chunks_exact(self.nodes_per_element))
    }
}

impl Document {
    /// The dimension of the cells; refused if there are no elements of dimension 2 or 3.
    pub(super) fn dimension(&self) -> Result<usize> {
        let blocks = self.blocks.iter().filter(|block| !block.tags.is_empty());
        blocks.map(|block| block.shape.dimension()).max().filter(|dimension| *dimension > 1).ok_or_else(|| {
            Error::Refused(
                "no triangles and no tetrahedra in the file, and no cells that can be split into them: mesh the surface or volume; in \
                 Gmsh, put it into a physical group or set Mesh.SaveAll = 1 so that its elements are saved"
                    .into(),
            )
        })
    }
}

/// The shape of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Shape {
    Point,
    Line,
    Triangle,
    Quadrilateral,
    Tetrahedron,
    Pyramid,
    Wedge,
    Hexahedron,
}

impl Shape {
    pub(super) fn corners(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::Triangle => 3,
            Self::Quadrilateral | Self::Tetrahedron => 4,
            Self::Pyramid => 5,
            Self::Wedge => 6,
            Self::Hexahedron => 8,
        }
    }

    pub(super) fn dimension(self) -> usize {
        match self {
            Self::Point => 0,
            Self::Line => 1,
            Self::Triangle | Self::Quadrilateral => 2,
            _ => 3,
        }
    }

    pub(super) fn is_simplex(self) -> bool {
        self.corners() == self.dimension() + 1
    }

    /// Its name for one, and for several.
    pub(super) fn words(self) -> [&'static str; 2] {
        match self {
            Self::Point => ["point", "points"],
            Self::Line => ["line", "lines"],
            Self::Triangle => ["triangle", "triangles"],
            Self::Quadrilateral => ["quadrilateral", "quadrilaterals"],
            Self::Tetrahedron => ["tetrahedron", "tetrahedra"],
            Self::Pyramid => ["pyramid", "pyramids"],
            Self::Wedge => ["wedge", "wedges"],
            Self::Hexahedron => ["hexahedron", "hexahedra"],
        }
    }

    /// The corners of its facets, from outside in positive order.
    pub(super) fn facets(self) -> &'static [&'static [usize]] {
        match self {
            Self::Point => &[],
            Self::Line => &[&[0], &[1]],
            Self::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
            Self::Quadrilateral => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
            Self::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]],
            Self::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
            Self::Wedge => &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
            Self::Hexahedron => {
                &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
            }
        }
    }
}
