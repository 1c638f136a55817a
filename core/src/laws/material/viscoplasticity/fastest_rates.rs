//! Tests of the fastest rates that laws state, which bound explicit steps: they are close bounds, from above, on the eigenvalues of the
//! derivatives of the rates, which are found by differences.

use super::{DruckerPrager, Flow, FlowLaw, Maxwell, Metric, Norton, Perzyna, Viscoplasticity};
use crate::{
    laws::material::{Elasticity, Hypothesis},
    linear_algebra::tensor::{Mandel, larger, von_mises},
};
use std::array;

const METRICS: [Metric; 3] = [Metric::Elasticity, Metric::Compliance, Metric::Frobenius];
const YIELD_STRESS: f64 = 19.0;
/// Strain that has hardened the material.
const ACCUMULATED: f64 = 0.01;

fn elastic(poisson_ratio: f64) -> Elasticity {
    Elasticity::linear(1000.0, poisson_ratio)
}

/// Of the material for stresses of so many components.
fn prepared(law: &Viscoplasticity, components: usize, poisson_ratio: f64) -> FlowLaw {
    law.prepare(&elastic(poisson_ratio), Hypothesis::of(components))
}

fn perzyna(
    metric: Metric,
    exponent: f64,
    [hardening_modulus, kinematic_modulus]: [Option<f64>; 2],
) -> Viscoplasticity {
    Viscoplasticity::Perzyna(Perzyna {
        relaxation: 100.0,
        yield_stress: YIELD_STRESS,
        exponent,
        hardening_modulus,
        kinematic_modulus,
        metric,
    })
}

/// How stress falls where strain is held, and with it the negative of the strain that hardens.
fn decay<const S: usize>(law: &FlowLaw, state: &[f64]) -> Vec<f64> {
    let s: Mandel<S> = array::from_fn(|c| state[c]);
    let (rate, growth) = law.rate(&s, state.get(S).copied().unwrap_or(0.0));
    law.stiffness::<S>().apply(&rate).into_iter().chain(law.hardens().then_some(-growth)).collect()
}

/// The fastest of the rates at overstresses of up to `most` times the yield stress along these directions, over the bound.
fn share_of_bound<const S: usize>(law: FlowLaw, most: f64, directions: &[Mandel<S>]) -> f64 {
    let accumulated = law.hardens().then_some(ACCUMULATED);
    let yield_stress = law.strength(accumulated.unwrap_or(0.0));
    let mut fastest = 0.0f64;
    for direction in directions {
        for share in [0.01, 0.3, 0.9, 1.0] {
            let size = yield_stress * (1.0 + share * most) / von_mises(direction);
            let state: Vec<f64> = direction.iter().map(|x| size * x).chain(accumulated).collect();
            fastest = fastest.max(spectral_radius(&|state: &[f64]| decay::<S>(&law, state), &state));
        }
    }
    fastest / law.fastest_rate::<S>(most)
}

/// The shares of a law in plane stress, plane strain and space.
fn shares(law: &Viscoplasticity, ratio: f64, most: f64) -> [f64; 3] {
    let all = directions::<6>(40);
    let thin: Vec<Mandel<3>> = all.iter().map(|d| [d[0], d[1], d[5]]).collect();
    let thick: Vec<Mandel<4>> = all.iter().map(|d| [d[0], d[1], d[2], d[5]]).collect();
    [
        share_of_bound(prepared(law, 3, ratio), most, &thin),
        share_of_bound(prepared(law, 4, ratio), most, &thick),
        share_of_bound(prepared(law, 6, ratio), most, &all),
    ]
}

/// In plane stress the bound may be somewhat above all rates.
fn assert_shares(shares: [f64; 3], least: f64, what: &str) {
    assert!(shares.iter().all(|share| *share <= 1.0 + 1e-5), "beyond the bound, {what}: {shares:?}");
    assert!(shares[0] > least && shares[1] > 0.999 && shares[2] > 0.999, "far below, {what}: {shares:?}");
}

#[test]
fn powers_of_the_overstress_relax_up_to_the_fastest_rate() {
    for metric in METRICS {
        for (exponent, most) in [(1.0, 30.0), (1.5, 0.2), (3.0, 1.0), (5.0, 2.0), (20.0, 1.0)] {
            for ratio in [-0.95, -0.5, 0.0, 0.3, 0.49] {
                let law = perzyna(metric, exponent, [None; 2]);
                assert_shares(
                    shares(&law, ratio, most),
                    0.6,
                    &format!("{metric:?}, n = {exponent}, {ratio}"),
                );
            }
        }
    }
}

#[test]
fn hardening_stress_relaxes_up_to_the_fastest_rate() {
    for metric in METRICS {
        for (exponent, most) in [(1.0, 1.0), (1.0, 10.0), (3.0, 1.0), (5.0, 2.0)] {
            for ratio in [-0.95, -0.5, 0.0, 0.3, 0.49] {
                for modulus in [100.0, 3000.0] {
                    for moduli in [[Some(modulus), None], [None, Some(modulus)]] {
                        let law = perzyna(metric, exponent, moduli);
                        let what = format!("{metric:?}, n = {exponent}, {ratio}, h = {moduli:?}, {most}");
                        assert_shares(shares(&law, ratio, most), 0.3, &what);
                    }
                }
            }
        }
    }
}

fn check_maxwell<const S: usize>(ratio: f64, volumetric: Option<f64>) {
    let maxwell = Maxwell { relaxation_time: 0.5, volumetric_relaxation_time: volumetric };
    let law = prepared(&Viscoplasticity::Maxwell(maxwell), S, ratio);
    let fastest = spectral_radius(&|s: &[f64]| decay::<S>(&law, s), &[1.0; S]);
    let share = fastest / law.fastest_rate::<S>(0.0);
    assert!((share - 1.0).abs() < 1e-7, "{S} components, {ratio}, {volumetric:?}: {share}");
}

#[test]
fn maxwells_law_relaxes_at_the_fastest_rate() {
    for ratio in [-0.9, 0.0, 0.4] {
        for volumetric in [None, Some(0.1), Some(5.0)] {
            check_maxwell::<3>(ratio, volumetric);
            check_maxwell::<4>(ratio, volumetric);
            check_maxwell::<6>(ratio, volumetric);
        }
    }
}

fn check_cone<const S: usize>(ratio: f64) {
    let cone = DruckerPrager { relaxation: 100.0, friction_coefficient: 0.6, cohesion: 10.0 };
    let law = prepared(&Viscoplasticity::DruckerPrager(cone), S, ratio);
    let mut fastest = 0.0f64;
    for direction in directions::<S>(60) {
        for mean in [0.0, 1.0] {
            let s: Mandel<S> = array::from_fn(|c| 60.0 * (direction[c] + if c < 3 { mean } else { 0.0 }));
            fastest = fastest.max(spectral_radius(&|s: &[f64]| decay::<S>(&law, s), &s));
        }
    }
    let (share, least) = (fastest / law.fastest_rate::<S>(0.0), if S == 3 { 0.05 } else { 0.999 });
    assert!(share < 1.0 + 1e-6 && share > least, "{S} components, {ratio}: {share}");
}

#[test]
fn stress_beyond_the_apex_of_the_cone_relaxes_at_the_fastest_rate() {
    for ratio in [-0.9, -0.3, 0.0, 0.3, 0.45] {
        check_cone::<3>(ratio);
        check_cone::<4>(ratio);
        check_cone::<6>(ratio);
    }
}

/// The fastest of the rates at stresses of three times the reference stress over the bound, after this accumulated strain.
fn share_of_creep<const S: usize>(law: &Norton, ratio: f64, accumulated: f64) -> f64 {
    let prepared = prepared(&Viscoplasticity::Norton(*law), S, ratio);
    let shares = directions::<S>(40).into_iter().map(|direction| {
        let size = 3.0 * law.reference_stress / von_mises(&direction);
        let s = direction.map(|x| size * x);
        let state: Vec<f64> = s.into_iter().chain(law.hardening_strain.map(|_| accumulated)).collect();
        let bound = prepared.fastest_rate::<S>(prepared.overstress(&s, accumulated));
        spectral_radius(&|state: &[f64]| decay::<S>(&prepared, state), &state) / bound
    });
    shares.fold(0.0, larger)
}

#[test]
fn creep_relaxes_up_to_the_fastest_rate_and_below_it_after_hardening() {
    for ratio in [-0.9, 0.0, 0.4] {
        for (exponent, hardening_strain) in [(1.0, None), (4.0, None), (1.0, Some(0.1)), (3.0, Some(0.1))] {
            let law = Norton {
                rate: 0.01,
                reference_stress: 20.0,
                exponent,
                hardening_strain,
                hardening_exponent: 1.5,
            };
            let shares = |accumulated: f64| {
                [
                    share_of_creep::<3>(&law, ratio, accumulated),
                    share_of_creep::<4>(&law, ratio, accumulated),
                    share_of_creep::<6>(&law, ratio, accumulated),
                ]
            };
            let what = format!("n = {exponent}, {hardening_strain:?}, {ratio}");
            assert_shares(shares(0.0), 0.999, &what);
            assert!(shares(ACCUMULATED).iter().all(|share| *share <= 1.0 + 1e-5), "after flow, {what}");
        }
    }
}

/// Tensors that look random, and some that are simple: along each axis, in shear, equibiaxial, and equibiaxial with little shear.
fn directions<const S: usize>(random: usize) -> Vec<Mandel<S>> {
    let mut seed = 1u64;
    let mut number = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut all: Vec<Mandel<S>> = (0..S).map(|i| array::from_fn(|c| f64::from(u8::from(c == i)))).collect();
    all.extend([0.0, 0.1, 0.3, 0.6, 1.0].map(|shear| {
        array::from_fn(|c| [1.0, shear][usize::from(c + 1 == S)] * f64::from(u8::from(c < 2 || c + 1 == S)))
    }));
    all.extend((0..random).map(|_| array::from_fn(|_| number())));
    all
}

/// The largest size of an eigenvalue of the derivative of a map at a point, by differences and powers of the matrix.
fn spectral_radius(map: &dyn Fn(&[f64]) -> Vec<f64>, at: &[f64]) -> f64 {
    let n = at.len();
    let size = at.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let mut columns = Vec::new();
    for i in 0..n {
        let h = 1e-6 * if at[i] == 0.0 { size } else { at[i].abs().max(1e-3 * size.min(1.0)) };
        let moved = |by: f64| {
            let mut point = at.to_vec();
            point[i] += by;
            map(&point)
        };
        let (above, below) = (moved(h), moved(-h));
        columns.push(above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h)).collect::<Vec<f64>>());
    }
    let (mut logarithm, mut power) = (0.0, 1.0);
    let mut before = vec![vec![0.0; n]; n];
    for _ in 0..30 {
        let largest = columns.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
        if largest == 0.0 {
            return 0.0;
        }
        columns.iter_mut().flatten().for_each(|x| *x /= largest);
        logarithm += largest.ln() / power;
        let changes = columns.iter().flatten().zip(before.iter().flatten()).map(|(x, y)| (x - y).abs());
        if changes.fold(0.0, larger) < 1e-14 {
            // Its square is a multiple of the matrix, so that all further powers add the same logarithm, halved again and again.
            return f64::exp(logarithm + largest.ln() / power);
        }
        power *= 2.0;
        let product = |column: &Vec<f64>| -> Vec<f64> {
            (0..n).map(|i| (0..n).map(|k| columns[k][i] * column[k]).sum()).collect()
        };
        before = columns.iter().map(product).collect();
        std::mem::swap(&mut before, &mut columns);
    }
    f64::exp(logarithm)
}

#[test]
fn the_radius_of_a_matrix_by_hand() {
    // Eigenvalues 2, -7 and 3, with coupled components.
    let map = |x: &[f64]| vec![2.0 * x[0] + 5.0 * x[1], -7.0 * x[1], 4.0 * x[0] + 3.0 * x[2]];
    let found = spectral_radius(&map, &[1.0, -2.0, 0.0]);
    assert!((found - 7.0).abs() < 1e-7, "{found}");
}
