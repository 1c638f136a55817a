//! A part of the runs of a study, so that several jobs of a cluster can execute one study.

use std::str::FromStr;

/// Every `count`-th run, starting with run `first`, counted from 1; written `first/count`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    first: usize,
    count: usize,
}

impl Part {
    /// Whether the run with this index, counted from 0, belongs to this part.
    pub fn has(self, index: usize) -> bool {
        index % self.count == self.first - 1
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers =
            text.split_once('/').and_then(|(first, count)| Some((first.parse().ok()?, count.parse().ok()?)));
        match numbers {
            Some((first, count)) if 1 <= first && first <= count => Ok(Self { first, count }),
            _ => Err("a part is written I/N with 1 <= I <= N: 2/8 is the second of eight".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_run_is_of_one_part() {
        let parts: Vec<Part> = ["1/3", "2/3", "3/3"].map(|text| text.parse().expect(text)).to_vec();
        for index in 0..8 {
            assert_eq!(parts.iter().filter(|part| part.has(index)).count(), 1, "run {index}");
        }
        assert!(parts[1].has(4));
    }

    #[test]
    fn what_is_no_part_is_refused() {
        for text in ["0/3", "4/3", "1/0", "2", "a/b", "-1/2", ""] {
            assert!(text.parse::<Part>().is_err(), "{text}");
        }
    }
}
