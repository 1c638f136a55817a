//! Maps: a value for each pair of two lists of labels, as coloured tiles.

use super::{
    chart::Axis,
    colour::{Colour, VIRIDIS, hex},
    frame::{ColourKey, Frame, colour_bar},
    scale::{Scale, size},
    svg::{LETTERS, WIDTH, open_svg, text, text_width},
};
use std::fmt::Write;

/// Room on the right for the colour bar.
const RIGHT: f64 = 118.0;
/// Space between labels, and between a label and the tiles.
const GAP: f64 = 9.0;
/// Largest width of the labels on the left.
const WIDEST: f64 = 170.0;
/// Heights of a row of tiles, between which the map is as tall as it is wide.
const ROW: [f64; 2] = [14.0, 64.0];
/// Smallest and largest height of all tiles.
const TALL: [f64; 2] = [190.0, 480.0];
/// Lightness of a colour, from 0 to 255, above which dark letters are legible on it.
const LIGHT: f64 = 120.0;

/// The labels along one direction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labels {
    /// What they are values of.
    pub name: String,
    /// The labels, from the left or from below.
    pub words: Vec<String>,
}

/// A map.
#[derive(Debug, Clone)]
pub struct Map {
    /// Labels along the horizontal direction.
    pub across: Labels,
    /// Labels along the vertical direction.
    pub up: Labels,
    /// The values, row by row from below; absent ones are crossed out.
    pub values: Vec<Option<f64>>,
    /// What the colours show.
    pub shown: Axis,
}

/// Where the tiles are.
struct Tiles {
    left: f64,
    floor: f64,
    size: [f64; 2],
}

impl Map {
    /// The drawing as an `svg` element for a picture with this name.
    pub fn svg(&self, name: &str) -> String {
        let values = || self.values.iter().copied().flatten();
        let scale = Scale::linear(values(), false);
        let words = scale.words(&self.shown.quantity, &self.shown.unit);
        let widest = self.up.words.iter().map(|words| text_width(words)).fold(0.0, f64::max);
        let left = widest.min(WIDEST) + 2.0 * GAP;
        let [columns, rows] = [&self.across, &self.up].map(|labels| labels.words.len().max(1) as f64);
        let wide = (WIDTH - RIGHT - left) / columns;
        let tall = (rows * wide.clamp(ROW[0], ROW[1])).clamp(TALL[0], TALL[1]);
        // As wide as the room beside the bar, so that a unit of the frame is one of the drawing.
        let frame = Frame::around([(0.0, WIDTH - 56.0 - RIGHT), (0.0, tall)], RIGHT);
        let tiles = Tiles { left, floor: frame.height - 3.2 * LETTERS, size: [wide, tall / rows] };
        let mut out = open_svg(frame.height);
        for (at, value) in self.values.iter().enumerate() {
            let [column, row] = [at % self.across.words.len(), at / self.across.words.len()];
            out += &tiles.tile([column as f64, row as f64], value.filter(|value| value.is_finite()), &scale);
        }
        out += &self.labels(&tiles);
        let middle = left + 0.5 * columns * wide;
        out += &text(middle, frame.height - 8.0, "middle", &shortened(&self.across.name, WIDTH - RIGHT));
        out +=
            &text(6.0, frame.height - 3.2 * LETTERS - tall - 14.0, "start", &shortened(&self.up.name, WIDTH));
        let heading = text(WIDTH - 6.0, LETTERS, "end", &shortened(&words, WIDTH));
        let key = ColourKey { scale: &scale, is_clipped: false, words: "" };
        out + &heading + &colour_bar(name, VIRIDIS, key, &frame) + "</svg>"
    }

    /// The labels of columns and rows; of numbers that are too close to each other only some.
    fn labels(&self, tiles: &Tiles) -> String {
        let mut out = String::new();
        let Tiles { left, floor, size: [wide, tall] } = *tiles;
        let widest = self.across.words.iter().map(|words| text_width(words) + GAP).fold(0.0, f64::max);
        let are_numbers = self.across.words.iter().all(|words| words.parse::<f64>().is_ok());
        let every = if are_numbers { (widest / wide).ceil().max(1.0) as usize } else { 1 };
        for (at, words) in self.across.words.iter().enumerate().step_by(every) {
            let x = left + (at as f64 + 0.5) * wide;
            out += &text(x, floor + 1.3 * LETTERS, "middle", &shortened(words, wide * every as f64));
        }
        let every = (LETTERS / tall).ceil().max(1.0) as usize;
        for (at, words) in self.up.words.iter().enumerate().step_by(every) {
            let y = floor - (at as f64 + 0.5) * tall + 0.35 * LETTERS;
            out += &text(left - GAP, y, "end", &shortened(words, WIDEST));
        }
        out
    }
}

impl Tiles {
    /// A tile with its value, if there is room for the number; crossed out without a value.
    fn tile(&self, [column, row]: [f64; 2], value: Option<f64>, scale: &Scale) -> String {
        let [wide, tall] = self.size;
        let (x, y) = (self.left + column * wide, self.floor - (row + 1.0) * tall);
        let colour = value
            .and_then(|value| scale.place(value))
            .map(|shown| VIRIDIS.at((shown - scale.low) / (scale.high - scale.low)));
        let fill = colour.map_or("#ffffff".to_owned(), hex);
        // Writing to a String cannot fail.
        let mut out = String::new();
        let _ = writeln!(
            out,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{wide:.1}\" height=\"{tall:.1}\" stroke=\"#fff\" fill=\"{fill}\"/>"
        );
        let Some((colour, value)) = colour.zip(value) else {
            let _ = writeln!(
                out,
                "<path stroke=\"#888\" fill=\"none\" d=\"M{x:.1} {y:.1}l{wide:.1} {tall:.1}m0 -{tall:.1}l-{wide:.1} {tall:.1}\"/>"
            );
            return out;
        };
        let words = size(value);
        if text_width(&words) + 6.0 <= wide && LETTERS + 4.0 <= tall {
            let ink = if lightness(colour) > LIGHT { "#1a1a1a" } else { "#ffffff" };
            let (x, y) = (x + 0.5 * wide, y + 0.5 * tall + 0.35 * LETTERS);
            out += &text(x, y, "middle", &words).replace("#1a1a1a", ink);
        }
        out
    }
}

/// Approximate perceived lightness, from 0 to 255.
fn lightness([red, green, blue]: Colour) -> f64 {
    0.2126 * f64::from(red) + 0.7152 * f64::from(green) + 0.0722 * f64::from(blue)
}

/// The text, cut off where it is wider than this.
fn shortened(words: &str, width: f64) -> String {
    let most = (width / text_width("x")).floor() as usize;
    if words.chars().count() <= most.max(2) {
        return words.to_owned();
    }
    words.chars().take(most.max(2) - 1).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(name: &str, words: &[&str]) -> Labels {
        Labels { name: name.into(), words: words.iter().map(|word| (*word).to_owned()).collect() }
    }

    fn map(values: Vec<Option<f64>>) -> Map {
        Map {
            across: labels("time.scheme", &["bdf2", "implicit_euler"]),
            up: labels("a<b", &["0.1", "0.2", "0.4"]),
            values,
            shown: Axis::new("probe.tip.displacement_x", "m"),
        }
    }

    #[test]
    fn each_value_is_a_tile_in_its_row_and_column_and_a_missing_one_is_crossed_out() {
        let svg = map(vec![Some(1.0), Some(2.0), None, Some(f64::NAN), Some(4.0), Some(3.0)]).svg("m");
        let fills: Vec<&str> = svg.split("stroke=\"#fff\" fill=\"").skip(1).map(|rest| &rest[..7]).collect();
        let shade = |value: f64| hex(VIRIDIS.at((value - 1.0) / 3.0));
        let expected = [shade(1.0), shade(2.0), "#ffffff".into(), "#ffffff".into(), shade(4.0), shade(3.0)];
        assert_eq!(fills, expected);
        assert_eq!(svg.matches("<path stroke=\"#888\"").count(), 2);
        let corner = |at: usize, name: &str| -> f64 {
            let tile = svg.split("<rect ").nth(at + 1).expect("a tile");
            let rest = tile.split(&format!("{name}=\"")).nth(1).expect("a number");
            rest.split('"').next().and_then(|number| number.parse().ok()).expect("a number")
        };
        assert!(corner(1, "x") > corner(0, "x") && corner(1, "y") == corner(0, "y"), "the second column");
        assert!(
            corner(2, "y") < corner(0, "y") && corner(2, "x") == corner(0, "x"),
            "the second row is above"
        );
        for words in
            ["bdf2", "implicit_euler", "0.4", "a&lt;b", "time.scheme", "probe.tip.displacement_x / m"]
        {
            assert!(svg.contains(&format!(">{words}<")), "{words} is not in {svg}");
        }
    }

    #[test]
    fn maps_of_one_value_of_none_and_of_many_are_drawn() {
        for values in [vec![Some(2.0); 6], vec![None; 6]] {
            let svg = map(values).svg("m");
            assert!(svg.ends_with("</svg>") && !svg.contains("NaN"), "{svg}");
        }
        let words: Vec<String> = (0..90).map(|n| (n * 1000).to_string()).collect();
        let many = Labels { name: "k".repeat(200), words };
        let values = (0..8100).map(|n| Some(f64::from(n))).collect();
        let map = Map { across: many.clone(), up: many, values, shown: Axis::new("q", "") };
        let svg = map.svg("m");
        assert_eq!(svg.matches("stroke=\"#fff\"").count(), 8100);
        assert!(svg.matches("<text").count() < 60, "labels and numbers do not overlap");
        assert!(svg.contains("kkk…<"), "a long name is cut off");
    }

    #[test]
    fn letters_on_tiles_contrast_with_them() {
        let svg = map([1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(Some).to_vec()).svg("m");
        let ink = |words: &str| {
            let before = svg.split(&format!(">{words}</text>")).next().expect("a number");
            before.rsplit("fill=\"").next().map(|rest| rest[..7].to_owned())
        };
        assert_eq!(ink("1").as_deref(), Some("#ffffff"), "on purple");
        assert_eq!(ink("6").as_deref(), Some("#1a1a1a"), "on yellow");
    }
}
