//! Files of what the box has learned: with a checksum, with the save before the last beside each, and never written over where
//! they are damaged.
//!
//! `NAME` is the newest save, `NAME.before` the one before it, `NAME.damaged` a file that the disk has changed, for a person to
//! look at. Form: `{"schema":"learned/1","crc32":"<8 hex digits>","state":<what was learned>,"sealed":true}`; the sum (ISO-HDLC)
//! covers the text of the state. A file of an older version is the state alone, without a sum: it has neither that beginning nor
//! that end.

use crate::files::replace_file;
use crate::log::{Notice, Severity};
use crate::problem::StatusProblem;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

const BEFORE: &str = ".before";
const DAMAGED: &str = ".damaged";
/// What stands before the sum, and between it and the state.
const HEAD: &str = "{\"schema\":\"learned/1\",\"crc32\":\"";
const STATE: &str = "\",\"state\":";
const END: &str = ",\"sealed\":true}";

fn add_suffix(path: &Path, end: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    name.into()
}

/// The file of a state, which is a text of JSON.
fn format_with_checksum(state: &str) -> String {
    format!("{HEAD}{:08x}{STATE}{state}{END}", crc32fast::hash(state.as_bytes()))
}

/// The state in a file; `None` when it is not as it was written.
#[must_use]
pub fn state_of(text: &str) -> Option<&str> {
    if !text.starts_with(HEAD) && !text.ends_with(END) {
        return serde_json::from_str::<serde::de::IgnoredAny>(text).is_ok().then_some(text);
    }
    let (sum, rest) = text.strip_prefix(HEAD)?.split_once(STATE)?;
    let state = rest.strip_suffix(END)?;
    (sum == format!("{:08x}", crc32fast::hash(state.as_bytes()))).then_some(state)
}

/// Saves a state, and keeps the save before it.
///
/// # Errors
/// The file cannot be written; what was there is there still, under one of its names.
pub fn save_state(path: &Path, state: &str) -> io::Result<()> {
    match std::fs::rename(path, add_suffix(path, BEFORE)) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => replace_file(path, &format_with_checksum(state)),
    }
}

/// What was learned until the last save, if anything was; a damaged file is set aside, the save before it takes its place, and
/// `tell` is told.
pub fn read(path: &Path, mut tell: impl FnMut(Notice)) -> Option<String> {
    let text = match std::fs::read(path) {
        Ok(bytes) => String::from_utf8(bytes).unwrap_or_default(),
        // Killed between the two steps of a save.
        Err(error) if error.kind() == ErrorKind::NotFound => return read_previous(path),
        Err(error) => {
            let text = format!("{}: what was learned cannot be read: {error}", path.display());
            tell(Notice::new(Severity::Error, "learned_unreadable", text));
            return None;
        }
    };
    if let Some(state) = state_of(&text) {
        return Some(state.to_owned());
    }
    let aside = add_suffix(path, DAMAGED);
    let kept = match std::fs::rename(path, &aside) {
        Ok(()) => format!("it is kept as {}", aside.display()),
        Err(error) => format!("it could not be set aside ({error})"),
    };
    let before = read_previous(path);
    let then = if before.is_some() { "the save before it is in force" } else { "it is learned anew" };
    let text = format!("{}: the disk has changed what was learned; {kept}, and {then}", path.display());
    tell(Notice::new(Severity::Error, "learned_damaged", text));
    before
}

fn read_previous(path: &Path) -> Option<String> {
    let text = std::fs::read_to_string(add_suffix(path, BEFORE)).ok()?;
    state_of(&text).map(str::to_owned)
}

/// Damaged files of this directory that nobody has looked at yet.
#[must_use]
pub fn list_damaged(directory: &Path) -> Vec<StatusProblem> {
    let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(&format!(".json{DAMAGED}"))).collect();
    names.sort();
    let problem = |name: String| StatusProblem {
        what: format!(
            "{} was damaged on the disk, and an older save or none is in force",
            name.trim_end_matches(DAMAGED)
        ),
        next: format!("look at the disk; then restore a backup, or remove {}", directory.join(&name).display()),
    };
    names.into_iter().map(problem).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &Path) -> (Option<String>, Vec<String>) {
        let mut told = Vec::new();
        let state = read(path, |notice| told.push(notice.operator));
        (state, told)
    }

    #[test]
    fn every_changed_byte_is_noticed_and_nothing_is_written_over() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("wear.json");
        assert_eq!(found(&path), (None, Vec::new()), "a first start");
        save_state(&path, "{\"edges\":1.25}").expect("written");
        save_state(&path, "{\"edges\":2.5}").expect("written");
        let whole = std::fs::read(&path).expect("there");
        for index in 0..whole.len() {
            for bit in 0..8 {
                let mut bytes = whole.clone();
                bytes[index] ^= 1 << bit;
                std::fs::write(&path, &bytes).expect("written");
                let (state, told) = found(&path);
                assert_eq!(state.as_deref(), Some("{\"edges\":1.25}"), "byte {index}, bit {bit}");
                assert!(told[0].contains("wear.json.damaged") && told[0].contains("before it is in force"), "{told:?}");
                assert_eq!(std::fs::read(directory.path().join("wear.json.damaged")).expect("kept"), bytes);
            }
        }
        assert_eq!(list_damaged(directory.path()).len(), 1);
        std::fs::write(&path, &whole).expect("written");
        assert_eq!(found(&path), (Some("{\"edges\":2.5}".to_owned()), Vec::new()));
        std::fs::remove_file(&path).expect("removed");
        assert_eq!(found(&path).0.as_deref(), Some("{\"edges\":1.25}"), "killed between the two steps");
    }

    #[test]
    fn a_file_of_an_older_version_has_no_sum() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("twin.json");
        std::fs::write(&path, "{\"a\": [1, 2]}\n").expect("written");
        assert_eq!(found(&path).0.as_deref(), Some("{\"a\": [1, 2]}\n"));
        for broken in [
            "",
            "{\"a\": [1, 2",
            "\u{0}\u{0}\u{0}",
            "{\"schema\":\"learned/1\",\"crc32\":\"0\",\"state\":1,\"sealed\":true}",
        ] {
            std::fs::write(&path, broken).expect("written");
            let (state, told) = found(&path);
            assert_eq!((state, told.len()), (None, 1), "{broken:?}");
            assert!(told[0].contains("learned anew"), "{told:?}");
        }
    }
}
