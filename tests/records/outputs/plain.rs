//! Plain topics over TLS with a client certificate, read by mosquitto's own client.

use crate::outputs::certificates::Certificates;
use serde_json::Value as Json;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use testkit::box_under_test::Sending;
use testkit::broker::{Broker, program};

/// `mosquitto_sub`, started again when its broker dies; its lines are `TOPIC PAYLOAD`.
pub(crate) struct Listener {
    child: Arc<Mutex<Option<Child>>>,
    lines: Arc<Mutex<Vec<String>>>,
}

impl Listener {
    pub(crate) fn plain(port: u16) -> Option<Self> {
        Self::start(port, &[])
    }

    fn secured(port: u16, certificates: &Certificates) -> Option<Self> {
        let files = [("--cafile", "ca.pem"), ("--cert", "box.pem"), ("--key", "box.key")];
        Self::start(port, &files.map(|(option, file)| [option.to_owned(), certificates.text(file)]).concat())
    }

    fn start(port: u16, more: &[String]) -> Option<Self> {
        let client = program("mosquitto_sub")?;
        let (port, more) = (port.to_string(), more.to_vec());
        let spawn = move || {
            let mut command = Command::new(&client);
            command.args(["-h", "localhost", "-p", &port, "-t", "works/#", "-v", "-q", "1"]).args(&more);
            command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("mosquitto_sub runs")
        };
        let listener = Self { child: Arc::new(Mutex::new(Some(spawn()))), lines: Arc::default() };
        let (child, lines) = (listener.child.clone(), listener.lines.clone());
        std::thread::spawn(move || {
            loop {
                let output = child.lock().expect("whole").as_mut().and_then(|child| child.stdout.take());
                let Some(output) = output else { return };
                for line in BufReader::new(output).lines().map_while(Result::ok) {
                    lines.lock().expect("whole").push(line);
                }
                std::thread::sleep(Duration::from_millis(20));
                let mut held = child.lock().expect("whole");
                let Some(ended) = held.as_mut() else { return };
                let _status = ended.wait();
                *held = Some(spawn());
            }
        });
        Some(listener)
    }

    /// Every document on any topic.
    fn all(&self) -> Vec<Json> {
        let lines = self.lines.lock().expect("whole").clone();
        lines.iter().filter_map(|line| serde_json::from_str(line.split_once(' ')?.1).ok()).collect()
    }

    pub(crate) fn messages(&self, topic: &str) -> Vec<Json> {
        let of_topic = |line: &String| line.strip_prefix(topic)?.strip_prefix(' ').map(str::to_owned);
        let lines: Vec<String> = self.lines.lock().expect("whole").iter().filter_map(of_topic).collect();
        lines.iter().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.lock().expect("whole").take() {
            let _ended = child.kill();
            let _status = child.wait();
        }
    }
}

#[test]
fn samples_arrive_over_tls_with_a_client_certificate() {
    let Some(certificates) = Certificates::make() else { return };
    let Some(mut broker) = Broker::with(&secured(&certificates, "broker"), |_| {}) else { return };
    let Some(listener) = Listener::secured(broker.port, &certificates) else { return };
    let address = format!("mqtts://localhost:{}/works/lathe?{}&protocol=5", broker.port, own(&certificates));
    let mut sending = Sending::to(&address, "");
    sending.wait_sink("connected", |sink| sink["state"] == "connected");
    sending.wait_sink("some are delivered", |sink| sink["delivered"].as_u64().is_some_and(|count| count > 30));
    let status = sending.sink();
    assert!(status["delay_s"].as_f64().is_some_and(|delay| delay < 3.0), "{status}");
    broker.kill();
    sending.wait_sink("the outage", |sink| sink["failing"] == true && sink["behind_items"].as_u64() > Some(15));
    broker.run();
    // mosquitto_sub connects again by itself.
    let behind =
        sending.wait_sink("all delivered", |sink| sink["failing"] == false && sink["behind_items"].as_u64() < Some(10));
    std::thread::sleep(Duration::from_millis(500));
    sending.stop();
    let samples = listener.messages("works/lathe/sample");
    assert!(samples.len() > 20, "{}", samples.len());
    assert!(samples.iter().all(|sample| sample["machine"] == "Lathe 7" && sample["box"].as_str().is_some()));
    let online = listener.messages("works/lathe/online");
    assert_eq!(online.last().map(|says| says["online"].clone()), Some(Json::from(false)), "{online:?}");
    let stored = sending.queried("spindle_power_w");
    let mut compared = 0;
    for sample in &samples {
        let at_ms = sample["at_ns"].as_i64().expect("a time").div_euclid(1_000_000);
        let values = sample["values"].as_array().expect("values");
        for value in values.iter().filter(|value| value["name"] == "spindle_power_w" && !value["value"].is_null()) {
            assert_eq!(value["unit"], "W");
            assert_eq!(stored["spindle_power_w"].get(&at_ms), Some(&value["value"]), "{sample}");
            compared += 1;
        }
    }
    println!("{} samples, {compared} powers equal to `history query`; after the outage {behind}", samples.len());
    assert!(compared > 10);
}

#[test]
fn a_killed_box_loses_nothing_that_it_remembers() {
    let Some(broker) = Broker::start() else { return };
    let Some(listener) = Listener::plain(broker.port) else { return };
    let address = format!("mqtt://127.0.0.1:{}/works/lathe", broker.port);
    let mut sending = Sending::fast(&address);
    for _ in 0..2 {
        sending.wait_sink("some are delivered", |sink| sink["delivered"].as_u64() > Some(100));
        sending.kill();
        sending.start();
    }
    sending.wait_sink("some are delivered", |sink| sink["delivered"].as_u64() > Some(100));
    sending.wait_sink("nothing waits", |sink| sink["behind_items"].as_u64() < Some(200));
    sending.stop();
    let mut numbers: Vec<u64> = listener.all().iter().filter_map(|item| item["sequence"].as_u64()).collect();
    let arrived = numbers.len();
    numbers.sort_unstable();
    numbers.dedup();
    println!("{} items after two kills, {} came twice", numbers.len(), arrived - numbers.len());
    assert_eq!(numbers, (1..=numbers.len() as u64).collect::<Vec<u64>>(), "no hole");
    assert!(arrived - numbers.len() < 2500, "at most what was sent since the last commit comes twice");
}

/// A listener with this certificate that asks for one.
pub(crate) fn secured(certificates: &Certificates, name: &str) -> String {
    let path = |file: &str| certificates.text(file);
    format!(
        "cafile {}\ncertfile {}\nkeyfile {}\nrequire_certificate true\nallow_anonymous true\nuser root\n",
        path("ca.pem"),
        path(&format!("{name}.pem")),
        path(&format!("{name}.key"))
    )
}

/// Keys of the address of a box that has a certificate.
pub(crate) fn own(certificates: &Certificates) -> String {
    let path = |file: &str| certificates.text(file);
    format!("ca={}&cert={}&key={}", path("ca.pem"), path("box.pem"), path("box.key"))
}
