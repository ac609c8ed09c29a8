//! How many ticks per second go through merge, estimators, scripts, gate and history, and what each stage costs.
//!
//! The readings of a simulated lathe at work are made beforehand, so that only the box is measured. Each figure is a
//! run of its own through one more stage; the cost of a stage is the difference to the run before.

use crate::config;
use crate::gate::Gate;
use crate::history::{Options, WhenFull, Writer};
use crate::pipeline::{NoStore, Pipeline, Store};
use crate::usage;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::merge::{Delay, Merge, SourceId, SourcePlan};
use adapters::open::open_pull;
use adapters::{Address, ChannelId, Pull, Reading, Sample};
use rules::estimators;
use rules::script::{Host, ScriptFile, list_shipped_scripts};
use serde_json::{Value, json};
use std::fmt;
use std::path::Path;
use std::time::Instant;

/// The machine is measured from here on: powered up and at work.
const WARM_UP_NS: i64 = 240 * SECOND_NS;
/// Length of the stretch that is gone through again and again.
const STRETCH_NS: i64 = 600 * SECOND_NS;
/// Between two ticks of machine time: 10 Hz.
const TICK_NS: i64 = SECOND_NS / 10;
/// How many channels are merged, inferred from, decided on and stored.
pub const CHANNELS: usize = 20;

/// An answer of a source.
struct Poll {
    source: SourceId,
    arrived_ns: TimeNs,
    readings: Vec<Reading>,
}

/// The readings of every source, made before the clock of the benchmark starts.
pub struct Course {
    plans: Vec<SourcePlan>,
    polls: Vec<Poll>,
}

/// Why the benchmark could not run.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The simulated machine or the scripts are broken.
    #[error("the benchmark cannot be set up: {0}")]
    SetUp(String),
    /// The history cannot be written.
    #[error(transparent)]
    History(#[from] crate::history::HistoryError),
}

impl Course {
    /// Ten minutes of a simulated lathe at work.
    ///
    /// # Errors
    /// [`BenchError::SetUp`].
    pub fn from_simulated_lathe() -> Result<Self, BenchError> {
        let bad = |error: &dyn fmt::Display| BenchError::SetUp(error.to_string());
        let address: Address = "simulated://lathe?seed=1".parse().map_err(|error| bad(&error))?;
        let mut sources = open_pull(&address, 0).map_err(|error| bad(&error))?.sources;
        let announced = sources.iter().flat_map(|source| source.channels().to_vec());
        let chosen = choose_channels(announced.collect());
        let kept = |plan: SourcePlan| {
            let channels = plan.channels.iter().copied().filter(|channel| chosen.contains(channel)).collect();
            SourcePlan { channels, ..plan }
        };
        let plans = sources.iter().map(|source| kept(SourcePlan::of_pull(source.as_ref()))).collect();
        let mut polls: Vec<Poll> = Vec::new();
        for (index, source) in sources.iter_mut().enumerate() {
            polls.extend(polls_of(SourceId(index), source.as_mut(), &chosen));
        }
        polls.sort_by_key(|poll| poll.arrived_ns);
        Ok(Self { plans, polls })
    }

    /// Ticks `count` times, handing each sample to `each`.
    fn play_ticks(&self, count: u64, mut each: impl FnMut(&Sample)) {
        let mut merge = Merge::new(&self.plans, Delay::SlowestPeriod);
        let mut sample = Sample::new_empty(0);
        let (mut next, mut shift_ns, mut now_ns) = (0, 0, WARM_UP_NS);
        for _ in 0..count {
            now_ns += TICK_NS;
            while let Some(poll) = self.polls.get(next).filter(|poll| poll.arrived_ns + shift_ns <= now_ns) {
                push(&mut merge, poll, shift_ns);
                next += 1;
                if next == self.polls.len() {
                    (next, shift_ns) = (0, shift_ns + STRETCH_NS);
                }
            }
            merge.sample_into(&mut sample, now_ns - merge.delay_ns());
            each(&sample);
        }
    }
}

/// The channels that the box itself looks at, then others until there are enough.
fn choose_channels(announced: Vec<ChannelId>) -> Vec<ChannelId> {
    let first = ["spindle_speed_rpm", "feed_mm_min", "spindle_power_w", "total_power_w", "spindle_load_pct", "rapid"];
    let mut chosen: Vec<ChannelId> = first.into_iter().filter_map(ChannelId::from_name).collect();
    for channel in announced {
        if chosen.len() < CHANNELS && !chosen.contains(&channel) {
            chosen.push(channel);
        }
    }
    chosen
}

fn polls_of(source: SourceId, pull: &mut dyn Pull, chosen: &[ChannelId]) -> Vec<Poll> {
    let mut polls = Vec::new();
    while let Some(arrived_ns) = pull.next_ns().filter(|at_ns| *at_ns < WARM_UP_NS + STRETCH_NS) {
        let mut readings = Vec::new();
        let read = pull.pull_readings(&mut readings).is_ok();
        readings.retain(|reading| chosen.contains(&reading.channel));
        if read && arrived_ns >= WARM_UP_NS {
            polls.push(Poll { source, arrived_ns, readings });
        }
    }
    polls
}

fn push(merge: &mut Merge, poll: &Poll, shift_ns: i64) {
    for reading in &poll.readings {
        let mut reading = reading.clone();
        reading.stamp.mid_ns += shift_ns;
        merge.push(poll.source, reading);
    }
}

/// What one run over the same readings costs, with the stages up to `through`.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// The last stage that took part.
    pub through: &'static str,
    /// Time per tick on the wall, us.
    pub us_per_tick: f64,
    /// Processor time per tick of the thread that ticks, us: what other programs take does not count. The wall where
    /// the system does not tell.
    pub cpu_us_per_tick: f64,
    /// Allocations per tick, where they were counted.
    pub allocations_per_tick: Option<f64>,
}

/// The costs of every run, stage by stage.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchFigures {
    /// Number of ticks that each run lasts.
    pub ticks: u64,
    /// In the order of the stages; the last one is the whole box.
    pub runs: Vec<Figure>,
    /// Each shipped script by itself: its file, and the processor time that it adds to a tick, us.
    pub scripts: Vec<(String, f64)>,
    /// Bytes per tick in the history.
    pub bytes_per_tick: f64,
}

/// Counts allocations of this process, if somebody does.
pub type Allocations = Option<fn() -> u64>;

struct BenchRun<'a> {
    course: &'a Course,
    ticks: u64,
    allocations: Allocations,
    runs: Vec<Figure>,
}

impl BenchRun<'_> {
    #[expect(clippy::cast_precision_loss, reason = "rates")]
    fn measure_stage(&mut self, through: &'static str, mut each: impl FnMut(&Sample)) {
        // A tenth beforehand: rings and tables have their size, scripts have run.
        self.course.play_ticks(self.ticks / 10, &mut each);
        let count = |allocations: Allocations| allocations.map(|count| count());
        let before = count(self.allocations);
        let (began, cpu) = (Instant::now(), usage::thread_cpu());
        self.course.play_ticks(self.ticks, &mut each);
        let took = began.elapsed();
        let cpu = usage::thread_cpu().zip(cpu).map_or(took, |(after, before)| after - before);
        let after = count(self.allocations);
        let allocated = before.zip(after).map(|(before, after)| (after - before) as f64 / self.ticks as f64);
        let us_per_tick = took.as_secs_f64() * 1e6 / self.ticks as f64;
        let cpu_us_per_tick = cpu.as_secs_f64() * 1e6 / self.ticks as f64;
        self.runs.push(Figure { through, us_per_tick, cpu_us_per_tick, allocations_per_tick: allocated });
    }
}

struct BenchHistory(Writer);

impl Store for BenchHistory {
    fn store_sample(&mut self, sample: &Sample, extras: &[crate::history::ExtraValue<'_>]) {
        self.0.queue_sample(sample, extras);
    }

    fn store_record(&mut self, record: crate::history::Record) {
        self.0.queue_record(record);
    }
}

/// Measures `ticks` ticks per run; the history goes into `directory`.
///
/// # Errors
/// See [`BenchError`].
pub fn measure_ticks(ticks: u64, directory: &Path, allocations: Allocations) -> Result<BenchFigures, BenchError> {
    let course = Course::from_simulated_lathe()?;
    let mut bench = BenchRun { course: &course, ticks, allocations, runs: Vec::new() };
    bench.measure_stage("merge", |sample| {
        std::hint::black_box(sample);
    });
    let mut inferring = estimators::Inference::new(estimators::Settings::default());
    bench.measure_stage("estimators", |sample| {
        std::hint::black_box(inferring.update_with_sample(sample));
    });
    let (mut inferring, mut host) = (estimators::Inference::new(estimators::Settings::default()), build_host()?);
    bench.measure_stage("scripts", |sample| {
        let estimates = *inferring.update_with_sample(sample);
        std::hint::black_box(host.run_due_scripts(sample, &estimates));
    });
    let scripts = measure_scripts(&course, ticks)?;
    let mut whole = build_pipeline()?;
    bench.measure_stage("gate and records", |sample| whole.run_tick(sample, &mut NoStore));
    let options = Options { when_full: WhenFull::Wait, extras: build_pipeline()?.extra_series(), ..Options::default() };
    let path = directory.join("bench.db");
    let (mut whole, mut store) = (build_pipeline()?, BenchHistory(Writer::open(&path, options)?));
    bench.measure_stage("history", |sample| whole.run_tick(sample, &mut store));
    store.0.flush()?;
    let status = store.0.close();
    #[expect(clippy::cast_precision_loss, reason = "a rate")]
    let bytes_per_tick = status.bytes as f64 / status.rows.max(1) as f64;
    Ok(BenchFigures { ticks, runs: bench.runs, scripts, bytes_per_tick })
}

/// Every shipped script by itself, against a host without scripts. A tenth of the ticks of the other runs is enough.
fn measure_scripts(course: &Course, ticks: u64) -> Result<Vec<(String, f64)>, BenchError> {
    let ticks = (ticks / 10).max(TICKS_MIN);
    let cost = |files: &[ScriptFile]| -> Result<f64, BenchError> {
        let mut bench = BenchRun { course, ticks, allocations: None, runs: Vec::new() };
        let (mut inferring, mut host) = (estimators::Inference::new(estimators::Settings::default()), host_of(files)?);
        bench.measure_stage("script", |sample| {
            let estimates = *inferring.update_with_sample(sample);
            std::hint::black_box(host.run_due_scripts(sample, &estimates));
        });
        Ok(bench.runs.first().map_or(0.0, |run| run.cpu_us_per_tick))
    };
    let without = cost(&[])?;
    let files = list_shipped_scripts().into_iter();
    files.map(|file| Ok((file.name.clone(), (cost(std::slice::from_ref(&file))? - without).max(0.0)))).collect()
}

fn build_host() -> Result<Host, BenchError> {
    host_of(&list_shipped_scripts())
}

fn host_of(files: &[ScriptFile]) -> Result<Host, BenchError> {
    let mut host = Host::new();
    host.load_scripts(files).map_err(|problems| BenchError::SetUp(format!("{problems:?}")))?;
    Ok(host)
}

fn build_pipeline() -> Result<Pipeline, BenchError> {
    let config = config::load(None, []).map_err(|problems| BenchError::SetUp(format!("{problems:?}")))?;
    let fresh = estimators::Inference::new(estimators::Settings::default());
    Ok(Pipeline::new(fresh, build_host()?, Gate::new(config.gate)))
}

impl BenchFigures {
    /// Ticks per second through everything.
    #[must_use]
    pub fn ticks_per_s(&self) -> f64 {
        self.runs.last().map_or(0.0, |whole| 1e6 / whole.us_per_tick)
    }

    /// Ticks per second of processor time, as on a computer with nothing else to do.
    #[must_use]
    pub fn undisturbed_ticks_per_s(&self) -> f64 {
        self.runs.last().map_or(0.0, |whole| 1e6 / whole.cpu_us_per_tick)
    }

    /// Each stage with the processor time it adds to a tick, us.
    fn compute_stage_costs(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let before = std::iter::once(0.0).chain(self.runs.iter().map(|run| run.cpu_us_per_tick));
        self.runs.iter().zip(before).map(|(run, before)| (run.through, run.cpu_us_per_tick - before))
    }

    /// The figures as JSON (`bench/1`).
    #[must_use]
    pub fn to_json(&self) -> Value {
        let whole = self.runs.last();
        let stages = self.compute_stage_costs().map(|(stage, us)| {
            json!({ "stage": stage, "cpu_us_per_tick": us, "share": us / whole.map_or(1.0, |whole| whole.cpu_us_per_tick) })
        });
        let scripts = self.scripts.iter().map(|(file, us)| json!({ "script": file, "cpu_us_per_tick": us }));
        json!({
            "schema": "bench/1",
            "ticks": self.ticks,
            "channels": CHANNELS,
            "ticks_per_s": self.ticks_per_s().round(),
            "undisturbed_ticks_per_s": self.undisturbed_ticks_per_s().round(),
            "stages": stages.collect::<Vec<_>>(),
            "scripts": scripts.collect::<Vec<_>>(),
            "allocations_per_tick": whole.and_then(|whole| whole.allocations_per_tick),
            "history_bytes_per_tick": self.bytes_per_tick,
        })
    }
}

impl fmt::Display for BenchFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (wall, undisturbed) = (self.ticks_per_s(), self.undisturbed_ticks_per_s());
        writeln!(
            f,
            "{wall:.0} ticks/s with {CHANNELS} channels, {undisturbed:.0} undisturbed ({} ticks per run)",
            self.ticks
        )?;
        let whole = self.runs.last().map_or(1.0, |whole| whole.cpu_us_per_tick);
        for ((stage, us), run) in self.compute_stage_costs().zip(&self.runs) {
            write!(f, "  {stage:<18} {us:>7.2} us {:>5.1} %", 100.0 * us / whole)?;
            match run.allocations_per_tick {
                Some(count) => writeln!(f, "   {count:.3} allocations per tick up to here")?,
                None => writeln!(f)?,
            }
        }
        for (file, us) in &self.scripts {
            writeln!(f, "    {file:<22} {us:>7.2} us, by itself")?;
        }
        writeln!(f, "  {:.1} bytes per tick in the history", self.bytes_per_tick)
    }
}

/// The shortest run that tells anything.
pub const TICKS_MIN: u64 = 1000;
