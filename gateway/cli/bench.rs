//! `cnc-gateway bench`: ticks per second on this computer.

use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::bench::{self, TICKS_MIN};
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct BenchArguments {
    /// Ticks per run; there is one run per stage.
    #[arg(long, default_value_t = 100_000, value_parser = clap::value_parser!(u64).range(TICKS_MIN..))]
    ticks: u64,
    /// Directory for the history that is written meanwhile; it is removed at the end.
    #[arg(long, value_name = "DIR")]
    directory: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Measures and prints. Allocations are counted by `cargo bench`.
pub(super) fn run(arguments: &BenchArguments) -> CommandResult {
    let parent = arguments.directory.clone().unwrap_or_else(std::env::temp_dir);
    let directory = parent.join(format!("cnc-gateway-bench-{}", std::process::id()));
    let cannot = |error: &dyn std::fmt::Display| CannotRun::new(error.to_string(), "name another --directory");
    std::fs::create_dir_all(&directory).map_err(|error| cannot(&error))?;
    let figures = bench::measure_ticks(arguments.ticks, &directory, None);
    let _left_behind = std::fs::remove_dir_all(&directory);
    let figures = figures.map_err(|error| cannot(&error))?;
    if arguments.json {
        print_json(&figures.to_json());
    } else {
        print_text(&figures.to_string());
    }
    Ok(CommandOutcome::Fine)
}
