//! The words of the page: every text in English and Chinese, every word that is used, every reason of the gate translated.

use gateway::gate::Hold;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use testkit::process::{Gateway, get};

fn web() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("gateway/web")
}

pub(super) fn read(name: &str) -> String {
    std::fs::read_to_string(web().join(name)).expect("a file of the page")
}

/// Every module of the page with its text; what others wrote is left out.
fn modules() -> Vec<(PathBuf, String)> {
    fn collect(folder: &Path, found: &mut Vec<(PathBuf, String)>) {
        for entry in std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path()) {
            if entry.is_dir() && !entry.ends_with("vendor") {
                collect(&entry, found);
            } else if entry.extension().is_some_and(|end| end == "js") {
                let text = std::fs::read_to_string(&entry).expect("text");
                found.push((entry, text));
            }
        }
    }
    let mut found = Vec::new();
    collect(&web(), &mut found);
    found
}

/// Name, English and Chinese of every row of the tables.
fn table() -> Vec<(String, String, String)> {
    let whole = read("word-table.js");
    let tables = modules().into_iter().filter(|(path, _)| path.parent().is_some_and(|it| it.ends_with("words")));
    let rows = tables.flat_map(|(path, text)| {
        let subject = path.file_stem().expect("a name").to_string_lossy().into_owned();
        assert!(whole.contains(&format!("/web/words-{subject}.js")), "{subject} is not part of the whole table");
        rows_of(&text)
    });
    rows.collect()
}

/// The rows of one table. A row that is too long for one line stands on several.
fn rows_of(text: &str) -> Vec<(String, String, String)> {
    let text = text.replace(": [\n    \"", ": [\"").replace("\",\n    \"", "\", \"").replace("\",\n  ]", "\"]");
    let mut rows = Vec::new();
    let mut rest = text.split_once(" = {").expect("the table").1;
    while let Some(at) = rest.find(": [\"") {
        let key: String = rest[..at]
            .chars()
            .rev()
            .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
            .collect::<Vec<_>>()
            .into_iter()
            .rev()
            .collect();
        let row = &rest[at + 4..];
        let (english, row) = row.split_once("\", \"").expect("two texts");
        let (chinese, row) = row.split_once("\"]").expect("two texts");
        rows.push((key, english.to_owned(), chinese.to_owned()));
        rest = row;
    }
    rows
}

pub(super) fn chinese(text: &str) -> bool {
    text.chars().any(|c| ('\u{4e00}'..='\u{9fff}').contains(&c))
}

/// What the box can answer a person: every sentence in a handler of the interface, with `{}` for what is filled in.
fn sentences_of_the_box() -> BTreeSet<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("gateway/http");
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path()) {
        let name = entry.file_name().expect("a name").to_string_lossy().into_owned();
        if entry.extension().is_none_or(|end| end != "rs") || NO_ANSWERS.contains(&name.as_str()) {
            continue;
        }
        let text = std::fs::read_to_string(&entry).expect("text");
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for literal in literals(code) {
            let blanks = literal.split(' ').count();
            let letters = literal.chars().all(|c| c != '<' && c != '\n' && !chinese(&c.to_string()));
            if blanks >= 3
                && literal.len() < SENTENCE_MAX
                && letters
                && !literal.contains("; charset=")
                && !NO_SENTENCES.iter().any(|it| without_names(it) == without_names(&literal))
            {
                found.insert(without_names(&literal));
            }
        }
    }
    found
}

/// Files whose texts are no answers to a person who reads the page: metrics, headers, the description of the interface, pages of their own
/// with both languages, and what goes to the log.
const NO_ANSWERS: [&str; 7] =
    ["description.rs", "headers.rs", "metrics.rs", "plain.rs", "server.rs", "vocabulary.rs", "wear.rs"];
/// Texts that are no sentences of an answer: reasons in the source, and the history's own words.
const NO_SENTENCES: [&str; 10] = [
    "saturates, which is meant",
    "microseconds suffice beyond a hundred days",
    "each piece was measured before it was taken",
    "seconds of centuries fit",
    "{} {path} ({code}){words}",
    "{} {} from {}: {}",
    "{} (from {})",
    // A person and one of four roles: each role has its sentence.
    "{name} is {}",
    "/api/v1/identified/{subject}; known are {}",
    "{}={value}; Path=/; Max-Age={seconds}; HttpOnly; SameSite=Strict{secure}",
];
/// A longer text is no sentence of an answer: it is the letter that lies in the archive for support.
const SENTENCE_MAX: usize = 220;

/// The texts between quotation marks, with lines that are continued put together.
pub(super) fn literals(code: &str) -> Vec<String> {
    let (mut all, mut open, mut escaped): (Vec<String>, Option<String>, bool) = (Vec::new(), None, false);
    let code: String = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let mut before = ' ';
    for c in code.chars() {
        match (&mut open, c) {
            (Some(text), _) if escaped => {
                // A line that is continued goes on with its first letter.
                if !c.is_whitespace() {
                    text.push(c);
                    escaped = false;
                }
                continue;
            }
            (Some(_), '\\') => escaped = true,
            (Some(_), '"') => all.extend(open.take()),
            (Some(text), _) => text.push(c),
            (None, '"') if before != '\'' => open = Some(String::new()),
            _ => {}
        }
        before = c;
    }
    all
}

/// `{name:?}` and `{0}` are `{}`; braces that are written twice are braces of the text, and one that is never closed too.
pub(super) fn without_names(text: &str) -> String {
    let (mut all, mut rest) = (String::new(), text);
    while let Some(at) = rest.find(['{', '}']) {
        all.push_str(&rest[..at]);
        let (brace, after) = rest[at..].split_at(1);
        let place = after.split_once('}').filter(|_| brace == "{");
        (rest, _) = match (after.strip_prefix(brace), place) {
            (Some(after), _) => (after, all.push_str(brace)),
            (None, Some((_, after))) => (after, all.push_str("{}")),
            (None, None) => (after, all.push_str(brace)),
        };
    }
    all + rest
}

#[test]
fn every_answer_of_the_interface_has_a_chinese_sentence() {
    let known: BTreeSet<String> = read("box-sentences.js")
        .split("[\n    \"")
        .flat_map(|text| text.split("  [\""))
        .filter_map(|text| Some(without_names(text.split_once("\",")?.0)))
        .collect();
    let missing: Vec<String> = sentences_of_the_box().into_iter().filter(|it| !known.contains(it)).collect();
    assert!(sentences_of_the_box().len() > 100, "the sources were not understood");
    assert!(missing.is_empty(), "no Chinese in box-sentences.js for:\n{}", missing.join("\n"));
}

/// Texts that are the same in both languages.
const SAME: [&str; 1] = ["rpm"];

#[test]
fn every_text_stands_in_both_languages_and_every_used_word_in_the_table() {
    let rows = table();
    assert!(rows.len() > 150, "the table was not understood: {} rows", rows.len());
    for (key, english, zh) in &rows {
        assert!(!english.is_empty() && !chinese(english), "{key}: {english}");
        assert!(chinese(zh) || SAME.contains(&key.as_str()), "{key} has no Chinese: {zh}");
    }
    let keys: BTreeSet<&str> = rows.iter().map(|(key, ..)| key.as_str()).collect();
    assert_eq!(keys.len(), rows.len(), "a key stands twice");
    let mut used = 0;
    for (path, text) in modules() {
        for part in text.split("t(").skip(1) {
            let before = &text[..part.as_ptr() as usize - text.as_ptr() as usize - 2];
            let word = before.chars().next_back().is_some_and(|c| c.is_ascii_alphanumeric() || c == '_' || c == '.');
            let Some(key) = part.trim_start().strip_prefix('"').filter(|_| !word) else { continue };
            let key = key.split('"').next().unwrap_or_default();
            assert!(keys.contains(key), "{}: no word {key:?} in the table", path.display());
            used += 1;
        }
    }
    assert!(used > 400, "the modules were not understood: {used} words are used");
}

#[test]
fn every_reason_of_the_gate_has_a_chinese_phrase() {
    let phrases = read("box-texts.js");
    let holds = [
        Hold::Off,
        Hold::OnlyEstimated,
        Hold::StateUnknown,
        Hold::Alarm,
        Hold::Manual,
        Hold::Mdi,
        Hold::SingleBlock,
        Hold::DryRun,
        Hold::NotAutomatic,
        Hold::FeedHold,
        Hold::NotRunning,
        Hold::Running,
        Hold::Rapid,
        Hold::Threading,
        Hold::Tapping,
    ];
    for hold in holds {
        assert!(phrases.contains(&format!("[\"{hold}\"")), "no phrase for {hold}");
    }
}

#[test]
fn every_view_has_its_own_address() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut gateway = Gateway::start(&directory.path().join("data"), &[]);
    let address = gateway.address();
    for view in ["", "now", "history", "wear", "thermal", "twin", "rules", "audit", "help"] {
        let answer = get(&address, &format!("/{view}"));
        assert_eq!(answer.status, 200, "{view}");
        assert!(answer.body.contains("<noscript>") && answer.head.contains("content-security-policy"), "{view}");
        assert!(!answer.head.contains("unsafe-inline"), "{}", answer.head);
    }
    gateway.stop();
}
