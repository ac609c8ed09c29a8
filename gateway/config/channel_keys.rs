//! The keys of `[[source.channel]]`: the user's own channels.

use super::config_key::{Absent, ConfigKey, ValueKind};
use adapters::channel::quantity::LIMITS;

/// The section, below a source.
pub(super) const SECTION: &str = "source.channel";

const fn new_channel_key(
    name: &'static str,
    kind: ValueKind,
    absent: Absent,
    en: &'static str,
    zh: &'static str,
) -> ConfigKey {
    ConfigKey { section: SECTION, name, kind, absent, en, zh }
}

/// Words of the key `quantity`.
const QUANTITIES: [&str; LIMITS.len()] = {
    let mut words = [""; LIMITS.len()];
    let mut at = 0;
    while at < words.len() {
        words[at] = LIMITS[at].0;
        at += 1;
    }
    words
};

/// Greatest number that a scale or a limit can have.
const GREATEST: f64 = 1e12;

pub(super) const KEYS: [ConfigKey; 11] = [
    new_channel_key(
        "name",
        ValueKind::Text,
        Absent::Required,
        "Name of the channel, the unit last: clamping_pressure_bar",
        "通道名称",
    ),
    new_channel_key(
        "read",
        ValueKind::Text,
        Absent::Required,
        "What is read, in the words of the source: pmc D20 word, AXIS@5/MOTOR/TEMPERATURE, register D120, input 52 f32",
        "读取内容",
    ),
    new_channel_key(
        "quantity",
        ValueKind::OneOf(&QUANTITIES),
        Absent::Optional,
        "What it is: gives unit, least and greatest where they are left out",
        "物理量",
    ),
    new_channel_key(
        "unit",
        ValueKind::Text,
        Absent::Optional,
        "Unit of the value after the scale; 1 for a pure number, text for a text; default: that of the quantity, else 1",
        "单位",
    ),
    new_channel_key(
        "scale",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Default("1.0"),
        "What is read times this is the value",
        "比例",
    ),
    new_channel_key(
        "offset",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Default("0.0"),
        "Added after the scale, in the unit",
        "偏移",
    ),
    new_channel_key(
        "least",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Optional,
        "Least possible value, in the unit; default: that of the quantity, else -1000000",
        "最小值",
    ),
    new_channel_key(
        "greatest",
        ValueKind::Number(-GREATEST, GREATEST),
        Absent::Optional,
        "Greatest possible value, in the unit; default: that of the quantity, else 1000000",
        "最大值",
    ),
    new_channel_key(
        "pace",
        ValueKind::OneOf(&["slow", "fast"]),
        Absent::Default("\"slow\""),
        "slow with parts and times, fast with motion and states",
        "读取节奏",
    ),
    new_channel_key(
        "path",
        ValueKind::Number(1.0, 10.0),
        Absent::Optional,
        "Path of the control; default: that of the address",
        "通道号",
    ),
    new_channel_key(
        "encoding",
        ValueKind::Text,
        Absent::Optional,
        "Character set of a text, for example gbk; default: that of the source",
        "字符编码",
    ),
];
