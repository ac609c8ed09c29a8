//! Reads everything that the user wrote - configuration, scripts, operations recipe, model, recordings - and tells everything that is
//! wrong, before a machine is involved.

use crate::config::{self, Config, Problem};
use crate::http::Certificate;
use crate::operations;
use crate::reload::read_directory;
use crate::sinks::broker::broker_files;
use adapters::address::{FanucBackend, NcLinkTarget, Target};
use adapters::recording::{RecordingError, read_path};
use adapters::words::{find_canonical_word, of_channel};
use rules::estimators::StateBasis;
use rules::estimators::thermal::ThermalModel;
use rules::{script, twin};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// What was read and what is wrong with it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Default)]
pub struct CheckReport {
    /// What was read, one line each.
    pub read: Vec<String>,
    /// Everything that is wrong, in the order in which it was found.
    pub problems: Vec<Problem>,
}

impl CheckReport {
    /// Whether no problem was found.
    #[must_use]
    pub fn is_fine(&self) -> bool {
        self.problems.is_empty()
    }
}

impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for line in &self.read {
            writeln!(f, "{line}")?;
        }
        for problem in &self.problems {
            writeln!(f, "{problem}")?;
        }
        match self.problems.len() {
            0 => writeln!(f, "nothing is wrong"),
            1 => writeln!(f, "1 problem"),
            count => writeln!(f, "{count} problems"),
        }
    }
}

/// Checks the file, or without one the built-in configuration, and everything it names.
#[must_use]
pub fn check_configuration(
    file: Option<&Path>,
    environment: impl IntoIterator<Item = (String, String)>,
) -> CheckReport {
    let mut report = CheckReport::default();
    match config::load(file, environment) {
        Ok(config) => {
            let name = file.map_or_else(|| config::BUILT_IN.to_owned(), |file| file.display().to_string());
            report.read.push(describe_config(&name, &config));
            report.read.extend(describe_reach(&config));
            check_certificate(&config, &mut report);
            check_scripts(&config, &mut report);
            check_operations(&config, &mut report);
            check_model(&config, &mut report);
            check_thermal(&config, &mut report);
            check_sources(&name, &config, &mut report);
            report.read.extend(state_basis(&name, &config));
            check_sinks(&name, &config, &mut report);
        }
        Err(problems) => report.problems = problems,
    }
    report
}

fn describe_config(name: &str, config: &Config) -> String {
    let sources: Vec<&str> = config.sources.iter().map(|source| source.name.as_str()).collect();
    let gate = match config.gate.mode {
        config::GateMode::Off => "the gate is off",
        config::GateMode::Shadow => "the gate decides and records, and writes nothing",
        config::GateMode::Armed => "the gate may be armed on the box",
    };
    let offsets = match config.gate.offset.mode {
        config::GateMode::Off => "",
        config::GateMode::Shadow => "; thermal offsets are decided about and not written",
        config::GateMode::Armed => "; thermal offsets may be armed on the box",
    };
    format!("{name}: reads {} at {} ticks per second; {gate}{offsets}", sources.join(", "), config.gateway.tick_hz)
}

/// What the state of the machine will be inferred from; `None` where that shows with the first values only. Nothing is connected
/// for it.
fn state_basis(name: &str, config: &Config) -> Option<String> {
    let mut channels = Vec::new();
    for source in &config.sources {
        // A stream listens as soon as it is opened.
        if matches!(source.address.target(), Target::Waveform { .. }) {
            return None;
        }
        let opened = adapters::open::open_address(&source.address, 0).ok()?;
        channels.extend(opened.sources.iter().flat_map(|source| source.channels().to_vec()));
    }
    Some(format!("{name}: {}", StateBasis::of_channels(|id| channels.contains(&id))))
}

/// What a page does that other computers can reach.
fn describe_reach(config: &Config) -> Option<String> {
    let http = &config.http;
    let arming = if http.allow_arming { "; the gate may be armed from it" } else { "" };
    // The configuration is refused where such a page would be open to all.
    let far = http.enabled && http.tokens_always && http.tls;
    far.then(|| format!("{}: the page is served over TLS, and asks everybody for a token{arming}", http.listen))
}

/// Certificate and key can be read and fit together.
fn check_certificate(config: &Config, report: &mut CheckReport) {
    let Some((certificate, key)) = config.http.certificate.as_ref().filter(|_| config.http.tls) else { return };
    match Certificate::read(certificate, key) {
        Ok(read) => report.read.push(format!("{}: SHA-256 {}", certificate.display(), read.fingerprint)),
        Err(error) => report.problems.push(Problem::in_file(certificate.display().to_string(), error.to_string(), "")),
    }
}

fn check_scripts(config: &Config, report: &mut CheckReport) {
    let directory = &config.scripts.directory;
    let shown = directory.display();
    let files = if directory.exists() {
        read_directory(directory)
    } else {
        report.read.push(format!("{shown}: not there yet; the first start writes the shipped scripts into it"));
        Ok(script::list_shipped_scripts())
    };
    let values = crate::settings::values_path(&config.gateway.data_dir);
    match files.and_then(|files| crate::reload::prepare_with_settings(&files, Some(&values))) {
        Ok(set) => {
            let trials = script::run_trials(&set).len();
            report.read.push(format!("{shown}: {} scripts, {trials} trials passed", set.len()));
            let chosen = set.values().list_values().count();
            if chosen > 0 {
                report.read.push(format!("{}: {chosen} settings chosen", values.display()));
            }
        }
        Err(problems) => report.problems.extend(problems.into_iter().map(|problem| with_full_path(directory, problem))),
    }
}

/// The name of the file as the user can open it.
fn with_full_path(directory: &Path, problem: script::ScriptProblem) -> Problem {
    let mut problem = Problem::from(problem);
    if directory.join(&problem.file).is_file() {
        problem.file = directory.join(&problem.file).display().to_string();
    }
    problem
}

fn check_operations(config: &Config, report: &mut CheckReport) {
    let Some(path) = &config.operations.path else { return };
    match operations::read(path) {
        Ok(loaded) => {
            let (count, version) = (loaded.recipe.operations().len(), loaded.recipe.version());
            report.read.push(format!("{}: {count} operations, version {version}", path.display()));
        }
        Err(problems) => report.problems.extend(problems.into_iter().map(Problem::from)),
    }
}

fn check_model(config: &Config, report: &mut CheckReport) {
    let Some(path) = &config.twin.model else { return };
    let name = path.display().to_string();
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) => {
            let next = "`model` under [twin] names it; `identify` writes one";
            return report.problems.push(Problem::in_file(name, format!("the model cannot be read: {error}"), next));
        }
    };
    match twin::parse_model(&text) {
        Ok(model) => report.read.push(format!("{name}: a model of {} effects", model.parts.len())),
        Err(problems) => report.problems.extend(problems.into_iter().map(|problem| Problem {
            file: name.clone(),
            line: Some(problem.line),
            column: None,
            what: problem.text,
            next: String::new(),
        })),
    }
}

fn check_thermal(config: &Config, report: &mut CheckReport) {
    let Some(path) = &config.thermal.model else { return };
    let name = path.display().to_string();
    let read = std::fs::read_to_string(path)
        .map_err(|error| format!("the thermal law cannot be read: {error}"))
        .and_then(|text| ThermalModel::read(&text, &config.gateway.machine.name));
    match read {
        Ok(model) => report.read.push(format!("{name}: a thermal law of {} terms", model.law.terms.len())),
        Err(what) => {
            let next = "`model` under [thermal] names it; `identify thermal --model` writes one";
            report.problems.push(Problem::in_file(name, what, next));
        }
    }
}

/// The files that the addresses of the sinks name.
fn check_sinks(name: &str, config: &Config, report: &mut CheckReport) {
    for sink in &config.sinks {
        let problems = sink.address.find_file_problems();
        if problems.is_empty() {
            report
                .read
                .push(format!("{name}: sends to {}; `cnc-gateway doctor` with this address connects", sink.address));
        }
        let line = match sink.address.is_secured() {
            true => "whoever may publish there",
            false => "whoever reaches the line, which is not encrypted,",
        };
        for (allowed, what, may) in [
            (sink.allow_requests, "requests", "ask the gate for a slower feed and acknowledge alarms"),
            (sink.allow_facts, "facts", "tell orders, scrap, reasons of stops, persons and planned time"),
        ] {
            if allowed {
                report.read.push(format!("{name}: sink {} takes {what}: {line} may {may}", sink.name));
            }
        }
        let problem = |(what, next)| Problem::in_file(name, format!("sink {}: {what}", sink.name), next);
        report.problems.extend(problems.into_iter().map(problem));
    }
}

/// The files that the address of a broker names.
fn check_broker(name: &str, source: &str, target: &NcLinkTarget, report: &mut CheckReport) {
    for (what, next) in broker_files(target.tls.as_ref(), &target.login) {
        report.problems.push(Problem::in_file(name, format!("source {source}: {what}"), next));
    }
}

fn check_sources(name: &str, config: &Config, report: &mut CheckReport) {
    for source in &config.sources {
        match source.address.target() {
            Target::Replay(replay) => check_recording(&replay.file, report),
            Target::Fanuc { backend: FanucBackend::Vendor(library), .. } => check_library(library, report),
            Target::NcLink(target) => check_broker(name, &source.name, target, report),
            Target::HncNet(target) => check_library(&target.vendor_library, report),
            _ => {}
        }
    }
}

fn check_library(path: &Path, report: &mut CheckReport) {
    if !path.is_file() {
        let next =
            "`library=` in the address names it; the machine's maker delivers it, it cannot come with the gateway";
        report.problems.push(Problem::in_file(path.display().to_string(), "the vendor library is not there", next));
    }
}

/// Words that a channel cannot have: the gate holds everything while one stands, and no rule that asks for the right one fires.
fn unknown_words(name: &str, recording: &adapters::Recording) -> Vec<Problem> {
    let channels = ["mode", "execution"].into_iter().filter_map(|channel| Some((channel, of_channel(channel)?)));
    let unknown = channels.flat_map(|(channel, known)| {
        let words = recording.find_words(channel).map(|words| words.words().to_vec()).unwrap_or_default();
        words.into_iter().filter(move |word| find_canonical_word(channel, word).is_none()).map(move |word| {
            let next = format!("write one of {}", known.join(", "));
            Problem::in_file(name, format!("{channel} is never {word:?}: the gate holds 100 % while it is"), next)
        })
    });
    unknown.collect()
}

fn check_recording(path: &Path, report: &mut CheckReport) {
    let name = path.display().to_string();
    let row = |problem: adapters::recording::RowProblem| Problem {
        file: name.clone(),
        line: usize::try_from(problem.line).ok(),
        column: None,
        what: problem.column.map_or_else(String::new, |column| format!("{column}: ")) + problem.reason.as_str(),
        next: String::new(),
    };
    match read_path(path) {
        Ok(read) => {
            let rows = read.recording.count_rows();
            report.read.push(format!("{name}: {rows} rows, {} refused", read.refused));
            let described = read.problems.len() as u64;
            report.problems.extend(read.problems.into_iter().map(row));
            report.problems.extend(unknown_words(&name, &read.recording));
            if read.refused > described {
                let what = format!("{} more rows are refused", read.refused - described);
                report.problems.push(Problem::in_file(name, what, "the first of them are told above"));
            }
        }
        Err(RecordingError::Io { error, .. }) => {
            report.problems.push(Problem::in_file(
                name,
                format!("the recording cannot be read: {error}"),
                "look at the path",
            ));
        }
        Err(RecordingError::Header { line, reason, .. }) => {
            let line = usize::try_from(line).ok();
            report.problems.push(Problem { line, ..Problem::in_file(name.clone(), reason.en, "") });
        }
        Err(RecordingError::Format { reason, .. }) => {
            report.problems.push(Problem::in_file(name.clone(), reason.en, ""))
        }
        Err(RecordingError::Empty { problems, .. }) => {
            report.problems.push(Problem::in_file(name.clone(), "the recording has no usable row", ""));
            report.problems.extend(problems.into_iter().map(row));
        }
    }
}
