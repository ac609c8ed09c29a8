//! Positions, names and units of the axes, and what spindles and drives show.

use super::answer_form::{ATTRIB, Data8};
use super::controller::{Controller, ControllerAxis};
use super::encode::{encode_longs, encode_shorts};
use adapter_core::integer::convert_bounded;
use fanuc::answer::SpeedUnit;
use fanuc::generation::Generation;
use fanuc::item::{Position, Servo, Spindle};
use fanuc::request::UNIT_OF_FEED;
use fanuc::wire::Number;

/// Numbers of positions besides those of [`Position::ALL`], as `cnc_absolute2`, `cnc_relative2` and `cnc_rdposition` ask
/// for them: absolute, relative and to go as the screen shows them.
const SHOWN: [(i32, Position); 3] = [(0, Position::Absolute), (2, Position::Relative), (3, Position::ToGo)];

/// Asked for with this number, the names come once per position of every axis.
const NAMES_OF_POSITIONS: i32 = -1;

/// Every position of an axis is shown. Source: `libfwlib32` 1.0.5 takes bit 0 for machine, bit 1 for absolute and
/// relative, bit 2 for what is to go.
const ALL_SHOWN: i32 = 0b111;

/// Units of positions. Source: FOCAS2 manual, `POSELM.unit`.
const MM: i16 = 0;
const INCH: i16 = 1;
const DEGREES: i16 = 2;

pub(super) fn encode_spindles(controller: &Controller, what: i32) -> Data8 {
    let place = Spindle::ALL.iter().position(|(_, number)| *number == what).ok_or(ATTRIB)?;
    Ok(controller.spindles.iter().flat_map(|spindle| spindle.quantities[place].to_bytes()).collect())
}

/// Places for every axis the controller could have; those without an axis are zero.
pub(super) fn encode_places(controller: &Controller, of: impl Fn(usize) -> Option<Number>) -> Vec<u8> {
    let places = usize::from(controller.opening.axes_max);
    (0..places).flat_map(|axis| of(axis).unwrap_or(Number::from_decimal(0, 0)).to_bytes()).collect()
}

pub(super) fn encode_servos(controller: &Controller, what: i32) -> Data8 {
    let (what, _) = Servo::ALL.iter().find(|(_, number)| *number == what).ok_or(ATTRIB)?;
    let quantity = |axis: &ControllerAxis| match what {
        Servo::Load => axis.load,
        Servo::Speed => axis.speed,
        Servo::Current => axis.current,
    };
    Ok(encode_places(controller, |axis| controller.axes.get(axis).map(quantity)))
}

pub(super) fn encode_positions(controller: &Controller, what: i32, axis: i32) -> Data8 {
    let shown = SHOWN.iter().find(|(number, _)| *number == what).map(|(_, position)| position.wire_number());
    let what = shown.unwrap_or(what);
    let what = Position::ALL.iter().position(|(_, number)| *number == what).ok_or(ATTRIB)?;
    if axis == -1 {
        return Ok(encode_places(controller, |axis| controller.axes.get(axis).map(|axis| axis.positions[what])));
    }
    let axis = usize::try_from(axis - 1).ok().and_then(|axis| controller.axes.get(axis)).ok_or(ATTRIB)?;
    Ok(axis.positions[what].to_bytes().to_vec())
}

/// Four bytes per name, and one name for each of its positions where they are asked for.
pub(super) fn encode_names(controller: &Controller, which: i32) -> Vec<u8> {
    let times = if which == NAMES_OF_POSITIONS { Position::ALL.len() } else { 1 };
    let name = |axis: &ControllerAxis| {
        let mut bytes = [0; 4];
        axis.name.bytes().take(3).zip(&mut bytes).for_each(|(letter, place)| *place = letter);
        bytes.repeat(times)
    };
    controller.axes.iter().flat_map(name).collect()
}

pub(super) fn spindle_names(controller: &Controller) -> Vec<u8> {
    (1..=controller.spindles.len().min(9)).flat_map(|n| [b'S', b'0' + n as u8, 0, 0]).collect()
}

pub(super) fn encode_shown_axes(controller: &Controller) -> Vec<u8> {
    encode_longs(&vec![ALL_SHOWN; usize::from(controller.opening.axes_max)])
}

pub(super) fn encode_count(controller: &Controller, which: i32) -> Vec<u8> {
    let count = if matches!(which, 1 | 3) { controller.spindles.len() } else { controller.axes.len() };
    encode_shorts(&[convert_bounded(count, i16::MAX)])
}

/// Units as numbered on the wire: of the feed (3 on newer controls, 0 on older ones), of the spindle's speed, and of the
/// positions (1 and 2), of those in pairs for the work and the machine coordinates of every axis.
pub(super) fn encode_units(controller: &Controller, which: i32) -> Vec<u8> {
    let unit = |axis: &ControllerAxis| match (axis.rotary, controller.inch) {
        (true, _) => DEGREES,
        (_, true) => INCH,
        _ => MM,
    };
    match (controller.opening.generation, which) {
        (_, 1 | 2) => encode_shorts(&controller.axes.iter().flat_map(|axis| [unit(axis); 2]).collect::<Vec<_>>()),
        (Generation::Newer(_), UNIT_OF_FEED) => encode_shorts(&[controller.feed_unit.newer_number()]),
        (Generation::Newer(_), _) => encode_shorts(&[SpeedUnit::MmMin.newer_number()]),
        (Generation::Older(_), 0) => encode_shorts(&[controller.feed_unit.older_number()]),
        (Generation::Older(_), _) => encode_shorts(&[0]),
    }
}
