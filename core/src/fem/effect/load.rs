//! Tractions and body forces.

use super::{EnergyKind, Role};
use crate::{
    error::{Error, Result},
    fem::space::{CellShape, Geometry, cell_rule, facet_points, fine_cell_rule, spread_over_facet},
    job::{BodyForce, Scalar},
    laws::material::ByMaterial,
    linear_algebra::tensor::{Vector, add_scaled, norm},
    mesh::Mesh,
};

/// Work of loads and of obstacles that move.
pub const WORK: EnergyKind = EnergyKind::new(
    5,
    Role::Work,
    "external_work",
    "work of loads, moving supports and obstacles whose motion is prescribed, on the body since time 0; with an \
     obstacle that a force moves, also that of the guide that keeps it on its direction",
);

/// A force per area on facets of this rank.
#[derive(Debug)]
pub struct Traction {
    /// Local facets.
    pub facets: Vec<u32>,
    /// One component an axis, in Pa; empty: zero.
    pub value: Vec<Scalar>,
    /// A pressure in Pa against the outward normal.
    pub pressure: Option<Scalar>,
}

/// The weight of the body.
#[derive(Debug)]
pub struct Gravity {
    /// One component an axis, in m/s^2.
    pub acceleration: Vec<Scalar>,
    /// Density in kg/m^d.
    pub density: ByMaterial<f64>,
}

impl Traction {
    /// Visits the forces in N on the nodes of this rank's facets at `time`, by quadrature of degree 2, on quadratic cells of degree 4.
    pub fn forces<const D: usize>(
        &self,
        mesh: &Mesh<D>,
        time: f64,
        mut visit: impl FnMut(u32, Vector<D>),
    ) -> Result<()> {
        for &facet in &self.facets {
            let (nodes, points) = facet_points(mesh, facet);
            for point in points {
                let value = self.at(time, &point.place, &point.normal)?;
                for (node, share) in nodes.clone().zip(point.shares) {
                    visit(node, value.map(|value| point.weight * share * value));
                }
            }
        }
        Ok(())
    }

    /// The traction in Pa at a place with this outward normal.
    fn at<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> Result<Vector<D>> {
        let value = evaluate(&self.value, time, place, "traction")?;
        let Some(pressure) = &self.pressure else { return Ok(value) };
        let pressure = finite(pressure, time, place, || "traction: the pressure".into())?;
        Ok(add_scaled(&value, -pressure, normal))
    }

    /// By how much the forces on the facets of this rank differ at `time` from the means of the traction over many parts of each facet, and the sums of
    /// the magnitudes of the traction at the points of facets, and of the means, in N.
    pub fn error_of_rule<const D: usize>(&self, mesh: &Mesh<D>, time: f64) -> Result<[f64; 3]> {
        let parts = spread_over_facet::<D>();
        let mut sums = [0.0; 3];
        for &facet in &self.facets {
            let (mut force, mut area, mut normal) = ([0.0; D], 0.0, [0.0; D]);
            for point in facet_points(mesh, facet).1 {
                let value = self.at(time, &point.place, &point.normal)?;
                force = add_scaled(&force, point.weight, &value);
                sums[1] += point.weight * norm(&value);
                normal = add_scaled(&normal, point.weight, &point.normal);
                area += point.weight;
            }
            if area <= 0.0 {
                continue;
            }
            let (corners, normal) = (mesh.facet_corners(facet), normal.map(|x| x / area));
            let mut mean = [0.0; D];
            for shares in &parts {
                let place = corners
                    .iter()
                    .zip(shares)
                    .fold([0.0; D], |at, (corner, share)| add_scaled(&at, *share, corner));
                mean = add_scaled(&mean, 1.0 / parts.len() as f64, &self.at(time, &place, &normal)?);
            }
            sums[0] += norm(&add_scaled(&force, -area, &mean));
            sums[2] += area * norm(&mean);
        }
        Ok(sums)
    }
}

/// All loads of a job.
#[derive(Debug, Default)]
pub struct Load {
    /// Forces on the surface.
    pub tractions: Vec<Traction>,
    /// Forces in the interior.
    pub body_forces: Vec<BodyForce>,
    /// Weight.
    pub gravity: Option<Gravity>,
}

impl Load {
    /// Whether there is any load.
    pub fn is_empty(&self) -> bool {
        self.tractions.is_empty() && self.body_forces.is_empty() && self.gravity.is_none()
    }

    /// Whether forces act in the interior.
    pub fn has_body_forces(&self) -> bool {
        !self.body_forces.is_empty() || self.gravity.is_some()
    }

    /// Whether the nodal forces are the same at all times.
    pub fn is_steady(&self) -> bool {
        !self.expressions().any(|(_, value)| value.depends_on_time())
    }

    /// The expressions, each with the words for its load.
    pub fn expressions(&self) -> impl Iterator<Item = (&'static str, &Scalar)> {
        let tractions = self.tractions.iter().flat_map(|t| t.value.iter().chain(&t.pressure));
        let body_forces = self.body_forces.iter().flat_map(|b| &b.value);
        let gravity = self.gravity.iter().flat_map(|g| &g.acceleration);
        let tractions = tractions.map(|value| ("a traction", value));
        tractions
            .chain(body_forces.map(|value| ("a body force", value)))
            .chain(gravity.map(|value| ("gravity", value)))
    }

    /// Visits the nodal forces in N at `time` on this rank's cells and facets, by quadrature of degree 2, on quadratic cells of degree 4:
    /// the cell of a force in the interior, the local node, the force.
    pub fn forces<const D: usize>(
        &self,
        mesh: &Mesh<D>,
        geometry: &Geometry<D>,
        time: f64,
        mut visit: impl FnMut(Option<usize>, u32, &Vector<D>),
    ) -> Result<()> {
        for traction in &self.tractions {
            traction.forces(mesh, time, |node, force| visit(None, node, &force))?;
        }
        let mut in_cell = |cell: usize, node: u32, force: &Vector<D>| visit(Some(cell), node, force);
        for BodyForce { value } in &self.body_forces {
            let of_place = |at: &Vector<D>| evaluate(value, time, at, "body_force");
            forces_in_cells(mesh, geometry, |_| 1.0, of_place, &mut in_cell)?;
        }
        if let Some(Gravity { acceleration, density }) = &self.gravity {
            let of_place = |at: &Vector<D>| evaluate(acceleration, time, at, "gravity");
            let density = |material| density.get(material).copied().unwrap_or(0.0);
            forces_in_cells(mesh, geometry, density, of_place, &mut in_cell)?;
        }
        Ok(())
    }
}

/// Visits the nodal forces of a force per volume: a factor for each material times the value at a place.
fn forces_in_cells<const D: usize>(
    mesh: &Mesh<D>,
    geometry: &Geometry<D>,
    factor: impl Fn(usize) -> f64,
    of_place: impl Fn(&Vector<D>) -> Result<Vector<D>>,
    visit: &mut impl FnMut(usize, u32, &Vector<D>),
) -> Result<()> {
    let materials = geometry.runs.iter().flat_map(|run| std::iter::repeat_n(run.material, run.count));
    for (number, (material, cell)) in materials.zip(geometry.cells()).enumerate() {
        let factor = factor(material);
        if factor == 0.0 {
            continue;
        }
        let mut scatter = |shares: &[f64], weight: f64, value: &Vector<D>| {
            for (node, share) in mesh.cell_nodes(number).zip(shares) {
                visit(number, node, &value.map(|value| weight * share * value));
            }
        };
        let (volume, corners) = (factor * cell.whole().volume, mesh.corners(number));
        if let CellShape::Linear = cell.shape() {
            for (place, weight) in cell_rule::<D>() {
                let value = of_place(&point(corners[..=D].iter().copied(), place))?;
                scatter(place, volume * weight, &value);
            }
            continue;
        }
        for (k, (place, weight)) in fine_cell_rule::<D>().iter().enumerate() {
            let shares = cell.shape().values::<D>(place);
            let coordinates = mesh.cell_nodes(number).map(|node| mesh.nodes[node as usize]);
            let value = of_place(&point(coordinates, &shares))?;
            let weight = match cell.shape() {
                CellShape::Curved(weights) | CellShape::LinearRing(weights) => {
                    factor * weights[k][cell.lane()]
                }
                _ => volume * weight,
            };
            scatter(&shares, weight, &value);
        }
    }
    Ok(())
}

fn point<const D: usize>(coordinates: impl Iterator<Item = Vector<D>>, shares: &[f64]) -> Vector<D> {
    let mut out = [0.0; D];
    for (coordinates, share) in coordinates.zip(shares) {
        for i in 0..D {
            out[i] += share * coordinates[i];
        }
    }
    out
}

/// The components at a time and point; refused where one is not finite.
pub(super) fn evaluate<const D: usize>(
    value: &[Scalar],
    time: f64,
    at: &Vector<D>,
    what: &str,
) -> Result<Vector<D>> {
    let mut out = [0.0; D];
    for (i, component) in value.iter().enumerate().take(D) {
        out[i] = finite(component, time, at, || format!("{what}: component {}", ["x", "y", "z"][i]))?;
    }
    Ok(out)
}

/// The value at a time and point; refused where it is not finite. `what` is what the message says of it.
pub(super) fn finite<const D: usize>(
    value: &Scalar,
    time: f64,
    at: &Vector<D>,
    what: impl Fn() -> String,
) -> Result<f64> {
    let number = value.evaluate(time, at);
    if number.is_finite() {
        return Ok(number);
    }
    let what = what();
    Err(Error::Failed(format!(
        "{what} is {number} at t = {time} s, position {at:?} m; correct the expression in the job"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Expression;

    #[test]
    fn loads_are_steady_where_neither_tractions_nor_body_forces_depend_on_time() {
        let of = |text: &str| vec![Scalar::Expression(Expression::parse(text).expect("an expression"))];
        let load = |traction: &str, force: &str| Load {
            tractions: vec![Traction { facets: Vec::new(), value: of(traction), pressure: None }],
            body_forces: vec![BodyForce { value: of(force) }],
            gravity: None,
        };
        assert!(load("x", "3*y").is_steady() && Load::default().is_steady());
        assert!(!load("t", "3*y").is_steady() && !load("x", "3*t").is_steady());
    }
}
