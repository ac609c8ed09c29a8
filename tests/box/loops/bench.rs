//! One machine with everything that a gateway has between its samples and its ladder, in the machine's own time.

use adapters::clock::{SECOND_NS, TimeNs};
use adapters::merge::{Delay, Lockstep};
use adapters::simulated::{ExperimentStep, METER_CHANNELS, Moment, Simulated, SimulatedSettings};
use adapters::{Absence, Actuator, ChannelId, LadderRule, Pull, Sample, Slot, Value};
use gateway::config::{self, BUILT_IN_TEXT, GateMode};
use gateway::gate::offset::{Moved, OffsetAccount, OffsetJournal, OffsetOrder};
use gateway::gate::{AskOutcome, Gate, Reaction, ScriptRequest};
use gateway::history::{ExtraValue, Part, Record};
use gateway::pipeline::{Pipeline, Store};
use gateway::run::actuator_worker::{ActuatorReport, ActuatorWorker, Tools};
use rules::estimators;
use rules::script::{Host, ScriptFile};
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// An audit that takes everything.
struct Stored;

impl gateway::gate::AuditPath for Stored {
    fn is_live(&self) -> bool {
        true
    }
}

pub(crate) const TICK_NS: i64 = SECOND_NS / 10;
/// The machine is looked at this often.
const LOOK_NS: i64 = SECOND_NS / 50;

/// The gate of a shop whose ladder multiplies dial and override, and which lets the feed rise as quickly as it falls.
pub(crate) fn limits(min_pct: f64, max_pct: f64) -> config::GateConfig {
    let config = config::parse("test", BUILT_IN_TEXT, Path::new(""), []).expect("it is accepted");
    let source = Some("lathe".to_owned());
    config::GateConfig {
        mode: GateMode::Armed,
        source,
        min_pct,
        max_pct,
        above_dial: true,
        slew_up_pct_per_s: 50.0,
        ..config.gate
    }
}

pub(crate) fn script(name: &str, text: impl Into<String>) -> ScriptFile {
    ScriptFile { name: name.to_owned(), text: text.into() }
}

/// Keeps the finished parts.
#[derive(Default)]
struct Finished(Vec<Part>);

impl Store for Finished {
    fn store_sample(&mut self, _: &Sample, _: &[ExtraValue<'_>]) {}

    fn store_record(&mut self, record: Record) {
        if let Record::Part(part) = record {
            self.0.push(part);
        }
    }
}

/// As a recipe fills it in.
fn name_material(sample: &mut Sample, material: &Arc<str>) {
    let channel = ChannelId::from_name("work_material").expect("a channel");
    sample.set_slot(channel, Slot { value: Ok(Value::Text(material.clone())), age_ns: 0 });
}

/// The mains of a hall in which others start and stop: two slow waves.
fn wander(sample: &mut Sample, share: f64, no_load_w: f64) {
    let at_s = sample.at_ns as f64 / SECOND_NS as f64;
    let wave = 0.6 * (at_s / 97.0).sin() + 0.4 * (at_s / 613.0).cos();
    let factor = 1.0 + share * wave;
    let by_mains_w = 0.3 * no_load_w * (factor * factor - 1.0);
    let mut change = |name: &str, of: &dyn Fn(f64) -> f64| {
        let id = ChannelId::from_name(name).expect("a channel");
        if let Ok(value) = sample.number(id) {
            let age_ns = sample.slot(id).age_ns;
            sample.set_slot(id, Slot { value: Ok(Value::Number(of(value))), age_ns });
        }
    };
    change("supply_voltage_v", &|volts| volts * factor);
    for name in ["spindle_power_w", "total_power_w"] {
        change(name, &|watts| watts + by_mains_w);
    }
}

/// A fault between the machine and what arrives of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LineFault {
    /// The pump is not switched on.
    CoolantOff,
    ControlSilent,
    MeterSilent,
    /// The bearing is so much warmer, K.
    BearingWarmer(f64),
    /// The supply is lower by so much, V.
    SupplyLower(f64),
}

impl LineFault {
    pub(crate) fn apply(self, sample: &mut Sample) {
        let mut add = |name: &str, by: f64| {
            let id = ChannelId::from_name(name).expect("a channel");
            if let Ok(value) = sample.number(id) {
                let age_ns = sample.slot(id).age_ns;
                sample.set_slot(id, Slot { value: Ok(Value::Number(value + by)), age_ns });
            }
        };
        match self {
            Self::BearingWarmer(kelvin) => add("bearing_temperature_c", kelvin),
            Self::SupplyLower(volts) => add("supply_voltage_v", -volts),
            Self::CoolantOff => {
                let id = ChannelId::from_name("coolant_on").expect("a channel");
                let slot = sample.slot(id).clone();
                if slot.value.is_ok() {
                    sample.set_slot(id, Slot { value: Ok(Value::Number(0.0)), ..slot });
                }
            }
            Self::ControlSilent | Self::MeterSilent => {
                let of_meter = |id: ChannelId| METER_CHANNELS.contains(&id.name());
                let silent: Vec<ChannelId> = sample
                    .provided_slots()
                    .map(|(id, _)| id)
                    .filter(|id| of_meter(*id) == (self == Self::MeterSilent))
                    .collect();
                for id in silent {
                    sample.set_slot(id, Slot { value: Err(Absence::Timeout), age_ns: 0 });
                }
            }
        }
    }
}

/// A machine, and the gateway beside it.
pub(crate) struct Bench {
    pub(crate) machine: Simulated,
    lockstep: Lockstep,
    pub(crate) pipeline: Pipeline,
    actuator_worker: ActuatorWorker,
    sample: Sample,
    now_ns: TimeNs,
    /// What the recipe of the shop names as work material.
    pub(crate) work_material: Option<Arc<str>>,
    /// The mains wanders by so much, as a share: the supply voltage, and with its square three tenths of the no-load power.
    pub(crate) mains: f64,
    pub(crate) line_fault: Option<LineFault>,
    /// Time between two ticks.
    pub(crate) period_ns: i64,
    /// Steps seen in force.
    pub(crate) reactions: Vec<Reaction>,
    /// Offsets that were shifted, or could not be.
    pub(crate) moves: Vec<Moved>,
    /// Finished parts, as they are stored.
    pub(crate) parts: Vec<Part>,
    /// What went wrong on the way to the machine.
    pub(crate) faults: Vec<String>,
    /// Where the account of the offsets is kept.
    _directory: TempDir,
}

impl Bench {
    /// An experiment in place of the day's work, under these scripts.
    pub(crate) fn new(
        mut settings: SimulatedSettings,
        steps: &[ExperimentStep],
        scripts: &[ScriptFile],
        limits: &config::GateConfig,
    ) -> Self {
        settings.ladder.rule = LadderRule::Product;
        Self::of(Simulated::experiment("simulated://lathe", settings, 0, steps), scripts, limits)
    }

    /// The day's work.
    pub(crate) fn at_work(settings: SimulatedSettings, scripts: &[ScriptFile], limits: &config::GateConfig) -> Self {
        Self::of(Simulated::new("simulated://lathe", settings, 0), scripts, limits)
    }

    fn of(machine: Simulated, scripts: &[ScriptFile], limits: &config::GateConfig) -> Self {
        let sources: Vec<Box<dyn Pull>> = vec![Box::new(machine.controller()), Box::new(machine.meter())];
        let mut host = Host::new();
        host.load_scripts(scripts).expect("the scripts are accepted");
        let actuator: Box<dyn Actuator> = Box::new(machine.feed_override());
        let directory = tempfile::tempdir().expect("a directory");
        let book = OffsetJournal::open(directory.path(), "simulated://lathe").expect("none yet");
        let offsets = OffsetAccount::new(Box::new(machine.offsets()), book);
        let estimators = estimators::Inference::new(estimators::Settings::default());
        Self {
            lockstep: Lockstep::new(sources, Delay::SlowestPeriod),
            pipeline: Pipeline::new(estimators, host, Gate::new(limits.clone())),
            actuator_worker: ActuatorWorker::with_inline_writers(
                Tools { audit: Arc::new(Stored), actuator: Some(actuator), offsets: Some(offsets) },
                limits,
            ),
            _directory: directory,
            machine,
            sample: Sample::new_empty(0),
            now_ns: 0,
            work_material: None,
            mains: 0.0,
            line_fault: None,
            period_ns: TICK_NS,
            reactions: Vec::new(),
            moves: Vec::new(),
            parts: Vec::new(),
            faults: Vec::new(),
        }
    }

    /// Armed from the next tick on, as a person would.
    pub(crate) fn arm(&mut self) {
        self.pipeline.gate_mut().arm("fitter", None, self.sample.at_ns).expect("allowed");
    }

    /// One tick; gives the sample.
    pub(crate) fn tick(&mut self) -> &Sample {
        self.now_ns += self.period_ns;
        self.lockstep.sample_into(&mut self.sample, self.now_ns);
        if let Some(material) = &self.work_material {
            name_material(&mut self.sample, material);
        }
        if self.mains > 0.0 {
            wander(
                &mut self.sample,
                self.mains,
                self.pipeline.estimates().no_load_power_w.map_or(0.0, |power| power.value),
            );
        }
        if let Some(fault) = self.line_fault {
            fault.apply(&mut self.sample);
        }
        let mut finished = Finished::default();
        self.pipeline.run_tick(&self.sample, &mut finished);
        self.parts.append(&mut finished.0);
        let verdict = *self.pipeline.verdict().expect("decided");
        let asks: Vec<ScriptRequest> =
            self.pipeline.scripts().decision().stops.iter().map(ScriptRequest::from_stop).collect();
        let gate = self.pipeline.gate_mut();
        let judged = gate.judge_requests(&asks, &self.sample).into_iter();
        let sent: Vec<ScriptRequest> =
            judged.filter(|(_, outcome)| *outcome == AskOutcome::Sent).map(|(ask, _)| ask).collect();
        let mut said = Vec::new();
        self.actuator_worker.submit_verdict(&verdict, &sent, self.now_ns, |it| said.push(it));
        let orders: Vec<OffsetOrder> =
            self.pipeline.judge_offsets(&self.sample).iter().filter_map(|verdict| verdict.order).collect();
        let gate = self.pipeline.gate_mut();
        self.actuator_worker.order_shifts(&orders, gate.writes_offsets(), self.now_ns, |it| said.push(it));
        for it in said {
            let fault = match it {
                ActuatorReport::Written(written) => written.fault,
                ActuatorReport::Fault(fault) => Some(fault),
                ActuatorReport::Seen(reaction) => {
                    self.reactions.push(reaction);
                    None
                }
                ActuatorReport::Moved(moved) => {
                    gate.offsets_mut().accept_answer(&moved);
                    let fault = moved.fault();
                    self.moves.push(*moved);
                    fault
                }
                ActuatorReport::Withdrawn(order) => {
                    gate.offsets_mut().withdraw_order(order);
                    None
                }
                ActuatorReport::Asked(_, failed) => {
                    self.faults.extend(failed);
                    None
                }
            };
            if let Some(fault) = fault {
                gate.disarm(fault.disarm_reason());
                self.faults.push(fault.to_string());
            }
        }
        &self.sample
    }

    pub(crate) fn now_s(&self) -> f64 {
        self.now_ns as f64 / SECOND_NS as f64
    }

    /// The machine at every look of the last tick.
    pub(crate) fn looks(&self) -> impl Iterator<Item = Moment> + '_ {
        let from_ns = self.now_ns - self.period_ns;
        (0..self.period_ns / LOOK_NS).map(move |look| self.machine.moment(from_ns + look * LOOK_NS))
    }
}
