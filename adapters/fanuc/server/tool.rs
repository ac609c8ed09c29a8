//! Tool offsets, work offsets and tool life.

use super::answer_form::{ATTRIB, Data8, NUMBER};
use super::controller::{Controller, ToolGroup};
use super::encode::{encode_longs, encode_shorts};
use fanuc::wire::Number;

/// A single offset is asked for with its type and this besides; a range with the type alone.
const SINGLE: i32 = 1000;

/// Types of offsets with memory C of a mill: wear and geometry of radius and length.
const TYPES: i32 = 4;

/// Kind of the memory for offsets, as `cnc_rdtofsinfo` tells it: memory C of a mill.
const MEMORY_C: i16 = 3;

/// Most offsets, work offsets and places in one answer.
const RANGE_MAX: i32 = 50;

pub(super) fn encode_tool_offsets(controller: &Controller, first: i32, last: i32, kind: i32) -> Data8 {
    let kind = if kind >= SINGLE - 1 { kind - SINGLE } else { kind };
    if first < 1 || last < first || last > controller.tool_offset_count {
        return Err(NUMBER);
    }
    let kinds = match kind {
        -1 => 0..TYPES,
        kind if (0..TYPES).contains(&kind) => kind..kind + 1,
        _ => return Err(ATTRIB),
    };
    let value = |number, kind| controller.tool_offsets.get(&(number, kind)).copied().unwrap_or(0);
    let all = (first..=last.min(first + RANGE_MAX)).flat_map(|number| kinds.clone().map(move |kind| (number, kind)));
    Ok(all.flat_map(|(number, kind)| Number::from_decimal(value(number, kind), 3).to_bytes()).collect())
}

pub(super) fn encode_offset_info(controller: &Controller) -> Vec<u8> {
    [encode_longs(&[controller.tool_offset_count]), encode_shorts(&[MEMORY_C, 1])].concat()
}

/// Work offsets of one axis, or places for every axis the control could have.
pub(super) fn encode_work_offsets(controller: &Controller, first: i32, last: i32, axis: i32) -> Data8 {
    if !(0..=54).contains(&first) || !(first..=54).contains(&last) {
        return Err(NUMBER);
    }
    let axes = i32::from(controller.opening.axes);
    let places = match axis {
        -1 => 1..=i32::from(controller.opening.axes_max),
        axis if (1..=axes).contains(&axis) => axis..=axis,
        _ => return Err(ATTRIB),
    };
    let value = |number, axis| controller.work_offsets.get(&(number, axis)).copied().unwrap_or(0);
    let all =
        (first..=last.min(first + RANGE_MAX / 4)).flat_map(|number| places.clone().map(move |axis| (number, axis)));
    Ok(all.flat_map(|(number, axis)| Number::from_decimal(value(number, axis), 3).to_bytes()).collect())
}

pub(super) fn encode_tool_life(controller: &Controller, first: i32, last: i32) -> Data8 {
    let group = |number: i32| {
        let group: &ToolGroup = controller.tool_groups.get(&number).ok_or(NUMBER)?;
        Ok(encode_longs(&[number, group.tools, 0, group.life, 0, group.count]))
    };
    (first..=last.min(first + RANGE_MAX)).map(group).collect::<Result<Vec<_>, i16>>().map(|all| all.concat())
}
