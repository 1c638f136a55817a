//! Loading of jobs: defaults, the effective job, overrides, keys that affect the results, and descriptions of keys.

use std::path::{Path, PathBuf};

use clarke::job::{
    Blocks, Job, Loaded, MeshNames, MeshSource, Quadrature, Scheme, describe, describe_json, differing_keys,
};
use clarke::laws::material::Metric;
use proptest::prelude::*;

const SQUARE: &str = include_str!("../jobs/papers/wang_cheng_2022.toml");

/// Keys of many effects, with a mesh file.
const RICH: &str = r#"
about = { title = "all keys", reference = "none", authors = ["A", "B"] }
mesh.file = "../meshes/block.msh"

[material]
density = 7800
elasticity = { youngs_modulus = 2e11, poisson_ratio = 0.49 }
viscosity = { volumetric = -1, shear = 10 }
viscoplasticity.perzyna = { relaxation = 1, yield_stress = 0, metric = "frobenius" }

[[support]]
on = ["a", "b"]
fix = ["x", "z"]
[[support]]
on = ["c"]
fix = "normal"

[[traction]]
on = ["d"]
value = ["0", "-10*min(t/0.1, 1)", 3]

[[body_force]]
value = [0, 0, "-9.81*z"]

[[contact]]
on = ["e"]
quadrature = "gauss"
normal = { graph = { points = [[-1, 0], [1, 2]], slope_after = 3 } }

[initial]
velocity = ["sin(pi*x)", 0, 0]

[time]
end = 2
step = 0.1

[solver]
tolerance = 1e-8
preconditioner = "gamg"
max_newton_iterations = 7
accept = ["uniqueness", "explicit_stability"]
petsc = { snes_monitor = "", ksp_type = "cg" }

[output]
folder = "results/rich"
fields = { interval = 0.5 }
probe = [{ name = "p", point = [0, 0, 9] }]
profile = [{ on = "e" }]

[checkpoint]
interval = 60
wall_limit = 3600

[check]
max_von_mises = { value = 1, relative = 1e-3 }
"probe.p.velocity_x" = { value = 0, absolute = 1e-3 }
"#;

fn load(text: &str, overrides: &[&str]) -> Loaded {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    Job::from_text(text, "case.toml", Path::new("/anywhere/jobs"), &overrides)
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn jobs_of_the_papers_load_and_flow_in_the_cube_is_warned_of() {
    for (file, dimension) in [("wang_cheng_2022.toml", 2), ("wang_cheng_cube.toml", 3)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers").join(file);
        let loaded = Job::load(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
        // Cells of the cube may lock where they flow.
        assert_eq!(loaded.warnings.len(), dimension - 2, "{:?}", loaded.warnings);
        assert_eq!(loaded.job.dimension(), Some(dimension));
        let stem = path.file_stem().expect("stem");
        assert_eq!(loaded.job.output_folder(), path.parent().expect("folder").join("out").join(stem));
    }
}

#[test]
fn an_initial_velocity_without_inertia_is_warned_of() {
    let quasistatic = SQUARE.replace("\ndensity", "\n# density");
    let warned = |text: &str, velocity: &str| {
        let loaded = load(text, &[&format!("initial.velocity={velocity}")]);
        loaded
            .warnings
            .iter()
            .any(|words| words.starts_with("initial.velocity has no effect: no material has"))
    };
    assert!(warned(&quasistatic, "[0.0, '0.1*x']") && !warned(&quasistatic, "[0.0, 0]"));
    assert!(!warned(SQUARE, "[0.0, 0.1]"));
}

#[test]
fn flow_that_keeps_the_volume_is_warned_of_where_cells_lock() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let warned = |overrides: &[&str]| {
        let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
        let loaded = Job::load(&path, &overrides).unwrap_or_else(|error| panic!("{error}"));
        loaded.warnings.iter().any(|words| words.starts_with("material.viscoplasticity conserves volume"))
    };
    let strain = "material.hypothesis=plane_strain";
    assert!(warned(&[strain]) && !warned(&[]), "von Mises flow locks in plane strain, not in plane stress");
    assert!(!warned(&[strain, "mesh.rectangle.diagonal=crossed"]));
    let law = |text: &str| format!("material.viscoplasticity={text}");
    for (text, locks) in [
        ("{ perzyna = { relaxation = 100, yield_stress = 19, hardening_modulus = 5 } }", true),
        ("{ maxwell = { relaxation_time = 1 } }", true),
        ("{ maxwell = { relaxation_time = 1, volumetric_relaxation_time = 5 } }", false),
        ("{ drucker_prager = { relaxation = 100, friction_coefficient = 0.3, cohesion = 10 } }", false),
        ("{ drucker_prager = { relaxation = 100, friction_coefficient = 0, cohesion = 10 } }", true),
        ("{ norton = { rate = 1, reference_stress = 10, exponent = 3 } }", true),
    ] {
        assert_eq!(warned(&[strain, &law(text)]), locks, "{text}");
    }
}

#[test]
fn keys_that_are_absent_have_their_defaults() {
    let job = load(
        "material.density = 1\nmaterial.hypothesis = \"plane_strain\"\nmesh.rectangle = { size = [1, 2], cells = [3, 4] }\n\
         time = { end = 1, step = 1 }\n[[contact]]\non = [\"left\"]\nnormal.damped_response = { breakpoints = [], slopes = [1] }\n",
        &[],
    )
    .job;
    assert_eq!(job.solver.tolerance, 1e-10);
    assert_eq!(job.time.scheme, Scheme::LaggedEuler);
    assert_eq!(job.contact[0].quadrature, Quadrature::Nodal);
    assert_eq!(job.output_folder(), Path::new("/anywhere/jobs/out/case"));
    assert!(job.checkpoint.is_none() && job.initial.is_none() && job.material.elasticity.is_none());
    let MeshSource::Rectangle(Blocks::One(rectangle)) = job.mesh.source else { panic!("not a rectangle") };
    assert_eq!((rectangle.grading.x, rectangle.grading.y), (1.0, 1.0));
}

#[test]
fn the_effective_job_loads_from_the_output_folder_as_the_same_job() {
    for text in [SQUARE, RICH] {
        let job = load(text, &[]).job;
        let written = job.to_toml().expect("written");
        let again = Job::from_text(&written, "job.toml", job.output_folder(), &[]);
        let again = again.unwrap_or_else(|error| panic!("{written}\n{error}"));
        assert_eq!(again.job, job);
        assert_eq!(again.job.physics(), job.physics());
    }
    let written = load(RICH, &[]).job.to_toml().expect("written");
    for default in [
        "scheme = \"lagged_euler\"",
        "slope_before = 0.0",
        "keep = 2",
        "compression = 0",
        "folder = \".\"",
        "/anywhere/meshes/block.msh",
    ] {
        assert!(written.contains(default), "{default} is not in\n{written}");
    }
}

#[test]
fn paths_are_relative_to_the_job_file() {
    let job = load(RICH, &[]).job;
    assert_eq!(job.mesh_file(), Some(Path::new("/anywhere/meshes/block.msh")));
    assert_eq!(job.output_folder(), Path::new("/anywhere/jobs/results/rich"));
    let elsewhere = load(RICH, &["output.folder=/scratch/../tmp/x", "mesh.file=./a.msh"]).job;
    assert_eq!(elsewhere.output_folder(), Path::new("/tmp/x"));
    assert_eq!(elsewhere.mesh_file(), Some(Path::new("/anywhere/jobs/a.msh")));
}

#[test]
fn expressions_are_evaluated_in_time_and_space() {
    let job = load(RICH, &[]).job;
    let at = |time: f64| -> Vec<f64> {
        job.traction[0].value.iter().map(|scalar| scalar.evaluate(time, &[1.0, 2.0, 3.0])).collect()
    };
    assert_eq!(at(0.05), [0.0, -5.0, 3.0]);
    assert_eq!(at(7.0), [0.0, -10.0, 3.0]);
    assert_eq!(job.body_force[0].value[2].evaluate(0.0, &[1.0, 2.0, 3.0]), -9.81 * 3.0);
}

#[test]
fn overrides_win_over_the_file() {
    let job = load(
        SQUARE,
        &[
            "time.step=0.25",
            "contact.0.quadrature=gauss",
            "material.viscoplasticity.perzyna.metric=compliance",
            "mesh.rectangle.cells=[8, 8]",
            "traction.0.value.1=-10*t",
            "solver.petsc.ksp_type=minres",
            "time.step=0.5",
        ],
    )
    .job;
    assert_eq!(job.time.step, 0.5);
    assert_eq!(job.contact[0].quadrature, Quadrature::Gauss);
    assert_eq!(job.solver.petsc["ksp_type"], "minres");
    assert_eq!(
        job.material.viscoplasticity,
        load(SQUARE, &["material.viscoplasticity.perzyna.metric=compliance"]).job.material.viscoplasticity
    );
    assert_ne!(job.material.viscoplasticity, load(SQUARE, &[]).job.material.viscoplasticity);
    assert_eq!(Metric::default(), Metric::Elasticity);
}

#[test]
fn only_what_changes_the_answer_counts_as_physics() {
    let physics = |overrides: &[&str]| load(SQUARE, overrides).job.physics().expect("physics");
    let original = physics(&[]);
    let same = physics(&[
        "time.end=3",
        "output.folder=x",
        "about.title=x",
        "checkpoint.every=3",
        "solver.preconditioner=gamg",
        "solver.petsc.snes_monitor=\"\"",
        "solver.accept=[\"uniqueness\"]",
        "check.max_von_mises={value=1, absolute=1}",
        "time.scheme=lagged_euler",
    ]);
    assert_eq!(differing_keys(&original, &same), Vec::<String>::new());
    let other = physics(&[
        "material.density=2",
        "contact.0.normal.damped_response.slopes.1=-9",
        "time.step=0.5",
        "initial.velocity=[\"x\", 0]",
    ]);
    assert_eq!(
        differing_keys(&original, &other),
        ["contact.0.normal.damped_response.slopes", "initial.velocity", "material.density", "time.step"]
    );
    assert_eq!(original["material.elasticity.youngs_modulus"], "1000.0");
    let more = physics(&["contact.0.friction.tresca.bound=1"]);
    for pair in [[&original, &more], [&more, &original]] {
        assert_eq!(differing_keys(pair[0], pair[1]), ["contact.0.friction.tresca.bound"], "one has it alone");
    }
}

/// Two blocks above each other. The lengths of the first one add up to a corner of the second one and to a probe but for rounding.
const BLOCKS: &str = r#"
[[mesh.rectangle]]
name = "low"
corner = [0.7, 0.1]
size = [0.1, 0.2]
cells = [4, 2]
[[mesh.rectangle]]
name = "high"
corner = [0.0, 0.3]
size = [1.0, 1.0]
cells = [4, 4]
diagonal = "crossed"
partition = "auto"
[material]
hypothesis = "plane_strain"
density = 1
[[region]]
name = "high"
material = { density = 2 }
[[support]]
on = ["low.bottom", "high.top"]
fix = "all"
[time]
end = 1
step = 0.1
[output]
probe = [{ name = "p", point = [0.8, 0.1] }]
profile = [{ on = "high.left" }]
"#;

#[test]
fn a_list_of_blocks_loads_and_is_written_as_one() {
    let job = load(BLOCKS, &[]).job;
    let MeshSource::Rectangle(Blocks::Several(blocks)) = &job.mesh.source else { panic!("not a list") };
    assert_eq!(blocks[1].name.as_deref(), Some("high"));
    assert_eq!((blocks[0].corner, blocks[1].corner), ([0.7, 0.1], [0.0, 0.3]));
    assert_eq!(job.dimension(), Some(2));
    let written = job.to_toml().expect("written");
    let again = Job::from_text(&written, "job.toml", job.output_folder(), &[]);
    assert_eq!(again.unwrap_or_else(|error| panic!("{written}\n{error}")).job, job);
    let physics = |overrides: &[&str]| load(BLOCKS, overrides).job.physics().expect("physics");
    let metis = physics(&["mesh.rectangle.0.partition=metis", "mesh.rectangle.1.partition=metis"]);
    assert_eq!(differing_keys(&physics(&[]), &metis), Vec::<String>::new());
    let moved = physics(&["mesh.rectangle.1.corner=[0.0, 0.5]", "mesh.rectangle.0.cells=[5, 2]"]);
    assert_eq!(differing_keys(&physics(&[]), &moved), ["mesh.rectangle.0.cells", "mesh.rectangle.1.corner"]);
}

#[test]
fn a_single_block_with_a_name_has_the_names_of_a_list() {
    let one = BLOCKS.split("[[mesh.rectangle]]\nname = \"high\"").collect::<Vec<_>>();
    let rest = one[1].split_once("[material]").expect("material").1;
    let text = format!("{}[material]{rest}", one[0].replace("[[mesh.rectangle]]", "[mesh.rectangle]"))
        .replace(", \"high.top\"", "")
        .replace("[[region]]\nname = \"high\"", "[[region]]\nname = \"low\"")
        .replace("high.left", "low.left");
    let job = load(&text, &["output.probe=[]"]).job;
    let MeshSource::Rectangle(Blocks::One(block)) = &job.mesh.source else { panic!("not a table") };
    assert_eq!((block.name.as_deref(), block.corner), (Some("low"), [0.7, 0.1]));
    let plain = load(SQUARE, &[]).job;
    assert!(!plain.to_toml().expect("written").contains("corner ="), "as before where the keys are absent");
}

#[test]
fn a_run_may_land_on_its_end() {
    assert_eq!(load(SQUARE, &["time.end=1", "time.land_on=[0.5, 1.0]"]).job.time.land_on, [0.5, 1.0]);
}

#[test]
fn a_mesh_file_is_compared_with_the_job_once_it_is_read() {
    let names = ["a", "b", "c", "d", "e"];
    let mesh = |boundaries| MeshNames { dimension: 3, boundaries, regions: &[], points: &[], inner: &[] };
    let mut loaded = load(RICH, &[]);
    assert_eq!(loaded.warnings, Vec::<String>::new());
    loaded.check_mesh(mesh(&names)).unwrap_or_else(|error| panic!("{error}"));
    assert!(loaded.warnings[0].contains("poisson_ratio = 0.49"), "{:?}", loaded.warnings);

    let error = loaded.check_mesh(mesh(&names[..4])).expect_err("no boundary e").to_string();
    assert!(error.contains("the mesh has no boundary \"e\"") && error.contains("case.toml:26:7"), "{error}");
    let points = MeshNames { points: &["pin"], ..mesh(&["a", "c", "d", "e"]) };
    let error = load(RICH, &[]).check_mesh(points).expect_err("no boundary b").to_string();
    assert!(error.contains("no boundary, point or curve \"b\"") && error.contains("e, pin"), "{error}");
    let inner = [["e", "(1, 2, 3)"], ["f", "(4, 5, 6)"]];
    let inside = MeshNames { inner: &inner, ..mesh(&names[..4]) };
    let mut job = load(RICH, &[]);
    let error = job.check_mesh(inside).expect_err("e is inside").to_string();
    assert!(error.contains("\"e\" has facets inside the body, for example around (1, 2, 3)"), "{error}");
    assert!(!error.contains("has no boundary"), "one fault: {error}");
    job.check_mesh(MeshNames { inner: &inner[1..], ..mesh(&names) })
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(job.warnings.iter().any(|warning| warning.contains("\"f\"") && warning.contains("is ignored")));
    let plane = MeshNames { dimension: 2, boundaries: &names, regions: &[], points: &[], inner: &[] };
    let error = loaded.check_mesh(plane).expect_err("2D").to_string();
    for part in [
        "a 2D body needs a hypothesis",
        "has 3 component(s)",
        "a 2D body has no z component",
        "has 3 coordinate(s)",
    ] {
        assert!(error.contains(part), "{part} is not in {error}");
    }
}

#[test]
fn faults_found_later_point_into_the_job() {
    let error = load(SQUARE, &[]).fault("contact.0.on", "the boundary is curved", "flatten it").to_string();
    let before = SQUARE.lines().take_while(|line| !line.starts_with("on         = ")).count();
    for part in [
        &*format!("case.toml:{}:14", before + 1),
        "the boundary is curved",
        "on         = [\"bottom\"]",
        "help: flatten it",
    ] {
        assert!(error.contains(part), "{part} is not in {error}");
    }
    let error = load(SQUARE, &["time.step=0.5"]).fault("time.step", "too long", "").to_string();
    assert!(error.contains("--set:1:11"), "{error}");
}

#[test]
fn every_key_is_described() {
    let text = describe(None).expect("described");
    for part in [
        "[[contact]]",
        "youngs_modulus: a number or an expression in x, y, z; above 0; unit Pa; required",
        "example: poisson_ratio = 0.4",
        "default 1e-10",
        "pressure: a number or an expression in t, x, y, z; unit Pa",
        "value: a list of items, each a number or an expression in t, x, y, z; unit Pa",
        "point: a list of items, each a number or an expression in t; unit m",
        "\"bdf2\": Second order in time.",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    let block = describe(Some("mesh.rectangle")).expect("described");
    for part in [
        "[mesh.rectangle]",
        "A list of tables `[[mesh.rectangle]]`",
        "corner: a list of 2 items",
        "[mesh.rectangle.grading]",
    ] {
        assert!(block.contains(part), "{part} is not in {block}");
    }
    let one = describe(Some("[contact.friction]")).expect("described");
    assert!(one.contains("[contact.friction.tresca]") && !one.contains("breakpoints"), "{one}");
    let unknown = describe(Some("contat")).expect_err("unknown").to_string();
    assert!(unknown.contains("did you mean `contact`?"), "{unknown}");
    for (word, first) in [
        ("youngs_modulus", "material.elasticity.youngs_modulus: "),
        ("coulomb", "contact.friction.coulomb: Coulomb friction."),
        ("friction", "contact.friction: "),
    ] {
        let found = describe(Some(word)).expect(word);
        let line = found.lines().nth(2).unwrap_or_default();
        assert!(
            found.starts_with(&format!("`{word}` occurs in")) && line.starts_with(&format!("  {first}")),
            "{found}"
        );
    }
}

#[test]
fn the_schema_has_a_meaning_for_every_key() {
    let schema: serde_json::Value = serde_json::from_str(&describe_json()).expect("JSON");
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    let mut keys = 0;
    for (table, definition) in schema["$defs"].as_object().expect("definitions") {
        for (key, property) in definition["properties"].as_object().into_iter().flatten() {
            keys += 1;
            assert!(property["description"].as_str().is_some_and(|text| text.len() > 5), "{table}.{key}");
        }
    }
    assert!(keys > 60, "{keys} keys");
    assert!(!describe_json().contains("\"null\""));
}

/// A random change of a job, which may or may not be an error.
#[derive(Debug, Clone)]
enum Change {
    Delete(usize),
    Repeat(usize),
    Rename(usize, String),
    Retype(usize, &'static str),
    Insert(usize, Vec<u8>),
    Override(String),
}

fn change() -> impl Strategy<Value = Change> {
    let value = prop::sample::select(vec![
        "1",
        "-1",
        "0.0",
        "1e400",
        "nan",
        "inf",
        "true",
        "\"x\"",
        "\"-x^2 + min(t\"",
        "[]",
        "[[]]",
        "{}",
        "1979-05-27",
        "[1, \"2\", {}]",
        "{ a.b.c = 1 }",
        "9223372036854775807",
        "99999999999999999999",
        "\"\\u001b[31m\"",
        "{ every = 1 }",
    ]);
    let path = "(mesh|material|contact|time|support|output|check)\\.[a-z0-9]{1,8}(\\.[a-z0-9\"]{0,4}){0,2}";
    prop_oneof![
        any::<usize>().prop_map(Change::Delete),
        any::<usize>().prop_map(Change::Repeat),
        (any::<usize>(), "[a-z_.]{1,12}").prop_map(|(line, name)| Change::Rename(line, name)),
        (any::<usize>(), value).prop_map(|(line, value)| Change::Retype(line, value)),
        (any::<usize>(), prop::collection::vec(any::<u8>(), 1..6))
            .prop_map(|(at, bytes)| Change::Insert(at, bytes)),
        (path, "[-a-z0-9\\[\\]{}\".=]{0,8}")
            .prop_map(|(key, value)| Change::Override(format!("{key}={value}"))),
    ]
}

fn changed(text: &str, changes: &[Change]) -> (Vec<u8>, Vec<String>) {
    let mut lines: Vec<String> =
        text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect();
    let mut overrides = Vec::new();
    let mut bytes = Vec::new();
    for change in changes {
        let count = lines.len().max(1);
        let split = |line: &str| line.split_once('=').map(|(key, value)| (key.to_owned(), value.to_owned()));
        match change {
            Change::Delete(line) if lines.len() > 1 => drop(lines.remove(line % count)),
            Change::Delete(_) => {}
            Change::Repeat(line) => lines.insert(line % count, lines[(line / 7) % count].clone()),
            Change::Rename(line, name) => match split(&lines[line % count]) {
                Some((_, value)) => lines[line % count] = format!("{name} = {value}"),
                None => lines[line % count] = format!("[{name}]"),
            },
            Change::Retype(line, value) => {
                if let Some((key, _)) = split(&lines[line % count]) {
                    lines[line % count] = format!("{key} = {value}");
                }
            }
            Change::Insert(at, inserted) => bytes.push((*at, inserted.clone())),
            Change::Override(text) => overrides.push(text.clone()),
        }
    }
    let mut out = lines.join("\n").into_bytes();
    for (at, inserted) in bytes {
        let at = at % (out.len() + 1);
        out.splice(at..at, inserted);
    }
    (out, overrides)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn changed_jobs_load_or_are_refused_in_words(
        rich in any::<bool>(),
        changes in prop::collection::vec(change(), 1..5),
    ) {
        let (bytes, overrides) = changed(if rich { RICH } else { SQUARE }, &changes);
        let text = String::from_utf8_lossy(&bytes);
        match Job::from_text(&text, "case.toml", &PathBuf::from("/work"), &overrides) {
            Ok(loaded) => {
                let written = loaded.job.to_toml().expect("written");
                let again = Job::from_text(&written, "job.toml", loaded.job.output_folder(), &[]);
                prop_assert_eq!(again.map(|again| again.job), Ok(loaded.job));
            }
            Err(error) => {
                let report = error.to_string();
                prop_assert_eq!(clarke::error::Exit::from(error), clarke::error::Exit::Refused);
                prop_assert!(report.contains("case.toml:") || report.contains("--set:"), "{}", report);
                prop_assert!(!report.contains(|c: char| c.is_control() && c != '\n'), "{:?}", report);
            }
        }
    }
}
