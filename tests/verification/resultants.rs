//! Resultants of scenes whose forces, pressures and areas are known.

use super::{
    World,
    corners::turned,
    run_on,
    scenes::{any_mesh, brick, crossed, simulation, supports},
};
use clarke::{
    fem::{
        effect::ContactAreas,
        resultants::{Resultants, Source},
    },
    job::Job,
    linear_algebra::tensor::larger,
    mesh::GlobalMesh,
    parallel::session::Session,
    run::Simulation,
};
use std::path::Path;

/// A block on a rigid plane with friction, pressed down by 3 Pa and pulled along x by `pull` in Pa.
fn job<const D: usize>(scheme: &str, pull: f64) -> String {
    let (hypothesis, pull) = if D == 2 {
        ("hypothesis = \"plane_strain\"\n", format!("{pull}, -3"))
    } else {
        ("", format!("{pull}, 0, -3"))
    };
    let x = if D == 2 { "[\"x\"]" } else { "[\"x\", \"y\"]" };
    format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = 0.05\nstep = 0.01\n[solver]\ntolerance = 1e-13\n\
         [material]\n{hypothesis}elasticity = {{ youngs_modulus = 100, poisson_ratio = 0 }}\n\
         viscosity = {{ volumetric = 0, shear = 4 }}\n\
         [[support]]\non = [\"left\"]\nfix = {x}\n\
         [[traction]]\non = [\"top\"]\nvalue = [{pull}]\n\
         [[contact]]\non = [\"bottom\"]\nnormal = {{ unilateral = {{}} }}\nfriction = {{ coulomb = {{ coefficient = 0.5 }} }}\n",
        any_mesh::<D>()
    )
}

/// A source, its force along x and along the last axis, and its moment.
type Row = (Source, [f64; 2], [f64; 3]);

/// The last resultants: force of each source along x and along the last axis, and the areas of the contact.
fn last<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    text: &str,
) -> (Vec<Row>, ContactAreas) {
    let mut run = simulation::<D, S>(session, text, mesh);
    let mut resultants =
        Resultants::new(session, &run.body, &run.state, &supports(text)).expect("resultants");
    while run.advance(session).expect("a step").is_some() {
        let motion = run.scheme.balanced_motion(&run.state);
        resultants
            .update(session, &run.body, &run.state, motion, run.scheme.load.as_ref())
            .expect("resultants");
    }
    let areas = resultants.rows().find_map(|(_, areas)| areas).expect("a contact");
    let rows = resultants.sources.iter().zip(resultants.rows());
    let rows = rows.map(|(source, (found, _))| (*source, [found.force[0], found.force[D - 1]], found.moment));
    (rows.collect(), areas)
}

fn close(found: f64, expected: f64, what: &str) {
    assert!((found - expected).abs() < 1e-8, "{what}: {found}, not {expected}");
}

fn block<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, scheme: &str) {
    let (rows, areas) = last::<D, S>(session, mesh, &job::<D>(scheme, 0.0));
    // The bottom is 1.2 m long, or 1 m by 0.8 m; its middle is at x = 0.6 m or 0.5 m.
    let (area, middle) = if D == 2 { (1.2, 0.6) } else { (0.8, 0.5) };
    let expected = [
        (Source::Support(0), [0.0, 0.0]),
        (Source::Contact(0), [0.0, 3.0 * area]),
        (Source::Traction(0), [0.0, -3.0 * area]),
    ];
    assert_eq!(rows.len(), expected.len(), "no momentum without inertia");
    for ((source, force, moment), (of, known)) in rows.into_iter().zip(expected) {
        assert_eq!(source, of);
        (0..2).for_each(|i| close(force[i], known[i], &format!("{scheme}, {source:?}")));
        // In the plane about z, in space about y.
        let about = if D == 2 { middle * known[1] } else { -middle * known[1] };
        close(moment[if D == 2 { 2 } else { 1 }], about, &format!("moment, {scheme}, {source:?}"));
    }
    close(areas.touching, area, "touching area");
    close(areas.open, 0.0, "open area");
    close(areas.pressure, 3.0 * area, "integral of the pressure");
    close(areas.largest_pressure, 3.0, "largest pressure");
    // Nodes that the support holds along the boundary stick, as all under pressure that do not slip.
    close(areas.sticking + areas.slipping, area, "sticking and slipping areas");
}

fn all(session: &Session) {
    for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
        block::<2, 4>(session, &crossed([4, 3]), scheme);
        block::<3, 6>(session, &brick([3, 2, 2]), scheme);
    }
    // Pulled away from the support, the block is held by friction and by the support together.
    let (rows, areas) = last::<2, 4>(session, &crossed([4, 3]), &job::<2>("implicit_euler", 2.0));
    let along = |of: Source| rows.iter().find(|row| row.0 == of).expect("a source").1[0];
    close(along(Source::Traction(0)), 2.4, "pull");
    close(along(Source::Support(0)) + along(Source::Contact(0)), -2.4, "what holds");
    assert!(along(Source::Support(0)) < 0.0 && along(Source::Contact(0)) < 0.0, "{areas:?}");
}

/// The area, the force and the moment of a traction of -3 Pa on the facets of the top with such centres, by hand.
fn by_hand<const D: usize>(mesh: &GlobalMesh<D>, is_loaded: impl Fn(&[f64; D]) -> bool) -> [f64; 3] {
    let top = mesh.boundaries.iter().find(|boundary| boundary.name == "top").expect("a boundary");
    let mut sums = [0.0; 3];
    for &facet in &top.facets {
        let corners = mesh.facets[facet as usize].map(|node| mesh.nodes[node as usize]);
        let centre: [f64; D] =
            std::array::from_fn(|i| corners.iter().map(|corner| corner[i]).sum::<f64>() / D as f64);
        if is_loaded(&centre) {
            let [a, b] =
                [1, D - 1].map(|at| std::array::from_fn::<f64, D, _>(|i| corners[at][i] - corners[0][i]));
            // The top is a plane across the last axis.
            let area = if D == 2 { a[0].abs() } else { (a[0] * b[1] - a[1] * b[0]).abs() / 2.0 };
            sums = [sums[0] + area, sums[1] - 3.0 * area, sums[2] - 3.0 * area * centre[0]];
        }
    }
    sums
}

/// Loads on parts of a boundary are those of the facets whose centres belong to them, and together the load on all of it.
fn parts<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, order: usize) {
    let (value, y) = if D == 2 { ("0, -3", "y") } else { ("0, 0, -3", "z") };
    let part = |condition: &str| {
        format!("[[traction]]\non = [\"top\"]\nwhere = \"{condition}\"\nvalue = [{value}]\n")
    };
    let whole = format!("[mesh]\norder = {order}\n{}", job::<D>("bdf2", 0.0));
    let (before, after) = whole.split_once("[[traction]]").expect("a traction");
    let (_, after) = after.split_once("]\n[[contact]]").expect("a contact");
    let text =
        format!("{before}{}{}[[contact]]{after}", part(&format!("({y} > 0)*(x > 0.5)")), part("x <= 0.5"));
    let (rows, _) = last::<D, S>(session, mesh, &text);
    let [right, left] = [by_hand(mesh, |centre| centre[0] > 0.5), by_hand(mesh, |centre| centre[0] <= 0.5)];
    assert!(right[0] > 0.1 && left[0] > 0.1, "both parts have facets");
    for (at, [_, force, moment]) in [right, left].into_iter().enumerate() {
        let (_, found, turn) = rows.iter().find(|row| row.0 == Source::Traction(at)).expect("a source");
        close(found[1], force, &format!("force of part {at}, order {order}"));
        let turn = if D == 2 { turn[2] } else { -turn[1] };
        close(turn, moment, &format!("moment of part {at}, order {order}"));
    }
    let (_, carried, _) = rows.iter().find(|row| row.0 == Source::Contact(0)).expect("a source");
    close(carried[1], -right[1] - left[1], "what the contact carries");
}

/// Parts that are nothing are refused.
fn refused(session: &Session) {
    for (condition, words) in [
        ("x > 9", "traction on top: `where` holds at no facet of these boundaries; correct the expression"),
        ("sqrt(x - 0.5)", "traction on top: `where` is not a number at"),
    ] {
        let text = job::<2>("bdf2", 0.0).replace("value = [", &format!("where = \"{condition}\"\nvalue = ["));
        let mut loaded = Job::from_text(&text, "job.toml", Path::new("."), &[]).expect("a job");
        let mesh = session.is_first().then(|| crossed([4, 3]));
        let error = Simulation::<2, 4>::new(session, &mut loaded, mesh).err().map(|error| error.to_string());
        assert!(error.as_ref().is_some_and(|error| error.contains(words)), "{error:?} instead of {words}");
    }
}

#[test]
fn parts_of_boundaries_are_loaded_by_the_facets_whose_centres_belong_to_them() {
    run_on(&[1, 2, 3], |World { session, .. }| {
        for order in [1, 2] {
            parts::<2, 4>(&session, &crossed([4, 3]), order);
            parts::<3, 6>(&session, &brick([3, 2, 2]), order);
        }
        refused(&session);
    });
}

/// A turned block between `normal` supports, pressed on one of them: each takes its own share of the reaction where they meet, in any
/// order. The mesh has 1.2 m by 1 m or 1 m by 0.8 m below the pressure.
fn corner<const D: usize, const S: usize>(session: &Session, mut mesh: GlobalMesh<D>) {
    let axis = if D == 2 { [0.0, 0.0, 1.0] } else { [0.3, -0.2, 1.0] };
    let way = |vector: [f64; D]| turned(&vector, &axis, 25.0);
    mesh.nodes.iter_mut().for_each(|place| *place = way(*place));
    let up = way(std::array::from_fn(|i| if i == D - 1 { 1.0 } else { 0.0 }));
    let hypothesis = if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" };
    let sides = if D == 2 { vec!["bottom", "left"] } else { vec!["bottom", "left", "front"] };
    for first in 0..sides.len() {
        let mut sides = sides.clone();
        sides.rotate_left(first);
        let support = |side: &&str| format!("[[support]]\non = [\"{side}\"]\nfix = \"normal\"\n");
        let text = format!(
            "{}[time]\nscheme = \"implicit_euler\"\nend = 0.02\nstep = 0.01\n[solver]\ntolerance = 1e-13\n\
             [material]\n{hypothesis}elasticity = {{ youngs_modulus = 100, poisson_ratio = 0.3 }}\n\
             viscosity = {{ volumetric = 1, shear = 4 }}\n{}\
             [[traction]]\non = [\"top\"]\nvalue = {:?}\n[[contact]]\non = [\"top\"]\nnormal.unilateral.gap = 1.0\n",
            any_mesh::<D>(),
            sides.iter().map(support).collect::<String>(),
            up.map(|x| -3.0 * x),
        );
        let (rows, _) = last::<D, S>(session, &mesh, &text);
        let area = if D == 2 { 1.2 } else { 0.8 };
        for (source, force, _) in rows {
            let carried = match source {
                Source::Support(at) if sides[at] == "bottom" => 3.0 * area,
                Source::Traction(_) => -3.0 * area,
                _ => 0.0,
            };
            for (found, along) in force.into_iter().zip([up[0], up[D - 1]]) {
                close(found, carried * along, &format!("{source:?} of {sides:?}"));
            }
        }
    }
}

#[test]
fn supports_along_normals_share_the_reaction_of_a_corner() {
    run_on(&[1, 2, 3], |World { session, .. }| {
        corner::<2, 4>(&session, crossed([4, 3]));
        corner::<3, 6>(&session, brick([3, 2, 2]));
    });
}

/// What all forces lack to the rate of momentum in the worst step, relative to the largest of them, with the default tolerance.
fn worst_balance(session: &Session, mesh: &GlobalMesh<2>, text: &str) -> f64 {
    let mut run = simulation::<2, 4>(session, text, mesh);
    let mut resultants =
        Resultants::new(session, &run.body, &run.state, &supports(text)).expect("resultants");
    let mut worst: f64 = 0.0;
    while run.advance(session).expect("a step").is_some() {
        let motion = run.scheme.balanced_motion(&run.state);
        resultants
            .update(session, &run.body, &run.state, motion, run.scheme.load.as_ref())
            .expect("resultants");
        let (mut sum, mut largest) = ([0.0; 2], 0.0);
        for (source, (found, _)) in resultants.sources.iter().zip(resultants.rows()) {
            let sign = if *source == Source::Momentum { -1.0 } else { 1.0 };
            for (sum, force) in sum.iter_mut().zip(found.force) {
                *sum += sign * force;
                largest = larger(largest, force.abs());
            }
        }
        worst = larger(worst, larger(sum[0].abs(), sum[1].abs()) / largest);
    }
    worst
}

/// The forces on a body that is carried along fast are solved for, not those that would stop it.
fn carried(session: &Session) {
    let steel = |scheme: &str| {
        format!(
            "{}[time]\nscheme = \"{scheme}\"\nend = 0.2\nstep = 0.01\n[material]\nhypothesis = \"plane_strain\"\n\
             density = 7800\nelasticity = {{ youngs_modulus = 2e11, poisson_ratio = 0.3 }}\n\
             [[support]]\non = [\"top\"]\nfix = [\"x\"]\nvelocity = [10.0]\n\
             [[traction]]\non = [\"top\"]\nvalue = [0, -1e5]\n\
             [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\nfriction.coulomb.coefficient = 0.3\n",
            any_mesh::<2>()
        )
    };
    for scheme in ["implicit_euler", "bdf2"] {
        let found = worst_balance(session, &crossed([6, 4]), &steel(scheme));
        println!("steel, {scheme}: {found:.1e}");
        assert!(found < 1e-5, "{scheme}: {found:e}");
    }
    let flight = format!(
        "{}[time]\nscheme = \"implicit_euler\"\nend = 1e-4\nstep = 1e-6\n[material]\nhypothesis = \"plane_strain\"\n\
         density = 1000\nelasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\n\
         [initial]\nvelocity = [1000.0, 0.0]\n[gravity]\nacceleration = [0, -9.81]\n\
         [[contact]]\non = [\"bottom\"]\nnormal.unilateral.gap = 1.0\n",
        any_mesh::<2>()
    );
    let found = worst_balance(session, &crossed([6, 4]), &flight);
    println!("flight: {found:.1e}");
    assert!(found < 1e-3, "flight: {found:e}");
}

#[test]
fn forces_on_a_body_that_is_carried_along_are_balanced() {
    run_on(&[1, 2], |world| carried(&world.session));
}

#[test]
fn forces_pressures_and_areas_of_a_pressed_block_are_the_known_ones() {
    run_on(&[1, 2, 3], |world| all(&world.session));
}
