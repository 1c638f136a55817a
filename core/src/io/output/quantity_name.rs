//! Names of quantities of a run, as in `[check]` of a job and in responses of a study.

use super::{
    columns::{PROBES, RunTable, TABLES},
    summary::{MEMBERS, MemberKind},
};
use crate::{job::Job, laws::nearest::nearest};

pub use super::resultants::source_names;

/// What is formed of the values of a run.
const OVER_TIME: [&str; 6] = ["max", "min", "mean", "amplitude", "period", "arrival"];

/// A quantity of a table, by its name.
pub struct TableQuantity<'a> {
    /// The table.
    pub table: &'static RunTable,
    /// The probe, source or boundary, which may contain dots; absent for a table without names.
    pub of: Option<&'a str>,
    /// The extremum, `mean`, `amplitude`, `period`, `arrival` or `first`.
    pub side: Option<&'a str>,
    /// The column.
    pub column: &'a str,
}

impl<'a> TableQuantity<'a> {
    /// The parts of `TABLE.NAME.COLUMN` or `TABLE.NAME.SIDE.COLUMN`, in tables without names those without `NAME`.
    pub fn parse(name: &'a str) -> Option<Self> {
        let (word, rest) = name.split_once('.')?;
        let table = RunTable::of(word)?;
        let (before, column) = rest.rsplit_once('.').unwrap_or(("", rest));
        let (of, side) = match before.rsplit_once('.') {
            _ if table.keys.is_empty() => (None, Some(before).filter(|side| !side.is_empty())),
            Some((of, side)) if side == "first" || OVER_TIME.contains(&side) => (Some(of), Some(side)),
            _ => (Some(before), None),
        };
        Some(Self { table, of, side, column })
    }

    /// Whether there may be a name, and the table has this side.
    fn has_form(&self) -> bool {
        let has_side = match self.side {
            None => self.table.word != "profile",
            Some(side) if self.table.word == "profile" => ["max", "min", "first"].contains(&side),
            Some(side) => OVER_TIME.contains(&side),
        };
        has_side && self.of != Some("")
    }
}

/// What names a quantity.
const FORMS: &str = "a number of summary.json, history.COLUMN, probe.NAME.COLUMN, probe.NAME.max.COLUMN, \
                     resultant.SOURCE.COLUMN or profile.BOUNDARY.max.COLUMN (also history.max.COLUMN and \
                     resultant.SOURCE.max.COLUMN; .min., .mean., .amplitude., .period. or .arrival. in place of .max., of profiles .min. or .first.)";

/// A job whose runs have quantities.
#[derive(Clone, Copy)]
pub struct RunOf<'a> {
    /// The job.
    pub job: &'a Job,
    /// What messages call it: `the job`.
    pub called: &'a str,
    /// The dimension of its body, 2 or 3.
    pub dimension: usize,
}

impl RunOf<'_> {
    /// What is wrong with the name of a quantity: messages with advice. A quantity has a known form, a probe, source or profile of the job, and
    /// a column of its table that the job has.
    pub fn faults_of_name(&self, name: &str) -> Vec<[String; 2]> {
        let Some(quantity) = TableQuantity::parse(name) else {
            let with_columns = |[message, help]: [String; 2]| [message, self.columns_called(name) + &help];
            return self.fault_of_number(name).map(with_columns).into_iter().collect();
        };
        if !quantity.has_form() {
            return vec![no_quantity(name)];
        }
        let of = quantity.of.and_then(|of| self.fault_of_place(quantity.table.word, of));
        of.into_iter().chain(self.fault_of_column(quantity.table, quantity.column, name)).collect()
    }

    /// How to name the columns of tables that are called like the last part of this name, as advice.
    fn columns_called(&self, name: &str) -> String {
        let column = name.rsplit('.').next().unwrap_or(name);
        let has = |table: &&&RunTable| table.columns(self.dimension).any(|(known, _)| known == column);
        let forms: Vec<String> = TABLES
            .iter()
            .filter(has)
            .map(|table| match table.word {
                "profile" => format!("`profile.BOUNDARY.max.{column}`"),
                "resultant" => format!("`resultant.SOURCE.{column}`"),
                word if table.keys.is_empty() => format!("`{word}.{column}`"),
                word => format!("`{word}.NAME.{column}`"),
            })
            .collect();
        if forms.is_empty() { String::new() } else { format!("`{column}` is {}; ", forms.join(" or ")) }
    }

    /// What is wrong with a column of a table in the name of a quantity.
    fn fault_of_column(&self, table: &RunTable, column: &str, name: &str) -> Option<[String; 2]> {
        let there = table.columns_of_groups(self.dimension, &self.groups(table.word));
        if there.iter().any(|known| known == column) {
            return None;
        }
        if table.columns(self.dimension).all(|(known, _)| known != column) {
            return Some(unknown(name, column, &there));
        }
        let asked = (table.word == "probe").then(|| super::probed::quantity_of(column, self.dimension));
        let ask = asked.flatten().map_or(String::new(), |quantity| {
            format!("; or add {quantity} to `probe_also` in its table [output]")
        });
        let help = format!("it may be {}{ask}", there.join(", "));
        Some([format!("{} has nothing that gives `{name}` a value", self.called), help])
    }

    /// What is wrong with the name of a probe, and with a column of `probes.csv`.
    pub fn faults_of_probe(&self, probe: &str, column: &str) -> [Option<[String; 2]>; 2] {
        [self.fault_of_place(PROBES.word, probe), self.fault_of_column(&PROBES, column, column)]
    }

    /// The groups of columns of a table that a run has, as far as the job says.
    fn groups(&self, word: &str) -> Vec<bool> {
        let contacts = &self.job.contact;
        match word {
            "resultant" => super::resultants::groups(self.job).to_vec(),
            "profile" => {
                let has_gap = contacts.iter().any(|contact| contact.normal.has_gap());
                let friction = || contacts.iter().flat_map(|contact| &contact.friction);
                let asks_for_slip = self.job.output.asks_for_slip();
                let slip = friction().any(|law| asks_for_slip || law.keeps_slip());
                vec![true, has_gap, friction().next().is_some(), slip, true]
            }
            "probe" => super::probed::groups(&self.job.output.probe_also),
            _ => vec![true, true, self.job.has_heat()],
        }
    }

    /// What is wrong with the name of a number of `summary.json`.
    fn fault_of_number(&self, name: &str) -> Option<[String; 2]> {
        let (first, rest) = name.split_once('.').map_or((name, None), |(first, rest)| (first, Some(rest)));
        if RunTable::of(first).is_some() || name.split('.').any(str::is_empty) {
            return Some(no_quantity(name));
        }
        let numbers = || MEMBERS.iter().filter(|member| member.kind != MemberKind::Other);
        let of_object = |object: &str| -> Vec<String> {
            let names = numbers().filter_map(|member| member.name.strip_prefix(object)?.strip_prefix('.'));
            names.map(str::to_owned).collect()
        };
        let Some(rest) = rest else {
            let known = numbers().filter(|member| member.kind == MemberKind::Number);
            let known: Vec<String> =
                known.map(|member| member.name.clone()).filter(|name| !name.contains('.')).collect();
            return (!known.iter().any(|known| known == name)).then(|| unknown(name, name, &known));
        };
        let known = of_object(first);
        if known.is_empty() {
            let is_open = numbers().any(|member| member.name == first && member.kind == MemberKind::Numbers);
            let objects =
                MEMBERS.iter().map(|member| &*member.name).filter(|name| !of_object(name).is_empty());
            let tables = TABLES.map(|table| table.word).into_iter();
            let known = || tables.chain(objects).map(str::to_owned).collect::<Vec<_>>();
            return (!is_open).then(|| unknown(name, first, &known()));
        }
        let number = rest.split('.').next().unwrap_or(rest);
        (!known.iter().any(|known| known == number)).then(|| unknown(name, number, &known))
    }

    /// What is wrong with the name of a probe, a source of resultants or a profile.
    fn fault_of_place(&self, word: &str, of: &str) -> Option<[String; 2]> {
        let output = &self.job.output;
        let (names, message, lacks): (Vec<String>, String, &str) = match word {
            "probe" => (
                output.probe.iter().map(|probe| probe.name.clone()).collect(),
                format!("no probe is called `{of}`"),
                "probes: add [[output.probe]] to it",
            ),
            "profile" => (
                output.profile.iter().map(|profile| profile.on.clone()).collect(),
                format!("{} has no profile along `{of}`", self.called),
                "profiles: add [[output.profile]] to it",
            ),
            _ => (source_names(self.job), format!("no source of resultants is called `{of}`"), "sources"),
        };
        if names.iter().any(|name| name == of) {
            return None;
        }
        let help = if names.is_empty() {
            format!("{} has no {lacks}", self.called)
        } else {
            format!("{}{} has: {}", did_you_mean(of, &names), self.called, names.join(", "))
        };
        Some([message, help])
    }
}

fn no_quantity(name: &str) -> [String; 2] {
    [format!("`{name}` is not a quantity"), FORMS.to_owned()]
}

/// A quantity of which this part is none of the known names.
fn unknown(name: &str, part: &str, known: &[String]) -> [String; 2] {
    let help = format!("{}it may be {}", did_you_mean(part, known), known.join(", "));
    [format!("there is no quantity `{name}`"), help]
}

fn did_you_mean(name: &str, known: &[String]) -> String {
    let near = nearest(name, known.iter().map(String::as_str));
    near.map_or(String::new(), |near| format!("did you mean `{near}`? "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::{Path, PathBuf};

    const JOB: &str = "\
[mesh.rectangle]
size = [1, 1]
cells = [2, 2]
[material]
hypothesis = 'plane_stress'
density = 1
viscosity = { volumetric = 1, shear = 1 }
[time]
end = 1
step = 0.1
[[support]]
on = ['left']
fix = 'all'
[[contact]]
on = ['bottom']
[contact.normal.graph]
points = [[0, 0], [0, 1]]
[[output.probe]]
name = 'middle'
point = [0.5, 0.5]
[[output.profile]]
on = 'bottom'
";

    fn faults(name: &str) -> Vec<[String; 2]> {
        let job = crate::job::Job::from_text(JOB, "job.toml", Path::new("."), &[]).expect("a job").job;
        RunOf { job: &job, called: "the job", dimension: 2 }.faults_of_name(name)
    }

    #[test]
    fn names_that_a_run_has_are_known() {
        for name in [
            "max_von_mises",
            "unstable_steps",
            "certificates.theta",
            "certificates.growth_constants.0",
            "inventory.history_bytes.slip",
            "history.kinetic_energy",
            "history.max.dt",
            "probe.middle.velocity_y",
            "probe.middle.amplitude.displacement_x",
            "history.period.kinetic_energy",
            "probe.middle.arrival.velocity_x",
            "resultant.support left.moment_z",
            "resultant.contact bottom.max.largest_pressure",
            "profile.bottom.first.contact_pressure",
            "profile.bottom.first.tangential_displacement_x",
        ] {
            assert_eq!(faults(name), Vec::<[String; 2]>::new(), "{name}");
        }
    }

    #[test]
    fn names_that_no_run_has_are_refused_with_the_nearest_ones() {
        for (name, message, help) in [
            ("max_vonmises", "there is no quantity `max_vonmises`", "did you mean `max_von_mises`?"),
            ("kinetic_energy", "there is no quantity", "`kinetic_energy` is `history.kinetic_energy`; "),
            ("energy.external_work", "there is no quantity", "`external_work` is `history.external_work`; "),
            ("velocity_x", "there is no quantity", "`velocity_x` is `probe.NAME.velocity_x`; "),
            ("certificates.thta", "there is no quantity `certificates.thta`", "did you mean `theta`?"),
            ("certificate.theta", "there is no quantity", "did you mean `certificates`?"),
            ("probes.middle.velocity_y", "there is no quantity", "did you mean `probe`?"),
            (
                "probe.midle.velocity_y",
                "no probe is called `midle`",
                "did you mean `middle`? the job has: middle",
            ),
            ("probe.middle.velocity_z", "there is no quantity", "it may be displacement_x"),
            ("probe.middle.stress_yy", "has nothing that gives", "or add \"stress\" to `probe_also`"),
            ("probe.middle.median.velocity_y", "no probe is called `middle.median`", "the job has: middle"),
            ("resultant.suport left.force_x", "no source of resultants", "did you mean `support left`?"),
            ("resultant.support left.forcex", "there is no quantity", "did you mean `force_x`?"),
            ("resultant.contact bottom.slipping_area", "has nothing that gives", "it may be force_x"),
            ("profile.botom.max.contact_pressure", "the job has no profile along `botom`", "`bottom`?"),
            (
                "profile.bottom.max.gap",
                "the job has nothing that gives `profile.bottom.max.gap` a value",
                "it may be x",
            ),
            ("profile.bottom.arrival.contact_pressure", "is not a quantity", "profile.BOUNDARY.max.COLUMN"),
            ("profile.bottom.contact_pressure", "is not a quantity", "profile.BOUNDARY.max.COLUMN"),
            ("history.", "there is no quantity", "it may be step"),
            ("", "is not a quantity", "history.COLUMN"),
        ] {
            let found = faults(name);
            let [said, advice] = found.first().unwrap_or_else(|| panic!("{name} is known"));
            assert!(said.contains(message) && advice.contains(help), "{name}: {found:?}");
        }
    }

    #[test]
    fn names_of_all_jobs_of_the_repository_are_known() {
        let mut folders: Vec<PathBuf> = ["jobs", "tests/cases"]
            .map(|name| Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(name))
            .to_vec();
        let mut count = 0;
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).expect("folder") {
                let path = entry.expect("entry").path();
                let name = path.file_name().expect("name").to_string_lossy().into_owned();
                if path.is_dir() {
                    folders.extend((name != "out" && name != "studies").then_some(path));
                } else if name.ends_with(".toml") {
                    let job = crate::job::Job::load(&path, &[]).expect("a job").job;
                    let dimension = if job.material.hypothesis.is_some() { 2 } else { 3 };
                    let run = RunOf { job: &job, called: "the job", dimension };
                    for name in job.check.keys() {
                        assert!(run.faults_of_name(name).is_empty(), "{}: {name}", path.display());
                        count += 1;
                    }
                }
            }
        }
        assert!(count > 100, "{count}");
    }
}
