//! The largest stress and strain of a body.

use crate::linear_algebra::{
    simd::{LANES, Pack},
    tensor::{dot, larger, von_mises_square},
};
use multiversion::multiversion;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest stress and strain of a body after a step, or after any step of a run, as files name them.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Peaks {
    /// Largest von Mises norm of the total stress at the points of integration of cells over all steps; linear cells have one.
    #[serde(rename = "max_von_mises")]
    #[schemars(title = "largest von Mises stress of the run", extend("unit" = "Pa"))]
    pub von_mises: f64,
    /// Largest norm of the strain of the displacement over all steps, in plane stress of its part in the plane.
    #[serde(rename = "max_strain")]
    #[schemars(title = "largest strain of the run")]
    pub strain: f64,
}

impl Peaks {
    /// The larger ones of two.
    pub fn or(self, other: Self) -> Self {
        Self { von_mises: larger(self.von_mises, other.von_mises), strain: larger(self.strain, other.strain) }
    }
}

/// Squares of the largest values over the cells visited so far, lane by lane.
#[derive(Debug, Default)]
pub struct PeakSquares {
    von_mises: [f64; LANES],
    strain: [f64; LANES],
}

impl PeakSquares {
    /// Updates the maxima with strain and total stress of the first `count` cells of a pack.
    pub fn update<const S: usize>(&mut self, count: usize, strain: &Pack<S>, stress: &Pack<S>) {
        update(self, count, strain, stress);
    }

    /// The maxima over all lanes.
    pub fn peaks(&self) -> Peaks {
        let most = |squares: &[f64; LANES]| squares.iter().copied().fold(0.0, larger).sqrt();
        Peaks { von_mises: most(&self.von_mises), strain: most(&self.strain) }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn update<const S: usize>(most: &mut PeakSquares, count: usize, strain: &Pack<S>, stress: &Pack<S>) {
    for lane in 0..LANES {
        // Lanes that no cell fills count nothing, whatever stands there.
        let counts = lane < count;
        let square = von_mises_square(&stress.lane(lane));
        most.von_mises[lane] = larger(most.von_mises[lane], if counts { square } else { 0.0 });
        let strain = strain.lane(lane);
        let square = dot(&strain, &strain);
        most.strain[lane] = larger(most.strain[lane], if counts { square } else { 0.0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::tensor::von_mises;

    #[test]
    fn the_largest_of_all_packs_is_found_and_nothing_beyond_the_cells() {
        let pack = |number: usize| -> Pack<6> {
            Pack::from_lanes(|lane| std::array::from_fn(|c| ((71 * number + 13 * lane + c) as f64).sin()))
        };
        let (mut squares, mut expected) = (PeakSquares::default(), Peaks::default());
        for number in 0..5 {
            let (strain, mut stress) = (pack(number), pack(100 + number));
            let count = LANES - number;
            for lane in 0..count {
                expected.von_mises = larger(expected.von_mises, von_mises(&stress.lane(lane)));
                expected.strain = larger(expected.strain, dot(&strain.lane(lane), &strain.lane(lane)).sqrt());
            }
            (count..LANES).for_each(|lane| stress.set(lane, [1e9, 0.0, f64::NAN, 0.0, 0.0, 0.0]));
            squares.update(count, &strain, &stress);
        }
        assert_eq!(squares.peaks(), expected);
        let mut bad = pack(1);
        bad.set(3, [f64::NAN; 6]);
        squares.update(LANES, &pack(2), &bad);
        squares.update(LANES, &pack(2), &pack(3));
        assert!(squares.peaks().von_mises.is_nan() && squares.peaks().strain == expected.strain);
    }
}
