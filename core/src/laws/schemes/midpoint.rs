//! The midpoint rule, with rigid contact at the end of the step.
//!
//! ```text
//! 2/k M (v_m - v_{n-1}) + A v_m + C(v_m) + B^T s_m = f(t_{n-1} + k/2)
//! s_m = s_{n-1} + k/2 [E e(v_m) + G(s_m)],   u_n = u_{n-1} + k v_m,   x_n = 2 x_m - x_{n-1} for velocity and stress
//! ```
//!
//! A step of implicit Euler over `k/2`, from whose end the state is extrapolated over another `k/2`. Forces of contact depend on
//! `v_m` through the displacement `u_n` at the end of the step: with a rigid obstacle at the gap `g`, `p (u_n - g) = 0` and
//! `u_n <= g`, so that the work of the pressure on the body, `-p (u_n - u_{n-1}) = -p (g - u_{n-1})`, is never positive. All
//! other terms conserve the energy or dissipate it, and the total energy of a body without loads never grows. The pressure of a law with a
//! potential is its mean over the step, which conserves energy ([`crate::laws::contact`], `discrete_gradient.rs`). A node with mass on a rigid
//! obstacle would rebound in each step; so contact boundaries must have no inertia, and the velocity of their nodes is `v_m`. (C. Kane,
//! E. A. Repetto, M. Ortiz, J. E. Marsden, Comput. Methods Appl. Mech. Engrg. 180, 1999; H. B. Khenous, P. Laborde, Y. Renard, Eur. J.
//! Mech. A 27, 2008.)

use crate::laws::step::{Blend, Step};

/// The blend from which the half step starts: the previous state.
pub(super) fn blend(step: Step) -> Blend {
    Blend::midpoint(step.length)
}
