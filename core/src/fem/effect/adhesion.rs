use super::{
    Curvature, Energy, EnergyKind, Evaluation, HistoryStore, NUMERICAL, Outcome, Role, Step, StressError,
    SurfaceEffect, SurfaceForce, Tangents, contact::tangents, evolution::IrreversibleStep,
    node_history::NodeHistory, quantity,
};
use crate::{
    fem::space::{Nodal, SurfacePoint},
    laws::contact::{self, Toughness},
    linear_algebra::tensor::{Vector, add_scaled, dot},
};

/// Stored in stretched adhesive bonds.
pub const STORED_IN_BONDS: EnergyKind =
    EnergyKind::new(9, Role::Stored, "adhesion_energy", "energy stored in bonds");
/// Dissipated by bonds that break.
pub const DEBONDING: EnergyKind = EnergyKind::new(
    10,
    Role::Dissipated,
    "adhesion_dissipation",
    "dissipated by breaking bonds since time 0",
);

/// Adhesion on contact boundaries, with one bonding `b` for each node.
///
/// With laws evaluated at the converged state the force at a point of weight `w` is `w b_n^2 t(u_{n-1})`, with `b_n` from `b_{n-1}` and
/// `u_{n-1}`. With the potential `F` of the law the work against it is exactly
///
/// ```text
/// -w b_n^2 t(u_{n-1}) . (u_n - u_{n-1}) = d(w b^2 F(u)) + released - numerical
/// released = w (b_{n-1}^2 - b_n^2) F(u_{n-1})
/// numerical = w b_n^2 (F(u_n) - F(u_{n-1}) + t(u_{n-1}) . (u_n - u_{n-1})).
/// ```
///
/// In an implicit step the force is `w b_n^2 t(u_n)` with `b_n` from `u_n`, and
///
/// ```text
/// -k w b_n^2 t(u_n) . v_n = d(w b^2 F(u)) + released - numerical
/// released = w (b_{n-1}^2 - b_n^2) (F(u_{n-1}) + F(u_n)) / 2
/// numerical = w (b_{n-1}^2 + b_n^2) / 2 (F(u_n) - F(u_{n-1})) + k w b_n^2 t(u_n) . v_n.
/// ```
///
/// In a long step `released` may be many times the energy of the bonds, because `F` continues to grow. The dissipated energy is that
/// of the law, [`Toughness::dissipated`], and the rest of `released` is numerical; with a truncation length it is all dissipated.
///
/// Faces of the body that meet at a node share its bonding, which follows from the sums over them.
#[derive(Debug)]
pub struct Adhesion<const D: usize> {
    laws: Vec<contact::Adhesion>,
    /// Positions of the contacts of the laws among those of the job.
    contacts: Vec<usize>,
    /// Points with the position of their law, those of a node together.
    points: Vec<(usize, SurfacePoint<D>)>,
    /// Points of each node that is bonded.
    counts: Vec<usize>,
    bonding: NodeHistory,
    /// Derivatives of the bonding by the drives of nodes at the end of an implicit step, in 1/J.
    slopes: Vec<f64>,
}

/// A law and the points where it holds.
#[derive(Debug)]
pub struct Bonded<const D: usize> {
    /// Position of its contact among those of the job.
    pub contact: usize,
    /// The law.
    pub law: contact::Adhesion,
    /// Points at nodes owned here.
    pub points: Vec<SurfacePoint<D>>,
}

impl<const D: usize> Adhesion<D> {
    /// Whole bonds at the points; the rank owns so many nodes.
    pub fn new(bonded: Vec<Bonded<D>>, owned: usize) -> Self {
        let (mut laws, mut contacts, mut points) = (Vec::new(), Vec::new(), Vec::new());
        for Bonded { contact, law, points: own } in bonded {
            points.extend(own.into_iter().map(|point| (laws.len(), point)));
            laws.push(law);
            contacts.push(contact);
        }
        points.sort_by_key(|(_, point)| point.node);
        let groups = || points.chunk_by(|(_, a), (_, b)| a.node == b.node);
        let nodes = groups().map(|group| group[0].1.node).collect();
        let counts = groups().map(<[_]>::len).collect();
        Self {
            laws,
            contacts,
            counts,
            points,
            bonding: NodeHistory::new(quantity!("bonding"), nodes, owned, 1.0),
            slopes: Vec::new(),
        }
    }

    /// Sums over the points of a node: driving force in J, and what opposes debonding. At the corners of quadratic facets in space, whose
    /// points have no weight, the bonding follows from sums with equal weights; it has no forces.
    fn drive(&self, group: &[(usize, SurfacePoint<D>)], displacement: &[f64]) -> (f64, Toughness) {
        let (mut drive, mut toughness) = (0.0, Toughness::default());
        for (law, point) in group {
            let law = &self.laws[*law];
            let weight = if point.weight > 0.0 { point.weight } else { 1.0 };
            drive += weight * law.drive(&point.value(displacement), &point.normal);
            toughness.add(weight, &law.toughness());
        }
        (drive, toughness)
    }

    /// Books the energy in J that bonds at the points of a node release in a step of this length in which the bonding falls from the
    /// first value to the second.
    fn record_energy(
        &self,
        group: &[(usize, SurfacePoint<D>)],
        bondings: [f64; 2],
        (released, length): (f64, f64),
        energy: &mut Energy,
    ) {
        let mut toughness = Toughness::default();
        group.iter().for_each(|(law, point)| toughness.add(point.weight, &self.laws[*law].toughness()));
        let is_truncated = group.iter().any(|(law, _)| self.laws[*law].length.is_some());
        let dissipated = if is_truncated { released } else { toughness.dissipated(bondings, length) };
        energy[DEBONDING] += dissipated;
        energy[NUMERICAL] += dissipated - released;
    }

    /// Energy in J that intact bonds at the points of a node store.
    fn potential(&self, group: &[(usize, SurfacePoint<D>)], displacement: &[f64]) -> f64 {
        let of_point = |(law, point): &(usize, SurfacePoint<D>)| {
            point.weight * self.laws[*law].potential(&point.value(displacement), &point.normal)
        };
        group.iter().map(of_point).sum()
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

    /// Advances the bonding with the converged displacement and adds the forces of the bonds.
    fn add_explicit(&mut self, step: Step, displacement: &[f64], forces: &mut [f64], energy: &mut Energy) {
        let mut trial = std::mem::take(&mut self.bonding.trial);
        for ((group, before), after) in self.groups().zip(&self.bonding.converged).zip(&mut trial) {
            let (drive, toughness) = self.drive(group, displacement);
            [*after, _] = toughness.relax(*before, drive, step.length);
            let released = (before * before - *after * *after) * self.potential(group, displacement);
            self.record_energy(group, [*before, *after], (released, step.length), energy);
            for (law, point) in group {
                let traction = self.laws[*law].traction(&point.value(displacement), &point.normal);
                point.add(point.weight * *after * *after, &traction, forces);
            }
        }
        self.bonding.trial = trial;
    }

    /// Advances the bonding with the displacement at the end of a step.
    fn advance(&mut self, evolution: IrreversibleStep, displacement: &[f64]) {
        let mut trial = std::mem::take(&mut self.bonding.trial);
        let mut slopes = std::mem::take(&mut self.slopes);
        slopes.clear();
        for (node, (group, after)) in self.groups().zip(&mut trial).enumerate() {
            let (drive, toughness) = self.drive(group, displacement);
            let relax = |start, length| toughness.relax(start, drive, length);
            let (before, last) = (self.bonding.converged[node], self.bonding.last_change(node));
            let slope;
            [*after, slope] = evolution.advance(before, last, relax);
            slopes.push(slope);
        }
        (self.bonding.trial, self.slopes) = (trial, slopes);
    }

    /// Adds minus the forces at the end of a step in which the displacement changes by `length` in s times its rate, for the
    /// displacement that the bonding was last advanced to.
    fn add_forces(
        &self,
        length: f64,
        displacement: &[f64],
        mut tangents: Option<&mut Tangents>,
        forces: &mut [f64],
    ) {
        for ((group, bonding), slope) in self.groups().zip(&self.bonding.trial).zip(&self.slopes) {
            let square = bonding * bonding;
            let (mut pull, mut gradient, mut tangent) = ([0.0; D], [0.0; D], [[0.0; D]; D]);
            let mut truncated = false;
            for (law, point) in group {
                let (law, normal) = (&self.laws[*law], &point.normal);
                let displacement = point.value(displacement);
                pull = add_scaled(&pull, point.weight, &law.traction(&displacement, normal));
                if tangents.is_some() {
                    let own = law.tangent(&displacement, normal);
                    tangent =
                        std::array::from_fn(|i| add_scaled(&tangent[i], point.weight * square, &own[i]));
                    gradient =
                        add_scaled(&gradient, point.weight, &law.drive_gradient(&displacement, normal));
                    truncated |= law.length.is_some();
                }
            }
            let Some((_, point)) = group.first() else { continue };
            point.add(-square, &pull, forces);
            if let Some(tangents) = &mut tangents {
                let slope = tangents.softening() * slope;
                // The bonding depends on the displacement. Traction and gradient of the drive are parallel unless a length is truncated.
                let tangent = std::array::from_fn(|i| {
                    add_scaled(&tangent[i], -2.0 * bonding * slope * pull[i], &gradient).map(|t| length * t)
                });
                tangents.push_node(point.node, &tangent, !truncated || slope == 0.0);
            }
        }
    }
}

impl<const D: usize> SurfaceEffect<D> for Adhesion<D> {
    fn name(&self) -> &'static str {
        "adhesion"
    }

    fn softens(&self) -> bool {
        true
    }

    fn nodes(&self) -> Vec<u32> {
        self.points.iter().filter(|(_, point)| point.weight > 0.0).map(|(_, point)| point.node).collect()
    }

    fn holding_directions(&self) -> Vec<(usize, Vector<D>)> {
        let mut all = Vec::new();
        for (group, bonding) in self.groups().zip(&self.bonding.converged) {
            // Of several faces at a node one is enough: its bonds hold the whole motion, unless they slide freely.
            let bond = group.iter().find(|(_, point)| point.weight > 0.0 && *bonding > 0.0);
            let Some((law, point)) = bond else { continue };
            let (law, node) = (&self.laws[*law], point.node as usize);
            all.push((node, point.normal));
            if law.tangential_stiffness() > 0.0 {
                all.extend(tangents(&point.normal).map(|tangent| (node, tangent)));
            }
        }
        all
    }

    fn evaluate(
        &mut self,
        at: Evaluation,
        step: Step,
        displacement: &[f64],
        forces: &mut [f64],
        outcome: &mut Outcome,
    ) {
        match at {
            Evaluation::Converged => self.add_explicit(step, displacement, forces, &mut outcome.energy),
            Evaluation::Start(_) => {}
            Evaluation::End(blend) => {
                self.advance(IrreversibleStep { blend, length: step.length }, displacement);
                self.add_forces(blend.length, displacement, outcome.tangents.as_deref_mut(), forces);
            }
        }
    }

    fn add_energy(&self, at: Evaluation, step: Step, nodal: Nodal<'_>, energy: &mut Energy) {
        for (group, bonding) in self.groups().zip(&self.bonding.converged) {
            for (law, point) in group {
                let (law, normal) = (&self.laws[*law], &point.normal);
                let displacement = point.value(nodal.displacement);
                let share = point.weight * bonding * bonding;
                let potential = law.potential(&displacement, normal);
                energy[STORED_IN_BONDS] += share * potential;
                if at == Evaluation::Converged {
                    let change = point.value(nodal.velocity).map(|v| step.length * v);
                    let before = std::array::from_fn(|i| displacement[i] - change[i]);
                    let gain = potential - law.potential(&before, normal);
                    energy[NUMERICAL] += share * (gain + dot(&law.traction(&before, normal), &change));
                }
            }
        }
    }

    fn add_step_energy(&mut self, at: Evaluation, step: Step, nodal: Nodal<'_>, energy: &mut Energy) {
        let Evaluation::End(blend) = at else { return };
        self.advance(IrreversibleStep { blend, length: step.length }, nodal.displacement);
        let bondings = self.bonding.converged.iter().zip(&self.bonding.trial);
        for (group, (bonding, next)) in self.groups().zip(bondings) {
            let (before, after) = (bonding * bonding, next * next);
            let ends = [nodal.previous_displacement, nodal.displacement];
            let potentials = ends.map(|displacement| self.potential(group, displacement));
            let released = (before - after) * 0.5 * (potentials[0] + potentials[1]);
            self.record_energy(group, [*bonding, *next], (released, step.length), energy);
            energy[NUMERICAL] += 0.5 * (before + after) * (potentials[1] - potentials[0]);
            for (law, point) in group {
                let traction = self.laws[*law].traction(&point.value(nodal.displacement), &point.normal);
                energy[NUMERICAL] +=
                    step.length * point.weight * after * dot(&traction, &point.value(nodal.velocity));
            }
        }
    }

    fn write_forces(&self, at: Evaluation, step: Step, nodal: Nodal<'_>, forces: &mut Vec<SurfaceForce<D>>) {
        // Laws at the converged state have the displacement before the step.
        let length = if at == Evaluation::Converged { step.length } else { 0.0 };
        for (group, bonding) in self.groups().zip(&self.bonding.converged) {
            for (law, point) in group {
                let displacement =
                    add_scaled(&point.value(nodal.displacement), -length, &point.value(nodal.velocity));
                let traction = self.laws[*law].traction(&displacement, &point.normal);
                let force = traction.map(|t| point.weight * bonding * bonding * t);
                forces.push(SurfaceForce {
                    contact: self.contacts[*law],
                    node: point.node,
                    weight: point.weight,
                    force,
                });
            }
        }
    }

    /// Bonds count as springs: an error `e` of `b^2` is one of `e` times the force of whole bonds.
    fn add_error(&self, curvature: Curvature, displacement: &[f64], error: &mut StressError) {
        for (group, bonding) in self.groups().zip(self.bonding.last_three()) {
            let off = curvature.error(bonding.map(|b| b * b));
            for (law, point) in group {
                let potential = self.laws[*law].potential(&point.value(displacement), &point.normal);
                let twice = 2.0 * point.weight * potential;
                error.error += off * off * twice;
                error.size += bonding[0] * bonding[0] * twice;
            }
        }
    }

    fn add_stiffness(&self, x: &[f64], forces: &mut [f64]) {
        for (law, point) in &self.points {
            let (law, x) = (&self.laws[*law], point.value(x));
            let along = dot(&x, &point.normal);
            let more = law.stiffness - law.tangential_stiffness();
            point.add(point.weight * law.tangential_stiffness(), &x, forces);
            point.add(point.weight * more * along, &point.normal, forces);
        }
    }

    fn histories(&self) -> Vec<&dyn HistoryStore> {
        vec![&self.bonding]
    }

    fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore)) {
        visit(&mut self.bonding);
    }
}
