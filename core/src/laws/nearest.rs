//! Suggestions for misspelt names.

/// The name in `known` that is closest to `name`, if it is close enough.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = name.to_lowercase().replace(['-', ' '], "_");
    let letters = lower.chars().count();
    known
        .into_iter()
        .map(|candidate| (distance(&lower, candidate), candidate))
        .filter(|&(distance, candidate)| distance <= letters.max(candidate.len()).div_ceil(3))
        .filter(|&(distance, candidate)| distance < letters.min(candidate.len()))
        .min()
        .map(|(_, candidate)| candidate)
}

/// Edit distance; if a name is the start of the other or its plural, the distance is 1.
fn distance(name: &str, candidate: &str) -> usize {
    let other = candidate.to_lowercase();
    let edits = strsim::damerau_levenshtein(name, &other);
    let starts = name.len().min(other.len()) >= 3 && (name.starts_with(&other) || other.starts_with(name));
    if starts { edits.min(1) } else { edits }
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn misspelt_names_find_what_was_meant() {
        let known = ["youngs_modulus", "poisson_ratio", "bottom", "top", "x"];
        assert_eq!(nearest("young_modulus", known), Some("youngs_modulus"));
        assert_eq!(nearest("Youngs-Modulus", known), Some("youngs_modulus"));
        assert_eq!(nearest("poisson", known), Some("poisson_ratio"));
        assert_eq!(nearest("botom", known), Some("bottom"));
        assert_eq!(nearest("X", known), Some("x"));
    }

    #[test]
    fn names_unlike_any_other_find_nothing() {
        assert_eq!(nearest("temperature", ["density", "x"]), None);
        assert_eq!(nearest("a", ["x", "y"]), None);
        assert_eq!(nearest("f", ["if", "t"]), None);
        assert_eq!(nearest("", ["x"]), None);
    }
}
