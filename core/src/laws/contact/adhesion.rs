//! Adhesion: elastic bonds between body and obstacle that break.
//!
//! With the bonding `b` between 0 (broken) and 1 (intact), stiffnesses `c_n`, `c_t` and the truncation `R` of displacements at
//! `length`, the traction on the body is
//!
//! ```text
//! b^2 (c_n R(-u_nu) nu - c_t R(u_tau)),    R(-u_nu) = 0 where u_nu >= 0
//! viscosity b' = -<b (c_n R(-u_nu)^2 + c_t |R(u_tau)|^2) - energy>_+
//! ```
//!
//! with the outward normal `nu` of the body and the displacement `u`; the bonds form at `u = 0`. Broken bonds are not restored.
//! Bonds store the energy `b^2 F(u)` with the potential `F` of the truncated springs. Slow separation takes the work `energy` in
//! total, and the largest traction is then `sqrt(stiffness energy)`. With a `strength` the bonding is instead the smallest so far of
//! that of a bilinear cohesive law: with the separation `s`, `c_n s^2 = c_n u_nu^2 + c_t |u_tau|^2`,
//!
//! ```text
//! b^2 = s_0 (s_f - s) / (s (s_f - s_0)) for s_0 < s < s_f,    s_0 = strength / c_n,    s_f = 2 energy / strength
//! ```
//!
//! so that the traction `b^2 c_n s` falls linearly from `strength` to 0, follows the secant where `s` shrinks, and takes the work
//! `energy` in total. (P. Camanho, C. Davila, M. de Moura, J. Compos. Mater. 37 (2003), 1415-1438. O. Chau, J. Fernández, M. Shillor, M. Sofonea, Variational
//! and numerical analysis of a quasistatic viscoelastic contact problem with adhesion, J. Comput. Appl. Math. 159 (2003), 431-465;
//! M. Raous, L. Cangémi, M. Cocou, A consistent model coupling adhesion, friction, and unilateral contact, Comput. Methods Appl.
//! Mech. Engrg. 177 (1999), 383-399.)

use super::interface::Interface;
use crate::{
    laws::law::LawFault,
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Adhesive bonds on a contact boundary.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "glue, bond, cohesive zone, delamination, crack, fracture, weld"))]
pub struct Adhesion {
    /// Normal stiffness of intact bonds: normal traction per opening. In slow opening the traction is at most `sqrt(stiffness
    /// energy)`.
    #[schemars(range(min = 0), extend("unit" = "Pa/m"), example = 1e6)]
    pub stiffness: f64,
    /// Tangential stiffness of intact bonds: tangential traction per sliding displacement. Absent: bonds do not resist sliding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0), extend("unit" = "Pa/m"), example = 5e5)]
    pub tangential_stiffness: Option<f64>,
    /// Dupré's energy of adhesion: the energy that separates a unit of area slowly.
    #[schemars(range(min = 0), extend("at_infinity" = "give a large number: with 1e9 no bond breaks", "unit" = "J/m^2"), example = 10.0)]
    pub energy: f64,
    /// Largest normal traction of the bonds, as in a bilinear cohesive law: the traction grows with `stiffness` up to `strength`,
    /// then decreases linearly, and vanishes at the opening `2 energy / strength`. Unloading follows the secant to the origin.
    /// Sliding counts as the opening that stores the same energy. Requires `energy` above `strength^2 / (2 stiffness)`; excludes
    /// `viscosity` and `length`. Absent: `energy` and `viscosity` govern debonding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "Pa", "exclusiveMinimum" = 0), example = 2e6)]
    pub strength: Option<f64>,
    /// Viscosity of debonding: the larger, the slower bonds break. 0: bonds break as soon as their elastic energy suffices.
    #[serde(default)]
    #[schemars(range(min = 0), extend("unit" = "J s/m^2"), example = 0.1)]
    pub viscosity: f64,
    /// Opening or sliding displacement beyond which the traction of bonds no longer grows. Absent: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 0.01)]
    pub length: Option<f64>,
}

/// What opposes the breaking of bonds, per area or as totals of a node.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Toughness {
    /// Energy of adhesion, in J/m^2 or J.
    pub energy: f64,
    /// Viscosity of debonding, in J s/m^2 or J s.
    pub viscosity: f64,
    /// The driving forces at which the traction of a cohesive law begins to fall and at which it vanishes, in J/m^2 or J; both are 0
    /// without a strength.
    pub softening: [f64; 2],
}

impl Toughness {
    /// Adds a share of another one.
    pub fn add(&mut self, share: f64, other: &Self) {
        self.energy += share * other.energy;
        self.viscosity += share * other.viscosity;
        self.softening = std::array::from_fn(|i| self.softening[i] + share * other.softening[i]);
    }

    /// The bonding after a step of implicit Euler of this length in s from `start`, which must not be below the value at which
    /// debonding ends, and its derivative with respect to the driving force.
    pub fn relax(&self, start: f64, drive: f64, length: f64) -> [f64; 2] {
        let Self { energy, viscosity, softening: [begin, end] } = *self;
        if end > 0.0 {
            return soften(start, drive, begin, end);
        }
        if start * drive <= energy {
            return [start, 0.0];
        }
        let resistance = viscosity + length * drive;
        let bonding = ((viscosity * start + length * energy) / resistance).min(start);
        [bonding, -length * bonding / resistance]
    }

    /// The energy in J/m^2 or J that bonds without a `length` dissipate while the bonding falls from the first value to the second
    /// in a step of this length in s: `-b b' drive` integrated over the step, with the drive at which the bonding gives way.
    pub fn dissipated(&self, [before, after]: [f64; 2], length: f64) -> f64 {
        let Self { energy, viscosity, softening: [begin, end] } = *self;
        if end > 0.0 {
            let [first, last] = [begin, end].map(f64::sqrt);
            // The separation, times the root of the stiffness, at which the bonding of the law has this value.
            let opened = |bonding: f64| first * last / (bonding * bonding * (last - first) + first);
            return 0.5 * first * last / (last - first) * (opened(after) - opened(before));
        }
        let fall = before - after;
        (energy + viscosity * fall / length) * fall
    }
}

/// The bonding of a cohesive law, not above `start`, and its derivative with respect to the driving force, given the driving forces at
/// which softening begins and ends.
fn soften(start: f64, drive: f64, begin: f64, end: f64) -> [f64; 2] {
    if drive <= begin {
        return [start, 0.0];
    }
    if drive >= end {
        return [0.0, 0.0];
    }
    let [first, now, last] = [begin, drive, end].map(f64::sqrt);
    let bonding = (first * (last - now) / (now * (last - first))).sqrt();
    if bonding >= start {
        return [start, 0.0];
    }
    [bonding, -first * last / (4.0 * bonding * (last - first) * now * drive)]
}

impl Adhesion {
    /// Tangential stiffness of intact bonds, in Pa/m.
    pub fn tangential_stiffness(&self) -> f64 {
        self.tangential_stiffness.unwrap_or(0.0)
    }

    /// The displacement in m beyond which the traction no longer grows; infinite without a limit.
    pub fn truncation_length(&self) -> f64 {
        self.length.unwrap_or(f64::INFINITY)
    }

    /// A displacement in m, truncated at this length.
    fn truncate(&self, length: f64) -> f64 {
        length.min(self.truncation_length())
    }

    /// What opposes the breaking of bonds, per area.
    pub fn toughness(&self) -> Toughness {
        let square = |length: f64| self.stiffness * length * length;
        let softening = self.strength.map_or([0.0; 2], |strength| {
            [strength / self.stiffness, 2.0 * self.energy / strength].map(square)
        });
        Toughness { energy: self.energy, viscosity: self.viscosity, softening }
    }

    /// The faults of the parameters, and of tables that adhesion cannot be combined with. Bonds connect a boundary that touches from the start to an
    /// obstacle at rest. Keys are those of the table of the contact.
    pub(super) fn faults(&self, interface: Interface<'_>) -> Vec<LawFault> {
        let help = "delete it, or [contact.adhesion]";
        let gap = interface.normal.gap_key().map(|gap| {
            let message = "adhesion requires contact from the start: no gap is allowed";
            LawFault::at_value(gap, message, help)
        });
        let obstacle = interface.obstacle_moves.then(|| {
            let message =
                "adhesion requires an obstacle at rest: bonds depend on the displacement of the body only";
            LawFault::at_key("obstacle", message, format!("keep the obstacle at rest, or {help}"))
        });
        gap.into_iter()
            .chain(obstacle)
            .chain(self.strength.and_then(|strength| self.fault_of(strength)))
            .collect()
    }

    /// What is wrong with the other parameters, given this strength in Pa.
    fn fault_of(&self, strength: f64) -> Option<LawFault> {
        if self.viscosity > 0.0 || self.length.is_some() {
            let key = if self.viscosity > 0.0 { "adhesion.viscosity" } else { "adhesion.length" };
            let message = "`strength` cannot be combined with `viscosity` or `length`";
            return Some(LawFault::at_key(key, message, "delete it, or `strength`"));
        }
        let least = 0.5 * strength * strength / self.stiffness;
        (self.energy <= least).then(|| {
            let message = format!(
                "the energy is too small: bonds store {least} J/m^2 when their traction reaches the strength"
            );
            LawFault::at_value(
                "adhesion.energy",
                message,
                "give a larger energy or stiffness, or a smaller strength",
            )
        })
    }

    /// A warning about the parameters, if they mean that no bond ever breaks.
    pub fn warning(&self) -> Option<String> {
        let (length, energy) = (self.length?, self.energy);
        let most = (self.stiffness + self.tangential_stiffness()) * length * length;
        (most <= energy && most > 0.0).then(|| {
            format!(
                "no bond ever breaks: the driving force of debonding is at most {most} J/m^2 and never exceeds the energy of adhesion {energy} J/m^2"
            )
        })
    }

    /// Opening in m, at least zero, and sliding.
    fn opening_and_sliding<const D: usize>(displacement: &Vector<D>, normal: &Vector<D>) -> (f64, Vector<D>) {
        let along = dot(displacement, normal);
        ((-along).max(0.0), add_scaled(displacement, -along, normal))
    }

    /// Traction in Pa of intact bonds on the body.
    pub fn traction<const D: usize>(&self, displacement: &Vector<D>, normal: &Vector<D>) -> Vector<D> {
        let (opening, sliding) = Self::opening_and_sliding(displacement, normal);
        let size = norm(&sliding);
        let cut = if size > self.truncate(size) { self.truncate(size) / size } else { 1.0 };
        let pull = normal.map(|n| self.stiffness * self.truncate(opening) * n);
        add_scaled(&pull, -self.tangential_stiffness() * cut, &sliding)
    }

    /// Stored energy of intact bonds in J/m²: the traction is minus its derivative.
    pub fn potential<const D: usize>(&self, displacement: &Vector<D>, normal: &Vector<D>) -> f64 {
        let (opening, sliding) = Self::opening_and_sliding(displacement, normal);
        let of = |length: f64| {
            let cut = self.truncate(length);
            cut * (length - 0.5 * cut)
        };
        self.stiffness * of(opening) + self.tangential_stiffness() * of(norm(&sliding))
    }

    /// The driving force of debonding in J/m²: `c_n R(-u_nu)^2 + c_t |R(u_tau)|^2`.
    pub fn drive<const D: usize>(&self, displacement: &Vector<D>, normal: &Vector<D>) -> f64 {
        let (opening, sliding) = Self::opening_and_sliding(displacement, normal);
        let square = |length: f64| self.truncate(length).powi(2);
        self.stiffness * square(opening) + self.tangential_stiffness() * square(norm(&sliding))
    }

    /// Minus the derivative of the traction of intact bonds with respect to the displacement, in Pa/m.
    pub fn tangent<const D: usize>(&self, displacement: &Vector<D>, normal: &Vector<D>) -> [Vector<D>; D] {
        let (opening, sliding) = Self::opening_and_sliding(displacement, normal);
        let along = if opening > 0.0 && opening < self.truncation_length() { self.stiffness } else { 0.0 };
        let size = norm(&sliding);
        // Beyond the truncation length only the direction of the traction changes.
        let (across, radial) = if size > self.truncation_length() {
            let across = self.tangential_stiffness() * self.truncation_length() / size;
            (across, across / (size * size))
        } else {
            (self.tangential_stiffness(), 0.0)
        };
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let identity = if i == j { across } else { 0.0 };
                identity + (along - across) * normal[i] * normal[j] - radial * sliding[i] * sliding[j]
            })
        })
    }

    /// The derivative of [`Adhesion::drive`] by the displacement, in J/m^3.
    pub fn drive_gradient<const D: usize>(&self, displacement: &Vector<D>, normal: &Vector<D>) -> Vector<D> {
        let (opening, sliding) = Self::opening_and_sliding(displacement, normal);
        let along = if opening < self.truncation_length() { -2.0 * self.stiffness * opening } else { 0.0 };
        let across =
            if norm(&sliding) > self.truncation_length() { 0.0 } else { 2.0 * self.tangential_stiffness() };
        add_scaled(&normal.map(|n| along * n), across, &sliding)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GLUE: Adhesion = Adhesion {
        stiffness: 100.0,
        tangential_stiffness: Some(40.0),
        energy: 0.5,
        viscosity: 2.0,
        length: Some(0.2),
        strength: None,
    };
    const DOWN: [f64; 2] = [0.0, -1.0];

    #[test]
    fn lifted_and_slid_bonds_pull_back_by_hand() {
        // Lifted by 0.1 m, slid by 0.05 m.
        let u = [0.05, 0.1];
        assert_eq!(GLUE.traction(&u, &DOWN), [-2.0, -10.0]);
        assert!((GLUE.potential(&u, &DOWN) - (0.5 + 0.05)).abs() < 1e-15);
        assert!((GLUE.drive(&u, &DOWN) - (1.0 + 0.1)).abs() < 1e-15);
        let far = [-0.3, 1.0];
        let [along, up] = GLUE.traction(&far, &DOWN);
        assert!((along - 8.0).abs() < 1e-14 && (up + 20.0).abs() < 1e-14, "truncated: {along} {up}");
        assert!((GLUE.potential(&far, &DOWN) - (100.0 * 0.18 + 40.0 * 0.04)).abs() < 1e-13);
        assert_eq!(GLUE.traction(&[0.0, -0.1], &DOWN), [0.0, 0.0], "pressed on: no bond is stretched");
    }

    #[test]
    fn bonds_give_way_by_hand() {
        // Driving force 1 J/m² against 0.5: (2 + 0.25) / (2 + 0.5) after half a second.
        let glue = GLUE.toughness();
        assert_eq!(glue.relax(1.0, 1.0, 0.5), [0.9, -0.18]);
        let brittle = Toughness { viscosity: 0.0, ..glue };
        assert_eq!(brittle.relax(1.0, 1.0, 0.5), [0.5, -0.5], "without viscosity at once");
        assert_eq!(glue.relax(0.4, 1.0, 0.5), [0.4, 0.0], "the drive is too weak");
        assert_eq!(Toughness { energy: 0.0, ..glue }.relax(0.0, 1e9, 0.5)[0], 0.0);
    }

    #[test]
    fn slow_separation_takes_up_the_energy_and_peaks_at_the_root_of_stiffness_and_energy() {
        let law = Adhesion { viscosity: 0.0, length: None, ..GLUE };
        let (mut bonding, mut dissipated, mut work, mut peak) = (1.0, 0.0, 0.0, 0.0f64);
        let (steps, end) = (100_000, 5.0);
        for step in 0..steps {
            let u = [0.0, end * f64::from(step) / f64::from(steps)];
            let [next, _] = law.toughness().relax(bonding, law.drive(&u, &DOWN), 1.0);
            dissipated += (bonding * bonding - next * next) * law.potential(&u, &DOWN);
            bonding = next;
            let pull = -bonding * bonding * law.traction(&u, &DOWN)[1];
            work += pull * end / f64::from(steps);
            peak = peak.max(pull);
        }
        assert!((peak / (100.0f64 * 0.5).sqrt() - 1.0).abs() < 1e-3, "peak {peak}");
        assert!((dissipated / 0.5 - 1.0).abs() < 2e-3, "dissipated {dissipated}");
        assert!((work / 0.5 - 1.0).abs() < 2e-3, "work {work}");
    }

    #[test]
    fn steps_of_any_length_dissipate_the_energy_of_the_bonds() {
        let brittle = Adhesion { viscosity: 0.0, length: None, ..GLUE };
        for law in [brittle, COHESIVE] {
            let toughness = law.toughness();
            let whole = toughness.dissipated([1.0, 0.0], 1.0);
            assert!((whole / law.energy - 1.0).abs() < 1e-14, "at once: {whole}");
            let (mut bonding, mut sum, mut integral, mut last) = (1.0, 0.0, 0.0, 0.0);
            for step in 1..=4000 {
                let u = [0.0, 1e-4 * f64::from(step)];
                let [next, _] = toughness.relax(bonding, law.drive(&u, &DOWN), 1.0);
                let potential = law.potential(&u, &DOWN);
                integral += (bonding * bonding - next * next) * 0.5 * (potential + last);
                sum += toughness.dissipated([bonding, next], 1.0);
                (bonding, last) = (next, potential);
            }
            assert!((sum - toughness.dissipated([1.0, bonding], 1.0)).abs() < 1e-12 * whole);
            assert!((sum / integral - 1.0).abs() < 1e-4, "{sum} and {integral}");
        }
        // From 1 to 0.9 in half a second: (0.5 + 2 * 0.2) * 0.1.
        assert!((GLUE.toughness().dissipated([1.0, 0.9], 0.5) - 0.09).abs() < 1e-15);
    }

    /// Stiffness 100 Pa/m, strength 5 Pa: intact up to 0.05 m, broken at 0.4 m.
    const COHESIVE: Adhesion =
        Adhesion { energy: 1.0, viscosity: 0.0, length: None, strength: Some(5.0), ..GLUE };

    /// The pull of bonds that were opened so far before, and their bonding.
    fn pull(opened: f64, opening: f64) -> [f64; 2] {
        let toughness = COHESIVE.toughness();
        let bonding = [opened, opening].iter().fold(1.0, |bonding, opening| {
            toughness.relax(bonding, COHESIVE.drive(&[0.0, *opening], &DOWN), 1.0)[0]
        });
        [-bonding * bonding * COHESIVE.traction(&[0.0, opening], &DOWN)[1], bonding]
    }

    #[test]
    fn cohesive_bonds_soften_linearly_and_unload_along_the_secant() {
        for (opened, opening, expected) in [
            (0.0, 0.05, 5.0),
            (0.0, 0.225, 2.5),
            (0.0, 0.39, 5.0 / 35.0),
            (0.225, 0.09, 1.0),
            (0.225, 0.3, 10.0 / 7.0),
        ] {
            let [found, _] = pull(opened, opening);
            assert!(
                (found - expected).abs() < 1e-13,
                "{opened} then {opening}: {found} instead of {expected}"
            );
        }
        assert_eq!(pull(0.4, 0.1), [0.0, 0.0], "broken");
        assert_eq!(pull(f64::INFINITY, 0.1), [0.0, 0.0], "broken");
        let slid =
            COHESIVE.toughness().relax(1.0, COHESIVE.drive(&[0.225 * 2.5_f64.sqrt(), 0.0], &DOWN), 1.0);
        assert!((slid[0] - pull(0.0, 0.225)[1]).abs() < 1e-14, "sliding counts by its energy");
    }

    #[test]
    fn cohesive_bonds_take_their_energy_and_their_slope_is_the_derivative() {
        let (steps, end) = (100_000, 0.5);
        let opening = |step: i32| end * f64::from(step) / f64::from(steps);
        let work: f64 = (0..steps).map(|step| pull(0.0, opening(step))[0] * end / f64::from(steps)).sum();
        assert!((work - 1.0).abs() < 1e-4, "{work}");
        let toughness = COHESIVE.toughness();
        for drive in [0.3, 1.0, 5.0, 15.9] {
            let [up, down] = [1e-7, -1e-7].map(|h| toughness.relax(1.0, drive + h, 1.0)[0]);
            let [_, slope] = toughness.relax(1.0, drive, 1.0);
            assert!(((up - down) / 2e-7 - slope).abs() < 1e-5 * slope.abs(), "{drive}: {slope}");
        }
    }

    proptest! {
        #[test]
        fn bonds_only_break_and_dissipate(
            u in proptest::array::uniform3(-0.5f64..0.5), bonding in 0.0f64..1.0,
            viscosity in 0.0f64..10.0, length in 1e-4f64..10.0,
        ) {
            let normal = [0.6, 0.0, -0.8];
            let (drive, potential) = (GLUE.drive(&u, &normal), GLUE.potential(&u, &normal));
            let [next, _] = Toughness { viscosity, ..GLUE.toughness() }.relax(bonding, drive, length);
            prop_assert!((0.0..=bonding).contains(&next));
            prop_assert!((bonding * bonding - next * next) * potential >= 0.0, "dissipation");
            prop_assert!(next == bonding || next * drive >= GLUE.energy * (1.0 - 1e-12), "no further than the end");
        }

        #[test]
        fn traction_is_minus_the_derivative_of_the_potential(u in proptest::array::uniform3(-0.5f64..0.5)) {
            let normal = [0.6, 0.0, -0.8];
            let traction = GLUE.traction(&u, &normal);
            for i in 0..3 {
                let h = 1e-6;
                let at = |sign: f64| {
                    let mut moved = u;
                    moved[i] += sign * h;
                    GLUE.potential(&moved, &normal)
                };
                let quotient = (at(1.0) - at(-1.0)) / (2.0 * h);
                prop_assert!((quotient + traction[i]).abs() < 1e-3, "{} {}", quotient, traction[i]);
            }
        }

        #[test]
        fn tangent_and_gradient_of_the_drive_are_derivatives(u in proptest::array::uniform3(-0.5f64..0.5)) {
            let normal = [0.6, 0.0, -0.8];
            let (opening, sliding) = Adhesion::opening_and_sliding(&u, &normal);
            let corners = [opening, opening - GLUE.truncation_length(), norm(&sliding) - GLUE.truncation_length()];
            prop_assume!(corners.iter().all(|corner| corner.abs() > 1e-4) || opening == 0.0 && corners[2].abs() > 1e-4);
            prop_assume!(dot(&u, &normal).abs() > 1e-4);
            let (tangent, gradient) = (GLUE.tangent(&u, &normal), GLUE.drive_gradient(&u, &normal));
            for j in 0..3 {
                let h = 1e-6;
                let [more, less] = [h, -h].map(|h| {
                    let mut moved = u;
                    moved[j] += h;
                    moved
                });
                let [up, down] = [more, less].map(|u| GLUE.traction(&u, &normal));
                for i in 0..3 {
                    let quotient = (up[i] - down[i]) / (2.0 * h);
                    prop_assert!((quotient + tangent[i][j]).abs() < 1e-4, "{} {} {} {}", i, j, quotient, tangent[i][j]);
                }
                let quotient = (GLUE.drive(&more, &normal) - GLUE.drive(&less, &normal)) / (2.0 * h);
                prop_assert!((quotient - gradient[j]).abs() < 1e-4, "{} {}", quotient, gradient[j]);
            }
        }
    }
}
