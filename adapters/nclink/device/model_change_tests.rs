//! A device that has another model from one moment to the next, at a real broker: no value of the client's is one of the other model.

use adapter_core::clock::SystemClock;
use adapter_core::driver::Source;
use adapter_core::reading::Reading;
use mqtt::{MqttClient, Options, Qos};
use nclink::NcLinkSource;
use nclink::address::{NcLinkTarget, parse_nclink};
use serde_json::{Value, json};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

const SERIAL: &str = "CHANGES";
/// The model changes so often; how long after a poll differs each time.
const MOMENTS: u32 = 20;

struct Broker {
    child: Child,
    port: u16,
}

impl Broker {
    fn start() -> Option<Self> {
        let program =
            ["/usr/sbin/mosquitto", "/usr/bin/mosquitto"].into_iter().find(|file| std::path::Path::new(file).is_file());
        let Some(program) = program else {
            assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "mosquitto is not installed");
            eprintln!("SKIPPED: mosquitto is not installed");
            return None;
        };
        let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address").port();
        let mut command = Command::new(program);
        command.args(["-p", &port.to_string()]).stdout(Stdio::null()).stderr(Stdio::null());
        let broker = Self { child: command.spawn().expect("mosquitto starts"), port };
        let until = Instant::now() + Duration::from_secs(10);
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(Instant::now() < until, "mosquitto does not listen");
            std::thread::sleep(Duration::from_millis(20));
        }
        Some(broker)
    }
}

impl Drop for Broker {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Even models tell um, mm/s and r/s, odd ones mm, mm/min and rpm, and X and Y have changed places. The machine is the same.
fn model(version: u32) -> Value {
    let odd = version % 2 == 1;
    let unit = |even: &str, other: &str| if odd { other.to_owned() } else { even.to_owned() };
    let axis = |number: &str, name: &str, id: &str| {
        json!({"type": "AXIS", "number": number, "configs": [{"id": format!("n{number}"), "type": "NAME", "value": name}],
               "components": [{"type": "SCREW", "dataItems": [{"id": id, "type": "POSITION", "units": unit("um", "mm")}]}]})
    };
    let (x, y) = if odd { ("p2", "p1") } else { ("p1", "p2") };
    json!({"devices": [{"type": "MACHINE",
        "dataItems": [{"id": "f", "type": "FEED_SPEED", "units": unit("mm/s", "mm/min")}],
        "components": [axis("0", "X", x), axis("1", "Y", y),
            {"type": "AXIS", "number": "5", "configs": [{"id": "n5", "type": "NAME", "value": "S"}],
             "components": [{"type": "MOTOR", "dataItems": [{"id": "s", "type": "SPEED", "units": unit("r/s", "rpm")}]}]}]}]})
}

fn answer(version: u32, id: &str) -> Value {
    let odd = version % 2 == 1;
    match (id, odd) {
        ("f", false) => json!(20),
        ("f", true) => json!(1200),
        ("s", false) => json!(25),
        ("s", true) => json!(1500),
        ("p1", false) => json!(123_456.7),
        ("p2", false) => json!(-55_500),
        ("p2", true) => json!(123.4567),
        _ => json!(-55.5),
    }
}

/// What is true whatever the model, in the units of the channels.
const TRUE: [(&str, f64); 4] = [
    ("feed_mm_min", 1200.0),
    ("spindle_speed_rpm", 1500.0),
    ("x_axis_position_mm", 123.4567),
    ("y_axis_position_mm", -55.5),
];

fn serve_device(port: u16, wanted: &AtomicU32, stop: &AtomicBool) {
    let client = MqttClient::connect(&Options::new("127.0.0.1", port, "device")).expect("the broker is there");
    let filters = [format!("Probe/Query/Request/{SERIAL}/#"), format!("Query/Request/{SERIAL}/#")];
    client.subscribe_filters(&filters, Qos::AtMostOnce).expect("subscribed");
    let send = |topic: &str, said: &Value| {
        client.publish_message(topic, said.to_string().as_bytes(), Qos::AtMostOnce).expect("the broker is there");
    };
    let mut version = 0;
    while !stop.load(Ordering::SeqCst) {
        let message = client.receive_message(Duration::from_millis(1)).expect("the broker is there");
        if wanted.load(Ordering::SeqCst) != version {
            version = wanted.load(Ordering::SeqCst);
            send("Register/Request", &json!({"@id": "r", "guid": SERIAL, "type": "CNC"}));
        }
        let Some(message) = message else { continue };
        let asked: Value = serde_json::from_slice(&message.payload).expect("JSON");
        if message.topic.starts_with("Probe/") {
            let said = json!({"@id": asked["@id"], "code": "OK", "probe": model(version)});
            send(&format!("Probe/Query/Response/{SERIAL}"), &said);
            continue;
        }
        let of = |one: &Value| {
            let id = one["id"].as_str().unwrap_or_default();
            json!({"id": id, "code": "OK", "values": [answer(version, id)]})
        };
        let values: Vec<Value> = asked["ids"].as_array().expect("a list").iter().map(of).collect();
        send(&format!("Query/Response/{SERIAL}"), &json!({"@id": asked["@id"], "values": values}));
    }
}

fn target(port: u16) -> NcLinkTarget {
    let mut keys = adapter_core::address::Keys::from_query("");
    parse_nclink(&format!("//127.0.0.1:{port}/{SERIAL}"), &mut keys, false).expect("an address")
}

#[test]
fn no_value_is_read_with_the_model_before() {
    let Some(broker) = Broker::start() else { return };
    let (wanted, stop) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicBool::new(false)));
    let device = {
        let (port, wanted, stop) = (broker.port, wanted.clone(), stop.clone());
        std::thread::spawn(move || serve_device(port, &wanted, &stop))
    };
    let mut source = NcLinkSource::new("nclink", &target(broker.port), None);
    let clock = SystemClock::default();
    let (mut right, mut absent, mut wrong) = (0, 0, Vec::new());
    let until = Instant::now() + Duration::from_secs(20);
    while source.read(&clock, &mut Vec::new()).is_err() {
        assert!(Instant::now() < until, "the device does not answer");
    }
    for moment in 1..=MOMENTS {
        wanted.store(moment, Ordering::SeqCst);
        std::thread::sleep(Duration::from_micros(u64::from(moment) * 400));
        for _ in 0..15 {
            let mut readings: Vec<Reading> = Vec::new();
            if source.read(&clock, &mut readings).is_err() {
                absent += TRUE.len();
                continue;
            }
            for (name, truth) in TRUE {
                let reading = readings.iter().find(|reading| reading.channel.name() == name).expect("one reading");
                match reading.value.as_ref().ok().and_then(|value| value.as_number()) {
                    Some(number) if (number - truth).abs() < 1e-6 * truth.abs() => right += 1,
                    Some(number) => wrong.push(format!("{name} {number} at {moment}")),
                    None => absent += 1,
                }
            }
        }
    }
    stop.store(true, Ordering::SeqCst);
    device.join().expect("the device does not panic");
    eprintln!("{right} right, {absent} absent, {} wrong in {MOMENTS} changes of the model", wrong.len());
    assert_eq!(wrong, Vec::<String>::new());
    assert!(right >= 1000, "{right} right, {absent} absent");
    let facts = format!("{:?}", source.collect_facts());
    assert!(facts.contains("model_changes\", value: Number(20.0)"), "{facts}");
}
