//! The handbook: chapters in Markdown that stand beside this file and are part of the program, so that a box without a
//! network can explain itself.
//!
//! A chapter is about one topic. Its topic is the name of its file, its title is its first heading. Every chapter is a row
//! of the table below; `tests/handbook/` fails when a file of the folder has no row.

use adapters::channel::find_nearest_name;
use rules::physics::explain::Language;

/// One chapter of the handbook.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chapter {
    /// What `cnc-gateway help` calls it; the name of the file without its ending.
    pub topic: &'static str,
    /// The whole chapter in English, Markdown.
    pub text: &'static str,
    /// The same in Chinese, where it is written.
    pub zh: Option<&'static str>,
}

impl Chapter {
    /// The chapter in this language; in English where there is no other.
    #[must_use]
    pub fn text_in(&self, language: Language) -> &'static str {
        self.zh.filter(|_| language == Language::Zh).unwrap_or(self.text)
    }

    /// The first heading, without its mark; the topic where there is none.
    #[must_use]
    pub fn title(&self, language: Language) -> &'static str {
        self.text_in(language).lines().find_map(|line| line.strip_prefix("# ")).map_or(self.topic, str::trim)
    }
}

macro_rules! chapters {
    (@zh $topic:literal) => { None };
    (@zh $topic:literal zh) => { Some(include_str!(concat!("zh/", $topic, ".md"))) };
    ($($topic:literal $($zh:ident)?),* $(,)?) => {
        /// Every chapter, in the order in which a reader wants them; those with `zh` also in Chinese.
        pub static CHAPTERS: &[Chapter] =
            &[$(Chapter { topic: $topic, text: include_str!(concat!($topic, ".md")), zh: chapters!(@zh $topic $($zh)?) }),*];
    };
}

chapters! {
    "install" zh,
    "start" zh,
    "configuration" zh,
    "sources" zh,
    "recordings" zh,
    "rules" zh,
    "history" zh,
    "contracts" zh,
    "fanuc" zh,
    "pace" zh,
    "gate" zh,
    "access" zh,
    "page" zh,
    "outputs" zh,
    "fleet" zh,
    "conformance" zh,
    "mismatch" zh,
    "measured" zh,
    "survives" zh,
    "not-proven" zh,
    "glossary" zh,
    "inside",
    "tests",
    "changelog",
}

/// The chapter of this topic. Case does not count.
#[must_use]
pub fn find_chapter(topic: &str) -> Option<&'static Chapter> {
    CHAPTERS.iter().find(|chapter| chapter.topic.eq_ignore_ascii_case(topic))
}

/// The topic that is written most like this one, if one is near.
#[must_use]
pub fn nearest_topic(topic: &str) -> Option<&'static str> {
    find_nearest_name(topic, CHAPTERS.iter().map(|chapter| chapter.topic))
}

/// One line for each chapter: topic and title.
#[must_use]
pub fn list_contents(language: Language) -> String {
    let width = CHAPTERS.iter().map(|chapter| chapter.topic.len()).max().unwrap_or(0);
    let line = |chapter: &Chapter| format!("  {:width$}  {}\n", chapter.topic, chapter.title(language));
    CHAPTERS.iter().map(line).collect()
}
