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
