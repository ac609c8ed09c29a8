//! The rows of the table of keys that concern what may be written to the machine.

use super::config_key::Absent::{Default, Optional};
use super::config_key::ValueKind::{Flag, Number, OneOf, Text};
use super::config_key::{ConfigKey, new_key};

/// Keys of `[gate]` and `[gate.offset]`.
pub(super) const GATE: &[ConfigKey] = &[
    new_key(
        ("gate", "mode"),
        OneOf(&["off", "shadow", "armed"]),
        Default("\"shadow\""),
        "off: decide nothing. shadow: decide and record, write nothing. armed: may be armed on the box",
        "写入方式：关闭、影子、允许",
    ),
    new_key(
        ("gate", "source"),
        Text,
        Optional,
        "Name of the source whose feed override may be written",
        "可写入的数据源",
    ),
    new_key(
        ("gate", "min_pct"),
        Number(10.0, 100.0),
        Default("50.0"),
        "Least feed override ever written; no script can widen the band",
        "最小进给倍率",
    ),
    new_key(
        ("gate", "max_pct"),
        Number(100.0, 200.0),
        Default("120.0"),
        "Greatest feed override ever written; no script can widen the band",
        "最大进给倍率",
    ),
    new_key(
        ("gate", "slew_up_pct_per_s"),
        Number(0.1, 100.0),
        Default("10.0"),
        "Greatest rise of the override per second",
        "倍率上升速率限制",
    ),
    new_key(
        ("gate", "slew_down_pct_per_s"),
        Number(0.1, 254.0),
        Default("50.0"),
        "Greatest fall of the override per second",
        "倍率下降速率限制",
    ),
    new_key(
        ("gate", "above_dial"),
        Flag,
        Default("false"),
        "The ladder multiplies the dial with the gateway's override, which may then exceed it; false: it takes the lesser one",
        "梯形图将面板倍率与网关倍率相乘（可高于面板）；false：取较小者",
    ),
    new_key(
        ("gate", "dead_band_pct"),
        Number(0.0, 20.0),
        Default("2.0"),
        "A request that differs less than this from the one in force changes nothing; 100 is always taken",
        "倍率死区",
    ),
    new_key(
        ("gate", "min_interval_s"),
        Number(0.0, 10.0),
        Default("0.2"),
        "Least time between two changes of the override; going back to 100 never waits",
        "两次修改的最短间隔（秒）",
    ),
    new_key(
        ("gate", "heartbeat_s"),
        Number(0.05, 5.0),
        Default("0.3"),
        "The sign of life is written this often while armed; at most a third of the time after which the ladder falls back",
        "心跳周期（秒）",
    ),
    new_key(
        ("gate", "stale_s"),
        Number(0.05, 10.0),
        Default("0.5"),
        "Data older than this holds 100 %; at most two polling periods is sensible",
        "数据过期时间（秒）",
    ),
    new_key(
        ("gate", "armed_for_s"),
        Number(1.0, 86400.0),
        Default("28800.0"),
        "Arming ends by itself after this time",
        "允许写入的有效时间（秒）",
    ),
    new_key(
        ("gate.offset", "mode"),
        OneOf(&["off", "shadow", "armed"]),
        Default("\"off\""),
        "off: proposals are recorded only. shadow: decide and record. armed: written while the gate is armed on the box",
        "热误差补偿量：关闭、影子、允许写入",
    ),
    new_key(
        ("gate.offset", "source"),
        Text,
        Optional,
        "Name of the source whose offsets may be written; default: that of [gate]",
        "可写入补偿量的数据源",
    ),
    new_key(
        ("gate.offset", "axes"),
        Text,
        Optional,
        "Axes that may be shifted, for example \"z\" or \"x z\"",
        "允许补偿的轴",
    ),
    new_key(
        ("gate.offset", "step_um"),
        Number(1.0, 100.0),
        Default("5.0"),
        "Greatest change of an offset at a time",
        "单次最大修改量（微米）",
    ),
    new_key(
        ("gate.offset", "total_um"),
        Number(1.0, 500.0),
        Default("50.0"),
        "Greatest shift from what the operator has set",
        "最大总补偿量（微米）",
    ),
    new_key(
        ("gate.offset", "min_interval_s"),
        Number(1.0, 86400.0),
        Default("60.0"),
        "Least time between two writes of offsets",
        "两次写入的最短间隔（秒）",
    ),
    new_key(
        ("gate.offset", "on_disarm"),
        OneOf(&["restore", "keep"]),
        Default("\"restore\""),
        "After disarming and at the end: give back what the operator had set, as soon as no program runs, or leave the shift",
        "解除后：恢复操作者设定值，或保持补偿",
    ),
];
