//! How the simulated machine and its two devices are set up.

use super::ladder::LadderSettings;
use crate::address::{SimulatedDay, SimulatedMachine, SimulatedTarget};
use std::time::Duration;

/// Wear land of an edge that has just been changed.
pub(super) const FRESH_EDGE_MM: f64 = 0.005;

/// How heavy the cuts are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CutLevel {
    /// The planned cutting forces times this factor; 1 is the plan.
    Planned(f64),
    /// Every cut adds this share of the no-load power of the moment (cutting power and load loss together); 0.05 is a
    /// light cut. For scoring.
    OfNoLoad(f64),
}

/// A device's own clock, and how it answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviceSettings {
    /// Pace at which it is polled.
    pub period: Duration,
    /// Its values are refreshed this often, on its own clock. For the meter this is the averaging window.
    pub refresh: Duration,
    /// Age of a value at the moment it is published inside the device.
    pub latency: Duration,
    /// Shortest duration of a request.
    pub round_trip: Duration,
    /// Typical excess of a request over the shortest one; one in a hundred takes five times this.
    pub jitter: Duration,
    /// Its clock minus the gateway's at the start, s.
    pub clock_offset_s: f64,
    /// Its clock runs fast by so many parts per million.
    pub clock_drift_ppm: f64,
}

impl DeviceSettings {
    /// How old a value is on average when it is asked for: its latency and half of the time to the next refresh.
    #[must_use]
    pub fn mean_age(&self) -> Duration {
        self.latency + self.refresh / 2
    }
}

/// What the meter adds to the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeterSettings {
    /// Clock, window and line.
    pub device: DeviceSettings,
    /// Noise, standard deviation as a share of the reading.
    pub noise_share: f64,
    /// Noise floor, standard deviation, W.
    pub noise_floor_w: f64,
    /// Amplitude of the ripple at twice the mains frequency before averaging, share of the reading.
    pub ripple_share: f64,
    /// Probability of a pulse in a window.
    pub pulse_probability: f64,
    /// Largest pulse, W; either sign.
    pub pulse_w: f64,
    /// Amplitude of the slow drift of the zero point, W.
    pub zero_drift_w: f64,
    /// Stretches without an answer, per hour.
    pub dropouts_per_h: f64,
    /// Longest such stretch, s; the shortest is a twentieth.
    pub dropout_s: f64,
}

/// A change of the machine: harder material, a bearing that gets tight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaterChange {
    /// When, s after the start; infinite when never.
    pub after_s: f64,
    /// Cutting forces after it over those before.
    pub cut: f64,
    /// Dry and viscous friction of the spindle after it over that before.
    pub friction: f64,
}

/// An insert breaks off: of a milling cutter one of its teeth is missing from then on, of a turning tool its only edge, until the edge
/// is changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LostInsert {
    /// When, s after the start; infinite when never.
    pub after_s: f64,
    /// Number after the T of the tool.
    pub tool: u8,
}

impl LostInsert {
    /// A machine whose tools keep all of their inserts.
    pub const NEVER: Self = Self { after_s: f64::INFINITY, tool: 1 };
}

/// How the working days of the machine go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DaySettings {
    /// From power-up to the end of work, s.
    pub shift_s: f64,
    /// Pause after half of the shift, s.
    pub lunch_s: f64,
    /// From the end of work to the next power-up, s.
    pub night_s: f64,
    /// Parts between two short pauses.
    pub parts_per_pause: u32,
    /// Length of a short pause, s.
    pub pause_s: f64,
    /// Parts of one program and lot.
    pub parts_per_lot: u32,
    /// Every day begins so long after the one before, s, and holds little of everything: for a demonstration. `None`: a working
    /// day as above.
    pub rhythm_s: Option<f64>,
    /// Edges wear so many times as fast as the laws say.
    pub wear_factor: f64,
}

impl DaySettings {
    /// A day of five minutes: power-up, warm-up, four short parts, an alarm, a pause, off.
    #[must_use]
    pub fn new_short() -> Self {
        Self {
            shift_s: 235.0,
            lunch_s: 0.0,
            night_s: 0.0,
            parts_per_pause: 2,
            pause_s: 8.0,
            parts_per_lot: u32::MAX,
            rhythm_s: Some(300.0),
            wear_factor: 8.0,
        }
    }
}

impl Default for DaySettings {
    fn default() -> Self {
        Self {
            shift_s: 8.0 * 3600.0,
            lunch_s: 1800.0,
            night_s: 15.0 * 3600.0,
            parts_per_pause: 10,
            pause_s: 240.0,
            parts_per_lot: 8,
            rhythm_s: None,
            wear_factor: 1.0,
        }
    }
}

/// The simulated machine with its controller and meter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedSettings {
    /// Which of the built-in machines.
    pub machine: SimulatedMachine,
    /// Seed of everything random.
    pub seed: u64,
    /// Time constant with which the power settles after a spindle start, s.
    pub tau_s: f64,
    /// Peak above the no-load power at the start of the spindle, W.
    pub start_peak_w: f64,
    /// How heavy the cuts are.
    pub cut: CutLevel,
    /// Change the spindle speed between passes of one operation.
    pub speed_changes: bool,
    /// Does the controller deliver what the program is annotated with?
    pub annotations: bool,
    /// Standard deviation of a gauge that measures the thermal error, um; 0: there is none.
    pub gauge_um: f64,
    /// Flank wear of every edge at the start, mm.
    pub wear_mm: f64,
    /// What becomes of the machine later.
    pub change: LaterChange,
    /// An insert that breaks off.
    pub lost_insert: LostInsert,
    /// The builder's ladder between the gateway and the feed.
    pub ladder: LadderSettings,
    /// The controller's clock and line.
    pub controller: DeviceSettings,
    /// The meter's clock, line, noise and pulses.
    pub meter: MeterSettings,
    /// How the working days go.
    pub day: DaySettings,
}

impl Default for SimulatedSettings {
    fn default() -> Self {
        Self {
            machine: SimulatedMachine::Lathe,
            seed: 1,
            tau_s: 0.6,
            start_peak_w: 3000.0,
            cut: CutLevel::Planned(1.0),
            speed_changes: false,
            annotations: true,
            gauge_um: 0.0,
            wear_mm: FRESH_EDGE_MM,
            change: LaterChange { after_s: f64::INFINITY, cut: 1.0, friction: 1.0 },
            lost_insert: LostInsert::NEVER,
            ladder: LadderSettings::default(),
            controller: DeviceSettings {
                period: Duration::from_millis(100),
                refresh: Duration::from_millis(8),
                latency: Duration::from_millis(12),
                round_trip: Duration::from_millis(6),
                jitter: Duration::from_millis(4),
                clock_offset_s: 1.7,
                clock_drift_ppm: -11.0,
            },
            meter: MeterSettings::default(),
            day: DaySettings::default(),
        }
    }
}

impl MeterSettings {
    /// The same meter with this lag against that controller, or the least one that its window allows.
    #[must_use]
    pub fn with_lag(mut self, lag: Duration, controller: &DeviceSettings) -> Self {
        self.device.latency = (lag + controller.mean_age()).saturating_sub(self.device.refresh);
        self
    }
}

impl Default for MeterSettings {
    fn default() -> Self {
        Self {
            device: DeviceSettings {
                period: Duration::from_millis(100),
                refresh: Duration::from_millis(64),
                latency: Duration::from_millis(30),
                round_trip: Duration::from_millis(11),
                jitter: Duration::from_millis(6),
                clock_offset_s: -42.0,
                clock_drift_ppm: 37.0,
            },
            noise_share: 0.01,
            noise_floor_w: 1.5,
            ripple_share: 0.25,
            pulse_probability: 0.002,
            pulse_w: 2500.0,
            zero_drift_w: 4.0,
            dropouts_per_h: 1.0,
            dropout_s: 4.0,
        }
    }
}

impl SimulatedSettings {
    /// The settings an address asks for.
    #[must_use]
    pub fn from_target(target: &SimulatedTarget) -> Self {
        let base = Self::default();
        let noise_share = target.noise_pct / 100.0;
        // A pulse while the machine is off looks like a fault to whoever sees the machine for the first time.
        let pulse_probability = if target.day == SimulatedDay::Short { 0.0 } else { base.meter.pulse_probability };
        Self {
            machine: target.machine,
            seed: target.seed,
            tau_s: target.tau_s,
            cut: CutLevel::Planned(target.cut_pct / 100.0),
            speed_changes: target.speed_changes,
            annotations: target.annotations,
            gauge_um: target.gauge_um,
            wear_mm: target.wear_mm,
            change: LaterChange {
                after_s: 3600.0 * target.change_h,
                cut: target.change_cut_pct / 100.0,
                friction: target.change_friction_pct / 100.0,
            },
            lost_insert: LostInsert { after_s: 3600.0 * target.lost_insert_h, tool: target.lost_insert_tool },
            ladder: LadderSettings { rule: target.ladder, ..base.ladder },
            day: match target.day {
                SimulatedDay::Work => base.day,
                SimulatedDay::Shifts => DaySettings { night_s: 1200.0, ..base.day },
                SimulatedDay::Short => DaySettings::new_short(),
            },
            meter: MeterSettings {
                noise_share,
                pulse_probability,
                dropouts_per_h: target.dropouts_per_h,
                ..base.meter
            }
            .with_lag(Duration::from_secs_f64(target.meter_lag_ms / 1e3), &base.controller),
            ..base
        }
    }

    /// A meter without noise, ripple, pulses, drift and dropouts.
    #[must_use]
    pub fn with_ideal_meter(mut self) -> Self {
        self.meter.noise_share = 0.0;
        self.meter.noise_floor_w = 0.0;
        self.meter.ripple_share = 0.0;
        self.meter.pulse_probability = 0.0;
        self.meter.zero_drift_w = 0.0;
        self.meter.dropouts_per_h = 0.0;
        self
    }
}
