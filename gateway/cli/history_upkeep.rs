//! `cnc-gateway history repair` and `set-apart`: when a disk or a clock was wrong.

use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::history::{Repaired, repair_history as save, set_apart as move_apart};
use crate::{clock, moment};
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `history repair`.
#[derive(Debug, Args)]
pub(super) struct RepairArguments {
    /// The new file; --history names the damaged one.
    new: PathBuf,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Arguments of `history set-apart`.
#[derive(Debug, Args)]
pub(super) struct SetApartArguments {
    /// The new file; --history names the one that holds rows from the future, which no gateway may be writing.
    new: PathBuf,
    /// Rows after this time: 2026-01-31T08:15:00Z, 2026-01-31; now when left out.
    #[arg(long, value_name = "TIME")]
    after: Option<String>,
}

/// Saves what is whole; exit code 1 when something is lost.
pub(super) fn repair_history(arguments: &RepairArguments, path: &Path) -> CommandResult {
    let repaired = save(path, &arguments.new).map_err(CannotRun::from_error)?;
    if arguments.json {
        print_json(&json!({ "schema": "history-repair/1", "whole": repaired.is_whole(), "tables": repaired.tables,
            "damaged": repaired.damaged }));
    } else {
        print_repaired(&repaired, &arguments.new);
    }
    Ok(if repaired.is_whole() { CommandOutcome::Fine } else { CommandOutcome::No })
}

fn print_repaired(repaired: &Repaired, new: &Path) {
    for table in repaired.tables.iter().filter(|table| table.saved > 0 || !table.lost.is_empty()) {
        print_text(&format!("{}: {} rows saved\n", table.table, table.saved));
        for (after, before) in &table.lost {
            print_text(&format!("  LOST: rows with numbers above {after} and below {before}\n"));
        }
    }
    for rows in &repaired.damaged {
        print_text(&format!("LOST: {rows}\n"));
    }
    let whole = if repaired.is_whole() { "everything" } else { "everything that is whole" };
    print_text(&format!(
        "{whole} is in {}. To go on with it, stop the gateway and put it in the place of its history.\n",
        new.display()
    ));
}

/// Moves rows from the future.
pub(super) fn set_apart(arguments: &SetApartArguments, path: &Path) -> CommandResult {
    let now_ns = clock::now_ns();
    let after = arguments.after.as_deref().map(|text| moment::parse(text, now_ns)).transpose();
    let after_ns = after.map_err(CannotRun::from_error)?.unwrap_or(now_ns);
    let apart = move_apart(path, &arguments.new, after_ns).map_err(CannotRun::from_error)?;
    print_text(&format!(
        "{} samples and {} records that are dated after {} are in {} now\n",
        apart.samples,
        apart.records,
        moment::format_utc(after_ns),
        arguments.new.display()
    ));
    Ok(CommandOutcome::Fine)
}
