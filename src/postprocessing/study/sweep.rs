//! The members of a sweep: the base job with every combination of the listed values and with every draw.

use super::document::{Draws, Run, SweptValue, Values};
use std::collections::BTreeMap;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// Longest name of a member.
const LONGEST_NAME: usize = 80;

/// A run of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Member {
    /// The run, whose overrides are the values.
    pub run: Run,
    /// A value for each key of the sweep.
    pub values: Vec<SweptValue>,
}

/// The number of members; the largest number that can be represented if there are more.
pub(super) fn count(sweep: &BTreeMap<String, Values>) -> usize {
    let mut count = usize::from(!sweep.is_empty());
    for values in sweep.values() {
        if let Values::List(list) = values {
            count = count.saturating_mul(list.len());
        }
    }
    count.saturating_mul(draws(sweep).unwrap_or(1))
}

/// The number of draws; keys with random values are drawn together.
fn draws(sweep: &BTreeMap<String, Values>) -> Option<usize> {
    let draws = |values: &Values| match values {
        Values::List(_) => None,
        Values::Draws(draws) => Some(draws.draws as usize),
    };
    sweep.values().find_map(draws)
}

/// All members; draws are in the innermost loop, then the values of the last key.
pub(super) fn members(sweep: &BTreeMap<String, Values>) -> Vec<Member> {
    let all = draws(sweep);
    let count = count(sweep);
    (0..count).map(|index| member(sweep, all, index)).collect()
}

/// Member `index`. The digits of the index in the mixed base of the numbers of values select the values.
fn member(sweep: &BTreeMap<String, Values>, draws: Option<usize>, index: usize) -> Member {
    let all = draws.unwrap_or(1);
    let (draw, mut rest) = (index % all, index / all);
    let mut values: Vec<SweptValue> = Vec::new();
    for (key, swept) in sweep.iter().rev() {
        values.push(match swept {
            Values::List(list) => {
                let value = list[rest % list.len()].clone();
                rest /= list.len();
                value
            }
            Values::Draws(draws) => SweptValue(drawn(key, draws, draw).into()),
        });
    }
    values.reverse();
    let listed = sweep.iter().zip(&values).filter(|((_, swept), _)| matches!(swept, Values::List(_)));
    let mut parts: Vec<String> =
        listed.map(|((key, _), value)| format!("{}-{}", short(key), value.text())).collect();
    parts.extend(draws.map(|_| format!("draw-{}", draw + 1)));
    let set = sweep.keys().zip(&values).map(|(key, value)| format!("{key}={}", value.0)).collect();
    Member { run: Run { name: Some(plain(&parts.join("-"))), set, ..Run::default() }, values }
}

/// Draw number `index` of a key. It depends on the seed, the key and the number only, so that further draws, other keys and other
/// parts of the study do not change it.
fn drawn(key: &str, draws: &Draws, index: usize) -> f64 {
    let bits = xxh3_64_with_seed(format!("{key} {index}").as_bytes(), u64::from(draws.seed));
    // The 53 leading bits as a number in [0, 1).
    let fraction = (bits >> 11) as f64 / (1u64 << 53) as f64;
    draws.from + fraction * (draws.to - draws.from)
}

/// The last part of a key; for an entry of a list also the part before it.
pub(super) fn short(key: &str) -> &str {
    let is_entry = |part: &str| part.bytes().all(|c| c.is_ascii_digit());
    let mut start = key.len();
    loop {
        let dot = key[..start].rfind('.');
        let part = &key[dot.map_or(0, |dot| dot + 1)..start];
        match dot {
            Some(dot) if is_entry(part) => start = dot,
            Some(dot) => return &key[dot + 1..],
            None => return key,
        }
    }
}

/// The text as the name of a folder.
fn plain(text: &str) -> String {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-' | '+');
    text.chars().map(|c| if fits(c) { c } else { '_' }).take(LONGEST_NAME).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(text: &str) -> BTreeMap<String, Values> {
        toml::from_str(text).expect("a sweep")
    }

    fn sets(text: &str) -> Vec<Vec<String>> {
        members(&sweep(text)).into_iter().map(|member| member.run.set).collect()
    }

    #[test]
    fn lists_give_all_combinations_with_values_as_written() {
        let text = "\"time.scheme\" = [\"bdf2\", \"implicit_euler\"]\n\"contact.0.friction.coulomb.coefficient\" = [0.1, 1, 1e-7]";
        let all = sets(text);
        assert_eq!(all.len(), 6);
        assert_eq!(all[0], ["contact.0.friction.coulomb.coefficient=0.1", "time.scheme=\"bdf2\""]);
        assert_eq!(all[3], ["contact.0.friction.coulomb.coefficient=1", "time.scheme=\"implicit_euler\""]);
        let distinct: std::collections::BTreeSet<_> = all.iter().collect();
        assert_eq!(distinct.len(), 6);
        let members = members(&sweep(text));
        assert_eq!(members[1].run.name.as_deref(), Some("coefficient-0.1-scheme-implicit_euler"));
        assert_eq!(members[4].values[0].number(), Some(1e-7));
        assert!(sets("").is_empty());
    }

    #[test]
    fn draws_depend_on_seed_key_and_number_only_and_fill_the_range() {
        let numbers = |text: &str, key: &str| -> Vec<f64> {
            let prefix = format!("{key}=");
            let all = sets(text).into_iter().flatten();
            all.filter_map(|set| set.strip_prefix(&prefix).map(|n| n.parse().expect("number"))).collect()
        };
        let few = numbers("\"a.b\" = { from = 2, to = 4, draws = 3, seed = 7 }", "a.b");
        let text = "\"a.b\" = { from = 2.0, to = 4.0, draws = 400, seed = 7 }\n\"c\" = { from = 2.0, to = 4.0, draws = 400, seed = 7 }";
        let many = numbers(text, "a.b");
        assert_eq!(many.len(), 400, "keys are drawn together");
        assert_eq!(few[..], many[..3]);
        assert_ne!(few, numbers("\"a.b\" = { from = 2, to = 4, draws = 3, seed = 8 }", "a.b"));
        assert_ne!(many, numbers(text, "c"));
        assert!(many.iter().all(|x| (2.0..4.0).contains(x)));
        // The mean of 400 uniform draws on [2, 4] has the standard deviation 0.029; each quarter holds 100 with deviation 8.7.
        let mean = many.iter().sum::<f64>() / 400.0;
        assert!((mean - 3.0).abs() < 0.12, "{mean}");
        for quarter in 0..4 {
            let low = 2.0 + 0.5 * f64::from(quarter);
            let inside = many.iter().filter(|x| (low..low + 0.5).contains(*x)).count();
            assert!((65..=135).contains(&inside), "{inside} in quarter {quarter}");
        }
    }

    #[test]
    fn a_grid_of_draws_has_each_draw_with_each_value() {
        let text = "\"traction.0.value.1\" = [-1.0, -2.0]\n\"x\" = { from = 0, to = 1, draws = 2 }";
        let all = members(&sweep(text));
        let names: Vec<_> = all.iter().filter_map(|member| member.run.name.clone()).collect();
        assert_eq!(
            names,
            ["value.1--1.0-draw-1", "value.1--1.0-draw-2", "value.1--2.0-draw-1", "value.1--2.0-draw-2"]
        );
        assert_eq!(all[0].values[1], all[2].values[1]);
        assert_ne!(all[0].values[1], all[1].values[1]);
    }

    #[test]
    fn a_sweep_of_any_size_is_counted_and_names_are_those_of_folders() {
        let list = format!("[{}]", vec!["1"; 100_000].join(","));
        let text: String = (0..5).map(|key| format!("\"k{key}\" = {list}\n")).collect();
        assert_eq!(count(&sweep(&text)), usize::MAX);
        assert_eq!(plain("bound-2*x/3 \u{e4}"), "bound-2_x_3__");
        assert_eq!(short("contact.0.friction.tresca.bound"), "bound");
        assert_eq!(short("time"), "time");
    }
}
