//! The one table of what goes over the wire: number of the function, controls that have it, arguments, encoding of the
//! answer, calls of the vendor's library that send it, and where it is known from. The client, the server, the child with
//! the vendor's library and the handbook all take their numbers from here.
//!
//! Numbers within a function (which position, which meter, which word) stand beside the item that they belong to, in
//! [`item`](super::item) and [`word`](super::item::BlockWord). What was confirmed by the vendor's own library or by captured
//! frames is tested with values written by hand, which do not come from this table.

/// Which controls have a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Era {
    /// All.
    All,
    /// Version word 3 and more: 30i, 31i, 32i, 35i, 0i-D, 0i-F.
    Newer,
    /// Version word up to 2: 16i, 18i, 21i, 0i-C and before.
    Older,
}

impl Era {
    fn word(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Newer => "newer",
            Self::Older => "older",
        }
    }
}

/// Where a row is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowOrigin {
    /// Frames of the vendor's library were captured, and the values it made of the answer.
    Captured,
    /// The vendor's library 1.0.5 sends it and makes the expected values of our server's answer.
    Library,
    /// An independent client (pyfanuc) sends it and reads our server's answer.
    Client,
}

impl RowOrigin {
    fn word(self) -> &'static str {
        match self {
            Self::Captured => "captured frames",
            Self::Library => "library 1.0.5",
            Self::Client => "pyfanuc",
        }
    }
}

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TableRow {
    /// What it is about.
    pub name: &'static str,
    /// 1 the numerical control, 2 the PMC.
    pub device: u8,
    /// Number of the function.
    pub function: u16,
    /// Who has it.
    pub era: Era,
    /// Its arguments, in order.
    pub arguments: &'static str,
    /// Its answer.
    pub answer: &'static str,
    /// Calls of the vendor's library that send it.
    pub calls: &'static str,
    /// Where it is known from.
    pub known: RowOrigin,
}

macro_rules! table {
    ($($name:ident = $device:literal $function:literal $era:ident $arguments:literal $answer:literal $library:literal $known:ident;)*) => {
        /// Numbers of the functions.
        pub mod function {
            $(
                #[doc = concat!("Answer: ", $answer, ". Library: ", $library, ".")]
                pub const $name: u16 = $function;
            )*
        }

        /// Every function.
        pub const TABLE: &[TableRow] = &[$(TableRow {
            name: stringify!($name),
            device: $device,
            function: $function,
            era: Era::$era,
            arguments: $arguments,
            answer: $answer,
            calls: $library,
            known: RowOrigin::$known,
        },)*];
    };
}

table! {
    PROGRAM_LIST = 1 0x06 All "first number, most, 1 with comment, 2 with size" "72 bytes each: number i32, size i32, comment 64 bytes" "cnc_rdprogdir3" Library;
    PROGRAM_COUNTS = 1 0x07 All "-" "registered i32, free i32, bytes used i32, bytes free i32" "cnc_rdproginfo" Library;
    TOOL_OFFSET = 1 0x08 All "first, last, 1000 + type (0 + type in ranges, -1 all types)" "number each" "cnc_rdtofs, cnc_rdtofsr" Captured;
    TOOL_OFFSET_WRITE = 1 0x09 All "first, last, 1000 + type, -, 8" "-" "cnc_wrtofs" Captured;
    TOOL_OFFSET_INFO = 1 0x0A All "-" "offsets i32, memory type i16, enabled i16" "cnc_rdtofsinfo, cnc_rdtofsinfo2" Library;
    WORK_OFFSET = 1 0x0B All "first, last, axis (-1 all)" "number each, all axes of an offset together" "cnc_rdzofs, cnc_rdzofsr" Captured;
    WORK_OFFSET_WRITE = 1 0x0C All "first, last, axis, -, 8" "-" "cnc_wrzofs" Captured;
    PARAMETER_OLDER = 1 0x0E Older "first, last, axis (-1 all)" "number i32, axis i16, type i16, i32 per place" "cnc_rdparam" Captured;
    MACRO = 1 0x15 All "first, last" "number each" "cnc_rdmacro, cnc_rdmacror" Captured;
    MACRO_WRITE = 1 0x16 All "first, last, -, -, 8" "-" "cnc_wrmacro" Captured;
    SYSTEM = 1 0x18 All "-" "18 bytes of ODBSYS" "cnc_sysinfo" Captured;
    STATUS = 1 0x19 All "-" "7 i16: mode, run, motion, auxiliary, emergency, alarm, edit" "cnc_statinfo" Captured;
    ALARM_BITS = 1 0x1A All "-" "i32" "cnc_alarm2" Captured;
    FIGURES = 1 0x1B All "what (0 axes)" "count i32, then places in and out i16 each" "cnc_getfigure" Library;
    PROGRAM = 1 0x1C All "-" "running i32, main i32" "cnc_rdprgnum" Captured;
    SEQUENCE = 1 0x1D All "-" "i32" "cnc_rdseqnum" Captured;
    EXECUTED_TEXT = 1 0x20 All "most bytes" "block i32, text" "cnc_rdexecprog" Captured;
    MODAL_GROUP = 1 0x21 All "group (-1 all)" "2 bytes each: code, flag" "cnc_modal 0 to 99, -1" Library;
    MODAL_WORD = 1 0x22 All "word" "value i32, two flags (places after the point in the second), 2 bytes" "cnc_modal 100 to 126" Captured;
    ALARMS = 1 0x23 All "type (-1 all), most, 2 with text, length" "number i32, type i32, axis i32, length i32, text" "cnc_rdalmmsg2" Captured;
    FEED = 1 0x24 All "-" "number" "cnc_actf, cnc_rdspeed" Captured;
    SPINDLE_SPEED = 1 0x25 All "-" "number" "cnc_acts, cnc_rdspeed" Captured;
    POSITION = 1 0x26 All "which, axis (-1 all)" "number each" "cnc_rddynamic2, cnc_absolute2, cnc_rdposition" Captured;
    DIAGNOSIS_OLDER = 1 0x30 Older "first, last, axis (-1 all)" "as a parameter" "cnc_diagnoss" Captured;
    MESSAGES_OLDER = 1 0x34 All "type (-1 all)" "number i32, type i32, length i32, text 256 bytes" "cnc_rdopmsg; cnc_rdopmsg3 on older controls" Library;
    BLOCK_COUNT = 1 0x35 All "-" "i32" "cnc_rdblkcount" Library;
    SPINDLES = 1 0x40 All "which, -1" "number each" "cnc_rdspmeter, cnc_acts2, cnc_rdspload, cnc_rdspgear" Captured;
    CLOCK = 1 0x45 All "0 date, 1 time" "year, month, day, hour, minute, second i16" "cnc_gettimer" Library;
    TOOL_GROUP = 1 0x48 All "-" "next i32, in use i32, selected i32" "cnc_rdtlusegrp" Library;
    TOOL_GROUP_COUNT = 1 0x4A All "-" "i32" "cnc_rdngrp" Library;
    SERVOS = 1 0x56 All "1 load, 2 speed, 3 current" "number each" "cnc_rdsvmeter, cnc_rdaxisdata" Captured;
    TUNING_MODE = 1 0x57 All "-" "i16" "cnc_rdopmode" Captured;
    PANEL_SIGNALS = 1 0x5D All "mask" "16 i16" "cnc_rdopnlsgnl" Captured;
    PANEL_SIGNALS_WRITE = 1 0x5E All "mask, -, -, -, 32" "-" "cnc_wropnlsgnl" Captured;
    ALARM_HISTORY_COUNT = 1 0x6B All "-" "i32" "cnc_rdalmhisno" Library;
    ALARM_HISTORY = 1 0x6C All "first, last, 1" "60 bytes each: number i32, type i32, axis i32, 6 i16 of the time, length i32, text 32 bytes" "cnc_rdalmhistry" Library;
    SPEED_UNIT = 1 0x88 All "3 feed (0 on older controls), 4 spindle, 1 and 2 positions" "unit i16 of a speed, + 3 on newer controls; pairs of i16 per axis for positions" "cnc_rdspeed, cnc_rdposition" Captured;
    AXIS_NAMES = 1 0x89 All "0, or -1 with the names of every position" "4 bytes each; 16 with -1" "cnc_rdaxisname, cnc_rdposition" Captured;
    SPINDLE_NAMES = 1 0x8A All "-1, 1 or 0" "4 bytes each" "cnc_rdspdlname, cnc_rdspmeter" Captured;
    TOOL_LIFE = 1 0x8B All "first group, last group" "group i32, tools i32, -, life i32, -, count i32" "cnc_rdntool, cnc_rdlife, cnc_rdcount" Library;
    PARAMETER = 1 0x8D Newer "first, last, axis (-1 all)" "number i32, axis i16, type i16, number per place" "cnc_rdparam" Captured;
    DIAGNOSIS = 1 0x93 Newer "first, last, axis (-1 all)" "as a parameter" "cnc_diagnoss" Captured;
    G_CODES = 1 0x96 All "group (-1 all), block" "12 bytes each: group i16, flag i16, code i32, -, places i16" "cnc_rdgcode" Library;
    COMMANDS = 1 0x97 All "word (-1 all), block" "12 bytes each: letter, number, flags i16, value i32, places i32" "cnc_rdcommand" Library;
    TOOL_MODE = 1 0x98 All "-" "i16" "cnc_statinfo" Captured;
    POSITION_SHOWN = 1 0xA3 Newer "0, -1" "bits i32 per axis" "cnc_rdposition" Library;
    COUNT = 1 0xA4 All "0 axes, 1 spindles, 2 axis drives, 3 spindles" "i16" "cnc_rdsvmeter, cnc_rdspmeter" Captured;
    MACRO_DOUBLE = 1 0xA7 All "first, count" "f64 each" "cnc_rdmacror2" Library;
    CURRENT_FOLDER = 1 0xB0 Newer "1 foreground, 2 background" "256 bytes" "cnc_rdpdf_curdir" Library;
    FOLDER = 1 0xB3 Newer "first, most, type, size, 256 = path" "128 bytes each" "-" Client;
    FOLDER_COUNTS = 1 0xB4 Newer "-, -, -, -, 256 = path" "folders i32, files i32" "-" Client;
    MAIN_PROGRAM = 1 0xB9 Newer "-" "256 bytes" "-" Client;
    PROGRAM_NAME = 1 0xCF All "-" "number i32, name 36 bytes" "cnc_exeprgname" Captured;
    MESSAGES = 1 0xD0 Newer "0, type (-1 all), most" "number i32, type i32, length i32, text 256 bytes" "cnc_rdopmsg3" Library;
    HANDLE_RETRACE = 1 0xE1 All "-" "i16" "cnc_statinfo" Captured;
    STATUS_LONG = 1 0xE2 All "-" "11 i16" "cnc_statinfo2" Captured;
    CNC_ID = 1 0xE8 All "-" "4 u32" "cnc_rdcncid" Library;
    PROGRAM_PATH = 1 0xFC All "-" "256 bytes" "cnc_exeprgname2" Captured;
    TIMER = 1 0x120 All "which" "minutes i32, milliseconds i32" "cnc_rdtimer" Captured;
    TOOL_GROUP_OPTION = 1 0x1BF Newer "first group, last group" "group i32, optional number i32" "cnc_rdtlusegrp" Library;
    PMC_READ = 2 0x8001 All "first byte, last byte, area, width" "elements" "pmc_rdpmcrng" Captured;
    PMC_WRITE = 2 0x8002 All "first byte, last byte, area, width, length" "-" "pmc_wrpmcrng" Captured;
}

/// The table for the handbook. Integers are big-endian; a *number* is a mantissa i32, a base and an exponent i16.
#[must_use]
pub fn markdown() -> String {
    let head = "| function | controls | arguments | answer | library | known from |\n|---|---|---|---|---|---|\n";
    let row = |row: &TableRow| {
        format!(
            "| {}/{:02X} {} | {} | {} | {} | {} | {} |\n",
            row.device,
            row.function,
            row.name.to_lowercase().replace('_', " "),
            row.era.word(),
            row.arguments,
            row.answer,
            row.calls,
            row.known.word()
        )
    };
    head.to_owned() + &TABLE.iter().map(row).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_function_stands_twice() {
        for (index, row) in TABLE.iter().enumerate() {
            assert!(TABLE[..index].iter().all(|other| (other.device, other.function) != (row.device, row.function)));
        }
    }
}
