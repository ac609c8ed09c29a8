//! `replay`: recordings through the same pipeline as a live machine, row by row, as fast as possible.
//!
//! A replay that was broken off goes on where it was: the pipeline runs over the stored rows again, because what it has
//! learned from them cannot be skipped, and stores only what is not in the history yet.

mod motion;
mod resume;
mod summary;

pub use motion::Motion;
pub use summary::{FileSummary, ReplaySummary, StoredRows};

use crate::cannot_run::CannotRun;
use crate::config;
use crate::gate::Gate;
use crate::history::{ExtraSeries, ExtraValue, Options, Reader, Record, WhenFull, Writer};
use crate::pipeline::{Pipeline, Store};
use adapters::clock::TimeNs;
use adapters::merge::{Delay, Lockstep};
use adapters::recording::{ReadRecording, read_path};
use adapters::replay::{Replay, UNKNOWN_PAUSE_S};
use adapters::{Pull, Sample};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use resume::{Before, origin_of};
use rules::estimators::wear::WearRecord;
use rules::estimators::{self, VisibilityTally};
use rules::operations::{Completion, Recipe};
use rules::script::Host;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use summary::ReplayCounts;

/// The progress is shown anew after so many rows.
const PROGRESS_ROWS: u64 = 2048;

/// What to replay, and where to.
#[derive(Debug)]
pub struct ReplayPlan {
    /// Paths of the recordings in the order in which they are run.
    pub files: Vec<PathBuf>,
    /// What the recordings do not say of the cut; fills in channels that they lack.
    pub operations: Option<Recipe>,
    /// The history whose library of wear models is used where the recordings go into none.
    pub models: Option<PathBuf>,
    /// The history they go into; without one nothing is stored.
    pub history: Option<PathBuf>,
    /// Show a progress bar on a terminal.
    pub progress: bool,
    /// Tell on standard error where storing begins.
    pub talk: bool,
}

/// Stores what is not stored yet, and counts everything.
struct ReplaySink {
    writer: Option<Writer>,
    before: Before,
    counts: ReplayCounts,
}

impl Store for ReplaySink {
    fn store_sample(&mut self, sample: &Sample, extras: &[ExtraValue<'_>]) {
        self.counts.rows += 1;
        if !self.before.has_row(self.counts.rows)
            && let Some(writer) = &self.writer
        {
            writer.queue_sample(sample, extras);
            self.counts.stored += 1;
        }
    }

    fn store_record(&mut self, record: Record) {
        self.counts.count_record(&record);
        if !self.before.has_record(self.counts.rows, &record)
            && let Some(writer) = &self.writer
        {
            writer.queue_record(record);
        }
    }
}

/// Replays every file through one pipeline; the gate decides within these limits and writes nothing.
///
/// # Errors
/// A file that cannot be read, or a history that cannot be written.
pub fn replay_files(plan: &ReplayPlan, scripts: Host, gate: config::GateConfig) -> Result<ReplaySummary, CannotRun> {
    let began = Instant::now();
    let fresh = estimators::Inference::new(estimators::Settings::default());
    let mut pipeline = Pipeline::new(fresh, scripts, Gate::new(gate));
    load_wear_models(plan, &mut pipeline)?;
    let mut files = Vec::new();
    let mut counts = ReplayCounts::default();
    let mut visibility = VisibilityTally::default();
    let mut motion = Motion::default();
    let mut next_ns = 0;
    for file in &plan.files {
        let read = read_path(file).map_err(|error| CannotRun::new(error.to_string(), ""))?;
        files.push(FileSummary::from_recording(file, &read));
        let mut one = OneFile {
            plan,
            pipeline: &mut pipeline,
            visibility: &mut visibility,
            motion: &mut motion,
            completion: Completion::new(),
        };
        let (of_file, last_ns) = one.run(file, &read, next_ns)?;
        counts.add(&of_file);
        next_ns = last_ns + (UNKNOWN_PAUSE_S * 1e9) as i64;
    }
    let kept = plan.history.as_ref().map(|path| StoredRows::from_counts(path, &counts));
    Ok(ReplaySummary {
        files,
        counts,
        stored_rows: kept,
        seconds_per_state: pipeline.tally().seconds_per_state(),
        parts: pipeline.parts().finished_count(),
        visibility: visibility.judge_visibility(),
        motion,
        took: began.elapsed(),
    })
}

/// Gives the pipeline the wear models of the history. A recording does not name its machine: a library of several machines is
/// used for what names none.
fn load_wear_models(plan: &ReplayPlan, pipeline: &mut Pipeline) -> Result<(), CannotRun> {
    let Some(path) = plan.models.as_ref().or(plan.history.as_ref()).filter(|path| path.exists()) else { return Ok(()) };
    let cannot = |error: crate::history::HistoryError| CannotRun::new(error.to_string(), "");
    let stored = Reader::open(path).and_then(|reader| reader.wear_models::<WearRecord>()).map_err(cannot)?;
    let records: Vec<_> =
        stored.into_iter().filter(|model| model.in_force).map(|model| Arc::new(model.record)).collect();
    let mut machines: Vec<&str> =
        records.iter().map(|record| &*record.key.machine).filter(|it| !it.is_empty()).collect();
    machines.sort_unstable();
    machines.dedup();
    let machine = if let [only] = machines[..] { only.to_owned() } else { String::new() };
    pipeline.wear_mut().set_models(&machine, records);
    Ok(())
}

/// One recording on its way through the pipeline.
struct OneFile<'a> {
    plan: &'a ReplayPlan,
    pipeline: &'a mut Pipeline,
    visibility: &'a mut VisibilityTally,
    motion: &'a mut Motion,
    completion: Completion,
}

impl OneFile<'_> {
    /// Replays the file, which begins at `next_ns` when it has no dates; what happened, and the time of the last row.
    fn run(&mut self, file: &Path, read: &ReadRecording, next_ns: TimeNs) -> Result<(ReplayCounts, TimeNs), CannotRun> {
        let origin = origin_of(file).map_err(|error| CannotRun::new(format!("{}: {error}", file.display()), ""))?;
        let before = self.read_before(&origin)?;
        let writer = self
            .plan
            .history
            .as_ref()
            .map(|path| open_writer(path, &origin, before.rows() > 0, self.pipeline.extra_series()))
            .transpose()?;
        let source = Replay::new(origin, &read.recording, before.origin_ns.unwrap_or(next_ns.max(before.free_ns)));
        let rows = source.count_rows() as u64;
        if let (Some(path), true) = (&self.plan.history, self.plan.talk) {
            // Not on standard output, which belongs to the summary.
            eprintln!("{}: storing in {} from row {} on", file.display(), path.display(), before.rows() + 1);
        }
        let bar = self.build_progress_bar(rows, file);
        let mut sink = ReplaySink { writer, before, counts: ReplayCounts::default() };
        let last_ns = self.feed_pipeline(source, &mut sink, &bar);
        bar.finish_and_clear();
        close_writer(sink.writer.take(), sink.counts.stored)?;
        Ok((sink.counts, last_ns))
    }

    /// What the history already holds of this recording.
    fn read_before(&self, origin: &str) -> Result<Before, CannotRun> {
        let found = self.plan.history.as_deref().filter(|path| path.exists()).map(|path| Before::read(path, origin));
        found.transpose().map(Option::unwrap_or_default).map_err(|error| CannotRun::new(error.to_string(), ""))
    }

    fn feed_pipeline(&mut self, source: Replay, sink: &mut ReplaySink, bar: &ProgressBar) -> TimeNs {
        let mut sources = Lockstep::new(vec![Box::new(source) as Box<dyn Pull>], Delay::Fixed(Duration::ZERO));
        let mut sample = Sample::new_empty(0);
        while let Some(now_ns) = sources.next_ns() {
            sources.sample_into(&mut sample, now_ns);
            if let Some(recipe) = &self.plan.operations {
                let _marked_in_the_sample = self.completion.apply_recipe(recipe, &mut sample);
            }
            self.pipeline.run_tick(&sample, sink);
            if let Some(record) = sink.before.continue_state(sink.counts.rows, &sample, self.pipeline.estimates()) {
                sink.store_record(record);
            }
            self.visibility.add(self.pipeline.estimates());
            self.motion.add(&sample, self.pipeline.estimates());
            if sink.counts.rows.is_multiple_of(PROGRESS_ROWS) {
                bar.set_position(sink.counts.rows);
            }
        }
        sample.at_ns
    }

    fn build_progress_bar(&self, rows: u64, file: &Path) -> ProgressBar {
        let target = if self.plan.progress { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(rows), target);
        let form = "{msg} {wide_bar} {human_pos}/{human_len} rows, {per_sec}, {eta} left";
        bar.set_style(ProgressStyle::with_template(form).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(file.file_name().unwrap_or_default().to_string_lossy().into_owned());
        bar
    }
}

fn open_writer(path: &Path, origin: &str, goes_on: bool, extras: Vec<ExtraSeries>) -> Result<Writer, CannotRun> {
    let origin = origin.to_owned();
    let options = Options { when_full: WhenFull::Wait, extras, origin, goes_on, ..Options::default() };
    Writer::open(path, options).map_err(|error| CannotRun::new(error.to_string(), ""))
}

/// The end of a file of which so many rows were handed in; an error where the history does not have them all.
fn close_writer(writer: Option<Writer>, handed_in: u64) -> Result<(), CannotRun> {
    let Some(writer) = writer else { return Ok(()) };
    let flushed = writer.flush();
    let status = writer.close();
    let missing = (status.rows < handed_in).then(|| format!("{} of {handed_in} rows are in the history", status.rows));
    match status.degraded.or_else(|| flushed.err().map(|error| error.to_string())).or(missing) {
        None => Ok(()),
        Some(reason) => Err(CannotRun::new(
            format!("not everything could be stored: {reason}"),
            "make room and run the same command again: it goes on where it stopped",
        )),
    }
}
