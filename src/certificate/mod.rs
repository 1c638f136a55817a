//! Certificates: what is known of a problem before its first step.
//!
//! | name | definition | meaning |
//! |---|---|---|
//! | `theta` | sup of `sum (m_j int w_nu^2 + m_t int w_tau^2)` over `(A e(w), e(w))` | below 1 the continuous problem has one solution; a sharper form of (13) of Wang and Cheng (2022) |
//! | `theta_step` | sup of `sum (m_j S_nu(w) + m_t S_tau(w))` over `(K w, w)`, `K` the matrix of a step | below 1 each step has one solution; tends to 0 with the step |
//! | `trace_norm_squared` | sup of `int w_nu^2` over `int e(w):e(w)` | `\|gamma\|^2` of the normal trace; (13) asks for `m_A > m_j \|gamma\|^2` |
//! | `explicit_step_bound` | least `k` with `k^2 (E e(w), e(w)) >= 4 (M w, w) + 2 k (A e(w), e(w))` for some `w`, or twice the inverse of the fastest viscoplastic relaxation (in the paper `4 lambda` over the largest eigenvalue of `E`) if that is less; of power laws at an overstress of the yield stress, and in each step at the largest one | steps beyond it grow without bound |
//! | `flowing_step_bound` | inverse of `1/k_E + 1/k_G`, of the two bounds in the row above; there if something flows | below it errors don't grow, however much flows: elastic and viscoplastic stress of the step before add up (exact without inertia, where all flows) |
//!
//! `S_nu(w)` and `S_tau(w)` are the integrals of `w_nu^2` and `w_tau^2` as the step sums them: over its quadrature points, with the
//! weights and the directions with which contact and friction act there. At Gauss points `S_nu` is the integral. At nodes it is
//! more, up to three times in the plane and four times in space where the velocity changes its sign from node to node.
//!
//! Implicit schemes have no explicit bound; their `K` holds the elastic stiffness, too: `theta_step` below 1 speaks of steps in
//! which nothing flows.
//!
//! `growth_constants` are the `c0` and `c1` of the growth condition `|dj(r)| <= c0 + c1 |r|` that existence rests on: valid for all
//! contact laws, the least `c1` first. A rigid obstacle has none, its graph ends in a vertical ray: there existence rests on its
//! graph being monotone. Nor has a law of the displacement.
//!
//! `m_j` is the steepest fall of a contact graph, `m_t` that of a friction graph (slip weakening: the fall of the coefficient
//! times the largest pressure of the normal law), `m_A` the smallest eigenvalue of the viscosity. Where the normal law has no
//! largest pressure, `slip_pressure_bound` is the pressure up to which `theta_step` stays below 1 with that fall,
//! `1 / sup of sum fall S_tau(w)` over `(K w, w) - sum (m_j S_nu(w) + m_t S_tau(w))`; a run is held against it. Suprema
//! run over velocities that the supports allow. Numerically they are approached from below, to about 1e-6 of their size: what is
//! said of one solution keeps a margin of 1e-3 ([`Certificates::MARGIN`]). On meshes of more than 10,000 velocity
//! components `explicit_step_bound` is the least of the bounds of single cells, which is never too large, unless a step of the
//! run is longer than that. Where a region of the body has no
//! viscosity, `m_A` is 0 and `theta` has no meaning.

mod ascent;
mod cells;
mod coverage;
mod forms;
mod small_eigen;
mod verdict;

pub use verdict::{Accepted, Verdict};

use crate::{
    body::Body,
    effect::{Contact, Form},
    error::Result,
    petsc::DistributedVector,
    session::Session,
    state::State,
    stepping::Stepper,
};
use ascent::{Quotient, climb};
use coverage::not_covered;
use serde::{Deserialize, Serialize};

/// Relative changes at which a supremum counts as found: of the explicit step, and of contact.
const TOLERANCE: f64 = 1e-5;
const TIGHT: f64 = 1e-8;
/// Velocity components up to which the sharp bound of explicit steps costs next to nothing.
const SMALL: usize = 10_000;
/// Iterations after which they are taken as they are.
const ITERATIONS: usize = 60;
const MANY: usize = 200;
/// `theta_step` of the largest step that is suggested: its digits are rounded.
const FAR_BELOW: f64 = 1.0 - 2.0 * Certificates::MARGIN;
/// A trace norm |gamma|^2 beyond this many times the length of the body comes from a rigid motion, blurred by rounding.
const RIGID: f64 = 1e10;

/// Constants of the problem; null where they have no meaning.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Certificates {
    /// `m_j sup |w_nu|^2 / (A e(w), e(w))`.
    pub theta: Option<f64>,
    /// The same with the matrix of a step, and with the sums over its quadrature points.
    pub theta_step: Option<f64>,
    /// `m_A` in Pa s.
    pub viscosity_modulus: Option<f64>,
    /// `m_j` in Pa s/m.
    pub monotonicity_constant: Option<f64>,
    /// `c0` in Pa and `c1` in Pa s/m with `|-sigma_nu| <= c0 + c1 |v_nu|`, whatever the contact; null where they are infinite.
    pub growth_constants: Option<[f64; 2]>,
    /// Why there are no growth constants although there is contact, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unbounded_growth: Option<String>,
    /// `|gamma|^2` of the normal trace in m; null where it is infinite: the supports leave a rigid motion against the contact.
    pub trace_norm_squared: Option<f64>,
    /// Contact pressure in Pa up to which a step has one solution, if pressures are given, where friction weakens under a
    /// pressure that no law bounds, with the margin; 0: at none.
    pub slip_pressure_bound: Option<f64>,
    /// Largest stable step in s.
    pub explicit_step_bound: Option<f64>,
    /// Whether the largest stable step may be longer than that: of a large mesh the bound of its cells is enough, where no step
    /// is longer.
    #[serde(skip)]
    pub explicit_bound_is_least: bool,
    /// Whether it holds for overstresses up to the yield stress only: there are power laws.
    #[serde(skip)]
    pub explicit_bound_follows_stress: bool,
    /// Step in s below which errors don't grow, however much of the body flows; for the verdict only.
    #[serde(skip)]
    pub flowing_step_bound: Option<f64>,
    /// What `theta` and `theta_step` say nothing of, in words; absent if there is nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_covered: Vec<String>,
}

impl Certificates {
    /// How far below 1 `theta_step` has to be for steps to count as having one solution: suprema are approached from below.
    pub const MARGIN: f64 = 1e-3;

    /// Computes what the body and the scheme, prepared for its step, call for, where no step is longer than `longest` in s.
    /// Collective.
    pub fn of<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        scheme: &mut Stepper,
        longest: f64,
    ) -> Result<Self> {
        let falls = body.contacts.iter().map(|c| c.known_falls().into_iter().fold(0.0, f64::max));
        let growth = growth(&body.contacts);
        let viscous = body.has_form_everywhere(Form::Viscosity);
        let mut known = Self {
            viscosity_modulus: body.smallest_viscosity(),
            monotonicity_constant: falls.reduce(f64::max),
            growth_constants: growth.ok().flatten(),
            unbounded_growth: growth.err().map(str::to_owned),
            ..Self::default()
        };
        let scheme_is_implicit = scheme.scheme().is_implicit();
        let mut starts = Starts::default();
        let mut find = |kind: Kind| find(session, body, state, scheme, kind, &mut starts);
        if !body.contacts.is_empty() {
            let falling = known.monotonicity_constant.is_some_and(|m| m > 0.0);
            known.theta_step = Some(if falling { find(Kind::ThetaStep)? } else { 0.0 });
            if viscous {
                known.theta = Some(if falling { find(Kind::Theta)? } else { 0.0 });
            }
            known.trace_norm_squared =
                Some(find(Kind::TraceNorm)?).filter(|norm| *norm < RIGID * length(session, &body.mesh.nodes));
        }
        if body.contacts.iter().any(|contact| contact.unknown_fall().is_some()) {
            let bound =
                if known.steps_are_unique() { (1.0 - Self::MARGIN) / find(Kind::SlipPressure)? } else { 0.0 };
            known.slip_pressure_bound = Some(bound).filter(|bound| bound.is_finite());
        }
        known.not_covered = not_covered(body, known.theta_step, known.slip_pressure_bound);
        if body.has_form(Form::Elasticity) && !scheme_is_implicit {
            let flow = body.flow_step_bound();
            let decides = |waves: &f64| longest.min(flow.unwrap_or(longest)) < *waves;
            let is_large = body.unknowns(session) > SMALL;
            let least = cells::explicit_step_bound(session, body).filter(|waves| is_large && decides(waves));
            let waves = match least {
                Some(waves) => waves,
                None => 1.0 / find(Kind::ExplicitStep)?,
            };
            let bound = flow.map_or(waves, |flow| waves.min(flow));
            known.explicit_step_bound = Some(bound);
            known.explicit_bound_is_least = least == Some(bound);
            known.explicit_bound_follows_stress = body.has_power_law();
            known.flowing_step_bound = flow.map(|flow| 1.0 / (1.0 / waves + 1.0 / flow));
        }
        Ok(known)
    }

    /// Whether `theta_step`, if there is one, says that each step has one solution.
    pub fn steps_are_unique(&self) -> bool {
        self.theta_step.is_none_or(|theta| theta < 1.0 - Self::MARGIN)
    }

    /// The step at which `theta_step` is below 1 by twice the margin, so that each step up to it has one solution; `None` where
    /// no step is small enough. Collective.
    pub fn unique_step<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
        scheme: &mut Stepper,
    ) -> Result<Option<f64>> {
        if !body.has_form_everywhere(Form::Mass) {
            return Ok(None);
        }
        Ok(Some(1.0 / find(session, body, state, scheme, Kind::UniqueStep, &mut Starts::default())?))
    }
}

/// The longest side of the box around these nodes on all ranks. Collective.
fn length<const D: usize>(session: &Session, nodes: &[[f64; D]]) -> f64 {
    let bound = |sign: f64| -> [f64; D] {
        let most = |i| nodes.iter().map(|node| sign * node[i]).fold(f64::NEG_INFINITY, f64::max);
        session.largest(std::array::from_fn(most))
    };
    let (high, low) = (bound(1.0), bound(-1.0));
    (0..D).map(|i| high[i] + low[i]).fold(0.0, f64::max)
}

/// Growth constants that hold for all contacts, if there are any contacts.
fn growth<const D: usize>(contacts: &[Contact<D>]) -> std::result::Result<Option<[f64; 2]>, &'static str> {
    let mut all: Option<[f64; 2]> = None;
    for contact in contacts {
        let [rest, slope] = contact.law.growth_constants()?;
        let [most, steepest] = all.unwrap_or_default();
        all = Some([rest.max(most), slope.max(steepest)]);
    }
    Ok(all)
}

fn find<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
    scheme: &mut Stepper,
    kind: Kind,
    starts: &mut Starts,
) -> Result<f64> {
    let mut pencil = Pencil { body, scheme, kind };
    if kind == Kind::ExplicitStep {
        let start = rough(body, state)?;
        return Ok(climb(session, &mut pencil, start, None, TOLERANCE, ITERATIONS)?.value);
    }
    let pulled = match &starts.pulled {
        Some(pulled) => copy(pulled)?,
        None => {
            let pull = pull(body, state)?;
            let mut pulled = pull.like()?;
            pencil.precondition(&pull, &mut pulled)?;
            starts.pulled = Some(copy(&pulled)?);
            pulled
        }
    };
    let (start, beside) = match starts.peak.take() {
        Some(peak) => (peak, Some(pulled)),
        None => (pulled, None),
    };
    let peak = climb(session, &mut pencil, start, beside, TIGHT, MANY)?;
    starts.peak = Some(peak.vector);
    Ok(peak.value)
}

fn copy(vector: &DistributedVector) -> Result<DistributedVector> {
    let mut copy = vector.like()?;
    copy.copy_from(vector)?;
    Ok(copy)
}

/// Where ascents start: suprema of the contact's pull lie near each other.
#[derive(Default)]
struct Starts {
    /// What a pull at the whole contact boundary leads to.
    pulled: Option<DistributedVector>,
    /// Where the last supremum was found.
    peak: Option<DistributedVector>,
}

/// Which supremum is sought.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Theta,
    ThetaStep,
    TraceNorm,
    ExplicitStep,
    /// `1/k` for the step `k` at which `theta_step` reaches `t`, 1 less twice the margin: the largest of `(W / t - A) / M`.
    UniqueStep,
    /// The inverse of the pressure at which `theta_step` reaches 1 where friction weakens with the pressure.
    SlipPressure,
}

struct Pencil<'a, const D: usize, const S: usize> {
    body: &'a Body<D, S>,
    scheme: &'a mut Stepper,
    kind: Kind,
}

impl<const D: usize, const S: usize> Quotient for Pencil<'_, D, S> {
    fn forms(&self) -> usize {
        if matches!(self.kind, Kind::ExplicitStep | Kind::UniqueStep | Kind::SlipPressure) { 3 } else { 2 }
    }

    fn apply(&mut self, form: usize, x: &mut DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let body = self.body;
        let interior = match (self.kind, form) {
            (Kind::ExplicitStep, 0) => Form::Elasticity,
            (Kind::ExplicitStep, 1) | (Kind::UniqueStep, 2) => Form::Mass,
            (Kind::ExplicitStep, _) | (Kind::Theta | Kind::UniqueStep, 1) => Form::Viscosity,
            (Kind::TraceNorm, 1) => Form::Strain,
            (Kind::ThetaStep | Kind::SlipPressure, 1) => return self.scheme.multiply(x, y),
            (kind, _) => {
                return forms::apply(body, x, y, |x, y| {
                    for contact in &body.contacts {
                        let falls = contact.known_falls();
                        match (kind, form) {
                            (Kind::TraceNorm, _) => forms::add_trace(&body.mesh, contact, [1.0, 0.0], x, y),
                            (Kind::Theta, _) => forms::add_trace(&body.mesh, contact, falls, x, y),
                            (Kind::SlipPressure, 0) => {
                                contact.add_squares([0.0, contact.unknown_fall().unwrap_or(0.0)], x, y);
                            }
                            _ => contact.add_squares(falls, x, y),
                        }
                    }
                });
            }
        };
        forms::apply(body, x, y, |x, y| body.add_form(interior, x, y))
    }

    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.scheme.precondition(r, z)?;
        forms::hold(self.body, z)
    }

    fn weights(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
        match self.kind {
            Kind::ExplicitStep => {
                let k = bound_of(values);
                (vec![k * k, 0.0, 0.0], vec![0.0, 4.0, 2.0 * k])
            }
            Kind::UniqueStep => (vec![1.0 / FAR_BELOW, -1.0, 0.0], vec![0.0, 0.0, 1.0]),
            Kind::SlipPressure => (vec![1.0, 0.0, 0.0], vec![0.0, 1.0, -1.0]),
            Kind::Theta | Kind::ThetaStep | Kind::TraceNorm => (vec![1.0, 0.0], vec![0.0, 1.0]),
        }
    }

    fn value(&self, values: &[f64]) -> f64 {
        match self.kind {
            Kind::ExplicitStep => 1.0 / bound_of(values),
            Kind::UniqueStep => (values[0] / FAR_BELOW - values[1]) / values[2],
            Kind::SlipPressure => values[0] / (values[1] - values[2]),
            Kind::Theta | Kind::ThetaStep | Kind::TraceNorm => values[0] / values[1],
        }
    }
}

/// The `k` with `k^2 e = 4 m + 2 k a`.
fn bound_of(values: &[f64]) -> f64 {
    let [e, m, a] = [values[0], values[1], values[2]];
    (a + (a * a + 4.0 * e * m).sqrt()) / e
}

/// A start that pulls the whole contact boundary outward, and along where there is friction.
fn pull<const D: usize, const S: usize>(body: &Body<D, S>, state: &State) -> Result<DistributedVector> {
    let mut out = rough(body, state)?;
    let mut values = out.owned_mut()?;
    values.iter_mut().for_each(|value| *value *= 1e-2);
    for contact in &body.contacts {
        contact.add_normals(&mut values);
        contact.add_unit_sliding(&mut values);
    }
    values.iter_mut().zip(&body.fixed).filter(|(_, fixed)| **fixed).for_each(|(value, _)| *value = 0.0);
    drop(values);
    Ok(out)
}

/// A start with a share of every mode: numbers between -1 and 1 that depend on the node's id alone.
fn rough<const D: usize, const S: usize>(body: &Body<D, S>, state: &State) -> Result<DistributedVector> {
    let mut out = state.velocity.like()?;
    {
        let mut values = out.owned_mut()?;
        for (node, target) in values.chunks_exact_mut(D).enumerate() {
            for (i, value) in target.iter_mut().enumerate() {
                let key = [body.mesh.node_ids[node].to_le_bytes(), (i as u32).to_le_bytes()].concat();
                let bits = xxhash_rust::xxh3::xxh3_64(&key) >> 11;
                *value = bits as f64 / (1u64 << 52) as f64 - 1.0;
            }
        }
    }
    forms::hold(body, &mut out)?;
    Ok(out)
}
