use super::{
    Curvature, Energy, History, Step, StressError, SurfaceEffect, SurfaceState, node_history::NodeHistory,
};
use crate::{
    contact,
    space::SurfacePoint,
    tensor::{Vector, dot},
};

/// Bonds on contact boundaries, with the bonding `b` as one number a node.
///
/// Their force follows the displacement before the step, as elastic stress does:
/// `w b_n^2 t(u_{n-1})` at a point of weight `w`, with `b_n` from `b_{n-1}` and `u_{n-1}`. With the potential `F` of the law
/// the work against it is exactly
///
/// ```text
/// -w b_n^2 t(u_{n-1}) . (u_n - u_{n-1}) = d(w b^2 F(u)) + w (b_{n-1}^2 - b_n^2) F(u_{n-1}) - numerical
/// numerical = w b_n^2 (F(u_n) - F(u_{n-1}) + t(u_{n-1}) . (u_n - u_{n-1})).
/// ```
///
/// Faces of the body that meet at a node share its bonding, which follows from the sums over them.
#[derive(Debug)]
pub struct Adhesion<const D: usize> {
    laws: Vec<contact::Adhesion>,
    /// Points with the position of their law, those of a node together.
    points: Vec<(usize, SurfacePoint<D>)>,
    /// Points of each node that is bonded.
    counts: Vec<usize>,
    bonding: NodeHistory,
}

/// A law and the points where it holds.
#[derive(Debug)]
pub struct Bonded<const D: usize> {
    /// The law.
    pub law: contact::Adhesion,
    /// Points at nodes owned here.
    pub points: Vec<SurfacePoint<D>>,
}

impl<const D: usize> Adhesion<D> {
    /// Whole bonds at the points; the rank owns so many nodes.
    pub fn new(bonded: Vec<Bonded<D>>, owned: usize) -> Self {
        let (mut laws, mut points) = (Vec::new(), Vec::new());
        for Bonded { law, points: own } in bonded {
            points.extend(own.into_iter().map(|point| (laws.len(), point)));
            laws.push(law);
        }
        points.sort_by_key(|(_, point)| point.node);
        let groups = || points.chunk_by(|(_, a), (_, b)| a.node == b.node);
        let nodes = groups().map(|group| group[0].1.node).collect();
        let counts = groups().map(<[_]>::len).collect();
        Self { laws, counts, points, bonding: NodeHistory::new("bonding", nodes, owned, 1.0) }
    }

    /// The points of each node in turn.
    fn groups(&self) -> impl Iterator<Item = &[(usize, SurfacePoint<D>)]> {
        let mut rest = &self.points[..];
        self.counts.iter().map(move |&count| {
            let (group, behind) = rest.split_at(count);
            rest = behind;
            group
        })
    }
}

fn at<const D: usize>(nodal: &[f64], point: &SurfacePoint<D>) -> Vector<D> {
    std::array::from_fn(|i| nodal[point.node as usize * D + i])
}

fn push<const D: usize>(point: &SurfacePoint<D>, factor: f64, value: &Vector<D>, forces: &mut [f64]) {
    let target = &mut forces[point.node as usize * D..][..D];
    target.iter_mut().zip(value).for_each(|(force, value)| *force += factor * value);
}

impl<const D: usize> SurfaceEffect<D> for Adhesion<D> {
    fn name(&self) -> &'static str {
        "adhesion"
    }

    fn add_explicit(&mut self, step: Step, state: SurfaceState<'_>, forces: &mut [f64], energy: &mut Energy) {
        let mut trial = std::mem::take(&mut self.bonding.trial);
        for ((group, before), after) in self.groups().zip(&self.bonding.converged).zip(&mut trial) {
            let (mut drive, mut threshold, mut viscosity, mut potential) = (0.0, 0.0, 0.0, 0.0);
            for (law, point) in group {
                let (law, displacement) = (&self.laws[*law], at(state.displacement, point));
                drive += point.weight * law.drive(&displacement, &point.normal);
                threshold += point.weight * law.energy;
                viscosity += point.weight * law.viscosity;
                potential += point.weight * law.potential(&displacement, &point.normal);
            }
            *after = contact::Adhesion::advance(*before, drive, threshold, viscosity, step.length);
            energy.debonding += (before * before - *after * *after) * potential;
            for (law, point) in group {
                let traction = self.laws[*law].traction(&at(state.displacement, point), &point.normal);
                push(point, point.weight * *after * *after, &traction, forces);
            }
        }
        self.bonding.trial = trial;
    }

    fn add_energy(&self, step: Step, state: SurfaceState<'_>, energy: &mut Energy) {
        for (group, bonding) in self.groups().zip(&self.bonding.converged) {
            for (law, point) in group {
                let (law, normal) = (&self.laws[*law], &point.normal);
                let displacement = at(state.displacement, point);
                let change = at(state.velocity, point).map(|v| step.length * v);
                let before = std::array::from_fn(|i| displacement[i] - change[i]);
                let share = point.weight * bonding * bonding;
                let potential = law.potential(&displacement, normal);
                let gain = potential - law.potential(&before, normal);
                energy.stored_in_bonds += share * potential;
                energy.numerical += share * (gain + dot(&law.traction(&before, normal), &change));
            }
        }
    }

    /// Bonds count as springs: an error `e` of `b^2` is one of `e` times the force of whole bonds.
    fn add_error(&self, curvature: Curvature, state: SurfaceState<'_>, error: &mut StressError) {
        for (group, bonding) in self.groups().zip(self.bonding.last_three()) {
            let off = curvature.error(bonding.map(|b| b * b));
            for (law, point) in group {
                let potential = self.laws[*law].potential(&at(state.displacement, point), &point.normal);
                let twice = 2.0 * point.weight * potential;
                error.error += off * off * twice;
                error.size += bonding[0] * bonding[0] * twice;
            }
        }
    }

    fn keep_earlier(&mut self) {
        self.bonding.keep_earlier("previous_bonding");
    }

    fn is_elastic(&self) -> bool {
        true
    }

    fn add_stiffness(&self, x: &[f64], forces: &mut [f64]) {
        for (law, point) in &self.points {
            let (law, x) = (&self.laws[*law], at(x, point));
            let along = dot(&x, &point.normal);
            let more = law.stiffness - law.tangential_stiffness;
            push(point, point.weight * law.tangential_stiffness, &x, forces);
            push(point, point.weight * more * along, &point.normal, forces);
        }
    }

    fn commit(&mut self) {
        self.bonding.commit();
    }

    fn histories(&self) -> Vec<History<'_>> {
        vec![self.bonding.history()]
    }

    fn earlier_histories(&self) -> Vec<History<'_>> {
        self.bonding.earlier_history().into_iter().collect()
    }

    fn restore(&mut self, name: &str, values: &[f64]) {
        self.bonding.restore(name, values);
    }
}
