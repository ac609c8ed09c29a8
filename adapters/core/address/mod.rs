//! The notation of addresses, `SCHEME:BODY?KEYS`: what all schemes share. What one scheme means stands with its device.

mod circuit;
mod endpoint;
mod keys;
mod login;
mod problem;
mod secrets;
mod serial_line;
mod speed;
mod waveform_keep;

pub use circuit::{Circuit, parse_circuit, parse_timeout};
pub use endpoint::{Endpoint, parse_endpoint, parse_library};
pub use keys::{Keys, parse_encoding};
pub use login::Login;
pub use problem::AddressProblem;
pub use secrets::{NO_SECRETS, mask_secrets};
pub use serial_line::{Parity, SerialTarget, parse_serial};
pub use speed::{Speed, parse_speed};
pub use waveform_keep::{WaveformKeep, parse_waveform_keep};

use std::fmt::Display;
use thiserror::Error;

/// A text that is no usable address, with everything that is wrong with it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{address}: {}", .problems.join("; "))]
pub struct AddressError {
    /// The text as given, without what could be a secret.
    pub address: String,
    /// Each problem, with what to do about it.
    pub problems: Vec<String>,
}

/// What a text `SCHEME:BODY?KEYS` means. `no_scheme` says what is missing in a text without a scheme; `target` is given
/// scheme, body and keys, and takes the keys that it knows.
///
/// # Errors
/// Everything that is wrong: what `target` says comes first, then keys that are unknown, doubled or out of range.
pub fn parse<T, E: Display>(
    text: &str,
    no_scheme: impl Fn(&str) -> String,
    target: impl Fn(&str, &str, &mut Keys) -> Result<T, E>,
) -> Result<T, AddressError> {
    let fail = |problems| AddressError { address: mask_secrets(text), problems };
    let (scheme, rest) = text.split_once(':').ok_or_else(|| fail(vec![no_scheme(text)]))?;
    let (body, query) = rest.rsplit_once('?').unwrap_or((rest, ""));
    if secrets::names_somebody(body) {
        return Err(fail(vec![NO_SECRETS.to_owned()]));
    }
    let mut keys = Keys::from_query(query);
    let target = target(scheme, body, &mut keys);
    let problems = keys.into_problems();
    match target {
        Ok(target) if problems.is_empty() => Ok(target),
        Ok(_) => Err(fail(problems)),
        Err(problem) => Err(fail(std::iter::once(problem.to_string()).chain(problems).collect())),
    }
}
