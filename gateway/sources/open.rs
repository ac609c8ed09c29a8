//! From the configuration to something that gives samples at its pace.

use super::pace::TickSchedule;
use super::sample_feed::SampleFeed;
use super::stand_in::declare_stand_ins;
use adapters::address::Target;
use adapters::clock::{Clock, TimeNs};
use adapters::merge::{Delay, Lockstep, Merge, SourcePlan};
use adapters::open::{OpenError, Opened, open_address, open_pull};
use adapters::simulated::Simulated;
use adapters::worker::{Worker, WorkerSettings};
use adapters::{Actuator, Address, ChannelId, OffsetSink, Pull, Source};
use gateway_config::{self as config, Config, GateMode};
use gateway_gate::EVIDENCE;
use gateway_status::alignment::{Alignment, Patience};
use std::sync::Arc;
use std::time::Duration;

/// How fast machine time runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MachineSpeed {
    /// As fast as real time.
    Real,
    /// So many times as fast; simulated machines and recordings only.
    Times(f64),
    /// As fast as possible; simulated machines and recordings only.
    Max,
}

impl MachineSpeed {
    /// Machine time over real time; `None` as fast as possible.
    #[must_use]
    pub fn time_factor(self) -> Option<f64> {
        match self {
            Self::Real => Some(1.0),
            Self::Times(times) => Some(times),
            Self::Max => None,
        }
    }
}

/// What the sources give.
pub struct Sources {
    /// Gives the samples of the ticks.
    pub feed: SampleFeed,
    /// When they are taken.
    pub schedule: TickSchedule,
    /// Ways to the machines.
    pub ways: Vec<Way>,
    /// The simulated machines among them, which count what is written to them.
    pub machines: Vec<Simulated>,
    /// Is every source simulated?
    pub simulated: bool,
}

/// What can be written at one source. Only the gate may hold it.
pub struct Way {
    /// Name of the source.
    pub name: String,
    /// The way to the feed override.
    pub actuator: Option<Box<dyn Actuator>>,
    /// The way to the offsets.
    pub offsets: Option<Box<dyn OffsetSink>>,
}

/// Opens every source of the configuration. An accelerated machine begins at `start_ns`.
///
/// # Errors
/// Everything that cannot be opened, in words.
pub fn open_sources(
    config: &Config,
    speed: MachineSpeed,
    clock: &Arc<dyn Clock>,
    start_ns: TimeNs,
) -> Result<Sources, Vec<String>> {
    match speed {
        MachineSpeed::Real => open_live_sources(config, clock),
        MachineSpeed::Times(_) | MachineSpeed::Max => open_stepped_sources(config, speed, start_ns),
    }
}

/// Time between two ticks.
pub fn tick_period(config: &Config) -> Duration {
    Duration::from_secs_f64(1.0 / config.gateway.tick_hz)
}

fn is_simulated(config: &Config) -> bool {
    config.sources.iter().all(|source| matches!(source.address.target(), Target::Simulated(_)))
}

fn open_live_sources(config: &Config, clock: &Arc<dyn Clock>) -> Result<Sources, Vec<String>> {
    let (mut found, mut ways, mut problems) = (Vec::new(), Vec::new(), Vec::new());
    let (mut machines, mut owners) = (Vec::new(), Vec::new());
    for source in &config.sources {
        match open_source(&source.address, clock.now_ns()) {
            Ok(opened) => {
                let (deadline, period) = (source.deadline, source.period);
                let settings = WorkerSettings { deadline, period, ..WorkerSettings::default() };
                owners.extend(opened.sources.iter().map(|_| source.name.as_str()));
                found.extend(opened.sources.into_iter().map(|driver| (driver, settings)));
                let (name, actuator, offsets) = (source.name.clone(), opened.actuator, opened.offsets);
                ways.push(Way { name, actuator, offsets });
                machines.extend(opened.simulated);
            }
            Err(error) => problems.push(error.to_string()),
        }
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    let written = find_written_source(&config.gate);
    let mut plans: Vec<SourcePlan> =
        found.iter().map(|(source, settings)| plan_live_source(source.as_ref(), settings)).collect();
    declare_stand_ins(&mut plans, &owners, &config.sources)?;
    reserve_evidence(&mut plans, &owners, written);
    let feed = start_workers(found, &plans, clock, &config.alignment)
        .map_err(|error| vec![format!("no thread for a source: {error}")])?;
    let pace = TickSchedule::on_clock(clock.clone(), tick_period(config));
    Ok(Sources { feed, schedule: pace, ways, machines, simulated: is_simulated(config) })
}

/// As [`open`], and streams that only become a channel in the box.
///
/// # Errors
/// See [`OpenError`].
pub(crate) fn open_source(address: &Address, now_ns: TimeNs) -> Result<Opened, OpenError> {
    crate::waveform::open_source(address).unwrap_or_else(|| open_address(address, now_ns))
}

/// Name of the source that may be written to.
fn find_written_source(gate: &config::GateConfig) -> Option<&str> {
    let overrides = gate.source.as_deref().filter(|_| gate.mode == GateMode::Armed);
    let offsets = gate.offset.source.as_deref().filter(|_| gate.offset.mode == GateMode::Armed);
    overrides.or(offsets)
}

/// What the machine that is written to tells of itself comes from that machine alone: no other source, wherever it stands in the list, can
/// take the place of its mode, its alarm or its switches, and none stands in while it is silent. What it does not tell may come from elsewhere.
fn reserve_evidence(plans: &mut [SourcePlan], owners: &[&str], written: Option<&str>) {
    let Some(written) = written else { return };
    let is_own = |index: usize| owners.get(index) == Some(&written);
    let own = |plan: &SourcePlan| plan.channels.iter().copied().filter(|id| EVIDENCE.contains(id)).collect::<Vec<_>>();
    let reserved: Vec<ChannelId> =
        plans.iter().enumerate().filter(|(index, _)| is_own(*index)).flat_map(|(_, plan)| own(plan)).collect();
    for (_, plan) in plans.iter_mut().enumerate().filter(|(index, _)| !is_own(*index)) {
        plan.channels.retain(|id| !reserved.contains(id));
    }
}

fn plan_live_source(source: &dyn Source, settings: &WorkerSettings) -> SourcePlan {
    let plan = SourcePlan::from_source(source);
    SourcePlan { period: settings.period.unwrap_or(plan.period), ..plan }
}

fn start_workers(
    sources: Vec<(Box<dyn Source>, WorkerSettings)>,
    plans: &[SourcePlan],
    clock: &Arc<dyn Clock>,
    alignment: &config::AlignmentConfig,
) -> std::io::Result<SampleFeed> {
    let merge = Merge::new(plans, Delay::SlowestPeriod);
    let start = |(source, settings)| Worker::start(source, clock.clone(), settings);
    let workers = sources.into_iter().map(start).collect::<Result<_, _>>()?;
    Ok(SampleFeed::Threads { workers, merge, alignment: Alignment::from_plans(plans, alignment, Patience::GoesOn) })
}

fn open_stepped_sources(config: &Config, speed: MachineSpeed, start_ns: TimeNs) -> Result<Sources, Vec<String>> {
    let (mut found, mut ways, mut problems) = (Vec::<Box<dyn Pull>>::new(), Vec::new(), Vec::new());
    let (mut machines, mut owners) = (Vec::new(), Vec::new());
    for source in &config.sources {
        match open_pull(&source.address, start_ns) {
            Ok(opened) => {
                owners.extend(opened.sources.iter().map(|_| source.name.as_str()));
                found.extend(opened.sources);
                let (name, actuator, offsets) = (source.name.clone(), opened.actuator, opened.offsets);
                ways.push(Way { name, actuator, offsets });
                machines.extend(opened.simulated);
            }
            Err(error) => problems.push(describe_speed_error(&error)),
        }
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    let names = found.iter().map(|source| (source.name().to_owned(), source.period())).collect();
    let mut plans: Vec<SourcePlan> = found.iter().map(|source| SourcePlan::of_pull(source.as_ref())).collect();
    declare_stand_ins(&mut plans, &owners, &config.sources)?;
    let alignment = Alignment::from_plans(&plans, &config.alignment, Patience::Waits);
    let lockstep = Lockstep::from_plans(found, &plans, Delay::SlowestPeriod);
    let feed = SampleFeed::Stepped { lockstep, sources: names, alignment };
    let pace = TickSchedule::with_speed(speed.time_factor(), start_ns, tick_period(config));
    Ok(Sources { feed, schedule: pace, ways, machines, simulated: is_simulated(config) })
}

fn describe_speed_error(error: &OpenError) -> String {
    format!("{error} (with --speed only simulated machines and recordings can be read)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_other_source_speaks_for_the_machine_that_is_written_to() {
        let plan = |name: &str, channels: &[&str]| SourcePlan {
            name: name.to_owned(),
            channels: channels.iter().map(|name| ChannelId::from_name(name).expect("in the table")).collect(),
            period: Duration::from_millis(100),
            stand_in: Vec::new(),
        };
        let all = || {
            [plan("simulated://lathe", &["mode", "alarm", "spindle_power_w", "dry_run"]), plan("c", &["mode", "alarm"])]
        };
        let names = |plan: &SourcePlan| plan.channels.iter().map(|id| id.name()).collect::<Vec<_>>();
        let mut plans = all();
        reserve_evidence(&mut plans, &["before", "control"], Some("control"));
        assert_eq!((names(&plans[0]), names(&plans[1])), (vec!["spindle_power_w", "dry_run"], vec!["mode", "alarm"]));
        let mut plans = all();
        reserve_evidence(&mut plans, &["before", "control"], None);
        assert_eq!(plans, all(), "nothing is written: the first one wins as before");
    }
}
