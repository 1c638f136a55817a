//! What all families of laws share: what is wrong with their keys, the root of a scalar equation, and calls of the law that was chosen.

/// What is wrong with a key of a law.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LawFault {
    /// The key, with dots, from the table it was asked of.
    pub key: String,
    /// Whether it is the key itself that should not be there, and not its value that is wrong.
    pub is_at_key: bool,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl LawFault {
    /// A value that is wrong.
    pub fn at_value(key: impl Into<String>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { key: key.into(), is_at_key: false, message: message.into(), help: help.into() }
    }

    /// A key that should not be there.
    pub fn at_key(key: impl Into<String>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { is_at_key: true, ..Self::at_value(key, message, help) }
    }

    /// The fault of a key in this table.
    pub fn within(self, table: &str) -> Self {
        Self { key: format!("{table}.{}", self.key), ..self }
    }
}

/// The root of an increasing function that is negative at `low` and not at `high`, by Newton's method kept inside a bracket.
/// `function` gives value and derivative.
pub(crate) fn increasing_root(
    mut low: f64,
    mut high: f64,
    start: f64,
    mut function: impl FnMut(f64) -> [f64; 2],
) -> f64 {
    let mut at = start;
    for _ in 0..200 {
        let [value, slope] = function(at);
        if value > 0.0 {
            high = at
        } else {
            low = at
        }
        let newton = at - value / slope;
        let next = if low < newton && newton < high {
            newton
        } else if high.is_finite() {
            0.5 * (low + high)
        } else {
            2.0 * at
        };
        if (next - at).abs() <= 2.0 * f64::EPSILON * next.abs() || value == 0.0 {
            return if value == 0.0 { at } else { next };
        }
        at = next;
    }
    at
}

/// Methods of an enum of laws that call the same ones of the chosen law, by a `match` that the macro `$each` makes.
macro_rules! calls {
    ($each:ident $family:ident $contract:ident: $($method:ident($($argument:ident: $kind:ty),*) -> $out:ty;)*) => {
        $(
            #[doc = concat!("See [`", stringify!($contract), "::", stringify!($method), "`].")]
            #[inline]
            pub fn $method(&self $(, $argument: $kind)*) -> $out {
                $each!($family, self, law => $contract::$method(law $(, $argument)*))
            }
        )*
    };
}
pub(crate) use calls;
