//! `cnc-gateway run`: the box, live.

use super::installation::note_data_dir;
use super::{CannotRun, CommandOutcome, CommandResult, LogArguments};
use crate::config;
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
    let overrides = collect_overrides(&arguments);
    // A person at the command line is told at once. A service polls, stores and writes whatever the page cannot open, and tries again.
    let port_named = arguments.listen.is_some();
    let own = |name: &str| overrides.iter().any(|(key, _)| key == name);
    let environment =
        std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    let environment: Vec<_> = environment.filter(|(name, _)| !own(name)).collect();
    let variables = environment.into_iter().chain(overrides.clone());
    let config = match arguments.config.as_deref() {
        Some(path) => config::load(Some(path), variables),
        None => config::parse(config::BUILT_IN, &demo::config_text(arguments.speed), Path::new(""), variables),
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

/// RunArguments go before the environment and the file: they are given as variables in place of those of the environment.
fn collect_overrides(arguments: &RunArguments) -> Vec<(String, String)> {
    let mut overrides = Vec::new();
    let mut set = |key: &str, value: String| overrides.push((format!("{}{key}", config::ENVIRONMENT_PREFIX), value));
    if let Some(directory) = &arguments.data_dir {
        let absolute = std::path::absolute(directory).unwrap_or_else(|_| directory.clone());
        set("GATEWAY__DATA_DIR", absolute.display().to_string());
    }
    if let Some(listen) = &arguments.listen {
        set("HTTP__LISTEN", listen.to_string());
    }
    overrides
}
