//! Which channel is which data item of MTConnect: the one table that the lines and `devices.xml` are made of.
//!
//! The data item has the name of the channel. Values are sent as the channel has them ([`ValueForm`]); where the standard wants another
//! unit, `devices.xml` names the native one and the agent converts.
//!
//! Source: MTConnect Standard 1.4, Part 2 (devices), tables of data items and units. Newer agents read it as well.

use gateway_history::Cell;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct DataItem {
    /// Channel, and identifier of the data item.
    pub(super) channel: &'static str,
    pub(super) category: Category,
    /// Type, for example `PATH_FEEDRATE`.
    pub(super) kind: &'static str,
    pub(super) sub_type: Option<&'static str>,
    /// Unit of the standard; samples only.
    pub(super) units: Option<&'static str>,
    /// Unit of the channel, where it is another one.
    pub(super) native_units: Option<&'static str>,
    pub(super) component: Component,
    pub(super) form: ValueForm,
}

/// How a value of the channel stands on a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ValueForm {
    /// The value as it is.
    Plain,
    /// The number behind the letter: 30 of `N30`.
    Number,
    /// 0 and 1 as words.
    Words(&'static str, &'static str),
}

impl ValueForm {
    pub(super) fn format_value(self, value: &Cell) -> String {
        match (self, value) {
            (Self::Words(off, on), Cell::Number(number)) => if *number == 0.0 { off } else { on }.to_owned(),
            (Self::Number, Cell::Text(text)) => {
                let digits = text.trim_start_matches(|letter: char| !letter.is_ascii_digit());
                if digits.is_empty() { UNAVAILABLE.to_owned() } else { replace_separators(digits) }
            }
            (_, Cell::Number(number)) => number.to_string(),
            // An empty word is a value that the agent would take for none.
            (_, Cell::Text(text)) if !text.is_empty() => replace_separators(text),
            (_, Cell::Text(_) | Cell::Missing(_)) => UNAVAILABLE.to_owned(),
        }
    }
}

/// What a data item is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Category {
    Sample,
    Event,
}

/// Where a data item stands in the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Component {
    /// All axes together; conditions only.
    Axes,
    Spindle,
    X,
    Y,
    Z,
    Controller,
    Path,
    Electric,
    Coolant,
    Environment,
}

const fn define_sample(
    channel: &'static str,
    component: Component,
    kind: &'static str,
    sub_type: Option<&'static str>,
    units: &'static str,
) -> DataItem {
    let category = Category::Sample;
    DataItem {
        channel,
        category,
        kind,
        sub_type,
        units: Some(units),
        native_units: None,
        component,
        form: ValueForm::Plain,
    }
}

const fn with_native_units(item: DataItem, unit: &'static str) -> DataItem {
    DataItem { native_units: Some(unit), ..item }
}

const fn with_form(item: DataItem, form: ValueForm) -> DataItem {
    DataItem { form, ..item }
}

const fn define_event(
    channel: &'static str,
    component: Component,
    kind: &'static str,
    sub_type: Option<&'static str>,
) -> DataItem {
    let category = Category::Event;
    DataItem { channel, category, kind, sub_type, units: None, native_units: None, component, form: ValueForm::Plain }
}

use Component::{Controller, Coolant, Electric, Environment, Path, Spindle, X, Y, Z};

const RPM: &str = "REVOLUTION/MINUTE";
const MM_PER_S: &str = "MILLIMETER/SECOND";
const MM_PER_MIN: &str = "MILLIMETER/MINUTE";
const ACTUAL: Option<&str> = Some("ACTUAL");
const PROGRAMMED: Option<&str> = Some("PROGRAMMED");

/// Every data item. Channels that are not here have no counterpart in the standard and are not sent.
pub(super) const ITEMS: &[DataItem] = &[
    define_sample("spindle_speed_rpm", Spindle, "ROTARY_VELOCITY", ACTUAL, RPM),
    define_sample("spindle_programmed_rpm", Spindle, "ROTARY_VELOCITY", PROGRAMMED, RPM),
    define_event("spindle_override_pct", Spindle, "ROTARY_VELOCITY_OVERRIDE", None),
    define_sample("spindle_load_pct", Spindle, "LOAD", None, "PERCENT"),
    define_sample("spindle_power_w", Spindle, "WATTAGE", ACTUAL, "WATT"),
    define_sample("spindle_current_a", Spindle, "AMPERAGE", None, "AMPERE"),
    define_sample("bearing_temperature_c", Spindle, "TEMPERATURE", None, "CELSIUS"),
    define_sample("x_axis_position_mm", X, "POSITION", ACTUAL, "MILLIMETER"),
    with_native_units(define_sample("x_axis_velocity_mm_min", X, "VELOCITY", None, MM_PER_S), MM_PER_MIN),
    define_sample("x_axis_load_pct", X, "LOAD", None, "PERCENT"),
    define_sample("x_axis_current_a", X, "AMPERAGE", None, "AMPERE"),
    define_sample("y_axis_position_mm", Y, "POSITION", ACTUAL, "MILLIMETER"),
    with_native_units(define_sample("y_axis_velocity_mm_min", Y, "VELOCITY", None, MM_PER_S), MM_PER_MIN),
    define_sample("y_axis_load_pct", Y, "LOAD", None, "PERCENT"),
    define_sample("y_axis_current_a", Y, "AMPERAGE", None, "AMPERE"),
    define_sample("z_axis_position_mm", Z, "POSITION", ACTUAL, "MILLIMETER"),
    with_native_units(define_sample("z_axis_velocity_mm_min", Z, "VELOCITY", None, MM_PER_S), MM_PER_MIN),
    define_sample("z_axis_load_pct", Z, "LOAD", None, "PERCENT"),
    define_sample("z_axis_current_a", Z, "AMPERAGE", None, "AMPERE"),
    define_event("mode", Controller, "CONTROLLER_MODE", None),
    with_form(
        define_event("emergency_stop", Controller, "EMERGENCY_STOP", None),
        ValueForm::Words("ARMED", "TRIGGERED"),
    ),
    define_event("execution", Path, "EXECUTION", None),
    define_event("program", Path, "PROGRAM", None),
    with_form(define_event("block", Path, "LINE_NUMBER", None), ValueForm::Number),
    define_event("block_text", Path, "BLOCK", None),
    define_event("tool", Path, "TOOL_NUMBER", None),
    define_event("part", Path, "PART_ID", None),
    define_event("part_count", Path, "PART_COUNT", None),
    with_native_units(define_sample("feed_mm_min", Path, "PATH_FEEDRATE", ACTUAL, MM_PER_S), MM_PER_MIN),
    with_native_units(define_sample("feed_programmed_mm_min", Path, "PATH_FEEDRATE", PROGRAMMED, MM_PER_S), MM_PER_MIN),
    define_event("feed_override_pct", Path, "PATH_FEEDRATE_OVERRIDE", PROGRAMMED),
    define_sample("total_power_w", Electric, "WATTAGE", ACTUAL, "WATT"),
    define_sample("supply_voltage_v", Electric, "VOLTAGE", None, "VOLT"),
    define_sample("coolant_temperature_c", Coolant, "TEMPERATURE", None, "CELSIUS"),
    define_sample("ambient_temperature_c", Environment, "TEMPERATURE", None, "CELSIUS"),
];

/// The event that tells whether the box is there.
pub(super) const AVAILABILITY: &str = "avail";
/// What stands where there is no value.
pub(super) const UNAVAILABLE: &str = "UNAVAILABLE";

/// The data item of a channel.
pub(super) fn of_channel(channel: &str) -> Option<&'static DataItem> {
    ITEMS.iter().find(|item| item.channel == channel)
}

/// Bars and ends of lines have a meaning of their own.
pub(super) fn replace_separators(text: &str) -> String {
    text.replace(|letter: char| letter == '|' || letter.is_control(), " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::ChannelId;
    use std::collections::BTreeSet;

    #[test]
    fn every_data_item_is_a_channel_and_stands_once() {
        assert!(ITEMS.iter().all(|item| ChannelId::from_name(item.channel).is_some()));
        let names: BTreeSet<&str> = ITEMS.iter().map(|item| item.channel).collect();
        assert_eq!(names.len(), ITEMS.len());
        let same =
            |a: &DataItem, b: &DataItem| (a.kind, a.sub_type) == (b.kind, b.sub_type) && a.component == b.component;
        for (index, item) in ITEMS.iter().enumerate() {
            assert!(!ITEMS[..index].iter().any(|before| same(before, item)), "{item:?} cannot be told apart");
        }
    }
}
