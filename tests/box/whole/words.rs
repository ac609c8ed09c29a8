//! The words of the page: every text in English and Chinese, every word that is used, every reason of the gate translated.

use gateway::gate::Hold;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use testkit::process::{Gateway, get};

fn web() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("gateway/web")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(web().join(name)).expect("a file of the page")
}

/// Name, English and Chinese of every row of the table.
fn table() -> Vec<(String, String, String)> {
    let text = read("word-table.js");
    let mut rows = Vec::new();
    let mut rest = text.split_once("WORDS = {").expect("the table").1;
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

fn chinese(text: &str) -> bool {
    text.chars().any(|c| ('\u{4e00}'..='\u{9fff}').contains(&c))
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
    for folder in [web(), web().join("views")] {
        for entry in std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path()) {
            if entry.extension().is_none_or(|end| end != "js") {
                continue;
            }
            let text = std::fs::read_to_string(&entry).expect("text");
            for part in text.split("t(\"").skip(1) {
                let before = &text[..part.as_ptr() as usize - text.as_ptr() as usize - 3];
                let word =
                    before.chars().next_back().is_some_and(|c| c.is_ascii_alphanumeric() || c == '_' || c == '.');
                let key = part.split('"').next().unwrap_or_default();
                assert!(word || keys.contains(key), "{}: no word {key:?} in the table", entry.display());
            }
        }
    }
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
