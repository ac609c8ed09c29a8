//! `cnc-gateway simulate`: a model over a recording's inputs, with each part's contribution.

use super::diagnose::cannot_use;
use super::{CannotRun, CommandResult, Outcome};
use crate::twin::{put, read_model, read_recordings, simulation};
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub(super) struct SimulateArguments {
    /// What the simulation believes (model/1).
    #[arg(long, value_name = "M.toml")]
    model: PathBuf,
    /// Recordings whose inputs are taken, as for diagnose.
    #[arg(long, value_name = "R.csv", num_args = 1.., required = true)]
    recording: Vec<String>,
    /// Write the simulated output and each part's contribution, row by row.
    #[arg(long, value_name = "OUT.csv")]
    rows: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Simulates and prints.
pub(super) fn simulate(arguments: SimulateArguments) -> CommandResult {
    let mut problems = Vec::new();
    let model = read_model(&arguments.model).map_err(|wrong| problems.extend(wrong));
    let given = read_recordings(&arguments.recording).map_err(|wrong| problems.extend(wrong));
    let (Ok(model), Ok(given)) = (model, given) else { return Err(cannot_use(&problems)) };
    given.warnings.iter().for_each(|warning| eprintln!("{warning}"));
    let simulation = simulation::run(&given.recording, &model).map_err(|all| cannot_use(&all))?;
    let say = |problem| CannotRun::new(problem, "");
    if let Some(path) = &arguments.rows {
        put(path, &simulation.rows_csv(&given.recording)).map_err(say)?;
    }
    let text = if arguments.json { format!("{:#}\n", simulation.json()) } else { simulation.text() };
    put(Path::new("-"), &text).map_err(say)?;
    Ok(Outcome::Fine)
}
