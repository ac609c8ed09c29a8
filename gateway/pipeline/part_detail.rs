//! What a finished part was made with: time in each machine state, greatest power, and, for each tool, how long it cut, with
//! what mean cutting power, against what limit of the wear model.

use adapter_core::{ChannelId, Sample, is_same_text};
use rules::estimators::wear::tool_of;
use rules::estimators::{Estimates, State};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Tools of one part that are told apart; further ones are not listed.
const TOOLS_MAX: usize = 64;

/// The detail of a part as it is stored and shown (JSON in the column `detail` of the table `parts`).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PartDetail {
    /// Seconds in each machine state, without those that did not occur.
    pub seconds: BTreeMap<String, f64>,
    /// Greatest power of a sample, W: of the whole machine where it is measured, else of the spindle.
    pub peak_power_w: Option<f64>,
    /// The tools that cut, in the order of their first cut.
    pub tools: Vec<ToolUse>,
    /// The operations of the part, in the order in which they began; empty where none is named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub operations: Vec<OperationUse>,
}

/// One operation of one part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OperationUse {
    /// As the process plan names it; empty for what is named by none.
    pub operation: String,
    /// Time in the operation, s.
    pub seconds: f64,
    /// Time in cut within the operation, s.
    pub cutting_s: f64,
    /// Energy over the time in which the power was known, J: of the whole machine where it is measured, else of the spindle.
    pub energy_j: Option<f64>,
    /// Mean power over that time, W.
    pub mean_power_w: Option<f64>,
}

/// An operation in progress.
#[derive(Debug, Clone, Default)]
struct OpenOperation {
    name: SharedName,
    seconds: f64,
    cutting_s: f64,
    power: Mean,
}

/// One tool in one part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolUse {
    /// The tool, without its edge; empty where the controller has none.
    pub tool: String,
    /// The edge, as the controller names it; empty where it names none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub edge: String,
    /// Time in cut with the tool, s.
    pub cutting_s: f64,
    /// Mean cutting power over the time in which it was known, W.
    pub cutting_power_w: Option<f64>,
    /// Mean limit of the wear model, W, over the time in which there was one.
    pub limit_w: Option<f64>,
    /// Mean cutting power over that same time, W: what the limit is compared with. Other cuts of the part have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_at_limit_w: Option<f64>,
    /// Mean flank wear that the power means, mm.
    pub wear_mm: Option<f64>,
    /// Mean half width of its 95 % interval, mm.
    pub wear_uncertainty_mm: Option<f64>,
}

/// The name of a tool or an operation as the sample has it; none is none, never an empty text.
pub(super) type SharedName = Option<Arc<str>>;

/// The text of this channel as a name.
pub(super) fn name_of(sample: &Sample, channel: ChannelId) -> Option<&Arc<str>> {
    sample.shared_text(channel).filter(|text| !text.is_empty())
}

/// A mean over time.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    seconds: f64,
}

impl Mean {
    fn add(&mut self, value: Option<f64>, step_s: f64) {
        if let Some(value) = value {
            self.sum += value * step_s;
            self.seconds += step_s;
        }
    }

    fn value(self) -> Option<f64> {
        (self.seconds > 0.0).then(|| self.sum / self.seconds)
    }
}

#[derive(Debug, Clone, Default)]
struct Tool {
    name: SharedName,
    cutting_s: f64,
    power: Mean,
    limit: Mean,
    power_at_limit: Mean,
    wear: Mean,
    wear_uncertainty: Mean,
}

/// Gathers the detail of the part in progress. Allocates only when a tool cuts for the first time.
#[derive(Debug, Clone, Default)]
pub(super) struct Gathering {
    seconds: [f64; State::ALL.len()],
    peak_power_w: Option<f64>,
    tools: Vec<Tool>,
    operations: Vec<OpenOperation>,
}

impl Gathering {
    /// Takes `step_s` seconds of the part.
    pub(super) fn add_step(
        &mut self,
        estimates: &Estimates,
        (tool, operation): (Option<&Arc<str>>, Option<&Arc<str>>),
        power_w: Option<f64>,
        step_s: f64,
    ) {
        self.add_operation_time(estimates, operation, power_w, step_s);
        if let Some(index) = State::ALL.iter().position(|state| *state == estimates.state) {
            self.seconds[index] += step_s;
        }
        if let Some(power_w) = power_w {
            self.peak_power_w = Some(self.peak_power_w.map_or(power_w, |peak| peak.max(power_w)));
        }
        if estimates.state == State::Cutting {
            self.add_cutting_time(estimates, tool, step_s);
        }
    }

    fn add_operation_time(
        &mut self,
        estimates: &Estimates,
        name: Option<&Arc<str>>,
        power_w: Option<f64>,
        step_s: f64,
    ) {
        let is_named = |operation: &OpenOperation| is_same_text(operation.name.as_ref(), name);
        let index = self.operations.iter().position(is_named).or_else(|| {
            (self.operations.len() < TOOLS_MAX).then(|| {
                self.operations.push(OpenOperation { name: name.cloned(), ..OpenOperation::default() });
                self.operations.len() - 1
            })
        });
        let Some(operation) = index.and_then(|index| self.operations.get_mut(index)) else { return };
        operation.seconds += step_s;
        operation.power.add(power_w, step_s);
        if estimates.state == State::Cutting {
            operation.cutting_s += step_s;
        }
    }

    /// Adds the energy of a short silence of the meter to the operation in which it ended.
    pub(super) fn bridge_energy_gap(&mut self, name: Option<&Arc<str>>, (energy_j, seconds): (f64, f64)) {
        if energy_j <= 0.0 {
            return;
        }
        let is_named = |operation: &&mut OpenOperation| is_same_text(operation.name.as_ref(), name);
        if let Some(operation) = self.operations.iter_mut().find(is_named) {
            operation.power.sum += energy_j;
            operation.power.seconds += seconds;
        }
    }

    fn add_cutting_time(&mut self, estimates: &Estimates, name: Option<&Arc<str>>, step_s: f64) {
        let index = self.tools.iter().position(|tool| is_same_text(tool.name.as_ref(), name)).or_else(|| {
            (self.tools.len() < TOOLS_MAX).then(|| {
                self.tools.push(Tool { name: name.cloned(), ..Tool::default() });
                self.tools.len() - 1
            })
        });
        let Some(tool) = index.and_then(|index| self.tools.get_mut(index)) else { return };
        tool.cutting_s += step_s;
        let wear = estimates.tool_wear_mm.ok();
        let power_w = estimates.cutting_power_w.ok().map(|it| it.value);
        let at_limit = estimates.wear_limit_w.ok().zip(power_w);
        tool.power.add(power_w, step_s);
        tool.limit.add(at_limit.map(|(limit, _)| limit.value), step_s);
        tool.power_at_limit.add(at_limit.map(|(_, power_w)| power_w), step_s);
        tool.wear.add(wear.map(|it| it.value), step_s);
        tool.wear_uncertainty.add(wear.map(|it| 1.96 * it.sd), step_s);
    }

    /// The detail of the finished part; what follows belongs to the next one.
    pub(super) fn finish_part(&mut self) -> PartDetail {
        let done = std::mem::take(self);
        let named = State::ALL.iter().zip(done.seconds).filter(|(_, seconds)| *seconds > 0.0);
        PartDetail {
            seconds: named.map(|(state, seconds)| (state.as_word().to_owned(), round_value(seconds, 1.0))).collect(),
            peak_power_w: done.peak_power_w,
            tools: done.tools.into_iter().map(ToolUse::from_tool).collect(),
            operations: match &done.operations[..] {
                [only] if only.name.is_none() => Vec::new(),
                _ => done.operations.into_iter().map(OperationUse::from_operation).collect(),
            },
        }
    }
}

impl ToolUse {
    fn from_tool(tool: Tool) -> Self {
        let edge = tool.name.as_deref().unwrap_or_default();
        Self {
            tool: tool_of(edge).to_owned(),
            edge: if tool_of(edge) == edge { String::new() } else { edge.to_owned() },
            cutting_s: round_value(tool.cutting_s, 1.0),
            cutting_power_w: tool.power.value().map(|watts| round_value(watts, 1.0)),
            limit_w: tool.limit.value().map(|watts| round_value(watts, 1.0)),
            power_at_limit_w: tool.power_at_limit.value().map(|watts| round_value(watts, 1.0)),
            wear_mm: tool.wear.value().map(|mm| round_value(mm, 4.0)),
            wear_uncertainty_mm: tool.wear_uncertainty.value().map(|mm| round_value(mm, 4.0)),
        }
    }
}

impl OperationUse {
    fn from_operation(operation: OpenOperation) -> Self {
        let known = operation.power.seconds > 0.0;
        Self {
            operation: operation.name.as_deref().unwrap_or_default().to_owned(),
            seconds: round_value(operation.seconds, 1.0),
            cutting_s: round_value(operation.cutting_s, 1.0),
            energy_j: known.then(|| round_value(operation.power.sum, 0.0)),
            mean_power_w: operation.power.value().map(|watts| round_value(watts, 1.0)),
        }
    }
}

/// To so many places, for short texts in the history.
fn round_value(value: f64, places: f64) -> f64 {
    let scale = 10_f64.powf(places);
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;
    use rules::estimators::Estimate;

    fn cutting(power_w: f64) -> Estimates {
        let estimate = Estimate { value: power_w, sd: 1.0 };
        Estimates { state: State::Cutting, cutting_power_w: Ok(estimate), ..Estimates::without_samples(0) }
    }

    fn share_name(text: &str) -> SharedName {
        Some(Arc::from(text))
    }

    #[test]
    fn means_are_over_the_time_and_the_next_part_begins_anew() {
        let mut gathering = Gathering::default();
        gathering.add_step(
            &Estimates { state: State::Idle, ..Estimates::without_samples(0) },
            (share_name("T1").as_ref(), None),
            Some(300.0),
            4.0,
        );
        gathering.add_step(&cutting(1000.0), (share_name("T1").as_ref(), None), Some(1300.0), 1.0);
        gathering.add_step(&cutting(400.0), (share_name("T2").as_ref(), None), Some(700.0), 1.0);
        gathering.add_step(&cutting(1300.0), (share_name("T1").as_ref(), None), None, 2.0);
        let detail = gathering.finish_part();
        assert_eq!(detail.seconds, BTreeMap::from([("cutting".to_owned(), 4.0), ("idle".to_owned(), 4.0)]));
        assert_eq!(detail.peak_power_w, Some(1300.0));
        let tools: Vec<_> =
            detail.tools.iter().map(|it| (it.tool.as_str(), it.cutting_s, it.cutting_power_w)).collect();
        assert_eq!(tools, [("T1", 3.0, Some(1200.0)), ("T2", 1.0, Some(400.0))]);
        assert_eq!(detail.tools[0].limit_w, None);
        assert_eq!(gathering.finish_part(), PartDetail::default());
    }

    /// A roughing cut outside of the model, of 3,000 W, and a finishing cut of 200 W whose limit is 252 W: no power of the one beside the
    /// limit of the other.
    #[test]
    fn the_limit_stands_beside_the_power_of_the_same_cuts() {
        let mut gathering = Gathering::default();
        gathering.add_step(&cutting(3000.0), (share_name("T1").as_ref(), None), None, 6.0);
        let limit = Ok(Estimate { value: 252.0, sd: 5.0 });
        gathering.add_step(
            &Estimates { wear_limit_w: limit, ..cutting(200.0) },
            (share_name("T1").as_ref(), None),
            None,
            2.0,
        );
        let tool = gathering.finish_part().tools.remove(0);
        assert_eq!(
            (tool.limit_w, tool.power_at_limit_w, tool.cutting_power_w),
            (Some(252.0), Some(200.0), Some(2300.0))
        );
    }

    #[test]
    fn a_part_with_endless_tools_stays_small() {
        let mut gathering = Gathering::default();
        (0..1000).for_each(|at| {
            gathering.add_step(&cutting(1.0), (share_name(&format!("T{at}")).as_ref(), None), None, 1.0)
        });
        assert_eq!(gathering.finish_part().tools.len(), TOOLS_MAX);
    }
}
