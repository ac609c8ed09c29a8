//! Two texts for two readers: an operator's line on standard output, an engineer's detail on standard error.
//!
//! A [`Notice`] carries both. The operator's line says what happened and what to do; the detail names the code, the
//! address and the numbers, as text or as one JSON object per line.
//!
//! Neither stream keeps anybody waiting: a thread of its own writes to each, see `outlet`.

mod crash;
mod outlet;

pub use crash::keep_crash_reports;

use outlet::Outlet;
use std::io::Write;
use std::sync::OnceLock;
use std::time::Duration;
use tracing::Level;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// A stream that is not read is not waited for at the end.
const FLUSH_WITHIN: Duration = Duration::from_secs(1);

static OPERATOR: OnceLock<Outlet> = OnceLock::new();
static ENGINEER: OnceLock<Outlet> = OnceLock::new();

fn operator_outlet() -> &'static Outlet {
    OPERATOR.get_or_init(|| Outlet::start("told", Box::new(std::io::stdout())))
}

fn engineer_outlet() -> &'static Outlet {
    ENGINEER.get_or_init(|| Outlet::start("log", Box::new(std::io::stderr())))
}

/// Lines of both streams that were left out because nobody was reading.
#[must_use]
pub fn count_dropped_lines() -> u64 {
    [&OPERATOR, &ENGINEER].into_iter().filter_map(OnceLock::get).map(Outlet::dropped_lines).sum()
}

/// Returns when everything said so far is written, or soon after where a stream is not read.
pub fn flush() {
    [&OPERATOR, &ENGINEER].into_iter().filter_map(OnceLock::get).for_each(|outlet| outlet.flush(FLUSH_WITHIN));
}

/// The form of the engineer's log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// No engineer's log.
    Off,
    /// One line of text per event.
    Text,
    /// One JSON object per event.
    Json,
}

/// How serious a notice is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// Something happened as it should.
    Info,
    /// Something does not work; the box goes on.
    Warning,
    /// Something is lost or stops.
    Error,
}

impl Severity {
    /// The word stored in the history and printed in logs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// Something worth telling, in two texts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// Decides the level of the event in the engineer's log.
    pub severity: Severity,
    /// A stable word for filters: `source_lost`, `port_in_use`, ...
    pub code: &'static str,
    /// For the person at the machine: what happened, where, what to do next.
    pub operator: String,
    /// For the engineer: addresses, numbers, the error as it came.
    pub detail: String,
}

impl Notice {
    /// A notice whose detail is the same as its text.
    pub fn new(severity: Severity, code: &'static str, operator: impl Into<String>) -> Self {
        Self { severity, code, operator: operator.into(), detail: String::new() }
    }

    /// Adds the engineer's detail.
    #[must_use]
    pub fn with_detail(mut self, detail: impl Into<String>) -> Self {
        self.detail = detail.into();
        self
    }

    /// Prints both texts: a line with the time for the operator, an event for the engineer. Never waits for either stream.
    pub fn write_to_logs(&self) {
        let Self { code, operator, detail, .. } = self;
        let mark = if self.severity == Severity::Info { " " } else { "!" };
        self::operator_outlet().queue_line(format!("{} {mark} {operator}\n", clock_text()).into_bytes());
        match self.severity {
            Severity::Info => tracing::info!(code, detail, "{operator}"),
            Severity::Warning => tracing::warn!(code, detail, "{operator}"),
            Severity::Error => tracing::error!(code, detail, "{operator}"),
        }
    }
}

/// Does the journal of the system keep what is said to the operator? The service manager names the socket that it listens on.
#[must_use]
pub fn is_kept_by_journal() -> bool {
    let Some(named) = std::env::var("JOURNAL_STREAM").ok() else { return false };
    let is_named = |found: rustix::io::Result<rustix::fs::Stat>| {
        found.is_ok_and(|found| named == format!("{}:{}", found.st_dev, found.st_ino))
    };
    is_named(rustix::fs::fstat(std::io::stderr())) || is_named(rustix::fs::fstat(std::io::stdout()))
}

/// A line for the operator that must not stand in any log: a token that is shown once.
pub fn say_to_operator_alone(text: &str) {
    operator_outlet().queue_line(format!("{}   {text}\n", clock_text()).into_bytes());
}

/// One event of the engineer's log on its way to the outlet.
#[derive(Debug, Default)]
struct LogLine(Vec<u8>);

impl Write for LogLine {
    fn write(&mut self, part: &[u8]) -> std::io::Result<usize> {
        self.0.extend_from_slice(part);
        Ok(part.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Drop for LogLine {
    fn drop(&mut self) {
        if !self.0.is_empty() {
            engineer_outlet().queue_line(std::mem::take(&mut self.0));
        }
    }
}

/// The time of the box as `14:03:22Z`.
fn clock_text() -> String {
    crate::moment::format_utc(crate::clock::now_ns()).get(11..19).map_or_else(String::new, |time| format!("{time}Z"))
}

/// Starts the engineer's log. A second call in one process changes nothing.
pub fn start_engineer_log(format: LogFormat, level: Level) {
    let wanted = filter_fn(move |event| *event.level() <= level);
    let base = tracing_subscriber::fmt::layer().with_writer(LogLine::default).with_ansi(false);
    let layer = match format {
        LogFormat::Off => return,
        LogFormat::Text => base.with_filter(wanted).boxed(),
        LogFormat::Json => base.json().flatten_event(true).with_filter(wanted).boxed(),
    };
    let _already_started = tracing_subscriber::registry().with(layer).try_init();
}
