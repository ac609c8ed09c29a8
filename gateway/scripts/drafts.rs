//! Scripts that somebody is writing, and the versions that were in charge before: beside everything else that the box keeps, in
//! `drafts/NAME` and `versions/NAME`, one JSON document each.
//!
//! A draft counts for nothing until it is put in charge. Two persons may have the same script open: whoever saves second is told,
//! because each save names the text that it began from.

use gateway_base::files::compute_digest;
use gateway_base::files::{read_text, replace_file};
use rules::script::TEXT_MAX;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Versions that are kept of one script; the oldest go first.
const VERSIONS_MAX: usize = 100;
/// A file of versions is never read beyond this.
const FILE_MAX: usize = VERSIONS_MAX * (TEXT_MAX + 4096);
/// Length of a name.
const NAME_MAX: usize = 80;

/// A script that is being written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Draft {
    /// The whole text of the script.
    pub text: String,
    /// Name of the person who saved it last.
    pub by: String,
    /// When, milliseconds since 1970.
    pub at_ms: i64,
}

/// A text that was in charge.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Version {
    /// The whole text of the script.
    pub text: String,
    /// Who put it in charge; empty where it was there before anybody used the page.
    pub by: String,
    /// When it was put in charge, or first seen, milliseconds since 1970.
    pub at_ms: i64,
}

/// What tells one text from another.
#[must_use]
pub fn digest_of(text: &str) -> String {
    format!("{:016x}", compute_digest(text.as_bytes()))
}

/// May a script be called this? Lower-case letters, digits and `_`, ending in `.rhai`: never a path.
#[must_use]
pub fn is_name(name: &str) -> bool {
    let stem = name.strip_suffix(".rhai").unwrap_or_default();
    let known = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    !stem.is_empty() && name.len() <= NAME_MAX && stem.chars().all(known)
}

/// Where drafts and versions are. Names are checked with [`is_name`] before they come here.
#[derive(Debug, Clone)]
pub struct Drafts {
    data_dir: PathBuf,
}

impl Drafts {
    /// Those of the box that keeps everything here.
    #[must_use]
    pub fn from_data_dir(data_dir: &Path) -> Self {
        Self { data_dir: data_dir.to_owned() }
    }

    fn file_path(&self, folder: &str, name: &str) -> PathBuf {
        self.data_dir.join(folder).join(format!("{name}.json"))
    }

    fn write(&self, folder: &str, name: &str, text: &str) -> std::io::Result<()> {
        std::fs::create_dir_all(self.data_dir.join(folder))?;
        replace_file(&self.file_path(folder, name), text)
    }

    /// The draft of this script; `None` where there is none.
    #[must_use]
    pub fn read_draft(&self, name: &str) -> Option<Draft> {
        let text = read_text(&self.file_path("drafts", name), 2 * TEXT_MAX + 4096).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// The scripts that have a draft.
    #[must_use]
    pub fn list_names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.data_dir.join("drafts")).into_iter().flatten().flatten();
        let names =
            entries.filter_map(|entry| Some(entry.file_name().into_string().ok()?.strip_suffix(".json")?.to_owned()));
        let mut names: Vec<String> = names.filter(|name| is_name(name)).collect();
        names.sort();
        names
    }

    /// Keeps a draft.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_draft(&self, name: &str, draft: &Draft) -> std::io::Result<()> {
        self.write("drafts", name, &serde_json::to_string(draft)?)
    }

    /// Removes the draft; nothing where there is none.
    ///
    /// # Errors
    /// The file cannot be removed.
    pub fn remove_draft(&self, name: &str) -> std::io::Result<()> {
        match std::fs::remove_file(self.file_path("drafts", name)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }

    /// What was in charge before, the newest first.
    #[must_use]
    pub fn read_versions(&self, name: &str) -> Vec<Version> {
        let text = read_text(&self.file_path("versions", name), FILE_MAX).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// Keeps a version, unless the newest one is the same text.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn keep_version(&self, name: &str, version: Version) -> std::io::Result<()> {
        let mut versions = self.read_versions(name);
        if versions.first().is_some_and(|newest| newest.text == version.text) {
            return Ok(());
        }
        versions.insert(0, version);
        versions.truncate(VERSIONS_MAX);
        self.write("versions", name, &serde_json::to_string(&versions)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn version(text: &str, at_ms: i64) -> Version {
        Version { text: text.to_owned(), by: "Li".to_owned(), at_ms }
    }

    #[test]
    fn a_name_is_never_a_path() {
        assert!(is_name("alarms.rhai") && is_name("my_2.rhai"));
        for name in ["", ".rhai", "../a.rhai", "a/b.rhai", "a.rhai.json", "A.rhai", "a.b.rhai", "a\0.rhai", "C:a.rhai"]
        {
            assert!(!is_name(name), "{name}");
        }
        assert!(!is_name(&format!("{}.rhai", "a".repeat(100))));
    }

    #[test]
    fn drafts_and_versions_come_back_and_the_oldest_go() {
        let directory = tempfile::tempdir().expect("a directory");
        let drafts = Drafts::from_data_dir(directory.path());
        assert_eq!((drafts.read_draft("a.rhai"), drafts.read_versions("a.rhai")), (None, Vec::new()));
        let draft = Draft { text: "let x = 1;".to_owned(), by: "Li".to_owned(), at_ms: 5 };
        drafts.save_draft("a.rhai", &draft).expect("written");
        assert_eq!(drafts.read_draft("a.rhai"), Some(draft));
        drafts.remove_draft("a.rhai").expect("removed");
        drafts.remove_draft("a.rhai").expect("nothing to remove");
        assert_eq!(drafts.read_draft("a.rhai"), None);
        for at in 0..150 {
            drafts.keep_version("a.rhai", version(&format!("{}", at / 2), at)).expect("written");
        }
        let kept = drafts.read_versions("a.rhai");
        assert_eq!((kept.len(), kept[0].text.as_str(), kept[74].text.as_str()), (75, "74", "0"));
        for at in 150..400 {
            drafts.keep_version("a.rhai", version(&format!("{at}"), at)).expect("written");
        }
        assert_eq!(drafts.read_versions("a.rhai").len(), VERSIONS_MAX);
    }
}
