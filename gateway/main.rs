//! `cnc-gateway`: parses the arguments and calls one function.

use std::process::ExitCode;

fn main() -> ExitCode {
    gateway::cli::main()
}
