//! Probe, query, set, faults of the line and of the partner, and how long an answer takes.

use crate::huazhong::stand::{SERIAL, Served, Stand, address, link, source, until};
use adapters::clock::{Clock, SystemClock};
use adapters::nclink::connection::Connection;
use adapters::nclink::{NcLinkAnswer, Params, RequestedItem};
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::{Absence, Reading, Source, SourceError};
use serde_json::json;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};
use testkit::broker::{Broker, program};

fn number(readings: &[Reading], channel: &str) -> Result<f64, Absence> {
    let reading = readings.iter().find(|reading| reading.channel.name() == channel).expect(channel);
    reading.value.clone().map(|value| value.as_number().expect("a number"))
}

fn text(readings: &[Reading], channel: &str) -> String {
    let reading = readings.iter().find(|reading| reading.channel.name() == channel).expect(channel);
    reading.value.clone().ok().and_then(|value| value.as_text().map(str::to_owned)).unwrap_or_default()
}

fn said_no(answer: &Option<NcLinkAnswer>, why: &str) -> bool {
    matches!(answer, Some(Err(reason)) if reason == why)
}

#[test]
fn probe_query_and_set_with_the_simulated_device() {
    let Some(stand) = Stand::start() else { return };
    let mut client = stand.connect();
    let model = client.probe_model().expect("a model");
    assert_eq!(model.name, "simulated lathe");
    assert_eq!(model.samples.iter().map(|channel| channel.interval_ms).collect::<Vec<_>>(), [2000.0, 1.0]);
    let d = model.find_item("CONTROLLER/VARIABLE@REG_D").expect("registers");
    assert!(d.settable && !model.find_item("FEED_OVERRIDE").expect("there").settable);

    let asks = [
        RequestedItem::from_id("010305"),
        RequestedItem::from_id("/CONTROLLER/PROGRAM"),
        RequestedItem::from_id("nothing"),
        RequestedItem::with_elements(&d.id, &[7]),
    ];
    let answers = client.query_values(&asks).expect("answered");
    assert_eq!(answers[0], Some(Ok(vec![json!(100)])), "the override in force");
    assert!(matches!(&answers[1], Some(Ok(values)) if values[0].as_str().is_some_and(|name| name.contains("O"))));
    assert!(said_no(&answers[2], "NOT_FOUND"));
    assert_eq!(answers[3], Some(Ok(vec![json!(0)])));

    // Accepted, and read back; a bit on its own.
    let set = client.set_values(&[RequestedItem::write(&d.id, 7, 40_000)]).expect("answered");
    assert_eq!(set, [Some(Ok(Vec::new()))]);
    let bit = Params { value: Some(json!(1)), index: Some(7), bit: Some(3), ..Params::default() };
    client.set_values(&[RequestedItem { id: d.id.clone(), params: bit }]).expect("answered");
    assert_eq!(
        client.query_values(&[RequestedItem::with_elements(&d.id, &[7])]).expect("answered"),
        [Some(Ok(vec![json!(40_008)]))]
    );

    // Refused, each for its own reason.
    let f = model.find_item("CONTROLLER/VARIABLE@REG_F").expect("registers").id.clone();
    let no_value = RequestedItem {
        id: d.id.clone(),
        params: Params { value: Some(json!("x")), index: Some(7), ..Params::default() },
    };
    let refused = [
        RequestedItem::write("010305", 0, 50),
        RequestedItem::write(&f, 2560, 1),
        RequestedItem::write(&d.id, 9999, 1),
        no_value,
    ];
    let answers = client.set_values(&refused).expect("answered");
    let reasons = ["NOT_SETABLE", "NOT_SETABLE", "INDEX_OUT_OF_RANGE", "NO_VALUE"];
    for (answer, reason) in answers.iter().zip(reasons) {
        assert!(said_no(answer, reason), "{answer:?} for {reason}");
    }
}

#[test]
fn the_source_reads_what_the_machine_does() {
    let Some(stand) = Stand::start() else { return };
    let mut source = stand.source();
    let channels = source.channels().to_vec();
    // Right at the edge of a block the words may belong to the next one: so several polls.
    let agreed = (0..20).filter(|_| {
        std::thread::sleep(Duration::from_millis(30));
        let readings = stand.read(&mut source).expect("read");
        let stamp = readings[0].stamp;
        let moment = stand.machine.moment(stamp.mid_ns);
        assert_eq!(readings.len(), channels.len(), "one reading of every channel");
        assert!(stamp.half_width_ns < 1_000_000_000);
        let speed = number(&readings, "spindle_speed_rpm").expect("a value");
        let near = (speed - moment.truth.spindle_speed_rpm).abs() < 1.0 + 0.05 * speed.abs();
        near && text(&readings, "mode") == moment.panel.mode
            && text(&readings, "execution") == moment.panel.execution
            && text(&readings, "program") == format!("O{}", moment.panel.program)
            && text(&readings, "block") == format!("N{}", moment.panel.block)
            && text(&readings, "tool") == format!("T{}", moment.panel.tool)
            && number(&readings, "y_axis_position_mm") == Err(Absence::NotSupported)
    });
    assert!(agreed.count() >= 12, "the readings are not those of the machine");
}

#[test]
fn a_killed_broker_is_a_failed_line_and_reading_goes_on_after_its_restart() {
    let Some(mut stand) = Stand::start() else { return };
    let mut source = stand.source();
    stand.read(&mut source).expect("read");
    stand.broker.kill();
    let error = stand.read(&mut source).expect_err("no broker");
    assert!(matches!(&error, SourceError::Line { .. }), "{error}");
    assert_eq!(error.to_absence(), Absence::Disconnected);
    let again = stand.read(&mut source).expect_err("still none");
    assert!(again.to_string().contains("no connection to the broker"), "{again}");
    stand.broker.run();
    let began = Instant::now();
    until("reading after the restart", || stand.read(&mut source).ok());
    println!("reading again {:.2} s after the restart of the broker", began.elapsed().as_secs_f64());
    stand.device.wait(2);
}

#[test]
fn a_device_that_is_silent_is_a_timeout_and_is_read_when_it_comes() {
    let Some(broker) = Broker::start() else { return };
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let mut source = source(broker.port, "");
    let mut out = Vec::new();
    let error = source.read(clock.as_ref(), &mut out).expect_err("nobody answers");
    assert!(matches!(&error, SourceError::Timeout { deadline_ms: 2000, .. }), "{error}");
    assert!(error.to_string().contains(SERIAL) && out.is_empty(), "{error}");
    let machine = Simulated::new("simulated://mill", SimulatedSettings::default(), clock.now_ns());
    let device = Served::start(broker.port, &machine, &clock);
    until("the device is read", || source.read(clock.as_ref(), &mut out).ok());
    drop(device);
    let error = source.read(clock.as_ref(), &mut out).expect_err("gone again");
    assert!(matches!(error, SourceError::Timeout { .. }), "{error}");
}

#[test]
fn a_broker_that_wants_a_password_refuses_and_lets_in() {
    let Some(passwd) = program("mosquitto_passwd") else { return };
    let prepare = |directory: &Path| {
        let users = directory.join("users");
        let made = Command::new(passwd).args(["-b", "-c"]).arg(&users).args(["gateway", "secret"]).output();
        assert!(made.expect("it runs").status.success());
        share(directory);
    };
    let Some(broker) = Broker::with("allow_anonymous false\npassword_file {dir}/users\n", prepare) else { return };
    let error = Connection::open(&link(broker.port), false).err().expect("refused");
    assert!(matches!(&error, SourceError::Refused { .. }) && error.to_string().contains("password_file"), "{error}");
    let mut link = link(broker.port);
    link.login = Some(("gateway".to_owned(), "secret".to_owned()));
    Connection::open(&link, false).expect("let in");
}

/// mosquitto gives up root before it reads the password file.
fn share(directory: &Path) {
    use std::os::unix::fs::PermissionsExt;
    let set = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).expect("ours");
    };
    set(directory, 0o755);
    set(&directory.join("users"), 0o644);
}

#[test]
fn another_make_of_client_is_answered() {
    let (Some(publish), Some(subscribe)) = (program("mosquitto_pub"), program("mosquitto_sub")) else { return };
    let Some(stand) = Stand::start() else { return };
    let port = stand.broker.port.to_string();
    let ask = |topic: &str, message: &str, answer: &str| {
        let mut listener = Command::new(&subscribe)
            .args(["-p", &port, "-t", answer, "-C", "1", "-W", "10", "-V", "5"])
            .stdout(std::process::Stdio::piped())
            .spawn()
            .expect("runs");
        // The listener says nothing when it is ready: ask until it has heard.
        until("an answer", || {
            let sent = Command::new(&publish).args(["-p", &port, "-t", topic, "-m", message, "-V", "5"]).status();
            assert!(sent.expect("runs").success());
            std::thread::sleep(Duration::from_millis(50));
            listener.try_wait().expect("ours").map(|_| ())
        });
        let output = listener.wait_with_output().expect("it has ended");
        String::from_utf8(output.stdout).expect("text").trim().to_owned()
    };
    let query = r#"{"@id":"m1","ids":[{"id":"/SPDL_OVERRIDE","params":{"operation":"get_value"}}]}"#;
    let answer = ask(&format!("Query/Request/{SERIAL}/me"), query, &format!("Query/Response/{SERIAL}/me"));
    assert_eq!(answer, r#"{"@id":"m1","values":[{"id":"/SPDL_OVERRIDE","code":"OK","values":[100]}]}"#);
    let set = r#"{"@id":"m2","values":[{"id":"/SPDL_OVERRIDE","params":{"operation":"set_value","value":7}}]}"#;
    let answer = ask(&format!("Set/Request/{SERIAL}"), set, &format!("Set/Response/{SERIAL}"));
    assert_eq!(answer, r#"{"@id":"m2","results":[{"id":"/SPDL_OVERRIDE","code":"NG","reason":"NOT_SETABLE"}]}"#);
    let probe =
        ask(&format!("Probe/Query/Request/{SERIAL}"), r#"{"@id":"m3"}"#, &format!("Probe/Query/Response/{SERIAL}"));
    assert!(probe.starts_with(r#"{"@id":"m3","code":"OK","probe":{"#), "{probe}");
    // Not JSON at all: no answer, and the device lives on.
    let bad = Command::new(&publish).args(["-p", &port, "-t", &format!("Set/Request/{SERIAL}"), "-m", "{"]).status();
    assert!(bad.expect("runs").success());
    stand.connect().probe_model().expect("it lives");
}

#[test]
fn how_long_an_answer_takes() {
    let Some(stand) = Stand::start() else { return };
    let mut client = stand.connect();
    let asks = [
        RequestedItem::from_id("010303"),
        RequestedItem::from_id("010305"),
        RequestedItem::from_id("0103532102"),
        RequestedItem::from_id("0103532103"),
    ];
    let mut took: Vec<Duration> = (0..500)
        .map(|_| {
            let began = Instant::now();
            client.query_values(&asks).expect("answered");
            began.elapsed()
        })
        .collect();
    took.sort_unstable();
    let ms = |at: usize| took[at].as_secs_f64() * 1e3;
    println!("query of 4 items, 500 times: p50 {:.2} ms, p99 {:.2} ms, max {:.2} ms", ms(250), ms(495), ms(499));
    assert!(ms(250) < 35.0, "a delayed acknowledgement costs 40 ms: is TCP_NODELAY on?");
}

#[test]
fn what_cannot_be_opened_says_why() {
    let error =
        adapters::open::open_address(&address(1, "?user=a&password_file=/does/not/exist"), 0).err().expect("no file");
    assert!(error.to_string().contains("/does/not/exist"), "{error}");
    let opened = adapters::open::open_address(&address(1, "?period_ms=250"), 0).expect("opens without a connection");
    assert_eq!(opened.sources[0].period(), Duration::from_millis(250));
    assert!(opened.actuator.is_none(), "nothing is written unless the address names a mailbox");
}
