//! Quadratic cells: orders of manufactured solutions, bars that linear cells lock, and the same results on any number of ranks.

use super::manufactured::{Case, Touch, elasticity, job_of, motion, rule};
use super::run_on;
use super::scenes::{any_mesh, simulation, stir};
use super::wave::Field;
use clarke::{
    fem::space::{cell_rule, values},
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
        shape::linear_at,
    },
    parallel::session::Session,
    run::Simulation,
};

/// The job with quadratic cells.
pub fn of_second_order(job: &str) -> String {
    format!("[mesh]\norder = 2\n{job}")
}

/// The strain of the motion.
fn strain<const D: usize>(field: &Field<D>, x: &[f64; D]) -> [[f64; D]; D] {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| 0.5 * (field.value(i, &[j], x) + field.value(j, &[i], x)))
    })
}

/// Errors at the end: of the velocity in L2 and of its strain, and of the stress at its points.
fn errors<const D: usize, const S: usize>(
    session: &Session,
    run: &Simulation<D, S>,
    hypothesis: &str,
    end: f64,
) -> [f64; 3] {
    let (field, mesh) = (motion::<D>(), &run.body.mesh);
    let [at_end, rate] = [0, 1].map(|order| field.time.value(order, end));
    let velocity = run.state.velocity.local().expect("velocity");
    let scale = if D == 2 { 2.0 } else { 6.0 };
    let mut squares = [0.0; 3];
    let coordinates =
        |cell: usize| -> Vec<[f64; D]> { mesh.cell_nodes(cell).map(|n| mesh.nodes[n as usize]).collect() };
    let mix = |all: &[[f64; D]], shares: &[f64]| -> [f64; D] {
        std::array::from_fn(|i| all.iter().zip(shares).map(|(value, share)| share * value[i]).sum())
    };
    for (number, cell) in run.body.geometry.iter().enumerate() {
        let nodal: Vec<[f64; D]> =
            mesh.cell_nodes(number).map(|n| std::array::from_fn(|i| velocity[n as usize * D + i])).collect();
        for (place, weight) in rule::<D>() {
            let weight = weight * cell.volume * scale;
            let mut at = [0.0; 4];
            at[0] = 1.0 - place.iter().sum::<f64>();
            at[1..=D].copy_from_slice(&place);
            let shares = values(D + 1, &at);
            let (x, value) = (mix(&coordinates(number), &shares), mix(&nodal, &shares));
            let gradient = cell.field_gradient(&linear_at(D + 1, &at, &nodal)[..=D]);
            let exact = strain(&field, &x);
            for i in 0..D {
                squares[0] += weight * (value[i] - rate * field.value(i, &[], &x)).powi(2);
                for j in 0..D {
                    let found = 0.5 * (gradient[i][j] + gradient[j][i]);
                    squares[1] += weight * (found - rate * exact[i][j]).powi(2);
                }
            }
        }
    }
    let parts = [(elasticity(hypothesis), at_end), (super::manufactured::VISCOSITY, rate)];
    run.body
        .visit_stress(&run.state, |batch| {
            let shares = values(D + 1, &cell_rule::<D>()[batch.point].0);
            for lane in 0..batch.count {
                let exact = strain(&field, &mix(&coordinates(batch.first_cell + lane), &shares));
                let trace: f64 = (0..D).map(|i| exact[i][i]).sum();
                for i in 0..D {
                    let stress = |((volumetric, shear), factor): &((f64, f64), f64)| {
                        factor * (volumetric * trace + shear * exact[i][i])
                    };
                    let off = batch.stress.0[i][lane] - parts.iter().map(stress).sum::<f64>();
                    squares[2] += batch.cells.volume[lane] * off * off;
                }
            }
        })
        .expect("stress");
    session.sum(squares).map(f64::sqrt)
}

/// Steps are chosen so that the error of the second-order scheme falls with the third power of the cells.
fn orders<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    quadrature: &str,
    cells: [usize; 2],
    mesh: impl Fn(usize) -> GlobalMesh<D>,
) {
    let end = 0.25;
    let found = cells.map(|n| {
        let steps = (2.0 * (n as f64).powf(1.5)).ceil();
        let (scheme, extra, touch, step) = ("bdf2", "", Touch::Damper, end / steps);
        let case = Case { hypothesis, scheme, quadrature, extra, relaxation: None, touch, end, step };
        let job = of_second_order(&job_of::<D>(&case));
        let mut run = simulation::<D, S>(session, &job, &mesh(n));
        while run.advance(session).expect("step").is_some() {}
        assert!(run.totals.max_energy_imbalance < 1e-9, "{}", run.totals.max_energy_imbalance);
        errors(session, &run, hypothesis, end)
    });
    let ratio = (cells[1] as f64 / cells[0] as f64).ln();
    let order: [f64; 3] = std::array::from_fn(|n| (found[0][n] / found[1][n]).ln() / ratio);
    let what = format!("{D}D {hypothesis} {quadrature}");
    println!("{what}: errors {:?}, orders {order:.3?} (velocity in L2, its strain, stress)", found[1]);
    assert!((2.75..3.4).contains(&order[0]), "{what}: velocity {order:?}");
    assert!((1.85..2.4).contains(&order[1]), "{what}: strain {order:?}");
    assert!((1.85..2.6).contains(&order[2]), "{what}: stress {order:?}");
}

fn plane(session: &Session) {
    let mesh = |n: usize| {
        stir(rectangle([1.0, 1.0], [n, n], Diagonal::Alternating, [1.0, 1.0]).expect("mesh"), 0.1 / n as f64)
    };
    orders::<2, 3>(session, "plane_stress", "gauss", [5, 10], mesh);
    orders::<2, 4>(session, "plane_strain", "gauss", [5, 10], mesh);
}

fn space(session: &Session) {
    let mesh = |n: usize| box_mesh([1.0; 3], [n; 3], [1.0; 3]).expect("mesh");
    orders::<3, 6>(session, "", "gauss", [3, 6], mesh);
}

/// Deflection of the end of an elastic bar that is clamped on the left and sheared on the right.
fn deflection<const D: usize, const S: usize>(
    session: &Session,
    ratio: f64,
    order: usize,
    mesh: &GlobalMesh<D>,
) -> f64 {
    let load = if D == 2 { "[0, -1]" } else { "[0, 0, -1]" };
    let hypothesis = if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" };
    let job = format!(
        "[mesh]\norder = {order}\n{}[time]\nend = 1e6\nstep = 1e6\nscheme = \"implicit_euler\"\n[material]\n{hypothesis}\
         elasticity = {{ youngs_modulus = 1e4, poisson_ratio = {ratio} }}\nviscosity = {{ volumetric = 0, shear = 1e-3 }}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"right\"]\nvalue = {load}\n",
        any_mesh::<D>()
    );
    let mut run = simulation::<D, S>(session, &job, mesh);
    while run.advance(session).expect("step").is_some() {}
    let displacement = run.state.displacement.owned().expect("displacement");
    let most = displacement.chunks(D).map(|u| -u[D - 1]).fold(0.0, f64::max);
    session.largest([most])[0]
}

/// On the mesh of the second argument cells lose at most 2 % of the deflection on a mesh that is finer by two.
fn bars_of<const D: usize, const S: usize>(session: &Session, mesh: impl Fn(usize) -> GlobalMesh<D>) {
    for ratio in [0.3, 0.499] {
        let [found, fine] = [1, 2].map(|n| deflection::<D, S>(session, ratio, 2, &mesh(n)));
        let linear = deflection::<D, S>(session, ratio, 1, &mesh(1));
        println!(
            "bar in {D}D, Poisson's ratio {ratio}: {:.2} % lost, with linear cells {:.1} %",
            100.0 * (1.0 - found / fine),
            100.0 * (1.0 - linear / fine)
        );
        assert!((0.98..1.0).contains(&(found / fine)) && linear < 0.9 * fine, "{found} {fine} {linear}");
    }
}

fn bars(session: &Session) {
    bars_of::<2, 4>(session, |n| {
        rectangle([4.0, 1.0], [16 * n, 4 * n], Diagonal::Right, [1.0; 2]).expect("mesh")
    });
    bars_of::<3, 6>(session, |n| box_mesh([4.0, 0.25, 1.0], [16 * n, n, 4 * n], [1.0; 3]).expect("mesh"));
}

#[test]
fn motions_in_the_plane_are_found_with_third_order_in_l2_and_second_in_stress() {
    run_on(&[1, 2], |world| plane(&world.session));
}

#[test]
fn motions_in_space_are_found_with_third_order_in_l2_and_second_in_stress() {
    run_on(&[2], |world| space(&world.session));
}

#[test]
fn quadratic_bars_do_not_lock() {
    run_on(&[1, 3], |world| bars(&world.session));
}
