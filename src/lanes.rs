//! Cells side by side, so that one instruction works on several of them.
//!
//! Functions whose loops run over lanes are compiled twice (`#[multiversion]`): for any processor of the architecture, and for
//! those with 256-bit vectors, which is decided at run time. Both do the same operations in the same order: no bit differs.

/// Cells of a pack.
pub const LANES: usize = 16;

/// `N` numbers of each of [`LANES`] cells, number by number.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Pack<const N: usize>(pub [[f64; LANES]; N]);

impl<const N: usize> Pack<N> {
    /// All zero.
    pub const ZERO: Self = Self([[0.0; LANES]; N]);

    /// The numbers of one cell.
    #[inline(always)]
    pub fn lane(&self, lane: usize) -> [f64; N] {
        std::array::from_fn(|c| self.0[c][lane])
    }

    /// Sets the numbers of one cell.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, numbers: [f64; N]) {
        for c in 0..N {
            self.0[c][lane] = numbers[c];
        }
    }

    /// From the numbers of each cell.
    #[inline(always)]
    pub fn from_lanes(mut numbers: impl FnMut(usize) -> [f64; N]) -> Self {
        let mut out = Self::ZERO;
        for lane in 0..LANES {
            out.set(lane, numbers(lane));
        }
        out
    }
}

/// Asks for numbers that are soon needed, so that they come while others are worked on.
#[inline(always)]
pub fn prefetch(numbers: &[f64]) {
    #[cfg(target_arch = "x86_64")]
    numbers.iter().step_by(64 / size_of::<f64>()).for_each(safe_arch::prefetch_t0);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = numbers;
}

/// Pack and lane of a cell that so many others precede.
#[inline(always)]
pub fn place(at: usize) -> (usize, usize) {
    (at / LANES, at % LANES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_found_where_they_were_put() {
        let mut pack = Pack::from_lanes(|lane| [lane as f64, -1.0, 0.5 * lane as f64]);
        pack.set(3, [7.0, 8.0, 9.0]);
        assert_eq!(pack.lane(3), [7.0, 8.0, 9.0]);
        assert_eq!(pack.lane(LANES - 1), [LANES as f64 - 1.0, -1.0, 0.5 * (LANES as f64 - 1.0)]);
        assert_eq!((pack.0[0][3], pack.0[2][4]), (7.0, 2.0));
        assert_eq!(place(2 * LANES + 5), (2, 5));
    }
}
