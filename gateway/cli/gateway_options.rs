//! Which gateway on this box a command is for, and how it answers. Shared by `arm`, `disarm`, `acknowledge` and `person`.

use super::installation::note_data_dir;
use super::{CannotRun, load_configuration};
use clap::Args;
use std::path::PathBuf;

/// Which gateway, and how the answer is printed.
#[derive(Debug, Args)]
pub(super) struct GatewayOptions {
    /// Configuration of the gateway, for its data directory.
    #[arg(long, value_name = "FILE", conflicts_with = "data_dir")]
    config: Option<PathBuf>,
    /// Data directory of the gateway.
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Print the answer as JSON.
    #[arg(long)]
    pub(super) json: bool,
}

impl GatewayOptions {
    /// The data directory that is meant: the one that is named, or that of a configuration, or that of the installed box.
    ///
    /// # Errors
    /// The configuration cannot be read.
    pub(super) fn data_dir(&self) -> Result<PathBuf, CannotRun> {
        if let Some(directory) = &self.data_dir {
            note_data_dir(directory);
            return Ok(directory.clone());
        }
        Ok(load_configuration(self.config.as_deref())?.gateway.data_dir)
    }
}
