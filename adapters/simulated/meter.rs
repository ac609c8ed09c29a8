//! The meter of the simulated machine as a source: averages over windows of its own clock, with everything that real
//! meters add.

use super::Simulated;
use super::device::{DEADLINE, PolledDevice, build_timeout_error};
use super::noise::{Purpose, sample_normal, sample_uniform};
use super::settings::MeterSettings;
use adapter_core::channel::ChannelId;
use adapter_core::clock::{Clock, TimeNs};
use adapter_core::driver::{Pull, Source, SourceError};
use adapter_core::integer::saturate_to_wait_ns;
use adapter_core::reading::{Reading, Stamp};
use std::f64::consts::TAU;
use std::time::Duration;

/// The channels of the meter, in the order of `MeterValues::collect_numbers`.
pub const METER_CHANNELS: [&str; 6] = [
    "spindle_power_w",
    "total_power_w",
    "spindle_current_a",
    "supply_voltage_v",
    "bearing_temperature_c",
    "ambient_temperature_c",
];

/// A dropout begins in a stretch of this length of the meter's own clock, or not.
const DROPOUT_STRETCH_S: f64 = 20.0;

/// What the meter shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeterValues {
    /// Power into the spindle drive, W.
    pub spindle_power_w: f64,
    /// Power into the machine, W.
    pub total_power_w: f64,
    /// Spindle current, A rms.
    pub spindle_current_a: f64,
    /// Supply, V phase to phase.
    pub supply_voltage_v: f64,
    /// Temperature of the spindle bearing, °C.
    pub bearing_temperature_c: f64,
    /// Temperature of the air, °C.
    pub ambient_temperature_c: f64,
}

impl MeterValues {
    fn collect_numbers(&self) -> [f64; 6] {
        [
            self.spindle_power_w,
            self.total_power_w,
            self.spindle_current_a,
            self.supply_voltage_v,
            self.bearing_temperature_c,
            self.ambient_temperature_c,
        ]
    }
}

/// The meter of the simulated machine.
pub struct SimulatedMeter {
    name: String,
    machine: Simulated,
    device: PolledDevice,
    settings: MeterSettings,
    channels: Vec<ChannelId>,
    seed: u64,
}

impl SimulatedMeter {
    pub(super) fn new(name: String, machine: Simulated) -> Self {
        let settings = *machine.settings();
        // Another seed than the controller's, so that their lines are not slow together.
        let seed = settings.seed.wrapping_add(0x5EED);
        let device = PolledDevice::new(settings.meter.device, seed, machine.origin_ns());
        let channels = METER_CHANNELS.iter().filter_map(|name| ChannelId::from_name(name)).collect();
        Self { name, machine, device, settings: settings.meter, channels, seed }
    }

    /// What the meter shows at `at_ns`, or `None` while it does not answer.
    #[must_use]
    pub fn read_values(&self, at_ns: TimeNs) -> Option<MeterValues> {
        (!self.drops_out(at_ns)).then(|| self.average_window(self.device.newest_beat(at_ns)))
    }

    /// The averages over the window that ends with this beat.
    fn average_window(&self, beat: i64) -> MeterValues {
        let (from_ns, to_ns) = (self.device.beat_ns(beat - 1), self.device.beat_ns(beat));
        let (from, to, moment) = self.machine.between(from_ns, to_ns);
        let window_s = self.settings.device.refresh.as_secs_f64();
        let mean = |from: f64, to: f64| (to - from) / window_s;
        let ripple = self.average_ripple(from.mains_rad, to.mains_rad);
        let pulse_w = self.pulse_w(beat);
        let zero_w = self.zero_w(to_ns);
        let spindle_w = mean(from.spindle_j, to.spindle_j);
        let total_w = mean(from.total_j, to.total_j);
        let current_a = mean(from.current_squared_a2s, to.current_squared_a2s).max(0.0).sqrt();
        let noise = |purpose| sample_normal(self.seed, purpose, beat);
        let noisy = |truth: f64, purpose| {
            let sigma_w = (self.settings.noise_share * truth).hypot(self.settings.noise_floor_w);
            round_to_tenth(truth * (1.0 + ripple) + zero_w + sigma_w * noise(purpose))
        };
        let electric = moment.electric;
        let sensor = |truth: f64, shift: i64| {
            round_to_tenth(truth + 0.04 * sample_normal(self.seed, Purpose::Temperature, 2 * beat + shift))
        };
        MeterValues {
            spindle_power_w: noisy(spindle_w + pulse_w, Purpose::SpindlePower),
            total_power_w: noisy(total_w + pulse_w, Purpose::TotalPower),
            spindle_current_a: round_to_hundredth(
                (current_a * (1.0 + self.settings.noise_share * noise(Purpose::Current))).abs(),
            ),
            supply_voltage_v: round_to_tenth(electric.supply_voltage_v + 0.1 * noise(Purpose::Voltage)),
            bearing_temperature_c: sensor(electric.bearing_temperature_c, 0),
            ambient_temperature_c: sensor(electric.ambient_temperature_c, 1),
        }
    }

    /// What is left of a ripple at twice the mains frequency after averaging over a window between two mains phases.
    fn average_ripple(&self, from_rad: f64, to_rad: f64) -> f64 {
        let width_rad = 2.0 * (to_rad - from_rad);
        if width_rad <= 0.0 {
            return 0.0;
        }
        self.settings.ripple_share * ((2.0 * to_rad).sin() - (2.0 * from_rad).sin()) / width_rad
    }

    fn pulse_w(&self, beat: i64) -> f64 {
        if sample_uniform(self.seed, Purpose::Pulse, beat) >= self.settings.pulse_probability {
            return 0.0;
        }
        let size = 2.0 * sample_uniform(self.seed, Purpose::PulseSize, beat) - 1.0;
        self.settings.pulse_w * (0.2 * size.signum() + 0.8 * size)
    }

    /// The zero point wanders over hours.
    fn zero_w(&self, at_ns: TimeNs) -> f64 {
        let hours = self.device.device_s(at_ns) / 3600.0;
        self.settings.zero_drift_w * (0.7 * (TAU * hours / 3.1).sin() + 0.3 * (TAU * hours / 0.71).sin())
    }

    fn drops_out(&self, at_ns: TimeNs) -> bool {
        let device_s = self.device.device_s(at_ns);
        #[expect(clippy::cast_possible_truncation, reason = "stretches of centuries fit")]
        let stretch = (device_s / DROPOUT_STRETCH_S).floor() as i64;
        let within_s = device_s.rem_euclid(DROPOUT_STRETCH_S);
        let probability = self.settings.dropouts_per_h * DROPOUT_STRETCH_S / 3600.0;
        if sample_uniform(self.seed, Purpose::Dropout, stretch) >= probability {
            return false;
        }
        let longest_s = self.settings.dropout_s.min(DROPOUT_STRETCH_S / 2.0);
        let length_s = longest_s * (0.05 + 0.95 * sample_uniform(self.seed, Purpose::DropoutLength, stretch));
        let begin_s = (DROPOUT_STRETCH_S - length_s) * sample_uniform(self.seed, Purpose::DropoutPlace, stretch);
        (begin_s..begin_s + length_s).contains(&within_s)
    }

    fn append_readings(&self, stamp: Stamp, out: &mut Vec<Reading>) {
        let numbers = self.average_window(self.device.newest_beat(stamp.mid_ns)).collect_numbers();
        let readings = self.channels.iter().zip(numbers);
        out.extend(readings.map(|(channel, number)| Reading::from_number(*channel, stamp, number)));
    }
}

fn round_to_tenth(number: f64) -> f64 {
    (number * 10.0).round() / 10.0
}

fn round_to_hundredth(number: f64) -> f64 {
    (number * 100.0).round() / 100.0
}

impl Source for SimulatedMeter {
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
        let silent = self.drops_out(began_ns);
        let wait_ns = if silent { saturate_to_wait_ns(DEADLINE) } else { self.device.round_trip_ns() };
        clock.sleep_until(began_ns + wait_ns);
        let ended_ns = clock.now_ns();
        self.device.schedule_next_poll(ended_ns);
        if silent {
            return Err(build_timeout_error(&self.name));
        }
        self.append_readings(Stamp::of_request(began_ns, ended_ns), out);
        Ok(())
    }
}

impl Pull for SimulatedMeter {
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
        let began_ns = self.device.next_begin_ns();
        let silent = self.drops_out(began_ns);
        Some(began_ns + if silent { saturate_to_wait_ns(DEADLINE) } else { self.device.round_trip_ns() })
    }

    fn pull_readings(&mut self, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let began_ns = self.device.next_begin_ns();
        let ended_ns = self.next_ns().unwrap_or(began_ns);
        let silent = self.drops_out(began_ns);
        self.device.schedule_next_poll(ended_ns.max(began_ns + saturate_to_wait_ns(self.device.period())));
        if silent {
            return Err(build_timeout_error(&self.name));
        }
        self.append_readings(Stamp::of_request(began_ns, ended_ns), out);
        Ok(())
    }
}
