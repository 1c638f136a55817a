//! Regions with their own material.

use crate::{case::Case, hdf5_file::NumberFile, results::assert_same_answer};

const HISTORY: &str = "viscoplastic_history";

/// The soft tread on the stiff core.
fn wheel() -> Case {
    let root = env!("CARGO_MANIFEST_DIR");
    Case::from(&std::path::Path::new(root).join("jobs/two_materials.toml"))
        .set("mesh.file", &format!("'{root}/meshes/wheel_segment.msh'"))
        .set("time.step", "0.005")
        .set("time.end", "0.05")
        .set("output.fields.every", "4")
        .set("checkpoint.every", "4")
}

/// The tread's material.
const RUBBER: &str = "{ density = 1100.0, elasticity = { youngs_modulus = 5e6, poisson_ratio = 0.4 }, \
    viscosity = { volumetric = 7e4, shear = 3.6e4 }, \
    viscoplasticity.perzyna = { relaxation = 5e4, yield_stress = 2e4, metric = 'compliance' } }";

#[test]
fn regions_of_the_same_material_are_the_body_of_one_material_to_the_last_bit() {
    let one = wheel().without("region").set("material", RUBBER);
    let two = wheel().set("material", RUBBER);
    let all =
        format!("[{{ name = 'core', material = {RUBBER} }}, {{ name = 'tread', material = {RUBBER} }}]");
    let named = wheel().set("material", "{}").set("region", &all);
    let results = one.run(2);
    for (case, what) in [(two, "tread"), (named, "tread and core")] {
        let other = case.run(2);
        for name in ["probes.csv", "profiles.csv"] {
            assert_eq!(results.text(name), other.text(name), "{what}: {name}");
        }
        // Energies are summed by batches, and no batch contains cells of two regions.
        assert_same_answer(&results, &other, 1e-12, what);
        assert_eq!(results.summary()["certificates"], other.summary()["certificates"], "{what}");
        assert_eq!(results.summary()["inventory"], other.summary()["inventory"], "{what}");
    }
}

#[test]
fn regions_without_mass_beside_others_with_mass_are_warned_of() {
    for (place, words) in [
        (
            "region.0.material",
            "region.0.material without density: its cells have neither inertia nor weight, as those of material",
        ),
        (
            "material",
            "material without density: its cells have neither inertia nor weight, as those of region.0.material",
        ),
    ] {
        let case = wheel().without(&format!("{place}.density"));
        let said = case.checked(2);
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn only_cells_whose_material_flows_keep_a_history() {
    let case = wheel();
    let results = case.run(2);
    assert!(results.number("max_energy_imbalance") < 1e-10);
    let history = NumberFile::open(&results.path("fields.vtkhdf")).field(HISTORY, 2);
    let flowing = history.chunks(6).filter(|tensor| tensor.iter().any(|value| *value != 0.0)).count();
    let bytes = results.summary()["inventory"]["history_bytes"][HISTORY].as_u64().expect("bytes");
    let (kept, cells) = (bytes as usize / (2 * 6 * 8), results.number("cells") as usize);
    assert!(flowing > 0 && flowing <= kept && kept < cells, "{flowing} of {kept} of {cells} cells flow");
}

#[test]
fn an_effect_may_be_in_one_region_only() {
    for lacking in ["density", "viscosity", "elasticity", "viscoplasticity"] {
        for place in ["material", "region.0.material"] {
            let mut case = wheel().set("time.step", "1e-4").set("time.end", "1e-3");
            if lacking == "elasticity" || place == "material" && lacking == "viscoplasticity" {
                case = case.set("region.0.material", RUBBER).without("region.0.material.viscoplasticity");
            }
            if lacking != "viscoplasticity" {
                case = case.without(&format!("{place}.{lacking}"));
            }
            let case = case.set("solver.accept", "['explicit_stability']");
            let results = case.run(2);
            let what = format!("{place} without {lacking}");
            assert!(results.number("max_energy_imbalance") < 1e-9, "{what}");
            let certificates = &results.summary()["certificates"];
            assert_eq!(certificates["theta"].is_null(), lacking == "viscosity", "{what}: {certificates}");
        }
    }
}

#[test]
fn a_run_with_regions_continues_on_another_number_of_ranks() {
    let straight = wheel().set("solver.tolerance", "1e-13");
    let straight = (straight.run(1), straight);
    for (writers, readers) in [(1, 2), (2, 3), (3, 1)] {
        let case = wheel().set("solver.tolerance", "1e-13");
        case.run_with(writers, &["--set", "time.end=0.025"]).expect(0);
        case.run_with(readers, &["--restart"]).expect(0).says("continuing from");
        let what = format!("saved on {writers} ranks, gone on on {readers}");
        assert_same_answer(&straight.0, &case.results(), 1e-8, &what);
    }
}

#[test]
fn a_material_that_nothing_moves_is_refused_with_its_region() {
    let still = wheel().without("material.density").without("material.viscosity");
    still.run_with(1, &[]).expect(2).says("of region \"core\"");
    let empty = wheel().set("material", "{}");
    empty.run_with(1, &[]).expect(2).says("\"core\"").says("has no density, no elasticity and no viscosity");
}
