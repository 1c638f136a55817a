//! The same problem in other units has the same results.

use super::family;
use crate::{case::Case, results::Results};
use clarke::linear_algebra::tensor::larger;
use toml::Value;

/// The values of 1 Pa, 1 m and 1 s in the units of a job.
#[derive(Clone, Copy, Debug)]
struct Units {
    stress: f64,
    length: f64,
    time: f64,
}

/// SI to mm, MPa, tonne and second.
const MILLIMETRES: Units = Units { stress: 1e-6, length: 1e3, time: 1.0 };
/// Young's modulus, the side and the time of a wave across it are 1.
const NONDIMENSIONAL: Units = Units { stress: 1e-3, length: 1.0, time: 31.622776601683793 };

/// Keys of the job, with the exponents of stress, length and time in their units.
const KEYS: [(&str, [i32; 3]); 16] = [
    ("mesh.rectangle.size", [0, 1, 0]),
    ("material.density", [1, -2, 2]),
    ("material.elasticity.youngs_modulus", [1, 0, 0]),
    ("material.viscosity.volumetric", [1, 0, 1]),
    ("material.viscosity.shear", [1, 0, 1]),
    ("material.viscoplasticity.perzyna.relaxation", [1, 0, 1]),
    ("material.viscoplasticity.perzyna.yield_stress", [1, 0, 0]),
    ("traction.0.value", [1, 0, 0]),
    ("contact.0.normal.damped_response.breakpoints", [0, 1, -1]),
    ("contact.0.normal.damped_response.slopes", [1, -1, 1]),
    ("contact.0.normal.unilateral.gap", [0, 1, 0]),
    ("contact.0.normal.compliance.stiffness", [1, -1, 0]),
    ("output.probe.0.point", [0, 1, 0]),
    ("output.probe.1.point", [0, 1, 0]),
    ("time.end", [0, 0, 1]),
    ("time.step", [0, 0, 1]),
];

impl Units {
    fn factor(&self, powers: [i32; 3]) -> f64 {
        self.stress.powi(powers[0]) * self.length.powi(powers[1]) * self.time.powi(powers[2])
    }

    /// The job in these units.
    fn put(&self, job: &Value, case: Case) -> Case {
        KEYS.iter().fold(case, |case, (key, powers)| {
            let found = key.split('.').try_fold(job, |node, part| match part.parse::<usize>() {
                Ok(position) => node.as_array()?.get(position),
                Err(_) => node.get(part),
            });
            let scaled = |value: &Value| {
                let number = value.as_float().or(value.as_integer().map(|n| n as f64)).expect("a number");
                format!("{:e}", number * self.factor(*powers))
            };
            match found {
                Some(Value::Array(numbers)) => {
                    let numbers: Vec<String> = numbers.iter().map(scaled).collect();
                    case.set(key, &format!("[{}]", numbers.join(", ")))
                }
                Some(number) => case.set(key, &scaled(number)),
                None => case,
            }
        })
    }
}

/// Jobs of the same square: the paper's; on a rigid obstacle with friction; on springs under the implicit scheme.
fn job(kind: &str) -> Case {
    let square = Case::square(8)
        .set("output.probe", "[{ name = 'tip', point = [1, 0] }, { name = 'in', point = [0.37, 0.61] }]");
    match kind {
        "damped" => square,
        "obstacle" => square
            .set("contact.0.normal", "{ unilateral = { gap = 0.002 } }")
            .set("contact.0.friction", "{ coulomb = { coefficient = 0.3 } }")
            .set("time.scheme", "'implicit_euler'"),
        _ => square
            .set("contact.0.normal", "{ compliance = { stiffness = 1000.0 } }")
            .set("time.scheme", "'bdf2'"),
    }
}

/// Largest difference of a column after division by its conversion factor, relative to its largest number.
fn off(one: &Results, other: &Results, table: &str, column: &str, factor: f64) -> f64 {
    let (one, other) = (one.table(table).numbers(column), other.table(table).numbers(column));
    assert_eq!(one.len(), other.len());
    let scale = one.iter().fold(0.0, |most, x| larger(most, x.abs()));
    let off = one.iter().zip(&other).map(|(a, b)| (a - b / factor).abs()).fold(0.0, larger);
    if off == 0.0 { 0.0 } else { off / scale }
}

fn assert_same(kind: &str, units: Units) {
    let si = job(kind).run_and_keep(1);
    let text = std::fs::read_to_string(si.written()).expect("job");
    let written = Value::Table(text.parse().expect("TOML"));
    let other = units.put(&written, job(kind)).run_and_keep(1);
    let (a, b) = (si.results(), other.results());
    let (velocity, energy) = (units.factor([0, 1, -1]), units.factor([1, 2, 0]));
    let mut worst = 0.0f64;
    for (table, column, factor) in [
        ("probes.csv", "displacement_x", units.length),
        ("probes.csv", "displacement_y", units.length),
        ("probes.csv", "velocity_x", velocity),
        ("probes.csv", "velocity_y", velocity),
        ("history.csv", "kinetic_energy", energy),
        ("history.csv", "elastic_energy", energy),
        ("history.csv", "viscous_dissipation", energy),
        ("history.csv", "external_work", energy),
    ] {
        let off = off(&a, &b, table, column, factor);
        worst = larger(worst, off);
        assert!(off < 1e-9, "{kind} in {units:?}: {column} is {off:e} off");
    }
    let stress = |results: &Results| results.number("final_von_mises");
    super::assert_close(stress(&b) / units.stress, stress(&a), 1e-9, &format!("{kind} in {units:?}"));
    println!("{kind} in {units:?}: {worst:.1e} off");
}

#[test]
fn a_job_in_other_units_has_the_same_digits() {
    let kinds = ["damped", "obstacle", "springs"];
    let all = kinds.iter().flat_map(|kind| [MILLIMETRES, NONDIMENSIONAL].map(|units| (*kind, units)));
    let all: Vec<_> = all.collect();
    for (kind, units) in family(&all[..3], &all[3..]) {
        assert_same(kind, units);
    }
}

/// Young's modulus from 1e-9 to 1e15, everything else in proportion.
#[test]
fn moduli_of_any_size_give_the_same_digits() {
    let sizes = |factors: &[f64]| -> Vec<(&str, f64)> {
        factors.iter().flat_map(|f| ["damped", "obstacle", "springs"].map(|kind| (kind, *f))).collect()
    };
    let (ends, between) = (sizes(&[1e-12, 1e12]), sizes(&[1e-9, 1e-6, 1e6, 1e9]));
    for (kind, stress) in family(&ends, &between) {
        assert_same(kind, Units { stress, length: 1.0, time: 1.0 });
    }
}
