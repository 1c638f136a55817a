//! Linear isotropic tensors: elasticity and viscosity.

use crate::tensor::{Mandel, normal_components, trace};

/// What the plane stands for in two dimensions, or space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hypothesis {
    /// The out-of-plane stress vanishes.
    PlaneStress,
    /// The out-of-plane strain vanishes.
    PlaneStrain,
    /// Three dimensions.
    Space,
}

impl Hypothesis {
    /// What stresses of so many components stand for.
    pub fn of(components: usize) -> Self {
        match components {
            3 => Self::PlaneStress,
            4 => Self::PlaneStrain,
            _ => Self::Space,
        }
    }
}

/// `T(e) = volumetric tr(e) I + shear e`, where `tr` and `I` run over the stored normal components.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Isotropic {
    /// Factor of the trace, in Pa or Pa s.
    pub volumetric: f64,
    /// Factor of the tensor itself (twice the shear modulus), in Pa or Pa s.
    pub shear: f64,
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

    /// `t : T^-1(t)`.
    #[inline(always)]
    pub fn inverse_square<const S: usize>(&self, t: &Mandel<S>) -> f64 {
        let (n, trace) = (normal_components::<S>() as f64, trace(t));
        let pressure = self.volumetric / (self.shear + n * self.volumetric) * trace;
        (crate::tensor::dot(t, t) - pressure * trace) / self.shear
    }

    /// Smallest eigenvalue over the stored components, `m_A` of assumption H(A)(iv) for a viscosity.
    pub fn smallest_modulus<const S: usize>(&self) -> f64 {
        self.shear.min(self.shear + normal_components::<S>() as f64 * self.volumetric)
    }

    /// Largest eigenvalue over the stored components.
    pub fn largest_modulus<const S: usize>(&self) -> f64 {
        self.shear.max(self.shear + normal_components::<S>() as f64 * self.volumetric)
    }
}

/// Linear isotropic elasticity, section 5 of Wang and Cheng (2022) for plane stress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elasticity {
    /// Young's modulus in Pa.
    pub youngs_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

impl Elasticity {
    /// The stress-strain relation under this hypothesis.
    ///
    /// Plane stress: `E k / (1 - k^2) tr(e) I + E / (1 + k) e` with the trace over the plane; otherwise
    /// `E k / ((1 + k)(1 - 2 k)) tr(e) I + E / (1 + k) e`.
    pub fn tensor(&self, hypothesis: Hypothesis) -> Isotropic {
        let (modulus, ratio) = (self.youngs_modulus, self.poisson_ratio);
        let volumetric = match hypothesis {
            Hypothesis::PlaneStress => modulus * ratio / (1.0 - ratio * ratio),
            Hypothesis::PlaneStrain | Hypothesis::Space => {
                modulus * ratio / ((1.0 + ratio) * (1.0 - 2.0 * ratio))
            }
        };
        Isotropic { volumetric, shear: modulus / (1.0 + ratio) }
    }
}

/// Linear viscosity `A(e) = volumetric tr(e) I + shear e`, section 5 of Wang and Cheng (2022).
pub type Viscosity = Isotropic;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::dot;

    const PAPER: Elasticity = Elasticity { youngs_modulus: 1000.0, poisson_ratio: 0.4 };

    #[test]
    fn plane_stress_gives_youngs_modulus_in_uniaxial_tension() {
        let stress = PAPER.tensor(Hypothesis::PlaneStress).apply(&[1e-3, -0.4e-3, 0.0]);
        assert!((stress[0] - 1.0).abs() < 1e-14 && stress[1].abs() < 1e-14, "{stress:?}");
    }

    #[test]
    fn space_gives_youngs_modulus_in_uniaxial_tension() {
        let stress = PAPER.tensor(Hypothesis::Space).apply(&[1e-3, -0.4e-3, -0.4e-3, 0.0, 0.0, 0.0]);
        assert!((stress[0] - 1.0).abs() < 1e-12 && stress[1].abs() < 1e-12, "{stress:?}");
    }

    #[test]
    fn plane_strain_is_space_without_out_of_plane_strain() {
        let plane: Mandel<4> = PAPER.tensor(Hypothesis::PlaneStrain).apply(&[0.1, 0.2, 0.0, 0.3]);
        let space: Mandel<6> = PAPER.tensor(Hypothesis::Space).apply(&[0.1, 0.2, 0.0, 0.0, 0.0, 0.3]);
        assert_eq!(plane, [space[0], space[1], space[2], space[5]]);
    }

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
    }

    #[test]
    fn the_papers_viscosity_has_modulus_fifty() {
        assert_eq!(Isotropic { volumetric: 25.0, shear: 50.0 }.smallest_modulus::<3>(), 50.0);
        assert_eq!(Isotropic { volumetric: -10.0, shear: 50.0 }.smallest_modulus::<6>(), 20.0);
    }
}
