//! One question to one answer, in the encoding of the generation.

use super::answer_form::{ATTRIB, Data8, FUNC, NUMBER, parse_stretch};
use super::axes::{self, encode_places};
use super::controller::{Controller, Data};
use super::encode::{convert_to_i32, encode_longs, encode_shorts, encode_text};
use super::{message, program, tool, write};
use adapter_core::integer::clamp_count;
use fanuc::answer::System;
use fanuc::generation::Generation;
use fanuc::item::Spindle;
use fanuc::request::function as f;
use fanuc::wire::{CncOrPmc, Number, ReplyBlock, Request, reply_body};

const PATH: i16 = 11;

/// Answers every question of a frame, in order.
#[must_use]
pub fn answer_body(controller: &mut Controller, requests: &[Request]) -> Vec<u8> {
    let answers: Vec<(&Request, ReplyBlock)> =
        requests.iter().map(|request| (request, answer_request(controller, request))).collect();
    reply_body(&answers)
}

fn answer_request(controller: &mut Controller, request: &Request) -> ReplyBlock {
    let refused = |(code, detail): (i16, i16)| ReplyBlock { code, detail, data: Vec::new() };
    if let Some(refusal) = controller.refusals.get(&request.function) {
        return refused(*refusal);
    }
    // PMC memory is the first path's, whatever the block says.
    let path = if request.device == CncOrPmc::Pmc { 1 } else { request.path };
    let Some(own) = controller.find_path(path) else { return refused((PATH, 0)) };
    match answer_data(own, request) {
        Ok(data) => ReplyBlock { code: 0, detail: 0, data },
        Err(code) => refused((code, 0)),
    }
}

fn answer_data(controller: &mut Controller, request: &Request) -> Data8 {
    match (request.device, request.function) {
        (CncOrPmc::Pmc, f::PMC_READ) => read_memory(controller, request),
        (CncOrPmc::Pmc, _)
        | (_, f::MACRO_WRITE | f::WORK_OFFSET_WRITE | f::TOOL_OFFSET_WRITE | f::PANEL_SIGNALS_WRITE) => {
            write::apply_write(controller, request).map(|()| {
                controller.writes += 1;
                Vec::new()
            })
        }
        (CncOrPmc::Cnc, _) => answer_state(controller, request).unwrap_or_else(|| answer_motion(controller, request)),
    }
}

/// Identity, state, program, alarms.
fn answer_state(controller: &Controller, request: &Request) -> Option<Data8> {
    let [first, second, third, fourth, ..] = request.arguments;
    let status = controller.status;
    let seven =
        [status.automatic, status.run, status.motion, status.auxiliary, status.emergency, status.alarm, status.edit];
    Some(Ok(match request.function {
        f::SYSTEM => encode_system(&controller.system),
        f::CNC_ID => controller.id.iter().flat_map(|word| word.to_be_bytes()).collect(),
        f::STATUS => encode_shorts(&seven),
        f::STATUS_LONG => encode_shorts(&[&seven[..], &[0; 4]].concat()),
        f::HANDLE_RETRACE | f::TOOL_MODE | f::TUNING_MODE => encode_shorts(&[0]),
        f::PROGRAM => encode_longs(&[controller.program.0, controller.program.1]),
        f::PROGRAM_NAME => program::encode_name(controller),
        f::PROGRAM_PATH | f::MAIN_PROGRAM => encode_text(&controller.program_path, 256),
        f::SEQUENCE => encode_longs(&[controller.sequence]),
        f::BLOCK_COUNT => encode_longs(&[controller.blocks]),
        f::EXECUTED_TEXT => program::encode_executed_text(controller, first),
        f::PROGRAM_LIST => program::encode_list(controller, first, second),
        f::PROGRAM_COUNTS => program::encode_counts(controller),
        f::ALARM_BITS => encode_longs(&[controller.alarm_bits]),
        f::ALARMS => message::encode_alarms(controller, second, fourth),
        f::ALARM_HISTORY_COUNT => encode_longs(&[convert_to_i32(controller.alarm_history.len())]),
        f::ALARM_HISTORY => return Some(message::encode_history(controller, first, second)),
        f::MESSAGES_OLDER => message::encode_messages(controller, first, usize::MAX),
        f::CLOCK => encode_shorts(&controller.clock),
        f::TIMER => return Some(encode_timer(controller, first)),
        // The mask stands before the signals in the vendor's structure, not on the wire.
        f::PANEL_SIGNALS => encode_shorts(&controller.panel),
        _ if !is_newer(controller) => return None,
        f::MESSAGES => message::encode_messages(controller, second, clamp_count(third, usize::MAX)),
        f::CURRENT_FOLDER => encode_text(program::FOLDER, 256),
        f::FOLDER => return Some(program::encode_folder(controller, request)),
        f::FOLDER_COUNTS => return Some(program::folder_counts(controller, request)),
        _ => return None,
    }))
}

fn is_newer(controller: &Controller) -> bool {
    matches!(controller.opening.generation, Generation::Newer(_))
}

fn encode_timer(controller: &Controller, which: i32) -> Data8 {
    let timer = usize::try_from(which).ok().and_then(|which| controller.timers.get(which)).ok_or(NUMBER)?;
    Ok(encode_longs(&[timer.0, timer.1]))
}

/// Axes, spindles, modal values, variables, parameters, tools.
fn answer_motion(controller: &Controller, request: &Request) -> Data8 {
    let [first, second, third, ..] = request.arguments;
    match request.function {
        f::FEED => Ok(controller.feed.to_bytes().to_vec()),
        f::SPINDLE_SPEED => {
            let speeds = axes::encode_spindles(controller, Spindle::Speed.wire_number())?;
            Ok(speeds.get(..Number::LEN).unwrap_or_default().to_vec())
        }
        f::SPINDLES => axes::encode_spindles(controller, first),
        f::SERVOS => axes::encode_servos(controller, first),
        f::POSITION => axes::encode_positions(controller, first, second),
        f::COUNT => Ok(axes::encode_count(controller, first)),
        f::AXIS_NAMES => Ok(axes::encode_names(controller, first)),
        f::SPINDLE_NAMES => Ok(axes::spindle_names(controller)),
        f::SPEED_UNIT => Ok(axes::encode_units(controller, first)),
        f::POSITION_SHOWN if is_newer(controller) => Ok(axes::encode_shown_axes(controller)),
        f::FIGURES => Ok(encode_figures(controller)),
        f::MODAL_WORD => program::modal_word(controller, first),
        f::MODAL_GROUP => program::encode_modal_groups(controller, first),
        f::G_CODES => program::g_codes(controller, first),
        f::COMMANDS => program::encode_commands(controller, first),
        f::MACRO => encode_macros(controller, first, second),
        f::MACRO_DOUBLE => encode_doubles(controller, first, second),
        f::PARAMETER | f::PARAMETER_OLDER => encode_parameter(controller, request, &controller.parameters),
        f::DIAGNOSIS | f::DIAGNOSIS_OLDER => encode_parameter(controller, request, &controller.diagnoses),
        f::TOOL_OFFSET => tool::encode_tool_offsets(controller, first, second, third),
        f::TOOL_OFFSET_INFO => Ok(tool::encode_offset_info(controller)),
        f::WORK_OFFSET => tool::encode_work_offsets(controller, first, second, third),
        f::TOOL_GROUP => Ok(encode_longs(&controller.tool_group)),
        f::TOOL_GROUP_COUNT => Ok(encode_longs(&[convert_to_i32(controller.tool_groups.len())])),
        f::TOOL_GROUP_OPTION if is_newer(controller) => Ok(encode_longs(&[first, 0])),
        f::TOOL_LIFE => tool::encode_tool_life(controller, first, second),
        _ => Err(FUNC),
    }
}

/// Places after the point of the positions of every axis, in and out.
fn encode_figures(controller: &Controller) -> Vec<u8> {
    let places: Vec<i16> = controller.axes.iter().flat_map(|axis| [axis.positions[1].exponent; 2]).collect();
    [encode_longs(&[convert_to_i32(controller.axes.len())]), encode_shorts(&places)].concat()
}

/// Variables as doubles; a vacant one is no number.
fn encode_doubles(controller: &Controller, first: i32, count: i32) -> Data8 {
    let last = first.saturating_add(count.clamp(0, 100) - 1);
    let each = |number| {
        let value = controller.macros.get(&number).ok_or(NUMBER)?;
        Ok(value.unwrap_or(f64::NAN).to_be_bytes())
    };
    (first..=last).map(each).collect::<Result<Vec<_>, i16>>().map(|all| all.concat())
}

fn encode_macros(controller: &Controller, first: i32, last: i32) -> Data8 {
    let last = last.min(first.saturating_add(100));
    let encode = |value: Option<f64>| match (value, controller.opening.generation) {
        (None, _) => Number::VACANT,
        (Some(value), Generation::Newer(_)) => Number::decimal_of(value),
        (Some(value), Generation::Older(_)) => Number::binary_of(value),
    };
    let each = |number| controller.macros.get(&number).map(|value| encode(*value).to_bytes()).ok_or(NUMBER);
    (first..=last).map(each).collect::<Result<Vec<_>, _>>().map(|all| all.concat())
}

fn encode_parameter(
    controller: &Controller,
    request: &Request,
    table: &std::collections::BTreeMap<i32, Data>,
) -> Data8 {
    let [number, _, axis, ..] = request.arguments;
    let newer = is_newer(controller);
    if newer != matches!(request.function, f::PARAMETER | f::DIAGNOSIS) {
        return Err(FUNC);
    }
    let data = table.get(&number).ok_or(NUMBER)?;
    let axis = i16::try_from(axis).map_err(|_| ATTRIB)?;
    let skip = clamp_count(i32::from(axis) - 1, usize::MAX);
    let value = |place: usize| data.values.get(place + skip).copied().filter(|_| axis == -1 || place == 0);
    let head = [encode_longs(&[number]), encode_shorts(&[axis, data.kind])].concat();
    let places_of = usize::from(controller.opening.axes_max);
    let older = || (0..places_of).flat_map(|place| value(place).map_or(0, |number| number.mantissa).to_be_bytes());
    let values = if newer { encode_places(controller, value) } else { older().collect() };
    Ok([head, values].concat())
}

fn read_memory(controller: &Controller, request: &Request) -> Data8 {
    controller.memory.read(parse_stretch(request)?).ok_or(NUMBER)
}

fn encode_system(system: &System) -> Vec<u8> {
    let padded = |text: &str, len: usize| format!("{text:>len$}").into_bytes();
    let mut bytes = encode_shorts(&[system.additional, system.axes_max]);
    for (text, len) in
        [(&system.kind, 2), (&system.machine, 2), (&system.series, 4), (&system.version, 4), (&system.axes, 2)]
    {
        bytes.extend(padded(text, len));
    }
    bytes
}
