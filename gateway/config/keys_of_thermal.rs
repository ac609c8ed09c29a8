//! The keys of the thermal law that the box runs.

use super::config_key::Absent::{Default, Optional};
use super::config_key::ValueKind::{Flag, Number, OneOf, Path};
use super::config_key::{ConfigKey, new_key};

pub(super) const THERMAL: &[ConfigKey] = &[
    new_key(
        ("thermal", "model"),
        Path,
        Optional,
        "Thermal law (thermal/1) that identify thermal --model writes; relative to this file; without it nothing is predicted",
        "热误差模型文件",
    ),
    new_key(("thermal", "axis"), OneOf(&["x", "y", "z"]), Default("\"z\""), "Axis whose error it predicts", "补偿轴"),
    new_key(
        ("thermal", "propose"),
        Flag,
        Default("false"),
        "Propose the offset against the predicted error; [gate.offset] decides what becomes of it",
        "向闸门建议补偿量",
    ),
    new_key(
        ("thermal", "learn"),
        Flag,
        Default("true"),
        "Every reading of thermal_error_um corrects the law by a bounded step",
        "由测头读数修正模型",
    ),
    new_key(
        ("thermal", "step_um"),
        Number(0.1, 100.0),
        Default("3.0"),
        "Greatest change of the prediction by one reading",
        "单次读数的最大修正量（微米）",
    ),
    new_key(
        ("thermal", "total_um"),
        Number(0.1, 1000.0),
        Default("30.0"),
        "Greatest change of the prediction by all readings; beyond it identify the law again",
        "全部读数的最大累计修正量（微米）",
    ),
    new_key(
        ("thermal", "limit_um"),
        Number(1.0, 1000.0),
        Default("60.0"),
        "Greatest offset that is proposed, and greatest sum of pulses",
        "补偿量限幅（微米）",
    ),
    new_key(
        ("thermal", "slew_um_per_s"),
        Number(0.001, 10.0),
        Default("0.2"),
        "Greatest change of the offset per second: faster ones would show on the work",
        "补偿量限速（微米/秒）",
    ),
    new_key(
        ("thermal", "dead_band_um"),
        Number(0.0, 50.0),
        Default("1.0"),
        "A prediction that moved less changes nothing",
        "死区（微米）",
    ),
    new_key(
        ("thermal", "hold_s"),
        Number(0.0, 86400.0),
        Default("600.0"),
        "Without a prediction to believe the offset stands for so long, then goes back to 0",
        "无有效预测时的保持时间（秒）",
    ),
    new_key(
        ("thermal", "pulse_um"),
        Number(0.01, 100.0),
        Default("1.0"),
        "Length of one pulse of the encoder that pulses are inserted into",
        "脉冲当量（微米）",
    ),
];
