//! The next step: what to record where an answer is not sure. Names are separated by the experiments of their effects;
//! what has no name is asked for by the channel that its curve was found over.

use super::diagnosis::{Alternative, Experiment};
use physics::find_effect;

/// Minutes of an experiment over one channel: four levels of it, up and down, twice, half a minute each, and the way there.
const CHANNEL_MINUTES: f64 = 10.0;

/// The experiment of the first of these kinds that the catalogue holds.
pub(super) fn find_effect_experiment<'a>(mut kinds: impl Iterator<Item = &'a str>) -> Option<Experiment> {
    let doc = kinds.find_map(find_effect)?.doc();
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

fn build_experiment(statement: String, minutes: f64, effect: &str) -> Experiment {
    Experiment { statement, minutes, effect: effect.to_owned() }
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
