//! `solver report`: pictures and one self-contained page from the output files of a run or a study.

mod arc;
mod boundary;
mod close_up;
mod comparison;
mod facts;
mod artifacts;
mod friction;
mod history;
mod law;
mod motion;
mod page;
mod run;
mod study;
mod support_motion;
mod table;
mod viewer;

use crate::{
    error::{Error, Result},
    io::output::field_list::VON_MISES,
    postprocessing::drawing::{body, chart, colour, common, markup, picture, scale, svg, view},
    run::version,
};
use artifacts::RunFiles;
use page::Page;
pub use run::Options;
use std::path::{Path, PathBuf};

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
pub fn report(folder: &Path, options: Options) -> Result<Made> {
    let (page, missing) = if study::is_study(folder) {
        (study::page(folder)?, Vec::new())
    } else {
        let found = RunFiles::read(folder)?;
        (run::page(&found, options)?, missing(&found))
    };
    write_page(&page, &folder.join("report/index.html"), options.force, missing)
}

/// Writes `report/comparison.html` in the first folder: a page with two runs side by side.
pub fn compare(folders: [&Path; 2], options: Options) -> Result<Made> {
    if let Some(study) = folders.into_iter().find(|folder| study::is_study(folder)) {
        let words = format!(
            "{} is the folder of a study, and runs are compared; its own report is that of `solver report {0}`, and the runs of a \
             study are in its folders",
            study.display()
        );
        return Err(Error::Refused(words));
    }
    let found = [RunFiles::read(folders[0])?, RunFiles::read(folders[1])?];
    let page = comparison::page(&found, options)?;
    let missing = found.iter().flat_map(|found| {
        missing(found).into_iter().map(|words| format!("{}: {words}", found.folder.display()))
    });
    write_page(&page, &folders[0].join("report/comparison.html"), options.force, missing.collect())
}

/// Descriptions of the files that are missing or unreadable.
fn missing(found: &RunFiles) -> Vec<String> {
    found.gaps.iter().map(|gap| format!("{}: {}", gap.file, gap.why)).collect()
}

/// What each page says, by which files of a user are told from those of a report.
const MADE_BY: &str = "Made by solver report";
/// The names of pages.
const PAGES: [&str; 2] = ["index.html", "comparison.html"];

fn write_page(page: &Page, path: &Path, force: bool, missing: Vec<String>) -> Result<Made> {
    let folder = path.parent().unwrap_or(path);
    let stress = page.pictures().iter().find(|picture| picture.name == VON_MISES.name);
    let small = stress.or(page.pictures().first());
    let pictures = page
        .pictures()
        .iter()
        .flat_map(|picture| ["svg", "png"].map(|end| format!("{}.{end}", picture.name)));
    let pictures: Vec<PathBuf> =
        pictures.chain(small.map(|_| "thumbnail.png".into())).map(|name| folder.join(name)).collect();
    if !force {
        refuse_own_files(path, &pictures)?;
    }
    std::fs::create_dir_all(folder).map_err(|error| Error::unwritable(folder, error))?;
    for picture in page.pictures() {
        write(&folder.join(format!("{}.svg", picture.name)), picture.file().as_bytes())?;
        write(&folder.join(format!("{}.png", picture.name)), &picture.png()?)?;
    }
    if let Some(picture) = small {
        write(&folder.join("thumbnail.png"), &picture.thumbnail()?)?;
    }
    let mut made_by = format!("{MADE_BY}, version {}. All quantities in SI units.", version());
    if !page.pictures().is_empty() {
        made_by += " The folder of this page contains the pictures as SVG and PNG files.";
    }
    let html = page.html(&made_by);
    write(path, html.as_bytes())?;
    Ok(Made { page: path.to_owned(), pictures: html.matches("<figure").count(), missing })
}

/// Refuses to overwrite a page that no report has written, and pictures in a folder without one of its pages.
fn refuse_own_files(page: &Path, pictures: &[PathBuf]) -> Result<()> {
    let is_made = |path: &Path| {
        let text = std::fs::read(path).unwrap_or_default();
        text.windows(MADE_BY.len()).any(|words| words == MADE_BY.as_bytes())
    };
    let is_there = |path: &&Path| path.symlink_metadata().is_ok();
    let has_report = PAGES.iter().any(|name| is_made(&page.with_file_name(name)));
    let pictures = pictures.iter().map(PathBuf::as_path).filter(|_| !has_report);
    match Some(page).filter(|page| !is_made(page)).into_iter().chain(pictures).find(is_there) {
        None => Ok(()),
        Some(own) => Err(Error::Refused(format!(
            "{}: no report has written this file, which would be overwritten; move it, or overwrite it with --force",
            own.display()
        ))),
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|error| Error::unwritable(path, error))
}
