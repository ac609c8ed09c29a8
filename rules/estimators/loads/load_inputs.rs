//! What is needed of a sample: the loads, the feed and the feed override in force.

use crate::signals::seconds_between;
use crate::{Estimates, State};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::{ChannelId, Sample};

/// A longer step between two samples is a pause: a cut begins anew after it.
const STEP_MAX_NS: i64 = 2 * SECOND_NS;

/// No control has a greater feed override.
const OVERRIDE_MAX_PCT: f64 = 254.0;

/// The channels in use, looked up once.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoadChannels {
    override_pct: ChannelId,
    feed: ChannelId,
    programmed: ChannelId,
    feed_per_rev: ChannelId,
    speed: ChannelId,
    spindle_power: ChannelId,
    current: ChannelId,
    load: ChannelId,
    pub(super) part_count: ChannelId,
    pub(super) program: ChannelId,
    pub(super) tool: ChannelId,
    pub(super) operation: ChannelId,
    pub(super) block: ChannelId,
    pub(super) material: ChannelId,
    coolant: ChannelId,
}

impl Default for LoadChannels {
    fn default() -> Self {
        let of = |name| ChannelId::from_name(name).expect("the name stands in the table, which a test checks");
        Self {
            override_pct: of("feed_override_pct"),
            feed: of("feed_mm_min"),
            programmed: of("feed_programmed_mm_min"),
            feed_per_rev: of("feed_per_rev_mm"),
            speed: of("spindle_speed_rpm"),
            spindle_power: of("spindle_power_w"),
            current: of("spindle_current_a"),
            load: of("spindle_load_pct"),
            part_count: of("part_count"),
            program: of("program"),
            tool: of("tool"),
            operation: of("operation"),
            block: of("block"),
            material: of("work_material"),
            coolant: of("coolant_on"),
        }
    }
}

/// One tick, as far as loads are concerned.
#[derive(Debug, Clone, Copy)]
pub(super) struct LoadMoment<'a> {
    pub(super) at_ns: TimeNs,
    /// Since the tick before, s; `None` after a pause.
    pub(super) step_s: Option<f64>,
    /// Something is being cut.
    pub(super) cutting: bool,
    /// The spindle turns without load while the axes feed: through the air, not in rapid traverse.
    pub(super) feeds_in_air: bool,
    /// Does the coolant pump run?
    pub(super) coolant_on: Option<bool>,
    /// For how long the machine has been in this state, s.
    pub(super) state_s: f64,
    /// Cutting power and its standard deviation, W.
    pub(super) cutting_power_w: Option<(f64, f64)>,
    pub(super) spindle_power_w: Option<f64>,
    pub(super) spindle_current_a: Option<f64>,
    pub(super) spindle_load_pct: Option<f64>,
    pub(super) feed_mm_min: Option<f64>,
    pub(super) programmed_mm_min: Option<f64>,
    pub(super) feed_per_rev_mm: Option<f64>,
    pub(super) speed_rpm: Option<f64>,
    /// Feed override in force, %: the greater one of what the control says and of the actual over the programmed feed, which counts
    /// up to 100 %. The control may say an override that does not act (threading), and the axes may be slower than the override (a
    /// corner): whoever needs to know that the machine has been slowed down is told so only where both agree. At a retract in
    /// rapid traverse the actual feed is many times the programmed one, which is no override.
    pub(super) in_force_pct: Option<f64>,
    pub(super) tool: &'a str,
    pub(super) material: &'a str,
}

impl LoadMoment<'_> {
    /// Feed that the axes have, percent of the programmed feed.
    pub(super) fn actual_pct(&self) -> Option<f64> {
        let programmed = self.programmed_mm_min.filter(|programmed| *programmed > 0.0)?;
        Some(100.0 * self.feed_mm_min? / programmed)
    }
}

impl LoadChannels {
    pub(super) fn read_moment<'a>(
        &self,
        sample: &'a Sample,
        estimates: &Estimates,
        last_ns: Option<TimeNs>,
    ) -> LoadMoment<'a> {
        let number = |channel| sample.number(channel).ok();
        let last_ns = last_ns.filter(|last_ns| (1..=STEP_MAX_NS).contains(&(sample.at_ns - last_ns)));
        let (feed, programmed) = (number(self.feed), number(self.programmed));
        let by_feed = feed.zip(programmed.filter(|programmed| *programmed > 0.0)).map(|(feed, of)| 100.0 * feed / of);
        LoadMoment {
            at_ns: sample.at_ns,
            step_s: last_ns.map(|last_ns| seconds_between(last_ns, sample.at_ns)),
            cutting: estimates.state == State::Cutting,
            feeds_in_air: estimates.state == State::Idle && feed.is_some_and(|feed| feed > 0.0),
            coolant_on: number(self.coolant).map(|on| on > 0.5),
            state_s: seconds_between(estimates.since_ns, sample.at_ns),
            cutting_power_w: estimates.comparable_cutting_power().ok().map(|it| (it.value, it.sd)),
            spindle_power_w: number(self.spindle_power),
            spindle_current_a: number(self.current),
            spindle_load_pct: number(self.load),
            feed_mm_min: feed,
            programmed_mm_min: programmed,
            feed_per_rev_mm: number(self.feed_per_rev),
            speed_rpm: number(self.speed),
            in_force_pct: in_force_pct(number(self.override_pct), by_feed),
            tool: sample.text(self.tool).unwrap_or_default(),
            material: sample.text(self.material).unwrap_or_default(),
        }
    }
}

/// From what the control says and what the feeds say.
fn in_force_pct(said: Option<f64>, by_feed: Option<f64>) -> Option<f64> {
    match (said, by_feed) {
        (Some(said), Some(by_feed)) => Some(said.max(by_feed.min(100.0))),
        (Some(said), None) => Some(said),
        (None, by_feed) => by_feed.filter(|pct| *pct <= OVERRIDE_MAX_PCT),
    }
}

#[cfg(test)]
mod tests {
    use super::in_force_pct;

    #[test]
    fn a_rapid_retract_and_a_corner_are_no_override() {
        assert_eq!(in_force_pct(Some(100.0), Some(5200.0)), Some(100.0), "a retract");
        assert_eq!(in_force_pct(Some(100.0), Some(40.0)), Some(100.0), "a corner");
        assert_eq!(in_force_pct(Some(60.0), Some(100.0)), Some(100.0), "an override that does not act");
        assert_eq!(in_force_pct(Some(60.0), Some(60.0)), Some(60.0));
        assert_eq!(in_force_pct(Some(120.0), Some(120.0)), Some(120.0));
        assert_eq!((in_force_pct(None, Some(80.0)), in_force_pct(None, Some(5200.0))), (Some(80.0), None));
    }
}
