//! Newton and linear iterations of small jobs against stored numbers, so that an increase is noticed.
//!
//! On one rank with a factor, a difference of one iteration is accepted. On several ranks and with multigrid, sums are computed in
//! another order, which may change the number of iterations: a tenth is accepted.

use crate::case::Case;

/// Accepted relative difference of counts on several ranks or with multigrid.
const MARGIN: f64 = 0.1;

/// The differences in the counts of a job.
fn count(name: &str, case: &Case, ranks: usize, stored: [f64; 2]) -> Option<String> {
    let results = case.run(ranks);
    let found = ["newton_iterations", "linear_iterations"].map(|key| results.number(key));
    println!("{name} on {ranks}: {found:?}");
    let exact = ranks == 1 && results.summary()["preconditioner"] == "cholesky";
    let within =
        |(found, stored): (f64, f64)| (found - stored).abs() <= if exact { 1.0 } else { MARGIN * stored };
    let fits = found.into_iter().zip(stored).all(within);
    (!fits).then(|| format!("{name} on {ranks}: {found:?}, stored {stored:?}"))
}

fn assert_counts(jobs: &[(&str, &Case, usize, [f64; 2])]) {
    let wrong: Vec<String> =
        jobs.iter().filter_map(|(name, case, ranks, stored)| count(name, case, *ranks, *stored)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn small_jobs_take_as_many_iterations_as_they_did() {
    let of_paper = |scheme: &str, steps: u32| {
        let step = (1.0 / f64::from(steps)).to_string();
        Case::square(16)
            .set("time.scheme", &format!("'{scheme}'"))
            .set("time.step", &step)
            .set("solver.preconditioner", "'cholesky'")
    };
    let [few, many] = [of_paper("lagged_euler", 16), of_paper("lagged_euler", 64)];
    let [euler, bdf2] = ["implicit_euler", "bdf2"].map(|scheme| of_paper(scheme, 16));
    let jobs =
        ["papers/wang_cheng_bdf2", "stick_on_a_jump", "oblique_sliding", "verification/double_cantilever"];
    let [adaptive, jump, oblique, cantilever] = jobs.map(Case::of);
    assert_counts(&[
        ("lagged_euler, 16 steps", &few, 1, [60.0, 141.0]),
        ("lagged_euler, 64 steps", &many, 1, [153.0, 353.0]),
        ("implicit_euler", &euler, 1, [210.0, 455.0]),
        ("bdf2", &bdf2, 1, [199.0, 433.0]),
        (jobs[0], &adaptive, 1, [330.0, 670.0]),
        (jobs[1], &jump, 1, [397.0, 396.0]),
        (jobs[2], &oblique, 1, [100.0, 105.0]),
        (jobs[3], &cantilever, 1, [259.0, 1900.0]),
        ("lagged_euler, 16 steps", &few, 2, [60.0, 141.0]),
        ("implicit_euler", &euler, 2, [210.0, 455.0]),
    ]);
}

#[test]
fn multigrid_takes_as_many_iterations_as_it_did() {
    let gamg = |case: Case| case.set("solver.preconditioner", "'gamg'");
    let [square, cube] = [gamg(Case::square(32)), gamg(Case::cube(6)).set("time.end", "0.25")];
    let [quadratic_square, quadratic_cube] = [Case::square(16), Case::cube(3).set("time.end", "0.25")]
        .map(|case| gamg(case.set("mesh.order", "2")));
    // The block of docs/contact-preconditioner.md, coarser: most of its points stick.
    let sticking = gamg(Case::written_as(
        "
        mesh.rectangle = {size = [1.0, 0.25], cells = [200, 20], grading = {y = 1.5}}
        time = {end = 0.0625, step = 0.0625}
        support = [{on = ['left'], fix = 'all'}]
        traction = [{on = ['top'], value = ['0', '-10*x*t/0.0625']}]
        [material]
        hypothesis = 'plane_strain'
        density = 1.0
        viscosity = {volumetric = 25.0, shear = 50.0}
        [[contact]]
        on = ['bottom']
        normal.graph = {points = [[0.0, -5.0], [0.0, 5.0]], slope_before = 10.0, slope_after = 10.0}",
    ));
    let sliding = gamg(Case::written_as(
        "
        mesh.rectangle = [{name = 'lower', size = [1, 0.5], cells = [32, 16], grading = {x = 1.2, toward = ['left']}},
                          {name = 'upper', corner = [0, 0.5], size = [1, 0.5], cells = [32, 16]}]
        time = {scheme = 'bdf2', end = 0.125, step = 0.015625}
        support = [{on = ['lower.bottom'], fix = 'all'}]
        traction = [{on = ['upper.top'], value = ['min(40*t, 4)', -10]}]
        [material]
        hypothesis = 'plane_strain'
        density = 1
        elasticity = {youngs_modulus = 1000, poisson_ratio = 0.3}
        [[contact]]
        on = ['upper.bottom']
        against = ['lower.top']
        side = 'on'
        normal.unilateral = {}
        friction.coulomb.coefficient = 0.3",
    ));
    assert_counts(&[
        ("blocks that slide", &sliding.set("solver.tolerance", "1e-8"), 1, [31.0, 407.0]),
        ("sticking block", &sticking.set("solver.tolerance", "1e-10"), 1, [12.0, 145.0]),
        ("square", &square, 1, [66.0, 447.0]),
        ("cube", &cube, 2, [17.0, 98.0]),
        ("square of quadratic cells", &quadratic_square, 1, [65.0, 427.0]),
        ("square of quadratic cells", &quadratic_square, 2, [66.0, 474.0]),
        ("cube of quadratic cells", &quadratic_cube, 2, [17.0, 96.0]),
    ]);
}

/// Layers of stiff and of soft material, and a stiff inclusion: aggregates of multigrid do not reach across.
#[test]
fn multigrid_takes_few_iterations_where_stiffness_jumps() {
    for (modulus, most) in [
        ("if(sin(8*pi*z) > 0, 1e5, 1e3)", 32.0),
        ("if((abs(x - 0.5) < 0.25)*(abs(y - 0.5) < 0.25)*(abs(z - 0.5) < 0.25), 1e9, 1e3)", 24.0),
    ] {
        let case = Case::written_as(
            "
            mesh.box = {size = [1.0, 1.0, 1.0], cells = [16, 16, 16]}
            time = {scheme = 'implicit_euler', end = 1.0, step = 1.0}
            support = [{on = ['bottom'], fix = 'all'}]
            traction = [{on = ['top'], value = ['4', '0', '-10*x']}]
            solver = {preconditioner = 'gamg', tolerance = 1e-8}
            [material]
            density = 1e-3
            elasticity = {youngs_modulus = 1e3, poisson_ratio = 0.3}",
        );
        let case = case.set("material.elasticity.youngs_modulus", &format!("'{modulus}'"));
        let found = case.run(1).number("linear_iterations");
        assert!(found <= most, "{modulus}: {found} iterations");
    }
}

/// A block that slides on a plane: friction resists a change of the direction of slip far more than the block does.
#[test]
fn multigrid_takes_hardly_longer_where_a_block_slides_in_space_than_without_friction() {
    let block = || {
        Case::written_as(
            "
        mesh.box = {size = [1, 1, 1], cells = [12, 12, 12]}
        time = {scheme = 'bdf2', end = 0.125, step = 0.015625}
        traction = [{on = ['top'], value = ['min(40*t, 4)', 0, -10]}]
        solver = {preconditioner = 'gamg', tolerance = 1e-8}
        [material]
        density = 1
        elasticity = {youngs_modulus = 1000, poisson_ratio = 0.3}
        [[contact]]
        on = ['bottom']
        normal.unilateral = {}
        friction.coulomb.coefficient = 0.3",
        )
    };
    let each = |coefficient: &str| {
        let case = block().set("contact.0.friction.coulomb.coefficient", coefficient);
        let results = case.run(1);
        results.number("linear_iterations") / results.number("newton_iterations")
    };
    let [with, without] = ["0.3", "0"].map(each);
    assert!(with <= 1.5 * without, "{with} iterations a solve, {without} without");
}

/// A pressed pair of curved blocks whose nodes touch and part in turn under full steps, where a line search takes fifty short ones.
#[test]
fn a_pair_of_quadratic_cells_that_full_steps_turn_round_takes_few_iterations() {
    let case = Case::written_as(
        "
        mesh.order = 2
        mesh.rectangle = [{name = 'l', size = [1.0, 0.5], cells = [12, 6]},
                          {name = 'u', corner = [0.0, 0.5], size = [1.0, 0.5], cells = [30, 10]}]
        time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}
        support = [{on = ['l.bottom'], fix = 'all'}, {on = ['u.left', 'l.left'], fix = ['x']}]
        traction = [{on = ['u.top'], value = [0.0, -7.5e5]}]
        region = [{name = 'l', material.elasticity = {youngs_modulus = 3e9, poisson_ratio = 0.2}}]
        [material]
        hypothesis = 'plane_strain'
        elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.3}
        [[contact]]
        on = ['l.top']
        against = ['u.bottom']
        normal.unilateral.gap = '0.25*x^2'",
    );
    let found = case.run(1).number("newton_iterations");
    assert!(found <= 30.0, "{found} iterations");
}

/// Two stiff blocks on a base that moves to and fro, of which one sticks and one slides: little but friction holds them, so that full steps
/// let all points of a block slide to and fro.
#[test]
fn stacked_blocks_of_which_one_slides_take_few_iterations() {
    let blocks = || {
        Case::written_as(
        "
        mesh.rectangle = [{name = 'base', size = [0.5, 0.05], corner = [-0.25, 0.0], cells = [5, 1]},
                          {name = 'low', size = [0.36, 0.05], corner = [-0.18, 0.05], cells = [4, 1]},
                          {name = 'high', size = [0.24, 0.05], corner = [-0.12, 0.1], cells = [3, 1]}]
        time = {scheme = 'implicit_euler', step = 0.005, end = 0.15}
        checkpoint = {every = 12}
        gravity.acceleration = [0.0, -9.81]
        support = [{on = ['base.bottom'], fix = 'all', displacement = ['0.06*(1 - cos(9*t))', 0.0]},
                   {on = ['base.top'], fix = ['x'], displacement = ['0.06*(1 - cos(9*t))']}]
        contact = [{on = ['low.bottom'], against = ['base.top'], normal.unilateral = {}, friction.coulomb.coefficient = 0.5},
                   {on = ['high.bottom'], against = ['low.top'], normal.unilateral = {}, friction.coulomb.coefficient = 0.25}]
        [material]
        hypothesis = 'plane_strain'
        density = 2000.0
        elasticity = {youngs_modulus = 2e10, poisson_ratio = 0.0}
        ",
    )
    };
    let (straight, stopped) = (blocks(), blocks());
    let found = straight.run(1).number("newton_iterations");
    assert!(found <= 200.0, "{found} iterations in 30 steps");
    // The fallback of the last step is known after a restart.
    stopped.run_with(1, &["--set", "time.end=0.06"]).expect(0);
    stopped.run_with(1, &["--restart"]).expect(0).says("step 12");
    assert_eq!(straight.results().text("history.csv"), stopped.results().text("history.csv"));
}

/// Loads carry a stiff body on soft springs far along a sphere: full steps let its nodes touch and part in turn, and a descent ends at kinks.
#[test]
fn a_body_on_soft_springs_that_is_carried_along_a_sphere_takes_few_iterations() {
    let case = Case::written_as(
        "
        mesh.rectangle = {size = [0.2, 0.1], cells = [12, 6]}
        time = {scheme = 'implicit_euler', end = 0.06, step = 0.02}
        traction = [{on = ['top'], value = [2e5, '-2e5*sin(9*t)']}]
        [material]
        hypothesis = 'plane_stress'
        density = 1000.0
        elasticity = {youngs_modulus = 1e8, poisson_ratio = 0.3}
        viscosity = {volumetric = 2e4, shear = 4e4}
        [[support]]
        on = ['left', 'right']
        where = 'y > 0.03'
        stiffness = {normal = 5e6, tangential = 1e6}
        [[contact]]
        on = ['bottom']
        normal.unilateral = {}
        obstacle.sphere = {centre = ['0.09 + 0.01*t', -0.5], radius = 0.5}",
    );
    let found = case.run(1).number("newton_iterations");
    assert!(found <= 60.0, "{found} iterations");
}

/// A force moves an obstacle at about the cost of its motion if it is prescribed.
#[test]
fn an_obstacle_moved_by_a_force_takes_as_many_iterations_as_one_whose_motion_is_given() {
    for viscoplastic in [true, false] {
        let case = || {
            let case = Case::of("indented_block");
            if viscoplastic { case } else { case.without("material.viscoplasticity") }
        };
        let kept = case().run_and_keep(1);
        let loaded = kept.results();
        let table = loaded.table("resultants.csv").only("source", "contact top");
        let (times, ways) = (table.numbers("time"), table.numbers("obstacle_displacement"));
        let mut heights = "0, 0.2".to_owned();
        for (time, way) in times.iter().zip(&ways) {
            heights += &format!(", {time}, {:.17}", 0.2 - way);
        }
        let sphere = format!("{{centre = [0.0, 'interpolate(t, {heights})'], radius = 0.1}}");
        let given = case()
            .without("contact.0.obstacle_load")
            .without("check")
            .set("contact.0.obstacle.sphere", &sphere);
        let [found, prescribed] = [&loaded, &given.run(1)].map(|results| results.number("newton_iterations"));
        assert!(found <= 1.2 * prescribed && prescribed > 40.0, "{found} instead of {prescribed}");
    }
}

/// Few points of a stiff body hold a light disc, and stick and slide in turn.
#[test]
fn rolling_takes_few_iterations_on_any_mesh_and_in_any_step() {
    let case = |cells: &str, time: &str| {
        Case::of("rolling_disc")
            .without("check")
            .set("mesh.rectangle.cells", cells)
            .set("time", &format!("{{{time}}}"))
    };
    for (cells, time, most) in [
        ("[120, 4]", "end = 0.1, step = 0.002, scheme = 'bdf2'", 900.0),
        ("[120, 4]", "end = 0.1, step = 0.005, scheme = 'bdf2'", 720.0),
        ("[120, 4]", "end = 0.1, step = 0.002, scheme = 'implicit_euler'", 1100.0),
        ("[480, 8]", "end = 0.01, step = 0.002, scheme = 'bdf2'", 600.0),
    ] {
        let kept = case(cells, time).run_and_keep(1);
        let results = kept.results();
        let found = results.number("newton_iterations");
        let table = results.table("resultants.csv").only("source", "contact top");
        let last = |column: &str| *table.numbers(column).last().expect("rows");
        let rolls = -0.1 * last("obstacle_angular_velocity") / last("obstacle_velocity");
        println!("{cells}, {time}: {found} iterations, rolls {rolls}");
        assert!(found <= most && (rolls - 1.0).abs() < 0.01, "{cells}, {time}: {found}, {rolls}");
    }
}

/// A force that moves a cylinder to and fro, pressed into a block, lets points at its edges stick and slide (Mindlin, 1949).
#[test]
fn partial_slip_under_a_force_takes_few_iterations() {
    let case = Case::written_as(
        "
        mesh.rectangle = {corner = [-0.2, 0.0], size = [0.4, 0.2], cells = [40, 12], grading = {y = 3.0}}
        mesh.order = 2
        time = {end = 2.4, step = 0.1, scheme = 'implicit_euler'}
        support = [{on = ['top'], fix = 'all', displacement = ['0', '-2e-3*min(t, 1)']}]
        [material]
        hypothesis = 'plane_strain'
        elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.49}
        [[contact]]
        on = ['bottom']
        normal.unilateral = {}
        friction.coulomb = {coefficient = 0.3}
        obstacle.sphere = {centre = [0.0, -1.0], radius = 1.0}
        obstacle_load = {direction = [1.0, 0.0], force = '2.4e5*interpolate(t, 1, 0, 2, 1, 4, -1)'}",
    );
    let results = case.run(1);
    let [found, steps] = ["newton_iterations", "steps"].map(|key| results.number(key));
    println!("{found} in {steps} steps");
    assert!(found <= 10.0 * steps, "{found} iterations in {steps} steps");
}

/// Contact and flow at once: the size of the contact, where it sticks and where the block yields change together.
#[test]
fn a_ball_pressed_into_a_plastic_block_takes_few_iterations() {
    let case = Case::written_as(
        "
        mesh.rectangle = {size = [0.02, 0.015], cells = [20, 15], grading = {x = 1.5, y = 1.5, toward = ['left', 'top']}}
        mesh.order = 2
        time = {end = 0.1, step = 0.02, scheme = 'implicit_euler'}
        support = [{on = ['bottom'], fix = 'normal'}]
        [material]
        hypothesis = 'axisymmetric'
        elasticity = {youngs_modulus = 2.1e11, poisson_ratio = 0.3}
        viscoplasticity.perzyna = {relaxation = 1e4, yield_stress = 3e8, hardening_modulus = 1e9}
        [[contact]]
        on = ['top']
        normal.unilateral = {}
        friction.coulomb.coefficient = 0.2
        obstacle.sphere = {centre = [0.0, '0.02 - 2.86e-4*t'], radius = 0.005}",
    );
    let results = case.run(1);
    let [steps, newton, linear] =
        ["steps", "newton_iterations", "linear_iterations"].map(|key| results.number(key));
    println!("{newton} and {linear} in {steps} steps");
    assert!(newton <= 31.0 * steps && linear <= 100.0 * steps, "{newton}, {linear}");
}

/// The velocity of the step before would make the block yield, and the derivatives of flow there lead nowhere.
#[test]
fn a_force_that_grows_no_more_leaves_a_block_below_its_yield_stress_at_rest() {
    for (scheme, cells) in [("implicit_euler", "[1, 1]"), ("bdf2", "[1, 1]"), ("implicit_euler", "[8, 2]")] {
        let case = Case::written_as(&format!(
            "
            mesh.rectangle = {{size = [0.01, 0.01], cells = {cells}}}
            time = {{end = 0.2, step = 0.05, scheme = '{scheme}'}}
            support = [{{on = ['left'], fix = 'normal'}}, {{on = ['bottom'], fix = 'normal'}}]
            [material]
            hypothesis = 'plane_stress'
            elasticity = {{youngs_modulus = 1e11, poisson_ratio = 0.3}}
            viscoplasticity.perzyna = {{relaxation = 1e6, yield_stress = 1e8}}
            [[contact]]
            on = ['top']
            normal.unilateral = {{}}
            obstacle.plane = {{normal = [0.0, -1.0], point = [0.0, 0.01]}}
            obstacle_load = {{direction = [0.0, -1.0], force = '9e5*min(t/0.05, 1)'}}"
        ));
        let kept = case.run_and_keep(1);
        let results = kept.results();
        let table = results.table("resultants.csv").only("source", "contact top");
        let place = *table.numbers("obstacle_displacement").last().expect("rows");
        assert!((place.abs() - 9e-6).abs() < 1e-14, "{scheme}, {cells}: {place}");
        assert!(results.number("newton_iterations") <= 40.0, "{scheme}, {cells}");
    }
}

/// Steady creep in long steps: stresses without flow are a thousand times those that are left, and so are their rounding errors.
#[test]
fn steady_creep_takes_few_steps_and_iterations() {
    let case = Case::written_as(
        "
        mesh.rectangle = {size = [0.2, 0.1], corner = [0.0, -0.05], cells = [2, 8], diagonal = 'crossed'}
        mesh.order = 2
        support = [{on = ['left'], fix = ['x']}, {on = ['left'], fix = ['y'], where = 'abs(y) < 1e-6'}]
        traction = [{on = ['right'], value = ['2.4e8*y', 0.0]}]
        time = {end = 2e7, step = 1e3, scheme = 'implicit_euler', adaptive = {smallest_step = 1.0, largest_step = 2e6}}
        [material]
        hypothesis = 'plane_stress'
        elasticity = {youngs_modulus = 1e11, poisson_ratio = 0.3}
        viscoplasticity.norton = {rate = 1e-8, reference_stress = 1e7, exponent = 5.0}",
    );
    let results = case.run(1);
    let [steps, rejected, found] =
        ["steps", "rejected_steps", "newton_iterations"].map(|key| results.number(key));
    println!("{steps} steps, {rejected} rejected, {found} iterations");
    assert!(steps < 200.0 && rejected < 10.0 && found < 6.0 * steps, "{steps}, {rejected}, {found}");
}

#[test]
fn a_stiff_body_on_soft_springs_repeats_no_iteration_in_vain() {
    // Contact that does not touch yet leaves the body free: linear solvers find no direction beside rounding errors.
    for (modulus, preconditioner) in [("2e9", "cholesky"), ("2e10", "cholesky"), ("2e10", "gamg")] {
        let case = Case::of("sliding_block")
            .set("mesh", "{ rectangle = { size = [2.0, 0.3], cells = [16, 2] } }")
            .set("material", "{ hypothesis = 'plane_strain' }")
            .set("material.elasticity", &format!("{{ youngs_modulus = {modulus}, poisson_ratio = 0.3 }}"))
            .without("body_force")
            .without("initial")
            .without("output")
            .set("output.folder", "'out'")
            .set("support", "[{ on = ['left'], where = 'y < 1e-6', fix = ['x'] }]")
            .set("traction", "[{ on = ['top'], pressure = '10*(1 + 0.5*(x - 1))' }]")
            .set("contact", "[{ on = ['bottom'], normal.compliance = { stiffness = 5000.0 } }]")
            .set("time", "{ scheme = 'implicit_euler', end = 1.0, step = 0.5 }")
            .set("solver", &format!("{{ preconditioner = '{preconditioner}' }}"));
        let found = case.run(1).number("newton_iterations");
        println!("{modulus} Pa, {preconditioner}: {found}");
        assert!(found <= 30.0, "{modulus} Pa, {preconditioner}: {found} iterations");
    }
}

#[test]
fn damage_that_never_comes_takes_no_further_iterations() {
    let block = r#"
        [mesh]
        order = 2
        [mesh.box]
        size = [1.0, 0.5, 0.4]
        cells = [4, 2, 2]
        [material]
        density = 1000.0
        elasticity = { youngs_modulus = 1e7, poisson_ratio = 0.3 }
        DAMAGE
        [[support]]
        on = ["left"]
        fix = "normal"
        [[traction]]
        on = ["back"]
        value = ["5e3*sin(8*t)", 0.0, "-2e4*min(t/0.1, 1)"]
        [[contact]]
        on = ["front"]
        normal.unilateral = {}
        friction.rate_and_state = { reference = 0.3, velocity = 1e-3, direct = 0.01, evolution = 0.008, distance = 1e-4 }
        [time]
        end = 0.2
        step = 0.05
        scheme = "bdf2"
        [solver]
        accept = ["uniqueness"]
    "#;
    let [without, with] = ["", "damage = { threshold = 1e9, viscosity = 100.0 }"]
        .map(|damage| Case::written_as(&block.replace("DAMAGE", damage)));
    for ranks in [1, 2] {
        let [without, with] = [&without, &with].map(|case| case.run(ranks));
        for key in ["newton_iterations", "linear_iterations"] {
            let [bare, found] = [&without, &with].map(|results| results.number(key));
            assert!(found <= 1.5 * bare, "{key} on {ranks}: {found}, without damage {bare}");
        }
    }
}

/// The derivatives of flow are not symmetric in plane stress, and a load that falls again takes the body back from far beyond its limit load.
#[test]
fn loads_near_the_limit_of_a_plastic_block_take_few_iterations_with_and_without_contact() {
    let block = |hypothesis: &str, load: &str| {
        Case::written_as(&format!(
            "
            mesh.rectangle = {{size = [1.0, 0.6], cells = [10, 6]}}
            mesh.order = 2
            time = {{end = 1.4, step = 0.05, scheme = 'implicit_euler'}}
            support = [{{on = ['bottom'], fix = ['y']}}, {{on = ['left'], fix = ['x']}}]
            [material]
            hypothesis = '{hypothesis}'
            elasticity = {{youngs_modulus = 1e11, poisson_ratio = 0.3}}
            viscoplasticity.perzyna = {{relaxation = 1e6, yield_stress = 1e8}}
            {load}"
        ))
    };
    let pressed = "[[contact]]
            on = ['top']
            normal.unilateral = {}
            obstacle.sphere = {centre = [0.0, 2.6], radius = 2.0}
            obstacle_load = {direction = [0.0, -1.0], force = '3.75e7*interpolate(t, 0, 0, 0.4, 1, 0.6, 1, 1.0, 0.1, 1.4, 1.0)'}";
    let loaded = "[[traction]]
            on = ['top']
            where = 'x < 0.5'
            value = [0.0, '-1.5e8*interpolate(t, 0, 0, 0.4, 1, 0.6, 1, 1.0, -0.5, 1.4, 1.0)']";
    for (hypothesis, load) in [("plane_stress", pressed), ("plane_strain", loaded)] {
        let case = block(hypothesis, load);
        let results = case.run(1);
        let [newton, linear] = ["newton_iterations", "linear_iterations"].map(|key| results.number(key));
        println!("{hypothesis}: {newton} and {linear}");
        assert!(newton <= 500.0 && linear <= 2000.0, "{hypothesis}: {newton}, {linear}");
    }
}

/// What friction alone holds slides as a whole where all points slide; and what springs press together has velocities far below the
/// pressures, as parameters of their graphs, in whose rounding they are lost.
#[test]
fn blocks_that_friction_holds_on_springs_take_few_iterations() {
    let block = r#"
        [mesh.rectangle]
        size = [0.1, 0.05]
        cells = [8, 3]
        [material]
        hypothesis = "plane_strain"
        elasticity = { youngs_modulus = 1e8, poisson_ratio = 0.3 }
        density = 2000.0
        [[traction]]
        on = ["top"]
        value = ["34300*min(t/0.2, 1)", "-1.357e5*min(t/0.1, 1)"]
        [[contact]]
        on = ["bottom"]
        normal.compliance = { stiffness = 5e9 }
        friction.coulomb = { coefficient = 0.3 }
        [time]
        scheme = "implicit_euler"
        end = 0.1
        step = 0.02
        [solver]
        accept = ["uniqueness"]
    "#;
    let pair = r#"
        [[mesh.rectangle]]
        name = "a"
        corner = [0.0053, 0.0]
        size = [0.1, 0.05]
        cells = [8, 3]
        [[mesh.rectangle]]
        name = "b"
        corner = [-0.02, -0.04]
        size = [0.14, 0.04]
        cells = [9, 3]
        [material]
        hypothesis = "plane_stress"
        elasticity = { youngs_modulus = 1e9, poisson_ratio = 0.2 }
        density = 2000.0
        viscoplasticity.maxwell = { relaxation_time = 0.3 }
        [[support]]
        on = ["b.bottom"]
        fix = "all"
        [[traction]]
        on = ["a.top"]
        value = ["2.74e5*min(t/0.2, 1)", "-1.17e6*min(t/0.1, 1)"]
        [[contact]]
        on = ["a.bottom"]
        against = ["b.top"]
        normal.compliance = { stiffness = 5e12, exponent = 1.5 }
        friction.coulomb = { coefficient = 0.4 }
        [time]
        scheme = "bdf2"
        end = 0.2
        step = 0.02
        [solver]
        accept = ["uniqueness"]
    "#;
    // The coefficient falls by a few per cent.
    let weakening = r#"
        [mesh.rectangle]
        size = [1.0, 0.5]
        cells = [4, 2]
        [material]
        hypothesis = "plane_stress"
        elasticity = { youngs_modulus = 1.3e6, poisson_ratio = 0.2 }
        damping = { stiffness = 0.001 }
        [[support]]
        on = ["top"]
        stiffness = { normal = 1300.0, tangential = 13000.0 }
        [[traction]]
        on = ["top"]
        value = ["4800*max(t - 0.012, 0)/0.03", "-12800*min(t/0.012, 1)"]
        [[contact]]
        on = ["bottom"]
        obstacle.plane = { point = [0.0, 0.0], normal = [0.0, 1.0] }
        normal.unilateral = {}
        friction.distance_weakening = { static = 0.13, dynamic = 0.078, distance = 0.0265, decay = "linear" }
        [time]
        scheme = "implicit_euler"
        end = 0.03
        step = 0.003
    "#;
    // After the first step, nothing moves.
    let resting = r#"
        material.hypothesis = "plane_strain"
        material.elasticity = { youngs_modulus = 5.4e5, poisson_ratio = 0.2 }
        [[mesh.rectangle]]
        name = "a"
        size = [1.0, 0.3]
        cells = [4, 2]
        [[mesh.rectangle]]
        name = "b"
        corner = [0.1, 0.3]
        size = [0.8, 0.25]
        cells = [7, 2]
        [[support]]
        on = ["a.bottom"]
        fix = "all"
        [[support]]
        on = ["a.left", "b.left"]
        stiffness = { normal = 540.0, tangential = 1620.0 }
        [[traction]]
        on = ["b.top"]
        value = [0.0, -1000.0]
        [[contact]]
        on = ["b.bottom"]
        against = ["a.top"]
        normal.compliance = { stiffness = 1e8 }
        friction.coulomb.coefficient = 0.2
        [time]
        scheme = "implicit_euler"
        end = 0.012
        step = 0.003
    "#;
    // A third block stands on the second one.
    let stacked = resting
        .replace("a.left\", \"b.left\"]", "a.left\", \"b.left\", \"d.left\"]")
        .replace("on = [\"b.top\"]\n        value", "on = [\"d.top\"]\n        value")
        + r#"
        [[mesh.rectangle]]
        name = "d"
        corner = [0.2, 0.55]
        size = [0.5, 0.2]
        cells = [2, 2]
        [[contact]]
        on = ["d.bottom"]
        against = ["b.top"]
        normal.compliance = { stiffness = 1.6e7 }
        friction.coulomb.coefficient = 0.26
    "#;
    // All points slide from one step on: full steps follow on descents, which solve their linear equations less accurately.
    let turning = r#"
        [mesh.rectangle]
        size = [0.2, 0.1]
        cells = [8, 3]
        [material]
        hypothesis = "plane_strain"
        elasticity = { youngs_modulus = 1e8, poisson_ratio = 0.3 }
        density = 2000.0
        [[support]]
        on = ["left", "right"]
        where = "y > 0.02"
        stiffness = { normal = 3e7, tangential = 5e7 }
        [[traction]]
        on = ["top"]
        value = ["1.5e5*sin(12*t)", "-3e5*min(t/0.05, 1)"]
        [[contact]]
        on = ["bottom"]
        normal.compliance = { stiffness = 3e10 }
        friction.tresca.bound = 3e4
        memory = { stiffness_rate = 3e9, decay_time = 0.2 }
        [time]
        scheme = "implicit_euler"
        end = 0.2
        step = 0.02
    "#;
    let all = [
        (block, 100.0),
        (pair, 200.0),
        (weakening, 200.0),
        (resting, 40.0),
        (&stacked, 200.0),
        (turning, 100.0),
    ];
    for (text, most) in all {
        let case = Case::written_as(text);
        for ranks in [1, 2] {
            let results = case.run(ranks);
            let newton = results.number("newton_iterations");
            let steps = results.number("steps");
            assert!(newton < most, "{steps} steps on {ranks} ranks: {newton}");
        }
    }
}

/// A force presses a sphere without mass on a block, beside the normal of the body and of the sphere where they touch.
#[test]
fn an_obstacle_that_is_pushed_obliquely_takes_few_iterations() {
    for law in [
        "displacement_graph = {points = [[0.0, 0.0], [0.0002, 911.0], [0.0004, 2604.0]], slope_after = 2e7}",
        "unilateral = {}",
    ] {
        let case = Case::written_as(&format!(
            "
            mesh.box = {{size = [1.0, 0.8, 0.5], cells = [4, 3, 2]}}
            material.elasticity = {{youngs_modulus = 6.6e5, poisson_ratio = 0.2}}
            support = [{{on = ['bottom'], fix = 'all'}}]
            time = {{scheme = 'implicit_euler', end = 0.03, step = 0.003}}
            [[contact]]
            on = ['top']
            obstacle.sphere = {{centre = [0.4685, 0.4577, 1.10006], radius = 0.6}}
            normal.{law}
            friction.coulomb.coefficient = 0.68
            obstacle_load = {{direction = [0.0, 0.1, -1.0], force = '126.8*min(t/0.012,1)'}}"
        ));
        for ranks in [1, 2] {
            let newton = case.run(ranks).number("newton_iterations");
            assert!(newton < 60.0, "{law} on {ranks} ranks: {newton}");
        }
    }
}
