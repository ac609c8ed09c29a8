//! What each scheme of an address means, typed.

use super::SCHEMES;
use super::fanuc::{self, FanucOptions};
use super::huazhong::{HncNetTarget, NcLinkTarget, parse_hncnet, parse_nclink};
use super::keys::Keys;
use super::meter::{self, EdaTarget, MeterTarget, WaveformKeep};
use crate::channel::find_nearest_name;
use crate::driver::LadderRule;
use std::path::PathBuf;

/// How fast a replay or a simulated machine runs against the clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// So many times real time.
    Times(f64),
    /// As fast as the pipeline takes it.
    Max,
}

/// Which built-in machine.
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
    /// Only the controller.
    Controller,
    /// Only the meter.
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

/// The built-in machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedTarget {
    /// Lathe or mill.
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
    /// Flank wear of every edge at the start, mm.
    pub wear_mm: f64,
    /// The machine changes after so many hours; infinite when it never does.
    pub change_h: f64,
    /// Strength of every cut after the change, percent of that before.
    pub change_cut_pct: f64,
    /// Friction of the spindle after the change, percent of that before.
    pub change_friction_pct: f64,
    /// Its day has begun so many seconds ago.
    pub begun_s: f64,
    /// How its days go.
    pub day: SimulatedDay,
    /// How the ladder combines the operator's dial and the gateway's override.
    pub ladder: LadderRule,
}

/// A recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplayTarget {
    /// The file, `.csv` or `.csv.gz`.
    pub file: PathBuf,
    /// Against the clock.
    pub speed: Speed,
}

/// A host and port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    /// Name or number of the host, without brackets.
    pub host: String,
    /// TCP port.
    pub port: u16,
}

/// How FOCAS2 is spoken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FanucBackend {
    /// By ourselves.
    Native,
    /// Through this vendor library, in a child process.
    Vendor(PathBuf),
}

/// Parity of a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parity {
    /// No parity bit.
    None,
    /// Even parity.
    Even,
    /// Odd parity.
    Odd,
}

/// A serial line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SerialTarget {
    /// The device file.
    pub port: PathBuf,
    /// Bits per second.
    pub baud: u32,
    /// Parity bit.
    pub parity: Parity,
}

/// What an address means.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// The built-in machine.
    Simulated(SimulatedTarget),
    /// A recording.
    Replay(ReplayTarget),
    /// A FANUC controller.
    Fanuc {
        /// Where.
        at: Endpoint,
        /// Path (channel) of the controller, from 1.
        path: u8,
        /// How.
        backend: FanucBackend,
        /// Pace, limits and the way of writing.
        options: Box<FanucOptions>,
    },
    /// A Huazhong controller by NC-Link over MQTT.
    NcLink(NcLinkTarget),
    /// A Huazhong controller through its vendor library.
    HncNet(HncNetTarget),
    /// A Modbus device on the network.
    ModbusTcp {
        /// Where.
        at: Endpoint,
        /// Which meter, and what it measures.
        meter: MeterTarget,
    },
    /// A Modbus device on a serial line.
    ModbusRtu {
        /// Where.
        line: SerialTarget,
        /// Which meter, and what it measures.
        meter: MeterTarget,
    },
    /// An EDA9033A meter in its native protocol.
    Eda9033a {
        /// Where.
        line: SerialTarget,
        /// Which meter, and what it measures.
        meter: EdaTarget,
    },
    /// Temperature sensors of the box itself.
    Temperature {
        /// The file that names them.
        file: PathBuf,
        /// Where the kernel shows devices; `/sys` everywhere but in tests.
        sys: PathBuf,
    },
    /// A framed stream of samples.
    Waveform {
        /// Where.
        at: Endpoint,
        /// Raw samples that stay.
        keep: Option<WaveformKeep>,
    },
}

pub(super) fn parse(scheme: &str, body: &str, keys: &mut Keys) -> Result<Target, String> {
    match scheme {
        "simulated" => parse_simulated(body, keys),
        "replay" => parse_replay(body, keys),
        "fanuc" => parse_fanuc(body, keys),
        "nclink" => parse_nclink(body, keys, false),
        "nclinks" => parse_nclink(body, keys, true),
        "hncnet" => parse_hncnet(body, keys),
        "modbus-tcp" => {
            let (meter, framing) = (meter::parse_modbus(keys, 0), meter::parse_framing(keys));
            let meter = meter.map(|meter| MeterTarget { framing, ..meter });
            Ok(Target::ModbusTcp { at: parse_endpoint(body, Some(502))?, meter: meter? })
        }
        "modbus-rtu" => {
            let (line, meter) = (parse_serial(body, keys), meter::parse_modbus(keys, 1));
            Ok(Target::ModbusRtu { line: line?, meter: meter? })
        }
        "eda9033a" => {
            let (line, meter) = (parse_serial(body, keys), meter::parse_eda9033a(keys));
            Ok(Target::Eda9033a { line: line?, meter })
        }
        "temperature" => {
            let sys = keys.take_text("sys").map_or_else(|| PathBuf::from("/sys"), PathBuf::from);
            let file = body.strip_prefix("//").unwrap_or(body);
            let named = !file.is_empty();
            named
                .then(|| Target::Temperature { file: PathBuf::from(file), sys })
                .ok_or_else(|| "no file; write temperature:FILE".to_owned())
        }
        "waveform" => {
            let keep = meter::parse_waveform_keep(keys);
            Ok(Target::Waveform { at: parse_endpoint(body, None)?, keep: keep? })
        }
        other => Err(unknown_scheme(other)),
    }
}

fn unknown_scheme(scheme: &str) -> String {
    let hint = find_nearest_name(scheme, SCHEMES)
        .map_or_else(|| format!("the schemes are {}", SCHEMES.join(", ")), |near| format!("did you mean {near}?"));
    format!("unknown scheme {scheme}; {hint}")
}

fn parse_simulated(body: &str, keys: &mut Keys) -> Result<Target, String> {
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
        wear_mm: keys.take_number("wear_mm", 0.005, 0.0, 0.29),
        change_h: keys.take_number("change_h", f64::INFINITY, 0.0, 1e5),
        change_cut_pct: keys.take_number("change_cut_pct", 100.0, 10.0, 300.0),
        change_friction_pct: keys.take_number("change_friction_pct", 100.0, 10.0, 300.0),
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
        "lathe" => Ok(Target::Simulated(target)),
        "mill" => Ok(Target::Simulated(SimulatedTarget { machine: SimulatedMachine::Mill, ..target })),
        other => Err(format!("no simulated machine {other:?}; there are simulated://lathe and simulated://mill")),
    }
}

fn parse_replay(body: &str, keys: &mut Keys) -> Result<Target, String> {
    let speed = parse_speed(keys);
    let file = body.strip_prefix("//").unwrap_or(body);
    if file.is_empty() {
        return Err("no file; write replay:FILE".to_owned());
    }
    Ok(Target::Replay(ReplayTarget { file: PathBuf::from(file), speed }))
}

fn parse_speed(keys: &mut Keys) -> Speed {
    let Some(text) = keys.take_text("speed") else { return Speed::Times(1.0) };
    if text == "max" {
        return Speed::Max;
    }
    match text.parse::<f64>() {
        Ok(times) if (0.001..=100_000.0).contains(&times) => Speed::Times(times),
        _ => {
            keys.add_problem(format!("speed={text}: give max or a factor from 0.001 to 100000"));
            Speed::Times(1.0)
        }
    }
}

fn parse_fanuc(body: &str, keys: &mut Keys) -> Result<Target, String> {
    let named = keys.take_optional_number("path", 1, 10);
    let vendor = keys.take_choice("backend", &[("native", false), ("vendor", true)]);
    let backend = if vendor { parse_library(keys).map(FanucBackend::Vendor) } else { Ok(FanucBackend::Native) };
    let mut options = Box::new(FanucOptions::read(keys));
    let path = match fanuc::parse_paths(keys) {
        Some((own, further)) => {
            if named.is_some() {
                keys.add_problem("give either path=, for one path under the plain channel names, or paths=".to_owned());
            }
            options.further = further;
            own
        }
        None => named.unwrap_or(1),
    };
    Ok(Target::Fanuc { at: parse_endpoint(body, Some(8193))?, path, backend: backend?, options })
}

pub(super) fn parse_library(keys: &mut Keys) -> Result<PathBuf, String> {
    keys.take_text("library").map(PathBuf::from).ok_or_else(|| "name the vendor's library with library=FILE".to_owned())
}

fn parse_serial(body: &str, keys: &mut Keys) -> Result<SerialTarget, String> {
    let baud = keys.take_number("baud", 9600, 300, 4_000_000);
    let parity = keys.take_choice("parity", &[("none", Parity::None), ("even", Parity::Even), ("odd", Parity::Odd)]);
    let port = body.strip_prefix("//").unwrap_or(body);
    if port.is_empty() {
        return Err("no serial port; write it like :///dev/ttyUSB0".to_owned());
    }
    Ok(SerialTarget { port: PathBuf::from(port), baud, parity })
}

/// Host and port of `//HOST:PORT`, or of `HOST` with the default port.
///
/// # Errors
/// What is wrong, in words.
pub fn parse_endpoint(body: &str, default_port: Option<u16>) -> Result<Endpoint, String> {
    let text = body.strip_prefix("//").unwrap_or(body).trim_end_matches('/');
    if text.contains('@') {
        return Err(super::NO_SECRETS.to_owned());
    }
    let (host, port) = split_port(text);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    if host.is_empty() || host.contains('/') {
        return Err(format!("{text:?} is not a host; write HOST:PORT"));
    }
    let port = match port {
        Some(port) => port.parse().ok().filter(|port| *port > 0),
        None => default_port,
    };
    let port = port.ok_or_else(|| format!("{text:?} has no port from 1 to 65535; write HOST:PORT"))?;
    Ok(Endpoint { host: host.to_owned(), port })
}

/// Splits at the last colon, unless it belongs to a bracketed IPv6 address.
fn split_port(text: &str) -> (&str, Option<&str>) {
    match text.rsplit_once(':') {
        Some((host, port)) if !port.contains(']') => (host, Some(port)),
        _ => (text, None),
    }
}
