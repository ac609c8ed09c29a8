//! Every file of the data directory, in one place: whether a backup holds it, and how it comes back, or why it is not in a backup.
//!
//! A test runs a whole box and fails when it leaves a file that no row here names. A box that has been restored decides as the one
//! that was saved: whatever a decision depends on is in a row with another fate than [`Fate::Left`].

use super::BackupPaths;
use std::path::Path;

/// What a backup makes of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It is in the backup. A restore puts it in its place.
    AtOnce,
    /// It is in the backup. A running box writes it from memory and would write over it, so a restore lays it ready and the next
    /// start takes it.
    AtStart,
    /// It is not in a backup, because ...
    Left(&'static str),
}

/// Name below the data directory, with `*` for anything, and what a backup makes of it.
type Row = (&'static str, Fate);

const SEEN_TO: &str = "it is written anew whenever it is needed, from what is in the backup";
const SECRET: &str = "a backup goes from hand to hand, and it holds a secret";
const LARGE: &str = "the history is too large for an archive; `cnc-gateway backup --history` copies it beside";

/// The list. The first row that fits counts.
pub const LIST: &[Row] = &[
    ("*.writing", Fate::Left("half a file, which its writer was stopped at")),
    ("*.json.before", Fate::Left("the save before the last one, which is in the backup")),
    ("*.json.damaged", Fate::Left("the disk has changed it; a person has to look at it, at this box")),
    ("settings.toml", Fate::AtOnce),
    ("annotations.jsonl", Fate::AtOnce),
    ("thermal_model.json", Fate::AtOnce),
    ("identified/*", Fate::AtOnce),
    ("drafts/*", Fate::AtOnce),
    ("versions/*", Fate::AtOnce),
    ("estimators.json", Fate::AtStart),
    ("scripts.json", Fate::AtStart),
    ("wear.json", Fate::AtStart),
    ("thermal.json", Fate::AtStart),
    ("twin.json", Fate::AtStart),
    ("model-improved.toml", Fate::AtStart),
    ("scripts_in_charge.json", Fate::Left(SEEN_TO)),
    ("commission.html", Fate::Left(SEEN_TO)),
    ("scripts/*.new", Fate::Left(SEEN_TO)),
    ("persons.json", Fate::Left(SECRET)),
    ("tls/*", Fate::Left(SECRET)),
    (
        "offsets.json",
        Fate::Left("it says what stands in the control now; an older one would take back the wrong amount"),
    ),
    ("offsets.json.unreadable", Fate::Left("a person has to look at it, at this box")),
    ("crashes/*", Fate::Left("reports of what broke off, for the support bundle")),
    ("box-id", Fate::Left("it says which box this is; another box that is restored from the backup stays another one")),
    ("confirmed", Fate::Left("which version of the program is well, at this box")),
    ("backup-check/*", Fate::Left("a scratch folder, in which a backup is tried")),
    ("diagnoses/*", Fate::Left("reports to read, which decide nothing")),
    ("control.sock", Fate::Left("an entrance of the running process")),
    ("*-before-restore-*.tar.gz", Fate::Left("it is a backup itself")),
    ("restore-kept/*", Fate::Left("what a restore was replacing when it was stopped")),
    ("restored/*", Fate::Left("a restore that waits for the next start")),
];

/// What a backup makes of this file of the data directory, as far as names tell; `None`: nobody has thought of it.
#[must_use]
pub fn find_fate(places: &BackupPaths, path: &Path) -> Option<Fate> {
    let below = path.strip_prefix(&places.data_dir).ok()?;
    let named = [&places.operations, &places.model, &places.thermal_model, &places.configuration];
    if named.into_iter().flatten().any(|it| it == path) {
        return Some(Fate::AtOnce);
    }
    if places.model.as_ref().is_some_and(|model| model.with_extension("before.toml") == path) {
        return Some(Fate::Left("the model before the one in force, which is in the backup"));
    }
    if path.parent() == Some(&places.scripts) && super::is_of_scripts(&path.file_name()?.to_string_lossy()) {
        return Some(Fate::AtOnce);
    }
    // The database, and what SQLite and the gateway keep beside it.
    if path.to_string_lossy().starts_with(&*places.history.to_string_lossy()) {
        return Some(Fate::Left(LARGE));
    }
    of_name(&below.to_string_lossy())
}

/// What a backup makes of a file of this name below the data directory.
#[must_use]
pub fn of_name(name: &str) -> Option<Fate> {
    LIST.iter().find(|(pattern, _)| matches_pattern(pattern, name)).map(|(_, fate)| *fate)
}

/// `*` stands for anything within one folder, so that no name leads elsewhere.
fn matches_pattern(pattern: &str, name: &str) -> bool {
    let (mut wanted, mut given) = (pattern.split('/'), name.split('/'));
    loop {
        match (wanted.next(), given.next()) {
            (None, None) => return true,
            (Some(part), Some(word)) if fits_word(part, word) => {}
            _ => return false,
        }
    }
}

fn fits_word(pattern: &str, word: &str) -> bool {
    if ["", ".", ".."].contains(&word) {
        return false;
    }
    let mut parts = pattern.split('*');
    let Some(mut rest) = word.strip_prefix(parts.next().unwrap_or_default()) else { return false };
    let parts: Vec<&str> = parts.collect();
    let Some((last, between)) = parts.split_last() else { return rest.is_empty() };
    for part in between {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_and_unknown_ones_are_not() {
        for (name, wanted) in [
            ("*.json.before", Fate::Left("the save before the last one, which is in the backup")),
            ("*.json.damaged", Fate::Left("the disk has changed it; a person has to look at it, at this box")),
            ("settings.toml", Fate::AtOnce),
            ("drafts/a.rhai.json", Fate::AtOnce),
            ("wear.json", Fate::AtStart),
            ("wear.json.writing", LIST[0].1),
            ("persons.json", Fate::Left(SECRET)),
        ] {
            assert_eq!(of_name(name), Some(wanted), "{name}");
        }
        let kept = of_name("cnc-gateway-before-restore-2026.tar.gz");
        assert_eq!(kept, Some(Fate::Left("it is a backup itself")));
        for name in [
            "another.json",
            "wear.jsonl",
            "persons.json.old",
            "drafts",
            "drafts/..",
            "drafts/../x",
            "sub/settings.toml",
        ] {
            assert_eq!(of_name(name), None, "{name}");
        }
    }
}
