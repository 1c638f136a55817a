//! Supports: components of the displacement that are held or moved.

use super::load::finite;
use crate::{
    error::{Error, Result},
    fem::space::{Held, INDEPENDENT, SurfacePoint, axis, facets, surface_points},
    job::{Fix, FixedDirections, Scalar, Support},
    laws::{quadrature::rule, step::Step},
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, dot, dual_basis, norm},
    },
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeMap;

/// Share of the first step over which the initial velocity of moving supports is found.
const START_SHARE: f64 = 1e-4;

/// What supports do at the nodes of a rank.
#[derive(Debug)]
pub struct Supports<const D: usize> {
    /// The directions that they hold.
    pub held: Held<D>,
    /// The motion of those that move; `None` on all ranks where none does.
    pub motion: Option<SupportMotion<D>>,
}

/// Directions at the nodes of a support, or of the axis of a body of revolution.
struct Constraints<'a, const D: usize> {
    support: Option<&'a Support>,
    /// Owned nodes, ascending, each with its directions.
    nodes: Vec<(u32, Vec<Vector<D>>)>,
}

/// The motion of supports.
#[derive(Debug)]
pub struct SupportMotion<const D: usize> {
    values: Vec<Prescribed>,
    nodes: Vec<MovedNode<D>>,
}

/// What a support prescribes along a direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Prescribed {
    /// In m or m/s.
    pub value: Scalar,
    /// Whether it is a displacement, not a velocity.
    pub is_displacement: bool,
}

impl Prescribed {
    /// Whether it stays where it is.
    pub fn is_rest(&self) -> bool {
        !self.value.depends_on_time() && (self.is_displacement || self.value == Scalar::Number(0.0))
    }
}

/// An owned node that supports move.
#[derive(Debug)]
struct MovedNode<const D: usize> {
    node: u32,
    place: Vector<D>,
    /// The displacement in m from which prescribed ones count.
    origin: Vector<D>,
    /// The prescribed values along independent unit directions, each with its part of the motion: the vector whose component along
    /// this direction is 1, and 0 along the others.
    parts: Vec<Part<D>>,
}

#[derive(Debug)]
struct Part<const D: usize> {
    /// Position in the values of the motion; `None` where the support does not move.
    value: Option<usize>,
    direction: Vector<D>,
    dual: Vector<D>,
}

impl<const D: usize> Supports<D> {
    /// What holds the body of a job: its supports and, of a body of revolution, the axis. `layout` is a vector with ghosts. Refuses
    /// motions that contradict each other. Collective.
    pub fn of_body(
        session: &Session,
        mesh: &Mesh<D>,
        supports: &[Support],
        layout: &DistributedVector,
    ) -> Result<Self> {
        let mut constraints = constraints(session, mesh, supports)?;
        let owned = mesh.nodes[..mesh.owned].iter().enumerate();
        let on_axis = owned.filter(|(_, place)| mesh.is_on_axis(place));
        let nodes = on_axis.map(|(node, _)| (node as u32, vec![axis(0)])).collect();
        constraints.push(Constraints { support: None, nodes });
        Self::from(session, mesh, constraints, layout)
    }

    /// Supports of a job alone. Collective.
    pub fn new(
        session: &Session,
        mesh: &Mesh<D>,
        supports: &[Support],
        layout: &DistributedVector,
    ) -> Result<Self> {
        Self::from(session, mesh, constraints(session, mesh, supports)?, layout)
    }

    fn from(
        session: &Session,
        mesh: &Mesh<D>,
        constraints: Vec<Constraints<'_, D>>,
        layout: &DistributedVector,
    ) -> Result<Self> {
        let mut of_node: BTreeMap<u32, Vec<Vector<D>>> = BTreeMap::new();
        for (node, directions) in constraints.iter().flat_map(|constraints| &constraints.nodes) {
            of_node.entry(*node).or_default().extend(directions);
        }
        let mut held = Held::from(vec![false; mesh.nodes.len() * D]);
        of_node.into_iter().for_each(|(node, directions)| held.hold(node, directions.into_iter()));
        hold_ghosts(session, mesh, &mut held, layout)?;
        let moves = |support: &Support| support.displacement.is_some() || support.velocity.is_some();
        let motion = if constraints.iter().filter_map(|of| of.support).any(moves) {
            Some(session.agree(SupportMotion::new(mesh, &constraints))?)
        } else {
            None
        };
        Ok(Self { held, motion })
    }
}

/// The directions that each support with `fix` determines. Collective.
fn constraints<'a, const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    supports: &'a [Support],
) -> Result<Vec<Constraints<'a, D>>, Agreed> {
    let mut out = Vec::new();
    // Boundaries that are held along their normals and do not move have one normal where they meet.
    let is_plain_normal = |support: &Support| {
        support.fix == Some(Fix::Keyword(FixedDirections::Normal))
            && support.displacement.is_none()
            && support.velocity.is_none()
            && support.part.is_none()
    };
    let mut normal_is_done = false;
    for support in supports {
        let Some(fix) = &support.fix else { continue };
        let mut names: Vec<&String> = support.on.iter().collect();
        if is_plain_normal(support) {
            if std::mem::replace(&mut normal_is_done, true) {
                continue;
            }
            names =
                supports.iter().filter(|other| is_plain_normal(other)).flat_map(|other| &other.on).collect();
        }
        let directions = |normals: &[SurfacePoint<D>]| match fix {
            Fix::Keyword(FixedDirections::All) => (0..D).map(axis).collect(),
            Fix::Axes(axes) => axes.iter().map(|a| axis(a.index())).collect(),
            Fix::Keyword(FixedDirections::Normal) => normals.iter().map(|point| point.normal).collect(),
        };
        let held_at = |facets: &[u32]| -> Result<BTreeMap<u32, Vec<Vector<D>>>, Agreed> {
            let points = surface_points(session, mesh, facets)?;
            let around = points.chunk_by(|a: &SurfacePoint<D>, b| a.node == b.node);
            Ok(around.map(|points| (points[0].node, directions(points))).collect())
        };
        let mut on = facets(mesh, names.iter().copied());
        let mut nodes = held_at(&on)?;
        if let Some(part) = support.part.as_ref().filter(|_| *fix == Fix::Keyword(FixedDirections::Normal)) {
            // On an edge between faces the normals are those of the faces of which the part has facets.
            let is_in = |node: u32| part.evaluate(0.0, &mesh.nodes[node as usize]) != 0.0;
            on.retain(|&facet| mesh.facet_nodes(facet).all(is_in));
            let of_part = held_at(&on)?.into_iter();
            nodes.extend(
                of_part
                    .filter(|(node, _)| nodes.get(node).is_some_and(|all| all.len() > 1))
                    .collect::<Vec<_>>(),
            );
        }
        nodes.extend(mesh.nodes_of_point_sets(&names).into_iter().map(|node| (node, directions(&[]))));
        if let Some(part) = &support.part {
            let share = |node: u32| part.evaluate(0.0, &mesh.nodes[node as usize]);
            let wrong = nodes.keys().find(|node| share(**node).is_nan());
            session.agree(wrong.map_or(Ok(()), |&node| {
                Err(Error::Refused(format!(
                    "support on {}: `where` is not a number at {:?} m; correct the expression",
                    support.on.join(", "),
                    mesh.nodes[node as usize]
                )))
            }))?;
            nodes.retain(|&node, _| share(node) != 0.0);
        }
        if support.part.is_some() && session.total(nodes.len()) == 0 {
            return session.agree(Err(Error::Refused(format!(
                "support on {}: `where` holds at no node of these boundaries; correct the expression",
                support.on.join(", ")
            ))));
        }
        out.push(Constraints { support: Some(support), nodes: nodes.into_iter().collect() });
    }
    Ok(out)
}

/// Copies what is held at owned nodes to the ghosts of other ranks. Collective.
fn hold_ghosts<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    held: &mut Held<D>,
    layout: &DistributedVector,
) -> Result<()> {
    let mut directions: BTreeMap<u32, Vec<Vector<D>>> = BTreeMap::new();
    let mut vector = layout.like()?;
    {
        let mut values = vector.owned_mut()?;
        values.iter_mut().zip(held.flags()).for_each(|(value, &held)| *value = f64::from(u8::from(held)));
    }
    vector.update_ghosts()?;
    for (at, &flag) in
        vector.local()?.iter().enumerate().skip(mesh.owned * D).filter(|(_, flag)| **flag > 0.0)
    {
        let direction = std::array::from_fn(|i| if i == at % D { flag } else { 0.0 });
        directions.entry((at / D) as u32).or_default().push(direction);
    }
    if session.total(held.slanted().len()) > 0 {
        for number in 0..D {
            {
                let mut values = vector.owned_mut()?;
                values.fill(0.0);
                for slanted in held.slanted() {
                    if let Some(direction) = slanted.held().get(number) {
                        values[slanted.node as usize * D..][..D].copy_from_slice(direction);
                    }
                }
            }
            vector.update_ghosts()?;
            for (node, value) in vector.local()?.chunks_exact(D).enumerate().skip(mesh.owned) {
                if value.iter().any(|v| *v != 0.0) {
                    let direction = std::array::from_fn(|i| value[i]);
                    directions.entry(node as u32).or_default().push(direction);
                }
            }
        }
    }
    directions.into_iter().for_each(|(node, directions)| held.hold(node, directions.into_iter()));
    Ok(())
}

impl<const D: usize> SupportMotion<D> {
    fn new(mesh: &Mesh<D>, constraints: &[Constraints<'_, D>]) -> Result<Self> {
        let mut values: Vec<Prescribed> = Vec::new();
        let mut moved: BTreeMap<u32, Vec<(Vector<D>, Option<usize>)>> = BTreeMap::new();
        for Constraints { support, nodes } in constraints {
            let motion = support.and_then(|support| {
                let displacement = support.displacement.as_ref().map(|all| (all, true));
                displacement.or(support.velocity.as_ref().map(|all| (all, false)))
            });
            let numbers: Vec<usize> = motion
                .iter()
                .flat_map(|(list, is_displacement)| {
                    list.iter()
                        .map(|value| Prescribed { value: value.clone(), is_displacement: *is_displacement })
                })
                .map(|value| {
                    values.iter().position(|known| *known == value).unwrap_or_else(|| {
                        values.push(value);
                        values.len() - 1
                    })
                })
                .collect();
            for (node, directions) in nodes {
                // A support along the normal has one value for all normals of a node.
                let number = |at: usize| numbers.get(at).or(numbers.first()).copied();
                // The axis of a body of revolution does not leave its place.
                let is_on_axis = mesh.is_on_axis(&mesh.nodes[*node as usize]);
                let moves = |direction: &Vector<D>| !(is_on_axis && direction[0] != 0.0);
                let all = directions
                    .iter()
                    .enumerate()
                    .map(|(at, direction)| (*direction, number(at).filter(|_| moves(direction))));
                moved.entry(*node).or_default().extend(all);
            }
        }
        let moved = moved.into_iter().filter(|(_, all)| all.iter().any(|(_, value)| value.is_some()));
        let is_rest = |number: usize| values[number].value == Scalar::Number(0.0);
        let nodes = moved.map(|(node, all)| MovedNode::new(mesh, node, &all, is_rest));
        let nodes = nodes.collect::<Result<_>>()?;
        Ok(Self { values, nodes })
    }

    /// All that is prescribed.
    pub fn values(&self) -> &[Prescribed] {
        &self.values
    }

    /// What is prescribed, by its number.
    pub fn value(&self, number: usize) -> Option<&Prescribed> {
        self.values.get(number)
    }

    /// Independent unit directions in which supports hold this node of this rank, each with its part of the motion and the number of what is
    /// prescribed, if the supports move; none at nodes that none moves.
    pub fn parts(&self, node: usize) -> impl Iterator<Item = (Vector<D>, Vector<D>, Option<usize>)> {
        let found = self.nodes.binary_search_by_key(&(node as u32), |moved| moved.node);
        let parts = found.into_iter().flat_map(|at| &self.nodes[at].parts);
        parts.map(|part| (part.direction, part.dual, part.value))
    }

    /// Whether supports hold this node of this rank and move it along this direction.
    pub fn moves(&self, node: usize, direction: &Vector<D>) -> bool {
        let found = self.nodes.binary_search_by_key(&(node as u32), |moved| moved.node);
        found.is_ok_and(|at| {
            let parts = self.nodes[at].parts.iter().filter(|part| part.value.is_some());
            parts.into_iter().any(|part| dot(&part.dual, direction).abs() > INDEPENDENT)
        })
    }

    /// Writes to owned nodes the velocity of supports in a step, 0 elsewhere: that with which the displacement `start` at owned nodes changes
    /// within `length` in s to the prescribed one, or to the `converged` one before the step and the integral of the prescribed velocity.
    /// Without the converged one a prescribed velocity is that at the end of the step.
    pub fn write_velocity(
        &self,
        step: Step,
        (converged, start): (Option<&[f64]>, &[f64]),
        length: f64,
        velocity: &mut [f64],
    ) -> Result<()> {
        velocity.fill(0.0);
        for moved in &self.nodes {
            let at = |i: usize| moved.node as usize * D + i;
            let along = |direction: &Vector<D>, from: &dyn Fn(usize) -> f64| {
                (0..D).map(|i| direction[i] * (start[at(i)] - from(i))).sum::<f64>()
            };
            moved.add(velocity, |part, number| {
                let Prescribed { value, is_displacement } = &self.values[number];
                let at_time = |time: f64| finite(value, time, &moved.place, what);
                let end = at_time(step.time)?;
                if *is_displacement {
                    return Ok((end - along(&part.direction, &|i| moved.origin[i])) / length);
                }
                let Some(converged) = converged.filter(|_| value.depends_on_time()) else { return Ok(end) };
                let parts = rule([step.start(), step.time]).map(|[time, weight]| Ok(weight * at_time(time)?));
                let way = parts.sum::<Result<f64>>()?;
                Ok((way - along(&part.direction, &|i| converged[at(i)])) / length)
            })?;
        }
        Ok(())
    }

    /// Lets prescribed displacements count from this one of owned nodes.
    pub fn count_from(&mut self, origin: &[f64]) {
        for moved in &mut self.nodes {
            moved.origin = std::array::from_fn(|i| origin[moved.node as usize * D + i]);
        }
    }

    /// Sets displacements of owned nodes at time 0 to those of the supports.
    pub fn start_displacement(&self, displacement: &mut [f64]) -> Result<()> {
        for moved in &self.nodes {
            let at = moved.node as usize * D;
            let before: Vector<D> = std::array::from_fn(|i| displacement[at + i]);
            moved.add(displacement, |part, number| {
                let Prescribed { value, is_displacement } = &self.values[number];
                if !is_displacement {
                    return Ok(0.0);
                }
                Ok(finite(value, 0.0, &moved.place, what)? - dot(&part.direction, &before))
            })?;
        }
        Ok(())
    }

    /// Adds to velocities of owned nodes, 0 at held components, those of the supports at time 0; `step` in s is the first step.
    /// `known` has the velocity of a node along a direction where it is known already.
    pub fn start_velocity(
        &self,
        step: f64,
        known: impl Fn(usize, &Vector<D>) -> Option<f64>,
        velocity: &mut [f64],
    ) -> Result<()> {
        let span = START_SHARE * step;
        for moved in &self.nodes {
            moved.add(velocity, |part, number| {
                if let Some(known) = known(moved.node as usize, &part.direction) {
                    return Ok(known);
                }
                let Prescribed { value, is_displacement } = &self.values[number];
                let value = |time: f64| finite(value, time, &moved.place, what);
                let start = value(0.0)?;
                if !is_displacement {
                    return Ok(start);
                }
                // Exact for parabolas.
                Ok((4.0 * value(span)? - 3.0 * start - value(2.0 * span)?) / (2.0 * span))
            })?;
        }
        Ok(())
    }
}

fn what() -> String {
    "support: a displacement or velocity".into()
}

/// Independent directions among these, each with the number of its value, if it moves. `None` if another direction, a combination of
/// them, contradicts: it is at rest only where all of them are, also by a value that is always 0, and moves only as one of them alone.
fn parts<const D: usize>(
    all: &[(Vector<D>, Option<usize>)],
    is_rest: impl Fn(usize) -> bool,
) -> Option<Vec<Part<D>>> {
    let moving = |value: Option<usize>| value.filter(|number| !is_rest(*number));
    let (mut independent, mut others) = (Vec::new(), Vec::new());
    // An orthonormal basis of the same span.
    let mut basis: Vec<Vector<D>> = Vec::new();
    for (direction, value) in all {
        let out = |rest: Vector<D>, known: &Vector<D>| add_scaled(&rest, -dot(known, &rest), known);
        let rest = basis.iter().chain(&basis).fold(*direction, out);
        let size = norm(&rest);
        if size > INDEPENDENT {
            basis.push(rest.map(|x| x / size));
            independent.push((*direction, *value));
        } else {
            others.push((direction, *value));
        }
    }
    let directions: Vec<Vector<D>> = independent.iter().map(|(direction, _)| *direction).collect();
    let duals = dual_basis(&directions, INDEPENDENT).unwrap_or_default();
    let parts = independent.into_iter().zip(duals);
    let parts: Vec<Part<D>> =
        parts.map(|((direction, value), dual)| Part { value, direction, dual }).collect();
    let agrees = |(direction, value): (&Vector<D>, Option<usize>)| {
        let share = |part: &Part<D>| dot(&part.dual, direction);
        let mut combined = parts.iter().filter(|part| share(part).abs() > INDEPENDENT);
        match moving(value) {
            None => combined.all(|part| moving(part.value).is_none()),
            Some(_) => combined.all(|part| part.value == value && share(part) > 1.0 - INDEPENDENT),
        }
    };
    others.into_iter().all(agrees).then_some(parts)
}

impl<const D: usize> MovedNode<D> {
    fn new(
        mesh: &Mesh<D>,
        node: u32,
        all: &[(Vector<D>, Option<usize>)],
        is_rest: impl Fn(usize) -> bool,
    ) -> Result<Self> {
        let place = mesh.nodes[node as usize];
        let parts = parts(all, is_rest).ok_or_else(|| {
            Error::Refused(format!(
                "support at {place:?} m: two supports determine the same component of the displacement there and move \
                 it differently; leave this component, or the boundary, out of one of them, or give both the same motion"
            ))
        })?;
        Ok(Self { node, place, origin: [0.0; D], parts })
    }

    /// Adds to a nodal value the vector with these components along the directions that move.
    fn add(&self, nodal: &mut [f64], value: impl Fn(&Part<D>, usize) -> Result<f64>) -> Result<()> {
        let mut sum = [0.0; D];
        for part in &self.parts {
            if let Some(number) = part.value {
                sum = add_scaled(&sum, value(part, number)?, &part.dual);
            }
        }
        let target = &mut nodal[self.node as usize * D..][..D];
        target.iter_mut().zip(sum).for_each(|(target, value)| *target += value);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_motions_of_the_same_component_contradict() {
        let (s, c) = 0.5f64.sin_cos();
        let [x, y, z, slanted] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [c, s, 0.0]];
        let back = x.map(|x: f64| -x);
        // The value of each independent direction, or a contradiction; number 9 is always 0.
        let values = |all: &[(Vector<3>, Option<usize>)]| {
            Some(parts(all, |number| number == 9)?.into_iter().map(|part| part.value).collect::<Vec<_>>())
        };
        for moved in [y, z] {
            assert_eq!(values(&[(back, None), (moved, Some(0)), (x, None)]), Some(vec![None, Some(0)]));
        }
        let held = [(x, None), (y, None), (z, Some(1))];
        for (more, agrees) in [
            ((slanted, None), true),
            ((back, None), true),
            ((x, Some(9)), true),
            ((slanted, Some(9)), true),
            ((z, Some(9)), false),
            ((z, Some(1)), true),
            ((z, None), false),
            ((z, Some(0)), false),
            ((z.map(|z| -z), Some(1)), false),
            ((slanted, Some(1)), false),
            (([c, 0.0, s], None), false),
        ] {
            let all = [&held[..], &[more]].concat();
            assert_eq!(values(&all), agrees.then(|| vec![None, None, Some(1)]), "{more:?}");
        }
    }
}
