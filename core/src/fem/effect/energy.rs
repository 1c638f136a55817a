//! The energies of a body in a step. Each effect declares its own; `mod.rs` lists them all.

use std::ops::{AddAssign, Index, IndexMut};

/// The side of an energy in the balance of a step: `change of Stored + Dissipated = Work + Numerical`, and `HeatSpent = Heat`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Stored at the end of the step.
    Stored,
    /// Dissipated in the step.
    Dissipated,
    /// Work done on the body in the step.
    Work,
    /// Terms of the time scheme in the step, known exactly. Files contain minus their sum: the numerical dissipation.
    Numerical,
    /// Heat that the body has stored or lost in the step.
    HeatSpent,
    /// Heat that was released in the body or entered it in the step.
    Heat,
}

impl Role {
    /// Number of roles.
    pub const COUNT: usize = 6;

    /// Whether it is a side of the balance of heat.
    pub const fn is_heat(self) -> bool {
        matches!(self, Self::HeatSpent | Self::Heat)
    }
}

/// Largest number of energies.
const CAPACITY: usize = 24;

/// The declaration of an energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EnergyKind {
    /// Its column in `history.csv`, and its key in checkpoints.
    pub column: &'static str,
    /// The meaning of this column, in Markdown.
    pub meaning: &'static str,
    /// Its side in the balance.
    pub role: Role,
    position: usize,
}

impl EnergyKind {
    /// Declares an energy, given its position in the list of all energies.
    pub const fn new(position: usize, role: Role, column: &'static str, meaning: &'static str) -> Self {
        assert!(position < CAPACITY, "increase CAPACITY");
        Self { column, meaning, role, position }
    }
}

/// Terms of the time scheme.
pub const NUMERICAL: EnergyKind = EnergyKind::new(
    6,
    Role::Numerical,
    "numerical_dissipation",
    "dissipated by the time scheme since time 0, known exactly; negative if the scheme produces energy",
);

/// Whether each energy of a list is at its declared position.
pub(super) const fn are_in_order(energies: &[EnergyKind]) -> bool {
    let mut at = 0;
    while at < energies.len() {
        if energies[at].position != at {
            return false;
        }
        at += 1;
    }
    true
}

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
/// measured by `E^-1`. The implicit schemes have their own `numerical`, see `stepping::implicit`. The energy stored by hardening is
/// part of the viscoplastic term. Damage `d` scales all terms with `S` or `E` by `1 - d_n` and adds its dissipation
/// `(d_n - d_{n-1}) 1/2 S_{n-1}:E^-1 S_{n-1}`; for the terms of adhesion see [`super::Adhesion`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energy {
    values: [f64; CAPACITY],
}

impl Energy {
    /// The unit of all energies.
    pub fn unit(dimension: usize) -> &'static str {
        if dimension == 2 { "J/m" } else { "J" }
    }

    /// Applies a function to the values of all energies, for example a sum over ranks.
    pub fn map_values(self, function: impl FnOnce([f64; CAPACITY]) -> [f64; CAPACITY]) -> Self {
        Self { values: function(self.values) }
    }
}

impl Index<EnergyKind> for Energy {
    type Output = f64;

    fn index(&self, kind: EnergyKind) -> &f64 {
        &self.values[kind.position]
    }
}

impl IndexMut<EnergyKind> for Energy {
    fn index_mut(&mut self, kind: EnergyKind) -> &mut f64 {
        &mut self.values[kind.position]
    }
}

impl AddAssign for Energy {
    fn add_assign(&mut self, other: Self) {
        self.values.iter_mut().zip(other.values).for_each(|(sum, value)| *sum += value);
    }
}

impl<const N: usize> From<[(EnergyKind, f64); N]> for Energy {
    fn from(values: [(EnergyKind, f64); N]) -> Self {
        let mut energy = Self::default();
        values.into_iter().for_each(|(kind, value)| energy[kind] += value);
        energy
    }
}
