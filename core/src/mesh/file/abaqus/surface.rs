//! Surfaces as they are written.

use super::lines::{Data, refuse};
use super::sets::Name;
use crate::error::Result;

/// A surface of facets of elements.
#[derive(Debug)]
pub(super) struct Surface {
    pub(super) name: Name,
    pub(super) facets: Vec<Facets>,
}

/// The facets with a label of an element or of those of a set.
#[derive(Debug)]
pub(super) struct Facets {
    /// A number or the name of a set.
    pub(super) of: Name,
    pub(super) label: String,
}

impl Surface {
    /// Reads the data lines of a surface.
    pub(super) fn read<'a>(name: Name, mut data: impl FnMut() -> Option<Data<'a>>) -> Result<Self> {
        let mut facets = Vec::new();
        while let Some(data) = data() {
            let word = |at: usize| data.words.get(at).map_or(String::new(), |word| word.to_string());
            let of = Name { text: word(0), scope: name.scope, line: data.line };
            if word(1).is_empty() {
                return Err(refuse(
                    data.line,
                    "the facets need a label, for example `PAD, S3`: surfaces of all free facets are not read",
                ));
            }
            facets.push(Facets { of, label: word(1) });
        }
        Ok(Self { name, facets })
    }
}
