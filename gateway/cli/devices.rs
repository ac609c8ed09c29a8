//! `cnc-gateway devices`: the `devices.xml` of this machine for an MTConnect agent.

use super::{CannotRun, CommandOutcome, CommandResult, print_text};
use crate::history::{Query, Reader, box_id};
use crate::sinks::shdr::{Described, devices_xml, is_prefix, prefix_of};
use crate::{clock, config, moment};
use clap::Args;
use gateway_base::machine_path::MachinePath;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct DevicesArguments {
    /// Configuration file; without one the built-in configuration.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Write it there instead of printing it.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// What every identifier begins with, so that several machines can stand in one agent; default: the path of the machine, or the digits of the box.
    #[arg(long, value_name = "TEXT")]
    prefix: Option<String>,
    /// The file that this command wrote for another machine, which stands in the same agent; can be given several times.
    #[arg(long = "with", value_name = "FILE")]
    others: Vec<PathBuf>,
}

/// Prints or writes the document. Where the machine has been read already, it holds what the machine delivers; before that,
/// everything that the gateway knows.
pub(super) fn run(arguments: &DevicesArguments) -> CommandResult {
    let environment =
        std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    let config = config::load(arguments.config.as_deref(), environment).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        CannotRun::new(lines.join("\n"), "")
    })?;
    let path = &config.history.path;
    let machine = &config.gateway.machine;
    let box_id = box_id(path, &machine.name)
        .map_err(|error| CannotRun::new(format!("the history gives the machine no identity: {error}"), ""))?;
    let prefix = arguments.prefix.clone().unwrap_or_else(|| prefix_of(machine.path.as_ref(), &box_id));
    if !is_prefix(&prefix) {
        return Err(CannotRun::new(
            format!("{prefix:?} is no beginning of an identifier"),
            "write a letter, then letters, digits and _",
        ));
    }
    let device = machine.path.as_ref().map_or(box_id, MachinePath::format_dotted);
    let delivered = read_delivered_channels(path);
    let created = moment::format_utc(clock::now_ns());
    let known = |channel: &str| delivered.as_ref().is_none_or(|names| names.contains(channel));
    let others = arguments.others.iter().map(|file| read(file)).collect::<Result<Vec<_>, _>>()?;
    let described = Described { machine: &machine.name, device: &device, prefix: &prefix };
    let text = devices_xml(described, &created, known, &others).map_err(CannotRun::from_error)?;
    match &arguments.out {
        None => print_text(&text),
        Some(file) => std::fs::write(file, text).map_err(|error| {
            CannotRun::new(format!("{} cannot be written: {error}", file.display()), "choose another place")
        })?,
    }
    Ok(CommandOutcome::Fine)
}

fn read(file: &Path) -> Result<(String, String), CannotRun> {
    let name = file.display().to_string();
    match std::fs::read_to_string(file) {
        Ok(text) => Ok((name, text)),
        Err(error) => Err(CannotRun::new(format!("{name} cannot be read: {error}"), "write the path of a devices.xml")),
    }
}

/// The channels of which the history holds something; `None` before there is one.
fn read_delivered_channels(path: &Path) -> Option<BTreeSet<String>> {
    let reader = Reader::open(path).ok()?;
    let (_, newest_ns) = reader.read_present_span().ok()??;
    let query = Query { from_ns: Some(newest_ns - 3_600_000_000_000), ..Query::default() };
    let mut names = BTreeSet::new();
    let read = reader.for_each_chunk(&query, |chunk| {
        names.extend(chunk.series.iter().map(|series| series.name.to_string()));
        std::ops::ControlFlow::Continue(())
    });
    read.ok().filter(|_| !names.is_empty()).map(|_| names)
}
