//! Lines to devices: TLS of a client, a serial line that sources share, and a child process around the library of a vendor.
//!
//! These need the system and other people's code; the vocabulary of devices (`adapter_core`) needs neither.

pub mod child;
pub mod serial;
pub mod tls;
