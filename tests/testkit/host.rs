//! The Sparkplug host of `host.py`, as a child process.

use serde_json::Value as Json;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A host that decodes everything it hears.
pub struct Host {
    child: Child,
    heard: Arc<Mutex<Vec<Json>>>,
}

impl Host {
    /// A host at the broker on this port; `None` where pysparkplug is not installed.
    pub fn at(port: u16) -> Option<Self> {
        let has = Command::new("python3").args(["-c", "import pysparkplug"]).stderr(Stdio::null()).status();
        if !has.is_ok_and(|status| status.success()) {
            assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "pysparkplug is not installed");
            eprintln!("SKIPPED: pysparkplug is not installed (pip install pysparkplug==0.6.1)");
            return None;
        }
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("host.py");
        let mut command = Command::new("python3");
        command.arg(script).arg(port.to_string()).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("python3 runs");
        let (heard, output) = (Arc::new(Mutex::new(Vec::new())), child.stdout.take().expect("piped"));
        let shared = heard.clone();
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                shared.lock().expect("whole").push(serde_json::from_str(&line).expect("JSON"));
            }
        });
        let host = Self { child, heard };
        host.wait("the host to connect", |heard| heard.iter().any(|message| message["kind"] == "connected"));
        Some(host)
    }

    /// Every message so far.
    pub fn heard(&self) -> Vec<Json> {
        self.heard.lock().expect("whole").clone()
    }

    /// Waits until what it has heard will do.
    pub fn wait(&self, what: &str, mut ready: impl FnMut(&[Json]) -> bool) {
        let until = Instant::now() + Duration::from_secs(40);
        while !ready(&self.heard.lock().expect("whole")) {
            let kinds = || self.last_kinds();
            assert!(Instant::now() < until, "waited 40 s in vain: {what}; heard {}", kinds());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until it has heard more than so many of a kind. The message of the failure names the last ones only.
    pub fn wait_more(&self, what: &str, kind: &str, than: usize) {
        self.wait(what, |heard| heard.iter().filter(|message| message["kind"] == kind).count() > than);
    }

    /// How many of this kind it has heard; nothing is copied, because a long run hears a hundred thousand.
    pub fn count(&self, kind: &str) -> usize {
        self.heard.lock().expect("whole").iter().filter(|message| message["kind"] == kind).count()
    }

    /// Sends a command to a node: `kind` is double, string or null.
    pub fn command(&mut self, node: &str, name: &str, kind: &str, value: &str) {
        writeln!(self.child.stdin.as_mut().expect("piped"), "command {node} {name} {kind} {value}")
            .expect("it listens");
    }

    /// Says whether this host is there.
    pub fn say_state(&mut self, online: bool, timestamp: i64) {
        writeln!(self.child.stdin.as_mut().expect("piped"), "state {online} {timestamp}").expect("it listens");
    }

    fn last_kinds(&self) -> String {
        let heard = self.heard.lock().expect("whole");
        let last = &heard[heard.len().saturating_sub(60)..];
        last.iter().map(|message| message["kind"].to_string()).collect::<Vec<_>>().join(" ")
    }

    /// Asks a node for its birth.
    pub fn ask_rebirth(&mut self, group: &str, node: &str) {
        writeln!(self.child.stdin.as_mut().expect("piped"), "rebirth {group} {node}").expect("it listens");
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _ended = self.child.kill();
        let _status = self.child.wait();
    }
}
