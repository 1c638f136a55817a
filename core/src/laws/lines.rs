//! Lines of text for a terminal.

use std::{borrow::Cow, iter::Peekable, str::Chars};

/// The text without control characters other than ends of lines, so that names and titles of a job can't command a terminal; a
/// whole escape sequence is left out.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    let is_control = |c: char| c.is_control() && c != '\n';
    if !text.contains(is_control) {
        return Cow::Borrowed(text);
    }
    let mut out = String::new();
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let introduces =
            |rest: &mut Peekable<Chars<'_>>, sign| c == '\u{1b}' && rest.next_if_eq(&sign).is_some();
        if c == '\u{9b}' || introduces(&mut rest, '[') {
            rest.by_ref().find(|c| ('@'..='~').contains(c));
        } else if introduces(&mut rest, ']') {
            // A command to the operating system, such as the title of the window.
            rest.by_ref().find(|c| matches!(c, '\u{7}' | '\u{1b}' | '\u{9c}'));
        } else if c == '\t' {
            out.push(' ');
        } else if !is_control(c) {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// Longest line, in characters.
pub const WIDTH: usize = 100;

/// The text with lines of at most [`WIDTH`] characters: longer ones continue on the next line, after `indent` blanks. A word longer
/// than a line stays whole.
pub fn wrapped(text: &str, indent: usize) -> Cow<'_, str> {
    if text.split('\n').all(|line| line.chars().count() <= WIDTH) {
        return Cow::Borrowed(text);
    }
    let lines: Vec<String> = text.split('\n').map(|line| wrapped_line(line, indent)).collect();
    Cow::Owned(lines.join("\n"))
}

fn wrapped_line(line: &str, indent: usize) -> String {
    let mut out = String::new();
    let (mut rest, mut before) = (line, 0);
    while before + rest.chars().count() > WIDTH {
        // The beginning of a line, such as its indentation and its first word, is not left alone.
        let least = indent.saturating_sub(before);
        let blanks = || rest.char_indices().enumerate().filter(|(at, (_, c))| *at > least && *c == ' ');
        let fitting = blanks().take_while(|(at, _)| before + at <= WIDTH).last();
        let Some((_, (at, _))) = fitting.or_else(|| blanks().next()) else { break };
        out.push_str(&format!("{:before$}{}\n", "", rest[..at].trim_end()));
        (rest, before) = (rest[at..].trim_start(), indent);
    }
    out + &format!("{:before$}{rest}", "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_continue_below_their_words_and_none_is_wider_than_the_terminal() {
        let long = format!("certified  {}", "words ".repeat(40));
        let lines: Vec<_> = wrapped(long.trim_end(), 11).lines().map(str::to_owned).collect();
        assert!(lines.iter().all(|line| line.chars().count() <= WIDTH), "{lines:?}");
        assert!(lines[0].starts_with("certified  words") && lines[1].starts_with("           words"));
        let words: Vec<&str> = lines.iter().flat_map(|line| line.split_whitespace()).collect();
        assert_eq!(words, long.split_whitespace().collect::<Vec<_>>());
    }

    #[test]
    fn escape_sequences_are_left_out() {
        let text = "a \u{1b}[31mred\u{1b}[0m title\u{7}\tof\u{9b}2J \u{1b}]0;window\u{7}two\nlines\r\u{1b}";
        assert_eq!(plain(text), "a red title of two\nlines");
        assert!(matches!(plain("µ, two\nlines"), Cow::Borrowed(_)));
    }

    #[test]
    fn short_lines_and_words_longer_than_a_line_stay_as_they_are() {
        assert!(matches!(wrapped("a line\nand another", 4), Cow::Borrowed(_)));
        let path = format!("files      /{}", "a".repeat(120));
        assert_eq!(wrapped(&path, 11), path);
        let exact = "a".repeat(WIDTH - 2) + " b";
        assert_eq!(wrapped(&format!("{exact} c"), 2), format!("{exact}\n  c"));
    }
}
