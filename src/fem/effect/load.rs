//! Tractions and body forces.

use super::{EnergyKind, Role};
use crate::{
    error::{Error, Result},
    fem::space::{CellShape, Geometry, cell_rule, facet_points, fine_cell_rule, values},
    job::{BodyForce, Scalar},
    linear_algebra::tensor::Vector,
    mesh::Mesh,
};

/// Work of loads and of obstacles that move.
pub const WORK: EnergyKind = EnergyKind::new(5, Role::Work, "external_work");

/// A force per area on facets of this rank.
#[derive(Debug)]
pub struct Traction {
    /// Local facets.
    pub facets: Vec<u32>,
    /// One component an axis, in Pa.
    pub value: Vec<Scalar>,
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
                let value = evaluate(&self.value, time, &point.place, "traction")?;
                for (node, share) in nodes.clone().zip(point.shares) {
                    visit(node, value.map(|value| point.weight * share * value));
                }
            }
        }
        Ok(())
    }
}

/// All loads of a job.
#[derive(Debug, Default)]
pub struct Load {
    /// Forces on the surface.
    pub tractions: Vec<Traction>,
    /// Forces in the interior.
    pub body_forces: Vec<BodyForce>,
}

impl Load {
    /// Whether there is any load.
    pub fn is_empty(&self) -> bool {
        self.tractions.is_empty() && self.body_forces.is_empty()
    }

    /// Whether the nodal forces are the same at all times.
    pub fn is_steady(&self) -> bool {
        let values = self.tractions.iter().map(|t| &t.value).chain(self.body_forces.iter().map(|b| &b.value));
        !values.flatten().any(Scalar::depends_on_time)
    }

    /// Adds the nodal forces at `time` to `forces` (`D` a local node, ghosts to be added to their owners), by
    /// quadrature of degree 2, on quadratic cells of degree 4.
    pub fn add<const D: usize>(
        &self,
        mesh: &Mesh<D>,
        geometry: &Geometry<D>,
        time: f64,
        forces: &mut [f64],
    ) -> Result<()> {
        for traction in &self.tractions {
            traction.forces(mesh, time, |node, force| add_at(forces, node, &force))?;
        }
        for body_force in &self.body_forces {
            for (number, cell) in geometry.cells().enumerate() {
                let (volume, corners) = (cell.whole().volume, mesh.corners(number));
                if let CellShape::Linear = cell.shape() {
                    let nodes = mesh.cell(number).iter().copied();
                    for (place, weight) in cell_rule::<D>() {
                        let at = point(corners[..=D].iter().copied(), place);
                        let value = evaluate(&body_force.value, time, &at, "body_force")?;
                        scatter(forces, nodes.clone(), place, volume * weight, &value);
                    }
                    continue;
                }
                for (k, (place, weight)) in fine_cell_rule::<D>().iter().enumerate() {
                    let shares = values(D + 1, place);
                    let coordinates = mesh.cell_nodes(number).map(|node| mesh.nodes[node as usize]);
                    let at = point(coordinates, &shares);
                    let value = evaluate(&body_force.value, time, &at, "body_force")?;
                    let weight = match cell.shape() {
                        CellShape::Curved(weights) => weights[k][cell.lane()],
                        _ => volume * weight,
                    };
                    scatter(forces, mesh.cell_nodes(number), &shares, weight, &value);
                }
            }
        }
        Ok(())
    }
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

fn scatter<const D: usize>(
    forces: &mut [f64],
    nodes: impl Iterator<Item = u32>,
    shares: &[f64],
    weight: f64,
    value: &Vector<D>,
) {
    for (node, share) in nodes.zip(shares) {
        add_at(forces, node, &value.map(|value| weight * share * value));
    }
}

fn add_at<const D: usize>(forces: &mut [f64], node: u32, force: &Vector<D>) {
    for i in 0..D {
        forces[node as usize * D + i] += force[i];
    }
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
        out[i] = component.evaluate(time, at);
        if !out[i].is_finite() {
            return Err(Error::Failed(format!(
                "{what}: component {} is {} at t = {time} s, position {at:?} m; correct the expression in the job",
                ["x", "y", "z"][i],
                out[i]
            )));
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Expression;

    #[test]
    fn loads_are_steady_where_neither_tractions_nor_body_forces_depend_on_time() {
        let of = |text: &str| vec![Scalar::Expression(Expression::parse(text).expect("an expression"))];
        let load = |traction: &str, force: &str| Load {
            tractions: vec![Traction { facets: Vec::new(), value: of(traction) }],
            body_forces: vec![BodyForce { value: of(force) }],
        };
        assert!(load("x", "3*y").is_steady() && Load::default().is_steady());
        assert!(!load("t", "3*y").is_steady() && !load("x", "3*t").is_steady());
    }
}
