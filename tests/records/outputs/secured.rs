//! What is wrong with a broker is told in one sentence with the next step; polling and rules go on.

use crate::outputs::certificates::Certificates;
use crate::outputs::plain::{own, secured};
use std::net::TcpListener;
use testkit::box_under_test::Sending;
use testkit::broker::Broker;
use testkit::port::free_port;
use testkit::process::{Gateway, program, run, stdout};

/// What `doctor` says of an address that is of no use.
fn said(address: &str) -> String {
    let examined = run(&["doctor", address, "--json"]);
    assert_eq!(examined.status.code(), Some(1), "{address}: {}", stdout(&examined));
    let report: serde_json::Value = serde_json::from_str(&stdout(&examined)).expect("JSON");
    let problem = &report["problems"][0];
    assert!(problem["next"].as_str().is_some_and(|next| !next.is_empty()), "{report}");
    let text =
        format!("{} -> {}", problem["what"].as_str().unwrap_or_default(), problem["next"].as_str().unwrap_or_default());
    println!("{text}");
    text
}

fn tells(address: &str, parts: &[&str]) {
    let text = said(address);
    for part in parts {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
}

#[test]
fn certificates_that_do_not_fit_are_told_apart() {
    let Some(certificates) = Certificates::make() else { return };
    let at = |broker: &Broker, host: &str, keys: &str| format!("mqtts://{host}:{}/works?{keys}", broker.port);
    let own = own(&certificates);
    let Some(broker) = Broker::with(&secured(&certificates, "broker"), |_| {}) else { return };
    let well = run(&["doctor", &at(&broker, "localhost", &own)]);
    assert!(well.status.success(), "{}", stdout(&well));
    let ca = format!("ca={}", certificates.text("ca.pem"));
    tells(&at(&broker, "localhost", &ca), &["client certificate", "cert="]);
    let stranger = format!("ca={}", certificates.text("stranger.pem"));
    tells(&at(&broker, "localhost", &stranger), &["signed by nobody that is trusted", "ca="]);
    let foreign = format!("{ca}&cert={}&key={}", certificates.text("stranger.pem"), certificates.text("stranger.key"));
    tells(&at(&broker, "localhost", &foreign), &["client certificate"]);
    tells(&at(&broker, "localhost", "ca=/does/not/exist.pem"), &["/does/not/exist.pem", "cannot be read"]);
    let plain = format!("mqtt://localhost:{}/works", broker.port);
    tells(&plain, &["TLS"]);
    let Some(other) = Broker::with(&secured(&certificates, "other"), |_| {}) else { return };
    tells(&at(&other, "localhost", &own), &["belongs to another host than localhost"]);
    if certificates.make_expired().is_some() {
        let Some(expired) = Broker::with(&secured(&certificates, "expired"), |_| {}) else { return };
        tells(&at(&expired, "localhost", &own), &["has expired", "date"]);
    }
    if certificates.make_early().is_some() {
        let Some(early) = Broker::with(&secured(&certificates, "early"), |_| {}) else { return };
        tells(&at(&early, "localhost", &own), &["not valid yet", "date"]);
    }
    let Some(open) = Broker::start() else { return };
    tells(&at(&open, "localhost", &own), &["does not speak TLS"]);
}

#[test]
fn a_broker_that_is_not_there_or_does_not_know_us_is_told_apart() {
    tells("mqtt://no-such-host.invalid/works", &["no-such-host.invalid", "broker"]);
    tells(&format!("mqtt://127.0.0.1:{}/works", free_port()), &["refused", "port"]);
    let silent = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = silent.local_addr().expect("bound").port();
    tells(&format!("mqtt://127.0.0.1:{port}/works"), &["did not acknowledge the connection"]);
    let Some(broker) = Broker::with("allow_anonymous false\n", |_| {}) else { return };
    tells(&format!("mqtt://127.0.0.1:{}/works", broker.port), &["refuses", "password"]);
    tells(&format!("mqtt://127.0.0.1:{}/works?user=a&protocol=5", broker.port), &["refuses", "password"]);
}

#[test]
fn addresses_that_cannot_be_used_are_refused_with_what_is_wrong() {
    for (address, part) in [
        ("mqtts://b/p?cert=/a.pem", "key=FILE"),
        ("mqtt://b/p?ca=/a.pem", "unknown key ca"),
        ("mqtt://b/a/+/c", "no beginning of a topic"),
        ("sparkplug://b/group", "GROUP/NODE"),
        ("sparkplug://b/group/no#de", "leave out + and #"),
        ("mqtt://b/p?protocol=4", "3.1.1, 5"),
    ] {
        let examined = run(&["doctor", address]);
        let text = String::from_utf8_lossy(&examined.stderr).into_owned();
        assert!(examined.status.code() == Some(2) && text.contains(part), "{address}: {text}");
    }
}

#[test]
fn what_the_broker_will_never_take_is_left_out_and_the_machine_is_read_on() {
    let Some(broker) = Broker::with("allow_anonymous true\nmax_packet_size 600\n", |_| {}) else { return };
    let mut sending = Sending::to(&format!("mqtt://127.0.0.1:{}/works?protocol=5", broker.port), "");
    let status = sending.wait_sink("some are refused", |sink| sink["refused"].as_u64() > Some(1));
    assert!(status["refusal"].as_str().is_some_and(|why| why.contains("600")), "{status}");
    assert_eq!(status["state"], "connected");
    let (before, source) = (sending.status()["tick"]["count"].as_u64(), sending.status()["sources"][0].clone());
    assert_ne!(source["state"], "failing", "{source}");
    std::thread::sleep(std::time::Duration::from_millis(600));
    assert!(sending.status()["tick"]["count"].as_u64() > before, "the tick goes on");
    sending.stop();
}

#[test]
fn a_box_without_its_broker_polls_decides_and_says_what_to_do() {
    let mut sending = Sending::to(&format!("mqtt://127.0.0.1:{}/works", free_port()), "");
    let status =
        sending.wait_sink("the failure", |sink| sink["failing"] == true && sink["behind_items"].as_u64() > Some(5));
    assert!(status["error"].as_str().is_some_and(|error| error.contains("refused")), "{status}");
    let whole = sending.status();
    assert_ne!(whole["sources"][0]["state"], "failing", "{}", whole["sources"][0]);
    let problems = whole["problems"].as_array().expect("a list");
    assert!(problems.iter().any(|problem| problem["what"].as_str().is_some_and(|what| what.contains("sink plant"))));
    assert_eq!(whole["tick"]["skipped"], 0, "{}", whole["tick"]);
    sending.stop();
}

#[test]
fn nc_link_is_read_over_tls() {
    let Some(certificates) = Certificates::make() else { return };
    let port = free_port();
    let lines = format!("allow_anonymous true\nlistener {port} 127.0.0.1\n{}", secured(&certificates, "broker"));
    let Some(broker) = Broker::with(&lines, |_| {}) else { return };
    let mut device = program();
    device.args(["serve", "nclink", "--machine", "mill", "--serial", "A7"]);
    device.args(["--broker", &format!("127.0.0.1:{}", broker.port)]);
    let mut device = Gateway::spawn(device);
    device.wait_said("serving nclink://");
    let address = format!("nclinks://localhost:{port}/A7?{}", own(&certificates));
    let examined = run(&["doctor", &address, "--json"]);
    let report: serde_json::Value = serde_json::from_str(&stdout(&examined)).expect("JSON");
    assert_eq!(report["reachable"], true, "{report}");
    assert!(report["readings"].as_array().is_some_and(|readings| readings.len() > 3), "{report}");
    let stranger = format!("nclinks://localhost:{port}/A7?ca={}", certificates.text("stranger.pem"));
    tells(&stranger, &["signed by nobody that is trusted", "ca="]);
    device.stop();
}
