//! Contact laws: graphs that have a relaxed monotonicity, friction that falls the right way.

use super::boundary::check_flat;
use super::{Findings, MeshNames, items};
use crate::job::document::{Bound, DampedResponse, Graph, Quadrature, SlipWeakening};

/// Whatever the mesh.
pub fn check(findings: &mut Findings<'_>) {
    for contact in items(findings.root, "contact") {
        check_damped_response(findings, &format!("{contact}.normal.damped_response"));
        check_graph(findings, &format!("{contact}.normal.graph.points"));
        check_quadrature(findings, &contact);
        check_bound(findings, &format!("{contact}.normal.unilateral"));
        let path = format!("{contact}.friction.slip_weakening");
        if let Some(SlipWeakening { at_rest, dynamic, .. }) = findings.root.read(&path)
            && at_rest < dynamic
        {
            let message = "the static coefficient is below the dynamic one";
            findings.fault(&format!("{path}.static"), message, format!("it must be at least {dynamic}"));
        }
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

/// A bound on the velocity knows no gap.
fn check_bound(findings: &mut Findings<'_>, path: &str) {
    let gap = format!("{path}.gap");
    if findings.root.read(&format!("{path}.bound")) == Some(Bound::Velocity)
        && findings.root.find(&gap).is_some()
    {
        findings.fault(&gap, "a bound on the velocity has no gap", "delete it, or bound the displacement");
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
    }
}
