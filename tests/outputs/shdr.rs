//! SHDR as an agent that is not ours reads it, with the `devices.xml` that the box writes.

use crate::box_under_test::Sending;
use crate::port::free_port;
use crate::process::{run, stdout, text};
use serde_json::Value as Json;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// What the agent knows after so many seconds; `None` where it is not installed.
fn agent(devices: &Path, port: u16, seconds: f64) -> Option<Json> {
    let has = Command::new("python3").args(["-c", "import mtconnect.agent"]).stderr(Stdio::null()).status();
    if !has.is_ok_and(|status| status.success()) {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "the agent is not installed");
        eprintln!("SKIPPED: the agent is not installed (pip install mtconnect==0.3.3)");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/outputs/agent.py");
    let output =
        Command::new("python3").arg(script).arg(devices).args([port.to_string(), seconds.to_string()]).output();
    let output = output.expect("python3 runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let last = String::from_utf8_lossy(&output.stdout).lines().last().map(str::to_owned).expect("it says something");
    Some(serde_json::from_str(&last).expect("JSON"))
}

#[test]
fn an_agent_reads_the_machine_with_the_devices_that_the_box_wrote() {
    let port = free_port();
    let mut sending = Sending::fast(&format!("shdr://127.0.0.1:{port}"));
    sending.wait_spindle();
    let devices = sending.devices();
    let Some(agent) = agent(&devices, port, 4.0) else { return };
    sending.stop();
    assert_eq!(agent["unknown"], Json::Array(Vec::new()), "every name of the lines stands in devices.xml");
    assert_eq!(agent["pong"], "* PONG 10000");
    assert_eq!(agent["values"]["avail"], "AVAILABLE");
    assert_eq!(agent["conditions"][0]["level"], "NORMAL");
    assert!(agent["assets"].as_array().is_some_and(|assets| !assets.is_empty()), "{}", agent["assets"]);
    let names = "spindle_speed_rpm,spindle_power_w,total_power_w,supply_voltage_v";
    let (stored, mut compared) = (sending.queried(names), 0);
    for pushed in agent["pushed"].as_array().expect("a list") {
        let (name, at, value) = (&pushed[0], &pushed[1], &pushed[2]);
        let Some(points) = name.as_str().and_then(|name| stored.get(name)) else { continue };
        let at_ms = gateway::moment::parse(at.as_str().expect("a time"), 0).expect("RFC 3339").div_euclid(1_000_000);
        // The greeting repeats older values with the time of the newest.
        let Some(Some(stored)) = points.get(&at_ms).map(Json::as_f64) else { continue };
        let sent: f64 = value.as_str().and_then(|value| value.parse().ok()).expect("a number");
        compared += u32::from(sent == stored);
        assert!(sent == stored || compared == 0, "{name} at {at}: {sent} and {stored}");
    }
    println!(
        "{} data items known, {compared} values equal to `history query`",
        agent["known"].as_array().map_or(0, Vec::len)
    );
    assert!(compared > 30, "{compared}");
}

#[test]
fn an_agent_that_sends_nonsense_or_reads_nothing_harms_nobody() {
    let port = free_port();
    let mut sending = Sending::fast(&format!("shdr://127.0.0.1:{port}"));
    sending.wait_sink("listening", |sink| sink["state"] == "connected");
    let mut noisy = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    noisy.write_all(&[b'x'; 5000]).expect("taken");
    let _silent = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    let mut asking = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    asking.set_read_timeout(Some(Duration::from_secs(5))).expect("a limit");
    asking.write_all(b"* PING\r\n").expect("taken");
    let (mut heard, mut buffer) = (String::new(), [0; 4096]);
    while !heard.contains("* PONG 10000\n") {
        let count = asking.read(&mut buffer).expect("in time");
        assert!(count > 0, "closed after {heard}");
        heard += &String::from_utf8_lossy(&buffer[..count]);
    }
    assert!(heard.contains("|avail|AVAILABLE"), "{heard}");
    assert_eq!(sending.sink()["state"], "connected");
    // The port is taken: the doctor says so.
    let examined = run(&["doctor", &format!("shdr://127.0.0.1:{port}")]);
    assert!(stdout(&examined).contains("cannot listen"), "{}", stdout(&examined));
    sending.stop();
}

#[test]
fn the_devices_are_valid_xml_of_everything_before_the_first_run() {
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("devices.xml");
    let written = run(&["devices", "--out", text(&file)]);
    assert!(written.status.success());
    let text = std::fs::read_to_string(&file).expect("written");
    assert!(text.matches("<DataItem ").count() > 30 && text.contains("type=\"PATH_FEEDRATE\""));
    assert!(text.contains("nativeUnits=\"MILLIMETER/MINUTE\""), "{text}");
}
