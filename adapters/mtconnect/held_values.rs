//! What every channel of a device says, from one observation to the next.
//!
//! An agent tells what changes. So every look at it says of all channels: as before. What counts is whether the value is newer than the
//! moment at which the adapter lost the control (`AVAILABILITY` is `UNAVAILABLE`): what is older is no value. An agent whose
//! adapter never tells its availability has every value after that moment.

use crate::conditions::StandingConditions;
use crate::plan::{ChannelPlan, ConditionChannel, FedChannel};
use crate::streams::{ConditionLevel, Observation, UNAVAILABLE};
use adapter_core::channel::ChannelId;
use adapter_core::clock::TimeNs;
use adapter_core::driver::SourceProblem;
use adapter_core::reading::{Absence, Reading, Stamp, Value};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// At most so many words of the agent that are not understood are told.
const UNKNOWN_WORDS_MAX: usize = 8;

#[derive(Debug, Clone)]
struct HeldValue {
    reading: Reading,
    sequence: Option<u64>,
}

/// The state of a device.
#[derive(Debug, Clone, Default)]
pub(crate) struct HeldValues {
    values: HashMap<ChannelId, HeldValue>,
    conditions: StandingConditions,
    /// Time of the newest reading of each channel.
    stamped_ns: HashMap<ChannelId, TimeNs>,
    /// Number of the observation that said that the control is not reached.
    lost_at: Option<u64>,
    is_lost: bool,
    /// What the agent said of channels with words of their own, where it is none of them.
    unknown_words: BTreeMap<ChannelId, String>,
}

impl HeldValues {
    /// Forgets which faults and warnings stand: `current` tells all of them.
    pub(crate) fn clear_conditions(&mut self) {
        self.conditions = StandingConditions::default();
    }

    /// Has this observation of an item been taken already?
    pub(crate) fn holds_observation(&self, plan: &ChannelPlan, observation: &Observation) -> bool {
        let fed = plan.channels_by_item.get(&observation.item).and_then(|fed| fed.first());
        let held = fed.and_then(|fed| self.values.get(&fed.channel));
        held.is_some_and(|held| held.sequence.is_some() && held.sequence == observation.sequence)
    }

    /// Takes an observation, and appends what it says to `out`.
    pub(crate) fn record_observation(
        &mut self,
        plan: &ChannelPlan,
        observation: &Observation,
        stamp: Stamp,
        out: &mut Vec<Reading>,
    ) {
        if plan.availability.as_deref() == Some(observation.item.as_str()) {
            self.is_lost = observation.text == UNAVAILABLE;
            self.lost_at = if self.is_lost { observation.sequence } else { None };
        }
        if let Some(fields) = &observation.condition {
            self.conditions.record_condition(observation, fields);
            for channel in plan.conditions.iter().filter(|channel| channel.items.contains(&observation.item)) {
                out.push(self.build_condition_reading(plan, channel, stamp));
            }
            return;
        }
        for fed in plan.channels_by_item.get(&observation.item).into_iter().flatten() {
            let stamp = self.order_stamp(fed.channel, stamp);
            let reading = build_reading(fed, observation, stamp);
            self.note_unknown_word(fed, observation, &reading);
            out.push(reading.clone());
            self.values.insert(fed.channel, HeldValue { reading, sequence: observation.sequence });
        }
    }

    /// Appends what every channel says as of `stamp`.
    pub(crate) fn append_all(&mut self, plan: &ChannelPlan, stamp: Stamp, out: &mut Vec<Reading>) {
        for fed in plan.channels_by_item.values().flatten() {
            let stamp = self.order_stamp(fed.channel, stamp);
            out.push(match self.values.get(&fed.channel) {
                Some(held) if self.counts(held.sequence) => restamp(&held.reading, stamp),
                Some(_) => Reading::from_absence(fed.channel, stamp, Absence::Disconnected),
                None => Reading::from_absence(fed.channel, stamp, Absence::NotYetRead),
            });
        }
        for channel in &plan.conditions {
            out.push(self.build_condition_reading(plan, channel, stamp));
        }
        let absent = |channel: &ChannelId| Reading::from_absence(*channel, stamp, Absence::NotSupported);
        out.extend(plan.absent.iter().map(absent));
    }

    /// Is a value of this number newer than the loss of the control?
    fn counts(&self, sequence: Option<u64>) -> bool {
        !self.is_lost || sequence > self.lost_at
    }

    /// Readings of a channel are in the order in which they came: one whose time lies before that of the reading before it is put right
    /// behind it, and its width tells by how much.
    fn order_stamp(&mut self, channel: ChannelId, stamp: Stamp) -> Stamp {
        let last_ns = self.stamped_ns.entry(channel).or_insert(TimeNs::MIN);
        let mid_ns = stamp.mid_ns.max(last_ns.saturating_add(1));
        *last_ns = mid_ns;
        Stamp { mid_ns, half_width_ns: stamp.half_width_ns.saturating_add(mid_ns - stamp.mid_ns) }
    }

    fn build_condition_reading(&mut self, plan: &ChannelPlan, condition: &ConditionChannel, stamp: Stamp) -> Reading {
        let stamp = self.order_stamp(condition.channel, stamp);
        let lost_at = if self.is_lost { Some(self.lost_at.unwrap_or(u64::MAX)) } else { None };
        if !self.conditions.is_known(&condition.items, lost_at) {
            return Reading::from_absence(condition.channel, stamp, Absence::Disconnected);
        }
        let mut texts = self.conditions.format_standing(&condition.items, condition.level);
        // As with other controls an emergency stop is an alarm, too.
        if condition.level == ConditionLevel::Fault && condition.channel.name() == "alarm" && self.is_stopped(plan) {
            texts.insert(0, "EMERGENCY STOP".to_owned());
        }
        Reading::from_text(condition.channel, stamp, Arc::from(texts.join("; ")))
    }

    fn is_stopped(&self, plan: &ChannelPlan) -> bool {
        let stop = plan.channels_by_item.values().flatten().find(|fed| fed.channel.name() == "emergency_stop");
        let held = stop.and_then(|fed| self.values.get(&fed.channel)).filter(|held| self.counts(held.sequence));
        held.is_some_and(|held| held.reading.value == Ok(Value::Number(1.0)))
    }

    fn note_unknown_word(&mut self, fed: &FedChannel, observation: &Observation, reading: &Reading) {
        let is_unknown = reading.value == Err(Absence::OutOfRange) && reading.implausible.is_none();
        if !is_unknown {
            self.unknown_words.remove(&fed.channel);
        } else if self.unknown_words.len() < UNKNOWN_WORDS_MAX {
            self.unknown_words.insert(fed.channel, observation.text.chars().take(60).collect());
        }
    }

    /// What is wrong with what the device says.
    pub(crate) fn list_problems(&self) -> Vec<SourceProblem> {
        let lost =
            self.is_lost && !self.values.values().any(|held| held.reading.value.is_ok() && self.counts(held.sequence));
        let lost = lost.then(|| SourceProblem {
            what: "the agent answers, but its adapter does not reach the control (AVAILABILITY is UNAVAILABLE)"
                .to_owned(),
            next: "Look whether the control is switched on, and whether the adapter runs and is connected to it"
                .to_owned(),
        });
        let unknown = self.unknown_words.iter().map(|(channel, word)| SourceProblem {
            what: format!("{channel} has no value: the agent says {word:?}, which is no value of it"),
            next: "Look at the adapter's settings; a data item of another meaning can be read as a channel of your own"
                .to_owned(),
        });
        lost.into_iter().chain(unknown).collect()
    }
}

fn restamp(reading: &Reading, stamp: Stamp) -> Reading {
    let mut again = reading.clone();
    again.stamp = stamp;
    again
}

fn build_reading(fed: &FedChannel, observation: &Observation, stamp: Stamp) -> Reading {
    if observation.text == UNAVAILABLE {
        return Reading::from_absence(fed.channel, stamp, Absence::Disconnected);
    }
    let Some(own) = &fed.own else {
        return fed.form.build_reading(fed.channel, stamp, &observation.text, fed.conversion);
    };
    if !fed.form.is_number() {
        return own.to_reading(stamp, Ok(Value::Text(Arc::from(observation.text.as_str()))));
    }
    let number = observation.text.parse::<f64>().map_err(|_| Absence::OutOfRange);
    let conversion = fed.conversion.ok_or(Absence::UnknownUnit);
    let number = conversion.and_then(|conversion| number.map(|number| conversion.convert_number(number)));
    own.to_reading(stamp, number.and_then(Value::from_number))
}
