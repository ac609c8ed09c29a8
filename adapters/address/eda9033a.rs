//! What an `eda9033a:` address says.

use adapter_core::address::{Circuit, Keys, parse_circuit, parse_timeout};
use std::time::Duration;

/// An EDA9033A in its native protocol.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdaTarget {
    /// Address of the meter on its line, 0 to 255.
    pub address: u8,
    /// Ratio of the current transformers.
    pub ct: f64,
    /// The supply that the meter sits in.
    pub circuit: Circuit,
    /// How long a request may take.
    pub timeout: Duration,
}

/// The keys of an EDA9033A.
pub(super) fn parse_eda9033a(keys: &mut Keys) -> EdaTarget {
    let (address, ct) = (keys.take_number("address", 1, 0, 255), keys.take_number("ct", 1.0, 0.001, 10_000.0));
    EdaTarget { address, ct, circuit: parse_circuit(keys), timeout: parse_timeout(keys) }
}
