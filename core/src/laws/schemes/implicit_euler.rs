//! Implicit Euler.
//!
//! ```text
//! M/k (v_n - v_{n-1}) + A v_n + C(v_n) + B^T s_n = f_n
//! s_n = s_{n-1} + k [E e(v_n) + G(s_n)],   u_n = u_{n-1} + k v_n,   sigma_n = A e(v_n) + s_n
//! ```
//!
//! Unconditionally stable, of first order.

use crate::laws::step::{Blend, Step};

/// The blend from which a step starts: the previous state.
pub(super) fn blend(step: Step) -> Blend {
    Blend::euler(step.length)
}
