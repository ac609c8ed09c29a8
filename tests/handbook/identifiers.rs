//! Functions and types that chapter `inside` names beside a file stand in that file.
//!
//! Two forms are held to the letter: `Type::function` on a line that names files, and names in parentheses directly behind
//! a file, as in `` `gateway/run/command.rs` (`run_orders`, `record_audit`) ``.

use super::documents::{Document, documents, root};
use std::collections::BTreeSet;

/// One name, and the files of which one has to contain it.
struct NamedIdentifier {
    line: usize,
    identifier: String,
    files: Vec<String>,
}

fn is_identifier_letter(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || letter == '_'
}

/// Files of a line, by their whole path.
fn list_files(line: &str) -> Vec<String> {
    super::named_files(line).into_iter().map(str::to_owned).collect()
}

/// Every `Type::function` of a line.
fn list_paths(line: &str) -> Vec<String> {
    let is_letter = |letter: char| is_identifier_letter(letter) || letter == ':';
    let words = line.split(|letter| !is_letter(letter)).map(|word| word.trim_matches(':'));
    let is_path = |word: &&str| word.contains("::") && word.starts_with(|first: char| first.is_ascii_uppercase());
    words.filter(is_path).map(str::to_owned).collect()
}

/// Every `name` in parentheses behind a file: the file and the name.
fn list_names_behind_files(line: &str) -> Vec<NamedIdentifier> {
    let mut found = Vec::new();
    for part in line.split(".rs` (").collect::<Vec<_>>().windows(2) {
        let [before, behind] = part else { continue };
        let file = format!("{}.rs", before.rsplit('`').next().unwrap_or_default());
        let names = behind.split(')').next().unwrap_or_default().split('`').skip(1).step_by(2);
        let is_name = |name: &&str| !name.is_empty() && name.chars().all(is_identifier_letter);
        found.extend(names.filter(is_name).map(|name| NamedIdentifier {
            line: 0,
            identifier: name.to_owned(),
            files: vec![file.clone()],
        }));
    }
    found
}

fn list_named_identifiers(document: &Document) -> Vec<NamedIdentifier> {
    let mut found = Vec::new();
    for (index, text) in document.text.lines().enumerate() {
        let line = index + 1;
        found.extend(list_names_behind_files(text).into_iter().map(|named| NamedIdentifier { line, ..named }));
        let files = list_files(text);
        if !files.is_empty() {
            let paths = list_paths(text).into_iter();
            found.extend(paths.map(|identifier| NamedIdentifier { line, identifier, files: files.clone() }));
        }
    }
    found
}

/// Whether one of the files contains every part of the identifier as a word.
fn stands_in_a_file(named: &NamedIdentifier) -> bool {
    named.files.iter().any(|file| {
        let text = std::fs::read_to_string(root().join(file)).unwrap_or_default();
        let words: BTreeSet<&str> = text.split(|letter| !is_identifier_letter(letter)).collect();
        named.identifier.split("::").all(|part| words.contains(part))
    })
}

#[test]
fn identifiers_stand_in_the_files_beside_them() {
    let inside = documents().into_iter().find(|document| document.name.ends_with("inside.md")).expect("a chapter");
    let named = list_named_identifiers(&inside);
    let gone: Vec<String> = named
        .iter()
        .filter(|named| !stands_in_a_file(named))
        .map(|named| format!("line {}: {} in {}", named.line, named.identifier, named.files.join(", ")))
        .collect();
    assert!(gone.is_empty(), "named, and not there:\n  {}", gone.join("\n  "));
    assert!(named.len() > 15, "only {} identifiers were found", named.len());
}

#[test]
fn names_behind_a_file_are_found() {
    let line = "| 2. | text | `gateway/run/command.rs` (`run_orders`, `obey`) |";
    let found: Vec<String> = list_names_behind_files(line).into_iter().map(|named| named.identifier).collect();
    assert_eq!(found, ["run_orders", "obey"]);
    assert_eq!(list_paths("Gate::decide_override   gateway/gate/lib.rs"), ["Gate::decide_override"]);
}
