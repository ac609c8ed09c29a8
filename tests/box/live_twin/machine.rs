//! A simulated machine that has worked for some hours, and the page beside it.

use crate::access::client::Client;
use serde_json::Value;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;
use testkit::process::{Gateway, get, program, run, stderr, stdout, text, wait_for};

/// The model of the demonstration.
const MODEL: &str = include_str!("../../../gateway/demo/lathe.toml");

/// A machine whose hours are over; its box runs on beside the page.
pub(crate) struct Worked {
    pub(crate) address: String,
    _gateway: Gateway,
    directory: TempDir,
}

impl Worked {
    /// `hours` of the machine with these settings as fast as possible; then the page.
    pub(crate) fn of(machine: &str, hours: u32) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let place = directory.path();
        std::fs::write(place.join("model.toml"), MODEL).expect("writable");
        let text = format!(
            "[gateway]\ndata_dir = \"data\"\n[twin]\nmodel = \"model.toml\"\n[[source]]\naddress = \"simulated://{machine}\"\n"
        );
        std::fs::write(place.join("box.toml"), text).expect("writable");
        let mut worked = start(place, &["--speed", "max", "--for", &(hours * 3600).to_string()]);
        wait_for("the end of the hours", Duration::from_secs(900), || worked.has_ended().then_some(()));
        assert!(worked.said().contains("history closed"), "{}", worked.said());
        // Faster than real time its clock goes on from the end of the history.
        let mut gateway = start(place, &["--speed", "2"]);
        let address = gateway.address();
        wait_for("the first tick", Duration::from_secs(60), || {
            (get(&address, "/api/v1/twin").status == 200).then_some(())
        });
        Self { address, _gateway: gateway, directory }
    }

    /// Begin and end of the hours that are over, ms since 1970.
    pub(crate) fn span_ms(&self, hours: u32) -> (i64, i64) {
        let first_ms = self.get("/api/v1/series")["first_ms"].as_i64().expect("a history");
        (first_ms, first_ms + 3_600_000 * i64::from(hours))
    }

    /// Somebody who may ask for a diagnosis, signed in.
    pub(crate) fn setter(&self) -> Client {
        let data = self.directory.path().join("data");
        let made = run(&["person", "add", "Li", "--role", "setter", "--json", "--data-dir", text(&data)]);
        assert!(made.status.success(), "{}{}", stdout(&made), stderr(&made));
        let told: Value = serde_json::from_str(&stdout(&made)).expect("JSON");
        let mut client = Client { address: self.address.clone(), cookie: String::new() };
        let answer = client.sign_in("Li", told["token"].as_str().expect("a token"));
        assert_eq!(answer.status, 200, "{}", answer.body);
        client
    }

    pub(crate) fn get(&self, path: &str) -> Value {
        let answer = get(&self.address, path);
        assert_eq!(answer.status, 200, "{path}: {}", answer.body);
        answer.json()
    }
}

fn start(place: &Path, more: &[&str]) -> Gateway {
    let mut command = program();
    command.current_dir(place).args(["run", "--config", "box.toml", "--listen", "127.0.0.1:0"]).args(more);
    Gateway::spawn(command)
}
