//! The energy balance contains the work of moving obstacles; contacts with different laws meet at edges; PETSc's solver for
//! variational inequalities finds the same solutions of unilateral contact.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::fem::effect::{CONTACT, ELASTIC, VISCOUS, WORK};
use clarke::{
    linear_algebra::tensor::larger,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};

/// All but time, solver and contact.
fn body<const D: usize>(dynamic: bool) -> String {
    let mut text = format!("{}[material]\n", any_mesh::<D>());
    if D == 2 {
        text += "hypothesis = \"plane_strain\"\n";
    }
    if dynamic {
        text += "density = 2\n";
    }
    text += "elasticity = { youngs_modulus = 100, poisson_ratio = 0.3 }\nviscosity = { volumetric = 1, shear = 2 }\n\
             [[support]]\non = [\"top\"]\nfix = \"all\"\n";
    text
}

fn time(step: f64, steps: usize, more: &str) -> String {
    format!("[time]\nend = {}\nstep = {step}\n[solver]\ntolerance = 1e-13\n{more}\n", step * steps as f64)
}

/// Components of a vector in 2D or 3D: those along x and y, and 0.4 along the third axis.
fn vector<const D: usize>(x: &str, y: &str) -> String {
    if D == 2 { format!("[\"{x}\", \"{y}\"]") } else { format!("[\"{x}\", 0.4, \"{y}\"]") }
}

/// The vertical axis.
fn up<const D: usize>() -> &'static str {
    ["", "", "y", "z"][D]
}

const UNILATERAL: &str = "[contact.normal.unilateral]\n";
const SPRINGS: &str = "[contact.normal.compliance]\nstiffness = 300\nexponent = 1.5\n";

fn obstacles<const D: usize>() -> [(&'static str, String); 5] {
    let rising = vector::<D>("0.3", "-0.01+0.5*t");
    let lower = vector::<D>("0.3", "-0.08+t");
    let (normal, tilted) = if D == 2 { ("[0, 1]", "[\"t\", 1]") } else { ("[0, 0, 1]", "[\"t\", \"t\", 1]") };
    let rolling = vector::<D>("0.2+5*t", "-0.5+0.05*sin(40*t)");
    let shell = vector::<D>("0.5+t", "2+0.5*sin(40*t)");
    let ball = if D == 2 { "sqrt(x^2 + y^2)" } else { "sqrt(x^2 + y^2 + z^2)" };
    [
        ("a plane that rises", format!("[contact.obstacle.plane]\npoint = {rising}\nnormal = {normal}\n")),
        ("a plane that turns", format!("[contact.obstacle.plane]\npoint = {lower}\nnormal = {tilted}\n")),
        ("a ball that rolls", format!("[contact.obstacle.sphere]\ncentre = {rolling}\nradius = 0.52\n")),
        (
            "a shell that shakes",
            format!("[contact.obstacle.sphere]\ncentre = {shell}\nradius = 2.2\nhollow = true\n"),
        ),
        (
            "a ball that rolls, given by its distance",
            format!("[contact.obstacle.shape]\ncentre = {rolling}\ndistance = \"{ball} - 0.52\"\n"),
        ),
    ]
}

fn balanced<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    for (name, obstacle) in obstacles::<D>() {
        for (law, dynamic) in [(UNILATERAL, true), (UNILATERAL, false), (SPRINGS, true), (SPRINGS, false)] {
            let contact = format!("[[contact]]\non = [\"bottom\"]\n{law}{obstacle}");
            let text = format!("{}{}{contact}", body::<D>(dynamic), time(0.002, 60, ""));
            let mut run = simulation::<D, S>(session, &text, mesh);
            let (mut touched, mut open, points) = (0, 0, run.body.mesh.total_nodes);
            while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")) {
                let (imbalance, inclusion) = (run.totals.energy_imbalance, outcome.inclusion_residual);
                assert!(imbalance <= 1e-10, "{name}: energy imbalance {imbalance:e}\n{text}");
                assert!(inclusion <= 1e-9, "{name}: inclusion residual {inclusion:e}\n{text}");
                touched += usize::from(outcome.energy[WORK] != 0.0);
                open = open.max(outcome.points.open);
            }
            assert!(
                touched > 10 && open > 0 && open < points,
                "{name}: {touched} steps, {open} open\n{text}"
            );
            let given = run.totals.energy[WORK];
            assert!(given != 0.0 && run.totals.energy[ELASTIC] > 0.0, "{name} does no work\n{text}");
        }
    }
}

fn held_sides<const D: usize>() -> &'static str {
    if D == 2 {
        "[[support]]\non = [\"left\", \"right\"]\nfix = \"all\"\n"
    } else {
        "[[support]]\non = [\"left\", \"right\", \"front\", \"back\"]\nfix = \"all\"\n"
    }
}

/// Velocities at the owned nodes after every step.
fn velocities<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    mesh: &GlobalMesh<D>,
) -> Vec<Vec<f64>> {
    let mut run: Simulation<D, S> = simulation(session, job, mesh);
    let mut found = Vec::new();
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")).is_some() {
        found.push(run.state.velocity.owned().expect("velocity").to_vec());
    }
    found
}

/// Largest difference over all steps and nodes, relative to the largest velocity of all.
fn difference(session: &Session, one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    assert!(!one.is_empty() && one.len() == other.len());
    let size = one.iter().flatten().fold(0.0, |m, v| larger(m, v.abs()));
    let pairs = one.iter().flatten().zip(other.iter().flatten());
    let off = pairs.fold(0.0, |m, (a, b)| larger(m, (a - b).abs()));
    let [size, off] = session.largest([size, off]);
    assert!(size > 1e-3, "something moves");
    off / size
}

/// A plane, a ball and a shape give the same results as gaps defined by expressions, which are measured along the normals of faces. A shell
/// around a flat face touches its edges, along its own normals. So does a plane that turns, where edges can move: there the sides are held.
fn alike<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let (z, across) = (up::<D>(), if D == 2 { "" } else { "-(y-0.4)^2" });
    let half = format!("0.52^2-(x-0.2-5*t)^2{across}");
    let ball = format!("{z}+0.5-0.05*sin(40*t)-sqrt(max({half},0))+1e9*max(sign(-({half})),0)");
    let gaps = [
        "-(-0.01+0.5*t) ".to_owned() + "+" + z,
        format!("(0.08-t+(x-0.3)*t{}) + {z}", if D == 2 { "" } else { "+(y-0.4)*t" }),
        ball.clone(),
        ball,
    ];
    let facing_faces = obstacles::<D>().into_iter().filter(|(name, _)| !name.starts_with("a shell"));
    for ((name, obstacle), gap) in facing_faces.zip(gaps) {
        for law in [UNILATERAL, SPRINGS] {
            let (sides, steps) = if name.ends_with("turns") { (held_sides::<D>(), 60) } else { ("", 40) };
            let start =
                body::<D>(true) + sides + &time(0.002, steps, "") + "[[contact]]\non = [\"bottom\"]\n" + law;
            let by_obstacle = velocities::<D, S>(session, &(start.clone() + &obstacle), mesh);
            let by_gap = velocities::<D, S>(session, &format!("{start}gap = \"{gap}\"\n"), mesh);
            let off = difference(session, &by_obstacle, &by_gap);
            assert!(off < 1e-10, "{name} is {off:e} off its expression\n{start}{obstacle}{gap}");
        }
    }
}

/// Bounds on displacements and velocities along all axes, with edges where they meet.
fn bounded<const D: usize>(method: &str) -> String {
    let walls = if D == 2 {
        "[[contact]]\non = [\"left\"]\n[contact.normal.unilateral]\ngap = \"0.01-0.2*t\"\n"
    } else {
        "[[contact]]\non = [\"left\"]\n[contact.normal.unilateral]\ngap = \"0.01-0.2*t\"\n\
         [[contact]]\non = [\"front\"]\n[contact.normal.unilateral]\ngap = 0.005\n"
    };
    let ball = vector::<D>("0.4+3*t", "-0.5+0.05*sin(60*t)");
    let load = if D == 2 {
        "[\"30*sin(90*t)\", \"20*cos(50*t)\"]"
    } else {
        "[\"30*sin(90*t)\", -9, \"20*cos(50*t)\"]"
    };
    let solver = format!("method = \"{method}\"");
    format!(
        "{}{}{walls}[[contact]]\non = [\"right\"]\n[contact.normal.unilateral]\nbound = \"velocity\"\n\
         [[contact]]\non = [\"bottom\"]\n{UNILATERAL}[contact.obstacle.sphere]\ncentre = {ball}\nradius = 0.52\n\
         [[body_force]]\nvalue = {load}\n",
        body::<D>(true),
        time(0.002, 40, &solver)
    )
}

fn cross_checked<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let mut runs = ["newton", "vinewtonrsls"].map(|method| {
        let job = bounded::<D>(method);
        (simulation::<D, S>(session, &job, mesh), job)
    });
    let mut held = 0;
    let mut worst = 0.0f64;
    loop {
        let [newton, other] = &mut runs;
        let one = newton.0.advance(session).unwrap_or_else(|e| panic!("{e}\n{}", newton.1));
        let two = other.0.advance(session).unwrap_or_else(|e| panic!("{e}\n{}", other.1));
        let (Some(one), Some(two)) = (one, two) else { break };
        assert_eq!(one.points, two.points, "the same points touch");
        held = held.max(one.points.held);
        let fields = |run: &Simulation<D, S>| {
            let traction = run.state.contact_traction.as_ref().expect("tractions").owned().expect("values");
            [run.state.velocity.owned().expect("values").to_vec(), traction.to_vec()]
        };
        let (here, there) = (fields(&newton.0), fields(&other.0));
        for (a, b) in here.iter().zip(&there) {
            let size = a.iter().fold(0.0, |m, v| larger(m, v.abs()));
            let off = a.iter().zip(b).fold(0.0, |m, (v, w)| larger(m, (v - w).abs()));
            let [size, off] = session.largest([size, off]);
            worst = larger(worst, off / size.max(1e-12));
        }
    }
    assert!(worst < 1e-8, "velocities or tractions are {worst:e} apart");
    assert!(held > 5, "only {held} points ever touch");
    if session.is_first() {
        println!("{D}D: bounds agree to {worst:.1e}, up to {held} points held");
    }
}

/// Different laws on boundaries that meet at square corners.
fn mixed<const D: usize>() -> String {
    let load = if D == 2 { "[\"20*t\", -6]" } else { "[\"20*t\", \"-8*t\", -6]" };
    let front = if D == 2 {
        ""
    } else {
        "[[contact]]\non = [\"front\"]\n[contact.normal.damped_response]\nbreakpoints = [0.01]\nslopes = [20, -2]\n\
         symmetry = \"odd\"\n"
    };
    let plain = body::<D>(true).replace("fix = \"all\"", "fix = [\"x\"]");
    format!(
        "{plain}{}[[contact]]\non = [\"bottom\"]\n[contact.normal.compliance]\nstiffness = 500\ngap = 0.001\n\
         [[contact]]\non = [\"right\"]\n[contact.normal.unilateral]\ngap = \"0.002+0.001*{}\"\n\
         [[contact]]\non = [\"left\"]\n[contact.normal.graph]\npoints = [[0, -0.5], [0, 0.5]]\nslope_after = 3\n\
         {front}[[body_force]]\nvalue = {load}\n",
        time(0.002, 60, ""),
        up::<D>()
    )
}

fn mixed_laws<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) -> [f64; 4] {
    let text = mixed::<D>();
    let mut run = simulation::<D, S>(session, &text, mesh);
    let mut corner = 0;
    while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")) {
        assert!(run.totals.energy_imbalance <= 1e-10, "{:e}\n{text}", run.totals.energy_imbalance);
        assert!(outcome.inclusion_residual <= 1e-8, "{:e}\n{text}", outcome.inclusion_residual);
        let tractions = run.state.contact_traction.as_ref().expect("tractions").owned().expect("values");
        // At the corner of bottom and right each law pushes along its own normal.
        let pushed = |t: &[f64]| t[0] > 1e-3 && t[D - 1] < -1e-3;
        corner += usize::from(tractions.chunks_exact(D).any(pushed));
    }
    let [corner] = session.sum([corner as f64]);
    assert!(corner > 0.0, "both laws act at once somewhere on the edge\n{text}");
    let totals = &run.totals;
    [totals.energy[ELASTIC], totals.energy[CONTACT], totals.energy[VISCOUS], totals.energy[WORK]]
}

/// An elastic bar of 1 m with a wave speed of 10 m/s hits a wall at a distance of 1 cm at 0.1 m/s: it is in contact from 0.1 s to
/// 0.3 s under 1000 Pa and rebounds. Returns the first and last time of contact, the mean pressure between 0.15 s and 0.25 s, and
/// the velocity of the rebound.
fn impact(session: &Session, cells: usize) -> [f64; 4] {
    let step = 0.025 / cells as f64;
    let job = format!(
        "{}[material]\nhypothesis = \"plane_strain\"\ndensity = 1000\n\
         elasticity = {{ youngs_modulus = 1e5, poisson_ratio = 0 }}\n[[support]]\non = [\"bottom\", \"top\"]\nfix = [\"y\"]\n\
         [[contact]]\non = [\"right\"]\n[contact.normal.unilateral]\n[contact.obstacle.plane]\npoint = [1.01, 0]\n\
         normal = [-1, 0]\n[initial]\nvelocity = [0.1, 0]\n[time]\nend = 0.4\nstep = {step}\n",
        any_mesh::<2>()
    );
    let mesh = rectangle([1.0, 0.05], [cells, 1], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    let (mut touch, mut middle, mut impulse) = (Vec::new(), Vec::new(), 0.0);
    while run.advance(session).expect("step").is_some() {
        let tractions = run.state.contact_traction.as_ref().expect("tractions").owned().expect("values");
        let [sum] = session.sum([tractions.chunks_exact(2).map(|t| t[0]).sum()]);
        // Two nodes of the same weight touch.
        let (pressure, time) = (0.5 * sum, run.state.time);
        impulse += step * pressure;
        if pressure > 0.0 {
            touch.push(time);
        }
        if (0.15..0.25).contains(&time) {
            middle.push(pressure);
        }
        assert!(run.totals.energy_imbalance <= 1e-10);
    }
    let mean = middle.iter().sum::<f64>() / middle.len() as f64;
    [touch[0], touch[touch.len() - 1], mean, 0.1 - impulse / 1000.0]
}

fn impacts(session: &Session) {
    let found = [10, 20, 40].map(|cells| impact(session, cells));
    for ([first, last, pressure, rebound], cells) in found.into_iter().zip([10.0, 20.0, 40.0]) {
        if session.is_first() {
            println!("{cells} cells: {first} s to {last} s, {pressure} Pa, {rebound} m/s");
        }
        assert!((first - 0.1).abs() <= 0.05 / cells, "it arrives at {first} s");
        assert!((last - 0.3).abs() <= 0.1 / cells, "it leaves at {last} s");
        assert!((pressure - 1000.0).abs() <= 400.0 / cells, "it presses with {pressure} Pa");
        // The node that hits the wall loses its kinetic energy, a fraction of that of the bar that decreases with the cell size.
        assert!((-0.1..=-0.1 + 0.12 / cells).contains(&rebound), "it flies back with {rebound} m/s");
    }
    let lost = found.map(|f| 0.1 + f[3]);
    for pair in lost.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order > 0.5, "the loss of velocity falls with order {order} only: {lost:?}");
    }
}

fn moving(session: &Session) {
    balanced::<2, 4>(session, &crossed([6, 3]));
    balanced::<3, 6>(session, &brick([4, 3, 2]));
    alike::<2, 4>(session, &crossed([6, 3]));
    alike::<3, 6>(session, &brick([4, 3, 2]));
}

fn bounds(session: &Session) {
    cross_checked::<2, 4>(session, &crossed([8, 5]));
    cross_checked::<3, 6>(session, &brick([4, 3, 3]));
}

fn several(session: &Session, folder: &std::path::Path) {
    let found =
        [mixed_laws::<2, 4>(session, &crossed([6, 4])), mixed_laws::<3, 6>(session, &brick([3, 3, 3]))];
    let file = folder.join("several.json");
    if session.ranks() == 1 {
        std::fs::write(&file, serde_json::to_string(&found).expect("JSON")).expect("written");
        return;
    }
    let text = std::fs::read_to_string(&file).expect("the numbers of one rank");
    let alone: [[f64; 4]; 2] = serde_json::from_str(&text).expect("JSON");
    for (one, several) in alone.iter().flatten().zip(found.iter().flatten()) {
        assert!((one - several).abs() <= 1e-9 * one.abs(), "{several} instead of {one}");
    }
}

/// A plane that is inside of the body at the start, as a constraint and as the vertical end of a graph.
fn interference(session: &Session) {
    let found = [UNILATERAL, "[contact.normal.displacement_graph]\npoints = [[0, 0]]\nslope_after = inf\n"]
        .map(|law| {
            let plane = "[contact.obstacle.plane]\npoint = [0, 1e-3]\nnormal = [0, 1]\n";
            let text = format!(
                "{}{}[[contact]]\non = [\"bottom\"]\n{law}{plane}",
                body::<2>(false),
                "[time]\nend = 1\nstep = 0.5\nscheme = \"implicit_euler\"\n"
            );
            let mut run = simulation::<2, 4>(session, &text, &crossed([4, 3]));
            while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {}
            (run.totals.energy, run.totals.energy_of_scheme())
        });
    for (energy, generated) in found {
        assert!(energy[CONTACT] < 0.0 && generated <= 0.0, "{energy:?}, {generated}");
        let off =
            (energy[CONTACT] - found[0].0[CONTACT]).abs() + (energy[ELASTIC] - found[0].0[ELASTIC]).abs();
        assert!(off < 1e-9 * energy[ELASTIC], "{energy:?}, not {:?}", found[0].0);
    }
}

#[test]
fn rigid_obstacles_inside_of_the_body_give_it_the_same_energy_by_constraints_and_by_graphs() {
    run_on(&[1], |world| interference(&world.session));
}

#[test]
fn an_elastic_bar_is_thrown_back_by_a_wall_as_travelling_waves_say() {
    run_on(&[1], |world| impacts(&world.session));
}

#[test]
fn obstacles_that_move_do_work_that_energy_accounts_for() {
    run_on(&[1, 2], |world| moving(&world.session));
}

#[test]
fn contacts_that_are_bounds_are_solved_alike_by_petsc_s_variational_inequalities() {
    run_on(&[1, 2], |world| bounds(&world.session));
}

#[test]
fn contacts_of_several_laws_meet_at_corners_the_same_on_any_number_of_ranks() {
    run_on(&[1, 2, 3], |world| several(&world.session, &world.folder));
}
