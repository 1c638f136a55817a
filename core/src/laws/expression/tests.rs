use super::program::COUNT;
use super::{
    Enclosure, Expression, Formula, Interval, Names, OfCreep, OfMotion, REACH, Resolved, Scalar, Span,
    Unproven, Variable,
};

fn value(text: &str) -> f64 {
    Expression::parse(text)
        .unwrap_or_else(|fault| panic!("{text}: {fault:?}"))
        .evaluate(0.5, &[2.0, 3.0, 4.0])
}

#[test]
fn operators_bind_as_in_mathematics() {
    for (text, expected) in [
        ("1 + 2*3", 7.0),
        ("1 - 2 - 3", -4.0),
        ("12/2/3", 2.0),
        ("12/2*3", 18.0),
        ("-x^2", -4.0),
        ("(-x)^2", 4.0),
        ("2^3^2", 512.0),
        ("2^-1", 0.5),
        ("--3", 3.0),
        ("2*-3", -6.0),
        ("1e-3*x", 2e-3),
        (".5e1", 5.0),
        ("2.", 2.0),
        ("t + 10*x + 100*y + 1000*z", 4320.5),
        ("-10*min(t/0.1, 1)", -10.0),
        ("min(max(t, 0), 1)", 0.5),
        ("max(0, min(1, x/4))", 0.5),
        ("min(3, 2, 1, 2)", 1.0),
        ("3*max(1, 2)^2", 12.0),
        ("abs(-x) + sqrt(y + 1)", 4.0),
        ("cos(pi) + ln(e)", 0.0),
        ("sign(-2) + sign(0)", -1.0),
        ("\t x\n", 2.0),
        ("(x >= 2)*(y <= 3) + 10*(x < 2) + 100*(y > 3)", 1.0),
        ("1 + x > 2", 1.0),
        ("if(x > 1, 3, 4) + 10*if(0, 3, 1 - 1)", 3.0),
        ("step(t - 0.5) + 10*step(-1)", 1.0),
        ("pulse(t, 0.5, 1) + 10*pulse(t, 0, 0.5)", 1.0),
        ("2*interpolate(t, 0, -1, 1, 3)", 2.0),
        ("interpolate(x, 0, 1, 1, 3) + interpolate(-x, 0, 10, 1, 3)", 13.0),
        ("interpolate(x, 0, -(1 + 2), sqrt(4)*2, 2*5 - 1)", 3.0),
    ] {
        assert!((value(text) - expected).abs() < 1e-12, "{text} is {}, not {expected}", value(text));
    }
}

#[test]
fn faults_point_into_the_text() {
    for (text, at, message, help) in [
        ("", 0..0, "empty", "number"),
        ("1 +", 3..3, "ends too early", "follow"),
        ("2x", 1..2, "operator is missing", "2*x"),
        ("2 MPa", 2..3, "operator is missing", "2e6 for 2 MPa"),
        ("(1)(2)", 3..4, "operator is missing", "2*x"),
        ("(1", 0..1, "never closed", ")"),
        ("1)", 1..2, "no matching", "delete"),
        ("0,5", 1..2, "comma", "0.5"),
        ("x**2", 2..3, "two stars", "x^2"),
        ("x == 1", 2..3, "comparison", "<="),
        ("(x < 1 < 2)*2", 7..8, "comparison", "<="),
        ("if(x, 1)", 0..8, "has 2 arguments", "3"),
        ("pulse(t, 0.5, 0.1)", 0..5, "ends at 0.1, before its start at 0.5", "pulse(t, start, end)"),
        ("interpolate(t, 0, 1, 0.5)", 0..25, "3 numbers", "pairs"),
        ("interpolate(t, 0, 1, 0, 2)", 0..26, "0 is not above 0", "jump"),
        ("interpolate(t, 0, x)", 17..19, "numbers", "v1"),
        ("interpolate(t, 0, 0/0)", 17..21, "numbers", "v1"),
        ("interpolate(t, 0, 1e308*10)", 17..26, "numbers", "v1"),
        ("1 + x*(1e308*10)", 6..16, "`(1e308*10)` is inf", "correct"),
        ("1e300*1e300*t", 0..11, "`1e300*1e300` is inf", "correct"),
        ("t^2 - 1/0", 6..9, "`1/0` is inf", "correct"),
        ("max(x, -ln(0), 1)", 7..13, "`-ln(0)` is inf", "correct"),
        ("if(t < 1, 2, sqrt(1 - 2))", 13..24, "`sqrt(1 - 2)` is NaN", "correct"),
        (" 0*inf + pi", 1..11, "is NaN", "correct"),
        ("interpolate(1/0, 0, 1)", 12..15, "`1/0` is inf", "correct"),
        ("interpolate(t, 0, interpolate(1, 0, 1))", 17..38, "numbers", "v1"),
        ("1 + T", 4..5, "unknown name `T`", "did you mean `t`?"),
        ("sine(x)", 0..4, "unknown name `sine`", "did you mean `sin`?"),
        ("temperature", 0..11, "unknown name", "known variables: t (time in s), x ("),
        ("sin", 0..3, "no arguments", "sin(...)"),
        ("x(1)", 0..1, "not a function", "x*("),
        ("sin(1, 2)", 0..9, "2 arguments", "takes 1"),
        ("min(1)", 0..6, "1 argument", "at least 2"),
        ("1.2.3", 0..5, "not a number", "1e-3"),
        ("1e999", 0..5, "not a number", "1e-3"),
        ("x + é", 4..6, "unexpected `é`", "numbers"),
    ] {
        let fault = Expression::parse(text).expect_err(text);
        assert_eq!(fault.at, at, "{text}: {fault:?}");
        assert!(fault.message.contains(message), "{text}: {fault:?}");
        assert!(fault.help.contains(help), "{text}: {fault:?}");
    }
}

#[test]
fn parts_that_are_not_finite_and_do_not_count_are_allowed() {
    for (text, number) in [
        ("-inf", f64::NEG_INFINITY),
        ("if(t < 1, inf, 2)", f64::INFINITY),
        ("if(1 > 2, 1/0, 3)", 3.0),
        ("min(inf, 2*3)", 6.0),
        ("1/(1/0)", 0.0),
    ] {
        assert_eq!(value(text), number, "{text}");
    }
}

#[test]
fn deep_and_long_expressions_are_refused_before_they_can_hurt() {
    let nested = |levels: usize| format!("{}x{}", "(".repeat(levels), ")".repeat(levels));
    assert!(Expression::parse(&nested(150)).is_ok());
    assert!(Expression::parse(&nested(4000)).expect_err("nested").message.contains("too deeply"));
    assert!(Expression::parse(&"2^".repeat(3000)).expect_err("powers").message.contains("too deeply"));
    assert!(Expression::parse(&"1+".repeat(6000)).expect_err("long").message.contains("12000 characters"));
    assert_eq!(value(&format!("{}1", "-".repeat(9000))), 1.0);
}

#[test]
fn values_that_need_a_deep_stack_are_right() {
    let levels = 150;
    assert_eq!(value(&format!("{}0{}", "1+(".repeat(levels), ")".repeat(levels))), levels as f64);
}

#[test]
fn dependence_follows_the_variables_that_occur() {
    let scalar = |text: &str| Scalar::Expression(Expression::parse(text).expect(text));
    for constant in [Scalar::Number(3.0), scalar("sin(pi)")] {
        assert!(!constant.depends_on_time() && !constant.depends_on_position());
    }
    assert!(scalar("2*t").depends_on_time() && !scalar("2*t").depends_on_position());
    for variable in ["x", "y", "z"] {
        assert!(scalar(variable).depends_on_position() && !scalar(variable).depends_on_time());
    }
}

#[test]
fn pieces_change_where_another_one_holds() {
    let scalar = |text: &str| Scalar::Expression(Expression::parse(text).expect(text));
    for (text, before, after) in [
        ("min(t/0.1, 1)", 0.099, 0.101),
        ("max(0, 1 - abs(t - 0.6)/0.01)", 0.58, 0.605),
        ("1 - abs(t - x)", 0.49, 0.51),
        ("sign(t - 0.5)", 0.4, 0.6),
        ("floor(10*t)", 0.19, 0.21),
        ("ceil(10*t) + round(t)", 0.19, 0.21),
        ("step(t - 0.5)", 0.4, 0.6),
        ("pulse(t, 0.1, 0.5)", 0.4, 0.6),
        ("if(t < 0.5, t, 1)", 0.4, 0.6),
        ("interpolate(t, 0, 0, 0.25, 1, 1, 0)", 0.24, 0.26),
    ] {
        let scalar = scalar(text);
        let pieces = |time: f64| scalar.pieces(time, &[0.5]);
        assert!(scalar.has_pieces(), "{text}");
        assert_ne!(pieces(before), pieces(after), "{text}");
        assert_eq!(pieces(before), pieces(before - 1e-3), "{text}");
    }
    for smooth in ["sin(t)^2", "-t + exp(x)/2", "hypot(t, 1)"] {
        assert!(!scalar(smooth).has_pieces(), "{smooth}");
        assert_eq!(scalar(smooth).pieces(0.1, &[]), scalar(smooth).pieces(0.9, &[]), "{smooth}");
    }
    assert!(!Scalar::Number(1.0).has_pieces() && Scalar::Number(1.0).pieces(0.5, &[]) == 0);
}

#[test]
fn breakpoints_follow_from_arguments_that_are_linear_in_time() {
    let scalar = |text: &str| Scalar::Expression(Expression::parse(text).expect(text));
    for (text, switches, kinks) in [
        ("pulse(t, 0.1, 0.5)", &[0.1, 0.5][..], &[][..]),
        ("1e5*pulse(t, 0.1, 0.1 + 0.25)*sin(t)", &[0.1, 0.35], &[]),
        ("pulse(x, t, 2*t - 1)", &[], &[]),
        ("x*step(t - 0.5)", &[0.5], &[]),
        ("step(-(0.5 - 2*t)/4)", &[0.25], &[]),
        ("step(t^2 - 0.25) + step(t*t) + step(x - t) + step(3)", &[], &[]),
        ("if(t < 1, t, 2)", &[1.0], &[]),
        ("(t >= 0.25)*(2*t <= 1 + sqrt(4)) + (t > t)", &[0.25, 1.5], &[]),
        ("interpolate(t, 0, 0, 0.25, 1, 1, 0)", &[], &[0.0, 0.25, 1.0]),
        ("-3*interpolate(2*t - 1, 0, 0, 1, 1)", &[], &[0.5, 1.0]),
        ("interpolate(t, 0, 1, 1, 1, 2, 2, 3, 3, 4, 3)", &[], &[1.0, 3.0]),
        ("interpolate(x, 0, 0, 1, 1) + interpolate(sin(t), 0, 0, 1, 1)", &[], &[]),
        ("min(t/0.1, 1) + abs(t - 0.2) + sign(t - 0.3)", &[], &[]),
    ] {
        let found = scalar(text).breakpoints();
        let near = |found: &[f64], expected: &[f64]| {
            found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15)
        };
        assert!(near(&found.switches, switches) && near(&found.kinks, kinks), "{text}: {found:?}");
    }
}

#[test]
fn tables_over_time_know_where_they_reach() {
    let spans = |text: &str| Scalar::Expression(Expression::parse(text).expect(text)).breakpoints().spans;
    for (text, ends, is_cut_off) in [
        ("2*interpolate(t, 1, 0, 2, -1, 4, 3)", [1.0, 4.0], true),
        ("2*interpolate(t, 1, 0, 2, 1, 4, 3)", [1.0, 4.0], false),
        ("interpolate(3 - t, 1, 2, 2, 1, 4, 3)", [-1.0, 2.0], true),
        ("interpolate(3 - t, 1, 1, 2, 1, 3, 0, 4, 3)", [-1.0, 2.0], false),
        ("interpolate(t, 1, 0, 2, 1, 4, 1)", [1.0, 4.0], false),
        ("interpolate(t, 1, 0, 2, 1, 4, 0)", [1.0, 4.0], false),
        ("interpolate(2*t, 1, 0, 2, 1)", [0.5, 1.0], false),
    ] {
        assert_eq!(spans(text), [Span { ends, is_cut_off }], "{text}");
    }
    assert!(spans("interpolate(x, 0, 0, 1, 1) + interpolate(sin(t), 0, 0, 1, 1)").is_empty());
}

fn formula(text: &str) -> Formula<OfMotion> {
    Formula::parse(text).unwrap_or_else(|fault| panic!("{text}: {fault:?}"))
}

#[test]
fn formulas_have_their_own_variables() {
    assert_eq!(formula("2*v + 1").value(&[(Variable::V, 3.0)]), 7.0);
    let fault = Formula::<OfMotion>::parse("v + t").expect_err("time");
    assert!(
        fault.message.contains("unknown name `t`") && fault.help.contains("known variables: v (normal or sliding velocity (speed) in m/s), d (penetration in m); constants and functions: pi"),
        "{fault:?}"
    );
    assert!(Expression::parse("v").is_err());
    // Euler's number, where the creep strain is not meant.
    assert_eq!(formula("e").value(&[]), std::f64::consts::E);
    assert_eq!(Formula::<OfCreep>::parse("e").unwrap().value(&[(Variable::E, 3.0)]), 3.0);
    let read: Formula<OfMotion> = serde::Deserialize::deserialize(serde::de::value::StrDeserializer::<
        serde::de::value::Error,
    >::new("e*v"))
    .unwrap();
    assert_eq!(read.value(&[(Variable::V, 1.0)]), std::f64::consts::E);
    assert!(Formula::<OfMotion>::parse("v*inf").expect_err("inf").message.contains("infinite"));
}

/// A formula of every function, its derivative by differences and enclosures that contain both.
#[test]
fn derivatives_agree_with_differences_and_enclosures_contain_all() {
    let texts = [
        "v^3 - 2*v/(v^2 + 1)",
        "(v^2 + 0.1)^(-0.4)",
        "(v^2 + 0.1)^v",
        "2^v",
        "-v^2",
        "v^-2",
        "abs(v - 0.3)",
        "min(v, 0.5, v^2)",
        "max(sin(3*v), cos(v))",
        "atan2(v, 2 - v)",
        "hypot(v, 0.3)",
        "sign(v)*v",
        "floor(3*v)*v",
        "ceil(v) + v",
        "round(2*v)",
        "step(v - 0.1)*exp(v)",
        "if(v < 0, v, v^2)",
        "(v >= 0.2)*v + (v <= 0.1) + (v > 3) ",
        "pulse(v, 0.1, 0.5)*v",
        "interpolate(v, -1, 2, 0, 0, 1, 5)",
        "sqrt(v^2 + 1)",
        "cbrt(v)",
        "ln(v^2 + 0.2)",
        "log10(v^2 + 0.2)",
        "tan(v/4)",
        "asin(v/4)",
        "acos(v/4)",
        "atan(5*v)",
        "sinh(v)",
        "cosh(v)",
        "tanh(3*v)",
        "v*exp(-v/0.02)",
        "3",
        "sqrt(v + 5)",
    ];
    for text in texts {
        let formula = formula(text);
        let program = &formula.expression.program;
        for step in -30..30 {
            let (low, width) = (f64::from(step) * 0.0937 + 0.001, 0.05);
            let mut ranges = [Interval::from(0.0); COUNT];
            ranges[Variable::V as usize] = Interval::new(low, low + width);
            let known = program.enclose(&ranges, Variable::V);
            for part in 0..=10 {
                let v = low + width * f64::from(part) / 10.0;
                let v = v.min(low + width);
                let [value, slope] = formula.differentiate(&[(Variable::V, v)], Variable::V);
                assert_eq!(value, formula.value(&[(Variable::V, v)]), "{text}");
                assert!(
                    known.value.contains(value) && known.slope.contains(slope),
                    "{text} at {v}: {value} {slope} {known:?}"
                );
                let growth = value + v * slope;
                let rounding = 1e-14 * (value.abs() + (v * slope).abs());
                assert!(
                    known.growth.low <= growth + rounding && growth - rounding <= known.growth.high,
                    "{text} at {v}: {growth} {known:?}"
                );
                if known.is_one_piece && part > 0 && part < 10 {
                    let at = |v| formula.value(&[(Variable::V, v)]);
                    let by_difference = (at(v + 1e-6) - at(v - 1e-6)) / 2e-6;
                    assert!(
                        (by_difference - slope).abs() <= 1e-5 * (1.0 + slope.abs()),
                        "{text} at {v}: {slope} {by_difference}"
                    );
                }
            }
        }
    }
}

#[test]
fn derivatives_of_terms_that_nearly_cancel_are_enclosed_sharply() {
    // d/dv of v/(1 + v) is 1/(1 + v)^2, that of v/sqrt(1 + v^2) is (1 + v^2)^(-3/2).
    for v in [1e-3_f64, 1.0, 1e4] {
        let part = [(Variable::V, Interval::new(v, 1.01 * v))];
        for (text, product, exact) in [
            ("1/(1 + v)", "v/(1 + v)", (1.0 + v).powi(-2)),
            ("1/sqrt(1 + v^2)", "v/sqrt(1 + v^2)", (1.0 + v * v).powf(-1.5)),
        ] {
            let growth = formula(text).enclose(&part, Variable::V).growth;
            let slope = formula(product).enclose(&part, Variable::V).slope;
            for found in [growth, slope] {
                let is_sharp = found.low > 0.9 * exact && found.high < 1.1 * exact;
                assert!(is_sharp && found.contains(exact), "{text} at {v}: {found:?} {exact}");
            }
        }
    }
}

#[test]
fn pieces_begin_where_conditions_change() {
    let all = Interval::new(-REACH, REACH);
    let borders = |text: &str| formula(text).borders(&[(Variable::V, all)], Variable::V).unwrap();
    assert!(borders("v*exp(-v)").is_empty());
    assert_eq!(borders("if(v < 0.1, 1, 2)"), [[0.1_f64.next_down(), 0.1]]);
    assert_eq!(borders("if(v <= 0.1, 1, 2)"), [[0.1, 0.1_f64.next_up()]]);
    let found = borders("sign(v) + min(3, abs(v - 1))");
    let places: Vec<f64> = found.iter().map(|border| (border[0] + border[1]) / 2.0).collect();
    assert!(
        places.iter().zip([-2.0, 0.0, 1.0, 4.0]).all(|(a, b)| (a - b).abs() < 1e-15) && places.len() == 4,
        "{places:?}"
    );
    let none = |text: &str| formula(text).borders(&[(Variable::V, all)], Variable::V).unwrap_err();
    assert!(matches!(none("floor(v)"), Unproven::Pieces(_)));
    assert!(matches!(none("if(v*v - v^2 < 1e-300, 1, 2)"), Unproven::Pieces(_)));
}

#[test]
fn suprema_are_sharp_to_a_per_cent_and_never_too_small() {
    let sup = |text: &str, low: f64, high: f64, of: fn(&Enclosure) -> Interval| {
        formula(text).supremum([&[(Variable::V, Interval::new(low, high))][..]], Variable::V, of)
    };
    let fall = |text: &str, low: f64| sup(text, low, REACH, |known| -known.slope).unwrap().bound;
    // The steepest decrease of v exp(-v / w) is exp(-2), at 2 w.
    for width in [1e-6, 0.02, 3.0, 1e6] {
        let found = fall(&format!("4e3*v*exp(-v/{width})"), 0.0) / 4e3;
        assert!((1.0..1.011).contains(&(found / (-2.0_f64).exp())), "{found}");
    }
    for increasing in
        ["tanh(v/0.1)", "v^3", "v - tanh(v)", "v", "sqrt(v)", "v + 0.5*sin(v)", "1 - exp(-v/0.02)"]
    {
        assert!(fall(increasing, 0.0) <= 1e-14, "{increasing}: {}", fall(increasing, 0.0));
    }
    let waves = [
        ("sin(v)", 1.0),
        ("50*v + 30*sin(v/0.0005)", 59950.0),
        ("100*cos(v/0.01)", 1e4),
        ("-sin(v)", 1.0),
        ("-2000*v^1", 2000.0),
    ];
    for (wave, steepest) in waves {
        let share = fall(wave, -REACH) / steepest;
        assert!((1.0..1.011).contains(&share), "{wave}: {share}");
    }
    for text in ["sinh(v)", "v^3", "tanh(v)", "asin(v)", "cbrt(v)", "v/1e-3", "tan(v)"] {
        let tiny = [
            &[(Variable::V, Interval::new(0.0, 1e-300))][..],
            &[(Variable::V, Interval::new(5e-324, 1e-300))][..],
        ];
        for range in tiny {
            assert!(formula(text).enclose(range, Variable::V).value.low >= 0.0, "{text}");
        }
    }
    let right_angle = formula("acos(v)").enclose(&[(Variable::V, Interval::from(0.0))], Variable::V).value;
    assert!(right_angle.low < right_angle.high && right_angle.contains(std::f64::consts::FRAC_PI_2));
    assert_eq!(formula("10*v^0").differentiate(&[(Variable::V, 0.0)], Variable::V), [10.0, 0.0]);
    assert!((fall("v^3 + 0.1*sin(20*v)", 0.0) / 2.0 - 0.97).abs() < 0.04, "beside slopes of 1e60");
    assert!((fall("2*exp(-v/0.5)", 0.0) / 4.0 - 1.0).abs() < 0.011);
    assert_eq!(fall("-sqrt(v)", 0.0), f64::INFINITY, "a vertical tangent");
    let top = sup("v*exp(-v)", 0.0, REACH, |known| known.value).unwrap().bound * 1.0_f64.exp();
    assert!((1.0..1.011).contains(&top), "{top}");
    assert!(
        matches!(sup("sqrt(v)", -1.0, 1.0, |known| known.value), Err(Unproven::Undefined(at)) if at[Variable::V as usize] <= 0.0)
    );
    assert!(
        matches!(sup("1/(1 + v)", -2.0, 2.0, |known| known.slope), Err(Unproven::Undefined(at)) if (at[Variable::V as usize] + 1.0).abs() < 1e-9)
    );
    assert!(matches!(sup("ln(v - 2)", 0.0, 4.0, |known| known.value), Err(Unproven::Undefined(_))));
}

fn resolved(text: &str) -> Result<Resolved, super::Fault> {
    let names = [("V", 0.1), ("n_2", -3.0), ("t0", 1e-7), ("x", 9.0), ("sine", 7.0)];
    Expression::resolve(
        text,
        Variable::OF_TIME_AND_PLACE,
        &Names::from(names.map(|(name, value)| (name.to_owned(), value))),
    )
}

#[test]
fn names_of_numbers_are_constants() {
    for (text, expected, with_numbers) in [
        ("V", 0.1, "(0.1)"),
        ("n_2^2 + V*t0", 9.0 + 1e-8, "(-3.0)^2 + (0.1)*(1e-7)"),
        ("2*V*y", 0.6, "2*(0.1)*y"),
        ("-n_2*t", 1.5, "-(-3.0)*t"),
        (
            "interpolate(t, t0, 2*V, 1 + V, n_2) - pulse(t, V, 1)",
            0.2 - 3.2 * 0.4999999 / 1.0999999 - 1.0,
            "interpolate(t, (1e-7), 2*(0.1), 1 + (0.1), (-3.0)) - pulse(t, (0.1), 1)",
        ),
    ] {
        let Resolved { expression, .. } = resolved(text).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
        let found = expression.evaluate(0.5, &[2.0, 3.0, 4.0]);
        assert!((found - expected).abs() < 1e-12, "{text} is {found}, not {expected}");
        assert_eq!(expression.text(), with_numbers);
        assert_eq!(value(with_numbers), found, "the text gives the same bits");
    }
    assert_eq!(resolved("V + n_2*sin(V)").expect("valid").names, ["V", "n_2", "V"]);
}

#[test]
fn faults_of_names_of_numbers_point_into_the_text() {
    for (text, at, message, help) in [
        ("1 + W", 4..5, "unknown name `W`", "known variables: t (time in s), x ("),
        ("n_3*t", 0..3, "unknown name `n_3`", "did you mean `n_2`?"),
        ("x + 1", 0..1, "`x` is a parameter, but here also the first coordinate", "another name"),
        ("3*time", 2..6, "unknown name `time`", "did you mean `t`?"),
        ("V(t)", 0..1, "`V` is not a function", "V*("),
        ("2V", 1..2, "operator is missing", "2*x"),
        ("pulse(t, 1, V)", 0..5, "ends at 0.1, before its start at 1", "pulse(t, start, end)"),
    ] {
        let fault = resolved(text).expect_err(text);
        assert_eq!(fault.at, at, "{text}: {fault:?}");
        assert!(fault.message.contains(message) && fault.help.contains(help), "{text}: {fault:?}");
        assert_eq!(fault.is_unknown_name, message.contains("unknown"));
    }
}

#[test]
fn expressions_with_the_numbers_are_never_longer_or_deeper_than_others() {
    let long = "V+".repeat(4000) + "V";
    assert!(resolved(&long).expect_err("long").message.contains("characters"));
    let nested = |levels: usize| format!("{}V{}", "(".repeat(levels), ")".repeat(levels));
    let deepest = (0..400).rfind(|levels| resolved(&nested(*levels)).is_ok()).expect("some");
    let text = resolved(&nested(deepest)).expect("deep").expression.text().to_owned();
    assert!(Expression::parse(&text).is_ok(), "{deepest} levels");
    assert!(resolved(&nested(deepest + 1)).expect_err("deeper").message.contains("too deeply"));
}
