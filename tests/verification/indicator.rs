//! The error indicator: zero for uniform stress, by hand on two cells, against sums over the whole mesh on any number of ranks, and
//! against the true error of a manufactured solution.

use super::manufactured::{self, VISCOSITY, elasticity, motion, rule};
use super::quadratic::of_second_order;
use super::run_on;
use super::scenes::{brick, crossed, noise, simulation, stir};
use clarke::{
    fem::space::cell_rule,
    io::output::error_indicator::{ErrorIndicator, Indicated},
    linear_algebra::tensor::{Mandel, symmetric_part},
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};

const MODULUS: f64 = 1000.0;
const RATIO: f64 = 0.4;

/// A body at rest whose region `core`, if the mesh has one, is three times as stiff.
fn at_rest<const D: usize, const S: usize>(
    session: &Session,
    whole: &GlobalMesh<D>,
    hypothesis: &str,
) -> Simulation<D, S> {
    with_modulus(session, whole, hypothesis, |modulus| modulus.to_string())
}

/// The same, with this text of Young's modulus.
fn with_modulus<const D: usize, const S: usize>(
    session: &Session,
    whole: &GlobalMesh<D>,
    hypothesis: &str,
    text: impl Fn(f64) -> String,
) -> Simulation<D, S> {
    let material = |modulus: f64| {
        let modulus = text(modulus);
        format!("density = 1\nelasticity = {{ youngs_modulus = {modulus}, poisson_ratio = {RATIO} }}\n")
    };
    // The mesh is handed over in memory; the file is never read.
    let mut job = format!(
        "mesh.file = \"in_memory.msh\"\n[time]\nend = 1\nstep = 1\nscheme = \"implicit_euler\"\n[material]\n{hypothesis}{}",
        material(MODULUS)
    );
    if whole.regions.len() > 1 {
        job += &format!("[[region]]\nname = \"core\"\n[region.material]\n{}", material(3.0 * MODULUS));
    }
    simulation(session, &job, whole)
}

fn indicated<const D: usize, const S: usize>(
    session: &Session,
    run: &Simulation<D, S>,
    stress: &[Mandel<S>],
) -> Indicated {
    let mut indicator = ErrorIndicator::new(session, &run.body).expect("indicator");
    // A second state must not use the means of the first.
    let other: Vec<Mandel<S>> = stress.iter().map(|stress| stress.map(|value| 1.0 - value)).collect();
    indicator.of(session, &run.body, &other).expect("indicated");
    indicator.of(session, &run.body, stress).expect("indicated")
}

/// The same stress in all cells.
fn uniform<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>, hypothesis: &str) {
    let run = at_rest::<D, S>(session, whole, hypothesis);
    let stress = vec![std::array::from_fn(|c| 3.7 - 1.3 * c as f64); run.body.mesh.cell_count()];
    let found = indicated(session, &run, &stress);
    assert!(found.relative < 1e-14 && found.total < 1e-14, "{} {}", found.total, found.relative);
}

/// Two halves of a unit square with stresses of 1 Pa and 7 Pa along x. The two nodes they share have the mean, which is
/// 3 Pa off in both, the others their own stress: with q = 6^2 / E, in each cell eta^2 = |K|/12 (2 q/4 + q) = q/16.
fn two_cells(session: &Session) {
    let mut whole = rectangle([1.0, 1.0], [1, 1], Diagonal::Right, [1.0; 2]).expect("mesh");
    let found = |whole: &GlobalMesh<2>| {
        let run = at_rest::<2, 3>(session, whole, "hypothesis = \"plane_stress\"\n");
        let ids = run.body.mesh.cell_ids.iter();
        let stress: Vec<Mandel<3>> = ids.map(|&id| [if id == 0 { 1.0 } else { 7.0 }, 0.0, 0.0]).collect();
        indicated(session, &run, &stress)
    };
    let one = found(&whole);
    let square = 36.0 / MODULUS / 16.0;
    assert!(one.cells.iter().all(|eta| (eta - square.sqrt()).abs() < 1e-15), "{:?}", one.cells);
    assert!((one.total - (2.0 * square).sqrt()).abs() < 1e-15);
    let size = 0.5 * (1.0 + 49.0) / MODULUS;
    assert!((one.relative - (2.0 * square / (2.0 * square + size)).sqrt()).abs() < 1e-14);

    whole.regions.push("core".into());
    whole.cell_regions = vec![0, 1];
    let two = found(&whole);
    assert_eq!((two.total, two.relative), (0.0, 0.0), "stress may jump between materials");
    assert!(two.cells.iter().all(|eta| *eta == 0.0));
}

/// Random stresses: against the definition, computed over the whole mesh on every rank.
fn noisy<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>, hypothesis: &str) {
    indicated_noise(session, whole, &at_rest::<D, S>(session, whole, hypothesis), |_| 1.0);
    let graded = |modulus: f64| format!("\"{modulus}*(1 + 2*x)\"");
    let run = with_modulus::<D, S>(session, whole, hypothesis, graded);
    indicated_noise(session, whole, &run, |centre| 1.0 + 2.0 * centre[0]);
}

/// The same for a body whose modulus is multiplied by the factor of the centre of each cell.
fn indicated_noise<const D: usize, const S: usize>(
    session: &Session,
    whole: &GlobalMesh<D>,
    run: &Simulation<D, S>,
    factor: impl Fn([f64; D]) -> f64,
) {
    let stress =
        |id: usize| -> Mandel<S> { std::array::from_fn(|c| 2.0 + c as f64 + noise((id * S + c) as u64)) };
    let mine: Vec<Mandel<S>> = run.body.mesh.cell_ids.iter().map(|&id| stress(id as usize)).collect();
    let found = indicated(session, run, &mine);

    let mut sums = vec![([0.0; S], 0.0); 2 * whole.nodes.len()];
    let slot = |cell: usize, node: u32| 2 * node as usize + usize::from(whole.cell_regions[cell]);
    for cell in 0..whole.cell_count() {
        for &node in whole.cell(cell) {
            let (sum, volume) = &mut sums[slot(cell, node)];
            (0..S).for_each(|c| sum[c] += whole.measure(cell) * stress(cell)[c]);
            *volume += whole.measure(cell);
        }
    }
    let eta = |cell: usize| {
        let stiff = if whole.cell_regions[cell] == 1 { 3.0 } else { 1.0 };
        let modulus = stiff * MODULUS * factor(whole.centroid(cell));
        let apart: Vec<Mandel<S>> = whole
            .cell(cell)
            .iter()
            .map(|&node| {
                let (sum, volume) = sums[slot(cell, node)];
                std::array::from_fn(|c| sum[c] / volume - stress(cell)[c])
            })
            .collect();
        // Strains of isotropic elasticity: ((1 + k) t - k tr(t) I) / E.
        let normal = if S == 3 { 2 } else { 3 };
        let product = |a: &Mandel<S>, b: &Mandel<S>| {
            let whole: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            let traces: f64 = a[..normal].iter().sum::<f64>() * b[..normal].iter().sum::<f64>();

            ((1.0 + RATIO) * whole - RATIO * traces) / modulus
        };
        let mut square = 0.0;
        for a in 0..=D {
            for b in 0..=D {
                let both = if a == b { 2.0 } else { 1.0 };
                square += both * product(&apart[a], &apart[b]);
            }
        }
        (whole.measure(cell) / ((D + 1) * (D + 2)) as f64 * square).sqrt()
    };
    for (&id, value) in run.body.mesh.cell_ids.iter().zip(&found.cells) {
        let expected = eta(id as usize);
        assert!((value / expected - 1.0).abs() < 1e-12, "cell {id}: {value} {expected}");
    }
    let total = (0..whole.cell_count()).map(|cell| eta(cell).powi(2)).sum::<f64>().sqrt();
    assert!((found.total / total - 1.0).abs() < 1e-12);
}

/// Marks the cells in the middle of a body as the region `core`.
fn with_core<const D: usize>(mut whole: GlobalMesh<D>) -> GlobalMesh<D> {
    whole.regions.push("core".into());
    for cell in 0..whole.cell_count() {
        let inside = whole.centroid(cell).iter().all(|x| (0.25..0.75).contains(x));
        whole.cell_regions[cell] = u16::from(inside);
    }
    assert!(whole.cell_regions.contains(&1));
    whole
}

fn sums(session: &Session) {
    let (plane, strain) = ("hypothesis = \"plane_stress\"\n", "hypothesis = \"plane_strain\"\n");
    uniform::<2, 3>(session, &stir(crossed([5, 4]), 0.03), plane);
    uniform::<3, 6>(session, &brick([4, 3, 3]), "");
    if session.ranks() < 3 {
        two_cells(session);
    }
    linear_stress::<2, 3>(session, &stir(crossed([5, 4]), 0.03), plane);
    linear_stress::<3, 6>(session, &brick([4, 3, 3]), "");
    noisy::<2, 3>(session, &with_core(stir(crossed([6, 5]), 0.03)), plane);
    noisy::<2, 4>(session, &crossed([6, 5]), strain);
    noisy::<3, 6>(session, &with_core(brick([4, 4, 3])), "");
}

/// A stress that is linear in place: quadratic cells have no error; one point of one cell that is off has, in this cell and around.
fn linear_stress<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>, hypothesis: &str) {
    let material =
        format!("elasticity = {{ youngs_modulus = {MODULUS}, poisson_ratio = {RATIO} }}\n{hypothesis}");
    let job = format!(
        "file = \"in_memory.msh\"\n[time]\nend = 1\nstep = 1\nscheme = \"implicit_euler\"\n[material]\ndensity = 1\n{material}"
    );
    let run = simulation::<D, S>(session, &of_second_order(&job), whole);
    let mesh = &run.body.mesh;
    let mut stress = Vec::new();
    for cell in 0..mesh.cell_count() {
        let corners: Vec<_> = mesh.cell(cell).iter().map(|&node| mesh.nodes[node as usize]).collect();
        for (place, _) in cell_rule::<D>() {
            let x: [f64; D] = std::array::from_fn(|i| (0..=D).map(|a| place[a] * corners[a][i]).sum());
            let slope = |c: usize| 2.0 + c as f64 - 3.0 * x[0] + (c as f64 - 1.0) * x[D - 1];
            stress.push(std::array::from_fn(slope));
        }
    }
    let found = indicated(session, &run, &stress);
    assert!(found.relative < 1e-12 && found.total < 1e-12, "{} {}", found.total, found.relative);
    if let Some(first) = mesh.cell_ids.iter().position(|&id| id == 0) {
        stress[first * (D + 1) + 1][0] += 1.0;
    }
    let off = indicated(session, &run, &stress);
    let largest = session.largest([off.cells.iter().fold(0.0, |most, eta| eta.max(most))])[0];
    let [least] = session.largest([-off.cells.iter().fold(f64::INFINITY, |least, eta| eta.min(least))]);
    assert!(off.total > 1e-4 && largest < off.total && -least < 1e-12, "{} {largest} {least}", off.total);
}

/// Ratio of the indicated to the true error of the stress at the end, in the elastic energy norm.
fn effectivity(session: &Session, whole: &GlobalMesh<2>, n: usize, order: usize) -> f64 {
    let end = 0.25;
    let steps = if order == 1 { 2 * n } else { n * n };
    let job = manufactured::job::<2>("plane_stress", "nodal", "", end, end / steps as f64);
    let job = job.replacen("[time]", "[time]\nscheme = \"bdf2\"", 1);
    let job = if order == 1 { job } else { of_second_order(&job) };
    let mut run = simulation::<2, 3>(session, &job, whole);
    while run.advance(session).expect("step").is_some() {}
    let stress = run.body.stress_at_points(&run.state).expect("stress");
    let found = indicated(session, &run, &stress);

    let (field, elastic) = (motion::<2>(), elasticity("plane_stress"));
    let compliance = run.body.tensor(clarke::fem::effect::Form::Elasticity, 0).expect("elasticity");
    let exact = |x: &[f64; 2]| -> Mandel<3> {
        let gradient: [[f64; 2]; 2] =
            std::array::from_fn(|i| std::array::from_fn(|j| field.value(i, &[j], x)));
        let strain: Mandel<3> = symmetric_part(&gradient);
        let part = |(volumetric, shear): (f64, f64), c: usize| {
            shear * strain[c] + if c < 2 { volumetric * (strain[0] + strain[1]) } else { 0.0 }
        };
        let (now, rate) = (field.time.value(0, end), field.time.value(1, end));
        std::array::from_fn(|c| now * part(elastic, c) + rate * part(VISCOSITY, c))
    };
    let mesh = &run.body.mesh;
    let mut square = 0.0;
    for (number, cell) in run.body.geometry.iter().enumerate() {
        let corners: Vec<[f64; 2]> =
            mesh.cell(number).iter().map(|&node| mesh.nodes[node as usize]).collect();
        for (place, weight) in &rule::<2>() {
            let first = 1.0 - place[0] - place[1];
            let x = std::array::from_fn(|i| {
                first * corners[0][i] + place[0] * corners[1][i] + place[1] * corners[2][i]
            });
            let own: Mandel<3> = if order == 1 {
                stress[number]
            } else {
                // The linear function that has these stresses where a coordinate is 2/3 and the others 1/6.
                let share = [first, place[0], place[1]].map(|share| 2.0 * share - 1.0 / 3.0);
                std::array::from_fn(|c| (0..3).map(|p| share[p] * stress[3 * number + p][c]).sum())
            };
            let apart: Mandel<3> = std::array::from_fn(|c| exact(&x)[c] - own[c]);
            square += 2.0 * weight * cell.volume * compliance.inverse_square(&apart);
        }
    }
    found.total / session.sum([square])[0].sqrt()
}

/// On a regular mesh the means are of higher order than the stresses, except in cells at the surface.
fn effectivity_tends_to_one(session: &Session) {
    let regular = |n: usize| rectangle([1.0, 1.0], [n, n], Diagonal::Right, [1.0; 2]).expect("mesh");
    let indices = [6, 12, 24].map(|n| effectivity(session, &regular(n), n, 1));
    println!("effectivity on regular meshes: {indices:.4?}");
    let off = indices.map(|index| (index - 1.0).abs());
    assert!(off[2] < 0.75 * off[1] && off[1] < off[0] && off[0] < 0.05 && off[2] < 0.02, "{indices:?}");
    let askew = effectivity(session, &stir(regular(12), 0.2 / 12.0), 12, 1);
    println!("effectivity on a mesh whose nodes were moved by up to a fifth of a cell: {askew:.4}");
    assert!((0.95..1.05).contains(&askew), "{askew}");

    let quadratic = [6, 12].map(|n| effectivity(session, &stir(regular(n), 0.1 / n as f64), n, 2));
    println!("effectivity of quadratic cells: {quadratic:.4?}");
    assert!(quadratic.iter().all(|index| (0.98..1.02).contains(index)), "{quadratic:?}");
}

#[test]
fn the_error_indicator_is_what_its_definition_says_on_any_number_of_ranks() {
    run_on(&[1, 2, 3], |world| sums(&world.session));
}

#[test]
fn the_error_indicator_tends_to_the_error_of_a_smooth_solution() {
    run_on(&[2], |world| effectivity_tends_to_one(&world.session));
}
