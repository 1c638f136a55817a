//! Vertical parts of contact graphs: rest at a jump, rigid obstacles; and foundations that store energy.

use crate::{
    case::Case,
    hdf5_file::NumberFile,
    launch,
    results::{assert_same_answer, relative_difference},
};
use clarke::linear_algebra::tensor::larger;

#[test]
fn contact_laws_give_the_same_answer_on_any_number_of_ranks() {
    for (job, end) in [("rigid_wall", "0.2"), ("stick_on_a_jump", "0.7"), ("compliant_foundation", "2.0")] {
        let make = || Case::of(job).set("time.end", end).set("solver.tolerance", "1e-12");
        let alone = make();
        alone.run(1);
        for ranks in [2, 3] {
            let case = make();
            case.run(ranks);
            assert_same_answer(&alone.results(), &case.results(), 1e-8, &format!("{job} on {ranks} ranks"));
        }
    }
}

#[test]
fn a_bar_hits_a_rigid_wall_when_it_gets_there_and_stays_out_of_it() {
    let case = Case::of("rigid_wall");
    let results = case.run(1);
    let probes = results.table("probes.csv").only("probe", "front");
    let (times, displacements) = (probes.numbers("time"), probes.numbers("displacement_x"));
    let deepest = displacements.iter().copied().fold(f64::MIN, larger);
    assert!(deepest <= 0.01 * (1.0 + 1e-12), "the bar is {} m in the wall", deepest - 0.01);
    let touching: Vec<f64> = times
        .iter()
        .zip(&displacements)
        .filter(|(_, u)| **u > 0.01 * (1.0 - 1e-12))
        .map(|(time, _)| *time)
        .collect();
    let (first, last) = (touching[0], touching[touching.len() - 1]);
    assert!((first - 0.1).abs() < 1e-3, "it gets there at {first} s");
    assert!((last - 0.3).abs() < 0.02, "it leaves at {last} s, when the wave is back");
}

#[test]
fn a_block_rests_in_a_jump_of_its_contact_law_until_the_load_is_beyond() {
    let case = Case::of("stick_on_a_jump");
    let results = case.run(1);
    let profile = results.table("profiles.csv");
    let (times, velocities) = (profile.numbers("time"), profile.numbers("normal_velocity"));
    for (time, velocity) in times.iter().zip(velocities) {
        if *time < 0.4 {
            assert!(velocity.abs() < 1e-15, "it moves with {velocity} m/s at {time} s");
        }
        if *time > 0.7 {
            assert!(velocity > 0.05, "it sticks at {time} s: {velocity} m/s");
        }
    }
    let forces = profile.numbers("contact_pressure");
    let mean = |wanted: f64| {
        let here: Vec<f64> =
            times.iter().zip(&forces).filter(|(t, _)| (**t - wanted).abs() < 1e-9).map(|(_, p)| *p).collect();
        here.iter().sum::<f64>() / here.len() as f64
    };
    assert!((mean(0.25) - 2.5).abs() < 0.5, "{}", mean(0.25));
}

#[test]
fn a_foundation_of_springs_carries_the_load_at_the_penetration_of_the_closed_form() {
    let case = Case::of("compliant_foundation").set("time.end", "40.0");
    let results = case.run(1);
    let depth = -results.table("probes.csv").last("displacement_y");
    assert!((depth - 0.021).abs() < 1e-5, "{depth}");
    let stored = results.table("history.csv").last("contact_energy");
    assert!((stored - 0.5 * 20.0 * 0.02).abs() < 1e-3, "{stored}");
    assert!(results.number("max_energy_imbalance") < 1e-10);
}

/// A block of uniform stress presses on a rigid plane with 3 Pa, at midside nodes and at corners.
#[test]
fn quadratic_cells_press_on_a_plane_with_a_uniform_pressure() {
    for (dimension, up) in [(2, "[0.0, -3.0]"), (3, "[0.0, 0.0, -3.0]")] {
        let case = if dimension == 2 { Case::square(4) } else { Case::cube(3) };
        let sides = if dimension == 2 {
            "[{on = ['left'], fix = ['x']}]"
        } else {
            "[{on = ['left'], fix = ['x']}, {on = ['front'], fix = ['y']}]"
        };
        let hypothesis = if dimension == 2 { "hypothesis = 'plane_strain', " } else { "" };
        let elasticity = "elasticity = {youngs_modulus = 1000.0, poisson_ratio = 0.25}";
        let case = case
            .set("mesh.order", "2")
            .set("material", &format!("{{{hypothesis}{elasticity}}}"))
            .set("support", sides)
            .set("traction", &format!("[{{on = ['top'], value = {up}}}]"))
            .set("contact", "[{on = ['bottom'], normal = {unilateral = {gap = 0.0}}}]")
            .without("body_force")
            .without("initial")
            .set("time", "{end = 1.0, step = 1.0, scheme = 'implicit_euler'}")
            .set("output.also", "['contact_pressure', 'gap']")
            .set("output.profile", "[{on = 'bottom'}]");
        for ranks in 1..=4 {
            let profile = case.run(ranks).table("profiles.csv");
            let pressures = profile.numbers("contact_pressure");
            let pressures = &pressures[pressures.len() / 2..];
            assert!(pressures.iter().all(|p| (p - 3.0).abs() < 1e-7), "{ranks} ranks: {pressures:?}");
        }
    }
}

/// A block without mass, whose stiffness is 1000 N/m; the contact on top has no obstacle.
fn on_a_spring() -> Case {
    let elasticity = "{youngs_modulus = 1000.0, poisson_ratio = 0.0}";
    Case::square(2)
        .set("material", &format!("{{hypothesis = 'plane_strain', elasticity = {elasticity}}}"))
        .set("support", "[{on = ['left'], fix = ['x']}, {on = ['bottom'], fix = ['y']}]")
        .set("contact", "[{on = ['top'], normal = {unilateral = {}}}]")
        .without("traction")
        .without("body_force")
        .without("initial")
}

/// A mass falls on an elastic block and bounces back: half a period of an oscillator.
#[test]
fn a_mass_that_hits_a_spring_turns_back_after_half_a_period() {
    let case = on_a_spring()
        .set("contact.0.obstacle", "{plane = {point = [0, 1], normal = [0, -1]}}")
        .set("contact.0.obstacle_load", "{direction = [0, -3], force = 0, mass = 10, velocity = 1}")
        .set("time", "{end = 0.4, step = 0.001, scheme = 'bdf2'}");
    let mut first: Option<Vec<f64>> = None;
    for ranks in 1..=3 {
        let results = case.run(ranks);
        let path = results.table("resultants.csv").only("source", "contact top");
        let (displacements, velocities) =
            (path.numbers("obstacle_displacement"), path.numbers("obstacle_velocity"));
        let (times, forces) = (path.numbers("time"), path.numbers("force_y"));
        // Stiffness 1000 N/m, frequency 10 /s: x = 0.1 m sin(10 t).
        let deepest = displacements.iter().copied().fold(0.0, larger);
        assert!((deepest - 0.1).abs() < 2e-4, "{deepest} m");
        let touching = times.iter().zip(&forces).filter(|(_, force)| **force < 0.0).map(|(time, _)| *time);
        let last = touching.fold(0.0, larger);
        assert!((last - 0.1 * std::f64::consts::PI).abs() < 2.5e-3, "{last} s");
        let rebound = velocities[velocities.len() - 1];
        assert!((rebound + 1.0).abs() < 5e-3, "{rebound} m/s");
        for (force, displacement) in forces.iter().zip(&displacements) {
            assert!((force + 1000.0 * displacement.max(0.0)).abs() < 1e-5, "{force} N at {displacement} m");
        }
        let alone = first.get_or_insert_with(|| displacements.clone());
        assert!(alone.iter().zip(&displacements).all(|(a, b)| (a - b).abs() < 1e-9), "{ranks} ranks");
    }
}

/// A body without mass is pressed by an obstacle that goes away again: it is free of forces afterwards.
#[test]
fn a_body_that_its_obstacle_releases_rests() {
    for scheme in ["implicit_euler", "bdf2"] {
        let case = on_a_spring()
            .set("contact.0.obstacle", "{plane = {point = [0, '1 - 0.1*sin(10*t)'], normal = [0, -1]}}")
            .set("time", &format!("{{end = 0.4, step = 0.001, scheme = '{scheme}'}}"));
        for ranks in [1, 2] {
            let forces =
                case.run(ranks).table("resultants.csv").only("source", "contact top").numbers("force_y");
            let deepest = forces.iter().copied().fold(0.0, |most, force| larger(most, -force));
            assert!((deepest - 100.0).abs() < 1e-3, "{scheme}: {deepest} N");
            assert!(forces[320..].iter().all(|force| force.abs() < 1e-9), "{scheme}: {forces:?}");
        }
    }
}

/// An elastic block under two discs, each of which its own force presses on its half of the top.
fn under_two_discs() -> Case {
    let disc = |x: f64, part: &str, force: &str| {
        format!(
            "{{on = ['top'], where = '{part}', normal = {{unilateral = {{}}}}, \
             obstacle = {{sphere = {{centre = [{x}, 0.2], radius = 0.1}}}}, \
             obstacle_load = {{direction = [0, -1], force = '{force}', mass = 2}}}}"
        )
    };
    let [left, right] = [disc(0.025, "x < 0.045", "4e5*t"), disc(0.08, "x > 0.055", "2e5*t*(2 - t)")];
    Case::of("indented_block")
        .without("material.viscoplasticity")
        .set("mesh.rectangle.cells", "[12, 12]")
        .set("mesh.rectangle.grading", "{y = 2.0, toward = ['top']}")
        .set("contact", &format!("[{left}, {right}]"))
        .set("output.probe", "[{name = 'between', point = [0.05, 0.1]}]")
        .set("time.end", "1.0")
        .set("time.step", "0.125")
}

/// The gap in a profile is that to the obstacle where its force has moved it, so that springs carry what it says.
#[test]
fn the_gap_of_a_profile_is_that_to_the_obstacle_where_it_is() {
    for ranks in [1, 2] {
        let case = under_two_discs()
            .set("contact.0.normal", "{compliance = {stiffness = 1e10, exponent = 1}}")
            .set("contact.1.normal", "{compliance = {stiffness = 1e10, exponent = 1}}")
            .set("output.profile", "[{on = 'top'}]");
        let top = case.run(ranks).table("profiles.csv");
        // Between the discs there is no contact, and no gap.
        let number = |gap: &str| if gap.is_empty() { 0.0 } else { gap.parse().expect("a number") };
        let gap: Vec<f64> = top.words("gap").into_iter().map(number).collect();
        let pressure = top.numbers("contact_pressure");
        let deepest = gap.iter().copied().fold(0.0, f64::min);
        assert!(deepest < -1e-5, "{deepest} m");
        for (gap, pressure) in gap.iter().zip(&pressure) {
            let spring = 1e10 * larger(-gap, 0.0);
            assert!((pressure - spring).abs() < 1e-6 * 1e10 * -deepest, "{pressure} Pa at a gap of {gap} m");
        }
    }
}

#[test]
fn two_obstacles_are_moved_by_their_forces_together() {
    let mut first: Option<Vec<f64>> = None;
    for scheme in ["implicit_euler", "bdf2"] {
        let make = || under_two_discs().set("time.scheme", &format!("'{scheme}'"));
        let mut alone: Option<Case> = None;
        for ranks in 1..=3 {
            let case = make().set("checkpoint.every", "4").run_and_keep(ranks);
            let table = case.results().table("resultants.csv");
            let at_end =
                |name: &str, column: &str| *table.only("source", name).numbers(column).last().expect("rows");
            // Without momentum to speak of, each contact carries the force of its disc.
            for (name, force) in [("contact top", 4e5), ("contact top (2)", 2e5)] {
                let found = at_end(name, "force_y");
                assert!((found + force).abs() < 10.0, "{scheme}, {name}: {found} N on {ranks} ranks");
                assert!(at_end(name, "obstacle_displacement") > 1e-5);
            }
            let imbalance = case.results().summary()["max_energy_imbalance"].as_f64().expect("a number");
            assert!(imbalance < 1e-9, "{scheme}: {imbalance}");
            match &alone {
                None => alone = Some(case),
                Some(one) => {
                    assert_same_answer(&one.results(), &case.results(), 1e-7, &format!("{scheme} {ranks}"))
                }
            }
        }
        let stopped = make().set("checkpoint.every", "4");
        stopped.run_with(1, &["--set", "time.end=0.5"]).expect(0);
        stopped.run_with(1, &["--restart"]).expect(0);
        let alone = alone.expect("a run");
        let straight = alone.results();
        for name in ["history.csv", "resultants.csv"] {
            assert_eq!(straight.text(name), stopped.results().text(name), "{scheme}: {name}");
        }
        let depths =
            straight.table("resultants.csv").only("source", "contact top").numbers("obstacle_displacement");
        let other = first.get_or_insert_with(|| depths.clone());
        assert!(
            other.iter().zip(&depths).all(|(a, b)| (a - b).abs() < 1e-3 * a.abs()),
            "{other:?} {depths:?}"
        );
    }
}

/// A disc or a ball under a force on its axle, and about its axis none, after 0.02 s.
fn rolling(in_space: bool) -> Case {
    let case = Case::of("rolling_disc").set("time.end", "0.02").without("output.fields");
    if !in_space {
        return case;
    }
    case.without("mesh.rectangle")
        .without("material.hypothesis")
        .set("mesh.box", "{size = [0.1, 0.06, 0.02], cells = [16, 10, 2]}")
        .set("contact.0.obstacle.sphere", "{centre = [0.04, 0.03, 0.119], radius = 0.1, axis = [0, 2, 0]}")
        .set("contact.0.obstacle_load.direction", "[1, 0, 0]")
        .set("contact.0.obstacle_load.moment_of_inertia", "0.04")
}

/// Forces and moments on obstacles hold at the midpoint, too: no energy is lost but in friction.
#[test]
fn a_disc_rolls_under_the_midpoint_rule() {
    let case = Case::of("rolling_disc")
        .without("check")
        .set("mesh.rectangle.cells", "[30, 2]")
        .set("material.density", "1.0")
        .set("contact.0.redistribute_mass", "true")
        .set("time", "{end = 0.02, step = 2e-4, scheme = 'midpoint'}");
    for ranks in [1, 2] {
        let results = case.run(ranks);
        let imbalance = results.summary()["max_energy_imbalance"].as_f64().expect("a number");
        assert!(imbalance < 1e-10, "{imbalance}");
        let table = results.table("resultants.csv").only("source", "contact top");
        let last = |column: &str| *table.numbers(column).last().expect("rows");
        let rolls = -0.1 * last("obstacle_angular_velocity") / last("obstacle_velocity");
        assert!((rolls - 1.0).abs() < 0.05, "it rolls: {rolls}");
    }
}

#[test]
fn a_disc_and_a_ball_roll_as_fast_as_their_inertia_lets_them() {
    // F / (m + I / R^2); the ball lies deeper, so that more of it slides.
    for (in_space, acceleration, error, turn) in [(false, 20.0, 0.01, -1.0), (true, 300.0 / 14.0, 0.02, 1.0)]
    {
        let straight = rolling(in_space).set("checkpoint.every", "5").run_and_keep(1);
        let table = straight.results().table("resultants.csv").only("source", "contact top");
        let last = |column: &str| *table.numbers(column).last().expect("rows");
        let (velocity, angular) = (last("obstacle_velocity"), turn * last("obstacle_angular_velocity"));
        assert!((velocity / (0.02 * acceleration) - 1.0).abs() < error, "{velocity} m/s");
        assert!((0.1 * angular / velocity - 1.0).abs() < 0.01, "{angular} rad/s at {velocity} m/s");
        let imbalance = straight.results().summary()["max_energy_imbalance"].as_f64().expect("a number");
        assert!(imbalance < 1e-9, "{imbalance}");
        for ranks in [2, 3] {
            let case = rolling(in_space).run_and_keep(ranks);
            let table = case.results().table("resultants.csv").only("source", "contact top");
            for column in ["obstacle_displacement", "obstacle_rotation"] {
                let found = *table.numbers(column).last().expect("rows");
                assert!((found / last(column) - 1.0).abs() < 1e-6, "{column} {found} on {ranks} ranks");
            }
        }
        let stopped = rolling(in_space).set("checkpoint.every", "5");
        stopped.run_with(1, &["--set", "time.end=0.01"]).expect(0);
        stopped.run_with(1, &["--restart"]).expect(0);
        for name in ["history.csv", "resultants.csv"] {
            assert_eq!(straight.results().text(name), stopped.results().text(name), "{name}");
        }
    }
}

/// A block of 0.4 m that slides on two planes with different friction, which meet below its middle.
fn on_two_planes() -> Case {
    let plane = |part: &str, coefficient: f64| {
        format!(
            "{{on = ['bottom'], where = '{part}', normal = {{unilateral = {{}}}}, \
             friction = {{coulomb = {{coefficient = {coefficient}}}}}}}"
        )
    };
    Case::of("sliding_block")
        .set("contact", &format!("[{}, {}]", plane("x < 0.2", 0.5), plane("x > 0.2", 0.25)))
        .set("time.end", "0.02")
        .without("output.fields")
}

#[test]
fn a_node_between_two_contacts_of_a_smooth_boundary_belongs_to_one_of_them() {
    let mut alone: Option<Case> = None;
    for ranks in 1..=3 {
        let case = on_two_planes().run_and_keep(ranks);
        let table = case.results().table("resultants.csv");
        let at_end =
            |name: &str, column: &str| *table.only("source", name).numbers(column).last().expect("rows");
        let [left, right] = ["contact bottom", "contact bottom (2)"].map(|name| at_end(name, "force_y"));
        assert!((left + right - 392.4).abs() < 1e-6, "the weight: {left} N and {right} N");
        let [area, other] = ["contact bottom", "contact bottom (2)"]
            .map(|name| at_end(name, "touching_area") + at_end(name, "open_area"));
        assert!((area - 0.2125).abs() < 1e-12 && (other - 0.1875).abs() < 1e-12, "{area} m and {other} m");
        // The profile has the pressure at each of the 17 nodes, with the friction of the contact that it belongs to.
        let profile = case.results().table("profiles.csv");
        let [x, p, q] =
            ["x", "contact_pressure", "friction_traction_x"].map(|column| profile.numbers(column));
        let last = x.len() - 17;
        let mut force = 0.0;
        for at in last..x.len() {
            let weight = if at == last || at == x.len() - 1 { 0.0125 } else { 0.025 };
            force += weight * p[at];
            let coefficient = if x[at] < 0.201 { 0.5 } else { 0.25 };
            assert!(
                (q[at] - coefficient * p[at]).abs() <= 1e-6 * p[at],
                "{} Pa and {} Pa at {}",
                q[at],
                p[at],
                x[at]
            );
        }
        assert!((force - 392.4).abs() < 1e-6, "{force} N");
        match &alone {
            None => alone = Some(case),
            Some(one) => assert_same_answer(&one.results(), &case.results(), 1e-7, &format!("{ranks} ranks")),
        }
    }
}

/// The gap of a node that belongs to no contact is not that of a closed one.
#[test]
fn a_profile_has_no_gap_where_there_is_no_contact() {
    let case = on_two_planes()
        .set("contact.1.where", "'x > 0.3'")
        .set("contact.0.where", "'x < 0.1'")
        .set("contact.0.friction.coulomb.coefficient", "0.25")
        .set("support", "[{on = ['top'], fix = ['y']}]");
    let profile = case.run(2).table("profiles.csv");
    let gaps = profile.words("gap");
    for (x, gap) in profile.numbers("x").iter().zip(gaps) {
        assert_eq!(gap.is_empty(), *x > 0.101 && *x < 0.299, "{gap} at {x}");
    }
}

#[test]
fn cells_that_are_too_large_for_the_bonds_are_warned_of_on_any_number_of_ranks() {
    let warning = "nodes on the boundary bottom are up to";
    for ranks in [1, 2] {
        let check = |cells: &str, order: &str, strength: &str| {
            let case = Case::of("verification/double_cantilever")
                .set("mesh.rectangle.cells", cells)
                .set("mesh.order", order)
                .set("contact.0.adhesion.strength", strength);
            let job = case.written();
            launch::run(ranks, &["check", job.to_str().expect("a path")]).expect(0)
        };
        // E G / strength^2 = 11.66 mm; with the thickness 1.5 mm the zone is 11.66^(1/4) 1.5^(3/4) = 2.50 mm long, a third of it 0.83 mm.
        check("[100, 2]", "1", "57e6").says(warning).says("only 2.5e-3 m long").says("at most 8.3e-4 m");
        // The strength that follows from this energy and stiffness is as large.
        let case = Case::of("verification/double_cantilever")
            .set("mesh.rectangle.cells", "[100, 2]")
            .set("mesh.order", "1")
            .set("contact.0.adhesion", "{stiffness = 2.32e13, energy = 140.0}");
        let checked = launch::run(ranks, &["check", case.written().to_str().expect("a path")]).expect(0);
        checked.says(warning).says("lower `stiffness`");
        for (cells, order, strength) in
            [("[100, 2]", "2", "57e6"), ("[200, 2]", "1", "57e6"), ("[100, 2]", "1", "20e6")]
        {
            let fine = check(cells, order, strength).stdout;
            assert!(!fine.contains(warning), "{cells} {order} {strength}: {fine}");
        }
    }
}

/// A block of quadratic cells that its right side presses to the ground and pushes against a wall.
fn pushed_block(contacts: &str) -> Case {
    Case::cube(2)
        .set("mesh", "{order = 2, box = {size = [0.6, 0.4, 0.5], cells = [4, 2, 2]}}")
        .set("material", "{density = 700, elasticity = {youngs_modulus = 3e6, poisson_ratio = 0.3}}")
        .set("support", "[{on = ['right'], fix = 'all', displacement = ['-0.03*t', '0.01*t', '-0.06*t']}]")
        .without("traction")
        .set("contact", contacts)
        .set(
            "output",
            "{folder = 'out', also = ['contact_pressure', 'contact_status', 'gap', 'branch', 'sliding_velocity'], \
             profile = [{on = 'bottom'}], fields.every = 1}",
        )
        .set("time", "{scheme = 'bdf2', end = 0.01, step = 0.001}")
}

/// The largest difference of a field of two runs in all steps, relative to its largest value.
fn differs(field: &str, cases: [&Case; 2]) -> f64 {
    let [one, other] = cases.map(|case| NumberFile::open(&case.results().path("fields.vtkhdf")));
    let off = (0..one.times().len()).map(|step| {
        let [one, other] = [&one, &other].map(|file| file.field(field, step));
        let size = one.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let worst = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, larger);
        if size > 0.0 { worst / size } else { worst }
    });
    off.fold(0.0, larger)
}

const GROUND: &str = "{on = ['bottom'], normal.unilateral = {}, friction.coulomb = {coefficient = 0.35}}";
const WALL: &str = "{on = ['left'], normal.compliance = {stiffness = 2e8}, friction.tresca = {bound = 500}}";

#[test]
fn fields_at_edges_do_not_depend_on_the_order_of_the_tables_or_the_ranks() {
    let ordered = pushed_block(&format!("[{GROUND}, {WALL}]")).run_and_keep(1);
    let swapped = pushed_block(&format!("[{WALL}, {GROUND}]")).run_and_keep(1);
    let parts = pushed_block(&format!("[{WALL}, {GROUND}]")).run_and_keep(3);
    for field in
        ["contact_pressure", "contact_status", "gap", "branch", "sliding_velocity", "contact_traction"]
    {
        for other in [&swapped, &parts] {
            let off = differs(field, [&ordered, other]);
            assert!(off < 1e-6, "{field} differs by {off}");
        }
    }
}

#[test]
fn corners_of_quadratic_cells_have_the_mean_traction_around_for_any_division_into_tables() {
    let whole = pushed_block(&format!("[{GROUND}]")).run_and_keep(1);
    let half = |part: &str| GROUND.replace("normal", &format!("where = '{part}', normal"));
    let halves = pushed_block(&format!("[{}, {}]", half("x < 0.3"), half("x > 0.3"))).run_and_keep(2);
    for field in ["contact_pressure", "contact_traction", "gap", "contact_status"] {
        let off = differs(field, [&whole, &halves]);
        assert!(off < 1e-6, "{field} differs by {off}");
    }
    for column in ["contact_pressure", "gap", "friction_traction_x", "sliding_velocity_x"] {
        let [one, other] = [&whole, &halves].map(|case| case.results().table("profiles.csv").numbers(column));
        let size = one.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        assert!(size > 0.0 && one.iter().all(|x| x.is_finite()), "{column} has a value at each node");
        let off = relative_difference(&one, &other);
        assert!(off < 1e-6, "{column} differs by {off}");
    }
    // No checkerboard: corners are under pressure as midpoints are.
    let file = NumberFile::open(&whole.results().path("fields.vtkhdf"));
    let pressed = file.field("contact_pressure", file.times().len() - 1).iter().filter(|p| **p > 0.0).count();
    assert!(pressed > 12, "{pressed} nodes, corners and midpoints, are under pressure");
}

#[test]
fn a_node_on_an_axis_of_symmetry_sticks_under_pressure() {
    for (scheme, friction) in
        [("implicit_euler", "coulomb.coefficient = 0.3"), ("bdf2", "tresca.bound = 1e4")]
    {
        let case = Case::written_as(
            "material = {hypothesis = 'plane_strain', elasticity = {youngs_modulus = 1e7, poisson_ratio = 0.3}}",
        )
        .set("mesh.rectangle", "{size = [1, 0.5], cells = [8, 4]}")
        .set("support", "[{on = ['left'], fix = ['x']}]")
        .set("traction", "[{on = ['top'], value = [0, '-1e5*t']}]")
        .set(
            "contact",
            &format!(
                "[{{on = ['bottom'], normal.unilateral = {{}}, friction.{friction}, \
                 obstacle.plane = {{point = [0, 0], normal = [0, 1]}}}}]"
            ),
        )
        .set("output", "{folder = 'out', also = ['contact_status'], profile = [{on = 'bottom'}]}")
        .set("time", &format!("{{scheme = '{scheme}', end = 1, step = 0.25}}"));
        for ranks in [1, 2] {
            let rows = case.run(ranks).table("resultants.csv").only("source", "contact bottom");
            let [touching, sticking, slipping] =
                ["touching_area", "sticking_area", "slipping_area"].map(|column| rows.numbers(column));
            for ((touching, sticking), slipping) in touching.iter().zip(sticking).zip(slipping) {
                assert!((touching - sticking - slipping).abs() < 1e-12, "{touching}: {sticking}, {slipping}");
            }
        }
    }
}

#[test]
fn corners_of_quadratic_cells_have_their_own_distance_from_an_obstacle() {
    for (sliding, ranks) in [("small", 1), ("small", 3), ("finite", 2)] {
        let case = Case::written_as("material.elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}")
            .set("mesh", "{order = 2, box = {size = [0.6, 0.6, 0.3], cells = [4, 4, 2]}}")
            .set("support", "[{on = ['top'], fix = 'all', displacement = [0, 0, '0.01*t']}]")
            .set(
                "contact",
                &format!(
                    "[{{on = ['bottom'], sliding = '{sliding}', normal.unilateral = {{}}, \
                     obstacle.sphere = {{centre = [0.3, 0.3, -1.0], radius = 1.0}}}}]"
                ),
            )
            .set("output", "{folder = 'out', profile = [{on = 'bottom'}]}")
            .set("time", "{scheme = 'implicit_euler', end = 1, step = 0.5}");
        let rows = case.run(ranks).table("profiles.csv");
        let last = rows.only("time", rows.words("time").last().expect("a row"));
        let [x, y, gaps] = ["x", "y", "gap"].map(|column| last.numbers(column));
        assert!(gaps.len() > 50, "corners and midpoints: {}", gaps.len());
        for ((x, y), gap) in x.iter().zip(&y).zip(gaps) {
            let across = ((x - 0.3).powi(2) + (y - 0.3).powi(2)).sqrt();
            // Along the normal of the boundary, or to the nearest place of the sphere.
            let distance = if sliding == "small" {
                1.01 - (1.0 - across.powi(2)).sqrt()
            } else {
                1.01f64.hypot(across) - 1.0
            };
            assert!((gap - distance).abs() < 1e-9, "{gap} at {x}, {y}, not {distance}: {sliding}");
        }
    }
}

#[test]
fn a_body_that_bounces_turns_as_much_as_the_moment_of_its_contact_forces_says() {
    let bounce = |order: usize, dimension: usize| {
        let case = Case::of("pressing_disc")
            .without("support")
            .without("material.viscosity")
            .set("material", "{density = 1.0, elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}}")
            .set("contact", "[{on = ['bottom'], redistribute_mass = true, normal.unilateral.gap = 0.01}]")
            .set("time", "{end = 0.016, step = 1e-3, scheme = 'midpoint'}")
            .set("solver.tolerance", "1e-13")
            .set("output", "{folder = 'out'}");
        // Cells whose diagonals all have the same direction are not symmetric.
        if dimension == 2 {
            case.set("mesh", &format!("{{rectangle = {{size = [1, 1], cells = [6, 6]}}, order = {order}}}"))
                .set("material.hypothesis", "'plane_strain'")
                .set("initial.velocity", "[0, -1]")
        } else {
            case.set("mesh", &format!("{{box = {{size = [1, 1, 1], cells = [3, 3, 3]}}, order = {order}}}"))
                .set("initial.velocity", "[0, 0, -1]")
        }
    };
    for (order, dimension, ranks) in [(1, 2, 1), (1, 2, 3), (2, 2, 2), (1, 3, 2), (2, 3, 1)] {
        let resultants = bounce(order, dimension).run(ranks).table("resultants.csv");
        let (contact, momentum) =
            (resultants.only("source", "contact bottom"), resultants.only("source", "momentum"));
        let force = if dimension == 2 { "force_y" } else { "force_z" };
        let size = contact.numbers(force).iter().fold(0.0, |most, force| larger(most, force.abs()));
        assert!(size > 1.0, "it bounces: {size} N");
        let moments: &[&str] =
            if dimension == 2 { &["moment_z"] } else { &["moment_x", "moment_y", "moment_z"] };
        for column in moments.iter().copied().chain([force]) {
            let off = contact.numbers(column).into_iter().zip(momentum.numbers(column));
            let off = off.fold(0.0, |most, (one, other)| larger(most, (one - other).abs()));
            assert!(off <= 1e-10 * size, "{column}, order {order} in {dimension}D: {off} of {size}");
        }
    }
}

/// A quasistatic bar on the line y = 0, 0.1 m x 0.002 m, bonded along its bottom and held in y along its top.
const BONDED: &str = "
    mesh.rectangle = {size = [0.1, 0.002], cells = [20, 2]}
    time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}
    [material]
    hypothesis = 'plane_stress'
    elasticity = {youngs_modulus = 7e9, poisson_ratio = 0.0}
    [[support]]
    on = ['top']
    fix = ['y']
    [[traction]]
    on = ['right']
    value = [1e6, 0.0]
    [[contact]]
    on = ['bottom']
    normal.unilateral = {}
    adhesion = {stiffness = 1e13, tangential_stiffness = 1e12, energy = 50.0}";

/// That bar on another one.
const TWO: &str = "[{name = 'up', size = [0.1, 0.002], cells = [20, 2]}, \
                    {name = 'low', corner = [0.0, -0.002], size = [0.1, 0.002], cells = [30, 2]}]";

#[test]
fn bonds_alone_hold_a_body_along_an_obstacle_and_another_body() {
    let case = Case::written_as(BONDED);
    case.run(1);
    let force = |case: &Case, source: &str| {
        case.results().table("resultants.csv").only("source", source).last("force_x")
    };
    assert!((force(&case, "contact bottom") + 2000.0).abs() < 1e-6, "{}", force(&case, "contact bottom"));
    for [on, against] in [["up.bottom", "low.top"], ["low.top", "up.bottom"]] {
        let case = Case::written_as(BONDED)
            .set("mesh", &format!("{{rectangle = {TWO}}}"))
            .set("support", "[{on = ['up.top'], fix = ['y']}, {on = ['low.bottom'], fix = 'all'}]")
            .set("traction.0.on", "['up.right']")
            .set("contact.0.on", &format!("['{on}']"))
            .set("contact.0.against", &format!("['{against}']"));
        case.run(2);
        let held = force(&case, "support low.bottom");
        assert!((held + 2000.0).abs() < 1e-6, "{held} N on {on}");
    }
    let sliding = Case::written_as(BONDED).set("contact.0.adhesion.tangential_stiffness", "0.0");
    sliding
        .run_with(1, &[])
        .expect(2)
        .says("nothing prevents these rigid motions")
        .says("translation along x");
}

#[test]
fn the_contact_traction_at_bonds_is_the_stress_on_either_side() {
    let output = "{probe_also = ['contact_traction', 'stress'], probe = [{name = 'm', point = [0.05, 0.0]}], folder = 'out'}";
    let pulled = "{fix = 'all', displacement = ['0', '1e-7*t']";
    let alone = Case::written_as(BONDED).set("support", &format!("[{pulled}, on = ['top']}}]"));
    let pair = |[on, against]: [&str; 2]| {
        let supports = format!("[{pulled}, on = ['up.top']}}, {{on = ['low.bottom'], fix = 'all'}}]");
        Case::written_as(BONDED)
            .set("mesh", &format!("{{rectangle = {TWO}}}"))
            .set("support", &supports)
            .set("contact.0.on", &format!("['{on}']"))
            .set("contact.0.against", &format!("['{against}']"))
    };
    for case in [alone, pair(["up.bottom", "low.top"]), pair(["low.top", "up.bottom"])] {
        let case = case.without("traction").set("output", output);
        case.run(1);
        let probes = case.results().table("probes.csv");
        let [traction, stress] = ["contact_traction_y", "stress_yy"].map(|column| probes.last(column));
        assert!(stress > 1e5 && (traction.abs() / stress - 1.0).abs() < 1e-9, "{traction} of {stress} Pa");
    }
}

#[test]
fn a_stiff_block_that_a_support_moves_rubs_with_its_own_friction() {
    // 1 Pa on 1 m with a coefficient of 0.3. The forces of the motion of the supported nodes alone are 1e13 N.
    let block = "
        mesh.rectangle = {size = [1.0, 0.2], cells = [10, 2]}
        time = {end = 1.0, step = 0.1, scheme = 'implicit_euler'}
        support = [{on = ['left'], fix = ['x'], displacement = ['0.01*t']}]
        traction = [{on = ['top'], value = [0.0, -1.0]}]
        contact = [{on = ['bottom'], normal.unilateral = {}, friction.coulomb.coefficient = 0.3}]
        [material]
        hypothesis = 'plane_strain'
        elasticity = {youngs_modulus = 1e15, poisson_ratio = 0.3}";
    for ranks in [1, 2] {
        let resultants = Case::written_as(block).run(ranks).table("resultants.csv");
        let force = resultants.only("source", "contact bottom").last("force_x");
        assert!((force + 0.3).abs() < 1e-3, "{force} N on {ranks} ranks");
    }
}

#[test]
fn a_block_at_rest_is_pressed_on_a_dashpot_that_gives_way() {
    let block = |load: &str, scheme: &str| {
        Case::written_as(
            "
            mesh.rectangle = {size = [1.0, 0.5], cells = [4, 1]}
            support = [{on = ['top'], fix = ['x']}]
            traction = [{on = ['top'], value = [0.0, 0.0]}]
            contact = [{on = ['bottom'], normal.exponential_damper = {limit = 6000.0, velocity = 0.05}}]
            time = {end = 0.2, step = 0.01, scheme = 'implicit_euler'}
            [material]
            hypothesis = 'plane_strain'
            elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.45}",
        )
        .set("traction.0.value", &format!("[0.0, '{load}']"))
        .set("time.scheme", &format!("'{scheme}'"))
        .run_and_keep(1)
    };
    let pressed =
        |case: Case| case.results().table("resultants.csv").only("source", "contact bottom").last("force_y");
    let force = pressed(block("-5700", "implicit_euler"));
    assert!((force - 5700.0).abs() < 1e-5, "{force} N");
    for scheme in ["implicit_euler", "bdf2"] {
        let force = pressed(block("-2000*sin(20*t)^2", scheme));
        assert!((force - 2000.0 * 4f64.sin().powi(2)).abs() < 1e-5, "{scheme}: {force} N");
    }
}

#[test]
fn an_obstacle_that_a_graph_loses_under_midpoint_presses_no_more() {
    let block = |gap: &str| {
        Case::written_as(
            "
            mesh.rectangle = {size = [1.0, 1.0], cells = [4, 2]}
            support = [{on = ['bottom'], fix = 'all'}]
            contact = [{on = ['top'], normal.displacement_graph = {points = [[0.0, 0.0], [0.01, 1e5]], slope_after = 1e8}, redistribute_mass = true}]
            time = {end = 0.02, step = 0.001, scheme = 'midpoint'}
            [material]
            hypothesis = 'plane_strain'
            density = 1000.0
            elasticity = {youngs_modulus = 1e7, poisson_ratio = 0.3}",
        )
        .set("contact.0.normal.displacement_graph.gap", &format!("'{gap}'"))
        .run_and_keep(1)
    };
    for (gap, pressed, free) in [("if(t < 0.01, -0.001, inf)", 4, 19), ("if(t < 0.01, inf, -0.001)", 19, 4)] {
        let case = block(gap);
        let results = case.results();
        let forces = results.table("resultants.csv").only("source", "contact top").numbers("force_y");
        assert!(forces[pressed] < -100.0 && forces[free] == 0.0, "{gap}: {forces:?}");
        assert!(results.number("max_energy_imbalance") < 1e-9, "{gap}");
    }
}

#[test]
fn a_block_lands_on_a_jump_of_its_graph_under_midpoint_and_keeps_its_energy() {
    // After 62 steps the penetration is that of the jump, up to rounding errors.
    let case = Case::written_as(
        "
        mesh.rectangle = {size = [0.5, 0.5], cells = [2, 2], diagonal = 'crossed'}
        initial.velocity = [0.0, -0.05]
        solver.accept = ['uniqueness']
        time = {end = 0.2, step = 0.001, scheme = 'midpoint'}
        [material]
        hypothesis = 'plane_strain'
        density = 1000.0
        elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.2}
        [[contact]]
        on = ['bottom']
        normal.displacement_graph = {points = [[0, 0], [1e-4, 0], [1e-4, 2e3], [1e-3, 4e3]], slope_after = 1e7}
        obstacle.plane = {point = [0.0, -0.003], normal = [0.0, 1.0]}
        redistribute_mass = true",
    );
    let results = case.run(1);
    assert!(results.table("history.csv").numbers("contact_energy").iter().any(|stored| *stored > 0.01));
    assert!(results.number("max_energy_imbalance") < 1e-10);
}

#[test]
fn a_beam_is_lifted_from_its_plane_in_one_step_node_by_node() {
    let case = Case::written_as(
        "
        mesh = {order = 2, rectangle = {size = [2.0, 0.02], cells = [100, 2]}}
        body_force = [{value = [0.0, -7700.85]}]
        contact = [{on = ['bottom'], normal.unilateral = {}}]
        time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}
        support = [{on = ['left'], fix = ['x']}, {on = ['right'], where = 'abs(y - 0.01) < 1e-6', fix = ['y'], displacement = ['0.002*t']}]
        [material]
        hypothesis = 'plane_stress'
        elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.3}",
    );
    let results = case.run(1);
    // P = 1/2 (24 E I h q^3)^(1/4) of a slender beam with the weight q per length that is lifted by h.
    let (stiffness, weight): (f64, f64) = (1e9 * 0.02f64.powi(3) / 12.0, 7700.85 * 0.02);
    let exact = 0.5 * (24.0 * stiffness * 0.002 * weight.powi(3)).powf(0.25);
    let lifting = results.table("resultants.csv").only("source", "support right").last("force_y");
    assert!((lifting / exact - 1.0).abs() < 1e-3, "{lifting} N for {exact} N");
}

#[test]
fn a_block_that_nothing_holds_falls_on_a_plane_under_any_load() {
    // The load alone decides whether springs in place of contact let it fall as far as the plane.
    for (modulus, pressure) in [("1e8", "1.0"), ("2e11", "6e3"), ("1e5", "1e-4"), ("1e7", "1.0")] {
        for law in ["{unilateral = {}}", "{compliance = {stiffness = 1e9}}"] {
            let case = Case::written_as(
                "
                mesh.rectangle = {size = [1.0, 0.5], cells = [4, 2]}
                support = [{on = ['top'], fix = ['x']}]
                traction = [{on = ['top'], pressure = 1.0}]
                time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}
                contact = [{on = ['bottom'], normal = {}, obstacle.plane = {point = [0.0, -1e-4], normal = [0, 1]}}]
                [material]
                hypothesis = 'plane_strain'
                elasticity = {youngs_modulus = 1e8, poisson_ratio = 0.3}",
            )
            .set("material.elasticity.youngs_modulus", modulus)
            .set("traction.0.pressure", pressure)
            .set("contact.0.normal", law);
            let load: f64 = pressure.parse().expect("a number");
            assert_carries(&case, load, &format!("{modulus}, {law}"));
        }
    }
}

/// Checks that contact carries a load in N.
fn assert_carries(case: &Case, load: f64, name: &str) {
    let force = case.run(1).table("resultants.csv").only("source", "contact bottom").last("force_y");
    assert!((force / load - 1.0).abs() < 1e-4, "{name}: {force} N for {load}");
}

#[test]
fn a_block_under_large_stresses_falls_on_a_plane_under_a_small_load() {
    // Rounding errors of forces that cancel hide that nothing holds the body above the gap.
    let case = |order: &str| {
        Case::written_as(
            "
            mesh.rectangle = {corner = [0.5, 0.0], size = [1.0, 0.5], cells = [2, 2], diagonal = 'crossed'}
            support = [{on = ['top'], fix = ['x']}]
            traction = [{on = ['top'], value = [0.0, -504.0]}, {on = ['left', 'right'], pressure = 0.0}]
            time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}
            contact = [{on = ['bottom'], normal.unilateral.gap = 1e-4, friction.coulomb.coefficient = 0.1}]
            [material]
            elasticity = {youngs_modulus = 1e8, poisson_ratio = 0.3}",
        )
        .set("mesh.order", order)
    };
    for order in ["1", "2"] {
        let plane = || case(order).set("material.hypothesis", "'plane_strain'");
        let pulled = plane().set("initial.stress.xx", "-5e4");
        assert_carries(&pulled, 504.0, &format!("initial stress, order {order}"));
        let squeezed = plane().set("traction.1.pressure", "5e4");
        assert_carries(&squeezed, 504.0, &format!("pressure at the sides, order {order}"));
        let whole_turn = 504.0 * std::f64::consts::PI * (1.5f64.powi(2) - 0.25);
        let ring = case(order).set("material.hypothesis", "'axisymmetric'").without("contact.0.friction");
        let ring = ring.set("material.elasticity.youngs_modulus", "2e11");
        let ring = ring.set("initial.stress", "{xx = -5e4, yy = -2e4}");
        assert_carries(&ring, whole_turn, &format!("axisymmetric, order {order}"));
    }
    // Newton's method strays to a flight, and solves the step from where the law bears the load.
    let graph = "{displacement_graph = {points = [[0.0, 0.0], [0.001, 1.2e5], [0.002, 2e5]], slope_after = 2e8, gap = 4e-3}}";
    let strays = case("1")
        .set("material.hypothesis", "'axisymmetric'")
        .set("material.elasticity.poisson_ratio", "0.49")
        .set("support", "[{on = ['top'], fix = ['x']}, {on = ['left'], stiffness.normal = 3e7}]")
        .set("traction.0.value", "[302.4, -504.0]")
        .set("initial.stress.yy", "-2e4")
        .set("contact.0.normal", graph)
        .set("contact.0.friction.coulomb.coefficient", "0.0")
        .set("time", "{end = 1.5625e-4, step = 1.5625e-4, scheme = 'implicit_euler'}");
    let whole_turn = 504.0 * std::f64::consts::PI * (1.5f64.powi(2) - 0.25);
    assert_carries(&strays, whole_turn, "a graph that begins beyond the gap");
}

/// An obstacle that a force presses on a block without supports and inertia: nothing but the obstacle pushes it against its foundation.
#[test]
fn a_force_presses_an_obstacle_on_a_block_that_contact_alone_holds() {
    let work = |law: &str| {
        let job = format!(
            "[mesh.rectangle]\nsize = [1.0, 0.4]\ncells = [4, 2]\n\
             [material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 1e4, poisson_ratio = 0.3 }}\n\
             [[contact]]\non = [\"top\"]\nnormal.unilateral = {{}}\n\
             obstacle.sphere = {{ centre = [0.5, 1.0], radius = 0.6 }}\n\
             obstacle_load = {{ direction = [0, -1], force = \"100*t\" }}\n\
             [[contact]]\non = [\"bottom\"]\nfriction.coulomb.coefficient = 0.3\n{law}\n\
             [time]\nend = 1.0\nstep = 0.5\nscheme = \"implicit_euler\"\n"
        );
        let case = Case::written_as(&job).run_and_keep(1);
        let history = case.results().table("history.csv");
        assert!(history.numbers("energy_imbalance").iter().all(|share| *share <= 1e-8), "{law}");
        *history.numbers("obstacle_work").last().expect("a step")
    };
    let found = work("normal.compliance = { stiffness = 1e5 }");
    let expected = work("normal.displacement_graph = { points = [[0.0, 0.0]], slope_after = 1e5 }");
    assert!((found - expected).abs() <= 1e-8 * expected, "{found} and {expected} J");
    assert!(
        work("normal.unilateral = {}") < 0.9 * expected,
        "a foundation that does not yield takes up no work"
    );
}

#[test]
fn a_law_that_falls_somewhere_holds_a_body_where_it_bears_the_loads() {
    // 1000 Pa press the body through the drop from 500 to 400 Pa at 1 mm to 2.6 mm, where the law bears them.
    let job = "[mesh.rectangle]\nsize = [1, 0.5]\ncells = [4, 2]\n\
        [material]\nhypothesis = 'plane_strain'\nelasticity = { youngs_modulus = 1e6, poisson_ratio = 0.3 }\n\
        [[support]]\non = ['left']\nfix = ['x']\n[[traction]]\non = ['top']\nvalue = [0, '-1000*t']\n\
        [[contact]]\non = ['bottom']\nnormal.displacement_graph = { points = [[0, 0], [1e-3, 500], [2e-3, 400]], slope_after = 1e6 }\n\
        [time]\nscheme = 'implicit_euler'\nend = 1\nstep = 0.1\n[[output.probe]]\nname = 'foot'\npoint = [1, 0]\n";
    Case::written_as(job).run_with(1, &[]).expect(2).says("may have several solutions");
    let case = Case::written_as(job).set("solver.accept", "['uniqueness']");
    let results = case.run(1);
    let foot = results.table("probes.csv").last("displacement_y");
    assert!((foot + 2.6e-3).abs() < 1e-8, "{foot}");
    assert!(results.number("max_energy_imbalance") < 1e-9);
}

/// A block whose right side supports move into the foundation, slowly and by rounding errors too: with every law the node at the corner
/// belongs to no part of the area.
#[test]
fn nodes_that_supports_hold_count_neither_as_touching_nor_as_open() {
    for (normal, depth) in [
        ("{ compliance = { stiffness = 1e8 } }", 1e-3),
        ("{ compliance = { stiffness = 1e8 } }", 1e-18),
        ("{ exponential_damper = { limit = 1e4, velocity = 1e-2 } }", 1e-3),
    ] {
        let case = Case::written_as(&format!(
            "[mesh.rectangle]\nsize = [1, 0.5]\ncells = [4, 2]\n\
             [material]\nhypothesis = 'plane_strain'\nelasticity = {{ youngs_modulus = 1e7, poisson_ratio = 0.3 }}\n\
             viscosity = {{ volumetric = 1e5, shear = 1e5 }}\n\
             [[support]]\non = ['right']\nfix = 'all'\nvelocity = [0, {}]\n\
             [[traction]]\non = ['top']\nvalue = [0, -2e4]\n\
             [[contact]]\non = ['bottom']\nnormal = {normal}\n\
             [time]\nend = 0.1\nstep = 0.05\nscheme = 'implicit_euler'\n",
            -10.0 * depth
        ));
        let contact = case.run_and_keep(1).results().table("resultants.csv").only("source", "contact bottom");
        let areas = ["touching_area", "open_area"].map(|column| contact.last(column));
        assert!((areas[0] + areas[1] - 0.875).abs() < 1e-12, "{normal}, {depth} m: {areas:?}");
    }
}

/// The shape functions at corners of quadratic cells have no share of the mass, which yet holds a body that only contact supports.
#[test]
fn a_body_of_quadratic_cells_with_mass_on_a_plane_is_solved_to_the_tolerance() {
    let case = Case::written_as(
        "
        mesh = {rectangle = {size = [0.4, 0.2], cells = [4, 2]}, order = 2}
        traction = [{on = ['top'], value = [0.0, '-3e4*x']}]
        contact = [{on = ['bottom'], normal.unilateral = {}}]
        time = {end = 0.2, step = 0.02, scheme = 'implicit_euler'}
        [material]
        hypothesis = 'plane_strain'
        density = 500
        elasticity = {youngs_modulus = 1.1e6, poisson_ratio = 0.3}
        damage = {threshold = 4, viscosity = 0.24, largest = 0.95}",
    );
    let residual = case.run(2).number("max_residual");
    assert!(residual < 1e-9, "{residual:e}");
}

/// Two blocks without friction, side by side on a plate, of which one or none is held along it.
const SIDE_BY_SIDE: &str = "
    time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}
    [mesh]
    rectangle = [
        {name = 'low', size = [2.0, 0.5], cells = [6, 2]},
        {name = 'a', corner = [0.0, 0.5], size = [0.8, 0.5], cells = [4, 2]},
        {name = 'b', corner = [0.8, 0.5], size = [1.2, 0.5], cells = [5, 3]},
    ]
    [material]
    hypothesis = 'plane_strain'
    elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.0}
    [[support]]
    on = ['low.bottom']
    fix = 'all'
    [[traction]]
    on = ['a.top', 'b.top']
    value = [0.0, -1000.0]
    [[contact]]
    on = ['a.bottom', 'b.bottom']
    against = ['low.top']
    normal.unilateral = {}
    [[contact]]
    on = ['a.right']
    against = ['b.left']
    normal.unilateral = {}";

#[test]
fn bodies_that_touch_are_named_where_nothing_holds_them_together() {
    for ranks in [1, 2] {
        Case::written_as(SIDE_BY_SIDE)
            .run_with(ranks, &[])
            .expect(2)
            .says("nothing prevents these rigid motions: body 2 (around (0.4, 0.75)) and body 3 (around (1.4, 0.75)) together: translation along x");
    }
    // As the message says: a support, or inertia.
    let held = "[{on = ['low.bottom'], fix = 'all'}, {on = ['a.left'], fix = ['x']}]";
    Case::written_as(SIDE_BY_SIDE).set("support", held).run(1);
    let told = Case::written_as(SIDE_BY_SIDE).set("material.density", "1.0").run_with(1, &[]).expect(0);
    assert!(!told.stdout.contains("bodies touch"), "there are contacts between them");
}

#[test]
fn parts_of_contacts_that_facets_do_not_follow_are_warned_of() {
    let part = |place: &str| {
        Case::written_as(BONDED).set("contact.0.where", &format!("'x < {place}'")).run_with(1, &[]).expect(0)
    };
    part("0.052").says("contact.0.where: the condition changes within 1 facet (0.005 m) of bottom");
    assert!(!part("0.05").stdout.contains("changes within"), "between two facets");
}

/// A strip that yields is peeled off a plane: bonds hold it, and its cells resist less than elastic ones.
const PEELED: &str = "
    mesh = {order = 2, rectangle = {size = [0.2, 0.01], cells = [20, 1]}}
    time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}
    [material]
    hypothesis = 'plane_stress'
    elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.0}
    viscoplasticity.perzyna = {relaxation = 1e-3, yield_stress = 1e6}
    [[support]]
    on = ['right']
    where = 'hypot(x - 0.2, y - 0.01) < 1e-9'
    fix = ['y']
    displacement = ['5e-4*t']
    [[support]]
    on = ['left']
    fix = ['x']
    [[contact]]
    on = ['bottom']
    where = 'x < 0.15'
    normal.unilateral = {}
    adhesion = {stiffness = 1e11, energy = 10.0, strength = 2e5}";

#[test]
fn bonds_hold_a_strip_whose_cells_yield() {
    let force = |step: &str| {
        let case = Case::written_as(PEELED).set("time.step", step);
        case.run(1).table("resultants.csv").only("source", "support right").last("force_y")
    };
    // Nothing gives way any more after cells and bonds beyond the tip have, however the step is divided.
    let [whole, quarters] = ["1.0", "0.25"].map(force);
    assert!((whole / quarters - 1.0).abs() < 1e-7 && (whole - 472.6).abs() < 0.1, "{whole} {quarters} N");
}

/// A block that is pulled off its bonds all at once.
const PULLED_OFF: &str = "
    mesh.rectangle = {size = [0.2, 0.05], cells = [4, 1]}
    time = {end = 1.0, step = 0.5, scheme = 'implicit_euler'}
    [material]
    hypothesis = 'plane_stress'
    elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.0}
    [[support]]
    on = ['top']
    fix = ['y']
    displacement = ['1e-3*t']
    [[support]]
    on = ['left']
    fix = ['x']
    [[contact]]
    on = ['bottom']
    normal.unilateral = {}
    adhesion = {stiffness = 1e11, energy = 10.0, strength = 2e5}";

#[test]
fn a_step_that_would_generate_the_energy_of_breaking_bonds_is_divided() {
    for (ranks, adaptive) in [(1, false), (2, false), (1, true)] {
        let case = Case::written_as(PULLED_OFF);
        let case = match adaptive {
            true => case.set("time.adaptive", "{smallest_step = 1e-4, largest_step = 0.5, tolerance = 0.5}"),
            false => case,
        };
        let kept = case
            .set("checkpoint", "{every = 1, keep = 100}")
            .set("output.fields", "{every = 1}")
            .run_and_keep(ranks);
        let results = kept.results();
        let history = results.table("history.csv");
        // 0.2 m^2 of bonds, all of which break in the first step, which does no work as a whole.
        let [work, dissipated] = ["external_work", "adhesion_dissipation"].map(|column| history.last(column));
        assert!(
            (dissipated - 2.0).abs() < 1e-9 && (work / dissipated - 1.0).abs() < 0.2,
            "{work} of {dissipated} J/m"
        );
        if adaptive {
            continue;
        }
        let fields = NumberFile::open(&results.path("fields.vtkhdf"));
        assert_eq!(fields.times(), [0.0, 0.5, 1.0], "the whole steps end where they would");
        // Within the step that is divided.
        let from = results.path("checkpoint-2.h5");
        let straight = results.text("history.csv");
        kept.run_with(ranks, &["--restart", from.to_str().expect("a path")]).expect(0);
        assert_eq!(straight, kept.results().text("history.csv"), "restarted on {ranks} ranks");
    }
}

/// A massless layer on a law that jumps and falls.
const FALLING: &str = "
    mesh.rectangle = {size = [1.0, 0.5], cells = [1, 1]}
    time = {end = 0.01, step = 0.01, scheme = 'lagged_euler'}
    solver = {accept = ['uniqueness'], guesses = 0}
    output.profile = [{on = 'bottom'}]
    [material]
    hypothesis = 'plane_strain'
    viscosity = {volumetric = 0.0, shear = 50.0}
    [[support]]
    on = ['left', 'right']
    fix = ['x']
    [[support]]
    on = ['top']
    fix = ['y']
    velocity = [-0.32]
    [[contact]]
    on = ['bottom']
    normal.graph = {points = [[0.0, -10.0], [0.0, 30.0], [0.2, -20.0], [0.2, 25.0], [0.4, 0.0]], slope_before = 50, slope_after = 0}";

#[test]
fn a_layer_whose_only_equilibrium_is_on_a_jump_of_a_falling_law_finds_it() {
    for speed in ["0.32", "0.35"] {
        let case = Case::written_as(FALLING).set("support.1.velocity", &format!("[-{speed}]"));
        let results = case.run(1);
        let [velocities, pressures] =
            ["normal_velocity", "contact_pressure"].map(|name| results.table("profiles.csv").numbers(name));
        let known = 100.0 * (speed.parse::<f64>().expect("number") - 0.2);
        assert!(velocities.iter().all(|v| (v - 0.2).abs() < 1e-12), "{velocities:?}");
        assert!(pressures.iter().all(|p| (p - known).abs() < 1e-8), "{pressures:?} Pa");
    }
}

/// On a bar of 1e5 Pa/m the falling part of the graph, -2e5 Pa/m, has equilibria that are maxima of the energy.
#[test]
fn steps_do_not_end_at_unstable_equilibria_of_a_graph_that_falls() {
    for scheme in ["implicit_euler", "bdf2"] {
        let case = Case::written_as(
            "
            mesh.rectangle = {size = [1.0, 1.0], cells = [1, 1]}
            support = [{on = ['top'], fix = 'all', displacement = [0.0, '-0.012*sin(2*pi*t)']}]
            time = {end = 1.0, step = 0.005}
            output.probe = [{name = 'foot', point = [0.5, 0.0]}]
            solver.accept = ['uniqueness']
            [material]
            hypothesis = 'plane_strain'
            elasticity = {youngs_modulus = 1e5, poisson_ratio = 0.0}
            [[contact]]
            on = ['bottom']
            [contact.normal.displacement_graph]
            points = [[-0.003, 0], [-0.001, -500], [0, 0], [0.001, 100], [0.001, 300], [0.002, 300], [0.003, 100], [0.004, 400]]
            slope_after = 1e5",
        )
        .set("time.scheme", &format!("'{scheme}'"));
        let results = case.run(1);
        let foot = results.table("probes.csv").numbers("displacement_y");
        let times = results.table("probes.csv").numbers("time");
        // The pressure of 300 Pa where the graph is flat, until it falls.
        for (time, displacement) in times.iter().zip(&foot).filter(|(time, _)| (0.058..0.068).contains(*time))
        {
            let expected = 3e-3 - 0.012 * (std::f64::consts::TAU * time).sin();
            assert!(
                (displacement - expected).abs() < 1e-9,
                "{scheme}, {time} s: {displacement} for {expected}"
            );
        }
        let history = results.table("history.csv").numbers("numerical_dissipation");
        let gained = history.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::min);
        assert!(scheme == "bdf2" || gained > -1e-9, "a step of Euler's scheme generated {gained} J");
    }
}
