//! pymodbus as a meter, socat as a cable, and what the tests read with.

use adapters::clock::SystemClock;
use adapters::{Address, ChannelId, Reading, Source, SourceError};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Does the tool answer? Where `CNC_GATEWAY_CI` is set it must; elsewhere its absence is said.
fn answers(tool: &str, arguments: &[&str]) -> bool {
    let found = Command::new(tool).args(arguments).output().is_ok_and(|output| output.status.success());
    assert!(found || std::env::var_os("CNC_GATEWAY_CI").is_none(), "{tool} {arguments:?} does not run; see .ci/run");
    if !found {
        eprintln!("SKIPPED: {tool} {} does not run here; .ci/run installs it", arguments.join(" "));
    }
    found
}

/// Is pymodbus installed?
pub(crate) fn pymodbus_is_there() -> bool {
    answers("python3", &["-c", "import pymodbus.server, serial"])
}

/// Is socat installed?
pub(crate) fn socat_is_there() -> bool {
    answers("socat", &["-V"])
}

/// A process that is killed when dropped.
pub(crate) struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A number in registers: address, format of Python's struct module, value.
pub(crate) type Cell = (u16, &'static str, f64);

/// pymodbus with these numbers. `arguments`: `tcp PORT` or `rtu DEVICE BAUD`.
pub(crate) fn pymodbus(arguments: &[&str], cells: &[Cell]) -> Running {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/controllers/meters/partner.py");
    let mut command = Command::new("python3");
    command.arg(script).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().expect("python3 starts");
    let cell = |(address, form, number): &Cell| match form.contains(['f', 'd']) {
        true => serde_json::json!([address, form, number]),
        #[expect(clippy::cast_possible_truncation, reason = "whole numbers, as the test wrote them")]
        false => serde_json::json!([address, form, *number as i64]),
    };
    let cells: Vec<serde_json::Value> = cells.iter().map(cell).collect();
    let mut stdin = child.stdin.take().expect("piped");
    writeln!(stdin, "{}", serde_json::Value::from(cells)).expect("it reads");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("it says something");
    let running = Running(child);
    assert_eq!(line.trim(), "ready", "pymodbus did not start");
    running
}

/// Meters of a shop at this port, as `partner_shop.py` describes them; `carrier` is `tcp` or `rtu-over-tcp`.
pub(crate) fn shop(carrier: &str, port: u16, meters: &serde_json::Value) -> Running {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/controllers/meters/partner_shop.py");
    let mut command = Command::new("python3");
    command.arg(script).args([carrier, &port.to_string()]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.stderr(Stdio::null()).spawn().expect("python3 starts");
    writeln!(child.stdin.take().expect("piped"), "{meters}").expect("it reads");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("it says something");
    let running = Running(child);
    assert_eq!(line.trim(), "ready", "the shop did not open");
    running
}

/// Two ends of a serial line.
pub(crate) struct Cable {
    _socat: Running,
    pub(crate) ours: PathBuf,
    pub(crate) theirs: PathBuf,
}

/// A pair of pseudo terminals in `directory`.
pub(crate) fn cable(directory: &Path) -> Cable {
    let (ours, theirs) = (directory.join("ours"), directory.join("theirs"));
    let end = |path: &Path| format!("pty,raw,echo=0,link={}", path.display());
    let mut command = Command::new("socat");
    let child = command.arg(end(&ours)).arg(end(&theirs)).stderr(Stdio::null()).spawn().expect("socat starts");
    let running = Running(child);
    let until = Instant::now() + Duration::from_secs(10);
    while !(ours.exists() && theirs.exists()) {
        assert!(Instant::now() < until, "socat made no line");
        std::thread::sleep(Duration::from_millis(10));
    }
    Cable { _socat: running, ours, theirs }
}

/// Register profiles made for tests.
pub(crate) const PROFILES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/meters");

/// The only source of an address.
pub(crate) fn source(address: &str) -> Box<dyn Source> {
    let address: Address = address.parse().unwrap_or_else(|error| panic!("{error}"));
    let opened = adapters::open::open_address(&address, 0).unwrap_or_else(|error| panic!("{error}"));
    opened.sources.into_iter().next().expect("one source")
}

/// One poll.
pub(crate) fn poll(source: &mut dyn Source) -> Result<Vec<Reading>, SourceError> {
    let mut readings = Vec::new();
    source.read(&SystemClock::new(), &mut readings).map(|()| readings)
}

/// The number of a channel in a poll.
pub(crate) fn number(readings: &[Reading], channel: &str) -> f64 {
    let id = ChannelId::from_name(channel).expect("a channel");
    let reading = readings.iter().find(|reading| reading.channel == id);
    let reading = reading.unwrap_or_else(|| panic!("no {channel} in {readings:?}"));
    reading.value.as_ref().ok().and_then(|value| value.as_number()).unwrap_or_else(|| panic!("{reading:?}"))
}

/// Asserts a number to seven digits.
pub(crate) fn near(readings: &[Reading], channel: &str, expected: f64) {
    let found = number(readings, channel);
    assert!((found - expected).abs() <= 1e-6 * expected.abs().max(1.0), "{channel}: {found} for {expected}");
}
