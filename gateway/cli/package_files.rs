//! `cnc-gateway package-files DIR`: what a package holds beside the program and is made from the program itself.

use super::{CannotRun, CommandOutcome, CommandResult, command_line};
use clap::Args;
use clap_complete::{Shell, generate_to};
use std::fs;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct PackageFilesArguments {
    /// Directory to write into.
    directory: PathBuf,
}

/// Writes man pages into `man`, completions of shells into `completions`.
pub(super) fn run(arguments: &PackageFilesArguments) -> CommandResult {
    let (man, completions) = (arguments.directory.join("man"), arguments.directory.join("completions"));
    write_files(&man, &completions).map_err(|error| {
        CannotRun::new(format!("{}: {error}", arguments.directory.display()), "name a directory that can be written")
    })?;
    Ok(CommandOutcome::Fine)
}

fn write_files(man: &Path, completions: &Path) -> std::io::Result<()> {
    fs::create_dir_all(man)?;
    fs::create_dir_all(completions)?;
    let mut command = command_line();
    clap_mangen::generate_to(command.clone(), man)?;
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        generate_to(shell, &mut command, "cnc-gateway", completions)?;
    }
    Ok(())
}
