//! Shaded triangles as an image in a drawing: nearer triangles cover those behind them.

use super::{
    colour::{Colour, dimmed},
    svg::WIDTH,
};
use crate::error::{Error, Result};
use base64::{Engine, engine::general_purpose::STANDARD};
use resvg::tiny_skia::{Pixmap, PremultipliedColorU8};

/// Samples per unit of the drawing, in each direction.
const FINE: usize = 4;
/// Half the width of a mesh line or contour line, in samples.
const LINE: f64 = 1.1;
/// Opacity of the mesh lines of large cells.
const OPACITY: f64 = 0.35;
/// Edge lengths, in units of the drawing, between which mesh lines appear.
const FADING: [f64; 2] = [2.0, 12.0];

/// A triangle of the drawing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Triangle {
    /// Its corners: to the right and downwards in units of the drawing, and toward the viewer.
    pub corners: [[f64; 3]; 3],
    /// The values at its corners as shares of the colour scale.
    pub shares: [f64; 3],
    /// Intensity of light, from 0 to 1.
    pub light: f64,
    /// Edges, from a corner to the next, that are not drawn.
    pub is_inside: [bool; 3],
}

/// How values become colours.
pub(super) struct Style<'a> {
    /// The colour of a share of the scale.
    pub colour: &'a dyn Fn(f64) -> Colour,
    /// Shares at which contour lines are drawn.
    pub contours: &'a [f64],
    /// Pixels of the image per unit of the drawing: 1, 2 or 4.
    pub resolution: usize,
}

/// The triangles as an SVG element. `height` is the height of the drawing.
pub(super) fn paint(triangles: &[Triangle], style: &Style, height: f64) -> Result<String> {
    let fault = |words: String| Error::Internal(format!("the mesh cannot be drawn: {words}"));
    let [wide, high] = [WIDTH, height].map(|length| length.ceil() as usize);
    let mut canvas = Canvas::new([wide, high].map(|length| length * FINE));
    let opacity = opacity(triangles);
    for triangle in triangles {
        canvas.draw(triangle, style, opacity);
    }
    let (size, samples) = ([wide, high].map(|length| length * style.resolution), FINE / style.resolution);
    let mut pixels = Pixmap::new(size[0] as u32, size[1] as u32).ok_or_else(|| fault("no size".into()))?;
    for (at, pixel) in pixels.pixels_mut().iter_mut().enumerate() {
        *pixel = canvas.pixel([at % size[0], at / size[0]], samples);
    }
    let png = pixels.encode_png().map_err(|error| fault(error.to_string()))?;
    Ok(format!(
        "<image x=\"0\" y=\"0\" width=\"{wide}\" height=\"{high}\" href=\"data:image/png;base64,{}\"/>\n",
        STANDARD.encode(png)
    ))
}

/// Opacity of mesh lines: the smaller the cells, the less, because lines would hide the colours.
fn opacity(triangles: &[Triangle]) -> f64 {
    let area = |triangle: &Triangle| {
        let [a, b, c] = triangle.corners;
        0.5 * side(a, b, c[0], c[1]).abs()
    };
    let length = (2.0 * triangles.iter().map(area).sum::<f64>() / triangles.len().max(1) as f64).sqrt();
    let [none, all] = FADING;
    OPACITY * ((length - none) / (all - none)).clamp(0.0, 1.0)
}

/// Twice the area of the triangle of an edge and a point, with the sign of its turn.
fn side(a: [f64; 3], b: [f64; 3], x: f64, y: f64) -> f64 {
    (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
}

/// Samples: the colour, if any triangle covers the sample, and how near that is.
struct Canvas {
    size: [usize; 2],
    colours: Vec<Option<Colour>>,
    depths: Vec<f64>,
}

impl Canvas {
    fn new(size: [usize; 2]) -> Self {
        let count = size[0] * size[1];
        Self { size, colours: vec![None; count], depths: vec![f64::NEG_INFINITY; count] }
    }

    /// Draws the samples whose centre is in the triangle; if there is none, the sample that contains the centre of the triangle.
    fn draw(&mut self, triangle: &Triangle, style: &Style, opacity: f64) {
        let [a, b, c] = triangle.corners.map(|[x, y, z]| [x * FINE as f64 - 0.5, y * FINE as f64 - 0.5, z]);
        let corners = [a, b, c];
        if corners.iter().flatten().any(|x| !x.is_finite()) {
            return;
        }
        let twice_area = side(a, b, c[0], c[1]);
        let edges = [(b, c), (c, a), (a, b)];
        let lengths = edges.map(|(from, to)| (to[0] - from[0]).hypot(to[1] - from[1]));
        let steepness = steepness(corners, triangle.shares, twice_area);
        let bounds = |axis: usize| {
            let along = corners.map(|corner| corner[axis]);
            let low = along.iter().fold(f64::MAX, |m, x| m.min(*x)).ceil().max(0.0);
            let high = along.iter().fold(f64::MIN, |m, x| m.max(*x)).floor();
            (low, high.min(self.size[axis] as f64 - 1.0))
        };
        let (columns, rows) = (bounds(0), bounds(1));
        let lines = Lines { twice_area, lengths, steepness, opacity };
        let mut is_empty = true;
        let mut y = rows.0;
        while y <= rows.1 {
            let mut x = columns.0;
            while x <= columns.1 {
                let weights = edges.map(|(from, to)| side(from, to, x, y) / twice_area);
                if weights.iter().all(|weight| *weight >= 0.0) {
                    is_empty = false;
                    self.set([x, y], triangle, style, weights, Some(&lines));
                }
                x += 1.0;
            }
            y += 1.0;
        }
        let centre = [0, 1].map(|axis| ((a[axis] + b[axis] + c[axis]) / 3.0).round());
        if is_empty && [0, 1].iter().all(|&axis| (0.0..self.size[axis] as f64).contains(&centre[axis])) {
            self.set(centre, triangle, style, [1.0 / 3.0; 3], None);
        }
    }

    fn set(
        &mut self,
        [x, y]: [f64; 2],
        triangle: &Triangle,
        style: &Style,
        weights: [f64; 3],
        lines: Option<&Lines>,
    ) {
        let at = y as usize * self.size[0] + x as usize;
        let depth = (0..3).map(|n| weights[n] * triangle.corners[n][2]).sum::<f64>();
        if depth < self.depths[at] {
            return;
        }
        let share = (0..3).map(|n| weights[n] * triangle.shares[n]).sum();
        let covered = lines.map_or(0.0, |lines| lines.cover(triangle, style, weights, share));
        self.depths[at] = depth;
        self.colours[at] = Some(dimmed((style.colour)(share), triangle.light * (1.0 - covered)));
    }

    /// The mean colour of the samples of a pixel, of which there are so many in each direction.
    fn pixel(&self, [column, row]: [usize; 2], samples: usize) -> PremultipliedColorU8 {
        let mut sums = [0; 4];
        for y in row * samples..(row + 1) * samples {
            for x in column * samples..(column + 1) * samples {
                if let Some(colour) = self.colours[y * self.size[0] + x] {
                    (0..3).for_each(|channel| sums[channel] += usize::from(colour[channel]));
                    sums[3] += 255;
                }
            }
        }
        let [red, green, blue, alpha] = sums.map(|sum| (sum / (samples * samples)) as u8);
        PremultipliedColorU8::from_rgba(red, green, blue, alpha).unwrap_or(PremultipliedColorU8::TRANSPARENT)
    }
}

/// The change of shares over a sample.
fn steepness([a, b, c]: [[f64; 3]; 3], shares: [f64; 3], twice_area: f64) -> f64 {
    let [first, second] = [shares[1] - shares[0], shares[2] - shares[0]];
    let along_x = first * (c[1] - a[1]) - second * (b[1] - a[1]);
    let along_y = second * (b[0] - a[0]) - first * (c[0] - a[0]);
    along_x.hypot(along_y) / twice_area.abs()
}

/// Mesh lines and contour lines in a triangle.
struct Lines {
    twice_area: f64,
    /// Of the edges opposite to the corners, in samples.
    lengths: [f64; 3],
    steepness: f64,
    opacity: f64,
}

impl Lines {
    /// How much a line darkens a sample.
    fn cover(&self, triangle: &Triangle, style: &Style, weights: [f64; 3], share: f64) -> f64 {
        let drawn = (0..3).filter(|n| !triangle.is_inside[(n + 1) % 3]);
        let is_edge = |n: usize| weights[n] * self.twice_area.abs() < LINE * self.lengths[n];
        let edge = if drawn.into_iter().any(is_edge) { self.opacity } else { 0.0 };
        let is_contour = |at: &f64| (share - at).abs() < LINE * self.steepness;
        if style.contours.iter().any(is_contour) { edge.max(0.6) } else { edge }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::postprocessing::drawing::{picture::Picture, svg::open_svg};

    const GREY: fn(f64) -> Colour = |share| [(255.0 * share).round() as u8; 3];

    /// A triangle over half of a drawing of height 100.
    fn half(shares: [f64; 3], depth: f64) -> Triangle {
        let corners = [[0.0, 0.0, depth], [560.0, 0.0, depth], [0.0, 100.0, depth]];
        Triangle { corners, shares, light: 1.0, is_inside: [true; 3] }
    }

    /// The colours at points of the drawing.
    fn drawn(triangles: &[Triangle], style: &Style, points: &[[u32; 2]]) -> Vec<[u8; 3]> {
        let body = paint(triangles, style, 100.0).expect("drawing");
        let png = Picture::new("p", "", "", format!("{}{body}</svg>", open_svg(100.0))).png().expect("PNG");
        let pixels = Pixmap::decode_png(&png).expect("PNG");
        let zoom = pixels.width() / 560;
        let at = |[x, y]: &[u32; 2]| pixels.pixel(x * zoom, y * zoom).map(|p| [p.red(), p.green(), p.blue()]);
        points.iter().map(|point| at(point).expect("inside")).collect()
    }

    const SMOOTH: Style<'static> = Style { colour: &GREY, contours: &[], resolution: 2 };

    #[test]
    fn values_are_interpolated_between_the_corners() {
        let triangle = half([0.0, 1.0, 0.0], 0.0);
        let points = [[140, 20], [280, 20], [500, 90]];
        let [quarter, middle, outside] = drawn(&[triangle], &SMOOTH, &points)[..] else { panic!("three") };
        assert!(quarter[0].abs_diff(64) <= 2 && middle[0].abs_diff(128) <= 2, "{quarter:?} {middle:?}");
        assert_eq!(outside, [255; 3]);
    }

    #[test]
    fn what_is_nearer_to_the_viewer_covers_the_rest_in_whatever_order() {
        let (behind, before) = (half([0.2; 3], -1.0), half([0.8; 3], 1.0));
        for order in [[behind, before], [before, behind]] {
            assert_eq!(drawn(&order, &SMOOTH, &[[100, 20]]), [[204; 3]]);
        }
    }

    #[test]
    fn large_cells_have_lines_and_small_ones_do_not() {
        let lined = Triangle { is_inside: [false; 3], ..half([1.0; 3], 0.0) };
        assert_eq!(opacity(&[lined]), OPACITY);
        let [line, inside] = drawn(&[lined], &SMOOTH, &[[200, 0], [200, 20]])[..] else { panic!("two") };
        assert!(line[0] < 230 && inside == [255; 3], "{line:?} {inside:?}");
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(opacity(&[Triangle { corners, ..lined }]), 0.0);
        let hidden = Triangle { is_inside: [true, false, false], ..lined };
        assert_eq!(drawn(&[hidden], &SMOOTH, &[[200, 0]]), [[255; 3]], "the first edge is inside a cell");
    }

    #[test]
    fn contours_are_where_the_value_is_theirs() {
        let contoured = Style { contours: &[0.5], ..SMOOTH };
        let triangle = half([0.0, 1.0, 0.0], 0.0);
        let [on, off] = drawn(&[triangle], &contoured, &[[280, 20], [290, 20]])[..] else { panic!("two") };
        assert!(on[0] < 110 && off[0] > 125, "{on:?} {off:?}");
    }

    #[test]
    fn a_triangle_smaller_than_a_sample_is_still_there() {
        let corners = [[10.01, 10.01, 0.0], [10.02, 10.01, 0.0], [10.01, 10.02, 0.0]];
        let speck = Triangle { corners, ..half([0.0; 3], 0.0) };
        assert!(drawn(&[speck], &SMOOTH, &[[10, 10]])[0][0] < 255);
    }
}
