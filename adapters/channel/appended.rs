//! What a control tells besides motion and states: parts, times, texts, codes, tool life.

use super::Kind::Held;
use super::{Channel, flag, number, text, whole};

const COUNTS: (f64, f64) = (0.0, 1e9);
/// About three hundred years.
const TIMES: (f64, f64) = (0.0, 1e10);

/// Came into the table after the channels of the paths.
pub(super) const LATER: [Channel; 14] = [
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
    flag(number("emergency_stop", "1", (0.0, 1.0), Held, "Emergency stop is pressed", "急停按下")),
];
