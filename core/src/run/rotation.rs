//! How far parts of a body turn: the theory of small displacements holds for small rotations only.

use crate::{
    error::Result,
    fem::{body::Body, space::Simplex, state::State, turning::Turn},
    linear_algebra::tensor::{larger, norm},
    parallel::session::Session,
};

/// Rotation in rad above which a warning is given: lengths are then wrong by half a per cent, directions of forces by ten.
const LARGEST_ROTATION: f64 = 0.1;
/// The moment by the growth of a body that turns, as a share of the moments of its contact forces, above which a warning is given.
const LARGEST_SHARE: f64 = 0.1;

/// Warnings where a cell has turned too far since the start, or a body too far for its contact forces. Collective.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
    turn: Option<Turn>,
) -> Result<Vec<String>> {
    let turned = || -> Result<f64> {
        let displacement = state.displacement.local()?;
        let of_node = |node: &u32| std::array::from_fn(|i| displacement[*node as usize * D + i]);
        let of_cell = |cell: usize| {
            let mut nodal = [[0.0; D]; 4];
            nodal.iter_mut().zip(body.mesh.cell(cell)).for_each(|(value, node)| *value = of_node(node));
            rotation(&Simplex::new(&body.mesh.corners(cell)[..=D]).field_gradient(&nodal[..=D]))
        };
        Ok((0..body.mesh.cell_count()).map(of_cell).fold(0.0, larger))
    };
    let [most] = session.largest([session.agree(turned())?]);
    let of_cells = (most > LARGEST_ROTATION).then(|| {
        format!(
            "parts of the body have turned by up to {most:.3} rad, more than {LARGEST_ROTATION}: the equations assume small rotations, so \
             that lengths and the directions of contact forces are wrong; let the body turn less, or take a shorter run"
        )
    });
    let of_body = turn.filter(|turn| turn.share > LARGEST_SHARE).map(|Turn { share, angle, time }| {
        let percent = 100.0 * share;
        format!(
            "a body with contact had turned by {angle:.4} rad at t = {time:.4e} s: the equations assume small rotations, by which bodies grow, \
             so that contact forces turn it back with a moment of {percent:.0} % of those that they have about its centre: a body that spins or \
             tips is wrong by such a share, one that rolls freely slows down and turns back; let it turn less, take a shorter run, or let a \
             rigid obstacle roll in its place ([contact.obstacle_load])"
        )
    });
    Ok(of_cells.into_iter().chain(of_body).collect())
}

/// The angle in rad of the rotation in a gradient of small displacements.
fn rotation<const D: usize>(gradient: &[[f64; D]; D]) -> f64 {
    let half = |i: usize, j: usize| 0.5 * (gradient[j][i] - gradient[i][j]);
    if D == 2 { half(0, 1).abs() } else { norm(&[half(0, 1), half(1, 2), half(2, 0)]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_rotation_of_a_gradient_counts() {
        assert!((rotation(&[[0.3, 0.5 - 0.2], [0.5 + 0.2, -1.0]]) - 0.2).abs() < 1e-15);
        let turned = [[1.0, -0.3 + 7.0, 0.6], [0.3 + 7.0, 2.0, -0.2], [-0.6, 0.2, 3.0]];
        assert!((rotation(&turned) - 0.7).abs() < 1e-15);
    }
}
