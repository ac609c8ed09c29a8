//! The functions of the host, as a reader finds them: the registration is in `outcomes`.

/// A function that a script, or a trial, can call besides those of the language.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Function {
    /// How it is written.
    pub signature: &'static str,
    /// What it does, in English.
    pub en: &'static str,
    /// What it does, in Chinese.
    pub zh: &'static str,
}

pub(super) const fn define_function(signature: &'static str, en: &'static str, zh: &'static str) -> Function {
    Function { signature, en, zh }
}

impl Function {
    /// Its name, which stands before the bracket.
    pub(super) fn name(&self) -> Option<&str> {
        self.signature.split_once('(').map(|(name, _)| name)
    }
}

/// The functions of the host.
pub const FUNCTIONS: &[Function] = &[
    define_function(
        "setting(name, default, #{ unit, min, max, en, zh })",
        "A number that the shop chooses: written in place of the number itself. Its value stands in settings.toml, or is the default. \
         More may be said of it: whole: true; per: [\"tool\", \"operation\"]; for texts one_of: [\"x\", \"y\"] in place of unit and range",
        "声明可由车间设定的参数；数值写在 settings.toml 中",
    ),
    define_function("has(x)", "true when x has a value in this run", "x 当前有值"),
    define_function("x ?? y", "x, or y where x has no value", "x 无值时取 y"),
    define_function(
        "alarm(name, text)",
        "The alarm stands for as long as this line is reached at every run",
        "每次运行到此行时报警有效",
    ),
    define_function(
        "alarm(name, level, en, zh)",
        "The same with a level (info, warning, critical) and a text in each language; all alarm functions take these three \
         in place of the text",
        "带级别（info、warning、critical）和中英文文本；所有报警函数均可如此",
    ),
    define_function(
        "raise_alarm(name, text)",
        "The alarm stands until clear_alarm(name), also when the box starts again; for handlers",
        "报警保持，直到 clear_alarm(name)",
    ),
    define_function("clear_alarm(name)", "Ends the alarm of this name", "解除报警"),
    define_function(
        "alarm_when(name, condition, hold_s, text)",
        "Alarm after the condition has held for hold_s, cleared after it has been false for hold_s",
        "条件持续 hold_s 秒后报警或解除",
    ),
    define_function(
        "alarm_above(name, x, on, off, hold_s, text)",
        "Alarm after x has been above `on` for hold_s, cleared after it has been below `off` for hold_s; without a value it stays",
        "x 高于 on 报警，低于 off 解除",
    ),
    define_function(
        "alarm_below(name, x, on, off, hold_s, text)",
        "Alarm after x has been below `on` for hold_s, cleared after it has been above `off` for hold_s; without a value it stays",
        "x 低于 on 报警，高于 off 解除",
    ),
    define_function(
        "note(text)",
        "A line in the history; the same text not twice in a minute, at most 20 a minute",
        "写入历史记录",
    ),
    define_function(
        "request_feed_override(pct, reason)",
        "Ask the gate for a feed override in percent; without a request it is 100 %; of several requests the least counts",
        "请求进给倍率（由闸门决定）",
    ),
    define_function(
        "follow_feed_override(name, reason)",
        "Ask at every tick, also between two runs of this script, for the feed override that the estimate of this name gives; without a value \
         nothing is asked for",
        "逐周期请求该估计量给出的进给倍率（无值时不请求）",
    ),
    define_function(
        "request_feed_hold(reason)",
        "Ask the gate to hold the feed; passed on once, then only after the request has ended",
        "请求进给保持（由闸门决定）",
    ),
    define_function(
        "request_tool_change(reason)",
        "Ask the gate to have the tool changed; passed on once, then only after the request has ended",
        "请求换刀（由闸门决定）",
    ),
    define_function(
        "propose_offset_um(axis, offset_um, reason)",
        "Propose a thermal offset of the axis \"x\", \"y\" or \"z\": the whole offset, not an increment",
        "建议热误差补偿量（总量）",
    ),
    define_function(
        "publish(name, x, unit)",
        "A channel of the script's own: stored, shown and published like the others; name and unit are written as texts here",
        "发布自定义通道",
    ),
    define_function(
        "remember(name, x)",
        "Puts a number away under a name, for tables that are too long for `memory`; at most 2048; () forgets it",
        "按名称保存数值（最多 2048 个）",
    ),
    define_function("recall(name)", "The number put away under this name, or no value", "取出已保存的数值"),
    define_function("remembered()", "How many numbers are put away, of at most 2048", "已保存数值的个数"),
    define_function(
        "learn_anew(program)",
        "What the estimators have learned of the load of this program is learned anew",
        "重新学习该程序的负荷",
    ),
    define_function("forget(beginning)", "Forgets every number whose name begins so", "删除以此开头的已保存数值"),
    define_function(
        "held_s(name, condition)",
        "For how many seconds the condition has been true without interruption",
        "条件持续为真的秒数",
    ),
    define_function(
        "changed(name, x)",
        "true when x has another value than the one remembered under this name; the first value is no change",
        "x 的值是否改变",
    ),
    define_function("clamp(x, least, greatest)", "x, but not outside the two limits", "限幅"),
    define_function(
        "why(method)",
        "Why the method of this name had no answer in this run, as text; no value when it had one",
        "该方法无值的原因",
    ),
];
