//! Threads that break off while the gate is armed: it is disarmed within a tick, told, and nothing is written without an audit.

use super::cut::{TICK_NS, asking, cutting, limits};
use super::running::{gate, order, prepared};
use crate::whole::twin::MODEL;
use adapters::Actuator;
use adapters::address::SimulatedMachine;
use adapters::clock::{ManualClock, SECOND_NS};
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::threads::FAULT_VARIABLE;
use gateway::config::GateMode;
use gateway::gate::{AuditPath, Gate, OverrideWriter};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use testkit::broker::Broker;
use testkit::process::{Gateway, get, program, text, wait_for};

/// The longest that a tick may take on a computer with other work, and the time between two documents of the status.
const WITHIN: Duration = Duration::from_millis(1500);

/// Every kind that waits or works for long in a box with a twin, a recipe, backups and an MQTT broker. `opening` and `backup work` live for
/// moments, `align` begins with the first meter that is late, `log` with the first line of the log, and `tick` ends the process (below);
/// they have the same supervision.
const KINDS: [&str; 15] = [
    "history",
    "source",
    "save",
    "audit",
    "gate",
    "wear",
    "control",
    "serve",
    "files",
    "scripts",
    "twin",
    "operations",
    "backup",
    "mqtt",
    "told",
];

/// The recipe, the model, backups and a broker, behind the configuration of [`prepared`].
fn furnish(directory: &Path, config: &Path, broker: &Broker) {
    std::fs::write(directory.join("model.toml"), MODEL).expect("written");
    std::fs::write(directory.join("recipe.toml"), "schema = \"operations/1\"\n").expect("written");
    std::fs::create_dir(directory.join("copies")).expect("a directory");
    let more = format!(
        "[twin]\nmodel = \"model.toml\"\n[operations]\npath = \"recipe.toml\"\n[backup]\ndirectory = \"copies\"\n\
         [[source]]\nname = \"meter\"\naddress = \"nclink://127.0.0.1:{}/NONE\"\n",
        broker.port
    );
    let written = std::fs::read_to_string(config).expect("there");
    std::fs::write(config, format!("{written}{more}")).expect("written");
}

/// A running, armed box that breaks off where the file says.
struct Armed {
    directory: tempfile::TempDir,
    gateway: Gateway,
    address: String,
}

impl Armed {
    /// `broker`: for a box with everything.
    fn start(broker: Option<&Broker>) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let config = prepared(directory.path(), "simulated://lathe?dropouts_per_h=0&begun_s=260");
        broker.into_iter().for_each(|broker| furnish(directory.path(), &config, broker));
        let mut command = program();
        command.env(FAULT_VARIABLE, directory.path().join("fault"));
        command.args(["run", "--config", text(&config), "--listen", "127.0.0.1:0"]);
        let mut gateway = Gateway::spawn(command);
        let address = gateway.address();
        wait_for("a decision", Duration::from_secs(60), || gate(&address)["permitted_pct"].is_number().then_some(()));
        let (code, said) = order(&config, &["arm", "--by", "fitter"]);
        assert_eq!(code, Some(0), "{said}");
        wait_for("the arming", Duration::from_secs(10), || gate(&address)["armed_by"].is_string().then_some(()));
        Self { directory, gateway, address }
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.directory.path().join(name)
    }

    /// Breaks the thread off; gives when that was.
    fn break_off(&self, thread: &str) -> Instant {
        let fault = self.path("fault");
        std::fs::write(self.path("fault.new"), thread).expect("written");
        std::fs::rename(self.path("fault.new"), &fault).expect("in its place");
        // These two break off when somebody comes.
        match thread {
            "control" => drop(UnixStream::connect(self.path("data/control.sock"))),
            "serve" => drop(testkit::process::try_get(&self.address, "/healthz")),
            _ => {}
        }
        wait_for(&format!("{thread} to break off"), Duration::from_secs(20), || {
            (!fault.exists()).then_some(Instant::now())
        })
    }
}

fn is_told(address: &str, thread: &str) -> bool {
    let status = get(address, "/api/v1/status").json();
    let problems = status["problems"].as_array().expect("problems").clone();
    problems.iter().any(|it| it["what"].as_str().is_some_and(|what| what.contains(&format!("the thread \"{thread}\""))))
}

fn crash_reports(data: &Path) -> usize {
    std::fs::read_dir(data.join("crashes")).map_or(0, |files| files.flatten().count())
}

/// Gives how long it took until the status said that the gate is disarmed, and why.
fn breaks_and_disarms(thread: &str, broker: Option<&Broker>) -> Duration {
    let armed = Armed::start(broker);
    let broke_off = armed.break_off(thread);
    let took = wait_for(&format!("{thread}: disarmed and told"), Duration::from_secs(10), || {
        (gate(&armed.address)["armed_by"].is_null() && is_told(&armed.address, thread)).then(|| broke_off.elapsed())
    });
    assert!(took < WITHIN, "{thread}: {took:?}");
    wait_for(&format!("{thread}: a crash report"), Duration::from_secs(10), || {
        (crash_reports(&armed.path("data")) == 1).then_some(())
    });
    if thread == "history" {
        let status = get(&armed.address, "/api/v1/status").json();
        assert!(status["history"]["error"].as_str().is_some_and(|error| error.contains("broke off")), "{status}");
    }
    armed.gateway.stop();
    took
}

#[test]
fn the_history_breaks_off_and_nobody_writes_on() {
    breaks_and_disarms("history", None);
}

#[test]
#[ignore = "2 minutes: a start of the program for each of fifteen kinds of thread, which breaks off"]
fn fifteen_kinds_of_thread_break_off_and_the_gate_is_disarmed() {
    let Some(broker) = Broker::start() else { return };
    for thread in KINDS {
        println!("{thread}: disarmed and told {} ms later", breaks_and_disarms(thread, Some(&broker)).as_millis());
    }
}

#[test]
fn a_tick_that_breaks_off_ends_the_process_with_an_error() {
    let mut armed = Armed::start(None);
    armed.break_off("tick");
    let status = armed.gateway.wait_at_most(Duration::from_secs(20));
    assert_eq!(status.code(), Some(2), "{}", armed.gateway.said());
    assert!(armed.gateway.said().contains("the tick broke off"), "{}", armed.gateway.said());
}

/// An audit that ends when the test says so.
struct Switched(Arc<AtomicBool>);

impl AuditPath for Switched {
    fn is_live(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

#[test]
fn nothing_is_written_after_the_audit_has_gone_whatever_the_verdict_says() {
    let settings = SimulatedSettings { machine: SimulatedMachine::Lathe, ..SimulatedSettings::default() };
    let machine = Simulated::new("simulated://lathe", settings, -7200 * SECOND_NS);
    let live = Arc::new(AtomicBool::new(true));
    let actuator = Box::new(machine.feed_override()) as Box<dyn Actuator>;
    let mut writer = OverrideWriter::new(actuator, Box::new(Switched(live.clone())), &limits(GateMode::Armed));
    let mut gate = Gate::new(limits(GateMode::Armed));
    gate.arm("fitter", None, 0).expect("allowed");
    let clock = ManualClock::with_time(0);
    let mut changes = [0, 0];
    for tick in 1..200 {
        live.store(tick < 100, Ordering::SeqCst);
        let at_ns = tick * TICK_NS;
        clock.set_time(at_ns);
        let (sample, estimates) = cutting(at_ns);
        let verdict = gate.decide_override(Some(&asking(60.0 + (tick % 30) as f64)), &sample, estimates.state);
        assert!(verdict.armed, "the gate itself knows nothing of it");
        let written = writer.write_verdict(&verdict, &clock);
        let asks =
            written.is_some_and(|it| matches!(it.occasion.as_words(), "the override was changed" | "the sign of life"));
        changes[usize::from(tick >= 100)] += usize::from(asks);
    }
    assert!(changes[0] > 10 && changes[1] == 0, "{changes:?}");
}
