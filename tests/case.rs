//! Jobs derived from the paper's job for a test, each in its own folder.

use crate::{
    launch::{self, Outcome, Running},
    results::Results,
};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use toml::{Table, Value};

/// The paper's own job.
pub fn paper_job() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml")
}

/// The paper's job in three dimensions.
pub fn paper_cube() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_cube.toml")
}

/// A job file in a temporary folder, its results beside it in `out`.
pub struct Case {
    folder: TempDir,
    job: Value,
}

impl Case {
    /// The paper's square with n x n cells, 16 steps.
    pub fn square(n: usize) -> Self {
        let probes = "[{name = 'tip', point = [1, 0]}, {name = 'middle', point = [0.5, 0]}, \
                      {name = 'inside', point = [0.37, 0.61]}]";
        Self::from(&paper_job())
            .set("mesh.rectangle.cells", &format!("[{n}, {n}]"))
            .set("output.probe", probes)
    }

    /// The cube with n x n x n cells, 16 steps.
    pub fn cube(n: usize) -> Self {
        let probes = "[{name = 'tip', point = [1, 0.5, 0]}, {name = 'inside', point = [0.37, 0.61, 0.29]}]";
        Self::from(&paper_cube())
            .set("mesh.box.cells", &format!("[{n}, {n}, {n}]"))
            .set("output.probe", probes)
    }

    /// A job of the folder `jobs`, with its original steps.
    pub fn of(name: &str) -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("jobs/{name}.toml"));
        let text = std::fs::read_to_string(&file).expect("job");
        let job = text.parse::<Table>().expect("TOML");
        let step = job["time"]["step"].to_string();
        Self::from(&file).set("time.step", &step)
    }

    /// A job of the repository with 16 steps a second.
    pub fn from(file: &Path) -> Self {
        let text = std::fs::read_to_string(file).expect("job");
        Self::written_as(&text).set("time.step", "0.0625").without("checkpoint").without("check")
    }

    /// The job of this text.
    pub fn written_as(text: &str) -> Self {
        let job = Value::Table(text.parse::<Table>().expect("TOML"));
        Self { folder: tempfile::tempdir().expect("folder"), job }.set("output.folder", "'out'")
    }

    /// Sets a key, given by names and positions joined by dots, to a TOML value.
    pub fn set(mut self, key: &str, value: &str) -> Self {
        let (parent, name) = key.rsplit_once('.').unwrap_or(("", key));
        let value = format!("value = {value}").parse::<Table>().expect(value).remove("value").expect("value");
        let table = parent.split('.').filter(|part| !part.is_empty()).fold(&mut self.job, |node, part| {
            if let Ok(position) = part.parse::<usize>() {
                return &mut node.as_array_mut().expect(key)[position];
            }
            let table = node.as_table_mut().expect(key);
            table.entry(part).or_insert_with(|| Value::Table(Table::new()))
        });
        table.as_table_mut().expect(key).insert(name.into(), value);
        self
    }

    /// Removes a key or table.
    pub fn without(mut self, key: &str) -> Self {
        let (parent, name) = key.rsplit_once('.').unwrap_or(("", key));
        let parts = parent.split('.').filter(|part| !part.is_empty());
        let table = parts.fold(&mut self.job, |node, part| match part.parse::<usize>() {
            Ok(position) => &mut node[position],
            Err(_) => &mut node[part],
        });
        table.as_table_mut().expect(key).remove(name);
        self
    }

    /// The job file.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The output folder.
    pub fn results(&self) -> Results {
        Results::of(self.folder().join("out"))
    }

    /// Starts the job with these arguments after its name.
    pub fn start_with(&self, ranks: usize, arguments: &[&str]) -> Running {
        Running::start(ranks, &self.arguments(arguments))
    }

    /// Runs the job with these arguments after its name.
    pub fn run_with(&self, ranks: usize, arguments: &[&str]) -> Outcome {
        launch::run(ranks, &self.arguments(arguments))
    }

    /// Runs the job, which must succeed, and overwrites earlier results in its folder.
    #[track_caller]
    pub fn run(&self, ranks: usize) -> Results {
        self.run_with(ranks, &["--force"]).expect(0);
        self.results()
    }

    /// Runs the job, which must succeed, and keeps its folder.
    #[track_caller]
    pub fn run_and_keep(self, ranks: usize) -> Self {
        self.run(ranks);
        self
    }

    /// What `solver check` says of the job, with each message in one line. It must accept the job.
    #[track_caller]
    pub fn checked(&self, ranks: usize) -> String {
        let file = self.written().display().to_string();
        launch::unwrapped(&launch::run(ranks, &["check", &file]).expect(0).stdout)
    }

    /// Writes the job file and returns its path.
    pub fn written(&self) -> PathBuf {
        let file = self.folder().join("job.toml");
        std::fs::write(&file, toml::to_string(&self.job).expect("TOML")).expect("written");
        file
    }

    fn arguments(&self, more: &[&str]) -> Vec<String> {
        let first = ["run".to_owned(), self.written().display().to_string()];
        first.into_iter().chain(more.iter().map(|a| (*a).to_owned())).collect()
    }
}
