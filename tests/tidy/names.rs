//! One name for one thing: no two types of a crate share a name, and no name is a word that nobody in the field would
//! guess. The names come from the glossary (`gateway/handbook/glossary.md`).

use super::{none, texts};
use std::collections::{BTreeMap, BTreeSet};

/// Words that code must not use, each with what to write instead.
const WORDS: [(&str, &str); 20] = [
    ("Desk", "what it does: a handle, a queue"),
    ("House", "what it is: a test bed"),
    ("Keeper", "what it holds: a store"),
    ("Kept", "what it holds: a store"),
    ("Paper", "what it is: a report"),
    ("Said", "what it is: a message, an answer"),
    ("Wish", "what it is: a request, a new value"),
    ("Wishes", "requests"),
    ("carried", "the quantity: a state, a remainder"),
    ("desk", "what it does: a handle, a queue"),
    ("in_charge", "`active`"),
    ("lie_in_wait", "what is waited for"),
    ("outdone", "what is better, and by which measure"),
    ("shots", "what they are: moments, images"),
    ("unrest", "`noise`"),
    ("veil", "`noise`, or a weight"),
    ("veiled", "what the rows are: weighed down"),
    ("vessel", "what holds it"),
    ("wish", "`request`"),
    ("wishes", "`requests`"),
];

/// Where a word stays: file, word, reason.
const STAY: [(&str, &str, &str); 4] = [
    (
        "rules/estimators/thermal/compensation/tests.rs",
        "carried",
        "the remainder of a division, as in written arithmetic",
    ),
    ("rules/script/functions/thermal.rs", "carried", "the remainder of a division, as in written arithmetic"),
    ("tests/inference/concealed/groups.rs", "wish", "part of a seed: another word would draw other cases"),
    ("tests/inference/concealed/spindle_case.rs", "unrest", "part of a seed: another word would draw other cases"),
];

/// The code of a file without its modules of tests.
pub(super) fn production(text: &str) -> Vec<&str> {
    let (mut lines, mut in_tests, mut before) = (Vec::new(), false, "");
    for line in text.lines() {
        in_tests |= before == "#[cfg(test)]" && line.starts_with("mod ") && line.ends_with('{');
        if !in_tests {
            lines.push(line);
        }
        in_tests &= line != "}";
        before = line;
    }
    lines
}

/// The name of the type that a line declares. A `type` that stands further in belongs to a trait.
fn declared(line: &str) -> Option<&str> {
    let code = line.trim_start();
    let code = code.strip_prefix("pub").map_or(code, |rest| match rest.strip_prefix('(') {
        Some(rest) => rest.split_once(')').map_or("", |(_, rest)| rest),
        None => rest,
    });
    let code = code.trim_start();
    let code = code.strip_prefix("unsafe ").unwrap_or(code);
    let (kind, rest) = code.split_once(' ')?;
    let is_type = ["struct", "enum", "trait", "union"].contains(&kind) || kind == "type" && !line.starts_with(' ');
    let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
    (is_type && end > 0).then(|| &rest[..end])
}

/// The files that declare each type, by crate and name.
fn types() -> BTreeMap<(String, String), Vec<String>> {
    let mut found: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for (path, text) in texts(&["rs"]) {
        let room = path.split('/').next().unwrap_or_default().to_owned();
        let is_test = room == "tests" || path.ends_with("tests.rs") || path.contains("/tests/");
        let names = production(&text).into_iter().filter(|_| !is_test).filter_map(declared);
        names.for_each(|name| found.entry((room.clone(), name.to_owned())).or_default().push(path.clone()));
    }
    found
}

#[test]
fn no_two_types_of_a_crate_share_a_name() {
    let all = types();
    let twice = all.iter().filter(|(_, files)| files.len() > 1);
    let told = twice.map(|((room, name), files)| format!("{room} {name}: {}", files.join(", ")));
    none(told.collect(), "several types of one name; name each after what it is");
    assert!(all.contains_key(&("gateway".to_owned(), "Gate".to_owned())), "types are found: {}", all.len());
    assert_eq!(declared("pub(super) struct Batch<'a> {"), Some("Batch"));
    assert_eq!(declared("    type Err = String;"), None);
}

/// The listed words that stand in the code of a file, outside of comments.
fn listed_words(text: &str) -> BTreeSet<&'static str> {
    let code = text.lines().filter_map(|line| line.split("//").next());
    let words: BTreeSet<&str> = code.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_')).collect();
    WORDS.iter().map(|(word, _)| *word).filter(|word| words.contains(word)).collect()
}

#[test]
fn no_name_is_a_word_that_nobody_would_guess() {
    let mut found: BTreeSet<(String, &str)> = BTreeSet::new();
    for (path, text) in texts(&["rs"]).into_iter().filter(|(path, _)| path != "tests/tidy/names.rs") {
        let stem = path.rsplit('/').next().unwrap_or_default().trim_end_matches(".rs");
        let of_file = WORDS.iter().map(|(word, _)| *word).filter(|word| *word == stem);
        found.extend(listed_words(&text).into_iter().chain(of_file).map(|word| (path.clone(), word)));
    }
    let stays = |path: &str, word: &str| STAY.iter().any(|(file, stays, _)| *file == path && *stays == word);
    let refused = found.iter().filter(|(path, word)| !stays(path, word)).map(|(path, word)| {
        let instead = WORDS.iter().find(|(listed, _)| listed == word).map_or("", |(_, instead)| *instead);
        format!("{path}: {word}; write {instead}")
    });
    none(refused.collect(), "on the list of words that nobody would guess");
    let idle = STAY.iter().filter(|(file, word, _)| !found.contains(&((*file).to_owned(), *word)));
    none(idle.map(|(file, word, _)| format!("{file}: {word}")).collect(), "no longer there: take it off the list");
    assert_eq!(listed_words("let wish = 1; // a veil\n"), BTreeSet::from(["wish"]));
}
