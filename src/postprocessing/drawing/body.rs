//! Pictures of the deformed body: coloured by its fields, and with arrows along its contact boundary.

use super::{
    colour::{Colour, Shades, VIRIDIS, dimmed, hex},
    frame::{Frame, colour_bar},
    paint::{Edges, Triangle, paint},
    picture::{Picture, open_svg, text},
    scale::{Scale, extent, number},
    view::{Face, View, faces, outline},
};
use crate::{
    error::Result,
    io::output::{
        field_list::DISPLACEMENT,
        field_snapshot::Snapshot,
        fields::{Place, Shape},
        output_field::{OutputField, Shading},
    },
};
use std::fmt::Write;

/// Lower limit of drawn errors, as a share of the largest error.
const DECADES: f64 = 1e-4;
/// Largest drawn displacement, as a share of the size of the body.
const VISIBLE: f64 = 0.12;

/// The drawing of a body.
pub struct Body<'a> {
    snapshot: &'a Snapshot,
    /// Magnification factor of displacements.
    pub magnification: f64,
    view: View,
    axes: [&'static str; 2],
    faces: Vec<Face>,
    places: Vec<[f64; 3]>,
}

/// A quantity that determines the colours of faces.
#[derive(Debug, Clone, Copy)]
pub struct Coloured<'a> {
    /// Name of the picture.
    pub name: &'a str,
    /// Description.
    pub quantity: &'a str,
    /// Its unit.
    pub unit: &'a str,
    /// Its colour scale.
    pub shades: Shades,
}

impl<'a> Body<'a> {
    /// Prepares the drawing of a body.
    pub fn new(snapshot: &'a Snapshot) -> Self {
        let magnification = magnification(snapshot);
        let view = View::of(snapshot);
        let displacement = snapshot.vectors(&DISPLACEMENT);
        let moved = |(n, x): (usize, &[f64; 3])| {
            let u = displacement.map_or([0.0; 3], |field| field[n]);
            std::array::from_fn(|i| x[i] + magnification * u[i])
        };
        let places = snapshot.nodes.iter().enumerate().map(moved).collect();
        Self { snapshot, magnification, view, axes: ["x", "y"], faces: faces(snapshot), places }
    }

    /// The same with other names of axes.
    pub fn with_axes(self, axes: [&'static str; 2]) -> Self {
        Self { axes, ..self }
    }

    /// Coloured by a field, if the field has a picture and the file contains it.
    pub fn of_field(&self, field: &OutputField) -> Result<Option<Picture>> {
        let (Some(picture), Some(values)) = (field.picture, self.snapshot.values(field)) else {
            return Ok(None);
        };
        let lengths: Vec<f64>;
        let values = match field.shape {
            Shape::Scalar => values,
            Shape::Vector | Shape::Tensor => {
                lengths = values.chunks_exact(field.width()).map(length).collect();
                &lengths
            }
        };
        let unit = field.unit(self.snapshot.dimension());
        let look = Coloured { name: picture.name, quantity: picture.quantity, unit, shades: VIRIDIS };
        let of_face = |face: &Face| match field.place {
            Place::Node => mean(face, values),
            Place::Cell => values[face.cell as usize],
        };
        let drawn = match picture.shading {
            Shading::Linear => self.field(look, linear(extent(values.iter().copied())), of_face)?,
            Shading::Errors => {
                let mut drawn = self.field(look, of_errors(values), of_face)?;
                // Each part of a divided cell has the error of the cell.
                let total = length(values) / (self.snapshot.parts.max(1) as f64).sqrt();
                drawn.caption += &format!(" Of all cells together: {} {unit}.", number(total));
                drawn
            }
        };
        Ok(Some(drawn))
    }

    /// Coloured by a quantity at the nodes.
    pub fn nodal(&self, look: Coloured, values: &[f64]) -> Result<Picture> {
        self.field(look, linear(extent(values.iter().copied())), |face| mean(face, values))
    }

    /// Coloured by the logarithms of the errors of the cells.
    pub fn errors(&self, look: Coloured, values: &[f64]) -> Result<Picture> {
        let largest = extent(values.iter().copied()).map_or(1.0, |range| range.1);
        let shown = values.iter().map(|value| value.max(DECADES * largest));
        let parts = self.snapshot.parts.max(1);
        self.field(look, Scale::logarithmic(shown), |face| values[face.cell as usize / parts])
    }

    /// A description of the magnification of the displacement.
    pub fn magnified(&self) -> String {
        match self.snapshot.vectors(&DISPLACEMENT) {
            None => "undeformed".into(),
            Some(_) if self.magnification == 1.0 => "displacement to scale".into(),
            Some(_) => format!("displacement × {}", number(self.magnification)),
        }
    }

    fn field(
        &self,
        Coloured { name, quantity, unit, shades }: Coloured,
        scale: Scale,
        value: impl Fn(&Face) -> f64,
    ) -> Result<Picture> {
        let (low, high) = extent(self.faces.iter().map(&value)).unwrap_or((0.0, 0.0));
        let share = |face: &Face| {
            let place = scale.place(value(face)).unwrap_or(scale.low);
            (place - scale.low) / (scale.high - scale.low)
        };
        let frame = self.frame(122.0, &[]);
        let triangles = self.triangles(&frame, |face| shades.at(share(face)));
        let mut svg = open_svg(frame.height);
        let heading = format!("t = {} s, {}", number(self.snapshot.time), self.magnified());
        svg += &text(6.0, 18.0, "start", &heading);
        svg += &paint(&triangles, self.edges(), frame.height)?;
        svg += &self.surroundings(&frame);
        svg += &colour_bar(name, shades, &scale, &scale.words(quantity, unit), &frame);
        svg += "</svg>";
        let seen = match self.view {
            View::Plane => String::new(),
            View::Oblique => {
                " The surface is seen from the front right and above (x right, y back, z up); darker \
                              faces have less light."
                    .into()
            }
        };
        let figures = format!("from {} to {} {unit}", number(low), number(high));
        let figures = figures.trim_end();
        Ok(Picture::new(
            name,
            format!("Mesh coloured by {quantity}, {figures}, at {} s", number(self.snapshot.time)),
            format!(
                "Mesh ({}) at t = {} s, coloured by {quantity}: {figures}.{seen}",
                self.magnified(),
                number(self.snapshot.time)
            ),
            svg,
        ))
    }

    /// The mesh with arrows, each from a point to a point of the deformed body, both with magnified displacements.
    pub fn arrows(&self, heading: &str, colour: Colour, arrows: &[[[f64; 2]; 2]]) -> Result<String> {
        let ends: Vec<[f64; 2]> = arrows.iter().flatten().copied().collect();
        let frame = self.frame(24.0, &ends);
        let mut svg = open_svg(frame.height);
        svg += &text(6.0, 18.0, "start", heading);
        svg += &paint(&self.triangles(&frame, |_| [0xee; 3]), self.edges(), frame.height)?;
        svg += &self.surroundings(&frame);
        let _ = writeln!(svg, "<g stroke=\"{0}\" fill=\"{0}\" stroke-width=\"1.6\">", hex(colour));
        for arrow in arrows {
            let [[x, y], [a, b]] = arrow.map(|end| frame.place(end));
            let (along, length) = ([a - x, b - y], (a - x).hypot(b - y));
            if length < 0.5 {
                continue;
            }
            let [e, f] = along.map(|c| c / length);
            let tip = length.min(7.0);
            let wing = |side: f64| [a - tip * e - side * 0.4 * tip * f, b - tip * f + side * 0.4 * tip * e];
            let ([p, q], [r, s]) = (wing(1.0), wing(-1.0));
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {y:.1}L{a:.1} {b:.1}M{a:.1} {b:.1}L{p:.1} {q:.1} {r:.1} {s:.1}Z\"/>"
            );
        }
        Ok(svg + "</g>\n</svg>")
    }

    /// The position in m at which the node with this number is drawn.
    pub fn place(&self, node: usize) -> [f64; 2] {
        let [x, y, _] = self.places[node];
        [x, y]
    }

    /// Length of the diagonal of the box around the undeformed body, in m.
    pub fn size(&self) -> f64 {
        size(self.snapshot)
    }

    fn edges(&self) -> Edges {
        if self.view == View::Plane { Edges::AboveAll } else { Edges::OfEach }
    }

    fn triangles(&self, frame: &Frame, colour: impl Fn(&Face) -> Colour) -> Vec<Triangle> {
        let mut seen = Vec::with_capacity(self.faces.len());
        for face in &self.faces {
            let corners = face.nodes.map(|n| self.places[n as usize]);
            let Some(light) = self.view.light(corners) else { continue };
            let projected = corners.map(|corner| self.view.project(corner));
            let depth = projected.iter().map(|p| p[2]).sum::<f64>();
            let corners = projected.map(|p| frame.place([p[0], p[1]]));
            let colour = dimmed(colour(face), light);
            seen.push((depth, Triangle { corners, colour, is_inside: face.is_inside }));
        }
        match self.view {
            View::Plane => seen.sort_by_key(|(_, triangle)| triangle.colour),
            View::Oblique => seen.sort_by(|a, b| a.0.total_cmp(&b.0)),
        }
        seen.into_iter().map(|(_, triangle)| triangle).collect()
    }

    /// Fits the deformed body, the undeformed one and these points into the drawing, with space on the right.
    fn frame(&self, right: f64, points: &[[f64; 2]]) -> Frame {
        let flat = |p: &[f64; 3]| {
            let [x, y, _] = self.view.project(*p);
            [x, y]
        };
        let all = || {
            let bodies = self.places.iter().chain(&self.snapshot.nodes).map(flat);
            bodies.chain(points.iter().copied())
        };
        let ranges = [0, 1].map(|axis| extent(all().map(|p| p[axis])).unwrap_or((0.0, 1.0)));
        Frame::around(ranges, right)
    }

    /// Axes and the undeformed outline of a 2D body; directions of the axes in 3D.
    fn surroundings(&self, frame: &Frame) -> String {
        if self.view == View::Oblique {
            return self.directions(frame);
        }
        let mut out = String::new();
        if self.magnification != 0.0 && self.snapshot.vectors(&DISPLACEMENT).is_some() {
            out.push_str(
                "<path fill=\"none\" stroke=\"#555\" stroke-width=\"1\" stroke-dasharray=\"5 4\" d=\"",
            );
            for line in outline(self.snapshot) {
                for (at, node) in line.into_iter().enumerate() {
                    let [x, y, _] = self.snapshot.nodes[node as usize];
                    let [a, b] = frame.place([x, y]);
                    let _ = write!(out, "{}{a:.1} {b:.1}", if at == 0 { "M" } else { "L" });
                }
            }
            out.push_str("\"/>\n");
        }
        out + &frame.axes(self.axes)
    }

    fn directions(&self, frame: &Frame) -> String {
        let foot = [34.0, frame.height - 30.0];
        let mut out = String::new();
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let mut along = [0.0; 3];
            along[axis] = 34.0;
            let [right, up, _] = self.view.project(along);
            let tip = [foot[0] + right, foot[1] - up];
            let _ = writeln!(
                out,
                "<path stroke=\"#1a1a1a\" stroke-width=\"1.5\" d=\"M{:.1} {:.1}L{:.1} {:.1}\"/>",
                foot[0], foot[1], tip[0], tip[1]
            );
            out += &text(foot[0] + 1.3 * right, foot[1] - 1.3 * up + 5.0, "middle", name);
        }
        out
    }
}

fn linear(range: Option<(f64, f64)>) -> Scale {
    Scale::linear(range.map_or([0.0; 2], |(low, high)| [low, high]).into_iter(), false)
}

/// Colours of errors, down to a hundredth of the largest.
fn of_errors(values: &[f64]) -> Scale {
    match extent(values.iter().copied()) {
        Some((_, largest)) if largest > 0.0 => {
            Scale::logarithmic(values.iter().copied().filter(|error| *error >= 1e-2 * largest))
        }
        _ => Scale::linear(values.iter().copied(), false),
    }
}

/// The mean of nodal values on a face.
fn mean(face: &Face, nodal: &[f64]) -> f64 {
    face.nodes.iter().map(|n| nodal[*n as usize]).sum::<f64>() / 3.0
}

/// The root of the sum of the squares.
fn length(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn size(snapshot: &Snapshot) -> f64 {
    let length =
        |axis: usize| extent(snapshot.nodes.iter().map(|x| x[axis])).map_or(0.0, |(low, high)| high - low);
    (0..3).map(|axis| length(axis).powi(2)).sum::<f64>().sqrt()
}

/// A round factor that makes displacements visible, at least 1.
fn magnification(snapshot: &Snapshot) -> f64 {
    let lengths = snapshot.vectors(&DISPLACEMENT).into_iter().flatten().map(|u| length(u));
    let largest = extent(lengths).map_or(0.0, |range| range.1);
    let wanted = VISIBLE * size(snapshot) / largest;
    if wanted.is_finite() && wanted > 1.0 { leading_digit(wanted) } else { 1.0 }
}

/// The number rounded down to one significant digit.
fn leading_digit(size: f64) -> f64 {
    let power = 10f64.powf(size.log10().floor());
    (size / power + 1e-9).floor() * power
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::output::field_list::{FIELDS, VELOCITY, VON_MISES};
    use std::collections::BTreeMap;

    fn square(displacement: f64) -> Snapshot {
        Snapshot {
            nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            cells: vec![0, 1, 2, 0, 2, 3],
            corners: 3,
            time: 0.5,
            fields: BTreeMap::from([
                ("displacement", [displacement, 0.0, 0.0].repeat(4)),
                ("velocity", [0.0, 3.0, 4.0].repeat(4)),
                ("von_mises", vec![1.0, 2.5]),
            ]),
            ..Snapshot::default()
        }
    }

    #[test]
    fn small_displacements_are_magnified_by_a_round_number_that_is_stated_and_large_ones_are_not() {
        for (displacement, factor, words) in [
            (0.04, 4.0, "displacement × 4"),
            (1e-5, 10000.0, "displacement × 10000"),
            (3.0, 1.0, "to scale"),
            (0.0, 1.0, "to scale"),
        ] {
            let snapshot = square(displacement);
            let body = Body::new(&snapshot);
            assert_eq!(body.magnification, factor);
            let picture = body.of_field(&VELOCITY).expect("drawn").expect("velocity");
            assert!(picture.svg.contains(words) && picture.caption.contains(words), "{}", picture.caption);
            assert!(picture.caption.contains("from 5 to 5 m/s"), "{}", picture.caption);
        }
    }

    #[test]
    fn fields_that_a_file_lacks_are_not_drawn() {
        let bare = square(0.0).without_fields();
        let body = Body::new(&bare);
        assert!(FIELDS.iter().all(|field| body.of_field(field).expect("nothing to draw").is_none()));
        assert_eq!(body.magnified(), "undeformed");
    }

    #[test]
    fn cells_of_different_stress_have_different_shades() {
        let snapshot = square(0.01);
        let svg = Body::new(&snapshot).of_field(&VON_MISES).expect("drawn").expect("stress").svg;
        for shade in [VIRIDIS.at(0.0), VIRIDIS.at(1.0)] {
            assert!(svg.contains(&format!("<path fill=\"{}\"", hex(shade))));
        }
        assert!(svg.contains("von Mises stress / Pa") && svg.contains("x / m"));
    }
}
