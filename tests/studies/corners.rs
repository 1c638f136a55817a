//! Singular stress at the clamped corners of the paper's problem: reduced orders on uniform meshes, and their recovery on graded
//! ones.

use super::scene::{Scene, number};
use std::path::Path;

const GRADED: &str = r#"set = ['mesh.rectangle.grading={x=1.75, y=1.75, toward=["left", "bottom", "top"]}']"#;

#[test]
fn grading_toward_the_clamped_corners_restores_the_first_order() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let paper = std::fs::read_to_string(paper).expect("job");
    let mut study =
        "set = ['time.end=0.25', 'time.step=0.0625', 'solver.preconditioner=cholesky']\n".to_owned();
    for grading in ["", GRADED] {
        for cells in [12, 24] {
            study += &format!("[[run]]\ncells = [{cells}, {cells}]\n{grading}\n");
        }
    }
    study += &format!("[reference.run]\ncells = [96, 96]\n{GRADED}\n");
    study += "[[norm]]\nof = 'velocity'\nin = 'V'\nover = 'sum'\n[[norm]]\nof = 'stress'\nin = 'Q'\nover = 'sum'\n";
    let scene = Scene::new(&paper, &study);
    scene.study(1, &[]).expect(0);
    let results = scene.results();
    let error = |run: usize, norm: usize| number(&results, &format!("/runs/{run}/errors/{norm}/error"));
    for (norm, uniform_orders) in [(0, 0.65..0.78), (1, 0.65..0.85)] {
        let order = |coarse: usize| (error(coarse, norm) / error(coarse + 1, norm)).log2();
        let (uniform, graded) = (order(0), order(2));
        println!("norm {norm}: order {uniform:.3} on uniform meshes, {graded:.3} on graded ones");
        assert!(uniform_orders.contains(&uniform), "norm {norm}, uniform: {uniform}");
        assert!((0.9..1.1).contains(&graded), "norm {norm}, graded: {graded}");
        assert!(error(3, norm) < 0.8 * error(1, norm));
    }
    assert_eq!(number(&results, "/runs/1/unknowns"), number(&results, "/runs/3/unknowns"));
}
