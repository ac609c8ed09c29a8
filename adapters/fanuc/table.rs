//! The one table of what goes over the wire: number of the function, controls that have it, arguments, encoding of the
//! answer, calls of the vendor's library that send it, and where it is known from. The client, the server, the child with
//! the vendor's library and the handbook all take their numbers from here.
//!
//! Behind every field of an answer stands who has seen it there: `(L)` the vendor's library 1.0.5 (x64), which was given answers
//! in which every byte differs, or our server's, and made the value of it; `(C)` the independent client pyfanuc reading our
//! server; `(D)` a document; `(-)` nobody. No real control was there: what one sends in these places was seen by nobody.
//!
//! Numbers within a function (which position, which meter, which word) stand beside the item that they belong to, in
//! [`item`](super::item) and [`as_word`](super::item::BlockWord). What was confirmed by the vendor's own library or by captured
//! frames is tested with values written by hand, which do not come from this table.

/// Which controls have a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Era {
    /// Every control, whatever its version word.
    All,
    /// Version word 3 and more: 30i, 31i, 32i, 35i, 0i-D, 0i-F.
    Newer,
    /// Version word up to 2: 16i, 18i, 21i, 0i-C and before.
    Older,
}

impl Era {
    fn as_word(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Newer => "newer",
            Self::Older => "older",
        }
    }
}

/// Who asks with a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowOrigin {
    /// The vendor's library 1.0.5.
    Library,
    /// An independent client (pyfanuc).
    Client,
}

impl RowOrigin {
    fn as_word(self) -> &'static str {
        match self {
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
    /// Which controls have the function.
    pub era: Era,
    /// Its arguments, in order.
    pub arguments: &'static str,
    /// The fields of its answer, each with who has seen it there.
    pub answer: &'static str,
    /// Calls of the vendor's library that send it.
    pub calls: &'static str,
    /// Who asks with it.
    pub origin: RowOrigin,
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

        /// Every function that is known, a row for each.
        pub const TABLE: &[TableRow] = &[$(TableRow {
            name: stringify!($name),
            device: $device,
            function: $function,
            era: Era::$era,
            arguments: $arguments,
            answer: $answer,
            calls: $library,
            origin: RowOrigin::$known,
        },)*];
    };
}

table! {
    PROGRAM_LIST = 1 0x06 All "first number, most, 1 with comment, 2 with size" "72 bytes each: number i32 (L), size i32 (L), comment 64 bytes (L)" "cnc_rdprogdir3" Library;
    PROGRAM_COUNTS = 1 0x07 All "-" "registered i32 (L), free i32 (L), bytes used i32 (L), bytes free i32 (L)" "cnc_rdproginfo" Library;
    TOOL_OFFSET = 1 0x08 All "first, last, 1000 + type (0 + type in ranges, -1 all types)" "number each: mantissa (L), places (-)" "cnc_rdtofs, cnc_rdtofsr" Library;
    TOOL_OFFSET_WRITE = 1 0x09 All "first, last, 1000 + type, -, 8" "-" "cnc_wrtofs" Library;
    TOOL_OFFSET_INFO = 1 0x0A All "-" "offsets i32 (L), memory type i16 (L), enabled i16 (L)" "cnc_rdtofsinfo, cnc_rdtofsinfo2" Library;
    WORK_OFFSET = 1 0x0B All "first, last, axis (-1 all)" "numbers of all axes of an offset together: mantissa (L), places (-)" "cnc_rdzofs, cnc_rdzofsr" Library;
    WORK_OFFSET_WRITE = 1 0x0C All "first, last, axis, -, 8" "-" "cnc_wrzofs" Library;
    PARAMETER_OLDER = 1 0x0E Older "first, last, axis (-1 all)" "number i32 (L), axis i16 (L), type i16 (L), i32 per place (L), number per place of a real (L)" "cnc_rdparam" Library;
    MACRO = 1 0x15 All "first, last" "number each: mantissa (L), base (L), exponent (L)" "cnc_rdmacro, cnc_rdmacror" Library;
    MACRO_WRITE = 1 0x16 All "first, last, -, -, 8" "-" "cnc_wrmacro" Library;
    SYSTEM = 1 0x18 All "-" "18 bytes of ODBSYS (L)" "cnc_sysinfo" Library;
    STATUS = 1 0x19 All "-" "7 i16: mode (L), run (L), motion (L), auxiliary (L), emergency (L), alarm (L), edit (L)" "cnc_statinfo" Library;
    ALARM_BITS = 1 0x1A All "-" "i32 (L)" "cnc_alarm2" Library;
    FIGURES = 1 0x1B All "what (0 axes)" "count i32 (L), places in and out i16 each (L)" "cnc_getfigure" Library;
    PROGRAM = 1 0x1C All "-" "running i32 (L), main i32 (L)" "cnc_rdprgnum" Library;
    SEQUENCE = 1 0x1D All "-" "i32 (L)" "cnc_rdseqnum" Library;
    EXECUTED_TEXT = 1 0x20 All "most bytes" "block i32 (L), text (L)" "cnc_rdexecprog" Library;
    MODAL_GROUP = 1 0x21 All "group (-1 all)" "2 bytes each: code (L), flag (-)" "cnc_modal 0 to 99, -1" Library;
    MODAL_WORD = 1 0x22 All "word" "value i32 (L), byte 4 (-), flag1 byte 5 (L), byte 6 (-), flag2 byte 7 which is the places (L)" "cnc_modal 100 to 126" Library;
    ALARMS = 1 0x23 All "type (-1 all), most, 2 with text, length" "number i32 (L), type i32 (L), axis i32 (L), length i32 (L), text (L)" "cnc_rdalmmsg2" Library;
    FEED = 1 0x24 All "-" "number: mantissa (L), base (-), places (L)" "cnc_actf, cnc_rdspeed" Library;
    SPINDLE_SPEED = 1 0x25 All "-" "number: mantissa (L), base (-), places (L)" "cnc_acts, cnc_rdspeed" Library;
    POSITION = 1 0x26 All "which, axis (-1 all)" "number each: mantissa (L), base (-), places (L)" "cnc_rddynamic2, cnc_absolute2, cnc_rdposition" Library;
    DIAGNOSIS_OLDER = 1 0x30 Older "first, last, axis (-1 all)" "as a parameter (L)" "cnc_diagnoss" Library;
    MESSAGES_OLDER = 1 0x34 All "type (-1 all)" "number i32 (L), type i32 (L), length i32 (L), text 256 bytes (L)" "cnc_rdopmsg; cnc_rdopmsg3 on older controls" Library;
    BLOCK_COUNT = 1 0x35 All "-" "i32 (L)" "cnc_rdblkcount" Library;
    SPINDLES = 1 0x40 All "which, -1" "number each: mantissa and places of load and motor speed (L), low half of the mantissa of plain load and gear and greatest speed (L), places of the speed (-)" "cnc_rdspmeter, cnc_acts2, cnc_rdspload, cnc_rdspgear" Library;
    CLOCK = 1 0x45 All "0 date, 1 time" "year (L), month (L), day (L), hour (L), minute (L), second i16 (L)" "cnc_gettimer" Library;
    TOOL_GROUP = 1 0x48 All "-" "next i32 (L), in use i32 (L), selected i32 (L)" "cnc_rdtlusegrp" Library;
    TOOL_GROUP_COUNT = 1 0x4A All "-" "i32 (L)" "cnc_rdngrp" Library;
    SERVOS = 1 0x56 All "1 load, 2 speed, 3 current" "number each: mantissa (L), base (-), places (L)" "cnc_rdsvmeter, cnc_rdaxisdata" Library;
    TUNING_MODE = 1 0x57 All "-" "i16 (L)" "cnc_rdopmode" Library;
    PANEL_SIGNALS = 1 0x5D All "mask" "mode i16 (L), feed override at the sixth place (L), the other 14 i16 (-)" "cnc_rdopnlsgnl" Library;
    PANEL_SIGNALS_WRITE = 1 0x5E All "mask, -, -, -, 32" "-" "cnc_wropnlsgnl" Library;
    ALARM_HISTORY_COUNT = 1 0x6B All "-" "i32 (L)" "cnc_rdalmhisno" Library;
    ALARM_HISTORY = 1 0x6C All "first, last, 1" "60 bytes each: number i32 (L), type i32 (L), axis i32 (L), 6 i16 of the time (L), length i32 (L), text 32 bytes (L)" "cnc_rdalmhistry" Library;
    SPEED_UNIT = 1 0x88 All "3 feed (0 on older controls), 4 spindle, 1 and 2 positions" "unit i16 of a speed and 3 more on newer controls (L), pairs per axis for positions: unit in work coordinates i16 (L), in machine coordinates i16 (L), what the numbers mean (D)" "cnc_rdspeed, cnc_rdposition" Library;
    AXIS_NAMES = 1 0x89 All "0, or -1 with the names of every position" "4 bytes each or 16 with -1: letter (L), second letter (L), third (L), last (-)" "cnc_rdaxisname, cnc_rdposition" Library;
    SPINDLE_NAMES = 1 0x8A All "-1, 1 or 0" "4 bytes each: letter (L), second letter (L), the rest (-)" "cnc_rdspdlname, cnc_rdspmeter" Library;
    TOOL_LIFE = 1 0x8B All "first group, last group" "group i32 (-), tools i32 (L), i32 (-), life i32 (L), i32 (-), count i32 (L)" "cnc_rdntool, cnc_rdlife, cnc_rdcount" Library;
    PARAMETER = 1 0x8D Newer "first, last, axis (-1 all)" "number i32 (L), axis i16 (L), type i16 (L), number per place: mantissa (L), places of a real (L)" "cnc_rdparam" Library;
    DIAGNOSIS = 1 0x93 Newer "first, last, axis (-1 all)" "as a parameter (L)" "cnc_diagnoss" Library;
    G_CODES = 1 0x96 All "group (-1 all), block" "12 bytes each: group i16 (L), flag i16 (L), code i32 (L), i16 (-), places i16 (L)" "cnc_rdgcode" Library;
    COMMANDS = 1 0x97 All "word (-1 all), block" "12 bytes each: letter (L), number (L), flags i16 (L), value i32 (L), places i32 (-)" "cnc_rdcommand" Library;
    TOOL_MODE = 1 0x98 All "-" "i16 (L)" "cnc_statinfo" Library;
    POSITION_SHOWN = 1 0xA3 Newer "0, -1" "bits i32 per axis (L)" "cnc_rdposition" Library;
    COUNT = 1 0xA4 All "0 axes, 1 spindles, 2 axis drives, 3 spindles" "i16 (L)" "cnc_rdsvmeter, cnc_rdspmeter" Library;
    MACRO_DOUBLE = 1 0xA7 All "first, count" "f64 each (L)" "cnc_rdmacror2" Library;
    CURRENT_FOLDER = 1 0xB0 Newer "1 foreground, 2 background" "256 bytes (L)" "cnc_rdpdf_curdir" Library;
    FOLDER = 1 0xB3 Newer "first, most, type, size, 256 = path" "128 bytes each (C)" "-" Client;
    FOLDER_COUNTS = 1 0xB4 Newer "-, -, -, -, 256 = path" "folders i32 (C), files i32 (C)" "-" Client;
    MAIN_PROGRAM = 1 0xB9 Newer "-" "256 bytes (C)" "-" Client;
    PROGRAM_NAME = 1 0xCF All "-" "number i32 (L), name 36 bytes (L)" "cnc_exeprgname" Library;
    MESSAGES = 1 0xD0 Newer "0, type (-1 all), most" "number i32 (L), type i32 (L), length i32 (L), text 256 bytes (L)" "cnc_rdopmsg3" Library;
    HANDLE_RETRACE = 1 0xE1 All "-" "i16 (L)" "cnc_statinfo" Library;
    STATUS_LONG = 1 0xE2 All "-" "11 i16 (L)" "cnc_statinfo2" Library;
    CNC_ID = 1 0xE8 All "-" "4 u32 (L)" "cnc_rdcncid" Library;
    PROGRAM_PATH = 1 0xFC All "-" "256 bytes (L)" "cnc_exeprgname2" Library;
    TIMER = 1 0x120 All "which" "minutes i32 (L), milliseconds i32 (L)" "cnc_rdtimer" Library;
    TOOL_GROUP_OPTION = 1 0x1BF Newer "first group, last group" "group i32 (-), optional number i32 (-)" "cnc_rdtlusegrp" Library;
    PMC_READ = 2 0x8001 All "first byte, last byte, area, width" "elements (L)" "pmc_rdpmcrng" Library;
    PMC_WRITE = 2 0x8002 All "first byte, last byte, area, width, length" "-" "pmc_wrpmcrng" Library;
}

/// The table for the handbook. Integers are big-endian; a *number* is a mantissa i32, a base and an exponent i16.
#[must_use]
pub fn format_markdown() -> String {
    let head = "| function | controls | arguments | answer | library | asked by |\n|---|---|---|---|---|---|\n";
    let row = |row: &TableRow| {
        format!(
            "| {}/{:02X} {} | {} | {} | {} | {} | {} |\n",
            row.device,
            row.function,
            row.name.to_lowercase().replace('_', " "),
            row.era.as_word(),
            row.arguments,
            row.answer,
            row.calls,
            row.origin.as_word()
        )
    };
    head.to_owned() + &TABLE.iter().map(row).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_says_who_has_seen_it() {
        for row in TABLE.iter().filter(|row| row.answer != "-") {
            for field in row.answer.split(", ") {
                let seen = ["(L)", "(C)", "(D)", "(-)"].iter().any(|mark| field.ends_with(mark));
                assert!(seen, "{}: {field}", row.name);
            }
        }
    }

    #[test]
    fn no_function_stands_twice() {
        for (index, row) in TABLE.iter().enumerate() {
            assert!(TABLE[..index].iter().all(|other| (other.device, other.function) != (row.device, row.function)));
        }
    }
}
