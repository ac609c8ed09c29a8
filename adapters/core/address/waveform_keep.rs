//! Raw samples that stay around high currents.

use super::keys::Keys;
use super::problem::AddressProblem;
use std::path::PathBuf;

/// Raw samples that stay around high currents.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveformKeep {
    /// Where files are written.
    pub directory: PathBuf,
    /// A feature beyond this leaves a file, A.
    pub above_a: f64,
}

/// The keys `keep` and `keep_above_a`.
///
/// # Errors
/// One of them is given without the other.
pub fn parse_waveform_keep(keys: &mut Keys) -> Result<Option<WaveformKeep>, AddressProblem> {
    let directory = keys.take_text("keep").map(PathBuf::from);
    let above_a = keys.take_number("keep_above_a", 0.0, 0.0, 100_000.0);
    match directory {
        Some(directory) if above_a > 0.0 => Ok(Some(WaveformKeep { directory, above_a })),
        Some(_) => Err(AddressProblem::KeepWithoutLimit),
        None if above_a > 0.0 => Err(AddressProblem::LimitWithoutKeep),
        None => Ok(None),
    }
}
