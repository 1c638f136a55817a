//! Warnings of `solver check` about units.

use super::{World, run_on};
use crate::jobs::jobs;
use clarke::{
    job::{Job, Loaded},
    run,
};
use std::path::Path;

/// What the report on a job says of its bodies, and its warnings about units.
fn report(world: &World, loaded: Loaded) -> Option<(serde_json::Value, Vec<String>)> {
    let report = run::check(&world.session, loaded.trusted(true), None).ok()?.json().expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let warnings = report["warnings"].as_array().expect("warnings").iter();
    let of_units = warnings.filter_map(|words| words.as_str()).filter(|words| words.starts_with("units: "));
    let of_units = of_units.map(str::to_owned).collect();
    Some((report["bodies"].clone(), of_units))
}

#[test]
fn no_job_of_the_repository_is_warned_of_its_units() {
    run_on(&[1], |world| {
        let mut count = 0;
        for file in jobs() {
            let loaded = Job::load(&file, &[]).expect("a job");
            // Options of PETSc would hold for all jobs that follow.
            if !loaded.job.solver.petsc.is_empty() {
                continue;
            }
            // Some start from the results of others.
            let Some((bodies, warnings)) = report(&world, loaded) else { continue };
            assert!(bodies[0]["extent"][0].as_f64() > Some(0.0), "{}: {bodies}", file.display());
            assert!(warnings.is_empty(), "{}: {warnings:?}", file.display());
            count += 1;
        }
        assert!(count > 80, "{count} jobs");
    });
}

/// A bar of 1 m x 0.1 m whose coordinates are in this unit, with this density, pulled by 210 MPa at one end and held at the other.
fn bar(metre: f64, density: f64) -> Loaded {
    let text = format!(
        "[mesh.rectangle]\nsize = [{}, {}]\ncells = [10, 2]\n[material]\nhypothesis = 'plane_stress'\ndensity = {density:e}\n\
         [material.elasticity]\nyoungs_modulus = 2.1e11\npoisson_ratio = 0.0\n[[support]]\non = ['left']\nfix = 'all'\n\
         [[traction]]\non = ['right']\nvalue = [2.1e8, 0]\n[time]\nscheme = 'bdf2'\nend = 1e-2\nstep = 1e-5\n",
        1.0 * metre,
        0.1 * metre
    );
    Job::from_text(&text, "bar.toml", Path::new("."), &[]).expect("a job")
}

#[test]
fn bodies_are_measured_alike_on_all_ranks_and_mixed_units_are_warned_of() {
    run_on(&[1, 2], |world| {
        let (bodies, warnings) = report(&world, bar(1.0, 7850.0)).expect("a report");
        assert!(warnings.is_empty(), "{warnings:?}");
        let close = |name: &str, expected: f64| {
            let found = bodies[0][name].as_f64().unwrap_or(f64::NAN);
            assert!((found / expected - 1.0).abs() < 1e-3, "{name}: {found} instead of {expected}");
        };
        assert_eq!(bodies.as_array().map(Vec::len), Some(1));
        close("mass", 785.0);
        close("farthest", 1.0);
        // sqrt(2.1e11 / 7850), 1 m over it, in steps of 1e-5 s.
        close("wave_speed", 5172.19);
        close("wave_time", 1.93342e-4);
        close("steps_per_wave", 19.3342);
        // 210 MPa over 2.1e11 Pa.
        close("load_strain", 1e-3);
        let of = |metre, density| report(&world, bar(metre, density)).expect("a report").1;
        let light = of(1e4, 7.85e-9);
        assert!(light.len() == 1 && light[0].contains("no solid has waves faster"), "{light:?}");
        let large = of(1e4, 7850.0);
        assert!(large.len() == 1 && large[0].contains("is 10000 m long"), "{large:?}");
    });
}
