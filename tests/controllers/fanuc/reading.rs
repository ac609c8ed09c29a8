//! What the channels say, for three generations.

use crate::fanuc::support::{CUT, address, controller, number, opened, poll, serve, text, value};
use adapters::fanuc::answer::{Alarm, SpeedUnit};
use adapters::fanuc::item::Area;
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::ServerSettings;
use adapters::open::open_address;
use adapters::{Absence, SourceError};

#[test]
fn every_channel_of_a_cut_in_all_generations() {
    for version in [2, 3, 4] {
        let server = serve(controller(version), ServerSettings::default());
        let mut opened = opened(&server, "");
        let readings = poll(opened.sources[0].as_mut()).expect("answers");
        let numbers = [
            ("x_axis_position_mm", 79.0),
            ("z_axis_position_mm", -12.345),
            ("z_axis_load_pct", 17.0),
            ("z_axis_current_a", 3.1),
            ("rapid", 0.0),
            ("drive_on", 1.0),
        ];
        for (channel, expected) in CUT.into_iter().chain(numbers) {
            assert_eq!(number(&readings, channel), expected, "{channel} of generation {version}");
        }
        let words = [("mode", "AUTOMATIC"), ("execution", "ACTIVE"), ("program", "O1001"), ("block", "N120")];
        for (channel, expected) in words.into_iter().chain([("tool", "T303"), ("alarm", ""), ("motion", "MOTION")]) {
            assert_eq!(text(&readings, channel), expected, "{channel} of generation {version}");
        }
        assert_eq!(value(&readings, "y_axis_position_mm"), Err(Absence::NotSupported), "a lathe has no Y");
        let slow = poll(opened.sources[1].as_mut()).expect("answers");
        assert_eq!((number(&slow, "part_count"), number(&slow, "gear_stage")), (17.0, 2.0));
        assert_eq!(number(&readings, "motor_temperature_c"), 48.0);
        assert_eq!((server.count_opened(), server.count_sessions()), (1, 1), "both groups share one connection");
        assert_eq!(server.count_frames(), 3, "the facts once, then one round trip per group");
    }
}

#[test]
fn what_one_control_does_not_have_does_not_disturb_the_rest() {
    let server = serve(controller(4), ServerSettings::default());
    server.with(|control| control.expect("on").refusals.extend([(0x56, (6, 0)), (0xCF, (1, 0)), (0x22, (-1, 0))]));
    let mut opened = opened(&server, "");
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    assert_eq!(value(&readings, "z_axis_load_pct"), Err(Absence::NotSupported), "the option is missing");
    assert_eq!(text(&readings, "program"), "O1001", "the number stands in for the name");
    assert_eq!(value(&readings, "tool"), Err(Absence::Refused), "busy just now");
    assert_eq!(number(&readings, "spindle_speed_rpm"), 1200.0);
    server.with(|control| control.expect("on").refusals.clear());
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    assert_eq!(value(&readings, "z_axis_load_pct"), Err(Absence::NotSupported), "not asked for again");
    assert_eq!(text(&readings, "tool"), "T303", "asked for again");
}

#[test]
fn the_power_that_a_drive_shows_of_itself_is_read_where_the_address_says_so() {
    let mut control = controller(4);
    control.set_diagnosis(4902, 2, Number::from_decimal(2350, 0));
    let server = serve(control, ServerSettings::default());
    let readings = poll(opened(&server, "power_diagnosis=4902").sources[0].as_mut()).expect("answers");
    assert_eq!(number(&readings, "spindle_power_w"), 2350.0);
    let readings = poll(opened(&server, "power_diagnosis=4903").sources[0].as_mut()).expect("answers");
    assert_eq!(value(&readings, "spindle_power_w"), Err(Absence::NotSupported));
    let readings = poll(opened(&server, "").sources[0].as_mut()).expect("answers");
    assert!(readings.iter().all(|reading| reading.channel.name() != "spindle_power_w"), "a meter is asked instead");
}

#[test]
fn inches_become_millimetres_and_feed_per_turn_becomes_feed() {
    let mut control = controller(4);
    control.measure_in_inches(true);
    control.feed_in(SpeedUnit::InchRev, Number::from_decimal(8, 3));
    control.axes[0].positions[1] = Number::from_decimal(20_000, 4);
    let server = serve(control, ServerSettings::default());
    let mut opened = opened(&server, "");
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    assert!((number(&readings, "x_axis_position_mm") - 50.8).abs() < 1e-9);
    assert!((number(&readings, "feed_mm_min") - 0.008 * 25.4 * 1200.0).abs() < 1e-9);
}

#[test]
fn alarms_are_raised_and_cleared_and_states_follow() {
    let server = serve(controller(4), ServerSettings::default());
    let mut opened = opened(&server, "");
    server.with(|control| {
        let control = control.expect("on");
        control.status.alarm = 1;
        control.status.run = 1;
        control.alarms = vec![Alarm { number: 417, kind: 6, axis: 2, text: "SERVO ALARM".into() }];
    });
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    assert_eq!(
        (text(&readings, "alarm"), text(&readings, "execution")),
        ("SV0417 (Z) SERVO ALARM".into(), "STOPPED".into())
    );
    server.with(|control| {
        let control = control.expect("on");
        (control.status.alarm, control.status.run, control.status.automatic) = (0, 3, 1);
        control.alarms.clear();
        control.memory.set_byte(Area::F, 2, 0x08);
    });
    let readings = poll(opened.sources[0].as_mut()).expect("answers");
    assert_eq!((text(&readings, "alarm"), text(&readings, "operation")), (String::new(), "threading".into()));
    assert_eq!(number(&readings, "feed_override_pct"), 100.0, "a thread is cut at the programmed feed");
}

#[test]
fn nobody_there_no_such_path_and_no_free_connection_are_told_apart() {
    let server = serve(controller(4), ServerSettings { sessions_max: 1, ..ServerSettings::default() });
    let mut first = opened(&server, "");
    poll(first.sources[0].as_mut()).expect("the one connection");
    let error = poll(opened(&server, "").sources[0].as_mut()).expect_err("none left").to_string();
    assert!(error.contains("no free connection") && error.contains("Close other programs"), "{error}");
    drop(first);
    let error = poll(opened(&server, "path=2").sources[0].as_mut()).expect_err("one path only").to_string();
    assert!(error.contains("path="), "{error}");
    let gone = address(&server, "");
    drop(server);
    std::thread::sleep(std::time::Duration::from_millis(150));
    let mut nobody = open_address(&gone, 0).expect("an address");
    let error = poll(nobody.sources[0].as_mut()).expect_err("nobody");
    assert!(matches!(error, SourceError::Line { .. }) && error.to_string().contains("8193"), "{error}");
}
