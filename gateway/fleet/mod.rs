//! Many boxes, one place to ask: from a NATS JetStream stream into PostgreSQL.
//!
//! Each box sends its items into the stream by itself (sink `nats://`). `fleet ingest` takes them through a durable consumer,
//! writes a batch in one transaction, and acknowledges it after the commit. It may be killed at any point: what was not
//! acknowledged is given out again, and what was written already is recognised by box and number (`ON CONFLICT DO NOTHING`).
//! Several share one consumer. Nothing here runs on the box of a machine.
//!
//! | file | what |
//! |---|---|
//! | `row` | a message as a row; pure |
//! | `database` | tables, partitions by day, writing a batch |
//! | `secured` | TLS for the line to the database |
//! | `ingest` | the loop |
//! | `schema.sql`, `same_finding*.sql` | what is created, and questions over all machines |

mod database;
pub mod ingest;
mod row;
mod secured;

pub use database::{Database, DatabaseSettings};
pub use row::RefusedMessage;

use crate::nats::NatsTarget;

/// The tables that `fleet ingest` creates.
pub const SCHEMA: &str = include_str!("schema.sql");
/// Which machines have had the same finding of the twin, in PostgreSQL.
pub const SAME_FINDING: &str = include_str!("same_finding.sql");
/// The same over Parquet partitions, for `DuckDB`.
pub const SAME_FINDING_PARQUET: &str = include_str!("same_finding_parquet.sql");

/// Reads `nats://SERVER,SERVER/PREFIX` or `natss://`; gives the servers and the prefix of the subjects.
///
/// # Errors
/// What is wrong with it, in words.
pub fn cluster(address: &str) -> Result<(NatsTarget, String), String> {
    let sink: crate::sinks::SinkAddress = address.parse().map_err(|error| format!("{error}"))?;
    match sink.target() {
        crate::sinks::SinkTarget::Nats(target) => Ok((target.servers.clone(), target.prefix.clone())),
        _ => Err(format!("{address} is no address of NATS; write nats://SERVER:4222,SERVER:4222/PREFIX")),
    }
}
