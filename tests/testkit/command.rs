//! The program as a user calls it.

use crate::process::program_path;
use std::path::Path;
use std::process::{Command, Output};

/// Runs the real binary in a directory and waits for its end.
pub fn gateway(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(program_path()).current_dir(directory).args(arguments).output().expect("the binary starts")
}
