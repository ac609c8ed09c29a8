//! What is kept of a diagnosis beside its row in the history: the report page in both languages, the model with what was missing,
//! the experiment it asks for as a plan and as steps. Files in a folder of the data directory, found by a key that follows from
//! the row, so that no second list can disagree with the history.

use super::beside::{BesideModel, compose_headline};
use super::context::DiagnosisContext;
use super::steps::{DiagnosisStep, group_steps};
use crate::report::{PageInput, page};
use gateway_base::files::compute_digest;
use gateway_base::files::{read_text, replace_file};
use gateway_history as history;
use recording::Recording;
use rules::physics::explain::Language;
use rules::twin::{self, diagnosis::Verdict, plan};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Diagnoses whose files are kept: half a megabyte each, and one in six hours at most without being asked for.
const KEPT_MAX: usize = 40;
/// The longest file that is read back.
const FILE_MAX: usize = 16 << 20;

/// Where the files are.
#[derive(Debug, Clone)]
pub struct DiagnosisStore {
    directory: PathBuf,
}

/// One file of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DiagnosisFile {
    /// The report as an HTML page in one language.
    Page(Language),
    /// The experiment it asks for, as a recording plan.
    Plan(Language),
    /// The model with what was missing.
    Model,
    /// The [`DiagnosisTexts`] as JSON.
    Words,
}

/// What the page of the box shows of a diagnosis that its JSON does not hold.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisTexts {
    /// The first sentence in Chinese; the English one stands in the row.
    pub summary_zh: String,
    /// The experiment it asks for.
    pub steps: Vec<DiagnosisStep>,
    /// How long the experiment takes, minutes.
    pub minutes: Option<f64>,
    /// The diagnosis beside the watch, by kind of work.
    #[serde(default)]
    pub beside: Vec<BesideModel>,
    /// Names, statements and experiments of the effects in it, by kind.
    #[serde(default)]
    pub effects: BTreeMap<String, EffectTexts>,
}

/// What the catalogue says of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectTexts {
    /// The name of the effect in the catalogue.
    pub name: DiagnosisStep,
    /// What the effect does, one sentence of the catalogue.
    pub statement: DiagnosisStep,
    /// What tells it apart.
    pub experiment: DiagnosisStep,
}

impl EffectTexts {
    fn from_kind(kind: &str) -> Option<Self> {
        let doc = rules::physics::find_effect(kind)?.doc();
        let both = |en: &str, zh: &str| DiagnosisStep { en: en.to_owned(), zh: zh.to_owned() };
        Some(Self {
            name: both(doc.en.name, doc.zh.name),
            statement: both(doc.en.statement, doc.zh.statement),
            experiment: both(doc.en.experiment, doc.zh.experiment),
        })
    }
}

/// Texts of every effect that a diagnosis names.
fn effect_texts(found: &twin::Diagnosis) -> BTreeMap<String, EffectTexts> {
    let missing = found.missing.iter().map(|missing| &missing.effect);
    let others = found.alternatives.iter().flat_map(|other| [&other.effect, &other.instead_of]);
    let next = found.next_experiment.iter().map(|next| &next.effect);
    missing.chain(others).chain(next).filter_map(|kind| Some((kind.clone(), EffectTexts::from_kind(kind)?))).collect()
}

/// The key of a row: the end of its stretch and what was found.
#[must_use]
pub fn diagnosis_key(row: &history::Diagnosis) -> String {
    format!("{}-{:016x}", row.to_ns.div_euclid(1_000_000), compute_digest(row.json.as_bytes()))
}

/// Has it the form of a key? Anything else must not become part of a path.
#[must_use]
pub fn is_key(text: &str) -> bool {
    let digits =
        |part: &str, all: fn(&u8) -> bool| !part.is_empty() && part.len() <= 20 && part.as_bytes().iter().all(all);
    text.split_once('-').is_some_and(|(at, of)| digits(at, u8::is_ascii_digit) && digits(of, u8::is_ascii_hexdigit))
}

impl DiagnosisStore {
    /// Below this data directory.
    #[must_use]
    pub fn from_data_dir(data_dir: &Path) -> Self {
        Self { directory: data_dir.join("diagnoses") }
    }

    /// Keeps diagnoses directly in this folder.
    #[must_use]
    pub fn from_directory(directory: PathBuf) -> Self {
        Self { directory }
    }

    /// Where the files of every diagnosis lie side by side.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The path of a file.
    #[must_use]
    pub fn file_path(&self, key: &str, part: DiagnosisFile) -> PathBuf {
        let word = |language| if language == Language::Zh { "zh" } else { "en" };
        let end = match part {
            DiagnosisFile::Page(language) => format!("{}.html", word(language)),
            DiagnosisFile::Plan(language) => format!("{}.csv", word(language)),
            DiagnosisFile::Model => "toml".to_owned(),
            DiagnosisFile::Words => "json".to_owned(),
        };
        self.directory.join(format!("{key}.{end}"))
    }

    /// The text of a file; `None` where nothing was kept, or no longer.
    #[must_use]
    pub fn read_file(&self, key: &str, part: DiagnosisFile) -> Option<String> {
        is_key(key).then(|| read_text(&self.file_path(key, part), FILE_MAX).ok()).flatten()
    }

    /// What is shown of it besides its JSON.
    #[must_use]
    pub fn read_texts(&self, key: &str) -> Option<DiagnosisTexts> {
        serde_json::from_str(&self.read_file(key, DiagnosisFile::Words)?).ok()
    }

    /// Keeps everything of a diagnosis; older ones beyond the limit go.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write_diagnosis(
        &self,
        row: &history::Diagnosis,
        found: &twin::Diagnosis,
        recording: &Recording,
        (context, beside): (&DiagnosisContext, Vec<BesideModel>),
    ) -> std::io::Result<()> {
        let key = diagnosis_key(row);
        let put = |part, text: &str| replace_file(&self.file_path(&key, part), text);
        for language in [Language::En, Language::Zh] {
            put(DiagnosisFile::Page(language), &page(&PageInput { diagnosis: found, recording, context, language }))?;
        }
        let summary_zh = summary_zh(found, &beside);
        let mut words =
            DiagnosisTexts { summary_zh, beside, effects: effect_texts(found), ..DiagnosisTexts::default() };
        if let Ok(plan) = plan::plan_experiments(found, recording) {
            (words.steps, words.minutes) = (group_steps(&plan), Some(plan.duration_min()));
            for language in [Language::En, Language::Zh] {
                put(DiagnosisFile::Plan(language), &plan.to_csv(language))?;
            }
        }
        if found.verdict != Verdict::CannotTell && !found.missing.is_empty() {
            put(DiagnosisFile::Model, &twin::write_model(&found.model))?;
        }
        put(DiagnosisFile::Words, &serde_json::to_string(&words)?)?;
        self.forget_the_oldest()
    }

    fn forget_the_oldest(&self) -> std::io::Result<()> {
        let names = std::fs::read_dir(&self.directory)?.flatten();
        let names = names.filter_map(|entry| entry.file_name().into_string().ok());
        let key = |name: &str| name.split_once('.').map(|(key, _)| key.to_owned()).filter(|key| is_key(key));
        let mut files: Vec<(u64, String, String)> = names
            .filter_map(|name| {
                let key = key(&name)?;
                Some((key.split_once('-')?.0.parse().ok()?, key, name))
            })
            .collect();
        files.sort_unstable_by(|a, b| b.cmp(a));
        let mut keys: Vec<&str> = files.iter().map(|(_, key, _)| key.as_str()).collect();
        keys.dedup();
        let Some(first_gone) = keys.get(KEPT_MAX).map(|key| (*key).to_owned()) else { return Ok(()) };
        let at = files.iter().position(|(_, key, _)| *key == first_gone).unwrap_or(files.len());
        files[at..].iter().try_for_each(|(.., name)| std::fs::remove_file(self.directory.join(name)))
    }
}

/// The headline of the report in Chinese, without the word of the verdict before it.
fn summary_zh(found: &twin::Diagnosis, beside: &[BesideModel]) -> String {
    let moved: Vec<&str> = beside.iter().filter(|one| one.is_of_parameters()).map(|one| one.zh.as_str()).collect();
    if found.verdict == Verdict::NoMismatch && !moved.is_empty() {
        return format!("模型参数已改变：{}。", moved.join("；"));
    }
    compose_headline(beside, &found.unit, ("", &found.summary.zh)).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_never_a_way_out_of_the_folder() {
        let row = history::Diagnosis { to_ns: 1_700_000_000_123_000_000, json: "{}".to_owned(), ..Default::default() };
        assert!(is_key(&diagnosis_key(&row)) && diagnosis_key(&row).starts_with("1700000000123-"));
        for wrong in ["", "-", "1-", "../1-a", "1-a/b", "1-g", "a-1", "1-a.html", "123456789012345678901-a"] {
            assert!(!is_key(wrong), "{wrong}");
            assert_eq!(DiagnosisStore::from_directory(PathBuf::from("/")).read_file(wrong, DiagnosisFile::Words), None);
        }
    }

    #[test]
    fn the_oldest_go_with_all_their_files() {
        let directory = tempfile::tempdir().expect("a directory");
        let kept = DiagnosisStore::from_directory(directory.path().to_owned());
        for at in 0..KEPT_MAX + 3 {
            for part in [DiagnosisFile::Words, DiagnosisFile::Model] {
                replace_file(&kept.file_path(&format!("{}-00ff", 900 + at), part), "{}").expect("written");
            }
        }
        std::fs::write(directory.path().join("of a person.txt"), "stays").expect("written");
        kept.forget_the_oldest().expect("swept");
        let left = std::fs::read_dir(directory.path()).expect("there").count();
        assert_eq!(left, 2 * KEPT_MAX + 1);
        assert!(
            kept.read_file("902-00ff", DiagnosisFile::Model).is_none()
                && kept.read_file("903-00ff", DiagnosisFile::Model).is_some()
        );
    }
}
