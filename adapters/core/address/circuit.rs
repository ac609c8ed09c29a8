//! What a meter sits in, and how long a request to it may take.

use super::keys::Keys;
use std::time::Duration;

/// What a power meter sits in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Circuit {
    /// The supply of the whole machine: `total_power_w`.
    Machine,
    /// The supply of the spindle drive: `spindle_power_w`, `spindle_current_a`.
    Spindle,
}

/// The key `circuit`: `machine`, which is the default, or `spindle`.
pub fn parse_circuit(keys: &mut Keys) -> Circuit {
    keys.take_choice("circuit", &[("machine", Circuit::Machine), ("spindle", Circuit::Spindle)])
}

/// The key `timeout_ms`: 10 to 60000, 500 where it is not given.
pub fn parse_timeout(keys: &mut Keys) -> Duration {
    Duration::from_millis(keys.take_number("timeout_ms", 500, 10, 60_000))
}
