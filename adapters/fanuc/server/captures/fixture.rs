//! The control that stood behind the captured frames.

use crate::{Controller, ControllerAxis};
use fanuc::answer::{Alarm, Status, System};
use fanuc::item::{Area, BlockWord};
use fanuc::wire::Number;

pub(super) fn build_controller(version: u16) -> Controller {
    let mut control = Controller::new(version, &['X', 'Y', 'Z']);
    control.system = System {
        additional: 0x0402,
        axes_max: if version == 2 { 8 } else { 32 },
        kind: "0".into(),
        machine: "M".into(),
        series: "D4F1".into(),
        version: "27.0".into(),
        axes: "03".into(),
    };
    control.status = Status { automatic: 1, run: 3, motion: 1, ..Status::default() };
    control.feed = Number::from_decimal(1200, 0);
    let quantities = [27, 0, 0, 8000, 275, 8012];
    control.spindles[0].quantities = quantities.map(|value| Number::from_decimal(value, 0));
    control.spindles[0].quantities[4] = Number::from_decimal(275, 1);
    control.axes = build_axes();
    control.program = (1234, 1000);
    control.program_path = "//CNC_MEM/USER/PATH1/O1234".into();
    control.sequence = 120;
    control.alarms = vec![
        Alarm { number: 100, kind: 3, axis: 0, text: "PARAMETER ENABLE SWITCH ON".into() },
        Alarm { number: 417, kind: 6, axis: 2, text: "SERVO ALARM".into() },
    ];
    control.set_modal_words([(BlockWord::F, 1200), (BlockWord::M, 3), (BlockWord::T, 12)]);
    control.macros.insert(500, Some(25.4));
    control.set_parameter(6711, 3, Number::from_decimal(456, 0));
    [3106, 3107, 9936].into_iter().for_each(|number| control.set_parameter(number, 3, Number::from_decimal(0, 0)));
    control.set_diagnosis(308, 2, Number::from_decimal(41, 0));
    control.memory.set_byte(Area::G, 12, 0x9B);
    (-123_456i32).to_le_bytes().iter().zip(100..).for_each(|(byte, at)| control.memory.set_byte(Area::R, at, *byte));
    control.executed = (0, "N120 G01 X10.5 F1200\nN130 Z-2.\nM30\n%".into());
    control.timers[0] = (12345, 6000);
    control.panel[0] = 1;
    control.panel[5] = 10;
    control.panel[6] = 5;
    control
}

fn build_axes() -> Vec<ControllerAxis> {
    let values = [
        ('X', -31, [123_456, 223_456, 1000, 500]),
        ('Y', 52, [-98_765, -198_765, 2000, 0]),
        ('Z', 118, [10_500, -10_500, -3000, -250]),
    ];
    let axis = |(name, load, positions): (char, i32, [i32; 4])| {
        let mut axis = ControllerAxis::new(&name.to_string());
        axis.load = Number::from_decimal(load, 0);
        axis.positions = positions.map(|position| Number::from_decimal(position, 3));
        axis
    };
    values.into_iter().map(axis).collect()
}

/// What happened on the control before a call.
pub(super) fn prepare_call(call: &str, control: &mut Controller) {
    control.alarm_bits = if call == "cnc_alarm2" { 72 } else { 0 };
    control.refusals.clear();
    if call == "option missing" {
        control.refusals.insert(0x24, (6, 2));
    }
}

/// What the writes of the rows have left there.
pub(super) fn assert_written(control: &Controller) {
    assert_eq!(control.memory.read_byte(Area::G, 12), 0xAF);
    assert_eq!(
        (900..904).map(|at| control.memory.read_byte(Area::D, at)).collect::<Vec<_>>(),
        [0x34, 0x12, 0xFE, 0xFF]
    );
    assert_eq!(control.macros[&511], Some(-2.5));
    assert!(control.macros[&510].is_some_and(|value| (value - 123.456_789).abs() < 1e-7));
    assert_eq!((control.tool_offsets[&(1, 0)], control.work_offsets[&(0, 1)]), (-1234, -250));
    assert_eq!(control.panel[5], 8);
}
