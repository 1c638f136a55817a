use super::*;
use crate::{
    laws::material::{
        DruckerPrager, Elastic, Elasticity, Hypothesis, Maxwell, Metric, Norton, Parameters, Perzyna,
        Viscoplasticity,
    },
    linear_algebra::tensor::{dot, larger, von_mises},
};
use proptest::prelude::*;

const BODY: Elasticity = Elasticity::linear(1000.0, 0.3);
const METRICS: [Metric; 3] = [Metric::Elasticity, Metric::Compliance, Metric::Frobenius];
const SOIL: DruckerPrager = DruckerPrager { relaxation: 100.0, friction_coefficient: 0.6, cohesion: 10.0 };

fn perzyna(metric: Metric, exponent: f64) -> Perzyna {
    Perzyna {
        relaxation: 100.0,
        yield_stress: 19.0,
        exponent,
        hardening_modulus: None,
        kinematic_modulus: None,
        metric,
    }
}

fn flow(law: Perzyna, hypothesis: Hypothesis) -> FlowLaw {
    FlowLaw::Perzyna(law.prepare(&BODY, hypothesis))
}

/// Every law under this hypothesis.
fn laws(hypothesis: Hypothesis) -> Vec<FlowLaw> {
    let mut laws = Vec::new();
    for metric in METRICS {
        let free = Perzyna { yield_stress: 0.0, ..perzyna(metric, 1.0) };
        for law in [1.0, 1.6, 3.0].map(|exponent| perzyna(metric, exponent)).into_iter().chain([free]) {
            laws.push(Viscoplasticity::Perzyna(law));
            laws.push(Viscoplasticity::Perzyna(Perzyna { hardening_modulus: Some(300.0), ..law }));
            laws.push(Viscoplasticity::Perzyna(Perzyna { kinematic_modulus: Some(200.0), ..law }));
        }
    }
    let maxwell = Maxwell { relaxation_time: 0.5, volumetric_relaxation_time: Some(4.0) };
    laws.push(Viscoplasticity::Maxwell(maxwell));
    for (exponent, hardening_strain, hardening_exponent) in
        [(1.0, None, 0.0), (4.0, None, 0.0), (1.0, Some(0.05), 2.0), (3.0, Some(0.02), 1.0)]
    {
        laws.push(Viscoplasticity::Norton(Norton {
            rate: 0.01,
            reference_stress: 60.0,
            exponent,
            hardening_strain,
            hardening_exponent,
        }));
    }
    laws.push(Viscoplasticity::DruckerPrager(SOIL));
    laws.into_iter().map(|law| law.prepare(&BODY, hypothesis)).collect()
}

fn largest<const S: usize>(s: &Mandel<S>) -> f64 {
    s.iter().fold(0.0, |m, x| larger(m, x.abs()))
}

fn difference<const S: usize>(a: &Mandel<S>, b: &Mandel<S>) -> f64 {
    largest(&add_scaled(a, -1.0, b))
}

/// The stress after many short explicit steps of pseudo-time toward `s = s* - k E X(s)`: slow, and shares nothing with the
/// mappings.
fn by_force<const S: usize>(law: &FlowLaw, trial: &Mandel<S>, length: f64, accumulated: f64) -> Mandel<S> {
    let stiff = 1.0 + length * law.fastest_rate::<S>(2.0) * 4.0;
    let stiffness = law.stiffness::<S>();
    let (mut s, mut p) = (*trial, accumulated);
    for _ in 0..200_000 {
        let (rate, growth) = law.rate(&s, p);
        let open = add_scaled(&add_scaled(trial, -length, &stiffness.apply(&rate)), -1.0, &s);
        let behind = accumulated + length * growth - p;
        s = add_scaled(&s, 1.0 / stiff, &open);
        p += behind / stiff;
        if largest(&open) < 1e-13 && behind.abs() < 1e-15 {
            break;
        }
    }
    s
}

fn check<const S: usize>(hypothesis: Hypothesis, trial: &Mandel<S>, length: f64, accumulated: f64) {
    for law in laws(hypothesis) {
        let mut tangent = [[0.0; S]; S];
        let Some(found) = law.return_stress(trial, length, accumulated, Some(&mut tangent)) else {
            assert_eq!(law.rate(trial, accumulated).0, [0.0; S], "{law:?}");
            continue;
        };
        let size = 1.0 + largest(trial);
        let (rate, growth) = law.rate(&found.stress, found.accumulated);
        let flow = rate.map(|r| length * r);
        let stiff = 1.0 + 4.0 * length * law.fastest_rate::<S>(1.0);
        let error = difference(&flow, &found.flow) * law.elasticity().shear;
        assert!(error < 1e-12 * size * stiff, "flow of {law:?}: {error:e}, {flow:?}, {:?}", found.flow);
        if law.hardens() {
            let error = (accumulated + length * growth - found.accumulated).abs();
            assert!(error < 1e-14 * size * stiff, "growth of {law:?}: {error:e}");
        }
        assert!(dot(&found.stress, &found.flow) >= -1e-12 * size, "dissipation of {law:?}");
        assert!(von_mises(&found.stress) <= von_mises(trial) * (1.0 + 1e-12) || S == 3);

        let step = 1e-6 * size;
        for j in 0..S {
            let moved = |by: f64| {
                let mut moved = *trial;
                moved[j] += by;
                law.return_stress(&moved, length, accumulated, None).map(|r| r.stress)
            };
            let (Some(above), Some(below)) = (moved(step), moved(-step)) else { continue };
            for i in 0..S {
                let quotient = (above[i] - below[i]) / (2.0 * step);
                let error = (quotient - tangent[i][j]).abs();
                assert!(
                    error < 2e-5,
                    "tangent {i} {j} of {law:?} at {trial:?}: {} or {quotient}",
                    tangent[i][j]
                );
            }
        }
        if law.has_symmetric_tangent::<S>() {
            let product = |i: usize, j: usize| {
                let mut unit = [0.0; S];
                unit[j] = 1.0;
                dot(&tangent[i], &law.stiffness::<S>().apply(&unit))
            };
            for i in 0..S {
                for j in 0..i {
                    assert!((product(i, j) - product(j, i)).abs() < 1e-9 * 1000.0, "symmetry of {law:?}");
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn mappings_solve_the_implicit_equation_with_its_tangent_and_dissipate(
        s in proptest::array::uniform6(-100.0f64..100.0),
        logarithm in -4.0f64..2.0,
        accumulated in 0.0f64..0.1,
    ) {
        let length = 10f64.powf(logarithm);
        check(Hypothesis::PlaneStress, &[s[0], s[1], s[3]], length, accumulated);
        check(Hypothesis::PlaneStrain, &[s[0], s[1], s[2], s[3]], length, accumulated);
        check(Hypothesis::Space, &s, length, accumulated);
    }
}

#[test]
fn mappings_agree_with_a_solution_by_force() {
    for hypothesis in [Hypothesis::PlaneStress, Hypothesis::PlaneStrain] {
        for law in laws(hypothesis) {
            for length in [0.05, 1.0] {
                let error = if hypothesis == Hypothesis::PlaneStress {
                    let trial = [60.0, -20.0, 35.0];
                    let found = law.return_stress(&trial, length, 0.01, None).expect("flow").stress;
                    difference(&found, &by_force(&law, &trial, length, 0.01))
                } else {
                    let trial = [60.0, -20.0, 15.0, 35.0];
                    let found = law.return_stress(&trial, length, 0.01, None).expect("flow").stress;
                    difference(&found, &by_force(&law, &trial, length, 0.01))
                };
                assert!(error < 1e-9, "{law:?} over {length}: {error:e}");
            }
        }
    }
}

#[test]
fn uniaxial_return_in_space_by_hand() {
    // q* = 31, Y = 19, k / (3 lambda) = 1/300, 3 G = 1500 / 1.3: dp = 0.04 / (1 + 5 / 1.3), q = 31 - 3 G dp.
    let law = flow(perzyna(Metric::Frobenius, 1.0), Hypothesis::Space);
    let found = law.return_stress(&[31.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, 0.0, None).expect("flow");
    let growth = 0.04 / (1.0 + 5.0 / 1.3);
    assert!((von_mises(&found.stress) - (31.0 - 1500.0 / 1.3 * growth)).abs() < 1e-12);
    assert!((found.flow[0] - growth).abs() < 1e-15 && (found.accumulated - growth).abs() < 1e-15);
    let trace: f64 = found.stress[..3].iter().sum();
    assert!((trace - 31.0).abs() < 1e-12, "pressure stays");
}

#[test]
fn stress_inside_does_not_flow() {
    let law = flow(perzyna(Metric::Elasticity, 2.0), Hypothesis::PlaneStress);
    assert_eq!(law.return_stress(&[18.9, 0.0, 0.0], 1.0, 0.0, None), None);
    let soil = FlowLaw::DruckerPrager(SOIL.prepare(&BODY, Hypothesis::Space));
    assert_eq!(soil.return_stress(&[-500.0, -500.0, -500.0, 0.0, 0.0, 0.0], 1.0, 0.0, None), None);
}

#[test]
fn without_relaxation_time_stress_returns_to_the_yield_surface_as_in_perfect_plasticity() {
    let plane = [60.0, -20.0, 35.0];
    for exponent in [1.0, 2.0] {
        for metric in METRICS {
            let law = Perzyna { relaxation: 1e-22, ..perzyna(metric, exponent) };
            let law = flow(law, Hypothesis::PlaneStress);
            let found = law.return_stress(&plane, 1.0, 0.0, None).expect("flow").stress;
            assert!((von_mises(&found) - 19.0).abs() < 1e-9, "{metric:?}: {found:?}");
            // Associated flow returns along E: to the closest stress in the metric of the compliance.
            let closest =
                perzyna(Metric::Compliance, 1.0).prepare(&BODY, Hypothesis::PlaneStress).project(&plane);
            assert_eq!(difference(&found, &closest) < 1e-8, metric == Metric::Frobenius, "{metric:?}");
        }
        let law = Perzyna { relaxation: 1e-22, ..perzyna(Metric::Compliance, exponent) };
        let law = law.prepare(&BODY, Hypothesis::Space);
        let trial = [60.0, -20.0, 15.0, 35.0, 7.0, -9.0];
        let found = FlowLaw::Perzyna(law).return_stress(&trial, 1.0, 0.0, None).expect("flow").stress;
        assert!(difference(&found, &law.project(&trial)) < 1e-9);
    }
    let soil = SOIL.prepare(&BODY, Hypothesis::Space);
    let stiff = DruckerPrager { relaxation: 1e-12, ..SOIL }.prepare(&BODY, Hypothesis::Space);
    for trial in [[60.0, -20.0, -35.0, 4.0, 5.0, 6.0], [100.0, 90.0, 95.0, 1.0, 2.0, 3.0]] {
        let found = FlowLaw::DruckerPrager(stiff).return_stress(&trial, 1.0, 0.0, None).expect("flow");
        assert!(difference(&soil.space.project(&found.stress), &found.stress) < 1e-9, "{found:?}");
    }
}

#[test]
fn slow_relaxation_leaves_the_stress_where_it_was() {
    for law in laws(Hypothesis::PlaneStress) {
        let trial = [60.0, -20.0, 35.0];
        let mut tangent = [[0.0; 3]; 3];
        let found = law.return_stress(&trial, 1e-12, 0.0, Some(&mut tangent)).expect("flow").stress;
        assert!(difference(&found, &trial) < 1e-7, "{law:?}");
        for i in 0..3 {
            for j in 0..3 {
                let identity = f64::from(u8::from(i == j));
                assert!((tangent[i][j] - identity).abs() < 1e-7, "{law:?}");
            }
        }
    }
}

/// How far a mapped stress is off its equation `s = s* - k E X(s)`, relative to what rounding of `s*` makes of it.
fn off<const S: usize>(law: &Elastic<Perzyna>, trial: &Mandel<S>) -> f64 {
    let (length, mut tangent) = (0.1, [[0.0; S]; S]);
    let found = FlowLaw::Perzyna(*law).return_stress(trial, length, 0.0, Some(&mut tangent));
    let found = found.expect("flow");
    assert!(tangent.iter().flatten().all(|t| t.abs() < 2.0), "{law:?}: {tangent:?}");
    let back = add_scaled(&found.stress, length, &law.elasticity.apply(&law.strain_rate(&found.stress)));
    let overstress = von_mises(&found.stress) - law.parameters.yield_stress;
    let rounding = 1e-10 + 1e-13 * law.parameters.exponent * largest(trial) / overstress;
    difference(&back, trial) / largest(trial) / rounding
}

#[test]
fn stresses_far_beyond_the_yield_stress_flow_as_their_law_says() {
    for (exponent, least) in [(1.0, 1e-200), (2.0, 1e-12), (5.0, 1e-12), (20.0, 1e-12)] {
        for yield_stress in
            [1.0, 1e-3, 1e-6, 1e-12, 1e-30, 1e-120, 1e-200].into_iter().filter(|y| *y >= least)
        {
            for relaxation in [100.0, 1.0, 1e-4, 1e-8] {
                let sizes = [1.0, 1e-3, 1e-6, 1e-9].into_iter().filter(|size| *size >= 2.0 * yield_stress);
                for (size, metric) in sizes.flat_map(|size| METRICS.map(|metric| (size, metric))) {
                    let law = |hypothesis| {
                        let law = Perzyna { yield_stress, relaxation, ..perzyna(metric, exponent) };
                        law.prepare(&BODY, hypothesis)
                    };
                    let plane = off(&law(Hypothesis::PlaneStress), &[3.0 * size, -2.0 * size, size]);
                    let space = [3.0, -2.0, 1.0, 0.5, 0.0, 4.0].map(|s| s * size);
                    let space = off(&law(Hypothesis::Space), &space);
                    let what = format!(
                        "exponent {exponent}, yield stress {yield_stress}, {relaxation}, {size}, {metric:?}"
                    );
                    assert!(plane < 1.0 && space < 1.0, "{what}: {plane:e}, {space:e}");
                }
            }
        }
    }
}

/// Lets a cell flow on from a step that ended its flow at `before` to the stress `elastic`: whether extrapolated flow was
/// limited there, and whether the law's tangent was compared with differences.
fn check_continued<const S: usize>(
    law: &FlowLaw,
    before: &Mandel<S>,
    elastic: &Mandel<S>,
    length: f64,
) -> [usize; 2] {
    let earlier = law.return_stress(before, length, 0.01, None).expect("flow");
    let flow = earlier.flow.map(|flow| flow / 3.0);
    let last = Extrapolated { flow, growth: (earlier.accumulated - 0.01) / 3.0 };
    let at = |stress: &Mandel<S>| law.continue_flow(stress, &last, length, earlier.accumulated, None);
    let mut tangent = [[0.0; S]; S];
    let found = law.continue_flow(elastic, &last, length, earlier.accumulated, Some(&mut tangent));
    let yields = law.return_stress(elastic, length, earlier.accumulated, None).is_some();
    assert_eq!(found.is_some(), yields, "{law:?} at {elastic:?} flows only where it yields");
    let Some((found, smooth)) = found else { return [0; 2] };
    let what = format!("{law:?} from {before:?} to {elastic:?} in {length} s");
    let size = largest(elastic);
    let beyond = found.stress.map(|s| s * (1.0 + 1e-9));
    assert!(law.return_stress(&beyond, length, found.accumulated, None).is_some(), "{what}: inside");
    let taken = dot(&found.stress, &found.flow);
    let radial = S != 3 && law.equivalent_stress(elastic).is_some();
    assert!(!radial || taken >= -1e-12 * size * largest(&found.flow), "{what}: dissipates {taken:e}");
    assert!(found.accumulated >= earlier.accumulated, "{what}: growth");
    let step = 1e-6 * size;
    let mut compared = true;
    for j in 0..S {
        let moved = |by: f64| {
            let mut moved = *elastic;
            moved[j] += by;
            at(&moved).map_or(moved, |(found, _)| found.stress)
        };
        let (above, below) = (moved(step), moved(-step));
        for i in 0..S {
            let sides = [(above[i] - found.stress[i]) / step, (found.stress[i] - below[i]) / step];
            assert!(sides.iter().all(|side| side.abs() < 20.0), "{what}: jumps by {sides:?}");
            // Not at a kink.
            if (sides[0] - sides[1]).abs() < 1e-3 {
                let error = (0.5 * (sides[0] + sides[1]) - tangent[i][j]).abs();
                assert!(error < 1e-4, "{what}: tangent {i} {j}: {} or {sides:?}", tangent[i][j]);
            } else {
                compared = false;
            }
        }
    }
    [usize::from(!smooth), usize::from(!smooth && compared)]
}

#[test]
fn extrapolated_flow_stays_outside_the_yield_surface_dissipates_and_has_its_tangent() {
    let mut random = proptest::test_runner::TestRng::deterministic_rng(Default::default());
    let mut counts = [[0; 2]; 3];
    for _ in 0..150 {
        let mut number = || f64::from(random.next_u32()) / f64::from(u32::MAX);
        let before: [f64; 6] = std::array::from_fn(|_| 200.0 * number() - 100.0);
        let turned = 0.3 * number();
        let other: [f64; 6] = std::array::from_fn(|_| 200.0 * number() - 100.0);
        let scale = 1.4 * number() - 0.2;
        let elastic: [f64; 6] = std::array::from_fn(|i| scale * (before[i] + turned * other[i]));
        let length = 10f64.powf(4.0 * number() - 2.0);
        let mut add = |kind: usize, [limited, compared]: [usize; 2]| {
            counts[kind][0] += limited;
            counts[kind][1] += compared;
        };
        for law in laws(Hypothesis::PlaneStress) {
            let [before, elastic] = [before, elastic].map(|s| [s[0], s[1], s[3]]);
            if law.return_stress(&before, length, 0.01, None).is_some() {
                add(0, check_continued(&law, &before, &elastic, length));
            }
        }
        for law in laws(Hypothesis::PlaneStrain) {
            let [before, elastic] = [before, elastic].map(|s| [s[0], s[1], s[2], s[3]]);
            if law.return_stress(&before, length, 0.01, None).is_some() {
                add(1, check_continued(&law, &before, &elastic, length));
            }
        }
        for law in laws(Hypothesis::Space) {
            if law.return_stress(&before, length, 0.01, None).is_some() {
                add(2, check_continued(&law, &before, &elastic, length));
            }
        }
    }
    println!("limited, and compared with differences: {counts:?}");
    assert!(
        counts.iter().all(|[limited, compared]| *limited > 50 && compared * 10 > limited * 8),
        "{counts:?}"
    );
}

#[test]
fn a_share_of_extrapolated_flow_by_hand() {
    // q = 31, Y = 19 + 100 x 0.02 = 21: f = 10. With m = 0.016 along the axis q(E m) = 3 G m = 1500 / 1.3 x 0.016, h p_m = 1.6.
    let law = Perzyna { hardening_modulus: Some(100.0), ..perzyna(Metric::Frobenius, 1.0) };
    let law = flow(law, Hypothesis::Space);
    let last = Extrapolated { flow: [0.016, -0.008, -0.008, 0.0, 0.0, 0.0], growth: 0.016 };
    let axial = |stress: f64| law.continue_flow(&[stress, 0.0, 0.0, 0.0, 0.0, 0.0], &last, 1.0, 0.02, None);
    // A share that takes half of f = 10; the rest flows at its rate: dp = f / 300 / (1 + (3 G + h) / 300).
    let (stiff, viscous) = (1500.0 / 1.3, 300.0 + 1500.0 / 1.3 + 100.0);
    let share = 5.0 / (stiff * 0.016 + 1.6);
    let growth = 0.016 * share + 5.0 / viscous;
    let (found, smooth) = axial(31.0).expect("flow");
    assert!(!smooth && (found.accumulated - 0.02 - growth).abs() < 1e-15);
    assert!((found.flow[0] - growth).abs() < 1e-15);
    assert!((von_mises(&found.stress) - 31.0 + stiff * growth).abs() < 1e-12);
    assert_eq!(axial(20.9), None, "what does not yield does not flow");
    // All of it, and on from q = 71 - 3 G 0.016 and Y = 22.6.
    let (found, smooth) = axial(71.0).expect("flow");
    let growth = (71.0 - stiff * 0.016 - 22.6) / viscous;
    assert!(smooth && (found.accumulated - 0.036 - growth).abs() < 1e-15);
    assert!((von_mises(&found.stress) - 71.0 + stiff * (0.016 + growth)).abs() < 1e-12);
    // Pulled the other way, the flow before is not taken on.
    let (found, _) = axial(-31.0).expect("flow");
    assert!((found.accumulated - 0.02 - 10.0 / viscous).abs() < 1e-15);
}

/// A step that goes on from a flow: stress, flow, accumulated strain and tangent, and whether the extrapolated flow was limited.
fn continued<const S: usize>(
    law: &FlowLaw,
    elastic: &Mandel<S>,
    last: &Extrapolated<S>,
) -> Option<(Returned<S>, Tangent<S>, bool)> {
    let mut tangent = [[0.0; S]; S];
    let (found, smooth) = law.continue_flow(elastic, last, 0.3, 0.01, Some(&mut tangent))?;
    Some((found, tangent, !smooth))
}

#[test]
fn a_threshold_of_a_formula_limits_extrapolated_flow_as_a_yield_surface_does() {
    let law = perzyna(Metric::Frobenius, 1.0);
    let pairs = [
        (law, "max(q - 19, 0)/300"),
        (Perzyna { hardening_modulus: Some(400.0), ..law }, "max(q - 19 - 400*e, 0)/300"),
        (Perzyna { exponent: 3.0, ..law }, "19*max(q/19 - 1, 0)^3/300"),
        (Perzyna { yield_stress: 0.0, ..law }, "q/300"),
    ];
    let mut random = proptest::test_runner::TestRng::deterministic_rng(Default::default());
    let mut number = || f64::from(random.next_u32()) / f64::from(u32::MAX);
    for (law, rate) in pairs {
        let formula = serde_json::json!({ "rate": rate, "reference_stress": 20.0 });
        let formula = Viscoplasticity::CreepFormula(serde_json::from_value(formula).expect("a law"));
        let [built_in, written] = [Viscoplasticity::Perzyna(law), formula]
            .map(|law: Viscoplasticity| law.prepare(&BODY, Hypothesis::Space));
        let (mut limited, mut inside) = (0, 0);
        for _ in 0..300 {
            let direction: Mandel<6> = std::array::from_fn(|_| number() - 0.5);
            let elastic: Mandel<6> =
                std::array::from_fn(|i| 50.0 * (direction[i] + 0.3 * (number() - 0.5)) * (0.2 + number()));
            let mean = direction[..3].iter().sum::<f64>() / 3.0;
            let scale = 0.05 * number();
            let flow: Mandel<6> =
                std::array::from_fn(|i| scale * (direction[i] - if i < 3 { mean } else { 0.0 }));
            let growth = (dot(&flow, &flow) / 1.5).sqrt();
            let last = Extrapolated { flow, growth };
            let [wanted, found] = [&built_in, &written].map(|law| continued(law, &elastic, &last));
            let (Some(wanted), Some(found)) = (wanted, found) else {
                assert!(wanted.is_none() && found.is_none(), "{rate} at {elastic:?}");
                inside += 1;
                continue;
            };
            limited += usize::from(wanted.2);
            assert_eq!(wanted.2, found.2, "{rate} at {elastic:?}");
            assert!(difference(&wanted.0.stress, &found.0.stress) < 1e-11, "{rate}: {wanted:?} {found:?}");
            assert!((wanted.0.accumulated - found.0.accumulated).abs() < 1e-14, "{rate}");
            for (one, other) in wanted.1.iter().zip(&found.1) {
                assert!(difference(one, other) < 1e-9, "{rate} at {elastic:?}: {one:?} {other:?}");
            }
        }
        assert!((limited > 30 && inside > 10) != (rate == "q/300"), "{rate}: {limited} {inside}");
    }
}
