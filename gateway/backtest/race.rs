//! Both sets side by side, on as many processors as there is work for.
//!
//! A script sees samples, estimates and its own memory. Scripts that are the same in both sets
//! therefore run once, for both; so do the estimators where both sets want the same settings. Reading, what both have in
//! common, and what differs are three threads in a row, with a few batches of samples between them: what is in memory does
//! not grow with the stretch.

use super::lane::{self, Lane};
use crate::lane::to_seconds;
use adapter_core::Sample;
use adapter_core::clock::TimeNs;
use gateway_history::HistoryError;
use gateway_pipeline::{Channels, CycleFollower};
use rules::estimators::wear::WearEstimator;
use rules::estimators::{self, Estimates};
use rules::script::{Decision, Host, ScriptSet};
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Samples that go from one thread to the next together.
const BATCH: usize = 256;
/// Batches between two threads.
const BATCHES_MAX: usize = 3;

/// Everything that is inferred of a sample before scripts decide.
struct Inferring {
    estimators: estimators::Inference,
    wear: WearEstimator,
    cycles: CycleFollower,
    channels: Channels,
}

impl Inferring {
    fn infer_estimates(&mut self, sample: &Sample) -> Estimates {
        let mut estimates = *self.estimators.update_with_sample(sample);
        self.wear.update_estimates(sample, &mut estimates);
        let _finished = self.cycles.follow_tick(&self.channels, sample, &estimates);
        estimates.part = self.cycles.last_figures();
        estimates
    }
}

/// Scripts with estimators of their own, or with somebody else's.
struct Runner {
    estimators: Option<Inferring>,
    host: Host,
    generation: u64,
}

impl Runner {
    fn new(set: ScriptSet, infers: bool) -> Self {
        let mut host = Host::new();
        host.install_set(set);
        let estimators = infers.then(|| Inferring {
            estimators: estimators::Inference::new(host.settings().clone()),
            wear: WearEstimator::default(),
            cycles: CycleFollower::default(),
            channels: Channels::new(),
        });
        Self { estimators, generation: host.generation(), host }
    }

    /// The estimates that it goes by, and what its scripts decide.
    fn run_tick(&mut self, sample: &Sample, estimates: Option<&Estimates>) -> (Estimates, &Decision) {
        let estimates = match (&mut self.estimators, estimates) {
            (None, Some(estimates)) => *estimates,
            (None, None) => Estimates::without_samples(sample.at_ns),
            (Some(estimators), _) => {
                if self.generation != self.host.generation() {
                    self.generation = self.host.generation();
                    estimators.estimators.apply_settings(self.host.settings().clone());
                }
                estimators.infer_estimates(sample)
            }
        };
        let decision = self.host.run_due_scripts(sample, &estimates);
        if let Some(estimators) = &mut self.estimators {
            decision.learn_anew.iter().for_each(|program| estimators.estimators.learn_load_anew(program));
        }
        (estimates, decision)
    }
}

/// Samples, and what has been found out about them on the way.
#[derive(Default)]
struct SampleBatch {
    samples: Vec<Sample>,
    used: usize,
    first: Vec<(Estimates, Decision)>,
}

impl SampleBatch {
    fn push(&mut self, sample: &Sample) {
        match self.samples.get_mut(self.used) {
            Some(place) => place.clone_from(sample),
            None => self.samples.push(sample.clone()),
        }
        self.used += 1;
    }
}

struct Split {
    /// What both have in common; where the settings differ, everything of the running set.
    first: Runner,
    /// What only the running set has. None where `first` has it all, and the edited scripts go by estimates of their own.
    running: Option<Runner>,
    edited: Runner,
}

impl Split {
    fn new(running: ScriptSet, edited: ScriptSet) -> Self {
        if running.settings() != edited.settings() {
            let (first, edited) = (Runner::new(running, true), Runner::new(edited, true));
            return Self { first, running: None, edited };
        }
        let (common, running, edited) = running.partition_with(edited);
        let first = Runner::new(common, true);
        Self { first, running: Some(Runner::new(running, false)), edited: Runner::new(edited, false) }
    }
}

pub(super) struct Raced {
    pub(super) running: Lane,
    pub(super) edited: Lane,
    pub(super) rows: u64,
    pub(super) first_ns: Option<TimeNs>,
    pub(super) last_ns: Option<TimeNs>,
    pub(super) covered_s: f64,
    pub(super) differing_s: f64,
}

/// Runs both over what `read` hands on.
///
/// # Errors
/// What `read` says.
pub(super) fn run_both_sets(
    from_ns: TimeNs,
    running: ScriptSet,
    edited: ScriptSet,
    read: impl FnOnce(&mut dyn FnMut(&Sample)) -> Result<(), HistoryError>,
) -> Result<Raced, HistoryError> {
    let lanes = [&running, &edited].map(|set| Lane::new(from_ns, set.len()));
    let Split { first, running, edited } = Split::new(running, edited);
    let mut finish = Finish::new(from_ns, lanes, running, edited);
    let (to_first, of_reader) = sync_channel(BATCHES_MAX);
    let (to_last, of_first) = sync_channel(BATCHES_MAX);
    let (give_back, empty) = sync_channel(2 * BATCHES_MAX + 3);
    let read = std::thread::scope(|scope| {
        let common = scope.spawn(move || run_shared_scripts(first, &of_reader, &to_last));
        let last = &mut finish;
        let rest = scope.spawn(move || {
            for mut batch in &of_first {
                last.accept_batch(&mut batch);
                // Whoever reads may have come to the end.
                let _not_needed = give_back.try_send(batch);
            }
        });
        let read = hand_on(read, &to_first, &empty);
        drop(to_first);
        for thread in [common.join(), rest.join()] {
            thread.unwrap_or_else(|panic| resume_unwind(panic));
        }
        read
    });
    read.map(|()| finish.into_result())
}

/// Gathers samples into batches.
fn hand_on(
    read: impl FnOnce(&mut dyn FnMut(&Sample)) -> Result<(), HistoryError>,
    to: &SyncSender<SampleBatch>,
    empty: &Receiver<SampleBatch>,
) -> Result<(), HistoryError> {
    let mut batch = SampleBatch::default();
    let read = read(&mut |sample| {
        batch.push(sample);
        if batch.used >= BATCH {
            // Nobody takes it any more when a thread has panicked, which is told when it is joined.
            let _sent = to.send(std::mem::replace(&mut batch, empty.try_recv().unwrap_or_default()));
        }
    });
    let _sent = to.send(batch);
    read
}

fn run_shared_scripts(mut first: Runner, from: &Receiver<SampleBatch>, to: &SyncSender<SampleBatch>) {
    for mut batch in from {
        batch.first.clear();
        for sample in &batch.samples[..batch.used] {
            let (estimates, decision) = first.run_tick(sample, None);
            // Empty at almost every tick, so that it costs nothing to copy.
            batch.first.push((estimates, decision.clone()));
        }
        if to.send(batch).is_err() {
            return;
        }
    }
}

/// What differs, and the accounts of both.
struct Finish {
    from_ns: TimeNs,
    lanes: [Lane; 2],
    running: Option<Runner>,
    edited: Runner,
    rows: u64,
    first_ns: Option<TimeNs>,
    last_ns: Option<TimeNs>,
    covered_ns: i64,
    differing_ns: i64,
}

impl Finish {
    fn new(from_ns: TimeNs, lanes: [Lane; 2], running: Option<Runner>, edited: Runner) -> Self {
        let (first_ns, last_ns) = (None, None);
        Self { from_ns, lanes, running, edited, rows: 0, first_ns, last_ns, covered_ns: 0, differing_ns: 0 }
    }

    fn accept_batch(&mut self, batch: &mut SampleBatch) {
        for (sample, (estimates, decision)) in batch.samples[..batch.used].iter().zip(&batch.first) {
            self.accept_sample(sample, estimates, decision);
        }
        batch.used = 0;
    }

    fn accept_sample(&mut self, sample: &Sample, estimates: &Estimates, first: &Decision) {
        let at_ns = sample.at_ns;
        let step_ns = self.last_ns.replace(at_ns).map_or(0, |last_ns| at_ns - last_ns);
        // A longer step is a gap, in which nobody asked for anything.
        let step_ns = if (0..=lane::STEP_MAX_NS).contains(&step_ns) { step_ns } else { 0 };
        let [running, edited] = &mut self.lanes;
        let of = |runner: &mut Runner, lane: &mut Lane, shared: bool| {
            let (own, decision) = runner.run_tick(sample, Some(estimates).filter(|_| shared));
            let both = [first, decision];
            lane.record_tick(at_ns, step_ns, own.state, if shared { &both } else { &both[1..] });
        };
        // Then the edited scripts go by the decisions and estimates of `first` too.
        let shared = self.running.is_some();
        match &mut self.running {
            Some(runner) => of(runner, running, true),
            None => running.record_tick(at_ns, step_ns, estimates.state, &[first]),
        }
        of(&mut self.edited, edited, shared);
        if at_ns < self.from_ns {
            return;
        }
        self.first_ns.get_or_insert(at_ns);
        self.rows += 1;
        self.covered_ns += step_ns;
        if lane::requests_differ(self.lanes[0].requested_pct(), self.lanes[1].requested_pct()) {
            self.differing_ns += step_ns;
        }
    }

    fn into_result(self) -> Raced {
        let [mut running, mut edited] = self.lanes;
        running.clip_to_stretch();
        edited.clip_to_stretch();
        let (covered_s, differing_s) = (to_seconds(self.covered_ns), to_seconds(self.differing_ns));
        let Self { rows, first_ns, last_ns, .. } = self;
        Raced { running, edited, rows, first_ns, last_ns, covered_s, differing_s }
    }
}
