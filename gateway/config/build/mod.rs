//! From checked values to the configuration, and the rules that concern more than one key.

mod backup;
mod http;
mod thermal;

use super::check_value::Scalar;
use super::outputs;
use super::read::{ConfigInput, LocatedValue, Origin, SectionValues};
use super::{
    AlignmentConfig, AlignmentUse, Config, GateConfig, GateMode, GatewayConfig, HistoryConfig, LogConfig, OffsetConfig,
    OperationsConfig, ScriptsConfig, SourceConfig, TwinConfig, channels, stand_in,
};
use adapters::Axis;
use adapters::address::{Target, WriteMethod};
use adapters::channel::find_nearest_name;
use gateway_base::log::LogFormat;
use gateway_base::machine_path::{MachinePath, NamedMachine, WORD_FORM};
use rules::physics::explain::Language;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The configuration, or `None` where a value is missing; the problem has been reported then.
pub(super) fn build_config(reading: &mut ConfigInput<'_>, base: &Path) -> Option<Config> {
    let sources: Option<Vec<SourceConfig>> = reading.sources.iter().map(source).collect();
    check_names(reading);
    check_gate(reading);
    http::check_http(reading);
    backup::check_backup(reading);
    let sources = sources.map(|mut sources| {
        let written = reading.sources.clone();
        sources.iter_mut().zip(&written).for_each(|(source, values)| channels::add(reading, source, values));
        let each = sources.iter_mut().zip(&written).enumerate();
        each.for_each(|(position, (source, values))| stand_in::add(reading, source, values, position));
        sources
    });
    let machine = build_machine(reading);
    let sinks = outputs::build_sinks(reading);
    let outbox = outputs::build_outbox(reading);
    let gateway = build_gateway(reading, machine?, base)?;
    let in_force = super::in_force::in_force(reading);
    Some(Config {
        in_force,
        alignment: AlignmentConfig {
            spindle_power: alignment_use(&find_text(reading, "alignment", "spindle_power")?),
            total_power: alignment_use(&find_text(reading, "alignment", "total_power")?),
        },
        scripts: build_scripts(reading, &gateway.data_dir)?,
        operations: OperationsConfig { path: find_text(reading, "operations", "path").map(|path| base.join(path)) },
        gate: build_gate(reading)?,
        history: build_history(reading, &gateway.data_dir)?,
        sinks: sinks?,
        outbox: outbox?,
        http: http::build_http(reading, base)?,
        twin: TwinConfig { model: find_text(reading, "twin", "model").map(|path| base.join(path)) },
        thermal: thermal::build_thermal(reading, base)?,
        backup: backup::read_backup(reading, base)?,
        log: build_log(reading)?,
        gateway,
        sources: sources?,
    })
}

fn alignment_use(word: &str) -> AlignmentUse {
    match word {
        "off" => AlignmentUse::Off,
        "merge" => AlignmentUse::Merge,
        _ => AlignmentUse::Show,
    }
}

fn build_log(reading: &ConfigInput<'_>) -> Option<LogConfig> {
    let format = match find_text(reading, "log", "format")?.as_str() {
        "text" => LogFormat::Text,
        "json" => LogFormat::Json,
        _ => LogFormat::Off,
    };
    // The words of the key are those of the levels.
    Some(LogConfig { level: find_text(reading, "log", "level")?.parse().ok()?, format })
}

/// The machine by its name, and by its path where one is written.
fn build_machine(reading: &mut ConfigInput<'_>) -> Option<NamedMachine> {
    let name = find_text(reading, "gateway", "name")?;
    let origin = |key: &str| reading.get("gateway", key).map_or(Origin::Default, |found| found.origin.clone());
    let (at_path, at_machine) = (origin("path"), origin("machine"));
    let word = find_text(reading, "gateway", "machine");
    let Some(above) = find_text(reading, "gateway", "path") else {
        if word.is_some() {
            let next = "write path = \"shanghai/line-2\" beside it, or leave it out";
            reading.add_problem(&at_machine, "`machine` is there without `path`", next);
        }
        return Some(NamedMachine { name, path: None });
    };
    let path = MachinePath::new(&above, &word.unwrap_or_else(|| name.replace(' ', "-")));
    if path.is_err() {
        let what = format!("`name` is {name:?}, which cannot be the last word of a path");
        reading.add_problem(&at_path, what, format!("write machine = \"lathe-7\" under [gateway]: {WORD_FORM}"));
    }
    path.ok().map(|path| NamedMachine { name, path: Some(path) })
}

fn build_gateway(reading: &ConfigInput<'_>, machine: NamedMachine, base: &Path) -> Option<GatewayConfig> {
    Some(GatewayConfig {
        machine,
        tick_hz: find_number(reading, "gateway", "tick_hz")?,
        clock_confirm: find_seconds(reading, "gateway", "clock_confirm_s")?,
        language: match find_text(reading, "gateway", "language")?.as_str() {
            "en" => Some(Language::En),
            "zh" => Some(Language::Zh),
            _ => None,
        },
        data_dir: base.join(find_text(reading, "gateway", "data_dir")?),
    })
}

fn build_scripts(reading: &ConfigInput<'_>, data_dir: &Path) -> Option<ScriptsConfig> {
    Some(ScriptsConfig {
        directory: data_dir.join(find_text(reading, "scripts", "directory")?),
        reload: find_flag(reading, "scripts", "reload")?,
    })
}

fn build_gate(reading: &ConfigInput<'_>) -> Option<GateConfig> {
    Some(GateConfig {
        mode: parse_mode(&find_text(reading, "gate", "mode")?),
        source: find_text(reading, "gate", "source"),
        min_pct: find_number(reading, "gate", "min_pct")?,
        max_pct: find_number(reading, "gate", "max_pct")?,
        slew_up_pct_per_s: find_number(reading, "gate", "slew_up_pct_per_s")?,
        slew_down_pct_per_s: find_number(reading, "gate", "slew_down_pct_per_s")?,
        above_dial: find_flag(reading, "gate", "above_dial")?,
        dead_band_pct: find_number(reading, "gate", "dead_band_pct")?,
        min_interval: find_seconds(reading, "gate", "min_interval_s")?,
        heartbeat: find_seconds(reading, "gate", "heartbeat_s")?,
        stale: find_seconds(reading, "gate", "stale_s")?,
        armed_for: find_seconds(reading, "gate", "armed_for_s")?,
        offset: build_offset(reading)?,
    })
}

fn build_offset(reading: &ConfigInput<'_>) -> Option<OffsetConfig> {
    const SECTION: &str = "gate.offset";
    Some(OffsetConfig {
        mode: parse_mode(&find_text(reading, SECTION, "mode")?),
        source: find_text(reading, SECTION, "source").or_else(|| find_text(reading, "gate", "source")),
        axes: parse_axes(&find_text(reading, SECTION, "axes").unwrap_or_default()).unwrap_or_default(),
        step_um: find_number(reading, SECTION, "step_um")?,
        total_um: find_number(reading, SECTION, "total_um")?,
        min_interval: find_seconds(reading, SECTION, "min_interval_s")?,
        restore: find_text(reading, SECTION, "on_disarm")? == "restore",
    })
}

/// A word that names no axis.
struct UnknownAxis(String);

/// `x z` or `x,z`, each once.
fn parse_axes(text: &str) -> Result<Vec<Axis>, UnknownAxis> {
    let words = text.split([' ', ',']).filter(|word| !word.is_empty());
    let mut axes = words
        .map(|word| Axis::from_word(word).ok_or_else(|| UnknownAxis(word.to_owned())))
        .collect::<Result<Vec<_>, _>>()?;
    axes.sort_unstable();
    axes.dedup();
    Ok(axes)
}

fn parse_mode(word: &str) -> GateMode {
    match word {
        "off" => GateMode::Off,
        "armed" => GateMode::Armed,
        _ => GateMode::Shadow,
    }
}

fn build_history(reading: &ConfigInput<'_>, data_dir: &Path) -> Option<HistoryConfig> {
    Some(HistoryConfig {
        path: data_dir.join(PathBuf::from(find_text(reading, "history", "path")?)),
        retention_days: find_number(reading, "history", "retention_days")?,
        max_gb: find_number(reading, "history", "max_gb")?,
        commit: find_seconds(reading, "history", "commit_s")?,
    })
}

fn source(values: &SectionValues) -> Option<SourceConfig> {
    let number = |key| values.found.get(key).and_then(as_number);
    let address = values.found.get("address").and_then(as_text)?.parse().ok()?;
    Some(SourceConfig {
        name: source_name(values)?,
        address,
        period: number("period_s").map(Duration::from_secs_f64),
        deadline: Duration::from_secs_f64(number("deadline_s")?),
        stand_in: Vec::new(),
    })
}

pub(super) fn source_name(values: &SectionValues) -> Option<String> {
    let named = |key| values.found.get(key).and_then(as_text).map(str::to_owned);
    named("name").or_else(|| named("address"))
}

/// Sources exist and have different names.
fn check_names(reading: &mut ConfigInput<'_>) {
    if reading.sources.is_empty() {
        let next = "write [[source]] with address = \"simulated://lathe\" to begin with";
        return reading.add_problem(&Origin::Default, "there is no source to read", next);
    }
    let names: Vec<Option<String>> = reading.sources.iter().map(source_name).collect();
    for (index, name) in names.iter().enumerate().filter(|(_, name)| name.is_some()) {
        if names[..index].contains(name) {
            let origin = origin_of_name(&reading.sources[index]);
            let what = format!("there are two sources named {:?}", name.clone().unwrap_or_default());
            reading.add_problem(&origin, what, "give each [[source]] its own `name`");
        }
    }
}

pub(super) fn origin_of_name(values: &SectionValues) -> Origin {
    let found = values.found.get("name").or_else(|| values.found.get("address"));
    found.map_or(Origin::Default, |found| found.origin.clone())
}

/// What is armed has somewhere to write to.
fn check_gate(reading: &mut ConfigInput<'_>) {
    check_offsets(reading);
    let armed = find_text(reading, "gate", "mode").as_deref() == Some("armed");
    let origin = |key: &str| reading.get("gate", key).map_or(Origin::Default, |found| found.origin.clone());
    let names: Vec<String> = reading.sources.iter().filter_map(source_name).collect();
    match find_text(reading, "gate", "source") {
        None if armed => {
            let (at, next) =
                (origin("mode"), format!("write source = ... under [gate]; there is {}", quote_names(&names)));
            reading.add_problem(&at, "the gate may be armed, but `source` does not say what it writes to", next);
        }
        Some(name) => {
            check_source(reading, &names, &name, &origin("source"));
            if armed {
                check_dial(reading, &name);
            }
        }
        None => {}
    }
}

/// A machine whose feed override may be written tells where its operator's dial stands: only then can nothing above it be
/// asked for, and a ladder that replaces the dial be found out.
fn check_dial(reading: &mut ConfigInput<'_>, name: &str) {
    let target = reading.sources.iter().find(|values| source_name(values).as_deref() == Some(name));
    let Some(found) = target.and_then(|values| values.found.get("address")) else { return };
    let address = as_text(found).and_then(|text| text.parse::<adapters::Address>().ok());
    let origin = found.origin.clone();
    if address.is_some_and(|address| lacks_dial(address.target())) {
        let what = "the gate may be armed, but the address does not name the byte in which the operator's dial stands";
        let next = "add dial=R907, or whichever byte the ladder copies the dial to (see the handbook, chapter gate)";
        reading.add_problem(&origin, what, next);
    }
}

/// With a second override or a macro variable G012 is the dial and counts whatever is written.
fn lacks_dial(target: &Target) -> bool {
    let Target::Fanuc { options, .. } = target else { return false };
    options.dial.is_none() && matches!(options.write, WriteMethod::Mailbox { .. } | WriteMethod::Direct)
}

/// There is a source of this name.
fn check_source(reading: &mut ConfigInput<'_>, names: &[String], name: &str, at: &Origin) {
    if names.iter().any(|known| known == name) || names.is_empty() {
        return;
    }
    let next = match find_nearest_name(name, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean {near:?}?"),
        None => format!("there is {}", quote_names(names)),
    };
    reading.add_problem(at, format!("no source is named {name:?}"), next);
}

/// What may shift an axis says which one, and where.
fn check_offsets(reading: &mut ConfigInput<'_>) {
    const SECTION: &str = "gate.offset";
    let origin = |reading: &ConfigInput<'_>, key: &str| {
        reading.get(SECTION, key).map_or(Origin::Default, |found| found.origin.clone())
    };
    let on = find_text(reading, SECTION, "mode").is_some_and(|mode| mode != "off");
    let (at_mode, at_axes) = (origin(reading, "mode"), origin(reading, "axes"));
    match parse_axes(&find_text(reading, SECTION, "axes").unwrap_or_default()) {
        Err(UnknownAxis(word)) => {
            let next = "write \"x\", \"y\", \"z\", or several: \"x z\"";
            reading.add_problem(&at_axes, format!("`axes` names {word:?}, which is no axis"), next);
        }
        Ok(axes) if axes.is_empty() && on => {
            let next = "write axes = \"z\" under [gate.offset]";
            reading.add_problem(&at_mode, "offsets are to be decided about, but `axes` names none", next);
        }
        Ok(_) => {}
    }
    let names: Vec<String> = reading.sources.iter().filter_map(source_name).collect();
    let at = origin(reading, "source");
    if let Some(name) = find_text(reading, SECTION, "source") {
        check_source(reading, &names, &name, &at);
    } else if find_text(reading, SECTION, "mode").as_deref() == Some("armed")
        && find_text(reading, "gate", "source").is_none()
    {
        let next = format!("write source = ... under [gate.offset]; there is {}", quote_names(&names));
        reading.add_problem(&at_mode, "offsets may be written, but `source` does not say where to", next);
    }
    check_single_target(reading, &at);
}

/// Override and offset go to one machine: what holds the gate back (mode, alarm, switches) is taken from the machine that is written
/// to, and there is one such set of values.
fn check_single_target(reading: &mut ConfigInput<'_>, at: &Origin) {
    let target = |section: &str| {
        let armed = find_text(reading, section, "mode").as_deref() == Some("armed");
        find_text(reading, section, "source").filter(|_| armed)
    };
    let (Some(overrides), Some(offsets)) = (target("gate"), target("gate.offset")) else { return };
    if overrides != offsets {
        let what = format!(
            "offsets would be written to {offsets:?} and the feed override to {overrides:?}: a gateway writes to one machine"
        );
        let next =
            format!("write source = {overrides:?} under [gate.offset], or run a second gateway for the other machine");
        reading.add_problem(at, what, next);
    }
}

fn quote_names(names: &[String]) -> String {
    names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ")
}

pub(super) fn as_text(found: &LocatedValue) -> Option<&str> {
    match &found.value {
        Scalar::Text(text) => Some(text),
        _ => None,
    }
}

fn as_number(found: &LocatedValue) -> Option<f64> {
    match found.value {
        Scalar::Number(number) => Some(number),
        _ => None,
    }
}

pub(super) fn find_text(reading: &ConfigInput<'_>, section: &str, key: &str) -> Option<String> {
    reading.get(section, key).and_then(as_text).map(str::to_owned)
}

pub(super) fn find_number(reading: &ConfigInput<'_>, section: &str, key: &str) -> Option<f64> {
    reading.get(section, key).and_then(as_number)
}

pub(super) fn find_seconds(reading: &ConfigInput<'_>, section: &str, key: &str) -> Option<Duration> {
    find_number(reading, section, key).map(Duration::from_secs_f64)
}

pub(super) fn find_flag(reading: &ConfigInput<'_>, section: &str, key: &str) -> Option<bool> {
    match reading.get(section, key).map(|found| &found.value) {
        Some(Scalar::Flag(flag)) => Some(*flag),
        _ => None,
    }
}
