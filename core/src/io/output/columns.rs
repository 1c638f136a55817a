//! The columns of the tables that a run writes, each declared once with its unit and its meaning: their files, studies, `[check]`,
//! reports, `solver describe outputs` and the page of output files read this list.

use super::declared::Declared;
use crate::fem::effect::{ENERGIES, FIRST_OF_HEAT};

/// A column of numbers or words, or those of the components of a vector.
#[derive(Debug, Clone, Copy)]
pub struct Column {
    /// Its name; that of a vector is the part before the axes.
    pub name: &'static str,
    /// Its unit in the plane and in space.
    units: [&'static str; 2],
    /// The axes of its components in the plane and in space; none of a number.
    axes: [&'static [&'static str]; 2],
    /// What it means, in Markdown.
    meaning: &'static str,
}

impl Column {
    /// A number, or a word, which has no unit.
    pub const fn plain(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self { name, units: [unit; 2], axes: [&[]; 2], meaning }
    }

    const fn vector(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self { axes: [&["x", "y"], &["x", "y", "z"]], ..Self::plain(name, unit, meaning) }
    }

    const fn tensor(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        let axes: [&[&str]; 2] = [&["xx", "yy", "zz", "xy"], &["xx", "yy", "zz", "xy", "yz", "xz"]];
        Self { axes, ..Self::plain(name, unit, meaning) }
    }

    /// The same with another unit in the plane.
    const fn in_plane(self, unit: &'static str) -> Self {
        Self { units: [unit, self.units[1]], ..self }
    }

    fn names(&self, dimension: usize) -> Vec<String> {
        match self.axes[dimension - 2] {
            [] => vec![self.name.to_owned()],
            axes if self.name.is_empty() => axes.iter().map(|axis| (*axis).to_owned()).collect(),
            axes => axes.iter().map(|axis| format!("{}_{axis}", self.name)).collect(),
        }
    }

    /// Its declaration, for those who read the files.
    pub fn declared(&self) -> Declared {
        let [plane, space] = [2, 3].map(|dimension| self.names(dimension));
        let only_in_space = space.iter().filter(|name| !plane.contains(name)).cloned().collect();
        Declared { units: self.units, only_in_space, ..Declared::new(space, self.meaning) }
    }
}

/// A table that a run writes.
#[derive(Debug)]
pub struct RunTable {
    /// Its file.
    pub file: &'static str,
    /// The word for it in the names of quantities: `history` in `history.dt`.
    pub word: &'static str,
    /// What has a row, in Markdown.
    pub rows: &'static str,
    /// The columns that say when and of what a row is, where a step has several.
    pub keys: &'static [Column],
    /// The other columns, in groups that a run has or has not.
    groups: &'static [&'static [Column]],
}

/// Number of energies before the column of the imbalance in `history.csv`.
pub(super) const BEFORE_IMBALANCE: usize = 6;

/// The column of an energy, by its position.
const fn of_energy(at: usize) -> Column {
    Column::plain(ENERGIES[at].column, "J", ENERGIES[at].meaning).in_plane("J/m")
}

const OF_ENERGIES: [Column; FIRST_OF_HEAT + 1] = {
    let imbalance = Column::plain(
        "energy_imbalance",
        "",
        "error of the energy balance of the step beyond rounding errors of a body without mass that moves without strain, relative to the \
         largest energy exchanged so far",
    );
    let mut columns = [imbalance; FIRST_OF_HEAT + 1];
    let mut at = 0;
    while at < FIRST_OF_HEAT {
        columns[if at < BEFORE_IMBALANCE { at } else { at + 1 }] = of_energy(at);
        at += 1;
    }
    columns
};

const OF_HEAT: [Column; ENERGIES.len() - FIRST_OF_HEAT + 2] = {
    let meaning = "imbalance of the heat of the step beyond rounding errors of what conduction and convection pass on, as a share of the \
                   largest of these heats so far";
    let imbalance = Column::plain("heat_imbalance", "", meaning);
    let mean = Column::plain(
        "mean_temperature",
        "K",
        "mean temperature of all bodies, weighted by their heat capacity",
    );
    let mut columns = [imbalance; ENERGIES.len() - FIRST_OF_HEAT + 2];
    columns[ENERGIES.len() - FIRST_OF_HEAT + 1] = mean;
    let mut at = FIRST_OF_HEAT;
    while at < ENERGIES.len() {
        columns[at - FIRST_OF_HEAT] = of_energy(at);
        at += 1;
    }
    columns
};

/// Steps, energies, with heat its balance.
pub const HISTORY: RunTable = RunTable {
    file: "history.csv",
    word: "history",
    rows: "A row for each step, none for time 0.",
    keys: &[],
    groups: &[
        &[
            Column::plain("step", "", "number of the step, from 1"),
            Column::plain("time", "s", "time at the end of the step"),
            Column::plain("dt", "s", "length of the step"),
            Column::plain(
                "newton_iterations",
                "",
                "Newton iterations of all attempts at the step, also those that failed or whose step was too long; 0 if the equations \
                 of the step are linear",
            ),
            Column::plain("linear_iterations", "", "iterations of the linear solver in all these attempts"),
            Column::plain("active_changes", "", "contact points that changed branch in the step"),
            Column::plain(
                "inclusion_residual",
                "",
                "largest distance of normal velocity and pressure, and of sliding velocity and friction, from the graphs of their laws, \
                 scaled by the ranges of the laws; at most `[solver] inclusion_tolerance`",
            ),
        ],
        &OF_ENERGIES,
        &OF_HEAT,
    ],
};

/// Forces and moments; of contacts areas and pressures, with friction, of an obstacle that a force moves, of one that a moment turns.
pub const RESULTANTS: RunTable = RunTable {
    file: "resultants.csv",
    word: "resultant",
    rows: "A row for each step and source. The columns of areas and pressures exist if the job has a contact; they are empty for other \
           sources.",
    keys: &[
        Column::plain("step", "", "number of the step"),
        Column::plain(
            "time",
            "s",
            "time at which the forces of the step are balanced: its end, under `midpoint` its middle",
        ),
        Column::plain(
            "source",
            "",
            "`support left`, `contact bottom`, `against top` (what a contact between bodies does to the other body; on a fault `other side \
             of fault`), `traction top`, `body_force`, `damping` (by the mass) or `momentum` (the rate of change of momentum, which is the \
             sum of all forces)",
        ),
    ],
    groups: &[
        &[
            Column::vector("force", "N", "force on the body").in_plane("N/m"),
            Column {
                axes: [&["z"], &["x", "y", "z"]],
                ..Column::plain(
                    "moment",
                    "N m",
                    "moment about the origin or the point of `[output] moments_about`, in the undeformed configuration; 0 of bodies of \
                     revolution. Forces between bodies act at the nodes of both sides: `contact` and `against` balance but for friction \
                     times the distance between the surfaces, that of meshes of curved surfaces that do not match, too, and for the \
                     pressure times the distance of sliding",
                )
                .in_plane("N")
            },
        ],
        &[
            Column::plain(
                "touching_area",
                "m²",
                "area with contact pressure",
            )
            .in_plane("m"),
            Column::plain("open_area", "m²", "area without contact pressure").in_plane("m"),
            Column::plain("mean_pressure", "Pa", "contact pressure, mean over `touching_area`"),
            Column::plain("largest_pressure", "Pa", "largest contact pressure"),
        ],
        &[
            Column::plain("sticking_area", "m²", "part of `touching_area` that sticks; only with friction")
                .in_plane("m"),
            Column::plain("slipping_area", "m²", "part of `touching_area` that slips; only with friction")
                .in_plane("m"),
        ],
        &[
            Column::plain(
                "obstacle_displacement",
                "m",
                "displacement of the obstacle at this time along the direction of its `obstacle_load`, in addition to the motion prescribed \
                 by its expressions; only if the job has one",
            ),
            Column::plain("obstacle_velocity", "m/s", "its velocity, likewise"),
        ],
        &[
            Column::plain(
                "obstacle_rotation",
                "rad",
                "rotation of an obstacle that a moment turns (`obstacle_load.moment`), counterclockwise; only if the job has one",
            ),
            Column::plain("obstacle_angular_velocity", "rad/s", "its angular velocity"),
        ],
    ],
};

/// Displacement and velocity, and a group for each [`ProbedQuantity`](crate::job::ProbedQuantity) in their order.
pub const PROBES: RunTable = RunTable {
    file: "probes.csv",
    word: "probe",
    rows: "A row for each step and probe. The columns after the velocity are those that `[output] probe_also` names.",
    keys: &[
        Column::plain("step", "", "number of the step, from 1"),
        Column::plain("time", "s", "time at the end of the step"),
        Column::plain("probe", "", "name of the probe"),
    ],
    groups: &[
        &[
            Column::vector("displacement", "m", "displacement, interpolated in the cell"),
            Column::vector("velocity", "m/s", "velocity"),
        ],
        &[Column::tensor(
            "stress",
            "Pa",
            "stress of the cell around the probe, as all quantities of cells below",
        )],
        &[Column::plain("von_mises", "Pa", "von Mises norm of the stress")],
        &[Column {
            axes: [&["1", "2", "3"]; 2],
            ..Column::plain("principal_stress", "Pa", "principal stresses, the largest first")
        }],
        &[Column::plain("pressure", "Pa", "minus the mean normal stress")],
        &[Column::tensor("strain", "", "components of the strain tensor, without a factor on shear")],
        &[Column::vector(
            "acceleration",
            "m/s²",
            "acceleration in the equations of the step, at the time at which they hold; interpolated, as all quantities of nodes",
        )],
        &[Column::plain(
            "equivalent_viscoplastic_strain",
            "",
            "accumulated equivalent viscoplastic strain: by work with hardening, otherwise of the strain rate (docs/conventions.md)",
        )],
        &[Column::plain("damage", "", "damage")],
        &[Column::plain(
            "contact_pressure",
            "Pa",
            "contact pressure; 0 off the contact boundaries, as all quantities of contact below",
        )],
        &[Column::vector("contact_traction", "Pa", "contact traction")],
        &[Column::plain("gap", "m", "distance to the obstacle along the normal")],
        &[Column::vector("sliding_velocity", "m/s", "velocity relative to the obstacle along the boundary")],
        &[Column::plain("slip", "m", "accumulated slip distance relative to the obstacle")],
        &[Column::plain("wear", "m", "depth of wear")],
        &[Column::plain("temperature", "K", "temperature")],
    ],
};

/// Displacements, velocities and pressures: with a gap, with friction.
pub const PROFILES: RunTable = RunTable {
    file: "profiles.csv",
    word: "profile",
    rows: "A row for each output time, profile and node of its boundary, sorted by coordinates. A node on an edge between facets of \
           different directions has a row for each direction.",
    keys: &[Column::plain("time", "s", "time"), Column::plain("profile", "", "name of the boundary")],
    groups: &[
        &[
            Column::vector("", "m", "undeformed position"),
            Column::plain(
                "normal_displacement",
                "m",
                "displacement along the outward normal of the undeformed boundary",
            ),
            Column::plain("normal_velocity", "m/s", "velocity along this normal"),
            Column::plain(
                "contact_pressure",
                "Pa",
                "minus the normal stress: on a contact boundary, on either side of contact between bodies, the solution of the step; \
                 elsewhere the mean of the facets around the node",
            ),
        ],
        &[Column::plain(
            "gap",
            "m",
            "distance to the obstacle, negative in penetration, as the field `gap`; `inf` where the normal does not intersect the obstacle, \
             empty where the node belongs to no contact. Only if a profile has a contact law of the displacement",
        )],
        &[
            Column::vector(
                "friction_traction",
                "Pa",
                "minus the tangential stress vector; only if a profile has friction",
            ),
            Column::vector(
                "sliding_velocity",
                "m/s",
                "velocity along the boundary relative to the obstacle; only if a profile has friction",
            ),
        ],
        &[Column::plain(
            "slip",
            "m",
            "accumulated slip distance relative to the obstacle; only if a profile has friction that depends on it, or with `[output] also` \
             or `probe_also`",
        )],
        &[Column::vector("tangential_displacement", "m", "displacement without its normal component")],
    ],
};

/// All tables.
pub const TABLES: [&RunTable; 4] = [&HISTORY, &RESULTANTS, &PROBES, &PROFILES];

impl RunTable {
    /// The table with this word.
    pub fn of(word: &str) -> Option<&'static Self> {
        TABLES.into_iter().find(|table| table.word == word)
    }

    /// Whether this column says when or of what a row is.
    pub fn is_key(&self, name: &str) -> bool {
        self.keys.iter().any(|key| key.name == name)
    }

    /// All columns with their meanings, in the order of the file.
    pub fn declared(&self) -> Vec<Declared> {
        let columns = self.keys.iter().chain(self.groups.iter().flat_map(|group| *group));
        columns.map(Column::declared).collect()
    }

    /// The first line of its file, with these of its groups.
    pub(super) fn header(&self, dimension: usize, is_there: &[bool]) -> String {
        let columns = self.columns_of_groups(dimension, is_there);
        self.keys.iter().map(|key| key.name.to_owned()).chain(columns).collect::<Vec<_>>().join(",")
    }

    /// All columns of numbers with their units.
    pub(crate) fn columns(&self, dimension: usize) -> impl Iterator<Item = (String, &'static str)> {
        let columns = self.groups.iter().flat_map(|group| *group);
        columns.flat_map(move |column| {
            column.names(dimension).into_iter().map(move |name| (name, column.units[dimension - 2]))
        })
    }

    /// The columns of numbers in these of its groups.
    pub(super) fn columns_of_groups(&self, dimension: usize, is_there: &[bool]) -> Vec<String> {
        assert_eq!(is_there.len(), self.groups.len(), "each group is there or not");
        let groups = self.groups.iter().zip(is_there).filter(|(_, is_there)| **is_there);
        groups.flat_map(|(group, _)| *group).flat_map(|column| column.names(dimension)).collect()
    }

    /// The unit of a column; empty for one without a unit.
    pub fn unit(&self, column: &str, dimension: usize) -> &'static str {
        self.columns(dimension).find(|(name, _)| name == column).map_or("", |(_, unit)| unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_have_the_columns_of_the_dimension_and_of_the_run() {
        assert_eq!(
            RESULTANTS.header(2, &[true, false, true, false, false]),
            "step,time,source,force_x,force_y,moment_z,sticking_area,slipping_area"
        );
        assert!(
            RESULTANTS
                .header(3, &[true, false, false, false, false])
                .ends_with("force_z,moment_x,moment_y,moment_z")
        );
        assert!(
            PROFILES
                .header(2, &[true, false, false, false, false])
                .starts_with("time,profile,x,y,normal_displacement,")
        );
        assert_eq!(HISTORY.header(2, &[true, true, false]).split(',').nth(13), Some("energy_imbalance"));
        assert_eq!((HISTORY.unit("dt", 3), RESULTANTS.unit("open_area", 2)), ("s", "m"));
    }
}
