use super::{
    Blend, Curvature, Energy, History, Step, StressError, SurfaceEffect, SurfaceState, SurfaceStep, Tangents,
    node_history::NodeHistory,
};
use crate::{
    contact::Memory,
    error::{Error, Result},
    mesh::Mesh,
    space::SurfacePoint,
};

/// Foundations that remember, with the pressure `m` as one number a node.
///
/// Their force is `w m_n nu` at a point of weight `w`. Explicitly `m_n` follows from `m_{n-1}` and `u_{n-1}`, which counts as held; in an
/// implicit step from `m_{n-1}` and both `u_{n-1}` and `u_n`, between which the displacement moves steadily: of second order whatever
/// the scheme. The work against the body, `k w m_n nu . v_n`, is what the foundation takes up, or gives back.
#[derive(Debug)]
pub struct ContactMemory<const D: usize> {
    /// One a node, in the order of nodes.
    points: Vec<(Memory, SurfacePoint<D>)>,
    pressure: NodeHistory,
    is_implicit: bool,
    /// How an implicit step starts, its length in s, and the normal displacements before it in m.
    blend: Blend,
    length: f64,
    before: Vec<f64>,
    /// Derivatives of the pressures by the normal displacements at the end of an implicit step, in Pa/m.
    slopes: Vec<f64>,
}

impl<const D: usize> ContactMemory<D> {
    /// Foundations that remember nothing yet, each with its points at owned nodes, and follow the displacement before steps or at
    /// their end. Refuses edges: a node has one memory.
    pub fn new(
        foundations: Vec<(Memory, Vec<SurfacePoint<D>>)>,
        mesh: &Mesh<D>,
        is_implicit: bool,
    ) -> Result<Self> {
        let of_each = foundations.into_iter();
        let mut points: Vec<(Memory, SurfacePoint<D>)> =
            of_each.flat_map(|(law, points)| points.into_iter().map(move |point| (law, point))).collect();
        points.sort_by_key(|(_, point)| point.node);
        if let Some(pair) = points.windows(2).find(|pair| pair[0].1.node == pair[1].1.node) {
            return Err(Error::Refused(format!(
                "contact memory at {:?} m: two boundaries meet at an edge there, and a node remembers one displacement only; \
                 round the edge with facets that turn by less than 40 degrees each, or give the memory to one of them",
                mesh.nodes[pair[0].1.node as usize]
            )));
        }
        let nodes = points.iter().map(|(_, point)| point.node).collect();
        Ok(Self {
            points,
            pressure: NodeHistory::new("memory_pressure", nodes, mesh.owned, 0.0),
            is_implicit,
            blend: Blend::euler(0.0),
            length: 0.0,
            before: Vec::new(),
            slopes: Vec::new(),
        })
    }
}

fn along<const D: usize>(nodal: &[f64], point: &SurfacePoint<D>) -> f64 {
    let value = &nodal[point.node as usize * D..][..D];
    value.iter().zip(&point.normal).map(|(value, normal)| value * normal).sum()
}

/// Adds a force along the normal, out of the body if it is positive.
fn push<const D: usize>(point: &SurfacePoint<D>, force: f64, forces: &mut [f64]) {
    let target = &mut forces[point.node as usize * D..][..D];
    target.iter_mut().zip(&point.normal).for_each(|(target, normal)| *target += force * normal);
}

impl<const D: usize> SurfaceEffect<D> for ContactMemory<D> {
    fn name(&self) -> &'static str {
        "contact_memory"
    }

    fn add_explicit(&mut self, step: Step, state: SurfaceState<'_>, forces: &mut [f64], _: &mut Energy) {
        let pressures = self.pressure.converged.iter().zip(&mut self.pressure.trial);
        for ((law, point), (before, after)) in self.points.iter().zip(pressures) {
            *after = law.advance(*before, along(state.displacement, point), step.length);
            push(point, -point.weight * *after, forces);
        }
    }

    fn is_implicit(&self) -> bool {
        self.is_implicit
    }

    fn begin(&mut self, blend: Blend, length: f64, displacement: &[f64]) {
        (self.blend, self.length) = (blend, length);
        self.before.clear();
        self.before.extend(self.points.iter().map(|(_, point)| along(displacement, point)));
    }

    fn advance(&mut self, displacement: &[f64]) {
        self.slopes.clear();
        let pressures = self.pressure.converged.iter().zip(&mut self.pressure.trial);
        for (((law, point), (before, after)), start) in self.points.iter().zip(pressures).zip(&self.before) {
            let slope;
            [*after, slope] = law.follow(*before, [*start, along(displacement, point)], self.length);
            self.slopes.push(slope);
        }
    }

    fn add_forces(&self, _: &[f64], mut tangents: Option<&mut Tangents>, forces: &mut [f64]) {
        for (((_, point), pressure), slope) in self.points.iter().zip(&self.pressure.trial).zip(&self.slopes)
        {
            push(point, point.weight * pressure, forces);
            if let Some(tangents) = &mut tangents {
                let stiffness = self.blend.length * point.weight * slope;
                tangents.push_node(
                    point.node,
                    &point.normal.map(|n| point.normal.map(|m| stiffness * n * m)),
                    true,
                );
            }
        }
    }

    /// Nothing: what the pressure takes up is counted with that of the normal law.
    fn add_implicit_energy(&self, _: Step, _: SurfaceStep<'_>, _: &mut Energy) {}

    fn add_energy(&self, step: Step, state: SurfaceState<'_>, energy: &mut Energy) {
        for ((_, point), pressure) in self.points.iter().zip(&self.pressure.converged) {
            energy.contact += point.weight * pressure * step.length * along(state.velocity, point);
        }
    }

    /// The foundation counts as the spring that it is against what is held for long.
    fn add_error(&self, curvature: Curvature, _: SurfaceState<'_>, error: &mut StressError) {
        for ((law, point), pressure) in self.points.iter().zip(self.pressure.last_three()) {
            let stiffness = law.stiffness();
            if stiffness > 0.0 {
                let off = curvature.error(pressure);
                error.error += point.weight * off * off / stiffness;
                error.size += point.weight * pressure[0] * pressure[0] / stiffness;
            }
        }
    }

    fn keep_earlier(&mut self) {
        self.pressure.keep_earlier("previous_memory_pressure");
    }

    fn is_elastic(&self) -> bool {
        true
    }

    fn add_stiffness(&self, x: &[f64], forces: &mut [f64]) {
        for (law, point) in &self.points {
            push(point, point.weight * law.stiffness() * along(x, point), forces);
        }
    }

    fn commit(&mut self) {
        self.pressure.commit();
    }

    fn histories(&self) -> Vec<History<'_>> {
        vec![self.pressure.history()]
    }

    fn earlier_histories(&self) -> Vec<History<'_>> {
        self.pressure.earlier_history().into_iter().collect()
    }

    fn restore(&mut self, name: &str, values: &[f64]) {
        self.pressure.restore(name, values);
    }
}
