//! The solver under `mpirun` with a time limit: a run that hangs is ended with all its processes, and the test fails.

use crate::cores::{self, Cores};
use std::{
    io::Read,
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

/// Time limit: runs are small, so that a longer run has hung. `make hard` has runs of a million steps.
fn guard() -> Duration {
    Duration::from_secs(if std::env::var_os("CLARKE_HARD").is_some() { 3000 } else { 120 })
}
/// Time after which an `mpirun` whose ranks have ended is ended.
const DESERTED: Duration = Duration::from_secs(20);
/// Time for which processes may outlive their `mpirun`.
const FAREWELL: Duration = Duration::from_secs(5);
/// The environment variable with the number of the run, which all its processes have.
const MARK: &str = "CLARKE_TEST_RUN";

/// The output of a run and its exit code.
#[derive(Debug)]
pub struct Outcome {
    /// The exit code; 128 plus the number of the signal if a signal ended the run.
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Outcome {
    /// Requires this exit code.
    #[track_caller]
    pub fn expect(self, code: i32) -> Self {
        assert_eq!(self.code, code, "exit code\n{}\n{}", self.stdout, self.stderr);
        self
    }

    /// Requires this text in the output.
    #[track_caller]
    pub fn says(self, words: &str) -> Self {
        let said =
            [&self.stdout, &self.stderr].iter().any(|text| unwrapped(text).contains(&unwrapped(words)));
        assert!(said, "{words:?} is not in\n{}\n{}", self.stdout, self.stderr);
        self
    }
}

/// The text with each line that was continued after blanks in one line.
pub fn unwrapped(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.split('\n') {
        let words = line.trim_start();
        match lines.last_mut() {
            Some(before) if words.len() < line.len() => before.push_str(&format!(" {words}")),
            _ => lines.push(line.to_owned()),
        }
    }
    lines.join("\n")
}

/// Runs the solver on this many ranks to its end. One rank is started without `mpirun`, which would take longer than many a run.
pub fn run<A: AsRef<std::ffi::OsStr>>(ranks: usize, arguments: &[A]) -> Outcome {
    if ranks == 1 {
        return run_alone(arguments);
    }
    let _cores = Cores::take(ranks);
    let mut command = launcher(ranks, arguments);
    // Where a run fails, Open MPI would wait for two seconds before it ends ranks that have ended by themselves.
    command.env("OMPI_MCA_odls_base_sigkill_timeout", "0");
    Running::spawn(command).wait()
}

/// `mpirun` with the solver on this many ranks.
fn launcher<A: AsRef<std::ffi::OsStr>>(ranks: usize, arguments: &[A]) -> Command {
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--bind-to", "none", "-n", &ranks.to_string()]);
    command.arg(env!("CARGO_BIN_EXE_solver")).args(arguments);
    command
}

/// Runs the solver without `mpirun`.
pub fn run_alone<A: AsRef<std::ffi::OsStr>>(arguments: &[A]) -> Outcome {
    let _cores = Cores::take(1);
    let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
    command.args(arguments);
    Running::spawn(command).wait()
}

/// Text that a thread collects from a pipe.
struct Collected {
    text: Arc<Mutex<String>>,
    thread: Option<JoinHandle<()>>,
}

impl Collected {
    fn from(mut pipe: impl Read + Send + 'static) -> Self {
        let text = Arc::new(Mutex::new(String::new()));
        let target = Arc::clone(&text);
        let thread = std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = pipe.read(&mut bytes) {
                target.lock().expect("text").push_str(&String::from_utf8_lossy(&bytes[..count]));
            }
        });
        Self { text, thread: Some(thread) }
    }

    fn so_far(&self) -> String {
        self.text.lock().expect("text").clone()
    }

    fn whole(&mut self) -> String {
        if let Some(thread) = self.thread.take() {
            thread.join().expect("reader");
        }
        self.so_far()
    }
}

/// The process to which a signal is sent.
#[derive(Clone, Copy)]
pub enum Target {
    /// `mpirun`.
    Launcher,
    /// The process of one rank.
    OneRank,
}

/// A run in progress.
pub struct Running {
    /// The folder of Open MPI.
    _folder: tempfile::TempDir,
    launcher: Child,
    mark: String,
    began: Instant,
    stdout: Collected,
    stderr: Collected,
}

impl Running {
    pub fn start<A: AsRef<std::ffi::OsStr>>(ranks: usize, arguments: &[A]) -> Self {
        Self::spawn(launcher(ranks, arguments))
    }

    /// Starts a command that launches the solver.
    pub fn spawn(mut command: Command) -> Self {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let mark = format!("{}.{}.", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        let folder = cores::share(&mut command);
        command.env(MARK, &mark);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut launcher = command.spawn().expect("mpirun starts");
        let stdout = Collected::from(launcher.stdout.take().expect("stdout"));
        let stderr = Collected::from(launcher.stderr.take().expect("stderr"));
        Self { _folder: folder, launcher, mark, began: Instant::now(), stdout, stderr }
    }

    /// Waits until this text is in the output of the run.
    #[track_caller]
    pub fn wait_for(&mut self, words: &str) {
        while !self.stdout.so_far().contains(words) {
            let ended = self.launcher.try_wait().expect("status");
            assert!(ended.is_none(), "ended before it said {words:?}:\n{}", self.stdout.so_far());
            self.sleep();
        }
    }

    /// Sends a signal.
    pub fn signal(&self, signal: &str, target: Target) {
        assert!(self.try_signal(signal, target), "no process to send a signal to");
    }

    /// Sends a signal if the process exists.
    pub fn try_signal(&self, signal: &str, target: Target) -> bool {
        let process = match target {
            Target::Launcher => Some(self.launcher.id()),
            Target::OneRank => self.processes().into_iter().filter(|p| runs_solver(*p)).max(),
        };
        process.is_some_and(|process| send(signal, process))
    }

    /// Whether the run has not ended; for the tests of faults.
    pub fn is_running(&mut self) -> bool {
        self.launcher.try_wait().is_ok_and(|ended| ended.is_none())
    }

    /// Waits for the end, but ends an `mpirun` that remains after its ranks have ended, and returns whether this was necessary:
    /// after a kill, Open MPI 4.1 occasionally hangs during its shutdown.
    pub fn end_launcher_without_ranks(&mut self) -> bool {
        let mut deserted = Instant::now();
        while self.is_running() {
            if self.processes().into_iter().any(runs_solver) {
                deserted = Instant::now();
            }
            if deserted.elapsed() > DESERTED {
                return send("KILL", self.launcher.id());
            }
            self.sleep();
        }
        false
    }

    /// Waits for the end; no process of the run may remain.
    #[track_caller]
    pub fn wait(mut self) -> Outcome {
        let status = loop {
            match self.launcher.try_wait().expect("status") {
                Some(status) => break status,
                None => self.sleep(),
            }
        };
        let gone = Instant::now();
        while !self.processes().is_empty() && gone.elapsed() < FAREWELL {
            std::thread::sleep(Duration::from_millis(20));
        }
        let left = self.end_all();
        let code = status.code().or_else(|| status.signal().map(|s| 128 + s)).expect("a code or a signal");
        let (stdout, stderr) = (self.stdout.whole(), self.stderr.whole());
        assert!(left.is_empty(), "processes {left:?} outlived their mpirun\n{stdout}\n{stderr}");
        Outcome { code, stdout, stderr }
    }

    #[track_caller]
    fn sleep(&mut self) {
        if self.began.elapsed() > guard() {
            let left = self.end_all();
            let _ = self.launcher.wait();
            let (stdout, stderr) = (self.stdout.so_far(), self.stderr.so_far());
            panic!("hangs: no end after {:?}, processes {left:?} were ended\n{stdout}\n{stderr}", guard());
        }
        std::thread::sleep(Duration::from_millis(10));
    }

    /// All processes of this run, including `mpirun`. Ranks have their own process groups; the environment variable identifies
    /// them.
    fn processes(&self) -> Vec<u32> {
        let wanted = format!("{MARK}={}", self.mark);
        let carries_mark = |process: &u32| {
            let environment = std::fs::read(process_file(*process, "environ")).unwrap_or_default();
            environment.split(|byte| *byte == 0).any(|entry| entry == wanted.as_bytes())
        };
        let entries = std::fs::read_dir("/proc").expect("/proc");
        let numbers = entries.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
        numbers.filter(carries_mark).collect()
    }

    /// Ends the remaining processes of the run.
    fn end_all(&self) -> Vec<u32> {
        let left = self.processes();
        for process in &left {
            send("KILL", *process);
        }
        left
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end_all();
        let _ = self.launcher.wait();
    }
}

fn send(signal: &str, process: u32) -> bool {
    let sent =
        Command::new("sh").args(["-c", &format!("kill -{signal} {process}")]).stderr(Stdio::null()).status();
    sent.is_ok_and(|status| status.success())
}

fn runs_solver(process: u32) -> bool {
    let program = std::fs::read_link(process_file(process, "exe")).unwrap_or_default();
    program == Path::new(env!("CARGO_BIN_EXE_solver"))
}

fn process_file(process: u32, name: &str) -> PathBuf {
    PathBuf::from(format!("/proc/{process}/{name}"))
}
