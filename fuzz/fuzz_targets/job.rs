//! Any bytes as a job file: refused in words, or a job whose effective form loads as the same job.
#![no_main]

use clarke_core::{error::Exit, job::Job};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let load = |text: &str| Job::from_text(text, "job.toml", Path::new("/nowhere"), &[]);
    match load(text) {
        Ok(loaded) => {
            let again = load(&loaded.job.to_toml().expect("a job can be written")).expect("and read");
            assert_eq!(again.job.physics(), loaded.job.physics());
            for traction in &loaded.job.traction {
                for value in &traction.value {
                    std::hint::black_box(value.evaluate(0.5, &[0.25, 0.75]));
                }
            }
        }
        Err(error) => {
            assert!(error.to_string().contains("job.toml"), "{error}");
            assert_eq!(Exit::from(error), Exit::Refused);
        }
    }
});
