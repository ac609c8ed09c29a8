//! Several paths over one connection: as few frames as there are for one, each path under its own names.

use crate::fanuc::commands::doctor;
use crate::fanuc::support::{controller, number, opened, poll, serve, text, value};
use crate::fanuc::vendor::{self, library};
use adapters::Absence;
use adapters::fanuc::answer::Alarm;
use adapters::fanuc::item::{Area, BlockWord};
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::{Controller, ServerSettings};
use std::time::Duration;
use testkit::process::{get, wait_for};
use testkit::served::{Serving, armed, channel, prepared, started};

/// The lathe that cuts, with a second turret that does something else.
fn two_paths(version: u16) -> Controller {
    let mut control = controller(version).with_path(&['Z', 'X']);
    let second = &mut control.further[0];
    (second.status.run, second.status.automatic) = (2, 1);
    second.feed = Number::from_decimal(35, 0);
    second.spindles[0].quantities = [7, 4000, 1, 800, 7, 800].map(|value| Number::from_decimal(value, 0));
    second.axes[0].positions[1] = Number::from_decimal(4_500, 3);
    (second.program, second.sequence) = ((2001, 2001), 60);
    second.set_modal_words([(BlockWord::F, 40), (BlockWord::S, 810), (BlockWord::T, 1212)]);
    control.memory.set_byte(Area::G, 1012, !60);
    control.memory.set_byte(Area::G, 1030, 90);
    control
}

#[test]
fn two_paths_travel_in_one_frame_in_all_generations() {
    for version in [2, 3, 4] {
        let server = serve(two_paths(version), ServerSettings::default());
        let mut opened = opened(&server, "paths=1,2");
        let source = opened.sources[0].as_mut();
        poll(source).expect("answers");
        let before = server.count_frames();
        let readings = poll(source).expect("answers");
        let frames = server.count_frames() - before;
        assert_eq!((frames, server.count_opened()), (1, 1), "frames per poll and connections of generation {version}");
        let both = [
            ("spindle_speed_rpm", 1200.0, 800.0),
            ("feed_mm_min", 240.0, 35.0),
            ("feed_programmed_mm_min", 250.0, 40.0),
            ("feed_override_pct", 80.0, 60.0),
            ("spindle_override_pct", 100.0, 90.0),
            ("spindle_load_pct", 41.0, 7.0),
            ("z_axis_position_mm", -12.345, 4.5),
        ];
        for (channel, first, second) in both {
            assert_eq!(number(&readings, channel), first, "{channel} of generation {version}");
            assert_eq!(number(&readings, &format!("path2_{channel}")), second, "path 2, {channel} of {version}");
        }
        let words = [("execution", "ACTIVE", "FEED_HOLD"), ("program", "O1001", "O2001"), ("block", "N120", "N60")];
        for (channel, first, second) in words.into_iter().chain([("tool", "T303", "T1212"), ("alarm", "", "")]) {
            assert_eq!(text(&readings, channel), first);
            assert_eq!(text(&readings, &format!("path2_{channel}")), second);
        }
        assert_eq!(value(&readings, "path2_y_axis_position_mm"), Err(Absence::NotSupported));
        let channels: Vec<_> = readings.iter().map(|reading| reading.channel).collect();
        assert_eq!(channels, source.channels(), "every channel has one reading");
    }
}

#[test]
fn an_alarm_belongs_to_its_path() {
    let server = serve(two_paths(4), ServerSettings::default());
    let mut opened = opened(&server, "paths=1,2");
    poll(opened.sources[0].as_mut()).expect("answers");
    server.with(|control| {
        let second = &mut control.expect("on").further[0];
        second.status.alarm = 1;
        second.alarms = vec![Alarm { number: 501, kind: 4, axis: 1, text: "OVERTRAVEL".into() }];
    });
    let before = server.count_frames();
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    assert_eq!(server.count_frames() - before, 2, "one frame more, for the path that has an alarm");
    assert_eq!(text(&readings, "alarm"), "");
    assert_eq!(text(&readings, "path2_alarm"), "OT0501 (Z) OVERTRAVEL", "the axis is named as path 2 names it");
}

#[test]
fn one_path_of_several_keeps_the_plain_names() {
    let server = serve(two_paths(4), ServerSettings::default());
    let readings = poll(opened(&server, "path=2").sources[0].as_mut()).expect("answers");
    assert_eq!((number(&readings, "spindle_speed_rpm"), text(&readings, "program")), (800.0, "O2001".into()));
    assert_eq!(number(&readings, "feed_override_pct"), 60.0);
    assert!(readings.iter().all(|reading| !reading.channel.name().starts_with("path")));
}

#[test]
fn a_path_that_is_not_there_is_told() {
    let server = serve(two_paths(4), ServerSettings::default());
    let error = poll(opened(&server, "paths=1,2,3").sources[0].as_mut()).expect_err("two only").to_string();
    assert!(error.contains("the controller has 2 path(s)") && error.contains("paths="), "{error}");
}

#[test]
fn the_library_turns_to_each_path() {
    let library = library(&[]);
    let mut opened = vendor::opened_with(&library, "fanuc://fake?paths=1,2");
    for round in 0..3 {
        let readings = poll(opened.sources[0].as_mut()).expect("answers");
        let both = |channel: &str| (number(&readings, channel), number(&readings, &format!("path2_{channel}")));
        assert_eq!(both("spindle_speed_rpm"), (1200.0, 600.0), "round {round}");
        assert_eq!(both("feed_mm_min"), (240.0, 120.0));
        assert_eq!((text(&readings, "program"), text(&readings, "path2_program")), ("O1001".into(), "O2001".into()));
    }
}

#[test]
fn a_box_shows_the_second_turret_of_a_served_machine() {
    let serving = Serving::start(&["--machine", "simulated://lathe?begun_s=600&speed=5", "--paths", "2"]);
    let address = format!("{}?paths=1,2", serving.address);
    let (_, report) = doctor(&[&address]);
    assert_eq!((report["identity"]["paths"].as_f64(), &report["identity"]["path2_axes"]), (Some(2.0), &"X Z".into()));
    let directory = tempfile::tempdir().expect("a directory");
    let config = prepared(directory.path(), "", &format!("[[source]]\naddress = \"{address}\"\n"));
    let (gateway, at) = started(&config);
    let both = wait_for("both paths in the merged sample, cutting", Duration::from_secs(60), || {
        let status = get(&at, "/api/v1/status").json();
        let of = |name: &str| channel(&status, name);
        let (first, second) = (of("feed_mm_min")?.as_f64()?, of("path2_feed_mm_min")?.as_f64()?);
        let programs = (of("program")?, of("path2_program")?);
        (second > 0.0).then_some((first, second, programs))
    });
    println!("feed of path 1 and 2, mm/min, and their programs: {both:?}");
    assert_ne!(both.2.0, both.2.1);
    gateway.stop();
}

/// The gate watches the second path and writes to it; the first one is read besides and left alone.
#[test]
fn the_override_of_the_second_turret_is_written_and_the_first_stays() {
    let serving = Serving::start(&["--machine", "simulated://lathe?begun_s=125", "--paths", "2"]);
    let address = format!("{}?paths=2,1&write=mailbox&mailbox=R920&dial=R927&power_diagnosis=4902", serving.address);
    let directory = tempfile::tempdir().expect("a directory");
    let script = "if has(rapid) && rapid == 0.0 { request_feed_override(60.0, \"gently\"); }";
    let source = format!("[[source]]\naddress = \"{address}\"\nname = \"lathe\"\n");
    let sections = format!("{source}[gate]\nmode = \"armed\"\nsource = \"lathe\"\n");
    let config = prepared(directory.path(), script, &sections);
    let (gateway, at) = started(&config);
    let status = || get(&at, "/api/v1/status").json();
    wait_for("a decision", Duration::from_secs(60), || status()["gate"]["permitted_pct"].is_number().then_some(()));
    armed(&config);
    let (second, first) = wait_for("an override on path 2", Duration::from_secs(150), || {
        let status = status();
        let of = |name: &str| channel(&status, name)?.as_f64();
        (of("feed_override_pct")? <= 61.0).then(|| (of("feed_override_pct"), of("path1_feed_override_pct")))
    });
    println!("override of path 2 {second:?} %, of path 1 {first:?} %");
    assert_eq!(first, Some(100.0));
    gateway.stop();
}
