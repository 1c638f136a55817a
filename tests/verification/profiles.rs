//! Stress and traction in `profiles.csv` on oblique boundaries with facets of unequal size.

use super::run_on;
use super::scenes::{body, brick, crossed, noise, set_nodal};
use clarke::{
    fem::effect::{Contact, ContactConditions, Effect, Inertia, Quadrature},
    io::output::profiles::Profiles,
    job::{Axis, Fix},
    laws::{
        contact::{Bound, Gap, NormalResponse, Unilateral},
        material::ByMaterial,
    },
    linear_algebra::tensor::{Mandel, cross, dot, larger, norm},
    mesh::GlobalMesh,
    parallel::session::Session,
};
use std::{f64::consts::SQRT_2, path::Path};

/// Rotates a position by the angle with cosine 0.8 and sine 0.6: about z in the plane, about y in space.
fn turned<const D: usize>(place: [f64; D]) -> [f64; D] {
    let mut out = place;
    (out[0], out[D - 1]) = (0.8 * place[0] - 0.6 * place[D - 1], 0.6 * place[0] + 0.8 * place[D - 1]);
    out
}

/// `n . sigma . n` by the components of the tensor, in the plane or in space.
fn along<const D: usize, const S: usize>(stress: &Mandel<S>, n: &[f64; D]) -> f64 {
    let shear = |c: usize, i: usize, j: usize| 2.0 * stress[c] / SQRT_2 * n[i] * n[j];
    let diagonal: f64 = (0..D).map(|i| stress[i] * n[i] * n[i]).sum();
    diagonal + if D == 2 { shear(S - 1, 0, 1) } else { shear(3, 1, 2) + shear(4, 0, 2) + shear(5, 0, 1) }
}

fn measure<const D: usize>(corners: &[[f64; D]; D]) -> f64 {
    let edge = |a: usize| -> [f64; 3] {
        std::array::from_fn(|i| if i < D { corners[a][i] - corners[0][i] } else { 0.0 })
    };
    if D == 2 { norm(&edge(1)) } else { 0.5 * norm(&cross(&edge(1), &edge(D - 1))) }
}

/// The rows of a profile: positions, the three numbers after them, and the normal component of the last numbers, the tangential
/// displacement.
fn rows<const D: usize>(folder: &Path) -> Vec<([f64; D], [f64; 3], f64)> {
    let mut down = [0.0; D];
    down[D - 1] = -1.0;
    let normal = turned(down);
    let text = std::fs::read_to_string(folder.join("profiles.csv")).expect("the file");
    let row = |line: &str| {
        let numbers: Vec<f64> = line.split(',').skip(2).map(|x| x.parse().expect("a number")).collect();
        let tangential: [f64; D] = std::array::from_fn(|i| numbers[numbers.len() - D + i]);
        let along: f64 = (0..D).map(|i| tangential[i] * normal[i]).sum();
        (std::array::from_fn(|i| numbers[i]), std::array::from_fn(|i| numbers[D + i]), along)
    };
    text.lines().skip(1).map(row).collect()
}

/// Compares a profile of the bottom with the `expected` values at the original nodes.
fn hold<const D: usize>(
    what: &str,
    folder: &Path,
    whole: &GlobalMesh<D>,
    expected: impl Fn(usize) -> [f64; 3],
) {
    let rows = rows::<D>(folder);
    let bottom = whole.boundaries.iter().find(|b| b.name == "bottom").expect("a boundary");
    let mut nodes: Vec<u32> = bottom.facets.iter().flat_map(|f| whole.facets[*f as usize]).collect();
    nodes.sort_unstable();
    nodes.dedup();
    assert_eq!(rows.len(), nodes.len(), "{what}");
    for (place, found, tangential) in rows {
        assert!(tangential.abs() < 1e-12, "{what} at {place:?}: not tangential by {tangential:e}");
        let node = nodes.iter().find(|n| whole.nodes[**n as usize] == place).expect("a node of the boundary");
        let expected = expected(*node as usize);
        let off = (0..3).map(|i| (found[i] - expected[i]).abs()).fold(0.0, larger);
        assert!(off < 1e-12, "{what} at {place:?}: {found:?} instead of {expected:?}");
    }
}

fn written<const D: usize, const S: usize>(session: &Session, folder: &Path, mut whole: GlobalMesh<D>) {
    whole.nodes.iter_mut().for_each(|place| *place = turned(*place));
    let mut down = [0.0; D];
    down[D - 1] = -1.0;
    let normal = turned(down);
    let effects: Vec<Box<dyn Effect<D, S>>> = vec![Box::new(Inertia { density: ByMaterial::uniform(1.0) })];
    let (mut body, mut state) = body::<D, S>(session, &whole, &[("left", Fix::Axes(vec![Axis::X]))], effects);
    let random = |salt: usize| {
        move |id: usize, _: &[f64; D]| std::array::from_fn(|i| noise(((salt * 1000 + id) * D + i) as u64))
    };
    set_nodal(&body.mesh, &mut state.displacement, random(1));
    set_nodal(&body.mesh, &mut state.velocity, random(2));
    let moved = |salt: usize, id: usize| dot(&random(salt)(id, &[0.0; D]), &normal);
    let write = |profiles: &mut Profiles<D>, body: &_, state: &_, stress: &[Mandel<S>]| {
        if session.is_first() {
            profiles.open(folder, None).expect("opened");
        }
        profiles.write::<S>(session, body, state, stress).expect("written");
        profiles.flush().expect("flushed");
    };
    // Without contact: a uniform stress, and one that differs between cells.
    let uniform: Mandel<S> = std::array::from_fn(|c| 3.0 + c as f64 * if c % 2 == 0 { 1.5 } else { -2.5 });
    let of_cell =
        |cell: usize| -> Mandel<S> { std::array::from_fn(|c| 5.0 * noise((9000 + cell * S + c) as u64)) };
    let mut profiles = Profiles::new(session, &body, &[("bottom".into(), vec![])]).expect("profiles");
    let cells = body.mesh.cell_ids.iter().map(|id| *id as usize);
    let (same, changing) = (vec![uniform; body.mesh.cell_ids.len()], cells.map(of_cell).collect::<Vec<_>>());
    write(&mut profiles, &body, &state, &same);
    if session.is_first() {
        let expected = |id: usize| [moved(1, id), moved(2, id), -along(&uniform, &normal)];
        hold("a uniform stress", folder, &whole, expected);
    }
    write(&mut profiles, &body, &state, &changing);
    if session.is_first() {
        let bottom = whole.boundaries.iter().find(|b| b.name == "bottom").expect("a boundary");
        let pressure = |id: usize| {
            let (mut sum, mut weights) = (0.0, Vec::new());
            for &facet in &bottom.facets {
                let nodes = whole.facets[facet as usize];
                if nodes.contains(&(id as u32)) {
                    let weight = measure(&nodes.map(|n| whole.nodes[n as usize]));
                    sum -= weight * along(&of_cell(whole.facet_cells[facet as usize] as usize), &normal);
                    weights.push(weight);
                }
            }
            sum / weights.iter().sum::<f64>()
        };
        hold("a stress that changes", folder, &whole, |id| [moved(1, id), moved(2, id), pressure(id)]);
    }
    // With contact: the component of the traction along the part of the normal that no support fixes.
    let facets = body.mesh.boundary("bottom").expect("a boundary").facets.clone();
    let law = NormalResponse::Unilateral(Unilateral { bound: Bound::Displacement, gap: None });
    let contact = Contact::new(
        session,
        &body.mesh,
        &facets,
        ContactConditions { quadrature: Quadrature::Nodal, law, gap: Gap::default(), paired: None },
        &body.held,
    );
    body.contacts.push(contact.expect("a contact"));
    let mut traction = state.velocity.like().expect("a vector");
    set_nodal(&body.mesh, &mut traction, random(3));
    state.contact_traction = Some(traction);
    let mut profiles = Profiles::new(session, &body, &[("bottom".into(), vec![0])]).expect("profiles");
    write(&mut profiles, &body, &state, &same);
    if session.is_first() {
        let left = whole.boundaries.iter().find(|b| b.name == "left").expect("a boundary");
        let is_held =
            |id: usize| left.facets.iter().any(|f| whole.facets[*f as usize].contains(&(id as u32)));
        let pressure = |id: usize| {
            let traction: [f64; D] = random(3)(id, &[0.0; D]);
            // The left side fixes x, so that only the part of the normal along the last axis, which points down, is free.
            if is_held(id) { -traction[D - 1] } else { dot(&traction, &normal) }
        };
        hold("tractions", folder, &whole, |id| [moved(1, id), moved(2, id), pressure(id)]);
    }
}

fn all(session: &Session, folder: &Path) {
    written::<2, 3>(session, folder, crossed([5, 3]));
    written::<2, 4>(session, folder, crossed([5, 3]));
    written::<3, 6>(session, folder, brick([4, 3, 2]));
}

#[test]
fn profiles_give_pressures_by_the_measure_of_facets_and_along_free_normals() {
    run_on(&[1, 2, 3], |world| all(&world.session, &world.folder));
}
