//! `run`: one machine, live. The tick has a thread of its own, so has every source; tokio only serves.

pub mod acknowledged_alarms;
pub mod actuator_worker;
pub mod command;
pub mod deadline;
pub mod end;
pub mod energy;
mod facts;
pub mod health;
pub mod history_store;
pub mod live_twin;
mod network_commands;
pub mod network_requests;
pub mod offset_commands;
pub mod operations;
pub mod outputs;
pub mod priority;
mod problems;
pub mod recent;
pub mod report;
pub mod restored_state;
pub mod rules;
pub mod save;
pub mod service_manager;
pub mod signals;
mod start_clock;
pub mod supervisor;
pub mod thermal;
pub mod tick;
pub mod update;
mod verdict_mailbox;
mod way_to_machine;
pub mod wear;

use crate::operations::Operations;
use crate::signals::Signals;
use adapters::clock::{Clock, SECOND_NS, TimeNs};
use deadline::{RUN_MAX, RunLimit};
use energy::EnergyCounter;
use gateway_access::{self as access, Access};
use gateway_backup::{BackupPaths, BackupSchedule, take_restored};
use gateway_base::cannot_run::CannotRun;
use gateway_base::clock::{self, of_box};
use gateway_base::log::{self, Notice, Severity};
use gateway_config::{Config, HttpConfig};
use gateway_control::{self as control, OrderReceiver};
use gateway_diagnosis::handle::DiagnosisHandle;
use gateway_gate::Gate;
use gateway_http::{
    Certificate, CertificateError, Configured, Server, ServerParts, ServerState, bind_port, port_trouble,
};
use gateway_pipeline::Pipeline;
use gateway_sources::open::{self, MachineSpeed, Sources};
use gateway_sources::origin_log::OriginLog;
use gateway_status::{Published, alignment};
use health::Health;
use history_store::HistoryStore;
use live_twin::Twin;
use outputs::ConfiguredSinks;
use service_manager::{OpeningReport, ProgressMarks, WatchedPart};
use start_clock::ClockStart;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use supervisor::Supervisor;
use thermal::Thermal;
use tick::{Identity, RunEnd, Ticker};
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::task::JoinSet;
use wear::Wear;

/// Questions about the history, hashes of tokens and the like, at the same time.
const BLOCKING_MAX: usize = 6;
/// Time between two looks at the file of persons.
const FOLLOW_EVERY: Duration = Duration::from_secs(1);
/// Time between two signs of life of the threads that answer the page.
const PAGE_BEAT: Duration = Duration::from_secs(1);

/// What the box shall do.
#[derive(Debug)]
pub struct RunPlan {
    /// The checked configuration that the box runs with.
    pub config: Config,
    /// Its file; `None`: the built-in one.
    pub config_file: Option<PathBuf>,
    /// Did a person name the port on the command line? Then one that is in use is an error; otherwise the box goes on without its
    /// page and keeps trying.
    pub port_named: bool,
    /// How fast machine time runs.
    pub speed: MachineSpeed,
    /// End after so many seconds of machine time.
    pub stop_after_s: Option<f64>,
}

/// The tick, ready to go, and what it publishes.
type StartedTicker = (Ticker, watch::Receiver<Option<Published>>);

/// Runs until told to stop. Where the clock of the computer turns out to be another than was thought, the run ends as for a
/// stop and another one begins: see [`gateway_base::clock`].
///
/// # Errors
/// Everything that makes it impossible to begin.
pub fn run(plan: RunPlan) -> Result<(), CannotRun> {
    let outputs = ConfiguredSinks::from_config(&plan.config);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .max_blocking_threads(BLOCKING_MAX + outputs.as_ref().map_or(0, ConfiguredSinks::count_threads))
        .thread_name("serve")
        .on_thread_start(priority::give_way)
        .enable_all()
        .build()
        .map_err(|error| CannotRun::new(format!("no threads to serve with: {error}"), ""))?;
    // Before anything is opened: from here on a signal ends the box in good order.
    let mut signals = runtime.block_on(async { Signals::start_listening() }).map_err(|error| {
        let text = format!("signals cannot be heard ({error}): stop the box with SIGKILL; nothing stored is lost");
        Notice::new(Severity::Warning, "no_signals", text).write_to_logs();
    });
    log::keep_crash_reports(&plan.config.gateway.data_dir);
    let mut follows = false;
    let ended = loop {
        match run_once(&plan, &runtime, signals.as_mut().ok(), follows) {
            Ok(RunEnd::FollowClock) => follows = true,
            Ok(RunEnd::Over) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    service_manager::report_stopping();
    runtime.shutdown_timeout(Duration::from_secs(1));
    ended
}

/// From the start to the end of one run. `follows`: the wall clock has stood long enough to be followed.
fn run_once(
    plan: &RunPlan,
    runtime: &tokio::runtime::Runtime,
    signals: Option<&mut Signals>,
    follows: bool,
) -> Result<RunEnd, CannotRun> {
    let listener = runtime.block_on(bind_named_port(plan))?;
    let opening = OpeningReport::start();
    let started = ClockStart::judge_clock(plan, follows);
    let outputs = ConfiguredSinks::from_config(&plan.config);
    let run_flags = Arc::new(end::RunFlags::default());
    let (report, port) = watch::channel(None);
    let (post, inbox) = control::create_queues();
    let marks = Arc::new(ProgressMarks::new());
    let (mut ticker, live) = build_ticker(plan, &run_flags, (port, marks.clone()), inbox, (outputs.as_ref(), started))?;
    drop(opening);
    let _backups = schedule_backups(plan, &mut ticker.health)?;
    let beat = runtime.spawn(mark_page(marks));
    let channels = (report, post, ticker.twin.as_ref().and_then(Twin::diagnosis_handle));
    let thread = std::thread::Builder::new()
        .name("tick".to_owned())
        .spawn(move || ticker.run())
        .map_err(|error| CannotRun::new(format!("no thread for the tick: {error}"), ""))?;
    let serving = serve_until_end(plan, listener, live, (&run_flags, signals), channels, outputs.as_ref());
    runtime.block_on(serving);
    beat.abort();
    thread.join().map_err(|_| CannotRun::new("the tick broke off", "report this with the log; what was stored is safe"))
}

/// Backups on a thread of their own, where the configuration wants them. They are taken while the box lives.
fn schedule_backups(plan: &RunPlan, health: &mut Health) -> Result<Option<BackupSchedule>, CannotRun> {
    let Some(config) = &plan.config.backup else { return Ok(None) };
    let paths = BackupPaths::from_config(&plan.config, plan.config_file.as_deref());
    let (tell, heard) = std::sync::mpsc::channel();
    health.follow_notices(heard);
    let now_s = || gateway_base::convert::clamp_to_unsigned(clock::now_ns() / SECOND_NS);
    // Without a tick nobody listens, and the box is about to end.
    let tell = move |notice: &Notice| drop(tell.send(notice.clone()));
    BackupSchedule::start(paths, config.clone(), now_s, tell)
        .map(Some)
        .map_err(|error| CannotRun::new(format!("no thread for backups: {error}"), ""))
}

/// The threads that answer the page move as long as this does.
async fn mark_page(marks: Arc<ProgressMarks>) {
    let mut beat = tokio::time::interval(PAGE_BEAT);
    loop {
        beat.tick().await;
        marks.mark_part(WatchedPart::Page);
    }
}

fn parse_listen_address(plan: &RunPlan) -> Result<Option<SocketAddr>, CannotRun> {
    let http = &plan.config.http;
    if !http.enabled {
        return Ok(None);
    }
    let bad = |_| CannotRun::new(format!("{} is no address to listen on", http.listen), "write 127.0.0.1:8080");
    http.listen.parse().map(Some).map_err(bad)
}

/// What is shown to whoever connects, where the page is served over TLS.
fn load_certificate(
    http: &HttpConfig,
    listen: SocketAddr,
    directory: &Path,
) -> Result<Option<Certificate>, CertificateError> {
    match &http.certificate {
        _ if !http.tls => Ok(None),
        Some((certificate, key)) => Certificate::read(certificate, key).map(Some),
        None => Certificate::load_or_create(directory, listen, &http.allow_hosts).map(Some),
    }
}

/// A port that the user named is opened before anything else starts.
async fn bind_named_port(plan: &RunPlan) -> Result<Option<TcpListener>, CannotRun> {
    let Some(address) = parse_listen_address(plan)?.filter(|_| plan.port_named) else { return Ok(None) };
    let next = "stop the other program, or choose another port with --listen 127.0.0.1:8081";
    bind_port(address).await.map(Some).map_err(|error| CannotRun::new(port_trouble(address, &error), next))
}

/// The estimators and edges as they were remembered, the scripts in charge and the gate.
fn build_pipeline(plan: &RunPlan, memory: &Path, told: &mut Vec<Notice>) -> (Pipeline, rules::ScriptWatch) {
    let (mut scripts, watched) = rules::load_scripts(&plan.config);
    if plan.speed == MachineSpeed::Real {
        scripts.set_deadline(Arc::new(RunLimit::new(RUN_MAX)));
    }
    let gate = Gate::new(plan.config.gate.clone());
    let mut pipeline = Pipeline::new(restored_state::restore_estimators(memory, told), scripts, gate);
    restored_state::restore_edge_wear(&mut pipeline, &memory.with_file_name(health::WEAR_MEMORY), told);
    (pipeline, watched)
}

fn build_ticker(
    plan: &RunPlan,
    run_flags: &Arc<end::RunFlags>,
    (port, marks): (watch::Receiver<Option<String>>, Arc<ProgressMarks>),
    inbox: OrderReceiver,
    (outputs, started): (Option<&ConfiguredSinks>, ClockStart),
) -> Result<StartedTicker, CannotRun> {
    let config = &plan.config;
    let data_dir = &config.gateway.data_dir;
    // Before anything is read that a restore has laid ready.
    let mut told: Vec<Notice> = take_restored(data_dir).into_iter().collect();
    let twin = Twin::from_config(config);
    let memory = data_dir.join("estimators.json");
    let (mut pipeline, watched) = build_pipeline(plan, &memory, &mut told);
    let beside = twin.as_ref().map(Twin::extra_series).unwrap_or_default();
    let (mut thermal, standing_problems) = thermal::open_law(config, &mut told);
    let of_thermal = thermal.as_ref().map(Thermal::extra_series).unwrap_or_default();
    pipeline.exclude_series(&of_thermal);
    let beside = [pipeline.extra_series(), alignment::list_series(), beside, of_thermal].concat();
    let outbox = outputs.map(|outputs| outputs.outbox.clone());
    let history_store = HistoryStore::open(&config.history, beside, outbox, started.mark.clone())
        .map_err(|error| CannotRun::new(error.to_string(), ""))?;
    let own = of_box().clone();
    let clock: Arc<dyn Clock> = own.clone();
    let start_ns = start_ns(plan, &history_store, clock.now_ns());
    let opened = open::open_sources(config, plan.speed, &clock, start_ns);
    let Sources { feed, schedule: pace, simulated, ways, machines } =
        opened.map_err(|problems| CannotRun::new(problems.join("\n"), "cnc-gateway check says more"))?;
    let wake = inbox.wake.clone();
    let commands =
        way_to_machine::build_commands(plan, ways, inbox, &clock, pipeline.gate_mut(), history_store.stored_audit())?;
    let identity = build_identity(plan, simulated);
    let (publish, live) = watch::channel(None);
    #[expect(clippy::cast_possible_truncation, reason = "saturates, which is meant")]
    let stop_after_ns = plan.stop_after_s.map(|seconds| (seconds * SECOND_NS as f64) as i64);
    let own = (plan.speed == MachineSpeed::Real).then_some(own);
    let mut health = Health::new(history_store, own, port, memory, marks);
    if let Some(twin) = twin.as_ref().filter(|twin| !twin.extra_series().is_empty()) {
        health.set_twin_values(twin.extra_values());
    }
    if let Some(thermal) = &mut thermal {
        thermal.report_notices(&mut health, start_ns);
    }
    let text = format!("{} is being polled; everything is kept in {}", identity.machine.name, data_dir.display());
    health.record_event(start_ns, "gateway", &Notice::new(Severity::Info, "started", text));
    told.iter().for_each(|notice| health.record_event(start_ns, "gateway", notice));
    started.notices.iter().for_each(|notice| health.record_event(start_ns, "clock", notice));
    let operations = config.operations.path.as_deref().map(Operations::start_watching);
    Ok((
        Ticker {
            identity,
            schedule: pace,
            feed,
            origins: OriginLog::default(),
            pipeline,
            commands,
            energy: EnergyCounter::default(),
            machines,
            operations,
            twin,
            wear: Wear::from_config(config),
            thermal,
            sinks: outputs.map(|outputs| outputs.board.clone()).unwrap_or_default(),
            scripts: watched,
            health,
            run_flags: run_flags.clone(),
            wake,
            publish,
            stop_after_ns,
            supervisor: Supervisor::new(),
            standing_problems,
        },
        live,
    ))
}

fn build_identity(plan: &RunPlan, simulated: bool) -> Identity {
    let gateway = &plan.config.gateway;
    Identity { machine: gateway.machine.clone(), simulated, speed: plan.speed.time_factor(), rate_hz: gateway.tick_hz }
}

/// Now; an accelerated machine begins after everything that the history already holds.
fn start_ns(plan: &RunPlan, history_store: &HistoryStore, now_ns: TimeNs) -> TimeNs {
    if plan.speed == MachineSpeed::Real {
        return now_ns;
    }
    let newest_ns = history_store.newest_ns().filter(|newest_ns| *newest_ns >= now_ns);
    newest_ns.map_or(now_ns, |newest_ns| newest_ns + SECOND_NS)
}

/// Serves until a signal says stop, or the tick has ended by itself.
async fn serve_until_end(
    plan: &RunPlan,
    listener: Option<TcpListener>,
    live: watch::Receiver<Option<Published>>,
    (run_flags, signals): (&Arc<end::RunFlags>, Option<&mut Signals>),
    (report, post, diagnoses): (watch::Sender<Option<String>>, control::OrderSender, Option<DiagnosisHandle>),
    outputs: Option<&ConfiguredSinks>,
) {
    // What runs beside ends with this run.
    let mut beside = JoinSet::new();
    let sinks = outputs.map(|outputs| outputs.start(&post));
    let _listening = control::listen_for_orders(&plan.config.gateway.data_dir, post.clone());
    let server = match parse_listen_address(plan) {
        Ok(Some(address)) => {
            let access = Arc::new(open_access(&plan.config, post.clone()));
            beside.spawn(follow_persons(access.clone()));
            let (history, language) = (plan.config.history.path.clone(), plan.config.gateway.language);
            let hosts = plan.config.http.allow_hosts.clone();
            let (scripts, data_dir) = (plan.config.scripts.directory.clone(), plan.config.gateway.data_dir.clone());
            let live = live.clone();
            let configured = Configured { config: Arc::new(plan.config.clone()), file: plan.config_file.clone() };
            let shared = ServerState::new(ServerParts {
                live,
                history,
                scripts,
                data_dir,
                language,
                access,
                orders: post,
                hosts,
                diagnoses,
                configured,
            });
            let http = plan.config.http.clone();
            let directory = plan.config.gateway.data_dir.join("tls");
            let certificate = move || load_certificate(&http, address, &directory);
            Some(Server::start((address, listener), certificate, shared, report))
        }
        _ => None,
    };
    end::wait_for_end(run_flags, signals, outputs, live).await;
    if let Some(sinks) = sinks {
        sinks.stop().await;
    }
    if let Some(server) = server {
        server.stop().await;
    }
}

/// Who may do what on the page. The first start makes an administrator, whose token is shown this once.
fn open_access(config: &Config, post: control::OrderSender) -> Access {
    let rules = access::Rules {
        tokens_always: config.http.tokens_always,
        session: config.http.session,
        allow_arming: config.http.allow_arming,
    };
    let (access, first) = Access::open(access::persons_path(&config.gateway.data_dir), rules, post);
    if let Some(token) = first {
        let name = access::FIRST;
        log::say_to_operator_alone(&match log::is_kept_by_journal() {
            true => "to change something on the page, make a token at the box: `sudo cnc-gateway setup`, or \
                     `sudo cnc-gateway person token admin`"
                .to_owned(),
            false => format!(
                "to change something on the page, sign in as {name} with the token {}; it is shown only now, and signs in once, within a day",
                token.text()
            ),
        });
    }
    access
}

/// Whoever changes the file of persons is followed, and it stands in the audit.
async fn follow_persons(access: Arc<Access>) {
    access.tell_persons().await;
    let mut beat = tokio::time::interval(FOLLOW_EVERY);
    loop {
        beat.tick().await;
        access.reload_if_changed().await;
    }
}
