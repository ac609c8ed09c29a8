//! The tick thread: waits for the tick, samples, steps the pipeline, hands the status over.

use super::command::Commands;
use super::end::RunFlags;
use super::energy::EnergyCounter;
use super::health::Health;
use super::live_twin::Twin;
use super::priority::{self, Granted};
use super::report;
use super::rules::ScriptWatch;
use super::supervisor::Supervisor;
use super::thermal::Thermal;
use super::wear::{self, Wear};
use crate::operations::{Operations, SOURCE};
use adapters::Sample;
use adapters::clock::TimeNs;
use adapters::simulated::Simulated;
use adapters::threads::reach_fault_point;
use gateway_base::log::{Notice, Severity};
use gateway_base::machine_path::NamedMachine;
use gateway_config::GateMode;
use gateway_control::Wake;
use gateway_gate::{Disarmed, ScriptRequest};
use gateway_pipeline::Pipeline;
use gateway_sinks::Board;
use gateway_sources::origin_log::OriginLog;
use gateway_sources::pace::TickSchedule;
use gateway_sources::sample_feed::SampleFeed;
use gateway_status::Published;
use gateway_status::{AlarmStatus, HistoryStatus, Status, StatusProblem, TickStatus};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// The status is published at most this often.
const PUBLISH_EVERY: Duration = Duration::from_millis(190);

/// Orders are carried out between two ticks so many times; what comes then waits for the tick.
const ORDERS_BETWEEN_MAX: u32 = 32;

/// How a run has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunEnd {
    /// It was told to stop, or there is nothing more to do.
    Over,
    /// It is to begin again, with the time that the wall clock says.
    FollowClock,
}

/// What does not change while the box runs.
#[derive(Debug, Clone)]
pub struct Identity {
    /// Name of the machine, and its path in the plant.
    pub machine: NamedMachine,
    /// Whether every source is simulated.
    pub simulated: bool,
    /// Machine time over real time; `None` as fast as possible.
    pub speed: Option<f64>,
    /// Ticks per second of machine time.
    pub rate_hz: f64,
}

/// Everything the tick thread owns.
pub struct Ticker {
    /// Name of the machine, and at which pace its time runs.
    pub identity: Identity,
    /// Gives the times of the ticks.
    pub schedule: TickSchedule,
    /// Gives the samples of the ticks.
    pub feed: SampleFeed,
    /// Which source each channel was last told to come from.
    pub origins: OriginLog,
    /// Infers, decides and records with each sample.
    pub pipeline: Pipeline,
    /// Orders, audit, and the worker that writes.
    pub commands: Commands,
    /// Energy since the start.
    pub energy: EnergyCounter,
    /// The simulated machines, which count what is written to them.
    pub machines: Vec<Simulated>,
    /// How each stretch of a program cuts, where a recipe is configured.
    pub operations: Option<Operations>,
    /// The model beside the machine, where one is configured.
    pub twin: Option<Twin>,
    /// The library of wear models.
    pub wear: Wear,
    /// The thermal law, where one is configured.
    pub thermal: Option<Thermal>,
    /// How the sinks are.
    pub sinks: Board,
    /// Keeps the scripts as they are on disk.
    pub scripts: ScriptWatch,
    /// Store, sources, clock: what may fail while the box goes on.
    pub health: Health,
    /// What the rest of the process wants.
    pub run_flags: Arc<RunFlags>,
    /// How somebody who orders wakes this thread.
    pub wake: Wake,
    /// Where the status goes.
    pub publish: watch::Sender<Option<Published>>,
    /// End after so much machine time.
    pub stop_after_ns: Option<i64>,
    /// Looks after the threads.
    pub supervisor: Supervisor,
    /// What could not be begun and will not be, until the box is started again.
    pub standing_problems: Vec<StatusProblem>,
}

impl Ticker {
    /// Runs until it is told to stop, the time is over, every source has come to its end, or another clock is to be followed.
    pub fn run(mut self) -> RunEnd {
        let started = Instant::now();
        let mut published = None;
        let mut sample = Sample::new_empty(0);
        let mut first_ns = None;
        if self.identity.speed == Some(1.0) {
            let granted = priority::request_priority();
            granted.tell_operator();
            if granted == Granted::RealTime && self.pipeline.gate().limits().greatest_mode() == GateMode::Armed {
                self.schedule.wake_early();
            }
        }
        self.wake.bind_current_thread();
        let mut last_ns = None;
        while let Some(now_ns) = self.next_tick(&sample, last_ns) {
            last_ns = Some(now_ns);
            reach_fault_point("tick");
            let began_ns = *first_ns.get_or_insert(now_ns);
            let alive = self.feed.sample_into(&mut sample, now_ns);
            self.energy.count_tick(&sample);
            self.tell_origins(sample.at_ns);
            self.fill_from_recipe(&mut sample, now_ns);
            self.scripts.apply_changes(&mut self.pipeline, &mut self.health, &self.run_flags, (now_ns, sample.at_ns));
            if self.disarm_for_broken_threads(&sample) {
                published = None;
            }
            self.commands.run_orders(self.pipeline.gate_mut(), &sample, &mut self.health);
            self.wear.supply_models(&mut self.pipeline, sample.at_ns, &mut self.health);
            let inferred = *self.pipeline.infer_estimates(&sample);
            self.feed.alignment_mut().record_state(sample.at_ns, inferred.state);
            self.health.update_lags(sample.at_ns, self.feed.alignment_mut());
            if let Some(thermal) = &mut self.thermal {
                self.pipeline.propose_offset(thermal.propose_offset(&sample, &mut self.health));
            }
            self.pipeline.request_override(self.commands.network_override(sample.at_ns));
            self.pipeline.decide_commands(&sample);
            let asks: Vec<ScriptRequest> =
                self.pipeline.scripts().decision().stops.iter().map(ScriptRequest::from_stop).collect();
            self.commands.apply_verdict(&mut self.pipeline, &asks, &sample, now_ns, &mut self.health);
            // What can wait comes after what is written to the machine.
            self.pipeline.record_tick(&sample, &mut self.health);
            self.scripts.print_failures(&self.pipeline.scripts().decision().problems);
            if let Some(twin) = &mut self.twin {
                twin.compare_tick(&sample, &self.pipeline, &mut self.health);
            }
            self.health.look_at_parts(&self.pipeline, &self.feed, now_ns);
            let over = !alive
                || self.health.follows_clock()
                || self.stop_after_ns.is_some_and(|limit_ns| now_ns - began_ns >= limit_ns);
            if over || published.is_none_or(|at: Instant| at.elapsed() >= PUBLISH_EVERY) {
                published = Some(Instant::now());
                self.publish_status(&sample, now_ns, started);
            }
            if over {
                break;
            }
        }
        if self.health.follows_clock() {
            self.commands.end_arming(Disarmed::Clock, &sample, self.pipeline.gate_mut(), &mut self.health);
        }
        self.commands.close(&sample, self.pipeline.gate_mut(), &mut self.health);
        self.tell_writes(sample.at_ns);
        self.feed.stop();
        if let Some(twin) = &mut self.twin {
            twin.save_learned(&self.health);
        }
        self.health.close(&self.pipeline, sample.at_ns);
        self.run_flags.stop.store(true, Ordering::SeqCst);
        if self.health.follows_clock() { RunEnd::FollowClock } else { RunEnd::Over }
    }

    /// A thread that broke off ends the arming, before anything is decided or ordered. Gives whether there was one.
    fn disarm_for_broken_threads(&mut self, sample: &Sample) -> bool {
        let Some(found) = self.supervisor.look_at_threads() else { return false };
        let Self { commands, pipeline, health, .. } = self;
        found.notices.iter().for_each(|notice| health.record_event(sample.at_ns, "gateway", notice));
        if let Some(thread) = &found.gone {
            pipeline.gate_mut().forbid_arming(thread);
        }
        commands.end_arming(Disarmed::Thread, sample, pipeline.gate_mut(), health);
        true
    }

    /// Waits for the next tick. Orders that come meanwhile are carried out at once: whoever disarms does not wait for it.
    fn next_tick(&mut self, sample: &Sample, last_ns: Option<TimeNs>) -> Option<TimeNs> {
        let Self { schedule, wake, run_flags, commands, pipeline, health, .. } = self;
        let mut left = ORDERS_BETWEEN_MAX;
        schedule.next_tick_or(&run_flags.stop, wake, || {
            // Before the first tick there is nothing to order about.
            let Some(last_ns) = last_ns.filter(|_| left > 0) else { return };
            left -= 1;
            commands.run_orders(pipeline.gate_mut(), sample, health);
            commands.let_go(pipeline, sample, last_ns, health);
        })
    }

    /// A channel that comes from another source than before is told.
    fn tell_origins(&mut self, at_ns: TimeNs) {
        for notice in self.feed.tell_origins(&mut self.origins, at_ns) {
            self.health.record_event(at_ns, "sources", &notice);
        }
    }

    /// What the simulated controllers have counted, for whoever does not believe the gateway's own figures.
    fn tell_writes(&mut self, at_ns: TimeNs) {
        for machine in &self.machines {
            let counts = machine.written();
            let text = format!("the simulated controller has counted {} writes", counts.count_writes());
            let notice = Notice::new(Severity::Info, "machine_writes", text).with_detail(format!("{counts:?}"));
            self.health.record_event(at_ns, "controller", &notice);
        }
    }

    /// The recipe fills in what the sources do not deliver.
    fn fill_from_recipe(&mut self, sample: &mut Sample, now_ns: TimeNs) {
        let Some(operations) = &mut self.operations else { return };
        let reload = self.run_flags.reload.load(Ordering::SeqCst);
        operations.update_sample(sample, reload, |notice| self.health.record_event(now_ns, SOURCE, notice));
    }

    fn publish_status(&mut self, sample: &Sample, now_ns: TimeNs, started: Instant) {
        let status = Arc::new(self.build_status(sample, now_ns, started));
        self.publish.send_replace(Some(Published { status, at: Instant::now() }));
    }

    fn build_status(&mut self, sample: &Sample, now_ns: TimeNs, started: Instant) -> Status {
        let alarms = self.list_alarms();
        let acknowledged = self.commands.update_acknowledged(&alarms);
        let Identity { machine, simulated, speed, rate_hz } = self.identity.clone();
        let (late_p50_ms, late_p99_ms) = self.schedule.late_ms();
        let count = self.pipeline.tally().ticks();
        let history = self.health.history_status();
        Status {
            schema: "status/1",
            version: env!("CARGO_PKG_VERSION"),
            machine: machine.name,
            path: machine.path,
            simulated,
            speed,
            at_ms: report::to_milliseconds(sample.at_ns),
            uptime_s: started.elapsed().as_secs_f64(),
            clock: self.health.clock_status(),
            tick: TickStatus {
                rate_hz,
                count,
                late_p50_ms,
                late_p99_ms,
                late: self.schedule.lateness_histogram(),
                skipped: self.schedule.skipped_ticks(),
            },
            state: report::build_state_status(&self.pipeline),
            channels: report::list_channels(sample, &self.feed),
            estimates: report::list_estimates(self.pipeline.estimates()),
            alarms,
            acknowledged,
            twin: self.twin.as_ref().map(Twin::build_status),
            parts: self.pipeline.parts().finished_count(),
            energies: self.energy.list_energies(),
            gate: report::build_gate_status(&self.pipeline, self.commands.written_pct()),
            sources: self.feed.list_sources(now_ns),
            alignment: self.feed.alignment().build_status(),
            scripts: report::list_scripts(&self.pipeline),
            operations: self.operations.as_ref().map(Operations::status),
            wear: wear::build_status(&self.pipeline),
            no_wear_model: self.pipeline.wear().explain_missing_model(),
            sinks: self.sinks.list_sinks(),
            problems: self.list_problems(&history),
            history,
        }
    }

    fn list_alarms(&self) -> Vec<AlarmStatus> {
        let of_twin = self.twin.iter().flat_map(Twin::list_alarms);
        let of_thermal = self.thermal.iter().flat_map(Thermal::list_alarms);
        let of_scripts = report::list_alarms(&self.pipeline).into_iter();
        of_scripts.chain(of_twin).chain(of_thermal).chain(self.commands.standing_alarm()).collect()
    }

    fn list_problems(&self, history: &HistoryStatus) -> Vec<StatusProblem> {
        let recipe = self.operations.as_ref().and_then(Operations::describe_problem);
        self.health
            .list_problems(history)
            .into_iter()
            .chain(recipe)
            .chain(self.sinks.list_problems())
            .chain(self.commands.list_problems(self.pipeline.gate()))
            .chain(self.supervisor.list_problems())
            .chain(self.standing_problems.iter().cloned())
            .collect()
    }
}
