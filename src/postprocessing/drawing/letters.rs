//! Texts of a drawing as outlines of their letters, for files that must not depend on a font.

use crate::error::{Error, Result};
use resvg::usvg::roxmltree::{Document, Node};
use std::fmt::Write;
use ttf_parser::{Face, OutlineBuilder};

/// The font of the outlines.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");

/// The drawing with a `path` in place of each `text`; other attributes than those of the font are kept.
pub(super) fn outlined(svg: &str) -> Result<String> {
    let fault = |words: String| Error::Internal(format!("letters cannot be drawn: {words}"));
    let face = Face::parse(FONT, 0).map_err(|error| fault(error.to_string()))?;
    let document = Document::parse(svg).map_err(|error| fault(error.to_string()))?;
    let mut out = String::with_capacity(2 * svg.len());
    let mut copied = 0;
    for text in document.descendants().filter(|node| node.has_tag_name("text")) {
        out.push_str(&svg[copied..text.range().start]);
        copied = text.range().end;
        out.push_str("<path");
        for name in ["fill", "opacity", "transform"] {
            if let Some(value) = text.attribute(name) {
                // Writing to a String cannot fail.
                let _ = write!(out, " {name}=\"{value}\"");
            }
        }
        let _ = write!(out, " d=\"{}\"/>", outline(&face, text));
    }
    Ok(out + &svg[copied..])
}

/// The outline of a text, as data of a path.
fn outline(face: &Face, text: Node) -> String {
    let number = |name: &str| text.attribute(name).and_then(|value| value.parse::<f32>().ok());
    let size = number("font-size").unwrap_or_default();
    // Units of lengths as browsers take them if a font does not give them.
    let shift = [("em", size), ("ex", 0.5 * size)].into_iter().find_map(|(unit, length)| {
        Some(length * text.attribute("dy")?.strip_suffix(unit)?.parse::<f32>().ok()?)
    });
    let scale = size / f32::from(face.units_per_em());
    let words = text.text().unwrap_or_default().trim();
    let glyphs = || words.chars().map(|letter| face.glyph_index(letter).unwrap_or_default());
    let advance = |glyph| scale * f32::from(face.glyph_hor_advance(glyph).unwrap_or_default());
    let part_before = match text.attribute("text-anchor") {
        Some("middle") => 0.5,
        Some("end") => 1.0,
        _ => 0.0,
    };
    let x = number("x").unwrap_or_default() - part_before * glyphs().map(advance).sum::<f32>();
    let y = number("y").unwrap_or_default() + shift.unwrap_or_default();
    let mut path = Path { data: String::new(), origin: [x, y], scale };
    for glyph in glyphs() {
        face.outline_glyph(glyph, &mut path);
        path.origin[0] += advance(glyph);
    }
    path.data
}

/// A path under construction; glyphs have their y-axis upwards.
struct Path {
    data: String,
    origin: [f32; 2],
    scale: f32,
}

impl Path {
    fn push<const N: usize>(&mut self, command: char, points: [[f32; 2]; N]) {
        self.data.push(command);
        for [x, y] in points {
            let [at_x, at_y] = [self.origin[0] + self.scale * x, self.origin[1] - self.scale * y];
            let _ = write!(self.data, "{at_x:.2} {at_y:.2} ");
        }
    }
}

impl OutlineBuilder for Path {
    fn move_to(&mut self, x: f32, y: f32) {
        self.push('M', [[x, y]]);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.push('L', [[x, y]]);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.push('Q', [[x1, y1], [x, y]]);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.push('C', [[x1, y1], [x2, y2], [x, y]]);
    }

    fn close(&mut self) {
        self.data.push('Z');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Smallest and largest coordinates of the only path of a drawing.
    fn extent(attributes: &str, words: &str) -> [[f32; 2]; 2] {
        let svg = outlined(&format!("<svg><text {attributes}>{words}</text></svg>")).expect("outlines");
        let document = Document::parse(&svg).expect("XML");
        let path = document.descendants().find(|node| node.has_tag_name("path")).expect("a path");
        let data = path.attribute("d").expect("data");
        let numbers: Vec<f32> = data
            .split(|c: char| c.is_ascii_alphabetic() || c == ' ')
            .filter_map(|number| number.parse().ok())
            .collect();
        assert!(numbers.len() >= 4 && numbers.len().is_multiple_of(2), "{data}");
        numbers.chunks(2).fold([[f32::INFINITY; 2], [f32::NEG_INFINITY; 2]], |[low, high], at| {
            [[low[0].min(at[0]), low[1].min(at[1])], [high[0].max(at[0]), high[1].max(at[1])]]
        })
    }

    #[test]
    fn texts_stand_where_their_attributes_put_them() {
        let [low, high] = extent("x=\"100\" y=\"50\" font-size=\"20\"", "HH");
        assert!((100.0..103.0).contains(&low[0]) && (high[1] - 50.0).abs() < 0.1, "{low:?} {high:?}");
        // Capitals of this font have 0.73 of its size.
        assert!((high[1] - low[1] - 14.6).abs() < 0.2);
        let [middle_low, middle_high] =
            extent("x=\"100\" y=\"50\" font-size=\"20\" text-anchor=\"middle\"", "\n HH\n");
        assert!((middle_low[0] + middle_high[0] - 200.0).abs() < 0.2);
        let [_, end] = extent("x=\"100\" y=\"50\" font-size=\"20\" text-anchor=\"end\"", "HH");
        assert!((97.0..100.0).contains(&end[0]), "{end:?}");
        for (dy, shift) in [("0.76em", 15.2), ("0.5ex", 5.0), ("-0.5ex", -5.0)] {
            let [_, moved] = extent(&format!("x=\"100\" y=\"50\" dy=\"{dy}\" font-size=\"20\""), "HH");
            assert!((moved[1] - high[1] - shift).abs() < 0.02, "{dy}");
        }
    }

    #[test]
    fn what_is_not_text_stays_and_escaped_letters_are_letters() {
        let svg = "<svg><rect/><text x=\"0\" y=\"9\" font-size=\"9\" fill=\"#123456\" opacity=\"0.5\">&lt;</text><g/></svg>";
        let out = outlined(svg).expect("outlines");
        assert!(
            out.starts_with("<svg><rect/><path fill=\"#123456\" opacity=\"0.5\" d=\"M")
                && out.ends_with("Z\"/><g/></svg>"),
            "{out}"
        );
        assert_eq!(extent("font-size=\"9\"", "&lt;"), extent("font-size=\"9\"", "&#60;"));
        let untouched = "<svg><rect/></svg>";
        assert_eq!(outlined(untouched).expect("outlines"), untouched);
    }
}
