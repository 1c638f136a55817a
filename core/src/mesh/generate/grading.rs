//! The grid lines of a generated mesh along an axis.

use super::limits::room;
use crate::{
    error::{Error, Result},
    mesh::check::DEGENERATE,
};

const AXES: [&str; 3] = ["x", "y", "z"];

/// The ends of an axis near which cells are smaller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Toward {
    /// The low end.
    Low,
    /// The high end.
    High,
    /// Both ends, alike.
    Both,
}

/// The grading of the cells along an axis.
///
/// With `n` cells, grid line `i` has the distance `length * (i/n)^power` from the end with smaller cells. With both ends, each half
/// of the axis is graded in this way with `n/2` cells, and an odd number of cells has one cell across the middle. With a power
/// above 1, cells grow with the distance from this end, each at most `2^power - 1` times as long as the previous one. The longest
/// cell is at most `power` times as long as without grading, the shortest one `n^(power - 1)` times shorter (with both ends
/// `(n/2)^(power - 1)`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grading {
    /// The exponent. 1: uniform cells; above 1: smaller cells near the end; below 1: larger cells near the end.
    pub power: f64,
    /// The end or ends.
    pub toward: Toward,
}

impl From<f64> for Grading {
    /// Toward the low end.
    fn from(power: f64) -> Self {
        Self { power, toward: Toward::Low }
    }
}

/// The grid lines in m along an axis, `cells + 1` of them; refused unless they increase strictly.
pub(super) fn axis(name: &str, length: f64, cells: usize, grading: Grading) -> Result<Vec<f64>> {
    if !(length.is_finite() && length > 0.0) {
        return Err(Error::Refused(format!(
            "mesh size along {name} is {length}: give a finite length above 0"
        )));
    }
    if cells == 0 {
        return Err(Error::Refused(format!("mesh cells along {name} is 0: give at least 1")));
    }
    let Grading { power, toward } = grading;
    if !(power.is_finite() && power > 0.0) {
        return Err(Error::Refused(format!(
            "mesh grading along {name} is {power}: give a finite number above 0 (1 is uniform)"
        )));
    }
    let share = |i: usize, of: f64| (i as f64 / of).powf(power);
    let whole = cells as f64;
    let place = |i: usize| match toward {
        Toward::Low => length * share(i, whole),
        Toward::High => length - length * share(cells - i, whole),
        Toward::Both if 2 * i <= cells => 0.5 * length * share(2 * i, whole),
        Toward::Both => length - 0.5 * length * share(2 * (cells - i), whole),
    };
    let mut points: Vec<f64> = room(cells + 1)?;
    points.extend((0..=cells).map(place));
    if let Some(i) = points.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(Error::Refused(format!(
            "mesh grading {power} along {name} gives a cell of zero length at {name} = {}: choose a grading closer to 1, or fewer cells",
            points[i]
        )));
    }
    Ok(points)
}

/// Grid lines that start at `corner` in place of the origin; refused if rounding changes the length of a cell by more than a
/// millionth.
pub(super) fn moved<const D: usize>(mut lines: [Vec<f64>; D], corner: [f64; D]) -> Result<[Vec<f64>; D]> {
    for (axis, (points, start)) in lines.iter_mut().zip(corner).enumerate() {
        let lengths: Vec<f64> = points.windows(2).map(|pair| pair[1] - pair[0]).collect();
        points.iter_mut().for_each(|point| *point += start);
        let fits = |(pair, length): (&[f64], &f64)| (pair[1] - pair[0] - length).abs() <= 1e-6 * length;
        if !points.windows(2).zip(&lengths).all(fits) {
            return Err(Error::Refused(format!(
                "mesh cells along {0} are too small for a corner at {0} = {start} m: choose a corner nearer to the origin, or larger \
                 cells",
                AXES[axis]
            )));
        }
    }
    Ok(lines)
}

/// Refuses grid lines along the axes whose cells are degenerate.
pub(super) fn refuse_flat<const D: usize>(lines: [Vec<f64>; D]) -> Result<[Vec<f64>; D]> {
    let sides = lines.each_ref().map(|points| {
        let sides = points.windows(2).map(|pair| pair[1] - pair[0]);
        sides.fold((f64::INFINITY, 0.0), |(least, most): (f64, f64), side| (least.min(side), most.max(side)))
    });
    for (i, &(least, _)) in sides.iter().enumerate() {
        for (j, &(_, most)) in sides.iter().enumerate().filter(|(j, _)| *j != i) {
            if least < DEGENERATE * most {
                return Err(Error::Refused(format!(
                    "mesh cells of {least:e} m along {} and {most:e} m along {} are degenerate: choose size, cells and grading so that \
                     sides differ less",
                    AXES[i], AXES[j]
                )));
            }
        }
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(length: f64, cells: usize, power: f64, toward: Toward) -> Vec<f64> {
        axis("x", length, cells, Grading { power, toward }).expect("grid lines")
    }

    #[test]
    fn grid_lines_lie_where_the_power_of_their_share_puts_them() {
        assert_eq!(lines(16.0, 4, 2.0, Toward::Low), [0.0, 1.0, 4.0, 9.0, 16.0]);
        assert_eq!(lines(16.0, 4, 2.0, Toward::High), [0.0, 7.0, 12.0, 15.0, 16.0]);
        assert_eq!(lines(16.0, 8, 2.0, Toward::Both), [0.0, 0.5, 2.0, 4.5, 8.0, 11.5, 14.0, 15.5, 16.0]);
        let odd = lines(27.0, 3, 3.0, Toward::Both);
        assert!(
            odd.iter().zip([0.0, 4.0, 23.0, 27.0]).all(|(x, place)| (x - place).abs() < 1e-13),
            "{odd:?}"
        );
        assert_eq!(lines(2.0, 1, 5.0, Toward::Both), [0.0, 2.0]);
        assert_eq!(lines(4.0, 2, 0.5, Toward::Low)[1], 8f64.sqrt());
    }

    #[test]
    fn lines_move_to_their_corner_unless_rounding_spoils_the_cells() {
        let from = |cells: usize, corner: f64| {
            moved([lines(1.0, cells, 1.0, Toward::Low), lines(1.0, 1, 1.0, Toward::Low)], [corner, -2.0])
        };
        assert_eq!(from(4, 8.0).expect("moved"), [vec![8.0, 8.25, 8.5, 8.75, 9.0], vec![-2.0, -1.0]]);
        assert_eq!(from(5, 0.0).expect("moved")[0], lines(1.0, 5, 1.0, Toward::Low));
        for corner in [1e12, 1e300, f64::MAX, f64::INFINITY, f64::NAN] {
            let words = from(5, corner).expect_err("spoilt").to_string();
            assert!(words.contains("along x are too small for a corner at x ="), "{words}");
        }
    }

    #[test]
    fn a_power_of_one_is_uniform_toward_any_end() {
        for toward in [Toward::Low, Toward::High, Toward::Both] {
            assert_eq!(lines(8.0, 8, 1.0, toward), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        }
    }

    #[test]
    fn cells_grow_no_faster_and_no_larger_than_the_power_says() {
        let within = |value: f64, bound: f64| value <= bound * (1.0 + 1e-9);
        for toward in [Toward::Low, Toward::High, Toward::Both] {
            for power in [1.0, 1.3, 2.0, 3.5] {
                for cells in [2, 3, 7, 16, 33] {
                    let lines = lines(1.0, cells, power, toward);
                    assert_eq!((lines.len(), lines[0], lines[cells]), (cells + 1, 0.0, 1.0));
                    let lengths: Vec<f64> = lines.windows(2).map(|pair| pair[1] - pair[0]).collect();
                    let mean = 1.0 / cells as f64;
                    let of = if toward == Toward::Both { cells as f64 / 2.0 } else { cells as f64 };
                    let shortest = mean / of.powf(power - 1.0);
                    for (i, length) in lengths.iter().enumerate() {
                        assert!(within(*length, power * mean) && within(shortest, *length));
                        let next = lengths.get(i + 1).unwrap_or(length);
                        let ratio = length.max(*next) / length.min(*next);
                        assert!(within(ratio, 2f64.powf(power) - 1.0), "{ratio} {power} {cells} {toward:?}");
                    }
                    if toward == Toward::Both {
                        for (i, x) in lines.iter().enumerate() {
                            assert!((x + lines[cells - i] - 1.0).abs() < 1e-15, "not symmetric");
                        }
                    }
                }
            }
        }
    }
}
