use super::geometry::{Point, clip, measure_and_centroid, quadrature};
use super::*;
use std::collections::BTreeMap;

/// Uniform numbers (splitmix64).
struct Random(u64);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        (self.uniform(0.0, count as f64) as usize).min(count - 1)
    }

    /// Orthonormal rows with determinant 1; for 2D the third row and column are those of the identity.
    fn rotation<const D: usize>(&mut self) -> [[f64; 3]; 3] {
        let mut rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (i, j) in [(0, 1), (1, 2), (0, 2)].into_iter().take(if D == 2 { 1 } else { 3 }) {
            let (sin, cos) = self.uniform(0.0, std::f64::consts::TAU).sin_cos();
            for row in &mut rows {
                (row[i], row[j]) = (cos * row[i] - sin * row[j], sin * row[i] + cos * row[j]);
            }
        }
        rows
    }
}

/// A surface with the places of its nodes by number.
#[derive(Clone)]
struct Surface<const D: usize> {
    facets: Vec<Facet<D>>,
    places: BTreeMap<u32, Vector<D>>,
}

impl<const D: usize> Surface<D> {
    /// Facets of corners among `points`, numbered from `first`; with nodes in the middle of the sides if
    /// `quadratic`. All normals have a positive component along `side`.
    fn new(
        points: &[Vector<D>],
        cells: &[[usize; D]],
        (side, first, quadratic): (Vector<D>, u32, bool),
    ) -> Self {
        let mut places: BTreeMap<u32, Vector<D>> = (first..).zip(points.iter().copied()).collect();
        let mut middles = BTreeMap::new();
        let mut facets = Vec::new();
        for cell in cells {
            let corners = cell.map(|i| points[i]);
            let mut nodes: Vec<u32> = cell.iter().map(|&i| first + i as u32).collect();
            if quadratic {
                for &(i, j) in sides::<D>() {
                    let key = (cell[i].min(cell[j]), cell[i].max(cell[j]));
                    let next = first + (points.len() + middles.len()) as u32;
                    let number = *middles.entry(key).or_insert(next);
                    nodes.push(number);
                    places.insert(number, std::array::from_fn(|k| 0.5 * (corners[i][k] + corners[j][k])));
                }
            }
            facets.push(Facet { normal: normal(&corners, &side), ..Facet::new(nodes, corners) });
        }
        Self { facets, places }
    }

    fn moved(&self, rotation: &[[f64; 3]; 3], by: &Vector<D>) -> Self {
        let turn = |v: &Vector<D>| -> Vector<D> {
            std::array::from_fn(|i| (0..D).map(|j| rotation[i][j] * v[j]).sum())
        };
        let place = |x: &Vector<D>| {
            let turned = turn(x);
            std::array::from_fn(|i| turned[i] + by[i])
        };
        let facets = self.facets.iter().map(|facet| Facet {
            normal: turn(&facet.normal),
            corners: facet.corners.map(|corner| place(&corner)),
            ..facet.clone()
        });
        let places = self.places.iter().map(|(&number, x)| (number, place(x))).collect();
        Self { facets: facets.collect(), places }
    }
}

/// The unit normal of a facet on this side of it.
fn normal<const D: usize>(corners: &[Vector<D>; D], side: &Vector<D>) -> Vector<D> {
    let a = subtract(&corners[1], &corners[0]);
    let mut normal = [0.0; D];
    if D == 2 {
        (normal[0], normal[1]) = (-a[1], a[0]);
    } else {
        let b = subtract(&corners[D - 1], &corners[0]);
        normal = std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
    }
    let length = dot(&normal, &normal).sqrt() * dot(&normal, side).signum();
    normal.map(|x| x / length)
}

const FIRST_MASTER: u32 = 1000;

/// Segments between these abscissae on the line y = height(x).
fn segments(xs: &[f64], height: impl Fn(f64) -> f64, of: (f64, u32, bool)) -> Surface<2> {
    let points: Vec<_> = xs.iter().map(|&x| [x, height(x)]).collect();
    let cells: Vec<_> = (1..xs.len()).map(|i| [i - 1, i]).collect();
    Surface::new(&points, &cells, ([0.0, of.0], of.1, of.2))
}

fn slave_segments(xs: &[f64], quadratic: bool) -> Surface<2> {
    segments(xs, |_| 0.0, (1.0, 0, quadratic))
}

fn master_segments(xs: &[f64], quadratic: bool) -> Surface<2> {
    segments(xs, |_| 0.0, (-1.0, FIRST_MASTER, quadratic))
}

/// A unit square at z = 0 of 2 * cells[0] * cells[1] triangles with random nodes; the outline stays the
/// square.
fn square(random: &mut Random, cells: [usize; 2], (side, first, quadratic): (f64, u32, bool)) -> Surface<3> {
    let [columns, rows] = cells;
    let mut points = Vec::new();
    for j in 0..=rows {
        for i in 0..=columns {
            let place = |i: usize, count: usize, random: &mut Random| {
                let shift = if i == 0 || i == count { 0.0 } else { random.uniform(-0.24, 0.24) };
                (i as f64 + shift) / count as f64
            };
            points.push([place(i, columns, random), place(j, rows, random), 0.0]);
        }
    }
    let mut triangles = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let at = |di: usize, dj: usize| (j + dj) * (columns + 1) + i + di;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            let two = if random.below(2) == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            for mut triangle in two {
                triangle.rotate_left(random.below(3));
                if random.below(2) == 0 {
                    triangle.swap(1, 2);
                }
                triangles.push(triangle);
            }
        }
    }
    Surface::new(&points, &triangles, ([0.0, 0.0, side], first, quadratic))
}

/// A pair of random unit squares in contact, the slave one below.
fn squares(random: &mut Random, slave: bool, master: bool) -> [Surface<3>; 2] {
    [(1.0, 0, slave), (-1.0, FIRST_MASTER, master)].map(|of| {
        let cells = [1 + random.below(4), 1 + random.below(4)];
        square(random, cells, of)
    })
}

fn pair<const D: usize>(slave: &Surface<D>, master: &Surface<D>) -> Vec<Contribution<D>> {
    contributions(&slave.facets, &master.facets, [0.0, f64::INFINITY])
}

/// The contributions summed by node.
fn by_node<const D: usize>(contributions: &[Contribution<D>]) -> BTreeMap<u32, Contribution<D>> {
    let mut sums: BTreeMap<u32, Contribution<D>> = BTreeMap::new();
    for one in contributions {
        let empty = Contribution {
            node: one.node,
            normal: one.normal,
            weight: 0.0,
            whole: 0.0,
            gap: 0.0,
            corners: 0.0,
            beyond: [f64::INFINITY; D],
            normals: [Normals::NONE; 2],
            masters: Vec::new(),
        };
        let sum = sums.entry(one.node).or_insert(empty);
        sum.weight += one.weight;
        sum.whole += one.whole;
        sum.gap += one.gap;
        sum.corners += one.corners;
        sum.masters.extend(&one.masters);
        sum_by_node(&mut sum.masters);
    }
    sums
}

fn close(value: f64, expected: f64, tolerance: f64) {
    // Fails for NaN.
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected} within {tolerance}");
}

fn same<const D: usize>(these: &[Contribution<D>], those: &[Contribution<D>], tolerance: f64) {
    assert_eq!(these.len(), those.len());
    for (a, b) in these.iter().zip(those) {
        assert_eq!(a.node, b.node);
        close(a.weight, b.weight, tolerance);
        close(a.whole, b.whole, tolerance);
        close(a.gap, b.gap, tolerance);
        let all: std::collections::BTreeSet<u32> =
            a.masters.iter().chain(&b.masters).map(|entry| entry.0).collect();
        for node in all {
            close(entry(a, node), entry(b, node), tolerance);
        }
    }
}

fn entry<const D: usize>(of: &Contribution<D>, node: u32) -> f64 {
    of.masters.iter().filter(|entry| entry.0 == node).map(|entry| entry.1).sum()
}

/// The largest error of the transfer of polynomials of the place of up to this degree, whose values at the
/// masters are to give the value at the node times its weight; 1 among them, for which the masters sum to the
/// weight.
fn transfer_error<const D: usize>(one: &Contribution<D>, surfaces: [&Surface<D>; 2], degree: usize) -> f64 {
    let place =
        |node: &u32| surfaces.iter().find_map(|surface| surface.places.get(node)).expect("it is known");
    assert!(one.masters.is_sorted_by(|a, b| a.0 < b.0));
    let error = |function: &dyn Fn(&Vector<D>) -> f64| {
        let sum: f64 = one.masters.iter().map(|(b, value)| value * function(place(b))).sum();
        (sum - one.weight * function(place(&one.node))).abs()
    };
    let mut errors = vec![error(&|_| 1.0)];
    for i in 0..D {
        errors.push(error(&|x| x[i]));
        errors.extend((0..=i).filter(|_| degree == 2).map(|j| error(&|x| x[i] * x[j])));
    }
    errors.into_iter().fold(0.0, |most, x| if x <= most { most } else { x })
}

fn check_transfer<const D: usize>(
    contributions: &[Contribution<D>],
    surfaces: [&Surface<D>; 2],
    degree: usize,
    tolerance: f64,
) {
    contributions.iter().for_each(|one| close(transfer_error(one, surfaces, degree), 0.0, tolerance));
}

#[test]
fn quadratures_are_exact_to_degree_4() {
    let corners: [Point; 3] = [[0.2, -0.1], [1.3, 0.4], [0.1, 0.9]];
    let area = measure_and_centroid::<3>(&corners).0;
    close(area, 0.5 * (1.1 * 1.0 + 0.5 * 0.1), 1e-15);
    // int lambda_0^i lambda_1^j lambda_2^k = 2 A i! j! k! / (i + j + k + 2)!
    let factorial = |n: usize| (1..=n).product::<usize>() as f64;
    let points = quadrature::<3>(&corners);
    assert_eq!(points.len(), 6);
    for (i, j, k) in
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 1, 0), (1, 1, 1), (2, 2, 0), (4, 0, 0), (2, 1, 1), (0, 1, 3)]
    {
        let sum: f64 = points
            .iter()
            .map(|&(place, weight)| {
                let shape = Shape::<3>::new(false, &corners, place).values();
                weight * shape[0].powi(i as i32) * shape[1].powi(j as i32) * shape[2].powi(k as i32)
            })
            .sum();
        let exact = 2.0 * area * factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 2);
        close(sum, exact, 1e-15);
    }
    for n in 0..=5 {
        let sum: f64 =
            quadrature::<2>(&[[0.5, 0.0], [2.0, 0.0]]).iter().map(|(x, weight)| weight * x[0].powi(n)).sum();
        let exact = (2.0f64.powi(n + 1) - 0.5f64.powi(n + 1)) / f64::from(n + 1);
        close(sum, exact, 1e-14 * exact);
    }
}

#[test]
fn shape_functions_are_1_at_their_nodes_and_their_differences_are_consistent() {
    let corners: [Point; 3] = [[0.2, -0.1], [1.3, 0.4], [0.1, 0.9]];
    let middle =
        |i: usize, j: usize| -> Point { std::array::from_fn(|k| 0.5 * (corners[i][k] + corners[j][k])) };
    let nodes = [corners[0], corners[1], corners[2], middle(0, 1), middle(1, 2), middle(2, 0)];
    let about = Shape::<3>::new(true, &corners, [0.4, 0.3]);
    for (m, &node) in nodes.iter().enumerate() {
        let values = Shape::<3>::new(true, &corners, node).values();
        let (start, differences) = (about.values(), about.differences(subtract(&node, &[0.4, 0.3])));
        for k in 0..6 {
            let expected = if k == m { 1.0 } else { 0.0 };
            close(values[k], expected, 1e-15);
            close(start[k] + differences[k], expected, 1e-14);
        }
    }
    let segment: [Point; 2] = [[1.0, 0.0], [3.0, 0.0]];
    for (m, x) in [1.0, 3.0, 2.0].into_iter().enumerate() {
        let values = Shape::<2>::new(true, &segment, [x, 0.0]).values();
        (0..3).for_each(|k| close(values[k], if k == m { 1.0 } else { 0.0 }, 1e-15));
    }
}

#[test]
fn clipping() {
    let triangle: [Point; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let area = |polygon: &[Point]| measure_and_centroid::<3>(polygon).0;
    close(area(&clip::<3>(&triangle, &triangle)), 0.5, 1e-15);
    // The triangle mirrored at the middle of its long side shares that side only.
    close(area(&clip::<3>(&triangle, &[[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])), 0.0, 1e-15);
    assert!(clip::<3>(&triangle, &[[2.0, 0.0], [3.0, 0.0], [2.0, 1.0]]).is_empty());
    // A hexagon of two triangles that are turned by 180 degrees to each other about the common centroid: 2/3.
    let turned = triangle.map(|[x, y]| [2.0 / 3.0 - x, 2.0 / 3.0 - y]);
    let hexagon = clip::<3>(&triangle, &turned);
    assert_eq!(hexagon.len(), 6);
    let (area, centroid) = measure_and_centroid::<3>(&hexagon);
    close(area, 1.0 / 3.0, 1e-15);
    centroid.iter().for_each(|&x| close(x, 1.0 / 3.0, 1e-15));
    assert!(clip::<2>(&[[0.0, 0.0], [1.0, 0.0]], &[[1.0, 0.0], [2.0, 0.0]]).is_empty());
}

#[test]
fn matching_segments_give_the_whole_weight_to_the_facing_node() {
    for quadratic in [false, true] {
        let xs = [0.0, 0.5, 2.0];
        let (slave, master) = (slave_segments(&xs, quadratic), master_segments(&xs, quadratic));
        let all = pair(&slave, &master);
        let shares = if quadratic { vec![1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0] } else { vec![0.5, 0.5] };
        assert_eq!(all.len(), 2 * shares.len());
        for (k, one) in all.iter().enumerate() {
            let expected = shares[k % shares.len()] * if k < shares.len() { 0.5 } else { 1.5 };
            close(one.weight, expected, 1e-15);
            close(one.whole, expected, 1e-15);
            close(one.gap, 0.0, 1e-15);
            for &(b, value) in &one.masters {
                close(value, if b == FIRST_MASTER + one.node { expected } else { 0.0 }, 1e-14);
            }
            close(entry(one, FIRST_MASTER + one.node), expected, 1e-14);
        }
    }
}

#[test]
fn matching_triangles_give_the_whole_weight_to_the_facing_node() {
    let random = &mut Random(1);
    for quadratic in [false, true] {
        let slave = square(random, [3, 2], (1.0, 0, quadratic));
        let mut master = slave.clone();
        for facet in &mut master.facets {
            facet.nodes.iter_mut().for_each(|node| *node += FIRST_MASTER);
            facet.normal[2] = -1.0;
        }
        let sums = by_node(&pair(&slave, &master));
        let mut total = 0.0;
        for (node, one) in &sums {
            close(one.weight, one.whole, 1e-14);
            close(entry(one, FIRST_MASTER + node), one.weight, 1e-14);
            let others = one.masters.iter().filter(|entry| entry.0 != FIRST_MASTER + node);
            others.for_each(|entry| close(entry.1, 0.0, 1e-14));
            total += one.weight;
        }
        close(total, 1.0, 1e-14);
        assert_eq!(sums.len(), if quadratic { 9 + 8 + 6 } else { 12 });
    }
}

#[test]
fn weights_of_a_quadratic_triangle() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let slave = Surface::new(&points, &[[0, 1, 2]], ([0.0, 0.0, 1.0], 0, true));
    let master = Surface::new(&points, &[[0, 1, 2]], ([0.0, 0.0, -1.0], FIRST_MASTER, true));
    let all = pair(&slave, &master);
    assert_eq!(all.iter().map(|one| one.node).collect::<Vec<_>>(), [3, 4, 5]);
    for one in &all {
        close(one.weight, 1.0 / 6.0, 1e-15);
        close(one.whole, 1.0 / 6.0, 1e-15);
        // Of the facing facet only the facing node counts, and the corners of the slave facet do not.
        assert_eq!(one.corners, 0.0);
        for &(b, value) in &one.masters {
            assert!(b >= FIRST_MASTER);
            close(value, if b == FIRST_MASTER + one.node { one.weight } else { 0.0 }, 1e-15);
        }
    }
}

#[test]
fn half_of_a_quadratic_triangle() {
    // Covered for x > y.
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let slave = Surface::new(&points, &[[0, 1, 2]], ([0.0, 0.0, 1.0], 0, true));
    let half = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
    let master = Surface::new(&half, &[[0, 1, 2]], ([0.0, 0.0, -1.0], FIRST_MASTER, true));
    let all = pair(&slave, &master);
    // int phi_c = int lambda_c (2 lambda_c - 1) over half of the facet, of area 1/4 with lambda = (1,0,0), (0,1,0), (0,1/2,1/2).
    let triangle = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.5, 0.5]];
    let product = |i: usize, j: usize| -> f64 {
        let sums = [i, j].map(|k| triangle.iter().map(|corner| corner[k]).sum::<f64>());
        let both: f64 = triangle.iter().map(|corner| corner[i] * corner[j]).sum();
        0.25 / 12.0 * (sums[0] * sums[1] + both)
    };
    let mean = |i: usize| 0.25 / 3.0 * triangle.iter().map(|corner| corner[i]).sum::<f64>();
    let corner = |i: usize| 2.0 * product(i, i) - mean(i);
    for (one, (i, j)) in all.iter().zip([(0, 1), (1, 2), (2, 0)]) {
        close(one.weight, 4.0 * product(i, j), 1e-15);
        close(one.corners, 0.5 * (corner(i) + corner(j)), 1e-14);
        close(entry(one, i as u32), -0.5 * corner(i), 1e-14);
        close(entry(one, j as u32), -0.5 * corner(j), 1e-14);
    }
}

#[test]
fn one_segment_against_two() {
    let (slave, master) = (slave_segments(&[0.0, 1.0], false), master_segments(&[0.0, 0.4, 1.0], false));
    let all = pair(&slave, &master);
    // psi_0 = 2 - 3 x and psi_1 = 3 x - 1 times the weight of 1/2 over int phi = 1/2; phi_0 = 1 - x / 0.4 on
    // [0, 0.4]: int psi_0 phi_0 = 2 (0.2) - 3 (0.4^2 / 6) = 0.32, int psi_1 phi_0 = 0.08 - 0.2 = -0.12. phi_2
    // = (x - 0.4) / 0.6: int phi_2 = 0.3, int x phi_2 = 0.3 (0.8) = 0.24: psi_0: -0.12, psi_1: 0.42.
    let expected = [[0.32, 0.3, -0.12], [-0.12, 0.2, 0.42]];
    for (one, row) in all.iter().zip(&expected) {
        close(one.weight, 0.5, 1e-15);
        close(one.whole, 0.5, 1e-15);
        assert_eq!(one.masters.len(), 3);
        for (k, &value) in row.iter().enumerate() {
            close(entry(one, FIRST_MASTER + k as u32), value, 1e-15);
        }
    }
}

#[test]
fn partly_covered_segment() {
    // Covered on [0, 0.5]: weights 3/8 and 1/8.
    let slave = slave_segments(&[0.0, 1.0], false);
    let master = segments(&[-0.3, 0.5], |x| 0.1 + x, (-1.0, FIRST_MASTER, false));
    let all = pair(&slave, &master);
    close(all[0].weight, 0.375, 1e-15);
    close(all[1].weight, 0.125, 1e-15);
    all.iter().for_each(|one| close(one.whole, 0.5, 1e-15));
    check_transfer(
        &pair(&slave, &segments(&[-0.3, 0.5], |_| 0.0, (-1.0, FIRST_MASTER, false))),
        [&slave, &segments(&[-0.3, 0.5], |_| 0.0, (-1.0, FIRST_MASTER, false))],
        1,
        1e-15,
    );
    // The gap at the nodes is g(x_a) times the weight, even where x_a is not covered.
    close(all[0].gap, 0.375 * 0.1, 1e-15);
    close(all[1].gap, 0.125 * 1.1, 1e-15);
    // Quadratic: phi_1 = x (2 x - 1) has the negative integral 1/12 - 1/8 on [0, 1/2].
    let slave = slave_segments(&[0.0, 1.0], true);
    let all = pair(&slave, &master);
    close(all[1].weight, 1.0 / 12.0 - 1.0 / 8.0, 1e-15);
    close(all.iter().map(|one| one.weight).sum(), 0.5, 1e-15);
}

#[test]
fn uncovered_facets_contribute_their_whole_alone() {
    let slave = slave_segments(&[0.0, 1.0], true);
    for master in [vec![], vec![1.0, 2.0], vec![1.0 - 1e-10, 2.0]] {
        let all = pair(&slave, &master_segments(&master, false));
        assert_eq!(all.len(), 3);
        for (one, share) in all.iter().zip([1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0]) {
            assert!(one.weight == 0.0 && one.gap == 0.0 && one.masters.is_empty());
            close(one.whole, share, 1e-15);
        }
    }
}

#[test]
fn sums_and_transfer_where_covered_in_part() {
    let random = &mut Random(2);
    for (slave_order, master_order) in [(false, false), (true, true), (false, true), (true, false)] {
        for _ in 0..20 {
            let [slave, master] = squares(random, slave_order, master_order);
            // The master square is turned in its plane and shifted, so that it covers a part.
            let (sin, cos) = random.uniform(0.0, std::f64::consts::TAU).sin_cos();
            let turn = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
            let shift = [random.uniform(0.0, 1.0), random.uniform(0.0, 1.0), 0.0];
            let master = master.moved(&turn, &shift);
            let all = pair(&slave, &master);
            let degree = if slave_order && master_order { 2 } else { 1 };
            check_transfer(&all, [&slave, &master], degree, 1e-11);
            // sum_a psi_a = 1, so that the sums over a are the integrals of the master shape functions: the
            // masters less the slave corners sum to the covered area.
            let covered: f64 = all
                .iter()
                .flat_map(|one| &one.masters)
                .filter(|entry| entry.0 >= FIRST_MASTER)
                .map(|entry| entry.1)
                .sum();
            let expected: f64 = slave
                .facets
                .iter()
                .flat_map(|s| master.facets.iter().map(move |m| (s, m)))
                .map(|(s, m)| {
                    let flat = |f: &Facet<3>| oriented::<3>(f.corners.map(|c| [c[0], c[1]]));
                    measure_and_centroid::<3>(&clip::<3>(&flat(s), &flat(m))).0
                })
                .sum();
            close(covered, expected, 1e-11);
            close(all.iter().map(|one| one.weight + one.corners).sum(), expected, 1e-11);
            assert!(slave_order || all.iter().all(|one| one.corners == 0.0));
        }
    }
}

#[test]
fn random_squares_reproduce_linear_functions() {
    let random = &mut Random(3);
    for trial in 0..200 {
        let (slave_order, master_order) = (trial % 2 == 1, trial % 4 >= 2);
        let [slave, master] = squares(random, slave_order, master_order);
        let all: Vec<_> = by_node(&pair(&slave, &master)).into_values().collect();
        for one in &all {
            close(one.weight, one.whole, 1e-11);
        }
        close(all.iter().map(|one| one.weight).sum(), 1.0, 1e-11);
        check_transfer(&all, [&slave, &master], if slave_order && master_order { 2 } else { 1 }, 1e-12);
    }
}

#[test]
fn random_segments_reproduce_polynomials() {
    let random = &mut Random(4);
    for trial in 0..100 {
        let (slave_order, master_order) = (trial % 2 == 1, trial % 4 >= 2);
        let mut xs = || {
            let mut xs: Vec<f64> = (0..6).map(|_| random.uniform(0.0, 1.0)).collect();
            xs.extend([0.0, 1.0]);
            xs.sort_by(f64::total_cmp);
            xs
        };
        let (slave, master) = (slave_segments(&xs(), slave_order), master_segments(&xs(), master_order));
        let all = pair(&slave, &master);
        check_transfer(&all, [&slave, &master], if slave_order && master_order { 2 } else { 1 }, 1e-12);
        all.iter().for_each(|one| close(one.weight, one.whole, 1e-12));
        close(all.iter().map(|one| one.weight).sum(), 1.0, 1e-12);
    }
}

#[test]
fn constant_pressure_gives_the_exact_forces_of_the_master_nodes() {
    fn check<const D: usize>(slave: &Surface<D>, master: &Surface<D>) {
        let mut forces: BTreeMap<u32, f64> = BTreeMap::new();
        for one in pair(slave, master) {
            one.masters.iter().for_each(|&(b, value)| *forces.entry(b).or_default() += value);
        }
        let mut exact: BTreeMap<u32, f64> = BTreeMap::new();
        for facet in &master.facets {
            let measure = Slave::new(facet).measure;
            for (i, &node) in facet.nodes.iter().enumerate() {
                *exact.entry(node).or_default() += measure * facet.share(i);
            }
        }
        for (&node, &force) in &exact {
            close(forces[&node], force, 1e-11);
        }
        // The corners of quadratic triangles of a slave surface that is covered get nothing.
        assert!(forces.keys().all(|&node| node >= FIRST_MASTER));
    }
    let random = &mut Random(5);
    for (slave_order, master_order) in [(false, false), (true, true), (false, true), (true, false)] {
        let rings = [
            slave_segments(&[0.0, 0.3, 0.7, 1.0], slave_order),
            master_segments(&[0.0, 0.45, 1.0], master_order),
        ];
        let [slave, master] = rings.map(|mut surface| {
            surface.facets.iter_mut().for_each(|facet| facet.turns = facet.corners.map(|[radius, _]| radius));
            surface
        });
        check(&slave, &master);
        let [slave, master] = squares(random, slave_order, master_order);
        check(&slave, &master);
        check(
            &slave_segments(&[0.0, 0.3, 0.7, 1.0], slave_order),
            &master_segments(&[0.0, 0.45, 1.0], master_order),
        );
    }
}

#[test]
fn rotations_and_shifts_do_not_change_the_numbers() {
    let random = &mut Random(6);
    for order in [false, true] {
        let [slave, master] = squares(random, order, order);
        // A gap that is not constant: the master plane is tilted.
        let (sin, cos) = 0.2f64.sin_cos();
        let master = master.moved(&[[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]], &[0.03, 0.1, 0.02]);
        let all = pair(&slave, &master);
        assert!(all.iter().any(|one| one.gap > 1e-3));
        for _ in 0..5 {
            let (rotation, by) = (random.rotation::<3>(), [0.3, -2.0, 1.0]);
            same(&all, &pair(&slave.moved(&rotation, &by), &master.moved(&rotation, &by)), 1e-11);
        }
        let slave = slave_segments(&[0.0, 0.3, 1.0], order);
        let master = segments(&[0.1, 0.6, 1.2], |x| 0.2 * x, (-1.0, FIRST_MASTER, order));
        for _ in 0..5 {
            let (rotation, by) = (random.rotation::<2>(), [0.3, -2.0]);
            let moved = pair(&slave.moved(&rotation, &by), &master.moved(&rotation, &by));
            same(&pair(&slave, &master), &moved, 1e-12);
        }
    }
}

#[test]
fn gaps_that_are_linear() {
    // Along the slave normal the gap is the sum of the masters times their heights, less the weight times
    // that of the node: psi_a gives w_a g(x_a) for a linear g.
    let random = &mut Random(7);
    for order in [false, true] {
        let [slave, mut master] = squares(random, order, false);
        let gap = |x: &Vector<3>| 0.3 + 0.2 * x[0] - 0.15 * x[1];
        for facet in &mut master.facets {
            facet.corners = facet.corners.map(|x| [x[0], x[1], gap(&x)]);
            facet.normal = normal(&facet.corners, &[0.0, 0.0, -1.0]);
        }
        for one in pair(&slave, &master) {
            let heights: f64 = one
                .masters
                .iter()
                .map(|(b, value)| value * if *b < FIRST_MASTER { 0.0 } else { gap(&master.places[b]) })
                .sum();
            close(one.gap, heights, 1e-13);
            close(one.gap, one.weight * gap(&slave.places[&one.node]), 1e-13);
        }
        let slave = slave_segments(&[0.0, 0.3, 1.0], order);
        let master = segments(&[-0.1, 0.6, 1.2], |x| 0.1 + 0.3 * x, (-1.0, FIRST_MASTER, order));
        for one in pair(&slave, &master) {
            close(one.gap, one.weight * (0.1 + 0.3 * slave.places[&one.node][0]), 1e-14);
        }
        // Penetration is negative.
        let below = segments(&[-0.1, 0.6, 1.2], |_| -0.01, (-1.0, FIRST_MASTER, order));
        pair(&slave, &below).iter().for_each(|one| close(one.gap, -0.01 * one.weight, 1e-15));
    }
}

fn is_uncovered<const D: usize>(all: &[Contribution<D>]) -> bool {
    all.iter().all(|one| one.weight == 0.0 && one.masters.is_empty())
}

#[test]
fn facets_that_face_the_same_way_form_no_pair() {
    let slave = slave_segments(&[0.0, 1.0], false);
    assert!(is_uncovered(&pair(&slave, &segments(&[0.0, 1.0], |_| 0.0, (1.0, FIRST_MASTER, false)))));
    // A normal of -0.1 along that of the slave facet is not opposed, one of -0.3 is.
    for (component, covered) in [(0.1f64, false), (0.3, true)] {
        let slope = (1.0 / component.powi(2) - 1.0).sqrt();
        let steep = segments(&[0.0, 0.1], |x| slope * x, (-1.0, FIRST_MASTER, false));
        close(steep.facets[0].normal[1], -component, 1e-14);
        assert_eq!(!is_uncovered(&pair(&slave, &steep)), covered);
    }
}

#[test]
fn of_two_master_facets_over_the_same_part_the_nearer_one_counts() {
    let slave = slave_segments(&[0.0, 1.0], false);
    let far = segments(&[0.0, 1.0], |_| 0.2, (-1.0, 10, false));
    let near = segments(&[0.0, 1.0], |_| -0.1, (-1.0, 20, false));
    // Overlaps the nearer ones by 1e-7 (both count) and by 1e-5 (skipped).
    for (start, counts) in [(0.6 - 1e-7, true), (0.6 - 1e-5, false)] {
        let left = segments(&[0.0, 0.6], |_| 0.1, (-1.0, 30, false));
        let right = segments(&[start, 1.0], |_| 0.15, (-1.0, 40, false));
        let masters = [right.facets, left.facets].concat();
        let all = contributions(&slave.facets, &masters, [0.0, f64::INFINITY]);
        assert_eq!(all[0].masters.iter().any(|entry| entry.0 >= 40), counts);
        assert!(all[0].masters.iter().any(|entry| entry.0 == 30));
    }
    for masters in [[&far, &near], [&near, &far]] {
        let masters: Vec<_> = masters.iter().flat_map(|surface| surface.facets.clone()).collect();
        let all = contributions(&slave.facets, &masters, [0.0, f64::INFINITY]);
        for one in &all {
            assert_eq!(one.masters.iter().map(|entry| entry.0).collect::<Vec<_>>(), [20, 21]);
            close(one.gap, -0.05, 1e-15);
        }
    }
    let deep = segments(&[0.0, 1.0], |_| -0.3, (-1.0, 50, false));
    let masters = [deep.facets, far.facets].concat();
    let all = contributions(&slave.facets, &masters, [0.0, f64::INFINITY]);
    all.iter().for_each(|one| close(one.gap, 0.1, 1e-15));
    let random = &mut Random(8);
    let [slave, near] = squares(random, false, false);
    let far = near.moved(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], &[0.0, 0.0, 0.3]);
    let both = [far.facets, near.facets.clone()].concat();
    same(&pair(&slave, &near), &contributions(&slave.facets, &both, [0.0, f64::INFINITY]), 1e-14);
}

#[test]
fn reach_and_depth() {
    let slave = slave_segments(&[0.0, 1.0], false);
    for (height, reach, covered) in [
        (0.3, 0.4, true),
        (0.3, 0.2, false),
        (1e6, f64::INFINITY, true),
        (-0.4, 0.1, true),
        (-0.6, f64::INFINITY, false),
    ] {
        let master = segments(&[-1.0, 2.0], |_| height, (-1.0, FIRST_MASTER, false));
        let all = contributions(&slave.facets, &master.facets, [0.0, reach]);
        assert_eq!(!is_uncovered(&all), covered, "{height} {reach}");
    }
    // Far above an oblique slave facet, among others beside it.
    let random = &mut Random(9);
    let [slave, master] = squares(random, true, false);
    let rotation = random.rotation::<3>();
    let height = [0.0, 0.0, 500.0];
    let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let far = master.moved(&unit, &height).moved(&rotation, &[0.0; 3]);
    let slave = slave.moved(&rotation, &[0.0; 3]);
    for one in by_node(&pair(&slave, &far)).into_values() {
        close(one.weight, one.whole, 1e-9);
        close(
            one.gap,
            500.0 * one.masters.iter().filter(|e| e.0 >= FIRST_MASTER).map(|e| e.1).sum::<f64>(),
            1e-8,
        );
    }
    assert!(is_uncovered(&contributions(&slave.facets, &far.facets, [0.0, 499.0])));
}

#[test]
fn facets_of_one_surface_on_both_sides_of_its_gap() {
    // A slit: the lower side looks up, the upper side down, and both share the node at its tip.
    let points = [[0.0, 0.0], [1.0, 0.1], [2.0, 0.1], [1.0, -0.1], [2.0, -0.1]];
    let upper = Surface::new(&points, &[[0, 1], [1, 2]], ([0.0, -1.0], 0, false));
    let lower = Surface::new(&points, &[[0, 3], [3, 4]], ([0.0, 1.0], 0, false));
    let all = [upper.facets.clone(), lower.facets.clone()].concat();
    let result = contributions(&lower.facets, &all, [0.0, f64::INFINITY]);
    close(result[2].weight, 0.5, 1e-14);
    close(result[2].gap, 0.1, 1e-14);
    close(entry(&result[2], 1), 0.5, 1e-14);
    // At the tip the facets share a node. The normal of the lower one leans towards the second upper one,
    // which covers the end of it: the lines from (1, -0.1) and through (1, 0.1) along the normal (0.1, 1) are
    // 0.2 * 0.1 apart.
    let length = 1.01f64.sqrt();
    close(result[0].weight + result[1].weight, 0.02 / length, 1e-14);
    assert!(result[..2].iter().all(|one| one.masters.iter().all(|entry| entry.0 == 1 || entry.0 == 2)));
    // If the tip were two nodes, they would be a pair.
    let mut apart = all;
    apart[0].nodes[0] = 9;
    let result = contributions(&lower.facets, &apart, [0.0, f64::INFINITY]);
    close(result[0].weight + result[1].weight, length, 1e-13);
}

#[test]
fn parts_of_a_surface_face_what_they_ask_other_parts_for_and_little_else() {
    let mut random = Random(7);
    let slave = square(&mut random, [13, 11], (1.0, 0, false));
    let master = square(&mut random, [12, 14], (-1.0, FIRST_MASTER, false));
    let oblique = random.rotation::<3>();
    let [slave, mut master] = [slave, master].map(|surface| surface.moved(&oblique, &[0.0; 3]));
    // What is not finite is in no box and faces nothing.
    master.facets[5].corners[0] = [f64::NAN; 3];
    let reach = [0.05, f64::INFINITY];
    let parts = |surface: &Surface<3>, count: usize| -> Vec<Vec<Facet<3>>> {
        surface.facets.chunks(surface.facets.len().div_ceil(count)).map(<[_]>::to_vec).collect()
    };
    let masters = parts(&master, 5);
    for own in parts(&slave, 4) {
        let mut asked = Vec::new();
        for part in &masters {
            let boxes = boxes_around(part, 8);
            assert!((1..=8).contains(&boxes.len()));
            let [near, none] = &may_face(&own, &[&boxes, &[]], reach)[..] else { panic!("two lists") };
            assert!(none.is_empty());
            let wanted: Vec<Facet<3>> = near.iter().map(|at| own[*at].clone()).collect();
            let [found, none] = &facing(&[wanted, Vec::new()], part, reach)[..] else { panic!("two lists") };
            assert!(none.is_empty());
            asked.extend(found.iter().map(|at| part[*at].clone()));
        }
        assert_eq!(contributions(&own, &asked, reach), contributions(&own, &master.facets, reach));
        assert!(3 * asked.len() < 2 * master.facets.len(), "{} of {}", asked.len(), master.facets.len());
    }
}

/// A polygon on the unit circle whose normals look out or in.
fn circle(count: usize, (start, out, first, quadratic): (f64, f64, u32, bool)) -> Surface<2> {
    let points: Vec<_> = (0..count)
        .map(|i| {
            let (sin, cos) = (start + 2.0 * std::f64::consts::PI * i as f64 / count as f64).sin_cos();
            [cos, sin]
        })
        .collect();
    let mut surface = Surface { facets: Vec::new(), places: BTreeMap::new() };
    for i in 0..count {
        let j = (i + 1) % count;
        let side = [out * (points[i][0] + points[j][0]), out * (points[i][1] + points[j][1])];
        let one = Surface::new(&points, &[[i, j]], (side, first, quadratic));
        surface.places.extend(&one.places);
        surface.facets.extend(one.facets);
    }
    if quadratic {
        for (i, facet) in surface.facets.iter_mut().enumerate() {
            facet.nodes[2] = first + (count + i) as u32;
        }
    }
    surface
}

#[test]
fn curved_surfaces_have_positive_weights() {
    for quadratic in [false, true] {
        for (slaves, masters) in [(12, 17), (40, 23), (31, 31)] {
            for out in [1.0, -1.0] {
                let slave = circle(slaves, (0.1, out, 0, quadratic));
                let master = circle(masters, (0.0, -out, FIRST_MASTER, quadratic));
                let sums = by_node(&contributions(&slave.facets, &master.facets, [0.0, 0.1]));
                assert_eq!(sums.len(), if quadratic { 2 * slaves } else { slaves });
                for one in sums.values() {
                    assert!(one.weight > 0.9 * one.whole && one.weight <= 1.0000001 * one.whole);
                    close(one.masters.iter().map(|entry| entry.1).sum(), one.weight, 1e-13);
                }
            }
        }
    }
}

#[test]
fn small_and_thin_covered_parts() {
    // Rounding is relative to the entries of the masters, which are large where the master facets are small
    // too, and to the width of the part, because its corners are rounded; of the corners of the slave facet, too, which a node stands for.
    fn check<const D: usize>(slave: &Surface<D>, master: &Surface<D>, (degree, width): (usize, f64)) {
        let all = pair(slave, master);
        assert!(!is_uncovered(&all));
        for one in &all {
            let largest = one.masters.iter().fold(0.0, |most: f64, entry| most.max(entry.1.abs()));
            let error = transfer_error(one, [slave, master], degree);
            close(error, 0.0, 1e-14 * (largest + (one.weight.abs() + one.corners.abs()) / width));
        }
    }
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for (order, degree) in [(false, 1), (true, 2)] {
        let triangle = Surface::new(&corners, &[[0, 1, 2]], ([0.0, 0.0, 1.0], 0, order));
        let segment = slave_segments(&[0.0, 1.0], order);
        for share in [1e-2, 1e-4, 1e-6, 1e-8] {
            let size: f64 = f64::sqrt(share);
            // Strips along a side and across, triangles at a corner and inside.
            let parts: [(f64, [Vector<3>; 3]); 4] = [
                (share, [[-10.0, share, 0.0], [10.0, share, 0.0], [0.0, -10.0, 0.0]]),
                (share, [[-1.0, 0.3, 0.0], [2.0, 0.3, 0.0], [2.0, 0.3 + 3.0 * share, 0.0]]),
                (size, [[-1.0, 0.0, 0.0], [size, 0.0, 0.0], [0.0, size, 0.0]]),
                (size, [[0.3, 0.2, 0.0], [0.3 + size, 0.2 + 0.3 * size, 0.0], [0.3, 0.2 + size, 0.0]]),
            ];
            for (width, part) in parts {
                let master = Surface::new(&part, &[[0, 1, 2]], ([0.0, 0.0, -1.0], FIRST_MASTER, order));
                check(&triangle, &master, (degree, width));
            }
            for start in [0.0, 0.2, 1.0 - share] {
                let end = start + share;
                for xs in
                    [vec![start, end], vec![start, start + 0.4 * share, end], vec![start, end, end + 0.4]]
                {
                    // Of the third, only the first segment may be on the facet.
                    let mut master = master_segments(&xs, order);
                    if xs[2..].iter().any(|&x| x > end) {
                        master.facets.truncate(1);
                    }
                    check(&segment, &master, (degree, share));
                }
            }
            // The master facet extends beyond the small part, so that its entries are moderate.
            check(&segment, &master_segments(&[-0.7, share], order), (degree, share));
        }
    }
}

/// The inverse of a regular matrix without zeros on the diagonal of its triangular factors.
fn inverse(mut matrix: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = matrix.len();
    for (i, row) in matrix.iter_mut().enumerate() {
        row.extend((0..n).map(|j| if i == j { 1.0 } else { 0.0 }));
    }
    for k in 0..n {
        let pivot = matrix[k][k];
        let row: Vec<f64> = matrix[k].iter().map(|x| x / pivot).collect();
        for i in (0..n).filter(|&i| i != k) {
            let factor = matrix[i][k];
            matrix[i].iter_mut().zip(&row).for_each(|(x, y)| *x -= factor * y);
        }
        matrix[k] = row;
    }
    matrix.into_iter().map(|row| row[n..].to_vec()).collect()
}

#[test]
fn multipliers_are_those_of_the_definition() {
    // diag(w) G^-1 chi with the shape functions as chi, on a part with five corners.
    let slave_corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let master_corners = [[0.1, -0.2, 0.0], [0.9, 0.5, 0.0], [-0.3, 0.6, 0.0]];
    let flat = |corners: &[Vector<3>; 3]| corners.map(|x| [x[0], x[1]]);
    let (slave_flat, master_flat) = (flat(&slave_corners), flat(&master_corners));
    let points = quadrature::<3>(&clip::<3>(&slave_flat, &master_flat));
    assert!(points.len() >= 18);
    for order in [false, true] {
        let slave = Surface::new(&slave_corners, &[[0, 1, 2]], ([0.0, 0.0, 1.0], 0, order));
        let master = Surface::new(&master_corners, &[[0, 1, 2]], ([0.0, 0.0, -1.0], FIRST_MASTER, order));
        let (first, count) = if order { (3, 6) } else { (0, 3) };
        let (mut matrix, mut mixed) = (vec![vec![0.0; count]; count], [[0.0; 6]; 6]);
        let mut weights = [0.0; 6];
        for &(place, weight) in &points {
            let phi = Shape::<3>::new(order, &slave_flat, place).values();
            let facing = Shape::<3>::new(order, &master_flat, place).values();
            for a in 0..count {
                weights[a] += weight * phi[a];
                (0..count).for_each(|m| matrix[a][m] += weight * phi[a] * phi[m]);
                (0..count).for_each(|b| mixed[a][b] += weight * phi[a] * facing[b]);
            }
        }
        let inverse = inverse(matrix);
        let exact = |a: usize, b: usize| -> f64 {
            (0..count).map(|k| weights[a] * inverse[a][k] * mixed[k][b]).sum()
        };
        for ((a, one), ends) in (first..).zip(pair(&slave, &master)).zip([[0, 1], [1, 2], [2, 0]]) {
            close(one.weight, weights[a], 1e-15);
            let corners: Vec<usize> = ends.into_iter().filter(|_| order).collect();
            for b in 0..count {
                let of_corners: f64 = corners.iter().map(|&c| 0.5 * exact(c, b)).sum();
                close(entry(&one, FIRST_MASTER + b as u32), exact(a, b) + of_corners, 1e-13);
            }
            for c in 0..first {
                let half = if corners.contains(&c) { 0.5 } else { 0.0 };
                close(entry(&one, c as u32), -half * weights[c], 1e-14);
            }
        }
    }
}

#[test]
fn the_search_finds_all_pairs() {
    let random = &mut Random(10);
    let mut cloud = |count: usize, first: u32| -> Vec<Facet<3>> {
        (0..count)
            .map(|i| {
                let middle = [0.0; 3].map(|_: f64| random.uniform(-1.0, 1.0));
                let corners = [[0.0; 3]; 3].map(|_: Vector<3>| middle.map(|x| x + random.uniform(-0.3, 0.3)));
                let side = [0.0; 3].map(|_: f64| random.uniform(-1.0, 1.0));
                let start = first + 3 * i as u32;
                Facet { normal: normal(&corners, &side), ..Facet::new((start..start + 3).collect(), corners) }
            })
            .collect()
    };
    let (slaves, masters) = (cloud(200, 0), cloud(200, 1000));
    for reach in [0.1, f64::INFINITY] {
        let search = Search::new(&masters, [0.0, reach]);
        let (mut pairs, mut visited) = (0, 0);
        for slave in &slaves {
            let slave = Slave::new(slave);
            let near = search.near(&slave);
            visited += near.len();
            for (i, master) in masters.iter().enumerate() {
                if search.part(&slave, master).is_some() {
                    assert!(near.binary_search(&i).is_ok());
                    pairs += 1;
                }
            }
        }
        // Of 40 000 combinations.
        assert!(pairs > 100 && visited < 8000, "{pairs} pairs of {visited} visited");
    }
}

#[test]
fn coordinates_that_are_not_finite_form_no_pair() {
    let slave = slave_segments(&[0.0, 1.0, f64::NAN], false);
    let master = master_segments(&[0.0, 1.0, f64::NAN, 2.0], false);
    let all = pair(&slave, &master);
    close(all[0].weight, 0.5, 1e-15);
    assert!(is_uncovered(&all[2..]));
}

#[test]
#[should_panic(expected = "is not positive")]
fn reach_that_is_nan() {
    contributions::<2>(&[], &[], [0.0, f64::NAN]);
}

#[test]
#[should_panic(expected = "a facet has 4 nodes")]
fn wrong_number_of_nodes() {
    let mut slave = slave_segments(&[0.0, 1.0], false);
    slave.facets[0].nodes = vec![0, 1, 2, 3];
    contributions(&slave.facets, &[], [0.0, 1.0]);
}
