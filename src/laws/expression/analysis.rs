//! What is proven of a formula by enclosures: where along a variable another piece begins, and bounds of values and derivatives.
//!
//! Ranges are halved until enclosures are sharp: the bounds hold for every number in them, not only for those that were tried.

use super::enclosure::{Enclosure, Ranges};
use super::evaluate::COUNT;
use super::interval::Interval;
use super::program::{Instruction, Program, Variable};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Variables that have no bounds of their own are enclosed up to this size: no velocity in m/s, length in m or pressure in Pa of a body
/// is larger.
pub const REACH: f64 = 1e30;

/// Largest number of pieces along a variable.
const MOST_PIECES: usize = 1000;

/// Largest number of enclosures in a search.
const MOST_ENCLOSURES: usize = 40_000;

/// A bound is sharp if it exceeds a value that is taken by at most this share.
const SHARP: f64 = 0.01;

/// A bound, and a value within its part, below this multiple of the width of the enclosure at one number are rounding.
const ROUNDING: f64 = 16.0;

/// A piece of at most this number of adjacent numbers is part of the border beside it.
const NARROW: u64 = 16;

/// Numbers, nearly adjacent, between which another piece begins.
pub type Border = [f64; 2];

/// Why nothing is proven.
#[derive(Debug, Clone, PartialEq)]
pub enum Unproven {
    /// The formula has no value near this number.
    Undefined(f64),
    /// There are too many pieces, or they cannot be told apart, near this number.
    Pieces(f64),
}

impl Program {
    /// The borders between pieces along one variable, ascending, for all values of the others in their ranges.
    pub(super) fn borders(&self, ranges: &Ranges, along: Variable) -> Result<Vec<Border>, Unproven> {
        let whole = ranges[along as usize];
        let (mut found, mut left) = (Vec::new(), vec![[whole.low, whole.high]]);
        let mut count = 0;
        while let Some([low, high]) = left.pop() {
            count += 1;
            let mut part = *ranges;
            part[along as usize] = Interval::new(low, high);
            if self.enclose(&part, along).is_one_piece {
                continue;
            }
            let middle = middle(low, high);
            if count > MOST_ENCLOSURES || found.len() > MOST_PIECES || low == high {
                return Err(Unproven::Pieces(middle));
            }
            if middle == low {
                // Adjacent numbers. One of them may itself be a piece, as 0 is for `sign`.
                found.push([low, high]);
                continue;
            }
            // Both ends belong to the parts: a border between them lies in one of the parts.
            left.extend([[middle, high], [low, middle]]);
        }
        // Where arguments are rounded several adjacent numbers may change pieces.
        found.dedup_by(|after: &mut Border, before: &mut Border| {
            let is_one = steps_between(before[1], after[0]) <= NARROW;
            before[1] = if is_one { after[1] } else { before[1] };
            is_one
        });
        Ok(found)
    }

    /// The largest value of a part of the enclosures in these ranges, from above, and about where it is taken along the variable; 0 if
    /// it is smaller than rounding. A derivative is meant within the pieces.
    pub(super) fn supremum(
        &self,
        ranges: &[Ranges],
        by: Variable,
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<[f64; 2], Unproven> {
        let axes: Vec<usize> = (0..COUNT).filter(|axis| self.uses_number(*axis)).collect();
        let (mut heap, mut taken) = (BinaryHeap::new(), f64::NEG_INFINITY);
        let part = |ranges: Ranges| {
            let middles = ranges.map(|range| Interval::from(middle(range.low, range.high)));
            let (there, known) = (of(&self.enclose(&middles, by)), self.enclose(&ranges, by));
            let is_defined = known.value.is_defined;
            Part {
                bound: of(&known).high,
                taken: there.low,
                rounding: there.high - there.low,
                is_defined,
                ranges,
            }
        };
        let mut add = |heap: &mut BinaryHeap<Part>, ranges: Ranges| {
            let part = part(ranges);
            taken = if part.taken.is_finite() { taken.max(part.taken) } else { taken };
            heap.push(part);
            taken
        };
        let mut known = f64::NEG_INFINITY;
        for part in ranges {
            known = add(&mut heap, *part);
        }
        let mut count = 0;
        while let Some(Part { bound, taken, rounding, is_defined, ranges }) = heap.pop() {
            count += 1;
            let is_rounding = rounding.is_finite() && bound.abs().max(taken.abs()) <= ROUNDING * rounding;
            let is_sharp = bound <= known + SHARP * known.abs() || is_rounding;
            let widest =
                axes.iter().copied().max_by_key(|&axis| steps_between(ranges[axis].low, ranges[axis].high));
            let widest =
                widest.filter(|&axis| middle(ranges[axis].low, ranges[axis].high) != ranges[axis].low);
            let place = middle(ranges[by as usize].low, ranges[by as usize].high);
            match widest {
                _ if is_sharp && is_defined => {
                    return Ok([if is_rounding { 0.0 } else { bound }, place]);
                }
                Some(axis) if count < MOST_ENCLOSURES => {
                    let Interval { low, high, .. } = ranges[axis];
                    let middle = middle(low, high);
                    for half in [[low, middle], [middle, high]] {
                        let mut part = ranges;
                        part[axis] = Interval::new(half[0], half[1]);
                        known = add(&mut heap, part);
                    }
                }
                _ if is_defined => return Ok([bound, place]),
                _ => return Err(Unproven::Undefined(place)),
            }
        }
        Ok([f64::NEG_INFINITY, 0.0])
    }

    fn uses_number(&self, number: usize) -> bool {
        self.instructions.iter().any(|instruction| {
            matches!(instruction, Instruction::Variable(variable) if *variable as usize == number)
        })
    }
}

/// A part of the ranges, in the order of its bound; parts in which the formula may have no value come first.
struct Part {
    bound: f64,
    /// A value that is taken, from below.
    taken: f64,
    /// The width of the enclosure of this value.
    rounding: f64,
    is_defined: bool,
    ranges: Ranges,
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Part {}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        other.is_defined.cmp(&self.is_defined).then(self.bound.total_cmp(&other.bound))
    }
}

/// The position of a number among all numbers, in ascending order.
fn position(number: f64) -> i64 {
    let bits = number.to_bits() as i64;
    if bits < 0 { i64::MIN - bits } else { bits }
}

fn steps_between(low: f64, high: f64) -> u64 {
    position(high).abs_diff(position(low))
}

/// The number in the middle of all numbers between two: of the order of both, if their orders differ.
fn middle(low: f64, high: f64) -> f64 {
    let middle = position(low) + (steps_between(low, high) / 2) as i64;
    f64::from_bits(if middle < 0 { (i64::MIN - middle) as u64 } else { middle as u64 })
}
