//! What the names in output files stand for.

/// The declaration of a name in an output file: a column, a field or a member. A vector has the names of its components.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Declared {
    /// The names, those of components in their order.
    pub names: Vec<String>,
    /// The unit in the plane and in space; empty for words, numbers without a unit and objects.
    pub units: [&'static str; 2],
    /// What it means, in Markdown.
    pub meaning: String,
    /// Those of the names that files of bodies in the plane do not have.
    pub only_in_space: Vec<String>,
    /// Of a field, whether it has a value for each of the `nodes` or of the `cells`, and when it is written.
    pub field: Option<[&'static str; 2]>,
}

impl Declared {
    /// A declaration without a unit.
    pub(crate) fn new(names: Vec<String>, meaning: impl Into<String>) -> Self {
        Self { names, meaning: meaning.into(), ..Self::default() }
    }
}
