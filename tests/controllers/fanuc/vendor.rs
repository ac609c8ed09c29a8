//! A library with the vendor's functions, compiled here and really loaded in the real child process.

use crate::fanuc::support::{CUT, controller, number, poll, serve, text, value};
use adapters::address::{Address, Endpoint, FanucOptions, Target};
use adapters::clock::SystemClock;
use adapters::fanuc::focas::Focas;
use adapters::fanuc::item::{Area, FocasItem, Stretch, Write};
use adapters::fanuc::line::Connect;
use adapters::fanuc::open::{self, OpenedFanuc};
use adapters::fanuc::vendor::{Vendor, VendorSettings};
use adapters::fanuc_server::ServerSettings;
use adapters::{Absence, Reading};
use std::net::TcpListener;
use std::time::{Duration, Instant};
use testkit::library::{Library, nothing_is_left, poll_survives};

pub(crate) fn library(flags: &[&str]) -> Library {
    Library::compiled("controllers/fanuc/fake_library.c", flags)
}

pub(crate) fn settings(library: &Library) -> VendorSettings {
    VendorSettings {
        vendor_library: library.file.clone(),
        endpoint: Endpoint { host: "192.0.2.1".to_owned(), port: 8193 },
        path: 1,
        timeout: Duration::from_secs(1),
        encoding: adapters::text::TextEncoding::default(),
        deadline: Some(Duration::from_millis(1500)),
        program: Some(Library::program()),
        environment: library.environment(),
    }
}

fn opened(library: &Library) -> OpenedFanuc {
    opened_with(library, "fanuc://fake")
}

/// With the keys of this address.
pub(crate) fn opened_with(library: &Library, address: &str) -> OpenedFanuc {
    opened_in(settings(library), address)
}

/// With these settings of the child.
pub(crate) fn opened_in(settings: VendorSettings, address: &str) -> OpenedFanuc {
    let connect: Connect = Box::new(move || Ok(Box::new(Vendor::connect(settings.clone())?)));
    let address: Address = address.parse().expect("usable");
    let Target::Fanuc { path, options, .. } = address.target() else { panic!("{address}") };
    let options = FanucOptions { duty_pct: 100, ..(**options).clone() };
    open::open_controller(address.text(), connect, *path, &options)
}

fn cut(readings: &[Reading]) {
    for (channel, expected) in CUT.into_iter().chain([("drive_on", 1.0)]) {
        assert_eq!(number(readings, channel), expected, "{channel}");
    }
    assert_eq!((text(readings, "mode"), text(readings, "execution")), ("AUTOMATIC".into(), "ACTIVE".into()));
    assert_eq!((text(readings, "program"), text(readings, "block")), ("O1001".into(), "N120".into()));
}

#[test]
fn the_library_gives_the_values_that_the_wire_gives() {
    let library = library(&[]);
    let mut opened = opened(&library);
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    cut(&readings);
    assert_eq!((number(&readings, "x_axis_position_mm"), number(&readings, "z_axis_position_mm")), (79.0, -12.345));
    assert_eq!(number(&readings, "z_axis_load_pct"), 17.0, "a load has no sign");
    assert_eq!(value(&readings, "z_axis_current_a"), Err(Absence::NotSupported), "the function is not there");
    let slow = poll(opened.sources[1].as_mut()).expect("answers");
    assert_eq!((number(&slow, "part_count"), number(&slow, "gear_stage")), (17.0, 2.0));
    let facts = opened.sources[0].collect_facts();
    assert!(facts.contains(&adapters::driver::Fact::from_text("series", "G421")), "{facts:?}");

    let server = serve(controller(4), ServerSettings::default());
    let native = poll(crate::fanuc::support::opened(&server, "").sources[0].as_mut()).expect("answers");
    // The functions for these are not in the library of the test.
    let differing = ["x_axis_current_a", "z_axis_current_a", "motor_temperature_c"];
    for (ours, theirs) in native.iter().zip(&readings).filter(|(ours, _)| !differing.contains(&ours.channel.name())) {
        assert_eq!((ours.channel, &ours.value), (theirs.channel, &theirs.value));
    }
}

#[test]
fn one_call_answers_several_questions_and_each_alone_where_it_is_missing() {
    let library = library(&[]);
    let mut opened = opened(&library);
    let source = opened.sources[0].as_mut();
    poll(source).expect("answers");
    library.fault("code cnc_acts 1");
    assert_eq!(number(&poll(source).expect("answers"), "spindle_speed_rpm"), 1200.0, "it came with the positions");
    library.fault("code cnc_rddynamic2 6");
    let readings = poll(source).expect("answers");
    cut(&readings);
    assert_eq!(value(&readings, "x_axis_position_mm"), Err(Absence::NotSupported), "only what comes with nothing else");
    library.fault("abort cnc_rddynamic2");
    cut(&poll(source).expect("not asked any more"));
}

#[test]
fn a_library_without_a_function_lacks_its_channels_only() {
    let library = library(&["-DWITHOUT_SERVO_METER"]);
    let mut opened = opened(&library);
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    cut(&readings);
    assert_eq!(value(&readings, "z_axis_load_pct"), Err(Absence::NotSupported));
    assert_eq!(value(&readings, "z_axis_position_mm"), Err(Absence::NotSupported), "no function names the axes");
}

#[test]
fn a_code_other_than_zero_never_shows_what_was_scribbled() {
    let library = library(&[]);
    let mut opened = opened(&library);
    let cases = [(-1, Absence::Refused), (6, Absence::NotSupported)];
    for (code, expected) in cases {
        library.fault(&format!("code cnc_rdspmeter {code}"));
        let readings = poll(opened.sources[0].as_mut()).expect("the others flow");
        assert_eq!(value(&readings, "spindle_load_pct"), Err(expected), "code {code}");
        assert_eq!(number(&readings, "feed_mm_min"), 240.0);
    }
    library.fault("code cnc_statinfo -16");
    assert!(poll(opened.sources[0].as_mut()).is_err(), "the connection is dead");
    library.well();
    cut(&poll(opened.sources[0].as_mut()).expect("a new connection"));
}

/// A fault in one function: the channel has a reason, the others flow, in the same poll; afterwards all is well.
fn survives(kind: &str, within: Duration, reason: Absence) {
    let library = library(&[]);
    let mut opened = opened(&library);
    let source = opened.sources[0].as_mut();
    let fault = format!("{kind} cnc_rdspmeter");
    cut(&poll(source).expect("well before"));
    let took = poll_survives(
        &library,
        &fault,
        || poll(source).expect("the others flow"),
        |readings| {
            assert_eq!(value(readings, "spindle_load_pct"), Err(reason), "{kind}");
            assert_eq!((number(readings, "spindle_speed_rpm"), text(readings, "program")), (1200.0, "O1001".into()));
        },
    );
    assert!(took < within, "{kind}: the child was back after {took:?}");
    cut(&poll(source).expect("well afterwards"));
    library.fault(&fault);
    poll(source).expect("the second time");
    let began = Instant::now();
    let readings = poll(source).expect("left alone by now");
    assert_eq!(value(&readings, "spindle_load_pct"), Err(Absence::NotSupported));
    assert!(began.elapsed() < Duration::from_secs(1), "no child is risked for it any more");
}

#[test]
fn a_library_that_hangs_costs_one_channel() {
    survives("hang", Duration::from_secs(5), Absence::Disconnected);
}

#[test]
fn a_library_that_aborts_costs_one_channel() {
    survives("abort", Duration::from_secs(5), Absence::Disconnected);
}

#[test]
fn a_library_that_overruns_its_structure_costs_one_channel() {
    survives("overrun", Duration::from_secs(5), Absence::OutOfRange);
}

#[test]
fn what_cannot_be_loaded_or_connected_says_so() {
    let library = library(&[]);
    let refused = |settings| Vendor::connect(settings).err().map(|error| error.to_string()).unwrap_or_default();
    let absent = VendorSettings { vendor_library: "/does/not/exist.so".into(), ..settings(&library) };
    let text = refused(absent);
    assert!(text.contains("/does/not/exist.so"), "{text}");
    // The library has one code for every connection that fails.
    library.fault("code cnc_allclibhndl3 -16");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("bound").port();
    let local = || VendorSettings { endpoint: Endpoint { host: "127.0.0.1".to_owned(), port }, ..settings(&library) };
    let text = refused(local());
    assert!(text.contains("no answer"), "it accepts and is silent: {text}");
    drop(listener);
    let text = refused(local());
    assert!(text.contains("nobody") || text.contains("refuse"), "nobody listens: {text}");
    library.fault("abort cnc_allclibhndl3");
    let text = refused(settings(&library));
    assert!(text.contains("ended") && text.contains("signal"), "{text}");
    library.fault("hang cnc_allclibhndl3");
    assert!(refused(settings(&library)).contains("killed"));
}

#[test]
fn what_is_written_is_read_back_through_the_library() {
    let library = library(&[]);
    let mut vendor = Vendor::connect(settings(&library)).expect("connects");
    let stretch = Stretch::from_byte_range(Area::R, 900, 3);
    vendor.write(&Write::Pmc { stretch, values: vec![0xA5, 80, 7] }).expect("written");
    vendor.write(&Write::Macro { number: 500, mantissa: -25, places: 1 }).expect("written");
    let mut out = Vec::new();
    vendor
        .ask_questions(&[FocasItem::Pmc(stretch).to_question(1), FocasItem::Macro(500).to_question(1)], &mut out)
        .expect("answers");
    let expected = [
        adapters::fanuc::answer::FocasAnswer::Memory(vec![0xA5, 80, 7]),
        adapters::fanuc::answer::FocasAnswer::Number(Some(-2.5)),
    ];
    assert_eq!(out.into_iter().map(|result| result.expect("a value")).collect::<Vec<_>>(), expected);
}

fn cycles(count: usize) {
    let library = library(&[]);
    let clock = SystemClock::new();
    nothing_is_left(
        &library,
        count,
        ["abort cnc_exeprgname", "overrun cnc_statinfo", "code cnc_rddynamic2 -16"],
        || {
            let mut opened = opened(&library);
            let mut out = Vec::new();
            let _typed = opened.sources[0].read(&clock, &mut out);
            library.well();
            assert_eq!(number(&poll(opened.sources[0].as_mut()).expect("well again"), "spindle_load_pct"), 41.0);
        },
    );
}

#[test]
fn nothing_is_left_of_dying_children() {
    cycles(150);
}

/// `cargo test --test controllers fanuc::vendor::nothing_is_left_of_a_thousand -- --ignored --nocapture`
#[test]
#[ignore = "15 seconds: 1,000 dying vendor libraries leave no file and no process"]
fn nothing_is_left_of_a_thousand_cycles() {
    cycles(1000);
}
