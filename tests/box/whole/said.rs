//! What is said of scripts and devices: every sentence of their sources stands in the tables of the page, English and Chinese.

use super::words::{chinese, literals, read, without_names};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The rows of a table of sentences: English, with `{}` for what is filled in, and Chinese.
fn sentences_of(table: &str) -> Vec<(String, String)> {
    let (mut texts, mut open, mut escaped): (Vec<String>, Option<(char, String)>, bool) = (Vec::new(), None, false);
    let code: Vec<&str> = table.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    for c in code.join("\n").chars() {
        match &mut open {
            Some((_, text)) if escaped => {
                text.push(c);
                escaped = false;
            }
            Some(_) if c == '\\' => escaped = true,
            Some((quote, _)) if *quote == c => texts.extend(open.take().map(|(_, text)| text)),
            Some((_, text)) => text.push(c),
            None if c == '"' || c == '\'' => open = Some((c, String::new())),
            None => {}
        }
    }
    let places = |text: &str| (0..10).fold(text.to_owned(), |text, at| text.replace(&format!("{{{at}}}"), "{}"));
    texts.chunks(2).map(|row| (places(&row[0]), row.last().cloned().unwrap_or_default())).collect()
}

/// The sources in and below this folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path());
    let (folders, files): (Vec<PathBuf>, Vec<PathBuf>) = entries.partition(|path| path.is_dir());
    let own =
        files.into_iter().filter(|path| path.extension().is_some_and(|end| end == "rs") && !path.ends_with("tests.rs"));
    own.chain(folders.iter().flat_map(|folder| sources(folder))).collect()
}

/// What of a source is no test.
fn production(path: &Path) -> String {
    let text = std::fs::read_to_string(path).expect("text");
    text.split("#[cfg(test)]").next().unwrap_or_default().to_owned()
}

/// Every sentence that the script host can say: the texts of its sources that are neither documentation, which begins with a capital
/// letter, nor a piece.
fn sentences_of_scripts() -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("rules/script");
    let mut found = BTreeSet::new();
    for path in sources(&folder).iter().filter(|path| !path.starts_with(folder.join("functions"))) {
        let name = path.file_name().expect("a name").to_string_lossy();
        if NO_SCRIPT_PROBLEMS.contains(&&*name) {
            continue;
        }
        let code = production(path);
        let is_documentation = |text: &str| {
            let mut letters = text.chars();
            letters.next().is_some_and(char::is_uppercase) && letters.next().is_some_and(|it| !it.is_uppercase())
        };
        for literal in literals(&code) {
            let words = literal.trim().split(' ').count();
            if words >= 3 && !is_documentation(&literal) && !literal.contains('\n') && !chinese(&literal) {
                found.insert(without_names(&literal));
            }
        }
    }
    found.retain(|it| !NO_SCRIPT_SENTENCES.contains(&it.as_str()));
    found
}

/// Files of the script host that say nothing of a script that is wrong: the vocabulary and its documentation.
const NO_SCRIPT_PROBLEMS: [&str; 8] = [
    "api.rs",
    "callable.rs",
    "engine.rs",
    "example_scripts.rs",
    "quantities.rs",
    "recipes.rs",
    "running.rs",
    "vocabulary.rs",
];
/// Pieces of them, signatures, and what stands in a file.
const NO_SCRIPT_SENTENCES: [&str; 23] = [
    "was not asked for",
    "was asked for",
    " (further notes of this minute are left out)",
    "n    {}",
    "&str | ImmutableString | String",
    "; did you mean ",
    "needs a map with quantity, feed, speed_rpm, tool, material, rows",
    "each row is depth mm, feed from, feed to, c0, c1, c2, c3, standard deviation",
    "given(#{})",
    "expect_offset_um(axis, least, greatest)",
    "expect_published(name, least, greatest)",
    "expect_setting(name, least, greatest)",
    "{} = {}",
    "with {} in force",
    "with the defaults",
    "with {} for {}",
    "write setting(\"target_w\", 0.0, #{})",
    "{} = {}n",
    ", whole numbers",
    "{} to {}{}{}",
    "the version before it is in charge",
    "it is suspended",
    "{}; {} until the file is changed",
];

/// A table whose every row is in both languages, with what is filled in; gives its English.
fn check_table(name: &str) -> BTreeSet<String> {
    let rows = sentences_of(read(name).split_once(" = [").expect("the table").1);
    let known: BTreeSet<String> = rows.iter().map(|(english, _)| english.clone()).collect();
    assert_eq!(known.len(), rows.len(), "a sentence of {name} stands twice");
    for (english, zh) in &rows {
        assert!(chinese(zh), "{english}: {zh}");
        let filled = (0..10).any(|at| zh.contains(&format!("{{{at}}}")));
        assert_eq!(english.contains("{}"), filled, "{english}: {zh}");
    }
    known
}

#[test]
fn every_problem_of_a_script_has_a_chinese_sentence() {
    let known = check_table("script-sentences.js");
    let said = sentences_of_scripts();
    let missing: Vec<&String> = said.difference(&known).collect();
    assert!(said.len() > 150, "the sources were not understood: {}", said.len());
    assert!(missing.is_empty(), "no Chinese in script-sentences.js for:\n{missing:#?}");
}

/// Sources of which every sentence is said to a person.
const SAYING: [&str; 7] = [
    "core/driver.rs",
    "fanuc/code.rs",
    "hnc/answer.rs",
    "line/child/supervise.rs",
    "line/tls/words.rs",
    "modbus/pdu.rs",
    "mqtt/words.rs",
];

/// What drivers say: every sentence of these sources, and of every driver what is to be done next.
fn sentences_of_devices() -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("adapters");
    let mut found = BTreeSet::new();
    for path in sources(&folder) {
        let code = production(&path);
        let next = code.split("next: ").skip(1).filter_map(|rest| {
            let rest = rest.trim_start_matches("format!(").trim_start();
            rest.starts_with('"').then(|| literals(rest).into_iter().next())?
        });
        found.extend(next.map(|text| without_names(text.trim_end_matches('.'))));
        if SAYING.iter().any(|name| path.ends_with(name)) {
            let sentences = literals(&code).into_iter().filter(|text| text.trim().split(' ').count() >= 3);
            found.extend(sentences.map(|text| without_names(text.trim_end_matches('.'))));
        }
    }
    // Pieces: what is filled in alone, and a name of FANUC with its number.
    found.retain(|it| !["{}", "{} ({} {})"].contains(&it.as_str()));
    found
}

#[test]
fn what_devices_say_has_a_chinese_sentence() {
    let known = check_table("device-sentences.js");
    let said = sentences_of_devices();
    let missing: Vec<&String> = said.difference(&known).collect();
    assert!(said.len() > 120, "the sources were not understood: {}", said.len());
    assert!(missing.is_empty(), "no Chinese in device-sentences.js for:\n{missing:#?}");
}
