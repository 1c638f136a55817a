//! The body to be turned and looked at in the page: its surface and its fields at several times, drawn by `viewer.js`.
//!
//! Numbers are 16 bits between the least and the largest value of a field at all times, which shows four digits of a range.

use super::{
    artifacts::{RunFiles, evenly},
    body::{AtCorners, DrawnBody, Look},
    colour::{LINES, VIRIDIS, hex},
    common::is_uniform,
    markup::escape,
    scale::extent,
};
use crate::{
    error::Result,
    io::output::{
        field_list::{BRANCH, CONTACT_STATUS, DISPLACEMENT, STATES_OF_CONTACT, VON_MISES},
        field_snapshot::Snapshot,
        output_field::Shading,
    },
};
use base64::{Engine, prelude::BASE64_STANDARD};
use serde_json::{Value, json};
use std::collections::BTreeMap;

const SCRIPT: &str = include_str!("viewer.js");
/// The most times.
const MOST_TIMES: usize = 60;
/// The most numbers of all fields at all times: 0.6 MB of the page.
const MOST_NUMBERS: usize = 220_000;
/// The most faces, which a browser still turns smoothly.
const MOST_FACES: usize = 200_000;
/// The most cells of all times together that are read.
const MOST_CELLS: usize = 5_000_000;
/// The number of a value that is not finite.
const NONE: u16 = u16::MAX;

/// The viewer of a run, in HTML: hidden where scripts are off. At first, this side of a solid is visible.
pub(super) fn viewer(found: &RunFiles, look: Look, side: Option<[f64; 3]>) -> Result<String> {
    let Some(last) = &found.snapshot else { return Ok(String::new()) };
    let body = DrawnBody::new(last).with_look(look);
    if body.faces().is_empty() || body.faces().len() > MOST_FACES {
        return Ok(String::new());
    }
    let surface = Surface::of(&body, last);
    let width = surface.vertices.len().max(surface.faces.len()) * (3 + body.quantities().len());
    let cells = last.cells.len() / last.corners;
    let most = MOST_TIMES.min(MOST_NUMBERS / width).min(MOST_CELLS / cells).max(1);
    let steps = evenly(last.times.len(), most);
    let snapshots = steps.iter().map(|step| found.snapshot_at(*step)).collect::<Result<Vec<_>>>()?;
    let bodies: Vec<DrawnBody> =
        snapshots.iter().map(|snapshot| DrawnBody::new(snapshot).with_look(look)).collect();
    let common = DrawnBody::in_common("", &bodies.iter().collect::<Vec<_>>(), false);
    let fields = fields(&surface, &bodies);
    if fields.is_empty() {
        return Ok(String::new());
    }
    let places = surface.vertices.iter().flat_map(|(node, _)| last.nodes[*node as usize]);
    let shown = fields.iter().position(|field| field["name"] == VON_MISES.name).unwrap_or(0);
    let data = json!({
        "dimension": last.dimension(),
        "magnification": common.magnification.unwrap_or(1.0),
        "toward": body.toward(side),
        "places": text(places.flat_map(|x| (x as f32).to_le_bytes())),
        "faces": text(surface.faces.iter().flatten().flat_map(|vertex| vertex.to_le_bytes())),
        "inside": text(surface.inside.iter().copied()),
        "times": snapshots.iter().map(|snapshot| snapshot.time).collect::<Vec<_>>(),
        "displacement": displacement(&surface, &snapshots),
        "fields": fields,
        "shown": shown,
        "shades": (0..=16).map(|n| hex(VIRIDIS.at(f64::from(n) / 16.0))).collect::<Vec<_>>(),
        "states": std::iter::once("#dddddd".to_owned()).chain(LINES.map(hex)).collect::<Vec<_>>(),
    });
    Ok(html(&data))
}

/// The faces of a body with vertices of their own: a node is one in each of its regions, so that values jump between these.
struct Surface {
    /// The node and the region of each vertex.
    vertices: Vec<(u32, u64)>,
    faces: Vec<[u32; 3]>,
    /// Bits: whether each edge, from a vertex to the next, lies inside a cell.
    inside: Vec<u8>,
}

impl Surface {
    fn of(body: &DrawnBody, snapshot: &Snapshot) -> Self {
        let regions = body.regions_of_faces();
        let mut numbers: BTreeMap<(u32, u64), u32> = BTreeMap::new();
        let mut surface = Self {
            vertices: Vec::with_capacity(snapshot.nodes.len()),
            faces: Vec::new(),
            inside: Vec::new(),
        };
        for (at, face) in body.faces().iter().enumerate() {
            let region = regions.as_ref().map_or(0, |regions| regions[at].to_bits());
            surface.faces.push(face.nodes.map(|node| {
                *numbers.entry((node, region)).or_insert_with(|| {
                    surface.vertices.push((node, region));
                    surface.vertices.len() as u32 - 1
                })
            }));
            surface.inside.push((0..3).map(|edge| u8::from(face.is_inside[edge]) << edge).sum());
        }
        surface
    }

    /// Values at the vertices by those at the corners of faces, or at the faces if they differ from one to the next at a vertex.
    fn values(&self, corners: &[[f64; 3]]) -> (&'static str, Vec<f64>) {
        let mut values = vec![f64::NAN; self.vertices.len()];
        let same = |a: f64, b: f64| a == b || (a.is_nan() && b.is_nan());
        let mut is_seen = vec![false; self.vertices.len()];
        for (face, corner) in self.faces.iter().zip(corners) {
            for (&vertex, &value) in face.iter().zip(corner) {
                let vertex = vertex as usize;
                if is_seen[vertex] && !same(values[vertex], value) {
                    return ("face", corners.iter().map(|corner| corner[0]).collect());
                }
                (values[vertex], is_seen[vertex]) = (value, true);
            }
        }
        ("vertex", values)
    }
}

/// The fields at all times, without those that are the same everywhere at all times.
fn fields(surface: &Surface, bodies: &[DrawnBody]) -> Vec<Value> {
    let mut of_times: Vec<Vec<AtCorners>> = bodies.iter().map(DrawnBody::quantities).collect();
    let names: Vec<String> = of_times.last().into_iter().flatten().map(|field| field.name.clone()).collect();
    let mut fields = Vec::new();
    for name in names {
        let mut here = Vec::new();
        for all in &mut of_times {
            let Some(at) = all.iter().position(|field| field.name == name) else { break };
            here.push(all.swap_remove(at));
        }
        let Some(AtCorners { words, unit, shading, .. }) = here.last().cloned() else { continue };
        let values: Vec<(&str, Vec<f64>)> = here.iter().map(|field| surface.values(&field.values)).collect();
        let is_per_face = values.iter().any(|(place, _)| *place == "face");
        let values: Vec<Vec<f64>> = if is_per_face {
            here.iter().map(|field| field.values.iter().map(|corner| corner[0]).collect()).collect()
        } else {
            values.into_iter().map(|(_, values)| values).collect()
        };
        let Some(ends @ (least, most)) = extent(values.iter().flatten().copied()) else { continue };
        if here.len() < bodies.len() || is_uniform(least, most) {
            continue;
        }
        let ranges = here.iter().filter_map(|field| field.range);
        let (low, high) = ranges.reduce(wider).unwrap_or(ends);
        let states = match name.as_str() {
            name if name == CONTACT_STATUS.name => Some(STATES_OF_CONTACT.map(String::from).to_vec()),
            name if name == BRANCH.name => Some((0..=most as usize).map(|n| n.to_string()).collect()),
            _ => None,
        };
        fields.push(json!({
            "name": name, "words": words, "unit": unit, "logarithmic": shading == Shading::Errors, "states": states,
            "place": if is_per_face { "face" } else { "vertex" }, "least": least, "most": most, "low": low, "high": high,
            "values": values.iter().map(|values| packed(values, ends)).collect::<Vec<_>>(),
        }));
    }
    fields
}

fn wider(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0.min(b.0), a.1.max(b.1))
}

/// The displacements of the vertices, in the manner of fields; `null` without any.
fn displacement(surface: &Surface, snapshots: &[Snapshot]) -> Value {
    let of_time = |snapshot: &Snapshot| -> Option<Vec<f64>> {
        let vectors = snapshot.vectors(&DISPLACEMENT)?;
        Some(surface.vertices.iter().flat_map(|(node, _)| vectors[*node as usize]).collect())
    };
    let Some(values) = snapshots.iter().map(of_time).collect::<Option<Vec<_>>>() else { return Value::Null };
    let Some(ends) = extent(values.iter().flatten().copied()) else { return Value::Null };
    let of_times: Vec<String> = values.iter().map(|values| packed(values, ends)).collect();
    json!({ "least": ends.0, "most": ends.1, "values": of_times })
}

/// Numbers of 16 bits between these ends.
fn packed(values: &[f64], (least, most): (f64, f64)) -> String {
    let range = (most - least).max(f64::MIN_POSITIVE);
    let number = |value: &f64| match (value - least) / range {
        share if share.is_finite() => (share.clamp(0.0, 1.0) * f64::from(NONE - 1)).round() as u16,
        _ => NONE,
    };
    text(values.iter().flat_map(|value| number(value).to_le_bytes()))
}

fn text(bytes: impl Iterator<Item = u8>) -> String {
    BASE64_STANDARD.encode(bytes.collect::<Vec<u8>>())
}

/// The controls, the drawing, the data and the script.
fn html(data: &Value) -> String {
    let mut options = String::new();
    for (at, field) in data["fields"].as_array().into_iter().flatten().enumerate() {
        let selected = if data["shown"] == at { " selected=\"selected\"" } else { "" };
        let words = field["words"].as_str().unwrap_or_default();
        options += &format!("<option value=\"{at}\"{selected}>{}</option>", escape(words));
    }
    let last = data["times"].as_array().map_or(0, |times| times.len().saturating_sub(1));
    let [times, turned] =
        [last > 0, data["dimension"] == 3].map(|shown| if shown { "" } else { " hidden=\"hidden\"" });
    // Inside a script element, only these signs are markup, the second in XML.
    let data_text = data.to_string().replace('<', "\\u003c").replace('&', "\\u0026");
    format!(
        "<div class=\"viewer\" hidden=\"hidden\">\n<div class=\"controls\">\n\
         <label>Field <select name=\"field\">{options}</select></label>\n\
         <span{times}><button type=\"button\" name=\"play\">Play</button> <label>Time <input type=\"range\" name=\"time\" min=\"0\" \
         max=\"{last}\" value=\"{last}\"/></label></span>\n\
         <label>Displacement × <input type=\"number\" name=\"factor\" min=\"0\" step=\"any\"/></label>\n\
         <label><input type=\"checkbox\" name=\"edges\" checked=\"checked\"/> Cells</label>\n\
         <span{turned}><button type=\"button\" name=\"along\" value=\"0\">Along x</button> <button type=\"button\" name=\"along\" \
         value=\"1\">y</button> <button type=\"button\" name=\"along\" value=\"2\">z</button></span>\n\
         <span><button type=\"button\" name=\"zoom\" value=\"1.25\" aria-label=\"Larger\">+</button> <button type=\"button\" \
         name=\"zoom\" value=\"0.8\" aria-label=\"Smaller\">−</button> <button type=\"button\" name=\"reset\">Reset view</button></span>\n\
         </div>\n<p class=\"about\" aria-live=\"polite\"></p>\n<canvas tabindex=\"0\" role=\"img\"></canvas>\n\
         <div class=\"key\"></div>\n<p class=\"reading\"></p>\n\
         <script type=\"application/json\">{data_text}</script>\n<script>//<![CDATA[\n{SCRIPT}//]]></script>\n</div>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::output::field_list::VELOCITY;

    fn square(stress: [f64; 2]) -> Snapshot {
        Snapshot {
            nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            cells: vec![0, 1, 2, 0, 2, 3],
            corners: 3,
            parts: 1,
            fields: BTreeMap::from([
                (DISPLACEMENT.name, [0.5, -0.25, 0.0].repeat(4)),
                (VELOCITY.name, vec![2.0; 12]),
                (VON_MISES.name, stress.to_vec()),
            ]),
            ..Snapshot::default()
        }
    }

    fn numbers(text: &Value) -> Vec<u16> {
        let bytes = BASE64_STANDARD.decode(text.as_str().expect("text")).expect("base64");
        bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect()
    }

    #[test]
    fn values_of_all_times_have_one_range_and_what_never_differs_is_left_out() {
        let snapshots = [square([0.0, 2.0]), square([4.0, f64::NAN])];
        let bodies: Vec<DrawnBody> = snapshots.iter().map(DrawnBody::new).collect();
        let surface = Surface::of(&bodies[0], &snapshots[0]);
        assert_eq!((surface.vertices.len(), &surface.faces[..]), (4, &[[0, 1, 2], [0, 2, 3]][..]));
        let fields = fields(&surface, &bodies);
        assert_eq!(fields.len(), 1, "the speed is the same everywhere");
        assert_eq!((&fields[0]["name"], &fields[0]["place"]), (&json!("von_mises"), &json!("vertex")));
        assert_eq!((&fields[0]["least"], &fields[0]["most"]), (&json!(0.0), &json!(4.0)));
        // Means at the nodes: 1, 0, 1, 2; then 4 at the node that only the first cell has.
        let half = (NONE - 1) / 2;
        assert_eq!(numbers(&fields[0]["values"][0]), [half / 2 + 1, 0, half / 2 + 1, half]);
        assert_eq!(numbers(&fields[0]["values"][1]), [NONE, NONE - 1, NONE, NONE]);
        let moved = displacement(&surface, &snapshots);
        assert_eq!(numbers(&moved["values"][0])[..3], [NONE - 1, 0, (NONE - 1) / 3 + 1]);
    }

    #[test]
    fn cells_of_one_colour_and_regions_keep_their_jumps() {
        let mut snapshot = square([1.0, 3.0]);
        let per_cell = Look { per_cell: true, ..Look::default() };
        let bodies = [DrawnBody::new(&snapshot).with_look(per_cell)];
        let surface = Surface::of(&bodies[0], &snapshot);
        let drawn = &fields(&surface, &bodies)[0];
        assert_eq!((&drawn["place"], numbers(&drawn["values"][0])), (&json!("face"), vec![0, NONE - 1]));
        snapshot.fields.insert("region", vec![0.0, 1.0]);
        let bodies = [DrawnBody::new(&snapshot)];
        let surface = Surface::of(&bodies[0], &snapshot);
        let drawn = &fields(&surface, &bodies)[0];
        assert_eq!(numbers(&drawn["values"][0]), [0, 0, 0, NONE - 1, NONE - 1, NONE - 1]);
        assert_eq!(drawn["place"], "vertex");
    }

    #[test]
    fn times_are_evenly_spaced_and_end_with_the_last() {
        assert_eq!(evenly(0, 5), [0]);
        assert_eq!(evenly(10, 1), [9]);
        assert_eq!(evenly(3, 60), [0, 1, 2]);
        assert_eq!(evenly(11, 6), [0, 2, 4, 6, 8, 10]);
    }

    #[test]
    fn nothing_in_the_data_ends_the_script() {
        let data =
            json!({ "fields": [{ "words": "</script><b>&" }], "times": [0.0], "dimension": 2, "shown": 0 });
        let html = html(&data);
        assert_eq!(html.matches("</script").count(), 2);
        assert!(html.contains("\\u003c/script>\\u003cb>\\u0026") && html.contains("&lt;/script&gt;"));
        assert!(!SCRIPT.contains("]]>"));
    }
}
