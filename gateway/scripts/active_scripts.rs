//! The scripts that were last active, kept beside everything else that the box writes: what a backtest compares with, and
//! what comes into charge again after a start at which the directory holds something broken.

use crate::reload::prepare_with_settings;
use crate::settings;
use adapter_core::clock::TimeNs;
use gateway_history::Event;
use rules::script::{Host, ScriptFile, ScriptProblem, ScriptSet, prepare_scripts};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file in the data directory.
const FILE: &str = "scripts_in_charge.json";
/// Kind of the events that tell which versions came into charge.
pub const KIND: &str = "scripts_in_charge";

/// Scripts by file name, each with its version.
pub type Versions = BTreeMap<String, u64>;

/// Where they are kept.
#[must_use]
pub fn file_path(data_dir: &Path) -> PathBuf {
    data_dir.join(FILE)
}

/// Keeps the texts of this set, in one step.
///
/// # Errors
/// The file cannot be written.
pub fn save_texts(data_dir: &Path, files: &[ScriptFile]) -> std::io::Result<()> {
    gateway_base::files::replace_file(&file_path(data_dir), &format_texts(files))
}

/// What the file says of this set.
#[must_use]
pub fn format_texts(files: &[ScriptFile]) -> String {
    let scripts: Map<String, Value> = files.iter().map(|file| (file.name.clone(), json!(file.text))).collect();
    json!({ "schema": "scripts_in_charge/1", "scripts": scripts }).to_string()
}

/// The texts that were kept; `None` where there are none.
#[must_use]
pub fn read_texts(data_dir: &Path) -> Option<Vec<ScriptFile>> {
    let text = std::fs::read_to_string(file_path(data_dir)).ok()?;
    let document: Value = serde_json::from_str(&text).ok()?;
    let file =
        |(name, text): (&String, &Value)| Some(ScriptFile { name: name.clone(), text: text.as_str()?.to_owned() });
    document["scripts"].as_object()?.iter().map(file).collect()
}

/// The set that was kept, compiled and tried with the settings of this machine, or with the defaults where those cannot be used;
/// `None` where there is none.
///
/// # Errors
/// A newer program may find something wrong with it.
pub fn prepare_last_set(data_dir: &Path) -> Option<Result<ScriptSet, Vec<ScriptProblem>>> {
    read_texts(data_dir).map(|files| {
        prepare_with_settings(&files, Some(&settings::values_path(data_dir))).or_else(|_| prepare_scripts(&files))
    })
}

/// From `at_ns` on these scripts decide: what tells a backtest whose alarms the history holds.
#[must_use]
pub fn build_event(host: &Host, at_ns: TimeNs) -> Event {
    let words = |(file, version): (&str, u64)| (file.to_owned(), json!(format!("{version:016x}")));
    let scripts: Map<String, Value> = host.versions().map(words).collect();
    Event {
        at_ns,
        kind: KIND.to_owned(),
        source: "scripts".to_owned(),
        text: format!("{} scripts are in charge", scripts.len()),
        detail: json!({ "scripts": scripts }).to_string(),
    }
}

/// What such an event says; `None` when it cannot be read.
#[must_use]
pub fn parse_versions(event: &Event) -> Option<Versions> {
    let document: Value = serde_json::from_str(&event.detail).ok()?;
    let version =
        |(file, version): (&String, &Value)| Some((file.clone(), u64::from_str_radix(version.as_str()?, 16).ok()?));
    document["scripts"].as_object()?.iter().map(version).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_history_is_told_the_versions() {
        let mut host = Host::new();
        assert_eq!(parse_versions(&build_event(&host, 7)), Some(Versions::new()));
        host.load_scripts(&[ScriptFile { name: "a.rhai".to_owned(), text: "note(\"a\");\n".to_owned() }])
            .expect("compiles");
        let told = parse_versions(&build_event(&host, 7)).expect("readable");
        assert_eq!(
            told.into_iter().collect::<Vec<_>>(),
            [("a.rhai".to_owned(), host.versions().next().expect("one").1)]
        );
        assert_eq!(
            parse_versions(&Event { detail: "{".to_owned(), ..build_event(&host, 7) }),
            None,
            "half an event says nothing"
        );
    }

    #[test]
    fn what_was_kept_comes_back() {
        let directory = tempfile::tempdir().expect("a directory");
        assert_eq!(read_texts(directory.path()), None);
        let files = vec![ScriptFile { name: "a.rhai".to_owned(), text: "note(\"报警\");\n".to_owned() }];
        save_texts(directory.path(), &files).expect("written");
        assert_eq!(read_texts(directory.path()), Some(files));
        std::fs::write(file_path(directory.path()), "{").expect("written");
        assert!(prepare_last_set(directory.path()).is_none(), "half a file is none");
    }
}
