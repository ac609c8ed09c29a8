//! README and handbook: what they show is accepted by the program, what they point to is there, and the templates of
//! chapter `inside` compile and work.
//!
//! Code blocks are looked at as they stand: fenced ones, and those that are indented by four spaces.

mod chinese;
mod commands;
mod documents;
mod driver;
mod effect;
mod identifiers;
mod pictures;
mod run;
mod settings;
mod source_index;

use documents::{documents, root};
use gateway::handbook::{CHAPTERS, find_chapter, list_contents, nearest_topic};
use rules::physics::explain::Language;
use std::collections::BTreeSet;

#[test]
fn every_file_of_the_handbook_is_a_chapter() {
    let folder = root().join("gateway/handbook");
    let names = std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").file_name());
    let files: BTreeSet<String> =
        names.filter_map(|name| name.to_string_lossy().strip_suffix(".md").map(str::to_owned)).collect();
    let known: BTreeSet<String> = CHAPTERS.iter().map(|chapter| chapter.topic.to_owned()).collect();
    assert_eq!(files, known, "files of gateway/handbook (left), rows of the table in gateway/handbook/lib.rs (right)");
    assert_eq!(known.len(), CHAPTERS.len(), "a chapter stands twice in the table");
    for chapter in CHAPTERS {
        assert!(chapter.text.starts_with("# "), "{}.md begins with its title: # Title", chapter.topic);
    }
}

#[test]
fn a_chapter_is_found_by_its_topic() {
    assert_eq!(find_chapter("Glossary").map(|found| found.title(Language::En)), Some("Glossary"));
    assert_eq!(find_chapter("nothing"), None);
    assert_eq!(nearest_topic("configuraton"), Some("configuration"));
    assert!(list_contents(Language::En).lines().count() == CHAPTERS.len());
}

#[test]
fn links_lead_to_files_that_are_there() {
    let mut broken = Vec::new();
    for document in documents() {
        let folder = document.path.parent().expect("a folder");
        for target in document.links() {
            let file = target.split('#').next().unwrap_or_default();
            let outside = target.contains("://") || file.is_empty();
            // The pictures are taken of a running box; a release without them shows their captions.
            let picture = file.ends_with(".png");
            if !outside && !picture && !folder.join(file).exists() {
                broken.push(format!("{}: {target}", document.name));
            }
        }
    }
    assert!(broken.is_empty(), "links to nothing:\n  {}", broken.join("\n  "));
}

/// Files that a document names by their whole path; `NAME` and the like stand for a name of the reader's.
pub(crate) fn named_files(text: &str) -> Vec<&str> {
    let of_a_path = |letter: char| letter.is_ascii_alphanumeric() || "/_.".contains(letter);
    let rooms = ["adapters/", "gateway/", "rules/", "tests/"];
    let whole = |word: &&str| rooms.iter().any(|room| word.starts_with(room)) && word.ends_with(".rs");
    let own = |word: &str| word.split(['/', '.']).any(|part| ["NAME", "SUBJECT"].contains(&part));
    text.split(|letter| !of_a_path(letter)).filter(whole).filter(|word| !own(word)).collect()
}

#[test]
fn files_that_are_named_are_there() {
    let (mut gone, mut seen) = (Vec::new(), 0);
    for document in documents() {
        let named = named_files(&document.text);
        seen += named.len();
        let missing = named.into_iter().filter(|file| !root().join(file).exists());
        gone.extend(missing.map(|file| format!("{}: {file}", document.name)));
    }
    assert!(gone.is_empty(), "named, and not there:\n  {}", gone.join("\n  "));
    assert!(seen > 60, "only {seen} files were found");
}

#[test]
fn the_readme_is_one_page() {
    let readme = documents().into_iter().find(|document| document.name == "README.md").expect("there is one");
    let lines = readme.text.lines().count();
    assert!(lines <= 100, "{lines} lines: what does not help to decide in a minute belongs into the handbook");
}

/// Sections, blocks of code and tables of a chapter, in their order.
fn shape(text: &str) -> Vec<String> {
    let mut shape = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        if let Some(kind) = line.trim_start().strip_prefix("```") {
            if !inside {
                shape.push(format!("code {kind}"));
            }
            inside = !inside;
        } else if !inside && line.starts_with("## ") {
            shape.push("section".to_owned());
        } else if !inside && line.starts_with("|---") {
            shape.push(format!("table of {}", line.matches("|---").count()));
        }
    }
    shape
}

#[test]
fn chapters_for_the_shop_are_there_in_chinese_section_by_section() {
    let mut wrong = Vec::new();
    for found in CHAPTERS {
        let Some(zh) = found.zh else { continue };
        let (own, other) = (shape(found.text), shape(zh));
        if own != other {
            let at = own.iter().zip(&other).position(|(a, b)| a != b).unwrap_or(own.len().min(other.len()));
            wrong.push(format!(
                "{}: the Chinese text differs from part {} on: {:?} for {:?}",
                found.topic,
                at + 1,
                other.get(at),
                own.get(at)
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
