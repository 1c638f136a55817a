//! The batch scripts of `jobs/cluster` with a simulated batch system: for every spelling of the output folder in the job, a run
//! that stops with a checkpoint is submitted again and continues from the checkpoint.

use crate::{
    case::Case,
    launch::{Outcome, Running},
};
use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::Command,
};

/// The text before and after the tables of a job, an option, and the resulting output folder.
const SPELLINGS: [(&str, &str, Option<&str>, &str); 7] = [
    ("", "[output]\nfolder = \"double\"", None, "double"),
    ("", "[output]\nfolder='single'", None, "single"),
    ("output.folder = \"dotted\"", "", None, "dotted"),
    ("", "[ output ] # where results go\n'folder' = \"spaced\"", None, "spaced"),
    ("output = { folder = \"\"\"in \\\"one\\\" line\"\"\" }", "", None, "in \"one\" line"),
    ("", "", None, "out/job"),
    ("", "[output]\nfolder = \"file\"", Some("output.folder='option'"), "option"),
];

/// A job that stops with a checkpoint after its first step, in a folder with commands that only record their arguments.
struct Submission {
    case: Case,
    job: PathBuf,
}

impl Submission {
    fn new(before: &str, behind: &str) -> Self {
        let case =
            Case::square(3).without("output").set("time.end", "0.25").set("checkpoint.wall_limit", "1e-9");
        let job = case.written();
        let text = fs::read_to_string(&job).expect("job");
        fs::write(&job, format!("{before}\n{text}\n{behind}\n")).expect("written");
        let submission = Self { case, job };
        submission.command("squeue", "echo 2099-01-01T00:00:00");
        submission.command("scontrol", "echo \"$@\" >>\"${0%/*}/submitted\"");
        submission.command("qsub", "echo \"$@\" \"RESTART=$RESTART JOB=$JOB\" >>\"${0%/*}/submitted\"");
        submission.command(
            "qstat",
            "echo '    Resource_List.walltime = 01:00:00'; echo '    Resource_List.select = 1'",
        );
        submission
    }

    fn path(&self, name: &str) -> PathBuf {
        self.case.folder().join(name)
    }

    fn command(&self, name: &str, body: &str) {
        let file = self.path(name);
        fs::write(&file, format!("#!/bin/bash\n{body}\n")).expect("written");
        fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).expect("executable");
    }

    fn run(&self, script: &str, arguments: &[&str], variables: &[(&str, &str)]) -> Outcome {
        let path = format!("{}:{}", self.case.folder().display(), std::env::var("PATH").expect("PATH"));
        let mut command = Command::new("bash");
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/cluster").join(script)).args(arguments);
        command.current_dir(self.case.folder()).env("PATH", path).env_remove("OUTPUT");
        command
            .env("SOLVER", env!("CARGO_BIN_EXE_solver"))
            .env("LAUNCHER", "env")
            .envs(variables.iter().copied());
        Running::spawn(command).wait()
    }

    fn submitted(&self) -> Option<String> {
        let file = self.path("submitted");
        let words = fs::read_to_string(&file).ok()?;
        fs::remove_file(file).expect("removed");
        Some(words)
    }
}

#[test]
fn a_requeued_job_continues_from_the_folder_that_it_names_however_it_spells_it() {
    for (before, behind, option, folder) in SPELLINGS {
        let submission = Submission::new(before, behind);
        let mut arguments = vec!["job.toml"];
        arguments.extend(option.iter().flat_map(|set| ["--set", set]));
        let first = [&arguments[..], &["--force"]].concat();
        submission.run("slurm.sbatch", &first, &[("SLURM_JOB_ID", "7")]).expect(3).says("requeueing job 7");
        assert_eq!(submission.submitted().as_deref(), Some("requeue 7\n"), "{folder}");
        let checkpoint = submission.path(folder).join("checkpoint-1.h5");
        assert!(checkpoint.is_file(), "{folder}");
        let again = [("SLURM_JOB_ID", "7"), ("SLURM_RESTART_COUNT", "1")];
        submission
            .run("slurm.sbatch", &first, &again)
            .expect(3)
            .says(&format!("continuing from {}", checkpoint.display()));
        assert_eq!(submission.submitted().as_deref(), Some("requeue 7\n"), "{folder}");
        assert!(submission.path(folder).join("checkpoint-2.h5").is_file(), "{folder}");
        // A second submission by mistake loses nothing.
        submission.run("slurm.sbatch", &arguments, &[("SLURM_JOB_ID", "8")]).expect(2).says("--restart");
        assert!(
            submission.submitted().is_none() && submission.path(folder).join("checkpoint-2.h5").is_file()
        );
    }
}

#[test]
fn a_job_that_is_submitted_to_pbs_again_continues_from_the_folder_that_it_names() {
    for (before, behind, _, folder) in SPELLINGS.into_iter().filter(|spelling| spelling.2.is_none()) {
        let submission = Submission::new(before, behind);
        let here = submission.case.folder().display().to_string();
        let job = submission.job.display().to_string();
        let variables = [("PBS_O_WORKDIR", here.as_str()), ("PBS_JOBID", "7"), ("JOB", &job)];
        submission.run("pbs.sh", &[], &variables).expect(3).says("submitting again");
        let submitted = submission.submitted().expect("a submission");
        assert!(submitted.contains("RESTART=yes"), "{submitted}");
        assert!(submitted.contains(&format!("JOB={job}")) && !submitted.contains(&format!("-v JOB={job}")));
        let again = [&variables[..], &[("RESTART", "yes")]].concat();
        let checkpoint = submission.path(folder).join("checkpoint-1.h5");
        submission
            .run("pbs.sh", &[], &again)
            .expect(3)
            .says(&format!("continuing from {}", checkpoint.display()));
    }
}

#[test]
fn the_margin_of_a_pbs_job_counts_from_its_start_and_paths_may_contain_commas() {
    let submission = Submission::new("output.folder = \"a, b\"", "");
    let job = submission.path("a, job.toml");
    fs::rename(&submission.job, &job).expect("renamed");
    submission.command("slow", "sleep 2; exec \"$@\"");
    submission.command("timeout", "echo \"runs for $4 s\"; shift 4; exec \"$@\"");
    let (here, job) = (submission.case.folder().display().to_string(), job.display().to_string());
    let variables =
        [("PBS_O_WORKDIR", here.as_str()), ("PBS_JOBID", "7"), ("JOB", &job), ("LAUNCHER", "slow")];
    let outcome = submission.run("pbs.sh", &[], &variables).expect(3);
    let seconds = outcome.stdout.split_once("runs for ").and_then(|(_, rest)| rest.split_once(" s"));
    let seconds: u64 = seconds.and_then(|(number, _)| number.parse().ok()).expect("seconds");
    assert!(seconds <= 3600 - 120 - 2, "{seconds}");
    assert!(submission.submitted().expect("a submission").contains(&format!("JOB={job}")));
    assert!(submission.path("a, b/checkpoint-1.h5").is_file());
}
