//! Flow in nonuniform states. A bar between lubricated walls is stretched by `u_x = T(t) U(x)`, so that the strain is uniaxial and
//! the stress is not. A separate implementation of the flow law is integrated along this strain; polynomials through its stresses
//! define the loads. The solver must find the stresses at first order.

use super::manufactured::{VISCOSITY, elasticity, rule};
use super::run_on;
use super::scenes::{any_mesh, simulation, stir};
use clarke::fem::effect::VISCOPLASTIC;
use clarke::{
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
};
use std::f64::consts::PI;

const DENSITY: f64 = 1.5;
const END: f64 = 0.5;
const RELAXATION: f64 = 3.0;
const YIELD: f64 = 1.0;
const HARDENING: f64 = 2.0;
/// Friction coefficient and cohesion of the cone.
const CONE: (f64, f64) = (0.12, 0.55);
/// Nodes of the polynomials in place and in time.
const NODES: usize = 8;
/// Steps of the reference between two of its times.
const FINE: usize = 400;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Law {
    Perzyna { metric: &'static str, exponent: i32 },
    Hardening { metric: &'static str },
    DruckerPrager,
}

/// `T` and its first derivative.
fn time(t: f64) -> [f64; 2] {
    [1.0 + 0.8 * t + 0.3 * t * t, 0.8 + 0.6 * t]
}

/// `U'`.
fn slope(x: f64) -> f64 {
    0.25 + 0.2 * x
}

/// Principal stresses, of which the third counts where the strain is plane or the body is in space.
type Stress = [f64; 3];

struct Material {
    law: Law,
    /// Volumetric and shear factor.
    elasticity: (f64, f64),
    plane_stress: bool,
}

impl Material {
    fn elastic(&self, e: Stress) -> Stress {
        let (volumetric, shear) = self.elasticity;
        let kept = if self.plane_stress { 2 } else { 3 };
        let trace: f64 = e[..kept].iter().sum();
        std::array::from_fn(|i| if i < kept { volumetric * trace + shear * e[i] } else { 0.0 })
    }

    /// What the projection on the yield surface removes from a stress beyond it, and its von Mises norm.
    fn removed(&self, s: Stress, metric: &str, yield_stress: f64) -> (Stress, f64) {
        let norm = (0.5 * ((s[0] - s[1]).powi(2) + (s[1] - s[2]).powi(2) + (s[2] - s[0]).powi(2))).sqrt();
        assert!(norm > yield_stress, "all flows");
        if !self.plane_stress {
            let mean = (s[0] + s[1] + s[2]) / 3.0;
            return (s.map(|x| (1.0 - yield_stress / norm) * (x - mean)), norm);
        }
        let (volumetric, shear) = self.elasticity;
        let (p, q) = (0.5 * (s[0] + s[1]), 0.5 * (s[0] - s[1]));
        let (a, b) = match metric {
            "elasticity" => (1.0 / (shear + 2.0 * volumetric), 1.0 / shear),
            "compliance" => (shear + 2.0 * volumetric, shear),
            _ => (1.0, 1.0),
        };
        let at = |m: f64| (p / (1.0 + a * m), q / (1.0 + 3.0 * b * m));
        let (mut low, mut high) = (0.0, 1e6);
        for _ in 0..100 {
            let middle: f64 = 0.5 * (low + high);
            let (p, q) = at(middle);
            if p * p + 3.0 * q * q > yield_stress * yield_stress { low = middle } else { high = middle }
        }
        let (left, right) = at(low);
        ([p + q - left - right, p - q - left + right, 0.0], norm)
    }

    /// Rates of viscoplastic strain, and of the strain that hardens.
    fn flow(&self, s: Stress, hardened: f64) -> (Stress, f64) {
        let half = 0.5 / RELAXATION;
        match self.law {
            Law::Perzyna { metric, exponent } => {
                let (removed, norm) = self.removed(s, metric, YIELD);
                let factor = half * (norm / YIELD - 1.0).powi(exponent - 1);
                (removed.map(|x| factor * x), 0.0)
            }
            Law::Hardening { metric } => {
                let (removed, norm) = self.removed(s, metric, YIELD + HARDENING * hardened);
                let work: f64 = s.iter().zip(&removed).map(|(s, x)| s * x * half).sum();
                (removed.map(|x| half * x), work / norm)
            }
            Law::DruckerPrager => {
                let (alpha, cohesion) = CONE;
                let mean = (s[0] + s[1] + s[2]) / 3.0;
                let size = s.iter().map(|x| (x - mean).powi(2)).sum::<f64>().sqrt();
                let beyond = size / 2f64.sqrt() + alpha * mean - cohesion;
                let multiplier = beyond / (alpha * alpha / 3.0 + 0.5);
                assert!(beyond > 0.0 && multiplier / 2f64.sqrt() < size, "all flows on the cone's side");
                let away = |x: f64| alpha / 3.0 + (x - mean) / (size * 2f64.sqrt());
                (s.map(|x| half * multiplier * away(x)), 0.0)
            }
        }
    }

    /// Stresses at these times, ascending, where the strain is `T(t) slope`.
    fn history(&self, slope: f64, times: &[f64]) -> Vec<Stress> {
        let change = |t: f64, s: Stress, hardened: f64| {
            let (flow, growth) = self.flow(s, hardened);
            (self.elastic([slope * time(t)[1] - flow[0], -flow[1], -flow[2]]), growth)
        };
        let add = |s: Stress, h: f64, ds: Stress| -> Stress { std::array::from_fn(|i| s[i] + h * ds[i]) };
        let (mut t, mut s, mut p) = (0.0, self.elastic([slope * time(0.0)[0], 0.0, 0.0]), 0.0);
        let reach = |end: &f64| {
            let h = (end - t) / FINE as f64;
            for _ in 0..FINE {
                let (a, pa) = change(t, s, p);
                let (b, pb) = change(t + 0.5 * h, add(s, 0.5 * h, a), p + 0.5 * h * pa);
                let (c, pc) = change(t + 0.5 * h, add(s, 0.5 * h, b), p + 0.5 * h * pb);
                let (d, pd) = change(t + h, add(s, h, c), p + h * pc);
                s = std::array::from_fn(|i| s[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
                p += h / 6.0 * (pa + 2.0 * pb + 2.0 * pc + pd);
                t += h;
            }
            s
        };
        times.iter().map(reach).collect()
    }
}

/// Chebyshev's points between -1 and 1, ascending.
fn points() -> Vec<f64> {
    (0..NODES).map(|i| -((2 * i + 1) as f64 * PI / (2 * NODES) as f64).cos()).collect()
}

/// Coefficients of the polynomial through values at these points.
fn polynomial(points: &[f64], values: &[f64]) -> Vec<f64> {
    let mut differences = values.to_vec();
    for order in 1..points.len() {
        for i in (order..points.len()).rev() {
            differences[i] = (differences[i] - differences[i - 1]) / (points[i] - points[i - order]);
        }
    }
    let mut out = vec![0.0; points.len()];
    for (point, difference) in points.iter().zip(&differences).rev() {
        for i in (1..out.len()).rev() {
            out[i] = out[i - 1] - point * out[i];
        }
        out[0] = difference - point * out[0];
    }
    out
}

fn derivative(coefficients: &[f64]) -> Vec<f64> {
    coefficients.iter().enumerate().skip(1).map(|(i, c)| i as f64 * c).collect()
}

fn value(coefficients: &[f64], z: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * z + c)
}

/// By Horner's scheme.
fn text(coefficients: &[String], variable: &str) -> String {
    coefficients.iter().rev().fold("0".into(), |sum, c| format!("({c}+{variable}*{sum})"))
}

/// The job, and coefficients of the stresses at the end in `2 x - 1`.
fn job<const D: usize>(hypothesis: &str, law: Law, scheme: &str, step: f64) -> (String, [Vec<f64>; 3]) {
    let material =
        Material { law, elasticity: elasticity(hypothesis), plane_stress: hypothesis == "plane_stress" };
    let nodes = points();
    let times: Vec<f64> = nodes.iter().map(|z| 0.5 * END * (z + 1.0)).chain([END]).collect();
    let histories: Vec<Vec<Stress>> =
        nodes.iter().map(|z| material.history(slope(0.5 * (z + 1.0)), &times)).collect();
    let at_end = std::array::from_fn(|i| {
        polynomial(&nodes, &histories.iter().map(|history| history[NODES][i]).collect::<Vec<f64>>())
    });
    // Polynomials in place, one for each time, and of their coefficients in time.
    let in_place: Vec<Vec<f64>> = (0..NODES)
        .map(|j| polynomial(&nodes, &histories.iter().map(|history| history[j][0]).collect::<Vec<f64>>()))
        .collect();
    let along = |pick: &dyn Fn(&[f64]) -> Vec<f64>| -> String {
        let picked: Vec<Vec<f64>> = in_place.iter().map(|coefficients| pick(coefficients)).collect();
        let of_place = |i: usize| -> String {
            let values: Vec<f64> = picked.iter().map(|coefficients| coefficients[i]).collect();
            let of_time: Vec<String> =
                polynomial(&nodes, &values).iter().map(|c| format!("({c:e})")).collect();
            text(&of_time, &format!("(t*{}-1)", 2.0 / END))
        };
        text(&(0..picked[0].len()).map(of_place).collect::<Vec<_>>(), "(2*x-1)")
    };
    let viscous = VISCOSITY.0 + VISCOSITY.1;
    let shape = "(0.25*x+0.1*x*x)";
    let mut force = vec![format!(
        "{DENSITY}*0.6*{shape}-2*{}-{viscous}*(0.8+0.6*t)*0.2",
        along(&|coefficients| derivative(coefficients))
    )];
    let mut pull = vec![format!(
        "{}+{viscous}*(0.8+0.6*t)*{}",
        along(&|coefficients| vec![value(coefficients, 1.0)]),
        slope(1.0)
    )];
    let [mut displacement, mut velocity] =
        [shape.to_owned(), format!("0.8*{shape}")].map(|first| vec![first]);
    for field in [&mut force, &mut pull, &mut displacement, &mut velocity] {
        field.resize(D, "0".into());
    }
    let given = if D == 2 { format!("hypothesis = '{hypothesis}'\n") } else { String::new() };
    let viscoplasticity = match law {
        Law::Perzyna { metric, exponent } => format!(
            "perzyna]\nrelaxation = {RELAXATION}\nyield_stress = {YIELD}\nexponent = {exponent}\nmetric = '{metric}'"
        ),
        Law::Hardening { metric } => format!(
            "perzyna]\nrelaxation = {RELAXATION}\nyield_stress = {YIELD}\nhardening_modulus = {HARDENING}\nmetric = '{metric}'"
        ),
        Law::DruckerPrager => format!(
            "drucker_prager]\nrelaxation = {RELAXATION}\nfriction_coefficient = {}\ncohesion = {}",
            CONE.0, CONE.1
        ),
    };
    let walls: &[(&str, &str)] = if D == 2 {
        &[("'bottom', 'top'", "y")]
    } else {
        &[("'front', 'back'", "y"), ("'bottom', 'top'", "z")]
    };
    let walls: String =
        walls.iter().map(|(on, axis)| format!("[[support]]\non = [{on}]\nfix = ['{axis}']\n")).collect();
    let text = format!(
        "{}[time]\nend = {END}\nstep = {step}\nscheme = '{scheme}'\n[material]\n{given}density = {DENSITY}\n\
         elasticity = {{ youngs_modulus = 6.0, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = {}, shear = {} }}\n[material.viscoplasticity.{viscoplasticity}\n\
         [[support]]\non = ['left']\nfix = ['x']\n{walls}[[body_force]]\nvalue = {force:?}\n\
         [[traction]]\non = ['right']\nvalue = {pull:?}\n\
         [initial]\ndisplacement = {displacement:?}\nvelocity = {velocity:?}\n",
        any_mesh::<D>(),
        VISCOSITY.0,
        VISCOSITY.1
    );
    (text, at_end)
}

/// Errors of the total stress at the end: in L2, and of its mean over the body, which does not depend on the piecewise constant
/// approximation.
fn errors<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    (job, at_end): (String, [Vec<f64>; 3]),
) -> [f64; 2] {
    let mut run = simulation::<D, S>(session, &job, mesh);
    while run.advance(session).expect("step").is_some() {}
    assert!(run.totals.energy[VISCOPLASTIC] > 0.0 && run.totals.max_energy_imbalance < 1e-9);
    let stress = run.body.stress(&run.state).expect("stress");
    let (scale, normals) = if D == 2 { (2.0, if S == 3 { 2 } else { 3 }) } else { (6.0, 3) };
    let mut sums = [0.0; 4];
    for (number, cell) in run.body.geometry.iter().enumerate() {
        let nodes = run.body.mesh.cell(number);
        for (place, weight) in rule::<D>() {
            let weight = weight * cell.volume * scale;
            let share = |a: usize| if a == 0 { 1.0 - place.iter().sum::<f64>() } else { place[a - 1] };
            let x: f64 = (0..=D).map(|a| share(a) * run.body.mesh.nodes[nodes[a] as usize][0]).sum();
            let rate = time(END)[1] * slope(x);
            sums[3] += weight * stress[number][normals..].iter().map(|shear| shear * shear).sum::<f64>();
            for (i, coefficients) in at_end.iter().enumerate().take(normals) {
                let viscous = VISCOSITY.0 * rate + if i == 0 { VISCOSITY.1 * rate } else { 0.0 };
                let off = stress[number][i] - value(coefficients, 2.0 * x - 1.0) - viscous;
                sums[3] += weight * off * off;
                sums[i] += weight * off;
            }
        }
    }
    let [a, b, c, square] = session.sum(sums);
    [square.sqrt(), a.hypot(b).hypot(c)]
}

fn check<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    law: Law,
    mesh: impl Fn(usize) -> GlobalMesh<D>,
) {
    for scheme in ["lagged_euler", "implicit_euler"] {
        let [coarse, fine] = [4, 8].map(|n| {
            errors::<D, S>(session, &mesh(n), job::<D>(hypothesis, law, scheme, END / (4 * n) as f64))
        });
        let orders = [0, 1].map(|n| (coarse[n] / fine[n]).log2());
        let what = format!("{hypothesis} {D}D, {law:?}, {scheme}");
        let [in_l2, of_mean] = fine;
        println!("{what}: errors {in_l2:.2e}, {of_mean:.2e}, orders {orders:.3?} (in L2, of the mean)");
        assert!((0.85..1.2).contains(&orders[0]), "{what}: order in L2 {}", orders[0]);
    }
}

fn plane(session: &Session) {
    let mesh = |n: usize| {
        stir(rectangle([1.0, 1.0], [n, n], Diagonal::Alternating, [1.0; 2]).expect("mesh"), 0.1 / n as f64)
    };
    for metric in ["elasticity", "compliance", "frobenius"] {
        check::<2, 3>(session, "plane_stress", Law::Perzyna { metric, exponent: 1 }, mesh);
    }
    check::<2, 3>(session, "plane_stress", Law::Perzyna { metric: "compliance", exponent: 3 }, mesh);
    check::<2, 3>(session, "plane_stress", Law::Hardening { metric: "compliance" }, mesh);
    check::<2, 4>(session, "plane_strain", Law::Perzyna { metric: "elasticity", exponent: 2 }, mesh);
    check::<2, 3>(session, "plane_stress", Law::DruckerPrager, mesh);
    check::<2, 4>(session, "plane_strain", Law::DruckerPrager, mesh);
}

fn space(session: &Session) {
    let mesh = |n: usize| box_mesh([1.0; 3], [n; 3], [1.0; 3]).expect("mesh");
    check::<3, 6>(session, "", Law::Hardening { metric: "frobenius" }, mesh);
    check::<3, 6>(session, "", Law::DruckerPrager, mesh);
}

#[test]
fn polynomials_go_through_their_values() {
    let nodes = points();
    let of = |z: f64| (0.3 * z).exp();
    let found = polynomial(&nodes, &nodes.iter().map(|z| of(*z)).collect::<Vec<_>>());
    assert!((value(&found, 0.37) - of(0.37)).abs() < 1e-10);
    assert!((value(&derivative(&found), 0.37) - 0.3 * of(0.37)).abs() < 1e-8);
}

#[test]
fn flow_in_the_plane_is_found_with_first_order_in_stress() {
    run_on(&[2], |world| plane(&world.session));
}

#[test]
fn flow_in_space_is_found_with_first_order_in_stress() {
    run_on(&[2], |world| space(&world.session));
}
