//! The programs as an integrator starts them: one serves the simulated machine as an NC-Link device, the other reads it.

use crate::huazhong::hnc::library;
use std::time::Duration;
use testkit::broker::Broker;
use testkit::port::free_port;
use testkit::process::{Gateway, get, program, run, stderr, stdout, wait_for};

#[test]
fn the_gateway_reads_a_served_machine_through_a_broker() {
    let Some(mut broker) = Broker::start() else { return };
    let at = format!("127.0.0.1:{}", broker.port);
    let mut device = program();
    device.args(["serve", "nclink", "--machine", "mill", "--serial", "A7", "--broker", &at]);
    let mut device = Gateway::spawn(device);
    device.wait_said("serving nclink://");
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("gateway.toml");
    let text = format!("[[source]]\nname = \"cnc\"\naddress = \"nclink://{at}/A7\"\n");
    std::fs::write(&file, text).expect("writable");
    let config = file.to_str().expect("a path");
    let mut gateway = Gateway::start(&directory.path().join("data"), &["--config", config]);
    let page = gateway.address();
    let status = || get(&page, "/api/v1/status").json();
    let tool = || {
        let status = status();
        let channels = status["channels"].as_array()?;
        channels.iter().find(|channel| channel["name"] == "tool")?["value"].as_str().map(str::to_owned)
    };
    assert!(wait_for("a tool", Duration::from_secs(60), tool).starts_with('T'));
    let source = || status()["sources"][0].clone();
    assert_eq!(source()["state"], "reading", "{}", source());
    // The broker dies: the box says so, and reads again when it is back.
    broker.kill();
    wait_for("the failed line", Duration::from_secs(30), || (source()["state"] == "failing").then_some(()));
    assert!(source()["error"].as_str().is_some_and(|error| error.contains("broker")), "{}", source());
    broker.run();
    wait_for("reading again", Duration::from_secs(60), || (source()["state"] == "reading").then_some(()));
    gateway.stop();
    device.stop();
}

#[test]
fn a_device_does_not_listen() {
    let refused = run(&["serve", "nclink", "--listen", "127.0.0.1:1883"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("--broker"), "{}", stderr(&refused));
}

#[test]
fn the_doctor_examines_a_controller_through_the_library() {
    let library = library(&[]);
    let keys = format!("local_host=127.0.0.1&local_port={}&sample=yes", free_port());
    let address = format!("hncnet://192.0.2.1:10001?library={}&{keys}", library.file.display());
    let examined = run(&["doctor", &address, "--json"]);
    let report: serde_json::Value = serde_json::from_str(&stdout(&examined)).expect("JSON");
    assert_eq!(report["reachable"], true, "{report}");
    assert_eq!(
        (&report["identity"]["serial"], &report["identity"]["nc version"]),
        (&"SN848".into(), &"2.31.03".into())
    );
    let readings = report["readings"].as_array().expect("a list");
    let speed = readings.iter().find(|reading| reading["channel"] == "spindle_speed_rpm").expect("read");
    assert_eq!(speed["value"], 2987.25);
    let absent = run(&["doctor", "hncnet://192.0.2.1?library=/does/not/exist.so"]);
    assert_eq!(absent.status.code(), Some(1));
    assert!(
        stdout(&absent).contains("library=") && stdout(&absent).contains("/does/not/exist.so"),
        "{}",
        stdout(&absent)
    );
}
