//! The tables: their version, what brings an older one up to it, and partitions by time, as PostgreSQL or TimescaleDB makes them.

use super::database::DatabaseError;
use gateway_base::log::{Notice, Severity};
use gateway_nats::NatsError;
use jiff::{Span, Timestamp, civil::Date, tz::TimeZone};
use std::collections::BTreeSet;
use tokio_postgres::{Client, Transaction};

/// The version of the tables that this program writes.
const VERSION: i32 = 5;
/// The statements that create the tables of the fleet database.
pub const TABLES: &str = concat!(
    include_str!("schema/tables.sql"),
    include_str!("schema/clock_moves.sql"),
    include_str!("schema/machines.sql"),
    include_str!("schema/facts.sql")
);
/// The views and functions.
pub const VIEWS: &str = include_str!("schema/views.sql");
/// Settings of the database, at every start: one that was made by an earlier version has them, too.
const SETTINGS: &str = include_str!("schema/settings.sql");
/// Records of a batch into their tables.
pub(super) const RECORDS: &str = include_str!("schema/records.sql");
/// From version 1: what makes room for the new tables, and what fills them.
const FROM_1: [&str; 2] = [include_str!("schema/migrate_1.sql"), include_str!("schema/migrate_1_rows.sql")];

/// From each version on, what it lacks of the next one. From version 2: epochs of items, and times that move. From version 3: machines
/// beside their boxes. From version 4: facts of production.
const FROM_2: &str = concat!(include_str!("schema/migrate_2.sql"), include_str!("schema/clock_moves.sql"));
const FROM_3: &str = include_str!("schema/machines.sql");
const FROM_4: &str = include_str!("schema/facts.sql");
/// Items of a wrong clock: which move, and, after their partitions are there, everything made of them.
pub(super) const REDATE: [&str; 2] = [include_str!("schema/redate.sql"), include_str!("schema/redate_rows.sql")];

/// Of the advisory lock under which tables and partitions are created: any number that nothing else uses.
const LOCK: i64 = 0x636e_6367_7731;

/// How long the time is that one partition holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Period {
    Day,
    Month,
    Year,
}

/// A table that is partitioned by time.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct PartitionedTable {
    pub(super) name: &'static str,
    /// The column of time.
    pub(super) column: &'static str,
    pub(super) period: Period,
    /// How a partition keeps its rows: room for rows that grow, and lists of means that are compressed from 256 bytes on.
    storage: &'static str,
}

const fn new_table(name: &'static str, column: &'static str, period: Period) -> PartitionedTable {
    PartitionedTable { name, column, period, storage: "" }
}

const MEANS: &str = "WITH (fillfactor = 80, toast_tuple_target = 256)";

/// Every table that is partitioned.
pub(super) const PARTITIONED: [PartitionedTable; 7] = [
    new_table("items", "at", Period::Day),
    PartitionedTable { storage: MEANS, ..new_table("minute_means", "hour", Period::Month) },
    PartitionedTable { storage: MEANS, ..new_table("hour_means", "day", Period::Year) },
    PartitionedTable { storage: MEANS, ..new_table("day_means", "month", Period::Year) },
    new_table("state_list", "since", Period::Month),
    new_table("part_list", "ended", Period::Month),
    new_table("operation_list", "ended", Period::Month),
];

/// Who divides tables by time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Partitioning {
    /// PostgreSQL: this program creates each partition.
    Declared,
    /// The extension TimescaleDB, where the database has it: it creates its chunks by itself, and compresses old items.
    Timescale,
}

impl Period {
    /// The first and the day after the last day of the period that holds this time.
    fn bounds_around(self, at_us: i64) -> Option<(Date, Date)> {
        let day = Timestamp::from_microsecond(at_us).ok()?.to_zoned(TimeZone::UTC).date();
        let (first, span) = match self {
            Self::Day => (day, Span::new().days(1)),
            Self::Month => (day.first_of_month(), Span::new().months(1)),
            Self::Year => (day.first_of_year(), Span::new().years(1)),
        };
        Some((first, first.checked_add(span).ok()?))
    }

    fn name_suffix(self, first: Date) -> String {
        let (year, month, day) = (first.year(), first.month(), first.day());
        match self {
            Self::Day => format!("{year:04}_{month:02}_{day:02}"),
            Self::Month => format!("{year:04}_{month:02}"),
            Self::Year => format!("{year:04}"),
        }
    }

    fn sql_interval(self) -> &'static str {
        match self {
            Self::Day => "1 day",
            Self::Month => "1 month",
            Self::Year => "1 year",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Partition {
    name: String,
    create: String,
}

impl PartitionedTable {
    /// The partition of this time.
    pub(super) fn partition_at(&self, at_us: i64) -> Option<Partition> {
        let (first, after) = self.period.bounds_around(at_us)?;
        let name = format!("{}_{}", self.name, self.period.name_suffix(first));
        let create = format!(
            "CREATE TABLE IF NOT EXISTS {name} PARTITION OF {} FOR VALUES FROM ('{first} 00:00:00+00') TO ('{after} 00:00:00+00') {}",
            self.name, self.storage
        );
        Some(Partition { name, create })
    }

    /// The table becomes one of TimescaleDB. It had been declared as partitioned, and is empty.
    fn hypertable_sql(&self) -> String {
        let Self { name, column, period, .. } = self;
        format!(
            "SELECT create_hypertable('{name}', '{column}', chunk_time_interval => interval '{}');\n",
            period.sql_interval()
        )
    }
}

/// The table of the name.
pub(super) fn find_partitioned(name: &str) -> Option<&'static PartitionedTable> {
    PARTITIONED.iter().find(|table| table.name == name)
}

/// The tables without declared partitions, which TimescaleDB brings itself.
fn tables_of(partitioning: Partitioning) -> String {
    match partitioning {
        Partitioning::Declared => TABLES.to_owned(),
        Partitioning::Timescale => {
            let plain = PARTITIONED.iter().fold(TABLES.to_owned(), |text, table| {
                text.replace(&format!(") PARTITION BY RANGE ({});", table.column), ");")
            });
            let hyper: String = PARTITIONED.iter().map(PartitionedTable::hypertable_sql).collect();
            format!("{plain}{hyper}{COMPRESSION}")
        }
    }
}

/// Items of one box stand beside each other in a compressed chunk. The edition of the extension without compression goes on without.
const COMPRESSION: &str = "DO $$ BEGIN
  ALTER TABLE items SET (timescaledb.compress, timescaledb.compress_segmentby = 'box_id', timescaledb.compress_orderby = 'at, sequence');
  PERFORM add_compression_policy('items', interval '7 days');
EXCEPTION WHEN OTHERS THEN RAISE WARNING 'old items are not compressed: %', SQLERRM; END $$;\n";

fn to_nats_error(doing: &str) -> impl Fn(tokio_postgres::Error) -> NatsError + Copy + '_ {
    move |error| DatabaseError::new(doing, &error).said
}

/// Creates what is missing, and brings older tables to the version of this program. Several processes may ask at once.
pub(super) async fn bring_up(client: &mut Client) -> Result<Partitioning, NatsError> {
    let creating = to_nats_error("creating the tables");
    let transaction = client.transaction().await.map_err(creating)?;
    transaction.execute("SELECT pg_advisory_xact_lock($1)", &[&LOCK]).await.map_err(creating)?;
    let partitioning = detect_partitioning(&transaction).await?;
    match read_version(&transaction).await? {
        0 => create_tables(&transaction, partitioning).await?,
        1 => from_1(&transaction, partitioning).await?,
        2 => change_tables(&transaction, 2, &[FROM_2, FROM_3, FROM_4]).await?,
        3 => change_tables(&transaction, 3, &[FROM_3, FROM_4]).await?,
        4 => change_tables(&transaction, 4, &[FROM_4]).await?,
        VERSION => {}
        newer => {
            let what = format!("the tables have version {newer}, this program knows {VERSION}");
            return Err(NatsError::new(what, "use the newer program that has made them"));
        }
    }
    transaction.batch_execute(SETTINGS).await.map_err(creating)?;
    transaction.commit().await.map_err(creating)?;
    Ok(partitioning)
}

/// 0: there are none; 1: those of before, which had no number.
async fn read_version(transaction: &Transaction<'_>) -> Result<i32, NatsError> {
    let asking = to_nats_error("asking for the version of the tables");
    let there = "SELECT to_regclass('fleet_schema') IS NOT NULL, to_regclass('items') IS NOT NULL";
    let row = transaction.query_one(there, &[]).await.map_err(asking)?;
    if !row.get::<_, bool>(0) {
        return Ok(i32::from(row.get::<_, bool>(1)));
    }
    let newest =
        transaction.query_one("SELECT coalesce(max(version), 0) FROM fleet_schema", &[]).await.map_err(asking)?;
    Ok(newest.get(0))
}

/// TimescaleDB, where the database has the extension.
async fn detect_partitioning(transaction: &Transaction<'_>) -> Result<Partitioning, NatsError> {
    let asking = to_nats_error("asking for extensions");
    let found = transaction.query_one("SELECT count(*) FROM pg_extension WHERE extname = 'timescaledb'", &[]).await;
    let has_it = found.map_err(asking)?.get::<_, i64>(0) > 0;
    if !has_it {
        return Ok(Partitioning::Declared);
    }
    // Tables that were made before the extension stay as they are.
    let declared = "SELECT count(*) FROM pg_partitioned_table WHERE partrelid = to_regclass('items')";
    let declared = transaction.query_one(declared, &[]).await.map_err(asking)?.get::<_, i64>(0) > 0;
    Ok(if declared { Partitioning::Declared } else { Partitioning::Timescale })
}

/// The partitions of every table that hold these times, microseconds since 1970.
pub(super) fn list_partitions(times_us: &[i64]) -> BTreeSet<Partition> {
    PARTITIONED.iter().flat_map(|table| times_us.iter().filter_map(|at_us| table.partition_at(*at_us))).collect()
}

async fn create_tables(transaction: &Transaction<'_>, partitioning: Partitioning) -> Result<(), NatsError> {
    let text = format!("{}{VIEWS}\nINSERT INTO fleet_schema (version) VALUES ({VERSION});", tables_of(partitioning));
    transaction.batch_execute(&text).await.map_err(to_nats_error("creating the tables"))
}

fn tell_move(from: i32) {
    let text = format!("the tables are brought from version {from} to {VERSION}; this may take minutes");
    Notice::new(Severity::Info, "tables_move", text).write_to_logs();
}

async fn from_1(transaction: &Transaction<'_>, partitioning: Partitioning) -> Result<(), NatsError> {
    let moving = to_nats_error("bringing the tables from version 1");
    tell_move(1);
    transaction.batch_execute(FROM_1[0]).await.map_err(moving)?;
    create_tables(transaction, partitioning).await?;
    let times = "SELECT (extract(epoch FROM min(at)) * 1000000)::bigint FROM items_1 GROUP BY date_trunc('day', at)";
    let days: Vec<i64> = transaction.query(times, &[]).await.map_err(moving)?.iter().map(|row| row.get(0)).collect();
    if partitioning == Partitioning::Declared {
        let statements: Vec<String> = list_partitions(&days).into_iter().map(|it| it.create).collect();
        transaction.batch_execute(&statements.join(";")).await.map_err(moving)?;
    }
    let text = format!("{INCOMING_RECORDS}{}{RECORDS}DROP TABLE incoming;", FROM_1[1]);
    transaction.batch_execute(&text).await.map_err(moving)
}

async fn change_tables(transaction: &Transaction<'_>, from: i32, steps: &[&str]) -> Result<(), NatsError> {
    tell_move(from);
    let text = format!("{}{VIEWS}\nINSERT INTO fleet_schema (version) VALUES ({VERSION});", steps.concat());
    let doing = format!("bringing the tables from version {from}");
    transaction.batch_execute(&text).await.map_err(to_nats_error(&doing))
}

/// Where the records of a batch lie before they go into their tables.
pub(super) const INCOMING_RECORDS: &str = "CREATE TEMP TABLE incoming (box_id int, epoch bigint NOT NULL DEFAULT 0, sequence bigint, at timestamptz, kind text, record jsonb) ON COMMIT DELETE ROWS;\n";

/// Creates the partitions that are missing, in a transaction of its own: creating one stops every other writer for a moment.
pub(super) async fn create_partitions(client: &mut Client, wanted: &BTreeSet<Partition>) -> Result<(), DatabaseError> {
    let creating = |error| DatabaseError::new("creating the partition of a time", &error);
    let transaction = client.transaction().await.map_err(creating)?;
    create_within(&transaction, wanted).await?;
    transaction.commit().await.map_err(creating)
}

/// The same within a transaction.
pub(super) async fn create_within(
    transaction: &Transaction<'_>,
    wanted: &BTreeSet<Partition>,
) -> Result<(), DatabaseError> {
    let creating = |error| DatabaseError::new("creating the partition of a time", &error);
    transaction.execute("SELECT pg_advisory_xact_lock($1)", &[&LOCK]).await.map_err(creating)?;
    for Partition { name, create } in wanted {
        let there =
            transaction.query_one("SELECT to_regclass($1::text) IS NOT NULL", &[name]).await.map_err(creating)?;
        if !there.get::<_, bool>(0) {
            transaction.batch_execute(create).await.map_err(creating)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_partition_holds_its_day_month_or_year() {
        let at_us = "2026-02-28T23:59:59Z".parse::<Timestamp>().expect("a time").as_microsecond();
        let created =
            |name: &str| find_partitioned(name).and_then(|table| table.partition_at(at_us)).expect("a partition");
        assert_eq!(created("items").name, "items_2026_02_28");
        assert!(created("items").create.contains("FROM ('2026-02-28 00:00:00+00') TO ('2026-03-01 00:00:00+00')"));
        assert!(created("part_list").create.contains("FROM ('2026-02-01 00:00:00+00') TO ('2026-03-01 00:00:00+00')"));
        assert!(created("hour_means").create.contains("TO ('2027-01-01 00:00:00+00') WITH (fillfactor"));
    }

    #[test]
    fn every_partitioned_table_is_a_plain_one_for_the_extension() {
        let text = tables_of(Partitioning::Timescale);
        assert!(!text.contains("PARTITION BY"), "{text}");
        assert_eq!(text.matches("create_hypertable").count(), PARTITIONED.len());
        assert_eq!(tables_of(Partitioning::Declared).matches("PARTITION BY").count(), PARTITIONED.len());
    }
}
