//! Sparkplug B as a host that is not ours decodes it.

use crate::outputs::decoders::assert_both_read_the_same;
use adapters::channel::{CHANNELS, Form};
use serde_json::Value as Json;
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};
use testkit::box_under_test::Sending;
use testkit::broker::Broker;
use testkit::host::Host;

fn metrics(message: &Json) -> &[Json] {
    message["metrics"].as_array().map_or(&[], Vec::as_slice)
}

fn named<'a>(message: &'a Json, name: &str) -> &'a Json {
    metrics(message).iter().find(|metric| metric["name"] == name).unwrap_or(&Json::Null)
}

/// What a host knows after everything it has heard: values by name and time, numbers of items.
#[derive(Default)]
struct Known {
    names: BTreeMap<u64, String>,
    values: BTreeMap<String, BTreeMap<i64, Json>>,
    items: Vec<(u64, bool)>,
}

impl Known {
    fn of(heard: &[Json]) -> Self {
        let mut known = Self::default();
        for message in heard {
            for metric in metrics(message) {
                known.take(message["kind"] == "DDATA", metric);
            }
        }
        known
    }

    fn take(&mut self, is_data: bool, metric: &Json) {
        let alias = metric["alias"].as_u64().unwrap_or(0);
        if let Some(name) = metric["name"].as_str().filter(|_| alias > 0) {
            let before = self.names.insert(alias, name.to_owned());
            assert!(before.is_none_or(|before| before == name), "alias {alias} changed its name");
        }
        let Some(name) = self.names.get(&alias).filter(|_| is_data) else { return };
        if name == "item/sequence" {
            let number = metric["value"].as_u64().expect("a number");
            self.items.push((number, metric["historical"] == true));
        } else if metric["null"] == false {
            let at_ms = metric["timestamp"].as_i64().expect("a time");
            self.values.entry(name.clone()).or_default().insert(at_ms, metric["value"].clone());
        }
    }
}

/// Births begin at 0, every message counts on by one modulo 256, deaths carry the number of the birth before.
/// Gives the number of births.
fn assert_legal(heard: &[Json]) -> usize {
    let (mut next, mut birth_number, mut births) = (None, None, 0);
    for message in heard {
        let kind = message["kind"].as_str().unwrap_or_default();
        match kind {
            "NBIRTH" => {
                assert_eq!(message["seq"], 0, "{message}");
                birth_number = named(message, "bdSeq")["value"].as_u64();
                assert!(birth_number.is_some(), "{message}");
                (next, births) = (Some(1), births + 1);
            }
            "DBIRTH" | "DDATA" | "DDEATH" => {
                // Before its first birth a host that came late hears data; it would ask for a birth.
                if let Some(expected) = next {
                    assert_eq!(message["seq"].as_u64(), Some(expected), "{kind}: {message}");
                    next = Some((expected + 1) % 256);
                }
            }
            "NDEATH" => {
                assert_eq!(message["seq"], Json::Null, "a death has no number");
                let number = named(message, "bdSeq")["value"].as_u64();
                assert!(birth_number.is_none() || number == birth_number, "{number:?} is not {birth_number:?}");
                next = None;
            }
            _ => {}
        }
    }
    births
}

#[test]
fn another_implementation_decodes_births_and_data_as_history_query_shows_them() {
    let Some(broker) = Broker::start() else { return };
    let Some(mut host) = Host::at(broker.port) else { return };
    let address = format!("sparkplug://127.0.0.1:{}/plant/line-1/lathe-7", broker.port);
    let mut sending = Sending::at_speed("20", &address, "[outbox]\nranges = \"spindle_speed_rpm=0..4500\"\n");
    host.wait("data", |heard| heard.iter().filter(|message| message["kind"] == "DDATA").count() > 400);
    host.ask_rebirth("plant", "line-1");
    let before = host.count("NBIRTH");
    host.wait("the birth that was asked for", |heard| {
        heard.iter().filter(|message| message["kind"] == "NBIRTH").count() > before
    });
    let after = host.count("DDATA");
    host.wait("more data", |heard| heard.iter().filter(|message| message["kind"] == "DDATA").count() > after + 20);
    sending.stop();
    host.wait("the death", |heard| heard.last().is_some_and(|message| message["kind"] == "NDEATH"));
    let heard = host.heard();
    assert_legal(&heard);
    births_say_units_and_ranges(&heard);
    assert_both_read_the_same(&heard);
    let known = Known::of(&heard);
    let names = "spindle_power_w,spindle_speed_rpm,feed_mm_min,machine_state,cutting_power_w";
    let (mut compared, stored) = (0, sending.queried(names));
    for (name, points) in &stored {
        for (at_ms, value) in known.values.get(name).into_iter().flatten() {
            assert_eq!(points.get(at_ms), Some(value), "{name} at {at_ms}");
            compared += 1;
        }
    }
    println!("{compared} values of {} series equal to `history query`", stored.len());
    assert!(compared > 100, "{compared}");
    let numbers: BTreeSet<u64> = known.items.iter().map(|(number, _)| *number).collect();
    assert_eq!(numbers.len(), known.items.len(), "no item comes twice");
}

fn births_say_units_and_ranges(heard: &[Json]) {
    let birth = heard.iter().rfind(|message| message["kind"] == "DBIRTH").expect("born");
    let (mut checked, mut others) = (0, BTreeSet::new());
    for channel in CHANNELS {
        let metric = named(birth, channel.name);
        if metric.is_null() || channel.unit.is_empty() {
            continue;
        }
        let properties = &metric["properties"];
        let datatype = match channel.form {
            Form::Flag => "BOOLEAN",
            Form::Whole => "INT64",
            Form::Real => "DOUBLE",
        };
        assert_eq!(metric["datatype"], datatype, "{metric}");
        let unit = if channel.unit == "1" { Json::Null } else { Json::from(channel.unit) };
        assert_eq!(properties["engUnit"], unit, "a pure number has no unit: {metric}");
        let range = (properties["engLow"].as_f64(), properties["engHigh"].as_f64());
        let expected = match (channel.name, channel.form) {
            ("spindle_speed_rpm", _) => (Some(0.0), Some(4500.0)),
            (_, Form::Flag) => (Some(0.0), Some(1.0)),
            // What is possible on any machine says nothing of this one.
            _ => (None, None),
        };
        assert_eq!(range, expected, "{metric}");
        assert_eq!(properties["description"], channel.en);
        checked += 1;
        if channel.form != Form::Real {
            others.insert(channel.name);
        }
    }
    println!("{checked} channels with type and unit of {} metrics; not Double: {others:?}", metrics(birth).len());
    assert!(checked > 5 && others.contains("coolant_on") && others.contains("part_count"), "{checked} {others:?}");
}

/// How often the broker dies: 200 times by hand, fewer in every run.
fn restarts() -> u32 {
    std::env::var("BROKER_RESTARTS").ok().and_then(|count| count.parse().ok()).unwrap_or(5)
}

#[test]
fn every_restart_of_the_broker_begins_a_legal_sequence_and_nothing_is_lost() {
    let Some(mut broker) = Broker::start() else { return };
    let Some(host) = Host::at(broker.port) else { return };
    let address = format!("sparkplug://127.0.0.1:{}/plant/line-1/lathe-7?host=host", broker.port);
    // About a hundred items a second of ours: while the broker is away more wait than are sent without a gap.
    let mut sending = Sending::at_speed("20", &address, "[outbox]\nevery_nth = 2\n");
    host.wait_more("data", "DDATA", 0);
    let mut took_s = Vec::new();
    for restart in 0..restarts() {
        let began = Instant::now();
        let (connections, births) = (host.count("connected"), host.count("DBIRTH"));
        broker.kill();
        broker.run();
        host.wait_more("the host is back", "connected", connections);
        host.wait_more(&format!("birth after restart {restart}"), "DBIRTH", births);
        let data = host.count("DDATA");
        host.wait_more(&format!("data after restart {restart}"), "DDATA", data);
        took_s.push(began.elapsed().as_secs_f64());
    }
    took_s.sort_by(f64::total_cmp);
    sending.wait_sink("nothing waits", |sink| sink["behind_items"].as_u64().is_some_and(|behind| behind < 400));
    std::thread::sleep(Duration::from_millis(500));
    let status = sending.sink();
    sending.stop();
    let heard = host.heard();
    let births = assert_legal(&heard);
    let known = Known::of(&heard);
    let numbers: BTreeSet<u64> = known.items.iter().map(|(number, _)| *number).collect();
    let (first, last) = (numbers.first().copied().unwrap_or(0), numbers.last().copied().unwrap_or(0));
    let lost = (last + 1).saturating_sub(first) - numbers.len() as u64;
    let twice = known.items.len() - numbers.len();
    let old = known.items.iter().filter(|(_, historical)| *historical).count();
    println!(
        "{} restarts, {births} births of the node, {} items, {old} of them flagged as history, {lost} lost, {twice} sent twice; \
         one restart {:.2} s, the longest {:.2} s; status {status}",
        restarts(),
        numbers.len(),
        took_s[took_s.len() / 2],
        took_s[took_s.len() - 1]
    );
    assert_eq!(lost, 0, "nothing may be lost");
}

/// What the specification asks of an edge node and of its device, message by message; the chapter `conformance` lists the requirements by
/// their names.
fn assert_by_the_book(heard: &[Json]) {
    let mut aliases: BTreeMap<u64, String> = BTreeMap::new();
    let mut dead = true;
    for message in heard {
        let kind = message["kind"].as_str().unwrap_or_default();
        if kind == "connected" || kind == "NCMD" {
            continue;
        }
        assert_eq!(message["retain"], false, "nothing is retained: {message}");
        assert_eq!(message["qos"], if kind == "NDEATH" { 1 } else { 0 }, "{message}");
        assert!(message["timestamp"].as_u64().is_some_and(|at_ms| at_ms > 1_600_000_000_000), "{message}");
        let device = message["topic"].as_str().expect("a topic").split('/').count() == 5;
        assert_eq!(device, kind.starts_with('D'), "{message}");
        match kind {
            "NDEATH" => {
                let names: Vec<&Json> = metrics(message).iter().map(|metric| &metric["name"]).collect();
                assert_eq!((names, &message["seq"]), (vec![&Json::from("bdSeq")], &Json::Null));
            }
            "NBIRTH" => {
                assert_eq!(named(message, "bdSeq")["datatype"], "INT64");
                let rebirth = named(message, "Node Control/Rebirth");
                assert_eq!(
                    (&rebirth["datatype"], &rebirth["value"], &rebirth["alias"]),
                    (&"BOOLEAN".into(), &false.into(), &Json::Null)
                );
                aliases.clear();
            }
            "DBIRTH" => dead = false,
            "DDEATH" => dead = true,
            "DDATA" => assert!(!dead, "data of a device that is dead or not born: {message}"),
            _ => {}
        }
        let births = kind.ends_with("BIRTH");
        for metric in metrics(message) {
            assert!(metric["timestamp"].as_u64().is_some(), "{metric}");
            assert_eq!(
                metric["null"] == true,
                metric["value"].is_null(),
                "null has no value, and the other way round: {metric}"
            );
            let alias = metric["alias"].as_u64().unwrap_or(0);
            if births {
                assert!(metric["typed"] == true && metric["name"].is_string(), "{metric}");
                let name = metric["name"].as_str().expect("named").to_owned();
                assert!(alias == 0 || aliases.insert(alias, name).is_none(), "an alias stands once: {metric}");
            } else if kind == "DDATA" {
                assert!(
                    metric["typed"] == false && metric["name"].is_null() && aliases.contains_key(&alias),
                    "{metric}"
                );
            }
            let quality = &metric["properties"]["Quality"];
            assert!(quality.is_null() || [0, 192, 500].map(Json::from).contains(quality), "{metric}");
        }
    }
}

#[test]
fn the_node_obeys_its_primary_host_and_every_message_is_by_the_book() {
    let Some(broker) = Broker::start() else { return };
    let Some(mut host) = Host::at(broker.port) else { return };
    let address = format!("sparkplug://127.0.0.1:{}/plant/line-1/lathe-7?host=host", broker.port);
    let mut sending = Sending::fast(&address);
    host.wait_more("data", "DDATA", 100);
    // A word that is older than the one by which the host is there changes nothing.
    host.say_state(false, 0);
    let data = host.count("DDATA");
    host.wait_more("data goes on", "DDATA", data + 50);
    assert_eq!(host.count("NDEATH"), 0);
    host.say_state(false, 2_000_000_000_000);
    let began = Instant::now();
    host.wait_more("the death of the node", "NDEATH", 0);
    let death_s = began.elapsed().as_secs_f64();
    std::thread::sleep(Duration::from_secs(2));
    let silent = host.heard();
    assert_eq!(silent.last().expect("heard")["kind"], "NDEATH", "nothing follows the death: {:?}", silent.last());
    let births = host.count("NBIRTH");
    host.say_state(true, 2_000_000_000_001);
    host.wait_more("the node is born again", "NBIRTH", births);
    host.wait("what waited comes", |heard| {
        heard.iter().rev().take(50).flat_map(metrics).any(|metric| metric["historical"] == true)
    });
    sending.stop();
    host.wait("the end", |heard| heard.last().is_some_and(|message| message["kind"] == "NDEATH"));
    let heard = host.heard();
    assert_legal(&heard);
    assert_by_the_book(&heard);
    let numbers: Vec<u64> = heard
        .iter()
        .filter(|message| message["kind"] == "NBIRTH")
        .filter_map(|message| named(message, "bdSeq")["value"].as_u64())
        .collect();
    println!("{} messages by the book; the node died {death_s:.2} s after its host; bdSeq {numbers:?}", heard.len());
}
