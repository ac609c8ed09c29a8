//! What the box remembers: samples as compressed column blocks, everything else as ordinary tables, in one `SQLite` file.
//!
//! # Layout, and why
//! A row per sample is the obvious layout and the wrong one. The rows of a minute are one database row instead: a small
//! directory, and one stream per series (scaled integers, differences, zigzag varints, zstd); every night ten of them
//! become one. Each minute adds its summary to minutes, hours and days, from which long ranges are drawn. The running
//! minute lies in a crash tail of JSON texts that any `SQLite` client can read.
//!
//! Measured on one day at 10 Hz with 20 quantities (`cargo test --release --test records history::figures -- --ignored
//! --nocapture --test-threads 1`, functions in `tests/records/history/figures.rs`; synthetic signals, so real machines may
//! differ by a factor of two):
//!
//! | | row per sample | blocks with summaries, fresh | after compaction |
//! |---|---|---|---|
//! | readings as meters quantise them, bytes per tick | 139.5 | 15.5 | 11.6 |
//! | the same, gigabytes per year | 44.0 | 4.9 | 3.7 |
//! | interpolated readings, bytes per tick | 160.6 | 16.9 | 14.8 |
//! | the same, gigabytes per year | 50.7 | 5.3 | 4.7 |
//! | written to the disk at one commit a second, MB per day | 843 | see `write_amplification` | |
//!
//! # What comes back
//! A decimal of at most 9 significant digits and 9 places comes back bit for bit; any other number (interpolated,
//! estimated) rounded to the resolution of its unit ([`decimals_of_unit`]), the same in the tail, the blocks and every
//! answer; publish [`as_stored`] and the page shows the same digits. [`Fidelity::Exact`] keeps every bit. Each missing
//! value keeps its reason. The age of a value within its tick is not stored.
//!
//! # Durability
//! One thread writes; commits are grouped (at most [`Options::group_commit`] late) and end in an fsync. What
//! [`Writer::acknowledged_through_ns`] and [`Writer::acknowledged_record`] have reached survives a killed process and a
//! power cut. A full disk costs the oldest raw samples and nothing else; a clock that goes back begins a new segment.
//!
//! # The audit
//! What the gate was asked for, let through, wrote and read back, and who armed it, stands in rows that are only appended and
//! each hold the hash of the one before ([`Reader::verify_audit`]). Retention takes the oldest of them last of all, and says
//! through which number.
//!
//! # The outbox
//! What other systems are sent is numbered and kept beside the samples until every sink has delivered it: see [`Outbox`].
//!
//! # Who does what
//! `mailbox` takes in, `minute_buffer` gathers and seals, `commit` makes durable, `maintenance` keeps order, all on `thread`;
//! [`Reader`] answers on connections of its own: `walk` goes through a range, `query`, `overview`, `list`, `sql` and
//! `export` ask.

mod audit;
mod audit_reading;
#[cfg(test)]
mod audit_tests;
mod block;
mod commit;
mod compact;
mod damage;
mod earlier;
mod error;
mod export;
mod fact;
mod fact_reading;
mod ffi;
mod future;
mod info;
mod levels;
mod list;
mod lock;
mod mailbox;
mod maintenance;
mod minute_buffer;
mod options;
mod outbox;
mod overview;
mod pages;
mod pyramid;
mod query;
mod readable_time;
mod reader;
mod reason;
mod record_sql;
mod recover;
mod redate;
mod repair;
mod retention;
mod rounding;
mod rows;
mod schema;
mod seal;
mod segments;
mod series;
mod series_kind;
mod set_apart;
mod space;
#[cfg(test)]
mod sparse_rows_tests;
mod sql;
mod status;
mod tables;
mod tail;
mod thread;
mod vtab;
mod walk;
mod wear_models;
mod writer;

pub use audit::{AuditCheck, AuditEntry, AuditRemoval, Break, audit_document};
pub use block::{Cells, NumberCells, ValueSummary, WordCells};
pub use damage::{Aside, DamagedRows, damaged_files, set_aside};
pub use earlier::{COPYING, go_back, is_going_back, remove_old_copies};
pub use error::HistoryError;
pub use export::{DayWritten, Format, day_of, plain_cell};
pub use future::FutureRows;
pub use gateway_records::{
    Alarm, AlarmClear, Audit, Command, Decision, Diagnosis, Event, Fact, FactKind, Model, Part, ReactionTime, Record,
    StateChange,
};
pub use info::{Dropped, Info, TableRows};
pub use list::{AlarmEntry, RecordSpan, StateHour, StateInterval};
pub use options::{DAY_NS, Options, Retention, WhenFull};
pub use outbox::parse_nested_json;
pub use outbox::{
    Cell, Content, DeliveryState, Gap, Item, ItemMove, NOT_RUNNING, Outbox, OutboxFigures, OutboxHead, OutboxReader,
    OutboxSettings, OutboxStretch, Position, RESENT_EPOCH, Reading, ResentItems, SeriesInfo, SeriesMean, box_id,
};
pub use overview::{Buckets, Overview};
pub use query::{Chunk, Query, STATE_SERIES};
pub use reader::Reader;
pub use reason::Reasons;
pub use redate::{Redated, set_clock};
pub use repair::{Repaired, RepairedTable, repair_history};
pub use rounding::round_to_decimals;
pub use rusqlite::types::Value as SqlValue;
pub use schema::page_layer;
pub use series::{Series, as_stored, decimals_of_unit};
pub use series_kind::{ExtraSeries, ExtraValue, Fidelity, SeriesKind};
pub use set_apart::{SetApart, set_apart};
pub use space::{DiskRoom, disk_room};
pub use sql::SQL_WITHIN;
pub use status::HistoryFigures;
pub use wear_models::{StoredWearModel, store_wear_model, store_wear_models};
pub use writer::{Writer, WriterLife};
