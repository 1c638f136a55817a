//! Warnings about the initial position of a body relative to its obstacles.

use crate::{
    error::Result,
    fem::{body::Body, state::State},
    job::Job,
    laws::contact::Gap,
    linear_algebra::tensor::{Vector, larger},
    parallel::session::Session,
};

/// Initial penetration, as a share of the body's size, above which a warning is given.
const TOO_DEEP: f64 = 0.01;

/// A depth of this share of the body's size is rounding.
const ROUNDING: f64 = 1e-9;

/// Warnings about contacts that can never close because the body lies behind the obstacle, and about bodies that start inside of
/// one. Collective, with the same warnings on all ranks.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
    state: &State,
) -> Result<Vec<String>> {
    let displacement = session.agree(state.displacement.local())?;
    let size = size(session, &body.mesh.nodes);
    let mut out = Vec::new();
    for (number, (contact, table)) in body.contacts.iter().zip(&job.contact).enumerate() {
        if !contact.law.depends_on_displacement() {
            continue;
        }
        let [deepest] = session.largest([contact.deepest(0.0, &displacement)]);
        let on = table.on.join(", ");
        if deepest > TOO_DEEP * size {
            out.push(format!(
                "contact.{number}: the boundary {on} starts up to {deepest:.3e} m inside its obstacle, {:.1} % of the body's size: the first steps will eject the body; correct the gap, the obstacle or [initial] displacement",
                100.0 * deepest / size
            ));
        }
        if deepest <= ROUNDING * size && is_behind(session, &contact.gap, &body.mesh.nodes, size) {
            let remedy = match contact.gap {
                Gap::Sphere(_) => "check `hollow`, which states whether the body is inside the sphere",
                Gap::Shape(_) => {
                    "the distance must be positive outside of the obstacle: reverse the sign of `distance`, or the orientation of \
                     the triangles of `surface`"
                }
                _ => "reverse the plane's `normal`: it must point out of the obstacle toward the body",
            };
            out.push(format!(
                "contact.{number}: the body lies behind its obstacle, so that the boundary {on} can never touch it; {remedy}"
            ));
        }
    }
    Ok(out)
}

/// The longest side of the box around the body. Collective.
fn size<const D: usize>(session: &Session, nodes: &[Vector<D>]) -> f64 {
    let mut ends = [[f64::NEG_INFINITY; 3]; 2];
    for node in nodes {
        for (axis, x) in node.iter().enumerate() {
            ends[0][axis] = larger(ends[0][axis], *x);
            ends[1][axis] = larger(ends[1][axis], -x);
        }
    }
    let ends = ends.map(|end| session.largest(end));
    (0..D).map(|axis| ends[0][axis] + ends[1][axis]).fold(0.0, larger)
}

/// Whether the whole body lies inside of the obstacle. Collective.
fn is_behind<const D: usize>(session: &Session, gap: &Gap, nodes: &[Vector<D>], size: f64) -> bool {
    let depths = nodes.iter().filter_map(|node| gap.depth(0.0, node));
    let [least, most] =
        depths.fold([f64::NEG_INFINITY; 2], |[a, b], depth| [larger(a, -depth), larger(b, depth)]);
    let [least, most] = session.largest([least, most]);
    -least >= -ROUNDING * size && most > TOO_DEEP * size
}
