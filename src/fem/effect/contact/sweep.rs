//! Obstacles that contact misses: they pass the boundary within a step, press against nodes that supports hold, or never touch it.

use super::{
    Contact,
    closeness::Gaps,
    normal::NormalContact,
    point::{Point, Unknown, Vectors::Body},
    tangential_point::tangents,
};
use crate::{
    error::{Error, Result},
    fem::{effect::Step, pairs::PairedNode},
    laws::contact::{Gap, Sweep},
    linear_algebra::tensor::{Vector, add_scaled, dot, larger, norm},
};

/// Penetration at nodes that supports hold, as a share of the body's size, from which on an obstacle counts as beyond them.
pub const OVERRUN: f64 = 1e-6;

/// The slip between bodies, as a share of the size of a facet, after which what they face is found anew.
pub const SLIP_BETWEEN_PAIRINGS: f64 = 0.25;

/// How far a point has slid along another body since it began to face it, as a share of the size of the facets there.
fn slip<const D: usize>(point: &Point<D>, displacement: &[f64]) -> f64 {
    let moved: Vector<D> = std::array::from_fn(|i| displacement[point.node() * D + i] - point.faced_at[i]);
    let along = norm(&add_scaled(&moved, -dot(&moved, &point.normal), &point.normal));
    along / point.stretch / point.facet_size
}

impl<const D: usize> NormalContact<D> {
    /// The largest slip of points on this rank along another body since they began to face it, as a share of the size of the facets there,
    /// at displacements that are relative to it.
    pub fn slip(&self, displacement: &[f64]) -> f64 {
        let facing = self.points.iter().filter(|point| point.distance.is_finite());
        facing.map(|point| slip(point, displacement)).fold(0.0, larger)
    }

    /// The nodes of the points on this rank that face nothing of the other body, with the sizes in m of the facets there.
    pub fn facing_nothing(&self) -> impl Iterator<Item = (usize, f64)> {
        let points = self.points.iter().filter(|point| !point.distance.is_finite());
        points.map(|point| (point.node(), point.facet_size))
    }

    /// Whether points may be inside of the body that they face, see [`allow_depths`](Self::allow_depths).
    pub fn keeps_depths(&self) -> bool {
        self.points.iter().any(|point| point.overlap > 0.0)
    }

    /// Sets the depths that points may have in the body that they face in the next step, at whose end they will be at these displacements
    /// relative to it if they move on as they do. What nodes face on a surface that is inclined or deformed jumps when it is found anew. A law
    /// without a finite pressure would remove the depth within one step, however short, and thus throw the bodies apart; over the slip
    /// until they face anew they move as the surface rises.
    pub fn allow_depths(&mut self, displacement: &[f64]) {
        for point in &mut self.points {
            let left = 1.0 - slip(point, displacement) / SLIP_BETWEEN_PAIRINGS;
            point.allowance = point.overlap * left.max(0.0);
        }
    }
}

impl<const D: usize> Contact<D> {
    /// Fails where the obstacle has passed a point in the step just solved, from displacements at its start and velocities at its end
    /// (with ghosts), and where it is beyond points that should have stopped it.
    pub fn refuse_passage(&self, step: Step, displacement: &[f64], velocity: &[f64]) -> Result<()> {
        if !self.normal.law.depends_on_displacement() || matches!(self.obstacle.gap, Gap::Distance(_)) {
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
                    step.time, step.length, point.place
                )));
            }
            let [worn, worn_before] = point.worn;
            let along = point.normal_component(Body, displacement);
            let moved = along + point.blend_offset + point.advance(Body, velocity);
            let [before, after] =
                [self.obstacle.seen_before(&point.place), self.obstacle.seen_after(&point.place)];
            let sweep = Sweep {
                times,
                places: [
                    add_scaled(&before, along - worn_before, &point.normal),
                    add_scaled(&after, moved - worn, &point.normal),
                ],
                normal: point.normal,
                body_size: self.normal.body_size,
                loses_obstacle: point.penetration_before > f64::NEG_INFINITY && !point.can_touch(),
            };
            if self.obstacle.gap.passes(&sweep)? {
                let speed = if is_loaded { "its force or its mass" } else { "its motion" };
                return Err(Error::Failed(format!(
                    "the step to t = {:.6e} s (length {:.3e} s) failed: its obstacle passes through the boundary at {:?} m, in front of \
                     which it is at the start of the step and behind which at the end, or comes and goes within the step; take a \
                     smaller [time] step, in which obstacle and body approach each other by less than the size of the obstacle and \
                     which resolves the motion, or correct {speed}",
                    step.time, step.length, point.place
                )));
            }
        }
        Ok(())
    }

    /// Keeps how near the obstacle has come in the step just solved, at its velocities with ghosts.
    pub fn keep_closeness(&mut self, velocity: &[f64]) {
        if !self.normal.law.depends_on_displacement() {
            return;
        }
        let mut closeness = self.closeness;
        for point in &self.normal.points {
            let after = (point.context.penetration + point.advance(Body, velocity)) / point.stretch;
            if point.carries(&self.normal.law) {
                let presses = point.pressure_at(&self.normal.law, Body, velocity) != 0.0;
                closeness.penetration =
                    larger(closeness.penetration, if presses { larger(after, 0.0) } else { after });
            } else {
                closeness.held = larger(closeness.held, after);
            }
        }
        self.closeness = closeness;
    }

    /// Keeps how far points with pressure have slid along another body in the step just committed, at displacements and velocities that
    /// are relative to it.
    pub fn keep_slip(&mut self, [displacement, velocity]: [&[f64]; 2]) {
        if !self.is_paired {
            return;
        }
        for point in &self.normal.points {
            if point.pressure_at(&self.normal.law, Body, velocity) != 0.0 {
                self.closeness.slip = larger(self.closeness.slip, slip(point, displacement));
            }
        }
    }

    /// Lets the points of a contact that slides along another body face it, at displacements that are relative to it. Points that are inside
    /// of it keep their depth at first, if wanted and if no finite pressure removes it.
    pub fn face(&mut self, nodes: &[PairedNode<D>], displacement: &[f64], keeps_depth: bool) -> Result<()> {
        let keeps_depth = keeps_depth && self.normal.law.has_vertical_parts() && self.wear.is_none();
        for (at, node) in nodes.iter().enumerate() {
            let point = &mut self.normal.points[at];
            point.overlap = 0.0;
            if keeps_depth {
                let own = self.obstacle.gap.of_moved(0.0, &point.place, &point.normal, 0.0)?;
                point.overlap = (-(node.distance + node.stretch * own)).max(0.0);
            }
            point.allowance = point.overlap;
            point.set_weight(node.weight);
            point.stretch = node.stretch;
            let moved = std::array::from_fn(|i| displacement[point.node() * D + i]);
            (point.distance, point.faced_at) = (node.distance + dot(&moved, &point.normal), moved);
        }
        for point in self.friction.iter_mut().flat_map(|friction| &mut friction.points) {
            point.weight = self.normal.points[point.at].weight;
        }
        Ok(())
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
            let Ok([along, gap]) = self.obstacle.position_at(time, displacement, point) else { continue };
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
