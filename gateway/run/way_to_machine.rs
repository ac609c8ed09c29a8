//! The way to the machine: what may be written, and who writes it.

use super::RunPlan;
use super::actuator_worker::{ActuatorWorker, Tools};
use super::command::Commands;
use super::facts::FactMarks;
use super::history_store::StoredAudit;
use super::offset_commands::OffsetCommands;
use adapters::clock::Clock;
use adapters::{Actuator, OffsetSink};
use gateway_base::cannot_run::CannotRun;
use gateway_config::{self as config, GateMode};
use gateway_control::OrderReceiver;
use gateway_gate::Gate;
use gateway_sources::open::{self, MachineSpeed, Way};
use std::sync::Arc;

/// The ways to the feed override and to the offsets, where they may be written.
type Ends = (Option<Box<dyn Actuator>>, Option<Box<dyn OffsetSink>>);

/// The way to the machine. Unless the configuration allows arming there is no actuator in the process at all, and no sink
/// of offsets.
pub(super) fn build_commands(
    plan: &RunPlan,
    mut ways: Vec<Way>,
    inbox: OrderReceiver,
    clock: &Arc<dyn Clock>,
    gate: &mut Gate,
    audit: StoredAudit,
) -> Result<Commands, CannotRun> {
    let inbox = (inbox, FactMarks::from_history(&plan.config.history.path));
    let limits: &config::GateConfig = &plan.config.gate;
    let data_dir = &plan.config.gateway.data_dir;
    let target = limits.source.clone().unwrap_or_default();
    if limits.greatest_mode() != GateMode::Armed {
        return Ok(Commands::new(ActuatorWorker::None, OffsetCommands::without_sink(data_dir), target, inbox));
    }
    let (actuator, sink) = take_writers(limits, &mut ways)?;
    let (shifting, offsets) = match sink {
        Some(sink) => OffsetCommands::resume_from_journal(data_dir, sink, gate)
            .map(|(shifting, account)| (shifting, Some(account)))?,
        None => (OffsetCommands::without_sink(data_dir), None),
    };
    let tools = Tools { audit: Arc::new(audit), actuator, offsets };
    let actuator_worker = match plan.speed {
        MachineSpeed::Real => ActuatorWorker::start(tools, limits, clock.clone(), open::tick_period(&plan.config))
            .map_err(|error| CannotRun::new(format!("no thread to write with: {error}"), ""))?,
        MachineSpeed::Times(_) | MachineSpeed::Max => ActuatorWorker::with_inline_writers(tools, limits),
    };
    Ok(Commands::new(actuator_worker, shifting, target, inbox))
}

/// What may be written, and nothing else.
fn take_writers(limits: &config::GateConfig, ways: &mut [Way]) -> Result<Ends, CannotRun> {
    let (mut actuator, mut sink) = (None, None);
    if limits.mode == GateMode::Armed {
        let target = limits.source.as_deref().unwrap_or_default();
        let way = ways.iter_mut().find(|way| way.name == target).and_then(|way| way.actuator.take());
        let what = format!("[gate] source = {target:?} has no feed override that could be written");
        actuator =
            Some(way.ok_or_else(|| CannotRun::new(what, "name the controller there, or write mode = \"shadow\""))?);
    }
    if limits.offset.mode == GateMode::Armed {
        let target = limits.offset.source.as_deref().unwrap_or_default();
        let way = ways.iter_mut().find(|way| way.name == target).and_then(|way| way.offsets.take());
        let what = format!("[gate.offset] source = {target:?} has no external offset that could be written");
        let next = "name the controller there (fanuc:// needs allow=EXT, nclink:// and hncnet:// need offset=), or write mode = \"shadow\"";
        sink = Some(way.ok_or_else(|| CannotRun::new(what, next))?);
    }
    Ok((actuator, sink))
}
