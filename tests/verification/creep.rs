//! Uniaxial viscoplastic creep, with and without damage, against the recursion (24)-(25) for one homogeneous cell, with separate
//! projections.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
};

const PULL: f64 = 3.0;
const MODULUS: f64 = 100.0;
const RATIO: f64 = 0.3;
const VISCOSITY: (f64, f64) = (5.0, 20.0);
const RELAXATION: f64 = 3.0;
const YIELD: f64 = 1.0;
const STEP: f64 = 0.02;
const STEPS: usize = 60;
/// Threshold, viscosity and exponent of damage.
const DAMAGE: (f64, f64, i32) = (0.01, 0.02, 2);

/// Normal components of a homogeneous state: two in plane stress, else three.
type Diagonal3 = [f64; 3];

/// One cell; `kept` normal stresses exist, `free` of them are prescribed.
struct Cell {
    kept: usize,
    free: usize,
    elasticity: (f64, f64),
    metric: &'static str,
    strain: Diagonal3,
    history: Diagonal3,
    stress: Diagonal3,
    /// The factor `1 - d` of the stress, if there is damage.
    left: Option<f64>,
}

fn von_mises(s: Diagonal3) -> f64 {
    (0.5 * ((s[0] - s[1]).powi(2) + (s[1] - s[2]).powi(2) + (s[2] - s[0]).powi(2))).sqrt()
}

impl Cell {
    fn new(hypothesis: &str, metric: &'static str, damaged: bool) -> Self {
        let plane_stress = hypothesis == "plane_stress";
        let below = if plane_stress { 1.0 - RATIO } else { 1.0 - 2.0 * RATIO };
        let volumetric = MODULUS * RATIO / (1.0 + RATIO) / below;
        Self {
            kept: if plane_stress { 2 } else { 3 },
            free: if hypothesis.is_empty() { 3 } else { 2 },
            elasticity: (volumetric, MODULUS / (1.0 + RATIO)),
            metric,
            strain: [0.0; 3],
            history: [0.0; 3],
            stress: [0.0; 3],
            left: damaged.then_some(1.0),
        }
    }

    fn apply(&self, (volumetric, shear): (f64, f64), e: Diagonal3) -> Diagonal3 {
        let trace: f64 = e[..self.kept].iter().sum();
        std::array::from_fn(|i| if i < self.kept { volumetric * trace + shear * e[i] } else { 0.0 })
    }

    /// The closest stress inside the yield surface.
    fn project(&self, s: Diagonal3) -> Diagonal3 {
        let norm = von_mises(s);
        if norm <= YIELD {
            return s;
        }
        if self.kept == 3 {
            let mean = (s[0] + s[1] + s[2]) / 3.0;
            return s.map(|x| mean + (x - mean) * YIELD / norm);
        }
        // (I + m G P) t = s, with P the matrix of the von Mises norm and G the inverse of the metric.
        let (volumetric, shear) = self.elasticity;
        let (near, far) = (volumetric + shear, volumetric);
        let inverse = near * near - far * far;
        let (near, far) = match self.metric {
            "compliance" => (near, far),
            "elasticity" => (near / inverse, -far / inverse),
            _ => (1.0, 0.0),
        };
        let product = (near - 0.5 * far, far - 0.5 * near);
        let at = |m: f64| {
            let (a, b) = (1.0 + m * product.0, m * product.1);
            let determinant = a * a - b * b;
            [(a * s[0] - b * s[1]) / determinant, (a * s[1] - b * s[0]) / determinant, 0.0]
        };
        let (mut low, mut high) = (0.0, 1.0);
        while von_mises(at(high)) > YIELD {
            high *= 2.0;
        }
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if von_mises(at(middle)) > YIELD { low = middle } else { high = middle }
        }
        at(0.5 * (low + high))
    }

    /// The elastic energy per volume before the step.
    fn energy(&self) -> f64 {
        let elastic = self.apply(self.elasticity, self.strain);
        let s: Diagonal3 = std::array::from_fn(|i| elastic[i] + self.history[i]);
        let trace: f64 = s[..self.kept].iter().sum();
        let (volumetric, shear) = self.elasticity;
        let mean = volumetric * trace / (shear + self.kept as f64 * volumetric);
        s[..self.kept].iter().map(|x| 0.5 * x * (x - mean) / shear).sum()
    }

    /// A step of (24) and (25); returns the total stress.
    fn advance(&mut self) -> Diagonal3 {
        let excess = f64::max(self.energy() - DAMAGE.0, 0.0);
        if let Some(left) = &mut self.left {
            *left -= STEP * left.powi(DAMAGE.2) * excess / DAMAGE.1;
        }
        let left = self.left.unwrap_or(1.0);
        let projected = self.project(self.stress);
        let flow = std::array::from_fn(|i| (self.stress[i] - projected[i]) / (2.0 * RELAXATION));
        let release = self.apply(self.elasticity, flow);
        let elastic = self.apply(self.elasticity, self.strain);
        for i in 0..3 {
            self.history[i] -= STEP * release[i];
            self.stress[i] = elastic[i] + self.history[i];
        }
        let open: Vec<f64> =
            (0..self.free).map(|i| if i == 0 { PULL } else { 0.0 } - left * self.stress[i]).collect();
        let trace = open.iter().sum::<f64>() / (self.free as f64 * VISCOSITY.0 + VISCOSITY.1);
        let mut rate = [0.0; 3];
        for i in 0..self.free {
            rate[i] = (open[i] - VISCOSITY.0 * trace) / VISCOSITY.1;
            self.strain[i] += STEP * rate[i];
        }
        let viscous = self.apply(VISCOSITY, rate);
        std::array::from_fn(|i| viscous[i] + left * self.stress[i])
    }
}

fn creeping<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    metric: &'static str,
    damaged: bool,
    mesh: &GlobalMesh<D>,
) {
    let end = STEP * STEPS as f64;
    let mut job = format!(
        "{}[time]\nend = {end}\nstep = {STEP}\n[solver]\ntolerance = 1e-14\n[material]\n",
        any_mesh::<D>()
    );
    if D == 2 {
        job += &format!("hypothesis = \"{hypothesis}\"\n");
    }
    job += &format!(
        "elasticity = {{ youngs_modulus = {MODULUS}, poisson_ratio = {RATIO} }}\n\
         viscosity = {{ volumetric = {}, shear = {} }}\n\
         viscoplasticity.perzyna = {{ relaxation = {RELAXATION}, yield_stress = {YIELD}, metric = \"{metric}\" }}\n",
        VISCOSITY.0, VISCOSITY.1
    );
    if damaged {
        let (threshold, viscosity, exponent) = DAMAGE;
        job += &format!(
            "damage = {{ threshold = {threshold}, viscosity = {viscosity}, exponent = {exponent} }}\n"
        );
    }
    let sides = ["left", if D == 2 { "bottom" } else { "front" }, "bottom"];
    for (side, axis) in sides.iter().zip(["x", "y", "z"]).take(D) {
        job += &format!("[[support]]\non = [\"{side}\"]\nfix = [\"{axis}\"]\n");
    }
    let value: Vec<f64> = (0..D).map(|i| if i == 0 { PULL } else { 0.0 }).collect();
    job += &format!("[[traction]]\non = [\"right\"]\nvalue = {value:?}\n");

    let mut run = simulation::<D, S>(session, &job, mesh);
    let mut cell = Cell::new(hypothesis, metric, damaged);
    while run.advance(session).expect("step").is_some() {
        let total = cell.advance();
        let step = run.state.step;
        let displacement = run.state.displacement.local().expect("displacement");
        for (x, u) in run.body.mesh.nodes.iter().zip(displacement.chunks_exact(D)) {
            for i in 0..D {
                let error = (u[i] - cell.strain[i] * x[i]).abs();
                assert!(
                    error < 1e-12,
                    "{D}D {hypothesis} {metric}, step {step}: displacement is off by {error}"
                );
            }
        }
        for stress in run.body.stress(&run.state).expect("stress") {
            for c in 0..S {
                let expected = if c < cell.kept { total[c] } else { 0.0 };
                let error = (stress[c] - expected).abs();
                assert!(error < 1e-10, "{D}D {hypothesis} {metric}, step {step}: stress is off by {error}");
            }
        }
    }
    assert_eq!(run.state.step as usize, STEPS);
    assert!(cell.left.is_none_or(|left| (0.1..0.9).contains(&left)), "{:?}", cell.left);
    assert!(
        von_mises(cell.stress) > YIELD && cell.strain[0] > 1.5 * PULL / MODULUS,
        "it creeps: {:?}",
        cell.strain
    );
}

fn all(session: &Session) {
    let plane = rectangle([1.0, 1.0], [1, 1], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let space = box_mesh([1.0; 3], [1; 3], [1.0; 3]).expect("mesh");
    for metric in ["elasticity", "compliance", "frobenius"] {
        creeping::<2, 3>(session, "plane_stress", metric, false, &plane);
    }
    for damaged in [false, true] {
        creeping::<2, 4>(session, "plane_strain", "elasticity", damaged, &plane);
        creeping::<3, 6>(session, "", "compliance", damaged, &space);
    }
    creeping::<2, 3>(session, "plane_stress", "compliance", true, &plane);
}

#[test]
fn uniaxial_creep_follows_the_recursion_worked_out_for_one_cell() {
    run_on(&[1, 2], |world| all(&world.session));
}
