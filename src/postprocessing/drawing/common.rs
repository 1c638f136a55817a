//! What several drawings of bodies have in common: colours, magnification of displacements, section.

use super::scale::number;
use std::collections::BTreeMap;

/// The common properties of several drawings.
#[derive(Debug, Clone, Default)]
pub struct Common {
    /// The drawings in words, such as "both runs".
    pub(super) words: &'static str,
    /// The ends of the colour scales, by the names of the pictures. A name is missing if the value is the same everywhere.
    pub(super) colours: BTreeMap<String, (f64, f64)>,
    /// Magnification factor of displacements, if there are any.
    pub magnification: Option<f64>,
    /// Points at the ends of all drawings, to the right and upwards in m; none except in animations.
    pub(super) section: Vec<[f64; 2]>,
}

impl Common {
    /// The common properties of drawings with these ends of the colour scales and magnification factors, each with its own section.
    pub(super) fn new(
        words: &'static str,
        ranges: impl Iterator<Item = (String, (f64, f64))>,
        magnification: Option<f64>,
    ) -> Self {
        let mut colours = BTreeMap::new();
        for (name, (low, high)) in ranges {
            let known = colours.entry(name).or_insert((low, high));
            *known = (known.0.min(low), known.1.max(high));
        }
        colours.retain(|_, (low, high)| !is_uniform(*low, *high));
        Self { words, colours, magnification, section: Vec::new() }
    }

    /// Whether the picture with this name shows a difference.
    pub fn has(&self, name: &str) -> bool {
        self.colours.contains_key(name)
    }
}

/// Whether values in this range count as the same: they are in all digits of a caption.
pub fn is_uniform(low: f64, high: f64) -> bool {
    number(low) == number(high)
}
