//! One question to one answer, in the encoding of the generation.

use super::controller::{Controller, Data};
use super::write;
use crate::fanuc::answer::{Alarm, System};
use crate::fanuc::item::{Area, Stretch, Width};
use crate::fanuc::opening::Generation;
use crate::fanuc::request::{ALARM_TEXT_LEN, function as f};
use crate::fanuc::wire::{Device, Number, ReplyBlock, Request, reply_body};

/// What a question yields: data, or a return code.
pub(super) type Data8 = Result<Vec<u8>, i16>;

/// No such function, wrong length, wrong number, wrong type.
pub(super) const FUNC: i16 = 1;
pub(super) const LENGTH: i16 = 2;
pub(super) const NUMBER: i16 = 3;
pub(super) const ATTRIB: i16 = 4;
/// No such path.
const PATH: i16 = 11;

/// Answers every question of a frame, in order.
#[must_use]
pub fn answer_body(controller: &mut Controller, requests: &[Request]) -> Vec<u8> {
    let answers: Vec<(&Request, ReplyBlock)> =
        requests.iter().map(|request| (request, answer(controller, request))).collect();
    reply_body(&answers)
}

fn answer(controller: &mut Controller, request: &Request) -> ReplyBlock {
    let refused = |(code, detail): (i16, i16)| ReplyBlock { code, detail, data: Vec::new() };
    if let Some(refusal) = controller.refusals.get(&request.function) {
        return refused(*refusal);
    }
    // PMC memory is the first path's, whatever the block says.
    let path = if request.device == Device::Pmc { 1 } else { request.path };
    let Some(own) = controller.path(path) else { return refused((PATH, 0)) };
    match data(own, request) {
        Ok(data) => ReplyBlock { code: 0, detail: 0, data },
        Err(code) => refused((code, 0)),
    }
}

fn data(controller: &mut Controller, request: &Request) -> Data8 {
    match (request.device, request.function) {
        (Device::Pmc, f::PMC_READ) => memory(controller, request),
        (Device::Pmc, _)
        | (_, f::MACRO_WRITE | f::WORK_OFFSET_WRITE | f::TOOL_OFFSET_WRITE | f::PANEL_SIGNALS_WRITE) => {
            write::take(controller, request).map(|()| {
                controller.writes += 1;
                Vec::new()
            })
        }
        (Device::Cnc, _) => state(controller, request).unwrap_or_else(|| motion(controller, request)),
    }
}

/// Identity, state, program, alarms.
fn state(controller: &Controller, request: &Request) -> Option<Data8> {
    let first = request.arguments[0];
    let status = controller.status;
    let seven =
        [status.automatic, status.run, status.motion, status.auxiliary, status.emergency, status.alarm, status.edit];
    Some(Ok(match request.function {
        f::SYSTEM => system(&controller.system),
        f::STATUS => shorts(&seven),
        f::STATUS_LONG => shorts(&[&seven[..], &[0; 4]].concat()),
        f::HANDLE_RETRACE | f::TOOL_MODE | f::TUNING_MODE => shorts(&[0]),
        f::PROGRAM => longs(&[controller.program.0, controller.program.1]),
        f::PROGRAM_NAME => {
            let name = format!("O{}", controller.program.0);
            [longs(&[controller.program.0]), text(&name, 36)].concat()
        }
        f::PROGRAM_PATH | f::MAIN_PROGRAM => text(&controller.program_path, 256),
        f::SEQUENCE => longs(&[controller.sequence]),
        f::BLOCK_COUNT => longs(&[controller.blocks]),
        f::EXECUTED_TEXT => {
            let most = usize::try_from(first).unwrap_or(0).min(controller.executed.1.len());
            [&longs(&[controller.executed.0])[..], &controller.executed.1.as_bytes()[..most]].concat()
        }
        f::ALARM_BITS => longs(&[controller.alarm_bits]),
        f::ALARMS => {
            controller.alarms.iter().take(usize::try_from(request.arguments[1]).unwrap_or(0)).flat_map(alarm).collect()
        }
        f::TIMER => return Some(timer(controller, first)),
        f::PANEL_SIGNALS => {
            // The mask stands before the signals in the vendor's structure, not on the wire.
            shorts(&controller.panel)
        }
        _ => return None,
    }))
}

fn timer(controller: &Controller, which: i32) -> Data8 {
    let timer = usize::try_from(which).ok().and_then(|which| controller.timers.get(which)).ok_or(NUMBER)?;
    Ok(longs(&[timer.0, timer.1]))
}

/// Axes, spindles, modal values, variables, parameters.
fn motion(controller: &Controller, request: &Request) -> Data8 {
    let [first, second, third, ..] = request.arguments;
    match request.function {
        f::FEED => Ok(controller.feed.bytes().to_vec()),
        f::SPINDLE_SPEED => spindles(controller, 3).map(|bytes| bytes.get(..8).unwrap_or_default().to_vec()),
        f::SPINDLES => spindles(controller, first),
        f::SERVOS => servos(controller, first),
        f::POSITION => positions(controller, first, second),
        f::COUNT => Ok(shorts(&[count(controller, first)])),
        f::AXIS_NAMES => Ok(controller.axes.iter().flat_map(|axis| [axis.name as u8, 0, 0, 0]).collect()),
        f::SPINDLE_NAMES => Ok((1..=controller.spindles.len()).flat_map(|n| [b'S', b'0' + n as u8, 0, 0]).collect()),
        f::SPEED_UNIT => Ok(shorts(&[controller.speed_units[usize::from(first == 4)]])),
        f::MODAL_WORD => {
            let value = controller.modal_words.get(&first).ok_or(NUMBER)?;
            Ok([&longs(&[*value])[..], &[0x40, 0, 0, 0]].concat())
        }
        f::MODAL_GROUP => groups(controller, first),
        f::MACRO => macros(controller, first, second),
        f::PARAMETER | f::PARAMETER_OLDER => parameter(controller, request, &controller.parameters),
        f::DIAGNOSIS | f::DIAGNOSIS_OLDER => parameter(controller, request, &controller.diagnoses),
        f::TOOL_OFFSET => {
            let value = controller.tool_offsets.get(&(first, third - 1000)).copied().unwrap_or(0);
            Ok(Number::decimal(value, 3).bytes().to_vec())
        }
        f::WORK_OFFSET => offset(controller, first, third),
        _ => Err(FUNC),
    }
}

fn count(controller: &Controller, which: i32) -> i16 {
    let count = if matches!(which, 1 | 3) { controller.spindles.len() } else { controller.axes.len() };
    i16::try_from(count).unwrap_or(0)
}

fn spindles(controller: &Controller, what: i32) -> Data8 {
    let what = usize::try_from(what).ok().filter(|what| *what < 6).ok_or(ATTRIB)?;
    Ok(controller.spindles.iter().flat_map(|spindle| spindle.quantities[what].bytes()).collect())
}

/// Places for every axis the controller could have; those without an axis are zero.
fn places(controller: &Controller, of: impl Fn(usize) -> Option<Number>) -> Vec<u8> {
    let places = usize::from(controller.opening.axes_max);
    (0..places).flat_map(|axis| of(axis).unwrap_or(Number::decimal(0, 0)).bytes()).collect()
}

fn servos(controller: &Controller, what: i32) -> Data8 {
    let quantity = |axis: &super::Axis| match what {
        1 => Some(axis.load),
        2 => Some(axis.speed),
        3 => Some(axis.current),
        _ => None,
    };
    if !(1..=3).contains(&what) {
        return Err(ATTRIB);
    }
    Ok(places(controller, |axis| controller.axes.get(axis).and_then(quantity)))
}

fn positions(controller: &Controller, what: i32, axis: i32) -> Data8 {
    let what = [4, 1, 6, 7].iter().position(|known| *known == what).ok_or(ATTRIB)?;
    if axis == -1 {
        return Ok(places(controller, |axis| controller.axes.get(axis).map(|axis| axis.positions[what])));
    }
    let axis = usize::try_from(axis - 1).ok().and_then(|axis| controller.axes.get(axis)).ok_or(ATTRIB)?;
    Ok(axis.positions[what].bytes().to_vec())
}

fn groups(controller: &Controller, group: i32) -> Data8 {
    if group == -1 {
        return Ok(controller.modal_groups.values().flat_map(|code| [*code, 0]).collect());
    }
    controller.modal_groups.get(&group).map(|code| vec![*code, 0]).ok_or(NUMBER)
}

fn macros(controller: &Controller, first: i32, last: i32) -> Data8 {
    let last = last.min(first.saturating_add(100));
    let encode = |value: Option<f64>| match (value, controller.opening.generation) {
        (None, _) => Number::VACANT,
        (Some(value), Generation::Newer(_)) => Number::decimal_of(value),
        (Some(value), Generation::Older(_)) => Number::binary_of(value),
    };
    let each = |number| controller.macros.get(&number).map(|value| encode(*value).bytes()).ok_or(NUMBER);
    (first..=last).map(each).collect::<Result<Vec<_>, _>>().map(|all| all.concat())
}

fn offset(controller: &Controller, number: i32, axis: i32) -> Data8 {
    let axes = i32::from(controller.opening.axes);
    if !(0..=54).contains(&number) || !(1..=axes).contains(&axis) {
        return Err(if (0..=54).contains(&number) { ATTRIB } else { NUMBER });
    }
    let value = controller.work_offsets.get(&(number, axis)).copied().unwrap_or(0);
    Ok(Number::decimal(value, 3).bytes().to_vec())
}

fn parameter(controller: &Controller, request: &Request, table: &std::collections::BTreeMap<i32, Data>) -> Data8 {
    let [number, _, axis, ..] = request.arguments;
    let newer = matches!(controller.opening.generation, Generation::Newer(_));
    if newer != matches!(request.function, f::PARAMETER | f::DIAGNOSIS) {
        return Err(FUNC);
    }
    let data = table.get(&number).ok_or(NUMBER)?;
    let skip = usize::try_from(axis - 1).unwrap_or(0);
    let value = |place: usize| data.values.get(place + skip).copied().filter(|_| axis == -1 || place == 0);
    let axis = i16::try_from(axis).map_err(|_| ATTRIB)?;
    let head = [longs(&[number]), shorts(&[axis, data.kind])].concat();
    let places_of = usize::from(controller.opening.axes_max);
    let older = || (0..places_of).flat_map(|place| value(place).map_or(0, |number| number.mantissa).to_be_bytes());
    let values = if newer { places(controller, value) } else { older().collect() };
    Ok([head, values].concat())
}

/// The stretch of PMC memory that a question is about.
pub(super) fn stretch(request: &Request) -> Result<Stretch, i16> {
    let [from, to, area, width, _] = request.arguments;
    let at = |at: i32| u16::try_from(at).map_err(|_| NUMBER);
    let (area, width) = (Area::of_number(area).ok_or(ATTRIB)?, Width::of_number(width).ok_or(ATTRIB)?);
    Ok(Stretch { area, from: at(from)?, to: at(to)?, width })
}

fn memory(controller: &Controller, request: &Request) -> Data8 {
    controller.memory.read(stretch(request)?).ok_or(NUMBER)
}

fn system(system: &System) -> Vec<u8> {
    let padded = |text: &str, len: usize| format!("{text:>len$}").into_bytes();
    let mut bytes = shorts(&[system.additional, system.axes_max]);
    for (text, len) in
        [(&system.kind, 2), (&system.machine, 2), (&system.series, 4), (&system.version, 4), (&system.axes, 2)]
    {
        bytes.extend(padded(text, len));
    }
    bytes
}

fn alarm(alarm: &Alarm) -> Vec<u8> {
    let length = i32::try_from(alarm.text.len().min(ALARM_TEXT_LEN)).unwrap_or(0);
    [longs(&[alarm.number, alarm.kind, alarm.axis, length]), text(&alarm.text, ALARM_TEXT_LEN)].concat()
}

fn text(text: &str, len: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(len, 0);
    bytes
}

fn shorts(numbers: &[i16]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}

fn longs(numbers: &[i32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}
