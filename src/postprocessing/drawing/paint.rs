//! Coloured triangles in a drawing, in the order in which they cover each other: polygons if they are few, otherwise an
//! image, because many polygons would make the page large.

use super::{
    colour::{Colour, dimmed, hex},
    picture::WIDTH,
};
use crate::error::{Error, Result};
use base64::{Engine, engine::general_purpose::STANDARD};
use resvg::tiny_skia::{Pixmap, PremultipliedColorU8};
use std::fmt::Write;

/// Number of triangles above which an image is drawn.
const POLYGONS: usize = 6000;
/// Number of triangles above which their edges would hide the colours.
const EDGES: usize = 5000;
/// Pixels of an image per unit of the drawing.
const RESOLUTION: f64 = 2.0;

/// A triangle of the drawing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Triangle {
    /// Its corners.
    pub corners: [[f64; 2]; 3],
    /// Its fill colour.
    pub colour: Colour,
    /// Edges, from a corner to the next, that are not drawn above the triangles.
    pub is_inside: [bool; 3],
}

/// Drawing of edges, for a small number of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edges {
    /// With each triangle, so that later triangles cover them.
    OfEach,
    /// On top of all triangles, for triangles that do not cover each other.
    AboveAll,
}

/// The triangles as SVG elements; later ones cover earlier ones. `height` is the height of the drawing.
pub(super) fn paint(triangles: &[Triangle], edges: Edges, height: f64) -> Result<String> {
    if triangles.len() > POLYGONS { image(triangles, height) } else { Ok(polygons(triangles, edges)) }
}

/// One path for each sequence of triangles of the same colour.
fn polygons(triangles: &[Triangle], edges: Edges) -> String {
    let mut out = String::from("<g stroke-width=\"0.5\" stroke-linejoin=\"round\">\n");
    let edges = (triangles.len() <= EDGES).then_some(edges);
    for run in triangles.chunk_by(|a, b| a.colour == b.colour) {
        let fill = run[0].colour;
        let stroke = if edges == Some(Edges::OfEach) { dimmed(fill, 0.75) } else { fill };
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<path fill=\"{}\" stroke=\"{}\" d=\"{}\"/>",
            hex(fill),
            hex(stroke),
            outlines(run)
        );
    }
    if edges == Some(Edges::AboveAll) {
        let _ = writeln!(
            out,
            "<path fill=\"none\" stroke=\"#000\" stroke-opacity=\"0.3\" d=\"{}\"/>",
            drawn_edges(triangles)
        );
    }
    out + "</g>\n"
}

fn drawn_edges(triangles: &[Triangle]) -> String {
    let mut path = String::new();
    for triangle in triangles {
        if triangle.is_inside == [false; 3] {
            path += &outlines(std::slice::from_ref(triangle));
            continue;
        }
        for at in (0..3).filter(|&at| !triangle.is_inside[at]) {
            let [a, b] = [at, (at + 1) % 3].map(|at| triangle.corners[at]);
            let _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
        }
    }
    path
}

fn outlines(triangles: &[Triangle]) -> String {
    let mut path = String::new();
    for Triangle { corners: [a, b, c], .. } in triangles {
        let _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1} {:.1} {:.1}Z", a[0], a[1], b[0], b[1], c[0], c[1]);
    }
    path
}

fn image(triangles: &[Triangle], height: f64) -> Result<String> {
    let fault = |words: String| Error::Internal(format!("the mesh cannot be drawn: {words}"));
    let (wide, high) = ((WIDTH * RESOLUTION) as u32, (height * RESOLUTION) as u32);
    let mut pixels = Pixmap::new(wide, high).ok_or_else(|| fault("no size".into()))?;
    let canvas = pixels.pixels_mut();
    for triangle in triangles {
        fill(triangle, canvas, wide as usize, high as usize);
    }
    let png = pixels.encode_png().map_err(|error| fault(error.to_string()))?;
    Ok(format!(
        "<image x=\"0\" y=\"0\" width=\"{WIDTH}\" height=\"{height}\" href=\"data:image/png;base64,{}\"/>\n",
        STANDARD.encode(png)
    ))
}

/// Fills the pixels whose centre is in the triangle; if there is none, the pixel that contains the centre of the triangle.
fn fill(triangle: &Triangle, canvas: &mut [PremultipliedColorU8], wide: usize, high: usize) {
    let [red, green, blue] = triangle.colour;
    let Some(colour) = PremultipliedColorU8::from_rgba(red, green, blue, 255) else { return };
    let corners = triangle.corners.map(|corner| corner.map(|x| x * RESOLUTION - 0.5));
    if corners.iter().flatten().any(|x| !x.is_finite()) {
        return;
    }
    let bounds = |axis: usize, size: usize| {
        let along = corners.map(|corner| corner[axis]);
        let low = along.iter().fold(f64::MAX, |m, x| m.min(*x)).ceil().max(0.0);
        let high = along.iter().fold(f64::MIN, |m, x| m.max(*x)).floor().min(size as f64 - 1.0);
        (low, high)
    };
    let (rows, columns) = (bounds(1, high), bounds(0, wide));
    let side =
        |a: [f64; 2], b: [f64; 2], x: f64, y: f64| (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    let [a, b, c] = corners;
    let turn = side(a, b, c[0], c[1]).signum();
    let mut empty = true;
    let mut y = rows.0;
    while y <= rows.1 {
        let mut x = columns.0;
        while x <= columns.1 {
            if [(a, b), (b, c), (c, a)].iter().all(|(from, to)| turn * side(*from, *to, x, y) >= 0.0) {
                canvas[y as usize * wide + x as usize] = colour;
                empty = false;
            }
            x += 1.0;
        }
        y += 1.0;
    }
    let centre = [0, 1].map(|axis| ((a[axis] + b[axis] + c[axis]) / 3.0).round());
    if empty && (0.0..wide as f64).contains(&centre[0]) && (0.0..high as f64).contains(&centre[1]) {
        canvas[centre[1] as usize * wide + centre[0] as usize] = colour;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::postprocessing::drawing::picture::{Picture, open_svg};

    /// Half of the drawing, and many very small triangles in its corner.
    fn half(colour: Colour, count: usize) -> Vec<Triangle> {
        let speck = Triangle { corners: [[0.0, 0.0], [0.2, 0.0], [0.0, 0.2]], colour, is_inside: [false; 3] };
        let mut all = vec![speck; count];
        all[0] =
            Triangle { corners: [[0.0, 0.0], [560.0, 0.0], [0.0, 100.0]], colour, is_inside: [false; 3] };
        all
    }

    fn drawn(triangles: &[Triangle]) -> (String, Vec<[u8; 3]>) {
        let body = paint(triangles, Edges::OfEach, 100.0).expect("drawing");
        let png = Picture::new("p", "", "", format!("{}{body}</svg>", open_svg(100.0))).png().expect("PNG");
        let pixels = Pixmap::decode_png(&png).expect("PNG");
        let at = |x, y| pixels.pixel(x, y).map(|p| [p.red(), p.green(), p.blue()]).expect("inside");
        (body, vec![at(300, 40), at(1000, 180)])
    }

    #[test]
    fn few_triangles_are_polygons_many_an_image_and_both_look_the_same() {
        let orange = [230, 120, 10];
        let (few, seen) = drawn(&half(orange, 3));
        assert!(few.contains("<path") && !few.contains("<image"));
        assert_eq!(seen, [orange, [255; 3]]);
        let (many, seen) = drawn(&half(orange, POLYGONS + 1));
        assert!(many.contains("<image") && !many.contains("<path"));
        assert_eq!(seen, [orange, [255; 3]]);
    }

    #[test]
    fn later_triangles_cover_earlier_ones() {
        let (below, above) = ([10, 20, 30], [200, 210, 220]);
        for count in [1, POLYGONS] {
            let mut both = half(below, count);
            both.extend(half(above, 1));
            assert_eq!(drawn(&both).1[0], above);
        }
    }
}
