//! What is too old goes: whole partitions where a table has them, rows elsewhere. A dry run says what would go.

use super::database::{self, DatabaseError, DatabaseSettings};
use super::schema::{PARTITIONED, Partitioning};
use gateway_nats::NatsError;
use serde::Serialize;
use tokio_postgres::Client;

/// How long a table keeps its rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Keeping {
    /// Name on the command line.
    pub option: &'static str,
    /// The tables, and the column of time of each.
    pub tables: &'static [(&'static str, &'static str)],
    /// Days, where nobody says otherwise.
    pub days: u32,
    /// What its rows are, in words.
    pub what: &'static str,
}

/// Every kind of rows with its usual age: that of the box for the same things, but for raw items, which the boxes have, too.
pub const KEEPING: [Keeping; 6] = [
    Keeping { option: "items-d", tables: &[("items", "at")], days: 90, what: "raw items" },
    Keeping { option: "minutes-d", tables: &[("minute_means", "hour")], days: 1098, what: "means of minutes" },
    Keeping {
        option: "hours-d",
        tables: &[("hour_means", "day"), ("day_means", "month")],
        days: 1830,
        what: "means of hours and days",
    },
    Keeping {
        option: "records-d",
        tables: &[
            ("state_list", "since"),
            ("part_list", "ended"),
            ("operation_list", "ended"),
            ("event_list", "at"),
            ("diagnosis_list", "at"),
            ("gap_list", "since"),
            ("fact_list", "at"),
        ],
        days: 1830,
        what: "states, parts, operations, events, diagnoses, gaps and facts",
    },
    Keeping {
        option: "alarms-d",
        tables: &[("alarm_marks", "at"), ("decision_list", "at")],
        days: 3660,
        what: "alarms and decisions",
    },
    Keeping { option: "refused-d", tables: &[("refused", "received")], days: 90, what: "refused messages" },
];

/// What goes, or would go.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Going {
    /// The table, or the partition.
    pub table: String,
    /// Everything before this time, UTC.
    pub before: String,
    /// Rows; of a partition as the database estimates them.
    pub rows: i64,
    /// Bytes that the disk gets back; 0 where the database uses the room again itself.
    pub bytes: i64,
}

/// Removes what is older than these days, in the order of [`KEEPING`]; with `dry` it only says what would go.
///
/// # Errors
/// What is wrong, in words.
pub async fn remove_expired(settings: &DatabaseSettings, days: &[u32], dry: bool) -> Result<Vec<Going>, NatsError> {
    let (client, partitioning) = database::connect(settings).await?;
    let mut going = Vec::new();
    for (keeping, days) in KEEPING.iter().zip(days) {
        for (table, column) in keeping.tables {
            let partitioned = PARTITIONED.iter().any(|known| known.name == *table);
            let found = match (partitioned, partitioning) {
                (true, Partitioning::Declared) => drop_partitions(&client, table, *days, dry).await,
                (true, Partitioning::Timescale) => drop_chunks(&client, table, *days, dry).await,
                (false, _) => delete_rows(&client, (table, column), *days, dry).await,
            };
            going.extend(found.map_err(|error| DatabaseError::new("removing what is too old", &error).said)?);
        }
    }
    Ok(going)
}

/// The time of `now() - days`, UTC.
async fn read_horizon(client: &Client, days: u32) -> Result<String, tokio_postgres::Error> {
    let text = format!("SELECT to_char(now() - interval '{days} days', 'YYYY-MM-DD HH24:MI:SS')");
    client.query_one(&text, &[]).await.map(|row| row.get(0))
}

/// Partitions whose end is not after the horizon.
async fn drop_partitions(
    client: &Client,
    table: &str,
    days: u32,
    dry: bool,
) -> Result<Vec<Going>, tokio_postgres::Error> {
    let before = read_horizon(client, days).await?;
    let list = "
        SELECT c.oid::regclass::text, greatest(c.reltuples, 0)::bigint, pg_total_relation_size(c.oid)
        FROM pg_inherits JOIN pg_class c ON c.oid = inhrelid
        WHERE inhparent = to_regclass($1) AND substring(pg_get_expr(c.relpartbound, c.oid) FROM $2)::timestamptz <= $3::text::timestamptz
        ORDER BY 1";
    let upper = r"TO \('([^']+)'\)";
    let rows = client.query(list, &[&table, &upper, &before]).await?;
    let going: Vec<Going> = rows
        .iter()
        .map(|row| Going { table: row.get(0), before: before.clone(), rows: row.get(1), bytes: row.get(2) })
        .collect();
    for partition in going.iter().filter(|_| !dry) {
        client.batch_execute(&format!("DROP TABLE {}", partition.table)).await?;
    }
    Ok(going)
}

/// The same by TimescaleDB.
async fn drop_chunks(client: &Client, table: &str, days: u32, dry: bool) -> Result<Vec<Going>, tokio_postgres::Error> {
    let before = read_horizon(client, days).await?;
    let which = if dry { "show_chunks" } else { "drop_chunks" };
    let call = format!("SELECT {which}('{table}', older_than => interval '{days} days')::text");
    let rows = client.query(&call, &[]).await?;
    let chunk = |row: &tokio_postgres::Row| Going { table: row.get(0), before: before.clone(), rows: 0, bytes: 0 };
    Ok(rows.iter().map(chunk).collect())
}

async fn delete_rows(
    client: &Client,
    (table, column): (&str, &str),
    days: u32,
    dry: bool,
) -> Result<Vec<Going>, tokio_postgres::Error> {
    let before = read_horizon(client, days).await?;
    let verb = if dry { "SELECT" } else { "DELETE" };
    let statement = format!("{verb} FROM {table} WHERE {column} < '{before}+00'");
    let rows = gateway_base::convert::clamp_to_signed(client.execute(&statement, &[]).await?);
    let going = Going { table: table.to_owned(), before, rows, bytes: 0 };
    Ok(if rows > 0 { vec![going] } else { Vec::new() })
}
