//! The page of a run.

use super::{
    artifacts::{MissingFile, RunFiles},
    body::{self, Drawn, DrawnBody},
    boundary::{Boundary, Laws},
    close_up::around_contact,
    facts, history,
    law::Law,
    markup::{escape, paragraph},
    motion,
    page::{Page, Pictures},
    picture::Picture,
    support_motion::support_motions,
    view::{facets, mean_direction, unit},
    viewer,
};
use crate::{
    error::Result,
    fem::effect::Energy,
    io::output::{
        field_list::{CONTACT_TRACTION, FIELDS, VON_MISES},
        field_snapshot::{History, Snapshot},
        fields::Place,
    },
    job::{Contact, Job},
};
use std::fmt::Write;

/// Heading of the section with pictures of the body.
const BODY: &str = "Body";

/// The most constant quantities that are named where the page does not fold them.
const MOST_CONSTANT: usize = 3;

/// What a report draws.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Options {
    /// Whether each cell has one colour, instead of means at the nodes.
    pub per_cell: bool,
    /// Whether pictures of the body have contour lines.
    pub contours: bool,
    /// Whether files that no report has written are overwritten.
    pub force: bool,
}

/// The title of a run: that of its job, or the name of its folder.
pub(super) fn title(found: &RunFiles) -> String {
    let about = found.job.as_ref().and_then(|job| job.about.as_ref());
    let name =
        found.folder.file_name().map_or_else(|| "Run".into(), |name| name.to_string_lossy().into_owned());
    about.and_then(|about| about.title.clone()).unwrap_or(name)
}

/// The page of a run.
pub(super) fn page(found: &RunFiles, options: Options) -> Result<Page> {
    let mut page = Page::new(&title(found), head(found));
    let body = drawn_body(found, options);
    for (heading, mut words, pictures) in drawn_sections(found, body.as_ref())? {
        let is_body = heading == BODY;
        if is_body {
            let sides = found.snapshot.as_ref().map(|snapshot| contact_directions(found, snapshot));
            let side = sides.into_iter().flatten().next();
            words.insert_str(0, &viewer::viewer(found, look(found, options), side)?);
        }
        page.section(&heading, &words, pictures);
        if is_body && let Some(motion) = motion::picture(found, look(found, options), &contact_laws(found)?)?
        {
            page.section("Motion", "", vec![motion]);
        }
    }
    if let Some(summary) = &found.summary {
        page.section("Summary", &facts::summary(summary), vec![]);
    }
    let [brief, certificates] = facts::certificates(found);
    let certificates = if certificates.is_empty() {
        certificates
    } else {
        folded("Uniqueness and growth of solutions", &certificates)
    };
    page.section("Certificates", &(brief + &certificates), vec![]);
    if let Some(phases) = found.summary.as_ref().and_then(facts::phases) {
        page.section("Wall time", "", vec![phases]);
    }
    if let Some(text) = &found.text {
        let job = folded("job.toml with all defaults", &format!("<pre>{}</pre>\n", escape(text)));
        page.section("Effective job", &job, vec![]);
    }
    Ok(page)
}

/// Sections with pictures.
pub(super) type Sections = Vec<Section>;

/// Heading, HTML, pictures.
pub(super) type Section = (String, String, Vec<Picture>);

/// How bodies are drawn.
fn look(found: &RunFiles, options: Options) -> body::Look {
    let several_materials = found.job.as_ref().is_some_and(|job| !job.region.is_empty());
    let Options { per_cell, contours, .. } = options;
    body::Look { per_cell, contours, several_materials }
}

/// The body at the last time, if there are fields.
pub(super) fn drawn_body(found: &RunFiles, options: Options) -> Option<DrawnBody<'_>> {
    found.snapshot.as_ref().map(|snapshot| DrawnBody::new(snapshot).with_look(look(found, options)))
}

/// The sections of the body, the boundaries and the quantities over time.
pub(super) fn drawn_sections(found: &RunFiles, body: Option<&DrawnBody>) -> Result<Sections> {
    let mut sections = Sections::new();
    if let (Some(body), Some(snapshot)) = (body, &found.snapshot) {
        sections.push(body_section(found, body, snapshot)?);
    }
    boundary_sections(&mut sections, found, body)?;
    time_sections(&mut sections, found)?;
    Ok(sections)
}

fn folded(summary: &str, html: &str) -> String {
    format!("<details>\n<summary>{}</summary>\n{html}</details>\n", escape(summary))
}

fn head(found: &RunFiles) -> String {
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
        head += &facts::unstable(summary);
        head += &facts::reason(summary);
        head += &facts::warnings(summary);
        head +=
            &found.job.as_ref().map_or_else(String::new, |job| facts::expected(summary, job, &found.folder));
    }
    if !found.gaps.is_empty() {
        head.push_str("<div class=\"missing\">\n<h2>Missing</h2>\n<ul>\n");
        for MissingFile { file, why, lacking } in &found.gaps {
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

fn body_section(found: &RunFiles, body: &DrawnBody, snapshot: &Snapshot) -> Result<Section> {
    let mut drawn = Vec::new();
    for field in &FIELDS {
        drawn.extend(body.of_field(field)?);
    }
    // Histories of contact nodes are drawn along their boundaries, if there are profiles.
    let has_profiles = found.profiles.as_ref().is_some_and(|profiles| !profiles.is_empty());
    let is_of_body = |history: &&History| history.place == Place::Cell || !has_profiles;
    for history in snapshot.histories.iter().filter(is_of_body) {
        drawn.push(body.of_history(history)?);
    }
    if let Some(part) = around_contact(snapshot)
        && let Some(Drawn::Picture(picture)) = body.alike_to_scale(&part).of_field(&VON_MISES)?
    {
        let picture = picture.renamed("von_mises_around_contact");
        let caption = format!("Around the contact. {}", picture.caption);
        drawn.push(Drawn::Picture(Picture { caption, ..picture }));
    }
    for direction in contact_directions(found, snapshot) {
        let Some(side) = body.hidden_side(direction) else { continue };
        if let Some(Drawn::Picture(picture)) = side.of_field(&VON_MISES)? {
            drawn.push(Drawn::Picture(picture.renamed("von_mises_contact_side")));
            break;
        }
    }
    let (mut pictures, mut uniform) = (Vec::new(), Vec::new());
    for drawn in drawn {
        match drawn {
            Drawn::Picture(picture) => pictures.push(picture),
            Drawn::Uniform(words) => uniform.push(words),
        }
    }
    let mut words = String::new();
    if pictures.is_empty() && uniform.is_empty() {
        words += &paragraph("fields.vtkhdf contains a mesh, but no fields yet.");
    }
    words += &not_drawn(&uniform);
    if body.lacks_regions() {
        words += &paragraph(
            "Each cell has one colour, because fields.vtkhdf does not contain the regions: add [output] also = [\"region\"] to \
             the job to average values at the nodes within each region.",
        );
    }
    Ok((BODY.into(), words, pictures))
}

/// The mean outward normals of the contact boundaries of a solid that have a profile; without any, that of the facets under contact traction.
fn contact_directions(found: &RunFiles, snapshot: &Snapshot) -> Vec<[f64; 3]> {
    if snapshot.dimension() != 3 {
        return Vec::new();
    }
    let (Some(profiles), Some(job)) = (&found.profiles, &found.job) else {
        let tractions = snapshot.vectors(&CONTACT_TRACTION).unwrap_or_default();
        let touches =
            |node: &&u32| tractions.get(**node as usize).is_some_and(|traction| *traction != [0.0; 3]);
        let of_facet = |(nodes, normal): (Vec<u32>, [f64; 3])| {
            std::iter::repeat_n(unit(normal), nodes.iter().filter(touches).count())
        };
        let normals: Vec<[f64; 3]> = facets(snapshot).into_iter().flat_map(of_facet).collect();
        return mean_direction(&normals).into_iter().collect();
    };
    let names = profiles.names();
    let has_side = |name: &&String| {
        job.contact.iter().any(|contact| contact.on.contains(name) || contact.against.contains(name))
    };
    let touching = names.iter().filter(has_side);
    let rows = |name| profiles.of(name).last("time");
    touching.filter_map(|name| Boundary::new(rows(name), name, Some(snapshot)).direction()).collect()
}

/// The laws of each contact.
fn contact_laws(found: &RunFiles) -> Result<Vec<Laws>> {
    let of = |contact: &Contact| {
        let Contact { on, part, friction, .. } = contact;
        Ok(Laws { on: on.clone(), part: part.clone(), normal: Law::of(contact)?, friction: friction.clone() })
    };
    found.job.iter().flat_map(|job| &job.contact).map(of).collect()
}

fn boundary_sections(sections: &mut Sections, found: &RunFiles, body: Option<&DrawnBody>) -> Result<()> {
    let contacts = contact_laws(found)?;
    let mut seen = Vec::new();
    if let Some(profiles) = found.profiles.as_ref().filter(|profiles| !profiles.is_empty()) {
        seen = profiles.names();
        for name in &seen {
            let here: Vec<&Laws> = contacts.iter().filter(|contact| contact.on.contains(name)).collect();
            let snapshot = found.snapshot.as_ref();
            let new = || Boundary::new(profiles.of(name).last("time"), name, snapshot);
            let mut parts = Vec::new();
            for (at, laws) in here.iter().enumerate() {
                let others = [&here[..at], &here[at + 1..]].concat();
                parts.push(new().within(laws, &others));
            }
            let whole = new();
            // The backgrounds of curves show the branches of one law.
            let boundary = if let [part] = &parts[..] { part } else { &whole };
            let Pictures { mut pictures, constant } = boundary.pictures(snapshot)?;
            for (at, part) in parts.iter().enumerate() {
                let named = |picture: Picture| match at {
                    0 => picture,
                    _ => {
                        let name = format!("{}_{}", picture.name, at + 1);
                        picture.renamed(&name)
                    }
                };
                pictures.extend(part.graphs()?.into_iter().map(named));
            }
            // The other side of contact between bodies has no law, but the opposite tractions.
            let is_faced =
                found.job.iter().flat_map(|job| &job.contact).any(|contact| contact.against.contains(name));
            let touches = is_faced || !here.is_empty();
            if let Some(body) = body.filter(|_| touches) {
                pictures.extend(boundary.arrows(body)?);
            }
            let heading = format!("{} {name}", if touches { "Contact boundary" } else { "Boundary" });
            let tables: String = parts.iter().map(Boundary::branch_table).collect();
            sections.push((heading, not_drawn(&constant) + &tables, pictures));
        }
    }
    let mut unseen: Vec<&String> =
        contacts.iter().flat_map(|laws| &laws.on).filter(|name| !seen.contains(name)).collect();
    unseen.sort_unstable();
    unseen.dedup();
    if !unseen.is_empty() {
        let words: String = unseen
            .iter()
            .map(|name| {
                paragraph(&format!(
                    "No profile along {name}: [[output.profile]] on = \"{name}\" in the job writes one."
                ))
            })
            .collect();
        sections.push(("Contact boundaries without profile".into(), words, vec![]));
    }
    Ok(())
}

/// The quantities that have no picture because they are constant.
fn not_drawn(constant: &[String]) -> String {
    if constant.is_empty() {
        return String::new();
    }
    let words = "Not drawn, because constant:";
    let all = paragraph(&format!("{words} {}.", constant.join(", ")));
    if constant.len() > MOST_CONSTANT {
        folded(&format!("{words} {} quantities", constant.len()), &all)
    } else {
        all
    }
}

fn time_sections(sections: &mut Sections, found: &RunFiles) -> Result<()> {
    let mut add = |heading: &str, mut words: String, Pictures { pictures, constant }: Pictures| {
        words += &not_drawn(&constant);
        sections.push((heading.into(), words, pictures));
    };
    if let Some(probes) = found.probes.as_ref().filter(|probes| !probes.is_empty()) {
        add("Probes", String::new(), history::probes(probes)?);
    }
    let dimension = found.dimension().unwrap_or(3);
    let is_revolved = found.job.as_ref().is_some_and(Job::is_revolved);
    let of_units = if is_revolved { 3 } else { dimension };
    if let Some(resultants) = found.resultants.as_ref().filter(|resultants| !resultants.is_empty()) {
        let words = if is_revolved {
            "Forces on the body, all around. In every step those along the axis add up to the rate of change of momentum; stresses along the \
             hoop balance radial ones."
        } else {
            "Forces on the body. In every step they add up to the rate of change of momentum."
        };
        let supports = found.job.as_ref().map_or(Vec::new(), |job| support_motions(job, dimension));
        let drawn = history::resultants(resultants, &supports, [dimension, of_units])?;
        add("Resultants", paragraph(words), drawn);
    }
    let Some(history) = found.history.as_ref() else { return Ok(()) };
    if history.is_empty() {
        add("Energy", paragraph("history.csv contains no steps yet."), Pictures::default());
        return Ok(());
    }
    add("Energy", String::new(), history::energies(history, Energy::unit(of_units))?);
    let tolerance = found.job.as_ref().map(|job| job.solver.inclusion_tolerance);
    sections.push(("Steps".into(), String::new(), history::steps(history, tolerance)?));
    Ok(())
}
