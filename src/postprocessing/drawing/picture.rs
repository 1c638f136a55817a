//! A picture as SVG and as PNG.

use super::{chart::Chart, letters::outlined, markup::escape};
use crate::error::{Error, Result};
use resvg::{tiny_skia, usvg};

/// Pixels of a PNG file per unit of the view box.
const RESOLUTION: f32 = 2.0;
/// Pixels of a thumbnail per unit of the view box.
const THUMBNAIL: f32 = 0.5;

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
    /// The chart that is drawn; none for other drawings.
    pub chart: Option<Box<Chart>>,
}

impl Picture {
    /// A drawing with its texts; the name is converted to a valid file name.
    pub fn new(name: &str, alt: impl Into<String>, caption: impl Into<String>, svg: String) -> Self {
        let name = plain_name(name);
        Self { name, alt: alt.into(), caption: caption.into(), svg, chart: None }
    }

    /// A chart with its texts.
    pub fn of_chart(
        chart: Chart,
        name: &str,
        alt: impl Into<String>,
        caption: impl Into<String>,
    ) -> Result<Self> {
        let svg = chart.svg()?;
        Ok(Self { chart: Some(Box::new(chart)), ..Self::new(name, alt, caption, svg) })
    }

    /// Two pictures to be seen beside each other: charts of the same quantities get the same axes.
    pub fn beside_each_other(pair: [Self; 2]) -> Result<[Self; 2]> {
        let [left, right] = &pair;
        let (Some(of_left), Some(of_right)) = (&left.chart, &right.chart) else { return Ok(pair) };
        let [on_left, on_right] = [of_left.beside(of_right), of_right.beside(of_left)];
        let redrawn =
            |picture: &Self, chart| Self::of_chart(chart, &picture.name, &*picture.alt, &*picture.caption);
        Ok([redrawn(left, on_left)?, redrawn(right, on_right)?])
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
        self.rendered(&outlined(&self.svg)?, RESOLUTION)
    }

    /// A small PNG file without the texts, which would be illegible.
    pub fn thumbnail(&self) -> Result<Vec<u8>> {
        let mut parts = self.svg.split("<text");
        let mut svg = parts.next().unwrap_or_default().to_owned();
        svg.extend(parts.filter_map(|part| Some(part.split_once("</text>")?.1)));
        self.rendered(&svg, THUMBNAIL)
    }

    fn rendered(&self, svg: &str, resolution: f32) -> Result<Vec<u8>> {
        let fault =
            |words: String| Error::Internal(format!("the picture {} cannot be drawn: {words}", self.name));
        let tree =
            usvg::Tree::from_str(svg, &usvg::Options::default()).map_err(|error| fault(error.to_string()))?;
        let size = tree.size().to_int_size().scale_by(resolution).ok_or_else(|| fault("no size".into()))?;
        let mut pixels =
            tiny_skia::Pixmap::new(size.width(), size.height()).ok_or_else(|| fault("no size".into()))?;
        pixels.fill(tiny_skia::Color::WHITE);
        let zoom = tiny_skia::Transform::from_scale(resolution, resolution);
        resvg::render(&tree, zoom, &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| fault(error.to_string()))
    }
}

/// A valid file name that is also a valid id in a page.
pub(super) fn plain_name(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::postprocessing::drawing::{
        chart::{Axis, Look, Series},
        svg::{open_svg, text},
    };

    #[test]
    fn charts_of_the_same_quantities_get_the_same_axes_beside_each_other() {
        let chart = |quantity: &str, points: [[f64; 2]; 2]| {
            let series = vec![Series::new(0, "", Look::Line, points.to_vec())];
            let chart = Chart::new(Axis::time(), Axis::new(quantity, "m"), series);
            Picture::of_chart(chart, "p", "", "").expect("picture")
        };
        let small = || chart("gap", [[0.0, 0.0], [1.0, 1.0]]);
        let large = || chart("gap", [[0.0, 0.0], [4.0, 10.0]]);
        let has = |picture: &Picture, tick: &str| picture.svg.lines().any(|line| line.trim() == tick);
        assert!(has(&large(), "10") && has(&large(), "4") && !has(&small(), "10") && !has(&small(), "4"));
        for pair in [[small(), large()], [large(), small()]] {
            let pair = Picture::beside_each_other(pair).expect("pair");
            assert!(pair.iter().all(|picture| has(picture, "10") && has(picture, "4")), "{}", pair[0].svg);
        }
        let [left, right] =
            Picture::beside_each_other([small(), chart("slip", [[0.0, 0.0], [4.0, 10.0]])]).expect("pair");
        assert!(left.svg == small().svg && has(&right, "10"));
    }

    #[test]
    fn a_thumbnail_is_small_and_has_no_texts() {
        let picture = |words: &str| {
            let square = "<rect x=\"300\" y=\"10\" width=\"20\" height=\"20\"/>";
            let svg = format!("{}{}{square}</svg>", open_svg(40.0), text(10.0, 25.0, "start", words));
            Picture::new("p", "", "", svg)
        };
        let thumbnail = picture("von Mises stress").thumbnail().expect("PNG");
        let pixels = tiny_skia::Pixmap::decode_png(&thumbnail).expect("pixels");
        assert_eq!([pixels.width(), pixels.height()], [280, 20]);
        assert_eq!(pixels.pixels().iter().filter(|pixel| pixel.red() == 0).count(), 100);
        assert!(thumbnail == picture("other").thumbnail().expect("PNG"));
    }

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
