//! The surroundings of a body in a drawing: frame, axes and colour bar.

use super::{
    colour::{Shades, hex},
    picture::plain_name,
    scale::Scale,
    svg::{LETTERS, WIDTH, text},
};
use std::fmt::Write;

const TALLEST: f64 = 620.0;
const LEFT: f64 = 56.0;
const TOP: f64 = 54.0;

/// The area of a body in a drawing, beside its axes and colour bar.
pub(super) struct Frame {
    low: [f64; 2],
    zoom: f64,
    width: f64,
    /// Height of the drawing.
    pub height: f64,
}

impl Frame {
    /// Fits these ranges in m, horizontal and vertical, into the frame, with space on the right.
    pub(super) fn around(ranges: [(f64, f64); 2], right: f64) -> Self {
        let [(left, width), (bottom, height)] =
            ranges.map(|(low, high)| (low, (high - low).max(f64::MIN_POSITIVE)));
        let below = 3.2 * LETTERS;
        let room = [WIDTH - LEFT - right, TALLEST - TOP - below];
        let zoom = (room[0] / width).min(room[1] / height);
        let tall = (zoom * height).max(if right > 60.0 { 190.0 } else { 60.0 });
        let low = [left - 0.5 * (room[0] / zoom - width), bottom - 0.5 * (tall / zoom - height)];
        Self { low, zoom, width: room[0], height: TOP + tall + below }
    }

    /// Position of a point, in m, in the drawing.
    pub(super) fn place(&self, point: [f64; 2]) -> [f64; 2] {
        let floor = self.height - 3.2 * LETTERS;
        [LEFT + self.zoom * (point[0] - self.low[0]), floor - self.zoom * (point[1] - self.low[1])]
    }

    fn scale(&self, axis: usize, length: f64) -> Scale {
        let high = self.low[axis] + length / self.zoom;
        Scale::linear([self.low[axis], high].into_iter(), false)
    }

    /// Axes with these names in a 2D drawing.
    pub(super) fn axes(&self, names: [&str; 2]) -> String {
        // Writing to a String cannot fail.
        let mut out = String::new();
        let floor = self.height - 3.2 * LETTERS;
        let across = self.scale(0, self.width);
        let up = self.scale(1, floor - TOP);
        out.push_str("<g stroke=\"#555\" fill=\"none\">");
        let _ = write!(out, "<path d=\"M{LEFT} {TOP}V{floor:.1}H{:.1}\"/>", LEFT + self.width);
        let tick = |scale: &Scale, value: f64| value / scale.factor;
        for (value, _) in &across.ticks {
            let x = self.place([tick(&across, *value), 0.0])[0];
            let _ = write!(out, "<path d=\"M{x:.1} {floor:.1}v5\"/>");
        }
        for (value, _) in &up.ticks {
            let y = self.place([0.0, tick(&up, *value)])[1];
            let _ = write!(out, "<path d=\"M{LEFT} {y:.1}h-5\"/>");
        }
        out.push_str("</g>\n");
        for (value, word) in &across.ticks {
            out += &text(self.place([tick(&across, *value), 0.0])[0], floor + 1.3 * LETTERS, "middle", word);
        }
        for (value, word) in &up.ticks {
            let y = self.place([0.0, tick(&up, *value)])[1];
            out += &text(LEFT - 9.0, y + 0.35 * LETTERS, "end", word);
        }
        out += &text(LEFT + 0.5 * self.width, self.height - 8.0, "middle", &across.words(names[0], "m"));
        out + &text(6.0, TOP - 14.0, "start", &up.words(names[1], "m"))
    }
}

/// What a colour bar shows.
pub(super) struct ColourKey<'a> {
    pub scale: &'a Scale,
    /// Whether there are values beyond the ends of the scale.
    pub is_clipped: bool,
    /// The heading.
    pub words: &'a str,
}

/// The colour bar on the right of a drawing. The name of the picture makes the names of gradients unique, because a page contains
/// many drawings. The ends of the bar of a clipped scale are arrows, because there are values beyond them.
pub(super) fn colour_bar(
    name: &str,
    shades: Shades,
    ColourKey { scale, is_clipped, words }: ColourKey<'_>,
    frame: &Frame,
) -> String {
    let name = plain_name(name);
    let (x, top, bottom) = (WIDTH - 94.0, TOP + 10.0, frame.height - 3.2 * LETTERS);
    let mut out = format!("<defs><linearGradient id=\"{name}-shades\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">");
    for stop in 0..=16 {
        let share = f64::from(stop) / 16.0;
        let _ = write!(out, "<stop offset=\"{share}\" stop-color=\"{}\"/>", hex(shades.at(share)));
    }
    let _ = writeln!(
        out,
        "</linearGradient></defs>\n<rect x=\"{x}\" y=\"{top}\" width=\"20\" height=\"{:.1}\" stroke=\"#555\" \
         fill=\"url(#{name}-shades)\"/>",
        bottom - top
    );
    for (share, edge, tip) in
        [(1.0, top, top - 9.0), (0.0, bottom, bottom + 9.0)].iter().filter(|_| is_clipped)
    {
        let _ = writeln!(
            out,
            "<path stroke=\"#555\" fill=\"{}\" d=\"M{x} {edge:.1}H{}L{} {tip:.1}Z\"/>",
            hex(shades.at(*share)),
            x + 20.0,
            x + 10.0
        );
    }
    for (value, word) in &scale.ticks {
        let y = bottom - (bottom - top) * (value - scale.low) / (scale.high - scale.low);
        let _ = writeln!(out, "<path stroke=\"#555\" d=\"M{} {y:.1}h5\"/>", x + 20.0);
        out += &text(x + 29.0, y + 0.35 * LETTERS, "start", word);
    }
    out + &text(WIDTH - 6.0, TOP - 14.0, "end", words)
}
