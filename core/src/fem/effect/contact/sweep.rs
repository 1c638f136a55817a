//! Obstacles that contact misses: they pass the boundary within a step, press against nodes that supports hold, or never touch it.

use super::{
    Contact,
    closeness::{Closeness, Ejection, Gaps},
    normal::NormalContact,
    point::{Point, Unknown, Vectors::Body},
    tangential_point::tangents,
};
use crate::{
    error::{Error, Result},
    fem::{effect::Step, pairs::PairedNode, space::Held},
    laws::contact::{Gap, GivenGap, Sweep},
    linear_algebra::tensor::{Vector, add_scaled, dot, larger, norm},
    parallel::session::Session,
};

/// A displacement of this share of the body's size is rounding.
const ROUNDING: f64 = 1e-9;
/// Changes of gaps by motions along an obstacle are negligible up to this share of the body's size.
const ASTRAY: f64 = 1e-4;
/// Those of the shape of gaps under pressure are negligible up to this share of the size of the part under pressure.
const LEAST_CHANGE: f64 = 1e-5;
/// Points under pressure from which on their displacements show the shape of the obstacle.
const LEAST_POINTS: f64 = 5.0;
/// The share of the spread of the normal displacements of a boundary that their deviation under pressure counts as at least: there it may be flat.
const LEAST_INDENTATION: f64 = 0.1;
/// The part of such a motion along which the slope of the obstacle is taken.
const NEARBY: f64 = 1e-3;

/// Penetration at nodes that supports hold, as a share of the body's size, from which on an obstacle counts as beyond them.
pub const OVERRUN: f64 = 1e-6;

/// The slip between bodies, as a share of the size of a facet, after which what they face is found anew.
pub const SLIP_BETWEEN_PAIRINGS: f64 = 0.25;

/// The strain by the ejection of points from an obstacle above which a warning is given: that of a hard blow.
pub const EJECTED: f64 = 1e-4;
/// Halvings of a step after which the change of a gap that is left is a leap.
const HALVINGS: usize = 20;

/// The gap, as a share of the size of a facet, up to which a point touches another body along which it slides.
const TOUCHING: f64 = 1e-6;
/// The slip, as a share of the size of a facet, from which on its direction is known.
const LEAST_SLIP: f64 = 1e-3;
/// The steepest ascent and descent of the plane that a point faces until it reaches a surface that is found anew. Farther behind the plane
/// the surface has ended.
const STEEPEST: f64 = 1.5;

/// How a point stands to another body along which it slides, before it faces it anew.
#[derive(Debug, Clone, Copy)]
pub struct Touch<const D: usize> {
    /// In m.
    gap: f64,
    /// How far it has moved relative to the body since it began to face it, in m.
    moved: Vector<D>,
}

impl<const D: usize> Touch<D> {
    /// Whether the point touches the body.
    fn is_closed(&self, point: &Point<D>) -> bool {
        self.gap <= TOUCHING * point.facet_size
    }

    /// By how much a point is deeper in m because its gap is found to be this one: where it does not touch, as far as it is inside.
    fn found_deeper(&self, found: f64, point: &Point<D>) -> f64 {
        if self.is_closed(point) { self.gap - found } else { (-found).max(0.0) }
    }

    /// The gap in m and the normal at which a point faces a plane from now on, given its gap to the surface found.
    fn plane(&self, found: f64, point: &Point<D>) -> (f64, Vector<D>) {
        let gap = if self.is_closed(point) { self.gap } else { found.max(0.0) };
        let along = point.along_surface(&self.moved);
        let slip = norm(&along);
        let least = point.stretch * point.facet_size;
        let ascent = (gap - found) / slip.max(SLIP_BETWEEN_PAIRINGS * least);
        if ascent < -STEEPEST {
            return (found, point.normal);
        }
        let share = if slip < LEAST_SLIP * least { 0.0 } else { ascent.min(STEEPEST) / slip };
        let normal = add_scaled(&point.normal, share, &along);
        let length = norm(&normal);
        (gap, normal.map(|n| n / length))
    }
}

/// How far a point has moved relative to another body since it began to face it, in m.
fn moved<const D: usize>(point: &Point<D>, displacement: &[f64]) -> Vector<D> {
    std::array::from_fn(|i| displacement[point.node() * D + i] - point.faced_at[i])
}

/// How far a point has slid along another body since it began to face it, as a share of the size of the facets there.
fn slip<const D: usize>(point: &Point<D>, displacement: &[f64]) -> f64 {
    norm(&point.along_surface(&moved(point, displacement))) / point.stretch / point.facet_size
}

impl<const D: usize> NormalContact<D> {
    /// The largest slip of points on this rank along another body since they began to face it, as a share of the size of the facets there,
    /// at displacements that are relative to it.
    pub fn slip(&self, displacement: &[f64]) -> f64 {
        let facing = self.points.iter().filter(|point| point.distance.is_finite());
        facing.map(|point| slip(point, displacement)).fold(0.0, larger)
    }

    /// Writes the planes that the points face: at their nodes the normal and the distance.
    pub fn write_planes(&self, nodal: &mut [f64]) {
        for point in &self.points {
            let plane = &mut nodal[(D + 1) * point.node()..][..=D];
            plane[..D].copy_from_slice(&point.normal);
            plane[D] = point.distance;
        }
    }

    /// The nodes of the points on this rank that face nothing of the other body, with the sizes in m of the facets there.
    pub fn facing_nothing(&self) -> impl Iterator<Item = (usize, f64)> {
        let points = self.points.iter().filter(|point| !point.distance.is_finite());
        points.map(|point| (point.node(), point.facet_size))
    }
}

impl<const D: usize> Contact<D> {
    /// Fails where the obstacle has passed a point in the step just solved, from displacements at its start and velocities at its end
    /// (with ghosts), and where it is beyond points that should have stopped it.
    pub fn refuse_passage(&self, step: Step, displacement: &[f64], velocity: &[f64]) -> Result<()> {
        let given = match &self.obstacle.gap {
            Gap::Distance(gap) if !gap.depends_on_time() && self.carried.is_none() => return Ok(()),
            Gap::Distance(gap) => Some(gap),
            _ => None,
        };
        if !self.normal.law.depends_on_displacement() {
            return Ok(());
        }
        let times = [step.start(), step.time];
        let is_loaded = self.obstacle.moves();
        for point in &self.normal.points {
            let depth = point.context.penetration + point.advance(Body, velocity);
            if point.unknown == Unknown::Stop && depth > OVERRUN * self.normal.body_size {
                return Err(Error::Failed(format!(
                    "the step to t = {:.6e} s (length {:.3e} s) failed: the obstacle that a force moves is {depth:.3e} m \
                     beyond the boundary at {:?} m, where a support holds the normal, and nowhere along its direction it is outside of \
                     all such points; let the contact end before the support (key `where`), free the normal component there, or take a \
                     law with a finite pressure, as normal.compliance",
                    step.time,
                    step.length,
                    point.initial_place()
                )));
            }
            let [worn, worn_before] = point.worn;
            let along = point.normal_component(Body, displacement);
            let moved = along + point.blend_offset + point.advance(Body, velocity);
            let moved = [along - worn_before, moved - worn];
            if let Some(gap) = given.filter(|_| point.carries(&self.normal.law)) {
                let closed = moved.map(|moved| (moved - point.distance) / point.stretch);
                let given = GivenGap { times, place: point.place, closed, body_size: self.normal.body_size };
                let approach = self.carried.as_ref().and_then(|by| by.approach(&point.normal, times[0]));
                if let Some(approach) = approach.filter(|_| closed[1].is_finite()) {
                    let most = approach.most(times[1]) / point.stretch;
                    let way = |time: f64| approach.at(time) / point.stretch;
                    if given.comes_and_goes_along(gap, (&way, most)) {
                        return Err(Error::Failed(format!(
                            "the step to t = {:.6e} s (length {:.3e} s) failed: supports let the boundary at {:?} m touch the other body and \
                             part from it within the step; take a smaller [time] step, which resolves the motion of the supports, or correct \
                             their motion",
                            step.time,
                            step.length,
                            point.initial_place()
                        )));
                    }
                } else if given.comes_and_goes(gap) {
                    return Err(Error::Failed(format!(
                        "the step to t = {:.6e} s (length {:.3e} s) failed: its gap at {:?} m closes and opens within the step; take a \
                         smaller [time] step, which resolves the formula of the gap, or correct the formula",
                        step.time,
                        step.length,
                        point.initial_place()
                    )));
                }
            }
            if given.is_some() {
                continue;
            }
            let [before, after] =
                [self.obstacle.seen_before(&point.place), self.obstacle.seen_after(&point.place)];
            let sweep = Sweep {
                times,
                places: [
                    add_scaled(&before, moved[0], &point.normal),
                    add_scaled(&after, moved[1], &point.normal),
                ],
                normal: point.normal,
                outward: point.edge.as_ref().map_or(point.normal, |edge| edge.whole().0),
                sizes: [self.normal.body_size, if D == 2 { point.weight } else { point.weight.sqrt() }],
                loses_obstacle: point.penetration_before > f64::NEG_INFINITY && !point.can_touch(),
            };
            if self.obstacle.gap.passes(&sweep)? {
                let speed = if is_loaded { "its force or its mass" } else { "its motion" };
                return Err(Error::Failed(format!(
                    "the step to t = {:.6e} s (length {:.3e} s) failed: its obstacle passes through the boundary at {:?} m, in front of \
                     which it is at the start of the step and behind which at the end, or comes and goes within the step; take a \
                     smaller [time] step, in which obstacle and body approach each other by less than the size of the obstacle and \
                     which resolves the motion, or correct {speed}",
                    step.time,
                    step.length,
                    point.initial_place()
                )));
            }
        }
        Ok(())
    }

    /// Whether points with mass that are inside of the obstacle are out of it at the end of a step, however short.
    pub fn ejects(&self) -> bool {
        self.wave_speed.is_some() && self.layer.is_none()
    }

    /// How the obstacle ejects a point in the step just solved. What overlaps before the first step is known before it.
    fn ejection(&self, point: &Point<D>, step: Step) -> Result<Ejection> {
        let way = point.context.step_length;
        let before = if step.previous_length > 0.0 { larger(point.penetration_before, 0.0) } else { 0.0 };
        let strain = |overlap: f64| {
            let speed = overlap / way - point.leaves;
            self.wave_speed.map_or(f64::NEG_INFINITY, |wave_speed| speed / wave_speed)
        };
        let inside = point.moved - point.reach;
        let mut overlap = inside.min(before - point.growth.min(0.0));
        if strain(overlap) > EJECTED && point.growth < 0.0 {
            overlap = inside.min(before + self.leap(point, step)?);
        }
        Ok(Ejection { strain: strain(overlap), overlap, time: step.time })
    }

    /// By how much the gap of a point falls at one moment of a step, in m, by the given motion of the obstacle.
    fn leap(&self, point: &Point<D>, step: Step) -> Result<f64> {
        let seen = self.obstacle.seen_before(&point.place);
        let gap = |time: f64| self.obstacle.gap_of(point, time, &seen, point.moved);
        let mut times = [step.start(), step.time];
        let mut gaps = [gap(times[0])?, gap(times[1])?];
        for _ in 0..HALVINGS {
            let middle = 0.5 * (times[0] + times[1]);
            let between = gap(middle)?;
            let later = usize::from(gaps[0] - between > between - gaps[1]);
            (times[later], gaps[later]) = (middle, between);
        }
        let fall = gaps[0] - gaps[1];
        Ok(if fall.is_finite() { larger(fall, 0.0) } else { 0.0 })
    }

    /// Keeps how near the obstacle has come in the step just solved, at its velocities with ghosts.
    pub fn keep_closeness(&mut self, step: Step, velocity: &[f64]) -> Result<()> {
        if !self.normal.law.depends_on_displacement() {
            return Ok(());
        }
        let ejects = self.ejects();
        let mut closeness = self.closeness;
        if let [Some(motion), _] = &self.obstacle.motions {
            closeness.leap = larger(closeness.leap, motion.way());
        }
        for point in &self.normal.points {
            let after = (point.context.penetration + point.advance(Body, velocity)) / point.stretch;
            if point.carries(&self.normal.law) {
                let presses = point.pressure_at(&self.normal.law, Body, velocity) != 0.0;
                closeness.penetration =
                    larger(closeness.penetration, if presses { larger(after, 0.0) } else { after });
                if ejects && presses && point.can_touch() {
                    let ejection = self.ejection(point, step)?;
                    if ejection.strain > EJECTED {
                        closeness.ejection = closeness.ejection.or(ejection);
                    }
                }
            } else {
                closeness.held = larger(closeness.held, after);
            }
        }
        self.closeness = closeness;
        Ok(())
    }

    /// Keeps how far points with pressure have slid along another body in the step just committed, at displacements and velocities that
    /// are relative to it, and how sharp its edges over them are.
    pub fn keep_slip(&mut self, [displacement, velocity]: [&[f64]; 2]) {
        if !self.is_paired {
            return;
        }
        for point in &self.normal.points {
            if point.pressure_at(&self.normal.law, Body, velocity) != 0.0 {
                let Closeness { slip: most, sharpness, ends, .. } = &mut self.closeness;
                *most = larger(*most, slip(point, displacement));
                *sharpness = larger(*sharpness, point.sharpness);
                *ends = larger(*ends, f64::from(u8::from(point.meets_end)));
            }
        }
    }

    /// The nodes of its points in their order, with the pressure in Pa and the part of the surface in m^(D-1) for which each stands, in the
    /// step just solved, at its velocities with ghosts.
    pub fn pressures(&self, velocity: &[f64]) -> impl Iterator<Item = (usize, [f64; 2])> {
        let pressure = |point: &Point<D>| point.pressure_at(&self.normal.law, Body, velocity);
        self.normal.points.iter().map(move |point| (point.node(), [pressure(point), point.area()]))
    }

    /// Keeps how far points with pressure have moved along an obstacle until the step just solved, and what that changes at their gaps, which
    /// are those of the undeformed body (`sliding = "small"`), and how the pressure is then inclined to the obstacle; at displacements and
    /// velocities at its end. Collective.
    pub fn keep_shift(&mut self, session: &Session, [displacement, velocity]: [&[f64]; 2]) -> Result<()> {
        let is_given = matches!(self.obstacle.gap, Gap::Distance(_));
        if self.is_paired || is_given || !self.normal.law.depends_on_displacement() {
            return Ok(());
        }
        let mut most = [f64::NEG_INFINITY; 4];
        // The tangential part of the pressures, and their sum.
        let mut force = [0.0; 4];
        // Of the points under pressure: their number, their area, and the integrals of the changes and the normal displacements and of their squares.
        let mut under_pressure = [0.0; 6];
        for point in self.normal.points.iter().filter(|point| point.undeformed().is_none()) {
            let along = point.normal_component(Body, displacement);
            let (mut moved, mut shift) = (0.0, 0.0);
            let pressure = point.pressure_at(&self.normal.law, Body, velocity);
            if pressure != 0.0 {
                let tangential = point.along_surface(&point.value(displacement));
                let seen = self.obstacle.seen_after(&add_scaled(&point.place, 1.0, &tangential));
                moved = norm(&tangential);
                if moved > 0.0 {
                    let direction = tangential.map(|u| u / moved);
                    let slope = self.obstacle.growth_along(point, &direction, NEARBY * moved);
                    if let Some(slope) = slope.ok().filter(|slope| slope.is_finite()) {
                        let normal = point.weight * pressure;
                        force.iter_mut().zip(&direction).for_each(|(sum, x)| *sum += normal * slope * x);
                        force[3] += normal.abs();
                    }
                }
                let change = self.obstacle.reach_from(point, &seen).unwrap_or(f64::INFINITY) - point.reach;
                shift = if change.is_finite() { change.abs() } else { moved };
                if change.is_finite() {
                    let w = point.weight;
                    let terms = [1.0, w, w * change, w * change * change, w * along, w * along * along];
                    under_pressure.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                }
            }
            for (most, value) in most.iter_mut().zip([moved, shift, -along, along]) {
                *most = larger(*most, value);
            }
        }
        let [moved, shift, lowest, highest] = session.largest(most);
        let spread = (lowest + highest).max(ROUNDING * self.normal.body_size);
        let [x, y, z, normal] = session.sum(force);
        let [count, area, changes @ .., displacements, of_squares] = session.sum(under_pressure);
        let deviation =
            |[sum, of_squares]: [f64; 2]| larger(of_squares / area - (sum / area) * (sum / area), 0.0).sqrt();
        let kept = &mut self.closeness;
        if shift > ASTRAY * self.normal.body_size && normal > 0.0 {
            kept.inclination = larger(kept.inclination, norm(&[x, y, z]) / normal);
            kept.shift_to_spread = larger(kept.shift_to_spread, shift / spread);
        }
        // What a motion changes in the shape of the gaps under pressure, beside what the pressures have changed in it.
        let extent = if D == 2 { area } else { area.sqrt() };
        if count >= LEAST_POINTS && deviation(changes) > LEAST_CHANGE * extent {
            let indented = larger(deviation([displacements, of_squares]), LEAST_INDENTATION * spread);
            kept.shift_to_spread = larger(kept.shift_to_spread, deviation(changes) / indented);
        }
        kept.moved = larger(kept.moved, moved);
        kept.shift = larger(kept.shift, shift);
        Ok(())
    }

    /// How the points stand to the other body along which they slide, at displacements that are relative to it.
    pub fn touches(&self, displacement: &[f64]) -> Result<Vec<Touch<D>>> {
        let touch = |point: &Point<D>| {
            let [along, gap] = self.obstacle.position_at(0.0, displacement, point)?;
            Ok(Touch { gap: gap - along, moved: moved(point, displacement) })
        };
        self.normal.points.iter().map(touch).collect()
    }

    /// Lets the points of a contact that slides along another body face it, at displacements that are relative to it.
    ///
    /// Between two such times each point faces a plane. What nodes face on a surface that is curved, or made of facets, jumps when it is
    /// found anew. A law that removed the jump of a point that touches within one step, however short, would throw the bodies apart. So the
    /// new plane goes through the place where the point is, given how it stood, and is inclined so that it reaches the surface when the
    /// point has slid on as far as it will until it faces anew. The pressure, at right angles to the plane, then does no work beyond that
    /// of closing a gap. Without mass nothing is thrown, and points see the surface as it is found.
    ///
    /// `touches` is how the points stood, if they have faced the body before, and whether the bodies have mass.
    pub fn face(
        &mut self,
        nodes: &[PairedNode<D>],
        held: &Held<D>,
        displacement: &[f64],
        touches: Option<(&[Touch<D>], bool)>,
    ) -> Result<()> {
        for (at, node) in nodes.iter().enumerate() {
            let point = &mut self.normal.points[at];
            (point.stretch, point.sharpness, point.meets_end) =
                (node.stretch, node.sharpness, node.meets_end);
            point.is_inclined = node.inclination(held).is_some();
            point.faced_at = std::array::from_fn(|i| displacement[point.node() * D + i]);
            point.turn(&node.normal, held);
            // Along a normal that is not that of the plane.
            let open = node.distance / dot(&node.normal, &point.normal);
            point.distance = open + dot(&point.faced_at, &point.sense);
            point.found_deeper = 0.0;
            if let Some((touches, has_mass)) = touches.filter(|_| open.is_finite()) {
                let touch = touches[at];
                let [along, gap] = self.obstacle.position_at(0.0, displacement, point)?;
                let mut found = gap - along;
                if has_mass {
                    let (kept, normal) = touch.plane(found, point);
                    point.turn(&normal, held);
                    let more = kept - found;
                    point.distance = open + more + dot(&point.faced_at, &point.sense);
                    found = kept;
                }
                point.found_deeper = touch.found_deeper(found, point);
            }
            point.set_weight(node.weight);
        }
        self.turn_tangents(held);
        Ok(())
    }

    /// Forgets by how much points are deeper because what they face was found anew, after the energy of a step was computed.
    pub fn forget_found(&mut self) {
        self.normal.points.iter_mut().for_each(|point| point.found_deeper = 0.0);
    }

    /// Lets the points face planes of an earlier run, see `write_planes`.
    pub fn face_planes(&mut self, planes: &[f64], held: &Held<D>) {
        for point in &mut self.normal.points {
            let plane = &planes[(D + 1) * point.node()..][..=D];
            if plane[..D].iter().any(|n| *n != 0.0) {
                point.turn(&std::array::from_fn(|i| plane[i]), held);
                point.set_weight(point.weight);
                point.distance = plane[D];
            }
        }
        self.turn_tangents(held);
    }

    fn turn_tangents(&mut self, held: &Held<D>) {
        for point in self.friction.iter_mut().flat_map(|friction| &mut friction.points) {
            point.face(&self.normal.points[point.at], held);
        }
    }

    /// The smallest and the largest angle in rad between the surface at a point on this rank and a plane in front of it at `time`;
    /// infinity and its opposite where none is.
    pub fn tilts(&self, time: f64) -> [f64; 2] {
        let of_point = |point: &Point<D>| {
            let gap = |along: &Vector<D>| {
                self.obstacle
                    .gap
                    .at(time, &add_scaled(&point.place, self.normal.body_size, along), &point.normal)
                    .unwrap_or(f64::NAN)
            };
            let here = gap(&[0.0; D]);
            let squares = tangents(&point.normal)
                .map(|tangent| ((gap(&tangent) - here) / self.normal.body_size).powi(2));
            squares.sum::<f64>().sqrt().atan()
        };
        let is_plane = matches!(self.obstacle.gap, Gap::Plane(_));
        let angles = self.normal.points.iter().filter(|point| is_plane && point.can_touch()).map(of_point);
        angles.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], angle| {
            [least.min(angle), most.max(angle)]
        })
    }

    /// The gaps of points on this rank at `time`, from displacements with ghosts. A gap that is NaN is ignored: the first step refuses
    /// it.
    pub fn gaps(&self, time: f64, displacement: &[f64]) -> Gaps {
        let mut gaps = Gaps { smallest: f64::INFINITY, largest: f64::NEG_INFINITY, without: 0 };
        for point in &self.normal.points {
            let point = self.facing(point, time, displacement);
            let Ok([along, gap]) = self.obstacle.position_at(time, displacement, &point) else { continue };
            if gap == f64::INFINITY {
                gaps.without += 1;
            } else {
                let open = (gap - along) / point.stretch;
                gaps.smallest = gaps.smallest.min(open);
                gaps.largest = gaps.largest.max(open);
            }
        }
        gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::space::SurfacePoint;

    #[test]
    fn what_is_found_makes_points_deeper_that_touch_and_others_as_far_as_they_are_inside() {
        let held = Held::<2>::from(vec![false; 2]);
        let place = SurfacePoint { node: 0, normal: [0.0, -1.0], weight: 1.0 };
        let mut point = Point::nodal(place, &held);
        point.facet_size = 0.1;
        let deeper = |gap: f64, found: f64| Touch { gap, moved: [0.0; 2] }.found_deeper(found, &point);
        assert_eq!([deeper(0.0, -2.0), deeper(0.0, 2.0), deeper(-3.0, -1.0)], [2.0, -2.0, -2.0]);
        assert_eq!([deeper(1.0, -2.0), deeper(1.0, 0.5), deeper(f64::INFINITY, -1.0)], [2.0, 0.0, 1.0]);
    }

    #[test]
    fn a_point_that_touches_faces_a_plane_through_its_place_which_leads_to_the_surface_found() {
        let held = Held::<2>::from(vec![false; 2]);
        let place = SurfacePoint { node: 0, normal: [0.0, -1.0], weight: 1.0 };
        let mut point = Point::nodal(place, &held);
        point.facet_size = 0.1;
        let plane = |gap: f64, slip: f64, found: f64| Touch { gap, moved: [slip, 0.0] }.plane(found, &point);
        // It is 2.5 mm inside, or outside, and slides by 25 mm until it faces anew: the plane rises, or falls, by a tenth.
        for found in [-2.5e-3, 2.5e-3] {
            let (gap, [x, y]) = plane(0.0, 0.025, found);
            assert_eq!(gap, 0.0);
            assert!((x / y - 40.0 * found).abs() < 1e-12, "{x}, {y}");
        }
        let own = [0.0, -1.0];
        // A surface that ends, one that is not touched, and one of which the point knows no direction of sliding.
        assert_eq!(plane(0.0, 0.025, 0.05), (0.05, own));
        assert_eq!(plane(1e-3, 0.025, 2e-3), (2e-3, own));
        assert_eq!(plane(0.0, 0.0, -1e-3), (0.0, own));
        // One that it meets deep inside at first.
        let (gap, [x, y]) = plane(f64::INFINITY, 0.025, -1.0);
        assert_eq!(gap, 0.0);
        assert!((x / y + STEEPEST).abs() < 1e-12, "{x}, {y}");
    }
}
