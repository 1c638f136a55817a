//! The energies of a body, each declared once, and their balance in a step.

use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// Where an energy stands in the balance of a step: `change of Stored + Dissipated = Work + Numerical`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Stored at the end of the step.
    Stored,
    /// Dissipated in the step.
    Dissipated,
    /// Work done on the body in the step.
    Work,
    /// Terms of the time scheme in the step, known exactly. Files hold minus their sum: the numerical dissipation.
    Numerical,
}

/// Defines [`Energy`] from a list of its members: meaning, role, field and column in `history.csv`.
macro_rules! energies {
    ($($(#[$meaning:meta])* $role:ident $name:ident = $column:literal;)*) => {
        /// Energies of a body in J (J/m in the plane): those that are stored at the end of a step, the others in it.
        ///
        /// For `lagged_euler` with `s_n = E e(u_{n-1}) + H_n` and `S_n = E e(u_n) + H_n`, testing (25) with `k v_n` gives exactly
        ///
        /// ```text
        /// d(1/2 v.Mv) + d(1/2 S:E^-1 S) + k v.Av + k s_{n-1}:X + k g(v).v - k f.v = numerical
        /// numerical = 1/2 |k E e(v_n)|^2 - 1/2 |v_n - v_{n-1}|^2_M - k (S_{n-1} - s_{n-1}):X + 1/2 |k E X|^2
        /// ```
        ///
        /// with `X` the viscoplastic strain rate at `s_{n-1}`, `(s_{n-1} - P_K s_{n-1}) / (2 lambda)` in the paper, and stresses
        /// measured by `E^-1`. The implicit schemes have their own `numerical`, see `stepping::implicit`. What hardening stores is part
        /// of the viscoplastic term. Damage `d` scales all terms with `S` or `E` by `1 - d_n` and adds its dissipation
        /// `(d_n - d_{n-1}) 1/2 S_{n-1}:E^-1 S_{n-1}`; for the terms of adhesion see [`super::Adhesion`].
        #[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
        #[serde(default)]
        pub struct Energy {
            $($(#[$meaning])* #[serde(rename = $column)] pub $name: f64,)*
        }

        impl Energy {
            /// How many there are.
            pub const COUNT: usize = [$($column),*].len();
            /// Their columns in `history.csv`, which are their names in checkpoints, too.
            pub const COLUMNS: [&'static str; Self::COUNT] = [$($column),*];
            /// Their roles, in the same order.
            pub const ROLES: [Role; Self::COUNT] = [$(Role::$role),*];

            /// As an array in this order.
            pub fn to_array(self) -> [f64; Self::COUNT] {
                [$(self.$name),*]
            }

            /// Back from the array.
            pub fn from_array([$($name),*]: [f64; Self::COUNT]) -> Self {
                Self { $($name),* }
            }
        }
    };
}

// The order of the columns: new ones go to the end.
energies! {
    /// Kinetic energy.
    Stored kinetic = "kinetic_energy";
    /// Elastic energy.
    Stored elastic = "elastic_energy";
    /// Dissipated by viscosity.
    Dissipated viscous = "viscous_dissipation";
    /// Taken up by viscoplastic flow: dissipated, or stored by hardening.
    Dissipated viscoplastic = "viscoplastic_dissipation";
    /// Dissipated by contact, or taken up by contact memory.
    Dissipated contact = "contact_dissipation";
    /// Work of loads and of obstacles that move.
    Work work = "external_work";
    /// Terms of the time scheme.
    Numerical numerical = "numerical_dissipation";
    /// Stored in contact (compliant foundations).
    Stored stored_in_contact = "contact_energy";
    /// Dissipated by damage.
    Dissipated damage = "damage_dissipation";
    /// Stored in stretched adhesive bonds.
    Stored stored_in_bonds = "adhesion_energy";
    /// Dissipated by bonds that break.
    Dissipated debonding = "adhesion_dissipation";
}

impl Energy {
    /// The unit of all of them.
    pub fn unit(dimension: usize) -> &'static str {
        if dimension == 2 { "J/m" } else { "J" }
    }
}

impl AddAssign for Energy {
    fn add_assign(&mut self, other: Self) {
        let (mut a, b) = (self.to_array(), other.to_array());
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        *self = Self::from_array(a);
    }
}
