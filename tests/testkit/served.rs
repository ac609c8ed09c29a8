//! A served FANUC machine and a gateway that reads it: two real processes.

use crate::process::{Gateway, program, run, stderr, stdout, text};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A served machine; ends with the test.
pub struct Serving {
    /// `fanuc://HOST:PORT`.
    pub address: String,
    _process: Gateway,
}

impl Serving {
    /// `serve fanuc` on a free port, with further arguments.
    pub fn start(arguments: &[&str]) -> Self {
        let mut command = program();
        command.args(["serve", "fanuc", "--listen", "127.0.0.1:0"]).args(arguments);
        let mut process = Gateway::spawn(command);
        let line = process.wait_said("fanuc://");
        let address = line.split_whitespace().next().unwrap_or_default().to_owned();
        assert!(address.starts_with("fanuc://"), "{line}");
        Self { address, _process: process }
    }
}

/// A directory with this script and this configuration, whose page listens on a free port. Gives the configuration's path.
pub fn prepared(directory: &Path, script: &str, sections: &str) -> PathBuf {
    let scripts = directory.join("data/scripts");
    std::fs::create_dir_all(&scripts).expect("a directory");
    std::fs::write(scripts.join("own.rhai"), script).expect("a script");
    let config = directory.join("cnc-gateway.toml");
    let written = format!("[gateway]\ndata_dir = \"data\"\n{sections}[http]\nlisten = \"127.0.0.1:0\"\n");
    std::fs::write(&config, written).expect("a configuration");
    config
}

/// The gateway of this configuration, and `127.0.0.1:PORT` of its page.
pub fn started(config: &Path) -> (Gateway, String) {
    let mut command = program();
    command.args(["run", "--config", text(config), "--listen", "127.0.0.1:0"]);
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    (gateway, address)
}

/// A person arms the gate of this configuration.
pub fn armed(config: &Path) {
    let told = run(&["arm", "--for", "30m", "--by", "fitter", "--config", text(config)]);
    assert!(told.status.success(), "{}{}", stdout(&told), stderr(&told));
}

/// What a status tells of this channel.
pub fn channel(status: &Value, name: &str) -> Option<Value> {
    let row = status["channels"].as_array()?.iter().find(|row| row["name"] == name)?;
    Some(row["value"].clone())
}
