//! A plan as steps that a person can tick off: moves that differ in one commanded number alone are one step.

use adapter_core::ChannelId;
use adapter_core::channel::quantity::space_unit;
use rules::twin::plan::{Move, Plan};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// Steps that are listed; what comes after is in the plan.
const STEPS_MAX: usize = 40;
/// Levels of one quantity that are written out.
const LEVELS_MAX: usize = 8;

/// One step in both languages.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosisStep {
    /// The text in English.
    pub en: String,
    /// The text in Chinese.
    pub zh: String,
}

/// The steps of a plan, in the order of time.
#[must_use]
pub fn group_steps(plan: &Plan) -> Vec<DiagnosisStep> {
    let mut groups: Vec<Vec<&Move>> = Vec::new();
    for a in &plan.moves {
        match groups.last_mut() {
            Some(group) if group.last().is_some_and(|last| are_alike(last, a)) => group.push(a),
            _ => groups.push(vec![a]),
        }
    }
    let repeated = groups.last().and_then(|group| group.last()).is_some_and(|a| a.run > 1);
    groups.iter().take(STEPS_MAX).map(|group| describe_step(group, repeated)).collect()
}

/// Of the same kind, with the same quantities commanded.
fn are_alike(a: &Move, b: &Move) -> bool {
    (a.run, a.operation, a.instruction, &a.words) == (b.run, b.operation, b.instruction, &b.words)
        && a.commands.keys().eq(b.commands.keys())
}

fn describe_step(group: &[&Move], repeated: bool) -> DiagnosisStep {
    let first = group[0];
    let (mut en, mut zh) = (String::new(), String::new());
    if repeated {
        let _ = write!(en, "Run {}: ", first.run);
        let _ = write!(zh, "第 {} 次：", first.run);
    }
    let (what, what_zh) = match first.operation {
        "standstill" => ("drives on, nothing moves", "驱动接通，静止"),
        "idle" => ("turn without a cut", "空转"),
        "cut" => ("cut", "切削"),
        "axis" => ("move the axis", "移动轴"),
        _ => ("change over", "过渡"),
    };
    en.push_str(what);
    zh.push_str(what_zh);
    for (name, value) in first.commands.iter().filter(|(name, _)| name.as_str() != "engaged") {
        if first.operation == "standstill" && *value == 0.0 {
            continue;
        }
        let channel = ChannelId::from_name(name).map(|id| id.channel());
        let (label, label_zh, unit) = channel.map_or((name.as_str(), name.as_str(), ""), |it| (it.en, it.zh, it.unit));
        let (levels, unit) = (format_levels(group, name), space_unit(unit));
        let _ = write!(en, "; {} {levels}{unit}", label.to_lowercase());
        let _ = write!(zh, "；{label_zh} {levels}{unit}");
    }
    for (column, word) in &first.words {
        let _ = write!(en, "; {column}: {word}");
        let _ = write!(zh, "；{column}：{word}");
    }
    let seconds: f64 = group.iter().map(|a| a.seconds).sum();
    let (time, time_zh) = match seconds {
        s if s < 120.0 => (format!("{s:.0} s"), format!("{s:.0} 秒")),
        s if s < 7200.0 => (format!("{:.0} min", s / 60.0), format!("{:.0} 分钟", s / 60.0)),
        s => (format!("{:.1} h", s / 3600.0), format!("{:.1} 小时", s / 3600.0)),
    };
    let _ = write!(en, ", {time}");
    let _ = write!(zh, "，共 {time_zh}");
    if !first.instruction.0.is_empty() {
        let _ = write!(en, " ({})", first.instruction.0);
        let _ = write!(zh, "（{}）", first.instruction.1);
    }
    DiagnosisStep { en, zh }
}

/// The values of one quantity over a group, each once where all are the same.
fn format_levels(group: &[&Move], name: &str) -> String {
    let mut values: Vec<String> = group.iter().filter_map(|a| a.commands.get(name)).map(f64::to_string).collect();
    values.dedup();
    let more = values.len() > LEVELS_MAX;
    values.truncate(LEVELS_MAX);
    format!("{}{}", values.join(", "), if more { " …" } else { "" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rules::twin::plan::{Envelope, build_plan};

    #[test]
    fn a_ladder_of_speeds_is_one_step_and_a_repetition_says_so() {
        let envelope = Envelope {
            speed_rpm: (300.0, 1500.0),
            cutting_speed_rpm: 800.0,
            feed_mm: (0.1, 0.2),
            depth_mm: (0.5, 1.5),
            diameter_mm: 60.0,
            axis_speed: 3000.0,
            axis_column: "z_axis_velocity_mm_min".to_owned(),
            drive_alone: false,
            spindle: true,
        };
        let steps = group_steps(&build_plan(&["no_load_power"], &envelope));
        assert_eq!(steps.len(), 4, "{steps:#?}");
        assert_eq!(steps[0].en, "Run 1: drives on, nothing moves, 20 s");
        assert!(steps[1].en.starts_with("Run 1: turn without a cut; ") && steps[1].en.contains("1500"), "{steps:#?}");
        assert!(steps[2].zh.starts_with("第 2 次：空转"), "{steps:#?}");
    }
}
