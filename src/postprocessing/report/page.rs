//! The page: one self-contained HTML document.

use super::{
    markup::{escape, paragraph},
    picture::Picture,
};
use std::fmt::Write;

const STYLE: &str = include_str!("style.css");

/// Pictures for a section, and quantities that are constant: these are named with their value instead of drawn.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    /// The pictures.
    pub pictures: Vec<Picture>,
    /// Such as `touching area of contact bottom: 0.2 m`.
    pub constant: Vec<String>,
}

/// A page under construction.
#[derive(Debug, Default)]
pub(super) struct Page {
    title: String,
    head: String,
    sections: Vec<(String, String, String)>,
    pictures: Vec<Picture>,
}

impl Page {
    /// An empty page; `head` is HTML before all sections.
    pub(super) fn new(title: &str, head: String) -> Self {
        Self { title: title.to_owned(), head, ..Self::default() }
    }

    /// Adds a section of HTML and pictures; an empty section is omitted.
    pub(super) fn section(&mut self, heading: &str, html: &str, pictures: Vec<Picture>) {
        if html.is_empty() && pictures.is_empty() {
            return;
        }
        let mut body = html.to_owned();
        if !pictures.is_empty() {
            body.push_str("<div class=\"figures\">\n");
            for picture in &pictures {
                // Writing to a String cannot fail.
                let _ = writeln!(
                    body,
                    "<figure id=\"{}\">\n{}\n<figcaption>{}</figcaption>\n</figure>",
                    picture.name,
                    picture.inline(),
                    escape(&picture.caption)
                );
            }
            body.push_str("</div>\n");
        }
        let id = format!("section-{}", self.sections.len() + 1);
        self.sections.push((id, heading.to_owned(), body));
        self.pictures.extend(pictures);
    }

    /// The pictures, each once.
    pub(super) fn pictures(&self) -> &[Picture] {
        &self.pictures
    }

    /// The complete document.
    pub(super) fn html(&self, made_by: &str) -> String {
        let title = escape(&self.title);
        let mut out = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<title>{title}</title>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
             <link rel=\"icon\" href=\"data:,\"/>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n\
             <h1>{title}</h1>\n{}<nav aria-label=\"Sections\"><ul>\n",
            self.head
        );
        for (id, heading, _) in &self.sections {
            let _ = writeln!(out, "<li><a href=\"#{id}\">{}</a></li>", escape(heading));
        }
        out.push_str("</ul></nav>\n</header>\n<main>\n");
        for (id, heading, body) in &self.sections {
            let _ = write!(
                out,
                "<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{}</h2>\n{body}</section>\n",
                escape(heading)
            );
        }
        let _ = write!(out, "</main>\n<footer>{}</footer>\n</body>\n</html>\n", paragraph(made_by));
        out
    }
}
