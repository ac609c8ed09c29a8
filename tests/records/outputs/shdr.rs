//! SHDR as an agent that is not ours reads it, with the `devices.xml` that the box writes.

use serde_json::Value as Json;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use testkit::box_under_test::Sending;
use testkit::port::free_port;
use testkit::process::{run, stdout, text};

/// What the agent knows after so many seconds; `None` where it is not installed.
fn agent(devices: &Path, port: u16, seconds: f64) -> Option<Json> {
    let has = Command::new("python3").args(["-c", "import mtconnect.agent"]).stderr(Stdio::null()).status();
    if !has.is_ok_and(|status| status.success()) {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "the agent is not installed");
        eprintln!("SKIPPED: the agent is not installed (pip install mtconnect==0.3.3)");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/records/outputs/agent.py");
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
    let conditions = agent["conditions"].as_array().expect("a list");
    assert_eq!(conditions.iter().filter(|condition| condition["level"] == "NORMAL").count(), conditions.len());
    assert!(conditions.iter().any(|condition| condition["name"] == "servo"), "{conditions:?}");
    assert!(
        agent["values"]["block"].as_str().is_some_and(|line| line.parse::<u32>().is_ok()),
        "{}",
        agent["values"]["block"]
    );
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
    while !(heard.contains("* PONG 10000\n") && heard.contains("|avail|AVAILABLE")) {
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

/// The `devices.xml` of a machine of this name that has never run.
fn devices(directory: &Path, name: &str, more: &[&str]) -> (std::path::PathBuf, String) {
    let own = directory.join(name);
    std::fs::create_dir_all(&own).expect("a directory");
    let (config, file) = (own.join("gateway.toml"), own.join("devices.xml"));
    let lines = format!(
        "[gateway]\nname = \"{name}\"\ndata_dir = \"{}\"\n[[source]]\naddress = \"simulated://lathe\"\n",
        text(&own)
    );
    std::fs::write(&config, lines).expect("writable");
    let written = run(&[&["devices", "--config", text(&config), "--out", text(&file)], more].concat());
    assert!(written.status.success(), "{}", testkit::process::stderr(&written));
    let written = std::fs::read_to_string(&file).expect("written");
    (file, written)
}

fn attribute<'a>(document: &'a str, name: &str) -> Vec<&'a str> {
    let mark = format!(" {name}=\"");
    document.split(&mark).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

#[test]
fn two_machines_with_chinese_names_stand_in_one_agent() {
    let directory = tempfile::tempdir().expect("a directory");
    let (first, text_of_first) = devices(directory.path(), "车床一号", &[]);
    assert!(text_of_first.matches("<DataItem ").count() > 30 && text_of_first.contains("type=\"PATH_FEEDRATE\""));
    assert!(text_of_first.contains("nativeUnits=\"MILLIMETER/MINUTE\""), "{text_of_first}");
    let (_, both) = devices(directory.path(), "车床二号", &["--with", text(&first)]);
    let (uuids, mut ids) = (attribute(&both, "uuid"), attribute(&both, "id"));
    let all = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert!(uuids.len() == 2 && uuids[0] != uuids[1], "{uuids:?}");
    assert_eq!(ids.len(), all, "no identifier stands twice");
    assert!(
        both.contains("<Description>车床一号</Description>") && both.contains("<Description>车床二号</Description>")
    );
    let (_, again) = devices(directory.path(), "车床一号", &[]);
    assert_eq!(attribute(&again, "uuid"), attribute(&text_of_first, "uuid"), "the identity stays");
    let (_, named) = devices(directory.path(), "车床一号", &["--prefix", "hall2_"]);
    assert!(attribute(&named, "id").iter().all(|id| id.starts_with("hall2_")));
}

/// Times that an adapter has told, read over its port.
fn times(port: u16, lines: usize) -> Vec<String> {
    let stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a limit");
    let read = std::io::BufRead::lines(std::io::BufReader::new(stream));
    let line = |line: std::io::Result<String>| line.ok()?.split_once('|').map(|(at, _)| at.to_owned());
    read.map_while(line).take(lines).collect()
}

#[test]
fn what_an_agent_is_told_after_a_kill_comes_after_the_moment_of_the_kill() {
    let port = free_port();
    let mut sending = Sending::to(&format!("shdr://127.0.0.1:{port}"), "");
    for _ in 0..2 {
        sending.wait_sink("listening", |sink| sink["delivered"].as_u64() > Some(20));
        let before = times(port, 20);
        sending.kill();
        // As an agent does it: unavailable, with the time of its own clock.
        let killed = gateway::moment::format_utc(adapters::clock::Clock::now_ns(&adapters::clock::SystemClock::new()));
        sending.start();
        testkit::process::wait_for("it listens again", Duration::from_secs(30), || {
            TcpStream::connect(("127.0.0.1", port)).ok()
        });
        let after = times(port, 60);
        assert!(before.is_sorted() && after.is_sorted(), "{before:?} {after:?}");
        assert!(*before.last().expect("some") <= killed && after[0] > killed, "{killed}: {:?}", after[0]);
    }
    sending.stop();
}
