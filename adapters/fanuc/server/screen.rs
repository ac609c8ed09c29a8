//! What the simulated machine's control shows besides motion and states: clock, times, programs, messages, tool life,
//! temperatures, and the parameters that integrators look at first.

use super::controller::{Controller, Data, ProgramFile, ToolGroup};
use super::encode::saturate_counter;
use super::panel_status::round_to_number;
use adapter_core::clock::TimeNs;
use adapter_core::words::execution;
use fanuc::answer::{Alarm, OperatorMessage, PastAlarm, SpeedUnit};
use fanuc::item::BlockWord;
use fanuc::wire::Number;
use jiff::Timestamp;
use jiff::tz::TimeZone;
use simulated::{Moment, Panel};

/// Kinds of parameters on the wire: byte, two words, real.
const BYTE: i16 = 1;
const LONG: i16 = 3;
const REAL: i16 = 4;
/// Kinds of diagnosis numbers: byte, two words, real.
const DIAGNOSIS_BYTE: i16 = 0;
const DIAGNOSIS_LONG: i16 = 2;
const DIAGNOSIS_REAL: i16 = 5;

/// Messages of the ladder have numbers from 2000 on, alarms of the ladder from 1000 on.
const PARTS_MESSAGE: i32 = 2001;
/// So many parts, and the message asks for a new box.
const BOX_OF_PARTS: u32 = 50;
/// At most so many alarms are remembered.
const HISTORY_MAX: usize = 50;
/// Uses after which a tool of the simulated machine is worn, for its group.
const TOOL_LIFE: i32 = 200;

/// Parameters that do not change: I/O channel, feed of the dry run, rapid traverse of every axis, bits of the screen,
/// greatest speed of the spindle, parts required.
pub(super) fn set_fixed_parameters(control: &mut Controller) {
    control.set_parameter(20, BYTE, Number::from_decimal(4, 0));
    control.set_parameter(1410, REAL, Number::from_decimal(3000, 0));
    control.set_parameter(3208, 0, Number::from_decimal(0, 0));
    control.set_parameter(3741, LONG, Number::from_decimal(6000, 0));
    control.set_parameter(6713, LONG, Number::from_decimal(500, 0));
    let axes = control.axes.len();
    let of_axes = |kind, value| Data { kind, values: vec![value; axes] };
    control.parameters.insert(1420, of_axes(REAL, Number::from_decimal(24_000, 0)));
    let rotary = control.axes.iter().map(|axis| Number::from_decimal(i32::from(axis.rotary), 0)).collect();
    control.parameters.insert(1006, Data { kind: 0, values: rotary });
    control.feed_in(SpeedUnit::MmMin, Number::from_decimal(0, 0));
    control.g_codes = g_codes(control.system.machine == "T");
    control.set_parameter(3107, 0, Number::from_decimal(0, 0));
}

/// G codes that are in force from power-on, by their group.
fn g_codes(lathe: bool) -> std::collections::BTreeMap<i16, Number> {
    let mill =
        [(0, 1), (1, 17), (2, 90), (3, 22), (4, 94), (5, 21), (6, 40), (7, 49), (8, 80), (9, 98), (11, 67), (13, 54)];
    let turning = [(0, 1), (1, 97), (3, 69), (4, 98), (5, 21), (6, 40), (8, 22), (11, 67), (13, 54), (15, 18)];
    let codes: &[(i16, i32)] = if lathe { &turning } else { &mill };
    codes.iter().map(|(group, code)| (*group, Number::from_decimal(*code, 0))).collect()
}

/// The moment on the other pages of the screen.
pub(super) fn show_pages(control: &mut Controller, moment: &Moment, now_ns: TimeNs) {
    let panel = &moment.panel;
    if let Some(clock) = to_civil_time(now_ns) {
        control.clock = clock;
    }
    let turning = panel.spindle_speed_rpm.abs() > 1.0;
    control.set_modal_words([(BlockWord::M, if turning { 3 } else { 5 }), (BlockWord::H, i32::from(panel.tool))]);
    control.g_codes.insert(0, Number::from_decimal(i32::from(!panel.rapid), 0));
    control.set_parameter(6712, LONG, round_to_number(f64::from(panel.part_count)));
    show_temperatures(control, moment);
    show_times(control, panel);
    show_programs(control, panel);
    show_tools(control, panel);
    show_messages(control, panel);
}

fn to_civil_time(now_ns: TimeNs) -> Option<[i16; 6]> {
    let time = Timestamp::from_nanosecond(i128::from(now_ns)).ok()?.to_zoned(TimeZone::UTC).datetime();
    let short = i16::from;
    Some([
        time.year(),
        short(time.month()),
        short(time.day()),
        short(time.hour()),
        short(time.minute()),
        short(time.second()),
    ])
}

/// Motors of the axes are a little warmer than the air with what they carry, their encoders cooler than the motors; the
/// position errors follow the speed.
fn show_temperatures(control: &mut Controller, moment: &Moment) {
    let air = moment.electric.ambient_temperature_c;
    let load = |number: &Number| f64::from(number.mantissa.abs());
    let motors: Vec<Number> = control.axes.iter().map(|axis| round_to_number(air + load(&axis.load) / 4.0)).collect();
    let encoders = control.axes.iter().map(|axis| round_to_number(air + load(&axis.load) / 8.0)).collect();
    control.diagnosis_of_axes(308, DIAGNOSIS_BYTE, motors);
    control.diagnosis_of_axes(309, DIAGNOSIS_BYTE, encoders);
    let errors = moment.panel.velocity_mm_min;
    let error =
        |place: usize| Number { exponent: 3, ..round_to_number(errors.get(place).copied().unwrap_or(0.0) / 3.0) };
    let real = (0..control.axes.len()).map(error).collect();
    control.diagnosis_of_axes(301, DIAGNOSIS_REAL, real);
    control.set_diagnosis(300, DIAGNOSIS_LONG, Number::from_decimal(0, 0));
}

/// The meters of time follow from the parts that were made, so that they are the same in every run.
fn show_times(control: &mut Controller, panel: &Panel) {
    let seconds = |seconds: i64| (saturate_counter(seconds / 60), saturate_counter(seconds % 60 * 1000));
    let parts = i64::from(panel.part_count);
    control.timers = [seconds(3600 + 100 * parts), seconds(90 * parts), seconds(60 * parts), seconds(90)];
    control.blocks = i32::from(panel.block);
}

fn show_programs(control: &mut Controller, panel: &Panel) {
    let number = i32::from(panel.program);
    if number > 0 && control.programs.iter().all(|file| file.number != number) {
        control.programs.push(ProgramFile { number, bytes: 1024, comment: "SIMULATED".to_owned() });
        control.programs.sort_by_key(|file| file.number);
    }
}

/// A group per tool; every part uses each of them once.
fn show_tools(control: &mut Controller, panel: &Panel) {
    let group = i32::from(panel.tool);
    let used = saturate_counter(i64::from(panel.part_count) % i64::from(TOOL_LIFE));
    let tools = i32::from(panel.edge).min(1000) + 1;
    control.tool_groups.insert(group, ToolGroup { tools, life: TOOL_LIFE, count: used });
    control.tool_group = [group, group, group];
}

fn show_messages(control: &mut Controller, panel: &Panel) {
    control.messages.clear();
    if panel.part_count > 0 && panel.part_count.is_multiple_of(BOX_OF_PARTS) {
        control.messages.push(OperatorMessage {
            number: PARTS_MESSAGE,
            kind: 0,
            text: "CHANGE THE BOX OF PARTS".to_owned(),
        });
    }
    let known = control.alarm_history.last().is_some_and(|past| past.alarm.text == panel.alarm);
    if panel.execution != execution::ACTIVE && !panel.alarm.is_empty() && !known {
        let alarm = Alarm { number: 2001, kind: 15, axis: 0, text: panel.alarm.to_owned() };
        control.alarm_history.push(PastAlarm { alarm, at: control.clock });
        let over = control.alarm_history.len().saturating_sub(HISTORY_MAX);
        control.alarm_history.drain(..over);
    }
}
