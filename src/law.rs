//! What all families of laws share: what is wrong with their keys, and calls of the law that was chosen.

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
