//! `check` of a text that is not saved: the command `check` itself, as a child process with limits. So the page and the command line cannot
//! find different things, and what the text names (recordings, models, scripts) is not read in the gateway.

use gateway_base::files::replace_durably;
use gateway_config::Problem;
use serde::Deserialize;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use thiserror::Error;

/// What `check --json` says, as far as it is needed here.
#[derive(Debug, Deserialize)]
struct CheckDocument {
    problems: Vec<Problem>,
}

/// Everything that is wrong with this text in the place of the file, and with what it names.
pub(super) fn check_text(path: &Path, text: &str) -> Vec<Problem> {
    let name = path.display().to_string();
    let failed = |what: String, next: &str| vec![Problem::in_file(name.clone(), what, next)];
    // Beside the file: paths in it are taken from there.
    let beside = path.with_extension(format!("check-{}.toml", std::process::id()));
    if let Err(error) = replace_durably(&beside, text) {
        return failed(
            format!("it cannot be checked: {}: {error}", beside.display()),
            "look at the permissions of its folder",
        );
    }
    let checked = run_check(&beside);
    let _already_gone = std::fs::remove_file(&beside);
    match checked {
        Ok(problems) => problems.into_iter().map(|problem| rename_file(problem, &beside, &name)).collect(),
        Err(what) => {
            failed(format!("checking it broke off: {what}"), "a recording or model that it names is too large")
        }
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
    let running = PathBuf::from("/proc/self/exe");
    let program = if running.exists() { Ok(running) } else { std::env::current_exe() };
    let output = Command::new(program?)
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
