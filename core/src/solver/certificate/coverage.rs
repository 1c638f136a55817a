//! Cases that the certificates do not cover.

use super::Certificates;
use crate::{
    fem::{body::Body, effect::Contact},
    laws::digits::Digits,
};

/// Whether `theta_step` below 1 excludes a second solution of a step: nothing in the step depends on the unknown contact pressures or
/// softens, and cells do not flow in it.
pub(super) fn covers_steps<const D: usize, const S: usize>(body: &Body<D, S>, step_length: f64) -> bool {
    let is_uncovered = |contact: &Contact<D>| {
        contact.friction.as_ref().is_some_and(|friction| friction.law.follows_pressure())
            || contact.obstacle.is_driven()
            || contact.laws().decrease_per_pressure(step_length).is_some()
    };
    !body.contacts.iter().any(is_uncovered) && !body.softens() && !body.flows_beside_viscosity()
}

/// Descriptions of effects that depend on the unknown contact pressures, and of effects that may soften the body at the end of a
/// step.
pub(super) fn not_covered<const D: usize, const S: usize>(
    body: &Body<D, S>,
    &Certificates { theta_step, slip_pressure_bound, decrease_with_displacement, .. }: &Certificates,
    step_length: f64,
) -> Vec<String> {
    let contacts = &body.contacts;
    let mut words = Vec::new();
    if contacts.iter().any(|c| c.friction.as_ref().is_some_and(|f| f.law.follows_pressure())) {
        words.push(
            "friction depends on the contact pressure, which theta takes as given: with a large friction coefficient a step may have several solutions"
                .into(),
        );
    }
    if contacts.iter().any(|c| c.obstacle.is_driven()) {
        words.push(
            "a force or moment moves an obstacle: theta takes the motion of the obstacle as given".into(),
        );
    }
    if contacts.iter().any(|c| c.wear.is_some()) {
        words.push(
            "wear widens the gap: theta of a step takes the sliding velocity that wears the surface off as given, but uniqueness of the continuous problem is not certified"
                .into(),
        );
    }
    if let Some(decrease) = decrease_with_displacement {
        words.push(format!(
            "a contact pressure decreases with the displacement, by up to {} Pa/m: theta of a step accounts for \
             this, but uniqueness of the continuous problem is not certified",
            Digits(decrease)
        ));
    }
    for fall in contacts.iter().filter_map(|contact| contact.laws().decrease_per_pressure(step_length)) {
        let covered = slip_pressure_bound.map_or_else(String::new, |bound| {
            if bound == 0.0 {
                let why = match theta_step {
                    Some(0.0) => ", because supports leave the body a rigid motion",
                    _ => "",
                };
                return format!("; uniqueness of steps is certified for no contact pressure{why}");
            }
            // If no other graph decreases, theta is proportional to the pressure.
            let each = match theta_step {
                Some(0.0) => {
                    let each = (1.0 - Certificates::MARGIN) / bound;
                    format!("theta of a step is {} for each Pa, so that ", Digits(each))
                }
                _ => String::new(),
            };
            format!(
                "; {each}each step has one solution for given contact pressures up to {} Pa; the run warns if they exceed this bound",
                Digits(bound)
            )
        });
        words.push(format!(
            "the friction traction decreases with the sliding velocity by up to {} Pa s/m for each Pa of contact \
             pressure, and the normal law does not bound the pressure: theta does not cover this decrease{covered}",
            Digits(fall)
        ));
    }
    if theta_step.is_some() {
        let words_of = |name| {
            format!("{name} may soften the body: theta of a step does not take softening into account")
        };
        words.extend(body.softening().map(words_of));
    }
    words
}
