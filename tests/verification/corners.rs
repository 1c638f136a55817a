//! Bodies that fall on an edge or a corner touch a rigid obstacle when they reach it.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    linear_algebra::tensor::{Vector, add_scaled, cross, dot, norm},
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
};

/// A place turned by an angle in degrees about an axis.
pub fn turned<const D: usize>(place: &Vector<D>, axis: &Vector<3>, degrees: f64) -> Vector<D> {
    let x: Vector<3> = std::array::from_fn(|i| place.get(i).copied().unwrap_or(0.0));
    let axis = axis.map(|a| a / norm(axis));
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let along = add_scaled(&x.map(|x| cosine * x), (1.0 - cosine) * dot(&axis, &x), &axis);
    let out = add_scaled(&along, sine, &cross(&axis, &x));
    std::array::from_fn(|i| out[i])
}

/// A body falls at 1 m/s on an obstacle 10 mm below the place (0, 0), its lowest one; steps of a tenth of the way. Compares the lowest
/// place of its nodes with the obstacle, and the time of the first force with that of the way.
fn falls<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    (on, obstacle): (&str, &str),
) {
    let velocity = if D == 2 { "[0, -1]" } else { "[0, 0, -1]" };
    let plane_strain = if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" };
    let job = format!(
        "{}[material]\n{plane_strain}density = 1000\nelasticity = {{ youngs_modulus = 1e7, poisson_ratio = 0.3 }}\n\
         [initial]\nvelocity = {velocity}\n[[contact]]\non = {on}\nnormal.unilateral = {{}}\nobstacle.{obstacle}\n\
         [time]\nend = 0.013\nstep = 0.001\nscheme = \"implicit_euler\"\n",
        any_mesh::<D>()
    );
    let mut run = simulation::<D, S>(session, &job, mesh);
    let mut first = f64::INFINITY;
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")).is_some() {
        let moved = run.state.displacement.owned().expect("displacements");
        let lowest = moved.chunks_exact(D).zip(&run.body.mesh.nodes).map(|(u, x)| x[D - 1] + u[D - 1]);
        let [deepest] = session.largest([lowest.fold(f64::NEG_INFINITY, |most, z| most.max(-z))]);
        assert!(deepest <= 0.01 + 1e-9, "it is {:e} m inside of the obstacle\n{job}", deepest - 0.01);
        let tractions = run.state.contact_traction.as_ref().expect("tractions").owned().expect("values");
        let pushed = tractions.iter().any(|t| *t != 0.0);
        if session.largest([f64::from(u8::from(pushed))])[0] > 0.0 {
            first = first.min(run.state.time);
        }
    }
    // The step that reaches it, or the next one by rounding.
    assert!((0.0099..0.0111).contains(&first), "it touches at {first} s\n{job}");
}

fn squares(session: &Session) {
    let plane = "plane = { point = [0, -0.01], normal = [0, 1] }";
    let both = "[\"bottom\", \"left\"]";
    let disc = "sphere = { centre = [0, -0.51], radius = 0.5 }";
    let shell = "sphere = { centre = [0, 1.99], radius = 2, hollow = true }";
    let box_ = "shape = { distance = \"max(abs(x) - 0.3, abs(y + 0.11) - 0.1)\" }";
    for (degrees, on, obstacle) in [
        (45.0, both, plane),
        (20.0, both, plane),
        (10.0, "[\"left\"]", plane),
        (5.0, "[\"bottom\"]", plane),
        (45.0, "[\"bottom\"]", disc),
        (45.0, both, shell),
        (30.0, both, box_),
    ] {
        let mut mesh = rectangle([0.1, 0.1], [2, 2], Diagonal::Right, [1.0; 2]).expect("mesh");
        mesh.nodes.iter_mut().for_each(|place| *place = turned(place, &[0.0, 0.0, 1.0], degrees));
        falls::<2, 4>(session, &mesh, (on, obstacle));
    }
}

fn cubes(session: &Session) {
    let plane = "plane = { point = [0, 0, -0.01], normal = [0, 0, 1] }";
    let all = "[\"bottom\", \"left\", \"front\"]";
    for (axis, degrees, on) in [
        ([1.0, -1.0, 0.0], 54.7356, all),
        ([1.0, -1.0, 0.0], 20.0, "[\"bottom\"]"),
        ([1.0, 0.0, 0.0], 45.0, all),
    ] {
        let mut mesh = box_mesh([0.1; 3], [2; 3], [1.0; 3]).expect("mesh");
        mesh.nodes.iter_mut().for_each(|place| *place = turned(place, &axis, degrees));
        falls::<3, 6>(session, &mesh, (on, plane));
    }
}

#[test]
fn a_square_that_falls_on_its_corner_stops_at_the_obstacle() {
    run_on(&[1, 2], |world| squares(&world.session));
}

#[test]
fn a_cube_that_falls_on_its_corner_or_edge_stops_at_the_obstacle() {
    run_on(&[1, 2], |world| cubes(&world.session));
}
