//! Which data item feeds which channel: by type, subtype and where its component stands.
//!
//! Where several rows name one channel, an item of the row that stands first is taken, and of one row the subtype that stands first. A subtype
//! of `""` is an item without one.

use crate::place::ComponentPlace;
use crate::words::ObservationForm;

/// Kinds of places that a row looks at, the likeliest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RowPlace {
    /// A path, or the control as a whole.
    Control,
    Spindle,
    SpindleMotor,
    /// Every linear axis; the channel's name begins with its letter.
    Axis,
    /// The supply of the device, or the device itself.
    Supply,
    Coolant,
    Environment,
}

impl RowPlace {
    /// How likely a place is; `None` where it is none of these.
    pub(crate) fn rank_place(self, place: ComponentPlace) -> Option<usize> {
        match (self, place) {
            (Self::Control, ComponentPlace::Path(_))
            | (Self::Spindle, ComponentPlace::Spindle)
            | (Self::SpindleMotor, ComponentPlace::SpindleMotor)
            | (Self::Axis, ComponentPlace::Linear(_))
            | (Self::Supply, ComponentPlace::Electric)
            | (Self::Coolant, ComponentPlace::Coolant)
            | (Self::Environment, ComponentPlace::Environment) => Some(0),
            (Self::Control, ComponentPlace::Controller) | (Self::Supply, ComponentPlace::Device) => Some(1),
            (Self::Control, ComponentPlace::Device) => Some(2),
            _ => None,
        }
    }
}

/// One way to a channel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChannelRow {
    pub(crate) channel: &'static str,
    pub(crate) place: RowPlace,
    pub(crate) kind: &'static str,
    pub(crate) sub_types: &'static [&'static str],
    pub(crate) form: ObservationForm,
}

const fn define_row(
    channel: &'static str,
    place: RowPlace,
    kind: &'static str,
    sub_types: &'static [&'static str],
    form: ObservationForm,
) -> ChannelRow {
    ChannelRow { channel, place, kind, sub_types, form }
}

const PLAIN: &[&str] = &[""];
const ACTUAL: &[&str] = &["ACTUAL", ""];
/// Before version 1.3 of the standard there was no `PROGRAMMED`. What a control includes in `COMMANDED` its maker decides.
const PROGRAMMED: &[&str] = &["PROGRAMMED", "COMMANDED"];
const OVERRIDE: &[&str] = &["OVERRIDE"];

use ObservationForm::{Block, Coordinate, EmergencyStop, Execution, Mode, Number, Program, Text, Tool};
use RowPlace::{Axis, Control, Coolant, Environment, Spindle, SpindleMotor, Supply};

/// Every row, the likeliest of a channel first.
#[rustfmt::skip]
pub(crate) const ROWS: &[ChannelRow] = &[
    define_row("execution", Control, "EXECUTION", PLAIN, Execution),
    define_row("mode", Control, "CONTROLLER_MODE", PLAIN, Mode),
    define_row("program", Control, "PROGRAM", &["ACTIVE", ""], Program),
    define_row("main_program", Control, "PROGRAM", &["MAIN"], Program),
    define_row("block", Control, "LINE_LABEL", PLAIN, Block),
    define_row("block", Control, "LINE_NUMBER", &["ABSOLUTE", ""], Block),
    define_row("block", Control, "LINE", PLAIN, Block),
    define_row("block_text", Control, "BLOCK", PLAIN, Text),
    define_row("tool", Control, "TOOL_NUMBER", PLAIN, Tool),
    define_row("tool", Control, "TOOL_ID", PLAIN, Tool),
    define_row("tool", Control, "TOOL_ASSET_ID", PLAIN, Tool),
    define_row("part_count", Control, "PART_COUNT", &["ALL", ""], Number),
    define_row("parts_required", Control, "PART_COUNT", &["TARGET"], Number),
    define_row("power_on_time_s", Control, "EQUIPMENT_TIMER", &["POWERED"], Number),
    define_row("operating_time_s", Control, "EQUIPMENT_TIMER", &["OPERATING"], Number),
    define_row("feed_mm_min", Control, "PATH_FEEDRATE", ACTUAL, Number),
    define_row("feed_programmed_mm_min", Control, "PATH_FEEDRATE", PROGRAMMED, Number),
    define_row("feed_per_rev_mm", Control, "PATH_FEEDRATE_PER_REVOLUTION", ACTUAL, Number),
    define_row("feed_override_pct", Control, "PATH_FEEDRATE_OVERRIDE", &["PROGRAMMED", ""], Number),
    define_row("feed_override_pct", Control, "PATH_FEEDRATE", OVERRIDE, Number),
    define_row("rapid_override_pct", Control, "PATH_FEEDRATE_OVERRIDE", &["RAPID"], Number),
    define_row("jog_override_pct", Control, "PATH_FEEDRATE_OVERRIDE", &["JOG"], Number),
    define_row("emergency_stop", Control, "EMERGENCY_STOP", PLAIN, EmergencyStop),
    define_row("operator_message", Control, "MESSAGE", PLAIN, Text),
    define_row("spindle_speed_rpm", Spindle, "ROTARY_VELOCITY", ACTUAL, Number),
    define_row("spindle_speed_rpm", Spindle, "SPINDLE_SPEED", ACTUAL, Number),
    define_row("spindle_programmed_rpm", Spindle, "ROTARY_VELOCITY", PROGRAMMED, Number),
    define_row("spindle_programmed_rpm", Spindle, "SPINDLE_SPEED", PROGRAMMED, Number),
    define_row("spindle_override_pct", Spindle, "ROTARY_VELOCITY_OVERRIDE", PLAIN, Number),
    define_row("spindle_override_pct", Spindle, "ROTARY_VELOCITY", OVERRIDE, Number),
    define_row("spindle_override_pct", Spindle, "SPINDLE_SPEED", OVERRIDE, Number),
    define_row("spindle_override_pct", Control, "ROTARY_VELOCITY_OVERRIDE", PLAIN, Number),
    define_row("spindle_load_pct", Spindle, "LOAD", ACTUAL, Number),
    define_row("spindle_power_w", Spindle, "WATTAGE", ACTUAL, Number),
    define_row("spindle_current_a", Spindle, "AMPERAGE", ACTUAL, Number),
    define_row("spindle_current_a", Spindle, "AMPERAGE_AC", ACTUAL, Number),
    define_row("torque_nm", Spindle, "TORQUE", ACTUAL, Number),
    define_row("axis_position_mm", Axis, "POSITION", ACTUAL, Number),
    define_row("axis_velocity_mm_min", Axis, "AXIS_FEEDRATE", ACTUAL, Number),
    define_row("axis_velocity_mm_min", Axis, "VELOCITY", ACTUAL, Number),
    define_row("axis_load_pct", Axis, "LOAD", ACTUAL, Number),
    define_row("axis_current_a", Axis, "AMPERAGE", ACTUAL, Number),
    define_row("x_axis_position_mm", Control, "PATH_POSITION", ACTUAL, Coordinate(0)),
    define_row("y_axis_position_mm", Control, "PATH_POSITION", ACTUAL, Coordinate(1)),
    define_row("z_axis_position_mm", Control, "PATH_POSITION", ACTUAL, Coordinate(2)),
    define_row("total_power_w", Supply, "WATTAGE", ACTUAL, Number),
    define_row("total_energy_kwh", Supply, "ELECTRICAL_ENERGY", ACTUAL, Number),
    define_row("coolant_temperature_c", Coolant, "TEMPERATURE", ACTUAL, Number),
    define_row("ambient_temperature_c", Environment, "TEMPERATURE", ACTUAL, Number),
    define_row("motor_temperature_c", SpindleMotor, "TEMPERATURE", ACTUAL, Number),
    define_row("motor_temperature_c", Spindle, "TEMPERATURE", ACTUAL, ObservationForm::OfComposition("MOTOR")),
    define_row("bearing_temperature_c", Spindle, "TEMPERATURE", ACTUAL, ObservationForm::OfComposition("BEARING")),
];

/// Temperatures that no row takes, in the order of the device.
pub(crate) const TEMPERATURE: &str = "TEMPERATURE";
/// So many of them have a channel.
pub(crate) const TEMPERATURES: usize = 16;

/// Letters of the axes with channels.
pub(crate) const LETTERS: [char; 3] = ['X', 'Y', 'Z'];
