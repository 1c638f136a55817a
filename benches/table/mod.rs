//! Tables in documents that a benchmark writes: what stands between the two marks of a table is replaced.

use std::{fs, path::Path, process::Command};

/// Replaces the table `name` of a document by `body`, under a line that says on what machine, with what memory bandwidth (bytes a
/// second) and when it was measured, and by which command.
pub fn write(document: &str, name: &str, command: &str, bandwidth: f64, body: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(document);
    let text = fs::read_to_string(&path).expect("the document");
    let (begin, end) = (format!("<!-- table {name} -->\n"), format!("<!-- end of table {name} -->"));
    let (before, rest) = text.split_once(&begin).unwrap_or_else(|| panic!("{document} has no {begin}"));
    let (_, after) = rest.split_once(&end).unwrap_or_else(|| panic!("{document} has no {end}"));
    let head = format!(
        "`{command}` on {}, triad {:.1} GB/s, {}:",
        machine(),
        bandwidth / 1e9,
        output("date", &["--utc", "+%F"]).unwrap_or_else(|| "unknown date".into())
    );
    fs::write(&path, format!("{before}{begin}{head}\n\n{}\n\n{end}{after}", body.trim_end()))
        .expect("written");
    println!("written: table {name} of {document}");
}

/// The processor and how many of its cores there are.
fn machine() -> String {
    let facts = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = facts.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{cores} cores of {}", model.map_or("an unknown processor", |(_, name)| name))
}

fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
