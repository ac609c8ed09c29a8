//! Channels of the further paths of a controller: a lathe with two turrets has a program, a state and a feed for each.
//!
//! One path keeps the plain names, so that everything that knows one path knows it unchanged: the one that is written to,
//! usually path 1. What belongs to another path N is called `pathN_` and the plain name: `path2_spindle_speed_rpm`. The
//! unit stays at the end of the name.

use super::Kind::{Continuous, Held};
use super::{Channel, flag, number, text};

/// Paths that have channels.
pub const PATHS: std::ops::RangeInclusive<u8> = 1..=3;

/// Name of a channel of a path from 1 that has not the plain names.
#[must_use]
pub fn on_path(name: &str, path: u8) -> String {
    format!("path{path}_{name}")
}

macro_rules! numbered {
    ($path:literal, $name:literal, $unit:literal, $range:expr, $kind:expr, $en:literal, $zh:literal) => {
        number(
            concat!("path", $path, "_", $name),
            $unit,
            $range,
            $kind,
            concat!($en, ", path ", $path),
            concat!("通道", $path, $zh),
        )
    };
}

macro_rules! named {
    ($path:literal, $name:literal, $en:literal, $zh:literal) => {
        text(concat!("path", $path, "_", $name), concat!($en, ", path ", $path), concat!("通道", $path, $zh))
    };
}

/// Motion goes both ways.
const SPEEDS: (f64, f64) = (-100_000.0, 100_000.0);
const PLACES: (f64, f64) = (-100_000.0, 100_000.0);
const FEEDS: (f64, f64) = (0.0, 200_000.0);
const OVERRIDES: (f64, f64) = (0.0, 254.0);
const LOADS: (f64, f64) = (-500.0, 500.0);

macro_rules! path {
    ($number:literal) => {
        [
            numbered!($number, "spindle_programmed_rpm", "rpm", SPEEDS, Held, "Commanded spindle speed before overrides", "主轴编程转速"),
            numbered!($number, "feed_programmed_mm_min", "mm/min", FEEDS, Held, "Commanded feed before overrides", "编程进给速度"),
            numbered!($number, "spindle_speed_rpm", "rpm", SPEEDS, Continuous, "Actual spindle speed", "主轴实际转速"),
            numbered!($number, "feed_mm_min", "mm/min", FEEDS, Continuous, "Actual feed", "实际进给速度"),
            numbered!($number, "feed_override_pct", "%", OVERRIDES, Held, "Feed override in force", "进给倍率"),
            numbered!($number, "spindle_override_pct", "%", OVERRIDES, Held, "Spindle override in force", "主轴倍率"),
            numbered!($number, "spindle_load_pct", "%", LOADS, Continuous, "Spindle load", "主轴负载"),
            numbered!($number, "x_axis_position_mm", "mm", PLACES, Continuous, "X axis position", "X轴位置"),
            numbered!($number, "y_axis_position_mm", "mm", PLACES, Continuous, "Y axis position", "Y轴位置"),
            numbered!($number, "z_axis_position_mm", "mm", PLACES, Continuous, "Z axis position", "Z轴位置"),
            numbered!($number, "x_axis_load_pct", "%", LOADS, Continuous, "X axis load", "X轴负载"),
            numbered!($number, "y_axis_load_pct", "%", LOADS, Continuous, "Y axis load", "Y轴负载"),
            numbered!($number, "z_axis_load_pct", "%", LOADS, Continuous, "Z axis load", "Z轴负载"),
            flag(numbered!($number, "rapid", "1", (0.0, 1.0), Held, "Rapid traverse active", "快速移动标志")),
            named!($number, "mode", "Controller mode", "控制方式"),
            named!($number, "execution", "Execution state", "执行状态"),
            named!($number, "program", "NC program running", "数控程序"),
            named!($number, "block", "NC block running", "程序段"),
            named!($number, "tool", "Tool in use", "刀具"),
            named!($number, "alarm", "Alarm, empty when there is none", "报警"),
            named!($number, "motion", "Motion word", "运动状态"),
            named!($number, "operation", "Threading or tapping", "工序"),
        ]
    };
}

/// Channels of one further path.
const PER_PATH: usize = 22;

/// The rows of each path, in the order in which they came into the table.
pub(super) const FURTHER: [[Channel; PER_PATH]; 3] = [path!(2), path!(3), path!(1)];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::ChannelId;

    #[test]
    fn a_further_path_has_the_same_quantities_under_its_own_names() {
        for (path, rows) in [2, 3, 1].into_iter().zip(FURTHER) {
            for row in rows {
                let plain = row.name.split_once('_').map(|(_, plain)| plain).expect("a prefix");
                assert_eq!(on_path(plain, path), row.name);
                let first = ChannelId::from_name(plain).expect("the plain names have it").channel();
                assert_eq!((row.unit, row.range, row.kind), (first.unit, first.range, first.kind), "{}", row.name);
            }
        }
        assert_eq!(usize::from(*PATHS.end()), FURTHER.len());
    }
}
