//! Invalid jobs in tests/refusals: the header of each lists the faults that must be reported and their positions. No other faults
//! may be reported.
//!
//! `# expect: line:column | fragment | fragment` is one fault; `# set: a.b=c` is an override.

use std::path::{Path, PathBuf};

use clarke::error::Exit;
use clarke::job::Job;

fn refusals() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/refusals");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("folder").map(|entry| entry.expect("entry").path()).collect();
    files.sort();
    files
}

fn header<'a>(text: &'a str, word: &str) -> Vec<&'a str> {
    text.lines().filter_map(|line| line.strip_prefix(word)).map(str::trim).collect()
}

/// The differences between expected and reported faults of this job.
fn differences(text: &str) -> Result<(), String> {
    let overrides: Vec<String> = header(text, "# set:").into_iter().map(str::to_owned).collect();
    let report = match Job::from_text(text, "job.toml", Path::new("."), &overrides) {
        Ok(_) => return Err("it is accepted".into()),
        Err(error) if Exit::from(error.clone()) == Exit::Refused => error.to_string(),
        Err(other) => return Err(format!("it is not refused but {other:?}")),
    };
    let mut faults: Vec<&str> = report.split("error: ").skip(1).collect();
    for expected in header(text, "# expect:") {
        let mut parts = expected.split(" | ");
        let place = parts.next().unwrap_or_default();
        let place = if place.starts_with("--set") { place.to_owned() } else { format!("job.toml:{place}") };
        let fragments: Vec<&str> = parts.collect();
        let found = faults.iter().position(|fault| {
            fault.contains(&format!("--> {place}\n")) && fragments.iter().all(|part| fault.contains(part))
        });
        match found {
            Some(index) => drop(faults.remove(index)),
            None => return Err(format!("not reported: {expected}\n\n{report}")),
        }
    }
    if faults.is_empty() { Ok(()) } else { Err(format!("not expected: {}", faults.join("\n"))) }
}

#[test]
fn every_fault_of_a_bad_job_is_reported_at_its_place_and_no_other() {
    let files = refusals();
    assert!(files.len() >= 30, "only {} bad jobs", files.len());
    let failures: Vec<String> = files
        .iter()
        .filter_map(|path| {
            let text = std::fs::read_to_string(path).expect("readable");
            differences(&text).err().map(|difference| format!("{}: {difference}", path.display()))
        })
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n=====\n"));
}

#[test]
fn files_that_are_no_text_or_too_large_are_refused_before_parsing() {
    let folder = tempfile::tempdir().expect("folder");
    let refused = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        Job::load(&path, &[]).expect_err(name).to_string()
    };
    assert!(refused("binary.toml", b"a = 1\n\xff\xfe").contains("binary.toml:2: not a text file"));
    assert!(refused("large.toml", &vec![b'#'; (1 << 20) + 1]).contains("at most 1048576 bytes"));
    assert!(
        refused("deep.toml", "a = ".bytes().chain([b'['; 100_000]).collect::<Vec<_>>().as_slice())
            .contains("not TOML")
    );
    let missing = Job::load(&folder.path().join("none.toml"), &[]).expect_err("missing");
    assert!(missing.to_string().contains("cannot read"), "{missing}");
}
