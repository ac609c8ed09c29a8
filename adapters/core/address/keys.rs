//! The part of an address after the question mark, taken key by key so that what is left over can be refused.

use crate::channel::find_nearest_name;
use crate::percent;
use crate::text::TextEncoding;
use std::fmt::Display;
use std::str::FromStr;

/// `key=value` pairs joined by `&`; values may hold `%20`-style escapes.
#[derive(Debug)]
pub struct Keys {
    given: Vec<(String, String)>,
    known: Vec<&'static str>,
    problems: Vec<String>,
}

impl Keys {
    /// The keys of a text `a=1&b=2`.
    #[must_use]
    pub fn from_query(query: &str) -> Self {
        let mut keys = Self { given: Vec::new(), known: Vec::new(), problems: Vec::new() };
        for pair in query.split('&').filter(|pair| !pair.is_empty()) {
            match pair.split_once('=') {
                Some((key, value)) if !value.is_empty() => keys.add(key, value),
                _ => keys.add_problem(format!("{pair:?} is not key=value")),
            }
        }
        keys
    }

    fn add(&mut self, key: &str, value: &str) {
        if self.given.iter().any(|(known, _)| known == key) {
            return self.add_problem(format!("{key} is given twice"));
        }
        self.given.push((key.to_owned(), percent::unescape_percent(value)));
    }

    /// Adds what is wrong with a key, in words; the address is refused with all of them.
    pub fn add_problem(&mut self, problem: String) {
        self.problems.push(problem);
    }

    /// The text of a key, if it was given.
    pub fn take_text(&mut self, key: &'static str) -> Option<String> {
        self.known.push(key);
        let at = self.given.iter().position(|(given, _)| given == key)?;
        Some(self.given.swap_remove(at).1)
    }

    /// A number within a range, or the default.
    pub fn take_number<T>(&mut self, key: &'static str, default: T, least: T, greatest: T) -> T
    where
        T: FromStr + PartialOrd + Display + Copy,
    {
        let Some(text) = self.take_text(key) else { return default };
        match text.parse::<T>() {
            Ok(number) if number >= least && number <= greatest => number,
            _ => {
                self.add_problem(format!("{key}={text}: give a number from {least} to {greatest}"));
                default
            }
        }
    }

    /// A number within a range, if it was given.
    pub fn take_optional_number<T>(&mut self, key: &'static str, least: T, greatest: T) -> Option<T>
    where
        T: FromStr + PartialOrd + Display + Copy,
    {
        let given = self.given.iter().any(|(given, _)| given == key);
        let number = self.take_number(key, least, least, greatest);
        given.then_some(number)
    }

    /// One of several words, or the first of them.
    pub fn take_choice<T: Copy>(&mut self, key: &'static str, choices: &[(&'static str, T)]) -> T {
        let Some(text) = self.take_text(key) else { return choices[0].1 };
        if let Some((_, value)) = choices.iter().find(|(word, _)| *word == text) {
            return *value;
        }
        let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
        self.add_problem(format!("{key}={text}: give one of {}", words.join(", ")));
        choices[0].1
    }

    /// Every problem, with the keys that nobody asked for.
    #[must_use]
    pub fn into_problems(mut self) -> Vec<String> {
        for (key, _) in std::mem::take(&mut self.given) {
            let hint = match find_nearest_name(&key, self.known.iter().copied()) {
                Some(near) => format!("; did you mean {near}?"),
                None if self.known.is_empty() => "; this address has no keys".to_owned(),
                None => format!("; the keys here are {}", self.known.join(", ")),
            };
            self.problems.push(format!("unknown key {key}{hint}"));
        }
        self.problems
    }
}

/// `encoding=gbk`: the character set of a device's texts.
pub fn parse_encoding(keys: &mut Keys) -> TextEncoding {
    let Some(label) = keys.take_text("encoding") else { return TextEncoding::default() };
    TextEncoding::of_label(&label).unwrap_or_else(|| {
        let near = find_nearest_name(
            &label,
            ["auto", "gbk", "gb18030", "shift_jis", "euc-kr", "big5", "utf-8", "windows-1252"],
        );
        let hint = near.map(|near| format!("; did you mean {near}?")).unwrap_or_default();
        keys.add_problem(format!(
            "encoding={label}: give auto, gbk, shift_jis, utf-8 or another label of the Encoding Standard{hint}"
        ));
        TextEncoding::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_given_twice_is_a_problem() {
        assert_eq!(Keys::from_query("a=1&a=2").problems, vec!["a is given twice"]);
    }
}
