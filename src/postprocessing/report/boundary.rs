//! Pictures of quantities along a boundary, at one time of its profile.

use super::{
    arc::along_curve,
    body::{Coloured, DrawnBody},
    chart::{Axis, Band, Chart, Look, Series},
    colour::{CIVIDIS, LINES, lightened},
    friction::{self, SlidingNode},
    law::Law,
    markup::{capital, table},
    page::Pictures,
    picture::Picture,
    scale::{extent, number},
    table::Table,
};
use crate::{
    error::Result,
    io::output::{
        columns::PROFILES,
        field_list::{self, CONTACT_STATUS, FIELDS},
        field_snapshot::Snapshot,
        fields::{Place, Shape},
        output_field::OutputField,
    },
    laws::{contact::FrictionLaw, expression::Scalar},
};
use std::collections::HashMap;

/// Number of bands in a chart above which none are drawn.
const MOST_BANDS: usize = 12;
/// Number of nodes above which the dots of a curve merge.
const MOST_DOTS: usize = 150;
/// Number of arrows above which they would hide each other.
const MOST_ARROWS: usize = 70;

/// A boundary at one time in `profiles.csv`.
pub(super) struct Boundary<'a> {
    /// Its name.
    pub name: &'a str,
    /// The time in s.
    pub time: f64,
    law: Option<&'a Law>,
    friction: Option<FrictionLaw>,
    table: Table,
    points: Vec<[f64; 3]>,
    arc: Vec<f64>,
    dimension: usize,
    behind: Option<BodyBehind<'a>>,
    /// Whether the laws act at each node.
    is_in_contact: Vec<bool>,
    /// The boundary, or the part of it on which its laws act, in words.
    place: String,
}

/// The body at the same time, with the numbers of the boundary's nodes and the outward normals there.
struct BodyBehind<'a> {
    snapshot: &'a Snapshot,
    nodes: Vec<usize>,
    normals: Vec<[f64; 3]>,
}

/// A quantity to be drawn.
struct Quantity<'a> {
    /// Its name in files.
    column: &'a str,
    /// Its name in words.
    name: &'a str,
    unit: &'a str,
}

/// The laws of a contact.
pub(super) struct Laws {
    /// Its boundaries.
    pub on: Vec<String>,
    /// The part of them on which it acts, if it is not all of them.
    pub part: Option<Scalar>,
    /// The normal law.
    pub normal: Law,
    /// The friction law.
    pub friction: Option<FrictionLaw>,
}

/// The nodes on which a law acts.
struct OnBranches {
    /// Their abscissa and pressure in the plane of the law's graph.
    nodes: Vec<[f64; 2]>,
    /// For each node of the boundary its branch, if the law acts on it.
    of_all: Vec<Option<usize>>,
}

impl<'a> Boundary<'a> {
    /// The rows of a profile at one time, and the body.
    pub(super) fn new(table: Table, name: &'a str, snapshot: Option<&'a Snapshot>) -> Self {
        let dimension = if table.header().iter().any(|column| column == "z") { 3 } else { 2 };
        let axes = ["x", "y", "z"].map(|axis| table.column(axis).unwrap_or_else(|| vec![0.0; table.len()]));
        let points: Vec<[f64; 3]> = (0..table.len()).map(|n| [0, 1, 2].map(|axis| axes[axis][n])).collect();
        let time = table.column("time").and_then(|times| times.last().copied()).unwrap_or(0.0);
        let is_in_contact = vec![true; points.len()];
        let mut boundary = Self {
            name,
            time,
            law: None,
            friction: None,
            table,
            points,
            arc: vec![],
            dimension,
            behind: None,
            is_in_contact,
            place: name.to_owned(),
        };
        if dimension == 2 {
            let (order, arc) = along_curve(&boundary.points);
            boundary.points = order.iter().map(|at| boundary.points[*at]).collect();
            (boundary.table, boundary.arc) = (boundary.table.select_rows(&order), arc);
        }
        if let Some(snapshot) = snapshot.filter(|snapshot| snapshot.time == time) {
            boundary.behind = boundary.nodes_of(snapshot).map(|nodes| {
                let normals = super::view::normals(snapshot, &nodes);
                BodyBehind { snapshot, nodes, normals }
            });
        }
        // The gap is empty at nodes without a contact.
        if let Some(gap) = boundary.table.column("gap") {
            boundary.is_in_contact = gap.iter().map(|gap| !gap.is_nan()).collect();
        }
        boundary
    }

    /// The nodes on which these laws act, and no others: of two contacts on one boundary, their common node follows neither law.
    pub(super) fn within(self, laws: &'a Laws, others: &[&Laws]) -> Self {
        let mut is_in_contact = self.is_in_contact.clone();
        let parts = std::iter::once((true, laws)).chain(others.iter().map(|other| (false, *other)));
        for (wanted, part) in parts {
            let inside = self.inside(part.part.as_ref());
            is_in_contact.iter_mut().zip(inside).for_each(|(is, inside)| *is &= inside == wanted);
        }
        let place = match &laws.part {
            Some(Scalar::Expression(part)) => format!("{} where {}", self.name, part.text()),
            _ => self.name.to_owned(),
        };
        Self { law: Some(&laws.normal), friction: laws.friction.clone(), is_in_contact, place, ..self }
    }

    /// Whether each node belongs to a facet of this part; without the body, whether the node itself does.
    fn inside(&self, part: Option<&Scalar>) -> Vec<bool> {
        let Some(part) = part else { return vec![true; self.points.len()] };
        let holds = |point: &[f64; 3]| part.evaluate(0.0, &point[..self.dimension]) != 0.0;
        let Some(BodyBehind { snapshot, nodes, .. }) = &self.behind else {
            return self.points.iter().map(holds).collect();
        };
        let places: HashMap<u32, usize> = (0..).zip(nodes).map(|(at, node)| (*node as u32, at)).collect();
        let mut inside = vec![false; self.points.len()];
        for (facet, _) in super::view::facets(snapshot) {
            let here: Vec<usize> = facet.iter().filter_map(|node| places.get(node).copied()).collect();
            let corner = |axis: usize| here.iter().map(|at| self.points[*at][axis]).sum::<f64>();
            let centre = std::array::from_fn(|axis| corner(axis) / facet.len() as f64);
            if here.len() == facet.len() && holds(&centre) {
                here.into_iter().for_each(|at| inside[at] = true);
            }
        }
        inside
    }

    /// The numbers of the boundary's nodes in the body, if all are found.
    fn nodes_of(&self, snapshot: &Snapshot) -> Option<Vec<usize>> {
        let bits = |p: &[f64; 3]| p.map(f64::to_bits);
        let nodes: HashMap<[u64; 3], usize> =
            snapshot.mesh_nodes().iter().enumerate().map(|(n, p)| (bits(p), n)).collect();
        self.points.iter().map(|p| nodes.get(&bits(p)).copied()).collect()
    }

    /// Quantities along the boundary, on its surface in 3D.
    pub(super) fn pictures(&self, snapshot: Option<&Snapshot>) -> Result<Pictures> {
        let columns: Vec<&str> =
            self.table.header().iter().filter(|name| is_quantity(name)).map(String::as_str).collect();
        let first = ["normal_velocity", "contact_pressure", "normal_displacement"];
        let rest = columns.iter().copied().filter(|name| !first.contains(name));
        let columns = first.into_iter().filter(|name| columns.contains(name)).chain(rest);
        let unit = |name| PROFILES.unit(name, self.dimension);
        let of_profile = columns.map(|name| (name, unit(name), self.table.column(name).unwrap_or_default()));
        let of_nodes = self.fields_of_nodes().into_iter();
        let of_nodes = of_nodes.map(|(name, values)| (name, field_list::unit(name, self.dimension), values));
        let mut out = Pictures::default();
        for (name, unit, values) in of_profile.chain(of_nodes) {
            let quantity = name.replace('_', " ");
            match extent(values.iter().copied()) {
                Some((low, high)) if number(low) == number(high) => {
                    out.constant.push(format!("{quantity}: {} {unit}", number(low)).trim_end().to_owned());
                }
                Some(range) => {
                    let mut picture = self.drawn(
                        Quantity { column: name, name: &quantity, unit },
                        &values,
                        range.into(),
                        snapshot,
                    )?;
                    if let (Some(picture), true) = (&mut picture, name == CONTACT_STATUS.name) {
                        picture.caption +=
                            " 1: open, 2: touching, without friction, 3: sticking, 4: sliding.";
                    }
                    out.pictures.extend(picture);
                }
                None => {}
            }
        }
        Ok(out)
    }

    /// Its nodes on the graphs of its laws.
    pub(super) fn graphs(&self) -> Result<Vec<Picture>> {
        Ok(self.on_law(&[])?.into_iter().chain(self.on_friction()?).collect())
    }

    /// Fields and histories with a number at each node that only nodes of contacts have, where the profile does not have them.
    fn fields_of_nodes(&self) -> Vec<(&str, Vec<f64>)> {
        let Some(BodyBehind { snapshot, nodes, .. }) = &self.behind else { return Vec::new() };
        let is_meant =
            |field: &&OutputField| field.place == Place::Node && matches!(field.shape, Shape::Scalar);
        let fields = FIELDS.iter().filter(is_meant);
        let fields = fields.filter_map(|field| Some((field.name, snapshot.values(field)?)));
        let histories = snapshot.histories.iter().filter(|history| history.place == Place::Node);
        let histories = histories.map(|history| (history.name.as_str(), history.values.as_slice()));
        let is_new = |(name, _): &(&str, &[f64])| !self.table.header().iter().any(|column| column == name);
        let here = |values: &[f64]| nodes.iter().map(|node| values[*node]).collect();
        fields.chain(histories).filter(is_new).map(|(name, values)| (name, here(values))).collect()
    }

    /// The number of nodes on each branch of the law, as a table.
    pub(super) fn branch_table(&self) -> String {
        let (Some(law), Some(OnBranches { of_all: on, .. })) = (self.law, self.on_branches()) else {
            return String::new();
        };
        let rows = law.branches().into_iter().enumerate().map(|(at, branch)| {
            let count = on.iter().filter(|other| **other == Some(at)).count();
            let where_ =
                extent(self.arc.iter().zip(&on).filter(|(_, other)| **other == Some(at)).map(|(s, _)| *s));
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
            self.place,
            number(self.time)
        );
        let mut header = vec!["branch", quantity, "slope", "nodes"];
        if self.dimension == 2 {
            header.push("arc length / m");
        }
        table(&words, &header, &rows.collect::<Vec<_>>())
    }

    /// Values at the nodes along the boundary. Nodes without a contact have no gap, and it is infinite where the normal meets no
    /// obstacle: such nodes are left out.
    fn drawn(
        &self,
        Quantity { column, name: quantity, unit }: Quantity<'_>,
        values: &[f64],
        [low, high]: [f64; 2],
        snapshot: Option<&Snapshot>,
    ) -> Result<Option<Picture>> {
        let name = format!("{}_{column}", self.name);
        if self.dimension == 3 {
            return self.map(&name, quantity, unit, values, snapshot);
        }
        let points = self.arc.iter().zip(values).filter(|(_, value)| value.is_finite());
        let points: Vec<[f64; 2]> = points.map(|(s, v)| [*s, *v]).collect();
        let place =
            ["normal_velocity", "contact_pressure"].iter().position(|known| *known == column).unwrap_or(2);
        let look = if points.len() > MOST_DOTS { Look::Line } else { Look::Dotted };
        let series = Series::new(place, "", look, points);
        let x = Axis::new("arc length", "m");
        let mut chart = Chart::new(x, Axis::new(quantity, unit), vec![series]);
        chart.bands = self.bands();
        let figures = format!("from {} to {} {unit}", number(low), number(high));
        let bands = if chart.bands.is_empty() { "" } else { " Background: branches of the contact law." };
        let picture = Picture::of_chart(
            chart,
            &name,
            format!("Chart of the {quantity} along {} at {} s, {figures}", self.name, number(self.time)),
            format!(
                "{} along {} at t = {} s, {figures}, over the arc length of the undeformed boundary{}.{bands}",
                capital(quantity),
                self.name,
                number(self.time),
                self.start()
            ),
        )?;
        Ok(Some(picture))
    }

    fn start(&self) -> String {
        let from = |p: &[f64; 3]| format!(" from ({}, {}) m", number(p[0]), number(p[1]));
        self.points.first().map(from).unwrap_or_default()
    }

    /// The quantity on the faces of the boundary, seen along the axis of their largest projection.
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
        let place = |p| places.get(&bits(p)).copied().filter(|n| values[*n as usize].is_finite());
        let here: Vec<Option<u32>> = snapshot.mesh_nodes().iter().map(place).collect();
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
        let body = DrawnBody::new(&flat).with_axes([axes[first], axes[second]]);
        let (low, high) = extent(values.iter().copied()).unwrap_or_default();
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

    /// The nodes in the plane of the law's graph, and the branch of each node on which the law acts.
    fn on_branches(&self) -> Option<OnBranches> {
        let law = self.law?;
        let column = |name: &str| self.table.column(name);
        let (v, p) = (column("normal_velocity")?, column("contact_pressure")?);
        let gap = if law.needs_gap() { column("gap")? } else { vec![0.0; v.len()] };
        let acts: Vec<usize> = (0..self.points.len()).filter(|n| self.is_in_contact[*n]).collect();
        let nodes: Vec<[f64; 2]> = acts.iter().map(|n| [law.abscissa(gap[*n], v[*n]), p[*n]]).collect();
        let mut on = vec![None; self.points.len()];
        for (n, branch) in acts.iter().zip(law.branches_of(&nodes, self.farthest())) {
            on[*n] = Some(branch);
        }
        (!nodes.is_empty()).then_some(OnBranches { nodes, of_all: on })
    }

    /// The largest coordinate of its nodes in m.
    fn farthest(&self) -> f64 {
        self.points.as_flattened().iter().fold(0.0, |most, x| x.abs().max(most))
    }

    /// The nodes in the plane of the law's graph: abscissa and pressure.
    pub(super) fn law_nodes(&self) -> Vec<[f64; 2]> {
        self.on_branches().map_or(Vec::new(), |on| on.nodes)
    }

    /// The nodes on the graph of the law, which also reaches these other nodes.
    pub(super) fn on_law(&self, others: &[[f64; 2]]) -> Result<Option<Picture>> {
        let (Some(law), Some(OnBranches { nodes, of_all: on })) = (self.law, self.on_branches()) else {
            return Ok(None);
        };
        let reached = [&nodes, others].concat();
        let line = Series { colour: [0x55; 3], ..Series::new(0, "", Look::Line, law.line(&reached)) };
        let mut series = vec![line];
        let mut counts = Vec::new();
        let on: Vec<usize> = on.into_iter().flatten().collect();
        let others_on = law.branches_of(others, self.farthest());
        for (at, branch) in law.branches().iter().enumerate() {
            let mine = nodes.iter().zip(&on).filter(|(_, other)| **other == at);
            let mine: Vec<[f64; 2]> = mine.map(|(node, _)| *node).collect();
            // A branch that any of the drawings needs is named in all of them, always with the same colour and marker.
            if !mine.is_empty() || others_on.contains(&at) {
                let plural = if mine.len() == 1 { "node" } else { "nodes" };
                let label = format!("{}: {} {plural}", branch.name, mine.len());
                counts.push(label.clone());
                series.push(Series::new(at, label, Look::Dots, mine));
            }
        }
        let (quantity, unit) = law.quantity();
        let y = Axis::new("contact pressure", "Pa");
        let chart = Chart::new(Axis::new(quantity, unit), y, series);
        let counted = counts.join(", ");
        let picture = Picture::of_chart(
            chart,
            &format!("{}_on_law", self.name),
            format!(
                "Nodes of {} on the graph of the contact law at {} s: {counted}",
                self.place,
                number(self.time)
            ),
            format!(
                "The contact law (grey) and the nodes of {} at t = {} s: {counted}.",
                self.place,
                number(self.time)
            ),
        )?;
        Ok(Some(picture))
    }

    /// The parts of the boundary on each branch; borders are half way between nodes.
    fn bands(&self) -> Vec<Band> {
        let (Some(law), Some(OnBranches { of_all: on, .. })) = (self.law, self.on_branches()) else {
            return Vec::new();
        };
        let names = law.branches();
        let mut bands: Vec<Band> = Vec::new();
        let mut at = 0;
        for same in on.chunk_by(|a, b| a == b) {
            let middle = |n: usize| 0.5 * (self.arc[n - 1] + self.arc[n]);
            let end = at + same.len();
            let from = if at == 0 { self.arc[0] } else { middle(at) };
            let to = if end == self.arc.len() { self.arc[end - 1] } else { middle(end) };
            if let Some(branch) = same[0] {
                let label = names.get(branch).map(|branch| branch.name.clone()).unwrap_or_default();
                bands.push(Band { span: [from, to], colour: lightened(LINES[branch % LINES.len()]), label });
            }
            at = end;
        }
        if bands.len() > MOST_BANDS || bands.len() < 2 { Vec::new() } else { bands }
    }

    /// The nodes on the graph of the friction law.
    fn on_friction(&self) -> Result<Option<Picture>> {
        let Some(law) = &self.friction else { return Ok(None) };
        let sizes = |vector: &str| -> Vec<f64> {
            let parts = ["x", "y", "z"].map(|axis| self.table.column(&format!("{vector}_{axis}")));
            let squares = |n: usize| parts.iter().flatten().map(|part| part[n] * part[n]).sum::<f64>();
            let has_any = parts.iter().any(Option::is_some);
            if has_any { (0..self.table.len()).map(|n| squares(n).sqrt()).collect() } else { Vec::new() }
        };
        let pressure = self.table.column("contact_pressure").unwrap_or_default();
        let (traction, speed) = (sizes("friction_traction"), sizes("sliding_velocity"));
        if traction.is_empty() || speed.is_empty() {
            return Ok(None);
        }
        let rubbing = pressure.into_iter().zip(traction).zip(speed).zip(&self.is_in_contact);
        let rubbing: Vec<SlidingNode> = rubbing
            .filter(|(_, is_in_contact)| **is_in_contact)
            .map(|(((pressure, traction), speed), _)| SlidingNode { speed, traction, pressure })
            .collect();
        friction::picture((self.name, &self.place), self.time, law, &rubbing)
    }

    /// The mean outward normal, if the normals have one.
    pub(super) fn direction(&self) -> Option<[f64; 3]> {
        super::view::mean_direction(&self.behind.as_ref()?.normals)
    }

    /// The deformed mesh of a 2D body with the boundary's normal velocity and contact pressure as arrows.
    pub(super) fn arrows(&self, body: &DrawnBody) -> Result<Vec<Picture>> {
        let Some(BodyBehind { nodes, normals, .. }) =
            self.behind.as_ref().filter(|behind| behind.nodes.len() > 1)
        else {
            return Ok(Vec::new());
        };
        if self.dimension != 2 {
            return Ok(Vec::new());
        }
        let feet: Vec<[f64; 2]> = nodes.iter().map(|node| body.place(*node)).collect();
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
            let unit = PROFILES.unit(column, self.dimension);
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
}

fn is_quantity(column: &str) -> bool {
    !PROFILES.is_key(column) && !["x", "y", "z"].contains(&column)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        job::{Contact, Quadrature, Side, Sliding},
        laws::{
            contact::{Compliance, NormalLaw},
            expression::Expression,
        },
    };

    fn laws(part: &str, stiffness: f64) -> Laws {
        let contact = Contact {
            on: vec!["bottom".into()],
            against: Vec::new(),
            side: Side::Auto,
            closed: false,
            sliding: Sliding::Small,
            part: Some(Scalar::Expression(Expression::parse(part).expect("expression"))),
            quadrature: Quadrature::Nodal,
            normal: NormalLaw::Compliance(Compliance { stiffness, exponent: 1.0, damping: 0.0, gap: None }),
            redistribute_mass: false,
            obstacle: None,
            obstacle_load: None,
            friction: None,
            friction_heat: None,
            wear: None,
            adhesion: None,
            memory: None,
        };
        let normal = Law::of(&contact).expect("law");
        Laws { on: contact.on, part: contact.part, normal, friction: None }
    }

    /// Five nodes: two on each of two springs, one on both.
    #[test]
    fn of_two_contacts_on_a_boundary_each_has_the_nodes_that_follow_its_law() {
        let text = "time,profile,x,y,normal_velocity,contact_pressure,gap\n1,bottom,0,0,0,10,-0.1\n1,bottom,0.25,0,0,10,-0.1\n\
                    1,bottom,0.5,0,0,55,-0.1\n1,bottom,0.75,0,0,100,-0.1\n1,bottom,1,0,0,0,\n";
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("profiles.csv");
        std::fs::write(&path, text).expect("written");
        let [soft, stiff] = [laws("x <= 0.5", 100.0), laws("x >= 0.5", 1000.0)];
        let table = || Table::read(&path, "profile").expect("table");
        let nodes = |one, other| Boundary::new(table(), "bottom", None).within(one, &[other]).law_nodes();
        assert_eq!(nodes(&soft, &stiff), [[0.1, 10.0], [0.1, 10.0]]);
        // The last node has no gap, because no contact acts there.
        assert_eq!(nodes(&stiff, &soft), [[0.1, 100.0]]);
        let part = Boundary::new(table(), "bottom", None).within(&soft, &[&stiff]);
        let words = part.branch_table();
        assert!(words.contains("Nodes of bottom where x &lt;= 0.5 on the branches"), "{words}");
    }
}
