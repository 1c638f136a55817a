//! Checks of probes, profiles and expected results.

use super::boundary::{check_name, check_repeats};
use super::findings::{Findings, MeshNames, items};
use crate::job::report::Fault;
use crate::job::source::Value;
use crate::laws::law::header;

/// Checks that do not depend on the mesh.
pub(super) fn check(findings: &mut Findings<'_>) {
    check_unique(findings, "output.probe", "name", "probes are called");
    check_unique(findings, "output.profile", "on", "profiles are along");
    if findings.root.find("output.profiles").is_some() && findings.root.count("output.profile") == 0 {
        let help = "name a boundary with [[output.profile]] on = \"...\", or leave the key out";
        findings.fault_at_key("output.profiles", "there are no profiles to write", help);
    }
    check_repeats(findings, "output.also", "field");
    check_expected(findings);
    check_indicator(findings);
}

/// The error indicator uses the elastic energy norm, so that every material needs elasticity.
fn check_indicator(findings: &mut Findings<'_>) {
    let root = findings.root;
    if root.read("output.error_indicator") != Some(true) {
        return;
    }
    let of_region = |region: String| format!("{region}.material");
    let materials =
        std::iter::once("material".to_owned()).chain(items(root, "region").into_iter().map(of_region));
    for material in materials {
        if root.find(&material).is_some() && root.find(&format!("{material}.elasticity")).is_none() {
            let table = header(&format!("{material}.elasticity"));
            let region =
                material.strip_suffix(".material").and_then(|region| root.read(&format!("{region}.name")));
            let whose = region.map_or(String::new(), |name: String| format!(" of region \"{name}\""));
            let message = format!("the error indicator needs {table}{whose}");
            let help = "it measures stress errors in the elastic energy norm: add elasticity, or delete error_indicator";
            findings.fault("output.error_indicator", message, help);
        }
    }
}

fn check_unique(findings: &mut Findings<'_>, list: &str, key: &str, words: &str) {
    let mut seen = Vec::new();
    for entry in items(findings.root, list) {
        let path = format!("{entry}.{key}");
        let Some(name) = findings.root.read::<String>(&path) else { continue };
        if seen.contains(&name) {
            findings.fault(&path, format!("two {words} \"{name}\""), "delete one, or change it");
        }
        seen.push(name);
    }
}

fn check_expected(findings: &mut Findings<'_>) {
    let root = findings.root;
    let Some(Value::Table(expected)) = root.find("check").map(|node| &node.value) else { return };
    let probes: Vec<String> = items(root, "output.probe")
        .iter()
        .filter_map(|probe| root.read::<String>(&format!("{probe}.name")))
        .collect();
    for (quantity, node) in expected {
        let mut fault = |message: String, help: String| {
            findings.faults.push(Fault::new(node.key.clone(), message, "").help(help));
        };
        if node.child("value").is_some()
            && node.child("relative").is_none()
            && node.child("absolute").is_none()
        {
            let help = "add relative = 1e-6, or absolute in the quantity's own unit";
            fault(format!("\"{quantity}\" has no tolerance"), help.to_owned());
        }
        let Some(name) = quantity.strip_prefix("probe.").map(|rest| rest.split('.').next().unwrap_or(rest))
        else {
            continue;
        };
        if !probes.iter().any(|probe| probe == name) {
            findings.warnings.push(format!("[check] \"{quantity}\": the job has no probe \"{name}\""));
        }
    }
}

/// Checks that depend on the dimension and the names of the mesh.
pub(super) fn check_names(findings: &mut Findings<'_>, mesh: MeshNames<'_>) {
    let root = findings.root;
    let size: Option<Vec<f64>> = root.read("mesh.rectangle.size").or_else(|| root.read("mesh.box.size"));
    for probe in items(root, "output.probe") {
        let path = format!("{probe}.point");
        let Some(point) = root.read::<Vec<f64>>(&path) else { continue };
        if point.len() != mesh.dimension {
            let message = format!("`{path}` has {} coordinate(s)", point.len());
            findings.fault(&path, message, format!("a {0}D body needs {0}", mesh.dimension));
        } else if let Some(size) = &size
            && point.iter().zip(size).any(|(x, length)| *x < 0.0 || *x > *length)
        {
            let help = format!("the body reaches from the origin to {size:?}");
            findings.fault(&path, "this probe lies outside the body", help);
        }
    }
    for profile in items(root, "output.profile") {
        let path = format!("{profile}.on");
        let Some(name) = root.read::<String>(&path) else { continue };
        if !mesh.inner.iter().any(|[inner, _]| *inner == name) {
            check_name(findings, &path, &name, mesh.boundaries, "boundary");
        }
    }
}
