//! `cnc-gateway doctor ADDRESS`: who is there, what it answers, how long that takes, what is wrong and what to do next.

use super::doctor_words::ReportWords;
use super::lang::language;
use super::{CannotRun, CommandOutcome, CommandResult, print_json, print_text};
use crate::config;
use crate::doctor::{self, DoctorReport, SystemFiles};
use crate::sinks::{self, SinkAddress};
use adapters::Address;
use adapters::address::AddressError;
use adapters::driver::FactValue;
use clap::Args;
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct DoctorArguments {
    /// The address, as in the configuration, for example fanuc://10.0.0.5:8193; with --config the name of a source.
    #[arg(required_unless_present = "computer")]
    address: Option<String>,
    /// Examine the computer that the gateway runs on instead: disk, clock, temperature, memory, real-time priority.
    #[arg(id = "computer", long = "box", conflicts_with = "compare")]
    computer: bool,
    /// Directory of the data of the box, with --box.
    #[arg(long, value_name = "DIR", default_value = ".", requires = "computer")]
    data_dir: PathBuf,
    /// Look the source up in this configuration, by its name or address, and read its own channels too.
    #[arg(long, value_name = "FILE", conflicts_with = "compare")]
    config: Option<PathBuf>,
    /// Read a FANUC controller through this library of the vendor's too, and list where the two differ.
    #[arg(long, value_name = "LIBRARY")]
    compare: Option<PathBuf>,
    /// List everything that the device offers too, and which channel takes it: for channels of your own.
    #[arg(long, conflicts_with = "compare")]
    all: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints the report. Exit code 0 reachable without problems, 1 with problems, 2 unusable address.
pub(super) fn run_doctor(arguments: &DoctorArguments) -> CommandResult {
    let unusable = |text| CannotRun::new(text, "");
    let Some(address) = &arguments.address else { return Ok(examine_box(arguments)) };
    if SinkAddress::is_one(address) {
        return examine_sink(address, arguments.json);
    }
    let Some(library) = &arguments.compare else {
        let address = match &arguments.config {
            Some(file) => find_configured_address(file, address)?,
            None => address.parse().map_err(|error: AddressError| unusable(error.to_string()))?,
        };
        let report = if arguments.all { doctor::examine_all(&address) } else { doctor::examine_address(&address) };
        let report = report.map_err(|error| unusable(error.to_string()))?;
        if arguments.json {
            print_json(&report.to_json())
        } else {
            print_text(&format_report(&report))
        }
        return Ok(to_outcome(report.problems.is_empty()));
    };
    let comparison = doctor::compare_backends(address, library).map_err(|error| unusable(error.to_string()))?;
    if arguments.json {
        print_json(&comparison.to_json());
    } else {
        let lines = comparison.format_lines().join("\n");
        print_text(&format!(
            "{}{}comparison\n{lines}\n",
            format_report(&comparison.ours),
            format_report(&comparison.theirs)
        ));
    }
    Ok(to_outcome(comparison.is_well()))
}

fn examine_box(arguments: &DoctorArguments) -> CommandOutcome {
    let report = doctor::examine_computer(&SystemFiles::default(), &arguments.data_dir);
    if arguments.json {
        print_json(&report.to_json());
    } else {
        let words = ReportWords(language());
        let mut text = format!("{}\n", words.select("this computer", "本机"));
        for fact in &report.facts {
            let value = match &fact.value {
                FactValue::Number(number) => number.to_string(),
                FactValue::Text(text) => words.translate_phrases(text),
            };
            // Writing to a string does not fail.
            let _ = writeln!(text, "  {}: {value}", words.translate_phrases(&fact.name));
        }
        for problem in &report.problems {
            let _ = writeln!(text, "{}", words.format_problem(&problem.what, &problem.next));
        }
        print_text(&text);
    }
    to_outcome(report.problems.is_empty())
}

fn examine_sink(address: &str, json: bool) -> CommandResult {
    let address: SinkAddress = address.parse().map_err(|error| CannotRun::new(format!("{error}"), ""))?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| CannotRun::new(format!("no threads: {error}"), ""))?;
    let found = runtime.block_on(sinks::doctor::examine_sink(&address));
    if json {
        print_json(&found.to_json(&address));
    } else {
        print_text(&format_sink(&address, &found));
    }
    Ok(to_outcome(found.error.is_none()))
}

/// Address, reachability, time and problem in lines for a person.
fn format_sink(address: &SinkAddress, found: &sinks::doctor::SinkFinding) -> String {
    let words = ReportWords(language());
    let ms = found.connected_ms;
    let Some(error) = &found.error else {
        let well = format!("takes what the box sends; connected in {ms:.1} ms");
        return format!(
            "{address}\n  {}\n",
            words.0.select_text(well, format!("可接收网关发送的内容；连接用时 {ms:.1} ms"))
        );
    };
    let (what, next) = error.as_parts();
    format!("{address}\n  {}\n{}\n", words.select("takes nothing", "不接收"), words.format_problem(what, next))
}

/// The address of the source of this name in a configuration.
fn find_configured_address(file: &Path, wanted: &str) -> Result<Address, CannotRun> {
    let config = config::load(Some(file), []).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        CannotRun::new(lines.join("\n"), "")
    })?;
    let found = config.sources.iter().find(|source| source.name == wanted || source.address.text() == wanted);
    found.map(|source| source.address.clone()).ok_or_else(|| {
        let names: Vec<&str> = config.sources.iter().map(|source| source.name.as_str()).collect();
        let next = format!("its sources are {}", names.join(", "));
        CannotRun::new(format!("{} has no source {wanted}", file.display()), next)
    })
}

fn to_outcome(well: bool) -> CommandOutcome {
    if well { CommandOutcome::Fine } else { CommandOutcome::No }
}

/// What the device offers, what nobody takes at the end.
fn write_offers(report: &DoctorReport, line: &mut impl FnMut(std::fmt::Arguments<'_>)) {
    let words = ReportWords(language());
    let Some(offers) = &report.offers else { return };
    if offers.is_empty() {
        return line(format_args!(
            "  {}",
            words.select("a device of this kind does not tell what else it offers", "此类设备不报告其它可读数据")
        ));
    }
    line(format_args!(
        "  {}",
        words.select(
            "offers (the name behind `read =` makes a channel of what nobody takes):",
            "可读数据（未被使用的，可用 `read =` 后的名称建立通道）："
        )
    ));
    let (taken, free): (Vec<_>, Vec<_>) = offers.iter().partition(|offer| offer.channel.is_some());
    for offer in taken.into_iter().chain(free) {
        let says = match &offer.says {
            Ok(says) => says.clone(),
            Err(why) => format!("- ({why})"),
        };
        let channel = offer.channel.map_or_else(String::new, |channel| format!(" -> {channel}"));
        line(format_args!("    {}{channel}: {says}", offer.name));
    }
}

fn format_report(report: &DoctorReport) -> String {
    let words = ReportWords(language());
    let mut text = format!("{}\n", report.address);
    let mut line = |what: std::fmt::Arguments<'_>| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{what}");
    };
    let answer = if report.reachable {
        words.select("answers", "有应答")
    } else {
        words.select("does not answer", "无应答")
    };
    line(format_args!("  {answer}"));
    for fact in &report.identity {
        match &fact.value {
            FactValue::Number(number) => line(format_args!("  {}: {number}", fact.name)),
            FactValue::Text(text) => line(format_args!("  {}: {text}", fact.name)),
        }
    }
    let (open_ms, read_ms) = (report.open_ms, report.read_ms);
    line(format_args!(
        "{}",
        words.0.select_text(
            format!("  opened and read in {open_ms:.1} ms, read again in {read_ms:.1} ms"),
            format!("  打开并读取用时 {open_ms:.1} ms，再次读取 {read_ms:.1} ms"),
        )
    ));
    for (channel, value) in &report.readings {
        let name = words.name_channel(channel.channel());
        match value {
            Ok(value) => line(format_args!("    {name:<26} {value}")),
            Err(missing) => line(format_args!("    {name:<26} - ({missing})")),
        }
    }
    write_offers(report, &mut line);
    for problem in &report.problems {
        line(format_args!("{}", words.format_problem(&problem.what, &problem.next)));
    }
    text
}
