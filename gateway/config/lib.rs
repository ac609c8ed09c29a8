//! The configuration: one TOML file, read completely or refused with everything that is wrong with it.
//!
//! [`load`] reads a file and the environment, [`parse`] does the same from text. The keys, their defaults, ranges and
//! texts are the rows of [`keys::KEYS`]. An environment variable `CNC_GATEWAY__SECTION__KEY` goes before the file.
//!
//! Nothing is guessed: an unknown key, a wrong type or a value out of range refuses the file, all of them at once.

mod build;
mod channel_keys;
mod channels;
mod check_value;
mod config_key;
mod in_force;
mod key_list;
pub mod keys;
mod keys_of_backup;
mod keys_of_gate;
mod keys_of_outputs;
mod keys_of_thermal;
mod outputs;
mod problem;
mod read;
mod stand_in;

pub use in_force::{InForce, ValueOrigin};
pub use problem::Problem;
pub use read::OptionValue;

use adapters::{Address, Axis, ChannelId};
use gateway_base::log::LogFormat;
use gateway_base::machine_path::NamedMachine;
pub use gateway_gate::limits::{GateConfig, GateMode, OffsetConfig};
use gateway_history::OutboxSettings;
pub use gateway_sinks::sink_config::SinkConfig;
use rules::estimators::thermal::CompensationSettings;
use rules::physics::explain::Language;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tracing::Level;

/// What every environment variable that overrides a key begins with.
pub const ENVIRONMENT_PREFIX: &str = "CNC_GATEWAY__";

/// Name under which the built-in configuration appears in messages.
pub const BUILT_IN: &str = "built-in configuration";

/// The configuration that is used when no file is given: the embedded simulated lathe.
pub const BUILT_IN_TEXT: &str =
    "[gateway]\nname = \"Simulated lathe\"\n\n[[source]]\naddress = \"simulated://lathe\"\n";

/// A complete, checked configuration. Every path in it is ready to be opened.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Name, tick rate, clock, language and data directory of the box.
    pub gateway: GatewayConfig,
    /// At least one source.
    pub sources: Vec<SourceConfig>,
    /// One time base for controller and meters.
    pub alignment: AlignmentConfig,
    /// Where the scripts are, and whether changed ones are read again.
    pub scripts: ScriptsConfig,
    /// How each stretch of an NC program cuts.
    pub operations: OperationsConfig,
    /// What may be written to the machine.
    pub gate: GateConfig,
    /// Path, ages and greatest size of the history.
    pub history: HistoryConfig,
    /// Where it is sent to.
    pub sinks: Vec<SinkConfig>,
    /// What the sinks are sent, and how much of it is kept for them.
    pub outbox: OutboxSettings,
    /// Address, TLS and sign-in of the page and of the interface.
    pub http: HttpConfig,
    /// The model that the machine is compared with.
    pub twin: TwinConfig,
    /// The thermal law and what may be done with its prediction.
    pub thermal: ThermalConfig,
    /// Backups taken by itself; `None`: none are.
    pub backup: Option<BackupConfig>,
    /// Level and form of the engineer's log.
    pub log: LogConfig,
    /// Every key with its value and where that was written.
    pub in_force: Vec<InForce>,
}

/// The section `[gateway]`: the box itself.
#[derive(Debug, Clone, PartialEq)]
pub struct GatewayConfig {
    /// Name of the machine, and its path in the plant.
    pub machine: NamedMachine,
    /// Ticks per second, 0.1 to 1000.
    pub tick_hz: f64,
    /// A reading of the wall clock that has stood for so long is believed.
    pub clock_confirm: Duration,
    /// Language in which the page opens; `None`: that of the browser.
    pub language: Option<Language>,
    /// Directory of everything the gateway writes.
    pub data_dir: PathBuf,
}

/// One section `[[source]]`: a controller, meter or recording.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceConfig {
    /// Where it is and how to talk to it.
    pub address: Address,
    /// Short name; the text of the address when none was given.
    pub name: String,
    /// Time between two polls; `None`: the driver's own pace.
    pub period: Option<Duration>,
    /// A poll that takes longer has failed.
    pub deadline: Duration,
    /// Channels that it may deliver while an earlier source that delivers them has no value.
    pub stand_in: Vec<ChannelId>,
}

/// What is done with the lag between the controller and a meter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AlignmentUse {
    /// It is not looked for.
    Off,
    /// It is estimated and shown, and nothing else.
    Show,
    /// It is shown, and the meter's readings are put back by it.
    Merge,
}

impl AlignmentUse {
    /// The word in the configuration and in the status.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Show => "show",
            Self::Merge => "merge",
        }
    }
}

/// The section `[alignment]`: lag of the power meters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AlignmentConfig {
    /// For the source of `spindle_power_w`.
    pub spindle_power: AlignmentUse,
    /// For the source of `total_power_w`, where that is another one.
    pub total_power: AlignmentUse,
}

/// The section `[scripts]`: the rules that the integrator edits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScriptsConfig {
    /// Directory of the `.rhai` files.
    pub directory: PathBuf,
    /// Look for changes every second.
    pub reload: bool,
}

/// The section `[operations]`: how each stretch of a program cuts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OperationsConfig {
    /// The operations recipe; `None`: none is used.
    pub path: Option<PathBuf>,
}

/// The section `[history]`: what is remembered, and for how long.
#[derive(Debug, Clone, PartialEq)]
pub struct HistoryConfig {
    /// Path of the SQLite database.
    pub path: PathBuf,
    /// Age at which raw samples are dropped, days.
    pub retention_days: f64,
    /// Greatest size, GB (1e9 bytes).
    pub max_gb: f64,
    /// Time between two commits.
    pub commit: Duration,
}

/// The section `[http]`: the page and the interface on the network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HttpConfig {
    /// Address and port of the page, `HOST:PORT`.
    pub listen: String,
    /// Whether page and interface are served at all.
    pub enabled: bool,
    /// Whether they are served over TLS; any other address than 127.0.0.1 needs it.
    pub tls: bool,
    /// Certificate chain and private key; `None`: made at the first start.
    pub certificate: Option<(PathBuf, PathBuf)>,
    /// Reading needs a token too.
    pub tokens_always: bool,
    /// Whoever has signed in is signed out after this time.
    pub session: Duration,
    /// Names by which browsers reach the box, besides its own addresses, in lower case.
    pub allow_hosts: Vec<String>,
    /// The gate may be armed from the page.
    pub allow_arming: bool,
    /// Beginnings of the shifts, minutes after midnight, increasing.
    pub shifts: Vec<i64>,
}

/// The section `[twin]`: the simulation beside the machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TwinConfig {
    /// Model file (model/1); `None`: no simulation runs.
    pub model: Option<PathBuf>,
}

/// The section `[thermal]`: the thermal law that the box runs.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalConfig {
    /// Model file that `identify thermal --model` writes.
    pub model: Option<PathBuf>,
    /// Axis whose error it predicts.
    pub axis: Axis,
    /// Propose the offset to the gate?
    pub propose: bool,
    /// Do readings of the error correct the law?
    pub learn: bool,
    /// Greatest change of the prediction by one reading, um.
    pub step_um: f64,
    /// Greatest change of the prediction by all readings, um.
    pub total_um: f64,
    /// From prediction to offset and pulses.
    pub compensation: CompensationSettings,
}

/// The section `[backup]`: backups that the box takes by itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BackupConfig {
    /// Where the archives go; a stick or share may be mounted there.
    pub directory: PathBuf,
    /// Time between two backups.
    pub every: Duration,
    /// So many are kept.
    pub keep: usize,
    /// Copy the history, too.
    pub history: bool,
}

/// The section `[log]`: the engineer's log on standard error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogConfig {
    /// Less important events are left out; `--log-level` goes before it.
    pub level: Level,
    /// Text, JSON, or none at all.
    pub format: LogFormat,
}

/// Reads the file, or without one the built-in configuration, and overlays the environment.
///
/// # Errors
/// Everything that is wrong, in the order of the file; then the variables.
pub fn load(
    file: Option<&Path>,
    environment: impl IntoIterator<Item = (String, String)>,
) -> Result<Config, Vec<Problem>> {
    load_with(file, environment, &[])
}

/// The same with options of the command line, which go before the environment and the file.
///
/// # Errors
/// As [`load`].
pub fn load_with(
    file: Option<&Path>,
    environment: impl IntoIterator<Item = (String, String)>,
    options: &[OptionValue],
) -> Result<Config, Vec<Problem>> {
    let Some(path) = file else {
        return parse_with(BUILT_IN, BUILT_IN_TEXT, Path::new(""), environment, options);
    };
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| vec![unreadable_problem(&name, &error)])?;
    let base = path.parent().unwrap_or(Path::new(""));
    parse_with(&name, &text, base, environment, options)
}

fn unreadable_problem(name: &str, error: &std::io::Error) -> Problem {
    let next = match error.kind() {
        std::io::ErrorKind::NotFound => "`cnc-gateway check --example` prints a file to start from",
        std::io::ErrorKind::InvalidData => "save the file as UTF-8",
        _ => "",
    };
    Problem::in_file(name, format!("the configuration cannot be read: {error}"), next)
}

/// The same from text. `file` is its name in messages, `base` the directory that relative paths begin at.
///
/// # Errors
/// Everything that is wrong, in the order of the file; then the variables.
pub fn parse(
    file: &str,
    text: &str,
    base: &Path,
    environment: impl IntoIterator<Item = (String, String)>,
) -> Result<Config, Vec<Problem>> {
    parse_with(file, text, base, environment, &[])
}

/// The same with options of the command line, which go before the environment and the file.
///
/// # Errors
/// As [`parse`].
pub fn parse_with(
    file: &str,
    text: &str,
    base: &Path,
    environment: impl IntoIterator<Item = (String, String)>,
    options: &[OptionValue],
) -> Result<Config, Vec<Problem>> {
    let mut reading = read::ConfigInput::from_text(file, text);
    let mut variables: Vec<_> =
        environment.into_iter().filter(|(name, _)| name.starts_with(ENVIRONMENT_PREFIX)).collect();
    variables.sort();
    for (name, value) in &variables {
        reading.overlay_variable(name, ENVIRONMENT_PREFIX, value);
    }
    options.iter().for_each(|given| reading.overlay_option(given));
    reading.complete_sections();
    let config = build::build_config(&mut reading, base);
    let mut problems = std::mem::take(&mut reading.problems);
    problems.sort_by_key(|problem| (problem.line.is_none(), problem.line, problem.column));
    match config {
        Some(config) if problems.is_empty() => Ok(config),
        _ => Err(problems),
    }
}
