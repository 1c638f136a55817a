//! The assembled matrix against a dense matrix computed here by other formulas.

use super::run_on;
use super::scenes::{body, brick, crossed, set_nodal, stir, sum};
use clarke::{
    fem::{
        body::Body,
        effect::{Effect, Inertia, ViscousStress},
    },
    job::{Axis, Fix, FixedDirections},
    laws::material::{ByMaterial, Isotropic},
    linear_algebra::{petsc::Matrix, tensor::larger},
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
};

const VISCOSITY: Isotropic = Isotropic { volumetric: 2.5, shear: 7.0 };
const DENSITY: f64 = 3.0;
const STEP: f64 = 0.05;

/// Coefficients `c[a]` of the shape functions `c[a][0] + c[a][1] x + ...`, and the volume.
fn shape_functions<const D: usize>(corners: &[[f64; D]]) -> (Vec<Vec<f64>>, f64) {
    let n = D + 1;
    // Gauss-Jordan on [1 x y z | I].
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|a| {
            let mut row = vec![1.0];
            row.extend(corners[a]);
            row.extend((0..n).map(|b| f64::from(u8::from(a == b))));
            row
        })
        .collect();
    let mut determinant = 1.0;
    for pivot in 0..n {
        let best =
            (pivot..n).max_by(|&p, &q| rows[p][pivot].abs().total_cmp(&rows[q][pivot].abs())).expect("rows");
        if best != pivot {
            rows.swap(best, pivot);
            determinant = -determinant;
        }
        determinant *= rows[pivot][pivot];
        let lead = rows[pivot].clone();
        rows[pivot].iter_mut().for_each(|x| *x /= lead[pivot]);
        let lead = rows[pivot].clone();
        for other in (0..n).filter(|&r| r != pivot) {
            let factor = rows[other][pivot];
            rows[other].iter_mut().zip(&lead).for_each(|(x, l)| *x -= factor * l);
        }
    }
    let functions = (0..n).map(|a| (0..n).map(|power| rows[power][n + a]).collect()).collect();
    (functions, determinant.abs() / if D == 2 { 2.0 } else { 6.0 })
}

/// Points of degree 2: the middles of edges of a triangle, four points in a tetrahedron.
fn quadrature<const D: usize>(corners: &[[f64; D]]) -> Vec<[f64; D]> {
    let mean = |shares: &[f64]| std::array::from_fn(|i| (0..=D).map(|a| shares[a] * corners[a][i]).sum());
    if D == 2 {
        return [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]].iter().map(|s| mean(s)).collect();
    }
    let near = (5.0 - 5f64.sqrt()) / 20.0;
    (0..4)
        .map(|far| {
            let mut shares = [near; 4];
            shares[far] = 1.0 - 3.0 * near;
            mean(&shares)
        })
        .collect()
}

/// The strain of the shape function `a` times the unit vector along `i`.
fn strain<const D: usize>(function: &[f64], i: usize) -> [[f64; D]; D] {
    let mut e = [[0.0; D]; D];
    for j in 0..D {
        e[i][j] += 0.5 * function[j + 1];
        e[j][i] += 0.5 * function[j + 1];
    }
    e
}

/// `DENSITY M / STEP + A` by original node ids.
fn reference<const D: usize>(whole: &GlobalMesh<D>) -> Vec<Vec<f64>> {
    let n = whole.nodes.len() * D;
    let mut dense = vec![vec![0.0; n]; n];
    for nodes in whole.cells.chunks_exact(D + 1) {
        let corners: Vec<[f64; D]> = nodes.iter().map(|&node| whole.nodes[node as usize]).collect();
        let (functions, volume) = shape_functions(&corners);
        let points = quadrature(&corners);
        let value = |a: usize, x: &[f64; D]| {
            functions[a][0] + (0..D).map(|i| functions[a][i + 1] * x[i]).sum::<f64>()
        };
        for a in 0..=D {
            for b in 0..=D {
                let mass: f64 =
                    points.iter().map(|x| value(a, x) * value(b, x)).sum::<f64>() / points.len() as f64;
                for i in 0..D {
                    for j in 0..D {
                        let (test, rate) = (strain::<D>(&functions[a], i), strain::<D>(&functions[b], j));
                        let trace: f64 = (0..D).map(|k| rate[k][k]).sum();
                        let mut power = 0.0;
                        for k in 0..D {
                            for l in 0..D {
                                let identity = f64::from(u8::from(k == l));
                                let stress =
                                    VISCOSITY.volumetric * trace * identity + VISCOSITY.shear * rate[k][l];
                                power += stress * test[k][l];
                            }
                        }
                        let inertia = if i == j { DENSITY / STEP * mass } else { 0.0 };
                        dense[nodes[a] as usize * D + i][nodes[b] as usize * D + j] +=
                            volume * (power + inertia);
                    }
                }
            }
        }
    }
    dense
}

/// The assembled matrix of all ranks, dense, by original node ids.
fn gathered<const D: usize, const S: usize>(session: &Session, body: &Body<D, S>) -> Vec<f64> {
    let n = body.mesh.total_nodes;
    let mut ids = vec![0.0; n];
    for node in 0..body.mesh.owned {
        ids[body.mesh.first_node + node] = f64::from(body.mesh.node_ids[node]);
    }
    let ids = sum(session, &ids);
    let rows = body.matrix(session, STEP).expect("assembled");
    assert_eq!(rows.offsets.len(), body.mesh.owned + 1);
    let mut dense = vec![0.0; n * D * n * D];
    for node in 0..body.mesh.owned {
        let range = rows.offsets[node]..rows.offsets[node + 1];
        assert!(rows.columns[range.clone()].is_sorted_by(|a, b| a < b), "columns ascend");
        for at in range {
            let (row, column) = (body.mesh.node_ids[node] as usize, ids[rows.columns[at] as usize] as usize);
            for i in 0..D {
                for j in 0..D {
                    dense[(row * D + i) * n * D + column * D + j] += rows.values[(at * D + i) * D + j];
                }
            }
        }
    }
    sum(session, &dense)
}

/// The components that supports fix, by original node ids.
fn held_components<const D: usize, const S: usize>(session: &Session, body: &Body<D, S>) -> Vec<bool> {
    let mut flags = vec![0.0; body.mesh.total_nodes * D];
    for at in 0..body.mesh.owned * D {
        flags[body.mesh.node_ids[at / D] as usize * D + at % D] = f64::from(u8::from(body.held.flags()[at]));
    }
    sum(session, &flags).iter().map(|&flag| flag > 0.0).collect()
}

fn effects<const D: usize, const S: usize>() -> Vec<Box<dyn Effect<D, S>>> {
    vec![
        Box::new(Inertia { density: ByMaterial::uniform(DENSITY) }),
        Box::new(ViscousStress::linear(ByMaterial::uniform(VISCOSITY))),
    ]
}

fn entries<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>, fixed: &[(&str, Fix)]) {
    let (body, _) = body::<D, S>(session, whole, fixed, effects());
    let (dense, reference) = (gathered(session, &body), reference(whole));
    let is_fixed = held_components(session, &body);
    assert_eq!(is_fixed.iter().any(|f| *f), !fixed.is_empty());
    let largest = reference.iter().flatten().fold(0.0, |m, x| larger(m, x.abs()));
    for (row, (found, expected)) in dense.chunks_exact(reference.len()).zip(&reference).enumerate() {
        for (column, (found, expected)) in found.iter().zip(expected).enumerate() {
            let decoupled = row != column && (is_fixed[row] || is_fixed[column]);
            let expected = if decoupled { 0.0 } else { *expected };
            let error = (found - expected).abs();
            assert!(error < 1e-13 * largest, "({row}, {column}): {found} is not {expected}");
        }
    }
}

/// Motions that do not strain a body.
fn rigid<const D: usize>(number: usize, x: &[f64; D]) -> [f64; D] {
    let mut out = [0.0; D];
    if number < D {
        out[number] = 1.0;
    } else {
        let (i, j) = [(0, 1), (1, 2), (0, 2)][number - D];
        (out[i], out[j]) = (-x[j], x[i]);
    }
    out
}

fn rigid_motions<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>) {
    let viscous: Vec<Box<dyn Effect<D, S>>> =
        vec![Box::new(ViscousStress::linear(ByMaterial::uniform(VISCOSITY)))];
    let (body, state) = body::<D, S>(session, whole, &[], viscous);
    let rows = body.matrix(session, STEP).expect("assembled");
    let matrix = Matrix::symmetric(D, &rows).expect("matrix");
    let (mut motion, mut force) =
        (state.velocity.like().expect("like"), state.velocity.like().expect("like"));
    for number in 0..if D == 2 { 3 } else { 6 } {
        set_nodal(&body.mesh, &mut motion, |_, x| rigid(number, x));
        matrix.multiply(&motion, &mut force).expect("product");
        let norm = force.norm().expect("norm");
        assert!(norm < 1e-12, "rigid motion {number} meets a force of {norm}");
    }
    set_nodal(&body.mesh, &mut motion, |_, x| [x[0]; D]);
    matrix.multiply(&motion, &mut force).expect("product");
    assert!(force.norm().expect("norm") > 0.1, "other motions are resisted");
}

fn total_mass<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>, volume: f64) {
    let inertia: Vec<Box<dyn Effect<D, S>>> =
        vec![Box::new(Inertia { density: ByMaterial::uniform(DENSITY) })];
    let (body, state) = body::<D, S>(session, whole, &[], inertia);
    let rows = body.matrix(session, STEP).expect("assembled");
    let matrix = Matrix::symmetric(D, &rows).expect("matrix");
    let (mut motion, mut momentum) =
        (state.velocity.like().expect("like"), state.velocity.like().expect("like"));
    for axis in 0..D {
        set_nodal(&body.mesh, &mut motion, |_, x| rigid(axis, x));
        matrix.multiply(&motion, &mut momentum).expect("product");
        let mass = STEP * motion.dot(&momentum).expect("dot");
        assert!((mass - DENSITY * volume).abs() < 1e-12 * mass, "{mass}");
    }
}

fn compare(session: &Session) {
    let plane = crossed([3, 2]);
    let askew = stir(rectangle([1.0, 2.0], [4, 3], Diagonal::Alternating, [1.0, 1.0]).expect("mesh"), 0.06);
    let space = brick([2, 3, 2]);
    let corner = [("left", Fix::Keyword(FixedDirections::All)), ("bottom", Fix::Axes(vec![Axis::Y]))];
    for mesh in [&plane, &askew] {
        entries::<2, 3>(session, mesh, &[]);
        entries::<2, 4>(session, mesh, &corner);
        rigid_motions::<2, 3>(session, mesh);
    }
    entries::<3, 6>(session, &space, &[]);
    let sides =
        [("left", Fix::Keyword(FixedDirections::Normal)), ("front", Fix::Keyword(FixedDirections::All))];
    entries::<3, 6>(session, &space, &sides);
    rigid_motions::<3, 6>(session, &space);
    total_mass::<2, 3>(session, &plane, 1.2 * 0.9);
    total_mass::<3, 6>(session, &space, 1.0 * 0.8 * 1.1);
}

#[test]
fn the_matrix_is_that_of_a_dense_computation_on_any_number_of_ranks() {
    run_on(&[1, 2, 3, 4], |world| compare(&world.session));
}
