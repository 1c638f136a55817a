use super::{Expression, Names, Resolved, Scalar};

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
        ("interpolate(t, 0, interpolate(1, 0, 1))", 17..38, "numbers", "v1"),
        ("1 + T", 4..5, "unknown name `T`", "did you mean `t`?"),
        ("sine(x)", 0..4, "unknown name `sine`", "did you mean `sin`?"),
        ("temperature", 0..11, "unknown name", "known names: t, x, y, z"),
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

fn resolved(text: &str) -> Result<Resolved, super::Fault> {
    let names = [("V", 0.1), ("n_2", -3.0), ("t0", 1e-7), ("x", 9.0), ("sine", 7.0)];
    Expression::resolve(text, &Names::from(names.map(|(name, value)| (name.to_owned(), value))))
}

#[test]
fn names_of_numbers_are_constants() {
    for (text, expected, with_numbers) in [
        ("V", 0.1, "(0.1)"),
        ("n_2^2 + V*t0", 9.0 + 1e-8, "(-3.0)^2 + (0.1)*(1e-7)"),
        ("2*V*x", 0.4, "2*(0.1)*x"),
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
    // Names of expressions have their own meaning.
    let own = resolved("x").expect("valid");
    assert!(own.names.is_empty() && own.expression.text() == "x");
}

#[test]
fn faults_of_names_of_numbers_point_into_the_text() {
    for (text, at, message, help) in [
        ("1 + W", 4..5, "unknown name `W`", "known names: t, x, y, z"),
        ("n_3*t", 0..3, "unknown name `n_3`", "did you mean `n_2`?"),
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
