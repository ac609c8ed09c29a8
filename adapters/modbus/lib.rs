//! Modbus meters, over TCP and over a serial line: the protocol spoken by ourselves.
//!
//! Sources: Modbus Application Protocol 1.1b3 (request and answer), Modbus Messaging on TCP/IP 1.0b (the header), Modbus
//! over Serial Line 1.02 (RTU frames, silences, CRC). Which register holds what is in profiles, as TOML.
//!
//! | file | what |
//! |---|---|
//! | `pdu` | what is asked and answered, whatever carries it; both sides |
//! | `crc` | the check of an RTU frame |
//! | `line` | one request and its answer over either carrier, and every way in which that fails |
//! | `tcp`, `rtu` | the two carriers |
//! | `number` | registers to numbers and back: widths, word order, sign and magnitude |
//! | `profile`, `register` | which register holds what: shipped files, the user's own, everything wrong with one told at once |
//! | `own_register` | what the user can have read besides |
//! | `plan` | the fewest blocks that hold all registers of a profile, and what they take on the wire |
//! | `poll` | one poll, in parts where the meter does not give a block as a whole |
//! | `outputs` | from registers to channels, and to what [`electric`](adapter_core::electric) judges |
//! | `refresh` | how often the meter really has something new |
//! | `meter` | the source |
//!
//! A poll is one request as a rule: a profile's registers are read as one block wherever they lie close enough together.
//! Every request has a deadline of its own (`timeout_ms`, 500 unless given). When it passes, or the answer cannot be
//! understood, nothing that belongs to this request may ever be taken for the answer to the next one: over TCP the
//! connection is closed (and besides every answer must carry the transaction number of its request); on a serial line,
//! which knows no numbers, the line is kept quiet until the late answer has come or twice the deadline has passed, and
//! after that an answer must still come from the right unit, with the right function and length and a good CRC.
//!
//! Limits: 125 registers per block, 8 blocks per profile, 64 values per profile, one frame in memory.
//!
//! What a meter says is kept as it is, with its sign: a spindle that brakes feeds power back, and that is negative.

pub mod address;
mod crc;
#[cfg(test)]
mod crossed_tests;
mod error;
pub mod line;
mod meter;
mod number;
mod outputs;
mod own_register;
pub mod pdu;
mod plan;
mod poll;
pub mod profile;
mod refresh;
pub mod register;
mod rtu;
pub mod tcp;

pub use error::MeterError;
pub use meter::ModbusMeter;
pub use number::{Format, WordOrder};
pub use own_register::{InRegisters, OwnRegister};
pub use plan::{PollBlocks, wire_time};
pub use refresh::Refresh;
pub use tcp::TcpFraming;
