//! The step being taken, and the state at which its laws are evaluated.

/// The step being taken, or the last one taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Step {
    /// Time at its end in s.
    pub time: f64,
    /// Its length in s.
    pub length: f64,
    /// Length of the step before it in s; 0 for the first step.
    pub previous_length: f64,
}

impl Step {
    /// The time at its start in s.
    pub fn start(self) -> f64 {
        start_of(self.time, self.length)
    }
}

/// The start in s of a step that ends at this time in s and has this length in s. A step may end at the last number before a jump of a load:
/// rounding errors of the difference must not take the start of the next one beyond it.
pub fn start_of(time: f64, length: f64) -> f64 {
    let rounding = 2.0 * f64::EPSILON * time.abs();
    if (time - length).abs() <= rounding { 0.0 } else { time - length - rounding }
}

/// A quantity that is kept from one step to the next, by its names in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity([&'static str; 2]);

/// Which values of a quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moment {
    /// Those after the last step.
    Last,
    /// Those before it.
    Earlier,
}

impl Moment {
    /// What belongs to this moment among the values after the last step and those before it, if they are kept.
    pub fn of<T>(self, last: T, earlier: Option<T>) -> Option<T> {
        match self {
            Self::Last => Some(last),
            Self::Earlier => earlier,
        }
    }
}

impl Quantity {
    /// A quantity with these names of its values after the last step and before it.
    pub const fn named(names: [&'static str; 2]) -> Self {
        Self(names)
    }

    /// The name of its values in checkpoints and field files.
    pub const fn name(self, moment: Moment) -> &'static str {
        self.0[moment as usize]
    }
}

/// The quantity of this name.
macro_rules! quantity {
    ($name:literal) => {
        $crate::laws::step::Quantity::named([$name, concat!("previous_", $name)])
    };
}
pub(crate) use quantity;

/// An implicit step: one of implicit Euler of length `k'` from a blend of the last two states to the time at which its equations hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    /// `k'` in s: displacement, stress and velocity change by `k'` times their rates at the end.
    pub length: f64,
    /// Share of the converged state.
    pub recent: f64,
    /// Share of the state before it.
    pub earlier: f64,
    /// Share of the step after which its equations hold: 1, or less if the end is extrapolated.
    pub balance: f64,
}

impl Blend {
    /// Implicit Euler.
    pub const fn euler(length: f64) -> Self {
        Self { length, recent: 1.0, earlier: 0.0, balance: 1.0 }
    }

    /// The midpoint rule for a step of this length in s.
    pub fn midpoint(length: f64) -> Self {
        Self { balance: 0.5, ..Self::euler(0.5 * length) }
    }

    /// The blend of two values.
    #[inline(always)]
    pub fn of(self, recent: f64, earlier: f64) -> f64 {
        self.recent * recent + self.earlier * earlier
    }

    /// Whether the end of the step is extrapolated from the time at which its equations hold.
    pub fn extrapolates(self) -> bool {
        self.balance < 1.0
    }

    /// The length in s that multiplies the solved velocity in the displacement at the end of the step.
    pub fn way(self) -> f64 {
        self.length / self.balance
    }

    /// The value at the end of the step on the line through that before it and that where its equations hold.
    pub fn end(self, before: f64, balanced: f64) -> f64 {
        (balanced - (1.0 - self.balance) * before) / self.balance
    }

    /// The same from the start of the step to its end, if that is extrapolated.
    pub fn to_end(self) -> Self {
        Self { length: self.way(), balance: 1.0, ..self }
    }

    /// The part of the step at whose end its equations hold.
    pub fn balanced(self, step: Step) -> Step {
        let rest = (1.0 - self.balance) * step.length;
        Step { time: step.time - rest, length: self.balance * step.length, ..step }
    }
}

/// The state at which laws are evaluated, chosen by the time scheme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Evaluation {
    /// The converged state before the step; evaluated once a step.
    Converged,
    /// The blend of states from which an implicit step starts; evaluated once a step. Gives the known part of the stress at its
    /// end.
    Start(Blend),
    /// The end of an implicit step; evaluated for each iterate. Gives the part of the stress that is not a linear function of the
    /// velocity.
    End(Blend),
}

impl Evaluation {
    /// The same at the end of an implicit step that was extrapolated to it.
    pub fn at_end(self) -> Self {
        match self {
            Self::End(blend) => Self::End(blend.to_end()),
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_starts_before_the_jump_at_which_the_last_one_ended() {
        for jump in [0.45f64, 0.1, 3.7, 1e6 + 0.3] {
            let last = jump.next_down();
            for time in [jump + 0.05, jump + 0.1, jump + 1.0 / 3.0] {
                for length in [time - last, time - jump] {
                    let start = start_of(time, length);
                    assert!(start <= last && last - start < 1e-15 * time, "{start} {last}");
                }
            }
        }
        assert_eq!([start_of(0.3, 0.3), start_of(0.0, 0.0), start_of(0.0, 0.5)], [0.0, 0.0, -0.5]);
    }

    #[test]
    fn a_step_is_solved_where_its_equations_hold_and_continued_to_its_end() {
        let step = Step { time: 3.0, length: 0.5, previous_length: 0.25 };
        let midpoint = Blend::midpoint(step.length);
        assert_eq!(midpoint.balanced(step), Step { time: 2.75, length: 0.25, ..step });
        assert_eq!((midpoint.length, midpoint.way(), midpoint.end(1.0, 3.0)), (0.25, 0.5, 5.0));
        assert_eq!((midpoint.to_end(), midpoint.extrapolates()), (Blend::euler(0.5), true));
        let euler = Blend::euler(step.length);
        assert_eq!((euler.balanced(step), euler.to_end(), euler.extrapolates()), (step, euler, false));
        assert_eq!((euler.way(), euler.end(1.0, 3.0)), (0.5, 3.0));
    }
}
