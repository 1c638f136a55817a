//! The types of elements and the labels of their facets.

use crate::mesh::file::document::Shape;

/// What the elements of a type are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Kind {
    pub(super) shape: Shape,
    pub(super) nodes: usize,
    pub(super) part: Part,
}

/// What elements are of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// Its cells.
    Cells,
    /// Parts of the boundary of cells; without any cells membranes in a plane are the cells, as Gmsh writes quadrilaterals of second order.
    Membrane,
    /// Parts of the boundary of cells.
    Boundary,
}

impl Kind {
    /// The nodes of an element in the order of a block.
    pub(super) fn sort(self, nodes: &mut [u64]) {
        if (self.shape, self.nodes) == (Shape::Tetrahedron, 10) {
            // Abaqus has the nodes on the edges 03, 13, 23 at the end.
            nodes.swap(8, 9);
        }
    }
}

/// What follows the name of a type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    Read(Kind),
    /// Springs, masses and the like.
    Ignored,
}

/// What a type of elements means; in words, why it is refused.
pub(super) fn meaning(name: &str) -> Result<Meaning, String> {
    let capitals = name.to_ascii_uppercase();
    let end = capitals.rfind("3D").or_else(|| capitals.rfind("2D")).map_or(0, |at| at + 2);
    let letters = end + capitals[end..].find(|c: char| c.is_ascii_digit()).unwrap_or(capitals.len() - end);
    let (family, rest) = capitals.split_at(letters);
    let digits: &str = &rest[..rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len())];
    let of = |shape, nodes, part| Ok(Meaning::Read(Kind { shape, nodes, part }));
    match (family, digits) {
        ("C3D", "4") => of(Shape::Tetrahedron, 4, Part::Cells),
        ("C3D", "5") => of(Shape::Pyramid, 5, Part::Cells),
        ("C3D", "6") => of(Shape::Wedge, 6, Part::Cells),
        ("C3D", "8") => of(Shape::Hexahedron, 8, Part::Cells),
        ("C3D", "10") => of(Shape::Tetrahedron, 10, Part::Cells),
        ("C3D", "13") => of(Shape::Pyramid, 13, Part::Cells),
        ("C3D", "15") => of(Shape::Wedge, 15, Part::Cells),
        ("C3D", "20") => of(Shape::Hexahedron, 20, Part::Cells),
        ("C3D", "27") => of(Shape::Hexahedron, 27, Part::Cells),
        ("CPS" | "CPE" | "CAX", "3") => of(Shape::Triangle, 3, Part::Cells),
        ("CPS" | "CPE" | "CAX", "4") => of(Shape::Quadrilateral, 4, Part::Cells),
        ("CPS" | "CPE" | "CAX", "6") => of(Shape::Triangle, 6, Part::Cells),
        ("CPS" | "CPE" | "CAX", "8") => of(Shape::Quadrilateral, 8, Part::Cells),
        ("M3D", "3") => of(Shape::Triangle, 3, Part::Membrane),
        ("M3D", "4") => of(Shape::Quadrilateral, 4, Part::Membrane),
        ("M3D", "6") => of(Shape::Triangle, 6, Part::Membrane),
        ("M3D", "8") => of(Shape::Quadrilateral, 8, Part::Membrane),
        ("M3D", "9") => of(Shape::Quadrilateral, 9, Part::Membrane),
        ("S" | "SFM3D" | "R3D" | "STRI", "3") => of(Shape::Triangle, 3, Part::Boundary),
        ("S" | "SFM3D" | "R3D", "4") => of(Shape::Quadrilateral, 4, Part::Boundary),
        ("S" | "SFM3D", "6") | ("STRI", "65") => of(Shape::Triangle, 6, Part::Boundary),
        ("S" | "SFM3D", "8") => of(Shape::Quadrilateral, 8, Part::Boundary),
        ("S", "9") => of(Shape::Quadrilateral, 9, Part::Boundary),
        ("T2D" | "T3D" | "R2D", "2") | ("B", "21" | "23" | "31" | "33") => of(Shape::Line, 2, Part::Boundary),
        ("T2D" | "T3D", "3") | ("B", "22" | "32") => of(Shape::Line, 3, Part::Boundary),
        ("MASS" | "ROTARYI" | "SPRINGA" | "SPRING" | "DASHPOTA" | "DASHPOT" | "CONN3D" | "CONN2D", _) => {
            Ok(Meaning::Ignored)
        }
        _ => Err(unknown(&capitals)),
    }
}

fn unknown(name: &str) -> String {
    let name: String = name.chars().take(20).collect();
    format!(
        "TYPE={}, a type unknown to the solver: C3D4, C3D5, C3D6, C3D8, C3D10, C3D15, C3D20 (in space) and CPS3, CPS4, CPS6, CPS8, CPE3, \
         CPE4, CPE6, CPE8 (in the plane; CAX3 to CAX8 likewise), with any letters after the number, are read",
        name.escape_debug()
    )
}

/// The corners of the facet of a cell with the label S1, S2, ...
pub(super) fn facet(shape: Shape, label: &str) -> Option<&'static [usize]> {
    let facets: &[&[usize]] = match shape {
        Shape::Triangle => &[&[0, 1], &[1, 2], &[2, 0]],
        Shape::Quadrilateral => &[&[0, 1], &[1, 2], &[2, 3], &[3, 0]],
        Shape::Tetrahedron => &[&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]],
        Shape::Pyramid => &[&[0, 1, 2, 3], &[0, 4, 1], &[1, 4, 2], &[2, 4, 3], &[3, 4, 0]],
        Shape::Wedge => &[&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]],
        Shape::Hexahedron => {
            &[&[0, 1, 2, 3], &[4, 7, 6, 5], &[0, 4, 5, 1], &[1, 5, 6, 2], &[2, 6, 7, 3], &[3, 7, 4, 0]]
        }
        Shape::Point | Shape::Line => &[],
    };
    let number: usize = label.strip_prefix(['S', 's'])?.parse().ok()?;
    facets.get(number.checked_sub(1)?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_known_with_all_suffixes() {
        for name in ["C3D8", "c3d8r", "C3D8I", "C3D8RH"] {
            let kind = Kind { shape: Shape::Hexahedron, nodes: 8, part: Part::Cells };
            assert_eq!(meaning(name), Ok(Meaning::Read(kind)), "{name}");
        }
        let shape = |name| match meaning(name) {
            Ok(Meaning::Read(kind)) => Some((kind.shape, kind.nodes)),
            _ => None,
        };
        assert_eq!(shape("C3D10M"), Some((Shape::Tetrahedron, 10)));
        assert_eq!(shape("CPE4R"), Some((Shape::Quadrilateral, 4)));
        assert_eq!(shape("CAX6M"), Some((Shape::Triangle, 6)));
        assert_eq!(shape("S4R"), Some((Shape::Quadrilateral, 4)));
        assert_eq!(shape("SFM3D3"), Some((Shape::Triangle, 3)));
        assert_eq!(shape("STRI65"), Some((Shape::Triangle, 6)));
        assert_eq!(meaning("SpringA"), Ok(Meaning::Ignored));
        assert_eq!(shape("S9R5"), Some((Shape::Quadrilateral, 9)));
        assert_eq!(shape("T3D3"), Some((Shape::Line, 3)));
        for name in ["", "C3D", "C3D7", "DC3D8", "CGAX4", "8", "é3D2D"] {
            assert!(meaning(name).is_err(), "{name}");
        }
    }

    #[test]
    fn labels_name_all_facets() {
        for shape in [
            Shape::Triangle,
            Shape::Quadrilateral,
            Shape::Tetrahedron,
            Shape::Pyramid,
            Shape::Wedge,
            Shape::Hexahedron,
        ] {
            let sorted = |facet: &[usize]| {
                let mut facet = facet.to_vec();
                facet.sort_unstable();
                facet
            };
            let mut labelled: Vec<_> =
                (1..).map_while(|number| facet(shape, &format!("S{number}"))).map(sorted).collect();
            let mut all: Vec<_> = shape.facets().iter().map(|facet| sorted(facet)).collect();
            labelled.sort();
            all.sort();
            assert_eq!(labelled, all, "{shape:?}");
        }
        assert_eq!(facet(Shape::Hexahedron, "s3"), Some(&[0, 4, 5, 1][..]));
        assert_eq!(
            [facet(Shape::Wedge, "S0"), facet(Shape::Wedge, "S6"), facet(Shape::Wedge, "SPOS")],
            [None; 3]
        );
    }
}
