//! The table `[[contact]]`, and the faults of its laws and of their combinations.

use super::{
    adhesion::Adhesion,
    interface::Interface,
    laws::{FrictionLaw, NormalLaw},
    memory::Memory,
    obstacle_load::ObstacleLoad,
    obstacles::Gap,
    wear::Wear,
};
use crate::laws::{expression::Scalar, law::LawFault};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The points of a facet at which the contact laws are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quadrature {
    /// The nodes of the facet: trapezoidal rule, Simpson's rule for quadratic cells in the plane, and the midpoints of edges for
    /// quadratic cells in space. Required with friction, adhesion, memory, laws of the displacement, rigid obstacles and graphs with jumps.
    #[default]
    Nodal,
    /// Gauss points inside the facet.
    Gauss,
}

/// How far bodies in contact may slide along each other or along an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sliding {
    /// Less than half a facet: nodes act on the surface that they face in the undeformed bodies. More is warned of. Along an obstacle: gaps
    /// and normals are those of the undeformed body. Motions that change them are warned of.
    #[default]
    Small,
    /// Any distance: what nodes face is found anew from the displacements, whenever some node has slid by a quarter of a facet since the
    /// last time, and so is the direction of the pressure: at right angles to a flat surface on which a corner or a rounded edge slides, and to both of two edges.
    /// Corners, edges and ends, as of a pad on a longer rail, must be on the side that carries the law (`side`). Along an obstacle: the gap is that from where the boundary is at
    /// the start of each step, and the pressure acts at right angles to the obstacle there, except at nodes that other contacts share. An inner
    /// corner of an obstacle should be made of two contacts, each with one of its sides, at boundaries that meet at an edge of the body.
    /// Requires a normal law with a gap, without adhesion and memory.
    Finite,
}

impl Sliding {
    fn is_small(&self) -> bool {
        *self == Self::Small
    }
}

/// The boundaries of contact between bodies at whose nodes the law acts, the slave side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Those in `on`, unless supports hold nodes there and not what they face, or the law of another contact acts at what they face, or all
    /// their nodes belong to other contacts, too, or, with `sliding = "finite"`, corners, edges or ends of `against` lie
    /// over them where the bodies are nearest to each other, and theirs not over `against`, or, with `"small"`, such corners or edges would press
    /// apart bodies that only touch, and would not the other way round; or else their body is more than 100 times as
    /// stiff, or, of bodies that are not, their mesh is clearly coarser: they face more than twice as many nodes of `against` as they have
    /// themselves, in 3D more than four times as many. Then those in `against`, if supports do not hold nodes there in the same way and, for a stiffer body or a coarser
    /// mesh, no other contact has nodes of either side. The log names the choice. A run that starts from another one (`[initial] from`)
    /// prefers the choice of that run.
    #[default]
    Auto,
    /// Those in `on`.
    On,
    /// Those in `against`. Names, signs and the part that `where` selects stay those of `on`.
    Against,
}

impl Side {
    fn is_auto(&self) -> bool {
        *self == Self::Auto
    }
}

/// Boundaries that may touch an obstacle or another body, and their contact laws.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// The names of the boundaries. A named line, in 3D a named surface, inside the body of a mesh file is a fault: the mesh is split along
    /// it, except at its ends. Tractions and profiles know its two sides by its own name, the side below, left of a vertical fault, and
    /// by "other side of" and its name.
    #[schemars(length(min = 1), example = ["bottom"], example = ["fault"])]
    pub on: Vec<String>,
    /// The names of the boundaries of other bodies that the boundaries `on` may touch, instead of a rigid obstacle. The law acts at nodes
    /// of one side, which `side` chooses, on their velocity and displacement relative to the surface that they face along their normals in
    /// the undeformed bodies; friction, adhesion, memory and wear as against an obstacle. The better side is that of the softer body, or with
    /// the finer mesh, with corners and without supports. The distance of the undeformed surfaces is that of the mesh, whose facets are
    /// straight; `gap` of the normal law adds to it, so that a negative one is an interference, whose work counts as negative contact
    /// dissipation. Several contacts may have one boundary, as of a plate under two blocks: where their laws act at its nodes, a node has
    /// the law of the contact that it faces most, on its velocity relative to all that it faces, if the laws are the same or, with
    /// `sliding = "small"`, `unilateral` with the friction `coulomb` or `tresca`. Absent: an obstacle or `gap`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 1), example = ["top"])]
    pub against: Vec<String>,
    /// The boundaries at whose nodes the law acts. All names and signs of outputs are those of `on` and `against`, whatever it is.
    #[serde(default, skip_serializing_if = "Side::is_auto")]
    pub side: Side,
    /// Whether the undeformed boundaries count as touching wherever they face each other, whatever their distance in the mesh: for curved
    /// boundaries that fit each other, but whose facets do not, as of a shaft in a bush. `gap` of the normal law is then the whole
    /// distance. Absent: the distance is that of the mesh.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub closed: bool,
    /// How far the boundaries may slide along an obstacle or those in `against`.
    #[serde(default, skip_serializing_if = "Sliding::is_small")]
    pub sliding: Sliding,
    /// The part of these boundaries to which the contact applies: the facets at whose centre this expression in x, y, z is not 0. A
    /// boundary may be in several contact tables if each has a `where`, and no facet belongs to two; a node between them belongs to the
    /// one with the larger part of its area. Facets within which the condition changes are warned of. A product of conditions holds where
    /// all hold, their `max` where one holds. Absent: the whole boundaries.
    #[serde(default, skip_serializing_if = "Option::is_none", rename = "where")]
    #[schemars(extend("variables" = "x, y, z"), example = "x < 1", example = "(x > 1)*(x < 2)")]
    pub part: Option<Scalar>,
    /// The points of a facet at which the contact laws are evaluated.
    #[serde(default)]
    pub quadrature: Quadrature,
    /// The normal law: the contact pressure -sigma_nu as a function of the normal velocity or the normal displacement.
    pub normal: NormalLaw,
    /// Whether the mass of the cells at these boundaries is moved to nodes behind them (mass redistribution), so that the boundary
    /// loses no kinetic energy in impacts and the contact pressure has no peak that grows as steps become shorter. In an impact it still
    /// overshoots while the wave crosses the first cells, of bars by a fifth (implicit_euler) to 55 % (midpoint) with steps in which it crosses
    /// one cell, with much shorter ones by up to 60 %. Total mass, centre of mass and moments of inertia stay the same; gravity and body
    /// forces move with the mass. Between bodies, the boundaries `against` take part. Requires an implicit scheme.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schemars(extend("also" = "restitution, rebound"))]
    pub redistribute_mass: bool,
    /// A rigid obstacle, which may move. It replaces the key `gap` of the normal laws `compliance`, `displacement_graph`, `unilateral` and
    /// `expression` of the penetration d; other normal laws have no distance to an obstacle. Absent: `gap` applies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<Gap>,
    /// A force that moves the obstacle (indentation), or a moment that turns it (rolling). Its displacement and velocity, angle and
    /// angular velocity are in `resultants.csv`. Absent: the obstacle moves as its keys prescribe.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle_load: Option<ObstacleLoad>,
    /// The friction law: the bound on the tangential traction sigma_tau. Absent: no friction, sigma_tau = 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("also" = "brake, clutch, belt, stick-slip, stick, slip"))]
    pub friction: Option<FrictionLaw>,
    /// Share of the heat of friction that enters the body, with [material.heat]; the rest enters the obstacle, or the body of `against`. No
    /// heat is conducted from one body to the other. Absent: 1, between bodies 0.5.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1), example = 0.5)]
    pub friction_heat: Option<f64>,
    /// Wear: the body's surface recedes where it slides under pressure, so that the gap widens. The depth grows by `coefficient`
    /// times the contact pressure times the length of sliding relative to the obstacle (Archard's law); fields have it as `wear`.
    /// Requires a friction law and a normal law with a gap. Absent: no wear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wear: Option<Wear>,
    /// Adhesion to an obstacle at rest: bonds that form at displacement zero, resist opening and sliding, and break. The bonding b
    /// at a node, 1 for intact and 0 for broken bonds, starts at 1 and decreases as `viscosity b' = -max(b (stiffness R(opening)^2
    /// + tangential_stiffness R(sliding)^2) - energy, 0)`, where R(s) = min(s, length). Broken bonds are not restored. The traction
    /// is `b^2 stiffness R(opening)` along the normal and `b^2 tangential_stiffness R(sliding)` against the sliding. The output
    /// `contact_pressure` is the pressure of the normal law without the traction of adhesion. Absent: no adhesion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adhesion: Option<Adhesion>,
    /// Memory of the foundation: a pressure that depends on the history of the normal displacement and is added to the pressure of
    /// the normal law, `integral from 0 to t of stiffness_rate exp(-(t - s) / decay_time) max(normal displacement(s), 0) ds`. Field
    /// files contain it as `memory_pressure`; the output `contact_pressure` is the pressure of the normal law only. The work of
    /// both pressures is part of `contact_dissipation`, which is negative while the foundation returns energy. Absent: no memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
}

impl Contact {
    fn interface(&self) -> Interface<'_> {
        let moves = self.obstacle.as_ref().is_some_and(Gap::surface_may_move);
        Interface {
            normal: &self.normal,
            friction: self.friction.as_ref(),
            has_obstacle: self.obstacle.is_some(),
            obstacle_moves: moves || self.obstacle_load.is_some(),
        }
    }

    /// Whether its laws are the same for any multiple of displacements, gaps and velocities: constraints, and friction with a bound that
    /// does not depend on the sliding.
    pub fn is_without_scale(&self) -> bool {
        let is_constraint = matches!(self.normal, NormalLaw::Unilateral(_));
        let has_bound =
            matches!(self.friction, None | Some(FrictionLaw::Tresca(_) | FrictionLaw::Coulomb(_)));
        let keeps_more = self.wear.is_some() || self.adhesion.is_some() || self.memory.is_some();
        is_constraint && has_bound && !keeps_more
    }

    /// Whether its laws are those of another contact, whatever the boundaries.
    pub fn has_the_laws_of(&self, other: &Self) -> bool {
        let Self { on, against, side, part, .. } = self.clone();
        self == &Self { on, against, side, part, ..other.clone() }
    }

    /// The shares of the heat of friction that enter the body of `on` and, if there is one, that of `against`.
    pub fn shares_of_heat(&self) -> [f64; 2] {
        match (self.friction_heat, self.against.is_empty()) {
            (share, true) => [share.unwrap_or(1.0), 0.0],
            (share, false) => [share.unwrap_or(0.5), 1.0 - share.unwrap_or(0.5)],
        }
    }

    /// The moment that turns the obstacle.
    pub fn moment(&self) -> Option<&Scalar> {
        self.obstacle_load.as_ref().and_then(|load| load.moment.as_ref())
    }

    /// The faults of the laws and of their combinations; keys are those of the table.
    pub fn faults(&self) -> Vec<LawFault> {
        let (normal, interface) = (&self.normal, self.interface());
        let mut faults: Vec<LawFault> =
            normal.own_faults().into_iter().map(|fault| fault.within(&normal.table())).collect();
        if let Some(obstacle) = &self.obstacle {
            faults.extend(normal.faults_beside_obstacle());
            faults.extend(obstacle.own_faults());
            faults.extend(self.faults_of_moment(obstacle));
        }
        if let Some(law) = &self.friction {
            faults.extend(law.own_faults().into_iter().map(|fault| fault.within(law.table())));
        }
        faults.extend(self.obstacle_load.iter().flat_map(|load| load.faults(interface)));
        faults.extend(self.adhesion.iter().flat_map(|law| law.faults(interface)));
        faults.extend(self.memory.iter().flat_map(|_| Memory::faults(interface)));
        let has_histories = self.adhesion.is_some() || self.memory.is_some();
        faults.extend(self.wear.iter().flat_map(|_| Wear::faults(interface, has_histories)));
        faults.extend(self.faults_of_pair());
        if self.quadrature == Quadrature::Gauss {
            let not_there = [
                (self.friction.is_some(), "friction is not available at Gauss points"),
                (self.adhesion.is_some(), "adhesion is not available at Gauss points"),
                (self.memory.is_some(), "memory is not available at Gauss points"),
                (normal.needs_nodes(), "this contact law is not available at Gauss points"),
                (!self.against.is_empty(), "contact between bodies acts at nodes"),
            ];
            let help = "use \"nodal\", or delete the key";
            let not_there = not_there.into_iter().filter(|(is_there, _)| *is_there);
            faults.extend(not_there.map(|(_, message)| LawFault::at_value("quadrature", message, help)));
        }
        faults
    }

    /// Another body takes the place of an obstacle.
    fn faults_of_pair(&self) -> Vec<LawFault> {
        let small = "use \"small\", or delete the key";
        let slides = self.sliding == Sliding::Finite;
        if self.against.is_empty() {
            let of_sliding = "only along an obstacle or another body can the boundary slide far";
            let of_histories = "adhesion and memory belong to the place where the boundary was first";
            let has_histories = self.adhesion.is_some() || self.memory.is_some();
            let of_distance = "only between bodies is the distance that of the mesh";
            let why = if self.obstacle.is_none() {
                Some(of_sliding)
            } else {
                has_histories.then_some(of_histories)
            };
            let sliding = why.filter(|_| slides).map(|why| LawFault::at_value("sliding", why, small));
            let closed = self.closed.then(|| LawFault::at_value("closed", of_distance, "delete the key"));
            let of_side = "only contact `against` another body has two sides";
            let is_given = self.side != Side::Auto;
            let side = is_given.then(|| LawFault::at_value("side", of_side, "delete the key"));
            return sliding.into_iter().chain(closed).chain(side).collect();
        }
        let other = "delete it, or delete `against`";
        let of_histories = "adhesion and memory belong to the surface that nodes faced first";
        let of_gap = "this normal law has no gap, so that it would act where nodes face nothing";
        let of_closed = "the distance of bodies that slide far is that of the mesh";
        let of_obstacle = "the boundaries `on` touch another body or a rigid obstacle, not both";
        let of_load = "a load moves a rigid obstacle, and this contact is against a body";
        let has_histories = self.adhesion.is_some() || self.memory.is_some();
        let mut faults = Vec::new();
        let mut check = |is_fault: bool, fault: LawFault| faults.extend(is_fault.then_some(fault));
        check(self.obstacle.is_some(), LawFault::at_key("obstacle", of_obstacle, other));
        check(self.obstacle_load.is_some(), LawFault::at_key("obstacle_load", of_load, other));
        check(slides && has_histories, LawFault::at_value("sliding", of_histories, small));
        check(slides && !self.normal.has_gap(), LawFault::at_value("sliding", of_gap, small));
        check(slides && self.closed, LawFault::at_value("closed", of_closed, "delete the key"));
        if let Some(name) = self.on.iter().find(|name| self.against.contains(name)) {
            let message = format!("the boundary \"{name}\" is on both sides of this contact");
            faults.push(LawFault::at_value("against", message, "name another boundary"));
        }
        faults
    }

    /// A moment turns what has a centre and does not turn otherwise.
    fn faults_of_moment(&self, obstacle: &Gap) -> impl Iterator<Item = LawFault> {
        let moment = self.moment().map(|_| obstacle);
        let of_plane = moment.filter(|obstacle| matches!(obstacle, Gap::Plane(_))).map(|_| {
            let message = "a moment turns an obstacle about its centre, and a plane has none";
            let help = "use a sphere, a torus or a shape, or give the plane a `rotation`";
            LawFault::at_key("obstacle_load.moment", message, help)
        });
        let twice = moment.and_then(Gap::rotation_key).map(|key| {
            let message = "the obstacle turns by a moment or by its `rotation`, not both";
            LawFault::at_key(key, message, "delete one of them")
        });
        of_plane.into_iter().chain(twice)
    }

    /// The fault of the rotation of the obstacle of a body of this dimension: in 2D a disc or shape rotates about its centre, and a line
    /// does not rotate; in 3D a sphere or shape needs an axis, and a torus has one.
    pub fn fault_of_rotation(&self, dimension: usize) -> Option<LawFault> {
        let obstacle = self.obstacle.as_ref()?;
        let (rotation, axis) = (obstacle.rotation_key(), obstacle.given_axis().map(|(key, _)| key));
        if let Gap::Plane(_) = obstacle {
            let message = "in 2D a plane cannot rotate about its normal";
            let help = "delete it; for a belt, let `point` move along the line; for a tilting line, let `normal` depend on t";
            return rotation.filter(|_| dimension == 2).map(|key| LawFault::at_value(key, message, help));
        }
        if obstacle.is_spatial() {
            let message = format!("a {} is an obstacle in 3D only", obstacle.name());
            let help = "in 2D a `sphere` is a disc, which beside a body of revolution is a ring";
            return (dimension == 2).then(|| LawFault::at_key("obstacle", message, help));
        }
        let turning = rotation.or_else(|| self.moment().map(|_| "obstacle_load.moment".to_owned()));
        match (axis, turning) {
            (Some(axis), _) if dimension == 2 => {
                let message = format!("in 2D a {} has no axis: it rotates about its centre", obstacle.name());
                Some(LawFault::at_value(axis, message, "delete the axis"))
            }
            (None, Some(key)) if dimension == 3 => {
                let help = "add `axis = [x, y, z]`, the direction of the axis of rotation";
                Some(LawFault::at_value(key, "in 3D a rotation needs an axis", help))
            }
            (Some(axis), None) => {
                let help = "add `rotation`, or delete the axis";
                Some(LawFault::at_value(axis, "an axis without `rotation` has no effect", help))
            }
            _ => None,
        }
    }

    /// Warnings, each beginning with a key.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        let of_bonds = self.adhesion.as_ref().and_then(Adhesion::warning);
        let rotation = self.obstacle.as_ref().filter(|_| self.friction.is_none()).and_then(Gap::rotation_key);
        let rotation = rotation.map(|key| {
            format!(
                "{key}: the rotation of an obstacle affects friction only, and this contact has no friction"
            )
        });
        of_bonds.map(|words| format!("adhesion: {words}")).into_iter().chain(rotation)
    }
}
