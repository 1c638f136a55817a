//! Pictures of the deformed body: coloured by its fields, and with arrows along its contact boundary.

use super::{
    colour::{Colour, Shades, VIRIDIS, hex},
    common::{Common, is_uniform},
    frame::{ColourKey, Frame, colour_bar},
    paint::{Style, Triangle, paint},
    picture::Picture,
    scale::{Scale, extent, number, percentiles},
    svg::{open_svg, text},
    view::{Face, View, cross, dot, faces, minus, outline, unit},
};
use crate::{
    error::Result,
    io::output::{
        field_list::{self, DISPLACEMENT, FIELDS, REGION},
        field_snapshot::{History, Snapshot},
        fields::{Place, Shape},
        output_field::{FieldPicture, OutputField, Shading},
    },
};
use std::{borrow::Cow, collections::BTreeMap, fmt::Write};

/// Lower limit of drawn errors, as a share of the largest error.
const DECADES: f64 = 1e-4;
/// Largest drawn displacement, as a share of the size of the body.
const VISIBLE: f64 = 0.12;
/// Pixels per unit of the drawing, except in animations.
const RESOLUTION: usize = 2;
/// The smallest drawn size of a cell, as a share of its undeformed size.
const THINNEST: f64 = 0.2;

/// The drawing of a body.
#[derive(Clone)]
pub struct DrawnBody<'a> {
    snapshot: &'a Snapshot,
    look: Look,
    common: Option<&'a Common>,
    /// Magnification factor of displacements.
    pub magnification: f64,
    view: View,
    axes: [&'static str; 2],
    faces: Vec<Face>,
    places: Vec<[f64; 3]>,
}

/// Options of the drawing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Look {
    /// Whether each cell has one colour. Otherwise values of cells are averaged at the nodes, within each region.
    pub per_cell: bool,
    /// Whether contour lines are drawn.
    pub contours: bool,
    /// Whether there are several materials, between which no mean is taken.
    pub several_materials: bool,
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

/// The drawing of a field.
#[derive(Debug, Clone)]
pub enum Drawn {
    /// A picture.
    Picture(Picture),
    /// No picture, because the value is the same everywhere: the quantity and its value, in words.
    Uniform(String),
}

/// A quantity at the corners of the faces, for drawings that are made elsewhere.
#[derive(Debug, Clone)]
pub struct AtCorners {
    /// Its name in files.
    pub name: String,
    /// Description.
    pub words: String,
    /// Its unit.
    pub unit: &'static str,
    /// How values become colours.
    pub shading: Shading,
    /// The ends of its colour scale.
    pub range: Option<(f64, f64)>,
    /// Its values at the corners of each [face](DrawnBody::faces).
    pub values: Vec<[f64; 3]>,
}

/// A quantity that has a picture.
struct Quantity<'a> {
    /// Name of the picture.
    name: &'a str,
    /// Description.
    words: Cow<'a, str>,
    unit: &'static str,
    place: Place,
    shading: Shading,
    values: Cow<'a, [f64]>,
}

impl Quantity<'_> {
    /// The ends of its colour scale: linear, from the 1st to the 99th percentile if the others are far from these; of errors, from
    /// the smallest that is drawn to the largest.
    fn range(&self) -> Option<(f64, f64)> {
        let full @ (least, most) = extent(self.values.iter().copied())?;
        match self.shading {
            Shading::Errors => Some(if most > 0.0 { (least.max(1e-2 * most), most) } else { full }),
            Shading::Linear => {
                let shown @ (low, high) = percentiles(&self.values)?;
                let is_wide = most - least > 1.05 * (high - low);
                Some(if is_wide && !is_uniform(low, high) { shown } else { full })
            }
        }
    }
}

/// The quantity of a history.
fn of_history(history: &History) -> Quantity<'_> {
    Quantity {
        name: &history.name,
        words: history.name.replace('_', " ").into(),
        unit: field_list::unit(&history.name, 3),
        place: history.place,
        shading: Shading::Linear,
        values: history.values.as_slice().into(),
    }
}

/// Values to be drawn.
struct Values<'a> {
    values: Cow<'a, [f64]>,
    place: Place,
    scale: Scale,
    /// Whether the scale leaves out the extreme values.
    is_clipped: bool,
    /// The drawings that have this scale in common, in words.
    common: Option<&'a str>,
    /// The region of each cell, if values of cells are averaged at the nodes within regions.
    regions: Option<Cow<'a, [f64]>>,
}

impl<'a> DrawnBody<'a> {
    /// Prepares the drawing of a body.
    pub fn new(snapshot: &'a Snapshot) -> Self {
        let magnification = magnification(snapshot).unwrap_or(1.0);
        let view = View::of(snapshot);
        let places = places(snapshot, magnification);
        let look = Look::default();
        Self {
            snapshot,
            look,
            common: None,
            magnification,
            view,
            axes: ["x", "y"],
            faces: faces(snapshot),
            places,
        }
    }

    /// The same with other names of axes.
    pub fn with_axes(self, axes: [&'static str; 2]) -> Self {
        Self { axes, ..self }
    }

    /// The same with other options.
    pub fn with_look(self, look: Look) -> Self {
        Self { look, ..self }
    }

    /// A drawing of another body with the options of this one, with displacements to scale.
    pub fn alike_to_scale<'b>(&self, snapshot: &'b Snapshot) -> DrawnBody<'b> {
        let places = places(snapshot, 1.0);
        DrawnBody { magnification: 1.0, places, ..DrawnBody::new(snapshot).with_look(self.look) }
    }

    /// The same body from another direction, if this drawing does not show its side with this outward normal.
    pub fn hidden_side(&self, normal: [f64; 3]) -> Option<Self> {
        self.view.of_hidden_side(normal).map(|view| Self { view, ..self.clone() })
    }

    /// The same with the colours, the magnification and the section that several drawings have in common.
    pub fn with_common(self, common: &'a Common) -> Self {
        let magnification = common.magnification.unwrap_or(1.0);
        let places = places(self.snapshot, magnification);
        Self { common: Some(common), magnification, places, ..self }
    }

    /// Coloured by a field, if the field has a picture and the file contains it.
    pub fn of_field(&self, field: &OutputField) -> Result<Option<Drawn>> {
        self.field(field).map(|quantity| self.drawn(quantity)).transpose()
    }

    /// Coloured by a history of the material.
    pub fn of_history(&self, history: &History) -> Result<Drawn> {
        self.drawn(of_history(history))
    }

    /// The quantity of a field that has a picture.
    fn field(&self, field: &OutputField) -> Option<Quantity<'_>> {
        self.as_picture(field, field.picture?)
    }

    /// The quantity of a field, with these words.
    fn as_picture(&self, field: &OutputField, picture: FieldPicture) -> Option<Quantity<'_>> {
        let values = self.snapshot.values(field)?;
        let values: Cow<[f64]> = match field.shape {
            Shape::Scalar => values.into(),
            Shape::Vector | Shape::Tensor => values.chunks_exact(field.width()).map(length).collect(),
        };
        let unit = field.unit(self.snapshot.dimension());
        let FieldPicture { name, quantity, shading } = picture;
        Some(Quantity { name, words: quantity.into(), unit, place: field.place, shading, values })
    }

    /// The drawn faces.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// The number of the region of each face; `None` if each cell has one colour.
    pub fn regions_of_faces(&self) -> Option<Vec<f64>> {
        let regions = self.regions()?;
        Some(self.faces.iter().map(|face| regions[face.cell as usize]).collect())
    }

    /// The unit vector toward the viewer of a solid: onto this side of it, if that has a normal.
    pub fn toward(&self, side: Option<[f64; 3]>) -> Option<[f64; 3]> {
        let view = side.and_then(|normal| self.view.of_hidden_side(normal)).unwrap_or(self.view);
        match view {
            View::Plane => None,
            View::Oblique(toward) => Some(unit(toward)),
        }
    }

    /// All scalars and lengths of vectors that the file contains.
    pub fn quantities(&self) -> Vec<AtCorners> {
        let is_drawn = |field: &&OutputField| field.shape != Shape::Tensor && field.name != REGION.name;
        let fields = FIELDS.iter().filter(is_drawn).filter_map(|field| {
            let plain = FieldPicture { name: field.name, quantity: field.name, shading: Shading::Linear };
            self.as_picture(field, field.picture.unwrap_or(plain))
        });
        let at_corners = |quantity: Quantity<'_>| {
            let range = quantity.range();
            let Quantity { name, words, unit, place, shading, values } = quantity;
            let regions =
                if place == Place::Cell && shading != Shading::Errors { self.regions() } else { None };
            let (scale, is_clipped, common) = (linear(None), false, None);
            let values = self.at_corners(&Values { values, place, scale, is_clipped, common, regions });
            AtCorners { name: name.into(), words: words.replace('_', " "), unit, shading, range, values }
        };
        fields.chain(self.snapshot.histories.iter().map(of_history)).map(at_corners).collect()
    }

    /// Pixels per unit of the drawing.
    fn resolution(&self) -> usize {
        if self.common.is_some_and(|common| !common.section.is_empty()) { 1 } else { RESOLUTION }
    }

    /// The colours and the magnification that these drawings have in common; those of an animation also have one section, and fewer
    /// pixels.
    pub fn in_common(words: &'static str, bodies: &[&Self], is_animation: bool) -> Common {
        let ranges = bodies.iter().flat_map(|body| body.ranges());
        let magnification = bodies.iter().filter_map(|body| magnification(body.snapshot)).reduce(f64::min);
        let mut common = Common::new(words, ranges, magnification);
        let factor = magnification.unwrap_or(1.0);
        for body in bodies.iter().filter(|_| is_animation) {
            let [(left, right), (bottom, top)] = body.section(&places(body.snapshot, factor), &[]);
            common.section.extend([[left, bottom], [right, top]]);
        }
        common
    }

    /// The ends of the colour scales of all pictures, by their names.
    fn ranges(&self) -> BTreeMap<String, (f64, f64)> {
        let fields = FIELDS.iter().filter_map(|field| self.field(field));
        let histories = self.snapshot.histories.iter().filter(|history| history.place == Place::Cell);
        let quantities = fields.chain(histories.map(of_history));
        quantities.filter_map(|quantity| Some((quantity.name.to_owned(), quantity.range()?))).collect()
    }

    fn drawn(&self, quantity: Quantity) -> Result<Drawn> {
        let Quantity { name, words, unit, place, shading, values } = &quantity;
        let common = self.common.and_then(|common| Some((*common.colours.get(*name)?, common.words)));
        let range = common.map(|(range, _)| range).or_else(|| quantity.range());
        let (low, high) = range.unwrap_or_default();
        if range.is_some() && is_uniform(low, high) {
            let words = format!("{words}: {} {unit}", number(low));
            return Ok(Drawn::Uniform(words.trim_end().to_owned()));
        }
        let look = Coloured { name, quantity: words, unit, shades: VIRIDIS };
        let common = common.map(|(_, words)| words);
        let values: Cow<[f64]> = values.as_ref().into();
        let drawn = match shading {
            Shading::Linear => {
                let beyond = extent(values.iter().copied())
                    .map_or(0.0, |(least, most)| (low - least).max(0.0) + (most - high).max(0.0));
                let is_clipped = beyond > 0.05 * (high - low);
                let regions = if *place == Place::Cell { self.regions() } else { None };
                let scale = linear(range);
                self.picture(look, &Values { values, place: *place, scale, is_clipped, common, regions })?
            }
            Shading::Errors => {
                // Each part of a divided cell has the error of the cell.
                let total = length(&values) / (self.snapshot.parts.max(1) as f64).sqrt();
                let scale = of_errors(range);
                let place = Place::Cell;
                let shown = Values { values, place, scale, is_clipped: false, common, regions: None };
                let mut drawn = self.picture(look, &shown)?;
                drawn.caption += &format!(" All cells together: {} {unit}.", number(total));
                drawn
            }
        };
        Ok(Drawn::Picture(drawn))
    }

    /// Coloured by a quantity at the nodes.
    pub fn nodal(&self, look: Coloured, values: &[f64]) -> Result<Picture> {
        let scale = linear(extent(values.iter().copied()));
        let (place, values) = (Place::Node, values.into());
        let (is_clipped, common, regions) = (false, None, None);
        self.picture(look, &Values { values, place, scale, is_clipped, common, regions })
    }

    /// Coloured by the logarithms of the errors of the cells.
    pub fn errors(&self, look: Coloured, values: &[f64]) -> Result<Picture> {
        let largest = extent(values.iter().copied()).map_or(1.0, |range| range.1);
        let scale = Scale::logarithmic(values.iter().map(|value| value.max(DECADES * largest)));
        let parts = self.snapshot.parts.max(1);
        let of_parts = values.iter().flat_map(|value| std::iter::repeat_n(*value, parts));
        let (place, values) = (Place::Cell, of_parts.collect());
        let (is_clipped, common, regions) = (false, None, None);
        self.picture(look, &Values { values, place, scale, is_clipped, common, regions })
    }

    /// A description of the magnification of the displacement.
    pub fn magnified(&self) -> String {
        match self.snapshot.vectors(&DISPLACEMENT) {
            None => "undeformed".into(),
            Some(_) if self.magnification == 1.0 => "displacement to scale".into(),
            Some(_) => format!("displacement × {}", number(self.magnification)),
        }
    }

    /// The regions within which values of cells are averaged; `None` if they are not known, or no mean is wanted.
    fn regions(&self) -> Option<Cow<'_, [f64]>> {
        if self.look.per_cell {
            return None;
        }
        let regions = self.snapshot.values(&REGION).map(Cow::from);
        let one = || Cow::from(vec![0.0; self.snapshot.cells.len() / self.snapshot.corners]);
        regions.or_else(|| (!self.look.several_materials).then(one))
    }

    /// Whether cells have one colour only because the regions are not known.
    pub fn lacks_regions(&self) -> bool {
        !self.look.per_cell && self.regions().is_none()
    }

    /// The values at the corners of each face.
    fn at_corners(&self, shown: &Values) -> Vec<[f64; 3]> {
        match (shown.place, &shown.regions) {
            (Place::Node, _) => {
                self.faces.iter().map(|face| face.nodes.map(|node| shown.values[node as usize])).collect()
            }
            (Place::Cell, None) => {
                self.faces.iter().map(|face| [shown.values[face.cell as usize]; 3]).collect()
            }
            (Place::Cell, Some(regions)) => {
                let means = means_at_nodes(self.snapshot, regions, &shown.values);
                let of_face = |face: &Face| {
                    let means = &means[&regions[face.cell as usize].to_bits()];
                    face.nodes.map(|node| means[node as usize])
                };
                self.faces.iter().map(of_face).collect()
            }
        }
    }

    fn picture(&self, look: Coloured, shown: &Values) -> Result<Picture> {
        let Coloured { name, quantity, unit, shades } = look;
        let scale = &shown.scale;
        let share = |value: f64| {
            let place = scale.place(value).unwrap_or(scale.low);
            ((place - scale.low) / (scale.high - scale.low)).clamp(0.0, 1.0)
        };
        let corners: Vec<[f64; 3]> =
            self.at_corners(shown).into_iter().map(|values| values.map(share)).collect();
        let frame = self.frame(122.0, self.common.map_or(&[], |common| &common.section));
        let contours: Vec<f64> = if self.look.contours {
            scale.ticks.iter().map(|(tick, _)| (tick - scale.low) / (scale.high - scale.low)).collect()
        } else {
            Vec::new()
        };
        let style =
            Style { colour: &|share| shades.at(share), contours: &contours, resolution: self.resolution() };
        let mut svg = open_svg(frame.height);
        let heading = format!("t = {} s, {}", number(self.snapshot.time), self.magnified());
        svg += &text(6.0, 18.0, "start", &heading);
        svg += &paint(&self.triangles(&frame, &corners), &style, frame.height)?;
        svg += &self.surroundings(&frame);
        let words = scale.words(quantity, unit);
        let key = ColourKey { scale, is_clipped: shown.is_clipped, words: &words };
        svg += &colour_bar(name, shades, key, &frame);
        svg += "</svg>";
        let (figures, colours) = words_of(shown, unit);
        let seen = self
            .view
            .words()
            .map_or_else(String::new, |from| format!(" Seen from {from}; shading shows face orientation."));
        Ok(Picture::new(
            name,
            format!("Body coloured by {quantity}, {figures}, at {} s", number(self.snapshot.time)),
            format!(
                "Body ({}) at t = {} s, coloured by {quantity}: {figures}{colours}.{seen}",
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
        let style = Style { colour: &|_| [0xee; 3], contours: &[], resolution: RESOLUTION };
        let blank = vec![[0.0; 3]; self.faces.len()];
        svg += &paint(&self.triangles(&frame, &blank), &style, frame.height)?;
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

    fn triangles(&self, frame: &Frame, shares: &[[f64; 3]]) -> Vec<Triangle> {
        let mut seen = Vec::with_capacity(self.faces.len());
        for (face, &shares) in self.faces.iter().zip(shares) {
            let corners = face.nodes.map(|n| self.places[n as usize]);
            let Some(light) = self.view.light(corners) else { continue };
            let corners = corners.map(|corner| {
                let [right, up, toward] = self.view.project(corner);
                let [x, y] = frame.place([right, up]);
                [x, y, if self.view == View::Plane { 0.0 } else { toward }]
            });
            seen.push(Triangle { corners, shares, light, is_inside: face.is_inside });
        }
        seen
    }

    /// Ranges to the right and upwards, in m, that contain the undeformed body, its nodes at these places, and these points.
    fn section(&self, places: &[[f64; 3]], points: &[[f64; 2]]) -> [(f64, f64); 2] {
        let flat = |p: &[f64; 3]| {
            let [x, y, _] = self.view.project(*p);
            [x, y]
        };
        let all = || {
            let bodies = places.iter().chain(&self.snapshot.nodes).map(flat);
            bodies.chain(points.iter().copied())
        };
        [0, 1].map(|axis| extent(all().map(|p| p[axis])).unwrap_or((0.0, 1.0)))
    }

    /// Fits the deformed body, the undeformed one and these points into the drawing, with space on the right.
    fn frame(&self, right: f64, points: &[[f64; 2]]) -> Frame {
        Frame::around(self.section(&self.places, points), right)
    }

    /// Axes and the undeformed outline of a 2D body; directions of the axes in 3D.
    fn surroundings(&self, frame: &Frame) -> String {
        if self.view != View::Plane {
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

/// Colours of errors in this range.
fn of_errors(range: Option<(f64, f64)>) -> Scale {
    match range {
        Some((low, high)) if high > 0.0 => Scale::logarithmic([low, high].into_iter()),
        _ => linear(range),
    }
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

/// The range of the values and that of their colours, in words.
fn words_of(shown: &Values, unit: &str) -> (String, String) {
    let (low, high) = extent(shown.values.iter().copied()).unwrap_or((0.0, 0.0));
    let range = |low: f64, high: f64| shown.scale.range([low, high], unit);
    let mut figures = range(low, high);
    if shown.regions.is_some() {
        figures += " in the cells";
    }
    let mut colours = String::new();
    if shown.regions.is_some() {
        colours += ", drawn as means at the nodes";
    }
    let Scale { low, high, factor, .. } = shown.scale;
    let ends = range(low / factor, high / factor);
    if let Some(common) = shown.common {
        colours += &format!("; colours as in {common}");
    } else if shown.is_clipped {
        colours += &format!("; colours {ends}, the 1st to the 99th percentile");
    }
    (figures, colours)
}

/// Means of values of cells at the nodes, weighted by the measures of the cells, for each region.
fn means_at_nodes(snapshot: &Snapshot, regions: &[f64], values: &[f64]) -> BTreeMap<u64, Vec<f64>> {
    let nodes = snapshot.nodes.len();
    let mut sums: BTreeMap<u64, Vec<[f64; 2]>> = BTreeMap::new();
    for ((cell, region), value) in snapshot.cells().zip(regions).zip(values) {
        let sums = sums.entry(region.to_bits()).or_insert_with(|| vec![[0.0; 2]; nodes]);
        let measure = measure(cell, &snapshot.nodes).abs();
        for node in cell {
            let [sum, weight] = &mut sums[*node as usize];
            (*sum, *weight) = (*sum + measure * value, *weight + measure);
        }
    }
    let mean = |[sum, weight]: [f64; 2]| sum / weight;
    sums.into_iter().map(|(region, sums)| (region, sums.into_iter().map(mean).collect())).collect()
}

/// A multiple of the area or volume of a cell whose nodes are at these places; its sign is that of its orientation.
fn measure(cell: &[u32], places: &[[f64; 3]]) -> f64 {
    let edge = |n: usize| minus(places[cell[n] as usize], places[cell[0] as usize]);
    let normal = cross(edge(1), edge(2));
    if cell.len() == 3 { normal[2] } else { dot(normal, edge(3)) }
}

/// The places of the nodes with displacements magnified by this factor.
fn places(snapshot: &Snapshot, magnification: f64) -> Vec<[f64; 3]> {
    let displacement = snapshot.vectors(&DISPLACEMENT);
    let moved = |(n, x): (usize, &[f64; 3])| {
        let u = displacement.map_or([0.0; 3], |field| field[n]);
        std::array::from_fn(|i| x[i] + magnification * u[i])
    };
    snapshot.nodes.iter().enumerate().map(moved).collect()
}

/// A round factor that makes displacements visible, at least 1, and no larger than one at which cells are drawn folded; `None`
/// without displacements.
fn magnification(snapshot: &Snapshot) -> Option<f64> {
    let lengths = snapshot.vectors(&DISPLACEMENT).into_iter().flatten().map(|u| length(u));
    let largest = extent(lengths).map_or(0.0, |range| range.1);
    let mut factor = VISIBLE * size(snapshot) / largest;
    if !factor.is_finite() {
        return None;
    }
    while factor > 1.0 {
        factor = leading_digit(factor);
        let moved = places(snapshot, factor);
        let ratio = |cell: &[u32]| measure(cell, &moved) / measure(cell, &snapshot.nodes);
        if snapshot.cells().all(|cell| ratio(cell) >= THINNEST) {
            return Some(factor);
        }
        factor *= 0.7;
    }
    Some(1.0)
}

/// The number rounded down to one significant digit.
fn leading_digit(size: f64) -> f64 {
    let power = 10f64.powf(size.log10().floor());
    (size / power + 1e-9).floor() * power
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::output::field_list::{VELOCITY, VON_MISES};

    fn square(displacement: f64) -> Snapshot {
        Snapshot {
            nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            cells: vec![0, 1, 2, 0, 2, 3],
            corners: 3,
            time: 0.5,
            fields: BTreeMap::from([
                ("displacement", [displacement, 0.0, 0.0].repeat(4)),
                ("velocity", [[0.0; 3], [0.0, 3.0, 4.0], [0.0; 3], [0.0; 3]].concat()),
                ("von_mises", vec![1.0, 2.5]),
            ]),
            ..Snapshot::default()
        }
    }

    #[track_caller]
    fn picture(body: &DrawnBody, field: &OutputField) -> Picture {
        match body.of_field(field).expect("drawn").expect(field.name) {
            Drawn::Picture(picture) => picture,
            Drawn::Uniform(words) => panic!("{words}"),
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
            let body = DrawnBody::new(&snapshot);
            assert_eq!(body.magnification, factor);
            let picture = picture(&body, &VELOCITY);
            assert!(picture.svg.contains(words) && picture.caption.contains(words), "{}", picture.caption);
            assert!(picture.caption.contains("from 0 to 5 m/s"), "{}", picture.caption);
        }
    }

    #[test]
    fn no_cell_is_drawn_folded() {
        let mut snapshot = square(0.0);
        // The right side moves to the left by 0.01 m: the body would be flat at a factor of 100, and 0.16 m are visible at 16.
        let moved = |x: &[f64; 3]| [if x[0] == 1.0 { -0.01 } else { 0.0 }, 0.0, 0.0];
        snapshot.fields.insert("displacement", snapshot.nodes.iter().flat_map(moved).collect());
        assert_eq!(DrawnBody::new(&snapshot).magnification, 10.0);
        let large = |x: &[f64; 3]| [if x[0] == 1.0 { -0.5 } else { 5e-3 * x[1] }, 0.0, 0.0];
        snapshot.fields.insert("displacement", snapshot.nodes.iter().flat_map(large).collect());
        assert_eq!(DrawnBody::new(&snapshot).magnification, 1.0);
        // A cell of a hundredth of the size that is halved: at a factor of 2 it would be flat.
        snapshot.nodes.extend([[1.01, 0.0, 0.0]]);
        snapshot.cells.extend([1, 4, 2]);
        let mut few = [[0.0; 3]; 5];
        few[4][0] = -0.005;
        snapshot.fields.insert("displacement", few.concat());
        assert_eq!(DrawnBody::new(&snapshot).magnification, 1.0);
    }

    #[test]
    fn fields_that_a_file_lacks_are_not_drawn() {
        let bare = square(0.0).without_fields();
        let body = DrawnBody::new(&bare);
        assert!(FIELDS.iter().all(|field| body.of_field(field).expect("nothing to draw").is_none()));
        assert_eq!(body.magnified(), "undeformed");
    }

    #[test]
    fn what_is_the_same_everywhere_is_named_instead_of_drawn() {
        let mut snapshot = square(0.0);
        snapshot.fields.insert("von_mises", vec![3.0; 2]);
        snapshot.fields.insert("velocity", vec![0.0; 12]);
        let body = DrawnBody::new(&snapshot);
        for (field, expected) in [(&VON_MISES, "von Mises stress: 3 Pa"), (&VELOCITY, "speed: 0 m/s")] {
            match body.of_field(field).expect("drawn") {
                Some(Drawn::Uniform(words)) => assert_eq!(words, expected),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn drawings_with_something_in_common_have_the_same_colours_and_magnification() {
        let [low, mut high] = [square(0.04), square(0.02)];
        high.fields.insert("von_mises", vec![2.0, 7.0]);
        high.fields.insert("velocity", vec![0.0; 12]);
        let bodies = [&low, &high].map(DrawnBody::new);
        let common = DrawnBody::in_common("both", &[&bodies[0], &bodies[1]], true);
        let drawn = |name| bodies.clone().map(|body| picture(&body.with_common(&common), name));
        let ticks = |picture: &Picture| picture.svg.split("shades)").nth(1).expect("a bar").to_owned();
        let stresses = drawn(&VON_MISES);
        assert_eq!(ticks(&stresses[0]), ticks(&stresses[1]));
        assert!(stresses.iter().all(
            |one| one.caption.contains("displacement × 4") && one.caption.contains("colours as in both")
        ));
        // The speed is the same everywhere in one of them only.
        let speeds = drawn(&VELOCITY);
        assert_eq!(ticks(&speeds[0]), ticks(&speeds[1]));
    }

    /// The values that are drawn at the corners of each face.
    fn corners(snapshot: &Snapshot, look: Look) -> Vec<[f64; 3]> {
        let body = DrawnBody::new(snapshot).with_look(look);
        let values = snapshot.values(&VON_MISES).expect("stress").into();
        let (scale, regions, common) = (linear(None), body.regions(), None);
        body.at_corners(&Values { values, place: Place::Cell, scale, is_clipped: false, common, regions })
    }

    #[test]
    fn values_of_cells_are_averaged_at_the_nodes_but_not_across_regions_or_on_request() {
        let mut snapshot = square(0.01);
        let cells = [[1.0; 3], [2.5; 3]];
        assert_eq!(corners(&snapshot, Look::default()), [[1.75, 1.0, 1.75], [1.75, 1.75, 2.5]]);
        assert_eq!(corners(&snapshot, Look { per_cell: true, ..Look::default() }), cells);
        let several = Look { several_materials: true, ..Look::default() };
        assert_eq!(corners(&snapshot, several), cells, "regions are not known");
        snapshot.fields.insert("region", vec![1.0, 2.0]);
        assert_eq!(corners(&snapshot, several), cells);
        snapshot.fields.insert("region", vec![2.0, 2.0]);
        assert_eq!(corners(&snapshot, several)[0], [1.75, 1.0, 1.75]);
        let picture = picture(&DrawnBody::new(&snapshot), &VON_MISES);
        let words = "from 1 to 2.5 Pa in the cells, drawn as means at the nodes.";
        assert!(picture.caption.contains(words), "{}", picture.caption);
        assert!(picture.svg.contains("von Mises stress / Pa") && picture.svg.contains("x / m"));
    }

    #[test]
    fn a_few_extreme_values_do_not_rule_the_colours_and_the_caption_says_so() {
        // 20 by 10 squares of two triangles. Copies of one large triangle would each paint half of the picture.
        let node = |column: u32, row: u32| row * 21 + column;
        let nodes = (0..11).flat_map(|row| (0..21).map(move |column| [column, row, 0].map(f64::from)));
        let squares = (0..10).flat_map(|row| (0..20).map(move |column| (column, row)));
        let cells = squares.flat_map(|(x, y)| {
            let [a, b, c, d] = [node(x, y), node(x + 1, y), node(x + 1, y + 1), node(x, y + 1)];
            [a, b, c, a, c, d]
        });
        let mut snapshot = Snapshot { nodes: nodes.collect(), cells: cells.collect(), ..square(0.0) };
        snapshot.fields = BTreeMap::from([("displacement", vec![0.0; 3 * 21 * 11])]);
        let mut values: Vec<f64> = (0..400).map(|n| f64::from(n) / 399.0).collect();
        values[399] = 1e6;
        snapshot.fields.insert("von_mises", values);
        let picture = picture(&DrawnBody::new(&snapshot), &VON_MISES);
        let words = "from 0 to 1 × 10⁶ Pa in the cells, drawn as means at the nodes; colours from 0.010025 to 0.98997 Pa, the 1st to \
                     the 99th percentile.";
        assert!(picture.caption.contains(words), "{}", picture.caption);
    }
}
