//! The energy that a stress stores whose modulus is a formula of the strain, as an integral.

use crate::laws::{
    expression::{Formula, Interval, REACH, Scope, Variable},
    quadrature::means,
};

/// The powers of two times the scale of the strain between which integrals are kept.
const POWERS: std::ops::Range<i32> = -40..20;
/// A piece is halved until its integral changes by less than this share, but not more often than this.
const ACCURACY: f64 = 1e-14;
const MOST_HALVINGS: u32 = 12;

/// The integral of `s f(s)` over a strain `s` from 0 on: its values at the ends of pieces on which Gauss's rule is accurate.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stored {
    ends: Vec<f64>,
    values: Vec<f64>,
}

impl Stored {
    /// Of a formula of the equivalent strain whose values change at strains of about this size.
    pub(super) fn new<S: Scope>(formula: &Formula<S>, scale: f64) -> Self {
        let mut ends: Vec<f64> = POWERS.map(|power| scale * f64::from(power).exp2()).collect();
        let kinks = formula.borders(&[(Variable::E, Interval::new(0.0, REACH))], Variable::E);
        ends.extend(kinks.unwrap_or_default().into_iter().map(|border| border[1]));
        ends.sort_by(f64::total_cmp);
        let mut stored = Self { ends: vec![0.0], values: vec![0.0] };
        for end in ends {
            let start = stored.ends[stored.ends.len() - 1];
            stored.add_piece(formula, [start, end], MOST_HALVINGS);
        }
        stored
    }

    fn add_piece<S: Scope>(&mut self, formula: &Formula<S>, [start, end]: [f64; 2], halvings: u32) {
        let middle = 0.5 * (start + end);
        let whole = integral(formula, [start, end]);
        let parts = integral(formula, [start, middle]) + integral(formula, [middle, end]);
        if (whole - parts).abs() > ACCURACY * parts.abs() && halvings > 0 {
            self.add_piece(formula, [start, middle], halvings - 1);
            self.add_piece(formula, [middle, end], halvings - 1);
        } else if end > start {
            self.values.push(self.values[self.values.len() - 1] + parts);
            self.ends.push(end);
        }
    }

    /// The number of ends that are not beyond a strain, at least 1.
    fn piece(&self, strain: f64) -> usize {
        self.ends.partition_point(|end| *end <= strain).max(1)
    }

    /// The integral between two strains.
    pub(super) fn between<S: Scope>(&self, formula: &Formula<S>, [from, to]: [f64; 2]) -> f64 {
        if from > to {
            return -self.between(formula, [to, from]);
        }
        let [first, last] = [from, to].map(|strain| self.piece(strain));
        if first == last {
            return integral(formula, [from, to]);
        }
        let whole = self.values[last - 1] - self.values[first];
        let start = match from == self.ends[first - 1] {
            true => self.values[first] - self.values[first - 1],
            false => integral(formula, [from, self.ends[first]]),
        };
        start + whole + integral(formula, [self.ends[last - 1], to])
    }

    /// The mean of the formula over the squares of the strains between two.
    pub(super) fn mean<S: Scope>(&self, formula: &Formula<S>, [from, to]: [f64; 2]) -> f64 {
        let sum = from + to;
        if sum == 0.0 {
            return formula.value(&[(Variable::E, 0.0)]);
        }
        if self.piece(from) == self.piece(to) {
            return 2.0 * mean(formula, [from, to]) / sum;
        }
        2.0 * self.between(formula, [from, to]) / (sum * (to - from))
    }
}

/// The integral of `s f(s)` by Gauss's rule.
fn integral<S: Scope>(formula: &Formula<S>, [from, to]: [f64; 2]) -> f64 {
    (to - from) * mean(formula, [from, to])
}

/// The mean of `s f(s)` by Gauss's rule.
fn mean<S: Scope>(formula: &Formula<S>, range: [f64; 2]) -> f64 {
    means(|strain| strain * formula.value(&[(Variable::E, strain)]), range)[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::expression::OfStrain;

    fn formula(text: &str) -> Formula<OfStrain> {
        Formula::parse(text).expect("a formula")
    }

    #[test]
    fn integrals_are_those_of_closed_forms() {
        // s/(1 + s/r) has the integral r (s - r ln(1 + s/r)); min(1, r/s) s is s^2/2 and then r s - r^2/2.
        let r = 1e-3;
        let hyperbola = |s: f64| r * (s - r * (s / r).ln_1p());
        let yields = |s: f64| if s < r { 0.5 * s * s } else { r * s - 0.5 * r * r };
        for (text, exact) in
            [("1/(1 + e/1e-3)", &hyperbola as &dyn Fn(f64) -> f64), ("min(1, 1e-3/max(e, 1e-9))", &yields)]
        {
            let (formula, scale) = (formula(text), 0.05);
            let stored = Stored::new(&formula, scale);
            for to in [1e-5, 0.9e-3, 2e-3, 0.04, 1.7] {
                let wanted = exact(to);
                let found = stored.between(&formula, [0.0, to]);
                // The closed form of the first one loses digits.
                let lost = 1e-15 * to * r;
                assert!((found - wanted).abs() < 1e-13 * wanted + lost, "{text} {to}: {found} {wanted}");
                for from in [0.0, 0.5 * to, to * (1.0 - 1e-9), 3.0 * to] {
                    let parts = stored.between(&formula, [0.0, to]) - stored.between(&formula, [0.0, from]);
                    let one = stored.between(&formula, [from, to]);
                    assert!((one - parts).abs() < 1e-14 * wanted.max(exact(from)), "{text} {from} {to}");
                    let mean = stored.mean(&formula, [from, to]);
                    let change = 0.5 * (to - from) * (to + from) * mean;
                    assert!((change - one).abs() < 1e-14 * one.abs(), "{text} {from} {to}: {change} {one}");
                }
            }
        }
        let constant = formula("0.7");
        assert!((Stored::new(&constant, 1.0).mean(&constant, [0.1, 0.4]) - 0.7).abs() < 1e-15);
        assert_eq!(Stored::new(&constant, 1.0).mean(&constant, [0.0, 0.0]), 0.7);
    }
}
