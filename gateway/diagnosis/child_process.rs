//! A process of this program that works on one job: started with the job on its standard input, whoever asks for it.

use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// The word of the command line.
const COMMAND: &str = "diagnosis-child";

/// The program that runs now, also where its file has been replaced meanwhile.
///
/// # Errors
/// The system does not say where it lies.
pub fn find_own_program() -> std::io::Result<PathBuf> {
    if cfg!(target_os = "linux") { Ok(PathBuf::from("/proc/self/exe")) } else { std::env::current_exe() }
}

/// Starts a child on a job.
///
/// # Errors
/// No process could be started.
pub fn start_child(job: &impl Serialize) -> std::io::Result<Child> {
    let mut child = Command::new(find_own_program()?)
        .arg(COMMAND)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()?;
    let line = serde_json::to_string(job)? + "\n";
    let told = child.stdin.as_mut().map_or(Ok(()), |pipe| pipe.write_all(line.as_bytes()));
    if let Err(error) = told {
        let _already_gone = child.kill();
        let _reaped = child.wait();
        return Err(error);
    }
    Ok(child)
}
