//! `check` of a text that is not saved: the command `check` itself, as a child process with limits. So the page and the command line cannot
//! find different things, and what the text names (recordings, models, scripts) is not read in the gateway.

use gateway_base::files::replace_privately;
use gateway_base::limits::{MEMORY_TOLD_MB, TimeLimits};
use gateway_config::Problem;
use gateway_diagnosis::child_process::find_own_program;
use serde::Deserialize;
use std::io;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use thiserror::Error;

/// What `check --json` says, as far as it is needed here.
#[derive(Debug, Deserialize)]
struct CheckDocument {
    problems: Vec<Problem>,
}

/// One check at a time, whoever asks: so much memory and one file beside the configuration, not more.
static ALONE: Mutex<()> = Mutex::new(());

/// Everything that is wrong with this text in the place of the file, and with what it names.
pub(super) fn check_text(path: &Path, text: &str) -> Vec<Problem> {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let name = path.display().to_string();
    // Beside the file: paths in it are taken from there. The text may hold passwords.
    let beside = path.with_extension(format!("check-{}.toml", std::process::id()));
    if let Err(error) = replace_privately(&beside, text) {
        let what = format!("it cannot be checked: {}: {error}", beside.display());
        return vec![Problem::in_file(name, what, "look at the permissions of its folder")];
    }
    let problems = check_file(&beside, &name);
    let _already_gone = std::fs::remove_file(&beside);
    problems
}

/// Everything that is wrong with the saved file, and with what it names.
pub(super) fn check_saved_file(path: &Path) -> Vec<Problem> {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    check_file(path, &path.display().to_string())
}

/// What the child says of a file, under the name that a person knows.
fn check_file(file: &Path, name: &str) -> Vec<Problem> {
    let failed = |what: String, next: &str| vec![Problem::in_file(name.to_owned(), what, next)];
    match run_check(file) {
        Ok(problems) => problems.into_iter().map(|problem| rename_file(problem, file, name)).collect(),
        Err(CheckBreak::Start(error)) => {
            failed(format!("no process to check it with: {error}"), "try again; if it stays, start the gateway again")
        }
        Err(what) => failed(
            format!(
                "checking it took more than {MEMORY_TOLD_MB} MB or {} s, or broke off: {what}",
                TimeLimits::from_bytes(0).processor_s
            ),
            "make the recordings and models that it names smaller, or run `cnc-gateway check` at the box",
        ),
    }
}

/// Why the child gave no answer.
#[derive(Debug, Error)]
enum CheckBreak {
    /// It could not be started, or not be waited for.
    #[error(transparent)]
    Start(#[from] io::Error),
    /// It ended without an answer: its status, and the last line of its complaint.
    #[error("{status} {complaint}")]
    NoAnswer { status: ExitStatus, complaint: String },
}

fn run_check(beside: &Path) -> Result<Vec<Problem>, CheckBreak> {
    let output = Command::new(find_own_program()?)
        .args(["check", "--json", "--limited", "--config"])
        .arg(beside)
        .stdin(Stdio::null())
        .output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice::<CheckDocument>(&output.stdout).map(|document| document.problems).map_err(|_| {
        CheckBreak::NoAnswer { status: output.status, complaint: said.lines().last().unwrap_or_default().to_owned() }
    })
}

fn rename_file(mut problem: Problem, beside: &Path, name: &str) -> Problem {
    let written = beside.display().to_string();
    problem.file = problem.file.replace(&written, name);
    problem.what = problem.what.replace(&written, name);
    problem
}
