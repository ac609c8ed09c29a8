//! The next step: what to record where an answer is not sure. Names are separated by the experiments of their effects;
//! what has no name is asked for by the channel that its curve was found over.

use super::diagnosis::{Alternative, Experiment};
use physics::find_effect;

/// Minutes of an experiment over one channel: four levels of it, up and down, twice, half a minute each, and the way there.
const CHANNEL_MINUTES: f64 = 10.0;

/// The shortest experiment of these kinds, the first of several that take as long: each of them separates its own kind from the others.
pub(super) fn find_effect_experiment<'a>(kinds: impl Iterator<Item = &'a str>) -> Option<Experiment> {
    let docs = kinds.filter_map(find_effect).map(physics::Effect::doc);
    let doc = docs.min_by(|a, b| a.experiment_minutes.total_cmp(&b.experiment_minutes))?;
    Some(build_experiment(doc.en.experiment.to_owned(), doc.experiment_minutes, doc.kind))
}

/// Another kind that this data cannot rule out, `delta_ic` units of information behind the one it would replace, with the
/// experiment that separates them.
pub(super) fn build_alternative(kind: &str, instead_of: &str, delta_ic: f64) -> Alternative {
    let experiment = find_effect(kind).or_else(|| find_effect(instead_of)).map(|effect| effect.doc().en.experiment);
    Alternative {
        effect: kind.to_owned(),
        instead_of: instead_of.to_owned(),
        delta_ic,
        separating_experiment: experiment.unwrap_or_default().to_owned(),
    }
}

pub(super) fn build_experiment(statement: String, minutes: f64, effect: &str) -> Experiment {
    Experiment { statement, statement_zh: None, minutes, effect: effect.to_owned() }
}

/// The experiment in the words of a drive on its own, which has no spindle and no cut; `moves::list_drive_moves` carries it out.
pub(super) fn describe_drive_experiment(kind: &str) -> (&'static str, &'static str) {
    match kind {
        "clock_lag" | "meter_window" | "axis_inertia" | "regeneration" | "engagement_timing" => (
            "start and stop the axis ten times at its full speed, with two seconds of rest between",
            "以全速启停该轴十次，每次间隔静止两秒",
        ),
        "stribeck" | "dry_friction" | "viscous_friction" | "axis_friction" | "direction_asymmetry" => (
            "move the axis back and forth at steady speeds from a hundredth of its full speed up, eight seconds each way, twice",
            "以从全速百分之一起的多个恒定速度往返移动该轴，每个方向八秒，重复两次",
        ),
        "bearing_warm_up" | "preload_growth" | "zero_drift" | "ambient_drift" => (
            "let the axis rest for a minute, move it for ten minutes, let it rest again for a minute, and repeat both",
            "让该轴静止一分钟，运行十分钟，再静止一分钟，重复一次",
        ),
        _ => (
            "move the axis back and forth over its whole way at a fifth, at half and at full speed, ten seconds each way, twice",
            "以全速的五分之一、二分之一和全速在全行程内往返移动该轴，每个方向十秒，重复两次",
        ),
    }
}

/// To learn what depends on this channel; on nothing that is known where there is none.
pub(super) fn build_channel_experiment(channel: Option<&str>) -> Experiment {
    build_experiment(channel.map_or_else(describe_repetition, describe_channel_sweep), CHANNEL_MINUTES, "")
}

fn describe_repetition() -> String {
    "Record the same programs again, at least four runs, and vary speed, feed and load on their own in each".to_owned()
}

/// What to record to learn what depends on a channel.
fn describe_channel_sweep(channel: &str) -> String {
    let stepped = |what: &str| {
        format!(
            "Step {what} alone over its whole range, up and down, twice, with everything else constant: what repeats with it depends on it"
        )
    };
    match channel {
        "time" | "run" => {
            "Record one run twice as long at constant speed and load, then pause for as long and repeat it: what follows the clock, the warmth and the program part then".to_owned()
        }
        "pass_progress" => {
            "Cut the same pass three times at the usual feed, half of it and double: what follows the time and what follows the way part then".to_owned()
        }
        "tool" | "tool_age" => {
            "Change the tool twice as often as usual over one hour, with everything else constant".to_owned()
        }
        "load" | "torque" => stepped("the load (depth, then feed) at one speed"),
        _ => stepped(channel),
    }
}

#[cfg(test)]
mod tests {
    use super::describe_channel_sweep;

    #[test]
    fn a_channel_is_stepped_and_time_is_waited_for() {
        assert!(describe_channel_sweep("feed_mm_min").starts_with("Step feed_mm_min alone"));
        assert!(describe_channel_sweep("time").starts_with("Record one run twice as long"));
    }
}
