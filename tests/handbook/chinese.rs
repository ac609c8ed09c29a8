//! The Chinese chapters say what the English ones say: the same commands and files, the same names in code, the same numbers, section by
//! section.

use crate::documents::{Document, root};
use gateway::handbook::CHAPTERS;
use std::collections::{BTreeMap, BTreeSet};

/// Chapters for who develops the program; the list of the page says that they are in English.
const IN_ENGLISH: [&str; 3] = ["inside", "tests", "changelog"];
/// A number that is written in words in English may stand in digits up to this one.
const WORDS_UP_TO: f64 = 12.0;

/// What of a section a reader would type or compare.
#[derive(Debug, Default)]
struct SectionContent {
    title: String,
    /// How often each number stands in running text and tables.
    numbers: BTreeMap<String, usize>,
    /// Code in running text.
    spans: BTreeSet<String>,
}

/// Numbers as they are written: digits with commas between thousands and a decimal point.
fn find_numbers(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let letters: Vec<char> = text.chars().collect();
    let mut at = 0;
    while at < letters.len() {
        if !letters[at].is_ascii_digit() {
            at += 1;
            continue;
        }
        let begins_word = at > 0 && (letters[at - 1].is_ascii_alphabetic() || letters[at - 1] == '_');
        let start = at;
        let digit = |index: usize| letters.get(index).is_some_and(char::is_ascii_digit);
        while digit(at) || (matches!(letters.get(at), Some(',' | '.')) && digit(at + 1)) {
            at += 1;
        }
        if !begins_word {
            found.push(letters[start..at].iter().collect());
        }
    }
    found
}

/// Sections of a chapter, without its blocks of code.
fn split_sections(text: &str) -> Vec<SectionContent> {
    let mut sections = vec![SectionContent::default()];
    let mut in_block = false;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
            continue;
        }
        if in_block || line.starts_with("    ") {
            continue;
        }
        if line.starts_with("## ") {
            sections.push(SectionContent { title: line.to_owned(), ..SectionContent::default() });
        }
        let Some(said) = sections.last_mut() else { continue };
        let parts: Vec<&str> = line.split('`').collect();
        for (index, part) in parts.iter().enumerate() {
            if index % 2 == 1 {
                said.spans.insert((*part).to_owned());
                continue;
            }
            // Where a link leads is no number of the text.
            let shown: Vec<&str> = part
                .split("](")
                .enumerate()
                .map(|(at, it)| if at == 0 { it } else { it.split_once(')').map_or("", |it| it.1) })
                .collect();
            for number in shown.iter().flat_map(|it| find_numbers(it)) {
                *said.numbers.entry(number).or_default() += 1;
            }
        }
    }
    sections
}

/// A line of code without the words that follow a comment sign.
fn strip_comment(line: &str) -> &str {
    let signs = [" # ", " -- ", " // "];
    let ends = signs.iter().filter_map(|sign| line.find(sign)).min().unwrap_or(line.len());
    let own = line[..ends].trim_end();
    if ["# ", "-- ", "// "].iter().any(|sign| own.starts_with(sign)) { "" } else { own }
}

/// Blocks that a reader copies; pictures in letters and what a program prints are told in the reader's language.
fn list_copied(document: &Document) -> Vec<Vec<String>> {
    let lines =
        |block: &crate::documents::Block| block.lines.iter().map(|line| strip_comment(line).to_owned()).collect();
    document.blocks().iter().filter(|block| block.language != "text").map(lines).collect()
}

fn name_document(name: &str, text: &str) -> Document {
    Document { name: name.to_owned(), path: root(), text: text.to_owned() }
}

/// What differs between two sections.
fn list_differences(own: &SectionContent, other: &SectionContent) -> Vec<String> {
    let mut wrong = Vec::new();
    for span in own.spans.difference(&other.spans) {
        wrong.push(format!("`{span}` is missing"));
    }
    for (number, count) in &own.numbers {
        let there = other.numbers.get(number).copied().unwrap_or(0);
        if there < *count {
            wrong.push(format!("{number} stands {there} times, in English {count}"));
        }
    }
    let small = |number: &str| number.parse::<f64>().is_ok_and(|it| it <= WORDS_UP_TO);
    for (number, count) in other.numbers.iter().filter(|(number, _)| !small(number)) {
        let there = own.numbers.get(number).copied().unwrap_or(0);
        if there < *count {
            wrong.push(format!("{number} stands {count} times, in English {there}"));
        }
    }
    wrong
}

#[test]
fn chinese_chapters_have_the_code_and_the_numbers_of_the_english_ones() {
    let (mut wrong, mut compared) = (Vec::new(), 0);
    for chapter in CHAPTERS {
        let Some(zh) = chapter.zh else { continue };
        let (own, other) = (split_sections(chapter.text), split_sections(zh));
        assert_eq!(own.len(), other.len(), "{}: sections", chapter.topic);
        for (own, other) in own.iter().zip(&other) {
            compared += own.numbers.len() + own.spans.len();
            wrong.extend(
                list_differences(own, other).into_iter().map(|it| format!("{} {}: {it}", chapter.topic, own.title)),
            );
        }
        let (own, other) =
            (list_copied(&name_document(chapter.topic, chapter.text)), list_copied(&name_document(chapter.topic, zh)));
        assert_eq!(own, other, "{}: what is copied", chapter.topic);
    }
    println!("{compared} numbers and pieces of code compared");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_chapter_for_the_shop_is_there_in_chinese() {
    let missing: Vec<&str> = CHAPTERS.iter().filter(|it| it.zh.is_none()).map(|it| it.topic).collect();
    assert_eq!(
        missing, IN_ENGLISH,
        "write gateway/handbook/zh/NAME.md, and `zh` behind its row in gateway/handbook/lib.rs"
    );
}

#[test]
fn numbers_are_found_as_they_are_written() {
    assert_eq!(find_numbers("1,024个地址，2.5 s，MQTT5 不算，0至4"), ["1,024", "2.5", "0", "4"]);
    assert_eq!(strip_comment("a = 1   # 注释"), "a = 1");
    assert_eq!(strip_comment("# 注释"), "");
}
