//! Loads a job from a file or a text, and refuses it if it has faults.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Component, Path, PathBuf};

use serde::de::DeserializeOwned;

use super::check::{check, check_names};
use super::findings::{Findings, MeshNames, Table};
use super::parameters::Parameters;
use super::petsc_options::reaches_beyond_the_run;
use super::report::{Fault, Place, Texts};
use super::schema::Kind;
use super::source::{Node, parse};
use super::validate::{self, Checked};
use super::written::Written;
use super::{Job, MeshSource, set, surfaces, tables};
use crate::error::{Error, Result, regular_file};

/// Largest size of a file in bytes.
const LARGEST: usize = 1 << 20;

/// A job without faults, with the positions of its keys for faults that only the mesh reveals.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The job with all defaults and with absolute paths.
    pub job: Job,
    /// Warnings.
    pub warnings: Vec<String>,
    /// What the log says of the faults along which the mesh is split.
    pub faults: Vec<String>,
    /// Whether options of PETSc may write files and load code.
    is_trusted: bool,
    root: Node,
    texts: Texts,
}

impl Job {
    /// Loads the job in the file `path` and applies `overrides` (`a.b.c=value`).
    pub fn load(path: &Path, overrides: &[String]) -> Result<Loaded> {
        Self::load_coloured(path, overrides, false)
    }

    /// As [`Job::load`]; faults are rendered for a terminal with colours if `colour`.
    pub fn load_coloured(path: &Path, overrides: &[String], colour: bool) -> Result<Loaded> {
        let (text, folder) = read(Kind::job(), path)?;
        Loaded::new(&text, &path.display().to_string(), &folder, overrides, colour)
    }

    /// The job in `text`, called `name` in faults; paths are relative to `base_dir`.
    pub fn from_text(text: &str, name: &str, base_dir: &Path, overrides: &[String]) -> Result<Loaded> {
        let folder = std::path::absolute(base_dir).map_err(|error| Error::unreadable(base_dir, error))?;
        Loaded::new(text, name, &folder, overrides, false)
    }
}

/// A document and the faults found so far.
pub struct Document {
    root: Node,
    texts: Texts,
    faults: Vec<Fault>,
    /// The paths of what could not be read.
    unread: Vec<String>,
    parameters: Parameters,
    written: Written,
}

/// Where a document comes from.
#[derive(Debug, Clone, Copy)]
pub struct Origin<'a> {
    /// Its name in messages.
    pub name: &'a str,
    /// The folder of relative paths.
    pub folder: &'a Path,
}

impl Document {
    /// Parses `text`, applies `overrides`, reads tables relative to its folder and checks every key against the schema.
    pub fn new(
        kind: Kind,
        text: &str,
        Origin { name, folder }: Origin<'_>,
        overrides: &[String],
        colour: bool,
    ) -> Result<Self> {
        refuse_long(kind, text.len(), name)?;
        let texts = Texts::new(kind.name, name, text, overrides, colour);
        let mut root = parse(text).map_err(|fault| texts.refuse(vec![fault]))?;
        if let Some(what) = other_document(kind, &root, name) {
            return Err(Error::Refused(format!("{name} is {what}")));
        }
        let mut faults = Vec::new();
        for (index, text) in overrides.iter().enumerate() {
            faults.extend(set::apply(&mut root, text, index + 1).err());
        }
        let mut parameters = Parameters::read(kind, &root, text, &mut faults);
        tables::insert(&mut root, folder, &mut parameters, &mut faults);
        let checked = validate::check(kind, &mut root, text, &mut parameters);
        let Checked { faults: of_keys, unread, written } = checked;
        faults.extend(of_keys);
        Ok(Self { root, texts, faults, unread, parameters, written })
    }

    /// Adds a fault at the value of `path`, or at the innermost existing table on this path.
    pub fn fault(&mut self, path: &str, message: impl Into<String>, help: impl AsRef<str>) {
        self.faults.push(Fault::new(self.root.deepest(path).at.clone(), message, "").help(help));
    }

    /// Adds a fault at a free name in a table, which may contain dots.
    pub fn fault_at_name(
        &mut self,
        (table, name): (&str, &str),
        message: impl Into<String>,
        help: impl AsRef<str>,
    ) {
        let node = self.root.deepest(table);
        let place = node.child(name).map_or(&node.at, |child| &child.key);
        self.faults.push(Fault::new(place.clone(), message, "").help(help));
    }

    /// The struct of the document, with neutral values in place of those that could not be read.
    pub fn fill<T: DeserializeOwned>(&self) -> Result<T> {
        T::deserialize(self.root.plain())
            .map_err(|error| self.texts.refuse(vec![Fault::new(Place::new(0, 0..0), error.message(), "")]))
    }

    /// An error with all faults, if there are some.
    pub fn refuse(&self) -> Result<()> {
        if self.faults.is_empty() { Ok(()) } else { Err(self.texts.refuse(self.faults.clone())) }
    }
}

impl Loaded {
    fn new(text: &str, name: &str, folder: &Path, overrides: &[String], colour: bool) -> Result<Self> {
        let mut document = Document::new(Kind::job(), text, Origin { name, folder }, overrides, colour)?;
        let mut job: Job = document.fill()?;
        let mut findings = Findings::default();
        check(&job, &mut Table::new(&document.root, &document.unread, &mut findings));
        document.faults.append(&mut findings.faults);
        document.refuse()?;
        findings.warnings.extend(document.parameters.unused());
        let Document { root, texts, written, .. } = document;
        job.written = written;
        job.resolve_paths(folder, Path::new(name));
        let unread = surfaces::read(&mut job)
            .into_iter()
            .map(|[key, message, help]| Fault::new(root.deepest(&key).at.clone(), message, "").help(help));
        let faults: Vec<Fault> = unread.collect();
        if faults.is_empty() {
            Ok(Self { job, warnings: findings.warnings, faults: Vec::new(), is_trusted: false, root, texts })
        } else {
            Err(texts.refuse(faults))
        }
    }

    /// A refusal at the position of `key_path` (`contact.0.on`), or of the innermost existing table on this path.
    pub fn fault(&self, key_path: &str, message: impl Into<String>, help: impl AsRef<str>) -> Error {
        let place = self.root.deepest(key_path).at.clone();
        self.texts.refuse(vec![Fault::new(place, message, "").help(help)])
    }

    /// Refuses these names in a table, which may contain dots, each with a message and advice.
    pub(crate) fn refuse_names(&self, table: &str, faults: Vec<(&str, [String; 2])>) -> Result<()> {
        if faults.is_empty() {
            return Ok(());
        }
        let node = self.root.deepest(table);
        let fault = |(name, [message, help]): (&str, [String; 2])| {
            let place = node.child(name).map_or(&node.at, |child| &child.key);
            Fault::new(place.clone(), message, "").help(help)
        };
        Err(self.texts.refuse(faults.into_iter().map(fault).collect()))
    }

    /// The job, whose options of PETSc may write files and load code if it `is_trusted`.
    pub fn trusted(self, is_trusted: bool) -> Self {
        Self { is_trusted, ..self }
    }

    /// Refuses options of PETSc that write files or load code, unless the job is trusted.
    pub fn refuse_untrusted(&self) -> Result<()> {
        let options = self.job.solver.petsc.iter().filter(|_| !self.is_trusted);
        for (name, value) in options {
            if let Some(what) = reaches_beyond_the_run(name, value) {
                let help = "delete it, or allow it for a job that you trust: solver run JOB --trust";
                return Err(self.fault(
                    &format!("solver.petsc.{name}"),
                    format!("this option of PETSc {what}"),
                    help,
                ));
            }
        }
        Ok(())
    }

    /// Checks the job against a mesh that was read from a file; adds warnings to [`Loaded::warnings`].
    pub fn check_mesh(&mut self, mesh: MeshNames<'_>) -> Result<()> {
        let mut findings = Findings::default();
        check_names(&self.job, &mut Table::new(&self.root, &[], &mut findings), mesh);
        if !findings.faults.is_empty() {
            return Err(self.texts.refuse(findings.faults));
        }
        // For a generated mesh these warnings exist already.
        for warning in findings.warnings {
            if !self.warnings.contains(&warning) {
                self.warnings.push(warning);
            }
        }
        Ok(())
    }
}

impl Job {
    fn resolve_paths(&mut self, folder: &Path, file: &Path) {
        let stem = file.file_stem().unwrap_or(file.as_os_str());
        let output = self.output.folder.take().unwrap_or_else(|| Path::new("out").join(stem));
        self.output.folder = Some(normal(&folder.join(output)));
        if let MeshSource::File(path) = &mut self.mesh.source {
            *path = normal(&folder.join(&*path));
        }
        for path in self.shapes_mut().filter_map(|(_, shape)| Some(&mut shape.surface.as_mut()?.file)) {
            *path = normal(&folder.join(&*path));
        }
        if let Some(path) = self.initial.as_mut().and_then(|initial| initial.from.as_mut()) {
            *path = normal(&folder.join(&*path));
        }
    }
}

/// The path without `.` and without each `..` that follows a name.
pub fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            part => out.push(part),
        }
    }
    out
}

fn refuse_long(kind: Kind, bytes: usize, name: &str) -> Result<()> {
    if bytes <= LARGEST {
        return Ok(());
    }
    Err(Error::Refused(format!("{name}: a {} file has at most {LARGEST} bytes", kind.name)))
}

/// What the document with this name is, if it is a study or a job and not of this kind.
fn other_document(kind: Kind, root: &Node, name: &str) -> Option<String> {
    match (kind.name, is_study(root)) {
        ("job", true) => Some(format!(
            "a study, not a job: run it with solver study {name}, check it with solver check {name}"
        )),
        ("study", false) if root.find("time").is_some() && root.find("mesh").is_some() => Some(format!(
            "a job, not a study: run it with solver run {name}, check it with solver check {name}, or name it in [base] job of a study"
        )),
        _ => None,
    }
}

fn is_study(root: &Node) -> bool {
    root.find("base.job").is_some()
}

/// Whether the file can be read and is a study.
pub fn file_is_study(path: &Path) -> bool {
    let text = std::fs::read_to_string(path).ok();
    text.and_then(|text| parse(&text).ok()).is_some_and(|root| is_study(&root))
}

/// What a file with this extension is, if it is one that is often given in place of another.
pub fn by_extension(path: &Path) -> Option<&'static str> {
    match path.extension()?.to_str()? {
        "geo" => Some("a geometry for Gmsh: make the mesh with gmsh -2 (in 3D -3) -format msh41 FILE.geo"),
        "stl" => Some(
            "a triangulated surface: name it in a job, [contact.obstacle.shape] surface = { file = \"FILE.stl\" }",
        ),
        "msh" | "inp" | "vtu" => Some("a mesh, not a job: name it in a job, [mesh] file = \"FILE\""),
        "csv" => Some("a table of numbers"),
        "toml" => Some("a text, a job or a study: solver check FILE or solver study FILE reads it"),
        _ => None,
    }
}

/// What a file is that begins with these bytes, if it is one that is often given in place of a job.
fn other_file(bytes: &[u8]) -> Option<&'static str> {
    // ASCII characters in UTF-16, without the mark at the beginning.
    if let [a, 0, b, 0, ..] | [0, a, 0, b, ..] = bytes
        && *a > 0
        && *b > 0
    {
        return Some("a text in UTF-16: save it in UTF-8");
    }
    let kinds: [(&[u8], &str); 4] = [
        (b"$MeshFormat", "a Gmsh mesh, not a job: name it in a job, [mesh] file = \"FILE.msh\""),
        (
            b"\x89HDF\r\n",
            "an HDF5 file, not a job: solver inspect FILE shows what it contains; a run continues from a checkpoint with \
             solver JOB.toml --restart FILE.h5",
        ),
        (&[0xff, 0xfe], "a text in UTF-16: save it in UTF-8"),
        (&[0xfe, 0xff], "a text in UTF-16: save it in UTF-8"),
    ];
    kinds.into_iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, what)| what)
}

/// The text of a file of this kind, and the folder it is in.
pub fn read(kind: Kind, path: &Path) -> Result<(String, PathBuf)> {
    let absolute = std::path::absolute(path).map_err(|error| Error::unreadable(path, error))?;
    let folder = absolute.parent().unwrap_or(Path::new("/")).to_owned();
    let mut bytes = Vec::new();
    let unreadable = |error: std::io::Error| match error.kind() {
        ErrorKind::NotFound => {
            Error::unreadable(path, format!("there is no {} file of this name", kind.name))
        }
        ErrorKind::IsADirectory => {
            Error::unreadable(path, format!("it is a folder, not a {} file", kind.name))
        }
        _ => Error::unreadable(path, error),
    };
    let read = |file: File| file.take(LARGEST as u64 + 1).read_to_end(&mut bytes);
    regular_file(path).and_then(|_| File::open(path)).and_then(read).map_err(unreadable)?;
    let extension = path.extension().is_some_and(|extension| extension != "toml");
    let by_name = if extension { by_extension(path) } else { None };
    if let Some(what) = other_file(&bytes).or(by_name) {
        return Err(Error::Refused(format!("{} is {what}", path.display())));
    }
    refuse_long(kind, bytes.len(), &path.display().to_string())?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + valid.iter().filter(|byte| **byte == b'\n').count();
        Error::Refused(format!("{}:{line}: not a text file (UTF-8 expected)", path.display()))
    })?;
    Ok((text, folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_jobs_are_named_as_what_they_are() {
        let folder = tempfile::tempdir().expect("a folder");
        let said = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("written");
            Job::load(&path, &[]).expect_err("no job").to_string()
        };
        assert!(said("a.msh", b"$MeshFormat\n4.1 0 8\n").contains("a Gmsh mesh, not a job"));
        assert!(said("a.h5", b"\x89HDF\r\n\x1a\n").contains("an HDF5 file, not a job"));
        assert!(said("a.toml", b"\xff\xfe[\0").contains("UTF-16: save it in UTF-8"));
        assert!(said("b.toml", b"[\0m\0e\0").contains("UTF-16: save it in UTF-8"));
        assert!(said("c.toml", b"\0[\0m\0e").contains("UTF-16: save it in UTF-8"));
        assert!(said("a.geo", b"Point(1) = {0, 0, 0};\n").contains("a geometry for Gmsh"));
        assert!(said("a.stl", b"solid a\n").contains("a triangulated surface"));
        assert!(
            said("d.toml", b"base.job = 'a.toml'\n").contains("a study, not a job: run it with solver study")
        );
        let missing = Job::load(&folder.path().join("none.toml"), &[]).expect_err("missing").to_string();
        assert!(missing.contains("cannot read") && missing.contains("there is no job file"), "{missing}");
        let directory = Job::load(folder.path(), &[]).expect_err("a folder").to_string();
        assert!(directory.contains("it is a folder, not a job file"), "{directory}");
        let device = Job::load(Path::new("/dev/null"), &[]).expect_err("a device").to_string();
        assert!(device.contains("it is a device or a pipe"), "{device}");
    }
}
