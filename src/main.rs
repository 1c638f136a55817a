//! The `solver` binary: arguments to exit codes.

fn main() -> std::process::ExitCode {
    clarke::cli::main()
}
