//! The source against an agent on a real socket.

use crate::address::{MtConnectTarget, parse_mtconnect};
use crate::plan::tests::TURNING_CENTRE;
use crate::scripted_agent::ScriptedAgent;
use crate::source::MtConnectSource;
use adapter_core::address::Keys;
use adapter_core::clock::SystemClock;
use adapter_core::driver::{FactValue, Source, SourceError};
use adapter_core::reading::{Absence, Reading, Value};
use std::time::{Duration, Instant};

fn target(port: u16, device: &str, query: &str) -> MtConnectTarget {
    let mut keys = Keys::from_query(query);
    parse_mtconnect(&format!("//127.0.0.1:{port}/{device}"), &mut keys).expect("usable")
}

fn open(agent: &ScriptedAgent) -> MtConnectSource {
    MtConnectSource::new("mtconnect://test", &target(agent.port, "M1", "period_ms=20&timeout_ms=400"))
}

fn fact(source: &MtConnectSource, name: &str) -> f64 {
    let found = source.collect_facts().into_iter().find(|fact| fact.name == name).expect(name);
    match found.value {
        FactValue::Number(number) => number,
        FactValue::Text(text) => panic!("{name} is {text}"),
    }
}

/// All readings of one channel.
fn values(readings: &[Reading], channel: &str) -> Vec<Result<Value, Absence>> {
    readings.iter().filter(|reading| reading.channel.name() == channel).map(|reading| reading.value.clone()).collect()
}

fn last(readings: &[Reading], channel: &str) -> Option<Result<Value, Absence>> {
    values(readings, channel).pop()
}

fn text(value: &str) -> Option<Result<Value, Absence>> {
    Some(Ok(Value::Text(value.into())))
}

/// Polls until the condition holds; errors of single polls are passed over.
fn poll_until(
    source: &mut MtConnectSource,
    readings: &mut Vec<Reading>,
    holds: impl Fn(&MtConnectSource, &[Reading]) -> bool,
) {
    let (clock, until) = (SystemClock::new(), Instant::now() + Duration::from_secs(10));
    while !holds(source, readings) {
        assert!(Instant::now() < until, "not in time: {:?}; {:?}", source.collect_facts(), source.list_problems());
        let _ = source.read(&clock, readings);
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn read_error(source: &mut MtConnectSource) -> SourceError {
    source.read(&SystemClock::new(), &mut Vec::new()).expect_err("it cannot be read")
}

/// The numbers of a channel, each told once however often it is repeated as before.
fn distinct(readings: &[Reading], channel: &str) -> Vec<f64> {
    let mut numbers: Vec<f64> =
        values(readings, channel).iter().filter_map(|value| value.as_ref().ok()?.as_number()).collect();
    numbers.dedup();
    numbers
}

#[test]
fn values_come_in_the_units_of_the_channels_and_stay_as_they_are() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    {
        let mut state = agent.lock();
        for (element, item, text) in [
            ("Availability", "avail", "AVAILABLE"),
            ("PathFeedrate", "Fact", "20"),
            ("RotaryVelocity", "Srpm", "1500"),
            ("Execution", "exec", "ACTIVE"),
            ("Program", "pgm", "O1 &amp; 2"),
            ("ToolNumber", "tool", "7"),
            ("EmergencyStop", "estop", "ARMED"),
            ("Load", "Sload", "UNAVAILABLE"),
        ] {
            state.observe(element, item, text);
        }
        state.observe_condition("Normal", "sys", "", "");
    }
    let (mut source, mut readings) = (open(&agent), Vec::new());
    source.read(&SystemClock::new(), &mut readings).expect("reads");
    assert_eq!(last(&readings, "feed_mm_min"), Some(Ok(Value::Number(1200.0))));
    assert_eq!(last(&readings, "spindle_speed_rpm"), Some(Ok(Value::Number(1500.0))));
    assert_eq!((last(&readings, "execution"), last(&readings, "program")), (text("ACTIVE"), text("O1 & 2")));
    assert_eq!((last(&readings, "tool"), last(&readings, "alarm")), (text("T7"), text("")));
    assert_eq!(last(&readings, "spindle_load_pct"), Some(Err(Absence::Disconnected)));
    assert_eq!(last(&readings, "mode"), Some(Err(Absence::NotYetRead)));
    assert_eq!(last(&readings, "total_power_w"), Some(Err(Absence::NotSupported)));
    readings.clear();
    agent.lock().observe("Execution", "exec", "FEED_HOLD");
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "execution") == text("FEED_HOLD"));
    assert_eq!(distinct(&readings, "feed_mm_min"), [1200.0]);
    let now_ns = adapter_core::clock::Clock::now_ns(&SystemClock::new());
    assert!(readings.iter().all(|reading| reading.stamp.mid_ns <= now_ns), "no value is of the future");
    assert_eq!(source.query_identity()[0].1, "M1");
    let offers = source.list_offers(&SystemClock::new()).expect("offers");
    let offer = offers.iter().find(|offer| offer.name == "Srpm").expect("offered");
    assert_eq!(
        (offer.says.as_deref(), offer.channel.map(|id| id.name())),
        (Ok("1500 REVOLUTION/MINUTE"), Some("spindle_speed_rpm"))
    );
}

#[test]
fn every_observation_comes_once_through_broken_lines_and_restarts() {
    for streams in [true, false] {
        let agent = ScriptedAgent::start(TURNING_CENTRE);
        agent.lock().streams = streams;
        let (mut source, mut readings) = (open(&agent), Vec::new());
        poll_until(&mut source, &mut readings, |source, _| fact(source, "connections") > 0.0);
        let mut sent = 0.0;
        for round in 0..4 {
            for _ in 0..300 {
                sent += 1.0;
                agent.lock().observe("PathFeedrate", "Fact", &(sent / 60.0).to_string());
            }
            // A line that breaks loses nothing.
            agent.lock().ends_streams = round % 2 == 0;
            poll_until(&mut source, &mut readings, |source, _| fact(source, "observations") >= sent);
            agent.lock().restart();
        }
        let numbers: Vec<f64> = distinct(&readings, "feed_mm_min").into_iter().map(f64::round).collect();
        assert_eq!(numbers, (1..=1200).map(f64::from).collect::<Vec<_>>(), "in parts: {streams}");
        assert_eq!((fact(&source, "observations"), fact(&source, "lost_observations")), (1200.0, 0.0));
        poll_until(&mut source, &mut readings, |source, _| fact(source, "agent_restarts") >= 4.0);
        assert!(source.list_problems().iter().any(|problem| problem.what.contains("started anew")));
    }
}

#[test]
fn what_the_agent_has_overwritten_is_told_with_its_count() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().buffer_size = 100;
    agent.lock().observe("PathFeedrate", "Fact", "1");
    agent.lock().observe_condition("Fault", "sys", "1", "old");
    let (mut source, mut readings) = (open(&agent), Vec::new());
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "alarm") == text("1 old"));
    {
        let mut state = agent.lock();
        state.observe_condition("Normal", "sys", "1", "");
        for number in 0..500 {
            state.observe("PathFeedrate", "Fact", &number.to_string());
        }
    }
    // 501 observations, of which the last hundred are left.
    poll_until(&mut source, &mut readings, |source, _| fact(source, "observations") >= 100.0);
    assert_eq!(
        (fact(&source, "lost_observations"), fact(&source, "gaps"), fact(&source, "observations")),
        (401.0, 1.0, 100.0)
    );
    let told = source.list_problems();
    assert!(
        told.iter().any(|problem| problem.what.contains("401 observations") && problem.next.contains("BufferSize")),
        "{told:?}"
    );
    readings.clear();
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "feed_mm_min") == Some(Ok(Value::Number(499.0 * 60.0)))
    });
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "alarm").is_some());
    assert_ne!(last(&readings, "alarm"), text("1 old"), "the fault ended within the gap");
}

#[test]
fn another_model_after_a_restart_gives_no_value_under_the_old_names() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().observe("PathFeedrate", "Fact", "20");
    let (mut source, mut readings) = (open(&agent), Vec::new());
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "feed_mm_min").is_some());
    readings.clear();
    {
        // The same identifier is the spindle's speed now.
        let mut state = agent.lock();
        state.devices = TURNING_CENTRE.replace("\"Fact\"", "\"other\"").replace("\"Srpm\"", "\"Fact\"");
        state.restart();
        state.observe("RotaryVelocity", "Fact", "1500");
    }
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "spindle_speed_rpm") == Some(Ok(Value::Number(1500.0)))
    });
    assert_eq!(distinct(&readings, "feed_mm_min"), [1200.0], "what was before the restart, and nothing after it");
    assert_eq!(last(&readings, "feed_mm_min"), Some(Err(Absence::NotYetRead)));
    assert_eq!((fact(&source, "model_changes"), fact(&source, "agent_restarts")), (1.0, 1.0));
}

#[test]
fn a_control_that_the_adapter_lost_has_no_values_and_is_not_off() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    // An adapter that never tells its availability has values all the same.
    agent.lock().observe("Availability", "avail", "UNAVAILABLE");
    agent.lock().observe("PathFeedrate", "Fact", "20");
    let (mut source, mut readings) = (open(&agent), Vec::new());
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "feed_mm_min") == Some(Ok(Value::Number(1200.0)))
    });
    agent.lock().observe("Availability", "avail", "AVAILABLE");
    agent.lock().observe("Availability", "avail", "UNAVAILABLE");
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "feed_mm_min") == Some(Err(Absence::Disconnected))
    });
    assert!(source.list_problems().iter().any(|problem| problem.what.contains("AVAILABILITY is UNAVAILABLE")));
    agent.lock().observe("PathFeedrate", "Fact", "10");
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "feed_mm_min") == Some(Ok(Value::Number(600.0)))
    });
    assert!(readings.iter().all(|reading| reading.value != Err(Absence::MachineOff)));
}

#[test]
fn faults_and_warnings_are_told_as_other_controls_tell_them() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().observe_condition("Normal", "sys", "", "");
    agent.lock().observe("EmergencyStop", "estop", "ARMED");
    let (mut source, mut readings) = (open(&agent), Vec::new());
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "alarm") == text(""));
    agent.lock().observe_condition("Fault", "sys", "SV0417", "SERVO ALARM");
    agent.lock().observe_condition("Warning", "Xtravel", "", "near the end");
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "control_warning") == text("near the end"));
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "alarm") == text("SV0417 SERVO ALARM"));
    agent.lock().observe("EmergencyStop", "estop", "TRIGGERED");
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "alarm") == text("EMERGENCY STOP; SV0417 SERVO ALARM")
    });
    agent.lock().observe_condition("Normal", "sys", "", "");
    agent.lock().observe("EmergencyStop", "estop", "ARMED");
    poll_until(&mut source, &mut readings, |_, readings| last(readings, "alarm") == text(""));
}

#[test]
fn a_wrong_device_gets_the_nearest_name_and_several_are_listed() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    let mut source = MtConnectSource::new("t", &target(agent.port, "M11", "timeout_ms=400"));
    let told = read_error(&mut source).to_string();
    assert!(told.contains("no device M11") && told.contains("Did you mean M1?"), "{told}");
    let second = "</Device><Device id=\"d2\" name=\"Mill\" uuid=\"u2\"></Device></Devices>";
    agent.lock().devices = TURNING_CENTRE.replace("</Device></Devices>", second);
    let mut source = MtConnectSource::new("t", &target(agent.port, "", "timeout_ms=400"));
    let told = read_error(&mut source).to_string();
    assert!(told.contains("2 devices: M1, Mill") && told.contains("/DEVICE"), "{told}");
    agent.lock().devices = TURNING_CENTRE.to_owned();
    source.read(&SystemClock::new(), &mut Vec::new()).expect("the only one needs no name");
}

#[test]
fn agents_that_take_no_name_and_agents_that_send_seldom_are_read_at_their_pace() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().takes_names = false;
    agent.lock().least_interval_ms = 150;
    agent.lock().observe("PathFeedrate", "Fact", "20");
    let (mut source, mut readings) = (open(&agent), Vec::new());
    poll_until(&mut source, &mut readings, |source, _| source.achievable_period() > Duration::from_millis(100));
    assert_eq!(last(&readings, "feed_mm_min"), Some(Ok(Value::Number(1200.0))));
    assert_eq!(fact(&source, "connections"), 1.0);
    assert!(agent.lock().requests.iter().any(|path| path.starts_with("/sample?from=")), "{:?}", agent.lock().requests);
}

#[test]
fn an_agent_that_sends_nothing_while_nothing_changes_is_asked_in_the_end() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().has_heartbeat = false;
    let (mut source, mut readings) = (open(&agent), Vec::new());
    poll_until(&mut source, &mut readings, |source, _| {
        source.query_identity().get(4).is_some_and(|(_, way)| way == "a question at every poll")
    });
    agent.lock().observe("PathFeedrate", "Fact", "20");
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "feed_mm_min") == Some(Ok(Value::Number(1200.0)))
    });
    assert_eq!(fact(&source, "observations"), 1.0);
}

#[test]
fn an_agent_that_refuses_parts_is_asked_at_every_poll() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().instead = Some(("interval=", b"HTTP/1.1 400 Bad\r\nContent-Length: 0\r\n\r\n".to_vec()));
    let (mut source, mut readings) = (open(&agent), Vec::new());
    source.read(&SystemClock::new(), &mut readings).expect("reads");
    agent.lock().observe("PathFeedrate", "Fact", "20");
    poll_until(&mut source, &mut readings, |_, readings| {
        last(readings, "feed_mm_min") == Some(Ok(Value::Number(1200.0)))
    });
    assert_eq!(source.query_identity()[4].1, "a question at every poll");
}

#[test]
fn bytes_of_every_kind_are_an_error_that_costs_this_source_only() {
    let http = |head: &str, body: &[u8]| [format!("HTTP/1.1 {head}\r\n\r\n").as_bytes(), body].concat();
    let endless = http("200 OK", &[b'<'; 33 << 20]);
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("probe", b"SSH-2.0-OpenSSH\r\n".to_vec(), "not HTTP"),
        ("probe", http("200 OK\r\nContent-Length: 6", b"<html>"), "ends in the middle"),
        ("probe", http("200 OK\r\nContent-Length: 13", b"<html></html>"), "html"),
        ("probe", http("200 OK\r\nContent-Length: 99", b"<MTConnectDevices>"), "in the middle of the answer"),
        ("probe", http("301 Moved\r\nLocation: https://agent/\r\nContent-Length: 0", b""), "https is not spoken"),
        ("probe", http("200 OK\r\nTransfer-Encoding: chunked", b"zz\r\n"), "chunk"),
        ("probe", http("200 OK\r\nContent-Encoding: x\r\nTransfer-Encoding: gzip", b""), "not asked for"),
        ("probe", endless, "longer than"),
        ("current", http("503 Busy\r\nContent-Length: 0", b""), "HTTP status 503"),
        (
            "current",
            http("200 OK", b"<MTConnectError><Error errorCode=\"QUERY_ERROR\">x</Error></MTConnectError>"),
            "QUERY_ERROR",
        ),
        (
            "sample",
            http(
                "200 OK\r\nContent-Type: text/xml",
                b"<MTConnectError><Error errorCode=\"OUT_OF_RANGE\">y</Error></MTConnectError>",
            ),
            "OUT_OF_RANGE",
        ),
        ("probe", vec![b'x'; 100_000], "not HTTP"),
    ];
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    for (word, bytes, part) in cases {
        agent.lock().instead = Some((word, bytes));
        let told = read_error(&mut open(&agent)).to_string();
        assert!(told.contains(part), "{part}: {told}");
    }
    agent.lock().instead = None;
    open(&agent).read(&SystemClock::new(), &mut Vec::new()).expect("the agent is well again");
}

#[test]
fn an_agent_that_sends_slowly_costs_a_poll_no_more_than_its_deadline() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().slow = Some("current");
    let (mut source, began) = (open(&agent), Instant::now());
    assert!(matches!(read_error(&mut source), SourceError::Timeout { .. }));
    let took = began.elapsed();
    assert!(
        (Duration::from_millis(1500)..Duration::from_millis(2500)).contains(&took),
        "four times the silence: {took:?}"
    );
}

#[test]
fn a_document_of_a_million_observations_is_refused() {
    let one = "<Load dataItemId=\"x\" timestamp=\"t\" sequence=\"1\"/>";
    let body = format!("<MTConnectStreams>{}</MTConnectStreams>", one.repeat(100_001));
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    agent.lock().instead = Some(("current", format!("HTTP/1.1 200 OK\r\n\r\n{body}").into_bytes()));
    let told = read_error(&mut open(&agent)).to_string();
    assert!(told.contains("more than 100000 observations"), "{told}");
}

#[test]
fn a_silent_agent_is_a_timeout_and_one_that_is_not_there_a_broken_line() {
    let agent = ScriptedAgent::start(TURNING_CENTRE);
    let (mut source, mut readings) = (open(&agent), Vec::new());
    agent.lock().silent = Some("probe");
    assert!(matches!(read_error(&mut source), SourceError::Timeout { .. }));
    agent.lock().silent = None;
    poll_until(&mut source, &mut readings, |source, _| fact(source, "connections") > 0.0);
    // Cable pulled: no part comes any more.
    agent.lock().silent = Some("sample");
    let (began, clock) = (Instant::now(), SystemClock::new());
    let error = loop {
        match source.read(&clock, &mut readings) {
            Ok(()) => std::thread::sleep(Duration::from_millis(10)),
            Err(error) => break error,
        }
        assert!(began.elapsed() < Duration::from_secs(3), "silence is noticed");
    };
    assert_eq!(error.to_absence(), Absence::Timeout);
    let closed = std::net::TcpListener::bind(("127.0.0.1", 0)).expect("a port").local_addr().expect("bound").port();
    let mut source = MtConnectSource::new("t", &target(closed, "M1", ""));
    assert!(
        matches!(read_error(&mut source), SourceError::Line { .. }),
        "an agent that is not there says nothing of the machine"
    );
}

#[test]
fn ten_thousand_items_and_texts_of_a_megabyte_are_read() {
    let item = |number: usize| format!("<DataItem category=\"EVENT\" id=\"i{number}\" type=\"x:OWN\"/>");
    let items: String = (0..10_000).map(item).collect();
    let agent = ScriptedAgent::start(&TURNING_CENTRE.replace(
        "<DataItem category=\"EVENT\" id=\"avail\"",
        &format!("{items}<DataItem category=\"EVENT\" id=\"avail\""),
    ));
    agent.lock().observe("Program", "pgm", &"x".repeat(1 << 20));
    agent.lock().observe("PathFeedrate", "Fact", "20");
    let target = target(agent.port, "M1", "period_ms=20");
    let (mut source, mut readings) = (MtConnectSource::new("t", &target), Vec::new());
    source.read(&SystemClock::new(), &mut readings).expect("reads");
    assert_eq!(last(&readings, "feed_mm_min"), Some(Ok(Value::Number(1200.0))));
    let program = readings.iter().find(|reading| reading.channel.name() == "program").expect("told");
    assert_eq!(program.cut_from_bytes(), Some(1 << 20));
    let items = 10_000 + TURNING_CENTRE.matches("<DataItem ").count();
    assert_eq!(source.query_identity()[3].1, items.to_string());
}
