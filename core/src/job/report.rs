//! Faults with their positions, rendered for the user.

use codespan_reporting::diagnostic::{Diagnostic, Label};
use codespan_reporting::files::SimpleFiles;
use codespan_reporting::term::termcolor::Buffer;
use codespan_reporting::term::{Chars, Config, emit_to_write_style};
use std::ops::Range;

use crate::error::Error;

/// Largest number of faults that are shown; the others are counted only.
const SHOWN: usize = 60;

/// A range of bytes of the job file or of an override.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    /// 0 for the job file, 1, 2, ... for the overrides.
    pub file: usize,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Place {
    /// The bytes `range` of `file`.
    pub(crate) fn new(file: usize, range: Range<usize>) -> Self {
        Self { file, start: range.start, end: range.end }
    }
}

/// A fault of a job.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Fault {
    at: Place,
    message: String,
    label: String,
    notes: Vec<String>,
}

impl Fault {
    /// A fault with this `message`, and with `label` under its position.
    pub(crate) fn new(at: Place, message: impl Into<String>, label: impl Into<String>) -> Self {
        Self { at, message: message.into(), label: label.into(), notes: Vec::new() }
    }

    /// Adds advice.
    pub(crate) fn help(mut self, help: impl AsRef<str>) -> Self {
        self.notes.push(format!("help: {}", help.as_ref()));
        self
    }
}

/// The texts to which faults refer.
#[derive(Debug, Clone)]
pub(crate) struct Texts {
    kind: &'static str,
    files: SimpleFiles<String, String>,
    colour: bool,
}

impl Texts {
    /// The file of a document, followed by the overrides.
    pub(crate) fn new(
        kind: &'static str,
        name: &str,
        text: &str,
        overrides: &[String],
        colour: bool,
    ) -> Self {
        let mut files = SimpleFiles::new();
        files.add(printable(name), printable(text));
        for text in overrides {
            files.add("--set".to_owned(), printable(text));
        }
        Self { kind, files, colour }
    }

    /// All `faults` as one refusal, in the order of their positions.
    pub(crate) fn refuse(&self, mut faults: Vec<Fault>) -> Error {
        faults.sort();
        faults.dedup();
        let mut text = String::new();
        for fault in faults.iter().take(SHOWN) {
            text.push_str(&self.render(fault));
        }
        if faults.len() > SHOWN {
            text.push_str(&format!("... and {} more\n\n", faults.len() - SHOWN));
        }
        let count = faults.len();
        text.push_str(&format!("{count} fault{} in the {}", if count == 1 { "" } else { "s" }, self.kind));
        Error::Refused(text)
    }

    fn render(&self, fault: &Fault) -> String {
        let label =
            Label::primary(fault.at.file, fault.at.start..fault.at.end).with_message(one_line(&fault.label));
        let notes = fault.notes.iter().map(|note| one_line(note)).collect();
        let diagnostic =
            Diagnostic::error().with_message(one_line(&fault.message)).with_label(label).with_notes(notes);
        let config = Config { chars: Chars::ascii(), ..Config::default() };
        let mut buffer = if self.colour { Buffer::ansi() } else { Buffer::no_color() };
        match emit_to_write_style(&mut buffer, &config, &self.files, &diagnostic) {
            Ok(()) => String::from_utf8_lossy(buffer.as_slice()).into_owned(),
            Err(_) => format!("error: {}\n", one_line(&fault.message)),
        }
    }
}

/// The message in one line, so that it cannot be mistaken for several messages.
fn one_line(text: &str) -> String {
    printable(text).replace(['\n', '\t'], " ")
}

/// The text with control characters replaced by the same number of printable bytes, so that a job cannot control the terminal.
fn printable(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\r' => out.push(' '),
            '\n' | '\t' => out.push(c),
            c if c.is_control() => out.extend(std::iter::repeat_n('?', c.len_utf8())),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{Fault, Place, Texts};

    fn rendered(texts: &Texts, faults: Vec<Fault>) -> String {
        texts.refuse(faults).to_string()
    }

    #[test]
    fn faults_come_in_the_order_of_the_file_with_line_and_column() {
        let texts = Texts::new("job", "a.toml", "first = 1\nsecond = 2\n", &["x=3".to_owned()], false);
        let text = rendered(
            &texts,
            vec![
                Fault::new(Place::new(1, 2..3), "in the override", "three"),
                Fault::new(Place::new(0, 10..16), "in line two", "here").help("do this"),
                Fault::new(Place::new(0, 0..5), "in line one", ""),
            ],
        );
        let order = ["in line one", "a.toml:1:1", "in line two", "a.toml:2:1", "help: do this", "--set:1:3"];
        let places: Vec<_> = order.iter().map(|part| text.find(part).expect(part)).collect();
        assert!(places.is_sorted(), "{text}");
        assert!(text.ends_with("3 faults in the job"), "{text}");
    }

    #[test]
    fn control_characters_of_a_job_never_reach_the_terminal() {
        let texts = Texts::new("job", "a.toml", "key = \"\u{1b}[31m\"\n", &[], false);
        let text = rendered(&texts, vec![Fault::new(Place::new(0, 0..3), "bad \u{1b}]0;", "\u{9b}")]);
        assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{text:?}");
    }

    #[test]
    fn colour_is_there_only_when_asked_for() {
        let fault = || vec![Fault::new(Place::new(0, 0..1), "wrong", "here")];
        assert!(!rendered(&Texts::new("job", "a", "x", &[], false), fault()).contains('\u{1b}'));
        assert!(rendered(&Texts::new("job", "a", "x", &[], true), fault()).contains('\u{1b}'));
    }
}
