//! The columns of the tables that a run writes, each declared once: their files, studies, `[check]` and reports read this list. Their
//! meanings are in `docs/reference-outputs.md`, which a test compares with it.

use crate::fem::effect::{ENERGIES, FIRST_OF_HEAT};

/// A column of numbers, or those of the components of a vector.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    name: &'static str,
    /// Its unit in the plane and in space.
    units: [&'static str; 2],
    /// The axes of its components in the plane and in space; none of a number.
    axes: [&'static [&'static str]; 2],
}

impl Column {
    const fn number(name: &'static str, unit: &'static str) -> Self {
        Self { name, units: [unit; 2], axes: [&[]; 2] }
    }

    const fn vector(name: &'static str, unit: &'static str) -> Self {
        Self { axes: [&["x", "y"], &["x", "y", "z"]], ..Self::number(name, unit) }
    }

    const fn tensor(name: &'static str, unit: &'static str) -> Self {
        let axes: [&[&str]; 2] = [&["xx", "yy", "zz", "xy"], &["xx", "yy", "zz", "xy", "yz", "xz"]];
        Self { axes, ..Self::number(name, unit) }
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
}

/// A table that a run writes.
#[derive(Debug)]
pub(crate) struct RunTable {
    /// Its file.
    pub file: &'static str,
    /// The word for it in the names of quantities: `history` in `history.dt`.
    pub word: &'static str,
    /// The columns that say when and of what a row is, where a step has several.
    pub keys: &'static [&'static str],
    /// The other columns, in groups that a run has or has not.
    groups: &'static [&'static [Column]],
}

/// Number of energies before the column of the imbalance in `history.csv`.
pub(super) const BEFORE_IMBALANCE: usize = 6;

const OF_ENERGIES: [Column; FIRST_OF_HEAT + 1] = {
    let mut columns = [Column::number("energy_imbalance", ""); FIRST_OF_HEAT + 1];
    let mut at = 0;
    while at < FIRST_OF_HEAT {
        let place = if at < BEFORE_IMBALANCE { at } else { at + 1 };
        columns[place] = Column::number(ENERGIES[at].column, "J").in_plane("J/m");
        at += 1;
    }
    columns
};

const OF_HEAT: [Column; ENERGIES.len() - FIRST_OF_HEAT + 1] = {
    let mut columns = [Column::number("heat_imbalance", ""); ENERGIES.len() - FIRST_OF_HEAT + 1];
    let mut at = FIRST_OF_HEAT;
    while at < ENERGIES.len() {
        columns[at - FIRST_OF_HEAT] = Column::number(ENERGIES[at].column, "J").in_plane("J/m");
        at += 1;
    }
    columns
};

/// One row per step: steps, energies, with heat its balance.
pub(crate) const HISTORY: RunTable = RunTable {
    file: "history.csv",
    word: "history",
    keys: &[],
    groups: &[
        &[
            Column::number("step", ""),
            Column::number("time", "s"),
            Column::number("dt", "s"),
            Column::number("newton_iterations", ""),
            Column::number("linear_iterations", ""),
            Column::number("active_changes", ""),
            Column::number("inclusion_residual", ""),
        ],
        &OF_ENERGIES,
        &OF_HEAT,
    ],
};

/// One row per step and source: forces and moments; of contacts areas and pressures, with friction, of an obstacle that a force moves, of
/// one that a moment turns.
pub(crate) const RESULTANTS: RunTable = RunTable {
    file: "resultants.csv",
    word: "resultant",
    keys: &["step", "time", "source"],
    groups: &[
        &[
            Column::vector("force", "N").in_plane("N/m"),
            Column { axes: [&["z"], &["x", "y", "z"]], ..Column::number("moment", "N m").in_plane("N") },
        ],
        &[
            Column::number("touching_area", "m²").in_plane("m"),
            Column::number("open_area", "m²").in_plane("m"),
            Column::number("mean_pressure", "Pa"),
            Column::number("largest_pressure", "Pa"),
        ],
        &[
            Column::number("sticking_area", "m²").in_plane("m"),
            Column::number("slipping_area", "m²").in_plane("m"),
        ],
        &[Column::number("obstacle_displacement", "m"), Column::number("obstacle_velocity", "m/s")],
        &[Column::number("obstacle_rotation", "rad"), Column::number("obstacle_angular_velocity", "rad/s")],
    ],
};

/// One row per step and probe: displacement and velocity, and a group for each [`ProbedQuantity`](crate::job::ProbedQuantity) in their order.
pub(crate) const PROBES: RunTable = RunTable {
    file: "probes.csv",
    word: "probe",
    keys: &["step", "time", "probe"],
    groups: &[
        &[Column::vector("displacement", "m"), Column::vector("velocity", "m/s")],
        &[Column::tensor("stress", "Pa")],
        &[Column::number("von_mises", "Pa")],
        &[Column { axes: [&["1", "2", "3"]; 2], ..Column::number("principal_stress", "Pa") }],
        &[Column::number("pressure", "Pa")],
        &[Column::tensor("strain", "")],
        &[Column::vector("acceleration", "m/s²")],
        &[Column::number("equivalent_viscoplastic_strain", "")],
        &[Column::number("damage", "")],
        &[Column::number("contact_pressure", "Pa")],
        &[Column::vector("contact_traction", "Pa")],
        &[Column::number("gap", "m")],
        &[Column::vector("sliding_velocity", "m/s")],
        &[Column::number("slip", "m")],
        &[Column::number("wear", "m")],
        &[Column::number("temperature", "K")],
    ],
};

/// One row per output time, profile and node: with a gap, with friction.
pub(crate) const PROFILES: RunTable = RunTable {
    file: "profiles.csv",
    word: "profile",
    keys: &["time", "profile"],
    groups: &[
        &[
            Column::vector("", "m"),
            Column::number("normal_displacement", "m"),
            Column::number("normal_velocity", "m/s"),
            Column::number("contact_pressure", "Pa"),
        ],
        &[Column::number("gap", "m")],
        &[Column::vector("friction_traction", "Pa"), Column::vector("sliding_velocity", "m/s")],
        &[Column::vector("tangential_displacement", "m")],
    ],
};

/// All tables.
const TABLES: [&RunTable; 4] = [&HISTORY, &RESULTANTS, &PROBES, &PROFILES];

impl RunTable {
    /// The table with this word.
    pub(crate) fn of(word: &str) -> Option<&'static Self> {
        TABLES.into_iter().find(|table| table.word == word)
    }

    /// The first line of its file, with these of its groups.
    pub(super) fn header(&self, dimension: usize, is_there: &[bool]) -> String {
        let columns = self.columns_of_groups(dimension, is_there);
        self.keys.iter().map(|key| (*key).to_owned()).chain(columns).collect::<Vec<_>>().join(",")
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
        let groups = self.groups.iter().zip(is_there).filter(|(_, is_there)| **is_there);
        groups.flat_map(|(group, _)| *group).flat_map(|column| column.names(dimension)).collect()
    }

    /// The unit of a column; empty for one without a unit.
    pub(crate) fn unit(&self, column: &str, dimension: usize) -> &'static str {
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
        assert!(RESULTANTS.header(3, &[true]).ends_with("force_z,moment_x,moment_y,moment_z"));
        assert!(PROFILES.header(2, &[true]).starts_with("time,profile,x,y,normal_displacement,"));
        assert_eq!(HISTORY.header(2, &[true; 2]).split(',').nth(13), Some("energy_imbalance"));
        assert_eq!((HISTORY.unit("dt", 3), RESULTANTS.unit("open_area", 2)), ("s", "m"));
    }

    #[test]
    fn the_page_of_output_files_has_each_column_with_its_unit() {
        let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reference-outputs.md"));
        let page = page.expect("the page");
        for table in TABLES {
            let (_, section) = page.split_once(&format!("## `{}`", table.file)).expect("a section");
            let rows = section.split("\n## ").next().into_iter().flat_map(str::lines);
            let mut written = Vec::new();
            for row in rows.filter(|row| row.starts_with("| `")) {
                let cells: Vec<&str> = row.split('|').map(str::trim).collect();
                let names = cells[1].split('`').skip(1).step_by(2);
                let units: Vec<&str> =
                    cells[2].split(',').map(|unit| unit.trim().trim_matches('1')).collect();
                let unit = |at: usize| *units.get(at).unwrap_or(&units[0]);
                written.extend(names.enumerate().map(|(at, name)| (name.to_owned(), unit(at))));
            }
            let keys = table.keys.iter().map(|key| (key.to_string(), if *key == "time" { "s" } else { "" }));
            let mut declared: Vec<_> = table.columns(3).chain(keys).collect();
            written.sort();
            declared.sort();
            assert_eq!(written, declared, "columns of {} on the page and in the code", table.file);
        }
    }
}
