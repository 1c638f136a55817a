//! Contact: a law at the quadrature points of a boundary.

use crate::{
    contact::Graph,
    error::Result,
    mesh::{Mesh, shape::facet_normal},
    session::Session,
    space::{facet_rule, surface_points},
    tensor::{Vector, norm},
};

/// Where on a facet the law holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quadrature {
    /// At its nodes (trapezoidal rule).
    Nodal,
    /// At Gauss points.
    Gauss,
}

/// A point where the law holds: its velocity is a mean of nodal ones, its pressure pushes the same nodes.
#[derive(Debug, Clone)]
struct Point<const D: usize> {
    /// Local nodes; `count` of them are used.
    nodes: [u32; D],
    count: usize,
    /// Share of each node.
    shares: [f64; D],
    normal: Vector<D>,
    /// Quadrature weight in m^(D-1).
    weight: f64,
    /// Force on each node per pressure, without held components, in m^(D-1).
    push: [Vector<D>; D],
    /// Slope of the law at the last point of linearisation, in Pa s/m.
    slope: f64,
}

impl<const D: usize> Point<D> {
    fn new(nodes: &[u32], shares: &[f64], normal: Vector<D>, weight: f64, fixed: &[bool]) -> Self {
        let mut point = Self {
            nodes: [0; D],
            count: nodes.len(),
            shares: [0.0; D],
            normal,
            weight,
            push: [[0.0; D]; D],
            slope: 0.0,
        };
        for (a, (&node, &share)) in nodes.iter().zip(shares).enumerate() {
            (point.nodes[a], point.shares[a]) = (node, share);
            for i in 0..D {
                if !fixed[node as usize * D + i] {
                    point.push[a][i] = weight * share * normal[i];
                }
            }
        }
        point
    }

    #[inline]
    fn normal_component(&self, nodal: &[f64]) -> f64 {
        let mut sum = 0.0;
        for a in 0..self.count {
            let value = &nodal[self.nodes[a] as usize * D..][..D];
            for i in 0..D {
                sum += self.shares[a] * self.normal[i] * value[i];
            }
        }
        sum
    }

    #[inline]
    fn push(&self, pressure: f64, forces: &mut [f64]) {
        for a in 0..self.count {
            let target = &mut forces[self.nodes[a] as usize * D..][..D];
            for i in 0..D {
                target[i] += pressure * self.push[a][i];
            }
        }
    }

    /// The normal force per area that the residual leaves open here.
    fn open_pressure(&self, residual: &[f64]) -> f64 {
        let mut largest = 0.0f64;
        for a in 0..self.count {
            let at = self.nodes[a] as usize * D;
            let Some(value) = residual.get(at..at + D) else { continue };
            let share: f64 = (0..D).map(|i| self.push[a][i] * self.push[a][i]).sum::<f64>().sqrt();
            let along: f64 = (0..D).map(|i| self.push[a][i] * value[i]).sum();
            if share > 0.0 && (along / (share * share)).abs() > largest.abs() {
                largest = along / (share * share);
            }
        }
        largest
    }
}

/// A law on a contact boundary.
#[derive(Debug)]
pub struct Contact<const D: usize> {
    /// The law.
    pub graph: Graph,
    facets: Vec<u32>,
    points: Vec<Point<D>>,
    needs_ghosts: bool,
}

impl<const D: usize> Contact<D> {
    /// Puts the law on these facets of this rank. `fixed` has one flag a local component. Collective.
    pub fn new(
        session: &Session,
        mesh: &Mesh<D>,
        facets: &[u32],
        quadrature: Quadrature,
        graph: Graph,
        fixed: &[bool],
    ) -> Result<Self> {
        let points = match quadrature {
            Quadrature::Nodal => surface_points(session, mesh, facets)?
                .into_iter()
                .map(|p| Point::new(&[p.node], &[1.0], p.normal, p.weight, fixed))
                .collect(),
            Quadrature::Gauss => facets.iter().flat_map(|&f| gauss_points(mesh, f, fixed)).collect(),
        };
        Ok(Self { graph, facets: facets.to_vec(), points, needs_ghosts: quadrature == Quadrature::Gauss })
    }

    /// Whether velocities of ghost nodes are read and forces on them written.
    pub fn needs_ghosts(&self) -> bool {
        self.needs_ghosts
    }

    /// Quadrature points on this rank.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Facets of this rank, local numbers.
    pub fn facets(&self) -> &[u32] {
        &self.facets
    }

    /// Adds the normals at the points to nodal values.
    pub fn add_normals(&self, nodal: &mut [f64]) {
        for point in self.points.iter().filter(|p| p.count == 1) {
            let target = &mut nodal[point.nodes[0] as usize * D..][..D];
            target.iter_mut().zip(point.normal).for_each(|(value, n)| *value += n);
        }
    }

    /// Adds the contact forces `C(v)` in N to `forces`.
    pub fn add_forces(&self, velocity: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            point.push(self.graph.pressure(point.normal_component(velocity)), forces);
        }
    }

    /// Takes the slopes of the law at these velocities.
    pub fn linearise(&mut self, velocity: &[f64]) {
        for point in &mut self.points {
            point.slope = self.graph.slope(point.normal_component(velocity));
        }
    }

    /// Adds the change of the contact forces along `direction`.
    pub fn add_derivative(&self, direction: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            point.push(point.slope * point.normal_component(direction), forces);
        }
    }

    /// Adds to `counts` the weight-free number of points on each branch of the graph.
    pub fn count_branches(&self, velocity: &[f64], counts: &mut [u32]) {
        for point in &self.points {
            counts[self.graph.branch(point.normal_component(velocity))] += 1;
        }
    }

    /// The branch of every point, to count changes of the active set.
    pub fn branches(&self, velocity: &[f64], out: &mut Vec<u8>) {
        let branch = |p: &Point<D>| self.graph.branch(p.normal_component(velocity)).min(255) as u8;
        out.extend(self.points.iter().map(branch));
    }

    /// Power dissipated in W.
    pub fn dissipation(&self, velocity: &[f64]) -> f64 {
        let power = |p: &Point<D>| {
            let v = p.normal_component(velocity);
            p.weight * self.graph.pressure(v) * v
        };
        self.points.iter().map(power).sum()
    }

    /// Largest scaled distance of (normal velocity, pressure from equilibrium) to the graph. `residual` holds what is
    /// left of the equations of motion at the owned nodes, in N.
    pub fn inclusion_residual(&self, velocity: &[f64], residual: &[f64]) -> f64 {
        let distance = |p: &Point<D>| {
            let v = p.normal_component(velocity);
            self.graph.distance(v, self.graph.pressure(v) - p.open_pressure(residual))
        };
        self.points.iter().map(distance).fold(0.0, f64::max)
    }
}

fn gauss_points<const D: usize>(mesh: &Mesh<D>, facet: u32, fixed: &[bool]) -> Vec<Point<D>> {
    let nodes = mesh.facets[facet as usize];
    let normal = facet_normal(&nodes.map(|n| mesh.nodes[n as usize]));
    let measure = norm(&normal);
    let unit = normal.map(|x| x / measure);
    let rule = facet_rule::<D>().iter();
    rule.map(|(place, weight)| Point::new(&nodes, &place[..D], unit, measure * weight, fixed)).collect()
}
