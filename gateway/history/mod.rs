//! What the box remembers: samples as compressed column blocks, everything else as ordinary tables, in one `SQLite` file.

#![allow(dead_code, reason = "the writer and the reader that use these parts follow")]

mod block;
mod error;
mod options;
mod reason;
mod record;
mod rounding;
mod rows;
mod series;

pub use block::{Cells, NumberCells, Summary, WordCells};
pub use error::HistoryError;
pub use options::{DAY_NS, ExtraSeries, ExtraValue, Fidelity, Options, Retention, SeriesKind, WhenFull};
pub use reason::Reasons;
pub use record::{Alarm, AlarmClear, Command, Decision, Diagnosis, Event, Model, Part, Record, StateChange};
pub use rounding::rounded;
pub use series::{Series, decimals_of_unit};
