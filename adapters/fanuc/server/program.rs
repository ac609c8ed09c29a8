//! Programs: what runs, what there is, and the modal state of the block.

use super::answer_form::{ATTRIB, Data8, NUMBER};
use super::controller::{Controller, ProgramFile};
use super::encode::{convert_to_i32, encode_longs, encode_shorts, encode_text};
use adapter_core::integer::clamp_count;
use fanuc::item::BlockWord;
use fanuc::wire::{Number, Request};

/// The folder that older clients and the library mean when they name none.
pub(super) const FOLDER: &str = "//CNC_MEM/USER/PATH1/";

/// Longest list of a directory in one answer.
const LISTED_MAX: usize = 20;

/// Bit of the flag of a modal word: a decimal point was written.
const DECIMAL_POINT: u8 = 0x40;

/// Bytes of memory for programs of which those that are there take their part.
const MEMORY_BYTES: i32 = 512 * 1024;

pub(super) fn encode_name(controller: &Controller) -> Vec<u8> {
    let name = format!("O{}", controller.program.0);
    [encode_longs(&[controller.program.0]), encode_text(&name, 36)].concat()
}

pub(super) fn encode_executed_text(controller: &Controller, most: i32) -> Vec<u8> {
    let most = clamp_count(most, controller.executed.1.len());
    let text = controller.executed.1.as_bytes().get(..most).unwrap_or_default();
    [&encode_longs(&[controller.executed.0])[..], text].concat()
}

/// Programs from a number on; what there is besides the number follows from the kind.
pub(super) fn encode_list(controller: &Controller, first: i32, most: i32) -> Vec<u8> {
    let most = clamp_count(most, LISTED_MAX);
    let record =
        |file: &ProgramFile| [encode_longs(&[file.number, file.bytes]), encode_text(&file.comment, 64)].concat();
    controller.programs.iter().filter(|file| file.number >= first).take(most).flat_map(record).collect()
}

pub(super) fn encode_counts(controller: &Controller) -> Vec<u8> {
    let used: i32 = controller.programs.iter().map(|file| file.bytes).sum();
    let known = convert_to_i32(controller.programs.len());
    encode_longs(&[known, 400 - known.min(400), used, MEMORY_BYTES - used.min(MEMORY_BYTES)])
}

/// The path that a request about a folder carries.
fn is_folder(request: &Request) -> bool {
    let end = request.data.iter().position(|byte| *byte == 0).unwrap_or(request.data.len());
    let asked = String::from_utf8_lossy(&request.data[..end]);
    asked.trim_end_matches('/').eq_ignore_ascii_case(FOLDER.trim_end_matches('/'))
}

pub(super) fn folder_counts(controller: &Controller, request: &Request) -> Data8 {
    if is_folder(request) { Ok(encode_longs(&[0, convert_to_i32(controller.programs.len())])) } else { Err(NUMBER) }
}

/// Files of the folder: kind, time, size, attributes, name, comment, and the time of the last run.
pub(super) fn encode_folder(controller: &Controller, request: &Request) -> Data8 {
    if !is_folder(request) {
        return Err(NUMBER);
    }
    let [first, most, ..] = request.arguments.map(|argument| clamp_count(argument, usize::MAX));
    let entry = |file: &ProgramFile| {
        let time = encode_shorts(&controller.clock);
        let sizes = encode_longs(&[file.bytes, 0]);
        let (name, comment) = (encode_text(&format!("O{:04}", file.number), 36), encode_text(&file.comment, 52));
        [encode_shorts(&[1]), time.clone(), vec![0; 6], sizes, name, comment, time].concat()
    };
    Ok(controller.programs.iter().skip(first).take(most.min(LISTED_MAX)).flat_map(entry).collect())
}

pub(super) fn modal_word(controller: &Controller, number: i32) -> Data8 {
    let word = BlockWord::of_number(number).ok_or(NUMBER)?;
    let value = controller.modal_words.get(&word).ok_or(NUMBER)?;
    let places = u8::try_from(value.exponent).map_err(|_| NUMBER)?;
    let flag = if places > 0 { DECIMAL_POINT } else { 0 };
    Ok([&encode_longs(&[value.mantissa])[..], &[0, flag, 0, places]].concat())
}

pub(super) fn encode_modal_groups(controller: &Controller, group: i32) -> Data8 {
    if group == -1 {
        return Ok(controller.modal_groups.values().flat_map(|code| [*code, 0]).collect());
    }
    controller.modal_groups.get(&group).map(|code| vec![*code, 0]).ok_or(NUMBER)
}

/// G codes as the program writes them: group, flag, code with its places.
pub(super) fn g_codes(controller: &Controller, group: i32) -> Data8 {
    let record = |(group, code): (&i16, &Number)| {
        [encode_shorts(&[*group, 1]), encode_longs(&[code.mantissa]), encode_shorts(&[0, code.exponent])].concat()
    };
    let wanted: Vec<u8> = controller
        .g_codes
        .iter()
        .filter(|(own, _)| group == -1 || i32::from(**own) == group)
        .flat_map(record)
        .collect();
    if wanted.is_empty() { Err(ATTRIB) } else { Ok(wanted) }
}

/// Words of the block: letter, number of the M, flags, value, places. `which` counts the letters from A.
pub(super) fn encode_commands(controller: &Controller, which: i32) -> Data8 {
    let letter = |word: BlockWord| format!("{word:?}").bytes().next().unwrap_or(b'?');
    let is_wanted = |word: BlockWord| which == -1 || i32::from(letter(word) - b'A') == which;
    let words = controller.modal_words.iter().filter(|(word, value)| {
        !matches!(word, BlockWord::Unused14 | BlockWord::Unused15)
            && is_wanted(**word)
            && (which != -1 || value.mantissa != 0)
    });
    let record = |(word, value): (&BlockWord, &Number)| {
        let head = vec![letter(*word), 0, 0, 1];
        [head, encode_longs(&[value.mantissa, i32::from(value.exponent)])].concat()
    };
    let found: Vec<u8> = words.flat_map(record).collect();
    if found.is_empty() && which != -1 { Err(ATTRIB) } else { Ok(found) }
}
