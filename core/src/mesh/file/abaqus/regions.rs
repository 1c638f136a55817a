//! Cells and their regions.

use super::elements::Part;
use super::model::{Model, Run};
use super::sets::{Resolved, find, shown};
use crate::error::{Error, Result};
use crate::mesh::file::document::{Block, Document};
use std::collections::{BTreeMap, HashMap, HashSet};

/// The region of each cell by its tag, and the names of the regions.
struct Regions {
    names: Vec<String>,
    of_cells: HashMap<u64, usize>,
}

/// Adds the cells of a model to a document, with a region each.
pub(super) fn add(
    document: &mut Document,
    model: &Model,
    (sets, dimension): (&[Resolved], usize),
) -> Result<()> {
    let cells: Vec<&Run> = model
        .runs
        .iter()
        .filter(|run| run.kind.part == Part::Cells && run.kind.shape.dimension() == dimension)
        .collect();
    let count = cells.iter().map(|run| run.tags.len()).sum();
    let regions = match of_sections(model, sets, count)?.or_else(|| of_partition(&cells, sets, count)) {
        Some(regions) => regions,
        None if cells.iter().any(|run| run.set.is_some()) => of_lines(&cells),
        None => of_sets(&cells, sets, &mut document.notes),
    };
    let too_many =
        || Error::Refused(format!("{} regions: at most {} are possible", regions.names.len(), u16::MAX));
    u16::try_from(regions.names.len()).map_err(|_| too_many())?;
    for (number, name) in (1..).zip(&regions.names) {
        document.names.insert((dimension, number), name.clone());
        document.groups.insert((dimension, number as i32), vec![number]);
    }
    for run in cells {
        let mut blocks: BTreeMap<usize, Block> = BTreeMap::new();
        for (tag, nodes) in run.elements() {
            let region = regions.of_cells.get(&tag).copied().unwrap_or(0);
            let block = || Block::new(run.kind.shape, run.kind.nodes, region as i32 + 1);
            let block = blocks.entry(region).or_insert_with(block);
            block.tags.push(tag);
            block.nodes.extend(nodes);
        }
        document.blocks.extend(blocks.into_values());
    }
    Ok(())
}

/// The sets of sections, if each of the cells is in just one.
fn of_sections(model: &Model, sets: &[Resolved], cells: usize) -> Result<Option<Regions>> {
    let mut regions = Regions { names: Vec::new(), of_cells: HashMap::new() };
    let mut seen: Vec<&Resolved> = Vec::new();
    let mut held = 0;
    for section in &model.sections {
        let set = find(sets, section, "element")?;
        if seen.iter().any(|other| std::ptr::eq(*other, set)) {
            continue;
        }
        seen.push(set);
        held += set.numbers.len();
        let region = regions.names.len();
        regions.of_cells.extend(set.numbers.iter().map(|&tag| (tag, region)));
        regions.names.push(shown(&set.name, sets));
    }
    Ok(Some(regions).filter(|regions| held == cells && regions.of_cells.len() == cells))
}

/// The sets of `*ELSET` with cells, if each of the cells is in just one, and there are as many as sets on the lines `*ELEMENT`.
fn of_partition(cells: &[&Run], sets: &[Resolved], count: usize) -> Option<Regions> {
    let all: HashSet<u64> = cells.iter().flat_map(|run| &run.tags).copied().collect();
    let on_lines: HashSet<String> =
        cells.iter().map(|run| run.set.as_deref().unwrap_or("body").to_ascii_uppercase()).collect();
    let mut regions = Regions { names: Vec::new(), of_cells: HashMap::new() };
    let mut held = 0;
    for set in sets.iter().filter(|set| !on_lines.contains(&set.name.text.to_ascii_uppercase())) {
        let of_set: Vec<u64> = set.numbers.iter().copied().filter(|tag| all.contains(tag)).collect();
        if of_set.is_empty() {
            continue;
        }
        held += of_set.len();
        if held > count {
            return None;
        }
        let region = regions.names.len();
        regions.of_cells.extend(of_set.into_iter().map(|tag| (tag, region)));
        regions.names.push(shown(&set.name, sets));
    }
    let is_partition =
        held == count && regions.of_cells.len() == count && regions.names.len() >= on_lines.len();
    is_partition.then_some(regions)
}

/// The sets on the lines `*ELEMENT`; the other cells are the region body.
fn of_lines(cells: &[&Run]) -> Regions {
    let mut regions = Regions { names: Vec::new(), of_cells: HashMap::new() };
    for run in cells.iter().filter(|run| !run.tags.is_empty()) {
        let name = run.set.as_deref().unwrap_or("body");
        let known = regions.names.iter().position(|other| other.eq_ignore_ascii_case(name));
        let region = known.unwrap_or(regions.names.len());
        if region == regions.names.len() {
            regions.names.push(name.to_owned());
        }
        regions.of_cells.extend(run.tags.iter().map(|&tag| (tag, region)));
    }
    regions
}

/// Sets of cells that do not overlap, smaller ones first; the other cells are the region body.
fn of_sets(cells: &[&Run], sets: &[Resolved], notes: &mut Vec<String>) -> Regions {
    let mut regions = Regions { names: Vec::new(), of_cells: HashMap::new() };
    let mut left: HashSet<u64> = cells.iter().flat_map(|run| &run.tags).copied().collect();
    let mut candidates: Vec<&Resolved> = sets.iter().filter(|set| !set.numbers.is_empty()).collect();
    candidates.sort_by_key(|set| set.numbers.len());
    candidates.retain(|set| left.contains(&set.numbers[0]));
    let mut overlapping = Vec::new();
    for set in candidates {
        if !set.numbers.iter().all(|tag| left.contains(tag)) {
            overlapping.push(shown(&set.name, sets));
            continue;
        }
        let region = regions.names.len();
        regions.names.push(shown(&set.name, sets));
        for tag in &set.numbers {
            left.remove(tag);
            regions.of_cells.insert(*tag, region);
        }
    }
    if !left.is_empty() {
        regions.names.push("body".into());
        let region = regions.names.len() - 1;
        regions.of_cells.extend(left.into_iter().map(|tag| (tag, region)));
    }
    if !overlapping.is_empty() {
        notes.push(format!(
            "these sets of elements are no regions, because smaller ones have cells in common with them: {}",
            overlapping.join(", ")
        ));
    }
    regions
}
