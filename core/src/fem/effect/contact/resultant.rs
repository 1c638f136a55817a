//! Forces of a contact on the body, and the parts of its area by state.

use super::{
    Contact,
    friction::FrictionStatus,
    point::{Unknown, Vectors::Body},
};
use crate::{
    error::Result,
    linear_algebra::tensor::{Vector, add_scaled, dot, larger},
};

/// Areas in m^(D-1) of a contact by the state of its points, and its pressures; points whose normal a support holds count for friction
/// only, unless a force moves the obstacle, which they stop.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactAreas {
    /// With contact pressure.
    pub touching: f64,
    /// Without contact pressure.
    pub open: f64,
    /// With friction, sticking.
    pub sticking: f64,
    /// With friction and sliding.
    pub slipping: f64,
    /// Integral of the contact pressure over the area in N.
    pub pressure: f64,
    /// Largest contact pressure in Pa; minus infinity where nothing touches.
    pub largest_pressure: f64,
}

/// The state of a nodal point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointState<const D: usize> {
    /// Outward unit normal of the boundary.
    pub normal: Vector<D>,
    /// The direction of the pressure in the traction: the normal without what supports hold, scaled to length 1; if nothing is left, the
    /// normal where the point stops an obstacle, otherwise 0.
    pub direction: Vector<D>,
    /// Contact pressure in Pa.
    pub pressure: f64,
    /// Distance to the obstacle in m; 0 if the law has no gap.
    pub gap: f64,
    /// Branch of the normal law.
    pub branch: usize,
    /// With friction, whether it sticks.
    pub sticks: Option<bool>,
    /// Velocity relative to the obstacle along the boundary in m/s, with friction.
    pub sliding: Vector<D>,
    /// Friction traction `-sigma_tau` in Pa.
    pub friction: Vector<D>,
    /// Accumulated slip distance in m, with friction that keeps it.
    pub slip: f64,
}

impl<const D: usize> Default for PointState<D> {
    fn default() -> Self {
        let [normal, direction, sliding, friction] = [[0.0; D]; 4];
        let [pressure, gap, slip] = [0.0; 3];
        Self { normal, direction, pressure, gap, branch: 0, sticks: None, sliding, friction, slip }
    }
}

impl<const D: usize> Contact<D> {
    /// Areas and pressures on this rank in the step just solved, at its velocities with ghosts.
    pub fn areas(&self, velocity: &[f64]) -> ContactAreas {
        let mut areas = ContactAreas { largest_pressure: f64::NEG_INFINITY, ..ContactAreas::default() };
        let stops = self.obstacle.moves();
        for point in self.normal.points.iter().filter(|point| point.unknown != Unknown::Held || stops) {
            let pressure = point.pressure_at(&self.normal.law, Body, velocity);
            if pressure == 0.0 {
                areas.open += point.area();
            } else {
                areas.touching += point.area();
                areas.pressure += point.area() * pressure;
                areas.largest_pressure = larger(areas.largest_pressure, pressure);
            }
        }
        if let Some(friction) = &self.friction {
            for ((motion, weight), tangential) in friction.motions(Body, velocity).zip(&friction.points) {
                let area = self.normal.points[tangential.at].stretch * weight;
                match motion {
                    FrictionStatus::Sticks => areas.sticking += area,
                    FrictionStatus::Slides => areas.slipping += area,
                    FrictionStatus::Separated => {}
                }
            }
        }
        areas
    }

    /// Visits the states of nodal points on this rank in the step just solved, at its time, displacements and velocities with ghosts and
    /// its nodal tractions.
    pub fn states(
        &self,
        time: f64,
        [displacement, velocity, traction]: [&[f64]; 3],
        mut visit: impl FnMut(usize, PointState<D>),
    ) -> Result<()> {
        if self.normal.needs_ghosts {
            return Ok(());
        }
        let friction = self.friction.as_ref();
        let mut moving =
            friction.into_iter().flat_map(|friction| friction.sliding(Body, velocity)).enumerate().peekable();
        let mut motions = friction.into_iter().flat_map(|friction| friction.motions(Body, velocity));
        for (at, point) in self.normal.points.iter().enumerate() {
            let mut state =
                PointState { normal: point.normal, direction: point.direction, ..PointState::default() };
            let mut leaning = 0.0;
            while let Some((number, (tangential, sliding))) = moving.next_if(|(_, (of, _))| of.at == at) {
                state.slip = friction.map_or(0.0, |friction| friction.slip_of(number));
                state.sliding = sliding.map(|speed| speed / point.stretch);
                let (free, held) = tangential.parts_of(traction);
                if tangential.leans() {
                    leaning = dot(&held, &point.direction);
                }
                state.friction = add_scaled(&free, 1.0, &held);
                state.sticks = motions.next().map(|(motion, _)| motion == FrictionStatus::Sticks);
            }
            if point.carries(&self.normal.law) {
                let along = point.velocity_along_normal(Body, velocity);
                if point.unknown.has_pressure() {
                    state.pressure = point.pressure_in(traction) - leaning;
                    let parameter = self.normal.scale * along + state.pressure;
                    state.branch =
                        self.normal.law.resolve_worn(parameter, self.normal.scale, point.context).branch;
                } else {
                    state.pressure = point.pressure_at(&self.normal.law, Body, velocity);
                    state.branch = self.normal.law.branch(along, point.context);
                }
            }
            if self.normal.law.depends_on_displacement() {
                let point = self.facing(point, time, displacement);
                let [along, gap] = self.obstacle.position_at(time, displacement, &point)?;
                state.gap = (gap - along) / point.stretch;
            }
            visit(point.node(), state);
        }
        Ok(())
    }

    /// The distance in m to the obstacle, at a `time`, of an undeformed place with this unit normal and this displacement, where the law has no
    /// point; none where the obstacle is not along the normal, the surface wears, or the law has no gap.
    pub fn gap_at(
        &self,
        (place, normal): (Vector<D>, Vector<D>),
        time: f64,
        displacement: &Vector<D>,
    ) -> Option<f64> {
        if !self.normal.law.depends_on_displacement() || self.wear.is_some() {
            return None;
        }
        let gap = &self.obstacle.gap;
        let found = if self.follows_surface {
            let here = self.obstacle.seen_before(&add_scaled(&place, 1.0, displacement));
            gap.at(time, &here, &gap.direction_of_nearest(&here, time).unwrap_or(normal))
        } else {
            let moved = dot(&normal, displacement);
            gap.of_moved(time, &self.obstacle.seen_before(&place), &normal, moved).map(|gap| gap - moved)
        };
        found.ok().filter(|gap| gap.is_finite())
    }

    /// Visits the forces in N on the body at the nodes of points on this rank in the step just solved, at its velocities with ghosts.
    /// They include those that supports take up.
    pub fn forces(&self, velocity: &[f64], mut visit: impl FnMut(u32, Vector<D>)) {
        for point in &self.normal.points {
            point.forces(point.pressure_at(&self.normal.law, Body, velocity), &mut visit);
        }
        for point in self.friction.iter().flat_map(|friction| &friction.points) {
            visit(point.node() as u32, point.whole_traction().map(|q| -point.weight * q));
        }
    }
}
