//! Maps of the responses over the two keys of a sweep.

use super::{
    document::{SweptValue, Values},
    plan::Plan,
    plot::{dimension, unit_of_response},
    results::{Results, RunResult},
};
use crate::{
    error::Result,
    postprocessing::drawing::{
        chart::Axis,
        map::{Labels, Map},
        picture::Picture,
        scale::{extent, size},
    },
};

/// A key of the sweep with its different values.
struct Key<'a> {
    /// Its position among the keys of the sweep.
    position: usize,
    name: &'a str,
    values: Vec<&'a SweptValue>,
}

/// A map of each response, if two keys of the sweep have several values and none is drawn at random.
pub(super) fn all(plan: &Plan, results: &Results) -> Result<Vec<Picture>> {
    let Some([across, up]) = two_keys(plan, results) else { return Ok(Vec::new()) };
    let dimension = dimension(plan);
    let responses = results.response.iter().enumerate();
    let maps = responses.map(|(at, name)| {
        let unit = unit_of_response(name, dimension);
        map(results, [&across, &up], (at, Axis::new(name, unit)))
    });
    maps.collect()
}

/// The two keys of which the runs have several values.
fn two_keys<'a>(plan: &'a Plan, results: &'a Results) -> Option<[Key<'a>; 2]> {
    let mut keys = Vec::new();
    for (position, name) in results.sweep.iter().enumerate() {
        let Some(Values::List(list)) = plan.study.sweep.get(name) else { return None };
        let values = different(list);
        if values.len() > 1 {
            keys.push(Key { position, name, values });
        }
    }
    keys.try_into().ok()
}

/// The different values of a list: numbers in ascending order, others in that of the list.
fn different(list: &[SweptValue]) -> Vec<&SweptValue> {
    let mut values: Vec<&SweptValue> = Vec::new();
    for value in list {
        if !values.iter().any(|known| known.text() == value.text()) {
            values.push(value);
        }
    }
    if values.iter().all(|value| value.number().is_some()) {
        values.sort_by(|a, b| a.number().partial_cmp(&b.number()).unwrap_or(std::cmp::Ordering::Equal));
    }
    values
}

/// The map of a response, given by its position, over two keys.
fn map(results: &Results, [across, up]: [&Key<'_>; 2], (at, shown): (usize, Axis)) -> Result<Picture> {
    let is_at = |run: &&RunResult, key: &Key<'_>, value: &SweptValue| {
        run.sweep.get(key.position).is_some_and(|own| own.text() == value.text())
    };
    let mut values = Vec::with_capacity(across.values.len() * up.values.len());
    for row in &up.values {
        for column in &across.values {
            let mut runs = results.runs.iter();
            let run = runs.find(|run| is_at(run, across, column) && is_at(run, up, row));
            values.push(run.and_then(|run| *run.response.get(at)?));
        }
    }
    let space = if shown.unit.is_empty() { "" } else { " " };
    let range = match extent(values.iter().copied().flatten()) {
        Some((low, high)) => format!("from {} to {}{space}{}", size(low), size(high), shown.unit),
        None => "without values".into(),
    };
    let words = format!("{} over {} and {}: {range}", shown.quantity, across.name, up.name);
    let missing = values.iter().filter(|value| value.is_none_or(|value| !value.is_finite())).count();
    let crossed =
        if missing > 0 { format!(" {missing} runs without a value are crossed out.") } else { String::new() };
    let name = format!("map-{}", shown.quantity);
    let labels = |key: &Key<'_>| Labels {
        name: key.name.to_owned(),
        words: key.values.iter().map(|value| value.text()).collect(),
    };
    let map = Map { across: labels(across), up: labels(up), values, shown };
    let svg = map.svg(&name);
    Ok(Picture::new(&name, format!("Map of {words}"), format!("{words}.{crossed}"), svg))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_ascend_and_words_keep_their_order() {
        let list = |text: &str| -> Vec<SweptValue> {
            let table: std::collections::BTreeMap<String, Vec<SweptValue>> =
                toml::from_str(text).expect("a list");
            table.into_values().next().expect("a list")
        };
        let texts = |list: &[SweptValue]| -> Vec<String> {
            different(list).into_iter().map(SweptValue::text).collect()
        };
        assert_eq!(texts(&list("a = [3, 0.5, 1e-3, 3]")), ["0.001", "0.5", "3"]);
        assert_eq!(texts(&list("a = ['midpoint', 'bdf2', 'midpoint', 2]")), ["midpoint", "bdf2", "2"]);
    }
}
