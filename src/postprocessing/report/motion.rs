//! An animation: the deformed body at the output times, with the nodes of a contact boundary on the graph of its law.

use super::{
    artifacts::{RunFiles, drawn_times},
    body::{Drawn, DrawnBody, Look},
    boundary::{Boundary, Laws},
    picture::Picture,
    scale::number,
    svg::open_svg,
};
use crate::{
    error::Result,
    io::output::{
        field_list::{FIELDS, VON_MISES},
        field_snapshot::Snapshot,
        output_field::OutputField,
    },
};
use std::fmt::Write;

/// The fewest drawings of an animation.
const FEWEST: usize = 3;
/// Seconds for which a drawing is shown.
const SECONDS: f64 = 0.6;

/// The animation of a run with these contacts, if its fields differ at three times or more.
pub(super) fn picture(found: &RunFiles, look: Look, contacts: &[Laws]) -> Result<Option<Picture>> {
    let Some(last) = &found.snapshot else { return Ok(None) };
    let times = drawn_times(last);
    if times.len() < FEWEST {
        return Ok(None);
    }
    let snapshots = times.into_iter().map(|step| found.snapshot_at(step)).collect::<Result<Vec<_>>>()?;
    let bodies: Vec<DrawnBody> =
        snapshots.iter().map(|snapshot| DrawnBody::new(snapshot).with_look(look)).collect();
    let all: Vec<&DrawnBody> = bodies.iter().collect();
    let common = DrawnBody::in_common("all drawings", &all, true);
    // A field whose value differs within a drawing, not only from one drawing to the next.
    let varies = |field: &&OutputField| {
        let name = field.picture.map(|picture| picture.name).filter(|name| common.has(name));
        name.is_some_and(|_| {
            bodies.iter().any(|body| matches!(body.of_field(field), Ok(Some(Drawn::Picture(_)))))
        })
    };
    let Some(field) = std::iter::once(&VON_MISES).chain(&FIELDS).find(varies) else { return Ok(None) };
    let graphs = graphs(found, contacts, &snapshots)?;
    let mut drawings = Vec::new();
    for (body, graph) in
        bodies.into_iter().zip(graphs.iter().map(Option::as_ref).chain(std::iter::repeat(None)))
    {
        if let Some(Drawn::Picture(picture)) = body.with_common(&common).of_field(field)? {
            let picture = picture.renamed(&format!("motion_{}", drawings.len()));
            drawings.push((picture, graph));
        }
    }
    Ok(animated(&drawings, last.time))
}

/// The nodes of the first contact boundary with a profile on the graph of its law, at the times of the snapshots at which there is
/// a profile.
fn graphs(found: &RunFiles, contacts: &[Laws], snapshots: &[Snapshot]) -> Result<Vec<Option<Picture>>> {
    let Some(profiles) = &found.profiles else { return Ok(Vec::new()) };
    let names = profiles.names();
    let on = |name: &String| contacts.iter().filter(|laws| laws.on.contains(name)).collect::<Vec<_>>();
    let Some(name) = names.iter().find(|name| !on(name).is_empty()) else { return Ok(Vec::new()) };
    let here = on(name);
    let Some((laws, others)) = here.split_first() else { return Ok(Vec::new()) };
    let rows = profiles.of(name);
    let mut boundaries = Vec::new();
    for snapshot in snapshots {
        let boundary = Boundary::new(rows.at("time", snapshot.time), name, Some(snapshot));
        boundaries.push(boundary.within(laws, others));
    }
    let nodes: Vec<[f64; 2]> = boundaries.iter().flat_map(Boundary::law_nodes).collect();
    boundaries.iter().map(|boundary| boundary.on_law(&nodes)).collect()
}

/// The drawings one after the other; where nothing moves, such as in a PNG file, the last.
fn animated(drawings: &[(Picture, Option<&Picture>)], end: f64) -> Option<Picture> {
    let (last, graph) = drawings.last()?;
    let heights = [Some(last), *graph].map(|picture| picture.map_or(0.0, |picture| height(&picture.svg)));
    let period = SECONDS * drawings.len() as f64;
    let mut svg = open_svg(heights.iter().sum());
    // Writing to a String cannot fail.
    let _ = write!(
        svg,
        "<style>.motion{{animation:motion {period:.2}s step-end infinite}}.motions:hover .motion{{animation-play-state:paused}}\
         @keyframes motion{{0%{{visibility:visible}}{:.3}%{{visibility:hidden}}}}\
         @media (prefers-reduced-motion:reduce){{.motion{{animation:none}}}}</style>\n\
         <g class=\"motions\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
        100.0 / drawings.len() as f64
    );
    for (n, (picture, graph)) in drawings.iter().enumerate() {
        let shown = if n + 1 == drawings.len() { "visible" } else { "hidden" };
        let delay = SECONDS * n as f64 - period;
        let _ = writeln!(
            svg,
            "<g class=\"motion\" visibility=\"{shown}\" style=\"animation-delay:{delay:.2}s\">\n{}",
            part(&picture.svg, 0.0)
        );
        if let Some(graph) = graph {
            svg += &part(&graph.svg, heights[0]);
        }
        svg += "</g>\n";
    }
    svg += "</g>\n</svg>";
    let law = if graph.is_some() {
        " Below: the nodes of the contact boundary on the graph of their law."
    } else {
        ""
    };
    let words = format!(
        "{} drawings of the deformed body up to {} s, one after the other",
        drawings.len(),
        number(end)
    );
    let caption = format!("{words}. Hover over the picture to pause. Last drawing: {}{law}", last.caption);
    Some(Picture::new("motion", words, caption, svg))
}

/// A drawing as a part of another, at this distance from its top.
fn part(svg: &str, top: f64) -> String {
    let (tag, rest) = svg.split_once('>').unwrap_or((svg, ""));
    let tag = tag.replace(" xmlns=\"http://www.w3.org/2000/svg\"", "");
    format!("{} y=\"{top:.0}\">{rest}", tag.trim_end())
}

/// The height of a drawing.
fn height(svg: &str) -> f64 {
    let value = svg.split_once("height=\"").and_then(|(_, rest)| rest.split('"').next()?.parse().ok());
    value.unwrap_or_default()
}
