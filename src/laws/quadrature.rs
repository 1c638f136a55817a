//! Gauss's rule with ten points.

/// Points of the quadrature of Gauss and Legendre on [-1, 1] and their weights; those at the negative points are the same. (M. Abramowitz,
/// I. A. Stegun, Handbook of Mathematical Functions, table 25.4.)
const RULE: [[f64; 2]; 5] = [
    [0.148_874_338_981_631_22, 0.295_524_224_714_752_87],
    [0.433_395_394_129_247_2, 0.269_266_719_309_996_35],
    [0.679_409_568_299_024_4, 0.219_086_362_515_982_04],
    [0.865_063_366_688_984_5, 0.149_451_349_150_580_6],
    [0.973_906_528_517_171_7, 0.066_671_344_308_688_14],
];

/// The means of a smooth function and of its absolute value from `a` to `b`.
pub fn means(function: impl Fn(f64) -> f64, [a, b]: [f64; 2]) -> [f64; 2] {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let sums = RULE.iter().fold([0.0; 2], |[sum, size], [at, weight]| {
        let values = [function(middle - half * at), function(middle + half * at)];
        [sum + weight * (values[0] + values[1]), size + weight * (values[0].abs() + values[1].abs())]
    });
    sums.map(|sum| 0.5 * sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_19_have_their_means() {
        let [mean, size] = means(|x| x.powi(19) + 1.0, [-1.0, 3.0]);
        let exact = (3f64.powi(20) - 1.0) / 20.0 / 4.0 + 1.0;
        assert!((mean / exact - 1.0).abs() < 1e-14 && size >= mean, "{mean} {size} {exact}");
        assert_eq!(means(|x| x, [2.0, 2.0]).map(|mean| (mean * 1e12).round()), [2e12; 2]);
    }
}
