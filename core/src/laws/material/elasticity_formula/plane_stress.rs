//! The law in plane stress: the strain across the plane leaves no stress there.
//!
//! The stress in the plane is the gradient of the least energy over strains across it, whose derivative is the Schur complement of that
//! with three normal strains; so both bounds by linear elasticity hold for it, too. Under the midpoint rule the mean of the stress on the
//! way between two strains is a discrete gradient with a symmetric derivative.

use super::{Isotropic, Point, StrainElasticity};
use crate::{
    laws::{expression::Variable, law::increasing_root, quadrature::rule},
    linear_algebra::tensor::{Mandel, add_scaled, dot, norm},
};

/// The component across the plane among those with three normal strains.
const ACROSS: usize = 2;
/// What the work of the mean stress may differ from the change of energy by rounding: as a share of the stress times the way, and times the
/// strain, whose rounding the change of energy has.
const ROUNDING: [f64; 2] = [1e-13, 1e-14];

/// The mean of the stress on the straight way between two strains.
struct Mean<const S: usize> {
    /// By quadrature.
    stress: Mandel<S>,
    way: Mandel<S>,
    /// What its work lacks of the change of energy, over the square of the way: across kinks the quadrature is not exact.
    missing: f64,
}

impl StrainElasticity {
    /// A strain in the plane with that across it, at which no stress is across the plane.
    pub(super) fn with_thickness<const S: usize>(&self, plane: &Mandel<S>) -> Mandel<4> {
        let with = |across: f64| [plane[0], plane[1], across, plane[2]];
        let sum = plane[0] + plane[1];
        if sum == 0.0 {
            return with(0.0);
        }
        let bulk = self.elasticity.volumetric + self.elasticity.shear / 3.0;
        let stress_across = |across: f64| {
            let Point { size, deviator } = Point::of(&with(across));
            let [factor, slope] =
                self.formula.shear_factor.differentiate(&[(Variable::E, size)], Variable::E);
            let deviator = deviator[ACROSS];
            let along = if size > 0.0 { 2.0 * slope * deviator * deviator / size } else { 0.0 };
            let (pressure, shear) = (bulk * (sum + across), self.elasticity.shear * factor * deviator);
            let stress = pressure + shear;
            let is_rounding = stress.abs() <= 4.0 * f64::EPSILON * (bulk * sum.abs() + shear.abs());
            let derivative = bulk + self.elasticity.shear * (2.0 / 3.0 * factor + along);
            [if is_rounding { 0.0 } else { stress }, derivative]
        };
        // There the volume stays, or the deviator has no part across.
        let ends = [-sum, 0.5 * sum];
        let start = -sum * self.elasticity.volumetric / (self.elasticity.volumetric + self.elasticity.shear);
        with(increasing_root(ends[0].min(ends[1]), ends[0].max(ends[1]), start, stress_across))
    }

    /// See [`StrainElasticity::stress`].
    pub(super) fn plane_stress<const S: usize>(&self, strain: &Mandel<S>) -> Mandel<S> {
        let whole: Mandel<S> = in_plane(&self.whole_stress(&self.with_thickness(strain)));
        add_scaled(&whole, -1.0, &self.linear::<S>().apply(strain))
    }

    /// See [`StrainElasticity::tangent`].
    pub(super) fn plane_tangent<const S: usize>(&self, strain: &Mandel<S>) -> [Mandel<S>; S] {
        let mut tangent = self.tangent(&self.with_thickness(strain));
        add_linear(1.0, &self.linear::<4>(), &mut tangent);
        let across = tangent[ACROSS];
        let rows = tangent.map(|row| in_plane(&add_scaled(&row, -row[ACROSS] / across[ACROSS], &across)));
        let mut plane = in_plane(&rows);
        add_linear(-1.0, &self.linear::<S>(), &mut plane);
        plane
    }

    /// See [`StrainElasticity::energy_change`].
    pub(super) fn plane_energy_change<const S: usize>(&self, strains: [&Mandel<S>; 2]) -> f64 {
        let [before, after] = strains.map(|strain| self.with_thickness(strain));
        let of_rest = self.energy_change([&before, &after]);
        of_rest + change(&self.linear::<4>(), [&before, &after]) - change(&self.linear::<S>(), strains)
    }

    /// See [`StrainElasticity::mean_stress`].
    pub(super) fn plane_mean_stress<const S: usize>(&self, strains: [&Mandel<S>; 2]) -> Mandel<S> {
        let Mean { stress, way, missing } = self.mean_on_way(strains);
        add_scaled(&stress, missing, &way)
    }

    /// See [`StrainElasticity::mean_tangent`].
    pub(super) fn plane_mean_tangent<const S: usize>(&self, strains: [&Mandel<S>; 2]) -> [Mandel<S>; S] {
        let [before, end] = strains;
        let Mean { stress, way, missing } = self.mean_on_way(strains);
        let mut sum = [[0.0; S]; S];
        for [share, weight] in rule([0.0, 1.0]) {
            let tangent = self.tangent(&add_scaled(before, share, &way));
            for (sum, row) in sum.iter_mut().zip(&tangent) {
                *sum = add_scaled(sum, 2.0 * share * weight, row);
            }
        }
        if missing != 0.0 {
            let jump = add_scaled(&self.stress(end), -1.0, &stress);
            let along: Mandel<S> = std::array::from_fn(|i| 2.0 * jump[i] - dot(&sum[i], &way));
            let slope = add_scaled(&along, -4.0 * missing, &way).map(|slope| slope / dot(&way, &way));
            for (i, row) in sum.iter_mut().enumerate() {
                row[i] += 2.0 * missing;
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry += 0.5 * (way[i] * slope[j] + slope[i] * way[j]);
                }
            }
        }
        sum
    }

    fn mean_on_way<const S: usize>(&self, [before, end]: [&Mandel<S>; 2]) -> Mean<S> {
        let way = add_scaled(end, -1.0, before);
        let on_way =
            rule([0.0, 1.0]).map(|[share, weight]| (weight, self.stress(&add_scaled(before, share, &way))));
        let stress = on_way.fold([0.0; S], |sum, (weight, stress)| add_scaled(&sum, weight, &stress));
        let missing = self.energy_change([before, end]) - dot(&stress, &way);
        let middle = add_scaled(before, 0.5, &way);
        let whole = norm(&self.linear::<S>().apply(&middle)) + norm(&stress);
        let size = whole * (ROUNDING[0] * norm(&way) + ROUNDING[1] * norm(&middle));
        let is_rounding = missing.abs() <= size;
        Mean { stress, way, missing: if is_rounding { 0.0 } else { missing / dot(&way, &way) } }
    }
}

/// The entries in the plane.
fn in_plane<T: Copy, const S: usize>(all: &[T; 4]) -> [T; S] {
    std::array::from_fn(|c| all[if c < ACROSS { c } else { c + 1 }])
}

/// Adds a multiple of linear elasticity to a derivative of the stress.
fn add_linear<const S: usize>(factor: f64, linear: &Isotropic, tangent: &mut [Mandel<S>; S]) {
    for (i, row) in tangent.iter_mut().enumerate() {
        let unit = std::array::from_fn(|c| f64::from(u8::from(c == i)));
        *row = add_scaled(row, factor, &linear.apply(&unit));
    }
}

/// How much more energy in J/m^3 linear elasticity stores at the second strain than at the first.
fn change<const S: usize>(linear: &Isotropic, [before, after]: [&Mandel<S>; 2]) -> f64 {
    0.5 * dot(&linear.apply(&add_scaled(after, -1.0, before)), &add_scaled(before, 1.0, after))
}
