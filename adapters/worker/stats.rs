//! How a source has been doing: pace, lateness, round trip, failures.

use crate::clock::{SECOND_NS, TimeNs};
use crate::driver::{Fact, SourceError, SourceProblem};
use crate::histogram::Histogram;
use adapter_core::integer::saturate_to_ns;
use std::collections::VecDeque;
use std::time::Duration;

/// Percentiles are over at most this many polls.
const WINDOW: usize = 512;

/// The pace that is kept follows from the intervals that ended within this time, and from the last two at least. The longest of
/// them does not count: a single poll that hangs must not make old values count as fresh.
const PACE_NS: i64 = 2 * SECOND_NS;

/// Of quick sources at most so many intervals are looked at.
const PACE_POLLS: usize = 64;

/// A source is never taken for slower than this: what is older than two minutes is old, whatever the pace.
const SLOWEST: Duration = Duration::from_secs(60);

/// A pace that differs less than this from the one before is the same.
const SAME_PACE: f64 = 0.1;

/// What a source is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkerState {
    /// No poll has ended yet.
    Starting,
    /// The last poll succeeded.
    Reading,
    /// The machine is off; a normal state.
    Off,
    /// The last poll failed.
    Failing,
    /// The current poll has not returned within the deadline.
    Stuck,
    /// The recording is over.
    Ended,
    /// The worker was asked to stop and has.
    Stopped,
}

impl WorkerState {
    /// The word used in JSON, SQL and on the page.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Starting => "starting",
            Self::Reading => "reading",
            Self::Off => "off",
            Self::Failing => "failing",
            Self::Stuck => "stuck",
            Self::Ended => "ended",
            Self::Stopped => "stopped",
        }
    }
}

/// Median and 99th percentile of the last polls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Spread {
    /// Half of the polls are at or below.
    pub p50: Duration,
    /// 99 of 100 polls are at or below.
    pub p99: Duration,
}

/// How a source has been doing.
#[derive(Debug, Clone, PartialEq)]
pub struct WorkerStats {
    /// What it is doing now.
    pub state: WorkerState,
    /// Since when it is in this state.
    pub state_since_ns: TimeNs,
    /// The pace it promised.
    pub period: Duration,
    /// The pace it keeps at the moment: values older than two of these count as stale.
    pub pace: Duration,
    /// The pace it keeps, from beginning to beginning of successful polls.
    pub period_kept: Spread,
    /// How late polls begin against their beat.
    pub lateness: Spread,
    /// Duration of a poll.
    pub round_trip: Spread,
    /// Durations of all polls.
    pub round_trips: Histogram,
    /// Since the last poll that succeeded, s; `None` before the first.
    pub lag_s: Option<f64>,
    /// Polls that ended, failed ones included.
    pub polls: u64,
    /// Polls that failed; a machine that is off does not count.
    pub failures: u64,
    /// Beats that were skipped because a poll took too long.
    pub missed: u64,
    /// Polls dropped because nobody took them.
    pub dropped: u64,
    /// The last error, also after it has passed.
    pub last_error: Option<SourceError>,
    /// Since when every poll has failed with it, or had until it passed.
    pub last_error_since_ns: Option<TimeNs>,
    /// What the source knows of itself, at most about a second old.
    pub facts: Vec<Fact>,
    /// What is wrong although it answers.
    pub problems: Vec<SourceProblem>,
}

/// The last durations, in nanoseconds.
struct Window {
    values: Vec<i64>,
    next: usize,
}

impl Window {
    fn new() -> Self {
        Self { values: Vec::with_capacity(WINDOW), next: 0 }
    }

    fn add(&mut self, value: i64) {
        if self.values.len() < WINDOW {
            self.values.push(value);
        } else {
            self.values[self.next] = value;
            self.next = (self.next + 1) % WINDOW;
        }
    }

    fn compute_spread(&self) -> Spread {
        let mut sorted = self.values.clone();
        sorted.sort_unstable();
        let rank = |percent: usize| (sorted.len() * percent).div_ceil(100).saturating_sub(1);
        let at = |percent| sorted.get(rank(percent)).map_or(0, |value| value.unsigned_abs());
        Spread { p50: Duration::from_nanos(at(50)), p99: Duration::from_nanos(at(99)) }
    }
}

/// Where the worker's thread writes and [`WorkerStats`] are read.
pub(super) struct WorkerCounters {
    period: Duration,
    deadline: Duration,
    state: WorkerState,
    state_since_ns: TimeNs,
    in_poll_since_ns: Option<TimeNs>,
    last_began_ns: Option<TimeNs>,
    intervals: Window,
    lateness: Window,
    round_trip: Window,
    round_trips: Histogram,
    last_success_ns: Option<TimeNs>,
    polls: u64,
    failures: u64,
    missed: u64,
    last_error: Option<SourceError>,
    last_error_since_ns: Option<TimeNs>,
    facts: Vec<Fact>,
    problems: Vec<SourceProblem>,
    /// At which it is polled now.
    beat: Duration,
    /// At which its values come, as was last told.
    pace: Duration,
    new_pace: Option<Duration>,
    /// The last intervals with their ends, ns; the newest at the end.
    latest: VecDeque<(TimeNs, i64)>,
}

impl WorkerCounters {
    pub(super) fn new(period: Duration, deadline: Duration, now_ns: TimeNs) -> Self {
        Self {
            period,
            deadline,
            state: WorkerState::Starting,
            state_since_ns: now_ns,
            in_poll_since_ns: None,
            last_began_ns: None,
            intervals: Window::new(),
            lateness: Window::new(),
            round_trip: Window::new(),
            round_trips: Histogram::default(),
            last_success_ns: None,
            polls: 0,
            failures: 0,
            missed: 0,
            last_error: None,
            last_error_since_ns: None,
            facts: Vec::new(),
            problems: Vec::new(),
            beat: period,
            pace: period,
            new_pace: None,
            latest: VecDeque::with_capacity(PACE_POLLS),
        }
    }

    /// From now on it is polled at this pace.
    pub(super) fn set_beat(&mut self, beat: Duration) {
        self.beat = beat;
    }

    pub(super) fn poll_began(&mut self, began_ns: TimeNs) {
        self.in_poll_since_ns = Some(began_ns);
    }

    pub(super) fn poll_over(
        &mut self,
        due_ns: TimeNs,
        began_ns: TimeNs,
        ended_ns: TimeNs,
        error: Option<&SourceError>,
    ) {
        self.in_poll_since_ns = None;
        self.polls += 1;
        self.lateness.add((began_ns - due_ns).max(0));
        self.round_trip.add(ended_ns - began_ns);
        self.round_trips.add_ns(ended_ns - began_ns);
        if error.is_none() {
            self.last_success_ns = Some(ended_ns);
        }
        if let Some(last_ns) = self.last_began_ns {
            self.intervals.add(began_ns - last_ns);
            if self.latest.len() >= PACE_POLLS {
                self.latest.pop_front();
            }
            self.latest.push_back((began_ns, began_ns - last_ns));
        }
        self.last_began_ns = error.is_none().then_some(began_ns);
        if let Some(error) = error {
            self.record_failure(error, ended_ns);
        }
        self.enter_state(state_after(error), ended_ns);
        self.look_at_pace();
    }

    fn record_failure(&mut self, error: &SourceError, ended_ns: TimeNs) {
        if matches!(error, SourceError::Off { .. } | SourceError::End { .. }) {
            return;
        }
        self.failures += 1;
        if self.state != WorkerState::Failing || self.last_error.as_ref() != Some(error) {
            self.last_error = Some(error.clone());
            self.last_error_since_ns = Some(ended_ns);
        }
    }

    fn enter_state(&mut self, state: WorkerState, at_ns: TimeNs) {
        if self.state != state {
            self.state = state;
            self.state_since_ns = at_ns;
        }
    }

    fn look_at_pace(&mut self) {
        let pace = self.beat.max(self.estimate_kept_pace()).min(SLOWEST.max(self.period));
        let differs = pace.abs_diff(self.pace).as_secs_f64() > SAME_PACE * self.pace.as_secs_f64();
        if differs || (pace == self.period && pace != self.pace) {
            self.pace = pace;
            self.new_pace = Some(pace);
        }
    }

    /// The second longest of the last intervals, where it is visibly longer than the beat.
    fn estimate_kept_pace(&self) -> Duration {
        let since_ns = self.latest.back().map_or(TimeNs::MIN, |(ended_ns, _)| ended_ns.saturating_sub(PACE_NS));
        let late = self.latest.iter().rev().enumerate();
        let late = late.take_while(|(place, (ended_ns, _))| *place < 2 || *ended_ns > since_ns);
        let mut longest = [0_i64; 2];
        for (_, (_, ns)) in late {
            longest = [longest[0].max(*ns), longest[1].max((*ns).min(longest[0]))];
        }
        let kept = Duration::from_nanos(longest[1].unsigned_abs());
        if kept > self.beat * 6 / 5 { kept } else { Duration::ZERO }
    }

    /// The pace the source keeps, if that has changed since it was last asked for.
    pub(super) fn take_new_pace(&mut self) -> Option<Duration> {
        self.new_pace.take()
    }

    pub(super) fn set_facts(&mut self, facts: Vec<Fact>) {
        self.facts = facts;
    }

    pub(super) fn set_problems(&mut self, problems: Vec<SourceProblem>) {
        self.problems = problems;
    }

    pub(super) fn count_missed(&mut self, beats: u64) {
        self.missed += beats;
    }

    pub(super) fn record_stop(&mut self, at_ns: TimeNs) {
        self.enter_state(WorkerState::Stopped, at_ns);
    }

    pub(super) fn build_stats(&self, now_ns: TimeNs, dropped: u64) -> WorkerStats {
        let deadline_ns = saturate_to_ns(self.deadline);
        let stuck_ns = self.in_poll_since_ns.filter(|since_ns| now_ns - since_ns > deadline_ns);
        WorkerStats {
            state: if stuck_ns.is_some() { WorkerState::Stuck } else { self.state },
            state_since_ns: stuck_ns.unwrap_or(self.state_since_ns),
            period: self.period,
            pace: self.pace,
            period_kept: self.intervals.compute_spread(),
            lateness: self.lateness.compute_spread(),
            round_trip: self.round_trip.compute_spread(),
            round_trips: self.round_trips,
            lag_s: self.last_success_ns.map(|last_ns| (now_ns - last_ns).max(0) as f64 / 1e9),
            polls: self.polls,
            failures: self.failures,
            missed: self.missed,
            dropped,
            last_error: self.last_error.clone(),
            last_error_since_ns: self.last_error_since_ns,
            facts: self.facts.clone(),
            problems: self.problems.clone(),
        }
    }
}

fn state_after(error: Option<&SourceError>) -> WorkerState {
    match error {
        None => WorkerState::Reading,
        Some(SourceError::Off { .. }) => WorkerState::Off,
        Some(SourceError::End { .. }) => WorkerState::Ended,
        Some(_) => WorkerState::Failing,
    }
}
