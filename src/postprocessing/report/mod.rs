//! `solver report`: pictures and one self-contained page from the output files of a run or a study.

mod arc;
mod boundary;
mod facts;
mod artifacts;
mod friction;
mod history;
mod law;
mod page;
mod study;
mod table;

use crate::{
    error::{Error, Result},
    fem::effect::Energy,
    io::output::field_list::FIELDS,
    postprocessing::drawing::{body, chart, colour, markup, picture, scale, view},
    run::VERSION,
};
use artifacts::{Found, Gap};
use body::Body;
use boundary::{Boundary, Laws};
use law::Law;
use markup::{escape, paragraph};
use page::Page;
use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

/// The result of a report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// The page.
    pub page: PathBuf,
    /// Number of pictures in the page; each is also a separate SVG and PNG file beside it (beside the study).
    pub pictures: usize,
    /// Descriptions of files that are missing or unreadable.
    pub missing: Vec<String>,
}

/// Writes `report/index.html` and the pictures beside it in the output folder of a run, or of a study.
pub fn report(folder: &Path) -> Result<Made> {
    let (page, missing) = if study::is_study(folder) {
        (study::page(folder)?, Vec::new())
    } else {
        let found = Found::read(folder)?;
        let missing = found.gaps.iter().map(|gap| format!("{}: {}", gap.file, gap.why)).collect();
        (page_of(&found)?, missing)
    };
    let target = folder.join("report");
    std::fs::create_dir_all(&target).map_err(|error| Error::unwritable(&target, error))?;
    for picture in page.pictures() {
        write(&target.join(format!("{}.svg", picture.name)), picture.file().as_bytes())?;
        write(&target.join(format!("{}.png", picture.name)), &picture.png()?)?;
    }
    let path = target.join("index.html");
    let made_by = format!(
        "Made by solver report, version {VERSION}. All quantities in SI units. The folder of this page contains the pictures as SVG and PNG files."
    );
    let html = page.html(&made_by);
    write(&path, html.as_bytes())?;
    Ok(Made { page: path, pictures: html.matches("<figure").count(), missing })
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|error| Error::unwritable(path, error))
}

fn page_of(found: &Found) -> Result<Page> {
    let about = found.job.as_ref().and_then(|job| job.about.as_ref());
    let name =
        found.folder.file_name().map_or_else(|| "Run".into(), |name| name.to_string_lossy().into_owned());
    let title = about.and_then(|about| about.title.clone()).unwrap_or(name);
    let mut page = Page::new(&title, head(found));
    if let Some(summary) = &found.summary {
        page.section("Summary", &facts::summary(summary), vec![]);
    }
    page.section("Certificates", &facts::certificates(found), vec![]);
    body_section(&mut page, found)?;
    boundary_sections(&mut page, found)?;
    time_sections(&mut page, found)?;
    if let Some(phases) = found.summary.as_ref().and_then(facts::phases) {
        page.section("Wall time", "", vec![phases]);
    }
    if let Some(text) = &found.text {
        let job = format!(
            "<details>\n<summary>job.toml with all defaults</summary>\n<pre>{}</pre>\n</details>\n",
            escape(text)
        );
        page.section("Effective job", &job, vec![]);
    }
    Ok(page)
}

fn head(found: &Found) -> String {
    let mut head = String::new();
    let about = found.job.as_ref().and_then(|job| job.about.as_ref());
    if let Some(reference) = about.and_then(|about| about.reference.as_ref()) {
        head += &paragraph(reference);
    }
    if let Some(authors) = about.map(|about| about.authors.join(", ")).filter(|authors| !authors.is_empty()) {
        head += &paragraph(&authors);
    }
    if let Some(summary) = &found.summary {
        head += &paragraph(&facts::ending(summary));
        head += &facts::warnings(summary);
    }
    if !found.gaps.is_empty() {
        head.push_str("<div class=\"missing\">\n<h2>Missing</h2>\n<ul>\n");
        for Gap { file, why, lacking } in &found.gaps {
            // Writing to a String cannot fail.
            let _ = writeln!(
                head,
                "<li><code>{file}</code>: {}. Without it this page lacks {lacking}.</li>",
                escape(why.trim_end().trim_end_matches('.'))
            );
        }
        head.push_str("</ul>\n</div>\n");
    }
    head
}

fn body_section(page: &mut Page, found: &Found) -> Result<()> {
    let Some(snapshot) = &found.snapshot else { return Ok(()) };
    let body = Body::new(snapshot);
    let drawn = FIELDS.iter().filter_map(|field| body.of_field(field).transpose());
    let pictures = drawn.collect::<Result<Vec<_>>>()?;
    let words = if pictures.is_empty() {
        paragraph("fields.vtkhdf contains a mesh, but no fields yet.")
    } else {
        String::new()
    };
    page.section("Body", &words, pictures);
    Ok(())
}

fn boundary_sections(page: &mut Page, found: &Found) -> Result<()> {
    let mut contacts: Vec<(&[String], Laws)> = Vec::new();
    for contact in found.job.iter().flat_map(|job| &job.contact) {
        let friction = contact.friction;
        let steps = match (&found.history, &contact.obstacle) {
            (Some(history), Some(_)) => history.curve("time", "dt"),
            _ => Vec::new(),
        };
        contacts.push((&contact.on, Laws { normal: Law::of(contact)?, friction, steps }));
    }
    let mut seen = Vec::new();
    if let Some(profiles) = found.profiles.as_ref().filter(|profiles| !profiles.is_empty()) {
        seen = profiles.names();
        for name in &seen {
            let contact = contacts.iter().find(|(on, _)| on.contains(name));
            let snapshot = found.snapshot.as_ref();
            let boundary = Boundary::new(profiles, name, contact.map(|(_, laws)| laws), snapshot);
            let mut pictures = boundary.pictures(snapshot)?;
            if let Some(snapshot) = snapshot.filter(|_| contact.is_some()) {
                pictures.extend(boundary.arrows(&Body::new(snapshot))?);
            }
            let heading =
                format!("{} {name}", if contact.is_some() { "Contact boundary" } else { "Boundary" });
            page.section(&heading, &boundary.branch_table(), pictures);
        }
    }
    let unseen: Vec<&String> =
        contacts.iter().flat_map(|(on, _)| on.iter()).filter(|name| !seen.contains(name)).collect();
    if !unseen.is_empty() {
        let words: String = unseen
            .iter()
            .map(|name| {
                paragraph(&format!(
                    "No profile along {name}: [[output.profile]] on = \"{name}\" in the job writes one."
                ))
            })
            .collect();
        page.section("Contact boundaries without profile", &words, vec![]);
    }
    Ok(())
}

fn time_sections(page: &mut Page, found: &Found) -> Result<()> {
    if let Some(probes) = found.probes.as_ref().filter(|probes| !probes.is_empty()) {
        page.section("Probes", "", history::probes(probes)?);
    }
    let dimension = found.dimension().unwrap_or(3);
    if let Some(resultants) = found.resultants.as_ref().filter(|resultants| !resultants.is_empty()) {
        let words = "Forces on the body. In every step they add up to the rate of momentum.";
        page.section("Resultants", &paragraph(words), history::resultants(resultants, dimension)?);
    }
    let Some(history) = found.history.as_ref() else { return Ok(()) };
    if history.is_empty() {
        page.section("Energy", &paragraph("history.csv contains no steps yet."), vec![]);
        return Ok(());
    }
    let unit = Energy::unit(dimension);
    page.section("Energy", "", history::energies(history, unit)?);
    let tolerance = found.job.as_ref().map(|job| job.solver.inclusion_tolerance);
    page.section("Steps", "", history::steps(history, tolerance)?);
    Ok(())
}
