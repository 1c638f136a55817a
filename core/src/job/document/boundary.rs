//! `[[support]]`, `[[traction]]`, `[[body_force]]` and `[initial]`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::job::Scalar;
use crate::job::findings::{MeshNames, Table};
use crate::laws::material::Hypothesis;

/// A support: boundaries with fixed or prescribed components of the displacement, or with springs and dashpots. A support has
/// `fix`, or one or more of `stiffness`, `damping` and `absorbing`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "boundary, boundary condition, constraint, clamp, Dirichlet"))]
pub struct Support {
    /// The names of the boundaries; with `fix` also of points and, in 3D, curves that have a name in the mesh file.
    #[schemars(length(min = 1), extend("also" = "boundary, surface, sideset"), example = ["left"])]
    pub on: Vec<String>,
    /// The part of these boundaries to which the support applies: with `fix` the nodes at which this expression in x, y, z is not
    /// 0, for example the nodes of an edge, or a single node; otherwise the facets at whose centre it is not 0. A product of
    /// conditions holds where all hold, their `max` where one holds. With fix = "normal" a node on an edge of the body is held along the
    /// normals of those faces of which the part has whole facets. What is held ends at the last node: where the facets that a support with `fix`
    /// holds as a whole have an area that differs by more than 10 % from that of the part, it is warned of. Absent: the whole boundaries.
    #[serde(default, skip_serializing_if = "Option::is_none", rename = "where")]
    #[schemars(extend("variables" = "x, y, z"), example = "x < 1", example = "hypot(x - 1, y) < 1e-6", example = "(x > 1)*(x < 2)")]
    pub part: Option<Scalar>,
    /// The components of the displacement that the support determines: "all", "normal" or a list of axes. They keep their initial
    /// values, unless `displacement` or `velocity` moves them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"all", example = ["x"])]
    pub fix: Option<Fix>,
    /// The displacement of the fixed components, one number or expression in t, x, y, z for each of them: in the order of the list
    /// `fix`, along x, y, z for "all", one along the outward normal for "normal". At time 0 it replaces the initial displacement;
    /// after `initial.from` it applies from the end of the first step. The work of the support is part of `external_work`. Absent:
    /// the components do not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("also" = "displacement control, prescribed displacement", "unit" = "m"), example = ["0.01*min(t/0.1, 1)"])]
    pub displacement: Option<Vec<Scalar>>,
    /// The velocity of the fixed components, in place of `displacement`. Without inertia they move by its integral over each step, whatever the
    /// length of the step; with inertia by the velocity at its end, which adaptive steps keep near its mean.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("also" = "earthquake, shaking, base motion, seismic, prescribed velocity", "unit" = "m/s"), example = [0.02])]
    pub velocity: Option<Vec<Scalar>>,
    /// Springs to the ground, per area: the traction on the body is minus the stiffness times the displacement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "Pa/m"))]
    pub stiffness: Option<Resistance>,
    /// Dashpots to the ground, per area: the traction on the body is minus the damping times the velocity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "Pa s/m"))]
    pub damping: Option<Resistance>,
    /// Whether the boundary absorbs waves. The dashpots are those of Lysmer and Kuhlemeyer (1969):
    /// density times the speed of pressure waves along the normal, density times the speed of shear waves along the boundary, of
    /// the elastic material behind the boundary. Waves at normal incidence are absorbed completely.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub absorbing: bool,
}

fn is_zero(value: &Scalar) -> bool {
    *value == Scalar::default()
}

/// A stiffness or a damping per area, along the normal of a boundary and along the boundary.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resistance {
    /// Along the normal.
    #[serde(default)]
    #[schemars(range(min = 0), example = 1e8)]
    pub normal: f64,
    /// Along the boundary.
    #[serde(default)]
    #[schemars(range(min = 0), example = 1e7)]
    pub tangential: f64,
}

/// The components of the displacement that a support holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Fix {
    /// All components, or the normal one.
    Keyword(FixedDirections),
    /// The components along the listed axes.
    Axes(#[schemars(length(min = 1))] Vec<Axis>),
}

/// A set of components that has a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FixedDirections {
    /// All components.
    All,
    /// The normal component. Where the boundary is curved, a node has the mean normal of the adjacent facets; where their normals
    /// differ by more than 40 degrees, it is fixed along each of them.
    Normal,
}

/// An axis of the coordinate system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// The x axis.
    X,
    /// The y axis.
    Y,
    /// The z axis, in 3D only.
    Z,
}

impl Axis {
    /// 0 for x, 1 for y, 2 for z.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A traction, which is a force per area, on boundaries. If several apply to the same boundary, they are added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Traction {
    /// The names of the boundaries.
    #[schemars(length(min = 1), example = ["top"])]
    pub on: Vec<String>,
    /// The part of these boundaries that is loaded: the facets at whose centre, the mean of their corners, this expression in x, y, z
    /// is not 0. A facet is loaded as a whole or not at all; `solver check` prints the loaded area. A product of conditions holds
    /// where all hold, their `max` where one holds. Absent: the whole boundaries.
    #[serde(default, skip_serializing_if = "Option::is_none", rename = "where")]
    #[schemars(extend("variables" = "x, y, z"), example = "x > 0.5", example = "(x > 1)*(x < 2)")]
    pub part: Option<Scalar>,
    /// The force per area on the body, one component per axis: numbers, or expressions in the time t and the undeformed coordinates
    /// x, y, z, integrated by their values at points within the facets.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("also" = "load, distributed load, surface load, Neumann, ramp, blast, explosion", "unit" = "Pa"), example = [0.0, -10.0], example = ["0", "-10*min(t/0.1, 1)"])]
    pub value: Vec<Scalar>,
    /// A pressure on the undeformed boundary, against its outward normal, in place of `value`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "Pa"), example = 1e5, example = "1e5*pulse(t, 0, 0.01)")]
    pub pressure: Option<Scalar>,
}

/// Gravity: a force per volume of the density of each material times this acceleration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gravity {
    /// The acceleration, one component per axis: numbers, or expressions in the time t and the undeformed coordinates x, y, z.
    #[schemars(extend("also" = "weight, self-weight, dead load", "unit" = "m/s^2"), example = [0.0, -9.81])]
    pub acceleration: Vec<Scalar>,
}

/// A force per volume on the whole body. If there are several, they are added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyForce {
    /// The force per volume on the body, one component per axis: numbers, or expressions in the time t and the undeformed
    /// coordinates x, y, z.
    #[schemars(extend("unit" = "N/m^d"), example = [0.0, -9.81])]
    pub value: Vec<Scalar>,
}

/// The state at time 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Initial {
    /// The last state of another run, from which this one starts at time 0: a checkpoint, or an output folder for its newest
    /// checkpoint. The mesh must be the same; loads, supports, contacts, laws and scheme may differ. Histories that this job does
    /// not have are dropped, those that only this job has start from their initial values; the log names both. Components held by
    /// supports keep the saved displacement; supports with `stiffness`, `damping` or `absorbing` take over the reactions of those that
    /// they replace, as constant forces. Obstacles moved by forces continue their motion if the boundaries of the
    /// contact, its `where` and the direction of the motion are the same. A prescribed initial stress is not part of the state:
    /// repeat `stress`. Not together with `displacement` and `velocity`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"), example = "out/first_stage", example = "out/first_stage/checkpoint-64.h5")]
    pub from: Option<PathBuf>,
    /// What starts anew in the state of `from`, whose time is 0 in any case.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["displacement"])]
    pub reset: Vec<Reset>,
    /// The displacement at time 0, one component per axis: numbers, or expressions in the undeformed coordinates x, y, z. Absent:
    /// zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "m"), example = [0.0, 0.0])]
    pub displacement: Option<Vec<Scalar>>,
    /// The velocity at time 0, one component per axis: numbers, or expressions in the undeformed coordinates x, y, z. Absent: zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "m/s"), example = [0.0, 0.0])]
    pub velocity: Option<Vec<Scalar>>,
    /// The temperature at time 0: a number, or an expression in the undeformed coordinates x, y, z; required with [material.heat]. With
    /// `from` the temperature of that state takes its place, if it has one. Absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "K"), example = 293.0)]
    pub temperature: Option<Scalar>,
    /// The elastic stress at displacement zero of all materials with elasticity: the values at the centre of each linear cell, and at
    /// the three quadrature points (in 3D four) of each quadratic one. Viscoplastic flow relaxes it; with `from` the saved history of
    /// these materials takes its place. Absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stress: Option<InitialStress>,
}

/// A part of the state of another run that may start anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reset {
    /// Displacements count from the start state: displacement and strain are 0 there in fields, probes and profiles, and a support
    /// with `displacement` moves by its value from where it is. Body, obstacles and springs remain where they are, so that
    /// stresses, gaps, forces, bonds, friction and all histories go on unchanged. `gap` and `max_strain` are still those of the whole
    /// deformation.
    Displacement,
}

/// The components of the initial stress: numbers, or expressions in the undeformed coordinates x, y, z; positive in tension.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InitialStress {
    /// The component xx.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa"), example = -1e5)]
    pub xx: Scalar,
    /// The component yy.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa"), example = "-2e4*(10 - y)")]
    pub yy: Scalar,
    /// The component zz; not in plane stress.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa"))]
    pub zz: Scalar,
    /// The component xy.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa"))]
    pub xy: Scalar,
    /// The component yz; in 3D only.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa"))]
    pub yz: Scalar,
    /// The component xz; in 3D only.
    #[serde(skip_serializing_if = "is_zero")]
    #[schemars(extend("variables" = "x, y, z", "unit" = "Pa"))]
    pub xz: Scalar,
}

impl Fix {
    /// The number of components that are fixed in a body of this dimension.
    fn count(&self, dimension: usize) -> usize {
        match self {
            Self::Keyword(FixedDirections::All) => dimension,
            Self::Keyword(FixedDirections::Normal) => 1,
            Self::Axes(axes) => axes.len(),
        }
    }

    fn axes(&self) -> &[Axis] {
        if let Self::Axes(axes) = self { axes } else { &[] }
    }

    /// Whether all components are fixed in a body of this dimension.
    fn is_complete(&self, dimension: usize) -> bool {
        let axes = [Axis::X, Axis::Y, Axis::Z];
        *self == Self::Keyword(FixedDirections::All)
            || axes[..dimension].iter().all(|axis| self.axes().contains(axis))
    }
}

impl Support {
    /// Whether no component of its whole boundaries is free in a body of this dimension.
    pub(in crate::job) fn holds_all(&self, dimension: usize) -> bool {
        self.part.is_none() && self.fix.as_ref().is_some_and(|fix| fix.is_complete(dimension))
    }

    /// Whether it moves the components that it fixes, by which key.
    pub(in crate::job) fn motions(&self) -> impl Iterator<Item = (&'static str, &[Scalar])> {
        let motions = [("displacement", &self.displacement), ("velocity", &self.velocity)];
        motions.into_iter().filter_map(|(key, values)| Some((key, values.as_deref()?)))
    }

    /// Whether it gives way: springs and dashpots act on its area.
    pub fn gives_way(&self) -> bool {
        self.stiffness.is_some() || self.damping.is_some() || self.absorbing
    }

    /// A support either determines components or gives way.
    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        table.refuse_repeats("on", "boundary");
        table.refuse_repeats("fix", "axis");
        let gives = [
            ("stiffness", self.stiffness.is_some()),
            ("damping", self.damping.is_some()),
            ("absorbing", self.absorbing),
        ];
        match (&self.fix, gives.into_iter().find(|(_, gives)| *gives)) {
            (Some(_), Some((key, _))) => {
                let help = "give springs and dashpots a [[support]] of their own";
                table.fault_at_key(key, format!("a support with `fix` can't have `{key}`"), help);
            }
            (None, None) => {
                let help =
                    "add fix = \"all\", or stiffness, damping or absorbing for a support that gives way";
                table.fault("", "this support has neither `fix` nor springs or dashpots", help);
            }
            _ => {}
        }
        for (key, _) in self.motions().filter(|_| self.fix.is_none()) {
            let message = format!("`{key}` moves the components of `fix`, which is absent");
            table.fault_at_key(key, message, "add `fix`");
        }
        if self.motions().count() == 2 {
            let message = "a support has a displacement or a velocity, not both";
            table.fault_at_key("velocity", message, "delete one");
        }
    }

    /// A motion has one value for each component that the support determines.
    pub(in crate::job) fn check_names(&self, table: &mut Table<'_>, mesh: MeshNames<'_>) {
        check_on(table, &self.on, self.fix.as_ref(), mesh);
        table.check_flat("where", self.part.as_ref(), mesh.dimension);
        let Some(fix) = self.fix.as_ref().filter(|_| !table.is_unread("fix")) else { return };
        let needed = fix.count(mesh.dimension);
        for (key, values) in self.motions() {
            if values.len() != needed {
                let (path, count) = (table.path(key), values.len());
                let message = format!("`{path}` has {count} value(s), but `fix` has {needed} component(s)");
                table.fault(key, message, "give one value for each component, in the order of `fix`");
            }
            for (index, value) in values.iter().enumerate() {
                table.check_flat(&format!("{key}.{index}"), value, mesh.dimension);
            }
        }
        for (index, _) in fix.axes().iter().enumerate().filter(|(_, axis)| axis.index() >= mesh.dimension) {
            table.fault(&format!("fix.{index}"), "a 2D body has no z component", "allowed: x, y");
        }
    }
}

/// Checks the names in the list `on` of a table. All tables may name boundaries, supports that hold nodes also points and curves.
pub(in crate::job) fn check_on(table: &mut Table<'_>, on: &[String], fix: Option<&Fix>, mesh: MeshNames<'_>) {
    for (index, name) in on.iter().enumerate() {
        let (key, name) = (format!("on.{index}"), name.as_str());
        let what = "is the name of points or curves";
        if mesh.boundaries.contains(&name) || !mesh.points.contains(&name) {
            let points = if fix.is_some() { mesh.points } else { &[] };
            table.check_place(&key, name, mesh, points);
        } else if fix.is_none() {
            let message = format!("\"{name}\" {what}: only a support with `fix` acts on them");
            table.fault(&key, message, "name a boundary");
        } else if fix == Some(&Fix::Keyword(FixedDirections::Normal)) {
            let message = format!("\"{name}\" {what}, which have no normal");
            table.fault(&key, message, "fix all components or a list of axes");
        }
    }
}

impl Traction {
    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        table.refuse_repeats("on", "boundary");
        match (table.has("value"), &self.pressure) {
            (true, Some(_)) => {
                let help = "delete one, or write two tables";
                table.fault_at_key("pressure", "a traction has a value or a pressure, not both", help);
            }
            (true, None) if self.value.is_empty() => {
                let help = "give a number or an expression for each axis";
                table.fault("value", "this value has no components", help);
            }
            (false, None) => {
                let help = "add value = [..], or pressure = .. against the normal";
                table.fault("", "this traction has neither `value` nor `pressure`", help);
            }
            _ => {}
        }
    }

    pub(in crate::job) fn check_names(&self, table: &mut Table<'_>, mesh: MeshNames<'_>) {
        check_on(table, &self.on, None, mesh);
        table.check_flat("where", self.part.as_ref(), mesh.dimension);
        table.check_vector("value", &self.value, mesh.dimension);
        table.check_flat("pressure", self.pressure.as_ref(), mesh.dimension);
    }
}

impl Initial {
    /// The vectors at time 0 that are given.
    fn vectors(&self) -> impl Iterator<Item = (&'static str, &[Scalar])> {
        let vectors = [("displacement", &self.displacement), ("velocity", &self.velocity)];
        vectors.into_iter().filter_map(|(key, vector)| Some((key, vector.as_deref()?)))
    }

    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        for (key, _) in self.vectors().filter(|_| self.from.is_some()) {
            table.fault_at_key(key, "`from` gives the whole initial state", "delete this key, or `from`");
        }
        table.refuse_repeats("reset", "item");
        if self.from.is_none() && !self.reset.is_empty() {
            let message = "`reset` is about the state of another run, which `from` names";
            table.fault_at_key("reset", message, "add `from`, or delete this key");
        }
    }

    /// Checks vectors and the initial stress, which has the components of the dimension.
    pub(in crate::job) fn check_in_body(
        &self,
        table: &mut Table<'_>,
        (dimension, hypothesis): (usize, Option<Hypothesis>),
    ) {
        for (key, vector) in self.vectors() {
            table.check_vector(key, vector, dimension);
        }
        table.check_flat("temperature", self.temperature.as_ref(), dimension);
        let Some(InitialStress { xx, yy, zz, xy, yz, xz }) = &self.stress else { return };
        let absent: &[&str] = match (dimension, hypothesis) {
            (2, Some(Hypothesis::PlaneStress)) => &["zz", "yz", "xz"],
            (2, _) => &["yz", "xz"],
            _ => &[],
        };
        for (component, value) in [("xx", xx), ("yy", yy), ("zz", zz), ("xy", xy), ("yz", yz), ("xz", xz)] {
            let key = format!("stress.{component}");
            table.check_flat(&key, value, dimension);
            if absent.contains(&component) && table.has(&key) {
                table.fault_at_key(&key, format!("this body has no stress {component}"), "delete it");
            }
        }
    }
}
