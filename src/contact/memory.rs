//! Memory of a foundation: what was pressed in pushes back, the more the longer it has been.
//!
//! Beside the normal law's pressure, `-sigma_nu` has the part
//!
//! ```text
//! m(t) = integral from 0 to t of b(t - s) max(u_nu(s), 0) ds,    b(t) = stiffness_rate exp(-t / decay_time)
//! ```
//!
//! so that `m' = stiffness_rate max(u_nu, 0) - m / decay_time`: one number a point stands for the whole past. A displacement
//! that is held is opposed, in the end, like by a spring of the stiffness `stiffness_rate decay_time`; what came off the
//! foundation is still pushed while that forgets. The force follows the displacement late, and so may put energy into a body
//! that swings: damping in the normal law or in the body has to take it up. (M. Sofonea, F. Pătrulescu, Analysis of a
//! history-dependent frictionless contact problem, Math. Mech. Solids 18 (2013), 409-430.)

/// The memory of a foundation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Memory {
    /// How fast the pressure grows at first for each metre pressed in, `b(0)`, in Pa/(m s).
    pub stiffness_rate: f64,
    /// Time in s in which the foundation forgets all but a part of 1/e.
    pub decay_time: f64,
}

impl Memory {
    /// The pressure in Pa after a step of this length in s, during which the point is held at this normal displacement in m.
    pub fn advance(&self, pressure: f64, displacement: f64, length: f64) -> f64 {
        let past = -length / self.decay_time;
        past.exp() * pressure - past.exp_m1() * self.stiffness() * displacement.max(0.0)
    }

    /// The stiffness in Pa/m against a displacement held for long.
    pub fn stiffness(&self) -> f64 {
        self.stiffness_rate * self.decay_time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLAY: Memory = Memory { stiffness_rate: 50.0, decay_time: 2.0 };

    #[test]
    fn pressure_grows_to_that_of_a_spring_and_is_forgotten_by_hand() {
        assert_eq!(CLAY.stiffness(), 100.0);
        // 100 Pa/m * 0.1 m, of which 1 - 1/e after the decay time.
        let once = CLAY.advance(0.0, 0.1, 2.0);
        assert!((once - 10.0 * (1.0 - (-1.0f64).exp())).abs() < 1e-14);
        assert!((CLAY.advance(once, 0.1, 1e3) - 10.0).abs() < 1e-13);
        assert!((CLAY.advance(10.0, 0.0, 2.0) - 10.0 * (-1.0f64).exp()).abs() < 1e-14);
        assert_eq!(CLAY.advance(0.0, -3.0, 2.0), 0.0, "lifted off");
        assert_eq!(Memory { stiffness_rate: 0.0, ..CLAY }.advance(0.0, 0.1, 2.0), 0.0);
    }

    #[test]
    fn short_steps_grow_with_the_stiffness_rate_and_steps_add_up() {
        let short = 1e-9;
        assert!((CLAY.advance(0.0, 0.1, short) / (5.0 * short) - 1.0).abs() < 1e-9);
        let halves = CLAY.advance(CLAY.advance(3.0, 0.1, 0.35), 0.1, 0.35);
        assert!((halves - CLAY.advance(3.0, 0.1, 0.7)).abs() < 1e-14);
    }
}
