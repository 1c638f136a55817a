//! The projection on the von Mises surface in plane stress, of several stresses at once.
//!
//! Newton's method runs on a pack of stresses at a time, so that the compiler can use vector instructions.

use std::array;

/// Newton's method ends with a correction below this share of the multiplier, because the next one would be of the order of its
/// square.
const LAST: f64 = 1e-8;
const ITERATIONS: usize = 60;

/// The coefficients of the multiplier.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    /// Inverse eigenvalue of the metric on `p`.
    pub along: f64,
    /// Three times that on `q` and `r`.
    pub across: f64,
    /// Yield stress in Pa, positive.
    pub yield_stress: f64,
}

impl Surface {
    /// The `m >= 0` with `volumetric / (1 + along m)^2 + deviatoric / (1 + across m)^2` equal to the square of the yield stress,
    /// for squares in Pa^2 whose sum has the root `norms`; 0 where that is not above the yield stress.
    ///
    /// Newton's method, from zero, on the reciprocal of the norm, which is nearly linear and concave: no step overshoots.
    #[inline(always)]
    pub(super) fn multipliers<const N: usize>(
        &self,
        volumetric: &[f64; N],
        deviatoric: &[f64; N],
        norms: &[f64; N],
    ) -> [f64; N] {
        let Self { along, across, yield_stress } = *self;
        let outside = norms.map(|norm| norm > yield_stress);
        // Stresses inside the surface are replaced by one on the surface.
        let volumetric: [f64; N] = array::from_fn(|i| if outside[i] { volumetric[i] } else { 0.0 });
        let deviatoric: [f64; N] =
            array::from_fn(|i| if outside[i] { deviatoric[i] } else { yield_stress * yield_stress });
        let mut multipliers = [0.0; N];
        let mut pace = outside.map(|outside| if outside { 1.0 } else { 0.0 });
        for _ in 0..ITERATIONS {
            for i in 0..N {
                // Quotients are multiplied by both denominators, so that one root and one quotient are left.
                let m = multipliers[i];
                let (a, b) = (1.0 + along * m, 1.0 + across * m);
                let (v, d) = (volumetric[i] * b * b, deviatoric[i] * a * a);
                let square = v + d;
                let fall = along * v * b + across * d * a;
                let step = pace[i] * (square.sqrt() / yield_stress - a * b) * square / fall;
                multipliers[i] = m + step;
                pace[i] = if step.abs() <= LAST * multipliers[i] { 0.0 } else { pace[i] };
            }
            if pace.iter().sum::<f64>() == 0.0 {
                break;
            }
        }
        multipliers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn multipliers_put_stresses_on_the_surface_whatever_goes_beside_them() {
        let surface = Surface { along: 1e-3, across: 4e-3, yield_stress: 19.0 };
        let volumetric = [1e6, 0.0, 361.0, 400.0, 1e12, 1.0, 300.0, 0.0];
        let deviatoric = [1.0, 1e6, 1e-9, 400.0, 1e12, 1.0, 300.0, 0.0];
        let norms: [f64; 8] = array::from_fn(|i| f64::sqrt(volumetric[i] + deviatoric[i]));
        let found = surface.multipliers(&volumetric, &deviatoric, &norms);
        for i in 0..8 {
            let alone = surface.multipliers(&[volumetric[i]], &[deviatoric[i]], &[norms[i]]);
            assert_eq!(alone[0], found[i], "{i}: another number beside others");
            let m = found[i];
            let norm = f64::sqrt(
                volumetric[i] / (1.0 + 1e-3 * m).powi(2) + deviatoric[i] / (1.0 + 4e-3 * m).powi(2),
            );
            let expected = norms[i].min(19.0);
            assert!((norm - expected).abs() <= 1e-14 * 19.0, "{i}: {norm} instead of {expected}");
            assert_eq!(m == 0.0, norms[i] <= 19.0);
        }
    }
}
