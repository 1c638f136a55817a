//! The `solver` binary: arguments to exit codes.

/// The commit that is built, or what the variable `CLARKE_GIT_ID` says of a source without one.
const SOURCE: &str = match option_env!("CLARKE_GIT_ID") {
    Some(id) => id,
    None => last_commit(include_bytes!(env!("CLARKE_GIT_LOG"))),
};

/// The first ten digits of the commit in the last line of git's log of `HEAD`: the commit before, this commit, who and when.
const fn last_commit(log: &'static [u8]) -> &'static str {
    let mut start = log.len().saturating_sub(1);
    while start > 0 && log[start - 1] != b'\n' {
        start -= 1;
    }
    let Some((_, line)) = log.split_at_checked(start) else { return "unknown" };
    let Some((_, commit)) = line.split_at_checked(41) else { return "unknown" };
    let Some((digits, _)) = commit.split_at_checked(10) else { return "unknown" };
    match std::str::from_utf8(digits) {
        Ok(digits) => digits,
        Err(_) => "unknown",
    }
}

fn main() -> std::process::ExitCode {
    clarke::cli::main(SOURCE)
}
