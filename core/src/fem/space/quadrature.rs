//! Quadrature on cells and facets: rules exact for polynomials of degree 2, and fine ones exact for degree 4.

/// Points in barycentric coordinates (`D + 1` used) and weights that sum to 1.
pub type CellRule = &'static [([f64; 4], f64)];

/// Points in barycentric coordinates (`D` used) and weights that sum to 1.
pub(super) type FacetRule = &'static [([f64; 3], f64)];

const NEAR: f64 = 0.138_196_601_125_010_5;
const FAR: f64 = 0.585_410_196_624_968_5;
const SIXTH: f64 = 1.0 / 6.0;
const LOW: f64 = 0.211_324_865_405_187_1;
const HIGH: f64 = 0.788_675_134_594_812_9;

const TRIANGLE: CellRule = &[
    ([4.0 * SIXTH, SIXTH, SIXTH, 0.0], 1.0 / 3.0),
    ([SIXTH, 4.0 * SIXTH, SIXTH, 0.0], 1.0 / 3.0),
    ([SIXTH, SIXTH, 4.0 * SIXTH, 0.0], 1.0 / 3.0),
];

const TETRAHEDRON: CellRule = &[
    ([FAR, NEAR, NEAR, NEAR], 0.25),
    ([NEAR, FAR, NEAR, NEAR], 0.25),
    ([NEAR, NEAR, FAR, NEAR], 0.25),
    ([NEAR, NEAR, NEAR, FAR], 0.25),
];

const EDGE: FacetRule = &[([HIGH, LOW, 0.0], 0.5), ([LOW, HIGH, 0.0], 0.5)];

const FACE: FacetRule = &[
    ([4.0 * SIXTH, SIXTH, SIXTH], 1.0 / 3.0),
    ([SIXTH, 4.0 * SIXTH, SIXTH], 1.0 / 3.0),
    ([SIXTH, SIXTH, 4.0 * SIXTH], 1.0 / 3.0),
];

/// Degree 4; D. A. Dunavant, International Journal for Numerical Methods in Engineering 21 (1985) 1129-1148.
const FINE_TRIANGLE: CellRule = &[
    ([1.0 - 2.0 * A, A, A, 0.0], WA),
    ([A, 1.0 - 2.0 * A, A, 0.0], WA),
    ([A, A, 1.0 - 2.0 * A, 0.0], WA),
    ([1.0 - 2.0 * B, B, B, 0.0], WB),
    ([B, 1.0 - 2.0 * B, B, 0.0], WB),
    ([B, B, 1.0 - 2.0 * B, 0.0], WB),
];

const FINE_FACE: FacetRule = &[
    ([1.0 - 2.0 * A, A, A], WA),
    ([A, 1.0 - 2.0 * A, A], WA),
    ([A, A, 1.0 - 2.0 * A], WA),
    ([1.0 - 2.0 * B, B, B], WB),
    ([B, 1.0 - 2.0 * B, B], WB),
    ([B, B, 1.0 - 2.0 * B], WB),
];

const A: f64 = 0.445_948_490_915_964_9;
const WA: f64 = 0.223_381_589_678_011_47;
const B: f64 = 0.091_576_213_509_770_74;
const WB: f64 = 0.109_951_743_655_321_87;

/// Degree 5 with positive weights; N. J. Walkington, Quadrature on simplices of arbitrary dimension, Carnegie Mellon University, 2000.
const FINE_TETRAHEDRON: CellRule = &[
    ([1.0 - 3.0 * P, P, P, P], WP),
    ([P, 1.0 - 3.0 * P, P, P], WP),
    ([P, P, 1.0 - 3.0 * P, P], WP),
    ([P, P, P, 1.0 - 3.0 * P], WP),
    ([1.0 - 3.0 * Q, Q, Q, Q], WQ),
    ([Q, 1.0 - 3.0 * Q, Q, Q], WQ),
    ([Q, Q, 1.0 - 3.0 * Q, Q], WQ),
    ([Q, Q, Q, 1.0 - 3.0 * Q], WQ),
    ([R, R, 0.5 - R, 0.5 - R], WR),
    ([R, 0.5 - R, R, 0.5 - R], WR),
    ([R, 0.5 - R, 0.5 - R, R], WR),
    ([0.5 - R, R, R, 0.5 - R], WR),
    ([0.5 - R, R, 0.5 - R, R], WR),
    ([0.5 - R, 0.5 - R, R, R], WR),
];

const P: f64 = 0.310_885_919_263_300_6;
const WP: f64 = 0.112_687_925_718_015_85;
const Q: f64 = 0.092_735_250_310_891_23;
const WQ: f64 = 0.073_493_043_116_361_95;
const R: f64 = 0.045_503_704_125_649_65;
const WR: f64 = 0.042_546_020_777_081_47;

const FINE_EDGE: FacetRule = &[
    ([0.5 + REACH, 0.5 - REACH, 0.0], 5.0 / 18.0),
    ([0.5, 0.5, 0.0], 8.0 / 18.0),
    ([0.5 - REACH, 0.5 + REACH, 0.0], 5.0 / 18.0),
];

const REACH: f64 = 0.387_298_334_620_741_7;

/// Points of the finest cell rule.
pub const MOST_POINTS: usize = 14;

/// One point, exact for linear functions on triangles.
pub(super) const CENTROID: CellRule = &[([2.0 * SIXTH, 2.0 * SIXTH, 2.0 * SIXTH, 0.0], 1.0)];

/// The rule for triangles (`D = 2`) or tetrahedra (`D = 3`).
pub const fn cell_rule<const D: usize>() -> CellRule {
    if D == 2 { TRIANGLE } else { TETRAHEDRON }
}

/// The rule for edges (`D = 2`) or triangular faces (`D = 3`).
pub const fn facet_rule<const D: usize>() -> FacetRule {
    if D == 2 { EDGE } else { FACE }
}

/// The fine rule for triangles (`D = 2`) or tetrahedra (`D = 3`).
pub const fn fine_cell_rule<const D: usize>() -> CellRule {
    if D == 2 { FINE_TRIANGLE } else { FINE_TETRAHEDRON }
}

/// The fine rule for edges (`D = 2`) or triangular faces (`D = 3`).
pub(super) const fn fine_facet_rule<const D: usize>() -> FacetRule {
    if D == 2 { FINE_EDGE } else { FINE_FACE }
}

/// Places in a segment, triangle or tetrahedron that are spread evenly, by the shares of its corners: the centres of those of its parts that
/// are turned as the whole, with this number of parts of an edge.
pub fn evenly_spread(corners: usize, parts: usize) -> Vec<[f64; 4]> {
    let mut found: Vec<[usize; 4]> = vec![[0; 4]];
    for corner in 0..corners - 1 {
        let longer = |given: [usize; 4]| {
            let left = parts - 1 - given.iter().sum::<usize>();
            (0..=left).map(move |count| {
                let mut given = given;
                given[corner] = count;
                given
            })
        };
        found = found.into_iter().flat_map(longer).collect();
    }
    let place = |mut counts: [usize; 4]| {
        counts[corners - 1] = parts - 1 - counts.iter().sum::<usize>();
        let share = |corner: usize| (counts[corner] as f64 + 1.0 / corners as f64) / parts as f64;
        std::array::from_fn(|corner| if corner < corners { share(corner) } else { 0.0 })
    };
    found.into_iter().map(place).collect()
}

/// Places in a segment (`D = 2`) or a triangular facet (`D = 3`) that are spread evenly, enough of them for its mean values.
pub fn spread_over_facet<const D: usize>() -> Vec<[f64; 4]> {
    evenly_spread(D, if D == 2 { 16 } else { 5 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrals of products of barycentric coordinates over a simplex of dimension d and measure 1:
    /// 2/((d+1)(d+2)) on the diagonal, half of it off.
    fn check<const N: usize>(rule: &[([f64; N], f64)], d: usize) {
        let scale = 1.0 / ((d + 1) * (d + 2)) as f64;
        for i in 0..=d {
            for j in 0..=d {
                let sum: f64 = rule.iter().map(|(b, w)| w * b[i] * b[j]).sum();
                let exact = if i == j { 2.0 * scale } else { scale };
                assert!((sum - exact).abs() < 1e-15, "{sum} {exact}");
            }
        }
    }

    #[test]
    fn rules_are_exact_for_degree_two() {
        check(cell_rule::<2>(), 2);
        check(cell_rule::<3>(), 3);
        check(facet_rule::<2>(), 1);
        check(facet_rule::<3>(), 2);
    }

    /// The integral of a product of powers of barycentric coordinates over a simplex of dimension d and measure 1:
    /// d! prod k_i! / (d + sum k_i)!.
    fn check_fine<const N: usize>(rule: &[([f64; N], f64)], d: usize) {
        let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
        for powers in (0..625usize).map(|n| [n % 5, n / 5 % 5, n / 25 % 5, n / 125]) {
            if powers.iter().sum::<usize>() > 4 || powers[d + 1..].iter().any(|&k| k > 0) {
                continue;
            }
            let product = |place: &[f64; N]| -> f64 {
                place.iter().zip(powers).map(|(l, k)| l.powi(k as i32)).product()
            };
            let sum: f64 = rule.iter().map(|(place, weight)| weight * product(place)).sum();
            let tops: f64 = powers.iter().map(|&k| factorial(k)).product();
            let exact = factorial(d) * tops / factorial(d + powers.iter().sum::<usize>());
            assert!((sum - exact).abs() < 2e-16, "{d} {powers:?}: {sum} {exact}");
        }
    }

    #[test]
    fn fine_rules_are_exact_for_degree_four() {
        check_fine(fine_cell_rule::<2>(), 2);
        check_fine(fine_cell_rule::<3>(), 3);
        check_fine(fine_facet_rule::<2>(), 1);
        check_fine(fine_facet_rule::<3>(), 2);
        assert!(fine_cell_rule::<3>().len() == MOST_POINTS && fine_cell_rule::<2>().len() <= MOST_POINTS);
    }

    #[test]
    fn evenly_spread_places_have_their_mean_in_the_centre() {
        for (corners, parts, count) in [(2, 16, 16), (3, 5, 15), (3, 12, 78), (4, 4, 20)] {
            let places = evenly_spread(corners, parts);
            assert_eq!(places.len(), count);
            for corner in 0..4 {
                let mean = places.iter().map(|shares| shares[corner]).sum::<f64>() / count as f64;
                let centre = if corner < corners { 1.0 / corners as f64 } else { 0.0 };
                assert!((mean - centre).abs() < 1e-14, "{corner}: {mean}");
            }
            assert!(places.iter().all(|shares| (shares.iter().sum::<f64>() - 1.0).abs() < 1e-14));
        }
    }
}
