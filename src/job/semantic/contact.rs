//! Contact laws: graphs that have a relaxed monotonicity, friction that falls the right way.

use super::boundary::{check_flat, check_vector};
use super::{Findings, MeshNames, items};
use crate::expression::Scalar;
use crate::job::document::{Adhesion, Bound, DampedResponse, Graph, Method, Quadrature, SlipWeakening};

/// Whatever the mesh.
pub fn check(findings: &mut Findings<'_>) {
    check_method(findings);
    for contact in items(findings.root, "contact") {
        check_damped_response(findings, &format!("{contact}.normal.damped_response"));
        check_graph(findings, &format!("{contact}.normal.graph.points"));
        check_quadrature(findings, &contact);
        check_adhesion(findings, &contact);
        check_memory(findings, &contact);
        check_bound(findings, &format!("{contact}.normal.unilateral"));
        check_obstacle(findings, &contact);
        let path = format!("{contact}.friction.slip_weakening");
        if let Some(SlipWeakening { at_rest, dynamic, .. }) = findings.root.read(&path)
            && at_rest < dynamic
        {
            let message = "the static coefficient is below the dynamic one";
            findings.fault(&format!("{path}.static"), message, format!("it must be at least {dynamic}"));
        }
    }
}

/// PETSc's solver for variational inequalities knows bounds only.
fn check_method(findings: &mut Findings<'_>) {
    let root = findings.root;
    if root.read("solver.method") != Some(Method::Vinewtonrsls) {
        return;
    }
    let contacts = items(root, "contact");
    let bounds = |contact: &String| {
        let has = |key: &str| root.find(&format!("{contact}.{key}")).is_some();
        has("normal.unilateral") && !has("friction")
    };
    if contacts.is_empty() || !contacts.iter().all(bounds) {
        let message = "this method solves frictionless contact whose every normal law is `unilateral`";
        findings.fault("solver.method", message, "use \"newton\", or leave the key out");
    }
}

/// Gauss points know neither jumps nor the displacement nor friction.
fn check_quadrature(findings: &mut Findings<'_>, contact: &str) {
    let root = findings.root;
    if root.read::<Quadrature>(&format!("{contact}.quadrature")) != Some(Quadrature::Gauss) {
        return;
    }
    if root.find(&format!("{contact}.friction")).is_some() {
        let message = "friction does not act at Gauss points";
        findings.fault(&format!("{contact}.quadrature"), message, "use \"nodal\", or leave the key out");
    }
    let graph: Option<Graph> = root.read(&format!("{contact}.normal.graph"));
    let jumps = graph.is_some_and(|graph| graph.points.windows(2).any(|pair| pair[0][0] == pair[1][0]));
    let displaced = ["compliance", "unilateral"]
        .into_iter()
        .any(|law| root.find(&format!("{contact}.normal.{law}")).is_some());
    if jumps || displaced {
        let message = "this contact law does not act at Gauss points";
        findings.fault(&format!("{contact}.quadrature"), message, "use \"nodal\", or leave the key out");
    }
}

/// Bonds are at nodes, and between what touches at first.
fn check_adhesion(findings: &mut Findings<'_>, contact: &str) {
    let root = findings.root;
    let path = format!("{contact}.adhesion");
    if root.find(&path).is_none() {
        return;
    }
    if root.read::<Quadrature>(&format!("{contact}.quadrature")) == Some(Quadrature::Gauss) {
        let message = "adhesion does not act at Gauss points";
        let help = "use \"nodal\", or leave the key out";
        findings.fault(&format!("{contact}.quadrature"), message, help);
    }
    for law in ["compliance", "unilateral"] {
        let gap = format!("{contact}.normal.{law}.gap");
        if root.find(&gap).is_some() {
            let message = "adhesion binds what touches at first: there is no gap";
            findings.fault(&gap, message, format!("delete it, or [{path}]"));
        }
    }
    if let Some(Adhesion { stiffness, tangential_stiffness, energy, length: Some(length), .. }) =
        root.read(&path)
    {
        let most = (stiffness + tangential_stiffness.unwrap_or(0.0)) * length * length;
        if most <= energy && most > 0.0 {
            findings.warnings.push(format!(
                "{path}: at its length a bond has the energy {most} J/m^2, not above {energy}: no bond ever gives way"
            ));
        }
    }
}

/// What is remembered is how far a foundation that touches at first was pressed in; friction sees the normal law alone.
fn check_memory(findings: &mut Findings<'_>, contact: &str) {
    let root = findings.root;
    let path = format!("{contact}.memory");
    if root.find(&path).is_none() {
        return;
    }
    if root.read::<Quadrature>(&format!("{contact}.quadrature")) == Some(Quadrature::Gauss) {
        let help = "use \"nodal\", or leave the key out";
        findings.fault(&format!("{contact}.quadrature"), "memory does not act at Gauss points", help);
    }
    let memory_or = |other: &str| format!("delete it, or [{path}]{other}");
    for (key, message, other) in [
        ("normal.unilateral", "a rigid obstacle is never pressed in: there is nothing to remember", ""),
        ("normal.compliance.gap", "memory is of what touches at first: there is no gap", ""),
        ("obstacle", "memory is of what touches at first: there is no obstacle that moves", ""),
        (
            "friction.coulomb",
            "this friction follows the pressure of the normal law, which memory is not part of",
            ", or use tresca",
        ),
        (
            "friction.slip_weakening",
            "this friction follows the pressure of the normal law, which memory is not part of",
            ", or use tresca",
        ),
    ] {
        let place = format!("{contact}.{key}");
        if root.find(&place).is_some() {
            findings.fault_at_key(&place, message, memory_or(other));
        }
    }
}

/// A bound on the velocity knows no gap.
fn check_bound(findings: &mut Findings<'_>, path: &str) {
    let gap = format!("{path}.gap");
    if findings.root.read(&format!("{path}.bound")) == Some(Bound::Velocity)
        && findings.root.find(&gap).is_some()
    {
        findings.fault(&gap, "a bound on the velocity has no gap", "delete it, or bound the displacement");
    }
}

/// Vectors of an obstacle.
const OBSTACLE_VECTORS: [&str; 3] = ["plane.point", "plane.normal", "sphere.centre"];
/// How an obstacle turns.
const OBSTACLE_ROTATIONS: [&str; 2] = ["plane.rotation", "sphere.rotation"];

/// An obstacle is for laws that know a gap, stands in for it, and moves as one.
fn check_obstacle(findings: &mut Findings<'_>, contact: &str) {
    let root = findings.root;
    let obstacle = format!("{contact}.obstacle");
    if root.find(&obstacle).is_none() {
        return;
    }
    let law = |name: &str| format!("{contact}.normal.{name}");
    let known = ["damped_response", "graph"].into_iter().find(|name| root.find(&law(name)).is_some());
    if let Some(name) = known {
        let message = format!("`{name}` acts at any distance: it has no obstacle");
        findings.fault_at_key(&obstacle, message, "delete the obstacle, or use `compliance` or `unilateral`");
    }
    if root.read(&law("unilateral.bound")) == Some(Bound::Velocity) {
        let help = "delete the obstacle, or bound the displacement";
        findings.fault_at_key(&obstacle, "a bound on the velocity has no obstacle", help);
    }
    for gap in ["compliance.gap", "unilateral.gap"].map(law) {
        if root.find(&gap).is_some() {
            findings.fault_at_key(
                &gap,
                "`gap` beside [contact.obstacle]",
                "give one of them: the obstacle says how far it is",
            );
        }
    }
    let components = OBSTACLE_VECTORS.map(|vector| items(root, &format!("{obstacle}.{vector}")));
    let rotations = OBSTACLE_ROTATIONS.map(|rotation| format!("{obstacle}.{rotation}"));
    for scalar in components.into_iter().flatten().chain(rotations.clone()) {
        if root.read::<Scalar>(&scalar).is_some_and(|scalar| scalar.depends_on_position()) {
            let help = "use t only; `gap` in the law may depend on x, y and z";
            findings.fault(&scalar, "a rigid obstacle moves as one", help);
        }
    }
    for rotation in rotations {
        if root.find(&rotation).is_some() && root.find(&format!("{contact}.friction")).is_none() {
            findings.warnings.push(format!(
                "{rotation}: only friction feels how an obstacle turns in itself, and there is none on this contact"
            ));
        }
    }
    let axis = format!("{obstacle}.sphere.axis");
    if root.read::<Vec<f64>>(&axis).is_some_and(|axis| !axis.is_empty() && axis.iter().all(|&x| x == 0.0)) {
        findings.fault(&axis, "this axis has no direction", "let it point along what the sphere turns about");
    }
    let normal: Option<Vec<f64>> = root.read(&format!("{obstacle}.plane.normal"));
    if normal.is_some_and(|normal| !normal.is_empty() && normal.iter().all(|&x| x == 0.0)) {
        let help = "let it point out of the obstacle toward the body";
        findings.fault(&format!("{obstacle}.plane.normal"), "this normal has no direction", help);
    }
}

fn check_damped_response(findings: &mut Findings<'_>, path: &str) {
    let root = findings.root;
    let key = format!("{path}.breakpoints");
    let breakpoints: Option<Vec<f64>> = root.read(&key);
    let mut last = 0.0;
    for (index, &breakpoint) in breakpoints.iter().flatten().enumerate() {
        if breakpoint <= last {
            let help = "they are velocities above zero, each larger than the one before";
            findings.fault(&format!("{key}.{index}"), "breakpoints must ascend from zero", help);
        }
        last = breakpoint;
    }
    if let Some(DampedResponse { breakpoints, slopes, .. }) = root.read(path)
        && slopes.len() != breakpoints.len() + 1
    {
        let message = format!("{} slope(s) for {} breakpoint(s)", slopes.len(), breakpoints.len());
        let help = "one slope before, between and after the breakpoints: one more than breakpoints";
        findings.fault(&format!("{path}.slopes"), message, help);
    }
}

fn check_graph(findings: &mut Findings<'_>, path: &str) {
    let points: Vec<[f64; 2]> = findings.root.read(path).unwrap_or_default();
    for (index, pair) in points.windows(2).enumerate() {
        let ([before, low], [after, high]) = (pair[0], pair[1]);
        let key = format!("{path}.{}", index + 1);
        if after < before {
            findings.fault(
                &key,
                "the velocities of a graph must ascend",
                format!("it must be at least {before}"),
            );
        } else if after == before && high < low {
            let message =
                "a downward jump has no relaxed monotonicity: no step is small enough to be solvable";
            let help = "order the two points upwards, or let the pressure fall along a steep slope";
            findings.fault(&key, message, help);
        } else if after == before && high == low {
            findings.fault(&key, "this point is there twice", "delete one");
        }
    }
    for (index, three) in points.windows(3).enumerate() {
        if three[0][0] == three[2][0] {
            let help = "two points with the same velocity are a jump; the ones between say nothing";
            findings.fault(&format!("{path}.{}", index + 2), "three points with the same velocity", help);
        }
    }
}

/// What depends on the dimension.
pub fn check_names(findings: &mut Findings<'_>, mesh: MeshNames<'_>) {
    for contact in items(findings.root, "contact") {
        for law in ["compliance", "unilateral"] {
            check_flat(findings, &format!("{contact}.normal.{law}.gap"), mesh.dimension);
        }
        for vector in OBSTACLE_VECTORS {
            check_vector(findings, &format!("{contact}.obstacle.{vector}"), mesh.dimension);
        }
        check_rotation(findings, &format!("{contact}.obstacle"), mesh.dimension);
    }
}

/// In the plane a disc turns about its centre and a line about nothing; in space a sphere needs an axis.
fn check_rotation(findings: &mut Findings<'_>, obstacle: &str, dimension: usize) {
    let root = findings.root;
    let [plane, sphere] = OBSTACLE_ROTATIONS.map(|rotation| format!("{obstacle}.{rotation}"));
    let axis = format!("{obstacle}.sphere.axis");
    let has = |key: &str| root.find(key).is_some();
    if dimension == 2 {
        if has(&plane) {
            let help = "delete it; let `point` move along the line for a belt, or let `normal` depend on t for a line that tilts";
            findings.fault(&plane, "in 2D a plane can't turn in itself", help);
        }
        if has(&axis) {
            findings.fault(&axis, "in 2D a sphere turns about its centre", "delete the axis");
        }
        return;
    }
    if has(&sphere) && !has(&axis) {
        let help = "add `axis = [x, y, z]`, what the sphere turns about";
        findings.fault(&sphere, "in 3D a rotation needs an axis", help);
    }
    if has(&axis) && !has(&sphere) {
        findings.fault(
            &axis,
            "an axis without `rotation` turns nothing",
            "add `rotation`, or delete the axis",
        );
    }
    check_vector(findings, &axis, dimension);
}
