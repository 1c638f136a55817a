//! The error of a run by its time steps: the run is repeated with longer steps, without output.
//!
//! `S_1` is the state at the end of the run, `S_2` that of steps twice as long, `S_4` that of steps four times as long. Their distances show
//! the order `p`, and Richardson's extrapolation the error of `S_1`,
//!
//! ```text
//! e = F |S_1 - S_2| / (2^p - 1),    2^p = |S_2 - S_4| / |S_1 - S_2|
//! ```
//!
//! with the safety factor `F = 1.25` of the grid convergence index (P. J. Roache, Journal of Fluids Engineering 116 (1994) 405-413). Adaptive
//! steps do not become exactly twice as long: the ratios of the numbers of steps stand for 2. The distance is that of energy: of stresses in
//! the compliance norm and of velocities in the mass norm.
//!
//! The order is that of the scheme at most. It is trusted if it is 0.7 or more, above that of the scheme by 0.5 at most, and if the states
//! change in one direction: the cosine between `S_1 - S_2` and `S_2 - S_4` is 0.5 or more. Steps that do not resolve a vibration or a jump show
//! any order between two pairs of states. Otherwise the error is uncertain, and `p` is 0.7 unless too high an order is all that is wrong.
//!
//! Where longer steps are refused or are not fewer, the run is repeated once with steps half as long instead, and `p` is 1:
//! `e = F 2 |S_1 - S_1/2|`.

use super::simulation::Simulation;
use crate::{
    error::{Exit, Result},
    fem::{
        body::Body,
        effect::{ELASTIC, Form, KINETIC},
    },
    io::output::error_indicator::ErrorIndicator,
    job::{Job, Loaded, Material},
    laws::digits::Digits,
    linear_algebra::tensor::{Mandel, add_scaled, larger},
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};
/// The safety factor of distances between states.
const SAFETY: f64 = 1.25;
/// That of the error indicator.
const SAFETY_OF_INDICATOR: f64 = 2.0;
/// A body vibrates whose kinetic energy is more than this share of its elastic energy.
const VIBRATING: f64 = 1e-2;
/// The step of repetitions over that of the run.
const LONGER: [f64; 2] = [2.0, 4.0];
/// The same where longer steps say nothing.
const SHORTER: f64 = 0.5;
/// The least order that is trusted, and the one assumed where states show less or change to and fro.
const LEAST_ORDER: f64 = 0.7;
/// How far above the order of the scheme an order is trusted.
const EXCESS: f64 = 0.5;
/// The least cosine between the changes of trusted states.
const LEAST_COSINE: f64 = 0.5;
/// Numbers of steps with a smaller ratio say nothing about the steps.
const LEAST_RATIO: f64 = 1.25;
/// The largest order that is looked for, and the halvings of its interval.
const LARGEST_ORDER: f64 = 8.0;
const BISECTIONS: u32 = 40;
/// The largest tolerance of adaptive steps.
const LARGEST_TOLERANCE: f64 = 0.5;
/// Share of the largest norm in the run below which the one at the end does not count as smaller.
const LEAST_SHARE: f64 = 0.05;

/// The estimated error of the steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorOfSteps {
    /// The error of stress and velocity at the end over `norm`; uncertain where there is no order.
    pub relative: f64,
    /// The order that the repetitions show, at most that of the job, and 1 where they can show none; `None` where it is not trusted.
    pub order: Option<f64>,
    /// The norm of stress and velocity at the end in J^(1/2), in two dimensions (J/m)^(1/2); at least a twentieth of the largest in the run.
    pub norm: f64,
    /// Whether the norm is that of the largest.
    pub is_of_largest: bool,
}

/// Stress and velocity at the end of a run.
pub struct EndState<const S: usize> {
    velocity: Vec<f64>,
    stress: Vec<Mandel<S>>,
    /// Number of steps.
    steps: u64,
    /// Largest sum of kinetic and elastic energy after any step, where that is known.
    most: f64,
}

impl<const S: usize> EndState<S> {
    /// The state that a simulation has reached.
    pub fn of<const D: usize>(simulation: &Simulation<D, S>) -> Result<Self> {
        let Simulation { body, state, .. } = simulation;
        Ok(Self {
            velocity: state.velocity.local()?.to_vec(),
            stress: body.stress_at_points(state)?,
            steps: state.step,
            most: 0.0,
        })
    }

    /// Steps a simulation to its end; `None` if it is interrupted. Collective.
    fn reached<const D: usize>(
        session: &Session,
        mut simulation: Simulation<D, S>,
        mut is_interrupted: impl FnMut() -> bool,
    ) -> Result<Option<Self>, Agreed> {
        let mut most: f64 = 0.0;
        while simulation.advance(session)?.is_some() {
            if is_interrupted() {
                return Ok(None);
            }
            most = larger(most, simulation.totals.energy[KINETIC] + simulation.totals.energy[ELASTIC]);
        }
        Ok(Some(Self { most, ..session.agree(Self::of(&simulation))? }))
    }

    /// The distance to another state of the body in the norm of energy; without one the norm. Collective.
    pub fn distance<const D: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
        other: Option<&Self>,
    ) -> Result<f64, Agreed> {
        let (mut velocity, mut stress) = (self.velocity.clone(), self.stress.clone());
        if let Some(other) = other {
            velocity.iter_mut().zip(&other.velocity).for_each(|(v, w)| *v -= w);
            stress.iter_mut().zip(&other.stress).for_each(|(s, t)| *s = add_scaled(s, -1.0, t));
        }
        let mut forces = vec![0.0; velocity.len()];
        if body.has_form(Form::Mass) {
            body.add_form(Form::Mass, &velocity, &mut forces);
        } else if !body.has_form(Form::Elasticity) {
            body.add_form(Form::Viscosity, &velocity, &mut forces);
        }
        let of_velocity: f64 = forces.iter().zip(&velocity).map(|(f, v)| f * v).sum();
        let mut of_stress = 0.0;
        let points = body.geometry.points();
        for (at, cell) in body.geometry.cells().enumerate() {
            let Some(tensor) = body.tensor(Form::Elasticity, cell.material()) else { continue };
            for point in 0..points {
                of_stress += cell.point(point).volume * tensor.inverse_square(&stress[at * points + point]);
            }
        }
        Ok(session.sum([of_velocity + of_stress])[0].max(0.0).sqrt())
    }
}

/// The job with other steps: the errors of adaptive steps grow with the square of their length.
pub fn with_steps(loaded: &Loaded, factor: f64) -> Loaded {
    let mut loaded = loaded.clone();
    let time = &mut loaded.job.time;
    time.step *= factor;
    if let Some(adaptive) = &mut time.adaptive {
        adaptive.smallest_step *= factor;
        adaptive.largest_step *= factor;
        adaptive.tolerance = (adaptive.tolerance * factor * factor).min(LARGEST_TOLERANCE);
    }
    loaded
}

/// Estimates the error of the steps of a run that began on `mesh` and has reached its end; `Err` says why it is unknown. Collective.
pub fn error_of_steps<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    (mesh, simulation): (&Mesh<D>, &Simulation<D, S>),
    mut is_interrupted: impl FnMut() -> bool,
) -> Result<std::result::Result<ErrorOfSteps, String>, Agreed> {
    let body = &simulation.body;
    let end = session.agree(EndState::of(simulation))?;
    let mut repeat = |factor: f64| {
        repeated::<D, S>(session, &with_steps(loaded, factor), mesh.clone(), &mut is_interrupted)
    };
    let mut states = [repeat(LONGER[0])?, Err("not needed".into())];
    let is_longer = |state: &EndState<S>| end.steps as f64 > LEAST_RATIO * state.steps as f64;
    if states[0].as_ref().is_ok_and(is_longer) {
        states[1] = repeat(LONGER[1])?;
    } else {
        states[0] = repeat(SHORTER)?;
    }
    let [near, far] = states;
    let near = match near {
        Ok(near) => near,
        Err(reason) => return Ok(Err(reason)),
    };
    let most = far.iter().map(|far| far.most).fold(near.most, larger);
    let (at_end, least_norm) = (end.distance(session, body, None)?, LEAST_SHARE * (2.0 * most).sqrt());
    let norm = at_end.max(least_norm);
    let ratio = |one: &EndState<S>, other: &EndState<S>| one.steps as f64 / other.steps as f64;
    let distance = end.distance(session, body, Some(&near))?;
    let first = ratio(&end, &near);
    let (order, share) = if first < 1.0 {
        (Some(1.0), SAFETY / (1.0 - first))
    } else {
        let (order, is_trusted) = match &far {
            Ok(far) => {
                let between = near.distance(session, body, Some(far))?;
                let across = end.distance(session, body, Some(far))?;
                let ratios = [first, ratio(&near, far)];
                order_of([distance, between, across], ratios, loaded.job.order_in_time().into())
            }
            Err(_) => (1.0, true),
        };
        (is_trusted.then_some(order), SAFETY / (first.powf(order) - 1.0))
    };
    let error = if distance == 0.0 { 0.0 } else { share * distance / norm };
    let least = loaded.job.solver.tolerance;
    // States that are equal within the tolerance show none.
    let order = if error <= least { order.or(Some(1.0)) } else { order };
    Ok(Ok(ErrorOfSteps { relative: larger(error, least), order, norm, is_of_largest: least_norm > at_end }))
}

const INTERRUPTED: &str = "interrupted";

/// The state at the end of a job; `Err` says why there is none. Collective.
fn repeated<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    mesh: Mesh<D>,
    is_interrupted: impl FnMut() -> bool,
) -> Result<std::result::Result<EndState<S>, String>, Agreed> {
    let run = || -> Result<Option<EndState<S>>, Agreed> {
        let simulation = session.agree(Simulation::<D, S>::on(session, loaded, mesh))?;
        EndState::reached(session, simulation, is_interrupted)
    };
    match run() {
        Ok(Some(state)) => Ok(Ok(state)),
        Ok(None) => Ok(Err(INTERRUPTED.into())),
        Err(error) if error.exit() == Exit::Stopped => Ok(Err(INTERRUPTED.into())),
        Err(error) if error.exit() == Exit::Internal => Err(error),
        Err(error) => Ok(Err(format!("with steps of {} s: {error}", Digits(loaded.job.time.step)))),
    }
}

/// The order to assume, at most that of the scheme, and whether it is trusted, given the distances of neighbouring states, the finer ones
/// first, and of the outer ones, and the ratios of the numbers of steps.
fn order_of([near, far, across]: [f64; 3], ratios: [f64; 2], of_scheme: f64) -> (f64, bool) {
    let shown = observed_order([near, far], ratios);
    let is_straight = across * across - near * near - far * far >= 2.0 * LEAST_COSINE * near * far;
    if !(is_straight && shown >= LEAST_ORDER) {
        return (LEAST_ORDER, false);
    }
    (shown.min(of_scheme), shown <= of_scheme + EXCESS)
}

/// The order at which states approach each other, given the distances of neighbours and the ratios of their numbers of steps, the finer ones
/// first; 1 where the ratios are too small to say, 0 where the states do not approach each other.
fn observed_order([near, far]: [f64; 2], [first, second]: [f64; 2]) -> f64 {
    if near == 0.0 || second < LEAST_RATIO {
        return 1.0;
    }
    let grows =
        |order: f64| first.powf(order) * (second.powf(order) - 1.0) < (first.powf(order) - 1.0) * far / near;
    let [mut low, mut high] = [0.0, LARGEST_ORDER];
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        *if grows(middle) { &mut low } else { &mut high } = middle;
    }
    low
}

/// The estimated error of the stress at the end by the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorOfMesh {
    /// Over the norm of the stress, at most 1.
    pub relative: f64,
    /// Why it is uncertain, if it is.
    pub doubt: Option<Doubt>,
}

/// Why an error by the mesh is uncertain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Doubt {
    /// The body vibrates: errors of waves add to it, which the indicator does not see.
    Vibrates,
    /// Most cells lie at the surface, where the indicator is poor.
    Thin,
    /// The indicator is so large that the stress is hardly known.
    Coarse,
}

impl Doubt {
    /// As a clause.
    pub fn words(self) -> &'static str {
        match self {
            Self::Vibrates => "the body vibrates, and errors of waves add to it",
            Self::Thin => "most cells lie at the surface, where the indicator is poor",
            Self::Coarse => "the mesh is too coarse",
        }
    }
}

/// Facets of the surface over cells above which a body counts as thin: those of five cells along each side, or of three across a long one.
const THIN: f64 = 0.45;
/// The largest error that is trusted.
const COARSE: f64 = 0.5;

/// Estimates the error of the stress at the end of a run by its mesh; `None` where the stress has no norm of linear elasticity. Collective.
pub fn error_of_mesh<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    Simulation { body, state, totals, .. }: &Simulation<D, S>,
) -> Result<Option<ErrorOfMesh>, Agreed> {
    let is_linear =
        |material: &Material| material.elasticity.as_ref().is_some_and(|law| law.expression.is_none());
    if !job.materials().all(|(_, material)| is_linear(material)) {
        return Ok(None);
    }
    let indicated = || {
        let stress = body.stress_at_points(state)?;
        ErrorIndicator::new(session, body)?.of(session, body, &stress)
    };
    let relative = SAFETY_OF_INDICATOR * session.agree(indicated())?.relative;
    let [facets, cells] =
        session.sum([body.mesh.facets.len(), body.mesh.cell_count()].map(|count| count as f64));
    let doubts = [
        (Doubt::Vibrates, totals.energy[KINETIC] > VIBRATING * totals.energy[ELASTIC]),
        (Doubt::Thin, facets > THIN * cells),
        (Doubt::Coarse, relative > COARSE),
    ];
    let doubt = doubts.into_iter().find_map(|(doubt, holds)| holds.then_some(doubt));
    Ok(Some(ErrorOfMesh { relative: relative.clamp(job.solver.tolerance, 1.0), doubt }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_trusted_near_that_of_the_scheme_where_states_change_in_one_direction() {
        let of = |distances: [f64; 3], scheme: f64| order_of(distances, [2.0, 2.0], scheme);
        let (known, is_trusted) = of([1.0, 2.0, 3.0], 1.0);
        assert!((known - 1.0).abs() < 1e-9 && is_trusted, "{known}");
        assert_eq!(of([1.0, 2.8, 3.8], 1.0), (1.0, true), "somewhat above that of the scheme");
        assert_eq!(of([1.0, 4.0, 5.0], 1.0), (1.0, false), "of order 2, by chance");
        assert!(of([1.0, 4.0, 5.0], 2.0).1);
        assert_eq!(of([0.0, 1.0, 1.0], 1.0), (1.0, true), "nothing changes");
        let uncertain = (LEAST_ORDER, false);
        assert_eq!(of([1.0, 1.5, 2.5], 1.0), uncertain, "slower than order 0.7");
        assert_eq!(of([1.0, 2.0, 1.0], 1.0), uncertain, "to and fro");
        assert_eq!(of([1.0, 2.0, f64::sqrt(5.0)], 1.0), uncertain, "each change in another direction");
        for at in 0..3 {
            let mut distances = [1.0, 2.0, 3.0];
            distances[at] = f64::NAN;
            assert_eq!(of(distances, 1.0), uncertain);
        }
    }

    #[test]
    fn states_that_halve_their_distance_at_each_doubling_are_of_first_order() {
        let close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        close(observed_order([1.0, 2.0], [2.0, 2.0]), 1.0);
        close(observed_order([1.0, 4.0], [2.0, 2.0]), 2.0);
        // Steps that are 1, 3 and 6 times as long have errors of 1, 9 and 36.
        close(observed_order([8.0, 27.0], [3.0, 2.0]), 2.0);
        assert!(observed_order([1.0, 1.0], [2.0, 2.0]) < 1e-9, "they keep their distance");
        assert!(observed_order([1.0, 0.5], [2.0, 2.0]) < 1e-9, "they part");
        close(observed_order([0.0, 1.0], [2.0, 2.0]), 1.0);
        close(observed_order([1.0, 2.0], [2.0, 1.1]), 1.0);
        assert!(observed_order([f64::NAN, 1.0], [2.0, 2.0]) < 1e-9);
    }
}
