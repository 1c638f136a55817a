//! Checks of contact laws, of their combinations, and of obstacles.

use super::boundary::{check_flat, check_vector};
use super::findings::{Findings, MeshNames, items};
use crate::job::document::Method;
use crate::job::source::Node;
use crate::laws::contact::{Adhesion, ContactTable, Gap, Interface, NormalLaw};
use crate::laws::schemes::Scheme;

/// Checks that do not depend on the mesh.
pub(super) fn check(findings: &mut Findings<'_>) {
    let root = findings.root;
    let tables: Vec<ContactTable> =
        items(root, "contact").into_iter().map(|path| table(root, path)).collect();
    check_method(findings, &tables);
    check_strengths(findings, &tables);
    for table in tables {
        for fault in table.faults() {
            let key = format!("{}.{}", table.interface.path, fault.key);
            if fault.is_at_key {
                findings.fault_at_key(&key, fault.message, fault.help);
            } else {
                findings.fault(&key, fault.message, fault.help);
            }
        }
        let warning = table.adhesion.as_ref().and_then(Adhesion::warning);
        findings
            .warnings
            .extend(warning.map(|warning| format!("{}.adhesion: {warning}", table.interface.path)));
        check_obstacle(findings, &table.interface.path);
        check_redistribution(findings, &table.interface.path);
    }
}

/// Stresses from the previous step would leave the velocity of a boundary without mass undetermined.
fn check_redistribution(findings: &mut Findings<'_>, contact: &str) {
    let (root, key) = (findings.root, format!("{contact}.redistribute_mass"));
    let scheme: Scheme = root.read("time.scheme").unwrap_or_default();
    if root.read(&key).unwrap_or(false) && !scheme.is_implicit() {
        let message = format!("scheme \"{}\" cannot solve for a boundary without mass", scheme.name());
        findings.fault(
            &key,
            message,
            "use [time] scheme = \"bdf2\" or \"implicit_euler\", or delete the key",
        );
    }
}

/// The readable contents of the table at this path.
fn table(root: &Node, path: String) -> ContactTable {
    let key = |key: &str| format!("{path}.{key}");
    let obstacle: Option<Gap> = root.read(&key("obstacle"));
    ContactTable {
        quadrature: root.read(&key("quadrature")).unwrap_or_default(),
        obstacle_load: root.read(&key("obstacle_load")),
        adhesion: root.read(&key("adhesion")),
        memory: root.read(&key("memory")),
        wear: root.read(&key("wear")),
        interface: Interface {
            normal: root.read(&key("normal")),
            friction: root.read(&key("friction")),
            has_obstacle: root.find(&key("obstacle")).is_some(),
            obstacle_moves: obstacle.is_some_and(|obstacle| obstacle.surface_may_move())
                || root.find(&key("obstacle_load")).is_some(),
            path,
        },
    }
}

/// PETSc's solver for variational inequalities supports bounds only.
fn check_method(findings: &mut Findings<'_>, tables: &[ContactTable]) {
    if findings.root.read("solver.method") != Some(Method::Vinewtonrsls) {
        return;
    }
    let is_bound = |table: &ContactTable| {
        table.interface.normal.as_ref().is_some_and(NormalLaw::is_bound) && table.interface.friction.is_none()
    };
    if tables.is_empty() || !tables.iter().all(is_bound) {
        let message = "this method requires that every contact is frictionless and `unilateral`";
        findings.fault("solver.method", message, "use \"newton\", or delete the key");
    }
}

/// Where boundaries meet, the bonds of a node break together: by one rule.
fn check_strengths(findings: &mut Findings<'_>, tables: &[ContactTable]) {
    let bonded = || tables.iter().filter_map(|table| Some((table, table.adhesion?.strength.is_some())));
    let Some((_, first)) = bonded().next() else { return };
    for (table, _) in bonded().filter(|(_, has_strength)| *has_strength != first) {
        let key = format!("{}.adhesion", table.interface.path);
        let message = "either all adhesion tables of a job have a `strength` or none has";
        findings.fault_at_key(&key, message, "give all of them a strength, or delete the key everywhere");
    }
}

/// Vectors of an obstacle.
const OBSTACLE_VECTORS: [&str; 4] = ["plane.point", "plane.normal", "sphere.centre", "shape.centre"];
/// Obstacles that rotate about their centre and, in space, an axis.
const ROUND_OBSTACLES: [&str; 2] = ["sphere", "shape"];

/// The paths of the rotations that an obstacle may have.
fn rotations(obstacle: &str) -> impl Iterator<Item = String> {
    ["plane"].into_iter().chain(ROUND_OBSTACLES).map(move |kind| format!("{obstacle}.{kind}.rotation"))
}

/// An obstacle is rigid, and its normal and axis must not be zero.
fn check_obstacle(findings: &mut Findings<'_>, contact: &str) {
    let root = findings.root;
    let obstacle = format!("{contact}.obstacle");
    if root.find(&obstacle).is_none() {
        return;
    }
    for rotation in rotations(&obstacle) {
        if root.find(&rotation).is_some() && root.find(&format!("{contact}.friction")).is_none() {
            findings.warnings.push(format!(
                "{rotation}: the rotation of an obstacle affects friction only, and this contact has no friction"
            ));
        }
    }
    for axis in ROUND_OBSTACLES.map(|kind| format!("{obstacle}.{kind}.axis")) {
        let given: Option<Vec<f64>> = root.read(&axis);
        if given.is_some_and(|axis| !axis.is_empty() && axis.iter().all(|&x| x == 0.0)) {
            findings.fault(
                &axis,
                "the axis is the zero vector",
                "give the direction of the axis of rotation",
            );
        }
    }
    check_shape(findings, &format!("{obstacle}.shape"));
    check_moment(findings, contact);
    let normal: Option<Vec<f64>> = root.read(&format!("{obstacle}.plane.normal"));
    if normal.is_some_and(|normal| !normal.is_empty() && normal.iter().all(|&x| x == 0.0)) {
        let help = "give the normal that points out of the obstacle toward the body";
        findings.fault(&format!("{obstacle}.plane.normal"), "the normal is the zero vector", help);
    }
}

/// A moment turns what has a centre and does not turn otherwise.
fn check_moment(findings: &mut Findings<'_>, contact: &str) {
    let root = findings.root;
    let moment = format!("{contact}.obstacle_load.moment");
    if root.find(&moment).is_none() {
        return;
    }
    if root.find(&format!("{contact}.obstacle.plane")).is_some() {
        let help = "use a sphere or a shape, or give the plane a `rotation`";
        findings.fault_at_key(
            &moment,
            "a moment turns a sphere or a shape about its centre, not a plane",
            help,
        );
    }
    for rotation in rotations(&format!("{contact}.obstacle")).filter(|rotation| root.find(rotation).is_some())
    {
        findings.fault_at_key(
            &rotation,
            "the obstacle turns by a moment or by its `rotation`, not both",
            "delete one of them",
        );
    }
}

/// A shape has either the expression of a distance or a surface; only a surface has a unit.
fn check_shape(findings: &mut Findings<'_>, shape: &str) {
    let root = findings.root;
    if root.find(shape).is_none() {
        return;
    }
    let [distance, surface, scale] = ["distance", "surface", "scale"].map(|key| format!("{shape}.{key}"));
    let has = |path: &str| root.find(path).is_some();
    match (has(&distance), has(&surface)) {
        (false, false) => {
            let help = "add distance = \"..\", an expression, or surface = \"..\", an STL file";
            findings.fault(shape, "this shape has neither `distance` nor `surface`", help);
        }
        (true, true) => {
            let help = "delete one of them";
            findings.fault_at_key(&surface, "a shape has a distance or a surface, not both", help);
        }
        (true, false) if has(&scale) => {
            let help = "delete it, or write the unit into the expression";
            findings.fault_at_key(&scale, "only a `surface` has a scale", help);
        }
        _ => {}
    }
}

/// Checks that depend on the dimension.
pub(super) fn check_names(findings: &mut Findings<'_>, mesh: MeshNames<'_>) {
    for contact in items(findings.root, "contact") {
        let normal: Option<NormalLaw> = findings.root.read(&format!("{contact}.normal"));
        if let Some(gap) = normal.and_then(|law| law.gap_key()) {
            check_flat(findings, &format!("{contact}.{gap}"), mesh.dimension);
        }
        for vector in OBSTACLE_VECTORS {
            check_vector(findings, &format!("{contact}.obstacle.{vector}"), mesh.dimension);
        }
        check_vector(findings, &format!("{contact}.obstacle_load.direction"), mesh.dimension);
        check_flat(findings, &format!("{contact}.obstacle.shape.distance"), mesh.dimension);
        let surface = format!("{contact}.obstacle.shape.surface");
        if mesh.dimension == 2 && findings.root.find(&surface).is_some() {
            let help = "give its distance as an expression of x and y: `distance`";
            findings.fault_at_key(&surface, "a triangulated surface is an obstacle in 3D only", help);
        }
        check_rotation(findings, &format!("{contact}.obstacle"), mesh.dimension);
    }
}

/// In 2D a disc or shape rotates about its centre, and a line does not rotate; in 3D a sphere or shape needs an axis.
fn check_rotation(findings: &mut Findings<'_>, obstacle: &str, dimension: usize) {
    let root = findings.root;
    let has = |key: &str| root.find(key).is_some();
    let plane = format!("{obstacle}.plane.rotation");
    if dimension == 2 && has(&plane) {
        let help = "delete it; for a belt, let `point` move along the line; for a tilting line, let `normal` depend on t";
        findings.fault(&plane, "in 2D a plane cannot rotate about its normal", help);
    }
    for kind in ROUND_OBSTACLES {
        let [rotation, axis] = ["rotation", "axis"].map(|key| format!("{obstacle}.{kind}.{key}"));
        if dimension == 2 && has(&axis) {
            let message = format!("in 2D a {kind} has no axis: it rotates about its centre");
            findings.fault(&axis, message, "delete the axis");
        }
        if dimension == 2 {
            continue;
        }
        let moment = obstacle.replace(".obstacle", ".obstacle_load.moment");
        if (has(&rotation) || (has(&moment) && has(&format!("{obstacle}.{kind}")))) && !has(&axis) {
            let help = "add `axis = [x, y, z]`, the direction of the axis of rotation";
            let at = if has(&rotation) { &rotation } else { &moment };
            findings.fault(at, "in 3D a rotation needs an axis", help);
        }
        if has(&axis) && !has(&rotation) && !has(&moment) {
            let help = "add `rotation`, or delete the axis";
            findings.fault(&axis, "an axis without `rotation` has no effect", help);
        }
        check_vector(findings, &axis, dimension);
    }
}
