//! Integrals that couple two meshed surfaces in contact, with dual Lagrange multipliers on the slave surface.
//!
//! Each slave facet is its own plane of projection. Master facets that face it are projected along its
//! outward normal, clipped with it, and the products of multipliers and shape functions are integrated on the
//! clipped polygons (Puso and Laursen 2004, Comput. Methods Appl. Mech. Eng. 193, 601-629). The multipliers
//! are biorthogonal to the shape functions of the slave nodes that carry a law (Wohlmuth 2000, SIAM J. Numer.
//! Anal. 38, 989-1012), on the covered part of each facet (Popp et al. 2013, Comput. Methods Appl. Mech. Eng.
//! 264, 67-80).
//!
//! # Multipliers
//!
//! On a slave facet e let C be the part that master facets cover, phi_m the shape functions of the nodes that
//! carry a law, and chi_a as many functions of the multiplier space, with sum_a chi_a = 1. Then
//!
//! - G_am = int_C chi_a phi_m, w_m = int_C phi_m, and psi = diag(w) G^-1 chi, so that
//! - int_C psi_a phi_m = w_a (G^-1 G)_am = w_a delta_am, and
//! - sum_a psi_a = 1: because sum_a chi_a = 1, the column sums of G are 1' G = w', thus w' G^-1 = 1', and
//!   sum_a psi_a = w' G^-1 chi = 1' chi = 1.
//!
//! On a body of revolution all integrals are those over the whole turn.
//!
//! The psi depend on the space of the chi only: with any other basis q = T chi of it and N = T G, diag(w)
//! N^-1 q is the same. Here q is orthonormal on C, which keeps N regular where C is small or thin. The space is that of the phi_m, and N^-1
//! is known: the functions q_j at the nodes, because q_j = sum_m q_j(x_m) phi_m. Thus psi_m gives w_m f(x_m) of each function f of the
//! space: the gap of a node is that at its place, also of curved surfaces.
//!
//! On quadratic triangles the middles of the sides carry laws alone: w_c of a corner is 0 where C is the whole facet. Where it is a part,
//! each of the two middles beside a corner takes over half of its psi_c, so that the sum remains 1.

use crate::linear_algebra::tensor::{Vector, in_space};
pub use geometry::shorter;
use geometry::{
    Plane, Point, Shape, clip, dot, measure_and_centroid, oriented, quadrature, sides, subtract, way_from,
};
use rstar::{
    AABB, RTree, RTreeObject, SelectionFunction,
    primitives::{GeomWithData, Rectangle},
};

mod facet;
mod geometry;
mod normals;
#[cfg(test)]
mod tests;

pub use facet::Facet;
pub use normals::{Normals, direction, smooth_direction};

/// A master facet faces a slave facet if its normal has a component along the slave normal below this.
const FACING: f64 = -0.2;
/// The deepest mean penetration of a pair, as a share of the diameter of the slave facet, where it may be deeper than `depth`.
const DEEPEST: f64 = 0.5;
/// The smallest clipped part that counts, as a share of the slave facet.
const SMALLEST_PART: f64 = 1e-12;
/// The largest overlap of two clipped parts that both count, as a share of the slave facet.
const LARGEST_OVERLAP: f64 = 1e-6;
/// The smallest covered share of a slave facet that contributes.
const SMALLEST_SHARE: f64 = 1e-9;
/// The distance of a node from the covered part of its facet that is a rounding error, as a share of the diameter of the facet.
const ROUNDING: f64 = 1e-9;
/// The width by which the space above a slave facet is searched in excess, as a share of its diameter.
const SEARCH_MARGIN: f64 = 1e-6;

/// What one slave facet gives to one of its nodes that carries a law: integrals over the part of the facet
/// that master facets cover. Those of a node are summed over the facets around it; all are 0 where nothing is
/// covered.
#[derive(Debug, Clone, PartialEq)]
pub struct Contribution<const D: usize> {
    /// The global number of the slave node a.
    pub node: u32,
    /// The outward unit normal of the facet.
    pub normal: Vector<D>,
    /// int phi_a in m^(D-1). Where a quadratic facet is covered in part it may be small beside the covered
    /// part, and in two dimensions zero or negative for corners.
    pub weight: f64,
    /// int phi_a in m^(D-1) over the whole facet, covered or not.
    pub whole: f64,
    /// int psi_a g in m^D, with the signed distance g in m from the facet along its normal to the master
    /// surface, positive where open. With the outward unit normal n of the facet it is the sum over `masters`
    /// of the entry times n.x_b, less the weight times n.x_a, at the places x of the nodes.
    pub gap: f64,
    /// The sum over the corners c of quadratic triangles, which carry no law, of int psi_a phi_c in m^2; otherwise 0, and 0 where the facet is
    /// covered. With `weight` it is int psi_a: the part of the surface for which the node stands, which may be negative where the facet is
    /// covered in part.
    pub corners: f64,
    /// The way in m to the node from the nearest place of the covered part of the facet; infinite where nothing is covered.
    pub beyond: Vector<D>,
    /// Over the covered part of the facet: its outward unit normal and those of the master facets, in the undeformed bodies.
    pub normals: [Normals<D>; 2],
    /// For each master node b, in ascending order, int psi_a phi_b in m^(D-1), with phi_b at the place on the
    /// master facet that is projected. The corners c of quadratic triangles that are covered in part, which carry no law, are included
    /// with -int psi_a phi_c. All sum to `weight`.
    pub masters: Vec<(u32, f64)>,
}

/// The contributions of all slave facets to their nodes that carry a law, in the order of the facets and of
/// their nodes.
///
/// A slave facet e and a master facet form a pair if they share no node, their normals are opposed (component
/// of one along the other below -0.2), and the mean of the gap g over the clipped part is between minus `depth`,
/// or half of the longest side of e if it is larger, and `reach`, both in m; `reach` may be infinite. Where several master facets are
/// projected on the same part of e, the one with the smallest mean |g| counts. To that end the pairs are
/// visited in ascending order of the magnitude of their mean gap, and one whose part overlaps a part already
/// taken by more than 1e-6 of e is skipped as a whole. Thus where the projections of two master facets
/// overlap in part, because the master surface is folded or strongly curved over e, the rest of the second
/// one is left uncovered; overlaps up to the limit count twice.
///
/// Facets with a covered share below 1e-9 contribute 0 (with their `whole`). Facets that are not finite cover nothing and are not covered.
///
/// The integrals are exact up to rounding for straight facets: all integrands are polynomials of degree 4 at
/// most on the clipped polygons.
///
/// # Panics
///
/// Where a facet has a number of nodes other than D or 3 (D - 1), `depth` is negative, or `reach` is not positive.
pub fn contributions<const D: usize>(
    slaves: &[Facet<D>],
    masters: &[Facet<D>],
    [depth, reach]: [f64; 2],
) -> Vec<Contribution<D>> {
    const { assert!(D == 2 || D == 3, "there are segments and triangles only") };
    assert!(depth >= 0.0 && reach > 0.0, "the depth {depth} m or the reach {reach} m is not positive");
    for facet in slaves.iter().chain(masters) {
        let count = facet.nodes.len();
        assert!(count == D || count == 3 * (D - 1), "a facet has {count} nodes");
    }
    let search = Search::new(masters, [depth, reach]);
    let mut result = Vec::with_capacity(slaves.len() * D);
    for facet in slaves {
        let slave = Slave::new(facet);
        let parts = search.covered(&slave);
        slave.integrate(&parts, &mut result);
    }
    result
}

/// For each list of slave facets the numbers of the master facets, ascending, that may form a pair with one of them, as [`contributions`]
/// has them.
pub fn facing<const D: usize>(
    slaves: &[Vec<Facet<D>>],
    masters: &[Facet<D>],
    reach: [f64; 2],
) -> Vec<Vec<usize>> {
    let search = Search::new(masters, reach);
    let of_list = |slaves: &Vec<Facet<D>>| {
        let mut all = Vec::new();
        for slave in slaves.iter().map(Slave::new) {
            let near = search.near(&slave).into_iter();
            all.extend(near.filter(|at| slave.is_faced_by(&masters[*at])));
        }
        all.sort_unstable();
        all.dedup();
        all
    };
    slaves.iter().map(of_list).collect()
}

/// At most this many boxes, low and high corners in m, around all of these facets that are finite.
pub fn boxes_around<const D: usize>(facets: &[Facet<D>], most: usize) -> Vec<[Vector<D>; 2]> {
    let finite = facets.iter().filter(|facet| facet.is_finite());
    let mut found = Vec::new();
    join_boxes(&mut finite.map(Facet::bounds).collect::<Vec<_>>(), most, &mut found);
    found
}

/// Joins boxes into at most this many, one at least, of neighbours.
fn join_boxes<const D: usize>(boxes: &mut [[Vector<D>; 2]], most: usize, joined: &mut Vec<[Vector<D>; 2]>) {
    let Some(first) = boxes.first() else { return };
    let [low, high] = boxes.iter().fold(*first, |[low, high], [other_low, other_high]| {
        let lower = std::array::from_fn(|i| low[i].min(other_low[i]));
        [lower, std::array::from_fn(|i| high[i].max(other_high[i]))]
    });
    if most < 2 || boxes.len() == 1 {
        joined.push([low, high]);
        return;
    }
    let size = |axis: &usize| high[*axis] - low[*axis];
    let axis = (0..D).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
    let middle = |corners: &[Vector<D>; 2]| corners[0][axis] + corners[1][axis];
    let half = boxes.len() / 2;
    boxes.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
    let (left, right) = boxes.split_at_mut(half);
    join_boxes(left, most / 2, joined);
    join_boxes(right, most - most / 2, joined);
}

/// For each list of boxes the numbers of the slave facets, ascending, that may form a pair with facets in one of them.
pub fn may_face<const D: usize>(
    slaves: &[Facet<D>],
    boxes: &[&[[Vector<D>; 2]]],
    reach: [f64; 2],
) -> Vec<Vec<usize>> {
    let numbered = boxes.iter().enumerate().flat_map(|(list, boxes)| {
        boxes.iter().map(move |corners| {
            let [low, high] = corners.map(|corner| in_space(&corner));
            GeomWithData::new(Rectangle::from_corners(low, high), list)
        })
    });
    let tree: RTree<NumberedBox> = RTree::bulk_load(numbered.collect());
    let mut found: Vec<Vec<usize>> = vec![Vec::new(); boxes.len()];
    for (number, slave) in slaves.iter().enumerate() {
        let prism = Prism::new(&Slave::new(slave), reach);
        for met in tree.locate_with_selection_function(&prism) {
            if found[met.data].last() != Some(&number) {
                found[met.data].push(number);
            }
        }
    }
    found
}

/// A slave facet in its plane.
#[derive(Debug)]
struct Slave<'a, const D: usize> {
    facet: &'a Facet<D>,
    plane: Plane<D>,
    corners: [Point; D],
    /// The length in m or area in m^2.
    measure: f64,
    /// The longest side in m.
    diameter: f64,
}

/// The part of a slave facet that one master facet covers, in the plane of the slave facet.
#[derive(Debug)]
struct Part<'a, const D: usize> {
    master: &'a Facet<D>,
    polygon: Vec<Point>,
    /// The length in m or area in m^2 of the polygon.
    measure: f64,
    centroid: Point,
    /// The shape functions of the master facet about the centroid.
    shape: Shape<D>,
    /// The gap in m at the centroid, which is its mean, and its gradient.
    gap: (f64, Point),
}

/// A box with a number.
type NumberedBox = GeomWithData<Rectangle<[f64; 3]>, usize>;

/// Master facets in a tree of bounding boxes.
struct Search<'a, const D: usize> {
    masters: &'a [Facet<D>],
    /// The bounding boxes of those with finite coordinates.
    tree: RTree<NumberedBox>,
    /// The largest penetration and the largest gap of a pair in m.
    reach: [f64; 2],
}

impl<'a, const D: usize> Search<'a, D> {
    fn new(masters: &'a [Facet<D>], reach: [f64; 2]) -> Self {
        let boxes = masters.iter().enumerate().filter(|(_, master)| master.is_finite());
        let boxes = boxes.map(|(number, master)| {
            let [low, high] = master.bounds().map(|corner| in_space(&corner));
            GeomWithData::new(Rectangle::from_corners(low, high), number)
        });
        let tree = RTree::bulk_load(boxes.collect());
        Self { masters, tree, reach }
    }

    /// The numbers of the master facets that may form a pair with a slave facet, ascending.
    fn near(&self, slave: &Slave<D>) -> Vec<usize> {
        let prism = Prism::new(slave, self.reach);
        let mut near: Vec<_> =
            self.tree.locate_with_selection_function(&prism).map(|facet| facet.data).collect();
        near.sort_unstable();
        near
    }

    /// The parts of a slave facet that master facets cover.
    fn covered(&self, slave: &Slave<D>) -> Vec<Part<'a, D>> {
        let mut parts: Vec<_> =
            self.near(slave).into_iter().filter_map(|i| self.part(slave, &self.masters[i])).collect();
        parts.sort_by(|a, b| a.gap.0.abs().total_cmp(&b.gap.0.abs()));
        let mut taken: Vec<Part<D>> = Vec::with_capacity(parts.len());
        for part in parts {
            let overlaps = |other: &Part<D>| {
                let both = clip::<D>(&part.polygon, &other.polygon);
                measure_and_centroid::<D>(&both).0 > LARGEST_OVERLAP * slave.measure
            };
            if !taken.iter().any(overlaps) {
                taken.push(part);
            }
        }
        taken
    }

    /// The part of a slave facet that a master facet covers; none if they do not form a pair.
    fn part(&self, slave: &Slave<D>, master: &'a Facet<D>) -> Option<Part<'a, D>> {
        if !slave.is_faced_by(master) {
            return None;
        }
        let projected = master.corners.map(|corner| slave.plane.project(&corner));
        let corners = projected.map(|(place, _)| place);
        let polygon = clip::<D>(&oriented(corners), &slave.corners);
        let (measure, centroid) = measure_and_centroid::<D>(&polygon);
        // Also false for facets without area and for NaN.
        let counts = measure > SMALLEST_PART * slave.measure;
        if !counts {
            return None;
        }
        let shape = Shape::new(master.is_quadratic(), &corners, centroid);
        let gap = shape.linear(&projected.map(|(_, height)| height));
        let [depth, reach] = self.reach;
        let accepted = (-depth.max(DEEPEST * slave.diameter)..=reach).contains(&gap.0);
        accepted.then_some(Part { master, polygon, measure, centroid, shape, gap })
    }
}

/// The space above and below a slave facet where facets may form a pair with it: the box along its tangents
/// and normal.
#[derive(Debug)]
struct Prism {
    origin: [f64; 3],
    directions: [[f64; 3]; 3],
    /// The smallest and largest component in m along each direction.
    bounds: [(f64, f64); 3],
}

impl Prism {
    fn new<const D: usize>(slave: &Slave<D>, [depth, reach]: [f64; 2]) -> Self {
        let margin = SEARCH_MARGIN * slave.diameter;
        let bound = |k: usize| {
            let along = slave.corners.map(|corner| corner[k]);
            let low = along.iter().copied().fold(f64::INFINITY, f64::min);
            (low - margin, along.iter().copied().fold(f64::NEG_INFINITY, f64::max) + margin)
        };
        let [first, second] = slave.plane.tangents;
        Self {
            origin: in_space(&slave.plane.origin),
            directions: [in_space(&slave.plane.normal), in_space(&first), in_space(&second)],
            bounds: [(-depth.max(DEEPEST * slave.diameter) - margin, reach + margin), bound(0), bound(1)],
        }
    }

    /// Whether a box may meet the prism, by the directions of the prism alone.
    fn meets(&self, bounds: &AABB<[f64; 3]>) -> bool {
        let (low, high) = (bounds.lower(), bounds.upper());
        self.directions.iter().zip(&self.bounds).all(|(direction, &(least, most))| {
            let (mut middle, mut half) = (0.0, 0.0);
            for i in 0..3 {
                middle += direction[i] * (0.5 * (low[i] + high[i]) - self.origin[i]);
                half += direction[i].abs() * 0.5 * (high[i] - low[i]);
            }
            middle + half >= least && middle - half <= most
        })
    }
}

impl SelectionFunction<NumberedBox> for &Prism {
    fn should_unpack_parent(&self, bounds: &AABB<[f64; 3]>) -> bool {
        self.meets(bounds)
    }

    fn should_unpack_leaf(&self, facet: &NumberedBox) -> bool {
        self.meets(&facet.envelope())
    }
}

/// A point of the quadrature on the covered part of a slave facet.
#[derive(Debug)]
struct Sample {
    /// The index of the part.
    part: usize,
    place: Point,
    /// The weight in m^(D-1).
    weight: f64,
    /// The functions of the orthonormal basis there.
    basis: [f64; MOST],
}

/// The most nodes of a facet, and functions of a basis.
const MOST: usize = 6;

/// Polynomials that are orthonormal on the covered part of a slave facet, linear or quadratic as its shape functions.
#[derive(Debug)]
struct Basis<const D: usize> {
    centroid: Point,
    /// The principal directions of the covered part, divided by its extent along each in m; the second one is 0 in two dimensions.
    axes: [Point; 2],
    /// Coefficients of the monomials; a function that is not used is 0.
    coefficients: [[f64; MOST]; MOST],
}

impl<const D: usize> Basis<D> {
    /// `count` orthonormal functions by the modified Gram-Schmidt process on the points of the quadrature,
    /// where their values are entered.
    fn new(parts: &[Part<D>], samples: &mut [Sample], (count, covered): (usize, f64)) -> Self {
        let measure: f64 = parts.iter().map(|part| part.measure).sum();
        let centroid: Point = std::array::from_fn(|i| {
            parts.iter().map(|part| part.measure * part.centroid[i]).sum::<f64>() / measure
        });
        let axes = axes::<D>(parts, samples, centroid);
        let mut basis = Self { centroid, axes, coefficients: [[0.0; MOST]; MOST] };
        basis.coefficients[0][0] = 1.0 / covered.sqrt();
        for sample in samples.iter_mut() {
            sample.basis[0] = basis.coefficients[0][0];
        }
        for k in 1..count {
            let mut function = [0.0; MOST];
            function[k] = 1.0;
            // The second pass restores the orthogonality that cancellation in the first takes.
            for _ in 0..2 {
                for j in 0..k {
                    let products = samples.iter().map(|sample| {
                        sample.weight * sample.basis[j] * dot(&function, &basis.monomials(sample.place))
                    });
                    let component: f64 = products.sum();
                    let other = basis.coefficients[j];
                    function = std::array::from_fn(|i| function[i] - component * other[i]);
                }
                let squares = samples
                    .iter()
                    .map(|sample| sample.weight * dot(&function, &basis.monomials(sample.place)).powi(2));
                let norm = squares.sum::<f64>().sqrt();
                function = function.map(|x| x / norm);
            }
            basis.coefficients[k] = function;
            for sample in samples.iter_mut() {
                sample.basis[k] = dot(&function, &basis.monomials(sample.place));
            }
        }
        basis
    }

    fn monomials(&self, place: Point) -> [f64; MOST] {
        let offset = subtract(&place, &self.centroid);
        let [u, v] = self.axes.map(|axis| dot(&axis, &offset));
        if D == 2 { [1.0, u, u * u, 0.0, 0.0, 0.0] } else { [1.0, u, v, u * u, u * v, v * v] }
    }

    fn values(&self, place: Point) -> [f64; MOST] {
        let monomials = self.monomials(place);
        self.coefficients.map(|function| dot(&function, &monomials))
    }
}

/// The axes of a basis, in which thin parts are as wide as long.
fn axes<const D: usize>(parts: &[Part<D>], samples: &[Sample], centroid: Point) -> [Point; 2] {
    let moments = samples.iter().fold([0.0; 3], |[xx, xy, yy], sample| {
        let [x, y] = subtract(&sample.place, &centroid);
        [xx + sample.weight * x * x, xy + sample.weight * x * y, yy + sample.weight * y * y]
    });
    let (sin, cos) = (0.5 * (2.0 * moments[1]).atan2(moments[0] - moments[2])).sin_cos();
    let directions = if D == 2 { [[1.0, 0.0], [0.0; 2]] } else { [[cos, sin], [-sin, cos]] };
    directions.map(|axis| {
        let corners = parts.iter().flat_map(|part| &part.polygon);
        let extent = corners.map(|corner| dot(&axis, &subtract(corner, &centroid)).abs()).fold(0.0, f64::max);
        axis.map(|x| if extent > 0.0 { x / extent } else { x })
    })
}

/// The integrals of the functions of the basis times the shape functions of one facet, \[basis\]\[node\].
type Products = [[f64; MOST]; MOST];

impl<'a, const D: usize> Slave<'a, D> {
    fn new(facet: &'a Facet<D>) -> Self {
        let plane = Plane::new(facet);
        let corners = facet.corners.map(|corner| plane.project(&corner).0);
        let measure = measure_and_centroid::<D>(&corners).0;
        let diameter = sides::<D>().iter().fold(0.0, |most: f64, &(i, j)| {
            let side = subtract(&facet.corners[j], &facet.corners[i]);
            most.max(dot(&side, &side).sqrt())
        });
        Self { facet, plane, corners, measure, diameter }
    }

    /// Whether the normal of a master facet, which shares no node, is opposed.
    fn is_faced_by(&self, master: &Facet<D>) -> bool {
        dot(&self.plane.normal, &master.normal) < FACING && !self.facet.shares_node(master)
    }

    /// The places of the nodes.
    fn places(&self) -> impl Iterator<Item = Point> {
        let corners = self.corners;
        let middles = sides::<D>().iter().map(move |&(i, j)| {
            let (a, b) = (corners[i], corners[j]);
            std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
        });
        corners.into_iter().chain(middles).take(self.facet.nodes.len())
    }

    /// Appends the contributions to the nodes that carry a law.
    fn integrate(&self, parts: &[Part<D>], result: &mut Vec<Contribution<D>>) {
        let (facet, first) = (self.facet, result.len());
        let law = facet.first_law()..facet.nodes.len();
        result.extend(law.clone().map(|i| Contribution {
            node: facet.nodes[i],
            normal: facet.normal,
            weight: 0.0,
            whole: self.measure * facet.share(i),
            gap: 0.0,
            corners: 0.0,
            beyond: [f64::INFINITY; D],
            normals: [Normals::NONE; 2],
            masters: Vec::new(),
        }));
        let mut covered: f64 = parts.iter().map(|part| part.measure).sum();
        if parts.is_empty() || covered < SMALLEST_SHARE * self.measure {
            return;
        }
        let mut samples: Vec<Sample> = Vec::new();
        for (part, Part { polygon, .. }) in parts.iter().enumerate() {
            let points = quadrature::<D>(polygon).into_iter();
            samples.extend(points.map(|(place, weight)| Sample { part, place, weight, basis: [0.0; MOST] }));
        }
        if facet.turns() {
            let turn = |place: Point| Shape::new(false, &self.corners, place).linear(&facet.turns).0;
            samples.iter_mut().for_each(|sample| sample.weight *= turn(sample.place));
            covered = samples.iter().map(|sample| sample.weight).sum();
        }
        let basis = Basis::new(parts, &mut samples, (facet.nodes.len(), covered));
        let own = self.own_products(&basis, &samples, covered);
        let duals = self.duals(&basis, &own, covered);
        let part_of_corner = |c: usize| own[0][c] * covered.sqrt();
        let is_negligible = |c: usize| part_of_corner(c).abs() <= SMALLEST_PART * self.measure;
        let is_whole = covered > 0.5 * self.measure && (0..law.start).all(is_negligible);
        let measure: f64 = parts.iter().map(|part| part.measure).sum();
        let mut normals = [Normals::NONE; 2];
        normals[0].add(measure, &facet.undeformed);
        parts.iter().for_each(|part| normals[1].add(part.measure, &part.master.undeformed));
        let result = &mut result[first..];
        for (contribution, place) in result.iter_mut().zip(self.places().skip(law.start)) {
            contribution.normals = normals;
            let ways = parts.iter().map(|part| way_from::<D>(&part.polygon, place));
            let way = ways.fold([f64::INFINITY; 2], shorter);
            let is_beyond = dot(&way, &way).sqrt() > ROUNDING * self.diameter;
            let [first, second] = self.plane.tangents;
            let along = |i: usize| if is_beyond { way[0] * first[i] + way[1] * second[i] } else { 0.0 };
            contribution.beyond = std::array::from_fn(along);
        }
        for (contribution, ((dual, m), &(i, j))) in
            result.iter_mut().zip(duals.iter().zip(law.clone()).zip(sides::<D>().iter().cycle()))
        {
            contribution.weight = own[0][m] * covered.sqrt();
            let corners = [i, j].into_iter().filter(|c| !is_whole && *c < law.start);
            contribution.masters.extend(corners.map(|c| (facet.nodes[c], -integral(dual, &own, c))));
            contribution.corners = -contribution.masters.iter().map(|(_, value)| value).sum::<f64>();
        }
        let totals = totals(parts, &samples, covered);
        let by_part = samples.chunk_by(|one, next| one.part == next.part);
        for (part, (samples, totals)) in parts.iter().zip(by_part.zip(&totals)) {
            let (products, gaps) = part.products(samples, totals);
            for (contribution, dual) in result.iter_mut().zip(&duals) {
                contribution.gap += dot(dual, &gaps);
                let nodes = part.master.nodes.iter().enumerate();
                contribution.masters.extend(nodes.map(|(b, &node)| (node, integral(dual, &products, b))));
            }
        }
        for contribution in result {
            sum_by_node(&mut contribution.masters);
        }
    }

    /// The integrals over the covered part with the shape functions of the facet itself. All functions of the
    /// basis but the first have the mean 0, so that the values at the centroid count for the first alone.
    fn own_products(&self, basis: &Basis<D>, samples: &[Sample], covered: f64) -> Products {
        let shape = Shape::new(self.facet.is_quadratic(), &self.corners, basis.centroid);
        let mut products = [[0.0; MOST]; MOST];
        products[0] = shape.values().map(|value| value * covered.sqrt());
        for sample in samples {
            let differences = shape.differences(subtract(&sample.place, &basis.centroid));
            add_products(&mut products, sample, &differences);
        }
        products
    }

    /// The coefficients of the multipliers psi_a of the nodes that carry a law in the basis: diag(w) N^-1, and of quadratic triangles with
    /// half of those of the corners at the ends of its side.
    fn duals(&self, basis: &Basis<D>, own: &Products, covered: f64) -> Vec<[f64; MOST]> {
        let of_node = |(m, place)| basis.values(place).map(|value| own[0][m] * covered.sqrt() * value);
        let mut all: Vec<[f64; MOST]> = self.places().enumerate().map(of_node).collect();
        let law = all.split_off(self.facet.first_law());
        let with_corners = |(mut dual, &(i, j)): ([f64; MOST], &(usize, usize))| {
            for corner in [i, j].iter().filter_map(|end| all.get(*end)) {
                dual = std::array::from_fn(|k| dual[k] + 0.5 * corner[k]);
            }
            dual
        };
        if all.is_empty() { law } else { law.into_iter().zip(sides::<D>()).map(with_corners).collect() }
    }
}

impl<const D: usize> Part<'_, D> {
    /// The integrals over the part with the shape functions of the master facet, and with the gap (in m^D per
    /// unit of the functions). `totals` are the integrals of the functions of the basis alone.
    fn products(&self, samples: &[Sample], totals: &[f64; MOST]) -> (Products, [f64; MOST]) {
        let values = self.shape.values();
        let mut products = totals.map(|total| values.map(|value| total * value));
        let (gap, gradient) = self.gap;
        let mut gaps = totals.map(|total| total * gap);
        for sample in samples {
            let offset = subtract(&sample.place, &self.centroid);
            add_products(&mut products, sample, &self.shape.differences(offset));
            let difference = dot(&gradient, &offset);
            gaps = std::array::from_fn(|j| gaps[j] + sample.weight * sample.basis[j] * difference);
        }
        (products, gaps)
    }
}

/// The integrals of the functions of the basis over each part. Those over the largest part are what the
/// others leave of the integrals over the covered part, which are known: the multipliers are large where the
/// covered part is small, and would multiply the rounding of the sum.
fn totals<const D: usize>(parts: &[Part<D>], samples: &[Sample], covered: f64) -> Vec<[f64; MOST]> {
    let mut totals = vec![[0.0; MOST]; parts.len()];
    for sample in samples {
        let total = &mut totals[sample.part];
        *total = std::array::from_fn(|j| total[j] + sample.weight * sample.basis[j]);
    }
    let largest = (0..parts.len()).max_by(|&i, &j| parts[i].measure.total_cmp(&parts[j].measure));
    if let Some(largest) = largest {
        let others = totals.iter().enumerate().filter(|&(i, _)| i != largest);
        let all = std::array::from_fn(|j| if j == 0 { covered.sqrt() } else { 0.0 });
        totals[largest] = others.fold(all, |rest, (_, total)| subtract(&rest, total));
    }
    totals
}

/// Adds the integrals at one point of the quadrature, where the shape functions have these values.
fn add_products(products: &mut Products, sample: &Sample, values: &[f64; MOST]) {
    for (row, value) in products.iter_mut().zip(&sample.basis) {
        *row = std::array::from_fn(|m| row[m] + sample.weight * value * values[m]);
    }
}

/// The integral of the multiplier with these coefficients times the shape function of a node.
fn integral(dual: &[f64; MOST], products: &Products, node: usize) -> f64 {
    (0..MOST).map(|j| dual[j] * products[j][node]).sum()
}

/// Sorts entries by their node and adds those of the same node.
fn sum_by_node(entries: &mut Vec<(u32, f64)>) {
    entries.sort_by_key(|&(node, _)| node);
    entries.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
}
