//! Scenes drawn at random.

use crate::verification::scenes::{noise, stir};
use clarke::mesh::{
    Boundary, GlobalMesh,
    generate::{Diagonal, box_mesh, rectangle},
};
use std::fmt::Write;

/// The frame in which a scene is written down.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// The angle by which it is rotated.
    pub angle: f64,
    /// How many of its units a metre, a kilogram and a second are.
    pub units: [f64; 3],
    /// Steps for each step of the scene.
    pub steps: u32,
}

impl Frame {
    pub const PLAIN: Self = Self { angle: 0.0, units: [1.0; 3], steps: 1 };
}

/// Exponents of metre, kilogram and second.
type Dimension = [f64; 3];
const ONE: Dimension = [0.0; 3];
const MOMENT: Dimension = [2.0, 1.0, -2.0];
const INERTIA: Dimension = [2.0, 1.0, 0.0];
const LENGTH: Dimension = [1.0, 0.0, 0.0];
const TIME: Dimension = [0.0, 0.0, 1.0];
const VELOCITY: Dimension = [1.0, 0.0, -1.0];
const ACCELERATION: Dimension = [1.0, 0.0, -2.0];
const FORCE: Dimension = [1.0, 1.0, -2.0];

/// A dimension multiplied by powers of length, mass and time.
fn times(dimension: Dimension, by: Dimension) -> Dimension {
    std::array::from_fn(|i| dimension[i] + by[i])
}

/// Steps of a scene, and their length in s.
pub const STEPS: u32 = 12;
pub const STEP: f64 = 0.003;
/// Names of probes with the first coordinate and all others in m: a corner, which waves from the left side may not have reached, and a
/// point beside that side.
pub const PROBES: [(&str, [f64; 2]); 2] = [("corner", [1.2, 0.9]), ("left", [0.2, 0.5])];
/// A time in s at which adaptive steps must end, and a kink of a load so shortly before it that a step is shorter than any certified.
const LANDING: f64 = 7.3 * STEP;
const KINK: f64 = LANDING - 1e-3 * STEP;

/// A scene that is drawn and written down.
pub struct Scene<const D: usize> {
    pub job: String,
    /// A job that goes on from the end of the first one for as long, in some scenes.
    pub second: Option<String>,
    /// Both in one, if their steps are the same.
    pub both: Option<String>,
    pub mesh: GlobalMesh<D>,
}

/// Whether the scene of this number is a body of revolution: those are not rotated.
pub fn is_revolved<const D: usize>(number: u64) -> bool {
    D == 2 && number % 7 == 3
}

struct Draw<const D: usize> {
    number: u64,
    count: u64,
    frame: Frame,
    text: String,
}

impl<const D: usize> Draw<D> {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.count += 1;
        low + (high - low) * 0.5 * (1.0 + noise(self.number * 100_003 + self.count))
    }

    /// Between two positive numbers, each decade as often.
    fn decades(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    fn chance(&mut self, share: f64) -> bool {
        self.between(0.0, 1.0) < share
    }

    fn one_of<'a>(&mut self, words: &[&'a str]) -> &'a str {
        words[(self.between(0.0, words.len() as f64) as usize).min(words.len() - 1)]
    }

    fn direction(&mut self) -> [f64; D] {
        std::array::from_fn(|_| self.between(-1.0, 1.0))
    }

    fn is_revolved(&self) -> bool {
        is_revolved::<D>(self.number)
    }

    /// In the plane densities are masses per area.
    fn dimensions(&self) -> f64 {
        if self.is_revolved() { 3.0 } else { D as f64 }
    }

    /// The dimension of pressures: in the plane forces are those of a metre of thickness, and stresses forces per length.
    fn pressure(&self) -> Dimension {
        [2.0 - self.dimensions(), 1.0, -2.0]
    }

    /// A number in the units of the frame.
    fn number(&self, value: f64, dimension: Dimension) -> f64 {
        value * (0..3).map(|i| self.frame.units[i].powf(dimension[i])).product::<f64>()
    }

    /// The components of a vector in the frame.
    fn turned(&self, vector: [f64; D]) -> [f64; D] {
        turned(self.frame.angle, vector)
    }

    /// A vector in the frame, as a list of numbers.
    fn vector(&self, vector: [f64; D], dimension: Dimension) -> String {
        format!("{:?}", self.turned(vector).map(|value| self.number(value, dimension)))
    }

    /// A vector that varies with the time: a list of expressions.
    fn varying(&self, vector: [f64; D], dimension: Dimension, factor: &str) -> String {
        let along = self.turned(vector).map(|value| self.number(value, dimension));
        format!("{:?}", along.map(|value| format!("{value:e}*({factor})")))
    }

    /// A point that moves with a constant velocity.
    fn moving(&self, point: [f64; D], velocity: [f64; D]) -> String {
        let (point, velocity) = (self.turned(point), self.turned(velocity));
        let words: [String; D] = std::array::from_fn(|i| {
            format!("{:e} + {:e}*t", self.number(point[i], LENGTH), self.number(velocity[i], VELOCITY))
        });
        format!("{words:?}")
    }

    /// A field that is linear in the coordinates: its value at the origin and its gradient.
    fn linear(&self, value: [f64; D], gradient: [[f64; D]; D], dimension: Dimension) -> String {
        let value = self.turned(value);
        // In the frame the gradient is `R G R^T`.
        let columns = gradient.map(|row| self.turned(row));
        let gradient: [[f64; D]; D] = {
            let by_column: [[f64; D]; D] =
                std::array::from_fn(|j| self.turned(std::array::from_fn(|i| columns[i][j])));
            std::array::from_fn(|i| std::array::from_fn(|j| by_column[j][i]))
        };
        let slope = times(dimension, [-1.0, 0.0, 0.0]);
        let words: [String; D] = std::array::from_fn(|i| {
            let mut word = format!("{:e}", self.number(value[i], dimension));
            for j in 0..D {
                let _ = write!(word, " + {:e}*{}", self.number(gradient[i][j], slope), ["x", "y", "z"][j]);
            }
            word
        });
        format!("{words:?}")
    }

    /// A smooth function of time without unit, between -1 and 1.
    fn factor(&mut self) -> String {
        let frequency = self.between(20.0, 60.0);
        let of_frame = self.number(frequency, [0.0, 0.0, -1.0]);
        match self.one_of(&["constant", "sine", "ramp"]) {
            "constant" => "1".into(),
            "sine" => format!("sin({of_frame:e}*t)"),
            _ => format!("min({of_frame:e}*t, 1)"),
        }
    }

    fn line(&mut self, line: impl AsRef<str>) {
        self.text += line.as_ref();
        self.text.push('\n');
    }

    fn key(&mut self, key: &str, value: f64, dimension: Dimension) {
        let value = self.number(value, dimension);
        self.line(format!("{key} = {value:e}"));
    }
}

/// A vector rotated by an angle: in the plane counterclockwise, in space about a slanted axis (Rodrigues).
pub fn turned<const D: usize>(angle: f64, vector: [f64; D]) -> [f64; D] {
    let (sine, cosine) = angle.sin_cos();
    if D == 2 {
        return std::array::from_fn(|i| match i {
            0 => cosine * vector[0] - sine * vector[1],
            _ => sine * vector[0] + cosine * vector[1],
        });
    }
    let axis = [1.0 / 3.0, -2.0 / 3.0, 2.0 / 3.0];
    let along: f64 = (0..D).map(|i| axis[i] * vector[i]).sum();
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let across = axis[j] * vector[k] - axis[k] * vector[j];
        cosine * vector[i] + sine * across + (1.0 - cosine) * along * axis[i]
    })
}

/// What a scene contains.
struct Content {
    scheme: &'static str,
    is_dynamic: bool,
    is_elastic: bool,
    is_viscous: bool,
    is_quadratic: bool,
    /// Whether adaptive steps leave the range of lengths for which they are certified.
    leaves_range: bool,
    /// Whether another body takes the place of obstacles.
    has_base: bool,
}

/// The scene of this number in a frame.
pub fn scene<const D: usize>(number: u64, frame: Frame) -> Scene<D> {
    let mut draw = Draw::<D> { number, count: 0, frame, text: String::new() };
    let scheme = match number % 8 {
        0 | 4 => "implicit_euler",
        1 | 5 | 7 => "bdf2",
        2 | 6 => "midpoint",
        _ => "lagged_euler",
    };
    let content = Content {
        scheme,
        is_dynamic: draw.chance(0.75) || scheme == "midpoint",
        is_elastic: draw.chance(0.9) || scheme == "midpoint",
        is_viscous: draw.chance(0.5),
        is_quadratic: draw.chance(0.3),
        leaves_range: false,
        has_base: number % 4 == 3,
    };
    let mesh = mesh::<D>(&mut draw, content.has_base);
    draw.line("[mesh]\nfile = \"mesh.msh\"");
    if content.is_quadratic {
        draw.line("order = 2");
    }
    let content = Content { leaves_range: time(&mut draw, &content), ..content };
    let mut hypothesis = draw.one_of(&["plane_stress", "plane_strain"]);
    if draw.is_revolved() {
        hypothesis = "axisymmetric";
    }
    draw.line("[material]");
    if D == 2 {
        draw.line(format!("hypothesis = \"{hypothesis}\""));
    }
    let is_viscous = material(&mut draw, &content, "material");
    let content = Content { is_viscous, ..content };
    if mesh.regions.len() > 1 {
        draw.line("[[region]]\nname = \"core\"\n[region.material]");
        material(&mut draw, &content, "region.material");
    }
    loads(&mut draw, &content);
    contacts(&mut draw, &content);
    for (name, [x, rest]) in PROBES {
        let mut point = [rest; D];
        point[0] = x + from_axis::<D>(number, content.has_base);
        let point = draw.vector(point, LENGTH);
        draw.line(format!("[[output.probe]]\nname = \"{name}\"\npoint = {point}"));
    }
    let half = draw.number(STEP * f64::from(STEPS / 2), TIME);
    draw.line(format!("[checkpoint]\nat = [{half:e}]"));
    let has_stages = draw.chance(0.12);
    let second = has_stages.then(|| second(&draw));
    let is_same = content.scheme == "implicit_euler" && !draw.text.contains("[time.adaptive]");
    let both = (has_stages && is_same).then(|| {
        let end = |steps: u32| format!("end = {:e}\n", draw.number(STEP * f64::from(steps), TIME));
        draw.text.replacen(&end(STEPS), &end(2 * STEPS), 1)
    });
    Scene { job: draw.text, second, both, mesh }
}

/// The job of a second stage: the same, with loads and motions that go on.
fn second<const D: usize>(draw: &Draw<D>) -> String {
    let before = draw.number(STEP * f64::from(STEPS), TIME);
    let job = draw.text.replace("*t", &format!("*(t + {before:e})"));
    let is_initial = |line: &&str| line.starts_with("[initial]") || line.starts_with("velocity = [\"");
    let lines: Vec<&str> = job.lines().filter(|line| !is_initial(line)).collect();
    format!("{}\n[initial]\nfrom = \"out/job\"\n", lines.join("\n"))
}

fn mesh<const D: usize>(draw: &mut Draw<D>, has_base: bool) -> GlobalMesh<D> {
    let diagonal = [Diagonal::Right, Diagonal::Left, Diagonal::Alternating, Diagonal::Crossed]
        [(draw.between(0.0, 4.0) as usize).min(3)];
    let has_core = draw.chance(0.2);
    let plane = || rectangle([1.2, 0.9], [4, 3], diagonal, [1.3, 0.8]).expect("mesh");
    let space = || box_mesh([1.2, 0.9, 0.9], [3, 2, 2], [1.2, 1.0, 0.9]).expect("mesh");
    // One of the two has the dimension.
    let mut mesh: GlobalMesh<D> = if D == 2 { same_dimension(plane()) } else { same_dimension(space()) };
    mesh = stir(mesh, 0.05);
    if has_core {
        mesh.regions = vec!["body".into(), "core".into()];
        mesh.cell_regions = (0..mesh.cells.len() / (D + 1)).map(|cell| u16::from(cell % 3 == 0)).collect();
    }
    if has_base {
        add_base(&mut mesh, diagonal);
    }
    let shift = from_axis::<D>(draw.number, has_base);
    mesh.nodes.iter_mut().for_each(|node| node[0] += shift);
    let (angle, metre) = (draw.frame.angle, draw.frame.units[0]);
    mesh.nodes.iter_mut().for_each(|node| *node = turned(angle, *node).map(|x| x * metre));
    mesh
}

/// Distance in m of a body of revolution from the axis, another body below reaches further; one in two scenes without it are solid.
fn from_axis<const D: usize>(number: u64, has_base: bool) -> f64 {
    match is_revolved::<D>(number) {
        true if has_base => 0.2,
        true if number.is_multiple_of(2) => 0.1,
        _ => 0.0,
    }
}

/// Distance in m of the body from another one below it.
const ABOVE_BASE: f64 = 0.003;

/// Adds a body below, whose mesh does not match and whose boundaries begin with `base_`.
fn add_base<const D: usize>(mesh: &mut GlobalMesh<D>, diagonal: Diagonal) {
    let plane = || rectangle([1.6, 0.5], [5, 2], diagonal, [1.0; 2]).expect("mesh");
    let space = || box_mesh([1.6, 1.2, 0.5], [3, 3, 1], [1.0; 3]).expect("mesh");
    let base: GlobalMesh<D> = if D == 2 { same_dimension(plane()) } else { same_dimension(space()) };
    let base = stir(base, 0.03);
    let [nodes, cells, facets] =
        [mesh.nodes.len(), mesh.cells.len() / (D + 1), mesh.facets.len()].map(|count| count as u32);
    let mut corner = [-0.15; D];
    (corner[0], corner[D - 1]) = (-0.2, -0.5 - ABOVE_BASE);
    mesh.nodes
        .extend(base.nodes.iter().map(|node| -> [f64; D] { std::array::from_fn(|i| node[i] + corner[i]) }));
    mesh.cells.extend(base.cells.iter().map(|node| node + nodes));
    mesh.cell_regions.extend(&base.cell_regions);
    mesh.facets.extend(base.facets.iter().map(|facet| facet.map(|node| node + nodes)));
    mesh.facet_cells.extend(base.facet_cells.iter().map(|cell| cell + cells));
    mesh.boundaries.extend(base.boundaries.into_iter().map(|boundary| Boundary {
        name: format!("base_{}", boundary.name),
        facets: boundary.facets.iter().map(|facet| facet + facets).collect(),
    }));
}

/// The same mesh, whose dimension the compiler does not know.
fn same_dimension<const A: usize, const D: usize>(mesh: GlobalMesh<A>) -> GlobalMesh<D> {
    assert_eq!(A, D);
    let node = |node: [f64; A]| std::array::from_fn(|i| node[i]);
    GlobalMesh {
        nodes: mesh.nodes.into_iter().map(node).collect(),
        cells: mesh.cells,
        curved: Vec::new(),
        is_second_order: mesh.is_second_order,
        cell_regions: mesh.cell_regions,
        regions: mesh.regions,
        facets: mesh.facets.into_iter().map(|facet| std::array::from_fn(|i| facet[i])).collect(),
        facet_cells: mesh.facet_cells,
        boundaries: mesh.boundaries,
        point_sets: mesh.point_sets,
        inner_groups: mesh.inner_groups,
        inner_facets: Vec::new(),
    }
}

/// The keys of the time; says whether adaptive steps leave their certified range.
fn time<const D: usize>(draw: &mut Draw<D>, content: &Content) -> bool {
    draw.line(format!("[time]\nscheme = \"{}\"", content.scheme));
    draw.key("end", STEP * f64::from(STEPS), TIME);
    let step = STEP / f64::from(draw.frame.steps);
    draw.key("step", step, TIME);
    let adapts = draw.chance(0.2) && content.scheme != "midpoint";
    let leaves_range = draw.chance(0.4) && adapts;
    if leaves_range {
        let landing = draw.number(LANDING, TIME);
        draw.line(format!("land_on = [{landing:e}]"));
    }
    // Convergence is tried with fixed steps.
    if adapts && draw.frame.steps == 1 {
        draw.line("[time.adaptive]");
        draw.key("smallest_step", STEP / 64.0, TIME);
        draw.key("largest_step", STEP, TIME);
    }
    leaves_range
}

/// The keys of a material; says whether it is viscous.
fn material<const D: usize>(draw: &mut Draw<D>, content: &Content, table: &str) -> bool {
    let pressure = draw.pressure();
    let viscosity = times(pressure, TIME);
    if content.is_dynamic {
        let density = draw.between(0.5, 3.0);
        let per_volume = [-draw.dimensions(), 1.0, 0.0];
        draw.key("density", density, per_volume);
    }
    if content.is_elastic {
        let (modulus, ratio) = (draw.between(20.0, 200.0), draw.between(0.0, 0.45));
        draw.line(format!("[{table}.elasticity]"));
        draw.key("youngs_modulus", modulus, pressure);
        draw.key("poisson_ratio", ratio, ONE);
    }
    let needs_viscosity = !content.is_elastic || content.scheme == "lagged_euler" && !content.is_dynamic;
    let is_viscous = content.is_viscous || needs_viscosity;
    if is_viscous {
        let (volumetric, shear) = (draw.between(-0.1, 2.0), draw.between(1.0, 5.0));
        if is_written(shear) {
            let (least, rate) = (draw.number(shear, viscosity), draw.number(5.0, TIME.map(|x| -x)));
            let power = if is_written(2.0 * shear) { "0.5" } else { "-0.4" };
            draw.line(format!("[{table}.viscosity.expression]"));
            draw.line(format!("shear = \"{least:e}*(0.01 + g/{rate:e})^({power})\""));
            draw.key("bulk", shear, viscosity);
            draw.key("reference_rate", 10.0, TIME.map(|x| -x));
        } else {
            draw.line(format!("[{table}.viscosity]"));
            draw.key("volumetric", volumetric, viscosity);
            draw.key("shear", shear, viscosity);
        }
        if content.is_elastic && content.is_dynamic {
            draw.line(format!("[{table}.damping]"));
            draw.key("mass", 2.0, TIME.map(|x| -x));
            draw.key("stiffness", 0.002, TIME);
        }
    }
    if content.is_elastic && draw.chance(0.4) {
        flow(draw, table);
    }
    let is_damaged = content.is_elastic && content.scheme != "midpoint" && draw.chance(0.15);
    if is_damaged && table == "material" {
        let (threshold, slowness) = (draw.between(1e-4, 2e-3), draw.between(1e-4, 2e-3));
        draw.line("[material.damage]");
        draw.key("threshold", threshold, pressure);
        draw.key("viscosity", slowness, viscosity);
    }
    is_viscous
}

fn flow<const D: usize>(draw: &mut Draw<D>, table: &str) {
    let pressure = draw.pressure();
    let viscosity = times(pressure, TIME);
    let law = draw.one_of(&["perzyna", "maxwell", "norton", "drucker_prager"]);
    let (relaxation, bound) = (draw.between(1.0, 10.0), draw.between(0.05, 0.5));
    if law == "norton" && is_written(bound) {
        let (rate, reference) = (draw.between(0.001, 0.02), draw.number(1.0, pressure));
        let rate = draw.number(rate, [0.0, 0.0, -1.0]);
        let hardening = if draw.chance(0.5) { "/(1 + e/0.1)" } else { "" };
        let formula = format!("{rate:e}*(q/{reference:e})^2{hardening}");
        return draw.line(format!(
            "[{table}.viscoplasticity.expression]\nrate = \"{formula}\"\nreference_stress = {reference:e}"
        ));
    }
    draw.line(format!("[{table}.viscoplasticity.{law}]"));
    match law {
        "perzyna" => {
            let metric = draw.one_of(&["elasticity", "compliance", "frobenius"]);
            draw.key("relaxation", relaxation, viscosity);
            draw.key("yield_stress", bound, pressure);
            match draw.one_of(&["perfect", "hardening", "power"]) {
                "hardening" => {
                    draw.key("hardening_modulus", 4.0, pressure);
                    draw.key("kinematic_modulus", 2.0, pressure);
                }
                "power" => draw.key("exponent", 1.5, ONE),
                _ => draw.line(format!("metric = \"{metric}\"")),
            }
        }
        "maxwell" => {
            let time = draw.between(0.05, 1.0);
            draw.key("relaxation_time", time, TIME);
            draw.key("volumetric_relaxation_time", 0.3, TIME);
        }
        "norton" => {
            let rate = draw.between(0.001, 0.02);
            draw.key("rate", rate, [0.0, 0.0, -1.0]);
            draw.key("reference_stress", 1.0, pressure);
            draw.key("exponent", 2.0, ONE);
            if draw.chance(0.5) {
                draw.key("hardening_strain", 0.1, ONE);
            }
        }
        _ => {
            let coefficient = draw.between(0.1, 0.5);
            draw.key("relaxation", relaxation, viscosity);
            draw.key("friction_coefficient", coefficient, ONE);
            draw.key("cohesion", bound, pressure);
        }
    }
}

fn loads<const D: usize>(draw: &mut Draw<D>, content: &Content) {
    let pressure = draw.pressure();
    let kind = draw.one_of(&["all", "all", "moved", "normal", "springs", "absorbing", "none", "none"]);
    let kind = match kind {
        "none" | "springs" if !content.is_dynamic => "all",
        "absorbing" if !content.is_dynamic || !content.is_elastic => "all",
        "moved" if content.scheme == "midpoint" => "all",
        kind => kind,
    };
    let kind = if kind == "normal" && !content.is_dynamic { "all" } else { kind };
    if kind != "none" {
        draw.line("[[support]]\non = [\"left\"]");
    }
    match kind {
        "all" => draw.line("fix = \"all\""),
        "normal" => draw.line("fix = \"normal\""),
        "moved" => {
            let direction = draw.direction();
            let way = draw.varying(direction.map(|x| 0.01 * x), LENGTH, "1");
            let frequency = draw.number(50.0, [0.0, 0.0, -1.0]);
            let way = way.replace("*(1)", &format!("*(1 - cos({frequency:e}*t))"));
            draw.line(format!("fix = \"all\"\ndisplacement = {way}"));
        }
        "springs" => {
            draw.line("[support.stiffness]");
            draw.key("normal", 100.0, times(pressure, [-1.0, 0.0, 0.0]));
            draw.key("tangential", 50.0, times(pressure, [-1.0, 0.0, 0.0]));
            draw.line("[support.damping]");
            draw.key("normal", 1.0, times(pressure, [-1.0, 0.0, 1.0]));
        }
        "absorbing" => draw.line("absorbing = true"),
        _ => {}
    }
    if content.has_base && (!content.is_dynamic || draw.chance(0.6)) {
        draw.line("[[support]]\non = [\"base_bottom\"]\nfix = \"all\"");
    }
    if draw.chance(0.5) {
        let (direction, factor) = (draw.direction(), draw.factor());
        let value = draw.varying(direction.map(|x| 3.0 * x), pressure, &factor);
        draw.line(format!("[[traction]]\non = [\"top\", \"right\"]\nvalue = {value}"));
    }
    if content.leaves_range {
        let (direction, rate) = (draw.direction(), draw.number(1.0 / KINK, [0.0, 0.0, -1.0]));
        let value = draw.varying(direction, pressure, &format!("min({rate:e}*t, 1)"));
        draw.line(format!("[[traction]]\non = [\"right\"]\nvalue = {value}"));
    }
    if draw.chance(0.25) {
        let factor = draw.factor();
        let value = draw.number(2.0, pressure);
        draw.line(format!("[[traction]]\non = [\"top\"]\npressure = \"{value:e}*({factor})\""));
    }
    if draw.chance(0.3) {
        let (direction, factor) = (draw.direction(), draw.factor());
        let value = draw.varying(direction.map(|x| 3.0 * x), times(pressure, [-1.0, 0.0, 0.0]), &factor);
        draw.line(format!("[[body_force]]\nvalue = {value}"));
    }
    if content.is_dynamic && draw.chance(0.5) {
        let mut down = [0.0; D];
        down[D - 1] = -9.81;
        let value = draw.vector(down, ACCELERATION);
        draw.line(format!("[gravity]\nacceleration = {value}"));
    }
    let mut velocity = draw.direction().map(|x| 0.5 * x);
    velocity[D - 1] -= 0.5;
    let mut gradient: [[f64; D]; D] = std::array::from_fn(|_| draw.direction().map(|x| 0.3 * x));
    if draw.is_revolved() {
        // The axis remains where it is.
        velocity[0] = 0.0;
        gradient[0][1] = 0.0;
    }
    // A held boundary does not move, and one that is moved starts from rest.
    let velocity = if kind == "all" || kind == "moved" || kind == "normal" {
        draw.linear(
            [0.0; D],
            gradient.map(|mut row| {
                row[1..].fill(0.0);
                row
            }),
            VELOCITY,
        )
    } else {
        draw.linear(velocity, gradient, VELOCITY)
    };
    if kind != "moved" && content.is_dynamic {
        draw.line(format!("[initial]\nvelocity = {velocity}"));
    }
}

/// What a normal law has.
#[derive(Clone, Copy, PartialEq)]
enum Normal {
    /// The pressure depends on the velocity.
    Rate,
    /// The pressure depends on a gap.
    Gap,
}

fn contacts<const D: usize>(draw: &mut Draw<D>, content: &Content) {
    if !draw.chance(0.9) {
        return;
    }
    draw.line("[[contact]]\non = [\"bottom\"]");
    if content.has_base {
        // Without the nodes that a support of the left side holds.
        let mut right = [0.0; D];
        right[0] = 1.0;
        let terms = draw.turned(right).into_iter().zip(["x", "y", "z"]).map(|(e, x)| format!("{e:e}*{x}"));
        let words = terms.collect::<Vec<_>>().join(" + ");
        let limit = draw.number(0.5, LENGTH);
        draw.line(format!("against = [\"base_top\"]\nwhere = \"{words} > {limit:e}\""));
    }
    let redistributes = content.is_dynamic
        && content.scheme != "lagged_euler"
        && !content.is_viscous
        && (content.scheme == "midpoint" || draw.chance(0.3));
    if redistributes || content.scheme == "midpoint" {
        draw.line("redistribute_mass = true");
    }
    let normal = normal_law(draw);
    let gap_of_obstacle = normal == Normal::Gap && draw.chance(0.6);
    if content.has_base {
        if gap_of_obstacle {
            let at = draw.text.rfind("against = ").expect("another body");
            draw.text.insert_str(at, "sliding = \"finite\"\n");
        }
    } else if gap_of_obstacle {
        obstacle(draw);
    } else if normal == Normal::Gap {
        let (gap, rate) = (draw.between(0.0, 0.004), draw.between(0.0, 0.3));
        let (gap, rate) = (draw.number(gap, LENGTH), draw.number(rate, VELOCITY));
        let key = format!("gap = \"{gap:e} - {rate:e}*t\"\n");
        let at = draw.text.rfind("[contact.normal.").expect("a normal law");
        let line = draw.text[at..].find('\n').expect("a line") + at + 1;
        draw.text.insert_str(line, &key);
    }
    // A moment acts against friction.
    let rubs = draw.chance(0.6) || draw.text.contains("\nmoment = ");
    if rubs {
        friction(draw);
    }
    let pressure = draw.pressure();
    let stiffness = times(pressure, [-1.0, 0.0, 0.0]);
    if rubs && normal == Normal::Gap && draw.chance(0.2) {
        let wear = draw.decades(1e-4, 1e-2);
        draw.line("[contact.wear]");
        draw.key("coefficient", wear, pressure.map(|x| -x));
    } else if !gap_of_obstacle && normal == Normal::Rate && content.scheme != "midpoint" && draw.chance(0.6) {
        let (normal, energy) = (draw.between(10.0, 200.0), draw.between(1e-5, 1e-3));
        let (is_cohesive, strength) = (draw.chance(0.6), draw.decades(0.05, 5.0));
        // Bonds soften from a thousandth of the body's length on, which it moves during the run.
        let (normal, energy) = if is_cohesive {
            (1e3 * strength, 0.5e-3 * strength * draw.between(1.1, 6.0))
        } else {
            (normal, energy)
        };
        draw.line("[contact.adhesion]");
        draw.key("stiffness", normal, stiffness);
        draw.key("tangential_stiffness", 0.5 * normal, stiffness);
        draw.key("energy", energy, times(pressure, LENGTH));
        if is_cohesive {
            draw.key("strength", strength, pressure);
        } else {
            let slowness = draw.decades(1e-5, 1e-3);
            draw.key("viscosity", slowness, times(pressure, [1.0, 0.0, 1.0]));
        }
    }
    if draw.chance(0.1) {
        draw.line("[solver]\nguesses = 2");
    }
}

fn normal_law<const D: usize>(draw: &mut Draw<D>) -> Normal {
    let pressure = draw.pressure();
    let damping = times(pressure, [-1.0, 0.0, 1.0]);
    let stiffness = times(pressure, [-1.0, 0.0, 0.0]);
    let (first, high, fall) = (draw.between(0.01, 0.1), draw.between(0.1, 0.5), draw.between(0.02, 0.2));
    let law = draw.one_of(&[
        "damped_response",
        "exponential_damper",
        "graph",
        "displacement_graph",
        "compliance",
        "unilateral",
        "unilateral",
        "one way",
    ]);
    if law == "one way" {
        draw.line("[contact.normal.unilateral]\nbound = \"velocity\"");
        return Normal::Rate;
    }
    let as_formula = is_written(first);
    if as_formula && let "exponential_damper" = law {
        let (limit, velocity) = (draw.number(high, pressure), draw.number(first, VELOCITY));
        let formula = format!("if(v < 0, 0, {limit:e}*(1 - exp(-v/{velocity:e})))");
        draw.line(format!("[contact.normal.expression]\npressure = \"{formula}\""));
        return Normal::Rate;
    }
    if as_formula && let "displacement_graph" = law {
        let numbers = [(0.003, 10.0 * high), (0.006, 12.0 * high)];
        let [(d, p), (e, q)] =
            numbers.map(|(at, value)| (draw.number(at, LENGTH), draw.number(value, pressure)));
        let slope = draw.number(500.0, stiffness);
        let last = format!("{q:e} + {slope:e}*(d - {e:e})");
        let formula = format!("if(d < {e:e}, interpolate(d, 0, 0, {d:e}, {p:e}, {e:e}, {q:e}), {last})");
        draw.line(format!("[contact.normal.expression]\npressure = \"{formula}\""));
        return Normal::Gap;
    }
    draw.line(format!("[contact.normal.{law}]"));
    let pair = |draw: &Draw<D>, of: f64, value: f64, dimension: Dimension| {
        format!("[{:e}, {:e}]", draw.number(of, dimension), draw.number(value, pressure))
    };
    match law {
        "damped_response" => {
            let symmetry = draw.one_of(&["odd", "one_sided"]);
            let (breakpoint, rise, fall) = (
                draw.number(first, VELOCITY),
                draw.number(high / first, damping),
                draw.number(-fall, damping),
            );
            draw.line(format!(
                "breakpoints = [{breakpoint:e}, {:e}]\nslopes = [{rise:e}, {fall:e}, {rise:e}]\nsymmetry = \"{symmetry}\"",
                2.0 * breakpoint
            ));
            Normal::Rate
        }
        "exponential_damper" => {
            draw.key("limit", high, pressure);
            draw.key("velocity", first, VELOCITY);
            Normal::Rate
        }
        "graph" => {
            let points = [
                pair(draw, -first, 0.0, VELOCITY),
                pair(draw, 0.0, 0.0, VELOCITY),
                pair(draw, 0.0, high, VELOCITY),
                pair(draw, first, high - fall * first, VELOCITY),
            ];
            draw.line(format!("points = [{}]", points.join(", ")));
            draw.key("slope_after", 1.0, damping);
            Normal::Rate
        }
        "displacement_graph" => {
            let points = [
                pair(draw, 0.0, 0.0, LENGTH),
                pair(draw, 0.003, 10.0 * high, LENGTH),
                pair(draw, 0.006, 12.0 * high, LENGTH),
            ];
            draw.line(format!("points = [{}]", points.join(", ")));
            draw.key("slope_after", 500.0, stiffness);
            Normal::Gap
        }
        "compliance" => {
            let exponent = [1.0, 1.5, 2.0][(draw.between(0.0, 3.0) as usize).min(2)];
            let value = draw.decades(100.0, 10_000.0);
            draw.key("stiffness", value, times(pressure, [-exponent, 0.0, 0.0]));
            draw.key("exponent", exponent, ONE);
            if exponent == 1.5 {
                draw.key("damping", high, damping);
            }
            Normal::Gap
        }
        _ => Normal::Gap,
    }
}

fn obstacle<const D: usize>(draw: &mut Draw<D>) {
    let (lift, approach) = (draw.between(0.003, 0.006), draw.between(0.0, 0.6));
    let mut velocity = draw.direction().map(|x| 0.5 * x);
    velocity[D - 1] = approach;
    let mut down = [0.0; D];
    down[D - 1] = -1.0;
    let kind = draw.one_of(&["plane", "sphere", "shape"]);
    let is_loaded = draw.chance(0.25);
    let is_turned = is_loaded && kind != "plane" && draw.chance(0.8) && !draw.is_revolved();
    if is_loaded {
        velocity = [0.0; D];
    }
    draw.line(format!("[contact.obstacle.{kind}]"));
    if kind == "plane" {
        let mut point = [0.5; D];
        point[D - 1] = -lift;
        let mut normal = draw.direction().map(|x| 0.002 * x);
        normal[D - 1] = 1.0;
        let (point, normal) = (draw.moving(point, velocity), draw.vector(normal, ONE));
        draw.line(format!("point = {point}\nnormal = {normal}"));
    } else {
        let radius = draw.between(0.4, 2.0);
        let mut centre = [0.5; D];
        centre[D - 1] = -radius - lift;
        let centre = draw.moving(centre, velocity);
        let radius = draw.number(radius, LENGTH);
        if kind == "sphere" {
            draw.line(format!("radius = {radius:e}"));
        } else {
            let squares = ["x^2 + y^2", "x^2 + y^2 + z^2"][D - 2];
            draw.line(format!("distance = \"sqrt({squares}) - {radius:e}\""));
        }
        draw.line(format!("centre = {centre}"));
        let rotates = draw.chance(0.4) && !is_turned && !draw.is_revolved();
        if rotates {
            draw.key("rotation", 3.0, [0.0, 0.0, -1.0]);
        }
        if (rotates || is_turned) && D == 3 {
            let axis = draw.vector(std::array::from_fn(|i| [0.2, 1.0, 0.1][i]), ONE);
            draw.line(format!("axis = {axis}"));
        }
    }
    if is_loaded {
        let direction = draw.vector(down.map(|x| -x), ONE);
        let (mass, force, factor) = (draw.between(0.1, 2.0), draw.between(0.0, 2.0), draw.factor());
        let force = draw.number(force, FORCE);
        draw.line(format!(
            "[contact.obstacle_load]\ndirection = {direction}\nforce = \"{force:e}*({factor})\""
        ));
        draw.key("mass", mass, [0.0, 1.0, 0.0]);
        draw.key("velocity", approach, VELOCITY);
        if is_turned {
            let (moment, inertia, factor) = (draw.between(-2.0, 2.0), draw.decades(0.01, 1.0), draw.factor());
            let moment = draw.number(moment, MOMENT);
            draw.line(format!("moment = \"{moment:e}*({factor})\""));
            draw.key("moment_of_inertia", inertia, INERTIA);
            draw.key("angular_velocity", 2.0, [0.0, 0.0, -1.0]);
        }
    }
}

/// Whether a law with this parameter is written as a formula: one in three.
fn is_written(parameter: f64) -> bool {
    ((parameter * 1e6) as u64).is_multiple_of(3)
}

fn friction<const D: usize>(draw: &mut Draw<D>) {
    let law = draw.one_of(&[
        "tresca",
        "coulomb",
        "coulomb",
        "velocity_weakening",
        "distance_weakening",
        "rate_and_state",
    ]);
    let (coefficient, more) = (draw.between(0.05, 0.5), draw.between(0.0, 0.2));
    let weakening = match law {
        "coulomb" => Some("0".to_owned()),
        "velocity_weakening" => Some(format!("exp(-v/{:e})", draw.number(0.5, VELOCITY))),
        "distance_weakening" => Some(format!("max(1 - l/{:e}, 0)", draw.number(0.002, LENGTH))),
        _ => None,
    };
    if let Some(weakening) = weakening.filter(|_| is_written(coefficient)) {
        let formula = format!("{coefficient:e} + {more:e}*{weakening}");
        return draw.line(format!("[contact.friction.expression]\ncoefficient = \"{formula}\""));
    }
    draw.line(format!("[contact.friction.{law}]"));
    match law {
        "tresca" => {
            let pressure = draw.pressure();
            draw.key("bound", coefficient, pressure);
        }
        "coulomb" => draw.key("coefficient", coefficient, ONE),
        "rate_and_state" => {
            draw.key("reference", coefficient + 0.2, ONE);
            draw.key("velocity", 0.01, VELOCITY);
            draw.key("direct", 0.01, ONE);
            draw.key("evolution", 0.01 + 0.02 * more, ONE);
            draw.key("distance", 0.002, LENGTH);
        }
        _ => {
            draw.key("static", coefficient + more, ONE);
            draw.key("dynamic", coefficient, ONE);
            match law {
                "velocity_weakening" => draw.key("decay_velocity", 0.5, VELOCITY),
                _ => draw.key("distance", 0.002, LENGTH),
            }
        }
    }
}

#[test]
fn the_scenes_of_a_test_have_every_feature() {
    let scenes: Vec<(String, bool)> = (0..60)
        .map(|number| {
            if number % 3 == 2 {
                let scene = scene::<3>(number, Frame::PLAIN);
                (scene.job, scene.second.is_some())
            } else {
                let scene = scene::<2>(number, Frame::PLAIN);
                (scene.job, scene.second.is_some())
            }
        })
        .collect();
    let with = |word: &str| (0..60).filter(|at| scenes[*at].0.contains(word)).collect::<Vec<usize>>();
    let stages: Vec<usize> = (0..60).filter(|at| scenes[*at].1).collect();
    let words = [
        "guesses",
        "contact.normal.expression",
        "contact.friction.expression",
        "\nmoment = ",
        "\nstrength = ",
        "land_on",
        "[time.adaptive]",
        "order = 2",
        "[[region]]",
        "finite",
        "axisymmetric",
    ];
    for (word, found) in words.into_iter().map(|word| (word, with(word))).chain([("a second stage", stages)])
    {
        println!("{word}: {found:?}");
        assert!(!found.is_empty(), "{word}");
    }
}
