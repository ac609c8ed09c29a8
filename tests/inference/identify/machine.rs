//! The simulated machine carries out steps; what a gateway records of it, and what was true.

use adapters::address::SimulatedMachine;
use adapters::channel::Kind;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::merge::{Delay, Lockstep};
use adapters::recording::{Cells, Numbers, Words};
use adapters::simulated::{ExperimentCut, ExperimentStep, Simulated, SimulatedSettings, Truth};
use adapters::{ChannelId, Pull, Recording, Sample, Value};

const ORIGIN_NS: TimeNs = 1_767_225_600 * SECOND_NS;

/// The lathe with a meter whose zero point stands still and which answers always.
pub(crate) fn lathe(seed: u64) -> SimulatedSettings {
    let mut settings = SimulatedSettings { machine: SimulatedMachine::Lathe, seed, ..SimulatedSettings::default() };
    settings.meter.dropouts_per_h = 0.0;
    settings.meter.zero_drift_w = 0.0;
    settings
}

/// Turning in the air.
pub(crate) fn idle(seconds: f64, spindle_rpm: f64, gear_stage: u8) -> ExperimentStep {
    ExperimentStep {
        seconds,
        spindle_rpm,
        gear_stage: Some(gear_stage),
        cut: None,
        axis_mm_min: 0.0,
        coolant_on: false,
        hydraulics_on: false,
        override_pct: 100,
        new_edge: false,
    }
}

/// Turning down.
pub(crate) fn cut(seconds: f64, spindle_rpm: f64, gear_stage: u8, cut: ExperimentCut) -> ExperimentStep {
    ExperimentStep { cut: Some(cut), ..idle(seconds, spindle_rpm, gear_stage) }
}

/// A recording, and what was true in each of its rows.
pub(crate) struct Recorded {
    pub(crate) recording: Recording,
    pub(crate) truth: Vec<Truth>,
}

/// The machine runs the steps from a cold start.
pub(crate) fn record(settings: SimulatedSettings, steps: &[ExperimentStep], rate_hz: f64) -> Recorded {
    let machine = Simulated::experiment("simulated://machine", settings, ORIGIN_NS, steps);
    let sources: Vec<Box<dyn Pull>> = vec![Box::new(machine.controller()), Box::new(machine.meter())];
    let mut lockstep = Lockstep::new(sources, Delay::SlowestPeriod);
    let mut sample = Sample::new_empty(0);
    let (mut samples, mut truth) = (Vec::new(), Vec::new());
    let (program, speed) =
        (ChannelId::from_name("program").expect("known"), ChannelId::from_name("spindle_speed_rpm").expect("known"));
    let seconds: f64 = steps.iter().map(|step| step.seconds + 30.0).sum();
    for tick in 0..(rate_hz * (seconds + 60.0)) as i64 {
        lockstep.sample_into(&mut sample, ORIGIN_NS + (tick as f64 / rate_hz * SECOND_NS as f64) as i64);
        if sample.text(program).is_some_and(|program| program == "O9100") {
            samples.push(sample.clone());
            truth.push(machine.truth(sample.at_ns));
        } else if !samples.is_empty() && sample.number(speed).is_ok_and(|rpm| rpm == 0.0) {
            break;
        }
    }
    Recorded { recording: table(&samples), truth }
}

fn table(samples: &[Sample]) -> Recording {
    let first_ns = samples.first().expect("the program ran").at_ns;
    let time_s = samples.iter().map(|sample| (sample.at_ns - first_ns) as f64 / SECOND_NS as f64).collect();
    let mut recording = Recording::new("simulated machine", time_s, None);
    for id in ChannelId::list_all() {
        let values = || samples.iter().map(|sample| sample.slot(id).value.as_ref().ok());
        if values().flatten().next().is_none() {
            continue;
        }
        let cells = if id.channel().kind == Kind::Text {
            let words = values().map(|value| value.and_then(Value::as_text).unwrap_or(""));
            Cells::Words(words.collect::<Words>())
        } else {
            Cells::Numbers(values().map(|value| value.and_then(Value::as_number)).collect::<Numbers>())
        };
        recording.set_column(id.name(), cells);
    }
    recording
}

impl Recorded {
    /// Mean of a true quantity from one time of the recording to another, s.
    pub(crate) fn mean(&self, from_s: f64, to_s: f64, of: impl Fn(&Truth) -> f64) -> f64 {
        let inside = |time_s: f64| time_s >= from_s && time_s <= to_s;
        let rows = self.recording.time_s.iter().zip(&self.truth).filter(|(time_s, _)| inside(**time_s));
        let values: Vec<f64> = rows.map(|(_, truth)| of(truth)).collect();
        values.iter().sum::<f64>() / values.len() as f64
    }
}
