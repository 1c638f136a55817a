use super::*;
use proptest::prelude::*;
use std::array;

const PAPER: Elasticity = Elasticity::linear(1000.0, 0.4);
const METRICS: [Metric; 3] = [Metric::Elasticity, Metric::Compliance, Metric::Frobenius];

fn law(metric: Metric, hypothesis: Hypothesis) -> Elastic<Perzyna> {
    Perzyna {
        relaxation: 100.0,
        yield_stress: 19.0,
        exponent: 1.0,
        hardening_modulus: None,
        kinematic_modulus: None,
        metric,
    }
    .prepare(&PAPER, hypothesis)
}

#[test]
fn stress_inside_the_yield_surface_flows_not_at_all() {
    let law = law(Metric::Elasticity, Hypothesis::PlaneStress);
    assert_eq!(law.strain_rate(&[18.9, 0.0, 0.0]), [0.0; 3]);
    assert_eq!(law.project(&[18.9, 0.0, 0.0]), [18.9, 0.0, 0.0]);
}

#[test]
fn stresses_flow_together_as_they_do_one_by_one() {
    let stresses = [[40.0, -3.0, 7.0], [0.0; 3], [1e6, 1e6, 0.0], [12.0, 3.0, 1.0], [-25.0, 20.0, 30.0]];
    for (metric, exponent) in [(METRICS[0], 1.0), (METRICS[1], 1.0), (METRICS[2], 2.5)] {
        let mut law = law(metric, Hypothesis::PlaneStress);
        law.parameters.exponent = exponent;
        let side_by_side = Pack::from_lanes(|lane| stresses.get(lane).copied().unwrap_or([0.0; 3]));
        let rates = law.strain_rates(&side_by_side).expect("flow");
        assert!((0..LANES).all(|lane| rates.lane(lane) == law.strain_rate(&side_by_side.lane(lane))));
        assert!((5..LANES).all(|lane| rates.lane(lane) == [0.0; 3]));
        let space = Elastic { elasticity: PAPER.tensor(Hypothesis::Space), ..law };
        let side_by_side =
            Pack::from_lanes(|lane| array::from_fn(|c| side_by_side.0[c % 3][lane] * (1.0 + c as f64)));
        let rates: Pack<6> = space.strain_rates(&side_by_side).expect("flow");
        assert!((0..LANES).all(|lane| rates.lane(lane) == space.strain_rate(&side_by_side.lane(lane))));
        assert_eq!(law.strain_rates(&Pack::from_lanes(|lane| [lane as f64, 0.0, 0.0])), None);
    }
}

#[test]
fn stresses_yield_together_where_they_flow_one_by_one() {
    let stresses = Pack::from_lanes(|lane| [2.0 * lane as f64 - 1.0, 3.0, -0.7 * lane as f64]);
    for hardening_modulus in [None, Some(20.0)] {
        let mut law = law(Metric::Elasticity, Hypothesis::PlaneStress);
        law.parameters.hardening_modulus = hardening_modulus;
        let accumulated = array::from_fn(|lane| 0.02 * lane as f64);
        let yielding = law.yielding(&stresses, &accumulated);
        let flows: [bool; LANES] = array::from_fn(|lane| {
            law.flow_to_end(&stresses.lane(lane), 0.1, accumulated[lane], None).is_some()
        });
        assert_eq!(yielding, flows);
        assert!(yielding.contains(&true) && yielding.contains(&false));
    }
}

#[test]
fn pure_shear_is_scaled_to_the_surface_in_every_metric() {
    for metric in METRICS {
        let projected = law(metric, Hypothesis::PlaneStress).project(&[0.0, 0.0, 100.0]);
        assert!((projected[2] - 19.0 / 1.5f64.sqrt()).abs() < 1e-12, "{projected:?}");
    }
}

#[test]
fn equibiaxial_stress_is_scaled_in_plane_stress_and_free_in_space() {
    for metric in METRICS {
        let plane = law(metric, Hypothesis::PlaneStress).project(&[38.0, 38.0, 0.0]);
        assert!((plane[0] - 19.0).abs() < 1e-12 && (plane[1] - 19.0).abs() < 1e-12, "{plane:?}");
    }
    let pressure = [50.0, 50.0, 50.0, 0.0, 0.0, 0.0];
    assert_eq!(law(Metric::Elasticity, Hypothesis::Space).project(&pressure), pressure);
}

#[test]
fn uniaxial_viscoplastic_strain_rate_in_space_by_hand() {
    // s = (31, 0, 0): deviator (62/3, -31/3, -31/3), scaled by 1 - 19/31, over 2 lambda = 200.
    let rate = law(Metric::Frobenius, Hypothesis::Space).strain_rate(&[31.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!((rate[0] - 8.0 / 200.0).abs() < 1e-15, "{rate:?}");
    assert!((rate[1] + 4.0 / 200.0).abs() < 1e-15);
}

#[test]
fn uniaxial_rates_just_beyond_yield_in_plane_stress_by_hand() {
    // The share of the overstress over 2 lambda that docs/conventions.md states; 2/3 in space.
    let k = 0.4;
    for (metric, share) in [
        (Metric::Elasticity, (1.0 + k / 2.0) / (1.25 + k)),
        (Metric::Frobenius, 0.8),
        (Metric::Compliance, (4.0 - 2.0 * k) / (5.0 - 4.0 * k)),
    ] {
        let elasticity = Elasticity::linear(1000.0, k);
        let law =
            law(metric, Hypothesis::PlaneStress).parameters.prepare(&elasticity, Hypothesis::PlaneStress);
        let rate = law.strain_rate(&[19.0 + 1e-5, 0.0, 0.0])[0] / (1e-5 / 200.0);
        assert!((rate - share).abs() < 1e-5, "{metric:?}: {rate} for {share}");
    }
}

#[test]
fn power_law_rate_by_hand() {
    // Overstress 12 of 19: the linear law's 8 / 200 is scaled by (12 / 19)^(n - 1).
    let stress = [31.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut law = law(Metric::Frobenius, Hypothesis::Space);
    for exponent in [1.0, 2.0, 3.5] {
        law.parameters.exponent = exponent;
        let expected = 8.0 / 200.0 * (12.0f64 / 19.0).powf(exponent - 1.0);
        assert!((law.strain_rate(&stress)[0] - expected).abs() < 1e-15, "{exponent}");
    }
    assert_eq!(law.strain_rate(&[18.9, 0.0, 0.0, 0.0, 0.0, 0.0]), [0.0; 6]);
}

#[test]
fn zero_yield_stress_leaves_no_plane_stress() {
    let mut law = law(Metric::Elasticity, Hypothesis::PlaneStress);
    law.parameters.yield_stress = 0.0;
    assert_eq!(law.project(&[3.0, 4.0, 5.0]), [0.0; 3]);
    // Then all of the stress flows, over 2 lambda = 200; of stresses side by side, too.
    let rates = law.strain_rates(&Pack::from_lanes(|lane| [3.0 * lane as f64, 4.0, -5.0])).expect("flow");
    for lane in 0..LANES {
        let expected = [3.0 * lane as f64, 4.0, -5.0].map(|s| s / 200.0);
        assert!((0..3).all(|c| (rates.lane(lane)[c] - expected[c]).abs() < 1e-15), "{rates:?}");
    }
}

fn check_projection<const S: usize>(law: &Elastic<Perzyna>, s: &Mandel<S>, other: &Mandel<S>) {
    let scale = 1.0 + dot(s, s).sqrt() + dot(other, other).sqrt();
    let p = law.project(s);
    let again = law.project(&p);
    assert!(von_mises(&p) <= 19.0 * (1.0 + 1e-12));
    if von_mises(s) > 19.0 {
        assert!((von_mises(&p) - 19.0).abs() < 1e-10 * 19.0, "on the surface");
    }
    for c in 0..S {
        assert!((again[c] - p[c]).abs() < 1e-9 * scale, "idempotent");
    }
    let inside = law.project(other);
    let mut to_other = [0.0; S];
    let mut away = [0.0; S];
    for c in 0..S {
        (to_other[c], away[c]) = (inside[c] - p[c], s[c] - p[c]);
    }
    let mut sum = [0.0; S];
    for c in 0..S {
        sum[c] = to_other[c] + away[c];
    }
    // <away, to_other> in the metric, by polarisation: not positive for a projection on a convex set.
    let square = |t: &Mandel<S>| match law.parameters.metric {
        Metric::Elasticity => dot(t, &law.elasticity.apply(t)),
        Metric::Compliance => law.elasticity.inverse_square(t),
        Metric::Frobenius => dot(t, t),
    };
    let product = 0.5 * (square(&sum) - square(&away) - square(&to_other));
    let size = square(&sum) + square(&away) + square(&to_other);
    assert!(product <= 1e-10 * size, "orthogonal: {product} of {size}");
    assert!(dot(s, &law.strain_rate(s)) >= -1e-12 * scale * scale, "dissipation");
}

proptest! {
    #[test]
    fn projections_are_idempotent_on_the_surface_orthogonal_and_dissipative(
        s in proptest::array::uniform6(-200.0f64..200.0),
        other in proptest::array::uniform6(-200.0f64..200.0),
        metric in proptest::sample::select(&METRICS[..]),
    ) {
        let first = |t: &[f64; 6]| [t[0], t[1], t[3]];
        let plane = |t: &[f64; 6]| [t[0], t[1], t[2], t[3]];
        check_projection(&law(metric, Hypothesis::PlaneStress), &first(&s), &first(&other));
        check_projection(&law(metric, Hypothesis::PlaneStrain), &plane(&s), &plane(&other));
        check_projection(&law(metric, Hypothesis::Space), &s, &other);
    }
}
