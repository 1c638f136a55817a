//! Jobs and studies made for a test, each in a folder of its own.

use crate::launch::{Outcome, run};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A viscous square, held on all sides, whose velocity is t sin(pi x) sin(pi y) in x: with A(e) = 25 tr(e) I + 50 e the
/// force is its time derivative minus the divergence of the stress. Implicit in the viscosity, the scheme makes no error
/// in time in this velocity, and one of first order in the displacement.
pub const SQUARE: &str = r#"
[mesh.rectangle]
size = [1, 1]
cells = [4, 4]
[material]
hypothesis = "plane_stress"
density = 1
viscosity = { volumetric = 25, shear = 50 }
[[support]]
on = ["left", "right", "bottom", "top"]
fix = "all"
[[body_force]]
value = ["sin(pi*x)*sin(pi*y)*(1 + 100*pi^2*t)", "-50*pi^2*t*cos(pi*x)*cos(pi*y)"]
[time]
end = 1
step = 0.5
[output]
probe = [{ name = "middle", point = [0.5, 0.5] }]
"#;

/// The solution of [`SQUARE`].
pub const SOLUTION: &str = r#"
[reference.exact]
displacement = ["t^2/2*sin(pi*x)*sin(pi*y)", 0]
velocity = ["t*sin(pi*x)*sin(pi*y)", 0]
stress = [
    "75*pi*t*cos(pi*x)*sin(pi*y)",
    "25*pi*t*cos(pi*x)*sin(pi*y)",
    "25*pi*t*sin(pi*x)*cos(pi*y)",
]
"#;

/// A job and a study in a temporary folder.
pub struct Scene {
    folder: TempDir,
}

impl Scene {
    /// The job, and the study behind a [base] that names it.
    pub fn new(job: &str, study: &str) -> Self {
        let scene = Self { folder: tempfile::tempdir().expect("folder") };
        scene.write("job.toml", job);
        scene.write("study.toml", &format!("[base]\njob = \"job.toml\"\n{study}"));
        scene
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).expect("written");
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the study on some ranks.
    pub fn study(&self, ranks: usize, more: &[&str]) -> Outcome {
        let file = self.path("study.toml").display().to_string();
        let arguments: Vec<&str> = ["study", &file].into_iter().chain(more.iter().copied()).collect();
        run(ranks, &arguments)
    }

    /// The results the study left.
    pub fn results(&self) -> Value {
        read(&self.path("out/study"))
    }
}

/// `study.json` of a folder.
pub fn read(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("study.json")).expect("study.json");
    serde_json::from_str(&text).expect("JSON")
}

/// The number at a pointer such as `/runs/1/errors/0/error`.
pub fn number(results: &Value, pointer: &str) -> f64 {
    results.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {pointer} in {results:#}"))
}
