//! The one table of channels: what scripts, SQL, HTTP and CSV all read.
//!
//! A channel's name ends in its unit; the names are those of the recording format.

mod declarations;
mod details;
mod form;
mod id;
mod paths;
pub mod quantity;
pub mod unit;

pub use declarations::{DECLARED_MAX, DeclareError, NewChannel, declare_channel};
pub use form::Form;
pub use id::ChannelId;
pub use paths::{PATHS, on_path};

/// How a channel behaves between two readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A physical quantity that may be interpolated.
    Continuous,
    /// A command, counter or flag that holds until it changes.
    Held,
    /// A state word or name; holds until it changes.
    Text,
}

/// Of an electrical quantity that begins at zero, noise below zero up to this share of its greatest value. A thousandth is ten times
/// what a class 1 meter shows at rest, and far from any current that would mean something.
const NOISE: f64 = 1e-3;

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Name used everywhere; ends in the unit.
    pub name: &'static str,
    /// Unit symbol; `1` for pure numbers, empty for text.
    pub unit: &'static str,
    /// Least and greatest value that is physically possible, in the unit.
    pub range: (f64, f64),
    /// Continuous, held or text.
    pub kind: Kind,
    /// Which numbers it can have.
    pub form: Form,
    /// What it is, in English.
    pub en: &'static str,
    /// What it is, in Chinese.
    pub zh: &'static str,
}

impl Channel {
    /// Is this a finite number within the physical range? An electrical quantity that begins at zero is judged by its size:
    /// the noise of a meter about zero, up to a thousandth of the greatest value, is believed as it is.
    #[must_use]
    pub fn accepts_number(&self, number: f64) -> bool {
        let (least, greatest) = self.range;
        let noise = if self.is_electric() && least == 0.0 { NOISE * greatest } else { 0.0 };
        number.is_finite() && number >= least - noise && number <= greatest
    }

    /// Is it an electrical quantity that a meter shows as exactly zero where it sees nothing?
    #[must_use]
    pub fn is_electric(&self) -> bool {
        self.kind == Kind::Continuous && matches!(self.unit, "W" | "A" | "V" | "VA")
    }
}

const fn number(
    name: &'static str,
    unit: &'static str,
    range: (f64, f64),
    kind: Kind,
    en: &'static str,
    zh: &'static str,
) -> Channel {
    Channel { name, unit, range, kind, form: Form::Real, en, zh }
}

/// The same with whole numbers only.
const fn whole(channel: Channel) -> Channel {
    Channel { form: Form::Whole, ..channel }
}

/// The same with 0 for no and 1 for yes.
const fn flag(channel: Channel) -> Channel {
    Channel { form: Form::Flag, ..channel }
}

const fn text(name: &'static str, en: &'static str, zh: &'static str) -> Channel {
    Channel { name, unit: "", range: (0.0, 0.0), kind: Kind::Text, form: Form::Real, en, zh }
}

/// Every channel the gateway knows. The position is the [`ChannelId`]; new channels are appended.
pub static CHANNELS: &[Channel] = &ALL;

const PATH_ROWS: &[Channel] = paths::FURTHER.as_flattened();

static ALL: [Channel; COUNT] = TABLE;

const COUNT: usize = FIRST.len() + PATH_ROWS.len() + details::LATER.len();

const TABLE: [Channel; COUNT] = {
    let mut all = [FIRST[0]; COUNT];
    let mut index = 0;
    while index < all.len() {
        let behind = FIRST.len() + PATH_ROWS.len();
        all[index] = if index < FIRST.len() {
            FIRST[index]
        } else if index < behind {
            PATH_ROWS[index - FIRST.len()]
        } else {
            details::LATER[index - behind]
        };
        index += 1;
    }
    all
};

/// Of a machine with one path, and what belongs to none.
const FIRST: &[Channel] = &[
    number(
        "spindle_programmed_rpm",
        "rpm",
        (-100000.0, 100000.0),
        Kind::Held,
        "Commanded spindle speed before overrides",
        "主轴编程转速",
    ),
    number(
        "feed_programmed_mm_min",
        "mm/min",
        (0.0, 200000.0),
        Kind::Held,
        "Commanded feed before overrides",
        "编程进给速度",
    ),
    number(
        "spindle_speed_rpm",
        "rpm",
        (-100000.0, 100000.0),
        Kind::Continuous,
        "Actual spindle speed, positive in M3",
        "主轴实际转速",
    ),
    number("feed_mm_min", "mm/min", (0.0, 200000.0), Kind::Continuous, "Actual feed along the path", "实际进给速度"),
    number(
        "feed_per_rev_mm",
        "mm/rev",
        (0.0, 100.0),
        Kind::Continuous,
        "Actual feed per spindle revolution",
        "每转进给量",
    ),
    number("feed_override_pct", "%", (0.0, 254.0), Kind::Held, "Feed override in force", "进给倍率"),
    number("spindle_override_pct", "%", (0.0, 254.0), Kind::Held, "Spindle override in force", "主轴倍率"),
    number("depth_of_cut_mm", "mm", (0.0, 500.0), Kind::Held, "Depth of cut", "背吃刀量"),
    number("width_of_cut_mm", "mm", (0.0, 2000.0), Kind::Held, "Width of cut", "切削宽度"),
    number(
        "diameter_mm",
        "mm",
        (0.0, 10000.0),
        Kind::Continuous,
        "Diameter of the work (turning) or of the tool (milling)",
        "工件或刀具直径",
    ),
    whole(number("teeth", "1", (0.0, 1000.0), Kind::Held, "Number of teeth of the tool", "刀具齿数")),
    number("removal_rate_cm3_min", "cm3/min", (0.0, 100000.0), Kind::Continuous, "Material removal rate", "材料去除率"),
    number("engaged", "1", (0.0, 1.0), Kind::Held, "Tool in the work: 0 to 1", "刀具切入标志"),
    number("axis_position_mm", "mm", (-100000.0, 100000.0), Kind::Continuous, "Axis position", "轴位置"),
    number("axis_velocity_mm_min", "mm/min", (-200000.0, 200000.0), Kind::Continuous, "Axis velocity", "轴速度"),
    number("x_axis_position_mm", "mm", (-100000.0, 100000.0), Kind::Continuous, "X axis position", "X轴位置"),
    number("x_axis_velocity_mm_min", "mm/min", (-200000.0, 200000.0), Kind::Continuous, "X axis velocity", "X轴速度"),
    number("y_axis_position_mm", "mm", (-100000.0, 100000.0), Kind::Continuous, "Y axis position", "Y轴位置"),
    number("y_axis_velocity_mm_min", "mm/min", (-200000.0, 200000.0), Kind::Continuous, "Y axis velocity", "Y轴速度"),
    number("z_axis_position_mm", "mm", (-100000.0, 100000.0), Kind::Continuous, "Z axis position", "Z轴位置"),
    number("z_axis_velocity_mm_min", "mm/min", (-200000.0, 200000.0), Kind::Continuous, "Z axis velocity", "Z轴速度"),
    number(
        "spindle_power_w",
        "W",
        (-1000000.0, 1000000.0),
        Kind::Continuous,
        "Power into the spindle drive, negative when it brakes into the supply",
        "主轴驱动功率",
    ),
    number(
        "total_power_w",
        "W",
        (-1000000.0, 1000000.0),
        Kind::Continuous,
        "Power into the whole machine",
        "机床总功率",
    ),
    number("spindle_current_a", "A", (0.0, 10000.0), Kind::Continuous, "Spindle motor current, true rms", "主轴电流"),
    number(
        "spindle_load_pct",
        "%",
        (-500.0, 500.0),
        Kind::Continuous,
        "Spindle load as the controller shows it",
        "主轴负载",
    ),
    number("axis_current_a", "A", (-10000.0, 10000.0), Kind::Continuous, "Axis motor current", "进给轴电流"),
    number("axis_power_w", "W", (-1000000.0, 1000000.0), Kind::Continuous, "Axis drive power", "进给轴功率"),
    number("x_axis_current_a", "A", (-10000.0, 10000.0), Kind::Continuous, "X axis motor current", "X轴电流"),
    number(
        "x_axis_load_pct",
        "%",
        (-500.0, 500.0),
        Kind::Continuous,
        "X axis load as the controller shows it",
        "X轴负载",
    ),
    number("y_axis_current_a", "A", (-10000.0, 10000.0), Kind::Continuous, "Y axis motor current", "Y轴电流"),
    number(
        "y_axis_load_pct",
        "%",
        (-500.0, 500.0),
        Kind::Continuous,
        "Y axis load as the controller shows it",
        "Y轴负载",
    ),
    number("z_axis_current_a", "A", (-10000.0, 10000.0), Kind::Continuous, "Z axis motor current", "Z轴电流"),
    number(
        "z_axis_load_pct",
        "%",
        (-500.0, 500.0),
        Kind::Continuous,
        "Z axis load as the controller shows it",
        "Z轴负载",
    ),
    number("cutting_force_n", "N", (-1000000.0, 1000000.0), Kind::Continuous, "Main cutting force", "主切削力"),
    number(
        "bearing_temperature_c",
        "°C",
        (-60.0, 300.0),
        Kind::Continuous,
        "Spindle bearing temperature",
        "主轴轴承温度",
    ),
    number("motor_temperature_c", "°C", (-60.0, 300.0), Kind::Continuous, "Spindle motor temperature", "主轴电机温度"),
    number("ambient_temperature_c", "°C", (-60.0, 100.0), Kind::Continuous, "Air temperature in the shop", "环境温度"),
    number("coolant_temperature_c", "°C", (-60.0, 150.0), Kind::Continuous, "Coolant temperature", "冷却液温度"),
    number(
        "thermal_error_um",
        "um",
        (-10000.0, 10000.0),
        Kind::Continuous,
        "Displacement of the tool against the work",
        "热误差",
    ),
    number("supply_voltage_v", "V", (0.0, 1000.0), Kind::Continuous, "Supply voltage, phase to phase", "供电电压"),
    flag(number("coolant_on", "1", (0.0, 1.0), Kind::Held, "Coolant pump running", "冷却泵运行")),
    flag(number("hydraulics_on", "1", (0.0, 1.0), Kind::Held, "Hydraulic pump running", "液压泵运行")),
    whole(number("gear_stage", "1", (0.0, 20.0), Kind::Held, "Gear or belt stage of the spindle", "主轴档位")),
    flag(number("rapid", "1", (0.0, 1.0), Kind::Held, "Rapid traverse (G0) active", "快速移动标志")),
    whole(number("part_count", "1", (0.0, 1000000000.0), Kind::Held, "Parts counted by the controller", "工件计数")),
    flag(number("drive_on", "1", (0.0, 1.0), Kind::Held, "Drives ready", "驱动就绪")),
    text("run", "Grouping: the unit of hold-out", "批次"),
    text("pass", "Grouping: one pass of the tool", "走刀"),
    text("part", "Work piece", "工件号"),
    text("tool", "Tool or edge in use", "刀具"),
    text("lot", "Lot of material", "材料批号"),
    text("program", "NC program running", "数控程序"),
    text("block", "NC block running", "程序段"),
    text("operation", "Operation, as the process plan names it", "工序"),
    text("mode", "Controller mode", "控制方式"),
    text("execution", "Execution state of the controller", "执行状态"),
    text("alarm", "Alarm shown by the controller, empty when there is none", "报警"),
    text("motion", "Motion word of the controller", "运动状态"),
    number("temperature_1_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 1", "测温点1"),
    number("temperature_2_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 2", "测温点2"),
    number("temperature_3_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 3", "测温点3"),
    number("temperature_4_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 4", "测温点4"),
    number("temperature_5_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 5", "测温点5"),
    number("temperature_6_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 6", "测温点6"),
    number("temperature_7_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 7", "测温点7"),
    number("temperature_8_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 8", "测温点8"),
    number("temperature_9_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 9", "测温点9"),
    number("temperature_10_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 10", "测温点10"),
    number("temperature_11_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 11", "测温点11"),
    number("temperature_12_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 12", "测温点12"),
    number("temperature_13_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 13", "测温点13"),
    number("temperature_14_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 14", "测温点14"),
    number("temperature_15_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 15", "测温点15"),
    number("temperature_16_c", "°C", (-60.0, 300.0), Kind::Continuous, "Temperature point 16", "测温点16"),
    text("work_material", "Material of the work", "工件材料"),
    text(
        "recipe",
        "Operation of the recipe that filled in this sample, and the version of the recipe",
        "所用工序配方及其版本",
    ),
    number(
        "feed_override_dial_pct",
        "%",
        (0.0, 254.0),
        Kind::Held,
        "Feed override as the operator's dial has it, before the gateway's",
        "操作面板进给倍率",
    ),
    flag(number("single_block", "1", (0.0, 1.0), Kind::Held, "Single block is switched on", "单段开关")),
    flag(number("dry_run", "1", (0.0, 1.0), Kind::Held, "Dry run is switched on", "空运行开关")),
    number("torque_nm", "N·m", (-100000.0, 100000.0), Kind::Continuous, "Torque at the spindle", "主轴扭矩"),
];

/// The name of the table nearest to `name`, for "did you mean".
#[must_use]
pub fn find_nearest_name<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let length = name.chars().count();
    let limit = (length / 3).max(2);
    // A name whose length differs by more cannot be near; of a text of a megabyte nothing else would be told in less than minutes.
    names
        .into_iter()
        .filter(|known| known.chars().count().abs_diff(length) <= limit)
        .map(|known| (strsim::levenshtein(name, known), known))
        .min()
        .filter(|(d, _)| *d <= limit)
        .map(|(_, known)| known)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn names_are_unique_and_found() {
        let names: BTreeSet<_> = CHANNELS.iter().map(|channel| channel.name).collect();
        assert_eq!(names.len(), CHANNELS.len());
        for id in ChannelId::list_all() {
            assert_eq!(ChannelId::from_name(id.name()), Some(id));
        }
    }

    #[test]
    fn a_misspelt_name_finds_its_neighbour() {
        let names = CHANNELS.iter().map(|channel| channel.name);
        assert_eq!(find_nearest_name("spindel_speed_rpm", names), Some("spindle_speed_rpm"));
        let names = CHANNELS.iter().map(|channel| channel.name);
        let began = std::time::Instant::now();
        assert_eq!(find_nearest_name(&"x".repeat(1 << 20), names), None);
        assert!(began.elapsed() < std::time::Duration::from_secs(1), "a text of a megabyte is near to no name at once");
    }
}
