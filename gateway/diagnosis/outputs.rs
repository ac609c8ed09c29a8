//! Where a diagnosis goes: words, JSON, a page, rows, the accepted model, the next experiment.

use super::context::DiagnosisContext;
use crate::report::{PageInput, page};
use recording::Recording;
use rules::physics::explain::Language;
use rules::twin::diagnosis::{Rows, Verdict};
use rules::twin::plan::plan_experiments;
use rules::twin::{Diagnosis, json_report, text_report, write_model};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What the user wants written. A path of `-` is standard output.
#[derive(Debug, Clone, Default)]
pub struct DiagnosisOutputs {
    /// The diagnosis as JSON.
    pub json: Option<PathBuf>,
    /// The report as one HTML page.
    pub html: Option<PathBuf>,
    /// Recorded and simulated output row by row, as CSV.
    pub rows: Option<PathBuf>,
    /// The model with what was missing; not written where the diagnosis cannot tell.
    pub accept: Option<PathBuf>,
    /// The next experiment as a plan.
    pub experiment: Option<PathBuf>,
    /// Language of the words.
    pub language: Language,
}

impl DiagnosisOutputs {
    /// Files that cannot be written, before any work is done.
    #[must_use]
    pub fn find_unwritable_files(&self) -> Vec<String> {
        let paths = [&self.json, &self.html, &self.rows, &self.accept, &self.experiment].into_iter().flatten();
        paths.filter(|path| !is_stdout(path)).filter_map(|path| trouble_of(path)).collect()
    }

    /// Writes everything.
    ///
    /// # Errors
    /// The file that cannot be written, and why.
    pub fn write(
        &self,
        diagnosis: &Diagnosis,
        recording: &Recording,
        context: &DiagnosisContext,
    ) -> Result<(), OutputError> {
        if let Some(path) = &self.json {
            write_output(path, &format!("{:#}\n", diagnosis_to_json(diagnosis, context)))?;
        } else {
            write_output(Path::new("-"), &describe_diagnosis(diagnosis, context, self.language))?;
        }
        if let Some(path) = &self.html {
            write_output(path, &page(&PageInput { diagnosis, recording, context, language: self.language }))?;
        }
        self.write_rows(&diagnosis.rows, diagnosis, recording)?;
        if let Some(path) = &self.experiment {
            match plan_experiments(diagnosis, recording) {
                Ok(plan) => write_output(path, &plan.to_csv(self.language))?,
                Err(reason) => eprintln!("note: {reason}"),
            }
        }
        match &self.accept {
            Some(_) if diagnosis.verdict == Verdict::CannotTell => {
                eprintln!("note: no model was written, because nothing could be told");
            }
            Some(path) => write_output(path, &write_model(&diagnosis.model))?,
            None => {}
        }
        Ok(())
    }
}

impl DiagnosisOutputs {
    /// Writes the rows of a diagnosis, where they are asked for: one line for each row of `recording`.
    ///
    /// # Errors
    /// The file that cannot be written, and why.
    pub fn write_rows(&self, rows: &Rows, diagnosis: &Diagnosis, recording: &Recording) -> Result<(), OutputError> {
        let Some(path) = &self.rows else { return Ok(()) };
        write_output(path, &format_rows(rows, &diagnosis.output, recording))
    }
}

/// The report in words, with what is doubtful before it.
fn describe_diagnosis(diagnosis: &Diagnosis, context: &DiagnosisContext, language: Language) -> String {
    context.to_words(language, &diagnosis.unit) + text_report::format_report(diagnosis, language).as_str()
}

/// The document (`diagnosis/1`), with the report in words in both languages.
#[must_use]
pub(super) fn diagnosis_to_json(diagnosis: &Diagnosis, context: &DiagnosisContext) -> serde_json::Value {
    let mut document = json_report::to_json(diagnosis);
    context.add_to(&mut document);
    document["words"] = serde_json::json!({
        "en": describe_diagnosis(diagnosis, context, Language::En),
        "zh": describe_diagnosis(diagnosis, context, Language::Zh),
    });
    document
}

/// The rows as the contract wants them: one line per row of the input, in input order.
fn format_rows(rows: &Rows, output: &str, recording: &Recording) -> String {
    let mut names = Vec::with_capacity(recording.count_rows());
    for run in recording.list_runs() {
        names.extend(std::iter::repeat_n(run.name, run.rows.len()));
    }
    let recorded: Vec<Option<f64>> = match recording.find_numbers(output) {
        Some(numbers) => numbers.iter().collect(),
        None => vec![None; recording.count_rows()],
    };
    json_report::format_rows_csv(&recording.time_s, &names, &recorded, rows)
}

fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

fn trouble_of(path: &Path) -> Option<String> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !parent.is_dir() {
        return Some(format!("{}: there is no directory {} to write into", path.display(), parent.display()));
    }
    path.is_dir().then(|| format!("{} is a directory; name a file to write", path.display()))
}

/// Why an output was not written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// Standard output does not take it.
    #[error("standard output: {0}")]
    Standard(std::io::Error),
    /// The file cannot be written.
    #[error("{}: {error}", path.display())]
    File {
        /// The file that was to be written.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
}

/// Writes a file as a whole or not at all, so that a reader never sees half of it.
///
/// # Errors
/// The path and what the system said.
pub fn write_output(path: &Path, text: &str) -> Result<(), OutputError> {
    if is_stdout(path) {
        let mut out = std::io::stdout().lock();
        let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        return written.map_err(OutputError::Standard);
    }
    let say = |error| OutputError::File { path: path.to_owned(), error };
    if path.exists() && !path.is_file() {
        // A pipe or a device is written into, never replaced.
        return std::fs::write(path, text).map_err(say);
    }
    gateway_base::files::replace_file(path, text).map_err(say)
}
