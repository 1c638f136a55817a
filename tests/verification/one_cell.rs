//! One cell with one contact facet: nodal forces computed by hand, for quadrature at nodes and at Gauss points.

use super::run_on;
use super::scenes::{any_mesh, part};
use clarke::{
    fem::{
        effect::{Contact, ContactConditions, Quadrature, choose_unknowns},
        space::Held,
    },
    job::Job,
    laws::contact::{Gap, NormalResponse, Polyline},
    linear_algebra::tensor::{Vector, larger},
    mesh::{Boundary, GlobalMesh},
    parallel::session::Session,
    run::Simulation,
};
use std::path::Path;

/// The cell with these corners, whose first facet is `bottom`, and `top` the others.
fn cell<const D: usize>(nodes: Vec<Vector<D>>, cell: Vec<u32>, facets: Vec<[u32; D]>) -> GlobalMesh<D> {
    let boundary = |name: &str, facets: Vec<u32>| Boundary { name: name.into(), facets };
    let others = (1..facets.len() as u32).collect();
    GlobalMesh {
        nodes,
        cells: cell,
        cell_regions: vec![0],
        regions: vec!["body".into()],
        facet_cells: vec![0; facets.len()],
        facets,
        boundaries: vec![boundary("bottom", vec![0]), boundary("top", others)],
        ..GlobalMesh::default()
    }
}

/// A triangle on a facet of 5 m with the normal (0.6, -0.8).
fn triangle() -> GlobalMesh<2> {
    let nodes = vec![[0.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
    cell(nodes, vec![0, 1, 2], vec![[0, 1], [1, 2], [2, 0]])
}

/// A tetrahedron on a facet of 4.5 m^2 with the normal (2, 1, -2) / 3.
fn tetrahedron() -> GlobalMesh<3> {
    let nodes = vec![[0.0; 3], [1.0, 2.0, 2.0], [2.0, -2.0, 1.0], [-2.0, -1.0, 2.0]];
    cell(nodes, vec![0, 2, 1, 3], vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
}

/// Contact forces at the nodes, given the velocity along the normal of each; a velocity along the facet changes nothing.
fn forces<const D: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    quadrature: Quadrature,
    law: &Polyline,
    [normal, tangent]: [Vector<D>; 2],
    along: &[f64],
) -> Vec<f64> {
    let mesh = part(session, mesh);
    let facets = mesh.boundary("bottom").expect("a boundary").facets.clone();
    let (law, gap, fixed) =
        (NormalResponse::Graph(law.clone()), Gap::default(), Held::from(vec![false; (D + 1) * D]));
    let contact = Contact::new(
        session,
        &mesh,
        &facets,
        ContactConditions { quadrature, law, gap, paired: None },
        &fixed,
    )
    .expect("contact");
    let mut contacts = [contact];
    choose_unknowns(&mut contacts, &mesh).expect("one normal");
    let [contact] = &mut contacts;
    let at = |node: usize, i: usize| {
        along.get(mesh.node_ids[node] as usize).unwrap_or(&9.0) * normal[i] + 7.0 * tangent[i]
    };
    let velocity: Vec<f64> =
        (0..=D).flat_map(|node| (0..D).map(move |i| (node, i))).map(|(n, i)| at(n, i)).collect();
    let mut unknown = velocity.clone();
    contact.unmap(&mut unknown);
    contact.map(&mut unknown);
    let off = unknown.iter().zip(&velocity).map(|(a, b)| (a - b).abs()).fold(0.0, larger);
    assert!(off < 1e-14, "velocities come back from the unknowns, {off:e} off");
    let mut local = vec![0.0; velocity.len()];
    contact.add_forces(&velocity, &mut local);
    let mut found = vec![0.0; velocity.len()];
    for node in 0..=D {
        found[mesh.node_ids[node] as usize * D..][..D].copy_from_slice(&local[node * D..][..D]);
    }
    found
}

/// The forces are these along the normal, and no others.
#[track_caller]
fn assert_along<const D: usize>(found: &[f64], normal: Vector<D>, expected: &[f64]) {
    for (node, force) in found.chunks_exact(D).enumerate() {
        for i in 0..D {
            let wanted = expected.get(node).unwrap_or(&0.0) * normal[i];
            assert!(
                (force[i] - wanted).abs() < 1e-13,
                "node {node}: {found:?} instead of {expected:?} along {normal:?}"
            );
        }
    }
}

fn by_hand(session: &Session) {
    // A law with 1 Pa at rest and 3 Pa s/m, and one with 2 Pa s/m in approach only.
    let damper = Polyline::new(vec![[0.0, 1.0]], 3.0, 3.0).expect("graph");
    let one_sided = Polyline::new(vec![[0.0, 0.0]], 0.0, 2.0).expect("graph");
    let (nodal, gauss) = (Quadrature::Nodal, Quadrature::Gauss);

    let directions = [[0.6, -0.8], [0.8, 0.6]];
    let plane = |quadrature, law, along: [f64; 2], expected: [f64; 2]| {
        let found = forces(session, &triangle(), quadrature, law, directions, &along);
        assert_along(&found, directions[0], &expected);
    };
    // Each node has half of the 5 m: 2.5 (1 + 3 v).
    plane(nodal, &damper, [0.5, 2.0], [6.25, 17.5]);
    // The integral of (1 + 3 v) N_a: 2.5 + 3 (5 / 6) (2 v_a + v_b).
    plane(gauss, &damper, [0.5, 2.0], [10.0, 13.75]);
    // At the nodes 2 Pa and nothing; at the Gauss points v = +-1 / sqrt 3, of which one approaches.
    plane(nodal, &one_sided, [1.0, -1.0], [5.0, 0.0]);
    let (root, weight) = (3.0f64.sqrt(), 2.5 * 2.0 / 3.0f64.sqrt());
    plane(
        gauss,
        &one_sided,
        [1.0, -1.0],
        [weight * 0.5 * (1.0 + 1.0 / root), weight * 0.5 * (1.0 - 1.0 / root)],
    );

    let third = 1.0 / 3.0;
    let directions = [[2.0 * third, third, -2.0 * third], [third, 2.0 * third, 2.0 * third]];
    let space = |quadrature, law, along: [f64; 3], expected: [f64; 3]| {
        let found = forces(session, &tetrahedron(), quadrature, law, directions, &along);
        assert_along(&found, directions[0], &expected);
    };
    // Each node has a third of the 4.5 m^2: 1.5 (1 + 3 v).
    space(nodal, &damper, [0.0, 1.0, -2.0], [1.5, 6.0, -7.5]);
    // 1.5 + 3 (4.5 / 12) (2 v_a + v_b + v_c).
    space(gauss, &damper, [0.0, 1.0, -2.0], [0.375, 1.5, -1.875]);
    space(nodal, &one_sided, [1.0, -1.0, -1.0], [3.0, 0.0, 0.0]);
    // At the Gauss points v = (4 v_a + v_b + v_c) / 6: 1/3, -2/3, -2/3. The first has 2/3 Pa on 1.5 m^2.
    space(gauss, &one_sided, [1.0, -1.0, -1.0], [4.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0]);
}

/// The facet's normal is along no axis, which PETSc's solver for bounds on velocity components can't do.
fn refusal(session: &Session) {
    let job = |contact: &str, method: &str| {
        format!(
            "{}[material]\nhypothesis = \"plane_strain\"\ndensity = 1\nviscosity = {{ volumetric = 1, shear = 1 }}\n\
             [[contact]]\non = [\"{contact}\"]\nnormal.unilateral = {{ gap = 1 }}\n[time]\nend = 1\nstep = 1\n\
             [solver]\nmethod = \"{method}\"\n",
            any_mesh::<2>()
        )
    };
    let set_up = |text: &str| {
        let mut loaded = Job::from_text(text, "job.toml", Path::new("."), &[]).expect("a job");
        Simulation::<2, 4>::new(session, &mut loaded, session.is_first().then(triangle)).map(|_| ())
    };
    let refused = set_up(&job("bottom", "vinewtonrsls")).expect_err("an oblique normal");
    assert_eq!(
        refused.to_string(),
        "[solver] method = \"vinewtonrsls\" limits components of the velocity, but the normal at [0.0, 0.0] m is not parallel to \
         an axis; use method = \"newton\""
    );
    set_up(&job("bottom", "newton")).expect("Newton's method takes any normal");
}

/// Where the graph is vertical, the velocity is exact for any pressure.
fn pushed_hard(session: &Session) {
    let nodes = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let mesh = part(session, &cell(nodes, vec![0, 1, 2], vec![[0, 1], [1, 2], [2, 0]]));
    let facets = mesh.boundary("bottom").expect("a boundary").facets.clone();
    let law =
        NormalResponse::Graph(Polyline::new(vec![[3e-10, -1e9], [3e-10, 1e9]], 1.0, 1.0).expect("graph"));
    let contact = Contact::new(
        session,
        &mesh,
        &facets,
        ContactConditions { quadrature: Quadrature::Nodal, law, gap: Gap::default(), paired: None },
        &Held::from(vec![false; 6]),
    );
    let mut contacts = [contact.expect("contact")];
    choose_unknowns(&mut contacts, &mesh).expect("one normal");
    let mut values = vec![-7e8; 6];
    contacts[0].map(&mut values);
    let touching =
        facets.iter().flat_map(|&f| mesh.facets[f as usize]).map(|node| values[node as usize * 2 + 1]);
    assert_eq!(touching.collect::<Vec<_>>(), [-3e-10, -3e-10]);
}

fn all(session: &Session) {
    by_hand(session);
    pushed_hard(session);
    refusal(session);
}

#[test]
fn contact_forces_on_one_cell_are_those_worked_out_by_hand() {
    run_on(&[1], |world| all(&world.session));
}
