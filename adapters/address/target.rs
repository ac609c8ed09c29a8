//! What each scheme of an address means, typed.

use super::SCHEMES;
use super::eda9033a::{EdaTarget, parse_eda9033a};
use adapter_core::address::{
    AddressProblem, Endpoint, Keys, SerialTarget, Speed, WaveformKeep, parse_endpoint, parse_serial, parse_speed,
    parse_waveform_keep,
};
use adapter_core::channel::find_nearest_name;
use fanuc::address::{FanucBackend, FanucOptions, FanucTarget, parse_fanuc};
use hnc::address::{HncNetTarget, parse_hncnet};
use modbus::address::{MeterTarget, NoProfile, parse_framing, parse_modbus};
use mtconnect::address::{MtConnectTarget, parse_mtconnect};
use nclink::address::{NcLinkAddressError, NcLinkTarget, parse_nclink};
use simulated::address::{NoSuchMachine, SimulatedTarget, parse_simulated};
use std::path::PathBuf;
use thiserror::Error;

/// A recording that is replayed.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplayTarget {
    /// The file, `.csv` or `.csv.gz`.
    pub file: PathBuf,
    /// How fast it runs against the clock.
    pub speed: Speed,
}

/// What an address means.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// The built-in machine, scheme `simulated`.
    Simulated(SimulatedTarget),
    /// A recording, scheme `replay`.
    Replay(ReplayTarget),
    /// A FANUC controller, scheme `fanuc`.
    Fanuc {
        /// Host and port of the controller.
        at: Endpoint,
        /// Path (channel) of the controller, from 1.
        path: u8,
        /// Natively, or through the vendor's library.
        backend: FanucBackend,
        /// Pace, limits and the way of writing.
        options: Box<FanucOptions>,
    },
    /// A Huazhong controller by NC-Link over MQTT.
    NcLink(NcLinkTarget),
    /// A control behind an MTConnect agent.
    MtConnect(MtConnectTarget),
    /// A Huazhong controller through its vendor library.
    HncNet(HncNetTarget),
    /// A Modbus device on the network.
    ModbusTcp {
        /// Host and port of the meter.
        at: Endpoint,
        /// Which meter, and what it measures.
        meter: MeterTarget,
    },
    /// A Modbus device on a serial line.
    ModbusRtu {
        /// The serial line with its speed and parity.
        line: SerialTarget,
        /// Which meter, and what it measures.
        meter: MeterTarget,
    },
    /// An EDA9033A meter in its native protocol.
    Eda9033a {
        /// The serial line with its speed and parity.
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
        /// Host and port of the sampler.
        at: Endpoint,
        /// Raw samples that stay.
        keep: Option<WaveformKeep>,
    },
}

/// Why an address names no source.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub(super) enum TargetError {
    /// No scheme has this name.
    #[error("unknown scheme {scheme}; {hint}")]
    UnknownScheme {
        /// The scheme as written.
        scheme: String,
        /// The nearest scheme, or all of them.
        hint: String,
    },
    /// A scheme that reads a file, without one.
    #[error("no file; write {0}:FILE")]
    NoFile(&'static str),
    /// What several schemes read alike.
    #[error(transparent)]
    Address(#[from] AddressProblem),
    #[error(transparent)]
    Simulated(#[from] NoSuchMachine),
    /// A meter without a profile.
    #[error(transparent)]
    Modbus(#[from] NoProfile),
    /// A device behind a broker.
    #[error(transparent)]
    NcLink(#[from] NcLinkAddressError),
}

pub(super) fn parse(scheme: &str, body: &str, keys: &mut Keys) -> Result<Target, TargetError> {
    match scheme {
        "simulated" => Ok(Target::Simulated(parse_simulated(body, keys)?)),
        "replay" => parse_replay(body, keys),
        "fanuc" => {
            let FanucTarget { endpoint: at, path, backend, options } = parse_fanuc(body, keys)?;
            Ok(Target::Fanuc { at, path, backend, options: Box::new(options) })
        }
        "nclink" => Ok(Target::NcLink(parse_nclink(body, keys, false)?)),
        "nclinks" => Ok(Target::NcLink(parse_nclink(body, keys, true)?)),
        "hncnet" => Ok(Target::HncNet(parse_hncnet(body, keys)?)),
        "mtconnect" => Ok(Target::MtConnect(parse_mtconnect(body, keys)?)),
        "modbus-tcp" => {
            let (meter, framing) = (parse_modbus(keys, 0), parse_framing(keys));
            let meter = meter.map(|meter| MeterTarget { framing, ..meter });
            Ok(Target::ModbusTcp { at: parse_endpoint(body, Some(502))?, meter: meter? })
        }
        "modbus-rtu" => {
            let (line, meter) = (parse_serial(body, keys), parse_modbus(keys, 1));
            Ok(Target::ModbusRtu { line: line?, meter: meter? })
        }
        "eda9033a" => {
            let (line, meter) = (parse_serial(body, keys), parse_eda9033a(keys));
            Ok(Target::Eda9033a { line: line?, meter })
        }
        "temperature" => {
            let sys = keys.take_text("sys").map_or_else(|| PathBuf::from("/sys"), PathBuf::from);
            let file = body.strip_prefix("//").unwrap_or(body);
            let named = !file.is_empty();
            named
                .then(|| Target::Temperature { file: PathBuf::from(file), sys })
                .ok_or(TargetError::NoFile("temperature"))
        }
        "waveform" => {
            let keep = parse_waveform_keep(keys);
            Ok(Target::Waveform { at: parse_endpoint(body, None)?, keep: keep? })
        }
        other => Err(TargetError::UnknownScheme { scheme: other.to_owned(), hint: hint_at_schemes(other) }),
    }
}

fn hint_at_schemes(scheme: &str) -> String {
    find_nearest_name(scheme, SCHEMES)
        .map_or_else(|| format!("the schemes are {}", SCHEMES.join(", ")), |near| format!("did you mean {near}?"))
}

fn parse_replay(body: &str, keys: &mut Keys) -> Result<Target, TargetError> {
    let speed = parse_speed(keys);
    let file = body.strip_prefix("//").unwrap_or(body);
    if file.is_empty() {
        return Err(TargetError::NoFile("replay"));
    }
    Ok(Target::Replay(ReplayTarget { file: PathBuf::from(file), speed }))
}
