//! Packs of cells for vector instructions: the same component of all cells of a pack is contiguous in memory.
//!
//! Functions whose loops run over lanes are compiled three times (`#[multiversion]`): for any processor of the architecture, for
//! those with vectors of 256 bits and for those with 512, which is decided at run time. All do the same operations in the same
//! order: no bit differs.

/// Number of cells in a pack.
pub const LANES: usize = 16;

/// `N` numbers of each of [`LANES`] cells, number by number.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Pack<const N: usize>(pub [[f64; LANES]; N]);

impl<const N: usize> Pack<N> {
    /// All zero.
    pub const ZERO: Self = Self([[0.0; LANES]; N]);
    /// An empty pack, for quantities that are not needed.
    pub const ABSENT: Self = Self([[f64::NAN; LANES]; N]);

    /// Whether these are no numbers.
    pub fn is_absent(&self) -> bool {
        self.0.as_flattened().iter().all(|number| number.is_nan())
    }

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

    /// Asks for the numbers, which are soon needed, so that they come while others are worked on.
    #[inline(always)]
    pub fn prefetch(&self) {
        self.0.iter().for_each(prefetch);
    }
}

/// Asks for a number of each cell, which is soon needed.
#[inline(always)]
pub fn prefetch(numbers: &[f64; LANES]) {
    // 64 bytes come at a time.
    #[cfg(target_arch = "x86_64")]
    for lane in [0, LANES / 2] {
        safe_arch::prefetch_t0(&numbers[lane]);
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = numbers;
}

/// The sum over the lanes, halves added to each other.
#[inline(always)]
pub fn sum(numbers: &[f64; LANES]) -> f64 {
    let mut sums = *numbers;
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            sums[lane] += sums[lane + width];
        }
        width /= 2;
    }
    sums[0]
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
        assert!(Pack::<2>::ABSENT.is_absent() && !pack.is_absent());
    }

    #[test]
    fn a_sum_takes_every_lane_once() {
        assert_eq!(sum(&std::array::from_fn(|lane| (1u64 << lane) as f64)), 65535.0);
        // Halves first: 1 meets -1 eight lanes on, before either meets what would swallow it.
        let mut numbers = [0.0; LANES];
        (numbers[0], numbers[8], numbers[1], numbers[9]) = (1e20, -1e20, 1.0, 2.0);
        assert_eq!(sum(&numbers), 3.0);
    }
}
