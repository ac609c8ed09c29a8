//! Channels besides those of the table: further axes and spindles by their own names, and the user's own. They are declared
//! when the source is opened, and travel with the quick or with the slow group.

use super::axis_name::AxisName;
use super::item::{FocasItem, Position, Question, Servo, Spindle};
use super::line::Asked;
use super::own_item::OwnItem;
use super::readings::build_reading;
use super::states::OrAbsence;
use super::view::{View, to_number_value};
use crate::address::FanucOptions;
use adapter_core::channel::{ChannelId, DeclareError, Kind, NewChannel, declare_channel};
use adapter_core::own::{Own, ReadWith};
use adapter_core::reading::{Absence, Reading, Stamp, Value};
use adapter_core::text::TextEncoding;

/// A quantity of an axis that has a channel of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum AxisQuantity {
    Position(Position),
    Load,
    Current,
    MotorTemperature,
    EncoderTemperature,
}

/// Diagnosis numbers of the temperatures of a servo motor and of its encoder, °C. Source: B-64305EN, 30i maintenance
/// manual, diagnosis 308 and 309.
const MOTOR_TEMPERATURE: FocasItem = FocasItem::Diagnosis(308, -1);
const ENCODER_TEMPERATURE: FocasItem = FocasItem::Diagnosis(309, -1);

/// Where the value of a further channel comes from.
#[derive(Debug, Clone, PartialEq)]
enum ExtraOrigin {
    Axis(AxisName, AxisQuantity),
    /// A quantity of the spindle at this place, counted from 0.
    Spindle(usize, Spindle),
    Own(Own<OwnItem>),
}

/// A channel besides those of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Extra {
    /// Its place in the table of channels.
    pub channel: ChannelId,
    path: u8,
    origin: ExtraOrigin,
}

const PLACES: (f64, f64) = (-1e6, 1e6);
const LOADS: (f64, f64) = (-500.0, 500.0);
const CURRENTS: (f64, f64) = (-1000.0, 1000.0);
const TEMPERATURES: (f64, f64) = (-50.0, 300.0);
const SPEEDS: (f64, f64) = (-100_000.0, 100_000.0);

impl AxisQuantity {
    fn to_item(self) -> FocasItem {
        match self {
            Self::Position(which) => FocasItem::Position(which, -1),
            Self::Load => FocasItem::Servos(Servo::Load),
            Self::Current => FocasItem::Servos(Servo::Current),
            Self::MotorTemperature => MOTOR_TEMPERATURE,
            Self::EncoderTemperature => ENCODER_TEMPERATURE,
        }
    }

    fn choose_pace(self) -> ReadWith {
        if matches!(self, Self::MotorTemperature | Self::EncoderTemperature) { ReadWith::Slow } else { ReadWith::Fast }
    }

    /// Ending of the name, unit, range, and what it is in English and Chinese.
    fn describe_channel(self, rotary: bool) -> (String, &'static str, (f64, f64), &'static str, &'static str) {
        let (ending, unit) = if rotary { ("deg", "°") } else { ("mm", "mm") };
        let place = |which: &str| format!("{which}_{ending}");
        match self {
            Self::Position(Position::Machine) => (place("position"), unit, PLACES, "position", "轴位置"),
            Self::Position(Position::Absolute) => {
                (place("absolute"), unit, PLACES, "position in the work coordinates", "轴绝对坐标")
            }
            Self::Position(Position::Relative) => (place("relative"), unit, PLACES, "relative position", "轴相对坐标"),
            Self::Position(Position::ToGo) => (place("to_go"), unit, PLACES, "distance to go", "轴剩余移动量"),
            Self::Load => ("load_pct".to_owned(), "%", LOADS, "load", "轴负载"),
            Self::Current => ("current_a".to_owned(), "A", CURRENTS, "current", "轴电流"),
            Self::MotorTemperature => {
                ("motor_temperature_c".to_owned(), "°C", TEMPERATURES, "motor temperature", "轴电机温度")
            }
            Self::EncoderTemperature => {
                ("encoder_temperature_c".to_owned(), "°C", TEMPERATURES, "encoder temperature", "轴编码器温度")
            }
        }
    }
}

/// Channels that an address and a configuration add, each with its pace.
///
/// # Errors
/// The name of the channel and why it cannot be added.
pub fn declare_channels(options: &FanucOptions, path: u8) -> Result<Vec<(ReadWith, Extra)>, (String, DeclareError)> {
    let mut extras = Vec::new();
    for axis in &options.axes {
        for of in list_quantities(options) {
            let (ending, unit, range, en, zh) = of.describe_channel(axis.rotary);
            let name = format!("{}_axis_{ending}", axis.name.to_lowercase());
            if adapter_core::channel::CHANNELS.iter().any(|known| known.name == name) {
                // X, Y and Z have it already.
                continue;
            }
            let kind = if of.choose_pace() == ReadWith::Slow { Kind::Held } else { Kind::Continuous };
            let (en, zh) = (format!("{} axis {en}", axis.name), format!("{}{zh}", axis.name));
            let new = NewChannel { name, unit: unit.to_owned(), range, kind, en, zh };
            extras.push((
                of.choose_pace(),
                declare_extra(&new, axis.path.unwrap_or(path), ExtraOrigin::Axis(axis.clone(), of))?,
            ));
        }
    }
    for number in 2..=options.spindles {
        for (what, ending, unit, range, en, zh) in [
            (Spindle::Speed, "speed_rpm", "rpm", SPEEDS, "actual speed", "转速"),
            (Spindle::Load, "load_pct", "%", LOADS, "load", "负载"),
        ] {
            let name = format!("spindle{number}_{ending}");
            let (en, zh) = (format!("Spindle {number}: {en}"), format!("主轴{number}{zh}"));
            let new = NewChannel { name, unit: unit.to_owned(), range, kind: Kind::Continuous, en, zh };
            extras.push((
                ReadWith::Fast,
                declare_extra(&new, path, ExtraOrigin::Spindle(usize::from(number) - 1, what))?,
            ));
        }
    }
    for own in &options.own {
        let path = own.channel.path.unwrap_or(path);
        extras.push((own.channel.pace, Extra { channel: own.id, path, origin: ExtraOrigin::Own(own.clone()) }));
    }
    Ok(extras)
}

fn list_quantities(options: &FanucOptions) -> Vec<AxisQuantity> {
    let positions =
        [Position::Machine].into_iter().chain(options.positions.iter().copied()).map(AxisQuantity::Position);
    positions
        .chain([
            AxisQuantity::Load,
            AxisQuantity::Current,
            AxisQuantity::MotorTemperature,
            AxisQuantity::EncoderTemperature,
        ])
        .collect()
}

fn declare_extra(new: &NewChannel, path: u8, origin: ExtraOrigin) -> Result<Extra, (String, DeclareError)> {
    let channel = declare_channel(new).map_err(|error| (new.name.clone(), error))?;
    Ok(Extra { channel, path, origin })
}

impl Extra {
    /// What has to be asked for: its item, and the unit of a position.
    pub fn list_questions(&self) -> impl Iterator<Item = Question> {
        let (item, unit) = match &self.origin {
            ExtraOrigin::Axis(_, of @ AxisQuantity::Position(which)) => {
                (of.to_item(), Some(FocasItem::PositionUnit(which.frame())))
            }
            ExtraOrigin::Axis(_, of) => (of.to_item(), None),
            ExtraOrigin::Spindle(_, what) => (FocasItem::Spindles(*what), None),
            ExtraOrigin::Own(own) => (own.item.item, None),
        };
        let path = self.path;
        std::iter::once(item).chain(unit).map(move |item| item.to_question(path))
    }

    /// The channel's reading of what was answered. `encoding` is the character set of the source.
    pub(super) fn to_reading(&self, asked: &Asked, stamp: Stamp, encoding: TextEncoding) -> Reading {
        let view = View { asked, path: self.path };
        if let ExtraOrigin::Own(own) = &self.origin {
            let found = view
                .find_answer(own.item.item)
                .and_then(|answer| own.item.extract_value(&own.channel, answer, encoding));
            return own.to_reading(stamp, found);
        }
        build_reading(self.channel, stamp, self.read(&view))
    }

    fn read(&self, view: &View<'_>) -> OrAbsence<Value> {
        match &self.origin {
            ExtraOrigin::Axis(axis, AxisQuantity::Position(which)) => {
                to_number_value(view.find_position(*which, &axis.name, axis.rotary))
            }
            ExtraOrigin::Axis(axis, AxisQuantity::Load) => to_number_value(view.axis_load(&axis.name)),
            ExtraOrigin::Axis(axis, of @ AxisQuantity::Current) => {
                to_number_value(view.find_axis_value(of.to_item(), &axis.name))
            }
            ExtraOrigin::Axis(axis, of) => {
                to_number_value(view.find_number_at(of.to_item(), view.find_axis_place(&axis.name)?))
            }
            ExtraOrigin::Spindle(at, Spindle::Load) => to_number_value(view.spindle_load(*at)),
            ExtraOrigin::Spindle(at, what) => to_number_value(view.find_number_at(FocasItem::Spindles(*what), *at)),
            ExtraOrigin::Own(_) => Err(Absence::NotSupported),
        }
    }
}

/// The readings of channels that an address or a configuration adds.
pub(super) fn append_extra_readings(extras: &[Extra], asked: &Asked, encoding: TextEncoding, out: &mut Vec<Reading>) {
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    out.extend(extras.iter().map(|extra| extra.to_reading(asked, stamp, encoding)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_named_as_on_the_control() {
        let read = |text| AxisName::read(text).map(|axis| (axis.name, axis.rotary));
        assert_eq!(read("x1"), Some(("X1".to_owned(), false)));
        assert_eq!(read("B"), Some(("B".to_owned(), true)));
        assert_eq!(read("C1:mm"), Some(("C1".to_owned(), false)));
        assert_eq!(read("W:deg"), Some(("W".to_owned(), true)));
        assert_eq!(AxisName::read("Z2@2").and_then(|axis| axis.path), Some(2));
        for wrong in ["", "Z2@0", "Z2@x", "1X", "X:inch", "XYZW", "X-1", ":mm"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
