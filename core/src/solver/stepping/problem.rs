//! A step to be solved: its data.

use super::{
    equations::{Floor, StepMatrix},
    flow::FlowStart,
    outcome::Work,
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{Form, Friction, LoadedMotion, Step},
        state::State,
    },
    laws::digits::Digits,
    linear_algebra::{petsc::DistributedVector, tensor::larger},
    parallel::session::Session,
};

/// A step whose right-hand side is known and whose contacts are prepared.
pub(super) struct StepProblem<'a, const D: usize, const S: usize> {
    /// All ranks.
    pub session: &'a Session,
    /// The body; the solution changes the pressures of its contacts.
    pub body: &'a mut Body<D, S>,
    /// The converged state from which the step starts.
    pub state: &'a State,
    /// Its velocity in the unknowns of the step.
    pub converged: &'a DistributedVector,
    pub step: Step,
    /// The right-hand side in N.
    pub forces: &'a DistributedVector,
    /// The size of the forces in N, by which the accuracy of the step is measured.
    pub scale: f64,
    /// Their norm in N, without what supports need to carry the body along.
    pub norm: f64,
    /// The residual norm in N due to rounding errors of the forces.
    pub rounding: f64,
    /// Whether zero is a velocity that supports allow and inertia does not resist, and not the one from which the step starts.
    pub may_rest: bool,
    /// The displacement from which the step starts.
    pub flow_start: FlowStart<'a>,
    /// The work done for the step.
    pub work: &'a mut Work,
}

/// The equations `K v + C(v) = b` of Newton's method: for the whole body, or for its contact nodes alone.
#[derive(Clone, Copy)]
pub(super) struct System<'a> {
    /// `K`.
    pub matrix: &'a dyn StepMatrix,
    /// `b` in N.
    pub right_hand_side: &'a DistributedVector,
    /// The residual norm in N at which the equations count as solved.
    pub tolerance: f64,
    /// The residual that rounding errors leave.
    pub floor: Floor,
    /// The residual below which rounding errors may hide that nothing holds a body yet: equations are given up soon.
    pub hiding_floor: Floor,
    /// Whether contact alone holds a body.
    pub awaits_pressure: bool,
    /// The number of fallbacks that are tried.
    pub fallbacks: usize,
    /// The velocity of the converged state.
    pub converged: &'a DistributedVector,
    /// The parameters of each contact's graphs, along the normal and of friction: equal to the resistance of the body to motions of
    /// its surface alone, and along the normal at least twice the steepest descent. With smaller parameters the residual is so steep
    /// where points change their branch that line searches fail.
    pub scales: &'a [[f64; 2]],
}

impl<const D: usize, const S: usize> StepProblem<'_, D, S> {
    /// The message that the step failed, with the reason and a remedy.
    pub(super) fn failed(&self, why: &str, remedy: &str) -> Error {
        let Step { time, length, .. } = self.step;
        Error::Failed(format!("step to t = {time:.6e} s (length {length:.3e} s) failed: {why}; {remedy}"))
    }

    /// The same where all fallbacks of Newton's method failed, which may lie at friction whose bounds grow steeply or, if they do, at
    /// laws that soften. Collective.
    pub(super) fn explain(&self, why: &str, softens: bool) -> Error {
        let body = &*self.body;
        let rises = body.contacts.iter().flat_map(|contact| &contact.friction).map(Friction::rise_of_bound);
        let [rise] = self.session.largest([rises.fold(0.0, larger)]);
        if rise > STEEP_RISE {
            return self.failed(why, &rise_remedy(rise));
        }
        if !softens {
            let motions = body.contacts.iter().flat_map(|contact| contact.obstacle.motions.iter().flatten());
            let has_massless = motions.map(LoadedMotion::inertia).any(|inertia| inertia == 0.0);
            return self
                .failed(why, &format!("{REMEDY}{}", if has_massless { MASS_OF_OBSTACLE } else { "" }));
        }
        let falls = body.contacts.iter().any(|contact| contact.monotonicity_constant() > 0.0);
        let weakens = body.contacts.iter().flat_map(|contact| &contact.friction).any(Friction::decreases);
        let own = [falls.then_some("contact"), weakens.then_some("friction")];
        let names: Vec<&str> = body.softening().chain(own.into_iter().flatten()).collect();
        let why = format!("{why}; forces of {} fall here as the body moves", names.join(", "));
        if weakens && body.redistributed_mass.is_some() {
            return self.failed(&why, MASSLESS_REMEDY);
        }
        let has = [Form::Mass, Form::Viscosity].map(|form| body.has_form(form));
        self.failed(&why, &softening_remedy(has, body.softens_at_surface()))
    }
}

impl System<'_> {
    /// Writes `b - K v`. Collective.
    pub(super) fn write_residual(
        &self,
        velocity: &DistributedVector,
        residual: &mut DistributedVector,
    ) -> Result<()> {
        self.matrix.multiply(velocity, residual)?;
        residual.scale(-1.0)?;
        residual.add_scaled(1.0, self.right_hand_side)
    }
}

/// A remedy if a solver does not converge.
pub(super) const REMEDY: &str =
    "try a smaller [time] step, a looser [solver] tolerance, or another [solver] preconditioner";

/// The same of obstacles without mass that forces or moments move.
const MASS_OF_OBSTACLE: &str =
    "; or give the obstacle that a force or a moment moves a mass or a moment_of_inertia, which may be small";

/// The same where laws soften, given whether the body has a density and a viscosity and whether bonds soften: shorter steps help only if
/// something resists fast motions.
fn softening_remedy([has_density, has_viscosity]: [bool; 2], has_bonds: bool) -> String {
    let first = match (has_density, has_viscosity) {
        (false, false) => "give the body a density or a viscosity and try a smaller [time] step",
        (true, false) => "try a smaller [time] step, give the body a viscosity",
        (_, true) => "try a smaller [time] step",
    };
    let mesh = "refine the mesh where these forces fall";
    if has_bonds {
        format!("{first}, {mesh}, or lower the `strength` of bonds")
    } else {
        format!("{first}, or {mesh}")
    }
}

/// Growth of friction bounds with the pressure above which it is named as the reason of a failure. With Coulomb's law a step may have no
/// solution or several from a coefficient of about 1 on, which depends on the body.
const STEEP_RISE: f64 = 2.0;

/// The same for friction whose bound grows so steeply with the contact pressure: of points that are about to open or to close, the
/// rounded pressure decides between no friction and all of it.
fn rise_remedy(rise: f64) -> String {
    format!(
        "friction bounds grow by {} Pa for each Pa of contact pressure where points come under pressure: use a friction coefficient that, \
         multiplied by the pressure, grows by about 1 Pa for each Pa there (in `c/(p + d)` a larger d), or [contact.friction.tresca], whose \
         bound does not depend on the pressure",
        Digits(rise)
    )
}

/// The same for friction that weakens where the surface has no mass: the velocity jumps, the more the shorter the steps.
const MASSLESS_REMEDY: &str = "friction that weakens makes the velocity of a surface without mass jump, the more the \
     shorter the steps: leave its mass there (`redistribute_mass = false`, under bdf2 or implicit_euler) or give the material a viscosity";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_is_given_only_what_it_lacks() {
        let says = |has, words: &str| softening_remedy(has, false).contains(words);
        assert!(says([false; 2], "give the body a density or a viscosity"));
        assert!(says([true, false], "give the body a viscosity"));
        assert!(
            !says([false, true], "give")
                && !says([true; 2], "give")
                && says([true; 2], "smaller [time] step, or")
        );
        assert!(softening_remedy([true; 2], true).ends_with("or lower the `strength` of bonds"));
    }
}
