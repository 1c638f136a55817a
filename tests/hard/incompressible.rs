//! The locking of linear cells near a Poisson's ratio of 0.5, and its reduction by crossed diagonals.

use super::family;
use crate::{case::Case, launch};

/// Deflection of a clamped bar of 4 m x 1 m in plane strain under a shear load of 1 Pa at its end, from 8 n x 2 n
/// rectangles.
fn deflection(poisson_ratio: f64, n: usize, diagonal: &str) -> f64 {
    let case = Case::of("hard/nearly_incompressible")
        .set(
            "mesh.rectangle",
            &format!("{{ size = [4, 1], cells = [{}, {}], diagonal = '{diagonal}' }}", 8 * n, 2 * n),
        )
        .set("material.elasticity.poisson_ratio", &format!("{poisson_ratio}"))
        .without("material.density")
        .without("contact")
        .set("support", "[{ on = ['left'], fix = 'all' }]")
        .set("traction", "[{ on = ['right'], value = [0, -1] }]")
        .set("output.probe", "[{ name = 'tip', point = [4, 0.5] }]")
        .set("time.end", "1.0")
        .set("time.step", "1.0");
    let outcome = case.run_with(1, &["--force"]).expect(0);
    let words = "linear elements lock above 0.45";
    if poisson_ratio > 0.45 && diagonal != "crossed" {
        outcome.says(words).says("diagonal = \"crossed\"");
    } else {
        assert!(!launch::unwrapped(&outcome.stdout).contains(words), "{poisson_ratio} {diagonal}");
    }
    -case.results().table("probes.csv").last("displacement_y")
}

#[test]
fn bending_locks_near_a_half_and_crossed_diagonals_do_not() {
    for ratio in family(&[0.4999], &[0.3, 0.45, 0.49, 0.499]) {
        // The limit for crossed cells, whose errors decrease by a factor of four per refinement.
        let (fine, finer) = (deflection(ratio, 8, "crossed"), deflection(ratio, 16, "crossed"));
        let exact = finer + (finer - fine) / 3.0;
        let lost = |diagonal| 1.0 - deflection(ratio, 4, diagonal) / exact;
        let [right, alternating, crossed] = ["right", "alternating", "crossed"].map(lost);
        println!(
            "Poisson's ratio {ratio}: 32 x 8 rectangles lose {right:.3} (right), {alternating:.3} (alternating), {crossed:.4} (crossed) of {exact:.6} m"
        );
        assert!(crossed.abs() < 0.03, "{ratio}: {crossed}");
        assert!(right > crossed, "{ratio}: {right} and {crossed}");
        if ratio >= 0.499 {
            assert!(right > 0.2, "{ratio}: right diagonals lock, {right}");
        }
    }
}
