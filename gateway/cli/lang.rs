//! The language of everything that a command prints: `--lang`, else what the computer is set to (`LC_ALL`, `LC_MESSAGES`, `LANG`).

use adapters::bilingual::Bilingual;
use clap::ValueEnum;
use rules::physics::explain::Language;
use std::sync::OnceLock;

/// A language of the product.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Lang {
    /// English.
    En,
    /// Chinese.
    Zh,
}

impl From<Lang> for Language {
    fn from(lang: Lang) -> Self {
        match lang {
            Lang::En => Self::En,
            Lang::Zh => Self::Zh,
        }
    }
}

static CHOSEN: OnceLock<Language> = OnceLock::new();

/// Chooses once, before anything is printed.
pub(super) fn choose_language(asked: Option<Lang>) {
    let _already_chosen = CHOSEN.set(asked.map_or_else(of_computer, Language::from));
}

/// The language of this process.
pub(super) fn language() -> Language {
    CHOSEN.get().copied().unwrap_or(Language::En)
}

/// Does the command line of this process say a language?
pub(super) fn was_asked() -> bool {
    asked_in(std::env::args_os()).is_some()
}

/// What the computer is set to; the first of the variables that says anything decides, as in every program.
pub(super) fn of_computer() -> Language {
    let said = ["LC_ALL", "LC_MESSAGES", "LANG"]
        .into_iter()
        .filter_map(|name| std::env::var(name).ok())
        .find(|value| !value.is_empty());
    if said.is_some_and(|said| said.starts_with("zh")) { Language::Zh } else { Language::En }
}

/// The language that the arguments ask for, before they are understood: help is printed while they are read.
pub(super) fn asked_in(arguments: impl Iterator<Item = std::ffi::OsString>) -> Option<Language> {
    let texts: Vec<String> = arguments.filter_map(|argument| argument.into_string().ok()).collect();
    let value = texts.iter().enumerate().find_map(|(index, text)| {
        text.strip_prefix("--lang=")
            .map(str::to_owned)
            .or_else(|| (text == "--lang").then(|| texts.get(index + 1).cloned()).flatten())
    })?;
    match value.as_str() {
        "zh" => Some(Language::Zh),
        "en" => Some(Language::En),
        _ => None,
    }
}

/// The arguments without a `--lang` before the command: it belongs to every command, and the options before a command are those of `run`.
pub(super) fn move_behind_command(arguments: Vec<std::ffi::OsString>) -> Vec<std::ffi::OsString> {
    let text = |at: usize| arguments.get(at).and_then(|argument| argument.to_str()).unwrap_or_default();
    let count = match text(1) {
        "--lang" => 2,
        one if one.starts_with("--lang=") => 1,
        _ => return arguments,
    };
    if text(1 + count).is_empty() || text(1 + count).starts_with('-') {
        return arguments;
    }
    let (head, rest) = (&arguments[..1], &arguments[1..]);
    [head, &rest[count..=count], &rest[..count], &rest[count + 1..]].concat()
}

/// A sentence in the language of this process.
pub(super) fn localize_text(text: &Bilingual) -> &str {
    pick_text(&text.en, &text.zh)
}

/// One of two texts.
pub(super) fn pick_text<'t>(en: &'t str, zh: &'t str) -> &'t str {
    language().select_text(en, zh)
}
