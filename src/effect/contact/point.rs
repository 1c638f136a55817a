//! A quadrature point of a contact boundary.

use crate::{
    contact::{NodeContext, NormalResponse, Resolved},
    mesh::{Mesh, shape::facet_normal},
    space::facet_rule,
    tensor::{Vector, norm},
};

/// What stands for the unknown at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unknown {
    /// The parameter of the law's graph, in place of the velocity along `direction`.
    Parameter,
    /// The velocity itself.
    Velocity,
    /// Nothing: supports hold all that the normal sees.
    Held,
}

/// A point where the law holds: its velocity is a mean of nodal ones, its pressure pushes the same nodes.
#[derive(Debug, Clone)]
pub(super) struct Point<const D: usize> {
    /// Local nodes; `count` of them are used.
    nodes: [u32; D],
    count: usize,
    /// Share of each node.
    shares: [f64; D],
    pub normal: Vector<D>,
    /// Quadrature weight in m^(D-1).
    pub weight: f64,
    /// Force on each node per pressure, without held components, in m^(D-1).
    push: [Vector<D>; D],
    /// At nodal points: the normal without held components, of length 1.
    pub direction: Vector<D>,
    /// Length that the normal has left without held components.
    pub stretch: f64,
    pub unknown: Unknown,
    /// Where the point was at first, in m.
    pub place: Vector<D>,
    /// What the step brings.
    pub context: NodeContext,
    /// `u_nu - gap` in m at the start of the step, both as they were then.
    pub penetration_before: f64,
    /// How far the gap grew in the step, in m.
    pub growth: f64,
    /// What is in the penetration beside the displacement at the start of the step, in m.
    pub shift: f64,
    /// Pressure in Pa at the last evaluation, where the unknown is the parameter.
    pub pressure: f64,
    /// Share of a change of the unknown that is a change of velocity, at the last linearisation: `c V'(s)`.
    pub theta: f64,
    /// Slope of the law at the last linearisation, in Pa s/m.
    pub slope: f64,
    /// Change of the pressure along the last direction, in Pa.
    pub change: f64,
}

impl<const D: usize> Point<D> {
    pub fn new(nodes: &[u32], shares: &[f64], normal: Vector<D>, weight: f64, fixed: &[bool]) -> Self {
        let mut point = Self {
            nodes: [0; D],
            count: nodes.len(),
            shares: [0.0; D],
            normal,
            weight,
            push: [[0.0; D]; D],
            direction: [0.0; D],
            stretch: 0.0,
            unknown: Unknown::Velocity,
            place: [0.0; D],
            context: NodeContext::default(),
            penetration_before: 0.0,
            growth: 0.0,
            shift: 0.0,
            pressure: 0.0,
            theta: 1.0,
            slope: 0.0,
            change: 0.0,
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

    /// A point at a node, whose unknown is the parameter of the law.
    pub fn nodal(node: u32, normal: Vector<D>, weight: f64, fixed: &[bool]) -> Self {
        let mut point = Self::new(&[node], &[1.0], normal, weight, fixed);
        let free: Vector<D> =
            std::array::from_fn(|i| if fixed[node as usize * D + i] { 0.0 } else { normal[i] });
        point.stretch = norm(&free);
        // A shorter rest is rounding in the normal of a face that supports hold.
        if point.stretch > 1e-9 {
            point.direction = free.map(|x| x / point.stretch);
            point.unknown = Unknown::Parameter;
        } else {
            point.push = [[0.0; D]; D];
            point.unknown = Unknown::Held;
        }
        point
    }

    /// The first of its nodes: the only one of a nodal point.
    pub fn node(&self) -> usize {
        self.nodes[0] as usize
    }

    /// Gives the only node of a nodal point another number.
    pub fn set_node(&mut self, node: usize) {
        self.nodes[0] = node as u32;
    }

    /// Nodes and shares.
    pub fn nodes(&self) -> impl Iterator<Item = (usize, f64)> {
        self.nodes[..self.count].iter().map(|&node| node as usize).zip(self.shares)
    }

    #[inline]
    pub fn normal_component(&self, nodal: &[f64]) -> f64 {
        let mut sum = 0.0;
        for a in 0..self.count {
            let value = &nodal[self.nodes[a] as usize * D..][..D];
            for i in 0..D {
                sum += self.shares[a] * self.normal[i] * value[i];
            }
        }
        sum
    }

    /// Length of the mean of nodal values.
    pub fn speed(&self, nodal: &[f64]) -> f64 {
        let mean = |i: usize| self.nodes().map(|(node, share)| share * nodal[node * D + i]).sum();
        norm::<D>(&std::array::from_fn(mean))
    }

    /// The component of a nodal value along the free part of the normal.
    #[inline]
    pub fn along(&self, nodal: &[f64]) -> f64 {
        let value = &nodal[self.node() * D..][..D];
        let mut sum = 0.0;
        for i in 0..D {
            sum += self.direction[i] * value[i];
        }
        sum
    }

    /// Adds to a nodal value along the free part of the normal.
    #[inline]
    pub fn add_along(&self, amount: f64, nodal: &mut [f64]) {
        let target = &mut nodal[self.node() * D..][..D];
        for i in 0..D {
            target[i] += amount * self.direction[i];
        }
    }

    #[inline]
    pub fn push(&self, pressure: f64, forces: &mut [f64]) {
        for a in 0..self.count {
            let target = &mut forces[self.nodes[a] as usize * D..][..D];
            for i in 0..D {
                target[i] += pressure * self.push[a][i];
            }
        }
    }

    /// The point of the law's graph that the unknown `along` the direction stands for.
    #[inline]
    pub fn resolve(&self, law: &NormalResponse, scale: f64, along: f64) -> Resolved {
        law.resolve(scale * self.stretch * along, scale, self.context)
    }

    /// The normal velocity in m/s that would close the gap in the step, without its sign; 0 for laws without a gap.
    pub fn context_velocity(&self) -> f64 {
        if self.context.step_length > 0.0 && self.can_touch() {
            (self.context.penetration / self.context.step_length).abs()
        } else {
            0.0
        }
    }

    /// Whether there is an obstacle along the normal.
    pub fn can_touch(&self) -> bool {
        self.context.penetration > f64::NEG_INFINITY
    }

    /// Pressure in Pa, given nodal velocities.
    pub fn pressure_at(&self, law: &NormalResponse, velocity: &[f64]) -> f64 {
        match self.unknown {
            Unknown::Parameter => self.pressure,
            Unknown::Velocity => law.pressure(self.normal_component(velocity), self.context),
            Unknown::Held => 0.0,
        }
    }

    /// The normal force per area that the residual leaves open here.
    pub fn open_pressure(&self, residual: &[f64]) -> f64 {
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

/// The Gauss points of a facet.
pub(super) fn gauss_points<const D: usize>(mesh: &Mesh<D>, facet: u32, fixed: &[bool]) -> Vec<Point<D>> {
    let nodes = mesh.facets[facet as usize];
    let normal = facet_normal(&nodes.map(|n| mesh.nodes[n as usize]));
    let measure = norm(&normal);
    let unit = normal.map(|x| x / measure);
    let rule = facet_rule::<D>().iter();
    rule.map(|(place, weight)| Point::new(&nodes, &place[..D], unit, measure * weight, fixed)).collect()
}
