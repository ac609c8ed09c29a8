//! What a `simulated://` address says.

use adapter_core::address::{Keys, Speed, parse_speed};
use adapter_core::driver::LadderRule;
use thiserror::Error;

/// The machines that are built in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimulatedMachine {
    /// A two-axis lathe with a turret.
    Lathe,
    /// A three-axis mill with a tool changer.
    Mill,
}

/// Which of the built-in machine's two devices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimulatedDevice {
    /// The controller and the meter.
    Both,
    /// The controller without the meter.
    Controller,
    /// The meter without the controller.
    Meter,
}

/// How the days of the built-in machine go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimulatedDay {
    /// Eight hours of work, then a night.
    Work,
    /// The next shift comes after twenty minutes: for a demonstration faster than real time.
    Shifts,
    /// A whole day again and again in five minutes, with quick wear: for a demonstration.
    Short,
}

/// The built-in machine as an address describes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedTarget {
    /// The machine that the address names.
    pub machine: SimulatedMachine,
    /// Which of its devices are sources.
    pub device: SimulatedDevice,
    /// Seed of everything random; the same seed gives the same readings.
    pub seed: u64,
    /// Against the clock; the gateway runs all its clocks at this factor.
    pub speed: Speed,
    /// Time constant of the spindle start, s.
    pub tau_s: f64,
    /// Strength of every cut in percent of the plan; 5 is a very light cut.
    pub cut_pct: f64,
    /// Noise of the meter, percent of the reading.
    pub noise_pct: f64,
    /// Meter dropouts per hour.
    pub dropouts_per_h: f64,
    /// How late the meter's averages are on the average against what the controller says at the same stamp, ms.
    pub meter_lag_ms: f64,
    /// Does the spindle change its speed between the passes of one operation?
    pub speed_changes: bool,
    /// Does the controller deliver what the program is annotated with (depth of cut, diameter, operation)?
    pub annotations: bool,
    /// Standard deviation of a gauge that measures the thermal error, um; 0: there is none.
    pub gauge_um: f64,
    /// Flank wear of every edge at the start, mm.
    pub wear_mm: f64,
    /// The machine changes after so many hours; infinite when it never does.
    pub change_h: f64,
    /// Strength of every cut after the change, percent of that before.
    pub change_cut_pct: f64,
    /// Friction of the spindle after the change, percent of that before.
    pub change_friction_pct: f64,
    /// An insert breaks off after so many hours; infinite when none does.
    pub lost_insert_h: f64,
    /// Number after the T of the tool whose insert breaks off.
    pub lost_insert_tool: u8,
    /// Its day has begun so many seconds ago.
    pub begun_s: f64,
    /// How its days go.
    pub day: SimulatedDay,
    /// How the ladder combines the operator's dial and the gateway's override.
    pub ladder: LadderRule,
}

/// The body of the address is neither `lathe` nor `mill`.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("no simulated machine {0:?}; there are simulated://lathe and simulated://mill")]
pub struct NoSuchMachine(pub String);

/// The machine that the address names.
///
/// # Errors
/// There is no such machine.
pub fn parse_simulated(body: &str, keys: &mut Keys) -> Result<SimulatedTarget, NoSuchMachine> {
    use SimulatedDevice::{Both, Controller, Meter};
    let target = SimulatedTarget {
        machine: SimulatedMachine::Lathe,
        device: keys.take_choice("device", &[("both", Both), ("controller", Controller), ("meter", Meter)]),
        seed: keys.take_number("seed", 1, 0, u64::MAX),
        speed: parse_speed(keys),
        tau_s: keys.take_number("tau_s", 0.6, 0.05, 10.0),
        cut_pct: keys.take_number("cut_pct", 100.0, 0.0, 300.0),
        noise_pct: keys.take_number("noise_pct", 1.0, 0.0, 50.0),
        meter_lag_ms: keys.take_number("meter_lag_ms", 78.0, 50.0, 1500.0),
        dropouts_per_h: keys.take_number("dropouts_per_h", 1.0, 0.0, 3600.0),
        speed_changes: keys.take_choice("speed_changes", &[("no", false), ("yes", true)]),
        annotations: keys.take_choice("annotations", &[("yes", true), ("no", false)]),
        gauge_um: keys.take_number("gauge_um", 0.0, 0.0, 100.0),
        wear_mm: keys.take_number("wear_mm", 0.005, 0.0, 0.29),
        change_h: keys.take_number("change_h", f64::INFINITY, 0.0, 1e5),
        change_cut_pct: keys.take_number("change_cut_pct", 100.0, 10.0, 300.0),
        change_friction_pct: keys.take_number("change_friction_pct", 100.0, 10.0, 300.0),
        lost_insert_h: keys.take_number("lost_insert_h", f64::INFINITY, 0.0, 1e5),
        lost_insert_tool: keys.take_number("lost_insert_tool", 1, 1, 7),
        begun_s: keys.take_number("begun_s", 0.0, 0.0, 86_400.0),
        day: keys.take_choice(
            "day",
            &[("work", SimulatedDay::Work), ("shifts", SimulatedDay::Shifts), ("short", SimulatedDay::Short)],
        ),
        ladder: keys.take_choice(
            "ladder",
            &[("least", LadderRule::Least), ("product", LadderRule::Product), ("replace", LadderRule::Replace)],
        ),
    };
    match body.strip_prefix("//").unwrap_or(body) {
        "lathe" => Ok(target),
        "mill" => Ok(SimulatedTarget { machine: SimulatedMachine::Mill, ..target }),
        other => Err(NoSuchMachine(other.to_owned())),
    }
}
