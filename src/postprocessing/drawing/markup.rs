//! Pieces of HTML.

use std::fmt::Write;

/// Text escaped for HTML and XML, for elements and quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c if c.is_control() && c != '\n' && c != '\t' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A table of two columns, name and value; the texts are escaped.
pub fn facts(caption: &str, rows: &[(String, String)]) -> String {
    let mut out = opening("facts", caption);
    for (what, value) in rows {
        // Writing to a String cannot fail.
        let _ = writeln!(out, "<tr><th scope=\"row\">{}</th><td>{}</td></tr>", escape(what), escape(value));
    }
    out + "</table></div>\n"
}

/// A table with a header; the texts are escaped.
pub fn table(caption: &str, header: &[&str], rows: &[Vec<String>]) -> String {
    let mut out = opening("data", caption) + "<thead><tr>";
    for name in header {
        let _ = write!(out, "<th scope=\"col\">{}</th>", escape(name));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in rows {
        let cells = row.iter().map(|cell| {
            let class = if is_short(cell) { " class=\"short\"" } else { "" };
            format!("<td{class}>{}</td>", escape(cell))
        });
        let _ = writeln!(out, "<tr>{}</tr>", cells.collect::<String>());
    }
    out + "</tbody></table></div>\n"
}

/// Whether a cell is a number, possibly with a unit, which must not be broken across lines.
fn is_short(cell: &str) -> bool {
    cell.len() <= 16 && cell.starts_with(|c: char| c.is_ascii_digit() || "-−".contains(c))
}

/// A container in which wide tables can be scrolled, also by keyboard.
fn opening(class: &str, caption: &str) -> String {
    let words = escape(if caption.is_empty() { "Table" } else { caption });
    format!(
        "<div class=\"wide\" role=\"region\" tabindex=\"0\" aria-label=\"{words}\"><table class=\"{class}\">\n\
         <caption>{}</caption>\n",
        escape(caption)
    )
}

/// A paragraph; the text is escaped.
pub fn paragraph(words: &str) -> String {
    format!("<p>{}</p>\n", escape(words))
}

/// With an initial capital letter.
pub fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_tables_stay_in_one_line() {
        let html = table("", &["a", "b"], &[vec!["2.1e-3".into(), "5 points on a long line".into()]]);
        assert!(html.contains("<td class=\"short\">2.1e-3</td><td>5 points"), "{html}");
    }

    #[test]
    fn nothing_a_job_says_becomes_markup() {
        assert_eq!(escape("<script>\"&'\u{7}"), "&lt;script&gt;&quot;&amp;&#39;\u{fffd}");
        assert!(
            facts("a<b", &[("<i>".into(), "1 & 2".into())])
                .contains("<th scope=\"row\">&lt;i&gt;</th><td>1 &amp; 2</td>")
        );
    }
}
