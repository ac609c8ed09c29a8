//! A box that plays the recording, with a broker, a clock that can be wrong, and who looks at it meanwhile.

use super::recorded::{Course, write_csv};
use serde_json::Value as Json;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use testkit::broker::{Broker, program as find_program};
use testkit::process::{Gateway, program, try_get};

const FAKETIME: &str = "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1";

/// `mosquitto_sub`, and every document that it has heard.
pub(super) struct Heard {
    child: Child,
    pub(super) lines: Arc<Mutex<Vec<Json>>>,
}

impl Heard {
    pub(super) fn of(port: u16) -> Self {
        let mut command = Command::new(find_program("mosquitto_sub").expect("beside mosquitto"));
        command.args(["-h", "127.0.0.1", "-p", &port.to_string(), "-t", "works/#", "-q", "1"]);
        command.args(["-i", "story", "-c"]).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("it runs");
        let lines = Arc::new(Mutex::new(Vec::new()));
        let (output, heard) = (child.stdout.take().expect("piped"), lines.clone());
        std::thread::spawn(move || {
            let documents = BufReader::new(output).lines().map_while(Result::ok);
            for line in documents.filter_map(|line| serde_json::from_str(&line).ok()) {
                heard.lock().expect("whole").push(line);
            }
        });
        Self { child, lines }
    }
}

impl Drop for Heard {
    fn drop(&mut self) {
        let _already_gone = self.child.kill();
        let _reaped = self.child.wait();
    }
}

/// What the live views said at one moment.
#[derive(Debug)]
pub(super) struct Moment {
    /// Whether the clock of the box was right by then.
    pub(super) dated: bool,
    pub(super) status: Json,
    /// Of the same status; `None` where another one came in between.
    pub(super) metrics: Option<String>,
}

/// A box that plays the recording.
pub(super) struct Story {
    pub(super) directory: tempfile::TempDir,
    pub(super) broker: Broker,
    pub(super) gateway: Gateway,
    pub(super) clock: Option<PathBuf>,
}

impl Story {
    /// `None`, with a word about it, where something is not installed.
    pub(super) fn start(course: Course, speed: f64, wrong_clock: bool) -> Option<Self> {
        if wrong_clock && !Path::new(FAKETIME).exists() {
            assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "no libfaketime: install the package faketime");
            eprintln!("SKIPPED: no libfaketime here; install the package faketime");
            return None;
        }
        let broker = Broker::start()?;
        let directory = tempfile::tempdir().expect("a directory");
        let recording = directory.path().join("hour.csv");
        std::fs::write(&recording, write_csv(course)).expect("written");
        let config = format!(
            "[gateway]\nname = \"Story\"\n[[source]]\naddress = \"replay:{}?speed={speed}\"\n[[sink]]\nname = \"plant\"\n\
             address = \"mqtt://127.0.0.1:{}/works/story\"\n",
            recording.display(),
            broker.port
        );
        std::fs::write(directory.path().join("box.toml"), config).expect("written");
        let clock = wrong_clock.then(|| directory.path().join("clock"));
        let mut command = program();
        command.arg("run").arg("--config").arg(directory.path().join("box.toml"));
        command.arg("--data-dir").arg(directory.path().join("data")).args(["--listen", "127.0.0.1:0"]);
        if let Some(clock) = &clock {
            std::fs::write(clock, "@1970-01-01 00:00:10").expect("written");
            command.env("LD_PRELOAD", FAKETIME).env("FAKETIME_TIMESTAMP_FILE", clock).env("FAKETIME_NO_CACHE", "1");
            command.env("FAKETIME_DONT_FAKE_MONOTONIC", "1").env("DONT_FAKE_MONOTONIC", "1").env("TZ", "UTC");
        }
        Some(Self { broker, gateway: Gateway::spawn(command), clock, directory })
    }

    pub(super) fn database(&self) -> PathBuf {
        self.directory.path().join("data/history.db")
    }

    /// The addresses of the page, one for each time that the box has begun.
    pub(super) fn pages(&self) -> Vec<String> {
        self.gateway.list_pages()
    }
}

/// Looks at a running box until it is told to stop.
pub(super) fn watch_box(address: &str, dated: bool, over: &AtomicBool, seen: &Mutex<Vec<Moment>>) {
    let mut last = Json::Null;
    while !over.load(Ordering::SeqCst) {
        let Ok(status) = try_get(address, "/api/v1/status").map(|it| it.json()) else { return };
        if status["at_ms"].is_i64() && status["at_ms"] != last {
            last = status["at_ms"].clone();
            let metrics = try_get(address, "/metrics").map(|it| it.body).ok();
            let after = try_get(address, "/api/v1/status").map(|it| it.json());
            let same = after.is_ok_and(|after| after["at_ms"] == last);
            seen.lock().expect("whole").push(Moment { dated, status, metrics: metrics.filter(|_| same) });
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}
