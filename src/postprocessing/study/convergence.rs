//! Orders of convergence and the cost of accuracy, from known errors.

use super::{
    Ran,
    orders::{Refinement, Size, expected, observed, refinements},
    plan::{Plan, Planned},
    results::{Order, Results},
};

/// Mesh and step of the runs that have results.
fn sizes(plan: &Plan, ran: &[Ran]) -> Vec<Option<Size>> {
    let of = |(planned, ran): (&Planned, &Ran)| {
        let record = &ran.record;
        record.is_complete().then(|| Size {
            family: format!(
                "{} {:e} {:?} {:?}",
                planned.scheme.name(),
                planned.tolerance,
                planned.adaptive,
                planned.set
            ),
            mesh: (record.cells as f64).powf(-1.0 / record.dimension.max(1) as f64),
            step: planned.step,
        })
    };
    plan.runs.iter().zip(ran).map(of).collect()
}

/// Adds the orders that runs show against coarser ones, and what the accuracy gained costs.
pub(super) fn add_orders(plan: &Plan, ran: &[Ran], results: &mut Results) {
    let coarser = refinements(&sizes(plan, ran));
    for (at, refined) in coarser.iter().enumerate() {
        for norm in 0..results.norms.len() {
            let orders: Vec<(Refinement, Order)> =
                refined.iter().filter_map(|r| Some((*r, order(plan, results, at, norm, r)?))).collect();
            let gained = orders.first().and_then(|(r, _)| digits_per_second(results, r.of, at, norm));
            if let Some(error) = &mut results.runs[at].errors.get_mut(norm).and_then(Option::as_mut) {
                error.digits_per_second = gained;
                error.orders = orders.into_iter().map(|(_, order)| order).collect();
            }
        }
    }
}

/// A run's error in a norm.
pub(super) fn error_of(results: &Results, run: usize, norm: usize) -> Option<f64> {
    results.runs[run].errors.get(norm)?.as_ref().map(|error| error.error)
}

fn order(plan: &Plan, results: &Results, run: usize, norm: usize, refined: &Refinement) -> Option<Order> {
    let (coarse, fine) = (error_of(results, refined.of, norm)?, error_of(results, run, norm)?);
    let (theory, job) = (plan.study.norm.get(norm), &plan.runs[run].loaded.job);
    let of_job = (job.mesh.order, job.order_in_time());
    Some(Order {
        refined: refined.what,
        against: results.runs[refined.of].name.clone(),
        observed: observed(coarse, fine, refined.factor)?,
        expected: theory.map(|norm| expected(norm, refined.what, of_job)),
    })
}

fn digits_per_second(results: &Results, coarse: usize, fine: usize, norm: usize) -> Option<f64> {
    let digits = (error_of(results, coarse, norm)? / error_of(results, fine, norm)?).log10();
    let more = results.runs[fine].seconds?.computing - results.runs[coarse].seconds?.computing;
    (more > 0.0 && digits.is_finite()).then(|| digits / more)
}

/// Sets errors beside published ones.
pub(super) fn add_published(plan: &Plan, ran: &[Ran], results: &mut Results) {
    let coarser = refinements(&sizes(plan, ran));
    for (at, norm) in plan.study.norm.iter().enumerate().filter(|(_, norm)| !norm.published.is_empty()) {
        for (run, published) in norm.published.iter().enumerate() {
            let Some(Some(error)) = results.runs[run].errors.get_mut(at) else { continue };
            error.published = Some(*published);
            error.ratio = Some(error.error / published);
            let before = coarser[run].first();
            error.published_order = before.and_then(|r| observed(norm.published[r.of], *published, r.factor));
        }
    }
}
