//! The vendor's library: one with the same functions, compiled here and really loaded in the real child process.

use crate::huazhong::stand::until;
use adapters::address::Endpoint;
use adapters::clock::SystemClock;
use adapters::driver::Actuator;
use adapters::hnc::item::HncItem;
use adapters::hnc::line::{HncLine, HncSettings};
use adapters::hnc::sampling::Sampled;
use adapters::hnc::{HncActuator, HncSource};
use adapters::nclink::mailbox::ControllerRegister;
use adapters::override_pct::OverridePct;
use adapters::{Absence, Reading, Source, SourceError};
use std::sync::mpsc;
use std::time::{Duration, Instant};
use testkit::library::{Library, nothing_is_left, poll_survives};
use testkit::port::free_port;

pub(crate) fn library(flags: &[&str]) -> Library {
    Library::compiled("controllers/huazhong/fake_hnc.c", flags)
}

fn settings(library: &Library) -> HncSettings {
    HncSettings {
        name: "hncnet://fake".to_owned(),
        vendor_library: library.file.clone(),
        endpoint: Endpoint { host: "192.0.2.1".to_owned(), port: 10001 },
        local_host: Some("127.0.0.1".to_owned()),
        local_port: free_port(),
        long_bytes: size_of::<std::ffi::c_long>(),
        deadline: Duration::from_millis(1500),
        program: Some(Library::program()),
        environment: library.environment(),
    }
}

pub(crate) fn line(library: &Library) -> HncLine {
    HncLine::new(settings(library))
}

fn source(library: &Library) -> HncSource {
    HncSource::new(line(library), Duration::from_millis(100), false)
}

fn poll(source: &mut dyn Source) -> Result<Vec<Reading>, SourceError> {
    let mut out = Vec::new();
    source.read(&SystemClock::new(), &mut out).map(|()| out)
}

fn number(readings: &[Reading], channel: &str) -> Result<f64, Absence> {
    let reading = readings.iter().find(|reading| reading.channel.name() == channel).expect(channel);
    reading.value.clone().map(|value| value.as_number().expect("a number"))
}

fn text(readings: &[Reading], channel: &str) -> Result<String, Absence> {
    let reading = readings.iter().find(|reading| reading.channel.name() == channel).expect(channel);
    reading.value.clone().map(|value| value.as_text().expect("a text").to_owned())
}

fn cut(readings: &[Reading]) {
    let numbers = [
        ("feed_mm_min", 812.5),
        ("feed_programmed_mm_min", 1000.0),
        ("spindle_speed_rpm", 2987.25),
        ("spindle_override_pct", 100.0),
        ("part_count", 17.0),
        ("x_axis_position_mm", -12.34567),
        ("z_axis_position_mm", -37.03701),
        ("y_axis_current_a", 2.25),
        ("spindle_current_a", 6.25),
    ];
    for (channel, expected) in numbers {
        assert_eq!(number(readings, channel), Ok(expected), "{channel}");
    }
    let words =
        [("mode", "AUTOMATIC"), ("execution", "ACTIVE"), ("program", "O1234"), ("block", "N340"), ("tool", "T12")];
    for (channel, expected) in words {
        assert_eq!(text(readings, channel).as_deref(), Ok(expected), "{channel}");
    }
}

#[test]
fn the_library_is_loaded_and_gives_values_in_units() {
    let library = library(&[]);
    let mut source = source(&library);
    let readings = poll(&mut source).expect("answers");
    cut(&readings);
    assert_eq!(text(&readings, "alarm").as_deref(), Ok("1010101 机床跑飞车"), "GBK");
    assert_eq!(text(&readings, "operation"), Err(Absence::NotSupported));
    assert_eq!(readings.len(), source.channels().len());
}

#[test]
fn a_library_without_a_function_lacks_its_channels_only() {
    let library = library(&["-DWITHOUT_AXIS"]);
    let readings = poll(&mut source(&library)).expect("answers");
    assert_eq!(number(&readings, "spindle_speed_rpm"), Ok(2987.25));
    assert_eq!(number(&readings, "spindle_current_a"), Err(Absence::NotSupported));
    assert_eq!(number(&readings, "x_axis_position_mm"), Err(Absence::NotSupported));
}

#[test]
fn not_yet_and_refused_never_show_what_was_scribbled() {
    let library = library(&[]);
    let mut source = source(&library);
    cut(&poll(&mut source).expect("well before"));
    library.fault("later HNC_ChannelGetValue");
    let readings = poll(&mut source).expect("the others flow");
    assert_eq!(number(&readings, "spindle_speed_rpm"), Err(Absence::NotYetRead), "not yet is no zero");
    assert_eq!(text(&readings, "mode"), Err(Absence::NotYetRead));
    assert_eq!(number(&readings, "y_axis_current_a"), Ok(2.25));
    for (code, expected) in [(-1, Absence::Refused), (-2, Absence::NotSupported), (77, Absence::Refused)] {
        library.fault(&format!("code HNC_AxisGetValue {code}"));
        let readings = poll(&mut source).expect("the others flow");
        assert_eq!(number(&readings, "spindle_current_a"), Err(expected), "code {code}");
        assert_eq!(number(&readings, "feed_mm_min"), Ok(812.5));
    }
    let line = line(&library);
    library.fault("later HNC_RegGetValue");
    assert!(line.read(HncItem::Register(6, 5)).expect("alive").is_err());
    library.well();
    cut(&poll(&mut source).expect("well afterwards"));
}

/// A fault in one function: its channel has a reason, the others flow; afterwards all is well.
fn survives(kind: &str, reason: Absence) {
    let library = library(&[]);
    let mut source = source(&library);
    cut(&poll(&mut source).expect("well before"));
    let fault = format!("{kind} HNC_FprogGetFullName");
    poll_survives(
        &library,
        &fault,
        || poll(&mut source).expect("the others flow"),
        |readings| {
            assert_eq!(text(readings, "program"), Err(reason), "{kind}");
            assert_eq!(number(readings, "spindle_speed_rpm"), Ok(2987.25));
        },
    );
    until("well again", || poll(&mut source).ok().filter(|readings| text(readings, "program").is_ok()));
}

#[test]
fn a_library_that_hangs_costs_one_channel() {
    survives("hang", Absence::Disconnected);
}

#[test]
fn a_library_that_aborts_costs_one_channel() {
    survives("abort", Absence::Disconnected);
}

#[test]
fn a_library_that_overruns_its_value_costs_one_channel() {
    survives("overrun", Absence::OutOfRange);
}

#[test]
fn absurd_counts_are_bounded() {
    let library = library(&[]);
    let mut source = HncSource::new(line(&library), Duration::from_millis(100), true);
    poll(&mut source).expect("well before");
    library.fault("lots HNC_AlarmGetNum 2000000000");
    let readings = poll(&mut source).expect("answers");
    assert_eq!(text(&readings, "alarm").map(|text| text.matches(';').count()), Ok(15));
    library.fault("lots HNC_SamplGetData 2000000000");
    let error = poll(&mut source).expect_err("points beyond what was asked for");
    assert!(matches!(&error, SourceError::Decode { what, .. } if what.contains("2000000000")), "{error}");
    library.well();
    cut(&poll(&mut source).expect("well afterwards"));
}

#[test]
fn a_dead_link_ends_the_poll_after_one_call() {
    let library = library(&[]);
    let mut settings = settings(&library);
    settings.deadline = Duration::from_millis(4500);
    let mut source = HncSource::new(HncLine::new(settings), Duration::from_millis(100), false);
    cut(&poll(&mut source).expect("well before"));
    library.fault("slow HNC_ChannelGetValue");
    let began = Instant::now();
    let error = poll(&mut source).expect_err("the link is dead");
    assert!(matches!(error, SourceError::Timeout { .. }), "{error}");
    assert!(began.elapsed() < Duration::from_secs(5), "one call of 3 s, not one for each channel");
    library.fault("code HNC_NetIsConnect 7");
    let error = poll(&mut source).expect_err("not connected");
    assert!(error.to_string().contains("connects again by itself"), "{error}");
    library.well();
    cut(&poll(&mut source).expect("well afterwards"));
}

#[test]
fn the_state_of_the_connection_comes_from_the_events() {
    let library = library(&[]);
    let line = line(&library);
    let alive = line.query_connection().expect("connected");
    assert_eq!((alive.connected, alive.lost, alive.generation), (1, 0, 1));
    line.end_child();
    assert_eq!(line.query_connection().expect("connected again").generation, 2);
}

#[test]
fn what_cannot_be_loaded_listened_at_or_connected_says_so() {
    let library = library(&[]);
    let said = |settings: HncSettings| HncLine::new(settings).query_connection().expect_err("it cannot").to_string();
    let absent = HncSettings { vendor_library: "/does/not/exist.so".into(), ..settings(&library) };
    let text = said(absent);
    assert!(text.contains("/does/not/exist.so") && text.contains("library="), "{text}");
    let first = settings(&library);
    let holder = HncLine::new(first.clone());
    holder.query_connection().expect("it listens");
    let text = said(first);
    assert!(text.contains("1009") && text.contains("local_port="), "{text}");
    library.fault("code HNC_NetConnect -1");
    assert!(said(settings(&library)).contains("does not answer"));
    library.fault("abort HNC_NetConnect");
    assert!(said(settings(&library)).contains("signal"));
    library.fault("hang HNC_NetConnect");
    assert!(said(settings(&library)).contains("hung"));
}

#[test]
fn registers_are_written_and_the_override_in_force_is_read_back() {
    let library = library(&[]);
    let line = line(&library);
    let mut actuator = HncActuator::new(line.clone(), ControllerRegister { kind: 'D', index: 100 });
    let clock = SystemClock::new();
    assert_eq!(actuator.read_feed_override(&clock).map(OverridePct::percent), Ok(80));
    let wanted = OverridePct::new(65).expect("exists");
    actuator.write_feed_override(&clock, wanted).expect("written");
    assert_eq!(actuator.read_feed_override(&clock), Ok(wanted));
    let word = |index| line.read(HncItem::Register(6, index)).expect("alive").expect("a value");
    let heartbeat = word(103);
    actuator.write_feed_override(&clock, wanted).expect("written");
    assert_ne!(word(103), heartbeat, "the heartbeat moves with every letter");
    library.fault("code HNC_RegSetValue -4");
    let error = actuator.write_feed_override(&clock, wanted).expect_err("refused");
    assert!(matches!(&error, SourceError::Refused { what, .. } if what.contains("only be read")), "{error}");
    library.fault("later HNC_ChannelGetValue");
    actuator.read_feed_override(&clock).expect_err("not yet is no override of 0 %");
}

#[test]
fn every_sampled_millisecond_comes_once() {
    let library = library(&[]);
    let mut source = HncSource::new(line(&library), Duration::from_millis(100), true);
    let (sender, blocks) = mpsc::channel();
    source.on_block(Box::new(move |block, _| sender.send(block.clone()).expect("the test listens")));
    let end = Instant::now() + Duration::from_secs(3);
    while Instant::now() < end {
        cut(&poll(&mut source).expect("answers"));
        std::thread::sleep(Duration::from_millis(100));
    }
    let blocks: Vec<_> = blocks.try_iter().collect();
    let Sampled { instants, missing, repeated } = source.sampling_counts().expect("it samples");
    assert_eq!((missing, repeated), (0, 0));
    assert!(instants > 2000, "{instants} ms of 3 s");
    for pair in blocks.windows(2) {
        let ended_ms = pair[0].begin_ms + i64::try_from(pair[0].instants).expect("fits");
        assert_eq!(pair[1].begin_ms, ended_ms);
    }
    let current = blocks[0].columns.iter().find(|column| column.path == "AXIS@5/MOTOR/CURRENT").expect("the spindle");
    assert_eq!(current.values[0], Some(6005.0), "type 6 of axis 5, as the library was told");
    println!(
        "1 ms sampling through the library for 3 s: {instants} instants, {missing} missing, {} blocks",
        blocks.len()
    );
}

fn cycles(count: usize) {
    let library = library(&[]);
    let faults = ["abort HNC_NetConnect", "overrun HNC_FprogGetFullName", "code HNC_NetConnect -1"];
    nothing_is_left(&library, count, faults, || {
        let _typed = poll(&mut source(&library));
    });
}

#[test]
fn nothing_is_left_of_sixty_dying_children() {
    cycles(60);
}

/// `cargo test --test controllers huazhong::hnc::nothing_is_left_of_a_thousand -- --ignored --nocapture`
#[test]
#[ignore = "1 minute: 1,000 dying vendor libraries leave no file and no process"]
fn nothing_is_left_of_a_thousand_cycles() {
    cycles(1000);
}
