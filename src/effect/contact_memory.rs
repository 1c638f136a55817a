use super::{
    Curvature, Energy, History, Step, StressError, SurfaceEffect, SurfaceState, node_history::NodeHistory,
};
use crate::{
    contact::Memory,
    error::{Error, Result},
    mesh::Mesh,
    space::SurfacePoint,
};

/// Foundations that remember, with the pressure `m` as one number a node.
///
/// Their force follows the displacement before the step, as elastic stress does: `w m_n nu` at a point of weight `w`, with
/// `m_n` from `m_{n-1}` and `u_{n-1}`. Its work against the body, `w m_n nu . (u_n - u_{n-1})`, is what the foundation takes
/// up, or gives back.
#[derive(Debug)]
pub struct ContactMemory<const D: usize> {
    /// One a node, in the order of nodes.
    points: Vec<(Memory, SurfacePoint<D>)>,
    pressure: NodeHistory,
}

impl<const D: usize> ContactMemory<D> {
    /// Foundations that remember nothing yet, each with its points at owned nodes. Refuses edges: a node has one memory.
    pub fn new(foundations: Vec<(Memory, Vec<SurfacePoint<D>>)>, mesh: &Mesh<D>) -> Result<Self> {
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
        Ok(Self { points, pressure: NodeHistory::new("memory_pressure", nodes, mesh.owned, 0.0) })
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
