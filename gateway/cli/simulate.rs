//! `cnc-gateway simulate`: a model over a recording's inputs, or the simulated machine over a plan.

use super::diagnose::cannot_use;
use super::{CannotRun, CommandOutcome, CommandResult};
use crate::diagnosis::{Copies, execute, read_model, read_recordings, simulation, write_output};
use adapters::address::{Address, Target};
use adapters::simulated::SimulatedSettings;
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct SimulateArguments {
    /// What the simulation believes (model/1).
    #[arg(long, value_name = "M.toml", required_unless_present = "machine")]
    model: Option<PathBuf>,
    /// Recordings whose inputs are taken, as for diagnose.
    #[arg(long, value_name = "R.csv", num_args = 1.., required_unless_present = "machine")]
    recording: Vec<String>,
    /// Write the simulated output and each part's contribution, row by row.
    #[arg(long, value_name = "OUT.csv")]
    rows: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Let the simulated machine carry out a plan in place of a model: lathe, mill, or lathe?wear_mm=0.2&seed=3.
    #[arg(long, value_name = "MACHINE", requires_all = ["plan", "out"], conflicts_with_all = ["model", "recording", "rows"])]
    machine: Option<String>,
    /// The plan: a recording of commanded inputs, as diagnose --experiment writes it.
    #[arg(long, value_name = "PLAN.csv")]
    plan: Option<String>,
    /// Where the simulated machine's recording goes.
    #[arg(long, value_name = "REC.csv")]
    out: Option<PathBuf>,
    /// Write what a torque sensor at the spindle of the simulated machine shows, on a clock of its own.
    #[arg(long, value_name = "SENSOR.csv", requires = "machine")]
    torque: Option<PathBuf>,
    /// Rows per second of the simulated machine's recording.
    #[arg(long, value_name = "HZ", default_value_t = 2.0, value_parser = parse_rate)]
    rate: f64,
}

fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().ok().filter(|rate| (0.01..=100.0).contains(rate));
    rate.ok_or_else(|| "give a rate from 0.01 to 100 rows per second".to_owned())
}

pub(super) fn run_simulation(arguments: SimulateArguments) -> CommandResult {
    match (&arguments.machine, &arguments.model) {
        (Some(machine), _) => simulate_experiment(machine, &arguments),
        (None, Some(path)) => simulate_model(path, &arguments),
        (None, None) => {
            Err(CannotRun::new("nothing to simulate", "give --model and --recording, or --machine and --plan"))
        }
    }
}

fn simulate_model(path: &Path, arguments: &SimulateArguments) -> CommandResult {
    let mut problems = Vec::new();
    let model = read_model(path).map_err(|wrong| problems.extend(wrong));
    let given = read_recordings(&arguments.recording, Copies::Keep).map_err(|wrong| problems.extend(wrong));
    let (Ok(model), Ok(given)) = (model, given) else { return Err(cannot_use(&problems)) };
    given.warnings.iter().for_each(|warning| eprintln!("{warning}"));
    let simulation = simulation::run(&given.recording, &model).map_err(|all| cannot_use(&all))?;
    if let Some(path) = &arguments.rows {
        write_output(path, &simulation.rows_csv(&given.recording)).map_err(CannotRun::from_error)?;
    }
    let text = if arguments.json { format!("{:#}\n", simulation.to_json()) } else { simulation.format_text() };
    write_output(Path::new("-"), &text).map_err(CannotRun::from_error)?;
    Ok(CommandOutcome::Fine)
}

fn simulate_experiment(machine: &str, arguments: &SimulateArguments) -> CommandResult {
    let mut problems = Vec::new();
    let settings = parse_machine(machine).map_err(|wrong| problems.push(wrong));
    let plan: Vec<String> = arguments.plan.iter().cloned().collect();
    let given = read_recordings(&plan, Copies::Keep).map_err(|wrong| problems.extend(wrong));
    let (Ok(settings), Ok(given)) = (settings, given) else { return Err(cannot_use(&problems)) };
    let (recording, instruments) = execute::execute_plan(settings, &given.recording, arguments.rate)
        .map_err(|wrong| cannot_use(&[wrong.to_string()]))?;
    let out = arguments.out.as_deref().unwrap_or(Path::new("-"));
    write_output(out, &execute::format_csv(&recording)).map_err(CannotRun::from_error)?;
    if let Some(path) = &arguments.torque {
        write_output(path, &instruments.torque_csv()).map_err(CannotRun::from_error)?;
    }
    eprintln!("{} rows of {machine} in {}", recording.count_rows(), out.display());
    if let Some((before_mm, after_mm)) = instruments.flank_wear_mm {
        eprintln!("a microscope shows a flank wear of {before_mm:.4} mm before and {after_mm:.4} mm after");
    }
    Ok(CommandOutcome::Fine)
}

fn parse_machine(machine: &str) -> Result<SimulatedSettings, String> {
    let text = if machine.starts_with("simulated:") { machine.to_owned() } else { format!("simulated://{machine}") };
    let address: Address = text.parse().map_err(|error| format!("--machine {machine}: {error}"))?;
    match address.target() {
        Target::Simulated(target) => Ok(SimulatedSettings::from_target(target)),
        _ => Err(format!("--machine {machine}: give lathe or mill")),
    }
}
