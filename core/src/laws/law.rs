//! Shared by all families of laws: faults of their keys, a root finder for scalar equations, and the dispatch to the chosen law.

use std::sync::OnceLock;

/// A fault of a key of a law, or of another table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LawFault {
    /// The dotted key, relative to the table that was checked; empty for this table.
    pub key: String,
    /// Whether the key should be absent; otherwise its value is wrong.
    pub is_at_key: bool,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl LawFault {
    /// A wrong value.
    pub fn at_value(key: impl Into<String>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { key: key.into(), is_at_key: false, message: message.into(), help: help.into() }
    }

    /// A key that should be absent.
    pub fn at_key(key: impl Into<String>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { is_at_key: true, ..Self::at_value(key, message, help) }
    }

    /// The same fault, with its key relative to the table that contains `table`.
    pub fn within(self, table: &str) -> Self {
        let key = if self.key.is_empty() { table.to_owned() } else { format!("{table}.{}", self.key) };
        Self { key, ..self }
    }
}

/// What follows from the parameters of a law, found once: parameters are equal whether it was found or not.
#[derive(Debug, Clone)]
pub(crate) struct Derived<T>(OnceLock<T>);

impl<T> Derived<T> {
    /// The value, found by `find` if it is asked for the first time.
    pub(crate) fn get(&self, find: impl FnOnce() -> T) -> &T {
        self.0.get_or_init(find)
    }
}

impl<T> Default for Derived<T> {
    fn default() -> Self {
        Self(OnceLock::new())
    }
}

impl<T> PartialEq for Derived<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The header of a table in a job file, given its path: without the positions of items of lists, `[contact.normal]` for
/// `contact.0.normal`, and with two brackets for an item of a list, `[[contact]]` for `contact.0`.
pub(crate) fn header(path: &str) -> String {
    let is_position = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    let is_item = path.rsplit('.').next().is_some_and(is_position);
    let keys: Vec<&str> = path.split('.').filter(|part| !is_position(part)).collect();
    if is_item { format!("[[{}]]", keys.join(".")) } else { format!("[{}]", keys.join(".")) }
}

/// The root of an increasing function that is negative at `low` and not negative at `high`, by Newton's method within a bracket, with
/// bisection where its steps leave the bracket or do not become half as long. `function` returns value and derivative.
pub(crate) fn increasing_root(
    mut low: f64,
    mut high: f64,
    start: f64,
    mut function: impl FnMut(f64) -> [f64; 2],
) -> f64 {
    let (mut at, mut last) = (start, f64::INFINITY);
    for _ in 0..200 {
        let [value, slope] = function(at);
        if value > 0.0 {
            high = at
        } else {
            low = at
        }
        let newton = at - value / slope;
        let converges = (newton - at).abs() <= 0.5 * last || !low.is_finite();
        let next = if low < newton && newton < high && converges {
            newton
        } else if high.is_finite() {
            0.5 * (low + high)
        } else {
            2.0 * at
        };
        if (next - at).abs() <= 2.0 * f64::EPSILON * next.abs() || value == 0.0 {
            return if value == 0.0 { at } else { next };
        }
        last = (next - at).abs();
        at = next;
    }
    at
}

/// Methods of an enum of laws that delegate to the chosen law, through the `match` of the macro `$each`: its own, or those of a trait.
macro_rules! calls {
    ($visibility:vis $each:ident $family:ident $contract:ident: $($method:ident($($argument:ident: $kind:ty),*) -> $out:ty;)*) => {
        $(
            #[doc = concat!("See [`", stringify!($contract), "::", stringify!($method), "`].")]
            #[inline]
            $visibility fn $method(&self $(, $argument: $kind)*) -> $out {
                $each!($family, self, law => $contract::$method(law $(, $argument)*))
            }
        )*
    };
}
pub(crate) use calls;
