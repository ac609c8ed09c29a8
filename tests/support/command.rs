//! The program as a user calls it.

use std::path::Path;
use std::process::{Command, Output};

/// Runs the real binary in a directory and waits for its end.
pub(crate) fn gateway(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cnc-gateway"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .expect("the binary starts")
}
