//! What an address says of a meter.

use crate::{OwnRegister, TcpFraming};
use adapter_core::address::{Circuit, Keys, parse_circuit, parse_timeout};
use adapter_core::own::Own;
use std::path::PathBuf;
use std::time::Duration;
use thiserror::Error;

/// A Modbus meter on its line.
#[derive(Debug, Clone, PartialEq)]
pub struct MeterTarget {
    /// Unit identifier of the meter, at most 247.
    pub unit: u8,
    /// Name of the register profile.
    pub profile: String,
    /// Directory of the user's own profiles.
    pub profiles: Option<PathBuf>,
    /// The supply that the meter sits in.
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

/// The key `profile` is missing: which registers a meter has cannot be guessed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("name the meter's registers with profile=NAME")]
pub struct NoProfile;

/// The keys of a Modbus meter.
///
/// # Errors
/// No profile is named.
pub fn parse_modbus(keys: &mut Keys, least_unit: u8) -> Result<MeterTarget, NoProfile> {
    let unit = keys.take_number("unit", 1, least_unit, 247);
    let profile = keys.take_text("profile");
    let profiles = keys.take_text("profiles").map(PathBuf::from);
    let circuit = parse_circuit(keys);
    let (ct, pt) = (keys.take_number("ct", 1.0, 0.001, 100_000.0), keys.take_number("pt", 1.0, 0.001, 100_000.0));
    let timeout = parse_timeout(keys);
    let profile = profile.ok_or(NoProfile)?;
    let framing = TcpFraming::default();
    Ok(MeterTarget { unit, profile, profiles, circuit, ct, pt, timeout, framing, own: Vec::new() })
}

/// `framing=rtu`: frames of a serial line, as a transparent converter carries them.
pub fn parse_framing(keys: &mut Keys) -> TcpFraming {
    keys.take_choice("framing", &[("tcp", TcpFraming::Tcp), ("rtu", TcpFraming::Rtu)])
}
