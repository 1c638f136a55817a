//! What is proven of a formula by enclosures: where along a variable another piece begins, and bounds of values and derivatives.
//!
//! Ranges are halved until enclosures are sharp: the bounds hold for every number in them, not only for those that were tried.

use super::enclosure::{Enclosure, Ranges};
use super::interval::Interval;
use super::program::{COUNT, Program, Variable};
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

/// A bound that is infinite is not sharpened where a value of this size is taken, nor one that has next to no digits.
const LARGE: f64 = 1e100;

/// A piece of at most this number of adjacent numbers is part of the border beside it.
const NARROW: u64 = 16;

/// Numbers, nearly adjacent, between which another piece begins.
pub type Border = [f64; 2];

/// Values of all variables, in their order.
pub type Place = [f64; COUNT];

/// A bound from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supremum {
    /// The bound.
    pub bound: f64,
    /// About where it is taken.
    pub place: Place,
}

/// Why nothing is proven.
#[derive(Debug, Clone, PartialEq)]
pub enum Unproven {
    /// The formula has no value near this place.
    Undefined(Place),
    /// There are too many pieces, or they cannot be told apart, near this place.
    Pieces(Place),
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
            if count > MOST_PIECES * 2 * u64::BITS as usize || found.len() > MOST_PIECES || low == high {
                return Err(Unproven::Pieces(part.map(centre)));
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

    /// The largest value of a part of the enclosures in these ranges, from above, and about where it is taken. A derivative is meant within
    /// the pieces.
    pub(super) fn supremum(
        &self,
        ranges: &[Ranges],
        by: Variable,
        of: impl Fn(&Enclosure) -> Interval,
    ) -> Result<Supremum, Unproven> {
        let axes: Vec<usize> = self.variables().collect();
        let part = |ranges: Ranges| {
            let there = of(&self.enclose(&ranges.map(|range| Interval::from(centre(range))), by));
            let known = self.enclose(&ranges, by);
            let taken = Some(there.low).filter(|low| low.is_finite()).unwrap_or(f64::NEG_INFINITY);
            Part { bound: of(&known).high, taken, is_defined: known.value.is_defined, ranges }
        };
        let mut heap: BinaryHeap<Part> = ranges.iter().map(|ranges| part(*ranges)).collect();
        let mut taken = heap.iter().fold(f64::NEG_INFINITY, |taken, part| taken.max(part.taken));
        let mut count = 0;
        while let Some(Part { bound, is_defined, ranges, .. }) = heap.pop() {
            let place = ranges.map(centre);
            let is_sharp = bound <= taken + SHARP * taken.abs()
                || (bound == f64::INFINITY && taken >= LARGE)
                || (bound > 0.0 && bound <= f64::MIN_POSITIVE);
            if is_defined && (is_sharp || count > MOST_ENCLOSURES) {
                return Ok(Supremum { bound, place });
            }
            // The axis whose halves exceed what is taken by the fewest orders; without a difference the widest one.
            let halved = |axis: usize| {
                let Interval { low, high, .. } = ranges[axis];
                let middle = middle(low, high);
                let half = |ends: [f64; 2]| {
                    let mut half = ranges;
                    half[axis] = Interval::new(ends[0], ends[1]);
                    part(half)
                };
                (middle != low).then(|| [half([low, middle]), half([middle, high])])
            };
            let halves = axes.iter().filter_map(|&axis| Some((axis, halved(axis)?)));
            let measure = |axis: usize, halves: &[Part; 2]| {
                let excess: f64 = halves.iter().map(|half| half.excess(taken)).sum();
                let undefined = halves.iter().filter(|half| !half.is_defined).count();
                (undefined, excess, steps_between(ranges[axis].low, ranges[axis].high))
            };
            let best = halves.min_by(|(a, one), (b, other)| {
                let ((p, q, r), (s, t, u)) = (measure(*a, one), measure(*b, other));
                p.cmp(&s).then(q.total_cmp(&t)).then(u.cmp(&r))
            });
            match best {
                Some((_, halves)) if count <= MOST_ENCLOSURES => {
                    count += 2 * axes.len();
                    taken = halves.iter().fold(taken, |taken, half| taken.max(half.taken));
                    heap.extend(halves);
                }
                _ if is_defined => return Ok(Supremum { bound, place }),
                _ => return Err(Unproven::Undefined(place)),
            }
        }
        Ok(Supremum { bound: f64::NEG_INFINITY, place: [0.0; COUNT] })
    }
}

/// A part of the ranges, in the order of its bound; parts in which the formula may have no value come first.
struct Part {
    bound: f64,
    /// A value that is taken, from below.
    taken: f64,
    is_defined: bool,
    ranges: Ranges,
}

impl Part {
    /// The logarithm of the share by which the bound exceeds a value that is taken.
    fn excess(&self, taken: f64) -> f64 {
        let scale = taken.abs().clamp(f64::MIN_POSITIVE, f64::MAX);
        let share = (self.bound.min(f64::MAX) - taken.max(-f64::MAX)) / scale;
        share.clamp(SHARP, f64::MAX).ln()
    }
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

fn centre(range: Interval) -> f64 {
    middle(range.low, range.high)
}

/// The number in the middle of all numbers between two: of the order of both, if their orders differ.
fn middle(low: f64, high: f64) -> f64 {
    let middle = position(low) + (steps_between(low, high) / 2) as i64;
    f64::from_bits(if middle < 0 { (i64::MIN - middle) as u64 } else { middle as u64 })
}
