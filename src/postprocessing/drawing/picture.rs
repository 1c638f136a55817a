//! A picture as SVG and as PNG.

use super::markup::escape;
use crate::error::{Error, Result};
use resvg::{tiny_skia, usvg};
use std::sync::Arc;

/// Width of all pictures in units of the view box.
pub const WIDTH: f64 = 560.0;
/// Height of letters in the same units: legible at a picture width of 370 pixels.
pub const LETTERS: f64 = 16.0;
/// Pixels of a PNG file per unit of the view box.
const RESOLUTION: f32 = 2.0;
/// The font of PNG files, so that they need no font of the computer.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");

/// A picture with its texts.
#[derive(Debug, Clone)]
pub struct Picture {
    /// Name of its files, without extension.
    pub name: String,
    /// Alternative text for readers who cannot see the picture.
    pub alt: String,
    /// Caption.
    pub caption: String,
    /// The drawing: a complete `svg` element.
    pub svg: String,
}

impl Picture {
    /// A drawing with its texts; the name is converted to a valid file name.
    pub fn new(name: &str, alt: impl Into<String>, caption: impl Into<String>, svg: String) -> Self {
        let name = plain_name(name);
        Self { name, alt: alt.into(), caption: caption.into(), svg }
    }

    /// The same with another name.
    pub fn renamed(self, name: &str) -> Self {
        Self {
            svg: self.svg.replace(&format!("{}-shades", self.name), &format!("{name}-shades")),
            name: plain_name(name),
            ..self
        }
    }

    /// The drawing for an HTML page: labelled for screen readers, without the XML namespace, which only files need.
    pub fn inline(&self) -> String {
        let words = format!("<svg role=\"img\" aria-label=\"{}\" ", escape(&self.alt));
        self.svg.replacen("<svg ", &words, 1).replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
    }

    /// The drawing as the content of an SVG file.
    pub fn file(&self) -> String {
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n", self.svg)
    }

    /// The drawing as the content of a PNG file.
    pub fn png(&self) -> Result<Vec<u8>> {
        let fault =
            |words: String| Error::Internal(format!("the picture {} cannot be drawn: {words}", self.name));
        let mut options = usvg::Options::default();
        let fonts = Arc::make_mut(&mut options.fontdb);
        fonts.load_font_data(FONT.to_vec());
        fonts.set_sans_serif_family("DejaVu Sans");
        let tree = usvg::Tree::from_str(&self.svg, &options).map_err(|error| fault(error.to_string()))?;
        let size = tree.size().to_int_size().scale_by(RESOLUTION).ok_or_else(|| fault("no size".into()))?;
        let mut pixels =
            tiny_skia::Pixmap::new(size.width(), size.height()).ok_or_else(|| fault("no size".into()))?;
        pixels.fill(tiny_skia::Color::WHITE);
        let zoom = tiny_skia::Transform::from_scale(RESOLUTION, RESOLUTION);
        resvg::render(&tree, zoom, &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| fault(error.to_string()))
    }
}

/// A valid file name that is also a valid id in a page.
pub(super) fn plain_name(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' }).collect()
}

/// The opening tag of a drawing of this height.
pub fn open_svg(height: f64) -> String {
    format!(
        "<svg width=\"{WIDTH}\" height=\"{height:.0}\" viewBox=\"0 0 {WIDTH} {height:.0}\" \
         xmlns=\"http://www.w3.org/2000/svg\">\n"
    )
}

/// A line of text in a drawing; `anchor` is start, middle or end.
pub fn text(x: f64, y: f64, anchor: &str, words: &str) -> String {
    format!(
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-family=\"sans-serif\" \
         font-size=\"{LETTERS}\" fill=\"#1a1a1a\">{}</text>\n",
        escape(words)
    )
}

/// Approximate width of a text in a drawing.
pub fn text_width(words: &str) -> f64 {
    0.6 * LETTERS * words.chars().count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_drawn_without_a_font_of_the_machine() {
        let dark = |words: &str| {
            let svg = format!("{}{}</svg>", open_svg(40.0), text(10.0, 25.0, "start", words));
            let png = Picture::new("letters", "", "", svg).png().expect("PNG");
            let pixels = tiny_skia::Pixmap::decode_png(&png).expect("PNG");
            assert_eq!((pixels.width(), pixels.height()), (1120, 80));
            pixels.pixels().iter().filter(|pixel| pixel.red() < 128).count()
        };
        assert_eq!(dark(""), 0);
        let one = dark("m");
        let two = dark("mm");
        assert!(one > 100 && two.abs_diff(2 * one) < one / 10, "{one} and {two}");
        for letter in ["σ", "ν", "×", "−", "⁻", "⁷", "²", "β", "Ä"] {
            assert!(dark(letter) > 3, "{letter} is missing in the font");
        }
    }

    #[test]
    fn plain_names_keep_letters_digits_and_underscores_of_ascii_alone() {
        assert_eq!(plain_name("wall_seconds"), "wall_seconds");
        assert_eq!(plain_name("Top 2.b/..\\\"<&>'"), "Top-2-b---------");
        assert_eq!(plain_name("Rückseite ²"), "R-ckseite--", "one dash a letter, whatever its bytes");
        assert_eq!(plain_name(""), "");
    }

    #[test]
    fn names_of_files_hold_nothing_that_leads_elsewhere() {
        assert_eq!(Picture::new("../left side", "", "", String::new()).name, "---left-side");
    }
}
