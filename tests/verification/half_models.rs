//! Nodes of contacts that supports hold or several boundaries share: halves and quarters of bodies with curved boundaries against the
//! whole bodies, and edges of any angle.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::{
    linear_algebra::tensor::{Vector, larger, norm},
    mesh::{Boundary, GlobalMesh},
    parallel::{exchange::gather, session::Session},
    run::Simulation,
};

/// The vertical, in the plane and in space.
const fn up(dimension: usize) -> usize {
    dimension - 1
}

/// A body whose bottom is a bowl that touches the plane at height 0 in the origin; its sides through the origin are planes.
fn bowl<const D: usize>(mut mesh: GlobalMesh<D>) -> GlobalMesh<D> {
    for place in &mut mesh.nodes {
        let square: f64 = place[..up(D)].iter().map(|x| x * x).sum();
        place[up(D)] += 0.25 * square * (1.0 - place[up(D)]);
    }
    mesh
}

/// The body with its mirror image at the plane through the origin across an axis. `plane` is the boundary on it.
fn mirrored<const D: usize>(half: &GlobalMesh<D>, axis: usize, plane: &str) -> GlobalMesh<D> {
    let mut whole = half.clone();
    let mut images = Vec::new();
    for place in &half.nodes {
        if place[axis] == 0.0 {
            images.push(images.len() as u32);
            continue;
        }
        images.push(whole.nodes.len() as u32);
        let mut image = *place;
        image[axis] = -image[axis];
        whole.nodes.push(image);
    }
    for cell in half.cells.chunks_exact(D + 1) {
        let first = whole.cells.len();
        whole.cells.extend(cell.iter().map(|node| images[*node as usize]));
        whole.cells.swap(first, first + 1);
    }
    whole.cell_regions.extend(&half.cell_regions);
    let inner = &half.boundaries.iter().find(|boundary| boundary.name == plane).expect("a boundary").facets;
    let outer: Vec<u32> = (0..half.facets.len() as u32).filter(|facet| !inner.contains(facet)).collect();
    whole.facets = outer.iter().map(|facet| half.facets[*facet as usize]).collect();
    whole.facet_cells = outer.iter().map(|facet| half.facet_cells[*facet as usize]).collect();
    for facet in &outer {
        let mut image = half.facets[*facet as usize].map(|node| images[node as usize]);
        image.swap(0, 1);
        whole.facets.push(image);
        whole.facet_cells.push(half.facet_cells[*facet as usize] + half.cell_regions.len() as u32);
    }
    let boundaries = half.boundaries.iter().filter(|boundary| boundary.name != plane);
    let both = |boundary: &Boundary| {
        let at = |facet: &u32| outer.binary_search(facet).expect("an outer facet") as u32;
        let own = boundary.facets.iter().map(at);
        let facets = own.clone().chain(own.map(|facet| facet + outer.len() as u32)).collect();
        Boundary { name: boundary.name.clone(), facets }
    };
    whole.boundaries = boundaries.map(both).collect();
    whole
}

/// Turns a vector about the y axis (in the plane: about the origin).
fn turned<const D: usize>(vector: Vector<D>) -> Vector<D> {
    let mut out = vector;
    out[0] = 0.8 * vector[0] - 0.6 * vector[up(D)];
    out[up(D)] = 0.6 * vector[0] + 0.8 * vector[up(D)];
    out
}

fn job<const D: usize>(
    order: usize,
    scheme: &str,
    contact: &str,
    planes: &[&str],
    is_slanted: bool,
) -> String {
    let hypothesis = if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" };
    let mut vertical = [0.0; D];
    vertical[up(D)] = 1.0;
    let normal = if is_slanted { turned(vertical) } else { vertical };
    let point = normal.map(|n| format!("{:?}", format!("{n}*0.03*t"))).join(", ");
    let held: String =
        planes.iter().map(|plane| format!("[[support]]\non = [\"{plane}\"]\nfix = \"normal\"\n")).collect();
    format!(
        "[mesh]\norder = {order}\n{}[time]\nscheme = \"{scheme}\"\nend = 0.5\nstep = 0.05\n[solver]\ntolerance = 1e-13\n\
         [material]\n{hypothesis}density = 0.5\nelasticity = {{ youngs_modulus = 200, poisson_ratio = 0.35 }}\n\
         viscosity = {{ volumetric = 2, shear = 3 }}\n{held}\
         [[traction]]\non = [\"top\"]\npressure = \"40*t\"\n\
         [[contact]]\non = [\"bottom\"]\n{contact}\nobstacle.plane = {{ point = [{point}], normal = {normal:?} }}\n",
        any_mesh::<D>()
    )
}

/// Place, displacement and contact traction of all nodes after the last step.
fn nodal<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    mesh: &GlobalMesh<D>,
) -> Vec<[Vector<D>; 3]> {
    let mut run: Simulation<D, S> = simulation(session, job, mesh);
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")).is_some() {}
    let displacement = run.state.displacement.owned().expect("values");
    let traction = run.state.contact_traction.as_ref().expect("contact").owned().expect("values");
    let nodes = run.body.mesh.nodes.iter().zip(displacement.chunks_exact(D)).zip(traction.chunks_exact(D));
    let mine: Vec<f64> = nodes.flat_map(|((x, u), q)| x.iter().chain(u).chain(q).copied()).collect();
    let all = gather(session.world(), &mine).expect("all");
    let row = |row: &[f64]| std::array::from_fn(|at| std::array::from_fn(|i| row[at * D + i]));
    all.chunks_exact(3 * D).map(row).collect()
}

fn compare<const D: usize, const S: usize>(session: &Session, half: &GlobalMesh<D>, planes: &[&str]) {
    let mut whole = half.clone();
    for (axis, plane) in planes.iter().enumerate() {
        whole = mirrored(&whole, axis, plane);
    }
    let laws = [
        "normal.unilateral = {}\nfriction.coulomb.coefficient = 0.2",
        "normal.compliance = { stiffness = 3000 }\nfriction.coulomb.coefficient = 0.2",
        "normal.compliance = { stiffness = 3000 }",
    ];
    for (order, scheme, law, is_slanted) in [
        (1, "implicit_euler", 0, false),
        (1, "bdf2", 1, true),
        (1, "implicit_euler", 2, false),
        (2, "bdf2", 0, true),
        (2, "implicit_euler", 1, false),
    ] {
        let turn = |mut mesh: GlobalMesh<D>| {
            mesh.nodes.iter_mut().filter(|_| is_slanted).for_each(|place| *place = turned(*place));
            mesh
        };
        let job = |planes: &[&str]| job::<D>(order, scheme, laws[law], planes, is_slanted);
        let part = nodal::<D, S>(session, &job(planes), &turn(half.clone()));
        // Without supports the body of the whole model keeps its place by symmetry.
        let all = nodal::<D, S>(session, &job(&[]), &turn(whole.clone()));
        let mut sizes = [0.0f64; 2];
        let mut worst = [0.0f64; 2];
        for [place, part @ ..] in &part {
            let same = |[other, ..]: &&[Vector<D>; 3]| {
                norm(&std::array::from_fn::<_, D, _>(|i| other[i] - place[i])) < 1e-9
            };
            let [_, all @ ..] = all.iter().find(same).expect("the node of the whole body");
            for k in 0..2 {
                sizes[k] = larger(sizes[k], norm(&all[k]));
                worst[k] =
                    larger(worst[k], norm(&std::array::from_fn::<_, D, _>(|i| part[k][i] - all[k][i])));
            }
        }
        let touches_at_the_axis =
            part.iter().any(|[place, _, q]| norm(place) < 0.3 && norm(q) > 0.01 * sizes[1]);
        assert!(touches_at_the_axis && sizes[1] > 1.0, "{sizes:?}");
        for k in 0..2 {
            assert!(
                worst[k] <= 1e-8 * sizes[k],
                "{D}D order {order} {scheme} law {law}: off by {worst:?} of {sizes:?} (displacement, traction)"
            );
        }
    }
}

/// A brick whose bottom and right face have outward normals at this angle in degrees, with nodes of the edge between them at unequal
/// distances.
fn wedge(degrees: f64) -> GlobalMesh<3> {
    let mut mesh = brick([2, 3, 2]);
    let slope = (degrees - 90.0).to_radians().tan();
    mesh.nodes.iter_mut().for_each(|place| place[0] -= slope * place[2] * place[0]);
    mesh
}

/// The brick is pressed obliquely into the edge between two walls.
fn pressed(session: &Session, degrees: f64, laws: [&str; 2], order: usize) -> Vec<[Vector<3>; 3]> {
    let tables: String = ["bottom", "right"]
        .iter()
        .zip(laws)
        .map(|(name, law)| format!("[[contact]]\non = [\"{name}\"]\n{law}\n"))
        .collect();
    let job = format!(
        "[mesh]\norder = {order}\n{}[time]\nscheme = \"bdf2\"\nend = 0.2\nstep = 0.05\n[solver]\ntolerance = 1e-12\n\
         [material]\ndensity = 0.1\nelasticity = {{ youngs_modulus = 200, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = 2, shear = 3 }}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\ndisplacement = [\"0.3*t\", \"0.4*t\", \"-0.2*t\"]\n{tables}",
        any_mesh::<3>()
    );
    nodal::<3, 6>(session, &job, &wedge(degrees))
}

/// Rigid walls and friction at an edge of any angle.
fn edges(session: &Session) {
    let rigid = "normal.unilateral = {}";
    let stiff = "normal.compliance = { stiffness = 1e8 }";
    let springs = "normal.compliance = { stiffness = 500 }";
    // Friction that is too weak to matter selects the same unknowns as rigid walls do; without it the velocity is the unknown.
    let weak = |law: &str| format!("{law}\nfriction.tresca.bound = 1e-11");
    let pairs = [(springs.to_owned(), weak(springs), 1e-8), (weak(stiff), rigid.to_owned(), 1e-3)];
    let angles = [41.0, 45.0, 89.99, 90.0, 110.0];
    for (degrees, (first, second, allowed)) in
        angles.iter().flat_map(|d| pairs.iter().map(move |pair| (*d, pair)))
    {
        let [expected, found] = [first, second].map(|law| pressed(session, degrees, [law; 2], 1));
        let mut worst = [0.0f64; 2];
        let mut sizes = [0.0f64; 2];
        for (expected, found) in expected.iter().zip(&found) {
            for k in 0..2 {
                let off: Vector<3> = std::array::from_fn(|i| found[k + 1][i] - expected[k + 1][i]);
                (worst[k], sizes[k]) =
                    (larger(worst[k], norm(&off)), larger(sizes[k], norm(&expected[k + 1])));
            }
        }
        assert!(sizes[1] > 1.0, "{sizes:?}");
        for k in 0..2 {
            assert!(worst[k] <= allowed * sizes[k], "{degrees} {second}: {worst:?} of {sizes:?}");
        }
    }
    let rough = "normal.unilateral = {}\nfriction.coulomb.coefficient = 0.3";
    let soft = "normal.compliance = { stiffness = 2000 }\nfriction.coulomb.coefficient = 0.3";
    for (degrees, laws, order) in [
        (45.0, [rough; 2], 1),
        (60.0, [rough, soft], 2),
        (89.99, [soft, rough], 1),
        (110.0, [rough, rigid], 1),
    ] {
        let nodes = pressed(session, degrees, laws, order);
        let edge = |place: &Vector<3>| place[2].abs() < 1e-9 && (place[0] - 1.0).abs() < 1e-9;
        let mut rubbing = 0;
        for [place, _, traction] in nodes.iter().filter(|[place, ..]| edge(place)) {
            let angle = degrees.to_radians();
            // T = p (0, 0, -1) + q (sin, 0, -cos) + friction along y.
            let other = traction[0] / angle.sin();
            let own = -traction[2] - other * angle.cos();
            let bound = 0.3 * f64::max(own, other) + 1e-9;
            assert!(own >= -1e-9 && other >= -1e-9, "{degrees} at {place:?}: {own} {other}");
            assert!(traction[1].abs() <= bound, "{degrees} at {place:?}: {traction:?}");
            rubbing += usize::from(traction[1] > 1e-3);
        }
        assert!(rubbing > 0, "{degrees}: friction acts along the edge");
    }
}

#[test]
fn friction_and_rigid_walls_act_at_edges_of_any_angle() {
    run_on(&[1, 2], |world| edges(&world.session));
}

/// An obstacle that slides past a body with a curved boundary, also along directions in which supports hold nodes of this boundary: friction
/// is that of Coulomb's law at every node, and points where the obstacle goes.
fn slid_past<const D: usize, const S: usize>(session: &Session, half: &GlobalMesh<D>, planes: &[&str]) {
    for law in ["normal.unilateral = {}", "normal.compliance = { stiffness = 3000 }"] {
        let contact = format!("{law}\nfriction.coulomb.coefficient = 0.2");
        let moves = if D == 2 { "\"-2*t\", \"0.03*t\"" } else { "\"-2*t\", \"-t\", \"0.03*t\"" };
        let job = job::<D>(1, "implicit_euler", &contact, planes, false);
        let (before, after) = job.split_once("point = [").expect("an obstacle");
        let slides = format!("{before}point = [{moves}{}", &after[after.find(']').expect("its end")..]);
        let mut run: Simulation<D, S> = simulation(session, &slides, half);
        while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{slides}")).is_some() {
            assert!(run.totals.energy_imbalance <= 1e-10, "{:e}\n{slides}", run.totals.energy_imbalance);
        }
        let velocity = run.state.velocity.local().expect("velocity");
        let mut forces: std::collections::BTreeMap<u32, Vec<Vector<D>>> = std::collections::BTreeMap::new();
        run.body.contacts[0].forces(&velocity, |node, force| forces.entry(node).or_default().push(force));
        let mut pressed = 0.0;
        for (node, forces) in forces {
            let [normal, friction] = forces[..] else { panic!("friction at {node}: {forces:?}\n{slides}") };
            let size = norm(&normal);
            assert!((norm(&friction) - 0.2 * size).abs() <= 1e-7 * size, "{normal:?} {friction:?}\n{slides}");
            assert!(size == 0.0 || friction[0] < 0.0, "{normal:?} {friction:?}\n{slides}");
            pressed += f64::from(u8::from(size > 0.0));
        }
        let [pressed] = session.sum([pressed]);
        assert!(pressed > 1.0, "{pressed} nodes touch\n{slides}");
    }
}

fn all(session: &Session) {
    slid_past::<2, 4>(session, &bowl(crossed([3, 2])), &["left"]);
    slid_past::<3, 6>(session, &bowl(brick([2, 2, 2])), &["left", "front"]);
    compare::<2, 4>(session, &bowl(crossed([3, 2])), &["left"]);
    compare::<3, 6>(session, &bowl(brick([2, 2, 2])), &["left", "front"]);
}

#[test]
fn half_and_quarter_models_with_friction_on_a_curved_boundary_are_the_whole_body() {
    run_on(&[1, 2, 3], |world| all(&world.session));
}

/// Tractions of a block that stands on its rough bottom next to a plane of symmetry, turned by this angle in degrees, in the directions of
/// the block.
fn standing(session: &Session, degrees: f64) -> Vec<Vector<2>> {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let turn = |[x, y]: Vector<2>, sine: f64| [cosine * x - sine * y, sine * x + cosine * y];
    let mut mesh = crossed([2, 2]);
    mesh.nodes.iter_mut().for_each(|place| *place = turn(*place, sine));
    let job = format!(
        "{}[time]\nscheme = \"implicit_euler\"\nend = 1.0\nstep = 0.5\n\
         [material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\n\
         [[support]]\non = [\"left\"]\nfix = \"normal\"\n[[traction]]\non = [\"top\"]\npressure = 1e4\n\
         [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\nfriction.coulomb.coefficient = 0.2\n",
        any_mesh::<2>()
    );
    nodal::<2, 4>(session, &job, &mesh).into_iter().map(|[_, _, traction]| turn(traction, -sine)).collect()
}

#[test]
fn planes_of_symmetry_at_any_angle_carry_no_friction() {
    run_on(&[1], |world| {
        let expected = standing(&world.session, 0.0);
        for degrees in [10.0, 120.0] {
            for (expected, found) in expected.iter().zip(standing(&world.session, degrees)) {
                let off: Vector<2> = std::array::from_fn(|i| found[i] - expected[i]);
                assert!(norm(&off) <= 1e-3, "{degrees} degrees: {found:?} for {expected:?} Pa");
            }
        }
    });
}

/// A body and beside it its mirror image at the plane at height 0: two bodies with boundaries "body.top", "image.top" and so on.
fn with_image<const D: usize>(half: &GlobalMesh<D>) -> GlobalMesh<D> {
    let mut both = half.clone();
    let nodes = half.nodes.len() as u32;
    both.nodes.extend(half.nodes.iter().map(|place| {
        let mut image = *place;
        image[up(D)] = -image[up(D)];
        image
    }));
    for cell in half.cells.chunks_exact(D + 1) {
        let first = both.cells.len();
        both.cells.extend(cell.iter().map(|node| node + nodes));
        both.cells.swap(first, first + 1);
    }
    both.cell_regions.extend(&half.cell_regions);
    for (facet, cell) in half.facets.iter().zip(&half.facet_cells) {
        let mut image = facet.map(|node| node + nodes);
        image.swap(0, 1);
        both.facets.push(image);
        both.facet_cells.push(cell + half.cell_regions.len() as u32);
    }
    let named = |body: &'static str, first: u32| {
        half.boundaries.iter().map(move |boundary| Boundary {
            name: format!("{body}.{}", boundary.name),
            facets: boundary.facets.iter().map(|facet| facet + first).collect(),
        })
    };
    both.boundaries = named("body", 0).chain(named("image", half.facets.len() as u32)).collect();
    both
}

/// A fault that weakens with slip breaks where its shear traction is above the strength. By antisymmetry its two sides move as one of them
/// does under half of the slip and the same pressure.
fn ruptures<const D: usize, const S: usize>(session: &Session, half: &GlobalMesh<D>) {
    let hypothesis = if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" };
    // Names that the mesh of a job must have; the mesh is handed over.
    let [shape, size, corner] =
        if D == 2 { ["rectangle", "1, 1", "2, 0"] } else { ["box", "1, 1, 1", "2, 0, 0"] };
    let block =
        |name: &str| format!("[[mesh.{shape}]]\nname = \"{name}\"\nsize = [{size}]\ncells = [{size}]\n");
    let blocks = block("body") + &block("image") + &format!("corner = [{corner}]\n");
    let side = |before: &str, sign: f64| {
        let value: Vec<String> = (0..D)
            .map(|axis| match axis {
                0 => format!("\"{sign}*(5 + 2*(x < 0.35))\""),
                1 if D == 3 => format!("\"{sign}*y\""),
                _ => format!("{}", -10.0 * sign),
            })
            .collect();
        let names = half.boundaries.iter().filter(|boundary| boundary.name != "bottom");
        let names: Vec<String> = names.map(|boundary| format!("{before}{}", boundary.name)).collect();
        format!(
            "[[support]]\non = {names:?}\nabsorbing = true\n[[traction]]\non = [\"{before}bottom\"]\nvalue = [{}]\n",
            value.join(", ")
        )
    };
    for order in [1, 2] {
        let job = |mesh: &str, contact: &str, distance: f64| {
            format!(
                "[mesh]\norder = {order}\n{mesh}[time]\nscheme = \"bdf2\"\nend = 0.12\nstep = 0.01\n[solver]\ntolerance = 1e-13\n\
                 [material]\n{hypothesis}density = 1.0\nelasticity = {{ youngs_modulus = 20, poisson_ratio = 0.25 }}\n\
                 [[contact]]\n{contact}\n\
                 friction.distance_weakening = {{ static = 0.6, dynamic = 0.4, distance = {distance} }}\n"
            )
        };
        let pressure = "on = [\"bottom\"]\nnormal.graph.points = [[-1.0, 10.0], [1.0, 10.0]]";
        let one = job(any_mesh::<D>(), pressure, 0.05) + &side("", 1.0);
        let pair = "on = [\"body.bottom\"]\nagainst = [\"image.bottom\"]\nnormal.unilateral = {}";
        let two = job(&blocks, pair, 0.1) + &side("body.", 1.0) + &side("image.", -1.0);
        let one = nodal::<D, S>(session, &one, half);
        let two = nodal::<D, S>(session, &two, &with_image(half));
        let (mut worst, mut sizes) = ([0.0f64; 2], [0.0f64; 2]);
        let mut slips = Vec::new();
        for [place, one @ ..] in &one {
            let off = |other: &Vector<D>, own: &Vector<D>| {
                norm(&std::array::from_fn::<_, D, _>(|i| other[i] - own[i]))
            };
            // On the fault, nodes of both bodies are at this place, with opposite displacements and tractions.
            let far = |[_, other @ ..]: &[Vector<D>; 3]| off(&other[0], &one[0]) + off(&other[1], &one[1]);
            let places = two.iter().filter(|[other, ..]| off(other, place) < 1e-9);
            let nearest = places.min_by(|a, b| far(a).total_cmp(&far(b)));
            let [_, two @ ..] = nearest.expect("the node of both bodies");
            for k in 0..2 {
                sizes[k] = larger(sizes[k], norm(&one[k]));
                worst[k] = larger(worst[k], off(&one[k], &two[k]));
            }
            if place[up(D)] == 0.0 {
                slips.push(2.0 * one[0][0]);
            }
        }
        let broken = slips.iter().filter(|slip| **slip > 0.01).count();
        let whole = slips.iter().filter(|slip| slip.abs() < 1e-9).count();
        assert!(broken > 0 && whole > 0, "the fault breaks in part: {slips:?}");
        for k in 0..2 {
            assert!(
                worst[k] <= 1e-10 * sizes[k],
                "{D}D order {order}: off by {worst:?} of {sizes:?} (displacement, traction)"
            );
        }
    }
}

#[test]
fn a_fault_between_a_body_and_its_mirror_image_breaks_as_under_one_of_them() {
    run_on(&[1, 2], |world| {
        ruptures::<2, 4>(&world.session, &crossed([8, 4]));
        ruptures::<3, 6>(&world.session, &brick([4, 2, 2]));
    });
}
