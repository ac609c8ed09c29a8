//! `offsets.json`: what was written to which control and not given back. Survives a power cut.
//!
//! ```json
//! {"schema":"offsets/2","controls":{"fanuc://192.168.1.10:8193":{"z":{"base_um":0.0,"written_um":5.0,"intended_um":7.0}}}}
//! ```
//!
//! A control that the configuration no longer names keeps its entry: what is shifted there a person has to see to.

use adapter_core::offset::{Axis, Left};
use gateway_files::files::replace_durably;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Name of the file in the data directory.
const FILE: &str = "offsets.json";
const SCHEMA: &str = "offsets/2";

type Axes = BTreeMap<String, Left>;

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct JournalContent {
    schema: String,
    /// By the address of the control.
    controls: BTreeMap<String, Axes>,
}

/// `offsets/1` knew one control.
#[derive(Deserialize)]
struct OneControl {
    target: String,
    axes: Axes,
}

/// What was written to which control and not given back; survives a power cut.
#[derive(Debug, Clone)]
pub struct OffsetJournal {
    path: PathBuf,
    target: String,
    content: JournalContent,
}

impl OffsetJournal {
    /// The book in this directory, for this control; empty where there is none.
    ///
    /// # Errors
    /// There is one that cannot be read. Nobody knows then what is left in the control.
    pub fn open(data_dir: &Path, target: &str) -> io::Result<Self> {
        let path = data_dir.join(FILE);
        let content = match std::fs::read_to_string(&path) {
            Ok(text) => parse(&text)?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => JournalContent::default(),
            Err(error) => return Err(error),
        };
        Ok(Self { path, target: target.to_owned(), content: JournalContent { schema: SCHEMA.to_owned(), ..content } })
    }

    /// Puts a book that cannot be read aside, and begins an empty one.
    ///
    /// # Errors
    /// It cannot be put aside.
    pub fn begin_anew(data_dir: &Path, target: &str) -> io::Result<(Self, PathBuf)> {
        let (path, aside) = (data_dir.join(FILE), data_dir.join(format!("{FILE}.unreadable")));
        std::fs::rename(path, &aside)?;
        Self::open(data_dir, target).map(|book| (book, aside))
    }

    /// Path of the book in the data directory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is left of this axis in this control.
    #[must_use]
    pub fn find_leftover(&self, axis: Axis) -> Option<Left> {
        self.content.controls.get(&self.target)?.get(axis.as_word()).copied()
    }

    /// What is left in every control: its address, the axis, and what it is.
    pub fn list_leftovers(&self) -> impl Iterator<Item = (&str, Axis, Left)> {
        let each = self.content.controls.iter().flat_map(|(target, axes)| axes.iter().map(move |it| (target, it)));
        each.filter_map(|(target, (axis, left))| Some((target.as_str(), Axis::from_word(axis)?, *left)))
    }

    /// Keeps what is left of this axis; returns when it would survive a power cut.
    ///
    /// # Errors
    /// It cannot be written; the book stays as it was.
    pub fn store_leftover(&mut self, axis: Axis, left: Option<Left>) -> io::Result<()> {
        let mut content = self.content.clone();
        let axes = content.controls.entry(self.target.clone()).or_default();
        match left {
            Some(left) => drop(axes.insert(axis.as_word().to_owned(), left)),
            None => drop(axes.remove(axis.as_word())),
        }
        content.controls.retain(|_, axes| !axes.is_empty());
        if content == self.content {
            return Ok(());
        }
        replace_durably(&self.path, &serde_json::to_string(&content)?)?;
        self.content = content;
        Ok(())
    }
}

fn parse(text: &str) -> io::Result<JournalContent> {
    let of_one = |OneControl { target, axes }| JournalContent {
        controls: BTreeMap::from([(target, axes)]),
        ..JournalContent::default()
    };
    let parsed = serde_json::from_str::<JournalContent>(text);
    parsed.or_else(|error| serde_json::from_str(text).map(of_one).map_err(|_| error.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEFT: Left = Left { base_um: 40.0, written_um: 45.0, intended_um: Some(48.0) };

    #[test]
    fn what_is_left_in_another_control_stays_in_the_book() {
        let directory = tempfile::tempdir().expect("a directory");
        let mut book = OffsetJournal::open(directory.path(), "fanuc://a").expect("none yet");
        book.store_leftover(Axis::Z, Some(LEFT)).expect("written");
        let mut other = OffsetJournal::open(directory.path(), "fanuc://b").expect("readable");
        assert_eq!(other.find_leftover(Axis::Z), None);
        other.store_leftover(Axis::X, Some(LEFT)).expect("written");
        other.store_leftover(Axis::X, None).expect("written");
        let book = OffsetJournal::open(directory.path(), "fanuc://a").expect("readable");
        assert_eq!(book.list_leftovers().collect::<Vec<_>>(), [("fanuc://a", Axis::Z, LEFT)]);
    }

    #[test]
    fn the_first_form_is_read_and_half_a_file_is_put_aside() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join(FILE);
        let first = r#"{"schema":"offsets/1","target":"fanuc://a","axes":{"z":{"base_um":40.0,"written_um":45.0}}}"#;
        std::fs::write(&path, first).expect("written");
        let book = OffsetJournal::open(directory.path(), "fanuc://a").expect("readable");
        assert_eq!(book.find_leftover(Axis::Z), Some(Left { intended_um: None, ..LEFT }));
        std::fs::write(&path, &first[..30]).expect("written");
        assert!(OffsetJournal::open(directory.path(), "fanuc://a").is_err());
        let (book, aside) = OffsetJournal::begin_anew(directory.path(), "fanuc://a").expect("put aside");
        assert!(aside.is_file() && book.list_leftovers().next().is_none());
    }
}
