//! Channels of the further paths of a controller: a lathe with two turrets has a program, a state and a feed for each.
//!
//! Path 1 keeps the plain names, so that everything that knows one path knows it unchanged. What belongs to path N is
//! called `pathN_` and the plain name: `path2_spindle_speed_rpm`. The unit stays at the end of the name.

use super::{Channel, Kind, number, text};

/// Paths that have channels.
pub const PATHS: std::ops::RangeInclusive<u8> = 1..=3;

/// Name of a channel on a path from 1.
#[must_use]
pub fn on_path(name: &str, path: u8) -> String {
    if path == 1 { name.to_owned() } else { format!("path{path}_{name}") }
}

macro_rules! path {
    ($number:literal) => {
        [
            number(
                concat!("path", $number, "_spindle_programmed_rpm"),
                "rpm",
                (-100000.0, 100000.0),
                Kind::Held,
                concat!("Commanded spindle speed before overrides, path ", $number),
                concat!("通道", $number, "主轴编程转速"),
            ),
            number(
                concat!("path", $number, "_feed_programmed_mm_min"),
                "mm/min",
                (0.0, 200000.0),
                Kind::Held,
                concat!("Commanded feed before overrides, path ", $number),
                concat!("通道", $number, "编程进给速度"),
            ),
            number(
                concat!("path", $number, "_spindle_speed_rpm"),
                "rpm",
                (-100000.0, 100000.0),
                Kind::Continuous,
                concat!("Actual spindle speed, path ", $number),
                concat!("通道", $number, "主轴实际转速"),
            ),
            number(
                concat!("path", $number, "_feed_mm_min"),
                "mm/min",
                (0.0, 200000.0),
                Kind::Continuous,
                concat!("Actual feed, path ", $number),
                concat!("通道", $number, "实际进给速度"),
            ),
            number(
                concat!("path", $number, "_feed_override_pct"),
                "%",
                (0.0, 254.0),
                Kind::Held,
                concat!("Feed override in force, path ", $number),
                concat!("通道", $number, "进给倍率"),
            ),
            number(
                concat!("path", $number, "_spindle_override_pct"),
                "%",
                (0.0, 254.0),
                Kind::Held,
                concat!("Spindle override in force, path ", $number),
                concat!("通道", $number, "主轴倍率"),
            ),
            number(
                concat!("path", $number, "_spindle_load_pct"),
                "%",
                (-500.0, 500.0),
                Kind::Continuous,
                concat!("Spindle load, path ", $number),
                concat!("通道", $number, "主轴负载"),
            ),
            number(
                concat!("path", $number, "_x_axis_position_mm"),
                "mm",
                (-100000.0, 100000.0),
                Kind::Continuous,
                concat!("X axis position, path ", $number),
                concat!("通道", $number, "X轴位置"),
            ),
            number(
                concat!("path", $number, "_y_axis_position_mm"),
                "mm",
                (-100000.0, 100000.0),
                Kind::Continuous,
                concat!("Y axis position, path ", $number),
                concat!("通道", $number, "Y轴位置"),
            ),
            number(
                concat!("path", $number, "_z_axis_position_mm"),
                "mm",
                (-100000.0, 100000.0),
                Kind::Continuous,
                concat!("Z axis position, path ", $number),
                concat!("通道", $number, "Z轴位置"),
            ),
            number(
                concat!("path", $number, "_x_axis_load_pct"),
                "%",
                (-500.0, 500.0),
                Kind::Continuous,
                concat!("X axis load, path ", $number),
                concat!("通道", $number, "X轴负载"),
            ),
            number(
                concat!("path", $number, "_y_axis_load_pct"),
                "%",
                (-500.0, 500.0),
                Kind::Continuous,
                concat!("Y axis load, path ", $number),
                concat!("通道", $number, "Y轴负载"),
            ),
            number(
                concat!("path", $number, "_z_axis_load_pct"),
                "%",
                (-500.0, 500.0),
                Kind::Continuous,
                concat!("Z axis load, path ", $number),
                concat!("通道", $number, "Z轴负载"),
            ),
            number(
                concat!("path", $number, "_rapid"),
                "1",
                (0.0, 1.0),
                Kind::Held,
                concat!("Rapid traverse active, path ", $number),
                concat!("通道", $number, "快速移动标志"),
            ),
            text(
                concat!("path", $number, "_mode"),
                concat!("Controller mode, path ", $number),
                concat!("通道", $number, "控制方式"),
            ),
            text(
                concat!("path", $number, "_execution"),
                concat!("Execution state, path ", $number),
                concat!("通道", $number, "执行状态"),
            ),
            text(
                concat!("path", $number, "_program"),
                concat!("NC program running, path ", $number),
                concat!("通道", $number, "数控程序"),
            ),
            text(
                concat!("path", $number, "_block"),
                concat!("NC block running, path ", $number),
                concat!("通道", $number, "程序段"),
            ),
            text(
                concat!("path", $number, "_tool"),
                concat!("Tool in use, path ", $number),
                concat!("通道", $number, "刀具"),
            ),
            text(
                concat!("path", $number, "_alarm"),
                concat!("Alarm, empty when there is none, path ", $number),
                concat!("通道", $number, "报警"),
            ),
            text(
                concat!("path", $number, "_motion"),
                concat!("Motion word, path ", $number),
                concat!("通道", $number, "运动状态"),
            ),
            text(
                concat!("path", $number, "_operation"),
                concat!("Threading or tapping, path ", $number),
                concat!("通道", $number, "工序"),
            ),
        ]
    };
}

/// Channels of one further path.
const PER_PATH: usize = 22;

/// The rows of path 2 and of path 3.
pub(super) const FURTHER: [[Channel; PER_PATH]; 2] = [path!(2), path!(3)];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::ChannelId;

    #[test]
    fn a_further_path_has_the_same_quantities_under_its_own_names() {
        for (path, rows) in (2..).zip(FURTHER) {
            for row in rows {
                let plain = row.name.split_once('_').map(|(_, plain)| plain).expect("a prefix");
                assert_eq!(on_path(plain, path), row.name);
                let first = ChannelId::of(plain).expect("path 1 has it").channel();
                assert_eq!((row.unit, row.range, row.kind), (first.unit, first.range, first.kind), "{}", row.name);
            }
        }
        assert_eq!(on_path("program", 1), "program");
        assert_eq!(usize::from(*PATHS.end()), 1 + FURTHER.len());
    }
}
