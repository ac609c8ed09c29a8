//! The loop closed: a gateway reads a served FANUC machine, a script holds the spindle load, the gate lets it through, the
//! ladder takes it from the mailbox. Two real processes.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Duration;
use testkit::process::{get, run, stdout, text, wait_for};
use testkit::served::{Serving, armed, channel, prepared, started};

/// What the script aims at, percent of the spindle's rating: a little less than the roughing cuts of the plan take.
const TARGET_PCT: f64 = 30.0;

const SCRIPT: &str = "
const TARGET = 30.0;
let pct = memory.pct ?? 100.0;
if has(spindle_load_pct) && has(rapid) && rapid == 0.0 && spindle_load_pct > 8.0 {
    pct = clamp(pct + 0.8 * (TARGET - spindle_load_pct) * dt_s, 60.0, 118.0);
    request_feed_override(pct, \"constant load\");
} else {
    pct = 100.0;
}
memory.pct = pct;
";

/// Less feed than the dial, and a feed hold when that has been so for two seconds.
const HOLDING: &str = "
let slow = memory.slow ?? 0;
memory.slow = if has(feed_override_pct) && feed_override_pct <= 61.0 { slow + 1 } else { 0 };
if has(rapid) && rapid == 0.0 { request_feed_override(60.0, \"gently\"); }
if memory.slow > 20 { request_feed_hold(\"look at the tool\"); }
";

fn configured(directory: &Path, address: &str, script: &str) -> PathBuf {
    let source = format!("[[source]]\naddress = \"{address}\"\nname = \"lathe\"\n");
    prepared(directory, script, &format!("{source}[gate]\nmode = \"armed\"\nsource = \"lathe\"\n"))
}

struct Shown {
    gate: Value,
    override_pct: Option<f64>,
    load_pct: Option<f64>,
}

fn shown(address: &str) -> Shown {
    let status = get(address, "/api/v1/status").json();
    let of = |name: &str| channel(&status, name)?.as_f64();
    Shown { gate: status["gate"].clone(), override_pct: of("feed_override_pct"), load_pct: of("spindle_load_pct") }
}

#[test]
fn the_load_is_held_through_the_mailbox_of_a_served_machine() {
    let serving = Serving::start(&["--machine", "simulated://lathe?begun_s=125"]);
    let directory = tempfile::tempdir().expect("a directory");
    let config = configured(
        directory.path(),
        &format!("{}?write=mailbox&dial=R907&power_diagnosis=4902", serving.address),
        SCRIPT,
    );
    let (gateway, address) = started(&config);
    wait_for("a decision", Duration::from_secs(60), || shown(&address).gate["permitted_pct"].is_number().then_some(()));
    armed(&config);
    let in_force = wait_for("an override other than 100 % in force", Duration::from_secs(150), || {
        let now = shown(&address);
        assert!(now.gate["disarmed"].is_null() || now.gate["disarmed"] == "not armed since the start", "{}", now.gate);
        let asked = now.gate["written_pct"].as_f64()?;
        let found = now.override_pct?;
        ((asked - 100.0).abs() >= 3.0 && (found - asked).abs() <= 2.0).then_some((asked, found, now.load_pct))
    });
    let (asked, found, load) = in_force;
    println!("asked {asked} %, the control shows {found} %, load {load:?} % towards {TARGET_PCT} %");
    let held = wait_for("the load near its target", Duration::from_secs(150), || {
        let now = shown(&address);
        let (found, load) = (now.override_pct?, now.load_pct?);
        (found <= 93.0 && (load - TARGET_PCT).abs() <= 3.0).then_some((found, load))
    });
    println!("at {} % of the feed the load is {} %", held.0, held.1);
    gateway.stop();
}

#[test]
fn the_dial_is_known_and_a_feed_hold_is_latched_by_the_ladder() {
    let serving = Serving::start(&["--machine", "simulated://lathe?begun_s=125", "--dial", "80"]);
    let directory = tempfile::tempdir().expect("a directory");
    let keys = "write=mailbox&dial=R907&request=R905&power_diagnosis=4902";
    let config = configured(directory.path(), &format!("{}?{keys}", serving.address), HOLDING);
    let (gateway, address) = started(&config);
    wait_for("a decision", Duration::from_secs(60), || shown(&address).gate["permitted_pct"].is_number().then_some(()));
    armed(&config);
    let of = |name: &str| channel(&get(&address, "/api/v1/status").json(), name);
    let dial = wait_for("the gateway's override below the dial", Duration::from_secs(150), || {
        let now = shown(&address);
        assert!(now.gate["disarmed"].is_null() || now.gate["disarmed"] == "not armed since the start", "{}", now.gate);
        (now.override_pct? <= 61.0).then(|| of("feed_override_dial_pct"))
    });
    assert_eq!(dial, Some(Value::from(80.0)), "the dial is told apart from what is in force");
    wait_for("the axes stand", Duration::from_secs(60), || of("execution").filter(|word| word == "FEED_HOLD"));
    gateway.stop();
    let database = directory.path().join("data/history.db");
    let told = stdout(&run(&["history", "audit", "--json", "--history", text(&database)]));
    assert!(told.contains("feed_hold"), "{told}");
}

#[test]
fn a_direct_write_is_not_held_and_ends_the_arming() {
    let serving = Serving::start(&["--machine", "simulated://lathe?begun_s=125"]);
    let directory = tempfile::tempdir().expect("a directory");
    let config = configured(
        directory.path(),
        &format!("{}?write=direct&dial=R907&power_diagnosis=4902", serving.address),
        SCRIPT,
    );
    let (gateway, address) = started(&config);
    wait_for("a decision", Duration::from_secs(60), || shown(&address).gate["permitted_pct"].is_number().then_some(()));
    armed(&config);
    let why = wait_for("the end of the arming", Duration::from_secs(150), || {
        let disarmed = shown(&address).gate["disarmed"].as_str().map(str::to_owned)?;
        (disarmed != "not armed since the start").then_some(disarmed)
    });
    println!("disarmed: {why}");
    gateway.stop();
    let database = directory.path().join("data/history.db");
    let told = stdout(&run(&["history", "audit", "--json", "--history", text(&database)]));
    assert!(told.contains("not held: 9") && told.contains("was written to G012"), "{told}");
}
