//! Derivatives of what effects add to the stress of cells, as parts of a matrix.

use crate::{
    fem::{
        effect::{Effect, Form, Tangents},
        space::{Cell, CellMatrix, Geometry},
    },
    laws::material::Anisotropic,
};

/// Share of the elastic stiffness in shear that flow leaves at least in the matrix of a step, where its derivatives are not symmetric.
const LEAST_STIFFNESS: f64 = 1e-3;

/// Adds the symmetric parts of derivatives of what effects add to the stress of cells in a step of this length in s to the matrix of a cell,
/// given its number: raised where the part that is not symmetric would make a body indefinite, unless the body softens.
pub(super) fn symmetric_parts<'a, const D: usize, const S: usize>(
    geometry: &Geometry<D>,
    effects: &'a [Box<dyn Effect<D, S>>],
    tangents: &'a Tangents,
    (length, softens): (f64, bool),
) -> impl Fn(usize, Cell<'_, D>, &mut CellMatrix<D>) + use<'a, D, S> {
    let points = geometry.points();
    let mut of_points = vec![None; geometry.point_count()];
    for (number, tangent) in tangents.iter::<S>() {
        let (cell, point, _) = geometry.point(number);
        of_points[cell * points + point] = Some(tangent);
    }
    let terms = || effects.iter().map(|effect| effect.term());
    let is_skew = !tangents.are_symmetric() || terms().any(|term| term.is_skew());
    let elasticity = terms().find(|term| term.form() == Some(Form::Elasticity));
    let elasticity = elasticity.filter(|_| is_skew && !softens);
    move |number, cell, matrix| {
        let elasticity = elasticity.and_then(|term| term.tensor(cell.material()));
        for (point, tangent) in of_points[number * points..][..points].iter().enumerate() {
            let Some(tangent) = tangent else { continue };
            let mut tensor = Anisotropic::of_entries::<S>(tangent);
            if let Some(elasticity) = &elasticity {
                let least = LEAST_STIFFNESS * length * elasticity.shear;
                tensor = tensor.raised::<S>((length, elasticity), least);
            }
            matrix.add_form_at((cell, point), 1.0, &tensor);
        }
    }
}
