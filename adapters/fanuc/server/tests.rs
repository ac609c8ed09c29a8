//! Writing to a served simulated control over a real socket: every way of writing, the ladder that fights, the offset.

use crate::{Controller, ServedControl, Server, ServerSettings, SimulatedControl};
use adapter_core::clock::{Clock, ScaledClock, SystemClock};
use adapter_core::driver::{Actuator, LadderRequest, SourceError};
use adapter_core::offset::{Axis, OffsetSink};
use adapter_core::override_pct::OverridePct;
use fanuc::address::parse_fanuc;
use fanuc::item::Area;
use fanuc::line::FanucLine;
use fanuc::open::{OpenedFanuc, open_native};
use fanuc::wire::Number;
use fanuc::work_offset::ExternalOffsets;
use simulated::{Simulated, SimulatedSettings};
use std::net::TcpListener;
use std::sync::Arc;

fn serve(served: Box<dyn ServedControl>) -> Server {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    Server::start(listener, served, ServerSettings::default()).expect("threads")
}

/// A simulated lathe in the middle of its morning, 4 times as fast as real: the 1.5 s in which its ladder wants a
/// heartbeat are long enough for a busy computer.
fn lathe() -> Server {
    lathe_with(4.0, |control| control).0
}

fn lathe_with(times: f64, with: impl FnOnce(SimulatedControl) -> SimulatedControl) -> (Server, Simulated) {
    let clock = Arc::new(ScaledClock::new(times));
    let origin_ns = clock.now_ns() - 1800 * adapter_core::clock::SECOND_NS;
    let machine = Simulated::new("simulated://lathe", SimulatedSettings::default(), origin_ns);
    let server = serve(Box::new(with(SimulatedControl::new(machine.clone(), clock, 4))));
    // The morning is simulated at the first look, which a client must not wait for.
    server.with(|_| ());
    (server, machine)
}

fn dial_at(percent: u8) -> impl FnOnce(SimulatedControl) -> SimulatedControl {
    move |mut control| {
        control.turn_dial(pct(percent));
        control
    }
}

fn opened(server: &Server, keys: &str) -> OpenedFanuc {
    let text = format!("fanuc://{}?{keys}", server.address());
    let target = adapter_core::address::parse(&text, |_| String::new(), |_, body, keys| parse_fanuc(body, keys));
    let target = target.expect("usable");
    open_native(&text, &target.endpoint, target.path, &target.options)
}

fn actuator(server: &Server, keys: &str) -> Box<dyn Actuator> {
    opened(server, keys).actuator.expect("a way of writing")
}

fn pct(percent: u8) -> OverridePct {
    OverridePct::new(percent).expect("exists")
}

fn write(actuator: &mut dyn Actuator, percent: u8) -> Result<OverridePct, SourceError> {
    let clock = SystemClock::new();
    actuator.write_feed_override(&clock, pct(percent))?;
    actuator.read_feed_override(&clock)
}

#[test]
fn an_address_without_a_way_of_writing_has_no_actuator() {
    assert!(opened(&lathe(), "").actuator.is_none());
}

#[test]
fn the_ladder_takes_what_comes_through_the_mailbox() {
    let server = lathe();
    let mut actuator = actuator(&server, "write=mailbox");
    assert_eq!(actuator.read_feed_override(&SystemClock::new()), Ok(OverridePct::FULL), "before the first write");
    assert_eq!(write(actuator.as_mut(), 90), Ok(pct(90)));
    assert_eq!(write(actuator.as_mut(), 80), Ok(pct(80)));
    assert_eq!(write(actuator.as_mut(), 20), Ok(pct(50)), "the ladder has limits of its own");
    let g12 = || server.with(|control| control.map(|control| control.memory.read_byte(Area::G, 12)));
    assert_eq!(g12(), Some(fanuc::feed_override::encode(pct(50))));
    actuator.release_override(&SystemClock::new()).expect("given back");
    std::thread::sleep(std::time::Duration::from_millis(30));
    assert_eq!(g12(), Some(fanuc::feed_override::encode(OverridePct::FULL)));
}

#[test]
fn a_known_dial_is_told_apart_from_what_is_in_force() {
    let (server, _) = lathe_with(4.0, dial_at(80));
    let clock = SystemClock::new();
    let mut actuator = actuator(&server, "write=mailbox&dial=R907");
    assert_eq!(actuator.read_feed_override(&clock), Ok(pct(80)), "the dial alone");
    assert_eq!(actuator.read_dial(&clock), Ok(Some(pct(80))));
    assert_eq!(write(actuator.as_mut(), 110), Ok(pct(80)), "never above the dial");
    let before = server.count_frames();
    actuator.read_feed_override(&clock).expect("answers");
    assert_eq!((actuator.read_dial(&clock), server.count_frames() - before), (Ok(Some(pct(80))), 1), "in one frame");
    assert_eq!(write(actuator.as_mut(), 60), Ok(pct(60)));
    assert_eq!(actuator.read_dial(&clock), Ok(Some(pct(80))), "nobody has turned it");
    actuator.release_override(&clock).expect("given back");
    std::thread::sleep(std::time::Duration::from_millis(30));
    assert_eq!(actuator.read_feed_override(&clock), Ok(pct(80)));
}

#[test]
fn a_product_goes_above_the_dial_where_the_maker_lets_it() {
    let (server, _) = lathe_with(4.0, |control| dial_at(80)(control.with_rule(adapter_core::LadderRule::Product)));
    let mut mailbox = actuator(&server, "write=mailbox&dial=R907");
    assert_eq!(write(mailbox.as_mut(), 120), Ok(pct(96)));
    mailbox.release_override(&SystemClock::new()).expect("given back");
    let mut second = actuator(&server, "write=second_override&dial=G12");
    assert_eq!(write(second.as_mut(), 50), Ok(pct(40)), "80 % of the dial and 50 % of the gateway");
    assert_eq!(second.read_dial(&SystemClock::new()), Ok(Some(pct(80))));
}

#[test]
fn a_feed_hold_is_asked_once_and_the_operator_ends_it() {
    let (server, machine) = lathe_with(60.0, |control| control);
    let clock = SystemClock::new();
    let mut actuator = actuator(&server, "write=mailbox&request=R905");
    let byte = |area, at| server.with(|control| control.expect("on").memory.read_byte(area, at));
    for _ in 0..3 {
        actuator.ask_ladder(&clock, LadderRequest::FeedHold).expect("latched");
    }
    assert_eq!((byte(Area::R, 905), byte(Area::R, 906), byte(Area::G, 8) & 0x20), (0, 1, 0), "*SP is off");
    let run = || server.with(|control| control.expect("on").status.run);
    wait_for("the axes stand", || run() == 2);
    assert_eq!(machine.written().feed_holds, 1, "asked three times, told once");
    wait_for("the operator has acknowledged", || byte(Area::R, 906) == 0);
    assert_eq!(byte(Area::G, 8) & 0x20, 0x20);
    actuator.ask_ladder(&clock, LadderRequest::FeedHold).expect("latched again");
    wait_for("the axes stand again", || run() == 2 && machine.written().feed_holds == 2);
}

#[test]
fn a_stop_lets_the_part_end() {
    let (server, machine) = lathe_with(60.0, |control| control);
    let mut actuator = actuator(&server, "write=mailbox&request=R905");
    actuator.ask_ladder(&SystemClock::new(), LadderRequest::Stop).expect("latched");
    let (run, parts) = (
        || server.with(|control| control.expect("on").status.run),
        || server.with(|control| control.expect("on").parameters[&6711].values[0].mantissa),
    );
    assert_ne!(run(), 1, "not in the middle of a part");
    let before = parts();
    wait_for("the program stands", || run() == 1);
    assert!(parts() > before, "the part was ended");
    assert_eq!(machine.written().stops, 1);
}

#[test]
fn a_request_that_no_rung_latches_is_refused_and_withdrawn() {
    let server = serve(Box::new(Controller::new(4, &['X'])));
    let mut silent = actuator(&server, "write=mailbox&request=D20");
    let error = silent.ask_ladder(&SystemClock::new(), LadderRequest::Stop).expect_err("nobody there").to_string();
    assert!(error.contains("no rung latches the bit of D20 in D21"), "{error}");
    assert_eq!(server.with(|control| control.expect("on").memory.read_byte(Area::D, 20)), 0, "nothing is left on");
    let error =
        actuator(&server, "write=mailbox").ask_ladder(&SystemClock::new(), LadderRequest::Stop).expect_err("no byte");
    assert!(error.to_string().contains("request=R905"), "{error}");
}

/// At most a minute, which is an hour of this machine's.
fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let until = std::time::Instant::now() + std::time::Duration::from_secs(60);
    while !holds() {
        assert!(std::time::Instant::now() < until, "not within a minute: {what}");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
}

#[test]
fn the_second_override_has_a_byte_of_its_own() {
    let server = lathe();
    let mut actuator = actuator(&server, "write=second_override");
    assert_eq!(write(actuator.as_mut(), 70), Ok(pct(70)));
    let g12 = server.with(|control| control.map(|control| control.memory.read_byte(Area::G, 12)));
    assert_eq!(g12, Some(0x9B), "the operator's dial is untouched");
    assert!(matches!(write(actuator.as_mut(), 0), Err(SourceError::Refused { .. })));
    actuator.release_override(&SystemClock::new()).expect("given back");
    std::thread::sleep(std::time::Duration::from_millis(30));
    assert_eq!(actuator.read_feed_override(&SystemClock::new()), Ok(OverridePct::FULL));
}

#[test]
fn a_macro_variable_is_written_and_read_back() {
    let server = serve(Box::new(Controller::new(2, &['X', 'Z'])));
    let mut actuator = actuator(&server, "write=macro&macro=501");
    assert_eq!(actuator.read_feed_override(&SystemClock::new()), Ok(OverridePct::FULL), "vacant");
    assert_eq!(write(actuator.as_mut(), 85), Ok(pct(85)));
    assert_eq!(server.with(|control| control.map(|control| control.macros[&501])), Some(Some(85.0)));
}

#[test]
fn a_direct_write_is_reported_not_held_when_the_ladder_takes_it_back() {
    let server = lathe();
    let mut direct = actuator(&server, "write=direct");
    let error = write(direct.as_mut(), 60).expect_err("the ladder fights").to_string();
    assert!(error.contains("not held") && error.contains("100 %") && error.contains("write=mailbox"), "{error}");
    let without_ladder = serve(Box::new(Controller::new(4, &['X'])));
    assert_eq!(write(actuator(&without_ladder, "write=direct").as_mut(), 60), Ok(pct(60)), "nobody fights");
}

#[test]
fn a_mailbox_that_no_ladder_reads_is_not_held() {
    let server = serve(Box::new(Controller::new(4, &['X'])));
    let error = write(actuator(&server, "write=mailbox").as_mut(), 80).expect_err("nobody there").to_string();
    assert!(error.contains("no ladder reads the mailbox"), "{error}");
}

fn line(server: &Server, keys: &str) -> FanucLine {
    opened(server, keys).line
}

#[test]
fn the_external_offset_is_moved_between_programs_only_and_never_over_what_somebody_has_just_set() {
    let mut control = Controller::new(4, &['X', 'Z']);
    control.offsets_only_at_rest = true;
    control.work_offsets.insert((0, 2), 40);
    let server = serve(Box::new(control));
    let clock = SystemClock::new();
    let mut offsets = ExternalOffsets::new("fanuc://x", line(&server, "write=mailbox&allow=EXT"));
    assert_eq!(offsets.at_rest(&clock, Axis::Z).expect("at rest"), 40.0);
    assert_eq!(offsets.write(&clock, Axis::Z, 40.0, 45.4).expect("at rest"), 45.0, "whole increments");
    server.with(|control| control.expect("on").status.run = 3);
    for error in [offsets.at_rest(&clock, Axis::Z), offsets.write(&clock, Axis::Z, 45.0, 50.0)] {
        let error = error.expect_err("a program runs").to_string();
        assert!(error.contains("a program runs"), "{error}");
    }
    server.with(|control| control.expect("on").status.run = 0);
    server.with(|control| control.expect("on").work_offsets.insert((0, 2), 100));
    let error = offsets.write(&clock, Axis::Z, 45.0, 48.0).expect_err("it is another by now").to_string();
    assert!(error.contains("somebody has just changed it"), "{error}");
    assert_eq!(offsets.at_rest(&clock, Axis::Z).expect("at rest"), 100.0);
    assert!(offsets.at_rest(&clock, Axis::Y).expect_err("a lathe").to_string().contains("no axis of this name"));
}

#[test]
fn the_path_that_is_named_first_is_written_to_on_the_one_connection() {
    let (server, _) = lathe_with(4.0, |control| dial_at(90)(control.with_path()));
    let clock = SystemClock::new();
    let opened = opened(&server, "paths=2,1&write=mailbox&mailbox=R920&dial=R927");
    let mut actuator = opened.actuator.expect("a way of writing");
    assert_eq!(write(actuator.as_mut(), 70), Ok(pct(70)));
    assert_eq!(actuator.read_dial(&clock), Ok(Some(pct(90))));
    let overrides = || {
        let byte = |at| move |control: &mut Controller| control.memory.read_byte(Area::G, at);
        [12, 1012].map(|at| server.with(|control| control.map(byte(at))).map(fanuc::feed_override::decode))
    };
    assert_eq!(overrides(), [Some(pct(90)), Some(pct(70))], "path 1 keeps its dial");
    actuator.release_override(&clock).expect("given back");
    std::thread::sleep(std::time::Duration::from_millis(30));
    assert_eq!(overrides(), [Some(pct(90)); 2]);
    assert_eq!(server.count_opened(), 1, "connections");
    let mut direct = self::actuator(&server, "paths=2,1&write=direct");
    let error = write(direct.as_mut(), 60).expect_err("the ladder of path 2 fights").to_string();
    assert!(error.contains("not held: 60 %"), "{error}");
}

#[test]
fn an_offset_is_shifted_on_the_path_that_is_named_first() {
    let mut control = Controller::new(4, &['X', 'Z']).with_path(&['Z', 'X']);
    control.status.run = 3;
    let server = serve(Box::new(control));
    let clock = SystemClock::new();
    let mut second = opened(&server, "paths=2,1&allow=EXT").offsets.expect("EXT is allowed");
    assert_eq!(second.write(&clock, Axis::Z, 0.0, 5.0), Ok(5.0), "its program does not run");
    let found = server.with(|control| {
        let control = control.expect("on");
        (control.work_offsets.clone(), control.further[0].work_offsets.clone())
    });
    assert_eq!((found.0.len(), found.1.get(&(0, 1))), (0, Some(&5)), "Z is its first axis");
    let mut first = opened(&server, "paths=1,2&allow=EXT").offsets.expect("EXT is allowed");
    first.write(&clock, Axis::Z, 0.0, 5.0).expect_err("its program runs");
}

#[test]
fn what_is_not_allowed_is_not_sent() {
    let server = serve(Box::new(Controller::new(4, &['X', 'Z'])));
    let mut offsets = ExternalOffsets::new("fanuc://x", line(&server, "write=mailbox"));
    let error = offsets.write(&SystemClock::new(), Axis::X, 0.0, 3.0).expect_err("not on the list").to_string();
    assert!(error.contains("allow="), "{error}");
    assert_eq!(server.with(|control| control.map(|control| control.writes)), Some(0));
}

/// Of every axis and of every spindle: the load meter shows an amount.
#[test]
fn no_load_has_a_sign() {
    let mut control = Controller::new(4, &['X', 'Y', 'Z', 'B']);
    let negative = |value| Number::from_decimal(value, 0);
    control.spindles[0].quantities[4] = negative(-41);
    control.spindles.push(control.spindles[0].clone());
    control.spindles[1].quantities[4] = negative(-7);
    for (axis, load) in control.axes.iter_mut().zip([-31, 52, -118, -9]) {
        axis.load = negative(load);
    }
    let server = serve(Box::new(control));
    let mut opened = opened(&server, "spindles=2&axes=B");
    let (clock, mut readings) = (SystemClock::new(), Vec::new());
    opened.sources[0].read(&clock, &mut readings).expect("answers");
    let loads: Vec<(&str, f64)> = readings
        .iter()
        .filter(|reading| reading.channel.name().ends_with("load_pct"))
        .map(|reading| {
            (reading.channel.name(), reading.value.as_ref().expect("a value").as_number().expect("a number"))
        })
        .collect();
    let expected = [
        ("spindle_load_pct", 41.0),
        ("x_axis_load_pct", 31.0),
        ("y_axis_load_pct", 52.0),
        ("z_axis_load_pct", 118.0),
        ("b_axis_load_pct", 9.0),
        ("spindle2_load_pct", 7.0),
    ];
    assert_eq!(loads, expected);
}
