//! Sets of nodes or elements.

use super::lines::{Data, Keyword, refuse, short};
use crate::error::Result;

/// Sets may hold this many numbers for each byte of the file; sets of sets could hold more than memory has.
const MOST_PER_BYTE: usize = 4;
/// And this many more.
const MOST: usize = 1_000_000;

/// Where a name is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    /// In the part, or in a file without parts.
    Part,
    /// In the assembly of an instance of the part.
    Assembly,
}

/// A reference to a set by its name.
#[derive(Debug, Clone)]
pub(super) struct Name {
    pub(super) text: String,
    pub(super) scope: Scope,
    pub(super) line: usize,
}

/// What a set contains.
#[derive(Debug)]
enum Entry {
    One(u64, usize),
    Range { first: u64, last: u64, step: u64 },
    Set(Name),
}

/// A set as it is written.
#[derive(Debug)]
struct Set {
    name: Name,
    entries: Vec<Entry>,
}

/// The sets of a file, of nodes or of elements.
#[derive(Debug, Default)]
pub(super) struct Sets(Vec<Set>);

/// A set with its numbers.
#[derive(Debug)]
pub(super) struct Resolved {
    pub(super) name: Name,
    /// Ascending, each once.
    pub(super) numbers: Vec<u64>,
}

impl Sets {
    /// Position of a set, which is made if it does not exist.
    fn at(&mut self, name: Name) -> &mut Set {
        let same = |set: &Set| set.name.scope == name.scope && set.name.text.eq_ignore_ascii_case(&name.text);
        let at = self.0.iter().position(same).unwrap_or(self.0.len());
        if at == self.0.len() {
            self.0.push(Set { name, entries: Vec::new() });
        }
        &mut self.0[at]
    }

    /// Adds numbers to a set.
    pub(super) fn add(&mut self, name: Name, numbers: impl IntoIterator<Item = u64>) {
        let line = name.line;
        self.at(name).entries.extend(numbers.into_iter().map(|number| Entry::One(number, line)));
    }

    /// Reads the data lines of a set. Numbers are left out if they are of nodes that belong to the assembly (`is_foreign`).
    pub(super) fn read<'a>(
        &mut self,
        keyword: &Keyword,
        name: Name,
        is_foreign: bool,
        mut data: impl FnMut() -> Option<Data<'a>>,
    ) -> Result<()> {
        let scope = name.scope;
        let set = self.at(name);
        let is_range = keyword.parameter("GENERATE").is_some();
        while let Some(data) = data() {
            if is_range {
                let step = if data.words.len() > 2 { data.number(2, "a step")? } else { 1 };
                let (first, last) = (data.number(0, "the first number")?, data.number(1, "the last number")?);
                if step == 0 || last < first {
                    return Err(refuse(
                        data.line,
                        "GENERATE needs a step above 0 and a last number not below the first",
                    ));
                }
                if !is_foreign {
                    set.entries.push(Entry::Range { first, last, step });
                }
                continue;
            }
            for word in data.words.iter().filter(|word| !word.is_empty()) {
                match word.parse() {
                    Ok(number) if !is_foreign => set.entries.push(Entry::One(number, data.line)),
                    Ok(_) => {}
                    Err(_) => {
                        let name = Name { text: word.to_string(), scope, line: data.line };
                        set.entries.push(Entry::Set(name));
                    }
                }
            }
        }
        Ok(())
    }

    /// The numbers of all sets, which have to be among `known` (ascending) unless they are generated. `what` is what they contain.
    pub(super) fn resolve(&self, known: &[u64], what: &str, bytes: usize) -> Result<Vec<Resolved>> {
        let mut left = MOST_PER_BYTE.saturating_mul(bytes).saturating_add(MOST);
        let mut all: Vec<Resolved> = Vec::with_capacity(self.0.len());
        for Set { name, entries } in &self.0 {
            let mut numbers = Vec::new();
            for entry in entries {
                let before = numbers.len();
                match entry {
                    Entry::One(number, line) => {
                        if known.binary_search(number).is_err() {
                            let words = format!(
                                "the set {} has the {what} {number}, which the file does not contain",
                                name.text
                            );
                            return Err(refuse(*line, words));
                        }
                        numbers.push(*number);
                    }
                    Entry::Range { first, last, step } => {
                        let [low, high] =
                            [known.partition_point(|n| n < first), known.partition_point(|n| n <= last)];
                        numbers
                            .extend(known[low..high].iter().filter(|number| (*number - first) % step == 0));
                    }
                    Entry::Set(other) => numbers.extend(&find(&all, other, what)?.numbers),
                }
                match left.checked_sub(numbers.len() - before) {
                    Some(fewer) => left = fewer,
                    None => return Err(refuse(name.line, "the sets of the file contain too many numbers")),
                }
            }
            numbers.sort_unstable();
            numbers.dedup();
            all.push(Resolved { name: name.clone(), numbers });
        }
        Ok(all)
    }
}

/// The set with a name, first in the scope of the reference. An instance before a point is a name in the part.
pub(super) fn find<'a>(sets: &'a [Resolved], name: &Name, what: &str) -> Result<&'a Resolved> {
    let is = |set: &&Resolved, scope: Scope, text: &str| {
        set.name.scope == scope && set.name.text.eq_ignore_ascii_case(text)
    };
    let other = if name.scope == Scope::Part { Scope::Assembly } else { Scope::Part };
    let found =
        [name.scope, other].into_iter().find_map(|scope| sets.iter().find(|set| is(set, scope, &name.text)));
    let in_part = || {
        let (_, behind) = name.text.split_once('.')?;
        sets.iter().find(|set| is(set, Scope::Part, behind))
    };
    found.or_else(in_part).ok_or_else(|| {
        let words = format!("no set of {what}s `{}` is defined before this line", short(&name.text));
        refuse(name.line, words)
    })
}

/// The name of a set in job files: one of the part follows the word part where the assembly has a set of the same name.
pub(super) fn shown(name: &Name, sets: &[Resolved]) -> String {
    let is_hidden = name.scope == Scope::Part
        && sets.iter().any(|set| {
            set.name.scope == Scope::Assembly
                && set.name.text.eq_ignore_ascii_case(&name.text)
                && !set.numbers.is_empty()
        });
    if is_hidden { format!("part.{}", name.text) } else { name.text.clone() }
}
