//! Certificates: bounds and constants of a problem, computed before its first step.
//!
//! | name | definition | meaning |
//! |---|---|---|
//! | `theta` | sup of `sum (m_j int w_nu^2 + m_t int w_tau^2)` over `(A e(w), e(w))` | below 1 the continuous problem has one solution; a sharper form of (13) of Wang and Cheng (2022) |
//! | `theta_step` | sup of `sum (m_j S_nu(w) + m_t S_tau(w))` over `(K w, w)`, `K` the matrix of a step | below 1 each step has one solution; tends to 0 with the step |
//! | `trace_norm_squared` | sup of `int w_nu^2` over `int e(w):e(w)` | `\|gamma\|^2` of the normal trace; (13) requires `m_A > m_j \|gamma\|^2` |
//! | `explicit_step_bound` | least `k` with `k^2 (E e(w), e(w)) >= 4 (M w, w) + 2 k (A e(w), e(w))` for some `w`, or twice the inverse of the fastest viscoplastic relaxation (in the paper `4 lambda` over the largest eigenvalue of `E`) if that is less; for power laws at an overstress equal to the yield stress, and in each step at its largest overstress | errors of longer steps grow without bound |
//! | `flowing_step_bound` | inverse of `1/k_E + 1/k_G`, of the two bounds in the row above; with viscoplastic flow only | for shorter steps errors do not grow, however much of the body flows: the elastic and viscoplastic stresses of the previous step add up (exact without inertia if the whole body flows) |
//!
//! `S_nu(w)` and `S_tau(w)` are the integrals of `w_nu^2` and `w_tau^2` as the step sums them: over its quadrature points, with the
//! weights and the directions with which contact and friction act there. At Gauss points `S_nu` is the integral. At nodes it is
//! more, up to three times in the plane and four times in space where the velocity changes its sign from node to node.
//!
//! Implicit schemes have no explicit bound. Their `K` contains the elastic stiffness, too: `theta_step` below 1 is a statement on
//! steps without viscoplastic flow.
//!
//! `growth_constants` are the `c0` and `c1` of the growth condition `|dj(r)| <= c0 + c1 |r|`, on which existence is based: the
//! smallest `c1`, then the smallest `c0`, that hold for all contact laws. A rigid obstacle has no growth constants, because its
//! graph ends in a vertical ray; there, existence follows from the monotonicity of the graph. Laws that depend on the displacement
//! have none either. Where a law decreases with the displacement, by `m` in Pa/m at most, its `m_j` in a step of length `k` is `k m`:
//! `theta_step` covers each step, and no certificate of the continuous problem is known.
//!
//! `theta_step` and `slip_pressure_bound` are those of the worst step that the run can make, of all lengths between the shortest and the
//! longest of its range (`StepRange`) and of all coefficients of its scheme. With the length `k'` for which a scheme takes its matrix
//! `M/k' + A + k' E` (`bdf2`: from `k/2`, if a step of length `k` is much longer than the last one, to `k` in the first step; `midpoint`:
//! `k/2`) the quotient of each motion has one peak as a function of `k'` (`worst_length.rs`), so that the ascent over motions takes the
//! worst length of each. It starts from lengths over the whole range, because there may be several local peaks. Slopes of laws of the
//! displacement and of friction that weakens with the slip or a state grow with `k'`: under `midpoint` the former are those of the mean
//! pressure over `k`, at most half as steep as the law. Those of damped responses do not depend on the step: without inertia and viscosity
//! their worst step is the shortest. A run that makes a step outside of the range, as
//! after a restart with other steps, renews its certificates.
//!
//! `m_j` is the steepest decrease of a contact graph, `m_t` that of a friction graph (velocity weakening: the decrease of the
//! coefficient times the largest pressure of the normal law), `m_A` the smallest eigenvalue of the viscosity. If the normal law has
//! no largest pressure, `slip_pressure_bound` is the pressure up to which `theta_step` stays below 1, `1 / sup of sum d S_tau(w)`
//! over `(K w, w) - sum (m_j S_nu(w) + m_t S_tau(w))` with the decrease `d` of the coefficient, and 0 where nothing but the contact
//! holds the body; the run compares its pressures with this bound. Suprema are taken over the velocities that the supports allow. The numerical values approach them from below, with a
//! relative error of about 1e-6; statements on the uniqueness of solutions keep a margin of 1e-3 ([`Certificates::MARGIN`]). On
//! meshes with more than 10,000 velocity components `explicit_step_bound` is the smallest of the bounds of single cells, which is
//! never too large, unless a step of the run is longer than that. If a region of the body has no viscosity, `m_A` is 0 and `theta`
//! has no meaning.

mod ascent;
mod cells;
mod certificates;
mod coverage;
mod forms;
mod suprema;
mod verdict;
mod worst_length;

pub use certificates::Certificates;
pub use verdict::{Statement, Verdict};

use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Contact, Form, Friction},
        state::State,
    },
    linear_algebra::tensor::Vector,
    mesh::count_free_motions,
    parallel::session::Session,
    solver::stepping::{MatrixOfStep, StepRange},
};
use coverage::{covers_steps, not_covered};
use suprema::{Suprema, Supremum};

/// Number of velocity components up to which the cost of the sharp bound of explicit steps is negligible.
const SMALL: usize = 10_000;

impl Certificates {
    /// Computes the certificates of a body, given the range of its steps and the matrix of one of them, preferably the longest.
    /// Collective.
    pub fn of<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        matrix: &mut MatrixOfStep<'_>,
        range: StepRange,
    ) -> Result<Self> {
        let (length, longest) = (matrix.length, range.steps[1]);
        let steepest = |constants: [f64; 2]| constants.into_iter().fold(0.0, f64::max);
        let falls = body.contacts.iter().map(|c| steepest(c.laws().monotonicity_constants(length)));
        let decrease = body.contacts.iter().filter_map(|contact| contact.laws().decrease_with_displacement());
        let decrease = decrease.reduce(f64::max);
        let growth = growth(&body.contacts);
        let viscous = body.has_form_everywhere(Form::Viscosity);
        let viscosity = body.smallest_viscosity();
        let mut known = Self {
            viscosity_modulus: viscosity.map(|modulus| -session.largest([-modulus])[0]),
            monotonicity_constant: falls.reduce(f64::max),
            growth_constants: growth.ok().flatten(),
            unbounded_growth: growth.err().map(str::to_owned),
            ..Self::default()
        };
        let scheme_is_implicit = matrix.scheme.is_implicit();
        let mut suprema = Suprema::new(session, body, state, matrix, range);
        if !body.contacts.is_empty() {
            let falling = known.monotonicity_constant.is_some_and(|m| m > 0.0);
            known.theta_step = Some(if falling { suprema.find(Supremum::ThetaStep)? } else { 0.0 });
            if viscous && decrease.is_none() {
                known.theta = Some(match falling {
                    true if moves_rigidly(session, body, falling_directions(body, length), false)? => {
                        f64::INFINITY
                    }
                    true => suprema.find(Supremum::Theta)?,
                    false => 0.0,
                });
            }
            let normals = body.contacts.iter().flat_map(|contact| contact.normal.boundary().directions());
            if !moves_rigidly(session, body, normals, false)? {
                known.trace_norm_squared = Some(suprema.find(Supremum::TraceNorm)?);
            }
        }
        if body.contacts.iter().any(|contact| contact.laws().decrease_per_pressure(length).is_some()) {
            let bound = if known.steps_are_unique() {
                let slips = |contact: &&Contact<D>| contact.laws().decrease_per_pressure(length).is_some();
                let rubbing = body.contacts.iter().filter(slips).flat_map(|contact| &contact.friction);
                let tangents = rubbing.flat_map(Friction::directions);
                if moves_rigidly(session, body, tangents, true)? {
                    0.0
                } else {
                    (1.0 - Self::MARGIN) / suprema.find(Supremum::SlipPressure)?
                }
            } else {
                0.0
            };
            known.slip_pressure_bound = Some(bound).filter(|bound| bound.is_finite() && *bound >= 0.0);
        }
        known.decrease_with_displacement = decrease;
        let depends = known.theta_step.is_some_and(|theta| theta != 0.0)
            || known.slip_pressure_bound.is_some_and(|bound| bound != 0.0);
        known.range = depends.then_some(range);
        known.step_range = depends.then_some(range.steps);
        known.covers_steps = covers_steps(body, length);
        known.not_covered = not_covered(body, &known, length);
        if body.has_form(Form::Elasticity) && !scheme_is_implicit {
            let flow = body.flow_properties().map(|flow| flow.step_bound).reduce(f64::min);
            let flow = flow.map(|bound| -session.largest([-bound])[0]);
            let decides = |waves: &f64| longest.min(flow.unwrap_or(longest)) < *waves;
            // The bound from the cells alone does not know the springs of supports.
            let is_large = body.unknowns(session) > SMALL && !body.elastic_support.has_stiffness;
            let least = cells::explicit_step_bound(session, body).filter(|waves| is_large && decides(waves));
            let waves = match least {
                Some(waves) => waves,
                None => 1.0 / suprema.find(Supremum::ExplicitStep)?,
            };
            let bound = flow.map_or(waves, |flow| waves.min(flow));
            known.explicit_step_bound = Some(bound);
            known.explicit_bound_is_least = least == Some(bound);
            known.explicit_bound_follows_stress = body.flow_properties().any(|flow| flow.has_power_law);
            known.flowing_step_bound = flow.map(|flow| 1.0 / (1.0 / waves + 1.0 / flow));
        }
        Ok(known)
    }

    /// The step at which `theta_step` is below 1 by twice the margin, so that each shorter step has one solution; `None` if no step
    /// is short enough. Collective.
    pub fn unique_step<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        matrix: &mut MatrixOfStep<'_>,
    ) -> Result<Option<f64>> {
        if !body.has_form_everywhere(Form::Mass) {
            return Ok(None);
        }
        let range = matrix.range;
        Ok(Some(1.0 / Suprema::new(session, body, state, matrix, range).find(Supremum::UniqueStep)?))
    }
}

/// The nodes at which laws of contact and friction fall, with the directions in which they do.
fn falling_directions<const D: usize, const S: usize>(
    body: &Body<D, S>,
    length: f64,
) -> impl Iterator<Item = (usize, Vector<D>)> {
    body.contacts.iter().flat_map(move |contact| {
        let [along, across] = contact.laws().monotonicity_constants(length).map(|fall| fall > 0.0);
        let normals = contact.normal.boundary().directions().filter(move |_| along);
        let friction = contact.friction.iter().filter(move |_| across);
        normals.chain(friction.flat_map(Friction::directions))
    })
}

/// Whether a rigid motion of a body moves these nodes along these directions without resistance of the supports, and of the inertia
/// and the springs if those count: a supremum of the motion over its resistance is then infinite, and its numerical value a rounding
/// error. Collective.
fn moves_rigidly<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    directions: impl Iterator<Item = (usize, Vector<D>)>,
    inertia_and_springs_count: bool,
) -> Result<bool> {
    let mesh = &body.mesh;
    let mut held: Vec<[bool; D]> = body.held.flags().as_chunks().0.to_vec();
    let mut along: Vec<_> = body.held.slanted_directions().collect();
    if inertia_and_springs_count {
        along = body.support_directions().collect();
        let mut masses = vec![0.0; held.len() * D];
        body.add_form(Form::Mass, &vec![1.0; held.len() * D], &mut masses);
        for (held, masses) in held.iter_mut().zip(masses.as_chunks::<D>().0) {
            (0..D).for_each(|i| held[i] |= masses[i] > 0.0);
        }
    }
    let free = count_free_motions(session, mesh, &held, &along)?;
    along.extend(directions);
    Ok(free > 0 && count_free_motions(session, mesh, &held, &along)? < free)
}

/// Growth constants that hold for all contacts, if there are any contacts.
fn growth<const D: usize>(contacts: &[Contact<D>]) -> std::result::Result<Option<[f64; 2]>, &'static str> {
    let mut all: Option<[f64; 2]> = None;
    for contact in contacts {
        let [rest, slope] = contact.normal.law.growth_constants()?;
        let [most, steepest] = all.unwrap_or_default();
        all = Some([rest.max(most), slope.max(steepest)]);
    }
    Ok(all)
}
