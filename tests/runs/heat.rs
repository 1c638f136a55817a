//! Runs of bodies with heat: files, stages, messages.

use crate::{case::Case, hdf5_file::NumberFile};

const HEAT: &str = "{ conductivity = 2, capacity = 3 }";
const INSULATOR: &str = "{ conductivity = 1e-9, capacity = 3, dissipation_share = 0 }";

fn square() -> Case {
    Case::square(6).set("time.end", "0.25").set("checkpoint.every", "2")
}

fn heated() -> Case {
    square()
        .set("material.heat", HEAT)
        .set("initial.temperature", "'290 + 10*x*y'")
        .set("heat", "[{ on = ['left'], temperature = 300 }, { on = ['top'], flux = '50*t' }]")
        .set("output.probe_also", "['temperature']")
}

#[test]
fn heat_leaves_the_motion_as_it_is_and_is_written_where_it_is_called_for() {
    let (plain, with) = (square().run_and_keep(2), heated().run_and_keep(2));
    let (plain, with) = (plain.results(), with.results());
    let [plain_rows, rows] = [&plain, &with].map(|results| results.table("history.csv"));
    for column in &plain_rows.columns {
        assert_eq!(plain_rows.words(column), rows.words(column), "{column}");
    }
    assert_eq!(rows.columns[plain_rows.columns.len()..].first().map(String::as_str), Some("stored_heat"));
    assert_eq!(plain.text("resultants.csv"), with.text("resultants.csv"));
    for (results, there) in [(&with, true), (&plain, false)] {
        let summary = results.summary();
        let effects = summary["effects"].as_array().expect("a list");
        assert_eq!(effects.iter().any(|name| name == "heat"), there, "{summary}");
        assert_eq!(summary["inventory"]["history_bytes"]["temperature"].is_null(), !there);
        assert_eq!(summary["max_heat_imbalance"].is_null(), !there);
        let fields = NumberFile::open(&results.path("fields.vtkhdf")).names("Fields");
        assert_eq!(fields.iter().any(|name| name == "temperature"), there, "{fields:?}");
        let checkpoint = NumberFile::open(&results.path("checkpoint-4.h5"));
        assert_eq!(checkpoint.checkpoint_tables().iter().any(|(name, _)| name == "temperature"), there);
    }
    assert!(with.number("max_heat_imbalance") < 1e-10);
    // The same on one rank.
    let one = heated().run_and_keep(1);
    let (one, two) = (one.results().table("probes.csv"), with.table("probes.csv"));
    for (a, b) in one.numbers("temperature").iter().zip(two.numbers("temperature")) {
        assert!((a - b).abs() < 1e-9 && *a > 285.0, "{a} {b}");
    }
}

#[test]
fn a_flux_that_ends_at_nodes_enters_whole() {
    for order in ["1", "2"] {
        let case = square()
            .set("mesh.rectangle.cells", "[8, 8]")
            .set("mesh.order", order)
            .set("material.heat", HEAT)
            .set("initial.temperature", "290")
            .set("heat", "[{ on = ['top'], flux = '60*(x > 0.25)*(x < 0.75)' }]");
        let results = case.run(2);
        let entered: f64 =
            results.table("history.csv").numbers("entered_heat").last().copied().expect("rows");
        assert!((entered - 60.0 * 0.5 * 0.25).abs() < 1e-9, "{entered}");
    }
}

#[test]
fn a_stage_goes_on_from_the_temperature_of_the_state_it_starts_from() {
    let first = heated().run_and_keep(1);
    let state = first.results().path("checkpoint-4.h5");
    let last = first.results().table("probes.csv").last("temperature");
    let stage = || {
        let from = format!("'{}'", state.display());
        square().set("initial", &format!("{{ from = {from} }}")).set("output.probe_also", "['temperature']")
    };
    let insulated = stage().set("material.heat", INSULATOR).run_and_keep(2);
    let kept = insulated.results().table("probes.csv").last("temperature");
    assert!((kept - last).abs() < 1e-6, "{kept} {last}");
    // A state without temperature.
    let cold = square().run_and_keep(1);
    let from = format!("{{ from = '{}' }}", cold.results().path("checkpoint-4.h5").display());
    let refused = square().set("initial", &from).set("material.heat", HEAT);
    refused
        .run_with(2, &[])
        .expect(2)
        .says("has no temperature")
        .says("add temperature = 293.0 beside `from`");
}

/// Two blocks that slide along each other, insulated and so conductive that each has one temperature.
fn pair(share: &str, side: &str, sliding: &str) -> Case {
    let text = "
        mesh.rectangle = [{ name = 'lower', size = [1.0, 0.5], cells = [5, 3] },
                          { name = 'upper', corner = [0.25, 0.5], size = [0.5, 0.25], cells = [4, 2] }]
        material.hypothesis = 'plane_strain'
        material.elasticity = { youngs_modulus = 1e9, poisson_ratio = 0.3 }
        material.heat = { conductivity = 1e6, volumetric_capacity = 300 }
        support = [{ on = ['lower.bottom'], fix = 'all' }, { on = ['upper.top'], fix = ['x'], velocity = [0.1] }]
        traction = [{ on = ['upper.top'], pressure = 1000 }]
        contact = [{ on = ['upper.bottom'], against = ['lower.top'], normal.unilateral = {}, friction.coulomb.coefficient = 0.4 }]
        initial.temperature = 300
        time = { end = 1.0, step = 0.05, scheme = 'bdf2' }
        output.probe = [{ name = 'lower', point = [0.1, 0.1] }, { name = 'upper', point = [0.5, 0.7] }]
        output.probe_also = ['temperature']";
    let joined = text.split('\n').map(str::trim).collect::<Vec<_>>().join("\n").replace(",\n", ", ");
    let case = Case::written_as(&joined).set("contact.0.side", side).set("contact.0.sliding", sliding);
    if share.is_empty() { case } else { case.set("contact.0.friction_heat", share) }
}

#[test]
fn heat_that_stays_in_an_insulated_body_or_does_not_pass_its_boundary_is_balanced() {
    let bar = || {
        Case::written_as(
            "
            mesh.rectangle = {size = [1.0, 0.5], cells = [4, 2]}
            support = [{on = ['bottom'], fix = 'all'}]
            time = {end = 0.01, step = 0.001, scheme = 'implicit_euler'}
            [material]
            hypothesis = 'plane_strain'
            elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}
            heat = {conductivity = 4.55e4, volumetric_capacity = 5e5}",
        )
    };
    let insulated = bar().set("initial.temperature", "'300 + 3*x'");
    let at_ambient = bar()
        .set("initial.temperature", "300.1")
        .set("heat", "[{ on = ['top'], convection = { coefficient = 7.3, ambient = 300.1 } }]");
    for case in [insulated, at_ambient] {
        for ranks in [1, 2] {
            case.run_with(ranks, &["--force"]).expect(0);
            let most = case.results().number("max_heat_imbalance");
            assert!(most < 1e-9, "{most:e}");
        }
    }
}

#[test]
fn the_heat_of_friction_between_bodies_is_divided_by_the_share() {
    // 0.4 * 1000 Pa * 0.5 m * 0.1 m; the capacities are 150 and 37.5 J/(m K).
    for (share, of_upper, side, sliding, ranks) in [
        ("", 0.5, "'on'", "'small'", 1),
        ("0.2", 0.2, "'on'", "'finite'", 2),
        ("0.2", 0.2, "'against'", "'finite'", 3),
    ] {
        let case = pair(share, side, sliding).run_and_keep(ranks);
        let results = case.results();
        let rows = results.table("history.csv");
        let [heat, lost] = ["friction_heat", "contact_dissipation"].map(|column| rows.last(column));
        assert!((heat - lost).abs() < 1e-6 * lost && (lost - 20.0).abs() < 0.05, "{side}: {heat} {lost}");
        assert!(results.number("max_heat_imbalance") < 1e-10);
        let probes = results.table("probes.csv");
        for (name, capacity, share) in [("upper", 37.5, of_upper), ("lower", 150.0, 1.0 - of_upper)] {
            let rise = probes.only("probe", name).last("temperature") - 300.0;
            let expected = share * heat / capacity;
            assert!((rise - expected).abs() < 1e-3 * expected, "{name} {side} {sliding}: {rise} {expected}");
        }
    }
}

#[test]
fn steps_that_are_rejected_leave_no_heat_behind() {
    let adaptive = || {
        Case::of("sliding_block")
            .without("check")
            .set("material.heat", HEAT)
            .set("initial.temperature", "300")
            .set("time.adaptive", "{ tolerance = 1e-5, smallest_step = 1e-6, largest_step = 0.01 }")
            .set("time.scheme", "'bdf2'")
    };
    let case = adaptive().run_and_keep(2);
    let results = case.results();
    assert!(results.number("rejected_steps") > 0.0, "{}", results.summary());
    let rows = results.table("history.csv");
    let [friction, flow, stored] =
        ["friction_heat", "flow_heat", "stored_heat"].map(|column| rows.last(column));
    let [contact, viscous] = ["contact_dissipation", "viscous_dissipation"].map(|column| rows.last(column));
    assert!(
        friction > 0.0 && (stored - friction - flow).abs() < 1e-10 * stored,
        "{friction} {flow} {stored}"
    );
    assert!((flow - viscous).abs() < 1e-10 * viscous.abs().max(friction), "{flow} {viscous}");
    assert!((friction - contact).abs() < 1e-7 * contact, "{friction} {contact}");
}

#[test]
fn a_body_that_warms_evenly_takes_long_steps() {
    let bar = |scheme: &str| {
        Case::written_as(&format!(
            "[mesh.rectangle]\nsize = [1, 0.1]\ncells = [4, 4]\n[material]\nhypothesis = \"plane_strain\"\n\
             elasticity = {{ youngs_modulus = 2e11, poisson_ratio = 0.3 }}\n\
             heat = {{ conductivity = 50, volumetric_capacity = 3.6e6, expansion = 1.2e-5, reference = 293 }}\n\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n\
             [[heat]]\non = [\"top\"]\nflux = 1e4\n[initial]\ntemperature = 293\n\
             [time]\nscheme = \"{scheme}\"\nend = 2000\nstep = 1\nadaptive = {{ smallest_step = 0.01, largest_step = 200 }}\n"
        ))
    };
    for (scheme, most) in [("implicit_euler", 200.0), ("bdf2", 160.0)] {
        let case = bar(scheme);
        let case = case.run_and_keep(1);
        let results = case.results();
        assert!(
            results.number("steps") < most && results.number("rejected_steps") < 20.0,
            "{}",
            results.summary()
        );
    }
}

#[test]
fn adaptive_steps_follow_the_temperature_of_a_body_that_does_not_move() {
    // A bar at 300 K whose end is suddenly at 400 K: 300 + 100 erfc(x / (2 sqrt(a t))).
    let bar = || {
        Case::written_as(
            "[mesh.rectangle]\nsize = [1, 0.05]\ncells = [80, 1]\n[material]\nhypothesis = \"plane_strain\"\n\
             elasticity = { youngs_modulus = 1e9, poisson_ratio = 0.3 }\n\
             heat = { conductivity = 50, volumetric_capacity = 4e6 }\n[[support]]\non = [\"left\"]\nfix = \"all\"\n\
             [[heat]]\non = [\"left\"]\ntemperature = 400\n[initial]\ntemperature = 300\n\
             [time]\nscheme = \"implicit_euler\"\nend = 2000\nstep = 10\n\
             adaptive = { smallest_step = 0.01, largest_step = 1000 }\n[checkpoint]\nevery = 30\nkeep = 5\n\
             [output]\nprobe = [{ name = \"at\", point = [0.1, 0.025] }]\nprobe_also = [\"temperature\"]\n",
        )
    };
    let straight = bar().run_and_keep(1);
    let loose = bar().set("time.adaptive.tolerance", "1e-2").run_and_keep(2);
    let [errors, loose_errors] = [&straight, &loose].map(|case| {
        let rows = case.results().table("probes.csv");
        let times = rows.numbers("time");
        let error =
            |(time, found): (&f64, f64)| (found - 300.0 - 100.0 * erfc(14.142136 / time.sqrt())).abs();
        times.iter().zip(rows.numbers("temperature")).skip(1).map(error).fold(0.0, f64::max)
    });
    assert!(errors < 0.5 && loose_errors < 1.5 && loose_errors > 1.5 * errors, "{errors} {loose_errors}");
    let steps = straight.results().number("steps");
    assert!(steps < 150.0 && loose.results().number("steps") < 60.0, "{steps}");
    // From its middle on, the same to the last bit.
    let restarted = bar();
    let state = straight.results().path("checkpoint-60.h5");
    restarted.run_with(1, &["--restart", state.to_str().expect("a path")]).expect(0);
    let [whole, rest] = [&straight, &restarted].map(|case| case.results().table("probes.csv").rows);
    assert!(rest.len() > 20 && whole.ends_with(&rest[1..]), "{rest:?}");
}

#[test]
fn a_friction_coefficient_sees_temperature_and_places_of_the_boundaries_on_whichever_side_has_the_law() {
    // A pad at 400 K, of which one half is rough, slides on a plate at 300 K. Supports leave the law to the pad or to the plate.
    let pulled = |coefficient: &str, support: &str, sliding: &str| {
        let case = Case::written_as(&format!(
            "[[mesh.rectangle]]\nname = \"plate\"\nsize = [3, 0.1]\ncells = [60, 1]\n\
             [[mesh.rectangle]]\nname = \"pad\"\ncorner = [0.2, 0.1]\nsize = [0.4, 0.1]\ncells = [8, 1]\n\
             [material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0 }}\n\
             heat = {{ conductivity = 1e-6, volumetric_capacity = 1e9 }}\n\
             [initial]\ntemperature = \"300 + 100*step(y - 0.1001)\"\n\
             [[heat]]\non = [\"pad.bottom\"]\ntemperature = 400\n[[heat]]\non = [\"plate.top\"]\ntemperature = 300\n\
             [[support]]\non = [\"plate.bottom\"]\nfix = \"all\"\ndisplacement = [\"-0.5*t\", 0]\n\
             [[support]]\non = {support}\nfix = [\"x\"]\n[[traction]]\non = [\"pad.top\"]\nvalue = [0, -1e4]\n\
             [[contact]]\non = [\"pad.bottom\"]\nagainst = [\"plate.top\"]\n{sliding}\nnormal.unilateral = {{}}\n\
             friction_heat = 0\nfriction.expression.coefficient = \"{coefficient}\"\n\
             [time]\nscheme = \"implicit_euler\"\nend = 1\nstep = 0.1\n"
        ));
        let case = case.run_and_keep(2);
        let rows = case.results().table("resultants.csv").only("source", "contact pad.bottom");
        [rows.last("force_x"), rows.numbers("force_x")[4]]
    };
    let [top, sides] = ["[\"pad.top\"]", "[\"pad.left\", \"pad.right\"]"];
    for sliding in ["", "sliding = \"finite\""] {
        for support in [top, sides] {
            let hot = pulled("0.1 + 0.4*step(temperature - 350)", support, sliding);
            assert!((hot[0] + 2000.0).abs() < 1e-4, "{support} {sliding}: {hot:?}");
        }
    }
    // The weights of the nodes differ, but the rough half stays rough as the plate passes.
    let [[end, early], [end_of_plate, early_of_plate]] =
        [top, sides].map(|support| pulled("0.1 + 0.4*step(x - 0.41)", support, "sliding = \"finite\""));
    assert!((end - early).abs() < 1e-3 * early.abs(), "{end} {early}");
    for force in [end_of_plate, early_of_plate] {
        assert!((force / end - 1.0).abs() < 0.1, "{force} N in place of {end} N");
    }
}

/// The complementary error function of a number from 0 on (Abramowitz and Stegun, 7.1.26, to 1.5e-7).
fn erfc(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.3275911 * x);
    let sum = [0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429];
    sum.iter().rev().fold(0.0, |sum, factor| t * (factor + sum)) * (-x * x).exp()
}

#[test]
fn elastic_stress_that_is_a_formula_releases_no_heat() {
    let softening = "{ youngs_modulus = 1000, poisson_ratio = 0.3, expression = { shear_factor = '1/(1 + e)', reference_strain = 1 } }";
    let kept = heated()
        .without("material.viscoplasticity")
        .without("material.viscosity")
        .set("material.hypothesis", "'plane_strain'")
        .set("material.elasticity", softening)
        .set("contact.0.redistribute_mass", "true")
        .set("time.scheme", "'midpoint'")
        .run_and_keep(1);
    let heats = kept.results().table("history.csv").numbers("flow_heat");
    assert!(heats.iter().all(|heat| *heat == 0.0), "{heats:?}");
}

#[test]
fn temperatures_below_zero_kelvin_are_refused_where_they_are_given_and_where_they_come_about() {
    let celsius = heated().set("initial.temperature", "-10");
    celsius
        .run_with(2, &[])
        .expect(2)
        .says("initial.temperature is -10 at")
        .says("temperatures are in K, not below 0");
    let given = heated().set("heat.0.temperature", "'200 - 1000*t'");
    given.run_with(2, &[]).expect(1).says("heat.0: the temperature is").says("temperatures are in K");
    let drained = heated().set("heat.1.flux", "-1e5");
    drained
        .run_with(1, &[])
        .expect(1)
        .says("the temperature at the end of the step is -")
        .says("check the fluxes");
}

/// Long steps, whose solution is not exact anywhere; temperatures there are differences, counted from 0.
#[test]
fn rounding_errors_below_zero_kelvin_are_none_and_given_temperatures_are_exact() {
    let case = square()
        .set("material.heat", "{ conductivity = 50, capacity = 1e-3 }")
        .set("initial.temperature", "0")
        .set("heat", "[{ on = ['left'], temperature = '600*t' }, { on = ['right'], temperature = '0' }]")
        .set("output.probe_also", "['temperature']")
        .set("output.probe", "[{ name = 'held', point = [1, 0.5] }, { name = 'hot', point = [0, 0.5] }]")
        .run_and_keep(1);
    let probes = case.results().table("probes.csv");
    let held = probes.only("probe", "held").numbers("temperature");
    assert!(held.iter().all(|value| *value == 0.0), "{held:?}");
    let (times, hot) =
        (probes.only("probe", "hot").numbers("time"), probes.only("probe", "hot").numbers("temperature"));
    assert!(times.iter().zip(&hot).all(|(time, value)| (600.0 * time - value).abs() < 1e-12), "{hot:?}");
}

#[test]
fn a_step_that_fails_leaves_temperature_and_motion_as_they_were() {
    let case = |end: &str, every: &str| {
        heated()
            .set("material.heat", "{ conductivity = 2, capacity = 3, expansion = 1e-4, reference = 290 }")
            .set("heat.1.flux", "'50*t'")
            .set("time.end", end)
            .set("checkpoint.every", every)
    };
    let before = case("0.1875", "3").run_and_keep(1);
    let before = NumberFile::open(&before.results().path("checkpoint-3.h5")).checkpoint_tables();
    for (key, value, words) in [
        ("heat.1.flux", "'50*t + 0*sqrt(0.2 - t)'", "the flux is NaN at t = 0.25 s"),
        ("heat.1.flux", "'50*t - 1e9*exp(1000*(t - 0.25))'", "the temperature at the end of the step is -"),
        ("traction.0.value", "[0, '-10 + 0*sqrt(0.2 - t)']", "component y is NaN at t = 0.25 s"),
    ] {
        let case = case("0.25", "2").set(key, value);
        case.run_with(1, &[]).expect(1).says(words);
        assert_eq!(case.results().checkpoints().first(), Some(&3), "{words}");
        let after = NumberFile::open(&case.results().path("checkpoint-3.h5")).checkpoint_tables();
        for ((name, values), (_, expected)) in after.iter().zip(&before) {
            assert_eq!(values, expected, "{name:?}: {words}");
        }
        assert_eq!(after.len(), before.len());
    }
}

#[test]
fn an_adaptive_step_whose_temperature_is_not_found_is_repeated_with_a_shorter_one() {
    // A short flux out of the body takes more heat than there is where a step holds it for long.
    let pulse =
        || heated().set("heat.1.flux", "'-1e4*exp(-((t - 0.0625)/0.001)^2)'").set("time.end", "0.125");
    let words = "the temperature at the end of the step is -";
    pulse().run_with(1, &[]).expect(1).says(words);
    let adaptive = |smallest: f64| {
        let keys = format!("{{ tolerance = 0.9, smallest_step = {smallest}, largest_step = 0.0625 }}");
        pulse().set("time.adaptive", &keys)
    };
    adaptive(0.03).run_with(1, &[]).expect(1).says(words);
    let results = adaptive(1e-4).run_and_keep(2);
    let results = results.results();
    assert!(results.number("rejected_steps") >= 1.0 && results.number("max_heat_imbalance") < 1e-10);
    let lengths = results.table("history.csv").numbers("dt");
    assert!(lengths.iter().all(|length| *length > 2e-3), "no shorter than it must be: {lengths:?}");
}

#[test]
fn heat_without_effect_and_parts_that_facets_do_not_follow_are_warned_of() {
    let heat = "[{ on = ['left'], temperature = 300 }, { on = ['left'], flux = 5 }, { on = ['top'], where = 'x < 0.4', flux = 5 },
                 { on = ['left', 'right'], where = 'y > 0.5', convection = { coefficient = 1, ambient = 300 } },
                 { on = ['left'], temperature = 310 }]";
    let case = heated().set("heat", &heat.replace('\n', "")).set("time.end", "0.0625");
    for ranks in [1, 2] {
        case.run_with(ranks, &["--force"])
            .expect(0)
            .says("heat.1.flux has no effect on 6 facets (1 m) of left, where another table gives the temperature")
            .says("heat.2.where: the condition changes within 1 facet (0.166667 m) of top")
            .says("heat.3.convection has no effect on 3 facets (0.5 m) of left, right")
            .says("heat.4.temperature has no effect on 6 facets (1 m) of left");
        let warnings = case.results().summary()["warnings"].clone();
        assert_eq!(warnings.as_array().map(Vec::len), Some(4), "{warnings}");
    }
}
