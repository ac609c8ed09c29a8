//! Readings of all sources onto the gateway's tick.
//!
//! The merge looks a little back in time ([`Merge::delay_ns`], one period of the slowest source unless set otherwise),
//! so that a continuous channel usually has a reading on either side of the tick. Between the two it interpolates;
//! commands, counters and words hold. Nothing bridges a gap of more than two periods of its source: then the slot holds
//! the reason the source gave, or [`Absence::Stale`]. Every value carries its age.
//!
//! A source may deliver late and out of order: a reading that still matters is put in its place, one that does not is
//! counted and dropped. A poll that failed ends the freshness of its source: what came before it is not held any longer. Where a clock steps, readings stamped by the wrong clock are dropped and counted.
//!
//! Where several sources deliver a channel, it belongs to the first of them that has it at all. Another one takes its place only where
//! its plan says so ([`SourcePlan::stand_in`]); else the channel is absent for the reason of the one it belongs to. [`Merge::find_origin`]
//! tells where the newest value came from.
//!
//! A source whose readings were true some time before their stamps (a meter that averages and transmits) is told so by
//! [`Merge::set_lag_ns`]; its stamps are shifted and every tick looks back further by as much.
//!
//! The merge is pure: time is an argument, the same readings and ticks give the same samples. It allocates nothing per
//! tick once its rings have their size.

mod counts;
mod lane;
mod lockstep;
mod track;

#[cfg(test)]
mod origin_tests;

#[cfg(test)]
mod properties;

pub use counts::MergeCounts;
pub use lane::Origin;
pub use lockstep::Lockstep;

use crate::channel::{ChannelId, Kind};
use crate::clock::TimeNs;
use crate::driver::{Pull, Source, SourceError};
use crate::integer::{convert_bounded, saturate_to_wait_ns, widen_to_usize};
use crate::reading::{Absence, Reading};
use crate::sample::Sample;
use lane::Lane;
use std::time::Duration;
use track::{PeriodLimits, Put, ReadingTrack};

/// Position of a source in the list the merge was built from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SourceId(pub usize);

/// What the merge must know of a source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourcePlan {
    /// The address, as in the configuration.
    pub name: String,
    /// The channels it can deliver.
    pub channels: Vec<ChannelId>,
    /// From one poll to the next, as the source promises it.
    pub period: Duration,
    /// Those of its channels that it may deliver while the source that they belong to has no value.
    pub stand_in: Vec<ChannelId>,
}

impl SourcePlan {
    /// The plan of a live source.
    #[must_use]
    pub fn from_source(source: &dyn Source) -> Self {
        Self::without_stand_in(source.name(), source.channels(), source.period())
    }

    /// The plan of a source that brings its own time.
    #[must_use]
    pub fn of_pull(source: &dyn Pull) -> Self {
        Self::without_stand_in(source.name(), source.channels(), source.period())
    }

    fn without_stand_in(name: &str, channels: &[ChannelId], period: Duration) -> Self {
        Self { name: name.to_owned(), channels: channels.to_vec(), period, stand_in: Vec::new() }
    }
}

/// How far back the merge looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Delay {
    /// One and a quarter periods of the slowest source with a channel that is interpolated, at most [`DELAY_MAX`].
    #[default]
    SlowestPeriod,
    /// Exactly this; zero means that the newest values are held and never interpolated.
    Fixed(Duration),
}

/// [`Delay::SlowestPeriod`] waits no longer than this for a slow source; its values are then held between readings.
pub const DELAY_MAX: Duration = Duration::from_secs(1);

/// A source is never shifted by more than this.
pub const LAG_MAX: Duration = Duration::from_secs(2);

/// No gap of more than this many periods of a source is bridged.
pub const GAP_PERIODS: i64 = 2;

struct SourceState {
    period_limits: PeriodLimits,
    /// Its readings were true so much before their stamps.
    lag_ns: i64,
    newest_ns: TimeNs,
    failure: Option<Failure>,
    counts: MergeCounts,
}

/// A stretch in which whole polls of a source failed.
#[derive(Debug, Clone, Copy)]
struct Failure {
    /// Stamp of the newest reading before it: what goes stale after this does so because of the failure.
    after_ns: TimeNs,
    since_ns: TimeNs,
    until_ns: Option<TimeNs>,
    reason: Absence,
}

impl Failure {
    fn ended_by(&self, at_ns: TimeNs) -> bool {
        self.until_ns.is_some_and(|until_ns| until_ns <= at_ns)
    }
}

const NO_TRACK: u32 = u32::MAX;

/// Readings in, samples out. See the [module](self).
pub struct Merge {
    sources: Vec<SourceState>,
    lanes: Vec<Lane>,
    tracks: Vec<ReadingTrack>,
    /// Track of (source, channel), or [`NO_TRACK`].
    lookup: Vec<u32>,
    /// Channels that there were when the merge was made.
    channels: usize,
    delay_ns: i64,
    last_tick_ns: TimeNs,
    tick_steps: u64,
}

impl Merge {
    /// A merge of these sources, in the order of precedence.
    #[must_use]
    pub fn new(plans: &[SourcePlan], delay: Delay) -> Self {
        let delay_ns = delay_of(plans, delay);
        let channels = ChannelId::count_channels();
        let pace = |plan: &SourcePlan| PeriodLimits::new(saturate_to_wait_ns(plan.period), delay_ns);
        let mut merge = Self {
            sources: plans
                .iter()
                .map(|plan| SourceState {
                    period_limits: pace(plan),
                    lag_ns: 0,
                    newest_ns: TimeNs::MIN,
                    failure: None,
                    counts: MergeCounts::default(),
                })
                .collect(),
            lanes: Vec::new(),
            tracks: Vec::new(),
            lookup: vec![NO_TRACK; plans.len() * channels],
            channels,
            delay_ns,
            last_tick_ns: TimeNs::MIN,
            tick_steps: 0,
        };
        ChannelId::list_all().take(channels).for_each(|channel| merge.add_lane(plans, channel));
        merge
    }

    fn add_lane(&mut self, plans: &[SourcePlan], channel: ChannelId) {
        let first = self.tracks.len();
        for (source, plan) in plans.iter().enumerate().filter(|(_, plan)| plan.channels.contains(&channel)) {
            let track = self.tracks.len();
            self.lookup[source * self.channels + channel.index()] = convert_bounded(track, NO_TRACK);
            let mut track = ReadingTrack::new(channel, source, self.sources[source].period_limits);
            track.stands_in = plan.stand_in.contains(&channel);
            self.tracks.push(track);
        }
        if self.tracks.len() > first {
            self.lanes.push(Lane { channel, tracks: first..self.tracks.len(), origin: None, has_value: false });
        }
    }

    /// How far back to look: sample at `now - delay_ns`. The lag of the latest source comes on top.
    #[must_use]
    pub fn delay_ns(&self) -> i64 {
        self.delay_ns + self.sources.iter().map(|state| state.lag_ns).fold(0, i64::max)
    }

    /// What this source says from now on was true so much before its stamps (behind them where negative). Whoever changes
    /// it does so slowly, by less than the time that passes; beyond [`LAG_MAX`] it is cut off.
    pub fn set_lag_ns(&mut self, source: SourceId, lag_ns: i64) {
        let most_ns = saturate_to_wait_ns(LAG_MAX);
        if let Some(state) = self.sources.get_mut(source.0) {
            state.lag_ns = lag_ns.clamp(-most_ns, most_ns);
        }
    }

    /// The lag of a source, ns.
    #[must_use]
    pub fn lag_ns(&self, source: SourceId) -> i64 {
        self.sources.get(source.0).map_or(0, |state| state.lag_ns)
    }

    /// A source turned out to be slower (or faster) than it promised: gaps are measured with this period from now on.
    pub fn set_period(&mut self, source: SourceId, period: Duration) {
        let Some(state) = self.sources.get_mut(source.0) else { return };
        state.period_limits = PeriodLimits::new(saturate_to_wait_ns(period), self.delay_ns);
    }

    /// Takes a reading. One of a channel that the source did not announce is counted and dropped.
    pub fn push(&mut self, source: SourceId, reading: Reading) {
        let Some(state) = self.sources.get_mut(source.0) else { return };
        state.counts.readings += 1;
        // A channel that was declared later has no track.
        let known = reading.channel.index() < self.channels;
        let track = if known { self.lookup[source.0 * self.channels + reading.channel.index()] } else { NO_TRACK };
        let Some(track) = self.tracks.get_mut(widen_to_usize(track)) else {
            state.counts.unannounced += 1;
            return;
        };
        let mid_ns = reading.stamp.mid_ns - state.lag_ns;
        if let Some(failure) = state.failure.as_mut().filter(|failure| failure.since_ns < mid_ns) {
            failure.until_ns.get_or_insert(mid_ns);
        }
        state.newest_ns = state.newest_ns.max(mid_ns);
        let late = mid_ns <= self.last_tick_ns;
        let put = track.insert_reading(mid_ns, reading.value, self.last_tick_ns, &state.period_limits);
        state.counts.count_reading(put, late);
    }

    /// Takes every reading out of `readings`.
    pub fn push_all(&mut self, source: SourceId, readings: &mut Vec<Reading>) {
        readings.drain(..).for_each(|reading| self.push(source, reading));
    }

    /// A whole poll of the source failed at `at_ns`. Its channels have the reason from then on until the next answer.
    pub fn record_failure(&mut self, source: SourceId, at_ns: TimeNs, error: &SourceError) {
        let Some(state) = self.sources.get_mut(source.0) else { return };
        state.counts.failures += 1;
        let since_ns = at_ns - state.lag_ns;
        let new = Failure { after_ns: state.newest_ns, since_ns, until_ns: None, reason: error.to_absence() };
        let going_on = state.failure.filter(|failure| failure.until_ns.is_none());
        state.failure = Some(going_on.map_or(new, |failure| Failure { reason: new.reason, ..failure }));
    }

    /// Writes every announced channel at `at_ns` into `sample` (from [`Sample::new_empty`]); other slots are left alone.
    /// Ticks normally increase; one that goes back counts as a clock step.
    pub fn sample_into(&mut self, sample: &mut Sample, at_ns: TimeNs) {
        if at_ns < self.last_tick_ns {
            self.step_back(at_ns);
        }
        self.last_tick_ns = at_ns;
        sample.at_ns = at_ns;
        for lane in &mut self.lanes {
            let slot = lane.choose_slot(&mut self.tracks, &mut self.sources, at_ns);
            sample.set_slot(lane.channel, slot);
        }
    }

    /// Where the newest value of a channel came from; `None` before the first one.
    #[must_use]
    pub fn find_origin(&self, channel: ChannelId) -> Option<Origin> {
        self.find_lane(channel)?.origin
    }

    /// The source of the value that a channel had at the newest tick; `None` where it had none.
    #[must_use]
    pub fn find_current_source(&self, channel: ChannelId) -> Option<SourceId> {
        let lane = self.find_lane(channel).filter(|lane| lane.has_value)?;
        lane.origin.map(|origin| origin.source)
    }

    /// The lanes are in the order of the table.
    fn find_lane(&self, channel: ChannelId) -> Option<&Lane> {
        let at = self.lanes.binary_search_by_key(&channel.index(), |lane| lane.channel.index()).ok()?;
        self.lanes.get(at)
    }

    /// The channels that more than one source delivers.
    pub fn list_shared_channels(&self) -> impl Iterator<Item = ChannelId> {
        self.lanes.iter().filter(|lane| lane.tracks.len() > 1).map(|lane| lane.channel)
    }

    /// Channels that this source delivers and that are not taken from it, now and while the source that they belong to has no value either.
    pub fn list_unused_channels(&self, source: SourceId) -> impl Iterator<Item = ChannelId> {
        self.lanes.iter().filter(move |lane| lane.leaves_out(source, &self.tracks)).map(|lane| lane.channel)
    }

    fn step_back(&mut self, at_ns: TimeNs) {
        self.tick_steps += 1;
        for track in &mut self.tracks {
            track.drop_after(at_ns + self.sources[track.source].period_limits.horizon_ns);
        }
    }

    /// What happened to the readings of a source.
    #[must_use]
    pub fn counts(&self, source: SourceId) -> MergeCounts {
        self.sources.get(source.0).map(|state| state.counts).unwrap_or_default()
    }

    /// How often a tick was earlier than the one before: steps of the gateway's clock.
    #[must_use]
    pub fn tick_steps(&self) -> u64 {
        self.tick_steps
    }
}

fn delay_of(plans: &[SourcePlan], delay: Delay) -> i64 {
    // Only what is interpolated has to wait for the next reading of its source.
    let waits = |plan: &&SourcePlan| plan.channels.iter().any(|id| id.channel().kind == Kind::Continuous);
    let slowest = plans.iter().filter(waits).map(|plan| plan.period).max();
    let slowest = slowest.or_else(|| plans.iter().map(|plan| plan.period).max()).unwrap_or_default();
    match delay {
        Delay::Fixed(delay) => saturate_to_wait_ns(delay),
        Delay::SlowestPeriod => saturate_to_wait_ns((slowest * 5 / 4).min(DELAY_MAX)),
    }
}

#[cfg(test)]
mod tests;
