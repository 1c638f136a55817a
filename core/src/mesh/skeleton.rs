//! The constraints on the bodies of a mesh, gathered from all ranks.

use super::{
    Mesh,
    rigid::{Motion, RigidBody, Skeleton, absent, extend, unit},
    shape::{centroid, signed_measure},
    surface::Bodies,
};
use crate::{
    error::Result,
    linear_algebra::tensor::{Vector, add_scaled, norm},
    parallel::{
        agreement::Agreed,
        exchange::{exchange_lists, gather},
        session::Session,
    },
};
use std::collections::BTreeMap;

/// The rigid motions that remain free when the components `held` of nodes and the directions `along` at nodes are constrained: one
/// sentence for each body that can move, none if every body is held. Collective, with the same sentences on all ranks.
///
/// A node at `x` that is held along a direction gives one linear constraint on the motion `t + w × (x - c)`; motions orthogonal to
/// all constraints are free. A body that shares single nodes with a held body is held at these nodes.
pub fn free_motions<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    held: &[[bool; D]],
    along: &[(usize, Vector<D>)],
) -> Result<Vec<String>, Agreed> {
    Ok(skeleton(session, mesh, held, along)?.free_motions())
}

/// The number of these motions. Collective.
pub fn count_free_motions<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    held: &[[bool; D]],
    along: &[(usize, Vector<D>)],
) -> Result<usize, Agreed> {
    Ok(skeleton(session, mesh, held, along)?.count_free_motions())
}

/// The rigid motions of several bodies together that remain free, in words as those of [`free_motions`], where these directions at nodes
/// are constrained: of velocities, and of velocities relative to what nodes face, which `seen` gives for the velocities of the nodes owned
/// here; both have ghosts. Collective, with the same sentences on all ranks.
///
/// The motions `m` of all bodies are free if `m . G m = 0` with the sum `G` of the squares of the constraints.
pub fn common_motions<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    held: &[[bool; D]],
    along: [&[(usize, Vector<D>)]; 2],
    mut seen: impl FnMut(&[f64]) -> Result<[Vec<f64>; 2], Agreed>,
) -> Result<Vec<String>, Agreed> {
    let bodies = mesh.bodies(session)?;
    let nodes = nodes_of(mesh, &bodies);
    let frames = frames(session, mesh, &bodies, &nodes)?;
    // A body of revolution moves along its axis alone.
    let kinds: &[usize] = match D {
        _ if mesh.is_revolved => &[1],
        2 => &[0, 1, 5],
        _ => &[0, 1, 2, 3, 4, 5],
    };
    let joints = joints(session, mesh, &nodes)?;
    let joints: Vec<_> = joints.chunk_by(|a, b| a.0 == b.0).collect();
    let counts = [held.len() * D, along[0].len(), along[1].len()];
    let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); counts.iter().sum()];
    for (number, (body, nodes)) in frames.iter().zip(&nodes).enumerate() {
        for (at, &kind) in kinds.iter().enumerate() {
            let mut motion = vec![0.0; mesh.owned * D];
            for &node in nodes.iter().filter(|&&node| (node as usize) < mesh.owned) {
                let joint = joints.binary_search_by_key(&mesh.global_node(node), |joint| joint[0].0);
                if joint.is_ok_and(|joint| joints[joint][0].1 != number) {
                    continue;
                }
                let place = &mesh.nodes[node as usize];
                (0..D).for_each(|i| motion[node as usize * D + i] = body.row(i, place)[kind]);
            }
            let [absolute, relative] = seen(&motion)?;
            let held = held.as_flattened().iter().zip(&absolute);
            let held = held.map(|(held, value)| if *held { *value } else { 0.0 });
            let component = |values: &[f64], (node, direction): &(usize, Vector<D>)| {
                direction.iter().zip(&values[node * D..]).map(|(n, v)| n * v).sum::<f64>()
            };
            let of_supports = along[0].iter().map(|point| component(&absolute, point));
            let of_contacts = along[1].iter().map(|point| component(&relative, point));
            for (row, value) in rows.iter_mut().zip(held.chain(of_supports).chain(of_contacts)) {
                if value != 0.0 {
                    row.push((number * kinds.len() + at, value));
                }
            }
        }
    }
    for joint in joints.iter().filter(|_| session.is_first()) {
        for ((_, other, place), i) in joint[1..].iter().flat_map(|of| (0..D).map(move |i| (of, i))) {
            let of_body = |body: usize, sign: f64| {
                let row = frames[body].row(i, place);
                kinds.iter().enumerate().map(move |(at, &kind)| (body * kinds.len() + at, sign * row[kind]))
            };
            rows.push(of_body(joint[0].1, 1.0).chain(of_body(*other, -1.0)).collect());
        }
    }
    let size = frames.len() * kinds.len();
    let mut squares = vec![0.0; size * size];
    for row in &rows {
        for (i, a) in row {
            row.iter().for_each(|(j, b)| squares[i * size + j] += a * b);
        }
    }
    let mut squares = session.sum_of_lists(&squares);
    let words = |motion: Vec<f64>| {
        let of_bodies = motion.chunks_exact(kinds.len()).map(|own| {
            let mut whole: Motion = [0.0; 6];
            kinds.iter().zip(own).for_each(|(&kind, value)| whole[kind] = *value);
            whole
        });
        let largest = of_bodies.clone().map(|own| norm(&own)).fold(0.0, f64::max);
        let moving: Vec<_> =
            of_bodies.enumerate().filter(|(_, own)| norm(own) > NO_MOTION * largest).collect();
        let names: Vec<String> = moving.iter().map(|(number, _)| frames[*number].name(*number)).collect();
        let first = moving.first().map(|(number, own)| {
            let size = norm(own);
            frames[*number].in_words(&[own.map(|x| x / size)]).join(", ")
        });
        let together = if names.len() > 1 { " together" } else { "" };
        format!("{}{together}: {}", names.join(" and "), first.unwrap_or_default())
    };
    Ok(null_space(&mut squares, size).into_iter().map(words).collect())
}

/// A body whose share in a motion is below this does not move.
const NO_MOTION: f64 = 1e-6;
/// Share of the largest diagonal entry of a sum of squares below which entries are rounding errors.
const NO_SQUARE: f64 = 1e-12;

/// A basis of the vectors that a positive semidefinite matrix makes zero; the matrix is changed.
fn null_space(matrix: &mut [f64], size: usize) -> Vec<Vec<f64>> {
    let largest = (0..size).map(|i| matrix[i * size + i]).fold(0.0, f64::max);
    let mut free: Vec<usize> = (0..size).collect();
    let mut taken = Vec::new();
    while let Some(at) = (0..free.len())
        .max_by(|&a, &b| matrix[free[a] * (size + 1)].total_cmp(&matrix[free[b] * (size + 1)]))
        .filter(|&at| matrix[free[at] * (size + 1)] > NO_SQUARE * largest)
    {
        let pivot = free.swap_remove(at);
        taken.push(pivot);
        let scale = 1.0 / matrix[pivot * (size + 1)];
        let row: Vec<f64> = matrix[pivot * size..][..size].iter().map(|x| x * scale).collect();
        for other in (0..size).filter(|other| *other != pivot) {
            let factor = matrix[other * size + pivot];
            if factor != 0.0 {
                (0..size).for_each(|j| matrix[other * size + j] -= factor * row[j]);
            }
        }
        matrix[pivot * size..][..size].copy_from_slice(&row);
    }
    free.sort_unstable();
    let vector = |&direction: &usize| {
        let mut vector = vec![0.0; size];
        vector[direction] = 1.0;
        taken.iter().for_each(|&pivot| vector[pivot] = -matrix[pivot * size + direction]);
        vector
    };
    free.iter().map(vector).collect()
}

/// The bodies, each with constraints that span those of its held nodes, at most six from each rank, and the points that it shares
/// with other bodies. Collective, the same on all ranks.
fn skeleton<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    held: &[[bool; D]],
    along: &[(usize, Vector<D>)],
) -> Result<Skeleton<D>, Agreed> {
    let mut directions: BTreeMap<u32, Vec<Vector<D>>> = BTreeMap::new();
    along.iter().for_each(|(node, direction)| directions.entry(*node as u32).or_default().push(*direction));
    let bodies = mesh.bodies(session)?;
    let nodes = nodes_of(mesh, &bodies);
    let mut skeleton = Skeleton { bodies: frames(session, mesh, &bodies, &nodes)?, ..Skeleton::default() };
    let mut records: Vec<f64> = Vec::new();
    for (number, (body, nodes)) in skeleton.bodies.iter().zip(&nodes).enumerate() {
        let rows_of = |&node: &u32| {
            let place = &mesh.nodes[node as usize];
            let components = (0..D).filter(move |&c| held[node as usize][c]);
            let components = components.map(move |component| body.row(component, place));
            let directions = directions.get(&node).into_iter().flatten();
            components.chain(directions.map(move |direction| body.row_along(direction, place)))
        };
        let all: Vec<Motion> = nodes.iter().flat_map(rows_of).collect();
        for taken in extend(&mut absent::<D>(), || all.iter().copied()) {
            records.push(number as f64);
            records.extend(all[taken]);
        }
    }
    for record in gather(session.world(), &records)?.chunks_exact(7) {
        let row = std::array::from_fn(|i| record[1 + i]);
        skeleton.bodies[record[0] as usize].rows.push(row);
    }
    if mesh.is_revolved {
        // A body of revolution moves along its axis alone.
        skeleton.bodies.iter_mut().for_each(|body| body.rows.extend([unit(0), unit(5)]));
    }
    if bodies.count > 1 {
        let joints = joints(session, mesh, &nodes)?;
        for joint in joints.chunk_by(|a, b| a.0 == b.0) {
            joint.iter().for_each(|&(_, body, _)| skeleton.bodies[body].points.push(skeleton.points.len()));
            skeleton.points.push(joint[0].2);
            skeleton.held.push([false; D]);
        }
    }
    Ok(skeleton)
}

/// The local nodes of each body, ghosts included.
fn nodes_of<const D: usize>(mesh: &Mesh<D>, bodies: &Bodies) -> Vec<Vec<u32>> {
    let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); bodies.count];
    let mut order: Vec<u32> = (0..mesh.cell_count() as u32).collect();
    order.sort_by_key(|&cell| bodies.of_cell[cell as usize]);
    let mut last_body = vec![u32::MAX; mesh.nodes.len()];
    for cell in order {
        let body = bodies.of_cell[cell as usize];
        for node in mesh.cell_nodes(cell as usize) {
            if std::mem::replace(&mut last_body[node as usize], body) != body {
                nodes[body as usize].push(node);
            }
        }
    }
    nodes
}

/// Centre of mass (of a uniform density) and radius of each body.
fn frames<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    bodies: &Bodies,
    nodes: &[Vec<u32>],
) -> Result<Vec<RigidBody<D>>, Agreed> {
    let mut sums = vec![0.0; bodies.count * (D + 1)];
    for (cell, &body) in bodies.of_cell.iter().enumerate() {
        let corners = mesh.corners(cell);
        let (measure, middle) = (signed_measure(&corners[..=D]), centroid(&corners[..=D]));
        let sum = &mut sums[body as usize * (D + 1)..][..=D];
        (0..D).for_each(|i| sum[i] += measure * middle[i]);
        sum[D] += measure;
    }
    let sums = session.sum_of_lists(&sums);
    let centres: Vec<Vector<D>> =
        sums.chunks_exact(D + 1).map(|sum| std::array::from_fn(|i| sum[i] / sum[D])).collect();
    let reach = |(nodes, centre): (&Vec<u32>, &Vector<D>)| {
        let distance = |&node: &u32| norm(&add_scaled(&mesh.nodes[node as usize], -1.0, centre));
        nodes.iter().map(distance).fold(f64::MIN_POSITIVE, f64::max)
    };
    let own: Vec<f64> = nodes.iter().zip(&centres).map(reach).collect();
    let mut radii = vec![f64::MIN_POSITIVE; bodies.count];
    for ranks in gather(session.world(), &own)?.chunks_exact(bodies.count.max(1)) {
        radii.iter_mut().zip(ranks).for_each(|(radius, reach)| *radius = reach.max(*radius));
    }
    let body = |(centre, radius)| RigidBody { rows: Vec::new(), points: Vec::new(), centre, radius };
    Ok(centres.into_iter().zip(radii).map(body).collect())
}

/// The nodes that bodies share: global number, body and coordinates of each, ordered by number. Collective, the same on all ranks.
fn joints<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    nodes: &[Vec<u32>],
) -> Result<Vec<(u32, usize, Vector<D>)>, Agreed> {
    let mut to_owners: Vec<Vec<u32>> = vec![Vec::new(); session.ranks()];
    for (body, nodes) in nodes.iter().enumerate() {
        for &node in nodes {
            let number = mesh.global_node(node);
            to_owners[mesh.owner(number)].extend([number, body as u32]);
        }
    }
    let came = exchange_lists(session.world(), &to_owners)?;
    let mut meetings: Vec<[u32; 2]> = came.as_chunks().0.to_vec();
    meetings.sort_unstable();
    meetings.dedup();
    let several = meetings.chunk_by(|a, b| a[0] == b[0]).filter(|around| around.len() > 1).flatten();
    let record = |&[number, body]: &[u32; 2]| {
        let place = mesh.nodes[mesh.owned_node(number)];
        [f64::from(number), f64::from(body)].into_iter().chain(place)
    };
    let all = gather(session.world(), &several.flat_map(record).collect::<Vec<f64>>())?;
    let joint = |of: &[f64]| (of[0] as u32, of[1] as usize, std::array::from_fn(|i| of[2 + i]));
    Ok(all.chunks_exact(D + 2).map(joint).collect())
}

#[cfg(test)]
mod tests {
    use super::null_space;

    #[test]
    fn what_several_constraints_leave_free_moves_together() {
        // Of four numbers the first two are equal, and the fourth is twice the third.
        let rows = [[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 2.0, -1.0]];
        let square = |i: usize, j: usize| rows.iter().map(|row| row[i] * row[j]).sum::<f64>();
        let mut squares: Vec<f64> = (0..16).map(|k| square(k / 4, k % 4)).collect();
        assert_eq!(null_space(&mut squares, 4), [[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.5, 1.0]]);
        assert!(null_space(&mut [1.0, 0.0, 0.0, 1e-9], 2).is_empty());
        assert_eq!(null_space(&mut [1.0, 0.0, 0.0, 1e-13], 2), [[0.0, 1.0]]);
        assert_eq!(null_space(&mut [0.0], 1), [[1.0]]);
    }
}
