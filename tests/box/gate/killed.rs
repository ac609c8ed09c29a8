//! The gateway dies: the machine, which lives in another process, is back at the operator's dial within its heartbeat time.
//!
//! The machine is the simulated one behind a FOCAS2/Ethernet control, served by this test; the gateway is the real program,
//! which writes through the mailbox of that control's ladder (sign of life at least every 1.5 s, see the ladder's module).

use adapters::address::SimulatedMachine;
use adapters::clock::{Clock, SystemClock};
use adapters::fanuc::item::Area;
use adapters::fanuc_server::{Server, ServerSettings, SimulatedControl};
use adapters::simulated::{Simulated, SimulatedSettings};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, get, program, run, stdout, text, wait_for};

/// The ladder's own patience with the sign of life, and a few scans.
const HEARTBEAT: Duration = Duration::from_millis(1500);

/// How long the control has been on: a quarter of a minute later its spindle turns free for three seconds, so that the gate
/// knows the state of the machine from the start of a gateway that has learned nothing yet.
const ON_NS: i64 = 260_000_000_000;

fn served() -> Server {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let settings = SimulatedSettings { machine: SimulatedMachine::Lathe, ..SimulatedSettings::default() };
    let machine = Simulated::new("simulated://lathe", settings, clock.now_ns() - ON_NS);
    let control = SimulatedControl::new(machine, clock, 4);
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    Server::start(listener, Box::new(control), ServerSettings::default()).expect("threads")
}

/// What the ladder has in force, from G012 (inverted).
fn in_force(server: &Server) -> Option<u8> {
    server.with(|control| control.map(|control| 255 - control.memory.read_byte(Area::G, 12)))
}

fn prepared(directory: &Path, server: &Server) -> PathBuf {
    let scripts = directory.join("data/scripts");
    std::fs::create_dir_all(&scripts).expect("a directory");
    std::fs::write(scripts.join("slow.rhai"), "request_feed_override(70, \"test\");").expect("a script");
    let config = directory.join("cnc-gateway.toml");
    let written = format!(
        "[gateway]\ndata_dir = \"data\"\n[[source]]\naddress = \"fanuc://{}?write=mailbox&dial=R907\"\nname = \"lathe\"\n\
         [gate]\nmode = \"armed\"\nsource = \"lathe\"\nabove_dial = true\nstale_s = 2.0\n[http]\nlisten = \"127.0.0.1:0\"\n",
        server.address()
    );
    std::fs::write(&config, written).expect("a configuration");
    config
}

#[test]
fn a_killed_gateway_gives_the_machine_back_within_the_heartbeat_time() {
    let directory = tempfile::tempdir().expect("a directory");
    let server = served();
    let config = prepared(directory.path(), &server);
    let mut command = program();
    command.args(["run", "--config", text(&config), "--listen", "127.0.0.1:0"]);
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    wait_for("a decision", Duration::from_secs(60), || {
        get(&address, "/api/v1/status").json()["gate"]["permitted_pct"].is_number().then_some(())
    });
    let armed = run(&["arm", "--by", "fitter", "--config", text(&config)]);
    assert!(armed.status.success(), "{}", stdout(&armed));
    wait_for("an override below the dial in force at the machine", Duration::from_secs(100), || {
        (in_force(&server)? <= 80).then_some(())
    });
    gateway.kill();
    let killed = Instant::now();
    wait_for("the dial", Duration::from_secs(20), || (in_force(&server)? == 100).then_some(()));
    let back = killed.elapsed();
    println!(
        "kill -9: the ladder of the machine in the other process was back at the dial {} ms later",
        back.as_millis()
    );
    assert!(back < HEARTBEAT + Duration::from_secs(2), "{back:?}: heartbeat {HEARTBEAT:?}, and a loaded computer");
}

/// The history commits once a minute, so that the kill takes nearly all of the audit with it.
#[test]
fn a_kill_takes_no_row_of_the_audit() {
    let directory = tempfile::tempdir().expect("a directory");
    let server = served();
    let config = prepared(directory.path(), &server);
    let written = std::fs::read_to_string(&config).expect("readable");
    std::fs::write(&config, written + "[history]\ncommit_s = 60.0\n").expect("a configuration");
    let start = || {
        let mut command = program();
        command.args(["run", "--config", text(&config), "--listen", "127.0.0.1:0"]);
        let mut gateway = Gateway::spawn(command);
        let address = gateway.address();
        (gateway, address)
    };
    let database = directory.path().join("data/history.db");
    let writes = || {
        let told = stdout(&run(&["history", "audit", "--json", "--history", text(&database)]));
        let document: serde_json::Value = serde_json::from_str(&told).expect("JSON");
        let rows = document["rows"].as_array().expect("rows").clone();
        rows.into_iter().filter(|row| row["kind"] == "write" && row["outcome"] == "written").collect::<Vec<_>>()
    };
    let (gateway, address) = start();
    let gate = |address: &str| get(address, "/api/v1/status").json()["gate"].clone();
    wait_for("a decision", Duration::from_secs(60), || gate(&address)["permitted_pct"].is_number().then_some(()));
    assert!(run(&["arm", "--by", "fitter", "--config", text(&config)]).status.success());
    let low = |pct: &serde_json::Value| pct.as_f64().is_some_and(|pct| pct <= 80.0);
    wait_for("an override below the dial", Duration::from_secs(100), || {
        low(&gate(&address)["written_pct"]).then_some(())
    });
    gateway.kill();
    let before = writes();
    let (mut gateway, _) = start();
    gateway.wait_said("rows of the audit that the last end had cut off");
    gateway.stop();
    let after = writes();
    println!("write rows in the history: {} after the kill, {} after the next start", before.len(), after.len());
    assert!(after.iter().any(|row| low(&row["asked"])), "the last one before the kill: {after:?}");
    assert!(after.len() > before.len() && after[..before.len()] == before[..], "{before:?}; {after:?}");
    assert!(run(&["history", "audit", "--verify", "--history", text(&database)]).status.success());
}
