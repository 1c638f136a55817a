//! The log: what the terminal shows, and the same without control characters in `run.log`.

use crate::{
    error::{Error, Result},
    laws::lines::{plain, wrapped},
};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};
use std::{
    fs::{File, OpenOptions, TryLockError},
    io::{IsTerminal, Write},
    path::Path,
    time::{Duration, Instant},
};

/// Where the words of a line begin, behind its title.
pub const WORDS: usize = 11;

/// Least time between two lines of steps on the standard output.
const BETWEEN_STEPS: Duration = Duration::from_secs(1);

/// Time between two changes of a bar while nothing happens.
const BETWEEN_TICKS: Duration = Duration::from_millis(500);

/// Writes lines on rank 0 and nothing elsewhere.
#[derive(Debug)]
pub(crate) struct Log {
    is_active: bool,
    on_terminal: bool,
    /// When the last line of a step was printed.
    stepped: Option<Instant>,
    file: Option<File>,
    /// The lines so far, until they are written to the file.
    early: Option<Vec<String>>,
    bar: Option<ProgressBar>,
    warnings: Vec<String>,
}

impl Log {
    /// A log that writes on rank 0 only and has no file yet; without `on_terminal` its lines go to the file only.
    pub(crate) fn new(is_active: bool, on_terminal: bool) -> Self {
        let early = Some(Vec::new());
        Self { is_active, on_terminal, stepped: None, file: None, early, bar: None, warnings: Vec::new() }
    }

    /// Locks this file for the run, as long as the log exists; creates a missing one if `create` is set.
    ///
    /// The system releases the lock of a process that was killed. On file systems without locks nothing is refused.
    pub(crate) fn lock(&mut self, path: &Path, create: bool) -> Result<()> {
        if !self.is_active || self.file.is_some() || !(create || path.exists()) {
            return Ok(());
        }
        let file = OpenOptions::new().create(create).append(true).open(path);
        let file = file.map_err(|e| Error::unwritable(path, e))?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(Error::Refused(format!(
                "{}: another run is writing into this folder; wait until it ends, or choose another [output] folder",
                path.parent().unwrap_or(path).display()
            )));
        }
        self.file = Some(file);
        Ok(())
    }

    /// Writes to the file from now on, the lines so far first; appends to it if the run continues an earlier one.
    pub(crate) fn open(&mut self, path: &Path, is_restart: bool) -> Result<()> {
        if let Some(file) = self.file.as_ref().filter(|_| !is_restart) {
            file.set_len(0).map_err(|e| Error::unwritable(path, e))?;
        }
        self.early.take().into_iter().flatten().for_each(|line| self.file_line(&line));
        Ok(())
    }

    /// Writes lines.
    pub(crate) fn line(&mut self, words: impl AsRef<str>) {
        if !self.is_active {
            return;
        }
        let words = plain(words.as_ref());
        let words = wrapped(&words, WORDS);
        match &self.bar {
            Some(bar) => bar.suspend(|| print_line(&words)),
            None if self.on_terminal => print_line(&words),
            None => {}
        }
        self.file_line(&words);
    }

    /// Writes a warning and keeps it for the summary.
    pub(crate) fn warning(&mut self, words: impl Into<String>) {
        let words = words.into();
        self.line(format!("warning: {words}"));
        self.warnings.push(words);
    }

    /// The warnings so far.
    pub(crate) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Writes lines to the file and, where no progress bar moves, to the terminal.
    pub(crate) fn quiet_line(&mut self, words: impl AsRef<str>) {
        if self.is_active {
            let words = plain(words.as_ref());
            if self.bar.is_none() && self.on_terminal {
                print_line(&words);
            }
            self.file_line(&words);
        }
    }

    /// Writes the line of a step to the file and, where no progress bar moves, to the terminal: there once a second, or always if
    /// `is_wanted`.
    pub(crate) fn step_line(&mut self, words: &str, is_wanted: bool) {
        if !self.is_active {
            return;
        }
        let is_due = self.stepped.is_none_or(|printed| printed.elapsed() >= BETWEEN_STEPS);
        if self.bar.is_none() && self.on_terminal && (is_due || is_wanted) {
            print_line(words);
            self.stepped = Some(Instant::now());
        }
        self.file_line(words);
    }

    fn file_line(&mut self, words: &str) {
        if let Some(early) = &mut self.early {
            early.push(words.to_owned());
        } else if let Some(file) = &mut self.file {
            // A failed write to the log must not end the run.
            let _ = writeln!(file, "{words}");
        }
    }

    /// Shows that steps are being prepared, if the output is a terminal.
    pub(crate) fn start_waiting(&mut self) {
        self.start_bar("{spinner} preparing the first step  {elapsed}", ProgressBar::new_spinner);
    }

    /// Shows a progress bar if the output is a terminal.
    pub(crate) fn start_progress(&mut self, steps: u64, taken: u64) {
        let template = "{wide_bar} {pos}/{len} steps  {msg}  {elapsed} spent, {eta} left";
        self.start_bar(template, || ProgressBar::new(steps));
        if let Some(bar) = &self.bar {
            bar.set_position(taken);
            bar.reset_eta();
        }
    }

    /// Shows a bar that moves also while steps take long, in place of another one.
    fn start_bar(&mut self, template: &str, new: impl Fn() -> ProgressBar) {
        self.end_progress();
        if !(self.is_active && self.on_terminal) {
            return;
        }
        let is_direct = std::io::stderr().is_terminal() && std::io::stdout().is_terminal();
        if is_direct || launcher_has_terminal() {
            let bar = new();
            if !is_direct {
                bar.set_draw_target(ProgressDrawTarget::term_like_with_hz(Box::new(LauncherTerminal), 5));
            }
            let style = ProgressStyle::with_template(template);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.enable_steady_tick(BETWEEN_TICKS);
            self.bar = Some(bar);
        }
    }

    /// Whether a progress bar is shown.
    pub(crate) fn has_bar(&self) -> bool {
        self.bar.is_some()
    }

    /// Moves the progress bar.
    pub(crate) fn progress(&self, taken: u64, words: &str) {
        if let Some(bar) = &self.bar {
            bar.set_position(taken);
            bar.set_message(words.to_owned());
        }
    }

    /// Removes the progress bar.
    pub(crate) fn end_progress(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

/// Whether the parent process (under mpirun, the launcher) writes to a terminal and forwards the output of this process to it.
fn launcher_has_terminal() -> bool {
    if std::env::var_os("OMPI_COMM_WORLD_RANK").is_none() && std::env::var_os("PMI_RANK").is_none() {
        return false;
    }
    let parent = std::os::unix::process::parent_id();
    [1, 2].iter().all(|stream| {
        let file = std::fs::read_link(format!("/proc/{parent}/fd/{stream}"));
        file.is_ok_and(|file| file.starts_with("/dev/pts") || file.starts_with("/dev/tty"))
    })
}

/// The terminal of the launcher, as far as a progress bar of one line needs it; written through the standard output.
#[derive(Debug)]
struct LauncherTerminal;

impl LauncherTerminal {
    fn put(words: std::fmt::Arguments<'_>) -> std::io::Result<()> {
        std::io::stdout().write_fmt(words)
    }
}

impl TermLike for LauncherTerminal {
    fn width(&self) -> u16 {
        80
    }

    fn move_cursor_up(&self, lines: usize) -> std::io::Result<()> {
        if lines == 0 { Ok(()) } else { Self::put(format_args!("\x1b[{lines}A")) }
    }

    fn move_cursor_down(&self, lines: usize) -> std::io::Result<()> {
        if lines == 0 { Ok(()) } else { Self::put(format_args!("\x1b[{lines}B")) }
    }

    fn move_cursor_right(&self, columns: usize) -> std::io::Result<()> {
        if columns == 0 { Ok(()) } else { Self::put(format_args!("\x1b[{columns}C")) }
    }

    fn move_cursor_left(&self, columns: usize) -> std::io::Result<()> {
        if columns == 0 { Ok(()) } else { Self::put(format_args!("\x1b[{columns}D")) }
    }

    fn write_line(&self, words: &str) -> std::io::Result<()> {
        Self::put(format_args!("{words}\n"))
    }

    fn write_str(&self, words: &str) -> std::io::Result<()> {
        Self::put(format_args!("{words}"))
    }

    fn clear_line(&self) -> std::io::Result<()> {
        Self::put(format_args!("\r\x1b[2K"))
    }

    fn flush(&self) -> std::io::Result<()> {
        std::io::stdout().flush()
    }
}

/// Prints a line; a closed pipe is no reason to stop.
fn print_line(words: &str) {
    let _ = writeln!(std::io::stdout(), "{words}");
}
