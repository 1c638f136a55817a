//! Viscoplastic laws in complete runs.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};

const LAW: &str = "material.viscoplasticity";
const STRAIN: &str = "equivalent_viscoplastic_strain";

/// Each law with values at which the paper's body flows.
const LAWS: [(&str, &str); 8] = [
    ("perzyna", "{ perzyna = { relaxation = 100, yield_stress = 9 } }"),
    ("power law", "{ perzyna = { relaxation = 100, yield_stress = 9, exponent = 2.5 } }"),
    ("hardening", "{ perzyna = { relaxation = 100, yield_stress = 9, hardening_modulus = 300 } }"),
    (
        "hardening power law",
        "{ perzyna = { relaxation = 100, yield_stress = 9, exponent = 2, hardening_modulus = 300, \
         metric = 'compliance' } }",
    ),
    (
        "hardening creep",
        "{ norton = { rate = 0.01, reference_stress = 9, exponent = 3, hardening_strain = 0.02, \
         hardening_exponent = 2 } }",
    ),
    (
        "hardening creep by a formula",
        "{ expression = { rate = '0.01*(q/9)^3/(1 + e/0.02)', reference_stress = 9 } }",
    ),
    ("maxwell", "{ maxwell = { relaxation_time = 0.4, volumetric_relaxation_time = 3 } }"),
    ("drucker prager", "{ drucker_prager = { relaxation = 100, friction_coefficient = 0.5, cohesion = 4 } }"),
];

fn square(hypothesis: &str) -> Case {
    Case::square(6).set("material.hypothesis", &format!("'{hypothesis}'")).set("time.step", "0.03125")
}

fn cube() -> Case {
    Case::cube(3).set("time.step", "0.03125")
}

#[test]
fn energy_balances_to_rounding_under_every_law() {
    for (name, law) in LAWS {
        let [strain, stress] = ["plane_strain", "plane_stress"].map(square);
        let cases = [("plane strain", strain), ("plane stress", stress), ("space", cube())];
        for (place, case) in cases {
            // The energy balance holds beyond the bound of explicit power laws, too.
            let mut case = case
                .set(LAW, law)
                .set("solver.tolerance", "1e-12")
                .set("solver.accept", "['explicit_stability']");
            for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
                case = case.set("time.scheme", &format!("'{scheme}'"));
                let results = case.run(2);
                let imbalance = results.number("max_energy_imbalance");
                assert!(imbalance < 1e-10, "{name} in {place} under {scheme}: {imbalance:e}");
                let taken_up = results.table("history.csv").last("viscoplastic_dissipation");
                assert!(taken_up > 0.0, "{name} in {place} never flows");
            }
        }
    }
}

fn same_tables(one: &Results, other: &Results, what: &str) {
    for name in ["probes.csv", "history.csv"] {
        assert_eq!(one.text(name), other.text(name), "{what}: {name}");
    }
}

#[test]
fn values_that_change_nothing_give_the_plain_law_to_the_last_bit() {
    for case in [|| square("plane_stress"), cube] {
        let plain = case().set(LAW, LAWS[0].1);
        let plain = (plain.run(1), plain);
        for key in ["exponent = 1", "hardening_modulus = 0"] {
            let law = format!("{{ perzyna = {{ relaxation = 100, yield_stress = 9, {key} }} }}");
            let other = case().set(LAW, &law);
            same_tables(&plain.0, &other.run(1), key);
        }
    }
}

#[test]
fn laws_that_never_flow_give_the_elastic_body() {
    let elastic = square("plane_strain").without(LAW);
    let probes = elastic.run(1).text("probes.csv");
    for law in [
        "{ perzyna = { relaxation = 1000, yield_stress = 1e30, exponent = 3, hardening_modulus = 300 } }",
        "{ drucker_prager = { relaxation = 1000, friction_coefficient = 0.5, cohesion = 1e30 } }",
    ] {
        let case = square("plane_strain").set(LAW, law);
        let results = case.run(1);
        assert_eq!(results.text("probes.csv"), probes, "{law}");
        assert_eq!(results.table("history.csv").last("viscoplastic_dissipation"), 0.0);
    }
}

#[test]
fn accumulated_strain_is_kept_where_the_material_hardens_only() {
    for (name, law) in LAWS {
        let hardens = name.starts_with("hardening");
        let case = square("plane_strain").set(LAW, law).set("checkpoint.every", "16");
        let results = case.run(2);
        let kept = results.summary()["inventory"]["history_bytes"][STRAIN].as_u64();
        assert_eq!(kept, hardens.then_some(2 * 72 * 8), "{name}");
        let fields = NumberFile::open(&results.path("fields.vtkhdf"));
        assert_eq!(fields.names("Fields").iter().any(|field| field == STRAIN), hardens, "{name}");
        if hardens {
            let strain = fields.field(STRAIN, fields.times().len() - 1);
            let is_kept = strain.iter().all(|value| *value >= 0.0) && strain.iter().any(|value| *value > 0.0);
            assert!(is_kept, "{name}: {strain:?}");
        }
    }
}

#[test]
fn every_law_writes_its_equivalent_strain_where_it_is_asked_for() {
    for (name, law) in LAWS {
        let case = square("plane_strain").set(LAW, law).set("output.also", &format!("['{STRAIN}']"));
        let results = case.run(2);
        let fields = NumberFile::open(&results.path("fields.vtkhdf"));
        let strain = fields.field(STRAIN, fields.times().len() - 1);
        let is_kept = strain.iter().all(|value| *value >= 0.0) && strain.iter().any(|value| *value > 0.0);
        assert!(is_kept, "{name}: {strain:?}");
    }
    // The same as that of hardening that does nothing.
    let norton = "norton = { rate = 0.01, reference_stress = 9, exponent = 3";
    for (hypothesis, law, nothing) in [
        ("plane_strain", "perzyna = { relaxation = 100, yield_stress = 9", ", hardening_modulus = 1e-9"),
        ("plane_stress", norton, ", hardening_strain = 1, hardening_exponent = 0"),
        ("plane_strain", norton, ", hardening_strain = 1, hardening_exponent = 0"),
    ] {
        for scheme in ["lagged_euler", "implicit_euler"] {
            let [found, wanted] = ["", nothing].map(|more| {
                let case = square(hypothesis).set(LAW, &format!("{{ {law}{more} }} }}"));
                let case = case
                    .set("time.scheme", &format!("'{scheme}'"))
                    .set("output.probe_also", &format!("['{STRAIN}']"));
                case.set("solver.accept", "['explicit_stability']").run(1).table("probes.csv").numbers(STRAIN)
            });
            let largest = wanted.iter().copied().fold(0.0, f64::max);
            assert!(largest > 1e-4, "{law}: {largest}");
            let is_same = |(one, other): (&f64, &f64)| (one - other).abs() < 1e-9 * largest;
            assert!(found.iter().zip(&wanted).all(is_same), "{law}: {found:?} {wanted:?}");
        }
    }
    let soil = square("plane_stress").set(LAW, LAWS[7].1).set("output.also", &format!("['{STRAIN}']"));
    soil.run_with(1, &[]).expect(2).says("keeps the volume only");
}

#[test]
fn a_hardening_run_that_continues_is_the_straight_run_to_the_last_bit() {
    let make = || square("plane_strain").set(LAW, LAWS[2].1).set("checkpoint.every", "8");
    let straight = make();
    let straight = (straight.run(2), straight);
    let stopped = make();
    stopped.run_with(2, &["--set", "time.end=0.53125"]).expect(0);
    stopped.run_with(2, &["--restart"]).expect(0).says("continuing from");
    same_tables(&straight.0, &stopped.results(), "hardening");
}

#[test]
fn the_step_bound_is_that_of_the_fastest_relaxation() {
    let law = "{ maxwell = { relaxation_time = 0.01 } }";
    let case = square("plane_strain").set(LAW, law);
    case.run_with(1, &[]).expect(2).says("the step of 0.03125 s exceeds 0.02 s");
}
