//! Cases that the certificates do not cover.

use super::Certificates;
use crate::fem::body::Body;

/// Descriptions of effects that depend on the unknown contact pressures, and of effects that may soften the body at the end of a
/// step.
pub(super) fn not_covered<const D: usize, const S: usize>(
    body: &Body<D, S>,
    &Certificates { theta_step, slip_pressure_bound, decrease_with_displacement, .. }: &Certificates,
    step_length: f64,
) -> Vec<String> {
    let contacts = &body.contacts;
    let mut words = Vec::new();
    if contacts.iter().any(|c| c.friction().is_some_and(|f| f.follows_pressure())) {
        words.push(
            "friction bounds depend on the contact pressure: theta holds for given pressures and does not cover their change with the solution; above some friction coefficient there may be several solutions"
                .into(),
        );
    }
    if contacts.iter().any(|c| c.obstacle.is_some()) {
        words.push("a force moves an obstacle: theta holds for a given motion of the obstacle".into());
    }
    if contacts.iter().any(|c| c.wear.is_some()) {
        words.push(
            "wear widens the gap between steps: theta of a step covers each step; for the continuous problem no certificate is known"
                .into(),
        );
    }
    if let Some(decrease) = decrease_with_displacement {
        words.push(format!(
            "a contact law decreases with the displacement, by {decrease:.4e} Pa/m: theta of a step covers it in each step; for the \
             continuous problem no certificate is known"
        ));
    }
    for fall in contacts.iter().filter_map(|contact| contact.decrease_per_pressure(step_length)) {
        let covered = slip_pressure_bound.map_or_else(String::new, |bound| {
            // If no other graph decreases, theta is proportional to the pressure.
            let each = match theta_step {
                Some(0.0) => {
                    let each = (1.0 - Certificates::MARGIN) / bound;
                    format!("theta of a step is {each:.4e} for each Pa, so that ")
                }
                _ => String::new(),
            };
            format!(
                "; {each}for given pressures up to {bound:.4e} Pa each step has one solution, and the run checks the pressures"
            )
        });
        words.push(format!(
            "the friction traction falls by {fall:.4} Pa s/m for each Pa of contact pressure, which this normal law does not \
             bound: theta does not cover it{covered}"
        ));
    }
    if theta_step.is_some() {
        let words_of = |name| {
            format!("{name} at the end of a step may soften the body: theta of a step does not cover it")
        };
        words.extend(body.softening().map(words_of));
    }
    words
}
