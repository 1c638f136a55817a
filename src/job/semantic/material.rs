//! Checks of materials: effects that require other effects, and the dimension.

use super::boundary::check_flat;
use super::findings::{Findings, MeshNames, items};
use crate::job::document::Diagonal;
use crate::laws::expression::Scalar;
use crate::laws::law::header;
use crate::laws::material::{Elasticity, Hypothesis, Material, Viscoplasticity, Viscosity};

/// Poisson's ratio above which linear elements lock.
const LOCKING: f64 = 0.45;

fn materials(findings: &Findings<'_>) -> Vec<String> {
    let regions = items(findings.root, "region").into_iter().map(|region| format!("{region}.material"));
    std::iter::once("material".to_owned()).chain(regions).collect()
}

/// Checks that do not depend on the dimension.
pub(super) fn check(findings: &mut Findings<'_>) {
    let root = findings.root;
    for path in materials(findings) {
        let Some(material) = root.find(&path) else { continue };
        let present = |key: &str| material.child(key).is_some();
        let may_be_empty = path == "material" && root.count("region") > 0;
        if !may_be_empty && !["density", "elasticity", "viscosity"].into_iter().any(present) {
            let [whole, elasticity, viscosity] =
                ["", ".elasticity", ".viscosity"].map(|key| header(&(path.clone() + key)));
            let message = format!("{whole} has no density, no elasticity and no viscosity");
            findings.fault(&path, message, format!("add density, {elasticity} or {viscosity}"));
        }
        for (key, message) in Material::REQUIRING_ELASTICITY {
            if present(key) && !present("elasticity") {
                findings.fault(
                    &format!("{path}.{key}"),
                    message,
                    format!("add {}", header(&format!("{path}.elasticity"))),
                );
            }
        }
        for name in Viscoplasticity::NAMES {
            let law: Option<Viscoplasticity<Scalar>> =
                root.read_choice(&format!("{path}.viscoplasticity"), name);
            // Expressions are checked in each cell.
            let number = |law: &Viscoplasticity<Scalar>| match law.yield_stress() {
                Some(Scalar::Expression(_)) => None,
                Some(Scalar::Number(number)) => Some(*number),
                None => Some(0.0),
            };
            let law = law.and_then(|law| Some(law.with_yield_stress(number(&law)?)));
            if let Some(fault) = law.and_then(|law| law.fault()) {
                let key = format!("{path}.viscoplasticity.{name}.{}", fault.key);
                findings.fault(&key, fault.message, fault.help);
            }
        }
        if path != "material" && present("hypothesis") {
            let message = "the hypothesis applies to the whole body";
            findings.fault(&format!("{path}.hypothesis"), message, "give it in [material] only");
        }
    }
    let mut seen = Vec::new();
    for region in items(root, "region") {
        let key = format!("{region}.name");
        let Some(name) = root.read::<String>(&key) else { continue };
        if seen.contains(&name) {
            findings.fault(
                &key,
                format!("two regions have the name \"{name}\""),
                "give each region its own name",
            );
        }
        seen.push(name);
    }
}

/// Cells that belong to no region have the main material, which may be empty only if there are no such cells.
pub(super) fn check_names(findings: &mut Findings<'_>, mesh: MeshNames<'_>) {
    let root = findings.root;
    let names: Vec<String> =
        items(root, "region").into_iter().filter_map(|r| root.read(&format!("{r}.name"))).collect();
    let Some(material) = root.find("material") else { return };
    let resists = ["density", "elasticity", "viscosity"].into_iter().any(|key| material.child(key).is_some());
    let other = mesh.regions.iter().find(|region| !names.iter().any(|name| name == *region));
    if let (Some(other), false, false) = (other, resists, names.is_empty()) {
        let message = format!(
            "the region \"{other}\" of the mesh has the material of [material], which has no density, no elasticity and no viscosity"
        );
        findings.fault("material", message, "add density, elasticity or viscosity, or a [[region]] for it");
    }
}

/// Checks that depend on the dimension.
pub(super) fn check_dimension(findings: &mut Findings<'_>, dimension: usize) {
    let root = findings.root;
    let hypothesis: Option<Hypothesis> = root.read("material.hypothesis");
    let given = root.find("material.hypothesis").is_some();
    if dimension == 2 && !given && root.find("material").is_some() {
        let message = "a 2D body needs a hypothesis";
        findings.fault(
            "material",
            message,
            "add hypothesis = \"plane_stress\" or \"plane_strain\" to [material]",
        );
    }
    if dimension == 3 && given {
        findings.fault("material.hypothesis", "a 3D body has no hypothesis", "delete this line");
    }
    for path in materials(findings) {
        for key in Material::variable_keys() {
            check_flat(findings, &format!("{path}.{key}"), dimension);
        }
        // Expressions are checked in each cell.
        let viscosity: Option<Viscosity> = root.read(&format!("{path}.viscosity"));
        if let Some(fault) = viscosity.and_then(|law| law.fault(dimension)) {
            findings.fault(&format!("{path}.viscosity.{}", fault.key), fault.message, fault.help);
        }
        if hypothesis == Some(Hypothesis::PlaneStress) {
            continue;
        }
        if root.read("mesh.order") == Some(2) {
            continue;
        }
        let remedy = if dimension == 2 {
            "[mesh] order = 2 does not lock, nor does a rectangle with diagonal = \"crossed\" (docs/stability.md)"
        } else {
            "[mesh] order = 2 hardly locks (docs/stability.md)"
        };
        if let Some(Elasticity::<Scalar> { poisson_ratio, .. }) = root.read(&format!("{path}.elasticity"))
            && poisson_ratio > LOCKING
        {
            findings.warnings.push(format!(
                "{path}.elasticity.poisson_ratio = {poisson_ratio}: linear elements lock above {LOCKING}; \
                 expect displacements that are too small; {remedy}"
            ));
        }
        let crossed = root.read("mesh.rectangle.diagonal") == Some(Diagonal::Crossed);
        let law: Option<Viscoplasticity<Scalar>> = root.read(&format!("{path}.viscoplasticity"));
        if !crossed && law.is_some_and(|law| law.with_yield_stress(0.0).keeps_volume()) {
            findings.warnings.push(format!(
                "{path}.viscoplasticity conserves volume: linear elements lock where they and their neighbours flow, for any Poisson's ratio; expect a load capacity that is too high, by 10 to 30 % on common meshes; {remedy}"
            ));
        }
    }
    let known: &[&str] = if dimension == 2 { &["x", "y"] } else { &["x", "y", "z"] };
    for support in items(root, "support") {
        for key in items(root, &format!("{support}.fix")) {
            if dimension == 2 && root.read::<String>(&key).as_deref() == Some("z") {
                let help = format!("allowed: {}", known.join(", "));
                findings.fault(&key, "a 2D body has no z component", help);
            }
        }
    }
}
