//! Many boxes, one place to ask: from a NATS JetStream stream into PostgreSQL.
//!
//! Each box sends its items into the stream by itself (sink `nats://`). `fleet ingest` takes them through a durable consumer,
//! writes a batch in one transaction, and acknowledges it after the commit. It may be killed at any point: what was not
//! acknowledged is given out again, and what was written already is recognised by box and number (`ON CONFLICT DO NOTHING`).
//! Several share one consumer. Nothing here runs on the box of a machine.
//!
//! | file | what |
//! |---|---|
//! | `row`, `field` | a message as a row, and its cells; pure |
//! | `copy` | rows in the binary format of `COPY`; pure |
//! | `latest`, `means` | the newest values, and the means of minutes, hours and days, of a batch; pure |
//! | `names` | rows with the numbers of their boxes and series, and machines that get another name |
//! | `write` | a batch in one transaction |
//! | `schema` | tables, their version, partitions; the SQL is in the folder `schema` |
//! | `database`, `tls_connection` | the connection, what it says in words, TLS |
//! | `ingest` | the loop |
//! | `retention` | what is too old goes |
//! | `questions` | what a shop asks, in SQL |

mod copy;
mod database;
mod field;
pub mod ingest;
mod known_items;
mod latest;
mod means;
mod names;
pub mod questions;
mod redate;
pub mod retention;
mod row;
mod schema;
mod tls_connection;
mod write;

pub use database::DatabaseSettings;
pub use row::RefusedMessage;
pub use schema::{TABLES, VIEWS};

use gateway_nats::NatsTarget;

/// Why a text names no cluster.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ClusterError {
    /// It is no address.
    #[error("{0}")]
    Address(adapters::address::AddressError),
    /// It is the address of something else.
    #[error("{address} is no address of NATS; write nats://SERVER:4222,SERVER:4222/PREFIX")]
    NotNats {
        /// The address as it was given.
        address: String,
    },
}

/// Reads `nats://SERVER,SERVER/PREFIX` or `natss://`; gives the servers and the prefix of the subjects.
///
/// # Errors
/// What is wrong with it, in words.
pub fn parse_cluster(address: &str) -> Result<(NatsTarget, String), ClusterError> {
    let sink: gateway_sinks::SinkAddress = address.parse().map_err(ClusterError::Address)?;
    match sink.target() {
        gateway_sinks::SinkTarget::Nats(target) => Ok((target.target.clone(), target.prefix.clone())),
        _ => Err(ClusterError::NotNats { address: address.to_owned() }),
    }
}
