//! The part of an address after the question mark, taken key by key so that what is left over can be refused.

use crate::channel::find_nearest_name;
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
        self.given.push((key.to_owned(), unescape_percent(value)));
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

/// `%20` and the like as the bytes they stand for; anything else as it is.
fn unescape_percent(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        match after.first_chunk::<2>().filter(|_| first == b'%').and_then(|pair| parse_hex_pair(*pair)) {
            Some(byte) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            None => {
                bytes.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

fn parse_hex_pair(pair: [u8; 2]) -> Option<u8> {
    let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    Some(digit(pair[0])? * 16 + digit(pair[1])?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_undone_and_stray_percent_signs_kept() {
        assert_eq!(unescape_percent("a%20b%2"), "a b%2");
        assert_eq!(unescape_percent("100%"), "100%");
    }

    #[test]
    fn a_key_given_twice_is_a_problem() {
        assert_eq!(Keys::from_query("a=1&a=2").problems, vec!["a is given twice"]);
    }
}
