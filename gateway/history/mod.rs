//! What the box remembers: samples as compressed column blocks, everything else as ordinary tables, in one `SQLite` file.
#![allow(dead_code, reason = "the reader that uses these parts follows")]

mod block;
mod commit;
mod compact;
mod error;
mod house;
mod keeper;
mod lock;
mod mailbox;
mod options;
mod overview;
mod pyramid;
mod query;
mod reader;
mod reason;
mod record;
mod record_sql;
mod recover;
mod retention;
mod rounding;
mod rows;
mod schema;
mod series;
mod space;
mod status;
mod tail;
mod thread;
mod walk;
mod writer;

pub use block::{Cells, NumberCells, Summary, WordCells};
pub use error::HistoryError;
pub use options::{DAY_NS, ExtraSeries, ExtraValue, Fidelity, Options, Retention, SeriesKind, WhenFull};
pub use overview::{Buckets, Overview};
pub use query::{Chunk, Query, STATE_SERIES};
pub use reader::Reader;
pub use reason::Reasons;
pub use record::{Alarm, AlarmClear, Command, Decision, Diagnosis, Event, Model, Part, Record, StateChange};
pub use rounding::rounded;
pub use series::{Series, decimals_of_unit};
pub use space::{DiskRoom, disk_room};
pub use status::Status;
pub use writer::Writer;
