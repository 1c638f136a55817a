//! In every step of random jobs, the energy balance holds and contact points lie on the graph of their law.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, noise, simulation};
use clarke::fem::effect::{CONTACT, DAMAGE, DEBONDING, ELASTIC, VISCOPLASTIC, VISCOUS, WORK};
use clarke::{
    fem::resultants::{Resultants, Source},
    io::output::history::Totals,
    linear_algebra::tensor::{larger, norm},
    mesh::GlobalMesh,
    parallel::session::Session,
};

const JOBS: u64 = 60;
/// Random jobs under each implicit scheme.
const IMPLICIT_JOBS: u64 = 50;
const STEPS: usize = 15;
/// Within the bound of the explicit parts of every job.
const STEP: f64 = 0.002;

/// Parameters of one job.
struct Draw(u64, u64);

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.1 += 1;
        low + (high - low) * 0.5 * (1.0 + noise(self.0 * 1000 + self.1))
    }

    fn one_of<'a>(&mut self, words: &[&'a str]) -> &'a str {
        words[(self.between(0.0, words.len() as f64) as usize).min(words.len() - 1)]
    }

    fn flip(&mut self) -> bool {
        self.between(0.0, 1.0) < 0.5
    }

    fn vector<const D: usize>(&mut self, size: f64) -> Vec<f64> {
        (0..D).map(|_| self.between(-size, size)).collect()
    }
}

/// A viscoplastic law.
fn viscoplasticity(draw: &mut Draw) -> String {
    let (relaxation, bound) = (draw.between(1.0, 10.0), draw.between(0.0, 0.5));
    let metric = draw.one_of(&["elasticity", "compliance", "frobenius"]);
    let perzyna = |bound: f64, more: &str| {
        format!(
            "perzyna = {{ relaxation = {relaxation}, yield_stress = {bound}, metric = \"{metric}\"{more} }}"
        )
    };
    let laws = ["linear", "power", "hardening", "maxwell", "creep", "drucker_prager"];
    // The last one most often.
    match laws[(draw.0 as usize % 7).min(5)] {
        "power" => perzyna(bound + 0.2, ", exponent = 1.5"),
        "hardening" => {
            let modulus = draw.between(0.5, 10.0);
            perzyna(bound, &format!(", hardening_modulus = {modulus}, kinematic_modulus = 3"))
        }
        "maxwell" => format!(
            "maxwell = {{ relaxation_time = {}, volumetric_relaxation_time = 0.3 }}",
            draw.between(0.05, 1.0)
        ),
        "creep" => format!(
            "norton = {{ rate = {}, reference_stress = 1, exponent = 2, hardening_strain = 0.1 }}",
            draw.between(0.001, 0.01)
        ),
        "drucker_prager" => format!(
            "drucker_prager = {{ relaxation = {relaxation}, friction_coefficient = {}, cohesion = {bound} }}",
            draw.between(0.1, 0.5)
        ),
        _ => perzyna(bound, ""),
    }
}

fn material(draw: &mut Draw, dynamic: bool, is_viscous: bool) -> String {
    let mut text = String::new();
    if dynamic {
        text += &format!("density = {}\n", draw.between(0.5, 5.0));
    }
    let elastic = draw.between(0.0, 1.0) < 0.8;
    if elastic {
        let (modulus, ratio) = (draw.between(5.0, 100.0), draw.between(0.0, 0.45));
        text += &format!("elasticity = {{ youngs_modulus = {modulus}, poisson_ratio = {ratio} }}\n");
    }
    if !dynamic || draw.flip() || is_viscous {
        let (volumetric, shear) = (draw.between(-0.3, 5.0), draw.between(2.0, 20.0));
        text += &format!("viscosity = {{ volumetric = {volumetric}, shear = {shear} }}\n");
    }
    if dynamic && elastic && draw.0.is_multiple_of(3) {
        text += "damping = { mass = 4, stiffness = 0.01 }\n";
    }
    if elastic && draw.between(0.0, 1.0) < 0.7 {
        text += &format!("viscoplasticity.{}\n", viscoplasticity(draw));
    }
    text
}

fn contact<const D: usize>(draw: &mut Draw) -> String {
    let laws = [
        "gauss",
        "damped",
        "graph",
        "jumps",
        "wall",
        "moving wall",
        "one way",
        "springs",
        "rigid plane",
        "springy sphere or shape",
    ];
    let law = laws[draw.0 as usize % laws.len()];
    let (friction, quadrature) = match law {
        "gauss" => ("none", "gauss"),
        _ => (draw.one_of(&["none", "tresca", "coulomb", "slip weakening"]), "nodal"),
    };
    let mut text = format!("[[contact]]\non = [\"bottom\"]\nquadrature = \"{quadrature}\"\n");
    let first = draw.between(0.01, 0.1);
    let fall = -draw.between(0.02, 0.2);
    let gap = draw.between(-0.001, 0.01);
    let high = draw.between(0.1, 0.5);
    text += &match law {
        "damped" => {
            let symmetry = draw.one_of(&["even", "odd", "one_sided"]);
            // Reflection turns an increase into a decrease.
            let rise = if symmetry == "even" { -fall } else { draw.between(0.1, 3.0) };
            if symmetry == "one_sided" && high < 0.3 {
                format!("[contact.normal.exponential_damper]\nlimit = {high}\nvelocity = {first}\n")
            } else {
                format!(
                    "[contact.normal.damped_response]\nbreakpoints = [{first}, {}]\nslopes = [{rise}, {fall}, {rise}]\n\
                     symmetry = \"{symmetry}\"\n",
                    2.0 * first
                )
            }
        }
        "graph" | "gauss" => format!(
            "[contact.normal.graph]\npoints = [[-{first}, 0], [{first}, {high}], [{}, {}]]\nslope_after = 1\n",
            3.0 * first,
            high + 2.0 * first * fall
        ),
        "jumps" => format!(
            "[contact.normal.graph]\npoints = [[-{first}, -1], [-{first}, 0], [0, 0], [0, {high}], [{first}, {}], \
             [{first}, 1]]\nslope_after = {fall}\n",
            high + first * fall
        ),
        "wall" => format!("[contact.normal.unilateral]\ngap = {gap}\n"),
        "moving wall" => format!("[contact.normal.unilateral]\ngap = \"{gap} - {high}*t + 0.01*x\"\n"),
        "rigid plane" => {
            let (point, normal, turn) = if D == 2 {
                ("\"0.5*t\", ", "0.1, 1", "")
            } else {
                ("\"0.5*t\", 0, ", "\"0.1+t\", 0.05, 1", "rotation = \"1+20*t\"\n")
            };
            format!(
                "[contact.normal.unilateral]\n[contact.obstacle.plane]\npoint = [{point}\"{high}*t-0.06\"]\nnormal = [{normal}]\n\
                 {turn}"
            )
        }
        "springy sphere or shape" => {
            let (centre, axis) = if D == 2 { ("0.5, ", "") } else { ("0.5, 0.4, ", "axis = [0, 1, 0.5]\n") };
            let (kind, surface) = if first < 0.055 {
                ("sphere", "radius = 0.5".to_owned())
            } else {
                ("shape", format!("distance = \"max(abs(x) - 0.3, {}) - 0.5\"", ["", "", "y", "z"][D]))
            };
            format!(
                "[contact.normal.compliance]\nstiffness = 300\nexponent = 1.5\ndamping = 2\n[contact.obstacle.{kind}]\n{surface}\n\
                 centre = [{centre}\"{high}*t-0.5\"]\nrotation = 4\n\
                 {axis}"
            )
        }
        "one way" => "[contact.normal.unilateral]\nbound = \"velocity\"\n".into(),
        _ => {
            let (stiffness, exponent) = (draw.between(10.0, 1000.0), draw.one_of(&["1", "1.5", "2"]));
            let damping = if exponent == "2" { 0.0 } else { high };
            format!(
                "[contact.normal.compliance]\nstiffness = {stiffness}\nexponent = {exponent}\ndamping = {damping}\ngap = \"{gap} - {high}*t\"\n"
            )
        }
    };
    let coefficient = draw.between(0.1, 0.6);
    text += &match friction {
        "none" => String::new(),
        "tresca" => format!("[contact.friction.tresca]\nbound = {coefficient}\n"),
        "coulomb" => format!("[contact.friction.coulomb]\ncoefficient = {coefficient}\n"),
        _ => format!(
            "[contact.friction.velocity_weakening]\nstatic = {}\ndynamic = {coefficient}\ndecay_velocity = {}\n",
            coefficient + 0.1,
            draw.between(0.5, 2.0)
        ),
    };
    text
}

fn job<const D: usize>(number: u64, hypothesis: &str, scheme: &str) -> String {
    let draw = &mut Draw(number, 0);
    let is_midpoint = scheme == "midpoint";
    let dynamic = draw.between(0.0, 1.0) < 0.7 || is_midpoint;
    let mut job = format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = {}\nstep = {STEP}\n",
        any_mesh::<D>(),
        STEP * STEPS as f64
    );
    job += "[solver]\ntolerance = 1e-13\n[material]\n";
    if D == 2 {
        job += &format!("hypothesis = \"{hypothesis}\"\n");
    }
    // Nothing else may resist where the boundary has no mass.
    job += &material(draw, dynamic, is_midpoint);
    let weak = &mut Draw(number + 5000, 0);
    if job.contains("elasticity") && !is_midpoint && weak.flip() {
        let (threshold, viscosity) = (weak.between(0.0, 2e-3), weak.between(1e-4, 2e-3));
        let (exponent, largest) = (weak.one_of(&["0", "1", "2.5"]), weak.between(0.3, 0.99));
        job += &format!(
            "damage = {{ threshold = {threshold}, viscosity = {viscosity}, exponent = {exponent}, largest = {largest} }}\n"
        );
    }
    if !dynamic || draw.flip() {
        job += "[[support]]\non = [\"left\"]\nfix = \"all\"\n";
    }
    if draw.flip() {
        job += &format!("[[traction]]\non = [\"top\", \"right\"]\nvalue = {:?}\n", draw.vector::<D>(5.0));
    }
    if !dynamic || draw.flip() {
        let size = draw.between(0.5, 5.0);
        let along: Vec<String> = (0..D).map(|i| format!("{size}*sin(7*t+{i})*x")).collect();
        job += &format!("[[body_force]]\nvalue = {along:?}\n");
    }
    if draw.between(0.0, 1.0) < 0.85 {
        let contact = contact::<D>(draw);
        let rubs_along_edges = D == 3 && contact.contains("friction");
        if is_midpoint {
            job += &contact.replacen("]]\n", "]]\nredistribute_mass = true\n", 1);
        } else if !rubs_along_edges
            && !contact.contains("gauss")
            && !contact.contains("gap")
            && !contact.contains("obstacle")
            && weak.between(0.0, 1.0) < 0.6
        {
            job += &contact.replacen("\"bottom\"", "\"bottom\", \"right\"", 1);
            let (stiffness, sliding) = (weak.between(10.0, 200.0), weak.between(0.0, 200.0));
            let (energy, viscosity) = (weak.between(0.0, 1e-4), weak.one_of(&["0", "1e-5", "1e-3"]));
            let length = weak.between(1e-3, 1e-2);
            job += &format!(
                "[contact.adhesion]\nstiffness = {stiffness}\ntangential_stiffness = {sliding}\nenergy = {energy}\n\
                 viscosity = {viscosity}\nlength = {length}\n"
            );
        } else {
            job += &contact;
            // Memory can be combined with laws without gap and friction that does not depend on the pressure, at nodes.
            let strange = ["gauss", "gap", "obstacle", "unilateral", "coulomb", "velocity_weakening"];
            if !strange.iter().any(|word| contact.contains(word)) {
                let (stiffness, time) = (weak.between(10.0, 200.0), weak.between(0.002, 0.5));
                job += &format!(
                    "[contact.memory]\nstiffness_rate = {}\ndecay_time = {time}\n",
                    stiffness / time
                );
            }
        }
    }
    let (speed, stretch) = (draw.between(0.1, 1.0), draw.between(-0.02, 0.02));
    let velocity: Vec<String> = (0..D).map(|i| format!("{speed}*cos(2*x+3*y+{i})")).collect();
    let displacement: Vec<String> = (0..D).map(|i| format!("{stretch}*{}", ["x", "y*x", "z"][i])).collect();
    job + &format!("[initial]\nvelocity = {velocity:?}\ndisplacement = {displacement:?}\n")
}

/// What forces and moments lack to the rate of momentum, relative to the sum of their magnitudes.
fn open_resultant<const D: usize>(resultants: &Resultants<D>) -> [f64; 2] {
    let (mut sums, mut sizes) = ([[0.0; 3]; 2], [0.0; 2]);
    for (source, (found, _)) in resultants.sources.iter().zip(resultants.rows()) {
        let sign = if *source == Source::Momentum { -1.0 } else { 1.0 };
        let force = std::array::from_fn(|i| found.force.get(i).copied().unwrap_or(0.0));
        for (at, vector) in [force, found.moment].iter().enumerate() {
            (0..3).for_each(|i| sums[at][i] += sign * vector[i]);
            sizes[at] += norm(vector);
        }
    }
    // In free flight only the rounding errors of the forces inside a body are left, which are 0.1 N to 10 N here.
    std::array::from_fn(|at| norm(&sums[at]) / larger(sizes[at], 0.1))
}

fn balanced<const D: usize, const S: usize>(
    session: &Session,
    number: u64,
    (hypothesis, scheme): (&str, &str),
    mesh: &GlobalMesh<D>,
) -> (Totals, String) {
    let text = job::<D>(number, hypothesis, scheme);
    let mut run = simulation::<D, S>(session, &text, mesh);
    let supports = super::scenes::supports(&text);
    let mut resultants = Resultants::new(session, &run.body, &run.state, &supports).expect("resultants");
    let mut steps = 0;
    while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")) {
        steps += 1;
        let (imbalance, inclusion) = (run.totals.energy_imbalance, outcome.inclusion_residual);
        assert!(
            imbalance < 1e-10,
            "step {steps}: energy imbalance {imbalance:e}\n{:?}\n{text}",
            outcome.energy
        );
        assert!(inclusion < 1e-6, "step {steps}: inclusion residual {inclusion:e}\n{text}");
        let motion = run.scheme.balanced_motion(&run.state);
        resultants
            .update(session, &run.body, &run.state, motion, run.scheme.load.as_ref())
            .expect("resultants of a step");
        let [open, turn] = open_resultant(&resultants);
        assert!(open < 1e-10 && turn < 1e-10, "step {steps}: forces {open:e}, moments {turn:e}\n{text}");
        assert!(outcome.energy[VISCOUS] >= 0.0);
        // Kinematic hardening gives energy back.
        assert!(outcome.energy[VISCOPLASTIC] >= 0.0 || text.contains("kinematic"));
        assert!(outcome.energy[DAMAGE] >= 0.0 && outcome.energy[DEBONDING] >= 0.0);
    }
    assert_eq!(steps, STEPS);
    assert!(run.totals.turnover > 1e-6, "something happens\n{text}");
    (run.totals, text)
}

/// The tables that must have occurred for each scheme.
const MET: [&str; 25] = [
    "plane_stress",
    "density",
    "viscosity",
    "metric = \"elasticity\"",
    "metric = \"compliance\"",
    "metric = \"frobenius\"",
    "exponent = 1.5 }",
    "hardening_modulus",
    "maxwell",
    "norton",
    "drucker_prager",
    "damped_response",
    "[contact.normal.graph]",
    "bound = \"velocity\"",
    "obstacle.plane",
    "obstacle.sphere",
    "obstacle.shape",
    "stiffness = ",
    "quadrature = \"gauss\"",
    "tresca",
    "coulomb",
    "velocity_weakening",
    // Not under the midpoint rule.
    "damage",
    "adhesion",
    "[contact.memory]",
];

fn assert_met(scheme: &str, jobs: &[String], words: &[&str]) {
    let count = |word: &str| jobs.iter().filter(|job| job.contains(word)).count();
    let rare: Vec<_> = words.iter().map(|word| (word, count(word))).filter(|(_, count)| *count < 2).collect();
    assert!(rare.is_empty(), "{scheme}: of {} jobs have {rare:?}", jobs.len());
}

fn random_jobs(session: &Session) {
    let (plane, space) = (crossed([4, 3]), brick([3, 2, 2]));
    let mut active = [0; 7];
    let run = |number: u64, scheme: &str| match number % 3 {
        0 => balanced::<2, 3>(session, number, ("plane_stress", scheme), &plane),
        1 => balanced::<2, 4>(session, number, ("plane_strain", scheme), &plane),
        _ => balanced::<3, 6>(session, number, ("", scheme), &space),
    };
    for scheme in ["implicit_euler", "bdf2"] {
        let jobs: Vec<String> = (0..IMPLICIT_JOBS).map(|number| run(number, scheme).1).collect();
        assert_met(scheme, &jobs, &MET);
    }
    let jobs: Vec<String> = (0..IMPLICIT_JOBS).map(|number| run(number, "midpoint").1).collect();
    assert_met("midpoint", &jobs, &MET[..MET.len() - 3]);
    let mut jobs = Vec::new();
    for number in 0..JOBS {
        let (totals, job) = run(number, "lagged_euler");
        jobs.push(job);
        let present = [
            totals.energy[ELASTIC],
            totals.energy[VISCOUS],
            totals.energy[VISCOPLASTIC],
            totals.energy[CONTACT],
            totals.energy[WORK],
            totals.energy[DAMAGE],
            totals.energy[DEBONDING],
        ];
        active.iter_mut().zip(present).for_each(|(count, energy)| *count += u64::from(energy != 0.0));
    }
    assert_met("lagged_euler", &jobs, &MET);
    let names = ["elastic", "viscous", "viscoplastic", "contact", "external", "damage", "adhesion"];
    for (count, what) in active.into_iter().zip(names) {
        let least = if what == "adhesion" { JOBS / 10 } else { JOBS / 5 };
        assert!((least..JOBS).contains(&count), "{what} energy in {count} of {JOBS} jobs");
    }
}

#[test]
fn energy_balances_and_contact_lies_on_its_graph_in_every_step_of_random_jobs() {
    run_on(&[1, 2], |world| random_jobs(&world.session));
}

/// A block without mass that its support carries along, without strain: all of its energies are rounding errors.
fn carried(session: &Session) {
    let elastic = "elasticity = { youngs_modulus = 100.0, poisson_ratio = 0.3 }";
    let viscous = "viscosity = { volumetric = 1.0, shear = 2.0 }";
    for (material, scheme) in [(elastic, "implicit_euler"), (elastic, "bdf2"), (viscous, "lagged_euler")] {
        let job = format!(
            "{}[material]\nhypothesis = \"plane_strain\"\n{material}\n\
             [time]\nend = 0.1\nstep = 0.01\nscheme = \"{scheme}\"\n\
             [[support]]\non = [\"left\"]\nfix = \"all\"\ndisplacement = [\"0.3*sin(20*t)\", \"0.1*t\"]\n",
            any_mesh::<2>()
        );
        let mut run = simulation::<2, 4>(session, &job, &crossed([4, 3]));
        while run.advance(session).expect("a step").is_some() {}
        let (worst, turnover) = (run.totals.max_energy_imbalance, run.totals.turnover);
        assert!(worst < 1e-9 && turnover < 1e-13, "{scheme}: {worst:e} of {turnover:e} J/m");
    }
}

#[test]
fn a_body_that_is_carried_along_has_balanced_energies() {
    run_on(&[1, 2, 3], |world| carried(&world.session));
}
