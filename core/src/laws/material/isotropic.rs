//! Linear isotropic tensors.

use crate::linear_algebra::tensor::{Mandel, Vector, dot, normal_components, trace};
use std::fmt::Debug;

/// A symmetric linear map `T` of strains to stresses in Pa, or of strain rates with `T` in Pa s.
pub trait LinearTensor: Copy + Debug {
    /// `T(e)`.
    fn stress<const S: usize>(&self, strain: &Mandel<S>) -> Mandel<S>;

    /// Adds `factor volume e_i : T(e_j)` for the strains `e_i = sym(a_i g^T)` and `e_j = sym(a_j h^T)` along the axes `a`, given `g` and
    /// `h`, each with the hoop strain that comes with the first axis in a body of revolution, elsewhere 0.
    fn add_block<const D: usize>(
        &self,
        factor: f64,
        volume: f64,
        slopes: [&(Vector<D>, f64); 2],
        block: &mut [[f64; D]; D],
    );
}

/// `T(e) = volumetric tr(e) I + shear e`, where `tr` and `I` run over the stored normal components.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Isotropic {
    /// Factor of the trace, in Pa or Pa s.
    pub volumetric: f64,
    /// Factor of the tensor itself (twice the shear modulus), in Pa or Pa s.
    pub shear: f64,
}

impl LinearTensor for Isotropic {
    #[inline(always)]
    fn stress<const S: usize>(&self, strain: &Mandel<S>) -> Mandel<S> {
        self.apply(strain)
    }

    #[inline(always)]
    fn add_block<const D: usize>(
        &self,
        factor: f64,
        volume: f64,
        [(g, hoop_g), (h, hoop_h)]: [&(Vector<D>, f64); 2],
        block: &mut [[f64; D]; D],
    ) {
        let (volumetric, shear) = (factor * self.volumetric, factor * self.shear);
        let inner = 0.5 * shear * dot(g, h);
        for i in 0..D {
            for j in 0..D {
                block[i][j] += volume * (volumetric * g[i] * h[j] + 0.5 * shear * g[j] * h[i]);
            }
            block[i][i] += volume * inner;
        }
        let pressure = volume * volumetric;
        for i in 0..D {
            block[0][i] += pressure * hoop_g * h[i];
            block[i][0] += pressure * g[i] * hoop_h;
        }
        block[0][0] += (pressure + volume * shear) * hoop_g * hoop_h;
    }
}

impl Isotropic {
    /// `T(e)`.
    #[inline(always)]
    pub fn apply<const S: usize>(&self, e: &Mandel<S>) -> Mandel<S> {
        let pressure = self.volumetric * trace(e);
        let mut out = [0.0; S];
        for c in 0..S {
            out[c] = self.shear * e[c];
        }
        for value in out.iter_mut().take(normal_components::<S>()) {
            *value += pressure;
        }
        out
    }

    /// With the shear modulus times this factor and the same bulk modulus, of strains with three normal components.
    pub fn with_shear_times(self, factor: f64) -> Self {
        Self { volumetric: self.volumetric + (1.0 - factor) * self.shear / 3.0, shear: factor * self.shear }
    }

    /// The same map of strains with three normal components, of those in a plane without stress across it.
    pub fn in_plane_stress(self) -> Self {
        Self { volumetric: self.volumetric * self.shear / (self.volumetric + self.shear), ..self }
    }

    /// The `e` with `T(e) = t`.
    #[inline(always)]
    pub fn solve<const S: usize>(&self, t: &Mandel<S>) -> Mandel<S> {
        let n = normal_components::<S>();
        let pressure = self.volumetric / (self.shear + n as f64 * self.volumetric) * trace(t);
        let mut out = *t;
        for value in out.iter_mut().take(n) {
            *value -= pressure;
        }
        for value in &mut out {
            *value /= self.shear;
        }
        out
    }

    /// `T U^-1`.
    #[inline(always)]
    pub fn over<const S: usize>(&self, other: &Self) -> Self {
        let n = normal_components::<S>() as f64;
        let [along, across] = [
            (self.shear + n * self.volumetric) / (other.shear + n * other.volumetric),
            self.shear / other.shear,
        ];
        Self { volumetric: (along - across) / n, shear: across }
    }

    /// `t : T^-1(t)`.
    #[inline(always)]
    pub fn inverse_square<const S: usize>(&self, t: &Mandel<S>) -> f64 {
        let (n, trace) = (normal_components::<S>() as f64, trace(t));
        let pressure = self.volumetric / (self.shear + n * self.volumetric) * trace;
        (dot(t, t) - pressure * trace) / self.shear
    }

    /// Smallest eigenvalue over the stored components, `m_A` of assumption H(A)(iv) for a viscosity.
    pub fn smallest_modulus<const S: usize>(&self) -> f64 {
        self.shear.min(self.shear + normal_components::<S>() as f64 * self.volumetric)
    }

    /// Largest eigenvalue over the stored components.
    pub(super) fn largest_modulus<const S: usize>(&self) -> f64 {
        self.shear.max(self.shear + normal_components::<S>() as f64 * self.volumetric)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solve_inverts_apply() {
        let tensor = Isotropic { volumetric: 25.0, shear: 50.0 };
        let e: Mandel<6> = [0.1, -0.2, 0.3, 0.4, -0.5, 0.6];
        let back = tensor.solve(&tensor.apply(&e));
        for c in 0..6 {
            assert!((back[c] - e[c]).abs() < 1e-15);
        }
        let t = tensor.apply(&e);
        assert!((tensor.inverse_square(&t) - dot(&t, &e)).abs() < 1e-13);
        let other = Isotropic { volumetric: -3.0, shear: 20.0 };
        let (found, expected) = (tensor.over::<6>(&other).apply(&e), tensor.apply(&other.solve(&e)));
        assert!((0..6).all(|c| (found[c] - expected[c]).abs() < 1e-14));
    }

    #[test]
    fn the_papers_viscosity_has_modulus_fifty() {
        assert_eq!(Isotropic { volumetric: 25.0, shear: 50.0 }.smallest_modulus::<3>(), 50.0);
        assert_eq!(Isotropic { volumetric: -10.0, shear: 50.0 }.smallest_modulus::<6>(), 20.0);
    }
}
