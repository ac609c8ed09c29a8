//! What a control tells besides motion and states (parts, times, texts, codes, tool life, programs, warnings), and what a
//! meter tells besides power, current and voltage.

use super::Kind::{Continuous, Held};
use super::{Channel, flag, number, text, whole};

const COUNTS: (f64, f64) = (0.0, 1e9);
/// About three hundred years.
const TIMES: (f64, f64) = (0.0, 1e10);

/// Energy fed back may be counted below zero.
const ENERGIES: (f64, f64) = (-1e9, 1e9);
const APPARENT: (f64, f64) = (0.0, 1e6);

/// Came into the table after the channels of the paths.
pub(super) const LATER: [Channel; 26] = [
    whole(number("parts_required", "1", COUNTS, Held, "Parts required, as set on the control", "所需零件数")),
    whole(number("parts_total", "1", COUNTS, Held, "Parts made in all, as the control counts", "零件总数")),
    number("power_on_time_s", "s", TIMES, Held, "Time for which the control has been switched on", "通电时间"),
    number("operating_time_s", "s", TIMES, Held, "Time for which programs have run", "运行时间"),
    number("cutting_time_s", "s", TIMES, Held, "Time of cutting feed", "切削时间"),
    number("cycle_time_s", "s", TIMES, Held, "Time of this run of the program", "循环时间"),
    text("block_text", "Text of the block that runs", "当前程序段内容"),
    text("operator_message", "Messages to the operator, empty without one", "操作信息"),
    text("alarm_history", "The last alarms that the control remembers, with their times", "报警履历"),
    text("g_codes", "G codes in force", "模态G代码"),
    text("m_code", "The last M code", "M代码"),
    number(
        "tool_life",
        "1",
        COUNTS,
        Held,
        "Life of the tools of the group in use, in the control's uses or minutes",
        "刀具寿命",
    ),
    number("tool_life_used", "1", COUNTS, Held, "How much of the life is used, in the same", "刀具寿命计数"),
    text("main_program", "Main NC program, which may run another one as its subprogram", "主程序"),
    text("control_warning", "Warning of the control that stops nothing: battery, fan; empty without one", "系统警告"),
    number("rapid_override_pct", "%", (0.0, 100.0), Held, "Rapid traverse override", "快速移动倍率"),
    number("jog_override_pct", "%", (0.0, 655.34), Held, "Override of the feed in manual operation", "手动进给倍率"),
    number(
        "spindle_drive_energy_kwh",
        "kWh",
        ENERGIES,
        Held,
        "Energy of the spindle drive, as the control counts it",
        "主轴驱动电能",
    ),
    number(
        "total_energy_kwh",
        "kWh",
        ENERGIES,
        Held,
        "Energy of the whole machine, as its meter counts it",
        "机床总电能",
    ),
    number(
        "spindle_energy_kwh",
        "kWh",
        ENERGIES,
        Held,
        "Energy into the spindle drive, as its meter counts it",
        "主轴电能",
    ),
    number("total_power_factor", "1", (-1.0, 1.0), Continuous, "Power factor of the whole machine", "机床功率因数"),
    number("spindle_power_factor", "1", (-1.0, 1.0), Continuous, "Power factor of the spindle drive", "主轴功率因数"),
    number(
        "total_apparent_power_va",
        "VA",
        APPARENT,
        Continuous,
        "Apparent power of the whole machine",
        "机床视在功率",
    ),
    number(
        "spindle_apparent_power_va",
        "VA",
        APPARENT,
        Continuous,
        "Apparent power of the spindle drive",
        "主轴视在功率",
    ),
    number("supply_frequency_hz", "Hz", (45.0, 65.0), Continuous, "Frequency of the supply", "电源频率"),
    flag(number("emergency_stop", "1", (0.0, 1.0), Held, "Emergency stop is pressed", "急停按下")),
];
