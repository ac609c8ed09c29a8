//! What a question writes.

use super::answer_form::{ATTRIB, FUNC, LENGTH, NUMBER, parse_stretch};
use super::controller::Controller;
use fanuc::item::Area;
use fanuc::request::function as f;
use fanuc::wire::{Cursor, Number, Request};

const REJECT: i16 = 13;

pub(super) fn apply_write(controller: &mut Controller, request: &Request) -> Result<(), i16> {
    if usize::try_from(request.arguments[4]) != Ok(request.data.len()) {
        return Err(LENGTH);
    }
    let [first, _, third, ..] = request.arguments;
    match request.function {
        f::PMC_WRITE => write_memory(controller, request),
        f::MACRO_WRITE => {
            let value = read_number(request)?;
            let place = controller.macros.get_mut(&first).ok_or(NUMBER)?;
            *place = value.value();
            Ok(())
        }
        f::TOOL_OFFSET_WRITE => {
            controller.tool_offsets.insert((first, third - 1000), read_number(request)?.mantissa);
            Ok(())
        }
        f::WORK_OFFSET_WRITE => work_offset(controller, first, third, read_number(request)?.mantissa),
        f::PANEL_SIGNALS_WRITE => write_panel_signals(controller, request),
        _ => Err(FUNC),
    }
}

fn read_number(request: &Request) -> Result<Number, i16> {
    let mut cursor = Cursor::new("written number", &request.data);
    let number = Number::read(&mut cursor).map_err(|_| LENGTH)?;
    cursor.check_end().map(|()| number).map_err(|_| LENGTH)
}

fn write_memory(controller: &mut Controller, request: &Request) -> Result<(), i16> {
    let stretch = parse_stretch(request)?;
    if matches!(stretch.area, Area::F | Area::X) {
        return Err(ATTRIB);
    }
    if controller.memory.read(stretch).is_none() {
        return Err(NUMBER);
    }
    if controller.memory.write(stretch, &request.data) { Ok(()) } else { Err(LENGTH) }
}

fn work_offset(controller: &mut Controller, number: i32, axis: i32, value: i32) -> Result<(), i16> {
    if !(0..=54).contains(&number) {
        return Err(NUMBER);
    }
    if !(1..=i32::from(controller.opening.axes)).contains(&axis) {
        return Err(ATTRIB);
    }
    if controller.offsets_only_at_rest && controller.status.run != 0 {
        return Err(REJECT);
    }
    controller.work_offsets.insert((number, axis), value);
    Ok(())
}

/// Bit 5 of the mask is the feed override, which stands at the sixth place.
fn write_panel_signals(controller: &mut Controller, request: &Request) -> Result<(), i16> {
    let mut cursor = Cursor::new("signals of the panel", &request.data);
    let mut signals = [0; 16];
    for signal in &mut signals {
        *signal = cursor.read_i16().map_err(|_| LENGTH)?;
    }
    for (bit, signal) in signals.into_iter().enumerate() {
        if request.arguments[0] >> bit & 1 == 1 {
            controller.panel[bit] = signal;
        }
    }
    Ok(())
}
