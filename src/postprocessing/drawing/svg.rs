//! Parts of drawings as SVG.

use super::markup::escape;

/// Width of all pictures in units of the view box.
pub const WIDTH: f64 = 560.0;
/// Height of letters in the same units: legible at a picture width of 370 pixels.
pub const LETTERS: f64 = 16.0;
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
