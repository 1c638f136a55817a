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
    /// The velocity in m/s and the traction in Pa that scale errors along the normal (`direction` 0) or in sliding (1), given the largest
    /// ones: the traction is at least this share of the mean traction of all forces, and the velocity at least the one at which the boundary
    /// resists with it.
    pub(super) fn range(self, [velocity, traction]: [f64; 2], share: f64, direction: usize) -> [f64; 2] {
        let mean = if self.area > 0.0 { self.forces / self.area } else { 0.0 };
        let traction = traction.max(share * mean);
        let range = [velocity.max(traction / self.resistance[direction]), traction];
        range.map(|size| if size > 0.0 { size } else { 1.0 })
    }
}

/// The largest distance; infinite if one is NaN.
pub(super) fn worst(distances: impl Iterator<Item = f64>) -> f64 {
    distances.fold(0.0, |worst, distance| if distance.is_nan() { f64::INFINITY } else { distance.max(worst) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_measured_by_the_forces_where_nothing_touches_and_moves() {
        let reference = ReferenceValues { resistance: [4.0, 2.0], area: 0.5, forces: 8.0 };
        assert_eq!(reference.range([1e-20, 0.0], 1.0, 0), [4.0, 16.0]);
        assert_eq!(reference.range([1e-20, 0.0], 0.25, 1), [2.0, 4.0]);
        assert_eq!(reference.range([9.0, 32.0], 1.0, 0), [9.0, 32.0]);
        assert_eq!(ReferenceValues::default().range([0.0; 2], 1.0, 0), [1.0; 2]);
    }
}
