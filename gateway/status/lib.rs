//! What the box says of itself at this moment: one document (`status/1`) for the page, the API and the metrics.
//!
//! The tick builds it a few times per second and hands it over whole, so that no reader ever waits for the tick or the
//! tick for a reader. Every number carries its unit in its name or beside it; a missing one carries its reason.

pub mod alignment;
mod gate;
mod latest_status;

use adapter_core::histogram::Histogram;
pub use gate::{AxisShift, GateStatus, OffsetStatus};
pub use gateway_base::clock::ClockStatus;
use gateway_base::machine_path::MachinePath;
pub use gateway_base::problem::StatusProblem;
pub use latest_status::Published;
use serde::Serialize;

/// A number or a word.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum NumberOrWord {
    /// In the unit beside it.
    Number(f64),
    /// A state word or name.
    Text(String),
}

/// One measured channel: a value with unit and age, or the reason for none.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelStatus {
    /// Name of the channel, ending in its unit.
    pub name: &'static str,
    /// The value; absent where `missing` says why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<NumberOrWord>,
    /// Unit of the value; `1` for pure numbers, empty for text.
    pub unit: &'static str,
    /// Seconds since the value was true; 0 between two readings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_s: Option<f64>,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<&'static str>,
    /// The source that delivered the value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

/// One inferred quantity: a value with its uncertainty, or the reason for none.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimateStatus {
    /// Name, ending in the unit.
    pub name: &'static str,
    /// The value; absent where `missing` says why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Half the width of the 95 % interval (1.96 standard deviations), in the same unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<f64>,
    /// Unit of value and uncertainty.
    pub unit: &'static str,
    /// The reason for none, as a word.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<&'static str>,
    /// The same in plain words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// What the machine is doing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateStatus {
    /// The word of the state.
    pub word: &'static str,
    /// Since when, milliseconds since 1970.
    pub since_ms: i64,
    /// For how long, seconds.
    pub seconds: f64,
    /// Seconds of machine time in each state since the start.
    pub seconds_per_state: Vec<(&'static str, f64)>,
    /// Why it is unknown, where it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// What it was inferred from.
    pub basis: &'static str,
    /// What that means, in words.
    pub basis_text: String,
    /// Can cutting be seen in the spindle power?
    pub visibility: &'static str,
    /// Where the no-load power comes from.
    pub no_load_origin: &'static str,
    /// `commissioned`, or `not_commissioned`: then the uncertainty of the cutting power is that of drives of this kind.
    pub load_loss_origin: &'static str,
}

/// An alarm that stands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlarmStatus {
    /// Its name in the script that raised it.
    pub code: String,
    /// `info`, `warning` or `critical`, as in the history.
    pub severity: String,
    /// What the operator reads.
    pub text: String,
    /// The same in Chinese.
    pub zh: String,
    /// Since when, milliseconds since 1970.
    pub since_ms: i64,
}

/// An alarm that stands and that a person has seen.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Acknowledged {
    /// Code of the alarm.
    pub code: String,
    /// Who has seen it.
    pub by: String,
    /// When, milliseconds since 1970.
    pub at_ms: i64,
}

/// A decision worth showing: a change of what scripts ask for or of what the gate lets through.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DecisionStatus {
    /// When, milliseconds since 1970.
    pub at_ms: i64,
    /// One sentence for the operator, in English.
    pub text: String,
}

/// What a source knows of itself.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FactStatus {
    /// What it is; a number's name ends in its unit.
    pub name: String,
    /// The value of the fact.
    pub value: NumberOrWord,
}

/// A source and how it keeps its pace.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SourceStatus {
    /// Address or name in the configuration.
    pub name: String,
    /// What it is doing: `reading`, `off` (the machine is switched off), `failing`, `stuck`, `ended`, ...
    pub state: &'static str,
    /// What went wrong last and what to do, while it lasts.
    pub error: Option<String>,
    /// Pace it promises, s.
    pub period_s: f64,
    /// Pace it keeps at the moment, s, once known: values older than two of these count as stale.
    pub period_kept_s: Option<f64>,
    /// How late polls begin against their beat, ms, once known: median and 99th percentile.
    pub jitter_p50_ms: Option<f64>,
    /// The 99th percentile of the same, ms.
    pub jitter_p99_ms: Option<f64>,
    /// From asking to answer, ms, once known: median and 99th percentile.
    pub round_trip_p50_ms: Option<f64>,
    /// The 99th percentile of the same, ms.
    pub round_trip_p99_ms: Option<f64>,
    /// From asking to answer, of all polls; for the metrics.
    #[serde(skip)]
    pub round_trips: Histogram,
    /// Since the last poll that succeeded, s; for the metrics.
    #[serde(skip)]
    pub lag_s: Option<f64>,
    /// Readings since the start.
    pub readings: u64,
    /// Failed polls since the start.
    pub failures: u64,
    /// Beats left out because a poll took too long.
    pub missed: u64,
    /// Readings and polls dropped: too late, by a stepping clock, unannounced, or nobody took them.
    pub dropped: u64,
    /// Device, register map, effective refresh, load of the wire and the like.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub facts: Vec<FactStatus>,
    /// What is wrong although it answers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub problems: Vec<StatusProblem>,
    /// Channels that it delivers and that are not taken from it: they belong to an earlier source, for which it does not stand in.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unused_channels: Vec<&'static str>,
}

/// A script and whether its newest text is in charge.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScriptStatus {
    /// Name of the file in the directory of scripts.
    pub file: String,
    /// Version in charge (start of the text's digest).
    pub version: String,
    /// `running`, `waiting` (for a value), `reverted`, `suspended` or `refused`.
    pub condition: &'static str,
    /// Why it does not run as written, with line and column.
    pub error: Option<String>,
}

/// The operations recipe and whether its newest text is in force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OperationsStatus {
    /// Path of the recipe file.
    pub path: String,
    /// Version in force; `null` when there is none.
    pub version: Option<String>,
    /// How many operations it holds.
    pub operations: usize,
    /// Operation of the block that runs now, with the version of the recipe.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_force: Option<String>,
    /// Why no operation is in force, where none is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<String>,
    /// Why the newest text of the file is not in force, with line and column.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Wear of the edge in use, followed over its parts. The limit is that of the last moment of cutting, where the library has a
/// model for the cut.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WearStatus {
    /// Which law the model is: `surface` or `physical`.
    pub form: &'static str,
    /// What of its key spoke for the model: `edge`, `tool`, `operation`, `work material`, `machine`, `any`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_by: Option<&'static str>,
    /// Flank wear at which the edge is worn, mm.
    pub criterion_mm: f64,
    /// Limit `[Pc]` of the cut, W.
    pub limit_w: Option<f64>,
    /// Half the 95 % interval of a single cut at the limit, W.
    pub limit_uncertainty_w: Option<f64>,
    /// Flank wear that the power means, mm.
    pub flank_wear_mm: Option<f64>,
    /// Half its 95 % interval, mm.
    pub flank_wear_uncertainty_mm: Option<f64>,
    /// Probability that the edge passes the criterion by the end of the next part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worn_probability: Option<f64>,
    /// Parts until it does: the middle, and the ends of an 80 % interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts_left: Option<[f64; 3]>,
    /// Whether the wear can be seen in the power: `observable` or `not_observable_here`.
    pub observability: Option<&'static str>,
    /// Factors in which the cut lies outside what the model was fitted on.
    pub extrapolated: Vec<&'static str>,
    /// Why a number is missing, where one is.
    pub why: Option<String>,
}

/// How the history is doing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HistoryStatus {
    /// Path of the database file.
    pub path: String,
    /// Samples acknowledged since the start of the file.
    pub rows: u64,
    /// Bytes in use in the database.
    pub bytes: u64,
    /// Days until the disk (or the limit) is full at this rate.
    pub lasts_days: Option<f64>,
    /// Samples that could not be stored since the start.
    pub lost: u64,
    /// What is wrong and what to do, while it lasts.
    pub error: Option<String>,
    /// Bytes of the log beside the file.
    pub log_bytes: u64,
    /// Histories that the disk has changed and that were therefore set aside.
    pub set_aside: Vec<String>,
}

/// Rate and punctuality of the tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TickStatus {
    /// Ticks per second of machine time.
    pub rate_hz: f64,
    /// Ticks since the start.
    pub count: u64,
    /// Lateness against the plan, ms: median and 99th percentile of the last minute.
    pub late_p50_ms: f64,
    /// The 99th percentile of the same, ms.
    pub late_p99_ms: f64,
    /// Lateness of all ticks; for the metrics.
    #[serde(skip)]
    pub late: Histogram,
    /// Ticks left out because the box was too late for them.
    pub skipped: u64,
}

/// Energy that was drawn since the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelEnergy {
    /// The power that it is counted from.
    pub channel: &'static str,
    /// Energy, J; what a braking spindle gives back is not taken off.
    pub joules: f64,
}

/// The document `status/1` of one tick.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Always `status/1`; another layout gets another number.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the machine.
    pub machine: String,
    /// Where it stands in its plant, where somebody has said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<MachinePath>,
    /// Is the machine simulated?
    pub simulated: bool,
    /// Machine time over real time; `null` when as fast as possible.
    pub speed: Option<f64>,
    /// The instant this document is about, milliseconds since 1970.
    pub at_ms: i64,
    /// Seconds since the start of the process.
    pub uptime_s: f64,
    /// What is thought of the clock; `null` where the machine brings its own time.
    pub clock: Option<ClockStatus>,
    /// Rate and punctuality of the tick.
    pub tick: TickStatus,
    /// What the machine is doing.
    pub state: StateStatus,
    /// Every channel that a source provides.
    pub channels: Vec<ChannelStatus>,
    /// Every quantity that is inferred from the channels.
    pub estimates: Vec<EstimateStatus>,
    /// Alarms that have not been cleared.
    pub alarms: Vec<AlarmStatus>,
    /// Those of them that a person has seen.
    pub acknowledged: Vec<Acknowledged>,
    /// The simulation beside the machine, where a model is configured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub twin: Option<gateway_diagnosis::status::TwinStatus>,
    /// Finished parts since the start.
    pub parts: u64,
    /// Energy since the start, by the power that it is counted from; for the metrics.
    #[serde(skip)]
    pub energies: Vec<ChannelEnergy>,
    /// The way of an override to the machine.
    pub gate: GateStatus,
    /// The controllers and meters that are read.
    pub sources: Vec<SourceStatus>,
    /// How late each meter is against the controller.
    pub alignment: Vec<crate::alignment::AlignmentStatus>,
    /// The scripts of the directory, each with its condition.
    pub scripts: Vec<ScriptStatus>,
    /// The operations recipe, where one is configured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operations: Option<OperationsStatus>,
    /// Wear of the tool, where the library has a model for the cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear: Option<WearStatus>,
    /// Why the library has none for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_wear_model: Option<String>,
    /// How the history is doing.
    pub history: HistoryStatus,
    /// What leaves the box, where a sink is configured.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sinks: Vec<gateway_sinks::SinkStatus>,
    /// What does not work while the box goes on.
    pub problems: Vec<StatusProblem>,
}
