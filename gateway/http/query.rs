//! The query part of a request: known keys only, each at most once, with suggestions for misspelt ones.

use super::problem::ApiProblem;
use adapters::channel::find_nearest_name;
use std::str::FromStr;

/// Keys and values not yet taken.
#[derive(Debug)]
pub(super) struct QueryKeys {
    pairs: Vec<(String, String)>,
}

impl QueryKeys {
    /// Takes the pairs apart from what the request may say.
    ///
    /// # Errors
    /// An unknown or repeated key.
    pub(super) fn from_pairs(pairs: Vec<(String, String)>, known: &[&'static str]) -> Result<Self, ApiProblem> {
        for (index, (key, _)) in pairs.iter().enumerate() {
            if !known.contains(&key.as_str()) {
                let meant = find_nearest_name(key, known.iter().copied());
                let hint = match (meant, known) {
                    (Some(meant), _) => format!("did you mean {meant}?"),
                    (None, []) => "this address takes none".to_owned(),
                    (None, _) => format!("known are {}", known.join(", ")),
                };
                return Err(ApiProblem::bad_request(format!("unknown key {key:?}"), hint));
            }
            if pairs[..index].iter().any(|(earlier, _)| earlier == key) {
                return Err(ApiProblem::bad_request(format!("{key} is given twice"), "give it once"));
            }
        }
        Ok(Self { pairs })
    }

    /// The value of `key`, if it was given and not empty.
    #[must_use]
    pub(super) fn find_text(&self, key: &str) -> Option<&str> {
        self.pairs.iter().find(|(name, value)| name == key && !value.is_empty()).map(|(_, value)| value.as_str())
    }

    /// The value of `key`, parsed and within `least..=greatest`.
    ///
    /// # Errors
    /// A value that does not parse or lies outside.
    pub(super) fn parse_number<T>(&self, key: &str, least: T, greatest: T) -> Result<Option<T>, ApiProblem>
    where
        T: FromStr + PartialOrd + std::fmt::Display,
    {
        let Some(text) = self.find_text(key) else { return Ok(None) };
        match text.parse::<T>() {
            Ok(number) if number >= least && number <= greatest => Ok(Some(number)),
            _ => Err(ApiProblem::bad_request(
                format!("{key}={text} is not usable"),
                format!("give a number from {least} to {greatest}"),
            )),
        }
    }

    /// The comma-separated words of `key`.
    pub(super) fn split_list(&self, key: &str) -> impl Iterator<Item = &str> {
        self.find_text(key).unwrap_or_default().split(',').map(str::trim).filter(|word| !word.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(text: &[(&str, &str)]) -> Result<QueryKeys, ApiProblem> {
        let pairs = text.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        QueryKeys::from_pairs(pairs, &["from", "limit"])
    }

    #[test]
    fn a_misspelt_key_gets_a_suggestion() {
        let problem = keys(&[("form", "1")]).expect_err("unknown");
        assert_eq!((problem.status, problem.hint.as_str()), (400, "did you mean from?"));
        assert!(keys(&[("from", "1"), ("from", "2")]).is_err());
    }

    #[test]
    fn numbers_are_held_to_their_range() {
        let keys = keys(&[("limit", "NaN")]).expect("known");
        assert!(keys.parse_number("limit", 0.0, 10.0).is_err());
        assert!(keys.parse_number::<u32>("limit", 0, 10).is_err());
        assert_eq!(keys.parse_number::<u32>("from", 0, 10), Ok(None));
    }
}
