//! What a control refuses at the moment of connecting: nothing is guessed, and everything is right one period after.

use crate::fanuc::support::{controller, number, opened, poll, serve, text, value};
use adapters::Absence;
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::{InjectedFault, ServerSettings};

/// Everything that is asked of a control, by its function.
const FUNCTIONS: [u16; 18] =
    [0x0E, 0x18, 0x19, 0x1C, 0x1D, 0x21, 0x22, 0x24, 0x25, 0x26, 0x30, 0x40, 0x56, 0x88, 0x89, 0x8D, 0x93, 0xCF];

/// Busy, write protected, no such path: a control that starts answers with these.
const CODES: [i16; 3] = [-1, 7, 11];

#[test]
fn refusals_at_connecting_leave_no_wrong_value_and_nothing_behind() {
    let mut cases = 0;
    for version in [2, 4] {
        for function in FUNCTIONS.into_iter().chain([0x8001]) {
            for code in CODES {
                let mut control = controller(version);
                control.measure_in_inches(true);
                control.axes[0].positions[1] = Number::from_decimal(20_000, 4);
                control.refusals.insert(function, (code, 0));
                let server = serve(control, ServerSettings::default());
                let mut opened = opened(&server, "duty_pct=100");
                let what = format!("function {function:x} refused with {code} by generation {version}");
                let readings = poll(opened.sources[0].as_mut()).expect("the line is well");
                let place = value(&readings, "x_axis_position_mm");
                let right = |place: f64| (place - 50.8).abs() < 1e-9;
                match &place {
                    Ok(_) => assert!(right(number(&readings, "x_axis_position_mm")), "{what}: {place:?}"),
                    Err(reason) => assert_eq!(*reason, Absence::Refused, "{what}"),
                }
                if function == 0x8001 {
                    for channel in ["feed_override_pct", "rapid", "drive_on", "spindle_override_pct"] {
                        assert_eq!(value(&readings, channel), Err(Absence::Refused), "{what}: {channel}");
                    }
                }
                server.with(|control| control.expect("on").refusals.clear());
                let readings = poll(opened.sources[0].as_mut()).expect("the line is well");
                assert!(right(number(&readings, "x_axis_position_mm")), "{what}: one period after");
                assert_eq!(number(&readings, "spindle_programmed_rpm"), 1200.0, "{what}: one period after");
                assert_eq!((number(&readings, "feed_mm_min"), number(&readings, "drive_on")), (240.0, 1.0), "{what}");
                assert_eq!(text(&readings, "program"), "O1001", "{what}");
                assert_eq!(server.count_opened(), 1, "{what}: on one connection");
                cases += 1;
            }
        }
    }
    println!("{cases} refusals at connecting: no wrong value, everything right one poll after");
}

#[test]
fn answers_that_end_early_are_no_machine_that_is_off() {
    let server = serve(controller(4), ServerSettings::default());
    let mut opened = opened(&server, "timeout_ms=200&duty_pct=100");
    let source = opened.sources[0].as_mut();
    poll(source).expect("well");
    for fault in [InjectedFault::Truncated, InjectedFault::Reset] {
        server.inject_fault(fault);
        for _ in 0..3 {
            let error = poll(source).expect_err("nothing whole comes");
            assert_ne!(error.to_absence(), Absence::MachineOff, "{fault:?}: {error}");
            assert!(error.to_string().contains("bytes"), "{fault:?}: {error}");
        }
    }
    server.inject_fault(InjectedFault::None);
    poll(source).expect("well again");
}
