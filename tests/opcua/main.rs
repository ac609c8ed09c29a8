//! The OPC UA server of the real box against a client that is not ours (PyPI asyncua).
//!
//! Built with the feature `opcua` only. Where asyncua is not installed the test says that it skips; with `CNC_GATEWAY_CI`
//! set it fails.

use serde_json::{Value as Json, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use testkit::box_under_test::Sending;
use testkit::{port, process};

const MACHINE_TOOL: &str = "http://opcfoundation.org/UA/MachineTool/";
/// An alarm that begins and ends every ten seconds of the machine while its spindle turns.
const SCRIPT: &str =
    "if held_s(\"turns\", spindle_speed_rpm > 100.0) % 10.0 > 5.0 { alarm(\"door\", \"the door was opened\") }";

/// What the client prints.
fn client(arguments: &[&str]) -> Json {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/opcua/client.py");
    let output = Command::new("python3").arg(script).args(arguments).output().expect("python3 runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn installed() -> bool {
    let has = Command::new("python3").args(["-c", "import asyncua"]).stderr(Stdio::null()).status();
    if has.is_ok_and(|status| status.success()) {
        return true;
    }
    assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "asyncua is not installed");
    eprintln!("SKIPPED: asyncua is not installed (pip install asyncua==2.1.0)");
    false
}

/// A box with this server, and a directory with the certificates of clients.
struct Served {
    sending: Sending,
    clients: tempfile::TempDir,
    url: String,
}

impl Served {
    fn start() -> Self {
        let clients = tempfile::tempdir().expect("a directory");
        let file = clients.path().join("password");
        std::fs::write(&file, "correct horse\n").expect("writable");
        for (name, days) in [("known", "4000"), ("stranger", "4000"), ("expired", "30")] {
            client(&["make", process::text(clients.path()), name, days]);
        }
        let port = port::free_port();
        let address = format!(
            "opcua://127.0.0.1:{port}?user=plant&password_file={}&manufacturer=Acme&model=L7&serial_number=4711",
            file.display()
        );
        let sending = Sending::with_script("simulated://lathe?seed=3", "20", &address, "", Some(SCRIPT));
        sending.wait_sink("listening", |sink| sink["state"] == "connected");
        Self { sending, clients, url: format!("opc.tcp://127.0.0.1:{port}/") }
    }

    fn attempt(&self, name: &str, login: &[&str]) -> Json {
        client(&[&["try", &self.url, process::text(self.clients.path()), name], login].concat())
    }

    fn look(&self, seconds: &str) -> Json {
        client(&["look", &self.url, process::text(self.clients.path()), "known", "plant", "correct horse", seconds])
    }

    fn certificates(&self) -> PathBuf {
        self.sending.database().with_file_name("opcua")
    }

    /// A person looks at the certificate that the server has put aside, and trusts it.
    fn trust(&self, name: &str) {
        let aside = std::fs::read_dir(self.certificates().join("rejected")).expect("a directory");
        let file = aside
            .filter_map(Result::ok)
            .find(|entry| entry.file_name().to_string_lossy().contains(&format!("{name} [")))
            .unwrap_or_else(|| panic!("{name} is not in rejected of {}", self.certificates().display()));
        std::fs::rename(file.path(), self.certificates().join("trusted").join(file.file_name())).expect("moved");
    }
}

const LOGIN: [&str; 2] = ["plant", "correct horse"];

#[test]
fn a_client_that_is_not_ours_reads_the_machine_and_changes_nothing() {
    if !installed() {
        return;
    }
    let mut served = Served::start();
    served.sending.wait_spindle();
    served.attempt("known", &LOGIN);
    served.trust("known");
    let seen = served.look("6");
    let status = served.sending.status();
    served.sending.stop();
    the_nodes_are_those_of_the_specification(&seen);
    absent_values_are_absent(&seen, &status);
    words_are_numbers_of_the_specification(&seen);
    the_program_has_a_state(&seen);
    alarms_are_events(&seen);
    assert_eq!(seen["methods"], json!([]));
    let writes: Vec<&str> =
        seen["writes"].as_array().expect("a list").iter().map(|said| said.as_str().expect("a word")).collect();
    assert_eq!(writes, ["BadUserAccessDenied"], "every write to every variable");
    let compared = equal_values(&served.sending, &seen);
    let nodes = seen["nodes"].as_object().map_or(0, serde_json::Map::len);
    println!("{nodes} nodes below the machine, {compared} values equal to `history query`, no write taken");
}

fn the_nodes_are_those_of_the_specification(seen: &Json) {
    assert_eq!(seen["machine"], "Lathe 7");
    assert_eq!(seen["type"], json!([MACHINE_TOOL, 13]));
    // Number of the type in the published list of OPC 40501-1.
    let objects = [
        ("Identification", 11),
        ("Monitoring", 14),
        ("Monitoring/MachineTool", 26),
        ("Monitoring/Channel1", 16),
        ("Monitoring/Spindle", 22),
        ("Production", 21),
        ("Production/ActiveProgram", 32),
        ("Production/ActiveProgram/State", 15),
        ("Notification", 7),
        ("Notification/Messages", 38),
    ];
    for (path, number) in objects {
        assert_eq!(seen["nodes"][path]["type"], json!([MACHINE_TOOL, number]), "{path}");
    }
    for path in ["Monitoring/Channel1/ChannelState", "Monitoring/Spindle/IsRotating", "Production/ActiveProgram/Name"] {
        assert_eq!(seen["nodes"][path]["space"], MACHINE_TOOL, "{path}");
        assert_eq!(seen["nodes"][path]["class"], "Variable", "{path}");
    }
    for (name, value) in
        [("ComponentName", "Lathe 7"), ("Manufacturer", "Acme"), ("Model", "L7"), ("SerialNumber", "4711")]
    {
        assert_eq!(seen["values"][format!("Identification/{name}")]["value"], value, "{name}");
    }
    assert_eq!(seen["units"]["Values/spindle_power_w"], json!(["W", 5_723_220]));
    assert_eq!(seen["units"]["Monitoring/Channel1/FeedOverride"], json!(["%", 20529]));
}

/// A value is there and good, or it is not there and the status says why; what the box shows as missing is missing here.
fn absent_values_are_absent(seen: &Json, status: &Json) {
    let (mut absent, mut present) = (0, 0);
    for (path, shown) in seen["values"].as_object().expect("values") {
        let good = shown["status"] == "Good";
        assert_eq!(good, !shown["value"].is_null(), "{path}: {shown}");
        assert!(good || shown["status"].as_str().is_some_and(|word| word.starts_with("Bad")), "{path}: {shown}");
        (absent, present) = (absent + u32::from(!good), present + u32::from(good));
        let Some(name) = path.strip_prefix("Values/") else { continue };
        let channels = status["channels"].as_array().expect("channels");
        let channel = channels.iter().find(|channel| channel["name"] == name && !channel["value"].is_null());
        assert!(good || channel.is_none(), "{path}: {shown} and {channel:?}");
    }
    println!("{present} values present, {absent} absent");
    assert!(absent > 10 && present > 30, "{absent} absent, {present} present");
    assert_eq!(seen["values"]["Monitoring/MachineTool/PowerOnDuration"]["status"], "BadNotSupported");
}

fn words_are_numbers_of_the_specification(seen: &Json) {
    let value = |path: &str| &seen["values"][path]["value"];
    if value("Values/mode") == "AUTOMATIC" {
        assert_eq!(value("Monitoring/MachineTool/OperationMode"), 1);
        assert_eq!(value("Monitoring/Channel1/ChannelMode"), 0);
    }
    let active = value("Values/execution") == "ACTIVE";
    assert_eq!(value("Monitoring/Channel1/ChannelState") == 0, active, "{}", value("Values/execution"));
    let speed_rpm = value("Values/spindle_speed_rpm").as_f64().expect("a speed");
    assert_eq!(value("Monitoring/Spindle/IsRotating"), speed_rpm.abs() >= 1.0);
}

/// The state of the program is the number, the node and the name of the published type.
fn the_program_has_a_state(seen: &Json) {
    let value = |path: &str| &seen["values"][format!("Production/ActiveProgram/State/{path}")]["value"];
    let (number, node) = match value("CurrentState").as_str().expect("a state") {
        "Initializing" => (0, 5039),
        "Running" => (1, 5041),
        "Ended" => (2, 5038),
        "Interrupted" => (3, 5040),
        other => panic!("{other} is no state of a program"),
    };
    assert_eq!(value("CurrentState/Number"), number);
    assert!(value("CurrentState/Id").to_string().contains(&node.to_string()), "{}", value("CurrentState/Id"));
}

/// Whoever subscribes to the messages hears an alarm begin and end.
fn alarms_are_events(seen: &Json) {
    let events = seen["events"].as_array().expect("a list");
    let of = |severity: u16| events.iter().filter(|event| event["Severity"] == severity).collect::<Vec<_>>();
    let (raised, cleared) = (of(500), of(1));
    println!("{} alarms began and {} ended in six seconds", raised.len(), cleared.len());
    assert!(!raised.is_empty() && !cleared.is_empty(), "{events:?}");
    for event in raised {
        assert_eq!(event["text"], "the door was opened");
        assert_eq!(event["Identifier"], "door (own.rhai)");
        assert_eq!(event["type"], "GatewayMessageEventType");
    }
}

/// How many changes that the client was told are those of the history, at their time.
fn equal_values(sending: &Sending, seen: &Json) -> u32 {
    let stored = sending.queried("spindle_speed_rpm,spindle_power_w,total_power_w,feed_mm_min");
    let mut compared = 0;
    for (index, change) in seen["changes"].as_array().expect("a list").iter().enumerate() {
        let (name, at_ms) = (change[0].as_str().expect("named"), change[1].as_i64().expect("a time"));
        let Some(points) = stored.get(name) else { panic!("{name} is not in the history") };
        match points.get(&at_ms) {
            Some(stored) => {
                assert_eq!(stored, &change[2], "{name} at {at_ms}");
                compared += 1;
            }
            // The first is what was in force, with the time of the last change.
            None => assert!(change[2].is_null() || index < 4, "{change} is not in the history"),
        }
    }
    assert!(compared > 30, "{compared}");
    compared
}

#[test]
fn whoever_is_not_known_is_refused() {
    if !installed() {
        return;
    }
    let mut served = Served::start();
    let refused = |said: Json, why: &str| {
        println!("{why}: {}", said["error"].as_str().unwrap_or("connected"));
        assert_eq!(said["connected"], false, "{why}");
    };
    refused(served.attempt("known", &LOGIN), "not trusted yet");
    served.trust("known");
    assert_eq!(served.attempt("known", &LOGIN)["connected"], true);
    refused(served.attempt("stranger", &LOGIN), "another certificate");
    refused(served.attempt("expired", &LOGIN), "expired, not trusted");
    served.trust("expired");
    refused(served.attempt("expired", &LOGIN), "expired, though trusted");
    refused(served.attempt("known", &["plant", "wrong"]), "wrong password");
    refused(served.attempt("known", &["nobody", "correct horse"]), "unknown user");
    refused(served.attempt("known", &[]), "anonymous");
    refused(client(&["plain", &served.url]), "without encryption");
    assert_eq!(served.attempt("known", &LOGIN)["connected"], true, "the others have harmed nobody");
    let own = std::fs::read(served.certificates().join("own/cert.der")).expect("its own");
    served.sending.stop();
    served.sending.start();
    served.sending.wait_sink("listening", |sink| sink["state"] == "connected");
    assert_eq!(std::fs::read(served.certificates().join("own/cert.der")).expect("its own"), own);
    assert_eq!(served.attempt("known", &LOGIN)["connected"], true, "after a restart");
    served.sending.stop();
}
