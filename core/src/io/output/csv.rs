//! CSV tables that are extended row by row and continued by a restart; rank 0 writes them.
//!
//! Text such as the name of a boundary is quoted where it contains separators. Spreadsheets execute text that begins with one of
//! `= + - @`; such text has an apostrophe before it in the file, which [`records`] removes.

use super::checkpoint_folder::list;
use crate::error::{Error, Result};
use crate::parallel::agreement::pass;
use crate::solver::stepping::without_rounding;
use csv::{ReaderBuilder, StringRecord, Writer};
use std::{
    fmt::{self, Display, Formatter},
    fs::{File, OpenOptions},
    io::{BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// Longest time between two flushes of rows, and between two writes of waiting times of fields.
pub(super) const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// First characters of text that would become a formula, or that would be read as the mark of such text.
const MARKED: [char; 7] = ['=', '+', '-', '@', '\t', '\r', MARK];
const MARK: char = '\'';

/// Text as an entry of a table.
pub fn entry(text: &str) -> String {
    let marked = if text.starts_with(MARKED) { format!("{MARK}{text}") } else { text.to_owned() };
    let mut writer = Writer::from_writer(Vec::new());
    // Writing to memory does not fail.
    let _ = writer.write_record([&marked]);
    let mut bytes = writer.into_inner().unwrap_or_default();
    bytes.pop();
    String::from_utf8(bytes).unwrap_or(marked)
}

/// The text of an entry.
fn text(entry: &str) -> &str {
    entry.strip_prefix(MARK).filter(|rest| rest.starts_with(MARKED)).unwrap_or(entry)
}

/// A row of a table that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Number of its line in the file, from 1.
    pub line: u64,
    /// Its entries.
    pub entries: Vec<String>,
}

/// The rows of a table, the header first.
pub fn records(bytes: &[u8]) -> impl Iterator<Item = Record> {
    let reader = ReaderBuilder::new().has_headers(false).flexible(true).from_reader(bytes);
    reader.into_byte_records().map_while(|record| record.ok()).map(|record| Record {
        line: record.position().map_or(0, csv::Position::line),
        entries: record.iter().map(|bytes| text(&String::from_utf8_lossy(bytes)).to_owned()).collect(),
    })
}

/// A CSV file open for appending.
#[derive(Debug)]
pub(crate) struct CsvFile {
    path: PathBuf,
    writer: BufWriter<File>,
    flushed: Instant,
    /// What the table that is continued lacks.
    faults: Vec<String>,
}

impl CsvFile {
    /// Starts an empty table, or continues one after the row whose first column, a step or a time as tables show it, is
    /// `goes_on_after`.
    pub(super) fn open(path: &Path, header: &str, goes_on_after: Option<f64>) -> Result<Self> {
        goes_on_after.map_or_else(|| Self::create(path, header), |last| Self::resume(path, header, last))
    }

    /// Starts an empty table.
    fn create(path: &Path, header: &str) -> Result<Self> {
        pass()?;
        let mut file = File::create(path).map_err(|e| Error::unwritable(path, e))?;
        writeln!(file, "{header}").map_err(|e| Error::unwritable(path, e))?;
        Ok(Self::new(path, file, Vec::new()))
    }

    fn new(path: &Path, file: File, faults: Vec<String>) -> Self {
        Self { path: path.to_owned(), writer: BufWriter::new(file), flushed: Instant::now(), faults }
    }

    /// Continues a table, keeping the rows whose first column is at most `last`; creates one if there is none. A table with another
    /// header is renamed and kept.
    fn resume(path: &Path, header: &str, last: f64) -> Result<Self> {
        pass()?;
        let old = match File::open(path) {
            Ok(old) => old,
            Err(error) => {
                // A run that is continued in another folder begins its tables there.
                let was_here =
                    path.parent().is_some_and(|folder| list(folder).is_ok_and(|all| !all.is_empty()));
                let mut new = Self::create(path, header)?;
                if error.kind() == ErrorKind::NotFound && was_here {
                    new.faults
                        .push("it was not there: it has no rows of the steps before this restart".into());
                }
                return Ok(new);
            }
        };
        let reader = ReaderBuilder::new().has_headers(false).flexible(true).from_reader(old);
        let mut rows = reader.into_byte_records();
        let columns = header.split(',').count();
        if !rows
            .next()
            .is_some_and(|row| row.is_ok_and(|row| row.iter().eq(header.split(',').map(str::as_bytes))))
        {
            let aside = path.with_extension("before.csv");
            std::fs::rename(path, &aside).map_err(|e| Error::unwritable(&aside, e))?;
            let mut new = Self::create(path, header)?;
            let kept = format!("what it had so far is kept in {}", aside.display());
            new.faults.push(format!("its first line did not name the columns of this run: {kept}"));
            return Ok(new);
        }
        let part = path.with_extension("csv.part");
        let unwritable = |e: &dyn Display| Error::unwritable(&part, e);
        let mut kept = BufWriter::new(File::create(&part).map_err(|e| unwritable(&e))?);
        writeln!(kept, "{header}").map_err(|e| unwritable(&e))?;
        let mut kept = Writer::from_writer(kept);
        let mut faults = Faults { by_step: header.starts_with("step,"), ..Faults::default() };
        let is_name: Vec<bool> = header.split(',').map(|column| NAMES.contains(&column)).collect();
        let fits = |row: &StringRecord| {
            row.len() == columns
                && row
                    .iter()
                    .zip(&is_name)
                    .all(|(cell, is_name)| *is_name || cell.is_empty() || cell.parse::<f64>().is_ok())
        };
        for row in rows {
            let row = row.map_err(|error| Error::unreadable(path, error))?;
            let line = row.position().map_or(0, csv::Position::line);
            let row = StringRecord::from_byte_record(row).ok();
            let first = row.as_ref().and_then(|row| row.get(0)?.parse::<f64>().ok());
            match (row.filter(fits), first) {
                (Some(_), Some(first)) if first > last => faults.ended = true,
                (Some(row), Some(first)) if first <= last => {
                    faults.row(first);
                    kept.write_record(&row).map_err(|e| unwritable(&e))?;
                }
                _ => faults.damaged(line),
            }
        }
        let mut kept = kept.into_inner().map_err(|e| unwritable(&e.error()))?;
        kept.flush().map_err(|e| unwritable(&e))?;
        std::fs::rename(&part, path).map_err(|e| Error::unwritable(path, e))?;
        let file = OpenOptions::new().append(true).open(path).map_err(|e| Error::unwritable(path, e))?;
        Ok(Self::new(path, file, faults.words(last)))
    }

    /// What the table that is continued lacks, each a sentence with the name of the file.
    pub(crate) fn faults(&self) -> impl Iterator<Item = String> {
        self.faults.iter().map(|fault| format!("{}: {fault}", self.path.display()))
    }

    /// Appends a row, its columns joined by commas.
    pub(super) fn row(&mut self, row: fmt::Arguments<'_>) -> Result<()> {
        pass()?;
        writeln!(self.writer, "{row}").map_err(|e| Error::unwritable(&self.path, e))?;
        if self.flushed.elapsed() > FLUSH_EVERY { self.write_out() } else { Ok(()) }
    }

    /// Writes all rows to the file and synchronises it with the disk.
    pub(crate) fn flush(&mut self) -> Result<()> {
        pass()?;
        self.write_out()?;
        match self.writer.get_ref().sync_data() {
            // A pipe or a device in place of the file has nothing to synchronise.
            Err(error) if error.kind() != ErrorKind::InvalidInput => {
                Err(Error::unwritable(&self.path, error))
            }
            _ => Ok(()),
        }
    }

    fn write_out(&mut self) -> Result<()> {
        self.flushed = Instant::now();
        self.writer.flush().map_err(|e| Error::unwritable(&self.path, e))
    }
}

/// The columns that hold names; all others hold numbers, or are empty.
const NAMES: [&str; 3] = ["probe", "profile", "source"];

/// What a table lacks before the row after which it is continued.
#[derive(Debug, Default)]
struct Faults {
    /// Whether the first column counts steps, without a gap.
    by_step: bool,
    /// The first column of the last row.
    at: Option<f64>,
    /// The first steps that are missing: the rows before and after them.
    gap: Option<[f64; 2]>,
    /// Rows that are not text, have too few or too many columns or a word for a number: the line of the first, and their number.
    damaged: Option<(u64, usize)>,
    /// The same without those at the end of the file, where a run that was killed leaves an incomplete row.
    damaged_inside: Option<(u64, usize)>,
    /// Whether there were rows beyond those that are kept.
    ended: bool,
}

impl Faults {
    fn row(&mut self, first: f64) {
        if let Some(before) = self.at
            && self.by_step
            && first > before + 1.0
        {
            self.gap.get_or_insert([before, first]);
        }
        self.at = Some(first);
        self.damaged_inside = self.damaged;
    }

    fn damaged(&mut self, line: u64) {
        if !self.ended {
            self.damaged = Some(self.damaged.map_or((line, 1), |(first, count)| (first, count + 1)));
        }
    }

    fn words(self, last: f64) -> Vec<String> {
        let mut words = Vec::new();
        if let Some((line, count)) = self.damaged_inside {
            words.push(format!("{count} damaged rows, the first in line {line}, are left out"));
        }
        let behind = self.at.filter(|at| self.by_step && *at < last).map(|at| [at, last + 1.0]);
        if let Some([before, after]) = self.gap.or(behind) {
            words.push(format!(
                "the rows of the steps {} to {} are missing: they were lost when the run before ended",
                before + 1.0,
                after - 1.0
            ));
        }
        words
    }
}

/// Numbers joined by commas, as [`Number`] writes them.
pub(super) struct Numbers<'a>(pub &'a [f64]);

impl Display for Numbers<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (at, value) in self.0.iter().enumerate() {
            let comma = if at > 0 { "," } else { "" };
            write!(f, "{comma}{}", Number(*value))?;
        }
        Ok(())
    }
}

/// The shortest text that is read back as the same number, with an exponent if that is shorter.
pub(super) struct Number(pub f64);

impl Display for Number {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (value, size) = (self.0, self.0.abs());
        if size == 0.0 || (1e-4..1e16).contains(&size) {
            write!(f, "{value}")
        } else {
            write!(f, "{value:e}")
        }
    }
}

/// A time: a step that ends at the last number before a jump at 0.003 s is shown at 0.003, not at 0.0029999999999999996.
pub(super) struct Time(pub f64);

impl Display for Time {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        Number(without_rounding(self.0)).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_table_keeps_whole_rows_up_to_the_step() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        std::fs::write(&path, "step,time\n1,0.5\n2,1\n3,1.5\n4,").unwrap();
        let mut table = CsvFile::resume(&path, "step,time", 2.0).unwrap();
        assert_eq!(table.faults().count(), 0);
        table.row(format_args!("3,9")).unwrap();
        table.flush().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "step,time\n1,0.5\n2,1\n3,9\n");
    }

    #[test]
    fn a_table_with_other_columns_is_kept_beside_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("probes.csv");
        std::fs::write(&path, "a,b\n1,2\n").unwrap();
        let mut table = CsvFile::resume(&path, "step,time", 2.0).unwrap();
        table.flush().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "step,time\n");
        assert_eq!(std::fs::read_to_string(folder.path().join("probes.before.csv")).unwrap(), "a,b\n1,2\n");
        assert!(table.faults().all(|fault| fault.contains("did not name the columns")));
        assert_eq!(table.faults().count(), 1);
    }

    #[test]
    fn a_table_that_is_gone_is_told_where_the_run_was_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let faults = || CsvFile::resume(&path, "step,time", 2.0).unwrap().faults().count();
        assert_eq!(faults(), 0, "a run that is continued in another folder");
        std::fs::remove_file(&path).unwrap();
        std::fs::write(folder.path().join("checkpoint-2.h5"), "").unwrap();
        assert_eq!(faults(), 1);
    }

    #[test]
    fn rows_that_a_resumed_table_lacks_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let told = |bytes: &[u8], last: f64| {
            std::fs::write(&path, bytes).unwrap();
            CsvFile::resume(&path, "step,time", last).unwrap().faults().collect::<Vec<_>>().join("; ")
        };
        assert_eq!(told(b"step,time\n1,1\n2,2\n2,2\n3,3\n", 3.0), "");
        // Begun by a restart in another folder; a row cut off at the end.
        assert_eq!(told(b"step,time\n7,1\n8,2\n9", 8.0), "");
        assert!(told(b"step,time\n1,1\n4,4\n", 4.0).contains("the steps 2 to 3 are missing"));
        assert!(told(b"step,time\n1,1\n2,2\n", 4.0).contains("the steps 3 to 4 are missing"));
        let damaged = told(b"step,time\n1,1\n2,\xff\xfe\n3,3\n", 3.0);
        assert!(damaged.contains("1 damaged rows, the first in line 3"), "{damaged}");
        assert!(damaged.contains("the steps 2 to 2 are missing"), "{damaged}");
        let words = told(b"step,time\n1,1\n2,abc\n3,\n", 3.0);
        assert!(words.contains("1 damaged rows, the first in line 3"), "{words}");
    }

    #[test]
    fn text_is_read_back_and_never_a_formula() {
        let names = [
            "plain",
            "a, b",
            "say \"x\"",
            "two\nlines",
            "=cmd|' /C calc'!A1",
            "+1",
            "-1",
            "@a",
            "'q",
            "''",
            "",
        ];
        for name in names {
            let file = format!("time,profile,x\n1,{},2\n", entry(name));
            let rows: Vec<Record> = records(file.as_bytes()).collect();
            assert_eq!(rows[1].entries, ["1", name, "2"], "{file}");
            assert!(!entry(name).trim_start_matches('"').starts_with(['=', '+', '-', '@']), "{file}");
        }
        assert_eq!(entry("contact bottom"), "contact bottom");
    }

    #[test]
    fn names_with_commas_stay_in_a_resumed_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("profiles.csv");
        let text = format!("time,profile,x\n1,{0},2\n1,{1},2\n", entry("left, low"), entry("=top\"s"));
        std::fs::write(&path, &text).unwrap();
        assert_eq!(CsvFile::resume(&path, "time,profile,x", 1.0).unwrap().faults().count(), 0);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }

    #[test]
    fn numbers_read_back_exactly() {
        for value in [0.0, 0.1, -1.0 / 3.0, 1e-300, 6.02e23, 5e-324, 123456.789] {
            assert_eq!(Number(value).to_string().parse::<f64>().unwrap(), value);
        }
        assert_eq!(Numbers(&[0.5, 1e-9]).to_string(), "0.5,1e-9");
        assert_eq!(Time(0.003f64.next_down()).to_string(), "0.003");
        assert_eq!(Time(1.0 / 3.0).to_string().parse::<f64>().unwrap(), 1.0 / 3.0);
    }
}
