//! Quadrature on cells and facets, exact for polynomials of degree 2.

/// Points in barycentric coordinates (`D + 1` used) and weights that sum to 1.
pub type CellRule = &'static [([f64; 4], f64)];

/// Points in barycentric coordinates (`D` used) and weights that sum to 1.
pub type FacetRule = &'static [([f64; 3], f64)];

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

/// The rule for triangles (`D = 2`) or tetrahedra (`D = 3`).
pub const fn cell_rule<const D: usize>() -> CellRule {
    if D == 2 { TRIANGLE } else { TETRAHEDRON }
}

/// The rule for edges (`D = 2`) or triangular faces (`D = 3`).
pub const fn facet_rule<const D: usize>() -> FacetRule {
    if D == 2 { EDGE } else { FACE }
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
}
