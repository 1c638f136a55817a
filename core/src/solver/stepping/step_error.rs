//! The error of a step, for adaptive steps.

use super::flow::FlowStart;
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Blend, CONTACT_QUANTITIES, Curvature, Deviation, FIRST_OF_OBSTACLES, Form, Step},
        space::longest_side,
        state::State,
    },
    linear_algebra::petsc::DistributedVector,
    mesh::{Mesh, count_free_motions},
    parallel::session::Session,
};

/// Share of the root of the kinetic energy below which the root of the elastic energy is a rounding error, and vice versa.
const NEGLIGIBLE: f64 = 1e-6;
/// Displacements that change by this share of themselves from node to node change by rounding errors: those of the forces in a smooth motion
/// are as many times their own as the body has cells along an edge.
const ROUNDING: f64 = 1e3 * f64::EPSILON;
/// Share of the size of a body without inertia below which a displacement does not count as smaller.
const LEAST_WAY: f64 = 1e-9;

/// Norms of velocity and stress.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Norms {
    /// Velocity in the mass norm, or in the norm of the viscosity for problems without inertia.
    pub velocity: f64,
    /// Stress in the compliance norm.
    pub stress: f64,
}

/// The error of the temperature in a step, over all ranks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemperatureError {
    /// The largest error of a node in K.
    pub error: f64,
    /// The lowest temperature in K at the start and at the end of the step.
    pub lowest: f64,
    /// The highest one.
    pub highest: f64,
}

/// The error of a step with its reference norms.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepError {
    /// The error.
    pub error: Norms,
    /// Velocity and stress at the end of the step.
    pub size: Norms,
    /// A velocity below this multiple of the stress is a rounding error, and a stress below this multiple of the velocity.
    pub negligible: Norms,
    /// Without inertia, errors of velocities and stresses below these are rounding errors of displacements, as of a body that moves as a
    /// whole.
    pub rounding: Norms,
    /// The displacement in the step with its error. With inertia in the mass norm in kg^(1/2) m, under first-order schemes, which move the body at
    /// the velocity at one end of the step, and 0 under others. Without inertia the root of the squares of all nodes in m, under all schemes,
    /// where velocities determine motions that stresses do not show.
    pub way: Deviation,
    /// Norms of the quantities of contacts, squares in the calculation of the step.
    pub contact: [Deviation; CONTACT_QUANTITIES],
    /// Norms of the forces of bonds and contact memory.
    pub surface: Deviation,
    /// That of the temperature, once it is found.
    pub temperature: Option<TemperatureError>,
}

/// Work space for nodal values with ghosts.
#[derive(Debug, Default)]
pub(super) struct ErrorWorkspace {
    curved: Vec<f64>,
    strained: Vec<f64>,
    end: Vec<f64>,
    forces: Vec<f64>,
    drift: Option<Drift>,
}

/// How a body without inertia may move without stress.
#[derive(Debug, Clone, Copy, Default)]
struct Drift {
    /// Whether velocities, and not forces alone, determine motions that elastic stresses do not show: those as a rigid body, or of cells without
    /// elasticity.
    is_free: bool,
    /// The norm of its displacement in m that does not count as smaller.
    least: f64,
}

impl Drift {
    /// Collective.
    fn of<const D: usize, const S: usize>(session: &Session, body: &Body<D, S>) -> Result<Self> {
        let mesh = &body.mesh;
        let along: Vec<_> = body.held.slanted_directions().collect();
        let free = count_free_motions(session, mesh, body.held.flags().as_chunks().0, &along)?;
        let shows_all = free == 0 && body.has_form_everywhere(Form::Elasticity);
        Ok(Self {
            is_free: body.depends_on_velocities() && !shows_all,
            least: LEAST_WAY * longest_side(session, &mesh.nodes) * (mesh.total_nodes as f64).sqrt(),
        })
    }
}

/// A step that is solved and not yet committed.
#[derive(Clone, Copy)]
pub(super) struct SolvedStep<'a> {
    pub step: Step,
    /// The velocity at its end, with ghosts.
    pub velocity: &'a DistributedVector,
    /// The displacement from which the step starts.
    pub flow_start: FlowStart<'a>,
    /// The states from which the step starts.
    pub blend: Blend,
    /// The order of the scheme.
    pub order: u32,
}

impl ErrorWorkspace {
    /// The error of a step whose trial histories belong to its solution. Collective.
    pub(super) fn error<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        solved: SolvedStep<'_>,
    ) -> Result<StepError> {
        let SolvedStep { step, velocity, flow_start, blend, order } = solved;
        let curvature = Curvature::of(step);
        let trial = velocity.local()?;
        let (now, before) = (state.velocity.local()?, state.previous_velocity.local()?);
        let values = trial.iter().zip(now.iter().zip(before.iter()));
        let form = [Form::Mass, Form::Viscosity].into_iter().find(|form| body.has_form(*form));
        let is_massless = form != Some(Form::Mass);
        let drift = match self.drift {
            Some(drift) => drift,
            None => {
                *self.drift.insert(if is_massless { Drift::of(session, body)? } else { Drift::default() })
            }
        };
        let Self { curved, strained, end, forces, .. } = self;
        write(curved, values.clone().map(|(t, (v, p))| curvature.error([*t, *v, *p])));
        // Displacements, and stresses with them, are one order more accurate in the second-order formula.
        if blend.earlier == 0.0 {
            write(strained, values.map(|(t, (v, _))| 0.5 * (t - v)));
        } else {
            strained.clone_from(curved);
        }
        let [histories, surface] = {
            let start = flow_start.displacement.local()?;
            write(end, start.iter().zip(trial.iter()).map(|(u, v)| u + blend.length * v));
            let surface = body.surface_error(curvature, end);
            [body.stress_error(curvature, end, surface), surface]
        };
        let contact = contact_deviations(session, body, curvature, (&*end, &*trial));
        let mut square = |form: Option<Form>, x: &[f64]| {
            let Some(form) = form else { return 0.0 };
            write(forces, x.iter().map(|_| 0.0));
            body.add_form(form, x, forces);
            forces.iter().zip(x).map(|(f, x)| f * x).sum::<f64>()
        };
        let elastic = body.has_form(Form::Elasticity).then_some(Form::Elasticity);
        let strains = blend.length * blend.length * square(elastic, strained);
        let nodal = |x: &[f64]| match drift.is_free {
            true => x[..D * body.mesh.owned].iter().map(|x| x * x).sum(),
            false => 0.0,
        };
        let drifts = form.filter(|form| order == 1 && *form == Form::Mass);
        let of_way = if is_massless { nodal(&strained[..]) } else { square(drifts, strained) };
        let of_displacement = nodal(&end[..]);
        // Where nothing resists velocities, they jump with the forces: where a step follows none, that at its start may be the one of a jump.
        let [increment, increment_of_way] = if form.is_none() && step.previous_length == 0.0 {
            write(strained, trial.iter().map(|v| 0.5 * v));
            [blend.length * blend.length * square(elastic, strained), nodal(&strained[..])]
        } else {
            [strains, of_way]
        };
        let [velocity, all_velocity] = [square(form, curved), square(form, &trial)];
        let all_ways = match drifts {
            Some(_) => all_velocity,
            None => nodal(&trial[..]),
        };
        let [error, size] = [surface.error, surface.size];
        // Norms of displacements whose sign differs from node to node. Velocities follow from displacements, and have their rounding
        // errors over the step, also at rest far from where the body was at the start.
        let [of_velocity, of_stress] = if !is_massless {
            [0.0; 2]
        } else {
            let sizes = end.iter().zip(trial.iter()).map(|(u, v)| u.abs() + (blend.length * v).abs());
            write(strained, sizes.zip(signs(&body.mesh)).map(|(size, sign)| sign * size));
            [square(form, strained) / (blend.length * blend.length), square(elastic, strained)]
        };
        let mut squares = session.sum([
            velocity,
            histories.error,
            all_velocity,
            histories.size,
            error,
            size,
            of_velocity,
            of_stress,
            of_way,
            all_ways,
            of_displacement,
            strains,
            increment,
            increment_of_way,
        ]);
        let [.., of_way, _, _, strains, increment, increment_of_way] = squares;
        let smaller = |increment: f64, whole: f64| if increment < whole { increment } else { whole };
        squares[1] += smaller(increment, strains);
        // Obstacles that forces move, alike on all ranks.
        for motion in body.obstacle_motions() {
            let unit = if is_massless { step.length } else { 1.0 };
            let [error, size] = motion.velocity_error(curvature);
            squares[0] += error / unit;
            squares[2] += size / unit;
        }
        let [
            velocity,
            stress,
            all_velocity,
            all_stress,
            error,
            size,
            of_velocity,
            of_stress,
            _,
            all_ways,
            of_displacement,
            ..,
        ] = squares.map(root);
        let of_way = root(smaller(increment_of_way, of_way));
        // With mass both norms are roots of energies: a free body has a stress of rounding errors, a fixed one a velocity of
        // rounding errors. Without mass the square of a velocity norm is a power.
        let unit = if is_massless { step.length.sqrt() } else { 1.0 };
        Ok(StepError {
            error: Norms { velocity, stress },
            size: Norms { velocity: all_velocity, stress: all_stress },
            negligible: Norms { velocity: NEGLIGIBLE / unit, stress: NEGLIGIBLE * unit },
            rounding: Norms { velocity: ROUNDING * of_velocity, stress: ROUNDING * of_stress },
            way: Deviation {
                error: blend.length * of_way,
                size: step.length * all_ways,
                negligible: of_displacement.max(drift.least),
            },
            contact,
            surface: Deviation { error, size, negligible: NEGLIGIBLE * NEGLIGIBLE * all_stress },
            temperature: None,
        })
    }
}

/// The root of a square, negative rounding errors as they are.
fn root(square: f64) -> f64 {
    if square > 0.0 { square.sqrt() } else { square }
}

/// The norms of the quantities of all contacts over all ranks. Collective where there is contact.
fn contact_deviations<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    curvature: Curvature,
    motion: (&[f64], &[f64]),
) -> [Deviation; CONTACT_QUANTITIES] {
    let mut all = [Deviation::default(); CONTACT_QUANTITIES];
    if body.contacts.is_empty() {
        return all;
    }
    let (end, velocity) = (body.seen_by_contacts(motion.0), body.seen_by_contacts(motion.1));
    let motion = (&*end, &*velocity);
    let mut squares = [[0.0; 3]; CONTACT_QUANTITIES];
    for contact in &body.contacts {
        for (sum, found) in squares.iter_mut().zip(contact.deviations(curvature, motion)) {
            let found = [found.error, found.size, found.negligible];
            sum.iter_mut().zip(found).for_each(|(sum, square)| *sum += square);
        }
    }
    for (at, (out, squares)) in all.iter_mut().zip(squares).enumerate() {
        // All ranks have the same obstacles.
        let copies = if at < FIRST_OF_OBSTACLES { 1.0 } else { session.ranks() as f64 };
        let [error, size, negligible] = session.sum(squares).map(|square| (square / copies).sqrt());
        *out = Deviation { error, size, negligible };
    }
    all
}

/// A sign for each component of the motion of each node, which differ from node to node as those of rounding errors do; the same on any
/// number of ranks.
fn signs<const D: usize>(mesh: &Mesh<D>) -> impl Iterator<Item = f64> {
    mesh.node_ids.iter().flat_map(|id| {
        let bits = u64::from(id + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        (0..D).map(move |i| if bits >> (40 + i) & 1 == 0 { 1.0 } else { -1.0 })
    })
}

/// Replaces the previous values by these.
fn write(target: &mut Vec<f64>, values: impl Iterator<Item = f64>) {
    target.clear();
    target.extend(values);
}
