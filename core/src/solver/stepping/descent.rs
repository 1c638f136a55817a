//! Minimisation of the incremental energy of a step.
//!
//! Where laws soften, the equations of a step may have no solution near its start: the nearest equilibrium has become unstable, and
//! Newton's method with a search along the norm of the residual ends at a minimum of this norm that solves nothing. The residual
//! `R = K v + C(v) + F(v) - b` of rate-independent laws is the derivative of an energy of the step, which is bounded below; a body that
//! moves slowly falls into one of its minima. Directions are therefore those of Newton's method with a positive definite derivative, in
//! which only a share of the softening counts: without softening it is that of bonds and damage held at their values, the step of
//! alternate minimisation over displacement and damage, which never raises the energy (B. Bourdin, G. Francfort, J.-J. Marigo,
//! Numerical experiments in revisited brittle fracture, J. Mech. Phys. Solids 48 (2000), 797-826; P. Farrell, C. Maurini, Linear and
//! nonlinear solvers for variational phase-field models of brittle fracture, Int. J. Numer. Methods Engrg. 109 (2017), 648-667).
//! The length of a step is where the power `R . v` of the residual along it vanishes: there the energy is smallest, without
//! being computed.

use super::equations::ContactEquations;
use crate::{
    error::Result,
    linear_algebra::petsc::{DistributedVector, NonlinearProblem, ProjectedKind},
};

/// Largest number of directions for each Newton iteration that a solve may take, on the way to another equilibrium.
pub(super) const DIRECTIONS_PER_ITERATION: usize = 20;
/// Largest number of directions where another start is better than more of them.
pub(super) const SHORT_DESCENT: usize = 25;
/// The ratio by which the share of softening decreases where the derivative is not positive definite, and by which it grows again.
const DECREASE: f64 = 0.25;
const INCREASE: f64 = 2.0;
/// The share from which it decreases to zero, and to which it grows from there.
const LEAST_SHARE: f64 = 0.1;
/// Evaluations along a direction.
const MAX_EVALUATIONS: usize = 12;
/// The power at the end of a step relative to that at its start at which a step is long enough and short enough.
const ENOUGH: f64 = 0.5;
/// Ratio of the lengths of steps before a kink: its square, and the square of that of the last two from then on. Without stiffness
/// against sliding a direction may be longer than all velocities by any factor.
const FIRST_SHRINKAGE: f64 = 0.7;
/// Ratio of two lengths beyond which the next one is their geometric mean.
const FAR: f64 = 100.0;
/// Ratio of the lengths at whose ends the direction is tried, and the least of them.
const SHORTENING: f64 = 0.1;
const LEAST_LENGTH: f64 = 1e-4;
/// A change of velocities by this share is a rounding error.
const ROUNDING: f64 = 1e-15;
/// Ratio of the lengths of steps while the energy falls steeply.
const GROWTH: f64 = 2.0;

/// Work vectors, and the residual at the end.
pub(super) struct Descent {
    pub residual: DistributedVector,
    /// Other unknowns from which to start, if there are any.
    pub other_start: DistributedVector,
    pub has_other_start: bool,
    /// Whether the energy is convex.
    pub is_convex: bool,
    trial: DistributedVector,
    trial_residual: DistributedVector,
    direction: DistributedVector,
    velocity: DistributedVector,
    change: DistributedVector,
}

/// A place along a direction: the length of the way, the power of the residual in N m/s for a unit of length, and its norm in N.
#[derive(Debug, Clone, Copy)]
struct Place {
    length: f64,
    power: f64,
    residual: f64,
    /// Norm of the change of velocities.
    change: f64,
}

impl Descent {
    /// Vectors with the layout of `like`.
    pub(super) fn new(like: &DistributedVector) -> Result<Self> {
        Ok(Self {
            residual: like.like()?,
            other_start: like.like()?,
            has_other_start: false,
            is_convex: false,
            trial: like.like()?,
            trial_residual: like.like()?,
            direction: like.like()?,
            velocity: like.like()?,
            change: like.like()?,
        })
    }

    /// Descends from the unknowns `x`, where it writes the solution, or from the other start if it leaves a smaller residual, until the
    /// norm of the residual is `absolute`, or `relative` times the first one; returns whether it did. Collective.
    pub(super) fn solve<const D: usize>(
        &mut self,
        equations: &mut ContactEquations<'_, D>,
        x: &mut DistributedVector,
        (absolute, relative): (f64, f64),
        limit: usize,
    ) -> Result<bool> {
        equations.residual(x, &mut self.residual)?;
        let mut norm = self.residual.norm()?;
        if self.has_other_start {
            equations.residual(&self.other_start, &mut self.trial_residual)?;
            if self.trial_residual.norm()? < norm {
                x.copy_from(&self.other_start)?;
            }
            equations.residual(x, &mut self.residual)?;
            norm = self.residual.norm()?;
        }
        let tolerance = absolute.max(relative * norm);
        let mut share = if self.is_convex { 0.0 } else { 1.0 };
        for _ in 0..limit {
            if norm <= tolerance || equations.is_exact() {
                return Ok(true);
            }
            if !norm.is_finite() {
                return Ok(false);
            }
            equations.write_motion(&mut self.velocity)?;
            let least_change = ROUNDING * self.velocity.norm()?;
            // The energy may have a kink here. On vertical parts of graphs pressures alone may change.
            let leads_away = |place: &Place| place.change > least_change || place.residual <= ENOUGH * norm;
            let place = loop {
                equations.set_softening(share);
                equations.linearise(x)?;
                let kind = (ProjectedKind::Definite, share == 0.0);
                if equations.solve_linearised(&self.residual, &mut self.direction, kind)?
                    && let Some(place) = self.search(equations, x, norm, share == 0.0)?.filter(leads_away)
                {
                    break place;
                }
                if share == 0.0 {
                    return Ok(false);
                }
                equations.counts.unstable += 1;
                share = if share > LEAST_SHARE { DECREASE * share } else { 0.0 };
            };
            x.add_scaled(-place.length, &self.direction)?;
            equations.residual(x, &mut self.residual)?;
            norm = self.residual.norm()?;
            if !self.is_convex {
                share = (INCREASE * share).clamp(LEAST_SHARE, 1.0);
            }
        }
        Ok(false)
    }

    /// The end of the step along the direction; `None` if the energy grows along it, on the last trial along its beginning, too.
    /// Collective.
    fn search<const D: usize>(
        &mut self,
        equations: &mut ContactEquations<'_, D>,
        x: &DistributedVector,
        norm: f64,
        is_last: bool,
    ) -> Result<Option<Place>> {
        let (mut length, mut shrink) = (1.0, FIRST_SHRINKAGE);
        let (mut low, mut high): (Option<Place>, Option<Place>) = (None, None);
        let mut start: Option<f64> = None;
        for _ in 0..MAX_EVALUATIONS {
            let place = self.evaluate(equations, x, length)?;
            if !(place.power.is_finite() && place.residual.is_finite()) {
                length *= DECREASE;
                continue;
            }
            // The power at the start, along the change of velocities.
            let first = match start {
                Some(first) => first,
                None => *start.insert(self.residual.dot(&self.change)? / length),
            };
            if place.residual <= ENOUGH * norm {
                return Ok(Some(place));
            }
            if first >= 0.0 {
                if !is_last || length < LEAST_LENGTH {
                    return Ok(None);
                }
                // Velocities bend where branches change.
                (length, start) = (SHORTENING * length, None);
                continue;
            }
            if place.power.abs() <= ENOUGH * first.abs() {
                return Ok(Some(place));
            }
            if place.power < 0.0 {
                low = Some(place)
            } else {
                high = Some(place)
            }
            length = match (low, high) {
                // The energy has a kink: nothing tells how near.
                (None, Some(high)) if high.power >= ENOUGH * first.abs() => {
                    shrink *= shrink;
                    shrink * high.length
                }
                (Some(low), Some(high)) if high.length > FAR * low.length => {
                    (low.length * high.length).sqrt()
                }
                (Some(low), None) => GROWTH * low.length,
                (low, Some(high)) => {
                    let [from, power] = low.map_or([0.0, first], |low| [low.length, low.power]);
                    let width = high.length - from;
                    let zero = -power * width / (high.power - power);
                    from + zero.clamp(0.1 * width, 0.9 * width)
                }
                (None, None) => length,
            };
        }
        Ok(low.or(high))
    }

    fn evaluate<const D: usize>(
        &mut self,
        equations: &mut ContactEquations<'_, D>,
        x: &DistributedVector,
        length: f64,
    ) -> Result<Place> {
        self.trial.copy_from(x)?;
        self.trial.add_scaled(-length, &self.direction)?;
        equations.residual(&self.trial, &mut self.trial_residual)?;
        equations.write_motion(&mut self.change)?;
        self.change.add_scaled(-1.0, &self.velocity)?;
        let power = self.trial_residual.dot(&self.change)? / length;
        Ok(Place { length, power, residual: self.trial_residual.norm()?, change: self.change.norm()? })
    }
}
