//! What an address says of a meter.

use super::keys::Keys;
use crate::modbus::{OwnRegister, TcpFraming};
use crate::own::Own;
use std::path::PathBuf;
use std::time::Duration;

/// What a power meter sits in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Circuit {
    /// The supply of the whole machine: `total_power_w`.
    Machine,
    /// The supply of the spindle drive: `spindle_power_w`, `spindle_current_a`.
    Spindle,
}

/// A Modbus meter on its line.
#[derive(Debug, Clone, PartialEq)]
pub struct MeterTarget {
    /// Unit identifier.
    pub unit: u8,
    /// Name of the register profile.
    pub profile: String,
    /// Directory of the user's own profiles.
    pub profiles: Option<PathBuf>,
    /// What it measures.
    pub circuit: Circuit,
    /// Ratio of the current transformers, where the meter does not count it in.
    pub ct: f64,
    /// Ratio of the voltage transformers, where the meter does not count it in.
    pub pt: f64,
    /// How long a request may take.
    pub timeout: Duration,
    /// Frames on a network.
    pub framing: TcpFraming,
    /// The user's own channels, which the configuration adds.
    pub own: Vec<Own<OwnRegister>>,
}

/// An EDA9033A in its native protocol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdaTarget {
    /// Device address.
    pub address: u8,
    /// Ratio of the current transformers.
    pub ct: f64,
    /// What it measures.
    pub circuit: Circuit,
    /// How long a request may take.
    pub timeout: Duration,
}

/// Raw samples that stay around high currents.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveformKeep {
    /// Where files are written.
    pub directory: PathBuf,
    /// A feature beyond this leaves a file, A.
    pub above_a: f64,
}

/// The keys of a Modbus meter.
pub(super) fn parse_modbus(keys: &mut Keys, least_unit: u8) -> Result<MeterTarget, String> {
    let unit = keys.take_number("unit", 1, least_unit, 247);
    let profile = keys.take_text("profile");
    let profiles = keys.take_text("profiles").map(PathBuf::from);
    let circuit = parse_circuit(keys);
    let (ct, pt) = (keys.take_number("ct", 1.0, 0.001, 100_000.0), keys.take_number("pt", 1.0, 0.001, 100_000.0));
    let timeout = parse_timeout(keys);
    let profile = profile.ok_or_else(|| "name the meter's registers with profile=NAME".to_owned())?;
    let framing = TcpFraming::default();
    Ok(MeterTarget { unit, profile, profiles, circuit, ct, pt, timeout, framing, own: Vec::new() })
}

/// `framing=rtu`: frames of a serial line, as a transparent converter carries them.
pub(super) fn parse_framing(keys: &mut Keys) -> TcpFraming {
    keys.take_choice("framing", &[("tcp", TcpFraming::Tcp), ("rtu", TcpFraming::Rtu)])
}

fn parse_timeout(keys: &mut Keys) -> Duration {
    Duration::from_millis(keys.take_number("timeout_ms", 500, 10, 60_000))
}

fn parse_circuit(keys: &mut Keys) -> Circuit {
    keys.take_choice("circuit", &[("machine", Circuit::Machine), ("spindle", Circuit::Spindle)])
}

/// The keys of an EDA9033A.
pub(super) fn parse_eda9033a(keys: &mut Keys) -> EdaTarget {
    let (address, ct) = (keys.take_number("address", 1, 0, 255), keys.take_number("ct", 1.0, 0.001, 10_000.0));
    EdaTarget { address, ct, circuit: parse_circuit(keys), timeout: parse_timeout(keys) }
}

/// The keys of a waveform whose raw samples stay.
pub(super) fn parse_waveform_keep(keys: &mut Keys) -> Result<Option<WaveformKeep>, String> {
    let directory = keys.take_text("keep").map(PathBuf::from);
    let above_a = keys.take_number("keep_above_a", 0.0, 0.0, 100_000.0);
    match directory {
        Some(directory) if above_a > 0.0 => Ok(Some(WaveformKeep { directory, above_a })),
        Some(_) => Err("keep needs a limit: write keep_above_a=40 as well".to_owned()),
        None if above_a > 0.0 => Err("keep_above_a needs a directory: write keep=DIRECTORY as well".to_owned()),
        None => Ok(None),
    }
}
