//! The page of `solver report`.

use crate::{browser::assert_fits, case::Case, launch};
use resvg::usvg::roxmltree::{Document, Node, ParsingOptions};
use std::path::{Path, PathBuf};

/// Writes the report of a finished case.
#[track_caller]
pub fn report(folder: &Path) -> PathBuf {
    launch::run_alone(&["report".as_ref(), folder.as_os_str()]).expect(0);
    folder.join("report/index.html")
}

fn parsed(html: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(html, options).expect("well-formed")
}

fn elements<'a, 'i>(page: &'a Document<'i>, tag: &str) -> Vec<Node<'a, 'i>> {
    page.descendants().filter(|node| node.tag_name().name() == tag).collect()
}

fn words_of(node: Node) -> String {
    node.descendants().filter_map(|inner| inner.text().filter(|_| inner.is_text())).collect()
}

/// The cell after the one with this text.
fn fact(page: &Document, name: &str) -> String {
    let header = elements(page, "th").into_iter().find(|th| words_of(*th) == name).expect(name);
    words_of(header.next_sibling_element().expect("value"))
}

fn files(folder: &Path, ending: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("folder").map(|entry| entry.expect("entry").path());
    let mut names: Vec<String> = entries
        .filter(|path| path.extension().is_some_and(|extension| extension == ending))
        .map(|path| path.file_stem().expect("name").to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Every picture of the page has a name, is drawn, and exists as SVG and PNG file; the page refers to no other files, and has no scripts but
/// those of the viewer, which is hidden without them.
#[track_caller]
fn check_page(page: &Path) -> Vec<String> {
    let html = std::fs::read_to_string(page).expect("page");
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    for outside in ["http:", "https:", "src=\"/", "url(/", "@import", "<script src"] {
        assert!(!html.contains(outside), "{outside}");
    }
    let document = parsed(&html);
    let is_hidden =
        |node: Node| node.attribute("class") == Some("viewer") && node.attribute("hidden").is_some();
    for script in elements(&document, "script") {
        assert!(script.parent().is_some_and(is_hidden), "a script outside of the viewer");
    }
    let mut names = Vec::new();
    for figure in elements(&document, "figure") {
        let name = figure.attribute("id").expect("id").to_owned();
        let drawing = figure.first_element_child().expect("drawing");
        assert_eq!(drawing.attribute("role"), Some("img"), "{name}");
        assert!(drawing.attribute("aria-label").is_some_and(|alt| alt.len() > 10), "{name}");
        assert!(words_of(figure.last_element_child().expect("caption")).len() > 10, "{name}");
        let shapes = drawing
            .descendants()
            .filter(|n| ["path", "polyline", "rect", "image"].contains(&n.tag_name().name()));
        assert!(shapes.count() > 3, "{name} is empty");
        names.push(name);
    }
    let mut ids: Vec<&str> = document.descendants().filter_map(|node| node.attribute("id")).collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count, "an id stands twice");
    for link in elements(&document, "a") {
        let target =
            link.attribute("href").and_then(|href| href.strip_prefix('#')).expect("a place of the page");
        assert!(ids.binary_search(&target).is_ok(), "{target}");
    }
    let levels = elements(&document, "h1").len();
    assert_eq!(levels, 1, "one main heading");
    let folder = page.parent().expect("folder");
    let mut sorted = names.clone();
    sorted.sort();
    assert_eq!(files(folder, "svg"), sorted);
    let mut with_thumbnail = sorted.clone();
    with_thumbnail.push("thumbnail".into());
    with_thumbnail.sort();
    assert_eq!(files(folder, "png"), with_thumbnail);
    for name in &sorted {
        let svg = std::fs::read_to_string(folder.join(format!("{name}.svg"))).expect("SVG");
        assert_eq!(parsed(&svg).root_element().tag_name().name(), "svg");
        let png = std::fs::read(folder.join(format!("{name}.png"))).expect("PNG");
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
        assert_eq!(u32::from_be_bytes([png[16], png[17], png[18], png[19]]), 1120, "width of {name}");
    }
    names
}

/// The square for which an independent program computed the numbers.
pub fn square() -> Case {
    Case::square(8)
}

#[test]
fn the_page_fits_wide_and_narrow_screens() {
    let case = square();
    case.run(1);
    assert_fits(&report(&case.folder().join("out")), case.folder());
}

#[test]
fn the_page_of_a_plane_run_has_its_pictures_and_the_known_numbers() {
    let case = square();
    case.run(2);
    let out = case.folder().join("out");
    let page = report(&out);
    let names = check_page(&page);
    for name in [
        "speed",
        "von_mises",
        "bottom_normal_velocity",
        "bottom_contact_pressure",
        "bottom_normal_displacement",
        "bottom_on_law",
        "bottom_normal_velocity_arrows",
        "bottom_contact_pressure_arrows",
        "motion",
        "probes_displacement_y",
        "probes_velocity_x",
        "force_0",
        "pressure_1",
        "energies",
        "dissipation",
        "energy_imbalance",
        "newton_iterations",
        "inclusion_residual",
        "wall_seconds",
    ] {
        assert!(names.iter().any(|other| other == name), "{name} is not in {names:?}");
    }
    let html = std::fs::read_to_string(&page).expect("page");
    assert!(
        html.contains("Not drawn, because constant:")
            && html.contains("touching area of contact bottom: 0.9375 m")
    );
    let document = parsed(&html);
    assert_eq!(
        words_of(elements(&document, "h1")[0]),
        "Dynamic viscoplastic contact with normal damped response"
    );
    assert_eq!(fact(&document, "status"), "completed");
    assert_eq!(fact(&document, "cells"), "128");
    assert_eq!(fact(&document, "largest von Mises stress at the end"), "26.042 Pa");
    let caption = |name: &str| {
        let figure =
            elements(&document, "figure").into_iter().find(|f| f.attribute("id") == Some(name)).expect(name);
        words_of(figure.last_element_child().expect("caption"))
    };
    assert!(
        caption("bottom_normal_velocity").contains("from 0 to 0.0060276 m/s"),
        "{}",
        caption("bottom_normal_velocity")
    );
    assert!(caption("bottom_normal_displacement").contains("to 0.035476 m,"));
    assert!(
        caption("von_mises").contains("to 26.042 Pa") && caption("von_mises").contains("displacement × ")
    );
    // At 0, 0.5 and 1 s; the profile begins after the first step.
    assert_eq!(html.matches("class=\"motion\"").count(), 3);
    assert_eq!(html.matches("class=\"motion\" visibility=\"visible\"").count(), 1);
    assert!(
        caption("motion").starts_with("3 drawings of the deformed body up to 1 s"),
        "{}",
        caption("motion")
    );
    assert!(caption("motion").contains("t = 1 s") && caption("motion").contains("on the graph of their law"));
    assert!(html.contains("below 1: the continuous problem has one solution"));
    assert!(html.contains("yield_stress = 19.0") && !html.contains("class=\"missing\""));
}

#[test]
fn each_node_of_the_contact_boundary_is_counted_on_the_branch_it_sits_on() {
    let case = square();
    let results = case.run(1);
    let out = case.folder().join("out");
    let html = std::fs::read_to_string(report(&out)).expect("page");
    let document = parsed(&html);
    let profiles = results.text("profiles.csv");
    let velocities: Vec<f64> = profiles
        .lines()
        .filter(|line| line.starts_with("1,bottom"))
        .map(|line| line.split(',').nth(5).expect("column").parse().expect("number"))
        .collect();
    assert_eq!(velocities.len(), 9);
    let between = |low: f64, high: f64| velocities.iter().filter(|v| (low..high).contains(*v)).count();
    let counted: Vec<String> = elements(&document, "tr")
        .into_iter()
        .filter(|row| row.first_element_child().is_some_and(|cell| words_of(cell).starts_with('S')))
        .map(|row| words_of(row.children().filter(Node::is_element).nth(3).expect("nodes")))
        .collect();
    let known = [0, 0, 0, between(0.0, 0.003), between(0.003, 0.005), between(0.005, 1.0)];
    assert_eq!(counted, known.map(|count| count.to_string()));
}

#[test]
fn the_page_of_a_solid_run_shows_its_surface_and_maps_of_its_contact_boundary() {
    let case = Case::cube(3)
        .set("output.profile", "[{on = 'bottom'}]")
        .set("output.also", "['contact_status', 'pressure']");
    case.run(2);
    let names = check_page(&report(&case.folder().join("out")));
    for name in [
        "speed",
        "von_mises",
        "von_mises_contact_side",
        "pressure",
        "bottom_contact_pressure",
        "bottom_contact_status",
        "bottom_on_law",
        "probes_velocity_z",
        "energies",
    ] {
        assert!(names.iter().any(|other| other == name), "{name} is not in {names:?}");
    }
}

/// A plate that tears, on its mesh of the repository.
fn plate() -> Case {
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/notched_plate.msh");
    Case::of("tearing_plate").set("mesh.file", &format!("{mesh:?}"))
}

#[test]
fn histories_are_drawn_and_what_is_the_same_everywhere_is_named() {
    let case = plate();
    case.run(1);
    let out = case.folder().join("out");
    let names = check_page(&report(&out));
    assert!(names.iter().any(|name| name == "damage"), "{names:?}");
    let intact = plate().set("material.damage.threshold", "1e9");
    intact.run(1);
    let page = report(&intact.folder().join("out"));
    assert!(!check_page(&page).iter().any(|name| name == "damage"));
    let html = std::fs::read_to_string(page).expect("page");
    assert!(html.contains("Not drawn, because constant: damage: 0."));
}

#[test]
fn cells_of_one_colour_and_contour_lines_on_request() {
    let case = square();
    case.run(1);
    let out = case.folder().join("out");
    let drawn = |option: Option<&str>| {
        let words = ["report", out.to_str().expect("text")].into_iter().chain(option);
        launch::run_alone(&words.map(<str as AsRef<std::ffi::OsStr>>::as_ref).collect::<Vec<_>>()).expect(0);
        let html = std::fs::read_to_string(out.join("report/index.html")).expect("page");
        (
            html.contains("drawn as means at the nodes"),
            std::fs::read(out.join("report/von_mises.png")).expect("PNG"),
        )
    };
    let [(is_mean, smooth), (is_mean_of_cells, cells), (_, contours)] =
        [None, Some("--cells"), Some("--contours")].map(drawn);
    assert!(is_mean && !is_mean_of_cells);
    assert!(smooth != cells && smooth != contours && cells != contours);
}

#[test]
fn two_runs_stand_side_by_side() {
    let cases = [square(), plate()];
    cases.iter().for_each(|case| drop(case.run(1)));
    let folders = [0, 1].map(|at| cases[at].folder().join("out"));
    let words = ["report".as_ref(), folders[0].as_os_str(), folders[1].as_os_str()];
    let outcome = launch::run_alone(&words).expect(0);
    assert!(outcome.stdout.contains("report/comparison.html with"), "{}", outcome.stdout);
    let page = folders[0].join("report/comparison.html");
    let html = std::fs::read_to_string(&page).expect("page");
    let document = parsed(&html);
    let is_side =
        |node: &Node| node.attribute("class").is_some_and(|class| ["left", "right"].contains(&class));
    let figures: Vec<Node> = document.descendants().filter(is_side).collect();
    let sides: Vec<&str> = figures.iter().filter_map(|figure| figure.attribute("class")).collect();
    assert!(sides.len() > 20 && sides.chunks(2).all(|pair| *pair == ["left", "right"]), "{sides:?}");
    let captions: Vec<String> = figures.iter().map(|figure| words_of(*figure)).collect();
    let pair = captions.chunks(2).find(|pair| pair[0].contains("von Mises")).expect("stress");
    assert!(pair[1].contains("von Mises") && pair[0] != pair[1], "{pair:?}");
    assert!(pair.iter().all(|words| words.contains("colours as in the other run")), "{pair:?}");
    assert!(captions.iter().any(|words| words == "The run on the left does not have this picture."));
    let row = |word: &str| {
        elements(&document, "tr").into_iter().find(|row| words_of(*row).starts_with(word)).expect("a row")
    };
    // Of a list of numbers, of a key that only one job has, and none of a key that both have.
    assert!(html.contains("Keys in which the jobs differ"));
    assert!(
        words_of(row("mesh.rectangle.cells")).contains("[8"),
        "{}",
        words_of(row("mesh.rectangle.cells"))
    );
    assert!(
        words_of(row("mesh.file")).contains("absent") || words_of(row("mesh.rectangle")).contains("absent")
    );
    let keys = elements(&document, "tr").into_iter().map(words_of).collect::<Vec<_>>();
    assert!(!keys.iter().any(|row| row.starts_with("output.folder")), "{keys:?}");
    let cells = row("cells");
    let numbers: Vec<String> = cells.children().filter(Node::is_element).map(words_of).collect();
    assert_eq!(numbers[..2], ["cells", "128"]);
    assert!(numbers[2].parse::<u64>().is_ok_and(|count| count != 128), "{numbers:?}");
    assert_fits(&page, cases[0].folder());
}

#[test]
fn a_report_is_the_same_on_one_and_several_processes() {
    let case = Case::square(4);
    case.run(1);
    let out = case.folder().join("out");
    let alone = std::fs::read(report(&out)).expect("page");
    let said = launch::run(2, &["report".as_ref(), out.as_os_str()]).expect(0).says("report/index.html with");
    assert_eq!(said.stdout.matches("index.html").count(), 1, "{}", said.stdout);
    assert!(alone == std::fs::read(out.join("report/index.html")).expect("page"));
}

#[test]
fn missing_and_damaged_files_are_named_and_the_rest_is_shown() {
    let case = Case::square(4);
    case.run(1);
    let out = case.folder().join("out");
    for name in [
        "job.toml",
        "summary.json",
        "history.csv",
        "resultants.csv",
        "probes.csv",
        "profiles.csv",
        "fields.vtkhdf",
    ] {
        let text = std::fs::read(out.join(name)).expect("file");
        std::fs::remove_file(out.join(name)).expect("removed");
        check_missing(&out, name, "it does not exist");
        std::fs::write(out.join(name), "[{,\nx y\nz").expect("written");
        check_missing(&out, name, name);
        std::fs::write(out.join(name), text).expect("written");
    }
    let html = std::fs::read_to_string(report(&out)).expect("page");
    assert!(!html.contains("class=\"missing\""));
}

#[track_caller]
fn check_missing(out: &Path, name: &str, why: &str) {
    drop(std::fs::remove_dir_all(out.join("report")));
    let page = report(out);
    assert!(check_page(&page).len() > 3, "without {name}");
    let html = std::fs::read_to_string(page).expect("page");
    let document = parsed(&html);
    let said: Vec<String> = elements(&document, "li").into_iter().map(words_of).collect();
    assert!(
        said.iter().any(|line| line.starts_with(&format!("{name}: ")) && line.contains(why)),
        "{name}: {said:?}"
    );
}

#[test]
fn a_failed_run_says_so_with_its_error() {
    let case = Case::square(4);
    case.run(1);
    let out = case.folder().join("out");
    let summary = std::fs::read_to_string(out.join("summary.json")).expect("summary");
    let failed = summary
        .replace("\"completed\"", "\"failed\"")
        .replace("\"error\": null", "\"error\": \"a <step> failed\"");
    std::fs::write(out.join("summary.json"), failed).expect("written");
    let html = std::fs::read_to_string(report(&out)).expect("page");
    let document = parsed(&html);
    assert_eq!(fact(&document, "status"), "failed");
    assert_eq!(fact(&document, "error"), "a <step> failed");
    assert_eq!(words_of(elements(&document, "pre")[0]), "a <step> failed", "before all sections");
}

#[test]
fn a_report_overwrites_its_own_files_only() {
    let case = square();
    case.run(1);
    let out = case.folder().join("out");
    let folder = out.join("report");
    for own in ["index.html", "von_mises.svg"] {
        std::fs::create_dir(&folder).expect("folder");
        std::fs::write(folder.join(own), "<p>notes</p>").expect("written");
        launch::run_alone(&["report".as_ref(), out.as_os_str()])
            .expect(2)
            .says(&format!("{own}: no report has written this file"))
            .says("overwrite it with --force");
        assert_eq!(std::fs::read_dir(&folder).expect("folder").count(), 1, "as it was");
        launch::run_alone(&["report".as_ref(), out.as_os_str(), "--force".as_ref()]).expect(0);
        report(&out);
        launch::run_alone(&["report".as_ref(), out.as_os_str(), out.as_os_str()]).expect(0);
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}

#[test]
fn a_run_at_rest_has_no_pictures_of_rounding_errors() {
    let ground = |support: &str, rest: &str| {
        Case::written_as(
            "material = {hypothesis = 'plane_strain', density = 1900, elasticity = {youngs_modulus = 6e7, poisson_ratio = 0.3}, \
             viscosity = {volumetric = 1e7, shear = 1e7}}",
        )
        .set("mesh.rectangle", "{size = [40, 10], cells = [20, 5]}")
        .set("support", &format!("[{{on = ['bottom'], fix = 'all'}}, {{on = ['left', 'right'], {support}}}]"))
        .set("gravity.acceleration", "[0, -9.81]")
        .set("checkpoint.every", "1000")
        .set("output.probe", "[{name = 'side', point = [40, 5]}]")
        .set("time", &format!("{{scheme = 'bdf2', {rest}}}"))
    };
    let settled = ground("fix = ['x']", "end = 20, step = 0.1");
    settled.run(1);
    let from = format!("{:?}", settled.folder().join("out"));
    let at_rest = ground("absorbing = true", "end = 1, step = 0.01").set("initial.from", &from);
    at_rest.run(1);
    let page = std::fs::read_to_string(report(&at_rest.folder().join("out"))).expect("page");
    let document = parsed(&page);
    let names: Vec<&str> =
        elements(&document, "figure").iter().filter_map(|figure| figure.attribute("id")).collect();
    assert!(names.contains(&"von_mises"), "{names:?}");
    for noise in ["speed", "velocity", "dissipation", "energies"] {
        assert!(!names.iter().any(|name| name.contains(noise)), "{noise} among {names:?}");
    }
}

#[test]
fn a_folder_without_a_run_is_refused_with_the_remedy() {
    let folder = tempfile::tempdir().expect("folder");
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("folder");
    let refused = |path: &Path, words: &str| {
        launch::run_alone(&["report".as_ref(), path.as_os_str()]).expect(2).says(words);
        let outcome = launch::run(2, &["report".as_ref(), path.as_os_str()]).expect(2);
        assert_eq!(outcome.stderr.matches(words).count(), 1, "{}", outcome.stderr);
    };
    refused(&empty, "is not the output folder of a run: it holds none of job.toml");
    refused(&folder.path().join("nowhere"), "nowhere does not exist");
    let case = Case::square(4);
    refused(&case.written(), "that is a job; give the output folder of its run");
    assert!(!empty.join("report").exists());
    let study = folder.path().join("study");
    std::fs::create_dir(&study).expect("folder");
    std::fs::write(study.join("study.json"), "{}").expect("written");
    launch::run_alone(&["report".as_ref(), empty.as_os_str(), study.as_os_str()])
        .expect(2)
        .says("study is the folder of a study, and runs are compared");
}
