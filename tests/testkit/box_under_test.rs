//! A gateway on a simulated lathe with one sink, as an integrator starts it.

use crate::process::{Gateway, get, program, run, stderr, stdout, text, wait_for};
use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

/// A gateway that sends.
pub struct Sending {
    directory: tempfile::TempDir,
    /// `None` while it is stopped.
    pub gateway: Option<Gateway>,
    page: String,
    speed: &'static str,
}

impl Sending {
    /// Starts it with one sink named `plant`, and further lines of configuration.
    pub fn to(address: &str, more: &str) -> Self {
        Self::at_speed("1", address, more)
    }

    /// The same twenty times as fast: the machine is switched on soon, and there is much to send.
    pub fn fast(address: &str) -> Self {
        Self::at_speed("20", address, "")
    }

    /// The same so many times as fast.
    pub fn at_speed(speed: &'static str, address: &str, more: &str) -> Self {
        Self::with_script("simulated://lathe?seed=3", speed, address, more, None)
    }

    /// The same with another machine, named `lathe`, and with this script instead of the shipped ones.
    pub fn with_script(machine: &str, speed: &'static str, address: &str, more: &str, script: Option<&str>) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        if let Some(script) = script {
            let scripts = directory.path().join("data/scripts");
            std::fs::create_dir_all(&scripts).expect("a directory");
            std::fs::write(scripts.join("own.rhai"), script).expect("writable");
        }
        let config = format!(
            "[gateway]\nname = \"Lathe 7\"\n[[source]]\nname = \"lathe\"\naddress = \"{machine}\"\n\
             [[sink]]\nname = \"plant\"\naddress = \"{address}\"\n{more}"
        );
        std::fs::write(directory.path().join("gateway.toml"), config).expect("writable");
        let mut sending = Self { directory, gateway: None, page: String::new(), speed };
        sending.start();
        sending
    }

    /// Starts it again, with the same data.
    pub fn start(&mut self) {
        let config = self.directory.path().join("gateway.toml");
        let mut gateway =
            Gateway::start(&self.directory.path().join("data"), &["--config", text(&config), "--speed", self.speed]);
        self.page = gateway.address();
        self.gateway = Some(gateway);
    }

    /// Its history.
    pub fn database(&self) -> PathBuf {
        self.directory.path().join("data/history.db")
    }

    /// `127.0.0.1:PORT` of its page.
    pub fn page(&self) -> &str {
        &self.page
    }

    /// What the page is told.
    pub fn status(&self) -> Json {
        get(&self.page, "/api/v1/status").json()
    }

    /// What the page is told of the sink.
    pub fn sink(&self) -> Json {
        self.status()["sinks"][0].clone()
    }

    /// Waits until the sink says so of itself.
    pub fn wait_sink(&self, what: &str, ready: impl Fn(&Json) -> bool) -> Json {
        wait_for(what, Duration::from_secs(60), || Some(self.sink()).filter(&ready))
    }

    /// Waits until the machine is switched on and its spindle turns.
    pub fn wait_spindle(&self) {
        wait_for("the spindle", Duration::from_secs(120), || {
            let status = self.status();
            let channels = status["channels"].as_array()?;
            let speed = channels.iter().find(|channel| channel["name"] == "spindle_speed_rpm")?["value"].as_f64()?;
            (speed > 100.0).then_some(())
        });
    }

    /// Ends it cleanly and gives what it said.
    pub fn stop(&mut self) -> String {
        self.gateway.take().expect("it runs").stop()
    }

    /// SIGKILL.
    pub fn kill(&mut self) {
        self.gateway.take().expect("it runs").kill();
    }

    /// Gives an order at the box.
    pub fn order(&self, arguments: &[&str]) -> String {
        let mut command = program();
        command.env("CNC_GATEWAY__GATEWAY__DATA_DIR", self.directory.path().join("data"));
        command.args(arguments).args(["--config", text(&self.directory.path().join("gateway.toml"))]);
        let output = command.output().expect("it runs");
        format!("{}{}", stdout(&output), stderr(&output))
    }

    /// The rows of the audit.
    pub fn audit(&self) -> Vec<Json> {
        let said = run(&["history", "audit", "--json", "--history", text(&self.database())]);
        let document: Json = serde_json::from_str(&stdout(&said)).expect("JSON");
        document["rows"].as_array().expect("rows").clone()
    }

    /// The `devices.xml` that the box writes.
    pub fn devices(&self) -> PathBuf {
        let (config, file) = (self.directory.path().join("gateway.toml"), self.directory.path().join("devices.xml"));
        // The data directory of the running box goes before that of the file.
        let mut command = program();
        command.env("CNC_GATEWAY__GATEWAY__DATA_DIR", self.directory.path().join("data"));
        command.args(["devices", "--config", text(&config), "--out", text(&file)]);
        let output = command.output().expect("it runs");
        assert!(output.status.success(), "{}", stderr(&output));
        file
    }

    /// What `history query` says: for each channel, the values by time in milliseconds; missing ones are left out.
    pub fn queried(&self, channels: &str) -> BTreeMap<String, BTreeMap<i64, Json>> {
        let database = self.database();
        let arguments = ["history", "query", "--history", text(&database), "--channels", channels, "--json"];
        let answer: Json = serde_json::from_str(&stdout(&run(&arguments))).expect("JSON");
        let series = answer["series"].as_array().expect("series").iter().map(|series| {
            let points = series["points"].as_array().expect("points").iter();
            let point =
                |point: &Json| Some((point[0].as_i64()?, point[1].clone())).filter(|(_, value)| !value.is_null());
            (series["channel"].as_str().expect("named").to_owned(), points.filter_map(point).collect())
        });
        series.collect()
    }
}
