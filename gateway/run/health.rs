//! What may fail while the box goes on: store, sources, clock, memory of the estimators. Each failure is told once, is
//! remembered as an event, and is shown while it lasts.

use super::history_store::HistoryStore;
use super::problems::{clock_problem, describe_clock_offset, problems_of_disk, problems_of_history};
use super::save::Saver;
use super::service_manager::{ProgressMarks, WatchedService};
use adapters::Sample;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::worker::WorkerState;
use gateway_base::clock::{BoxClock, ClockNews};
use gateway_base::log::{Notice, Severity};
use gateway_history::{Audit, ExtraValue, Record};
use gateway_pipeline::{Pipeline, Store, event_of};
use gateway_sources::sample_feed::{SampleFeed, SourcePace};
use gateway_status::alignment::{self, Alignment};
use gateway_status::{ClockStatus, HistoryStatus, SourceStatus, StatusProblem};
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// Everything is looked at about this often.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// What the estimators have learned is saved about this often.
const SAVE_EVERY: Duration = Duration::from_secs(60);
/// Another pace is told when it differs from the last one by this factor.
const OTHER_PACE: f64 = 1.3;
/// So many notices of other threads are taken at one look.
const HEARD_MAX: usize = 10;
/// One day of machine time.
const DAY_NS: i64 = 86_400 * SECOND_NS;

/// What the scripts remember, beside what the estimators have learned.
pub(super) const SCRIPTS_MEMORY: &str = "scripts.json";
/// What is known of the edges, beside the memory of the estimators.
pub(super) const WEAR_MEMORY: &str = "wear.json";

/// What does not work while the box goes on; each failure is told once and shown while it lasts.
pub struct Health {
    history_store: HistoryStore,
    clock: Option<Arc<BoxClock>>,
    /// Another reading of the wall clock has stood long enough: the run is to end and to begin again with it.
    follow: bool,
    port: watch::Receiver<Option<String>>,
    memory: PathBuf,
    sources: Vec<KnownSource>,
    /// The pace of each source that was last told, s.
    paces: Vec<Option<f64>>,
    looked: Option<Instant>,
    saved: Instant,
    saver: Saver,
    day: Option<i64>,
    stores: bool,
    /// The lags of the meters, stored beside the values of the pipeline.
    lags: [ExtraValue<'static>; alignment::SERIES],
    /// Values that are stored after these.
    beside: Option<[ExtraValue<'static>; 2]>,
    thermal: Vec<ExtraValue<'static>>,
    service: WatchedService,
    /// What is wrong with files in the data directory, as of the last look: the status asks for it several times a second.
    of_disk: Vec<StatusProblem>,
    /// What threads beside the tick have to say.
    notices: Option<mpsc::Receiver<Notice>>,
}

impl Health {
    /// `clock` is the box's own where machine time is real time, `port` the trouble with the page's port, `memory` the
    /// file for what the estimators have learned, `marks` what has moved.
    #[must_use]
    pub fn new(
        history_store: HistoryStore,
        clock: Option<Arc<BoxClock>>,
        port: watch::Receiver<Option<String>>,
        memory: PathBuf,
        marks: Arc<ProgressMarks>,
    ) -> Self {
        let data_dir = memory.parent().map(Path::to_owned).unwrap_or_default();
        let service = WatchedService::new(data_dir, marks);
        let stores = history_store.is_storing();
        Self {
            history_store,
            clock,
            follow: false,
            port,
            memory,
            sources: Vec::new(),
            paces: Vec::new(),
            looked: None,
            saved: Instant::now(),
            saver: Saver::start(),
            day: None,
            stores,
            lags: [ExtraValue::Missing("not_yet"); alignment::SERIES],
            beside: None,
            thermal: Vec::new(),
            service,
            of_disk: Vec::new(),
            notices: None,
        }
    }

    /// From now on these notices become events.
    pub fn follow_notices(&mut self, notices: mpsc::Receiver<Notice>) {
        self.notices = Some(notices);
    }

    /// Remembers and tells that something happened.
    pub fn record_event(&mut self, at_ns: TimeNs, source: &str, notice: &Notice) {
        notice.write_to_logs();
        self.history_store.store_record(event_of(at_ns, source, notice).into());
    }

    /// Remembers a record that is no event.
    pub fn keep_record(&mut self, record: Record) {
        self.history_store.store_record(record);
    }

    /// Hands in a row of the audit; false when it will not be stored.
    pub fn append_audit(&mut self, row: Audit) -> bool {
        self.history_store.append_audit(row)
    }

    /// Does the history take anything at the moment?
    #[must_use]
    pub fn is_storing(&self) -> bool {
        self.stores && self.history_store.is_storing()
    }

    /// From now on these lags are stored with every sample, after the values of the pipeline, and what has happened to
    /// them is remembered.
    pub fn update_lags(&mut self, at_ns: TimeNs, alignment: &mut Alignment) {
        self.lags = alignment.current_values();
        for notice in alignment.take_notices() {
            self.record_event(at_ns, "alignment", &notice);
        }
    }

    /// From now on these values are stored with every sample, after all others.
    pub fn set_twin_values(&mut self, values: [ExtraValue<'static>; 2]) {
        self.beside = Some(values);
    }

    /// From now on these values are stored with every sample, after those of the simulation.
    pub fn set_thermal_values(&mut self, values: &[ExtraValue<'static>]) {
        self.thermal.clear();
        self.thermal.extend_from_slice(values);
    }

    /// Looks after everything, about once per second.
    pub fn look_at_parts(&mut self, pipeline: &Pipeline, feed: &SampleFeed, now_ns: TimeNs) {
        if self.looked.is_some_and(|at| at.elapsed() < LOOK_EVERY) {
            return;
        }
        self.looked = Some(Instant::now());
        self.history_store.look_at_condition();
        self.of_disk = problems_of_disk(&self.memory);
        self.stores = self.history_store.is_storing();
        self.service.report_moved_parts(feed.count_steps(), self.history_store.count_rounds());
        let heard: Vec<Notice> = self.notices.iter().flat_map(mpsc::Receiver::try_iter).take(HEARD_MAX).collect();
        heard.iter().for_each(|notice| self.record_event(now_ns, "gateway", notice));
        self.look_at_clock(now_ns);
        self.look_at_sources(feed, now_ns);
        self.look_at_paces(&feed.list_paces(now_ns), now_ns);
        self.look_at_day(now_ns);
        if self.saved.elapsed() >= SAVE_EVERY {
            self.save_learned(pipeline);
        }
    }

    /// Housekeeping: once a day, and not before the clock is confirmed. A machine that brings its own time is right about it.
    fn look_at_day(&mut self, now_ns: TimeNs) {
        let confirmed = self.clock.as_ref().is_none_or(|clock| clock.is_confirmed());
        let day = now_ns.div_euclid(DAY_NS);
        if confirmed && self.day.replace(day).is_some_and(|before| before != day) {
            self.history_store.maintain_file(now_ns);
        }
    }

    fn look_at_clock(&mut self, now_ns: TimeNs) {
        let Some(news) = self.clock.as_ref().and_then(|clock| clock.compare_with_wall()) else { return };
        let told = |severity, code, text: String| Notice::new(severity, code, text);
        let notice = match news {
            ClockNews::Confirmed => {
                self.history_store.confirm_clock();
                // What is due by then is done; the next time at the turn of the day.
                self.history_store.maintain_file(now_ns);
                told(
                    Severity::Info,
                    "clock_confirmed",
                    "the clock has been right for long enough to be believed".to_owned(),
                )
            }
            ClockNews::Leapt { ahead_ns } => told(
                Severity::Warning,
                "clock_leapt",
                format!(
                    "the wall clock is {} the box now; the box keeps its own time",
                    describe_clock_offset(ahead_ns)
                ),
            ),
            ClockNews::Returned => {
                told(Severity::Info, "clock_right", "the wall clock agrees with the box again".to_owned())
            }
            ClockNews::Follow { ahead_ns } => {
                self.follow = true;
                let text = format!(
                    "the wall clock has been {} the box for long enough: the box begins again with it",
                    describe_clock_offset(ahead_ns)
                );
                told(Severity::Warning, "clock_followed", text)
            }
        };
        self.record_event(now_ns, "clock", &notice.with_detail(format!("{news:?}")));
    }

    /// Shall the run end, and begin again with the time of the wall clock?
    #[must_use]
    pub fn follows_clock(&self) -> bool {
        self.follow
    }

    /// What is thought of the clock.
    #[must_use]
    pub fn clock_status(&self) -> Option<ClockStatus> {
        self.clock.as_ref().map(|clock| clock.build_status())
    }

    fn look_at_sources(&mut self, feed: &SampleFeed, now_ns: TimeNs) {
        let status = feed.list_sources(now_ns);
        self.sources.resize_with(status.len(), KnownSource::default);
        for (index, source) in status.into_iter().enumerate() {
            for notice in self.sources[index].notice_changes(&source) {
                self.record_event(now_ns, &source.name, &notice);
            }
        }
    }

    /// A device that keeps another pace than was wanted, or than was last told.
    fn look_at_paces(&mut self, paces: &[Option<SourcePace>], now_ns: TimeNs) {
        self.paces.resize(paces.len(), None);
        for (index, pace) in paces.iter().enumerate() {
            let Some(pace) = pace else { continue };
            let (wanted_s, kept_s) = (pace.wanted.as_secs_f64(), pace.kept.as_secs_f64());
            let told_s = self.paces[index].unwrap_or(wanted_s);
            if (kept_s / told_s).ln().abs() < OTHER_PACE.ln() {
                continue;
            }
            self.paces[index] = Some(kept_s);
            self.record_event(now_ns, &pace.name, &told_pace(pace));
        }
    }

    /// Saves what the estimators have learned, what is known of the edges and what the scripts remember: new files in the place of the old ones.
    fn save_learned(&mut self, pipeline: &Pipeline) {
        self.saved = Instant::now();
        let scripts = self.memory.with_file_name(SCRIPTS_MEMORY);
        let wear = self.memory.with_file_name(WEAR_MEMORY);
        let all = [
            (&self.memory, pipeline.estimators().take_snapshot()),
            (&scripts, pipeline.scripts().take_snapshot()),
            (&wear, pipeline.wear().take_snapshot()),
        ];
        for (path, snapshot) in all {
            self.saver.put_learned(path, snapshot.to_string());
        }
    }

    /// Puts a file of the box's own on disk, beside the tick.
    pub fn put_file(&self, path: &Path, text: String) {
        self.saver.put_file(path, text);
    }

    /// The same for what was learned: with a checksum, and beside the save before it.
    pub fn put_learned(&self, path: &Path, state: String) {
        self.saver.put_learned(path, state);
    }

    /// The last tick is over.
    pub fn close(&mut self, pipeline: &Pipeline, at_ns: TimeNs) {
        self.save_learned(pipeline);
        self.saver.close();
        let stopped = Notice::new(Severity::Info, "stopped", "stopped");
        self.history_store.store_record(event_of(at_ns, "gateway", &stopped).into());
        self.history_store.close();
    }

    /// How the history is, for the status document.
    #[must_use]
    pub fn history_status(&self) -> HistoryStatus {
        self.history_store.build_status()
    }

    /// What does not work, of the store too.
    #[must_use]
    pub fn list_problems(&self, history: &HistoryStatus) -> Vec<StatusProblem> {
        let mut problems = Vec::new();
        let mut add = |what: String, next: &str| problems.push(StatusProblem { what, next: next.to_owned() });
        if let Some(what) = self.port.borrow().clone() {
            add(what, "stop the other program, or choose another port with --listen");
        }
        if let Some(what) = &history.error {
            add(what.clone(), "polling goes on");
        }
        if let Some((what, next)) = self.clock_status().and_then(clock_problem) {
            add(what, next);
        }
        problems.extend(self.of_disk.iter().cloned());
        problems.extend(problems_of_history(history));
        let mut add = |what: String, next: &str| problems.push(StatusProblem { what, next: next.to_owned() });
        for source in &self.sources {
            if let Some(error) = &source.error {
                add(error.clone(), "the other sources go on");
            }
            source.problems.iter().for_each(|problem| add(problem.what.clone(), &problem.next));
        }
        problems
    }
}

/// What was last told of a source.
#[derive(Debug, Default)]
struct KnownSource {
    /// Why it gives nothing.
    error: Option<String>,
    /// It gave nothing and has not answered since; it may have been switched off meanwhile.
    is_lost: bool,
    /// What is wrong although it answers.
    problems: Vec<StatusProblem>,
}

impl KnownSource {
    /// What is new, and what is over.
    fn notice_changes(&mut self, now: &SourceStatus) -> Vec<Notice> {
        let mut notices = Vec::new();
        let before = std::mem::replace(&mut self.error, now.error.clone());
        if let (None, Some(error)) = (&before, &now.error) {
            notices.push(Notice::new(Severity::Warning, "source_lost", error.clone()));
            self.is_lost = true;
        }
        if self.is_lost && now.state == WorkerState::Reading.as_word() {
            notices.push(Notice::new(Severity::Info, "source_back", format!("{} answers again", now.name)));
            self.is_lost = false;
        }
        let known = std::mem::replace(&mut self.problems, now.problems.clone());
        let told = |one: &StatusProblem| format!("{}: {}", now.name, one.what);
        let new = self.problems.iter().filter(|problem| !known.contains(problem));
        notices.extend(
            new.map(|one| Notice::new(Severity::Warning, "source_problem", told(one)).with_detail(one.next.as_str())),
        );
        let over = known.iter().filter(|problem| !self.problems.contains(problem));
        notices
            .extend(over.map(|one| Notice::new(Severity::Info, "source_problem_over", format!("over: {}", told(one)))));
        notices
    }
}

/// What the pace of a source means for who reads its values.
fn told_pace(SourcePace { name, wanted, kept }: &SourcePace) -> Notice {
    let (wanted_s, kept_s) = (wanted.as_secs_f64(), kept.as_secs_f64());
    if kept_s < wanted_s * OTHER_PACE {
        return Notice::new(
            Severity::Info,
            "source_pace",
            format!("{name} is read every {wanted_s:.2} s again, as wanted"),
        );
    }
    let text = format!(
        "{name} is read every {kept_s:.2} s instead of every {wanted_s:.2} s, because of the time that the device takes to answer; its \
         values count as fresh for {:.2} s",
        2.0 * kept_s
    );
    let detail =
        "a fanuc:// address may take more of the control's time with duty_pct=, or be read less often with period_ms=";
    Notice::new(Severity::Warning, "source_pace", text).with_detail(detail)
}

impl Store for Health {
    fn store_sample(&mut self, sample: &Sample, extras: &[ExtraValue<'_>]) {
        let beside: &[ExtraValue<'_>] = self.beside.as_ref().map_or(&[], |beside| beside);
        self.history_store.store_sample(sample, &[extras, &self.lags, beside, &self.thermal].concat());
    }

    fn store_record(&mut self, record: Record) {
        self.history_store.store_record(record);
    }

    fn store_notice(&mut self, at_ns: TimeNs, source: &str, notice: &Notice) {
        self.record_event(at_ns, source, notice);
    }
}
