//! The box that a package has installed: where its configuration and its data are, and that what root writes there stays the service's.

use super::CannotRun;
use crate::config::{self, Config};
use gateway_base::owner;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The configuration that the service of the package runs with.
const CONFIGURATION: &str = "/etc/cnc-gateway/cnc-gateway.toml";
/// The data directory that it runs with, whatever the configuration says.
const DATA_DIR: &str = "/var/lib/cnc-gateway";

/// Data directories that this command works on.
static DIRECTORIES: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Says that this command works on a data directory.
pub(super) fn note_data_dir(directory: &Path) {
    DIRECTORIES.lock().unwrap_or_else(PoisonError::into_inner).push(directory.to_owned());
}

/// At the end of a command: what it wrote as root into a data directory of another user belongs to that user.
pub(super) fn hand_over_data() {
    for directory in DIRECTORIES.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
        match owner::hand_over(&directory) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => eprintln!(
                "cnc-gateway: {}: files of root may be left in it, which the service cannot read: {error}",
                directory.display()
            ),
            _ => {}
        }
    }
}

/// The configuration in a file; without one that of the installed box, and where none is installed the built-in one.
///
/// # Errors
/// It cannot be read, or is refused.
pub(super) fn load_configuration(file: Option<&Path>) -> Result<Config, CannotRun> {
    let installed = Path::new(CONFIGURATION);
    let file = match file {
        None if is_installed(installed)? => Some(installed),
        given => given,
    };
    let mut environment: Vec<(String, String)> = std::env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
        .collect();
    let key = format!("{}GATEWAY__DATA_DIR", config::ENVIRONMENT_PREFIX);
    if file == Some(installed) && !environment.iter().any(|(name, _)| *name == key) {
        environment.push((key, DATA_DIR.to_owned()));
    }
    let config = config::load(file, environment).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        CannotRun::new(lines.join("\n"), "")
    })?;
    note_data_dir(&config.gateway.data_dir);
    Ok(config)
}

/// Is there an installed box? That this user may not look is no reason to take another one.
fn is_installed(configuration: &Path) -> Result<bool, CannotRun> {
    configuration.try_exists().map_err(|error| {
        let next = "run it with sudo, or name the box with --config or --data-dir";
        CannotRun::new(format!("{}: {error}", configuration.display()), next)
    })
}
