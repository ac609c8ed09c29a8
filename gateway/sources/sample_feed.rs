//! Where samples come from: sources on their own threads for a real machine, sources in step for an accelerated one.

use super::origin_log::OriginLog;
use adapters::clock::TimeNs;
use adapters::histogram::Histogram;
use adapters::merge::{Lockstep, Merge, MergeCounts, SourceId};
use adapters::worker::{Poll, Worker, WorkerState, WorkerStats};
use adapters::{ChannelId, Fact, FactValue, Sample, SourceError, SourceProblem};
use gateway_base::log::Notice;
use gateway_status::alignment::Alignment;
use gateway_status::{FactStatus, NumberOrWord, SourceStatus, StatusProblem};
use std::time::Duration;

/// Where samples come from: sources on threads of their own, or sources in step with machine time.
pub enum SampleFeed {
    /// One thread per source.
    Threads {
        /// The sources, in the order of precedence.
        workers: Vec<Worker>,
        /// Makes one sample of their readings.
        merge: Merge,
        /// Lag of each meter.
        alignment: Alignment,
    },
    /// Sources that bring their own time.
    Stepped {
        /// Advances the sources and merges their readings.
        lockstep: Lockstep,
        /// Name and period of each source.
        sources: Vec<(String, Duration)>,
        /// Lag of each meter.
        alignment: Alignment,
    },
}

/// At which pace a source is read.
#[derive(Debug, Clone, PartialEq)]
pub struct SourcePace {
    /// Address of the source, as in the configuration.
    pub name: String,
    /// The pace that was wanted.
    pub wanted: Duration,
    /// The pace that the device keeps at the moment.
    pub kept: Duration,
}

impl SampleFeed {
    /// The pace of each source that has been read.
    #[must_use]
    pub fn list_paces(&self, now_ns: TimeNs) -> Vec<Option<SourcePace>> {
        let Self::Threads { workers, .. } = self else { return Vec::new() };
        let pace = |worker: &Worker| {
            let WorkerStats { period, pace, polls, .. } = worker.stats(now_ns);
            (polls > 1).then(|| SourcePace { name: worker.name().to_owned(), wanted: period, kept: pace })
        };
        workers.iter().map(pace).collect()
    }

    /// Samples at the tick `now_ns` (minus the merge's delay). `false` when every source has come to its end.
    pub fn sample_into(&mut self, sample: &mut Sample, now_ns: TimeNs) -> bool {
        match self {
            Self::Threads { workers, merge, alignment } => {
                for (index, worker) in workers.iter().enumerate() {
                    let source = SourceId(index);
                    let see = |poll: &Poll| {
                        alignment.observe_readings(source, poll.error.is_none().then_some(&poll.readings))
                    };
                    worker.drain_seen_into(merge, source, see);
                }
                alignment.update_lags(now_ns, merge);
                merge.sample_into(sample, now_ns.saturating_sub(merge.delay_ns()));
                !workers.iter().all(Worker::is_finished)
            }
            Self::Stepped { lockstep, alignment, .. } => {
                alignment.update_lags(now_ns, lockstep.merge_mut());
                lockstep
                    .sample_seen_into(sample, now_ns, |source, readings| alignment.observe_readings(source, readings))
            }
        }
    }

    /// Lag of each meter.
    #[must_use]
    pub fn alignment(&self) -> &Alignment {
        match self {
            Self::Threads { alignment, .. } | Self::Stepped { alignment, .. } => alignment,
        }
    }

    /// Lag of each meter, to be told what the machine does.
    pub fn alignment_mut(&mut self) -> &mut Alignment {
        match self {
            Self::Threads { alignment, .. } | Self::Stepped { alignment, .. } => alignment,
        }
    }

    fn merge(&self) -> &Merge {
        match self {
            Self::Threads { merge, .. } => merge,
            Self::Stepped { lockstep, .. } => lockstep.merge(),
        }
    }

    /// Which channels have begun to come from another source.
    pub fn tell_origins(&self, log: &mut OriginLog, at_ns: TimeNs) -> Vec<Notice> {
        log.take_notices(self.merge(), at_ns, |source| self.name_of(source).to_owned())
    }

    /// The name of the source that a channel has its value from.
    #[must_use]
    pub fn find_origin_name(&self, channel: ChannelId) -> Option<&str> {
        self.merge().find_current_source(channel).map(|source| self.name_of(source))
    }

    fn name_of(&self, source: SourceId) -> &str {
        match self {
            Self::Threads { workers, .. } => workers.get(source.0).map_or("", Worker::name),
            Self::Stepped { sources, .. } => sources.get(source.0).map_or("", |(name, _)| name.as_str()),
        }
    }

    /// Channels of each source that are not taken from it.
    fn list_unused(&self, source: usize) -> Vec<&'static str> {
        self.merge().list_unused_channels(SourceId(source)).map(ChannelId::name).collect()
    }

    /// How each source is doing.
    #[must_use]
    pub fn list_sources(&self, now_ns: TimeNs) -> Vec<SourceStatus> {
        let mut sources = self.list_source_conditions(now_ns);
        for (index, source) in sources.iter_mut().enumerate() {
            source.unused_channels = self.list_unused(index);
        }
        sources
    }

    fn list_source_conditions(&self, now_ns: TimeNs) -> Vec<SourceStatus> {
        match self {
            Self::Threads { workers, merge, .. } => {
                let each = workers.iter().enumerate();
                each.map(|(i, worker)| of_worker(worker.name(), &worker.stats(now_ns), merge.counts(SourceId(i))))
                    .collect()
            }
            Self::Stepped { lockstep, sources, .. } => {
                let each = sources.iter().enumerate();
                each.map(|(i, (name, period))| {
                    of_step(name, *period, lockstep.last_error(SourceId(i)), lockstep.merge().counts(SourceId(i)))
                })
                .collect()
            }
        }
    }

    /// Polls and waits of all threads that are over; `None` without threads. Whoever looks twice sees whether any of them moves.
    #[must_use]
    pub fn count_steps(&self) -> Option<u64> {
        match self {
            Self::Threads { workers, .. } => Some(workers.iter().map(Worker::count_steps).sum()),
            Self::Stepped { .. } => None,
        }
    }

    /// Stops every thread; does not wait for a vendor library that hangs.
    pub fn stop(&self) {
        if let Self::Threads { workers, .. } = self {
            workers.iter().for_each(Worker::stop);
        }
    }
}

fn to_milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

fn count_dropped(counts: MergeCounts) -> u64 {
    counts.too_late + counts.clock_steps + counts.unannounced
}

fn of_worker(name: &str, stats: &WorkerStats, counts: MergeCounts) -> SourceStatus {
    let failing = matches!(stats.state, WorkerState::Failing | WorkerState::Stuck);
    let known = stats.polls > 1;
    SourceStatus {
        name: name.to_owned(),
        state: stats.state.as_word(),
        error: stats.last_error.as_ref().filter(|_| failing).map(ToString::to_string),
        period_s: stats.period.as_secs_f64(),
        period_kept_s: known.then_some(stats.pace.as_secs_f64()),
        jitter_p50_ms: known.then(|| to_milliseconds(stats.lateness.p50)),
        jitter_p99_ms: known.then(|| to_milliseconds(stats.lateness.p99)),
        round_trip_p50_ms: known.then(|| to_milliseconds(stats.round_trip.p50)),
        round_trip_p99_ms: known.then(|| to_milliseconds(stats.round_trip.p99)),
        round_trips: stats.round_trips,
        lag_s: stats.lag_s,
        readings: counts.readings,
        failures: stats.failures,
        missed: stats.missed,
        dropped: count_dropped(counts) + stats.dropped,
        facts: stats.facts.iter().map(to_fact_status).collect(),
        problems: stats.problems.iter().map(to_status_problem).collect(),
        unused_channels: Vec::new(),
    }
}

fn to_status_problem(problem: &SourceProblem) -> StatusProblem {
    StatusProblem { what: problem.what.clone(), next: problem.next.clone() }
}

fn to_fact_status(fact: &Fact) -> FactStatus {
    let value = match &fact.value {
        FactValue::Number(number) => NumberOrWord::Number(*number),
        FactValue::Text(text) => NumberOrWord::Text(text.clone()),
    };
    FactStatus { name: fact.name.clone(), value }
}

fn of_step(name: &str, period: Duration, error: Option<&SourceError>, counts: MergeCounts) -> SourceStatus {
    let (state, error) = match error {
        None => ("reading", None),
        Some(SourceError::Off { .. }) => ("off", None),
        Some(SourceError::End { .. }) => ("ended", None),
        Some(error) => ("failing", Some(error.to_string())),
    };
    SourceStatus {
        name: name.to_owned(),
        state,
        error,
        period_s: period.as_secs_f64(),
        period_kept_s: None,
        jitter_p50_ms: None,
        jitter_p99_ms: None,
        round_trip_p50_ms: None,
        round_trip_p99_ms: None,
        round_trips: Histogram::default(),
        lag_s: None,
        readings: counts.readings,
        failures: counts.failures,
        missed: 0,
        dropped: count_dropped(counts),
        facts: Vec::new(),
        problems: Vec::new(),
        unused_channels: Vec::new(),
    }
}
