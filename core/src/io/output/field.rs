//! A field: its location, its shape and its layout in files.

use crate::linear_algebra::tensor::{component, in_space};

/// The location of the values of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Each node.
    Node,
    /// Each cell.
    Cell,
}

/// The shape of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A number.
    Scalar,
    /// `D` numbers; files hold three.
    Vector,
    /// A symmetric tensor in Mandel form with 3, 4 or 6 components (see [`crate::linear_algebra::tensor`]); files hold the six plain
    /// components.
    Tensor,
}

/// This rank's values of a field.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// Letters, digits and underscores.
    pub name: &'a str,
    /// The location of its values.
    pub place: Place,
    /// The shape of its values.
    pub shape: Shape,
    /// The values of the nodes or cells this rank owns, in the order of the mesh.
    pub values: &'a [f64],
}

/// Name, place and shape of a field, which stay the same for all steps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FieldKind {
    pub(super) name: String,
    pub(super) place: Place,
    pub(super) shape: Shape,
}

/// Number of values per row of a field of this shape in the file.
pub(super) fn file_width(shape: Shape) -> usize {
    match shape {
        Shape::Scalar => 1,
        Shape::Vector => 3,
        Shape::Tensor => 6,
    }
}

/// Names of the stored components in order; empty for a scalar. Tensors are stored in the order of XDMF.
pub(super) fn component_names(shape: Shape) -> &'static [&'static str] {
    match shape {
        Shape::Scalar => &[],
        Shape::Vector => &["x", "y", "z"],
        Shape::Tensor => &["xx", "xy", "xz", "yy", "yz", "zz"],
    }
}

/// The stored component for each component of VTK, whose order of tensor components is xx yy zz xy yz xz.
pub(super) fn view_columns(shape: Shape) -> &'static [usize] {
    match shape {
        Shape::Scalar => &[0],
        Shape::Vector => &[0, 1, 2],
        Shape::Tensor => &[0, 3, 5, 1, 4, 2],
    }
}

/// A field's values with as many components as the file has.
pub(super) fn spread<const D: usize>(field: &Field, rows: usize) -> Vec<f64> {
    match field.shape {
        Shape::Scalar => field.values.to_vec(),
        Shape::Vector => field.values.chunks_exact(D).flat_map(in_space).collect(),
        Shape::Tensor => match field.values.len().checked_div(rows) {
            Some(3) => field.values.chunks_exact(3).flat_map(plain_components::<3>).collect(),
            Some(4) => field.values.chunks_exact(4).flat_map(plain_components::<4>).collect(),
            _ => field.values.chunks_exact(6).flat_map(plain_components::<6>).collect(),
        },
    }
}

/// The components xx xy xz yy yz zz of a tensor in Mandel form.
pub(super) fn plain_components<const S: usize>(mandel: &[f64]) -> [f64; 6] {
    const POSITION: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
    let mut plain = [0.0; 6];
    for (c, value) in mandel.iter().enumerate() {
        let (i, j, factor) = component::<S>(c);
        plain[POSITION[i][j]] = value / factor;
    }
    plain
}

/// Name, place and shape of a field.
pub(super) fn kind_of(field: &Field) -> FieldKind {
    FieldKind { name: field.name.into(), place: field.place, shape: field.shape }
}

/// Names and shapes, in words.
pub(super) fn list(kinds: &[FieldKind]) -> String {
    let words = kinds.iter().map(|kind| format!("{} ({})", kind.name, shape_word(kind.shape)));
    words.collect::<Vec<_>>().join(", ")
}

/// The group of VTKHDF that holds the fields of a place.
pub(super) fn data_group(place: Place) -> &'static str {
    match place {
        Place::Node => "PointData",
        Place::Cell => "CellData",
    }
}

/// The name of a place in files.
pub(super) fn place_word(place: Place) -> &'static str {
    match place {
        Place::Node => "node",
        Place::Cell => "cell",
    }
}

/// The name of a shape in files.
pub(super) fn shape_word(shape: Shape) -> &'static str {
    match shape {
        Shape::Scalar => "scalar",
        Shape::Vector => "vector",
        Shape::Tensor => "tensor",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::SQRT_2;

    fn field(shape: Shape, values: &[f64]) -> Field<'_> {
        Field { name: "field", place: Place::Cell, shape, values }
    }

    #[test]
    fn plane_vectors_get_a_third_component_of_zero() {
        assert_eq!(
            spread::<2>(&field(Shape::Vector, &[1.0, 2.0, 3.0, 4.0]), 2),
            [1.0, 2.0, 0.0, 3.0, 4.0, 0.0]
        );
        assert_eq!(spread::<3>(&field(Shape::Vector, &[1.0, 2.0, 3.0]), 1), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn tensors_are_stored_as_xx_xy_xz_yy_yz_zz_and_seen_by_vtk_as_xx_yy_zz_xy_yz_xz() {
        let mandel = [11.0, 22.0, 33.0, 23.0 * SQRT_2, 13.0 * SQRT_2, 12.0 * SQRT_2];
        let stored = spread::<3>(&field(Shape::Tensor, &mandel), 1);
        let rounded: Vec<f64> = stored.iter().map(|value| value.round()).collect();
        assert_eq!(rounded, [11.0, 12.0, 13.0, 22.0, 23.0, 33.0]);
        let seen: Vec<f64> = view_columns(Shape::Tensor).iter().map(|column| rounded[*column]).collect();
        assert_eq!(seen, [11.0, 22.0, 33.0, 12.0, 23.0, 13.0]);
    }

    #[test]
    fn the_out_of_plane_stress_of_plane_strain_is_kept() {
        let stored = spread::<2>(&field(Shape::Tensor, &[1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0, 0.0]), 2);
        assert_eq!(stored, [1.0, 0.0, 0.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 5.0, 0.0, 6.0]);
    }
}
