//! Identifiers that the handbook names are there.
//!
//! In the chapters of [`EVERY_WORD`] each word of a code span is a name of the sources; in the others each word with an
//! underscore, and each `Type::member`. In chapter `inside`, a name also stands in a file that its section names, and so do
//! the names in its pictures.

use super::documents::{Document, documents, root};
use super::source_index::{SourceIndex, is_word_letter, split_words};
use std::collections::BTreeSet;
use std::sync::LazyLock;

static INDEX: LazyLock<SourceIndex> = LazyLock::new(SourceIndex::read);

/// Chapters for those who change the program.
const EVERY_WORD: [&str; 4] = ["inside.md", "tests.md", "/glossary.md", "mismatch.md"];

/// Names of others, and names that stand for the reader's own.
const NOT_OURS: [(&str, &str); 9] = [
    ("Instant::now", "the standard library"),
    ("SystemTime::now", "the standard library"),
    ("message_size_limit", "a key of mosquitto's configuration"),
    ("fast_group_period_wanted_ms", "put together from the name of the group, `period_wanted` and `_ms`"),
    ("group_left", "a word of PromQL"),
    ("b_axis_current_a", "a channel of an axis that the reader has named B"),
    ("b_axis_motor_temperature_c", "a channel of an axis that the reader has named B"),
    ("b_axis_encoder_temperature_c", "a channel of an axis that the reader has named B"),
    ("b_axis_absolute_deg", "a channel of an axis that the reader has named B"),
];

/// A name in a document.
struct Named {
    line: usize,
    name: String,
}

/// A command line is run through the program by the tests of commands.
fn is_command(span: &str) -> bool {
    let first = span.split(' ').find(|word| !word.contains('=')).unwrap_or_default();
    ["cargo", "cnc-gateway", "$"].contains(&first)
}

/// A file or folder, by its whole path or by its name.
fn is_path(span: &str) -> bool {
    let ending = span.rsplit_once('.').map_or("", |(_, ending)| ending);
    let endings = ["rs", "toml", "md", "sql", "rhai", "js", "tsv", "csv", "html", "json", "db", "py"];
    !span.contains(' ') && (span.contains('/') || endings.contains(&ending))
}

/// `NAME`, `KIND`: what the reader puts in.
fn is_placeholder(word: &str) -> bool {
    word.split('_').any(|part| part.len() > 1 && part.chars().all(|letter| letter.is_ascii_uppercase()))
}

/// Words of a span, a path `Type::member` as one.
fn split_paths(span: &str) -> impl Iterator<Item = &str> {
    let words = span.split(|letter| !is_word_letter(letter) && letter != ':').map(|word| word.trim_matches(':'));
    words.filter(|word| word.len() > 1 && !word.starts_with(|first: char| first.is_ascii_digit()))
}

/// Names of a span that have to be there.
fn list_names(span: &str, is_every_word: bool) -> Vec<&str> {
    if is_command(span) || is_path(span) {
        return Vec::new();
    }
    let is_name = |word: &str| word.trim_matches('_').contains('_') && word.is_ascii();
    let is_checked = |word: &&str| {
        !is_placeholder(word) && (word.contains("::") || is_name(word) || is_every_word && !span.contains(' '))
    };
    split_paths(span).filter(is_checked).collect()
}

/// `Type::member` is declared with its type; another path, and a word, part by part.
fn is_there(name: &str) -> bool {
    let parts: Vec<&str> = name.split(':').filter(|part| !part.is_empty()).collect();
    match parts.as_slice() {
        [.., owner, member] if owner.starts_with(|first: char| first.is_ascii_uppercase()) => {
            INDEX.has_member(owner, member)
        }
        parts => parts.iter().all(|part| INDEX.has_name(part)),
    }
}

fn list_named(document: &Document) -> Vec<Named> {
    let is_every_word = EVERY_WORD.iter().any(|end| document.name.ends_with(end));
    let names = document.spans().into_iter().flat_map(|(line, span)| {
        let names: Vec<String> = match INDEX.has_name(&span) {
            true => vec![span],
            false => list_names(&span, is_every_word).into_iter().map(str::to_owned).collect(),
        };
        names.into_iter().map(move |name| Named { line, name })
    });
    names.collect()
}

#[test]
fn every_identifier_of_the_handbook_is_there() {
    let (mut gone, mut seen, mut used) = (Vec::new(), 0, BTreeSet::new());
    for document in documents().iter().filter(|document| !document.name.ends_with("changelog.md")) {
        for Named { line, name } in list_named(document) {
            seen += 1;
            if let Some((own, _)) = NOT_OURS.iter().find(|(own, _)| *own == name) {
                used.insert(*own);
            } else if !is_there(&name) {
                gone.push(format!("{}:{line}: {name}", document.name));
            }
        }
    }
    println!("{seen} identifiers looked up, {} not there, {} of others", gone.len(), used.len());
    assert!(gone.is_empty(), "named, and nowhere in the sources:\n  {}", gone.join("\n  "));
    assert_eq!(used.len(), NOT_OURS.len(), "no longer named: strike them off");
    assert!(seen > 1000, "only {seen} identifiers were found");
}

/// A part of the chapter below one heading.
#[derive(Default)]
struct Section {
    title: String,
    spans: Vec<Named>,
}

fn list_sections(document: &Document) -> Vec<Section> {
    let mut spans = document.spans().into_iter().peekable();
    let heads = document.text.lines().enumerate().filter(|(_, line)| line.starts_with("##"));
    let mut starts: Vec<(usize, &str)> = heads.map(|(index, line)| (index + 1, line)).collect();
    starts.push((usize::MAX, ""));
    let mut sections = Vec::new();
    for pair in starts.windows(2) {
        let mut section = Section { title: pair[0].1.trim_matches(['#', ' ']).to_owned(), spans: Vec::new() };
        while let Some((line, span)) = spans.next_if(|(line, _)| *line < pair[1].0) {
            section.spans.push(Named { line, name: span });
        }
        sections.push(section);
    }
    sections
}

/// Names of a section that stand in none of its files.
fn list_strangers(section: &Section) -> (usize, Vec<String>) {
    let paths = section.spans.iter().filter(|named| is_path(&named.name));
    let files: Vec<_> = paths.flat_map(|named| INDEX.find_files(&named.name)).collect();
    let (mut seen, mut strangers) = (0, Vec::new());
    for named in section.spans.iter().filter(|_| !files.is_empty()) {
        let is_whole = |name: &&str| !name.starts_with('_') && !name.ends_with('_');
        for name in list_names(&named.name, true).into_iter().filter(is_whole) {
            seen += 1;
            let stands = |word: &str| files.iter().any(|file| file.words.contains(word));
            if !split_words(name).all(stands) && !NOT_OURS.iter().any(|(own, _)| *own == name) {
                strangers.push(format!("line {}, {}: {name}", named.line, section.title));
            }
        }
    }
    (seen, strangers)
}

fn find_inside() -> Document {
    documents().into_iter().find(|document| document.name.ends_with("inside.md")).expect("a chapter")
}

#[test]
fn identifiers_stand_in_a_file_of_their_section() {
    let found: Vec<(usize, Vec<String>)> = list_sections(&find_inside()).iter().map(list_strangers).collect();
    let strangers: Vec<String> = found.iter().flat_map(|(_, strangers)| strangers.clone()).collect();
    let seen: usize = found.iter().map(|(seen, _)| seen).sum();
    println!("{seen} identifiers beside files, {} not in them", strangers.len());
    assert!(strangers.is_empty(), "in no file that the section names:\n  {}", strangers.join("\n  "));
    assert!(seen > 80, "only {seen} identifiers were found");
}

#[test]
fn files_of_the_inner_chapter_are_there() {
    let spans = find_inside().spans();
    let paths = spans.iter().filter(|(_, span)| is_path(span) && !span.split(['/', '.', '_']).any(is_placeholder));
    let is_chapter = |span: &str| root().join("gateway/handbook").join(span).exists();
    let (there, gone): (Vec<_>, Vec<_>) = paths
        .partition(|(_, span)| is_chapter(span) || root().join(span).exists() || !INDEX.find_files(span).is_empty());
    assert!(gone.is_empty(), "named, and not there: {gone:?}");
    assert!(there.len() > 100, "only {} files were found", there.len());
}

#[test]
fn identifiers_of_pictures_are_there() {
    let blocks = find_inside().blocks();
    let lines = blocks.iter().filter(|block| block.language == "text").flat_map(|block| &block.lines);
    let is_name = |word: &&str| word.contains("::") || word.trim_matches('_').contains('_');
    let is_code = |word: &&str| !is_path(word) && !is_command(word);
    let words: Vec<String> = lines
        .flat_map(|line| line.split([' ', ',', '(']))
        .filter(is_code)
        .flat_map(split_paths)
        .filter(is_name)
        .map(str::to_owned)
        .collect();
    let gone: Vec<&String> = words.iter().filter(|name| !is_there(name)).collect();
    println!("{} identifiers of pictures, {} not there", words.len(), gone.len());
    assert!(gone.is_empty(), "drawn, and nowhere in the sources: {gone:?}");
    assert!(words.len() > 15, "only {} identifiers were found", words.len());
}

#[test]
fn names_that_are_not_there_are_found() {
    assert!(is_there("Gate::decide_override") && !is_there("Gate::obey") && !is_there("Gatekeeper::decide_override"));
    assert!(
        is_there("stale_s") && is_there("spindle_speed_rpm") && is_there("_ns") && !is_there("run_orders_of_yesterday")
    );
    assert_eq!(list_names("Type::member", false), ["Type::member"]);
    assert_eq!(list_names("cargo test some_test", true), [""; 0]);
    assert_eq!(list_names("effect_KIND", true), [""; 0]);
    assert_eq!(list_names("two plain words", true), [""; 0]);
}
