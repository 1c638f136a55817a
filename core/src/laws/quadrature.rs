//! Gauss's rule with ten points.

use crate::linear_algebra::tensor::larger;

/// Points of the quadrature of Gauss and Legendre on [-1, 1] and their weights; those at the negative points are the same. (M. Abramowitz,
/// I. A. Stegun, Handbook of Mathematical Functions, table 25.4.)
const RULE: [[f64; 2]; 5] = [
    [0.148_874_338_981_631_22, 0.295_524_224_714_752_87],
    [0.433_395_394_129_247_2, 0.269_266_719_309_996_35],
    [0.679_409_568_299_024_4, 0.219_086_362_515_982_04],
    [0.865_063_366_688_984_5, 0.149_451_349_150_580_6],
    [0.973_906_528_517_171_7, 0.066_671_344_308_688_14],
];

/// The Legendre polynomials of degrees 8 and 9 at these points, times 17/2 and 19/2.
const LAST: [[f64; 2]; 5] = {
    let mut last = [[0.0; 2]; 5];
    let mut point = 0;
    while point < 5 {
        let (x, mut pair, mut degree) = (RULE[point][0], [1.0, RULE[point][0]], 1.0);
        while degree < 9.0 {
            pair = [pair[1], ((2.0 * degree + 1.0) * x * pair[1] - degree * pair[0]) / (degree + 1.0)];
            degree += 1.0;
        }
        last[point] = [8.5 * pair[0], 9.5 * pair[1]];
        point += 1;
    }
    last
};

/// The points of the quadrature from `a` to `b` and their weights, whose sum is `b - a`.
pub fn rule([a, b]: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
    let length = b - a;
    let side = move |sign: f64| {
        RULE.into_iter()
            .map(move |[at, weight]| [a + (0.5 + 0.5 * sign * at) * length, 0.5 * weight * length])
    };
    side(-1.0).chain(side(1.0))
}

/// The means of a smooth function and of its absolute value from `a` to `b`, and the larger one of its coefficients of the Legendre
/// polynomials of degrees 8 and 9: where they fall geometrically with the degree, the error of the mean is about the square of this one,
/// as it is made by the degrees from 20 on.
pub fn means(function: impl Fn(f64) -> f64, [a, b]: [f64; 2]) -> [f64; 3] {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let (mut sums, mut last) = ([0.0; 2], [0.0; 2]);
    for ([at, weight], [even, odd]) in RULE.iter().zip(LAST) {
        let values = [function(middle - half * at), function(middle + half * at)];
        sums[0] += weight * (values[0] + values[1]);
        sums[1] += weight * (values[0].abs() + values[1].abs());
        last[0] += weight * even * (values[0] + values[1]);
        last[1] += weight * odd * (values[1] - values[0]);
    }
    [0.5 * sums[0], 0.5 * sums[1], larger(last[0].abs(), last[1].abs())]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_19_have_their_means() {
        let [mean, size, _] = means(|x| x.powi(19) + 1.0, [-1.0, 3.0]);
        let exact = (3f64.powi(20) - 1.0) / 20.0 / 4.0 + 1.0;
        assert!((mean / exact - 1.0).abs() < 1e-14 && size >= mean, "{mean} {size} {exact}");
        assert_eq!(means(|x| x, [2.0, 2.0]).map(|mean| (mean * 1e12).round()), [2e12, 2e12, 0.0]);
    }

    #[test]
    fn the_last_coefficients_tell_how_smooth_a_function_is() {
        // x^8 has 128/6435 times the polynomial of degree 8, x^9 has 128/12155 times that of degree 9.
        for (degree, coefficient) in [(7, 0.0), (8, 128.0 / 6435.0), (9, 128.0 / 12155.0)] {
            let [_, _, last] = means(|x| x.powi(degree), [-1.0, 1.0]);
            assert!((last - coefficient).abs() < 1e-14, "{degree}: {last}");
        }
        let [mean, _, last] = means(f64::exp, [0.0, 1.0]);
        assert!(last < 1e-8 && (mean - 1f64.exp_m1()).abs() < 1e-15, "{last}");
        let [_, _, last] = means(f64::sqrt, [0.0, 1.0]);
        assert!(last > 1e-4, "{last}");
    }
}
