//! The controller of the simulated machine as a source.

use super::Simulated;
use super::device::PolledDevice;
use super::moment::{Moment, Panel};
use super::noise::{Purpose, sample_normal};
use crate::address::SimulatedMachine;
use adapter_core::channel::ChannelId;
use adapter_core::clock::{Clock, TimeNs};
use adapter_core::driver::{Pull, Source, SourceError};
use adapter_core::integer::saturate_to_wait_ns;
use adapter_core::reading::{Reading, Stamp};
use std::sync::Arc;
use std::time::Duration;

/// What the value of a channel is taken from.
#[derive(Clone, Copy)]
enum Get {
    Number(fn(&Moment) -> f64),
    /// The actual speed, with the noise of its encoder.
    Speed,
    /// The displacement of the tool by heat, with the noise of the gauge.
    Gauge,
    Text(fn(&Panel) -> CachedText),
}

/// A word that is made into text only when it changes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum CachedText {
    Plain(&'static str),
    Numbered(char, u16),
    Edge(u8, u16),
}

impl CachedText {
    fn to_text(self) -> Arc<str> {
        match self {
            Self::Plain(word) => Arc::from(word),
            Self::Numbered(letter, number) => Arc::from(format!("{letter}{number}")),
            Self::Edge(tool, 0) => Arc::from(format!("T{tool}")),
            Self::Edge(tool, edge) => Arc::from(format!("T{tool}-{}", edge + 1)),
        }
    }
}

type ChannelGetter = (&'static str, Get);

const COMMON: [ChannelGetter; 25] = [
    ("spindle_programmed_rpm", Get::Number(|moment| moment.panel.spindle_programmed_rpm)),
    ("spindle_speed_rpm", Get::Speed),
    ("feed_programmed_mm_min", Get::Number(|moment| moment.panel.feed_programmed_mm_min.round())),
    ("feed_mm_min", Get::Number(|moment| round_to_tenth(moment.panel.feed_mm_min))),
    ("feed_override_pct", Get::Number(|moment| f64::from(moment.panel.feed_override_pct))),
    ("feed_override_dial_pct", Get::Number(|moment| f64::from(moment.panel.dial_pct))),
    ("spindle_override_pct", Get::Number(|_| 100.0)),
    ("spindle_load_pct", Get::Number(|moment| moment.electric.spindle_load_pct.round())),
    ("motor_temperature_c", Get::Number(|moment| moment.electric.motor_temperature_c.round())),
    ("x_axis_position_mm", Get::Number(|moment| round_to_thousandth(moment.panel.position_mm[0]))),
    ("z_axis_position_mm", Get::Number(|moment| round_to_thousandth(moment.panel.position_mm[2]))),
    ("x_axis_velocity_mm_min", Get::Number(|moment| round_to_tenth(moment.panel.velocity_mm_min[0]))),
    ("z_axis_velocity_mm_min", Get::Number(|moment| round_to_tenth(moment.panel.velocity_mm_min[2]))),
    ("gear_stage", Get::Number(|moment| f64::from(moment.panel.gear_stage))),
    ("rapid", Get::Number(|moment| f64::from(u8::from(moment.panel.rapid)))),
    ("coolant_on", Get::Number(|moment| f64::from(u8::from(moment.panel.coolant_on)))),
    ("hydraulics_on", Get::Number(|moment| f64::from(u8::from(moment.panel.hydraulics_on)))),
    ("drive_on", Get::Number(|moment| f64::from(u8::from(moment.panel.drives_on)))),
    ("part_count", Get::Number(|moment| f64::from(moment.panel.part_count))),
    ("mode", Get::Text(|panel| CachedText::Plain(panel.mode))),
    ("execution", Get::Text(|panel| CachedText::Plain(panel.execution))),
    ("program", Get::Text(|panel| CachedText::Numbered('O', panel.program))),
    ("block", Get::Text(|panel| CachedText::Numbered('N', panel.block))),
    ("tool", Get::Text(|panel| CachedText::Edge(panel.tool, panel.edge))),
    ("alarm", Get::Text(|panel| CachedText::Plain(panel.alarm))),
];

const ANNOTATIONS: [ChannelGetter; 3] = [
    ("operation", Get::Text(|panel| CachedText::Plain(panel.operation))),
    ("depth_of_cut_mm", Get::Number(|moment| moment.panel.depth_of_cut_mm)),
    ("diameter_mm", Get::Number(|moment| round_to_tenth(moment.panel.diameter_mm))),
];

const MILL_POSITION: [ChannelGetter; 2] = [
    ("y_axis_position_mm", Get::Number(|moment| round_to_thousandth(moment.panel.position_mm[1]))),
    ("y_axis_velocity_mm_min", Get::Number(|moment| round_to_tenth(moment.panel.velocity_mm_min[1]))),
];

const GAUGE: [ChannelGetter; 1] = [("thermal_error_um", Get::Gauge)];

const MILL_ANNOTATIONS: [ChannelGetter; 2] = [
    ("width_of_cut_mm", Get::Number(|moment| moment.panel.width_of_cut_mm)),
    ("teeth", Get::Number(|moment| moment.panel.teeth)),
];

fn round_to_tenth(number: f64) -> f64 {
    (number * 10.0).round() / 10.0
}

fn round_to_thousandth(number: f64) -> f64 {
    (number * 1000.0).round() / 1000.0
}

/// A channel, where its value comes from, and the last text it had.
struct ControllerChannel {
    channel: ChannelId,
    get: Get,
    last: Option<(CachedText, Arc<str>)>,
}

/// The controller of the simulated machine.
pub struct SimulatedController {
    name: String,
    machine: Simulated,
    device: PolledDevice,
    channels: Vec<ChannelId>,
    outputs: Vec<ControllerChannel>,
    seed: u64,
}

impl SimulatedController {
    pub(super) fn new(name: String, machine: Simulated) -> Self {
        let settings = *machine.settings();
        let device = PolledDevice::new(settings.controller, settings.seed, machine.origin_ns());
        let mill = settings.machine == SimulatedMachine::Mill;
        let mut entries = COMMON.to_vec();
        let optional: [(bool, &[ChannelGetter]); 4] = [
            (settings.annotations, &ANNOTATIONS),
            (settings.gauge_um > 0.0, &GAUGE),
            (mill, &MILL_POSITION),
            (mill && settings.annotations, &MILL_ANNOTATIONS),
        ];
        optional.iter().filter(|(wanted, _)| *wanted).for_each(|(_, more)| entries.extend_from_slice(more));
        let output = |(name, get): ChannelGetter| {
            Some(ControllerChannel { channel: ChannelId::from_name(name)?, get, last: None })
        };
        let outputs: Vec<ControllerChannel> = entries.into_iter().filter_map(output).collect();
        let channels = outputs.iter().map(|output| output.channel).collect();
        Self { name, machine, device, channels, outputs, seed: settings.seed }
    }

    /// What the controller answers to a request of this stamp.
    fn append_readings(&mut self, stamp: Stamp, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let beat = self.device.newest_beat(stamp.mid_ns);
        let moment = self.machine.moment(self.device.beat_ns(beat));
        if !moment.panel.booted {
            return Err(SourceError::Off { source_name: self.name.clone() });
        }
        let noise = SensorNoise {
            speed_rpm: 0.6 * sample_normal(self.seed, Purpose::Speed, beat),
            gauge_um: self.machine.settings().gauge_um * sample_normal(self.seed, Purpose::Gauge, beat),
        };
        out.extend(self.outputs.iter_mut().map(|output| output.build_reading(&moment, noise, stamp)));
        Ok(())
    }
}

/// What the sensors of the control add to the truth at one beat.
#[derive(Debug, Clone, Copy)]
struct SensorNoise {
    speed_rpm: f64,
    gauge_um: f64,
}

impl ControllerChannel {
    fn build_reading(&mut self, moment: &Moment, noise: SensorNoise, stamp: Stamp) -> Reading {
        match self.get {
            Get::Number(get) => Reading::from_number(self.channel, stamp, get(moment)),
            Get::Speed => {
                let speed_rpm = simulate_encoder(moment.panel.spindle_speed_rpm, noise.speed_rpm);
                Reading::from_number(self.channel, stamp, speed_rpm)
            }
            Get::Gauge => {
                let shown_um = round_to_tenth(moment.truth.thermal_error_um + noise.gauge_um);
                Reading::from_number(self.channel, stamp, shown_um)
            }
            Get::Text(get) => Reading::from_text(self.channel, stamp, self.cache_text(get(&moment.panel))),
        }
    }

    fn cache_text(&mut self, word: CachedText) -> Arc<str> {
        match &self.last {
            Some((last, text)) if *last == word => text.clone(),
            _ => {
                let text = word.to_text();
                self.last = Some((word, text.clone()));
                text
            }
        }
    }
}

/// Whole turns per minute; a standing spindle shows exactly zero.
fn simulate_encoder(speed_rpm: f64, unrest_rpm: f64) -> f64 {
    if speed_rpm == 0.0 { 0.0 } else { (speed_rpm + unrest_rpm).round() }
}

impl Source for SimulatedController {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.device.period()
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let began_ns = clock.now_ns();
        clock.sleep_until(began_ns + self.device.round_trip_ns());
        let stamp = Stamp::of_request(began_ns, clock.now_ns());
        self.device.schedule_next_poll(clock.now_ns());
        self.append_readings(stamp, out)
    }
}

impl Pull for SimulatedController {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.device.period()
    }

    fn next_ns(&self) -> Option<TimeNs> {
        Some(self.device.next_begin_ns() + self.device.round_trip_ns())
    }

    fn pull_readings(&mut self, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let began_ns = self.device.next_begin_ns();
        let stamp = Stamp::of_request(began_ns, began_ns + self.device.round_trip_ns());
        self.device.schedule_next_poll(began_ns + saturate_to_wait_ns(self.device.period()));
        self.append_readings(stamp, out)
    }
}
