//! CSV tables that are extended row by row and continued by a restart; rank 0 writes them.

use crate::error::{Error, Result};
use crate::parallel::agreement::pass;
use crate::solver::stepping::without_rounding;
use std::{
    fmt::{self, Display, Formatter},
    fs::{File, OpenOptions},
    io::{BufRead, BufReader, BufWriter, Write},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// Longest time between two flushes of rows, and between two writes of waiting times of fields.
pub(super) const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// A CSV file open for appending.
#[derive(Debug)]
pub(super) struct CsvFile {
    path: PathBuf,
    writer: BufWriter<File>,
    flushed: Instant,
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
        Ok(Self { path: path.to_owned(), writer: BufWriter::new(file), flushed: Instant::now() })
    }

    /// Continues a table, keeping the rows whose first column is at most `last`; creates one if there is none or its header
    /// differs.
    fn resume(path: &Path, header: &str, last: f64) -> Result<Self> {
        pass()?;
        let Ok(old) = File::open(path) else { return Self::create(path, header) };
        let mut lines = BufReader::new(old).lines();
        if !matches!(lines.next(), Some(Ok(first)) if first == header) {
            return Self::create(path, header);
        }
        let part = path.with_extension("csv.part");
        let unwritable = |e: std::io::Error| Error::unwritable(&part, e);
        let mut kept = BufWriter::new(File::create(&part).map_err(unwritable)?);
        writeln!(kept, "{header}").map_err(unwritable)?;
        let columns = header.split(',').count();
        for line in lines.map_while(|line| line.ok()) {
            let first = line.split(',').next().and_then(|value| value.parse::<f64>().ok());
            if first.is_some_and(|value| value <= last) && line.split(',').count() == columns {
                writeln!(kept, "{line}").map_err(unwritable)?;
            }
        }
        kept.flush().map_err(unwritable)?;
        std::fs::rename(&part, path).map_err(|e| Error::unwritable(path, e))?;
        let file = OpenOptions::new().append(true).open(path).map_err(|e| Error::unwritable(path, e))?;
        Ok(Self { path: path.to_owned(), writer: BufWriter::new(file), flushed: Instant::now() })
    }

    /// Appends a row, its columns joined by commas.
    pub(super) fn row(&mut self, row: fmt::Arguments<'_>) -> Result<()> {
        pass()?;
        writeln!(self.writer, "{row}").map_err(|e| Error::unwritable(&self.path, e))?;
        if self.flushed.elapsed() > FLUSH_EVERY { self.write_out() } else { Ok(()) }
    }

    /// Flushes all rows to the file.
    pub(super) fn flush(&mut self) -> Result<()> {
        pass()?;
        self.write_out()
    }

    fn write_out(&mut self) -> Result<()> {
        self.flushed = Instant::now();
        self.writer.flush().map_err(|e| Error::unwritable(&self.path, e))
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
        std::fs::write(&path, "step,time\n1,0.5\n2,1\n2\n3,1.5\n4,").unwrap();
        let mut table = CsvFile::resume(&path, "step,time", 2.0).unwrap();
        table.row(format_args!("3,9")).unwrap();
        table.flush().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "step,time\n1,0.5\n2,1\n3,9\n");
    }

    #[test]
    fn a_table_with_other_columns_is_started_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("probes.csv");
        std::fs::write(&path, "a,b\n1,2\n").unwrap();
        CsvFile::resume(&path, "step,time", 2.0).unwrap().flush().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "step,time\n");
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
