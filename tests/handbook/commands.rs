//! Command lines: the program would take them, and a test that is named is there.

use crate::documents::{Document, documents, root};
use std::fs;
use std::path::{Path, PathBuf};

/// A command line as words: quotes hold a word together, a comment or a pipe ends the line.
pub(crate) fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None::<char>);
    for letter in line.chars() {
        match (letter, quote) {
            (mark, Some(open)) if mark == open => quote = None,
            (letter, Some(_)) => word.get_or_insert_default().push(letter),
            ('"' | '\'', None) => {
                quote = Some(letter);
                word.get_or_insert_default();
            }
            ('#', None) if word.is_none() => break,
            ('|' | '>' | ';' | '&', None) if word.is_none() => break,
            (' ', None) => words.extend(word.take()),
            (letter, None) => word.get_or_insert_default().push(letter),
        }
    }
    words.extend(word);
    words
}

/// A command line, with its line in the document.
pub(crate) struct Line {
    pub(crate) number: usize,
    pub(crate) text: String,
    /// It stands in running text, where a command may be named without what it needs.
    pub(crate) mentioned: bool,
}

/// Every command line of a document; a line that ends in `\` goes on in the next.
pub(crate) fn lines(document: &Document) -> Vec<Line> {
    let mut lines = Vec::new();
    for block in document.blocks() {
        let mut whole = String::new();
        for (index, line) in block.lines.iter().enumerate() {
            whole.push_str(line.trim_start());
            if whole.ends_with('\\') {
                whole.pop();
                continue;
            }
            lines.push(Line { number: block.line + index, text: std::mem::take(&mut whole), mentioned: false });
        }
    }
    lines.extend(document.spans().into_iter().map(|(number, text)| Line { number, text, mentioned: true }));
    lines
}

/// Does it stand for several commands, or leave something out?
pub(crate) fn is_a_pattern(line: &str) -> bool {
    let choice = line.split(' ').any(|word| word.len() > 1 && word.contains('|'));
    choice || ["...", "[", "…"].iter().any(|mark| line.contains(mark))
}

/// The words behind `program`, when the line calls it; assignments before it are left out.
pub(crate) fn arguments<'a>(words: &'a [String], program: &str) -> Option<&'a [String]> {
    let assigned = |word: &&String| word.contains('=') && !word.starts_with('-');
    let before = words.iter().take_while(assigned).count();
    let rest = words.get(before..)?;
    rest.split_first().filter(|(first, _)| *first == program).map(|(_, rest)| rest)
}

#[test]
fn every_command_line_is_one_that_the_program_takes() {
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for document in documents() {
        for Line { number, text, mentioned } in lines(&document) {
            let line = text.trim_start_matches("$ ");
            let words = words(line);
            let Some(given) = arguments(&words, "cnc-gateway").filter(|given| !given.is_empty()) else { continue };
            if is_a_pattern(line) {
                continue;
            }
            seen += 1;
            let whole = std::iter::once("cnc-gateway").chain(given.iter().map(String::as_str));
            if let Err(refused) = gateway::cli::check_arguments(whole)
                && !(mentioned && refused.contains(" required "))
            {
                let first = refused.lines().next().unwrap_or_default().to_owned();
                wrong.push(format!("{}:{number}: {line}\n    {first}", document.name));
            }
        }
    }
    assert!(wrong.is_empty(), "the program does not take these:\n  {}", wrong.join("\n  "));
    assert!(seen > 25, "only {seen} command lines were found");
}

/// The files in which a test of these arguments of `cargo test` stands.
fn places(given: &[String]) -> Vec<PathBuf> {
    let after = |name: &str| given.iter().position(|word| word == name).and_then(|at| given.get(at + 1));
    let tests = root().join("tests");
    match (after("--test"), after("-p"), after("--bench")) {
        (Some(test), _, _) => vec![tests.join(format!("{test}.rs")), tests.join(test)],
        (_, Some(package), _) => vec![find_package(package)],
        (_, _, Some(bench)) => vec![tests.join(format!("bench/{bench}.rs"))],
        _ => ["adapters", "gateway", "rules", "tests"].iter().map(|room| root().join(room)).collect(),
    }
}

/// The folder of a package; its manifest says the name.
fn find_package(package: &str) -> PathBuf {
    let line = format!("name = \"{package}\"\n");
    let named = |folder: &PathBuf| fs::read_to_string(folder.join("Cargo.toml")).is_ok_and(|text| text.contains(&line));
    let rooms = ["adapters", "gateway", "rules", "tests"].map(|room| root().join(room));
    let inside = rooms
        .iter()
        .flat_map(|room| fs::read_dir(room).expect("readable"))
        .map(|entry| entry.expect("readable").path());
    let mut folders: Vec<PathBuf> = inside.filter(|path| path.is_dir()).chain(rooms.iter().cloned()).collect();
    folders.sort();
    folders.into_iter().find(named).unwrap_or_else(|| root().join(package))
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    if path.is_dir() {
        let entries = fs::read_dir(path).expect("readable").map(|entry| entry.expect("readable").path());
        entries.for_each(|entry| collect(&entry, files));
    } else if path.extension().is_some_and(|end| end == "rs") {
        files.push(path.to_owned());
    }
}

/// Names by which tests are chosen: words that are neither options nor values of options.
fn filters(given: &[String]) -> Vec<&str> {
    let valued = ["--test", "-p", "--bench", "--profile", "--target", "--features"];
    let mut filters = Vec::new();
    let mut words = given.iter();
    while let Some(word) = words.next() {
        if valued.contains(&word.as_str()) {
            words.next();
        } else if !word.starts_with('-') {
            filters.push(word.as_str());
        }
    }
    filters
}

#[test]
fn every_test_that_is_named_is_there() {
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for document in documents() {
        for Line { number, text: line, .. } in lines(&document) {
            let words = words(line.trim_start_matches("$ "));
            let Some((kind, given)) = arguments(&words, "cargo").and_then(<[String]>::split_first) else { continue };
            if !["test", "bench"].contains(&kind.as_str()) || is_a_pattern(&line) {
                continue;
            }
            seen += 1;
            let mut files = Vec::new();
            places(given).iter().filter(|place| place.exists()).for_each(|place| collect(place, &mut files));
            if files.is_empty() {
                wrong.push(format!("{}:{number}: {line}: no such suite", document.name));
            }
            let texts: Vec<String> = files.iter().map(|file| fs::read_to_string(file).expect("text")).collect();
            for filter in filters(given) {
                let found = |part: &str| {
                    let of_file = |file: &PathBuf| file.display().to_string().contains(part);
                    texts.iter().any(|text| text.contains(part)) || files.iter().any(of_file)
                };
                if !filter.split("::").filter(|part| !part.is_empty()).all(found) {
                    wrong.push(format!("{}:{number}: {line}: no test {filter}", document.name));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "not there:\n  {}", wrong.join("\n  "));
    assert!(seen > 30, "only {seen} lines of cargo were found");
}

#[test]
fn a_line_is_taken_apart_as_a_shell_does() {
    assert_eq!(words("a \"b c\" d=e # f"), ["a", "b c", "d=e"]);
    assert_eq!(words("check --example > file"), ["check", "--example"]);
    let words = words("SEED=1 cargo test --test box name -- --ignored");
    let given = arguments(&words, "cargo").expect("calls cargo");
    assert_eq!(filters(&given[1..]), ["name"]);
}
