//! Pictures of what happens along a boundary, at the last time of its profile.

use super::{
    arc::along_curve,
    body::{Body, Coloured},
    chart::{Axis, Band, Chart, Look, Series},
    colour::{BANDS, CIVIDIS, Colour, LINES},
    law::Law,
    markup::table,
    picture::Picture,
    scale::{extent, number},
    table::Table,
};
use crate::{error::Result, output::field_snapshot::Snapshot};
use std::collections::HashMap;

/// Bands behind a chart beyond which they would only confuse.
const MOST_BANDS: usize = 12;
/// Nodes beyond which the dots of a curve merge.
const MOST_DOTS: usize = 150;
/// Arrows beyond which they would hide each other.
const MOST_ARROWS: usize = 70;

/// A boundary at the last time in `profiles.csv`.
pub struct Boundary<'a> {
    /// Its name.
    pub name: &'a str,
    /// When, in s.
    pub time: f64,
    law: Option<&'a Law>,
    table: Table,
    points: Vec<[f64; 3]>,
    arc: Vec<f64>,
    dimension: usize,
}

impl<'a> Boundary<'a> {
    /// The profile of this name, with the law that acts there.
    pub fn new(profiles: &Table, name: &'a str, law: Option<&'a Law>) -> Self {
        let table = profiles.of(name).last("time");
        let dimension = if table.header().iter().any(|column| column == "z") { 3 } else { 2 };
        let axes = ["x", "y", "z"].map(|axis| table.column(axis).unwrap_or_else(|| vec![0.0; table.len()]));
        let points: Vec<[f64; 3]> = (0..table.len()).map(|n| [0, 1, 2].map(|axis| axes[axis][n])).collect();
        let time = table.column("time").and_then(|times| times.last().copied()).unwrap_or(0.0);
        if dimension == 3 {
            return Self { name, time, law, table, points, arc: vec![], dimension };
        }
        let (order, arc) = along_curve(&points);
        let points = order.iter().map(|at| points[*at]).collect();
        Self { name, time, law, table: table.picked(&order), points, arc, dimension }
    }

    /// All pictures: quantities along the boundary (on its surface in space), and its nodes on the law.
    pub fn pictures(&self, snapshot: Option<&Snapshot>) -> Result<Vec<Picture>> {
        let mut out = Vec::new();
        let columns: Vec<&String> = self.table.header().iter().filter(|name| is_quantity(name)).collect();
        for column in ["normal_velocity", "contact_pressure", "normal_displacement"] {
            if columns.iter().any(|name| *name == column) {
                out.extend(self.quantity(column, snapshot)?);
            }
        }
        let first = ["normal_velocity", "contact_pressure", "normal_displacement"];
        for column in columns.into_iter().filter(|name| !first.contains(&name.as_str())) {
            out.extend(self.quantity(column, snapshot)?);
        }
        out.extend(self.on_law()?);
        Ok(out)
    }

    /// How many nodes sit on which part of the law, as a table.
    pub fn branch_table(&self) -> String {
        let (Some(law), Some((_, on))) = (self.law, self.on_branches()) else { return String::new() };
        let rows = law.branches().into_iter().enumerate().map(|(at, branch)| {
            let count = on.iter().filter(|other| **other == at).count();
            let where_ = extent(self.arc.iter().zip(&on).filter(|(_, other)| **other == at).map(|(s, _)| *s));
            let place = where_.map_or("–".into(), |(a, b)| format!("{} to {}", number(a), number(b)));
            let mut row = vec![branch.name, branch.range, branch.slope, count.to_string()];
            if self.dimension == 2 {
                row.push(place);
            }
            row
        });
        let quantity = law.quantity().0;
        let words = format!(
            "Nodes of {} on the branches of the contact law at t = {} s",
            self.name,
            number(self.time)
        );
        let mut header = vec!["branch", quantity, "slope", "nodes"];
        if self.dimension == 2 {
            header.push("arc length / m");
        }
        table(&words, &header, &rows.collect::<Vec<_>>())
    }

    fn quantity(&self, column: &str, snapshot: Option<&Snapshot>) -> Result<Option<Picture>> {
        let values = self.table.column(column).unwrap_or_default();
        let (quantity, unit) = (column.replace('_', " "), unit_of(column));
        let name = format!("{}_{column}", self.name);
        if self.dimension == 3 {
            return self.map(&name, &quantity, unit, &values, snapshot);
        }
        let points: Vec<[f64; 2]> = self.arc.iter().zip(&values).map(|(s, v)| [*s, *v]).collect();
        let place =
            ["normal_velocity", "contact_pressure"].iter().position(|known| *known == column).unwrap_or(2);
        let look = if points.len() > MOST_DOTS { Look::Line } else { Look::Dotted };
        let series = Series::new(place, "", look, points);
        let x = Axis { quantity: "arc length", unit: "m" };
        let mut chart = Chart::new(x, Axis { quantity: &quantity, unit }, vec![series]);
        chart.bands = self.bands();
        let (low, high) = extent(values.into_iter()).unwrap_or((0.0, 0.0));
        let figures = format!("from {} to {} {unit}", number(low), number(high));
        let bands = if chart.bands.is_empty() { "" } else { " Backgrounds: branches of the contact law." };
        Ok(Some(Picture::new(
            &name,
            format!("Chart of the {quantity} along {} at {} s, {figures}", self.name, number(self.time)),
            format!(
                "{} along {} at t = {} s, {figures}, over the arc length of the undeformed boundary{}.{bands}",
                capital(&quantity),
                self.name,
                number(self.time),
                self.start()
            ),
            chart.svg()?,
        )))
    }

    fn start(&self) -> String {
        let from = |p: &[f64; 3]| format!(" from ({}, {}) m", number(p[0]), number(p[1]));
        self.points.first().map(from).unwrap_or_default()
    }

    /// The quantity on the boundary's own faces, seen along the axis that shows most of them.
    fn map(
        &self,
        name: &str,
        quantity: &str,
        unit: &str,
        values: &[f64],
        snapshot: Option<&Snapshot>,
    ) -> Result<Option<Picture>> {
        let Some(snapshot) = snapshot else { return Ok(None) };
        let bits = |p: &[f64; 3]| p.map(f64::to_bits);
        let places: HashMap<[u64; 3], u32> = (0..).zip(&self.points).map(|(n, p)| (bits(p), n)).collect();
        let here: Vec<Option<u32>> = snapshot.nodes.iter().map(|p| places.get(&bits(p)).copied()).collect();
        let mut cells = Vec::new();
        for face in super::view::faces(snapshot) {
            if let [Some(a), Some(b), Some(c)] = face.nodes.map(|node| here[node as usize]) {
                cells.extend([a, b, c]);
            }
        }
        if cells.is_empty() {
            return Ok(None);
        }
        let along = super::view::widest_along(&self.points, &cells);
        let [first, second] = [[1, 2], [0, 2], [0, 1]][along];
        let nodes = self.points.iter().map(|p| [p[first], p[second], 0.0]).collect();
        let flat = Snapshot { time: self.time, nodes, cells, corners: 3, ..Snapshot::default() };
        let look = Coloured { name, quantity, unit, shades: CIVIDIS };
        let axes = ["x", "y", "z"];
        let body = Body::new(&flat).with_axes([axes[first], axes[second]]);
        let (low, high) = extent(values.iter().copied()).unwrap_or((0.0, 0.0));
        let figures = format!("from {} to {} {unit}", number(low), number(high));
        let mut picture = body.nodal(look, values)?;
        picture.alt = format!("Map of the {quantity} on {} at {} s, {figures}", self.name, number(self.time));
        picture.caption = format!(
            "{} on {} at t = {} s, {figures}, on the undeformed boundary seen along {}.",
            capital(quantity),
            self.name,
            number(self.time),
            axes[along]
        );
        Ok(Some(picture))
    }

    /// The nodes in the plane of the law, and the branch of each.
    fn on_branches(&self) -> Option<(Vec<[f64; 2]>, Vec<usize>)> {
        let law = self.law?;
        let column = |name: &str| self.table.column(name);
        let (u, v, p) =
            (column("normal_displacement")?, column("normal_velocity")?, column("contact_pressure")?);
        let node = |n: usize| [law.abscissa(self.time, &self.points[n], u[n], v[n]), p[n]];
        let nodes: Vec<[f64; 2]> = (0..self.points.len()).map(node).collect();
        let on = law.branches_of(&nodes);
        (!nodes.is_empty()).then_some((nodes, on))
    }

    fn on_law(&self) -> Result<Option<Picture>> {
        let (Some(law), Some((nodes, on))) = (self.law, self.on_branches()) else { return Ok(None) };
        let line = Series { colour: [0x55; 3], ..Series::new(0, "", Look::Line, law.line(&nodes)) };
        let mut series = vec![line];
        let mut counts = Vec::new();
        for (at, branch) in law.branches().iter().enumerate() {
            let mine = nodes.iter().zip(&on).filter(|(_, other)| **other == at);
            let mine: Vec<[f64; 2]> = mine.map(|(node, _)| *node).collect();
            if !mine.is_empty() {
                let plural = if mine.len() == 1 { "node" } else { "nodes" };
                let label = format!("{}: {} {plural}", branch.name, mine.len());
                counts.push(label.clone());
                let dots = Series::new(series.len(), label, Look::Dots, mine);
                series.push(Series { colour: branch_colour(at), ..dots });
            }
        }
        let (quantity, unit) = law.quantity();
        let y = Axis { quantity: "contact pressure", unit: "Pa" };
        let chart = Chart::new(Axis { quantity, unit }, y, series);
        let counted = counts.join(", ");
        Ok(Some(Picture::new(
            &format!("{}_on_law", self.name),
            format!(
                "Nodes of {} on the graph of the contact law at {} s: {counted}",
                self.name,
                number(self.time)
            ),
            format!(
                "The contact law (grey) and the nodes of {} at t = {} s: {counted}.",
                self.name,
                number(self.time)
            ),
            chart.svg()?,
        )))
    }

    /// Which parts of the boundary are on which branch; borders lie half way between nodes.
    fn bands(&self) -> Vec<Band> {
        let (Some(law), Some((_, on))) = (self.law, self.on_branches()) else { return Vec::new() };
        let names = law.branches();
        let mut bands: Vec<Band> = Vec::new();
        let mut at = 0;
        for same in on.chunk_by(|a, b| a == b) {
            let middle = |n: usize| 0.5 * (self.arc[n - 1] + self.arc[n]);
            let end = at + same.len();
            let from = if at == 0 { self.arc[0] } else { middle(at) };
            let to = if end == self.arc.len() { self.arc[end - 1] } else { middle(end) };
            let name = names.get(same[0]).map(|branch| branch.name.clone()).unwrap_or_default();
            bands.push(Band { span: [from, to], colour: BANDS[same[0] % BANDS.len()], label: name });
            at = end;
        }
        if bands.len() > MOST_BANDS || bands.len() < 2 { Vec::new() } else { bands }
    }

    /// The deformed mesh of a plane body with the boundary's normal velocity and contact pressure as arrows.
    pub fn arrows(&self, body: &Body, snapshot: &Snapshot) -> Result<Vec<Picture>> {
        if self.dimension != 2 || snapshot.time != self.time {
            return Ok(Vec::new());
        }
        let bits = |p: &[f64; 3]| p.map(f64::to_bits);
        let nodes: HashMap<[u64; 3], usize> =
            snapshot.nodes.iter().enumerate().map(|(n, p)| (bits(p), n)).collect();
        let found: Vec<usize> = self.points.iter().filter_map(|p| nodes.get(&bits(p)).copied()).collect();
        if found.len() != self.points.len() || found.len() < 2 {
            return Ok(Vec::new());
        }
        let feet: Vec<[f64; 2]> = found.iter().map(|node| body.place(*node)).collect();
        let normals = self.outward(snapshot, &found);
        let mut out = Vec::new();
        for (column, words, colour, inward) in [
            ("normal_velocity", "normal velocity", LINES[0], false),
            ("contact_pressure", "contact pressure", LINES[1], true),
        ] {
            let values = self.table.column(column).unwrap_or_default();
            let largest = values.iter().fold(0.0, |m, v| f64::max(m, v.abs()));
            if largest == 0.0 || values.len() != feet.len() {
                continue;
            }
            let longest = 0.2 * body.size();
            let arrow = |n: usize| {
                let length = longest * values[n] / largest;
                let tip = [0, 1].map(|i| feet[n][i] + length.abs() * normals[n][i]);
                if (length < 0.0) != inward { [tip, feet[n]] } else { [feet[n], tip] }
            };
            let arrows: Vec<[[f64; 2]; 2]> =
                (0..feet.len()).step_by(feet.len().div_ceil(MOST_ARROWS)).map(arrow).collect();
            let unit = unit_of(column);
            let heading = format!("longest arrow {} {unit}, {}", number(largest), body.magnified());
            let time = number(self.time);
            out.push(Picture::new(
                &format!("{}_{column}_arrows", self.name),
                format!("Deformed mesh with the {words} on {} as arrows at {time} s", self.name),
                format!(
                    "Deformed mesh ({}) with the {words} on {} at t = {time} s; the longest arrow is {} {unit}.",
                    body.magnified(),
                    self.name,
                    number(largest)
                ),
                body.arrows(&heading, colour, &arrows)?,
            ));
        }
        Ok(out)
    }

    /// Unit normals out of the body at the boundary's nodes, from their neighbours along it and the cells behind.
    fn outward(&self, snapshot: &Snapshot, nodes: &[usize]) -> Vec<[f64; 2]> {
        let mut behind: HashMap<usize, [f64; 3]> = nodes.iter().map(|node| (*node, [0.0; 3])).collect();
        for cell in snapshot.cells() {
            for corner in cell {
                let Some(sum) = behind.get_mut(&(*corner as usize)) else { continue };
                for other in cell {
                    let [x, y, _] = snapshot.nodes[*other as usize];
                    *sum = [sum[0] + x, sum[1] + y, sum[2] + 1.0];
                }
            }
        }
        let last = nodes.len() - 1;
        let normal = |n: usize| {
            let (before, after) = (self.points[n.saturating_sub(1)], self.points[(n + 1).min(last)]);
            let along = [after[0] - before[0], after[1] - before[1]];
            let size = along[0].hypot(along[1]);
            let [x, y, _] = self.points[n];
            let [a, b, count] = behind[&nodes[n]];
            let normal = [along[1] / size, -along[0] / size];
            let inside = (a / count - x) * normal[0] + (b / count - y) * normal[1];
            if inside > 0.0 { normal.map(|c| -c) } else { normal }
        };
        (0..nodes.len()).map(normal).collect()
    }
}

/// The colour of a branch's nodes, that of its background in strong.
fn branch_colour(branch: usize) -> Colour {
    [LINES[0], LINES[1], LINES[6]][branch % BANDS.len()]
}

fn is_quantity(column: &str) -> bool {
    !["time", "profile", "x", "y", "z"].contains(&column)
}

/// The unit of a column, by its name.
pub fn unit_of(column: &str) -> &'static str {
    let known =
        [("displacement", "m"), ("velocity", "m/s"), ("pressure", "Pa"), ("traction", "Pa"), ("gap", "m")];
    known.iter().find(|(word, _)| column.contains(word)).map_or("", |(_, unit)| unit)
}

/// With a capital letter in front.
pub fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}
