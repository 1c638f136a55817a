//! Reference values for distances to the graphs of the laws.

/// Reference values for errors of velocities and tractions of a contact where its laws have no range of their own. They depend only
/// on the matrix and the forces of the step, not on the method of solving it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceValues {
    /// Resistance to a motion of the boundary alone, along the normal and in sliding, in Pa s/m.
    pub resistance: [f64; 2],
    /// Size of the boundary in m^(D-1), over all ranks.
    pub area: f64,
    /// The forces of the step, in N.
    pub forces: f64,
}

impl Default for ReferenceValues {
    fn default() -> Self {
        Self { resistance: [1.0; 2], area: 1.0, forces: 0.0 }
    }
}

impl ReferenceValues {
    /// The mean traction of all forces, in Pa.
    pub fn traction(self) -> f64 {
        if self.area > 0.0 { self.forces / self.area } else { 0.0 }
    }
}

/// The largest distance; infinite if one is NaN.
pub(super) fn worst(distances: impl Iterator<Item = f64>) -> f64 {
    distances.fold(0.0, |worst, distance| if distance.is_nan() { f64::INFINITY } else { distance.max(worst) })
}
