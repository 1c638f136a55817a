//! Options of PETSc that a job must not set unless the user trusts it: they write files anywhere, load code, or open a connection.

/// Options that load code or other options, open a connection, or start a program.
const NEVER: [&str; 14] = [
    "dll_append",
    "dll_prepend",
    "history",
    "log",
    "log_all",
    "on_error_attach_debugger",
    "on_error_emacs",
    "options_file",
    "options_file_yaml",
    "options_string_file",
    "python",
    "saws_port_auto_select",
    "start_in_debugger",
    "stop_for_debugger",
];

/// Parts of names of options that name files.
const FILES: [&str; 6] = ["filename", "draw_save", "ooc_tmpdir", "ooc_prefix", "viewer_", "saws_"];

/// Viewers that write a file or open a connection, with or without a name.
const WRITERS: [&str; 12] = [
    "adios", "binary", "cgns", "draw", "exodusii", "glvis", "hdf5", "matlab", "python", "saws", "socket",
    "vtk",
];

/// Options that print, or write a file if their value names one; so do those that begin with `malloc`.
const PRINTERS: [&str; 6] = ["citations", "info", "log_mpe", "log_summary", "log_trace", "memory_view"];

/// What an option does beyond the run, if it does something.
pub(super) fn reaches_beyond_the_run(name: &str, value: &str) -> Option<String> {
    let (name, value) = (name.to_ascii_lowercase(), value.trim());
    if NEVER.contains(&name.as_str()) || ["options_file", "python_type"].iter().any(|end| name.ends_with(end))
    {
        return Some("loads code or options, writes files or starts a program".into());
    }
    if value == "python" {
        return Some("loads code".into());
    }
    if FILES.iter().any(|part| name.contains(part)) {
        return Some("names a file".into());
    }
    if value.contains('/') {
        return Some(format!("names a file: {value}"));
    }
    if PRINTERS.contains(&name.as_str()) || name.starts_with("malloc") {
        let file = if name == "info" { value.split(':').next().unwrap_or_default() } else { value };
        let prints =
            matches!(file.to_ascii_lowercase().as_str(), "" | "true" | "yes" | "1" | "false" | "no" | "0");
        return (!prints).then(|| format!("writes the file {file}"));
    }
    let is_shown = name.contains("view") || name.contains("monitor");
    // There may be several viewers, each with its own file: kind:file:format.
    let writes = |viewer: &str| {
        let mut parts = viewer.split(':').map(str::trim);
        let kind = parts.next().unwrap_or_default().to_ascii_lowercase();
        is_shown && WRITERS.contains(&kind.as_str()) || parts.next().is_some_and(|file| !file.is_empty())
    };
    value.split(',').any(writes).then(|| format!("writes a file or opens a connection: {value}"))
}

#[cfg(test)]
mod tests {
    use super::reaches_beyond_the_run;

    #[test]
    fn options_that_write_files_or_load_code_are_found() {
        for (name, value) in [
            ("log_view", ":/home/user/.bashrc"),
            ("log_view", "ascii:log.txt:ascii_info_detail"),
            ("ksp_view", "ascii:file"),
            ("mg_levels_1_ksp_view_mat", "binary"),
            ("mat_view", "hdf5:a.h5"),
            ("ksp_monitor", "ascii,ascii:file"),
            ("snes_monitor", "draw:image:a.png"),
            ("info", "file"),
            ("info", "file:ksp"),
            ("log_trace", "trace"),
            ("dll_append", "lib.so"),
            ("options_file", "more"),
            ("first_options_file", "more"),
            ("history", ""),
            ("pc_type", "python"),
            ("ksp_python_type", "os.System"),
            ("pc_python_type", "a.b"),
            ("viewer_binary_filename", "b"),
            ("on_error_attach_debugger", "gdb"),
            ("mat_mumps_ooc_tmpdir", "/etc"),
            ("log_summary", "times"),
            ("malloc_view", "memory"),
            ("malloc_dump", "memory"),
            ("citations", "papers.bib"),
            ("a_later_option", "/etc/passwd"),
        ] {
            assert!(reaches_beyond_the_run(name, value).is_some(), "{name} = {value:?}");
        }
    }

    #[test]
    fn options_of_solvers_and_printed_views_are_free() {
        for (name, value) in [
            ("snes_monitor", ""),
            ("ksp_monitor", "ascii"),
            ("ksp_view", "::ascii_info_detail"),
            ("ksp_view", "ascii::ascii_info_detail"),
            ("log_view", ""),
            ("info", ""),
            ("info", ":ksp,pc"),
            ("malloc_debug", "true"),
            ("citations", ""),
            ("ksp_type", "cg"),
            ("pc_gamg_threshold", "0.01,0.02"),
            ("mat_mumps_icntl_14", "50"),
            ("mg_levels_ksp_max_it", "3"),
            ("options_left", ""),
        ] {
            assert_eq!(reaches_beyond_the_run(name, value), None, "{name} = {value:?}");
        }
    }
}
