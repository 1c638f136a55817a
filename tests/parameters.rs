//! Parameters of jobs: numbers with names in place of numbers.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clarke::job::{Job, Loaded, Written, describe, describe_json, differing_keys};
use toml::{Table, Value};

const JOB: &str = r#"
[parameters]
n = 4
V = 0.05
W = "2*V"
T = "1/W"
[mesh.rectangle]
size = [1, "V*20"]
cells = ["2*n", "n"]
[material]
hypothesis = "plane_stress"
density = 1
elasticity = { youngs_modulus = "1e3*(1 + W*x)", poisson_ratio = "W/0.5" }
[[support]]
on = ["left"]
fix = ["x"]
velocity = ["V"]
[[traction]]
on = ["top"]
value = [0, "-W*min(t/T, 1) + interpolate(t, 0, V, T/2, W)"]
[time]
end = "2*T"
step = 0.1
scheme = "bdf2"
[output]
fields = { every = "n" }
[check]
max_von_mises = { value = 1, relative = "V" }
"#;

fn load(text: &str, overrides: &[&str]) -> Loaded {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    Job::from_text(text, "case.toml", Path::new("/anywhere"), &overrides)
        .unwrap_or_else(|error| panic!("{error}"))
}

fn refused(text: &str, overrides: &[&str]) -> String {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    let loaded = Job::from_text(text, "case.toml", Path::new("/anywhere"), &overrides);
    loaded.expect_err("a fault").to_string()
}

#[test]
fn expressions_of_parameters_have_their_values() {
    let loaded = load(JOB, &[]);
    assert_eq!(loaded.warnings, Vec::<String>::new());
    let job = loaded.job;
    assert_eq!(job.mesh.source.cells(), [8, 4]);
    assert_eq!(job.time.end, 20.0);
    let at = |time: f64| job.traction[0].value[1].evaluate(time, &[]);
    // From 0.05 at 0 to 0.1 at 5, and a ramp to -0.1 at 10.
    for (time, value) in [(0.0, 0.05), (2.5, 0.05), (5.0, 0.05), (10.0, 0.0), (12.0, 0.0)] {
        assert!((at(time) - value).abs() < 1e-15, "{} at {time}", at(time));
    }
    let elasticity = job.material.elasticity.expect("elastic");
    assert_eq!(elasticity.youngs_modulus.evaluate(0.0, &[3.0]), 1e3 * (1.0 + 0.1 * 3.0));
    assert_eq!(elasticity.poisson_ratio, 0.2);
    assert_eq!(job.check["max_von_mises"].relative, Some(0.05));
}

#[test]
fn parameters_are_those_of_the_command_line() {
    let job =
        load(JOB, &["parameters.V=0.1", "parameters.k=n/2", "solver.tolerance=k*1e-9", "time.step=2*T/k"])
            .job;
    assert_eq!((job.time.end, job.time.step, job.solver.tolerance), (10.0, 5.0, 2.0 * 1e-9));
    assert_eq!(load(JOB, &["parameters.T=3"]).job.time.end, 6.0);
    assert!(load(JOB, &["parameters.W=3*V"]).job.time.end > 13.3);
    let error = refused(JOB, &["parameters.V=T"]);
    assert!(error.contains("in a circle") && error.contains("W -> V -> T -> W"), "{error}");
    let error = refused(JOB, &["time.end=2*U"]);
    assert!(error.contains("--set:1:10") && error.contains("parameters: T, V, W, n"), "{error}");
}

#[test]
fn a_parameter_that_nothing_uses_is_warned_of() {
    let warnings = load(JOB, &["parameters.Vv=1", "parameters.a=2*b", "parameters.b=1"]).warnings;
    let unused = ["Vv", "a"]
        .map(|name| format!("parameters.{name}: no key and no other parameter uses this parameter"));
    assert_eq!(warnings, unused);
}

#[test]
fn the_effective_job_keeps_parameters_and_their_expressions() {
    let job = load(JOB, &[]).job;
    let written = job.to_toml().expect("written");
    for line in [
        "T = \"1/W\"",
        "V = 0.05",
        "size = [1.0, \"V*20\"]",
        "cells = [\"2*n\", \"n\"]",
        "velocity = [\"V\"]",
        "value = [0.0, \"-W*min(t/T, 1) + interpolate(t, 0, V, T/2, W)\"]",
        "youngs_modulus = \"1e3*(1 + W*x)\"",
        "end = \"2*T\"",
    ] {
        assert!(written.contains(line), "{line} is not in\n{written}");
    }
    let again = Job::from_text(&written, "job.toml", job.output_folder(), &["parameters.V=0.1".into()]);
    assert_eq!(again.expect("a job").job.physics(), load(JOB, &["parameters.V=0.1"]).job.physics());
    // A value that was changed after reading is written as it is.
    let mut changed = job.clone();
    changed.time.end = 7.0;
    assert!(changed.to_toml().expect("written").contains("end = 7.0"));
}

#[test]
fn a_changed_parameter_counts_as_a_change_of_the_keys_that_use_it() {
    let physics = |overrides: &[&str]| load(JOB, overrides).job.physics().expect("physics");
    let differing = |overrides: &[&str]| differing_keys(&physics(&[]), &physics(overrides));
    assert_eq!(differing(&["parameters.n=5"]), ["mesh.rectangle.cells"]);
    // The end of the run is no physics.
    assert_eq!(differing(&["parameters.T=11"]), ["traction.0.value"]);
    assert_eq!(differing(&["parameters.T=10"]), Vec::<String>::new(), "the same value");
    assert_eq!(differing(&["parameters.new=1"]), Vec::<String>::new());
    let value =
        "traction.0.value=[0, \"-(0.1)*min(t/(10.0), 1) + interpolate(t, 0, (0.05), (10.0)/2, (0.1))\"]";
    let numbers = [value, "support.0.velocity=[0.05]", "mesh.rectangle.cells=[8, 4]"];
    assert_eq!(differing(&numbers), Vec::<String>::new(), "numbers in place of parameters");
}

#[test]
fn a_parameter_may_choose_the_column_of_a_table() {
    let folder = tempfile::tempdir().expect("folder");
    std::fs::write(folder.path().join("load.csv"), "0,1,2\n1,3,4\n").expect("written");
    let text = JOB.replace(
        "\"-W*min(t/T, 1) + interpolate(t, 0, V, T/2, W)\"",
        "{ table = \"load.csv\", column = \"n - 1\" }",
    );
    let load = |overrides: &[String]| Job::from_text(&text, "case.toml", folder.path(), overrides);
    let value =
        |overrides: &[String]| load(overrides).expect("a job").job.traction[0].value[1].evaluate(1.0, &[]);
    assert_eq!(value(&[]), 4.0);
    assert_eq!(value(&["parameters.n=3".into()]), 3.0);
    let error = load(&["parameters.n=3.5".into()]).expect_err("no column").to_string();
    assert!(error.contains("`traction.0.value.1.column` must be a whole number"), "{error}");
}

#[test]
fn parameters_are_described() {
    let text = describe(Some("parameters")).expect("described");
    assert!(text.contains("[parameters]") && text.contains("T = \"2*pi/V\""), "{text}");
    let schema: serde_json::Value = serde_json::from_str(&describe_json()).expect("JSON");
    let kind = |key: &str| &schema["$defs"]["Time"]["properties"][key]["type"];
    assert_eq!(*kind("end"), serde_json::json!(["number", "string"]));
    assert_eq!(
        schema["$defs"]["Rectangle"]["properties"]["cells"]["items"]["type"],
        serde_json::json!(["integer", "string"])
    );
    assert_eq!(schema["$defs"]["Probe"]["properties"]["name"]["type"], "string");
}

/// All jobs of the repository without parameters of their own, and without studies.
fn jobs() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["jobs", "jobs/papers", "jobs/hard", "jobs/verification", "tests/cases"]
        .map(|folder| root.join(folder));
    let entries = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("folder"));
    let files = entries.map(|entry| entry.expect("entry").path());
    files.filter(|file| file.extension().is_some_and(|extension| extension == "toml")).collect()
}

/// Puts a parameter in place of each finite number below `path`. The result has the keys of these numbers without positions in lists.
fn replace(value: &mut Value, path: &str, parameters: &mut Table) -> Vec<String> {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Table(table) => {
            table.iter_mut().flat_map(|(key, value)| replace(value, &below(key), parameters)).collect()
        }
        Value::Array(items) => items.iter_mut().flat_map(|item| replace(item, path, parameters)).collect(),
        Value::Float(number) if !number.is_finite() => Vec::new(),
        Value::Integer(_) | Value::Float(_) => {
            let name = format!("p{}", parameters.len());
            parameters.insert(name.clone(), std::mem::replace(value, Value::String(name)));
            vec![path.to_owned()]
        }
        _ => Vec::new(),
    }
}

/// The keys of numbers that the schema allows below a table, without positions in lists.
fn numbers(root: &serde_json::Value, schema: &serde_json::Value, path: &str, keys: &mut BTreeSet<String>) {
    let target = schema["$ref"].as_str().and_then(|name| root.pointer(name.trim_start_matches('#')));
    for schema in [Some(schema), target].into_iter().flatten() {
        let is_number = |kind: &serde_json::Value| kind == "number" || kind == "integer";
        if schema["type"].as_array().is_some_and(|kinds| kinds.iter().any(is_number)) {
            keys.insert(path.to_owned());
            continue;
        }
        for choice in ["oneOf", "anyOf"] {
            schema[choice].as_array().into_iter().flatten().for_each(|one| numbers(root, one, path, keys));
        }
        for (key, inner) in schema["properties"].as_object().into_iter().flatten() {
            numbers(root, inner, format!("{path}.{key}").trim_start_matches('.'), keys);
        }
        for inner in
            ["items", "additionalProperties"].map(|keyword| &schema[keyword]).iter().filter(|s| s.is_object())
        {
            numbers(root, inner, path, keys);
        }
    }
}

/// Jobs with the keys of numbers that no job of the repository has.
const RARE: [&str; 7] = [
    r#"
[mesh.box]
size = [1, 1, 1]
cells = [2, 2, 2]
[material.elasticity]
youngs_modulus = 2
poisson_ratio = 0.25
expression = { shear_factor = 3, reference_strain = 6 }
[time]
end = 1
step = 0.25
scheme = "implicit_euler"
"#,
    r#"
[mesh.rectangle]
size = [1, 2]
cells = [3, 4]
[material]
hypothesis = "plane_strain"
density = 3
elasticity = { youngs_modulus = 2, poisson_ratio = 0.25 }
heat = { conductivity = 2, capacity = 3, expansion = 1e-5, reference = 293, dissipation_share = 0.9 }
[[heat]]
on = ["left"]
where = 1
flux = 5
[[contact]]
on = ["bottom"]
friction_heat = 0.5
normal.unilateral = {}
friction.expression.coefficient = "0.3/(1 + temperature/100)"
[initial]
temperature = 293
[time]
end = 1
step = 0.5
scheme = "bdf2"
"#,
    r#"
[mesh.box]
corner = [1, 2, 3]
size = [1, 2, 1]
cells = [3, 4, 2]
[material]
density = 1
elasticity = { youngs_modulus = 2, poisson_ratio = 0.25 }
damage = { threshold = 50, viscosity = 10, exponent = 2, largest = 0.9 }
[[support]]
on = ["left"]
where = "z < 0.5"
damping = { normal = 3, tangential = 4 }
[[traction]]
on = ["top"]
where = 1
value = [1, 2, 3]
[[support]]
on = ["right"]
where = 1
fix = ["x"]
[[contact]]
on = ["bottom"]
where = 1
normal.unilateral = {}
friction.coulomb.coefficient = 0.5
obstacle.sphere = { centre = [0.5, 0.5, -1], radius = 1.01, axis = [0, 1, 0] }
obstacle_load = { direction = [0, 0, 1], force = 2, velocity = 0.1, moment = 1, moment_of_inertia = 3, angular_velocity = 7 }
[[contact]]
on = ["front"]
normal.compliance = { stiffness = 3 }
obstacle.shape = { distance = 5, rotation = 1, axis = [0, 1, 0] }
[[contact]]
on = ["back"]
normal.compliance = { stiffness = 3 }
obstacle.sphere = { centre = [0.5, 8, 0.5], radius = 1.01, axis = [0, 1, 0], rotation = 2 }
[initial.stress]
xy = 1
yz = 2
xz = 3
[time]
end = 1
step = 0.25
land_on = [0.1, 0.2]
scheme = "implicit_euler"
[solver]
inclusion_tolerance = 1e-7
max_newton_iterations = 30
[output]
moments_about = [1, 2, 3]
compression = 3
fields = { at = [0, 0.5] }
profile = [{ on = "top" }]
profiles = { interval = 0.25 }
[checkpoint]
interval = 60
at = [0.5]
wall_limit = 3600
margin = 10
"#,
    r#"
[mesh.rectangle]
size = [1, 2]
cells = [3, 4]
[material]
hypothesis = "plane_strain"
density = 1
elasticity = { youngs_modulus = 2, poisson_ratio = 0.25 }
viscosity = { volumetric = 2, shear = 3 }
[[contact]]
on = ["bottom"]
normal.compliance = { stiffness = 10 }
adhesion = { stiffness = 5, tangential_stiffness = 6, energy = 7, viscosity = 8, length = 9 }
[[contact]]
on = ["top"]
normal.compliance = { stiffness = 10 }
obstacle.plane = { point = [0, 2], normal = [0, -1] }
friction.rate_and_state = { reference = 0.6, velocity = 1e-6, direct = 0.02, evolution = 0.01, distance = 3, initial_state = 2 }
[[contact]]
on = ["left"]
normal.displacement_graph = { points = [[0, 0], [1, 2]], gap = 0.1 }
[[contact]]
on = ["right"]
where = "y < 1"
normal.expression = { pressure = 4 }
[[contact]]
on = ["right"]
where = "y > 1"
normal.expression = { pressure = "1e3*max(d, 0)", gap = 0.1 }
friction.expression = { coefficient = 0.3 }
[time]
end = 1
step = 0.25
[output]
profile = [{ on = "top" }]
profiles = { every = 2 }
"#,
    r#"
[mesh.box]
size = [1, 2, 1]
cells = [3, 4, 2]
[material]
density = 1
viscosity = { volumetric = 2, shear = 3 }
[[contact]]
on = ["bottom"]
normal.unilateral = {}
friction.coulomb.coefficient = 0.5
obstacle.plane = { point = [0, 0, 0], normal = [0, 0, 1], rotation = 10 }
[time]
end = 1
step = 0.25
[output]
profile = [{ on = "top" }]
profiles = { at = [0.5] }
"#,
    r#"
[mesh]
file = "any.msh"
scale = 0.5
rotate = { angle = 30, axis = [0, 1, 2] }
translate = [1, 2, 3]
[material]
density = 1
elasticity = { youngs_modulus = 2, poisson_ratio = 0.25 }
viscoplasticity.expression = { rate = 0, reference_stress = 5 }
viscosity.expression = { shear = 3, bulk = 2, reference_rate = 6 }
[time]
end = 1
step = 0.25
"#,
    r#"
[mesh.box]
size = [1, 1, 1]
cells = [2, 2, 2]
[material.orthotropic]
youngs_moduli = [3, 2, 1]
poisson_ratios = [0.1, 0.2, 0.3]
shear_moduli = [1, 2, 3]
axes = [[1, 0, 0], [0, 1, 0]]
[[region]]
name = "body"
[region.material.orthotropic]
youngs_moduli = [3, 2, 1]
poisson_ratios = [0.1, 0.2, 0.3]
shear_moduli = [1, 2, 3]
axes = [[1, 0, 0], [0, 1, 0]]
[[support]]
on = ["left"]
fix = "all"
[time]
end = 1
step = 0.25
scheme = "implicit_euler"
"#,
];

/// Keys that an effective job has only where they differ from their default.
const SKIPPED: [&str; 3] = ["mesh.order", "mesh.rectangle.corner", "mesh.box.corner"];

#[test]
fn a_parameter_can_take_the_place_of_every_number() {
    let mut keys = BTreeSet::new();
    let files = jobs().into_iter().map(|file| (std::fs::read_to_string(&file).expect("a job"), file));
    let rare = RARE.map(|text| (text.to_owned(), PathBuf::from("/anywhere/rare.toml")));
    for (text, file) in files.chain(rare).filter(|(text, _)| !text.contains("[parameters]")) {
        let read = |text: &str| {
            let job = Job::from_text(text, "case.toml", file.parent().expect("folder"), &[]);
            job.unwrap_or_else(|error| panic!("{}: {error}", file.display()))
        };
        let plain = read(&text);
        let mut document = Value::Table(text.parse().expect("TOML"));
        let mut parameters = Table::new();
        let replaced = replace(&mut document, "", &mut parameters);
        let table = document.as_table_mut().expect("a table");
        table.insert("parameters".into(), Value::Table(parameters));
        let loaded = read(&toml::to_string(table).expect("TOML"));
        assert_eq!(loaded.warnings, plain.warnings, "{}", file.display());
        let bare = Job { parameters: BTreeMap::new(), written: Written::default(), ..loaded.job.clone() };
        assert_eq!(bare, plain.job, "{}", file.display());
        // The effective job has the same parameters in the same places, except at keys that it lacks because they have their default.
        let written = loaded.job.to_toml().expect("written");
        assert_eq!(read(&written).job.to_toml().as_ref(), Ok(&written));
        for (number, key) in replaced.iter().enumerate() {
            let is_there = written.contains(&format!("\"p{number}\""));
            assert!(is_there || SKIPPED.contains(&&**key), "{}: {key} in {written}", file.display());
        }
        keys.extend(replaced);
    }
    let schema: serde_json::Value = serde_json::from_str(&describe_json()).expect("JSON");
    let mut all = BTreeSet::new();
    numbers(&schema, &schema, "", &mut all);
    // Each number of [check] has a name of its own, and regions have the keys of the material.
    let is_free = |key: &&String| key.starts_with("check.") || *key == "parameters";
    let plain = |key: &str| key.trim_start_matches("region.").to_owned();
    let keys: BTreeSet<String> = keys.iter().map(|key| plain(key)).collect();
    let others: Vec<&String> =
        all.iter().filter(|key| !keys.contains(&plain(key)) && !is_free(key)).collect();
    assert!(others.is_empty() && all.len() > 100, "numbers in no job: {others:#?}");
}
