//! Friction: closed forms of blocks that slide, stop and stick, and the output of a job with friction.

use crate::{
    case::Case,
    hdf5_file::NumberFile,
    launch,
    results::{Results, Table, assert_same_answer, relative_difference},
};

const GRAVITY: f64 = 9.81;

fn centre(results: &Results) -> Table {
    results.table("probes.csv").only("probe", "centre")
}

#[test]
fn a_block_slides_to_a_stop_after_the_distance_and_time_of_a_mass_point_and_stays() {
    let deceleration = 0.5 * GRAVITY;
    let (distance, time) = (0.5 / deceleration, 1.0 / deceleration);
    let mut misses = Vec::new();
    for step in [0.002, 0.001] {
        let probes = "[{name = 'centre', point = [0.2, 0.05]}, {name = 'foot', point = [0.2, 0]}]";
        let case = Case::of("sliding_block").set("time.step", &step.to_string()).set("output.probe", probes);
        let results = case.run(1);
        let foot = results.table("probes.csv").only("probe", "foot");
        let (times, velocities) = (foot.numbers("time"), foot.numbers("velocity_x"));
        for (t, v) in times.iter().zip(velocities) {
            if *t > time + step {
                assert!(v.abs() < 1e-15, "its foot moves with {v} m/s at {t} s");
            }
            if *t < time - step {
                assert!((v - (1.0 - deceleration * t)).abs() < 1e-3, "{v} m/s at {t} s");
            }
        }
        let rest = centre(&results).last("velocity_x");
        assert!(rest.abs() < 1e-7, "it creeps with {rest} m/s");
        misses.push(distance - centre(&results).last("displacement_x"));
        assert!(results.number("max_energy_imbalance") < 1e-10);
        let dissipated = results.table("history.csv").last("contact_dissipation");
        assert!(
            (dissipated / 20.0 - 1.0).abs() < 0.01,
            "{dissipated} J of kinetic energy went into friction"
        );
    }
    assert!((misses[0] - 0.001).abs() < 2e-4 && (misses[1] - 0.0005).abs() < 1e-4, "first order: {misses:?}");
}

#[test]
fn a_pushed_block_sticks_just_below_the_bound_and_speeds_up_just_above() {
    let bound = 0.5 * GRAVITY * 1000.0;
    let pushed = |share: f64| {
        Case::of("sliding_block")
            .set("initial.velocity", "[0, 0]")
            .set("body_force", &format!("[{{ value = [{}, {}] }}]", share * bound, -1000.0 * GRAVITY))
            .run_and_keep(1)
    };
    let below = centre(&pushed(0.98).results()).last("velocity_x");
    assert!(below.abs() < 2e-4, "{below}");
    let (above, expected) = (centre(&pushed(1.02).results()).last("velocity_x"), 0.02 * 0.5 * GRAVITY * 0.25);
    assert!((above / expected - 1.0).abs() < 0.02, "{above} instead of {expected}");
}

#[test]
fn friction_keeps_the_direction_of_sliding_in_space() {
    let probes = centre(&Case::of("oblique_sliding").run(2));
    for (time, (x, y)) in probes
        .numbers("time")
        .iter()
        .zip(probes.numbers("velocity_x").iter().zip(probes.numbers("velocity_y")))
    {
        let expected = 0.5 - 0.2 * time;
        assert!(
            (x - 0.8 * expected).abs() < 1e-4 && (y - 0.6 * expected).abs() < 1e-4,
            "{x} {y} at {time} s"
        );
    }
}

#[test]
fn friction_gives_the_same_answer_on_any_number_of_ranks() {
    let jobs = ["sliding_block", "oblique_sliding", "velocity_weakening_block", "conveyor_belt"];
    for (job, end) in jobs.into_iter().zip(["0.21", "0.5", "2.8", "0.21"]) {
        let make = || Case::of(job).set("time.end", end).set("solver.tolerance", "1e-11");
        let alone = make().run_and_keep(1);
        for ranks in [2, 3] {
            let other = make().run_and_keep(ranks);
            let what = format!("{job} on {ranks} ranks");
            assert_same_answer(&alone.results(), &other.results(), 1e-7, &what);
        }
    }
}

#[test]
fn the_fixed_point_finds_what_newtons_method_finds() {
    for (job, end) in [("sliding_block", "0.21"), ("velocity_weakening_block", "2.8")] {
        let make = || Case::of(job).set("time.end", end);
        let newton = make().run_and_keep(1);
        let fixed = make().set("solver.friction", "'fixed_point'").run_and_keep(1);
        assert_same_answer(&newton.results(), &fixed.results(), 1e-6, job);
        assert!(fixed.results().number("newton_iterations") > newton.results().number("newton_iterations"));
    }
}

#[test]
fn a_job_with_friction_says_so_and_one_without_has_nothing_of_it() {
    let with = Case::of("oblique_sliding").set("time.end", "0.1").run_and_keep(1);
    let without =
        Case::of("oblique_sliding").set("time.end", "0.1").without("contact.0.friction").run_and_keep(1);
    let (a, b) = (with.results(), without.results());
    let effects =
        |r: &Results| r.summary()["effects"].as_array().expect("a list").contains(&"friction".into());
    assert!(effects(&a) && !effects(&b));
    assert_eq!(a.summary()["inventory"]["friction_points"], 20);
    assert_eq!(b.summary()["inventory"]["friction_points"], 0);
    let columns = a.table("profiles.csv").columns;
    assert_eq!(
        columns[6..],
        [
            "normal_velocity",
            "contact_pressure",
            "gap",
            "friction_traction_x",
            "friction_traction_y",
            "friction_traction_z",
            "sliding_velocity_x",
            "sliding_velocity_y",
            "sliding_velocity_z",
            "tangential_displacement_x",
            "tangential_displacement_y",
            "tangential_displacement_z"
        ]
    );
    assert_eq!(b.table("profiles.csv").columns.len(), 12);
    let size = |r: &Results, c: &str| r.table("profiles.csv").last(c);
    assert!((size(&a, "friction_traction_x").hypot(size(&a, "friction_traction_y")) - 20.0).abs() < 1e-6);
    assert!(a.text("run.log").contains(", 20 slip  ") && !b.text("run.log").contains(" slip"));
    assert!(b.table("history.csv").last("contact_dissipation").abs() < 1e-9);
}

#[test]
fn friction_that_can_not_be_right_is_refused_in_words() {
    let block = || Case::of("sliding_block");
    let held = |on: &str, fix: &str| block().set("support", &format!("[{{ on = ['{on}'], fix = {fix} }}]"));
    held("left", "['y']").run_with(1, &[]).expect(2).says("a support fixes the normal component there");
    held("left", "'all'").set("time.end", "0.002").run(1);
}

/// A brick is pushed into the edge between a floor and a wall, and along it: both rub, with a given bound. Along the edge itself only
/// the floor or the wall does: that with the larger part of its nodes.
#[test]
fn two_boundaries_with_friction_meet_at_an_edge() {
    let make = || {
        Case::of("oblique_sliding")
            .set("contact.0.on", "['bottom', 'left']")
            .set("body_force.0.value", "[-1000.0, 0.0, -1000.0]")
            .set("initial.velocity", "[0.0, 0.5, 0.0]")
            .set("time.end", "0.2")
    };
    let alone = make().run_and_keep(1);
    for ranks in [2, 3] {
        let case = make().run_and_keep(ranks);
        assert_same_answer(&alone.results(), &case.results(), 1e-7, &format!("{ranks} ranks"));
    }
    let forces =
        alone.results().table("resultants.csv").only("source", "contact bottom+left").numbers("force_y");
    let force = forces[forces.len() - 1];
    // 20 Pa on 0.12 m^2 and 0.03 m^2; the nodes of the edge have 0.05 m of the floor and 0.025 m of the wall along 0.3 m.
    assert!((force + 20.0 * (0.12 + 0.03 - 0.025 * 0.3)).abs() < 1e-3, "{force} N");
    assert!(alone.results().number("max_energy_imbalance") < 1e-9);
}

#[test]
fn friction_and_another_contact_share_an_edge() {
    let channel = "[{ on = ['bottom'], normal.unilateral = {}, friction.tresca.bound = 20 }, \
                    { on = ['left', 'right'], normal.unilateral = { gap = 0 } }]";
    let case = Case::of("oblique_sliding")
        .set("contact", channel)
        .set("initial.velocity", "[0, 0.5, 0]")
        .set("output.profile", "[{ on = 'bottom' }]");
    let results = case.run(2);
    let found = centre(&results).last("velocity_y");
    assert!((found - 0.3).abs() < 1e-3, "{found}");
    let tractions = results.table("profiles.csv").numbers("friction_traction_y");
    assert!(relative_difference(&tractions[tractions.len() - 20..], &[20.0; 20]) < 0.01);
}

#[test]
fn a_belt_pulls_a_block_along_until_it_rides_and_a_restart_continues_to_the_last_bit() {
    let make = || Case::of("conveyor_belt").set("output.fields", "{ every = 10 }");
    let straight = make().run_and_keep(2);
    let rubbing = straight.results().table("profiles.csv");
    let columns = ["time", "contact_pressure", "friction_traction_x"].map(|name| rubbing.numbers(name));
    let [times, pressures, tractions] = &columns;
    let (mut slides, mut rides, mut carried) = (0, 0, [0.0; 2]);
    for ((time, pressure), traction) in times.iter().zip(pressures).zip(tractions) {
        if *time > 0.0 && *time < 0.2 {
            // -sigma_tau points in the sliding direction relative to the belt, which is backward.
            assert!((traction + 0.5 * pressure).abs() <= 1e-6 * pressure, "{traction} Pa at {time} s");
            slides += 1;
        } else if *time > 0.23 {
            // Its own weight spreads it, so that the friction on its two halves has opposite directions and a zero sum.
            carried[0] += traction;
            carried[1] += pressure;
            rides += 1;
        }
    }
    assert!(carried[0].abs() < 1e-3 * carried[1], "{carried:?}");
    assert!(slides > 100 && rides > 20, "{slides} rows of sliding, {rides} of riding");
    let stopped = make().set("checkpoint.every", "100");
    stopped.run_with(2, &["--set", "time.end=0.1"]).expect(0);
    stopped.run_with(2, &["--restart"]).expect(0).says("continuing from");
    for name in ["probes.csv", "history.csv", "profiles.csv"] {
        assert_eq!(straight.results().text(name), stopped.results().text(name), "{name}");
    }
}

#[test]
fn a_body_that_starts_inside_or_behind_its_obstacle_is_warned_of_on_any_number_of_ranks() {
    let check = |case: &Case, ranks: usize| {
        let job = case.written();
        launch::run(ranks, &["check", job.to_str().expect("a path")]).expect(0)
    };
    for ranks in [1, 2] {
        let wrong = Case::of("conveyor_belt").set("contact.0.obstacle.plane.normal", "[0, -1]");
        check(&wrong, ranks)
            .says("warning: contact.0: the body lies behind its obstacle")
            .says("reverse the plane's `normal`");
        let deep = Case::of("conveyor_belt").set("contact.0.obstacle.plane.point", "['t', 0.02]");
        check(&deep, ranks)
            .says("warning: contact.0: the boundary bottom starts up to 2.000e-2 m inside its obstacle, 5.0 % of the body's size");
        let right = check(&Case::of("conveyor_belt"), ranks).stdout;
        assert!(!right.contains("warning: contact"), "{right}");
    }
    let wrong =
        Case::of("conveyor_belt").set("contact.0.obstacle.plane.normal", "[0, -1]").set("time.end", "0.001");
    assert!(wrong.run(2).text("run.log").contains("warning: contact.0: the body lies behind its obstacle"));
}

/// The force per area in Pa of a spring of `stiffness` in Pa/m that a belt of `velocity` in m/s stretches through rate-and-state friction
/// with the parameters of the job `rate_and_state_belt` under 1 MPa, at `time`: the equations of the spring and of the state, by the
/// classical Runge-Kutta method.
fn spring_on_a_belt(slips: bool, stiffness: f64, velocity: f64, time: f64) -> f64 {
    let (pressure, reference, direct, evolution, distance, v0) = (1e6, 0.6, 0.01, 0.015, 1e-5, 1e-6);
    let rates = |[u, state]: [f64; 2]| {
        let strength = (reference + evolution * (v0 * state / distance).ln()) / direct;
        let sliding = 2.0 * v0 * (stiffness * u / (pressure * direct)).sinh() * (-strength).exp();
        let x = sliding * state / distance;
        let evolves = match slips {
            true if x > 0.0 => -x * x.ln(),
            true => 0.0,
            false => 1.0 - x,
        };
        [velocity - sliding, evolves]
    };
    let count = 200_000;
    let h = time / f64::from(count);
    let mut at = [0.0, distance / v0];
    for _ in 0..count {
        let moved = |rate: [f64; 2], share: f64| [0, 1].map(|i| at[i] + share * h * rate[i]);
        let first = rates(at);
        let second = rates(moved(first, 0.5));
        let third = rates(moved(second, 0.5));
        let fourth = rates(moved(third, 1.0));
        at = [0, 1].map(|i| at[i] + h / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]));
    }
    stiffness * at[0]
}

#[test]
fn a_block_on_a_spring_follows_the_equations_of_rate_and_state_friction() {
    for (law, slips) in [("ageing", false), ("slip", true)] {
        // Before the spring carries the friction of steady sliding, at its peak, and while the state evolves.
        for time in [4.0, 6.4, 8.0] {
            let exact = 0.2 * spring_on_a_belt(slips, 1e10, 1e-5, time);
            let errors_of = |scheme: &str| {
                [0.04, 0.02].map(|step| {
                    let case = Case::of("rate_and_state_belt")
                        .set("contact.0.obstacle.plane.point", "['1e-5*t', 0.0]")
                        .set("contact.0.friction.rate_and_state.law", &format!("'{law}'"))
                        .set("support", "[{ on = ['top'], stiffness = { tangential = 1e10 } }]")
                        .set("time.scheme", &format!("'{scheme}'"))
                        .set("time.step", &step.to_string())
                        .set("time.end", &time.to_string());
                    let force =
                        case.run(2).table("resultants.csv").only("source", "contact bottom").last("force_x");
                    (force - exact) / exact
                })
            };
            for (scheme, ratio, off) in [("implicit_euler", 0.5, 0.2), ("bdf2", 0.25, 0.3)] {
                let errors = errors_of(scheme);
                assert!(
                    errors.iter().all(|error| error.abs() < 0.01),
                    "{scheme}, {law} at {time} s: {errors:?}"
                );
                let converges = (errors[1] / errors[0] / ratio - 1.0).abs() < off;
                assert!(
                    converges || errors[0].abs() < 1e-4 * ratio,
                    "{scheme}, {law} at {time} s: {errors:?}"
                );
            }
        }
    }
}

/// The way of a block of mass `m` per area that starts with the velocity `v` under friction that weakens linearly with the slip from
/// `m b` to zero over `distance`, after `time`: `u'' = (b / distance) (u - distance)`.
fn weakened_way(velocity: f64, b: f64, distance: f64, time: f64) -> f64 {
    let rate = (b / distance).sqrt();
    distance - distance * (rate * time).cosh() + velocity / rate * (rate * time).sinh()
}

#[test]
fn a_block_slides_as_far_as_weakening_with_the_distance_lets_it_with_the_order_of_the_scheme() {
    // 100 kg/m² under 2 kPa: mu p / m falls from 12 m/s² over 0.5 m.
    let exact = weakened_way(1.5, 12.0, 0.5, 0.12);
    for (scheme, order) in [("implicit_euler", 1.0), ("bdf2", 2.0), ("midpoint", 2.0)] {
        let errors = [0.01, 0.005].map(|step| {
            let weakening = "{ static = 0.6, dynamic = 0.0, distance = 0.5 }";
            let case = Case::of("distance_weakening_block")
                .without("body_force")
                .without("material.viscosity")
                .set("material.elasticity", "{ youngs_modulus = 1e8, poisson_ratio = 0.0 }")
                .set("support", "[{ on = ['top'], fix = ['y'] }]")
                .set("contact.0.normal", "{ graph = { points = [[-1.0, 2000.0], [1.0, 2000.0]] } }")
                .set("contact.0.friction", &format!("{{ distance_weakening = {weakening} }}"))
                .set("contact.0.redistribute_mass", if scheme == "midpoint" { "true" } else { "false" })
                .set("initial.velocity", "[1.5, 0]")
                .set("time.scheme", &format!("'{scheme}'"))
                .set("time.step", &step.to_string())
                .set("time.end", "0.12");
            let results = case.run(1);
            assert!(results.number("max_energy_imbalance") < 1e-9, "{scheme}");
            centre(&results).last("displacement_x") - exact
        });
        let observed = (errors[0] / errors[1]).abs().log2();
        assert!((observed - order).abs() < 0.3, "{scheme}: {errors:?} of {exact} m");
    }
}

/// The friction coefficients after 15 s of a block under 4 MPa on a spring of 1.5 GPa/m and a dashpot of 0.5 MPa s/m that a belt of 10 um/s
/// drags through rate-and-state friction (`direct` 0.01, `evolution` 0.015, `distance` 10 um), by the classical Runge-Kutta method. It starts
/// at the friction of steady sliding with the state of twice its age.
fn stick_slip(end: f64) -> Vec<f64> {
    let (stiffness, damping, pressure, belt, distance) = (1.5e9, 5e5, 4e6, 1e-5, 1e-5);
    let coefficient = |sliding: f64, state: f64| {
        let strength = (0.6 + 0.015 * (belt * state / distance).ln()) / 0.01;
        0.01 * (0.5 * sliding / belt * strength.exp()).asinh()
    };
    let sliding = |[u, state]: [f64; 2]| {
        let (mut low, mut high) = (-60f64, 0f64);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let v = middle.exp();
            let open = pressure * coefficient(v, state) - stiffness * u - damping * (belt - v);
            *(if open > 0.0 { &mut high } else { &mut low }) = middle;
        }
        (0.5 * (low + high)).exp()
    };
    let (mut at, mut time, mut found) =
        ([0.6 * pressure / stiffness, 2.0 * distance / belt], 0.0, Vec::new());
    while time < end {
        let now = sliding(at);
        if time > 15.0 {
            found.push(coefficient(now, at[1]));
        }
        let h = f64::min(0.01, 0.02 * distance / now);
        let rates = |at: [f64; 2]| {
            let v = sliding(at);
            [belt - v, 1.0 - v * at[1] / distance]
        };
        let moved = |rate: [f64; 2], share: f64| [0, 1].map(|i| at[i] + share * h * rate[i]);
        let first = rates(at);
        let second = rates(moved(first, 0.5));
        let third = rates(moved(second, 0.5));
        let fourth = rates(moved(third, 1.0));
        at = [0, 1].map(|i| at[i] + h / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]));
        time += h;
    }
    found
}

#[test]
fn adaptive_steps_of_the_default_tolerance_follow_stick_slip() {
    let range = |values: &[f64]| {
        values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)])
    };
    let expected = range(&stick_slip(40.0));
    let case = Case::of("rate_and_state_belt")
        .set("mesh.rectangle.cells", "[4, 1]")
        .set("contact.0.obstacle.plane.point", "['1e-5*t', 0.0]")
        .set("contact.0.friction.rate_and_state.velocity", "1e-5")
        .set("contact.0.friction.rate_and_state.initial_state", "2.0")
        .set(
            "support",
            "[{ on = ['top'], stiffness = { tangential = 1.5e9 }, damping = { tangential = 5e5 } }]",
        )
        .set("traction", "[{ on = ['top'], value = [0.0, -4e6] }]")
        .set("initial.displacement", "[1.6e-3, 0.0]")
        .set("time.step", "0.01")
        .set("time.end", "40.0")
        .set("time.adaptive", "{ smallest_step = 1e-6, largest_step = 0.5 }");
    let results = case.run(1);
    let table = results.table("resultants.csv").only("source", "contact bottom");
    let late =
        table.numbers("time").into_iter().zip(table.numbers("force_x")).filter(|(time, _)| *time > 15.0);
    let found = range(&late.map(|(_, force)| force / (0.2 * 4e6)).collect::<Vec<_>>());
    let size = expected[1] - expected[0];
    for (found, expected) in found.into_iter().zip(expected) {
        assert!((found - expected).abs() < 0.02 * size, "{found} instead of {expected} in a range of {size}");
    }
}

#[test]
fn the_state_of_friction_follows_a_varying_velocity_with_the_second_order_of_the_schemes() {
    for scheme in ["bdf2", "midpoint"] {
        let displacement = |steps: u32| {
            let case = Case::of("sliding_block")
                .set("mesh", "{ rectangle = { size = [0.1, 0.02], cells = [4, 2] } }")
                .set(
                    "material",
                    "{ hypothesis = 'plane_strain', elasticity = { youngs_modulus = 1e6, poisson_ratio = 0.0 }, \
                     viscosity = { volumetric = 300.0, shear = 300.0 } }",
                )
                .without("initial")
                .without("body_force")
                .set("support", "[{ on = ['top'], fix = 'all' }]")
                .set(
                    "contact",
                    "[{ on = ['bottom'], normal.unilateral = {}, friction.rate_and_state = { reference = 0.6, \
                     velocity = 0.5, direct = 0.02, evolution = 0.1, distance = 0.3 }, obstacle.plane = { \
                     point = ['0.5*t + 0.05*sin(5*t)', '4e-6*(1 - cos(3*t))'], normal = [0, 1] } }]",
                )
                .set("output.probe", "[{ name = 'centre', point = [0.05, 0] }]")
                .set("time", &format!("{{ scheme = '{scheme}', end = 1.0, step = {} }}", 1.0 / f64::from(steps)));
            let case = if scheme == "midpoint" {
                case.set("material.density", "1000.0").set("contact.0.redistribute_mass", "true")
            } else {
                case
            };
            centre(&case.run(1)).last("displacement_x")
        };
        let [long, middle, short] = [100, 200, 400].map(displacement);
        let order = ((long - middle) / (middle - short)).abs().log2();
        assert!((order - 2.0).abs() < 0.3, "{scheme}: {order}, {long} {middle} {short} m");
    }
}

/// A brick under 1000 Pa, 120 N in total, on a plane. It is one cell wide, and its sides are held in these directions.
/// Coulomb's coefficient is 0.5.
fn held_brick(fix: &str) -> Case {
    Case::of("oblique_sliding")
        .without("material.density")
        .without("material.viscosity")
        .without("initial")
        .without("body_force")
        .set("material.elasticity", "{ youngs_modulus = 1e8, poisson_ratio = 0.2 }")
        .set("mesh.box.cells", "[1, 3, 2]")
        .set("support", &format!("[{{ on = ['left', 'right'], fix = {fix} }}]"))
        .set("contact.0.friction", "{ coulomb = { coefficient = 0.5 } }")
        .set("time", "{ scheme = 'implicit_euler', step = 0.1, end = 0.5 }")
        .set("output.fields", "{ every = 1 }")
}

/// The last force in N of a source.
fn force(results: &Results, source: &str) -> [f64; 3] {
    let rows = results.table("resultants.csv").only("source", source);
    ["force_x", "force_y", "force_z"].map(|name| rows.last(name))
}

#[track_caller]
fn assert_forces(results: &Results, what: &str, expected: [(&str, [f64; 3]); 2]) {
    for (source, expected) in expected {
        let found = force(results, source);
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-4, "{what}: {source} {found:?} N instead of {expected:?} N");
    }
}

/// The power in W of friction and the work of everything else in the last step.
fn powers(results: &Results) -> [f64; 2] {
    ["contact_dissipation", "external_work"].map(|name| {
        let sums = results.table("history.csv").numbers(name);
        (sums[sums.len() - 1] - sums[sums.len() - 2]) / 0.1
    })
}

/// The least and the largest last value of a field at the nodes of the bottom: those above it have none.
fn last_range(results: &Results, field: &str) -> [f64; 2] {
    let file = NumberFile::open(&results.path("fields.vtkhdf"));
    let values = file.field(field, file.times().len() - 1);
    let there = values.into_iter().filter(|value| *value != 0.0);
    there.fold([f64::INFINITY, 0.0], |[low, high], value| [low.min(value), high.max(value)])
}

/// Supports hold the brick in x, and the plane slides at 3 m/s there. The traction in y is 48 N of the bound of 60 N, so that friction
/// points along (3, 4): the brick moves in y with 4 m/s, and slides with 5 m/s.
#[test]
fn friction_sees_sliding_along_directions_that_a_support_holds() {
    let pulled = |scheme: &str, friction: &str| {
        held_brick("['x']")
            .set("traction", "[{ on = ['top'], value = [0.0, 400.0, -1000.0] }]")
            .set("contact.0.obstacle", "{ plane = { point = ['3*t', 0.0, 0.0], normal = [0, 0, 1] } }")
            .set("contact.0.friction", friction)
            .set("time.scheme", &format!("'{scheme}'"))
    };
    let weakening = "{ distance_weakening = { static = 0.5, dynamic = 0.5, distance = 1.0 } }";
    let state = "{ rate_and_state = { reference = 0.5, velocity = 5.0, direct = 0.01, evolution = 0.02, distance = 1.0 } }";
    for (scheme, friction) in [
        ("implicit_euler", "{ coulomb = { coefficient = 0.5 } }"),
        ("bdf2", "{ tresca = { bound = 500 } }"),
        ("bdf2", weakening),
        ("implicit_euler", weakening),
        ("implicit_euler", state),
    ] {
        let make = || pulled(scheme, friction);
        let alone = make().run_and_keep(1);
        let results = alone.results();
        let what = format!("{scheme} {friction}");
        let expected = [("contact bottom", [36.0, -48.0, 120.0]), ("support left+right", [-36.0, 0.0, 0.0])];
        assert_forces(&results, &what, expected);
        let found = centre(&results).last("velocity_y");
        assert!((found - 4.0).abs() < 1e-6, "{what}: {found} m/s");
        for found in powers(&results) {
            assert!((found / 300.0 - 1.0).abs() < 1e-6, "{what}: {found} W");
        }
        assert!(results.number("max_energy_imbalance") < 1e-10, "{what}");
        let table = results.table("resultants.csv").only("source", "contact bottom");
        assert!((table.last("slipping_area") - 0.12).abs() < 1e-9, "{what}");
        let tractions = results.table("profiles.csv");
        let [pressure, along, across] = ["contact_pressure", "friction_traction_x", "friction_traction_y"]
            .map(|name| tractions.last(name));
        let coefficient = if friction.contains("tresca") { 500.0 / pressure } else { 0.5 };
        let off =
            (along + 0.6 * coefficient * pressure).abs() + (across - 0.8 * coefficient * pressure).abs();
        assert!(off < 1e-6 * pressure, "{what}: {along} {across} Pa at {pressure} Pa");
        // In the first step the brick is deformed, so that it slides a little farther.
        let history = if friction == weakening { Some(("slip", 2.5)) } else { None };
        let history = if friction == state { Some(("friction_state", 0.2)) } else { history };
        if let Some((name, expected)) = history {
            for found in last_range(&results, name) {
                assert!((found / expected - 1.0).abs() < 1e-4, "{what}: {name} {found}");
            }
        }
        // The brick moves by 2 m and is deformed by 1 um: rounding errors of its forces are 1e-8 of the loads.
        let shared = make().run_and_keep(2);
        assert_same_answer(&results, &shared.results(), 1e-5, &what);
    }
}

/// A block under 1e4 N whose sides a support guides along y, on a plane with this normal that touches a corner and moves along x at this
/// velocity in m/s.
fn guided_block(normal: &str, velocity: f64) -> Case {
    let corner = u8::from(normal.starts_with("[-"));
    let text = format!(
        "mesh.rectangle = {{ size = [1, 0.5], cells = [1, 4] }}
        material.hypothesis = 'plane_strain'
        material.elasticity = {{ youngs_modulus = 1e10, poisson_ratio = 0 }}
        support = [{{ on = ['left', 'right'], fix = ['x'] }}]
        traction = [{{ on = ['top'], value = [0, -1e4] }}]
        time = {{ scheme = 'implicit_euler', end = 1, step = 0.1 }}
        [[contact]]
        on = ['bottom']
        sliding = 'finite'
        normal.unilateral = {{}}
        friction.coulomb.coefficient = 0.3
        obstacle.plane = {{ point = ['{corner} + {velocity}*t', 0], normal = {normal} }}"
    );
    Case::written_as(&text)
}

/// A plane whose normal is inclined by `a` presses with `N` along it and rubs with `mu N`: `N (cos a - mu sin a) = W` along the guide, and across
/// it the support takes `W tan(a + atan mu)`. The plane slides past at `v / cos a`.
#[test]
fn friction_acts_along_a_guide_where_the_obstacle_is_inclined_to_it() {
    let inclined = |degrees: f64| format!("[{}, {}]", degrees.to_radians().sin(), degrees.to_radians().cos());
    let friction = 0.3f64;
    let force = |results: &Results, source: &str| {
        let rows = results.table("resultants.csv").only("source", source);
        ["force_x", "force_y"].map(|name| rows.last(name))
    };
    let check = |case: &Case, what: &str, (angle, velocity): (f64, f64)| {
        let results = case.results();
        let mu = friction * velocity.signum();
        let across = 1e4 * (angle + mu.atan()).tan();
        let [x, y] = force(&results, "contact bottom");
        assert!((x - across).abs() < 1e-5 * across.abs() && (y - 1e4).abs() < 0.1, "{what}: {x} {y} N");
        let [support, _] = force(&results, "support left+right");
        assert!((support + across).abs() < 1e-5 * across.abs(), "{what}: {support} N");
        let pressed = 1e4 / (angle.cos() - mu * angle.sin());
        let expected = friction * pressed * velocity.abs() / angle.cos();
        let [dissipated, _] = powers(&results);
        assert!((dissipated / expected - 1.0).abs() < 1e-3, "{what}: {dissipated} W instead of {expected} W");
        assert!(results.number("max_energy_imbalance") < 1e-10, "{what}");
        let rows = results.table("resultants.csv").only("source", "contact bottom");
        let [slips, touches] = ["slipping_area", "touching_area"].map(|name| rows.last(name));
        assert!(touches > 0.2 && (slips / touches - 1.0).abs() < 1e-9, "{what}: {slips} of {touches} m2");
    };
    for degrees in [0.0, 1e-7, 1e-4, 1.0, 10.0, -10.0, 30.0] {
        for velocity in [0.02, -0.02] {
            let what = format!("{degrees} degrees, {velocity} m/s");
            let case = guided_block(&inclined(degrees), velocity);
            let case = case.run_and_keep(1);
            check(&case, &what, (degrees.to_radians(), velocity));
        }
    }
    for (key, value) in [
        ("time.scheme", "'bdf2'"),
        ("contact.0.normal", "{ compliance = { stiffness = 1e10 } }"),
        ("contact.0.friction", "{ tresca = { bound = 3000 } }"),
        ("contact.0.friction", "{ expression = { coefficient = '0.3 + 0*p' } }"),
        ("solver.friction", "'fixed_point'"),
        ("mesh.rectangle.cells", "[4, 2]"),
    ] {
        let case = guided_block(&inclined(5.0), 0.02).set(key, value);
        case.run_with(2, &[]).expect(0);
        if value.contains("tresca") {
            let [x, _] = force(&case.results(), "contact bottom");
            let (sine, cosine) = 5f64.to_radians().sin_cos();
            // 3000 Pa on the shadow of the bottom.
            let rubbed = 3000.0 * cosine;
            let expected = (1e4 + rubbed * sine) / cosine * sine + rubbed * cosine;
            assert!((x / expected - 1.0).abs() < 1e-5, "{x} N instead of {expected} N");
        } else if !value.contains("[4") {
            check(&case, value, (5f64.to_radians(), 0.02));
        }
    }
    let tilting = "['sin(0.1*max(t - 0.5, 0))', 'cos(0.1*max(t - 0.5, 0))']";
    let straight = guided_block(tilting, 0.02).run_and_keep(1);
    let rows = straight.results().table("resultants.csv").only("source", "contact bottom");
    for (time, found) in rows.numbers("time").iter().zip(rows.numbers("force_x")) {
        let expected = 1e4 * (0.1 * (time - 0.5).max(0.0) + friction.atan()).tan();
        assert!((found / expected - 1.0).abs() < 1e-3, "{found} N instead of {expected} N at {time} s");
    }
    let stopped = guided_block(tilting, 0.02).set("checkpoint.every", "2");
    stopped.run_with(1, &["--set", "time.end=0.8"]).expect(0);
    stopped.run_with(1, &["--restart"]).expect(0);
    for name in ["history.csv", "resultants.csv"] {
        assert_eq!(straight.results().text(name), stopped.results().text(name), "{name}");
    }
    let steep = guided_block("[0.8, 0.6]", 0.02).set("contact.0.friction.coulomb.coefficient", "0.9");
    steep.run_with(1, &[]).says("holds the node fast");
}

/// The brick is held in x and y, and the plane slides past, or the supports take it over a plane at rest.
#[test]
fn a_boundary_that_is_held_along_its_plane_rubs_and_wears() {
    let make = |scheme: &str, plane: &str, support: &str| {
        held_brick("['x', 'y']")
            .set("traction", "[{ on = ['top'], value = [0.0, 0.0, -1000.0] }]")
            .set("contact.0.obstacle", &format!("{{ plane = {{ point = {plane}, normal = [0, 0, 1] }} }}"))
            .set("contact.0.wear", "{ coefficient = 1e-16 }")
            .set("support.0.displacement", support)
            .set("time.scheme", &format!("'{scheme}'"))
    };
    let moves = "['3*t', '4*t', 0.0]";
    for (scheme, plane, support) in [
        ("implicit_euler", moves, "[0.0, 0.0]"),
        ("bdf2", moves, "[0.0, 0.0]"),
        ("implicit_euler", "[0.0, 0.0, 0.0]", "['-3*t', '-4*t']"),
        ("bdf2", "['t', '2*t', 0.0]", "['-2*t', '-2*t']"),
    ] {
        let what = format!("{scheme}, plane {plane}, support {support}");
        let alone = make(scheme, plane, support).run_and_keep(1);
        let results = alone.results();
        let expected = [("contact bottom", [36.0, 48.0, 120.0]), ("support left+right", [-36.0, -48.0, 0.0])];
        assert_forces(&results, &what, expected);
        for found in powers(&results) {
            assert!((found / 300.0 - 1.0).abs() < 1e-6, "{what}: {found} W");
        }
        assert!(results.number("max_energy_imbalance") < 1e-10, "{what}");
        let [least, _] = last_range(&results, "wear");
        let pressures = results.table("profiles.csv").numbers("contact_pressure");
        let lowest = pressures[pressures.len() - 8..].iter().fold(f64::INFINITY, |low, p| low.min(*p));
        let expected = 1e-16 * lowest * 5.0 * 0.5;
        assert!((least / expected - 1.0).abs() < 1e-4, "{what}: {least} m instead of {expected} m");
        let shared = make(scheme, plane, support).run_and_keep(2);
        assert_same_answer(&results, &shared.results(), 1e-7, &what);
    }
    let straight = make("bdf2", moves, "[0.0, 0.0]").run_and_keep(1);
    let stopped = make("bdf2", moves, "[0.0, 0.0]").set("checkpoint.every", "2");
    stopped.run_with(1, &["--set", "time.end=0.2"]).expect(0);
    stopped.run_with(1, &["--restart"]).expect(0);
    for name in ["probes.csv", "history.csv", "profiles.csv", "resultants.csv"] {
        assert_eq!(straight.results().text(name), stopped.results().text(name), "{name}");
    }
}

#[test]
fn quasistatic_friction_that_falls_faster_than_the_body_resists_has_a_solution_in_each_step() {
    let job = "[[mesh.rectangle]]\nname = 'block'\ncorner = [0.1, 0]\nsize = [0.4, 0.2]\ncells = [5, 3]\n\
        [[mesh.rectangle]]\nname = 'base'\ncorner = [-0.1, -0.2]\nsize = [1.2, 0.2]\ncells = [17, 3]\n\
        [material]\nhypothesis = 'plane_strain'\nelasticity = { youngs_modulus = 1e6, poisson_ratio = 0.3 }\n\
        [[support]]\non = ['base.bottom']\nfix = 'all'\n[[support]]\non = ['block.top']\nfix = ['x']\n\
        [[traction]]\non = ['block.top']\nvalue = [0, -1000]\n\
        [[contact]]\non = ['block.bottom']\nagainst = ['base.top']\nnormal.unilateral = {}\n\
        friction.expression.coefficient = '0.2 + 0.1*exp(-v/0.05)'\n\
        [time]\nscheme = 'implicit_euler'\nend = 1e-4\nstep = 1e-4\n";
    // The load spreads the block at once, at speeds between which the coefficient falls by 0.1 s/m times 1 kPa per 0.05 m/s.
    for step in [1e-4, 5e-5] {
        let case = Case::written_as(job).set("time.step", &step.to_string());
        let results = case.run(1);
        // Within the accepted distance to the graphs, `[solver] inclusion_tolerance`.
        assert!(results.number("max_inclusion_residual") < 1e-6);
        assert!(results.number("max_energy_imbalance") < 1e-7);
        let forces = results.table("resultants.csv");
        let contact = forces.only("source", "contact block.bottom").last("force_y");
        assert!((contact - 400.0).abs() < 1e-6, "{contact} N");
    }
}

#[test]
fn a_heated_plate_that_nothing_but_friction_holds_has_a_solution_in_each_step() {
    let job = "[mesh.rectangle]\nsize = [0.2, 0.02]\ncells = [4, 1]\n\
        [material]\nhypothesis = 'plane_strain'\nelasticity = { youngs_modulus = 7e10, poisson_ratio = 0.33 }\n\
        heat = { conductivity = 200.0, volumetric_capacity = 2.4e6, expansion = 2.3e-5, reference = 293.0 }\n\
        [initial]\ntemperature = 293.0\n\
        [[heat]]\non = ['top']\ntemperature = '293 + 50*(1 - cos(2*pi*t/10))'\n\
        [[traction]]\non = ['top']\npressure = 1e6\n\
        [[contact]]\non = ['bottom']\nobstacle.plane = { point = [0.0, 0.0], normal = [0.0, 1.0] }\n\
        normal.unilateral = {}\nfriction.coulomb.coefficient = 0.3\n\
        [time]\nscheme = 'implicit_euler'\nend = 10.0\nstep = 0.5\n";
    // The plate grows and shrinks over the plane: all points slip outwards or inwards, except for one that holds it.
    for law in ["{ unilateral = {} }", "{ compliance = { stiffness = 1e12 } }"] {
        let case = Case::written_as(job).set("contact.0.normal", law);
        let results = case.run(1);
        assert!(results.number("max_energy_imbalance") < 1e-9, "{law}");
        let forces = results.table("resultants.csv");
        let contact = forces.only("source", "contact bottom");
        for (name, expected) in [("force_x", 0.0), ("force_y", 2e5)] {
            let misses = contact.numbers(name).into_iter().map(|force| (force - expected).abs());
            let largest = misses.fold(0.0, f64::max);
            assert!(largest < 1e-3, "{law}: {name} misses {expected} N by {largest} N");
        }
    }
}

#[test]
fn a_sheet_that_creeps_on_a_table_as_it_is_heated_and_cooled_takes_few_iterations_at_each_turn() {
    let job = "[mesh.rectangle]\nsize = [1.0, 0.1]\ncells = [40, 4]\n\
        [material]\nhypothesis = 'plane_strain'\nelasticity = { youngs_modulus = 2e11, poisson_ratio = 0.3 }\n\
        heat = { conductivity = 5e4, volumetric_capacity = 1.0, expansion = 1e-5, reference = 293.0 }\n\
        [initial]\ntemperature = 293.0\n\
        [[heat]]\non = ['top', 'bottom', 'left', 'right']\ntemperature = '293 + 100*min(t/2, 2 - t/2)'\n\
        [[body_force]]\nvalue = [0.0, '-1e5*min(t/0.2, 1)']\n\
        [[contact]]\non = ['bottom']\nnormal.unilateral = {}\nfriction.coulomb.coefficient = 0.3\n\
        [time]\nscheme = 'implicit_euler'\nend = 2.4\nstep = 0.2\n";
    // Before points resisted that all slide: up to 80 with coulomb, 58 with tresca.
    for law in ["{ coulomb.coefficient = 0.3 }", "{ tresca.bound = 3e3 }"] {
        let kept = Case::written_as(job).set("contact.0.friction", law).run_and_keep(1);
        let history = kept.results().table("history.csv");
        let largest = history.numbers("newton_iterations").into_iter().fold(0.0, f64::max);
        assert!(largest <= 21.0, "{law}: {largest}");
    }
}

#[test]
fn friction_that_falls_fast_under_lagged_euler_is_warned_of_by_checks_and_runs() {
    for (scheme, is_warned) in [("lagged_euler", true), ("bdf2", false)] {
        let case = Case::of("verification/fault_rupture")
            .set("parameters.n", "1")
            .set("time", &format!("{{ scheme = '{scheme}', end = 0.4, step = 0.02 }}"));
        let run = case.run_with(1, &[]).expect(0);
        let checked = launch::run_alone(&["check".as_ref(), case.written().as_os_str()]);
        for outcome in [&run, &checked] {
            let says = launch::unwrapped(&outcome.stdout);
            assert_eq!(says.contains("of its coefficient in one step: lagged_euler"), is_warned, "{says}");
        }
        let fall = &case.results().summary()["max_friction_fall"];
        assert_eq!(fall.as_f64().is_some_and(|fall| fall > 2e-3), is_warned, "{fall}");
    }
}

#[test]
fn friction_that_falls_with_the_speed_moves_a_block_without_mass_from_sticking_to_sliding_on_a_belt() {
    let case = Case::written_as(
        "
        mesh.rectangle = { size = [0.5, 0.2], cells = [10, 4] }
        material = { hypothesis = 'plane_strain', elasticity = { youngs_modulus = 1e8, poisson_ratio = 0.3 } }
        support = [{ on = ['left'], stiffness = { normal = 1e7, tangential = 1e7 } }]
        traction = [{ on = ['top'], value = [0, -1e5] }]
        time = { end = 0.1, step = 0.01, scheme = 'implicit_euler' }
        [[contact]]
        on = ['bottom']
        normal.unilateral = {}
        friction.velocity_weakening = { static = 0.5, dynamic = 0.3, decay_velocity = 0.1 }
        obstacle.plane = { point = ['0.5*t', 0], normal = [0, 1] }",
    );
    let table = case.run(1).table("resultants.csv").only("source", "contact bottom");
    let ratios: Vec<f64> =
        table.numbers("force_x").iter().zip(table.numbers("force_y")).map(|(x, y)| x / y).collect();
    // It sticks at first; at last all points slide at the speed of the belt.
    let sliding = 0.3 + 0.2 * (-5.0f64).exp();
    assert!(ratios[0] < 0.3, "{ratios:?}");
    assert!((ratios[ratios.len() - 1] / sliding - 1.0).abs() < 1e-6, "{ratios:?}, not {sliding} at last");
}

/// A block that flows, pressed on a plane by a load that stays: the friction rises steeply from rest, and is part of what holds the block.
const PRESSED: &str = "
    mesh.rectangle = {size = [1.0, 0.5], cells = [8, 4]}
    output.probe = [{name = 'top', point = [0.5, 0.5]}]
    time = {end = 0.4, step = 0.02, scheme = 'implicit_euler'}
    [material]
    hypothesis = 'plane_stress'
    elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.45}
    viscoplasticity.perzyna = {relaxation = 2e3, yield_stress = 8e3}
    [[support]]
    on = ['top']
    stiffness = {normal = 1e5, tangential = 5e4}
    [[traction]]
    on = ['top']
    value = [0.0, '-8e3*min(t/0.2, 1)']
    [[contact]]
    on = ['bottom']
    normal.unilateral = {}
    friction.rate_and_state = {reference = 0.3, velocity = 1e-3, direct = 0.02, evolution = 0.0, distance = 1e-3}";

#[test]
fn friction_that_rises_steeply_from_rest_holds_a_body_that_flows() {
    let case = Case::written_as(PRESSED);
    let [one, two] = [1, 2].map(|ranks| case.run(ranks));
    assert_same_answer(&one, &two, 1e-9, "two ranks");
    let count = one.number("newton_iterations");
    assert!(count < 400.0, "{count} Newton iterations in 20 steps");
}
