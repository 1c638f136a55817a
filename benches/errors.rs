//! Estimated errors of runs against true ones: `cargo bench --bench errors -- [--write] [words in the names of jobs]`.
//!
//! Each job of the project runs with its own steps and with steps half as long. The true error of the steps is the distance to a run with
//! steps an eighth as long; that of the mesh, for jobs whose mesh is one block, the distance to a run on cells a quarter as large, of the job's
//! mesh and of one with half as many cells along each axis. `--write` puts the table into docs/what-accuracy-costs.md.

mod jobs;
mod table;

use clarke::{
    fem::{
        effect::Form,
        space::{cell_rule, place_in_cell},
    },
    io::output::error_indicator::stress_at,
    job::{Job, Loaded},
    laws::material::Hypothesis,
    linear_algebra::tensor::{Mandel, Vector, add_scaled},
    mesh::{Mesh, shape::signed_measure},
    parallel::session::{Mpi, Session},
    run::{Doubt, EndState, Scene, Simulation, error_of_mesh, error_of_steps, with_steps},
};
use jobs::jobs;
use std::{
    fmt::Write,
    path::Path,
    time::{Duration, Instant},
};

const PAGE: &str = "docs/what-accuracy-costs.md";
/// Runs that take longer are left out: estimates and true errors.
const LONGEST: [Duration; 2] = [Duration::from_secs(10), Duration::from_secs(60)];
/// The step of the true state over that of a run.
const TRUE_STEP: f64 = 0.125;
/// Its cells along an axis over those of a run.
const TRUE_CELLS: u32 = 4;
/// The largest number of cells of a true state, in which each square of a mesh is two of them and each cube six.
const MOST_CELLS: u32 = 40_000;

/// True errors below this are rounding errors or those of Newton's method.
const NEGLIGIBLE: f64 = 1e-8;
/// How much larger than a true error an estimate may be.
const LARGEST_RATIO: f64 = 3.0;

/// What causes an error.
#[derive(Clone, Copy)]
enum Of {
    Steps,
    Mesh,
}

type Outcome<T> = Result<T, String>;

/// The error of a run.
struct Measured {
    estimate: f64,
    actual: f64,
    /// Whether the estimate is not said to be uncertain.
    is_trusted: bool,
}

fn words(error: impl ToString) -> String {
    error.to_string()
}

/// Runs a job to its end within this time.
fn run<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    mesh: Mesh<D>,
    longest: Duration,
) -> Outcome<Simulation<D, S>> {
    let began = Instant::now();
    let mut simulation = Simulation::<D, S>::on(session, loaded, mesh).map_err(words)?;
    while simulation.advance(session).map_err(words)?.is_some() {
        if began.elapsed() > longest {
            return Err("takes too long".into());
        }
    }
    Ok(simulation)
}

/// The errors of the steps of a run.
fn of_steps<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    mesh: Mesh<D>,
) -> Outcome<Measured> {
    let simulation = run::<D, S>(session, loaded, mesh.clone(), LONGEST[0])?;
    let began = Instant::now();
    let is_late = || began.elapsed() > LONGEST[1];
    let estimate = error_of_steps(session, loaded, (&mesh, &simulation), is_late).map_err(words)??;
    let fine = run::<D, S>(session, &with_steps(loaded, TRUE_STEP), mesh, LONGEST[1])?;
    let [end, fine] = [&simulation, &fine].map(EndState::of);
    let distance = end.map_err(words)?.distance(session, &simulation.body, Some(&fine.map_err(words)?));
    let actual = distance.map_err(words)? / estimate.norm;
    Ok(Measured { estimate: estimate.relative, actual, is_trusted: estimate.order.is_some() })
}

/// The errors of the mesh of a run.
fn of_mesh<const D: usize, const S: usize>(
    session: &Session,
    [loaded, fine]: [&Loaded; 2],
    [mesh, fine_mesh]: [Mesh<D>; 2],
) -> Outcome<Measured> {
    let coarse = run::<D, S>(session, loaded, mesh, LONGEST[0])?;
    let estimate = error_of_mesh(session, &loaded.job, &coarse).map_err(words)?.ok_or("no estimate")?;
    if estimate.doubt == Some(Doubt::Vibrates) {
        return Err("vibrates".into());
    }
    let fine = run::<D, S>(session, fine, fine_mesh, LONGEST[1])?;
    let [of_coarse, of_fine] = [&coarse, &fine].map(|run| run.body.stress_at_points(&run.state));
    let (of_coarse, of_fine) = (of_coarse.map_err(words)?, of_fine.map_err(words)?);
    let points = fine.body.geometry.points();
    let [mut error, mut size] = [0.0; 2];
    for (number, cell) in fine.body.geometry.cells().enumerate() {
        let tensor = fine.body.tensor(Form::Elasticity, cell.material()).ok_or("no elasticity")?;
        for point in 0..points {
            let x = place_in_cell(&fine.body.mesh, number, &cell_rule::<D>()[point].0);
            let (around, place) = cell_around(&coarse.body.mesh, &x);
            let held = coarse.body.geometry.points();
            let stress: Mandel<S> = stress_at::<D, S>(&of_coarse[around * held..][..held], &place);
            let own = of_fine[number * points + point];
            let volume = cell.point(point).volume;
            error += volume * tensor.inverse_square(&add_scaled(&own, -1.0, &stress));
            size += volume * tensor.inverse_square(&own);
        }
    }
    let actual = (error / size).sqrt();
    Ok(Measured { estimate: estimate.relative, actual, is_trusted: estimate.doubt.is_none() })
}

/// The cell that contains a place or is nearest to it, with the barycentric coordinates there.
fn cell_around<const D: usize>(mesh: &Mesh<D>, x: &Vector<D>) -> (usize, [f64; 4]) {
    let mut best = (f64::NEG_INFINITY, 0, [0.0; 4]);
    for cell in 0..mesh.cell_count() {
        let corners: Vec<Vector<D>> =
            mesh.cell(cell)[..=D].iter().map(|&node| mesh.nodes[node as usize]).collect();
        let place = barycentric(&corners, x);
        let inside = place[..=D].iter().copied().fold(f64::INFINITY, f64::min);
        if inside > best.0 {
            best = (inside, cell, place);
        }
        if inside > -1e-12 {
            break;
        }
    }
    (best.1, best.2)
}

/// Barycentric coordinates of a place in a simplex: measures of the simplices in which it replaces a corner.
fn barycentric<const D: usize>(corners: &[Vector<D>], x: &Vector<D>) -> [f64; 4] {
    let whole = signed_measure(corners);
    let mut place = [0.0; 4];
    for (at, share) in place.iter_mut().enumerate().take(D + 1) {
        let mut moved = corners.to_vec();
        moved[at] = *x;
        *share = signed_measure(&moved) / whole;
    }
    place
}

/// A job with its mesh, with some keys changed.
fn load(session: &Session, path: &Path, set: &[String]) -> Outcome<(Loaded, Scene)> {
    let mut loaded = Job::load(path, set).map_err(words)?;
    let scene = Scene::of(session, &mut loaded).map_err(words)?;
    Ok((loaded, scene))
}

fn is_plane_strain(loaded: &Loaded) -> bool {
    matches!(loaded.job.material.hypothesis, Some(Hypothesis::PlaneStrain | Hypothesis::Axisymmetric))
}

/// Estimates and measures the errors of steps of a job with these keys changed.
fn steps_of(session: &Session, path: &Path, set: &[String]) -> Outcome<Measured> {
    let (loaded, scene) = load(session, path, set)?;
    match scene {
        Scene::Two(mesh) if is_plane_strain(&loaded) => of_steps::<2, 4>(session, &loaded, mesh),
        Scene::Two(mesh) => of_steps::<2, 3>(session, &loaded, mesh),
        Scene::Three(mesh) => of_steps::<3, 6>(session, &loaded, mesh),
    }
}

/// Estimates and measures the errors of a job's mesh with these numbers of cells.
fn mesh_of(session: &Session, path: &Path, cells: &[u32]) -> Outcome<Measured> {
    let block = if cells.len() == 2 { "rectangle" } else { "box" };
    let set = |factor: u32| {
        let cells: Vec<u32> = cells.iter().map(|count| count * factor).collect();
        vec![format!("mesh.{block}.cells={cells:?}")]
    };
    let simplices = if cells.len() == 2 { 2 } else { 6 };
    if cells.iter().map(|count| count * TRUE_CELLS).product::<u32>() * simplices > MOST_CELLS {
        return Err("too many cells".into());
    }
    let (coarse, mesh) = load(session, path, &set(1))?;
    let (fine, fine_mesh) = load(session, path, &set(TRUE_CELLS))?;
    match (mesh, fine_mesh) {
        (Scene::Two(a), Scene::Two(b)) if is_plane_strain(&coarse) => {
            of_mesh::<2, 4>(session, [&coarse, &fine], [a, b])
        }
        (Scene::Two(a), Scene::Two(b)) => of_mesh::<2, 3>(session, [&coarse, &fine], [a, b]),
        (Scene::Three(a), Scene::Three(b)) => of_mesh::<3, 6>(session, [&coarse, &fine], [a, b]),
        _ => Err("two dimensions".into()),
    }
}

/// What is measured of a job, of its variants: estimated and true errors. Bodies that vibrate have no estimate of the error by the mesh.
fn variants(session: &Session, path: &Path, of: Of) -> Vec<(String, Outcome<Measured>)> {
    let Ok(loaded) = Job::load(path, &[]) else { return Vec::new() };
    let time = &loaded.job.time;
    match of {
        Of::Steps => {
            let shorter = match &time.adaptive {
                Some(adaptive) => format!("time.adaptive.tolerance={}", 0.25 * adaptive.tolerance),
                None => format!("time.step={}", 0.5 * time.step),
            };
            let sets = [Vec::new(), vec![shorter]];
            sets.into_iter().map(|set| (set.join(" "), steps_of(session, path, &set))).collect()
        }
        Of::Mesh => {
            let cells = loaded.job.mesh.source.cells().to_vec();
            let halves: Vec<u32> = cells.iter().map(|count| count.div_ceil(2)).collect();
            let all = [halves, cells].into_iter().filter(|cells| !cells.is_empty());
            all.map(|cells| (format!("{cells:?}"), mesh_of(session, path, &cells))).collect()
        }
    }
}

/// How many runs were measured, and what their estimates are worth.
#[derive(Default)]
struct Tally {
    /// Estimated over true error of each run whose true error is not negligible.
    ratios: Vec<f64>,
    /// Runs with a negligible true error, and those of them with a small estimate.
    negligible: [usize; 2],
    /// Rows of the runs whose estimate is below the true error or too large.
    outside: String,
}

impl Tally {
    fn add(&mut self, of: &str, name: &str, Measured { estimate, actual, .. }: Measured) {
        if actual < NEGLIGIBLE {
            self.negligible[0] += 1;
            self.negligible[1] += usize::from(estimate < LARGEST_RATIO * NEGLIGIBLE);
            return;
        }
        let ratio = estimate / actual;
        self.ratios.push(ratio);
        if !(1.0..=LARGEST_RATIO).contains(&ratio) {
            writeln!(self.outside, "| {of} | {name} | {estimate:.1e} | {actual:.1e} | {ratio:.2} |")
                .expect("text");
        }
    }

    fn is_empty(&self) -> bool {
        self.ratios.is_empty() && self.negligible[0] == 0
    }

    fn row(&mut self, of: &str) -> String {
        self.ratios.sort_by(f64::total_cmp);
        let share = |is_inside: &dyn Fn(f64) -> bool| {
            let inside = self.ratios.iter().filter(|ratio| is_inside(**ratio)).count();
            format!("{inside} of {}", self.ratios.len())
        };
        let held = share(&|ratio| ratio >= 1.0);
        let tight = share(&|ratio| ratio <= LARGEST_RATIO);
        let both = share(&|ratio| (1.0..=LARGEST_RATIO).contains(&ratio));
        let median = self.ratios.get(self.ratios.len() / 2).copied().unwrap_or(f64::NAN);
        let [negligible, small] = self.negligible;
        format!("| {of} | {held} | {tight} | {both} | {median:.2} | {small} of {negligible} |\n")
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let (options, words): (Vec<String>, Vec<String>) =
        arguments.into_iter().partition(|word| word.starts_with("--"));
    assert!(options.iter().all(|option| option == "--write"), "known is --write");
    let mpi = Mpi::start().expect("MPI");
    let session = mpi.session().expect("a session");
    let mut table = "| error by | estimate at least the true error | at most three times | both | median of estimate over truth | negligible, \
                     and said to be |\n|---|---|---|---|--:|---|\n"
        .to_owned();
    let mut outside = String::new();
    for (of, name) in [(Of::Steps, "steps"), (Of::Mesh, "mesh")] {
        let names = [name.to_owned(), format!("{name}, uncertain")];
        let mut tallies = [Tally::default(), Tally::default()];
        for path in jobs(&words) {
            let stem = path.file_stem().expect("a name").to_string_lossy().into_owned();
            for (variant, found) in variants(&session, &path, of) {
                let run = format!("`{}`", [stem.as_str(), variant.as_str()].join(" ").trim());
                match found {
                    Ok(measured) => {
                        let kind = usize::from(!measured.is_trusted);
                        println!(
                            "{} {run} {:.2e} for {:.2e}",
                            names[kind], measured.estimate, measured.actual
                        );
                        tallies[kind].add(&names[kind], &run, measured);
                    }
                    Err(reason) => {
                        println!("{name} {run} left out: {}", reason.lines().next().unwrap_or_default())
                    }
                }
            }
        }
        for (tally, name) in tallies.iter_mut().zip(&names).filter(|(tally, _)| !tally.is_empty()) {
            table += &tally.row(name);
            outside += &tally.outside;
        }
    }
    write!(table, "\n| error by | run | estimate | true error | ratio |\n|---|---|--:|--:|--:|\n{outside}")
        .expect("text");
    println!("{table}");
    if options.iter().any(|option| option == "--write") {
        let command = if cfg!(debug_assertions) {
            "cargo bench --profile dev --bench errors -- --write"
        } else {
            "make bench-errors ARGS=--write"
        };
        table::write(
            PAGE,
            "estimated errors",
            &[&[command.to_owned()], &words[..]].concat().join(" "),
            None,
            &table,
        );
    }
}
