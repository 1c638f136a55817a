//! The energy balance of a step.

use std::ops::AddAssign;

/// Energies of a body in J (J/m in the plane), after a step or released in it.
///
/// For `lagged_euler` with `s_n = E e(u_{n-1}) + H_n` and `S_n = E e(u_n) + H_n`, testing (25) with `k v_n` gives exactly
///
/// ```text
/// d(1/2 v.Mv) + d(1/2 S:E^-1 S) + k v.Av + k s_{n-1}:X + k g(v).v - k f.v = numerical
/// numerical = 1/2 |k E e(v_n)|^2 - 1/2 |v_n - v_{n-1}|^2_M - k (S_{n-1} - s_{n-1}):X + 1/2 |k E X|^2
/// ```
///
/// with `X` the viscoplastic strain rate at `s_{n-1}`, `(s_{n-1} - P_K s_{n-1}) / (2 lambda)` in the paper, and stresses measured
/// by `E^-1`. The implicit schemes have their own `numerical`, see `stepping::implicit`. What hardening stores is part of the viscoplastic term. Damage `d` scales all terms with `S` or `E` by
/// `1 - d_n` and adds its dissipation `(d_n - d_{n-1}) 1/2 S_{n-1}:E^-1 S_{n-1}`; what adhesion adds stands with
/// [`super::Adhesion`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energy {
    /// Kinetic energy at the end of the step.
    pub kinetic: f64,
    /// Elastic energy at the end of the step.
    pub elastic: f64,
    /// Stored in contact (compliant foundations) at the end of the step.
    pub stored_in_contact: f64,
    /// Dissipated by viscosity in the step.
    pub viscous: f64,
    /// Taken up by viscoplastic flow in the step: dissipated, or stored by hardening.
    pub viscoplastic: f64,
    /// Dissipated by contact in the step, or taken up by a foundation that remembers.
    pub contact: f64,
    /// Work of loads and of obstacles that move in the step.
    pub work: f64,
    /// The scheme's own terms in the step, known exactly.
    pub numerical: f64,
    /// Dissipated by damage in the step.
    pub damage: f64,
    /// Stored in stretched adhesive bonds at the end of the step.
    pub stored_in_bonds: f64,
    /// Dissipated by bonds that give way in the step.
    pub debonding: f64,
}

impl Energy {
    /// As an array, for sums over ranks.
    pub fn to_array(self) -> [f64; 11] {
        [
            self.kinetic,
            self.elastic,
            self.stored_in_contact,
            self.viscous,
            self.viscoplastic,
            self.contact,
            self.work,
            self.numerical,
            self.damage,
            self.stored_in_bonds,
            self.debonding,
        ]
    }

    /// Back from the array.
    pub fn from_array(a: [f64; 11]) -> Self {
        let [kinetic, elastic, stored_in_contact, viscous, viscoplastic, contact, work, numerical, rest @ ..] =
            a;
        let [damage, stored_in_bonds, debonding] = rest;
        Self {
            kinetic,
            elastic,
            stored_in_contact,
            viscous,
            viscoplastic,
            contact,
            work,
            numerical,
            damage,
            stored_in_bonds,
            debonding,
        }
    }
}

impl AddAssign for Energy {
    fn add_assign(&mut self, other: Self) {
        let (mut a, b) = (self.to_array(), other.to_array());
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        *self = Self::from_array(a);
    }
}
