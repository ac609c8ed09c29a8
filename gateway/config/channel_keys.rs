//! The keys of `[[source.channel]]`: the user's own channels.

use super::keys::{Absent, ConfigKey, ValueKind};

/// The section, below a source.
pub(super) const SECTION: &str = "source.channel";

const fn key(name: &'static str, kind: ValueKind, absent: Absent, en: &'static str, zh: &'static str) -> ConfigKey {
    ConfigKey { section: SECTION, name, kind, absent, en, zh }
}

/// Greatest number that a scale or a limit can have.
const GREATEST: f64 = 1e12;

pub(super) const KEYS: [ConfigKey; 9] = [
    key(
        "name",
        ValueKind::Text,
        Absent::Required,
        "Name of the channel, the unit last: clamping_pressure_bar",
        "通道名称",
    ),
    key(
        "read",
        ValueKind::Text,
        Absent::Required,
        "What is read: macro 500, parameter 6711, diagnosis 301 axis 1, pmc R100.3, pmc D20 word, tool_offset 1 type 3",
        "读取内容",
    ),
    key(
        "unit",
        ValueKind::Text,
        Absent::Default("\"1\""),
        "Unit of the value after the scale; 1 for a pure number",
        "单位",
    ),
    key(
        "scale",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Default("1.0"),
        "What is read times this is the value",
        "比例",
    ),
    key(
        "offset",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Default("0.0"),
        "Added after the scale, in the unit",
        "偏移",
    ),
    key(
        "least",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Default("-1000000.0"),
        "Least possible value, in the unit",
        "最小值",
    ),
    key(
        "greatest",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Default("1000000.0"),
        "Greatest possible value, in the unit",
        "最大值",
    ),
    key(
        "pace",
        ValueKind::OneOf(&["slow", "fast"]),
        Absent::Default("\"slow\""),
        "slow with parts and times, fast with motion and states",
        "读取节奏",
    ),
    key(
        "path",
        ValueKind::Number(1.0, 10.0),
        Absent::Optional,
        "Path of the control; default: that of the address",
        "通道号",
    ),
];
