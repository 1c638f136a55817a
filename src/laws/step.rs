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

/// The start of an implicit step, which equals a step of implicit Euler of length `k'` from a blend of the last two states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    /// `k'` in s: displacement, stress and velocity change by `k'` times their rates at the end.
    pub length: f64,
    /// Share of the converged state.
    pub recent: f64,
    /// Share of the state before it.
    pub earlier: f64,
}

impl Blend {
    /// Implicit Euler.
    pub fn euler(length: f64) -> Self {
        Self { length, recent: 1.0, earlier: 0.0 }
    }

    /// The blend of two values.
    #[inline(always)]
    pub fn of(self, recent: f64, earlier: f64) -> f64 {
        self.recent * recent + self.earlier * earlier
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
