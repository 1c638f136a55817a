//! The types of elements.

use crate::mesh::file::document::Shape;

/// The shape of the elements of a type and the number of their nodes; in words, why such elements are not read.
pub(super) fn kind(number: i32) -> Result<(Shape, usize), String> {
    Ok(match number {
        15 => (Shape::Point, 1),
        1 => (Shape::Line, 2),
        2 => (Shape::Triangle, 3),
        3 => (Shape::Quadrilateral, 4),
        4 => (Shape::Tetrahedron, 4),
        5 => (Shape::Hexahedron, 8),
        6 => (Shape::Wedge, 6),
        7 => (Shape::Pyramid, 5),
        8 => (Shape::Line, 3),
        9 => (Shape::Triangle, 6),
        10 => (Shape::Quadrilateral, 9),
        11 => (Shape::Tetrahedron, 10),
        12 => (Shape::Hexahedron, 27),
        13 => (Shape::Wedge, 18),
        14 => (Shape::Pyramid, 14),
        16 => (Shape::Quadrilateral, 8),
        17 => (Shape::Hexahedron, 20),
        18 => (Shape::Wedge, 15),
        19 => (Shape::Pyramid, 13),
        other => return Err(unknown(other)),
    })
}

fn unknown(number: i32) -> String {
    let name = match number {
        20..=25 => "triangles of order 3 to 5",
        26..=28 => "lines of order 3 to 5",
        29..=31 => "tetrahedra of order 3 to 5",
        36..=40 => "quadrilaterals of order 3 to 5",
        92 | 93 => "hexahedra of order 3 or 4",
        _ => "elements unknown to the solver",
    };
    format!(
        "element type {number}, {name}: only points, lines, triangles, quadrilaterals, tetrahedra, pyramids, wedges and hexahedra of \
         order 1 or 2 are read. Mesh with Mesh.ElementOrder = 1 or 2"
    )
}
