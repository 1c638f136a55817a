//! Observed and theoretical orders of convergence.

use super::document::{Norm, Space};
use serde::{Deserialize, Serialize};

/// The quantity that is refined between two runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refined {
    /// The mesh only.
    Mesh,
    /// The step only.
    Step,
    /// Mesh and step.
    Both,
}

impl Refined {
    /// Its symbol in tables.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Mesh => "h",
            Self::Step => "k",
            Self::Both => "h,k",
        }
    }
}

/// The properties of a run that determine orders.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Size {
    /// The family: scheme, tolerance and other overrides. Only runs of one family are refinements of each other.
    pub family: String,
    /// Mesh size: the number of cells to the power -1/dimension.
    pub mesh: f64,
    /// Length of a step in s.
    pub step: f64,
}

/// The refinement from a coarser run to a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Refinement {
    /// Index of the coarser run.
    pub of: usize,
    /// The refined quantity.
    pub what: Refined,
    /// The refinement factor; for mesh and step, their geometric mean.
    pub factor: f64,
}

/// For each run the next coarser runs: in the mesh, in the step and, if there are none, in both. `None` is a run without results.
pub(super) fn refinements(sizes: &[Option<Size>]) -> Vec<Vec<Refinement>> {
    let of = |at: usize| -> Vec<Refinement> {
        let Some(fine) = &sizes[at] else { return Vec::new() };
        let mut found: Vec<Refinement> = Vec::new();
        for (of, coarse) in sizes[..at].iter().enumerate() {
            let Some(coarse) = coarse.as_ref().filter(|coarse| coarse.family == fine.family) else {
                continue;
            };
            let (mesh, step) = (coarse.mesh / fine.mesh, coarse.step / fine.step);
            let (same_mesh, same_step) = ((mesh - 1.0).abs() < 1e-9, (step - 1.0).abs() < 1e-9);
            let (what, factor) = match (same_mesh, same_step) {
                (false, true) if mesh > 1.0 => (Refined::Mesh, mesh),
                (true, false) if step > 1.0 => (Refined::Step, step),
                (false, false) if mesh > 1.0 && step > 1.0 => (Refined::Both, (mesh * step).sqrt()),
                _ => continue,
            };
            let next = Refinement { of, what, factor };
            match found.iter_mut().find(|other| other.what == what) {
                Some(other) if factor <= other.factor => *other = next,
                Some(_) => {}
                None => found.push(next),
            }
        }
        if found.iter().any(|refinement| refinement.what != Refined::Both) {
            found.retain(|refinement| refinement.what != Refined::Both);
        }
        found.sort_by_key(|refinement| refinement.what);
        found
    };
    (0..sizes.len()).map(of).collect()
}

/// The observed order of two errors.
pub(super) fn observed(coarse: f64, fine: f64, factor: f64) -> Option<f64> {
    let order = (coarse / fine).ln() / factor.ln();
    order.is_finite().then_some(order)
}

/// The theoretical order: that given in the study, or that for smooth solutions of a job with cells of this order and steps of that one.
/// Of the stress the mean of each cell is compared, also where it is linear in the cell.
pub(super) fn expected(norm: &Norm, what: Refined, (of_cells, of_steps): (u8, u32)) -> f64 {
    let mesh = match norm.space {
        Space::H => f64::from(of_cells) + 1.0,
        Space::V => f64::from(of_cells),
        Space::Q => 1.0,
    };
    let step = f64::from(of_steps);
    norm.expected_order.unwrap_or(match what {
        Refined::Mesh => mesh,
        Refined::Step => step,
        Refined::Both => mesh.min(step),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::postprocessing::study::document::{Over, Quantity};

    fn size(family: &str, cells: f64, step: f64) -> Option<Size> {
        Some(Size { family: family.into(), mesh: 1.0 / cells, step })
    }

    #[test]
    fn runs_refined_in_mesh_and_step_are_compared_with_the_one_before() {
        let sizes = [size("a", 4.0, 0.5), size("a", 8.0, 0.25), None, size("a", 16.0, 0.0625)];
        let found = refinements(&sizes);
        assert_eq!(found[0], []);
        assert_eq!(found[1], [Refinement { of: 0, what: Refined::Both, factor: 2.0 }]);
        assert_eq!(found[2], []);
        assert_eq!((found[3][0].of, found[3][0].what), (1, Refined::Both));
        assert!((found[3][0].factor - 8f64.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn products_have_an_order_in_each_direction_and_families_keep_apart() {
        let sizes = [
            size("a", 4.0, 0.5),
            size("a", 4.0, 0.25),
            size("a", 8.0, 0.5),
            size("a", 8.0, 0.25),
            size("b", 8.0, 0.1),
        ];
        let found = refinements(&sizes);
        assert_eq!(
            found[3],
            [
                Refinement { of: 1, what: Refined::Mesh, factor: 2.0 },
                Refinement { of: 2, what: Refined::Step, factor: 2.0 }
            ]
        );
        assert_eq!(found[4], []);
    }

    #[test]
    fn orders_are_ratios_of_logarithms() {
        assert!((observed(0.4, 0.1, 2.0).expect("order") - 2.0).abs() < 1e-14);
        assert_eq!(observed(0.4, 0.0, 2.0), None);
        assert_eq!(observed(0.0, 0.0, 2.0), None);
    }

    #[test]
    fn theory_takes_the_lower_order_where_both_are_refined_and_what_the_study_says() {
        let norm = |space, expected_order| Norm {
            of: Quantity::Velocity,
            space,
            over: Over::Max,
            expected_order,
            published: Vec::new(),
            targets: Vec::new(),
        };
        assert_eq!(expected(&norm(Space::H, None), Refined::Mesh, (1, 2)), 2.0);
        assert_eq!(expected(&norm(Space::H, None), Refined::Both, (1, 1)), 1.0);
        assert_eq!(expected(&norm(Space::V, None), Refined::Step, (1, 2)), 2.0);
        assert_eq!(expected(&norm(Space::V, None), Refined::Both, (1, 2)), 1.0);
        assert_eq!(expected(&norm(Space::V, Some(1.5)), Refined::Both, (1, 2)), 1.5);
        let of_mesh = |space| expected(&norm(space, None), Refined::Mesh, (2, 1));
        assert_eq!([Space::H, Space::V, Space::Q].map(of_mesh), [3.0, 2.0, 1.0]);
    }
}
