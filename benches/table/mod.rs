//! Tables in documents that a benchmark writes: what stands between the two marks of a table is replaced.

use std::{fs, path::Path, process::Command};

/// Replaces the table `name` of a document by `body`, under a line that says on what machine, with what memory bandwidth (bytes a
/// second; `None` if the numbers do not depend on it) and when it was measured, and by which command.
pub fn write(document: &str, name: &str, command: &str, bandwidth: impl Into<Option<f64>>, body: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(document);
    let text = fs::read_to_string(&path).expect("the document");
    let (begin, end) = (format!("<!-- table {name} -->\n"), format!("<!-- end of table {name} -->"));
    let (before, rest) = text.split_once(&begin).unwrap_or_else(|| panic!("{document} has no {begin}"));
    let (_, after) = rest.split_once(&end).unwrap_or_else(|| panic!("{document} has no {end}"));
    let triad = bandwidth.into().map(|bytes| format!(" triad {:.1} GB/s,", bytes / 1e9));
    let head = format!(
        "`{command}` on {},{} {}:",
        machine(),
        triad.unwrap_or_default(),
        output("date", &["--utc", "+%F"]).unwrap_or_else(|| "unknown date".into())
    );
    fs::write(&path, format!("{before}{begin}{head}\n\n{}\n\n{end}{after}", body.trim_end()))
        .expect("written");
    println!("written: table {name} of {document}");
}

/// The processor, how many of its cores there are, and how wide its vectors are: kernels are compiled for each width.
fn machine() -> String {
    let facts = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let values = |key: &'static str| {
        facts.lines().filter_map(move |line| line.strip_prefix(key)?.split_once(": ")).map(|(_, value)| value)
    };
    let has =
        |feature: &str| values("flags").next().is_some_and(|all| all.split(' ').any(|one| one == feature));
    let bits = match ["avx512vl", "avx2"].map(has) {
        [true, _] => 512,
        [_, true] => 256,
        _ => 128,
    };
    let model = values("model name").next().unwrap_or("an unknown processor");
    format!("{} cores of {model} with {bits}-bit vectors", values("model name").count())
}

fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
