//! `GET /api/v1/channels`: every name the box uses, with unit, range and text in English and Chinese.

use super::route::Route;
use adapters::channel::Kind;
use adapters::{Absence, ChannelId};
use axum::Json;
use axum::routing::get;
use rules::estimators::State;
use serde_json::{Map, Value, json};

/// Quantities that are inferred: name, unit, English, Chinese.
pub const ESTIMATES: [(&str, &str, &str, &str); 15] = [
    ("filtered_power_w", "W", "Filtered spindle power", "滤波后的主轴功率"),
    ("no_load_power_w", "W", "No-load power at this speed", "空载功率"),
    ("cutting_power_w", "W", "Cutting power", "切削功率"),
    ("load_loss_w", "W", "Additional loss under load", "附加载荷损耗"),
    ("visible_cutting_power_w", "W", "Least visible cutting power", "最小可见切削功率"),
    ("wear_limit_w", "W", "Limit of the cutting power for a worn edge", "磨损阈值功率"),
    ("tool_wear_mm", "mm", "Flank wear of the edge", "后刀面磨损量"),
    ("tool_growth_pct", "%", "Rise of the cutting power by wear", "磨损引起的功率增量"),
    ("tool_worn_probability", "1", "Probability that the edge is worn after the next part", "下一件后刀刃磨损概率"),
    ("tool_parts_left", "1", "Parts until the edge is worn", "剩余可加工件数"),
    ("material_level_pct", "%", "By how much the material takes more than usual", "材料比平常多耗的功率"),
    ("tool_limit_parts", "1", "Parts in a row above the limit of the wear model", "连续超过磨损阈值的工件数"),
    ("tool_life_share", "1", "Cut by this edge over what the edges before it had cut", "切削量与以往刀刃寿命之比"),
    ("feed_in_force_pct", "%", "Feed in force at the machine, of the programmed feed", "机床生效的进给倍率"),
    ("learned_power_w", "W", "Cutting power learned at this place of the program", "程序此处的示教切削功率"),
];

/// Why an estimate is missing: word, English, Chinese. The full reason stands beside the estimate.
const NO_ESTIMATES: [(&str, &str, &str); 33] = [
    ("not_yet", "no sample yet", "尚无采样"),
    ("input_missing", "an input is missing", "缺少输入"),
    ("spindle_stopped", "spindle stands still", "主轴静止"),
    ("speed_changing", "spindle is changing speed", "主轴变速中"),
    ("not_settled", "not settled yet", "尚未稳定"),
    ("not_learned", "not learned at this speed", "该转速尚未学习"),
    ("extrapolated", "too far from learned speeds", "超出已学习转速范围"),
    ("imbalance", "coefficients contradict the power", "系数与功率矛盾"),
    ("below_no_load", "below no-load power", "低于空载功率"),
    ("no_model", "no wear model for this cut", "无此切削的磨损模型"),
    ("cut_unknown", "depth or diameter not known", "切削参数未知"),
    ("outside_model", "outside the cuts of the model", "超出模型范围"),
    ("not_observable", "wear cannot be seen in this cut", "此切削中不可观测"),
    ("no_part_yet", "no part judged yet", "尚无可判断的工件"),
    ("no_limit", "no cut of this edge has a limit", "此刀刃没有按阈值判断的切削"),
    ("no_lives_yet", "fewer than two edges of this tool used up", "该刀具用尽的刀刃不足两把"),
    ("feed_unknown", "feed not known", "进给未知"),
    ("no_target", "no load is aimed at", "未设定目标负荷"),
    ("load_unknown", "the load is not measured", "负荷未测量"),
    ("place_not_learned", "not learned at this place yet", "此处尚未示教"),
    ("nothing_to_change", "the programmed feed is right", "无需调整进给"),
    ("power_unknown", "no power was measured", "未测得功率"),
    ("control_silent", "the control does not answer, and the machine draws power", "数控系统无应答，而机床正在用电"),
    ("not_cutting", "nothing is being cut", "未切削"),
    ("output_missing", "the measured value is missing", "缺少测量值"),
    ("too_few_transients", "too few changes of spindle speed without cutting", "未切削时的主轴变速次数不足"),
    ("unexplained", "the speed does not explain this power", "转速无法解释该功率"),
    ("changed", "the lag has changed and is estimated anew", "滞后已改变，正在重新估计"),
    ("too_slow", "the speed changes too slowly", "主轴变速过慢"),
    ("ambiguous", "two lags explain the power alike", "存在两个同样合理的滞后"),
    ("too_wide", "not known closely enough", "不确定度过大"),
    ("shown_only", "not applied, only shown", "仅显示，未校正"),
    ("warming_up", "the model has not seen enough yet", "模型数据尚不足"),
];

fn name_absence(reason: Absence) -> (&'static str, &'static str) {
    match reason {
        Absence::NotProvided => ("no source has it", "无数据源"),
        Absence::NotYetRead => ("not read yet", "尚未读取"),
        Absence::MachineOff => ("machine is off", "机床已关机"),
        Absence::Disconnected => ("source is not connected", "数据源未连接"),
        Absence::Timeout => ("no answer in time", "应答超时"),
        Absence::Refused => ("refused by the device", "设备拒绝"),
        Absence::NotSupported => ("not supported by the device", "设备不支持"),
        Absence::OutOfRange => ("outside the possible range", "超出物理范围"),
        Absence::Stale => ("too old", "数据过旧"),
        Absence::NotRecorded => ("not recorded", "未记录"),
        Absence::UnknownUnit => ("unit of the device not known", "设备单位未知"),
    }
}

/// A state's name, English and Chinese.
#[must_use]
pub fn name_state(state: State) -> (&'static str, &'static str) {
    match state {
        State::Off => ("Off", "关机"),
        State::Standby => ("Standby", "待机"),
        State::SpindleStart => ("Spindle start", "主轴启动"),
        State::Idle => ("Idle", "空转"),
        State::Cutting => ("Cutting", "切削"),
        State::Unknown => ("Unknown", "未知"),
        State::SpeedChange => ("Speed change", "变速"),
        State::Rapid => ("Rapid", "快速移动"),
    }
}

/// The name of a state in one language, by its word.
pub(super) fn state_text(word: &str, zh: bool) -> &'static str {
    let found = State::ALL.into_iter().find(|state| state.as_word() == word).unwrap_or(State::Unknown);
    let (en, cn) = name_state(found);
    if zh { cn } else { en }
}

/// Why a value is missing, in one language, by its word.
pub(super) fn absence_text(word: &str, zh: bool) -> &'static str {
    let found = Absence::ALL.into_iter().find(|reason| reason.as_word() == word).unwrap_or(Absence::NotProvided);
    let (en, cn) = name_absence(found);
    if zh { cn } else { en }
}

fn texts_to_json(en: &str, zh: &str) -> Value {
    json!({ "en": en, "zh": zh })
}

fn list_quantities() -> Map<String, Value> {
    let measured = ChannelId::list_all().map(|id| {
        let channel = id.channel();
        let kind = match channel.kind {
            Kind::Continuous => "continuous",
            Kind::Held => "held",
            Kind::Text => "text",
        };
        let mut row =
            json!({ "en": channel.en, "zh": channel.zh, "unit": channel.unit, "kind": kind, "origin": "measured" });
        if channel.kind != Kind::Text {
            row["range"] = json!([channel.range.0, channel.range.1]);
        }
        (channel.name.to_owned(), row)
    });
    let inferred = ESTIMATES.iter().map(|(name, unit, en, zh)| {
        let row = json!({ "en": en, "zh": zh, "unit": unit, "kind": "continuous", "origin": "inferred" });
        ((*name).to_owned(), row)
    });
    measured.chain(inferred).collect()
}

/// The whole vocabulary as one document.
#[must_use]
pub fn build_vocabulary() -> Value {
    let reasons = Absence::ALL.into_iter().map(|reason| {
        let (en, zh) = name_absence(reason);
        (reason.as_word().to_owned(), texts_to_json(en, zh))
    });
    let no_estimates = NO_ESTIMATES.iter().map(|(word, en, zh)| ((*word).to_owned(), texts_to_json(en, zh)));
    let states = State::ALL.into_iter().map(|word| {
        let (en, zh) = name_state(word);
        (word.as_word().to_owned(), texts_to_json(en, zh))
    });
    json!({
        "schema": "channels/1",
        "quantities": list_quantities(),
        "states": states.collect::<Map<_, _>>(),
        "absences": reasons.chain(no_estimates).collect::<Map<_, _>>(),
    })
}

pub(super) const ROUTES: &[Route] = &[Route::read("/api/v1/channels", || get(serve_channels))];

/// `GET /api/v1/channels`: every channel that a script or a request can name.
pub(super) async fn serve_channels() -> Json<Value> {
    Json(build_vocabulary())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rules::estimators::Estimates;

    #[test]
    fn everything_the_page_shows_has_a_name_in_both_languages() {
        let document = build_vocabulary();
        for (name, _) in Estimates::without_samples(0).list_quantities() {
            assert!(document["quantities"][name]["zh"].is_string(), "{name}");
        }
        assert_eq!(
            document["quantities"].as_object().map(Map::len),
            Some(ChannelId::count_channels() + ESTIMATES.len())
        );
        for state in State::ALL {
            assert!(document["states"][state.as_word()]["en"].is_string(), "{state}");
        }
    }
}
