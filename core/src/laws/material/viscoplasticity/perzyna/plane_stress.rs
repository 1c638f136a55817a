//! Perzyna's law in plane stress.
//!
//! In the components `p`, `q`, `r` of [`Perzyna`] both `E` (eigenvalues `e`) and the projection
//! are diagonal. With the projected stress `t`, its multiplier `m` and `eta = k / (2 lambda) (f / Y)^(n - 1)`
//!
//! ```text
//! s = (1 + a m) t,   s* = s + eta e (s - t) = (1 + a m (1 + eta e)) t,   a = inverse metric, three times it on q and r
//! ```
//!
//! where `m` puts `t` on the yield surface `|t| = Y`, `Y = Y* + h dp` with `dp = eta s:(s - t) / |s|`: one increasing
//! equation for `m`, the projection's own with other factors. For `n = 1` `eta` is known; else it is the root of an increasing
//! equation around that one.

use super::{
    overstress::{NO_YIELD_STRESS, Overstressed, Perzyna},
    plane_projection::Surface,
};
use crate::{
    laws::{
        law::increasing_root,
        material::{
            Elastic,
            viscoplasticity::{flow::Flow, tangent::Tangent},
        },
    },
    linear_algebra::tensor::Mandel,
};
use std::f64::consts::FRAC_1_SQRT_2;

/// Weights of `p²`, `q²`, `r²` in the square of the von Mises norm.
const WEIGHTS: [f64; 3] = [0.5, 1.5, 1.5];

/// A step at a point.
struct Step {
    trial: [f64; 3],
    /// `a`.
    compliance: [f64; 3],
    /// `e`.
    stiffness: [f64; 3],
    /// `Y*`.
    yield_stress: f64,
    /// `h`.
    hardening: f64,
    /// `k / (2 lambda)`.
    rate: f64,
    /// `n - 1`.
    power: f64,
}

/// The stresses and norms for `m` and `eta`.
struct Point {
    /// `s` and `t`.
    stress: [f64; 3],
    projected: [f64; 3],
    /// `|t|`, `|s|` and `|s| - |t|`.
    projected_norm: f64,
    norm: f64,
    overstress: f64,
    /// `s:(s - t)` and `dp`.
    product: f64,
    growth: f64,
}

/// The same with derivatives with respect to `m`, `eta` and the three components of `s*`.
struct Values {
    growth: f64,
    projected_norm: f64,
    overstress: f64,
    by_projected_norm: [f64; 5],
    by_norm: [f64; 5],
    by_growth: [f64; 5],
    /// For each component of the stress the derivatives with respect to `m`, `eta` and the same component of `s*`.
    by_stress: [[f64; 3]; 3],
}

/// Flow of the step, and increment of the accumulated strain, from the norm of `s*` and `Y*`.
pub(super) fn flow<const S: usize>(
    law: &Elastic<Perzyna>,
    trial: &Mandel<S>,
    length: f64,
    Overstressed { norm, yield_stress }: Overstressed,
    tangent: Option<&mut Tangent<S>>,
) -> (Mandel<S>, f64) {
    let [along, across] = law.metric_and_stiffness();
    let step = Step {
        trial: turned(&[trial[0], trial[1], trial[2]]),
        compliance: [along.0, 3.0 * across.0, 3.0 * across.0],
        stiffness: [along.1, across.1, across.1],
        yield_stress,
        hardening: law.hardening_modulus(),
        rate: 0.5 * length / law.parameters.relaxation,
        power: law.parameters.exponent - 1.0,
    };
    let without_yield_stress = yield_stress <= NO_YIELD_STRESS * norm && step.power == 0.0;
    let (flow, growth, derivative) = if without_yield_stress && law.hardening_modulus() == 0.0 {
        let share = step.stiffness.map(|e| 1.0 / (1.0 + step.rate * e));
        let flow = std::array::from_fn(|i| step.rate * share[i] * step.trial[i]);
        let diagonal = |i: usize| std::array::from_fn(|j| if i == j { share[i] } else { 0.0 });
        (flow, 0.0, std::array::from_fn(diagonal))
    } else {
        let (multiplier, eta) = step.solve(norm);
        let found = step.point(multiplier, eta);
        let flow = std::array::from_fn(|i| eta * step.compliance[i] * multiplier * found.projected[i]);
        let derivative = if tangent.is_some() {
            step.derivative(eta, &step.values(multiplier, eta))
        } else {
            [[0.0; 3]; 3]
        };
        (flow, found.growth, derivative)
    };
    if let Some(tangent) = tangent {
        let rows = derivative.map(|row| turned(&row));
        for j in 0..3 {
            let column = turned(&[rows[0][j], rows[1][j], rows[2][j]]);
            (tangent[0][j], tangent[1][j], tangent[2][j]) = (column[0], column[1], column[2]);
        }
    }
    let flow = turned(&flow);
    let mut out = [0.0; S];
    out[..3].copy_from_slice(&flow);
    (out, growth)
}

/// From normal components to `p` and `q`, or back.
fn turned(s: &[f64; 3]) -> [f64; 3] {
    [(s[0] + s[1]) * FRAC_1_SQRT_2, (s[0] - s[1]) * FRAC_1_SQRT_2, s[2]]
}

impl Step {
    /// `m` and `eta`, for a stress outside the yield surface.
    fn solve(&self, norm: f64) -> (f64, f64) {
        if self.power == 0.0 {
            return (self.multiplier(self.rate), self.rate);
        }
        // In the logarithm of eta the slope is at least 1. `f` is below that of `s*`, and `eta e f` below `s*`.
        let softest = self.stiffness.into_iter().fold(f64::INFINITY, f64::min);
        let most = (norm / self.yield_stress - 1.0).ln();
        let left = (10.0 * norm / (self.yield_stress * self.rate * softest)).ln() / (self.power + 1.0);
        let highest = self.rate.ln() + self.power * most.min(left);
        let open = |logarithm: f64| {
            let eta = logarithm.exp();
            let values = self.values(self.multiplier(eta), eta);
            let y = self.yield_stress + self.hardening * values.growth;
            let residual = logarithm - self.rate.ln() - self.power * (values.overstress / y).ln();
            let [surface, power] = self.equations(eta, &values);
            let slope = eta * (power[1] - power[0] * surface[1] / surface[0]);
            [residual, slope.max(1.0)]
        };
        let lowest = highest - open(highest)[0];
        let logarithm = increasing_root(lowest - 1.0, highest + 1.0, highest, open);
        let eta = logarithm.exp();
        (self.multiplier(eta), eta)
    }

    /// `m` at this `eta`: the root of `Y / |t| - 1`.
    fn multiplier(&self, eta: f64) -> f64 {
        let [along, across] = [0, 1].map(|i| self.compliance[i] * (1.0 + eta * self.stiffness[i]));
        let [p, q, r] = std::array::from_fn(|i| WEIGHTS[i] * self.trial[i] * self.trial[i]);
        let norm = (p + q + r).sqrt();
        if self.hardening == 0.0 {
            let surface = Surface { along, across, yield_stress: self.yield_stress };
            return surface.multipliers(&[p], &[q + r], &[norm])[0];
        }
        let largest = along.max(across);
        let start =
            if self.yield_stress > 0.0 { (norm / self.yield_stress - 1.0) / largest } else { 1.0 / largest };
        increasing_root(0.0, f64::INFINITY, start, |multiplier| {
            let values = self.values(multiplier, eta);
            let y = self.yield_stress + self.hardening * values.growth;
            let t = values.projected_norm;
            let slope = (self.hardening * values.by_growth[0] - y * values.by_projected_norm[0] / t) / t;
            [(y - t) / t, slope]
        })
    }

    fn point(&self, multiplier: f64, eta: f64) -> Point {
        let gain = self.compliance.map(|a| a * multiplier);
        let projected: [f64; 3] =
            std::array::from_fn(|i| self.trial[i] / (1.0 + gain[i] * (1.0 + eta * self.stiffness[i])));
        let stress = std::array::from_fn(|i| (1.0 + gain[i]) * projected[i]);
        let squares: [f64; 3] = std::array::from_fn(|i| WEIGHTS[i] * projected[i] * projected[i]);
        let square: f64 = squares.iter().sum();
        let beyond: f64 = (0..3).map(|i| squares[i] * gain[i] * (2.0 + gain[i])).sum();
        let (projected_norm, norm) = (square.sqrt(), (square + beyond).sqrt());
        let product: f64 = (0..3).map(|i| stress[i] * projected[i] * gain[i]).sum();
        let overstress = beyond / (norm + projected_norm);
        Point { stress, projected, projected_norm, norm, overstress, product, growth: eta * product / norm }
    }

    fn values(&self, multiplier: f64, eta: f64) -> Values {
        let Point { stress, projected, projected_norm, norm, overstress, product, growth } =
            self.point(multiplier, eta);
        let (mut by_stress, mut by_projected) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for (i, t) in projected.into_iter().enumerate() {
            let (a, e) = (self.compliance[i], self.stiffness[i]);
            let below = 1.0 + a * multiplier * (1.0 + eta * e);
            let above = 1.0 + a * multiplier;
            by_projected[i] =
                [-t * a * (1.0 + eta * e) / below, -t * a * multiplier * e / below, 1.0 / below];
            by_stress[i] = [-t * a * eta * e / below, -above * t * a * multiplier * e / below, above / below];
        }
        let gain = |i: usize| self.compliance[i] * multiplier;
        let mut values = Values {
            growth,
            projected_norm,
            overstress,
            by_projected_norm: [0.0; 5],
            by_norm: [0.0; 5],
            by_growth: [0.0; 5],
            by_stress,
        };
        for variable in 0..5 {
            let mut by_product = 0.0;
            for i in (0..3).filter(|i| variable < 2 || variable == 2 + i) {
                let (s, t) = (by_stress[i][variable.min(2)], by_projected[i][variable.min(2)]);
                values.by_projected_norm[variable] += WEIGHTS[i] * projected[i] * t / projected_norm;
                values.by_norm[variable] += WEIGHTS[i] * stress[i] * s / norm;
                by_product += (s * projected[i] + stress[i] * t) * gain(i);
                if variable == 0 {
                    by_product += stress[i] * projected[i] * self.compliance[i];
                }
            }
            let by_norm = values.by_norm[variable];
            values.by_growth[variable] = eta * (by_product - product * by_norm / norm) / norm;
        }
        values.by_growth[1] += product / norm;
        values
    }

    /// Derivatives of the two equations, `|t| - Y` and `ln eta - (n - 1) ln(f / Y)`.
    fn equations(&self, eta: f64, values: &Values) -> [[f64; 5]; 2] {
        let y = self.yield_stress + self.hardening * values.growth;
        let mut rows = [[0.0; 5]; 2];
        for variable in 0..5 {
            let by_y = self.hardening * values.by_growth[variable];
            rows[0][variable] = values.by_projected_norm[variable] - by_y;
            let overstress = (values.by_norm[variable] - by_y) / values.overstress;
            rows[1][variable] = if self.power == 0.0 { 0.0 } else { -self.power * (overstress - by_y / y) };
        }
        rows[1][1] += 1.0 / eta;
        rows
    }

    /// `ds/ds*` at the solution.
    fn derivative(&self, eta: f64, values: &Values) -> [[f64; 3]; 3] {
        let [first, second] = self.equations(eta, values);
        let determinant = first[0] * second[1] - first[1] * second[0];
        let mut out = [[0.0; 3]; 3];
        for j in 0..3 {
            let (one, other) = (-first[2 + j], -second[2 + j]);
            let multiplier = (one * second[1] - first[1] * other) / determinant;
            let eta = (first[0] * other - one * second[0]) / determinant;
            for i in 0..3 {
                let own = if i == j { values.by_stress[i][2] } else { 0.0 };
                out[i][j] = own + values.by_stress[i][0] * multiplier + values.by_stress[i][1] * eta;
            }
        }
        out
    }
}
