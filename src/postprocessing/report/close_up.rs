//! The part of a plane body around its contact, where that is much smaller than the body.

use crate::io::output::{
    field_list::{CONTACT_PRESSURE, FIELDS},
    field_snapshot::{History, Snapshot},
    fields::Place,
};

/// Share of the largest contact pressure above which a node belongs to the contact.
const PRESSED: f64 = 0.02;
/// Half of the side of the part over half of the length of the contact, and over the length of the edges there.
const AROUND: [f64; 2] = [2.5, 5.0];
/// Side of the part over the size of the body up to which it has a picture of its own.
const SMALL: f64 = 0.25;

/// The cells around the contact with their fields; `None` where there is no contact pressure, where the contact is not much smaller than the body,
/// and in space.
pub(super) fn around_contact(snapshot: &Snapshot) -> Option<Snapshot> {
    let pressures = snapshot.values(&CONTACT_PRESSURE).filter(|_| snapshot.dimension() == 2)?;
    let most = pressures.iter().copied().filter(|pressure| pressure.is_finite()).fold(0.0, f64::max);
    let is_pressed = |node: u32| most > 0.0 && pressures[node as usize] > PRESSED * most;
    let [low, high] = extent(snapshot, (0..snapshot.nodes.len() as u32).filter(|node| is_pressed(*node)))?;
    let whole = extent(snapshot, 0..snapshot.nodes.len() as u32)?;
    let near = snapshot.cells().filter(|cell| cell.iter().any(|node| is_pressed(*node)));
    let edge = near
        .filter_map(|cell| Some(larger_side(extent(snapshot, cell.iter().copied())?)))
        .fold(0.0, f64::max);
    let reach = f64::max(AROUND[0] * 0.5 * larger_side([low, high]), AROUND[1] * edge);
    if 2.0 * reach > SMALL * larger_side(whole) {
        return None;
    }
    let centre = [0, 1].map(|i| 0.5 * (low[i] + high[i]));
    let is_near = |node: &u32| (0..2).all(|i| (snapshot.nodes[*node as usize][i] - centre[i]).abs() <= reach);
    Some(part(snapshot, |cell| cell.iter().any(is_near)))
}

/// The corners of the box around these nodes.
fn extent(snapshot: &Snapshot, nodes: impl Iterator<Item = u32>) -> Option<[[f64; 2]; 2]> {
    nodes.map(|node| snapshot.nodes[node as usize]).fold(None, |range, [x, y, _]| {
        let [low, high] = range.unwrap_or([[x, y]; 2]);
        Some([[x.min(low[0]), y.min(low[1])], [x.max(high[0]), y.max(high[1])]])
    })
}

fn larger_side([low, high]: [[f64; 2]; 2]) -> f64 {
    f64::max(high[0] - low[0], high[1] - low[1])
}

/// The cells of the file of which a part is kept, with their nodes and fields.
fn part(snapshot: &Snapshot, is_kept: impl Fn(&[u32]) -> bool) -> Snapshot {
    let cells: Vec<&[u32]> = snapshot.cells().collect();
    let parts = snapshot.parts.max(1);
    let numbered =
        cells.chunks(parts).enumerate().filter(|(_, of_cell)| of_cell.iter().any(|cell| is_kept(cell)));
    let kept: Vec<usize> =
        numbered.flat_map(|(cell, of_cell)| (cell * parts..).take(of_cell.len())).collect();
    let mut nodes: Vec<usize> =
        kept.iter().flat_map(|cell| cells[*cell]).map(|node| *node as usize).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let number = |node: &u32| nodes.partition_point(|kept| *kept < *node as usize) as u32;
    let rows = |values: &[f64], place: Place, width: usize| -> Vec<f64> {
        let rows = if place == Place::Node { &nodes } else { &kept };
        rows.iter().flat_map(|row| &values[row * width..][..width]).copied().collect()
    };
    let field = |(name, values): (&&'static str, &Vec<f64>)| {
        let field = FIELDS.iter().find(|field| field.name == *name)?;
        Some((*name, rows(values, field.place, field.width())))
    };
    let history = |History { name, place, values }: &History| History {
        name: name.clone(),
        place: *place,
        values: rows(values, *place, 1),
    };
    Snapshot {
        time: snapshot.time,
        times: snapshot.times.clone(),
        nodes: nodes.iter().map(|node| snapshot.nodes[*node]).collect(),
        of_mesh: None,
        cells: kept.iter().flat_map(|cell| cells[*cell]).map(number).collect(),
        corners: snapshot.corners,
        parts: snapshot.parts,
        fields: snapshot.fields.iter().filter_map(field).collect(),
        histories: snapshot.histories.iter().map(history).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::output::field_list::{DISPLACEMENT, VON_MISES};

    /// Squares of two triangles, 0.1 m long, in rows of this number; pressed at these nodes of the bottom.
    fn square(n: usize, pressed: &[usize]) -> Snapshot {
        let side = n + 1;
        let nodes = (0..side * side).map(|at| [0.1 * (at % side) as f64, 0.1 * (at / side) as f64, 0.0]);
        let square = |at: usize| {
            let [a, b, c, d] = [at, at + 1, at + side, at + side + 1].map(|node| node as u32);
            [a, b, d, a, d, c]
        };
        let cells: Vec<u32> = (0..n * n).flat_map(|at| square(at / n * side + at % n)).collect();
        let mut pressures = vec![0.0; side * side];
        pressed.iter().for_each(|node| pressures[*node] = 3.0);
        let numbers = |count: usize| (0..count).map(|at| at as f64);
        Snapshot {
            nodes: nodes.collect(),
            corners: 3,
            fields: [
                (CONTACT_PRESSURE.name, pressures),
                (DISPLACEMENT.name, numbers(side * side).flat_map(|number| [number, 0.0, 0.0]).collect()),
                (VON_MISES.name, numbers(cells.len() / 3).collect()),
            ]
            .into(),
            cells,
            ..Snapshot::default()
        }
    }

    #[test]
    fn the_part_around_a_small_contact_keeps_the_places_and_fields_of_its_cells() {
        let whole = square(60, &[30, 31]);
        let part = around_contact(&whole).expect("a part");
        // Triangles with a node from 2.6 m to 3.5 m along x and up to 0.5 m along y: of the square at the upper left one.
        assert_eq!(part.cells.len() / 3, 2 * 11 * 6 - 1);
        let [nodes, cells] = [&DISPLACEMENT, &VON_MISES].map(|field| part.values(field).expect("a field"));
        assert_eq!([nodes.len(), cells.len()], [3 * part.nodes.len(), part.cells.len() / 3]);
        for (number, place) in nodes.iter().step_by(3).zip(&part.nodes) {
            assert_eq!(whole.nodes[*number as usize], *place);
        }
        for (number, cell) in cells.iter().zip(part.cells()) {
            let places = |snapshot: &Snapshot, cell: &[u32]| -> Vec<[f64; 3]> {
                cell.iter().map(|node| snapshot.nodes[*node as usize]).collect()
            };
            let of_whole = whole.cells().nth(*number as usize).expect("a cell");
            assert_eq!(places(&part, cell), places(&whole, of_whole));
        }
    }

    #[test]
    fn contacts_as_large_as_the_body_or_far_from_each_other_have_no_part() {
        assert!(around_contact(&square(60, &[])).is_none());
        assert!(around_contact(&square(60, &[3, 50])).is_none());
        assert!(around_contact(&square(8, &[4])).is_none());
    }
}
