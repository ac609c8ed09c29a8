//! Devices that write otherwise, answer late, answer nonsense or answer somebody else's question.

use crate::huazhong::stand::{SERIAL, source, until};
use adapters::clock::SystemClock;
use adapters::mqtt::{MqttClient, Options, Qos};
use adapters::nclink::topic::Subject;
use adapters::{Absence, Reading, Source, SourceError};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use testkit::broker::Broker;

/// What a scripted device says to a message: topics with payloads.
type Script = Box<dyn FnMut(Subject, &Value) -> Vec<(Subject, Vec<u8>)> + Send>;

/// A device whose every answer is written by the test.
struct Scripted {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Scripted {
    fn start(port: u16, mut script: Script) -> Self {
        let client = MqttClient::connect(&Options::new("127.0.0.1", port, "scripted")).expect("the broker is there");
        let asked = [Subject::Probe, Subject::Query, Subject::Set].map(|subject| subject.build_filter(SERIAL));
        client.subscribe_filters(&asked, Qos::AtMostOnce).expect("granted");
        let stop = Arc::new(AtomicBool::new(false));
        let stopping = stop.clone();
        let thread = std::thread::spawn(move || {
            while !stopping.load(Ordering::SeqCst) {
                let Some(message) = client.receive_message(Duration::from_millis(20)).expect("the broker stays") else {
                    continue;
                };
                let Some((subject, _)) = Subject::from_topic(&message.topic, SERIAL) else { continue };
                let said = serde_json::from_slice(&message.payload).expect("we send JSON");
                for (subject, payload) in script(subject, &said) {
                    client
                        .publish_message(&subject.build_topic(SERIAL), &payload, Qos::AtMostOnce)
                        .expect("the broker stays");
                }
            }
        });
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Scripted {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        self.thread.take().map(JoinHandle::join).expect("running").expect("no panic");
    }
}

fn model(settable: &str, samples: &[&str]) -> Value {
    let ids: Vec<Value> = samples.iter().map(|id| json!({"id": id})).collect();
    json!({"devices": [{"type": "MACHINE", "id": "1",
        "configs": [{"id": "s", "type": "SAMPLE_CHANNEL", "sampleInterval": 1000, "ids": ids}],
        "dataItems": [{"id": "11", "type": "FEED_SPEED", settable: false}, {"id": "12", "type": "PART_COUNT"},
                      {"id": "13", "type": "WARNNING", "source": "CONTROLLER"}]}]})
}

fn probe_answer(said: &Value, model: &Value) -> Vec<(Subject, Vec<u8>)> {
    let answer = json!({"@id": said["@id"], "code": "OK", "probe": model});
    vec![(Subject::ProbeAnswer, answer.to_string().into_bytes())]
}

fn value(readings: &[Reading], channel: &str) -> Result<f64, Absence> {
    let reading = readings.iter().find(|reading| reading.channel.name() == channel).expect(channel);
    reading.value.clone().map(|value| value.as_number().expect("a number"))
}

fn read(source: &mut dyn Source) -> Result<Vec<Reading>, SourceError> {
    let mut out = Vec::new();
    source.read(&SystemClock::new(), &mut out).map(|()| out)
}

/// Answers every item by this rule.
fn each(said: &Value, rule: impl Fn(&str) -> Value) -> Vec<u8> {
    let items = said["ids"].as_array().expect("a list");
    let values: Vec<Value> = items.iter().map(|item| rule(item["id"].as_str().expect("a name"))).collect();
    json!({"@id": said["@id"], "values": values}).to_string().into_bytes()
}

#[test]
fn a_device_that_names_by_path_is_asked_by_path() {
    let Some(broker) = Broker::start() else { return };
    let script = |subject, said: &Value| match subject {
        Subject::Probe => probe_answer(said, &model("settable", &["/MACHINE/FEED_SPEED", "/CONTROLLER/WARNNING"])),
        _ => vec![(
            Subject::QueryAnswer,
            each(said, |id| match id {
                "/FEED_SPEED" => json!({"id": id, "code": "OK", "values": ["1200.5"]}),
                "/PART_COUNT" => json!({"id": id, "value": 9}),
                _ => json!({"id": id, "code": "NG", "reason": "NOT_FOUND"}),
            }),
        )],
    };
    let _device = Scripted::start(broker.port, Box::new(script));
    let readings = read(&mut source(broker.port, "")).expect("read");
    assert_eq!((value(&readings, "feed_mm_min"), value(&readings, "part_count")), (Ok(1200.5), Ok(9.0)));
}

#[test]
fn a_device_that_refuses_its_own_numbers_is_asked_by_path() {
    let Some(broker) = Broker::start() else { return };
    let script = |subject, said: &Value| match subject {
        Subject::Probe => probe_answer(said, &model("setable", &["11"])),
        _ => vec![(
            Subject::QueryAnswer,
            each(said, |id| match id {
                "/FEED_SPEED" => json!({"id": id, "code": "ok", "values": [7]}),
                _ => json!({"id": id, "code": "NG"}),
            }),
        )],
    };
    let _device = Scripted::start(broker.port, Box::new(script));
    let mut source = source(broker.port, "");
    let readings = read(&mut source).expect("read");
    assert_eq!((value(&readings, "feed_mm_min"), value(&readings, "part_count")), (Ok(7.0), Err(Absence::Refused)));
}

#[test]
fn late_foreign_and_senseless_answers_are_not_taken_for_ours() {
    let Some(broker) = Broker::start() else { return };
    let mut late: Option<Vec<u8>> = None;
    let mut queries = 0;
    let script = move |subject, said: &Value| {
        if subject == Subject::Probe {
            return probe_answer(said, &model("setable", &["11"]));
        }
        queries += 1;
        let answer = |value: u32| each(said, |id| json!({"id": id, "code": "OK", "values": [value]}));
        match queries {
            // The first question is answered only together with the second one, before its own answer.
            1 => {
                late = Some(answer(1));
                Vec::new()
            }
            2 => {
                let foreign = json!({"@id": "someone-else", "values": [{"id": "11", "values": [5]}]}).to_string();
                let all = [late.take().unwrap_or_default(), b"{\"@id\":".to_vec(), foreign.into_bytes(), answer(2)];
                all.into_iter().map(|payload| (Subject::QueryAnswer, payload)).collect()
            }
            3 => vec![(Subject::QueryAnswer, b"\xff\xfe not json".to_vec())],
            4 => vec![(
                Subject::QueryAnswer,
                json!({"@id": said["@id"], "code": "NG", "reason": "busy"}).to_string().into_bytes(),
            )],
            5 => vec![(Subject::QueryAnswer, json!({"@id": said["@id"], "values": 3}).to_string().into_bytes())],
            _ => vec![(Subject::QueryAnswer, answer(6))],
        }
    };
    let _device = Scripted::start(broker.port, Box::new(script));
    let mut source = source(broker.port, "");
    let first = read(&mut source).expect_err("not answered in time");
    assert!(matches!(first, SourceError::Timeout { .. }), "{first}");
    assert_eq!(value(&read(&mut source).expect("answered"), "feed_mm_min"), Ok(2.0));
    let third = read(&mut source).expect_err("no JSON");
    assert!(matches!(&third, SourceError::Decode { what, .. } if what.contains("JSON")), "{third}");
    let fourth = read(&mut source).expect_err("refused");
    assert!(matches!(&fourth, SourceError::Refused { what, .. } if what == "busy"), "{fourth}");
    let fifth = read(&mut source);
    assert!(fifth.is_ok_and(|readings| value(&readings, "feed_mm_min") == Err(Absence::NotSupported)));
    assert_eq!(value(&read(&mut source).expect("answered"), "feed_mm_min"), Ok(6.0));
}

#[test]
fn a_model_without_anything_known_is_said_so() {
    let Some(broker) = Broker::start() else { return };
    let strange = json!({"devices": [{"type": "SENSOR", "dataItems": [{"id": "1", "type": "HUMIDITY"}]}]});
    let script = move |_, said: &Value| probe_answer(said, &strange);
    let _device = Scripted::start(broker.port, Box::new(script));
    let error = read(&mut source(broker.port, "")).expect_err("nothing to read");
    assert!(error.to_string().contains("none of its 1 data items"), "{error}");
}

#[test]
fn events_and_samples_without_paths_are_taken() {
    let Some(broker) = Broker::start() else { return };
    let script = |subject, said: &Value| {
        if subject == Subject::Probe {
            return probe_answer(said, &model("setable", &["11", "12"]));
        }
        let event = json!({"@id": "e", "id": "e1", "time": "1700000000000", "event": {"number": 7, "text": "oil low"}});
        let sample = json!({"id": "s", "beginTime": "1700000000000", "data": [{"data": [1, 2]}, {"data": [[], []]}]});
        let answer = each(said, |id| json!({"id": id, "code": "OK", "values": [1]}));
        vec![
            (Subject::Event, event.to_string().into_bytes()),
            (Subject::QueryAnswer, answer),
            (Subject::Sample, sample.to_string().into_bytes()),
        ]
    };
    let _device = Scripted::start(broker.port, Box::new(script));
    let mut source = source(broker.port, "");
    until("the event and the sample", || {
        read(&mut source).expect("read");
        let (events, sampled) = (source.track().event_count(), source.track().channels().count());
        (events > 0 && sampled > 0).then_some(())
    });
    assert_eq!(source.track().events()[0], "7 oil low");
    // Interval and columns come from the model; the same time again is seen as such.
    let (name, track) = source.track().channels().next().expect("sampled");
    assert_eq!((name, track.instants % 2, track.missing), ("s", 0, 0));
    assert_eq!((track.overlapping, source.track().unusable_messages().0), (track.messages - 1, 0));
}
