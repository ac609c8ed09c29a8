//! `cnc-gateway run`: the box, live.

use super::installation::note_data_dir;
use super::{CannotRun, CommandOutcome, CommandResult, LogArguments};
use crate::config::{self, OptionValue};
use crate::demo;
use crate::run::{self, RunPlan};
use crate::sources::open::MachineSpeed;
use clap::Args;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct RunArguments {
    /// Configuration file; without one the embedded simulated lathe runs.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Directory of everything the box writes.
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// Address and port of the live page; port 0 takes a free one.
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<SocketAddr>,
    /// Machine time over real time, or max: simulated machines and recordings only.
    #[arg(long, value_name = "N|max", value_parser = parse_speed, default_value = "1")]
    speed: MachineSpeed,
    /// End after so many seconds of machine time.
    #[arg(long = "for", value_name = "SECONDS", value_parser = parse_seconds)]
    seconds: Option<f64>,
}

fn parse_speed(text: &str) -> Result<MachineSpeed, String> {
    if text == "max" {
        return Ok(MachineSpeed::Max);
    }
    match text.parse::<f64>() {
        Ok(1.0) => Ok(MachineSpeed::Real),
        Ok(times) if (0.01..=10_000.0).contains(&times) => Ok(MachineSpeed::Times(times)),
        _ => Err("give a factor from 0.01 to 10000, or max".to_owned()),
    }
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e9 => Ok(seconds),
        _ => Err("give a number of seconds above 0".to_owned()),
    }
}

/// Runs the box until it is told to stop.
pub(super) fn run(arguments: RunArguments, log: LogArguments) -> CommandResult {
    let plan = build_plan(arguments)?;
    note_data_dir(&plan.config.gateway.data_dir);
    log.start_log(&plan.config.log);
    run::run(plan)?;
    Ok(CommandOutcome::Fine)
}

fn build_plan(arguments: RunArguments) -> Result<RunPlan, CannotRun> {
    let options = collect_options(&arguments);
    // A person at the command line is told at once. A service polls, stores and writes whatever the page cannot open, and tries again.
    let port_named = arguments.listen.is_some();
    // A variable that an option goes before is not looked at: a wrong one does not matter.
    let variable =
        |given: &OptionValue| format!("{}{}__{}", config::ENVIRONMENT_PREFIX, given.section, given.key).to_uppercase();
    let own = |name: &str| options.iter().any(|given| variable(given) == name);
    let environment =
        std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    let variables: Vec<_> = environment.filter(|(name, _)| !own(name)).collect();
    let config = match arguments.config.as_deref() {
        Some(path) => config::load_with(Some(path), variables, &options),
        None => {
            let text = demo::config_text(arguments.speed);
            config::parse_with(config::BUILT_IN, &text, Path::new(""), variables, &options)
        }
    };
    let mut config = config.map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        CannotRun::new(lines.join("\n"), "")
    })?;
    if arguments.config.is_none() {
        demo::install_data(&mut config, arguments.speed);
    }
    Ok(RunPlan {
        config,
        config_file: arguments.config,
        port_named,
        speed: arguments.speed,
        stop_after_s: arguments.seconds,
    })
}

/// Options go before the environment and the file.
fn collect_options(arguments: &RunArguments) -> Vec<OptionValue> {
    let directory = arguments.data_dir.as_ref().map(|directory| {
        let absolute = std::path::absolute(directory).unwrap_or_else(|_| directory.clone());
        OptionValue { option: "--data-dir", section: "gateway", key: "data_dir", value: absolute.display().to_string() }
    });
    let listen = arguments.listen.map(|listen| OptionValue {
        option: "--listen",
        section: "http",
        key: "listen",
        value: listen.to_string(),
    });
    directory.into_iter().chain(listen).collect()
}
