//! Why an address means nothing, apart from its keys.

use super::NO_SECRETS;
use thiserror::Error;

/// What is wrong with the part of an address that all schemes read alike. What is wrong with a key that has a value stands in
/// [`AddressError`](super::AddressError) beside it.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum AddressProblem {
    /// A user or a password stands before the host.
    #[error("{NO_SECRETS}")]
    Secret,
    /// The text in the place of a host is none.
    #[error("{0:?} is not a host; write HOST:PORT")]
    NoHost(String),
    /// The text with the host names no port from 1 to 65535, and the scheme has no port of its own.
    #[error("{0:?} has no port from 1 to 65535; write HOST:PORT")]
    NoPort(String),
    /// The key `library` is missing.
    #[error("name the vendor's library with library=FILE")]
    NoLibrary,
    /// No device file of a serial line is named.
    #[error("no serial port; write it like :///dev/ttyUSB0")]
    NoSerialPort,
    /// The key `keep` without `keep_above_a`.
    #[error("keep needs a limit: write keep_above_a=40 as well")]
    KeepWithoutLimit,
    /// The key `keep_above_a` without `keep`.
    #[error("keep_above_a needs a directory: write keep=DIRECTORY as well")]
    LimitWithoutKeep,
}
