//! `cnc-gateway backup` and `cnc-gateway restore`: what makes a box this box, as an archive, and its way back. At the box itself,
//! whether the gateway runs or not.

use super::{CannotRun, CommandOutcome, CommandResult, load_configuration, print_text};
use crate::archive::{pack, unpack};
use crate::backup::{BackupPaths, RestoreRequest, archive_name, collect_files, copy_history};
use crate::clock;
use adapters::clock::SECOND_NS;
use clap::Args;
use gateway_base::files::replace_durably;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct BackupArguments {
    /// Configuration of the box; without it that of the installed box, or the built-in one.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Archive to write; without it a name with the time, in this directory.
    #[arg(long, value_name = "FILE.tar.gz")]
    out: Option<PathBuf>,
    /// Copy the history too, to this file, which must not be there yet. A gateway may be writing it meanwhile.
    #[arg(long, value_name = "COPY.db")]
    history: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct RestoreArguments {
    /// Archive that `backup` or the page has made.
    archive: PathBuf,
    /// Configuration of the box; without it that of the installed box, or the built-in one.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// The archive may be of another box: its scripts, settings and what was learned there come into force here.
    #[arg(long)]
    from_another_box: bool,
    /// Who restores; stands in the settings and their history.
    #[arg(long, value_name = "NAME", default_value = "at the box")]
    by: String,
}

fn read_clock() -> (i64, u64) {
    let now_ns = clock::now_ns();
    (now_ns, now_ns.div_euclid(SECOND_NS).unsigned_abs())
}

pub(super) fn run_backup(arguments: &BackupArguments) -> CommandResult {
    let config = load_configuration(arguments.config.as_deref())?;
    let (_, at_s) = read_clock();
    let files = collect_files(&BackupPaths::from_config(&config, arguments.config.as_deref()))
        .map_err(CannotRun::from_error)?;
    let archive = pack(&files, at_s).map_err(CannotRun::from_error)?;
    let out = arguments.out.clone().unwrap_or_else(|| PathBuf::from(archive_name("backup", at_s)));
    replace_durably(&out, &archive).map_err(|error| CannotRun::from_error(format!("{}: {error}", out.display())))?;
    print_text(&format!("{}: {} files, {} bytes\n", out.display(), files.len(), archive.len()));
    match &arguments.history {
        Some(copy) => {
            let bytes = copy_history(&config.history.path, copy).map_err(CannotRun::from_error)?;
            print_text(&format!("{}: the history, {bytes} bytes\n", copy.display()));
        }
        None => print_text("the history is not in it; --history COPY.db copies it beside\n"),
    }
    Ok(CommandOutcome::Fine)
}

pub(super) fn run_restore(arguments: &RestoreArguments) -> CommandResult {
    let config = load_configuration(arguments.config.as_deref())?;
    let places = BackupPaths::from_config(&config, arguments.config.as_deref());
    let shown = arguments.archive.display();
    let bytes =
        std::fs::read(&arguments.archive).map_err(|error| CannotRun::from_error(format!("{shown}: {error}")))?;
    let files = unpack(&bytes).map_err(|error| CannotRun::from_error(format!("{shown} is no backup: {error}")))?;
    let (at_ns, at_s) = read_clock();
    let before = collect_files(&places).map_err(CannotRun::from_error)?;
    let before = pack(&before, at_s).map_err(CannotRun::from_error)?;
    let ask = RestoreRequest {
        by: &arguments.by,
        at_ns,
        before: (&before, &archive_name("before-restore", at_s)),
        from_another_box: arguments.from_another_box,
    };
    let done = crate::backup::restore_backup(&places, &files, ask)
        .map_err(|error| CannotRun::new(error.to_string(), error.describe_state()))?;
    print_text(&format!("{done}\n"));
    Ok(CommandOutcome::Fine)
}
