//! What holds in each random scene.

use super::drawn::{Frame, PROBES, STEP, Scene, is_revolved, scene, turned};
use clarke::{
    error::Exit,
    job::Job,
    mesh::GlobalMesh,
    parallel::session::Session,
    run::{self, Clock, Start},
};
use std::{
    collections::BTreeMap,
    fmt::Write,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// Largest accepted error of balanced energies, forces and moments.
const BALANCE: f64 = 1e-7;
/// Largest accepted difference of results that are equal but for rounding errors and the tolerance of the steps.
const EQUAL: f64 = 1e-5;
/// The same where rounding errors choose among adaptive steps, or among several solutions of a step.
const CHOSEN: f64 = 3e-2;
/// What the log says of a step that has passed unstable states, or is too long for what fails within it.
const JUMPS: [&str; 2] = ["passes unstable states", "fails faster than the step resolves"];
/// What the log says of the number of linear systems that were indefinite.
const INDEFINITE: &str = "linear systems were indefinite";
/// Energies in J that are none: a body that moves rigidly has rounding errors alone.
const NONE: f64 = 1e-12;
/// Errors of momentum in a step as a share of the energy over 1 m/s: the tolerance of a step. A body that moves freely has no other
/// forces, and in a step of some microseconds these are large.
const SOLVED: f64 = 1e-10;
/// The frame of the comparison, and its units: 1 mm, 10 g, 0.1 s.
const OTHER: Frame = Frame { angle: 0.7, units: [1e3, 1e2, 10.0], steps: 1 };

/// How the jobs ended, by their messages.
#[derive(Default)]
struct Tally {
    ends: BTreeMap<String, Vec<u64>>,
    faults: Vec<String>,
    /// The last job.
    job: String,
}

/// Runs these scenes on the ranks of the session; on one rank in all variants. The folder has the results of one rank where there are
/// more. Collective.
pub fn hold(session: &Session, numbers: std::ops::Range<u64>, folder: &Path) {
    let mut tally = Tally::default();
    let count = numbers.clone().count();
    for number in numbers {
        if number % 3 == 2 {
            Trial::<3> { session, number, folder: folder.join(number.to_string()) }.hold(&mut tally);
        } else {
            Trial::<2> { session, number, folder: folder.join(number.to_string()) }.hold(&mut tally);
        }
    }
    if !session.is_first() {
        return;
    }
    if session.ranks() == 1 {
        for (end, numbers) in &tally.ends {
            println!("{:5} {end}: {:?}", numbers.len(), &numbers[..numbers.len().min(8)]);
        }
    }
    if count == 1 {
        println!("{}", tally.job);
    }
    assert!(tally.faults.is_empty(), "{} faults\n{}", tally.faults.len(), tally.faults.join("\n"));
}

/// The results of a run.
struct Results<const D: usize> {
    /// Columns of the history, by their names.
    history: BTreeMap<String, Vec<f64>>,
    /// Displacement and velocity of each probe at the end, in the frame.
    probes: Vec<[[f64; D]; 2]>,
    /// Forces and moments.
    open: [Open; 2],
}

/// The largest error of the balance of forces or moments, and the largest of them.
#[derive(Clone, Copy)]
struct Open {
    error: f64,
    size: f64,
}

impl Open {
    /// The error relative to the size, where it is above the least one.
    fn of(self, least: f64) -> f64 {
        if self.error <= least { 0.0 } else { self.error / self.size }
    }
}

struct Trial<'a, const D: usize> {
    session: &'a Session,
    number: u64,
    folder: PathBuf,
}

impl<const D: usize> Trial<'_, D> {
    fn hold(&self, tally: &mut Tally) {
        let ranks = self.session.ranks();
        let name = format!("ranks-{ranks}");
        let end = self.run(Frame::PLAIN, &name, &Start::Anew);
        let drawn = scene::<D>(self.number, Frame::PLAIN);
        tally.job = [Some(drawn.job), drawn.second]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join("\n# second stage\n");
        let mut fault = |what: String| tally.faults.push(format!("scene {}: {what}", self.number));
        if ranks > 1 {
            if !self.session.is_first() {
                return;
            }
            let one = self.out("ranks-1");
            let was_completed = one.join("history.csv").exists() && one.join("completed").exists();
            match (&end, was_completed) {
                (Ok(()), true) => {
                    for what in self.differences(Frame::PLAIN, "ranks-1", &name) {
                        fault(format!("{ranks} ranks: {what}"));
                    }
                }
                (Ok(()), false) => fault(format!("is completed on {ranks} ranks, but not on one")),
                (Err((_, words)), true) if !self.may_fail(&name, words) => {
                    fault(format!("{ranks} ranks: {words}"))
                }
                (Err(_), _) => {}
            }
            return;
        }
        match &end {
            Ok(()) => tally.ends.entry("completed".into()).or_default().push(self.number),
            Err((exit, words)) => {
                let known = matches!(exit, Exit::Refused | Exit::Failed);
                if !known || !words.contains(';') && !words.contains("help:") {
                    fault(format!("{exit:?}: {words}"));
                }
                let digits = |c: char| if c.is_ascii_digit() { '#' } else { c };
                let words: String =
                    words.lines().next().unwrap_or_default().chars().map(digits).take(110).collect();
                tally.ends.entry(format!("{exit:?}: {words}")).or_default().push(self.number);
                return;
            }
        }
        let plain = self.results(&name);
        std::fs::write(self.out(&name).join("completed"), "").expect("written");
        let turnover: f64 = ["kinetic_energy", "elastic_energy", "external_work", "contact_dissipation"]
            .iter()
            .map(|name| largest(&plain.history[*name]))
            .sum();
        let shortest = plain.history["dt"].iter().fold(STEP, |a: f64, b| a.min(*b));
        let least = SOLVED * turnover.max(1.0) / shortest;
        for (what, worst) in [
            ("energy", largest(&plain.history["energy_imbalance"])),
            ("forces", plain.open[0].of(least)),
            ("moments", plain.open[1].of(least)),
        ] {
            if exceeds(worst, BALANCE) {
                fault(format!("{what}: {worst:e} out of balance"));
            }
        }
        for (name, frame) in [
            ("turned", Frame { angle: OTHER.angle, ..Frame::PLAIN }),
            ("units", Frame { angle: 0.0, ..OTHER }),
        ] {
            if is_revolved::<D>(self.number) && frame.angle != 0.0 {
                continue;
            }
            match self.run(frame, name, &Start::Anew) {
                Ok(()) => {
                    for what in self.differences(frame, "ranks-1", name) {
                        fault(format!("{name}: {what}"));
                    }
                }
                Err((_, words)) if !self.may_fail(name, &words) => fault(format!("{name}: {words}")),
                Err(_) => {}
            }
        }
        if scene::<D>(self.number, Frame::PLAIN).both.is_some() {
            match self.run_both("both") {
                Ok(()) => {
                    for what in self.differences(Frame::PLAIN, "both", "ranks-1") {
                        // Dissipations and work are those of the second stage alone.
                        if what.starts_with("displacement") || what.starts_with("velocity") {
                            fault(format!("two stages: {what}"));
                        }
                    }
                }
                Err((_, words)) => fault(format!("both stages in one: {words}")),
            }
        }
        self.restart(&mut fault);
        self.halve(&plain, &mut fault);
    }

    /// A restart in the middle must give the same rows.
    fn restart(&self, fault: &mut impl FnMut(String)) {
        let straight = std::fs::read(self.out("ranks-1").join("history.csv")).expect("a history");
        let saved: Vec<PathBuf> = std::fs::read_dir(self.out("ranks-1"))
            .expect("folder")
            .map(|entry| entry.expect("entry").path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "h5"))
            .collect();
        let step = |path: &PathBuf| {
            let name = path.file_stem().expect("name").to_string_lossy().into_owned();
            name.rsplit('-').next().and_then(|digits| digits.parse::<u64>().ok()).unwrap_or(u64::MAX)
        };
        let Some(first) = saved.into_iter().min_by_key(step) else {
            return fault("no checkpoint".into());
        };
        let mut end = self.run(Frame::PLAIN, "ranks-1", &Start::From(first));
        if end.is_ok() {
            let again = std::fs::read(self.out("ranks-1").join("history.csv")).expect("a history");
            if again != straight {
                end = Err((Exit::Internal, "the history differs".into()));
            }
        }
        if let Err((_, words)) = end {
            fault(format!("restart: {words}"));
        }
    }

    /// Shorter steps must approach a limit, unless the body passes unstable states: where it lands depends on the steps.
    fn halve(&self, plain: &Results<D>, fault: &mut impl FnMut(String)) {
        let mut values = vec![Self::sample(plain)];
        for steps in [2, 4, 8] {
            let name = format!("steps-{steps}");
            match self.run(Frame { steps, ..Frame::PLAIN }, &name, &Start::Anew) {
                Ok(()) => values.push(Self::sample(&self.results(&name))),
                // A certificate may exclude short steps. Friction that weakens where the surface has neither mass nor viscosity has no
                // limit of short steps: velocities are jumps over lengths of steps.
                Err((Exit::Refused, _)) => return,
                Err((Exit::Failed, words)) if words.contains("friction fall here as the body moves") => {
                    return;
                }
                Err((_, words)) => return fault(format!("steps divided by {steps}: {words}")),
            }
        }
        if ["ranks-1", "steps-2", "steps-4", "steps-8"].iter().any(|name| self.has_jumped(name)) {
            return;
        }
        let distance = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |a: f64, b| if a >= b { a } else { b })
        };
        let size = values[3].iter().map(|x| x.abs()).fold(0.0, f64::max);
        let [long, _, short] = [0, 1, 2].map(|at| distance(&values[at], &values[at + 1]));
        if exceeds(short, 0.8 * long + 0.05 * size) {
            fault(format!(
                "shorter steps do not converge: changes {long:e}, then {short:e} of {size:e}: {values:?}"
            ));
        }
    }

    /// The displacements of all probes at the end. Convergence is one of the body: where a wave has hardly come to a probe, the errors there
    /// are those of the wave elsewhere.
    fn sample(results: &Results<D>) -> Vec<f64> {
        results.probes.iter().flat_map(|[displacement, _]| *displacement).collect()
    }

    /// The output folder of the last stage.
    fn out(&self, name: &str) -> PathBuf {
        let second = self.folder.join(name).join("out/second");
        if second.exists() { second } else { self.folder.join(name).join("out/job") }
    }

    /// Runs the scene in a frame, with its files in a folder of this name; a restart is one of its last stage. Collective.
    fn run(&self, frame: Frame, name: &str, start: &Start) -> Result<(), (Exit, String)> {
        let Scene { job, second, mesh, .. } = scene::<D>(self.number, frame);
        if *start == Start::Anew || second.is_none() {
            self.run_job((&job, "job.toml"), &mesh, name, start)?;
        }
        second.map_or(Ok(()), |second| self.run_job((&second, "second.toml"), &mesh, name, start))
    }

    /// Runs the two stages of a scene as one job.
    fn run_both(&self, name: &str) -> Result<(), (Exit, String)> {
        let Scene { both, mesh, .. } = scene::<D>(self.number, Frame::PLAIN);
        self.run_job((&both.unwrap_or_default(), "job.toml"), &mesh, name, &Start::Anew)
    }

    fn run_job(
        &self,
        (job, file): (&str, &str),
        mesh: &GlobalMesh<D>,
        name: &str,
        start: &Start,
    ) -> Result<(), (Exit, String)> {
        let folder = self.folder.join(name);
        if self.session.is_first() {
            std::fs::create_dir_all(&folder).expect("folder");
            std::fs::write(folder.join("mesh.msh"), gmsh(mesh)).expect("written");
            std::fs::write(folder.join(file), job).expect("written");
        }
        self.session.sum([0.0]);
        let loaded = Job::from_text(job, file, &folder, &[])
            .unwrap_or_else(|error| panic!("scene {}: {error}\n{job}", self.number));
        let clock = Clock {
            began: Instant::now(),
            launched: Duration::ZERO,
            on_terminal: false,
            logs_every_step: false,
        };
        match run::run(self.session, loaded, start, clock) {
            Ok(Exit::Done) => Ok(()),
            Ok(exit) => Err((exit, "it ended early".into())),
            Err(error) => Err((error.exit(), error.to_string())),
        }
    }

    fn results(&self, name: &str) -> Results<D> {
        let read = |file: &str| table(&self.out(name).join(file));
        let history = read("history.csv");
        let number = |text: &String| text.parse::<f64>().unwrap_or(f64::NAN);
        let column = |table: &BTreeMap<String, Vec<String>>, name: &str| -> Vec<f64> {
            table[name].iter().map(number).collect()
        };
        let probes = read("probes.csv");
        let vector = |probe: &str, quantity: &str| -> [f64; D] {
            let row = probes["probe"].iter().rposition(|name| name == probe).expect("a row");
            std::array::from_fn(|i| column(&probes, &format!("{quantity}_{}", ["x", "y", "z"][i]))[row])
        };
        Results {
            history: history.keys().map(|name| (name.clone(), column(&history, name))).collect(),
            probes: PROBES
                .map(|(probe, _)| ["displacement", "velocity"].map(|quantity| vector(probe, quantity)))
                .to_vec(),
            open: open_resultants::<D>(&read("resultants.csv"), is_revolved::<D>(self.number)),
        }
    }

    /// Whether a file of this name of some stage has these words.
    fn says(&self, name: &str, file: &str, words: &str) -> bool {
        ["job", "second"].iter().any(|stage| {
            let file = self.folder.join(name).join("out").join(stage).join(file);
            std::fs::read_to_string(file).is_ok_and(|text| text.contains(words))
        })
    }

    /// Whether some stage passed unstable states, or failed faster than its steps resolve: rounding errors choose where it lands.
    fn has_jumped(&self, name: &str) -> bool {
        JUMPS.iter().any(|jump| self.says(name, "run.log", jump))
    }

    /// Whether a linear system of some stage was indefinite: the energy of its step is not convex, and may have several minima.
    fn was_indefinite(&self, name: &str) -> bool {
        ["job", "second"].iter().any(|stage| {
            let file = self.folder.join(name).join("out").join(stage).join("run.log");
            let text = std::fs::read_to_string(file).unwrap_or_default();
            text.lines().any(|line| line.contains(INDEFINITE) && !line.contains(&format!(", 0 {INDEFINITE}")))
        })
    }

    /// Whether steps may have had several solutions without unstable states, as the run says.
    fn may_choose(&self, name: &str) -> bool {
        ["a step is certain to have one solution only up to", "no step is certain to have one solution"]
            .iter()
            .any(|words| self.says(name, "summary.json", words))
    }

    /// Whether a run of the same scene may fail with these words where this one does not: from where it has landed after unstable
    /// states, it may find no solution.
    fn may_fail(&self, name: &str, words: &str) -> bool {
        self.has_jumped(name) && words.contains("fall here as the body moves")
    }

    /// The steps of the last stage before unstable states; all of them where none were passed.
    fn steps_before_jump(&self, name: &str) -> usize {
        let log = |folder: &Path| std::fs::read_to_string(folder.join("run.log")).unwrap_or_default();
        let (first, last) = (self.folder.join(name).join("out/job"), self.out(name));
        let is_jump = |text: &str| JUMPS.iter().any(|jump| text.contains(jump));
        if last != first && is_jump(&log(&first)) {
            return 0;
        }
        let number = |line: &str| line.strip_prefix("step ")?.split(',').next()?.parse::<usize>().ok();
        let log = log(&last);
        let jumps = log.lines().filter(|line| is_jump(line));
        jumps.map(|line| number(line).expect("a step") - 1).min().unwrap_or(usize::MAX)
    }

    /// How the results of a frame differ from those of the plain one.
    ///
    /// Where a body has passed unstable states, the steps before must be equal. At such a state the derivative of a step is singular, and
    /// behind it are as many equilibria as there are sets of points that may soften while others unload: rounding errors choose one.
    /// Bonds and friction mostly meet again at the same end, damage does not: it never heals and keeps the choice. What follows is not
    /// compared, nor where Newton's method has passed such states within a step, nor the step of a damaged body before them, which leads there.
    fn differences(&self, frame: Frame, plain: &str, other: &str) -> Vec<String> {
        let names = [plain, other];
        let pair = Pair { frame, results: names.map(|name| self.results(name)) };
        let rows = pair.results.each_ref().map(|results| results.history["step"].len());
        let job = scene::<D>(self.number, Frame::PLAIN).job;
        let (is_adaptive, is_damaged) = (job.contains("adaptive"), job.contains("[material.damage]"));
        let has_jumped = names.iter().any(|name| self.has_jumped(name));
        let is_chosen = has_jumped || names.iter().any(|name| self.was_indefinite(name));
        let may_choose = is_adaptive || names.iter().any(|name| self.may_choose(name));
        let share = if may_choose { CHOSEN } else { EQUAL };
        let mut found = Vec::new();
        if !is_adaptive && rows[0] != rows[1] {
            found.push(format!("{} steps instead of {}", rows[1], rows[0]));
        }
        if !is_damaged || !is_chosen {
            let share = if has_jumped { CHOSEN } else { share };
            found.extend(pair.energies(rows.map(|count| count - 1), share));
            found.extend(pair.motions(share));
        }
        if has_jumped && !is_adaptive && rows[0] == rows[1] {
            let before = names.map(|name| self.steps_before_jump(name));
            let same = before[0].min(before[1]).saturating_sub(usize::from(is_damaged)).min(rows[0]);
            found.extend((0..same).flat_map(|row| pair.energies([row; 2], share)));
        }
        found
    }
}

/// The results of the plain frame, and those of a frame.
struct Pair<const D: usize> {
    frame: Frame,
    results: [Results<D>; 2],
}

impl<const D: usize> Pair<D> {
    /// Differences of the energies in these rows above this share of all of them.
    fn energies(&self, rows: [usize; 2], share: f64) -> Vec<String> {
        let [metre, kilogram, second] = self.frame.units;
        let joule = kilogram * metre * metre / (second * second);
        let [plain, other] = self.results.each_ref().map(|results| &results.history);
        let energies = plain.keys().filter(|name| {
            name.ends_with("_energy") || name.ends_with("_dissipation") || name.as_str() == "external_work"
        });
        let turnover: f64 = energies.clone().map(|name| plain[name][rows[0]].abs()).sum();
        let mut found = Vec::new();
        for name in energies {
            let (expected, got) = (plain[name][rows[0]], other[name][rows[1]] / joule);
            if exceeds((got - expected).abs(), share * turnover + NONE) {
                let step = rows[0] + 1;
                found
                    .push(format!("{name} {got:e} instead of {expected:e} of {turnover:e} J in step {step}"));
            }
        }
        found
    }

    /// Differences of the displacements and velocities at the end above ten times this share. The accuracy of displacements limits that of
    /// the velocities of a body at rest: they are changes of displacements over a step.
    fn motions(&self, share: f64) -> Vec<String> {
        let [metre, _, second] = self.frame.units;
        let mut found = Vec::new();
        let step = self.results[0].history["dt"].last().copied().unwrap_or(f64::INFINITY);
        for (number, (probe, _)) in PROBES.iter().enumerate() {
            let mut moved = 0.0;
            for (at, unit) in [metre, metre / second].into_iter().enumerate() {
                let [plain, other] = self.results.each_ref().map(|results| results.probes[number][at]);
                let expected = turned(self.frame.angle, plain);
                let size = expected.iter().map(|x| x * x).sum::<f64>().sqrt().max(moved / step);
                moved = size;
                for i in 0..D {
                    let got = other[i] / unit;
                    if exceeds((got - expected[i]).abs(), 10.0 * share * size.max(1e-6)) {
                        let what = ["displacement", "velocity"][at];
                        found.push(format!("{what} of {probe} {got:e} instead of {:e}", expected[i]));
                    }
                }
            }
        }
        found
    }
}

/// Whether a number is above its bound, or NaN.
fn exceeds(value: f64, bound: f64) -> bool {
    value > bound || value.is_nan()
}

/// The largest of the magnitudes, or NaN.
fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a: f64, b| if a.is_nan() || a >= b.abs() { a } else { b.abs() })
}

/// The columns of a table.
fn table(file: &Path) -> BTreeMap<String, Vec<String>> {
    let text = std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let column = |at: usize| rows.iter().map(|row| row[at].to_owned()).collect();
    names.iter().enumerate().map(|(at, name)| ((*name).to_owned(), column(at))).collect()
}

/// The largest difference of forces and moments from the rate of momentum in a step, and the largest ones of the run.
fn open_resultants<const D: usize>(table: &BTreeMap<String, Vec<String>>, is_revolved: bool) -> [Open; 2] {
    let axes = ["x", "y", "z"];
    let turns: Vec<String> =
        if D == 2 { vec!["moment_z".into()] } else { axes.map(|axis| format!("moment_{axis}")).to_vec() };
    // Of a body of revolution only the forces along the axis are balanced; stresses around it balance the others.
    let balanced = if is_revolved { &axes[1..2] } else { &axes[..D] };
    let forces: Vec<String> = balanced.iter().map(|axis| format!("force_{axis}")).collect();
    [forces, turns].map(|columns| {
        let mut open = 0.0;
        let mut size = 0.0;
        for column in columns {
            let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
            for ((step, source), text) in table["step"].iter().zip(&table["source"]).zip(&table[&column]) {
                let value: f64 = text.parse().unwrap_or(f64::NAN);
                *sums.entry(step).or_default() += if source == "momentum" { -value } else { value };
                size = largest(&[size, value]);
            }
            open = largest(&[&[open], &sums.into_values().collect::<Vec<f64>>()[..]].concat());
        }
        Open { error: open, size }
    })
}

/// A mesh as a Gmsh file of format 4.1.
fn gmsh<const D: usize>(mesh: &GlobalMesh<D>) -> String {
    let (facet, cell) = if D == 2 { (1, 2) } else { (2, 4) };
    let names: Vec<(usize, &str)> = mesh
        .boundaries
        .iter()
        .map(|boundary| (D - 1, boundary.name.as_str()))
        .chain(mesh.regions.iter().map(|name| (D, name.as_str())))
        .collect();
    let mut text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n".to_owned();
    let _ = writeln!(text, "{}", names.len());
    for (at, (dimension, name)) in names.iter().enumerate() {
        let _ = writeln!(text, "{dimension} {} \"{name}\"", at + 1);
    }
    let (boundaries, regions) = (mesh.boundaries.len(), mesh.regions.len());
    let counts = if D == 2 { [0, boundaries, regions, 0] } else { [0, 0, boundaries, regions] };
    let [points, curves, surfaces, volumes] = counts;
    let _ = writeln!(text, "$EndPhysicalNames\n$Entities\n{points} {curves} {surfaces} {volumes}");
    for at in 0..names.len() {
        let _ = writeln!(text, "{} -1e9 -1e9 -1e9 1e9 1e9 1e9 1 {} 0", at + 1, at + 1);
    }
    let nodes = mesh.nodes.len();
    let _ = writeln!(text, "$EndEntities\n$Nodes\n1 {nodes} 1 {nodes}\n{D} {} 0 {nodes}", names.len());
    (1..=nodes).for_each(|tag| {
        let _ = writeln!(text, "{tag}");
    });
    for node in &mesh.nodes {
        let z = if D == 3 { node[D - 1] } else { 0.0 };
        let _ = writeln!(text, "{:e} {:e} {z:e}", node[0], node[1]);
    }
    let mut blocks: Vec<(usize, usize, Vec<&[u32]>)> = Vec::new();
    for boundary in &mesh.boundaries {
        let facets = boundary.facets.iter().map(|at| &mesh.facets[*at as usize][..]).collect();
        blocks.push((D - 1, facet, facets));
    }
    for region in 0..regions {
        let cells = mesh.cells.chunks_exact(D + 1).zip(&mesh.cell_regions);
        let own = cells.filter(|(_, of)| usize::from(**of) == region).map(|(nodes, _)| nodes).collect();
        blocks.push((D, cell, own));
    }
    let count: usize = blocks.iter().map(|(.., elements)| elements.len()).sum();
    let _ = writeln!(text, "$EndNodes\n$Elements\n{} {count} 1 {count}", blocks.len());
    let mut tag = 0;
    for (at, (dimension, kind, elements)) in blocks.iter().enumerate() {
        let _ = writeln!(text, "{dimension} {} {kind} {}", at + 1, elements.len());
        for nodes in elements {
            tag += 1;
            let words: Vec<String> = nodes.iter().map(|node| (node + 1).to_string()).collect();
            let _ = writeln!(text, "{tag} {}", words.join(" "));
        }
    }
    text + "$EndElements\n"
}
