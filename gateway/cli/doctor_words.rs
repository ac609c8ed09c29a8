//! The words of the report of `doctor` in the language of the command.

use adapters::channel::Channel;
use rules::physics::explain::Language;

/// Phrases of what computer, sources and receivers say, a tab, and the same in Chinese. Longer phrases stand before their parts.
const PHRASES: &str = include_str!("doctor_zh.tsv");

/// The words of the report. What a device says itself, and what the table does not know, stands as it was said.
#[derive(Clone, Copy)]
pub(super) struct ReportWords(pub(super) Language);

impl ReportWords {
    pub(super) fn select(self, en: &'static str, zh: &'static str) -> &'static str {
        self.0.select_text(en, zh)
    }

    /// The text with the phrases of the table in the language of the command.
    pub(super) fn translate_phrases(self, text: &str) -> String {
        if self.0 == Language::En {
            return text.to_owned();
        }
        let phrases = PHRASES.lines().filter_map(|line| line.split_once('\t'));
        phrases.fold(text.to_owned(), |text, (en, zh)| text.replace(en, zh))
    }

    pub(super) fn format_problem(self, what: &str, next: &str) -> String {
        let (problem, step) = (self.select("problem", "问题"), self.select("next", "处理"));
        format!("  {problem}: {}\n    {step}: {}", self.translate_phrases(what), self.translate_phrases(next))
    }

    /// In Chinese beside its meaning: the name is what the configuration knows.
    pub(super) fn name_channel(self, channel: &'static Channel) -> String {
        self.0.select_text(channel.name.to_owned(), format!("{} {}", channel.name, channel.zh))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::{SystemFiles, examine_computer};
    use adapters::driver::FactValue;
    use std::path::Path;

    /// Words of English that stand one behind the other.
    fn count_english_words(text: &str) -> usize {
        let words = text.split(|letter: char| !letter.is_ascii_lowercase()).filter(|word| word.len() > 2);
        words
            .filter(|word| ["the", "and", "that", "with", "has", "not", "for", "its", "are", "nothing"].contains(word))
            .count()
    }

    #[test]
    fn what_is_said_of_the_computer_is_chinese_in_chinese() {
        let words = ReportWords(Language::Zh);
        let report = examine_computer(&SystemFiles::default(), Path::new("/"));
        assert!(report.facts.len() > 5);
        for fact in &report.facts {
            let value =
                if let FactValue::Text(text) = &fact.value { words.translate_phrases(text) } else { String::new() };
            let told = format!("{}: {value}", words.translate_phrases(&fact.name));
            assert_eq!(count_english_words(&told), 0, "{told}");
        }
        for problem in &report.problems {
            let told = words.format_problem(&problem.what, &problem.next);
            assert_eq!(count_english_words(&told), 0, "{told}");
        }
    }

    #[test]
    fn the_table_is_in_order_and_english_stays_as_it_was_said() {
        let rows: Vec<(&str, &str)> = PHRASES.lines().filter_map(|line| line.split_once('\t')).collect();
        assert_eq!(rows.len(), PHRASES.lines().count(), "a line without a tab");
        for (at, (en, _)) in rows.iter().enumerate() {
            let hidden = rows[..at].iter().find(|(earlier, _)| en.contains(earlier));
            assert_eq!(hidden, None, "{en:?} stands behind a part of it");
        }
        assert_eq!(ReportWords(Language::En).translate_phrases("the machine is off"), "the machine is off");
        assert_eq!(ReportWords(Language::Zh).translate_phrases("the machine is off"), "机床已关机");
    }
}
