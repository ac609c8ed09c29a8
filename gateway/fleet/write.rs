//! A batch into the database: names, partitions, and everything else in one transaction.

use super::copy::CopyRows;
use super::database::{self, DatabaseError, DatabaseSettings};
use super::known_items::KnownItems;
use super::latest::Latest;
use super::means::{self, MeanRows};
use super::names::{Names, NumberedRow};
use super::redate::{self, KnownMoves, MovesOfBatch};
use super::row::FleetRow;
use super::schema::{self, Partition, Partitioning};
use crate::row::Arrived;
use gateway_nats::NatsError;
use std::collections::BTreeSet;
use tokio_postgres::error::SqlState;
use tokio_postgres::{Client, Transaction};

/// Columns of `items` in the order in which they are copied.
const ITEM_COLUMNS: &str = "sequence, epoch, at, at_ns, arrived, box_id, historical, redated_ns, kind, series, numbers, texts, reasons, record";

/// Where a batch lies that cannot be copied into its tables directly.
const INCOMING: &str = "CREATE TEMP TABLE incoming_items (LIKE items) ON COMMIT DELETE ROWS;
CREATE TEMP TABLE incoming_means (series_id int, box_id int, start timestamptz, mean real[], least real[], greatest real[], seconds real[]) ON COMMIT DELETE ROWS;
CREATE TEMP TABLE incoming_latest (box_id int, first_at timestamptz, last_at timestamptz, last_arrival timestamptz, last_sequence bigint, cells jsonb) ON COMMIT DELETE ROWS;";

/// What a batch did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct BatchResult {
    /// Rows that are new.
    pub new: u64,
    /// Rows that were there already.
    pub known: u64,
}

/// A message that is kept apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct RefusalRecord {
    pub(super) stream_sequence: i64,
    pub(super) subject: String,
    pub(super) reason: String,
    pub(super) payload: String,
}

/// A connection whose tables are there.
#[derive(Debug)]
pub(super) struct Database {
    client: Client,
    partitioning: Partitioning,
    names: Names,
    partitions: BTreeSet<Partition>,
    moves: KnownMoves,
}

/// Everything of a batch, ready to be copied.
struct Encoded {
    items: CopyRows,
    records: CopyRows,
    latest: CopyRows,
    means: Vec<(&'static means::MeanLevel, CopyRows)>,
    partitions: BTreeSet<Partition>,
}

fn writing_error(error: tokio_postgres::Error) -> DatabaseError {
    DatabaseError::new("writing a batch", &error)
}

impl Database {
    /// Connects, and creates what is missing.
    pub(super) async fn open(settings: &DatabaseSettings) -> Result<Self, NatsError> {
        let (client, partitioning) = database::connect(settings).await?;
        let text = format!("{}{INCOMING}", schema::INCOMING_RECORDS);
        client.batch_execute(&text).await.map_err(|error| writing_error(error).said)?;
        let (names, moves) = (Names::default(), KnownMoves::default());
        Ok(Self { client, partitioning, names, partitions: BTreeSet::new(), moves })
    }

    /// Gives items the time that they have by what the database knows of clocks that were wrong.
    pub(super) async fn settle_times<'r, 'm: 'r>(
        &mut self,
        rows: impl Iterator<Item = &'r mut FleetRow<'m>>,
    ) -> Result<(), DatabaseError> {
        self.moves.renew(&self.client).await?;
        rows.for_each(|row| self.moves.settle_time(row));
        Ok(())
    }

    /// Writes the rows, whose times are settled, in one transaction; nothing is written where it fails.
    pub(super) async fn write(&mut self, rows: &[Arrived<'_>]) -> Result<BatchResult, DatabaseError> {
        if rows.is_empty() {
            return Ok(BatchResult::default());
        }
        let mut numbered = self.names.number_rows(&self.client, rows).await?;
        self.leave_out_known(&mut numbered).await?;
        let left_out = (rows.len() - numbered.len()) as u64;
        // Several write at a time: the same order everywhere leaves no two that wait for each other.
        numbered.sort_unstable_by_key(|one| (one.box_id, one.row.at_ns, one.row.sequence));
        let told = MovesOfBatch::from_rows(numbered.iter().map(|one| one.row));
        let (encoded, moves) = (encode_rows(&numbered, &told), !told.is_empty());
        self.create_missing_partitions(&encoded.partitions).await?;
        let mut transaction = self.client.transaction().await.map_err(writing_error)?;
        if !self.moves.lock(&transaction, moves).await? {
            let said = NatsError::new("another reader has put the clock of a box right meanwhile", "it is tried again");
            return Err(DatabaseError { said, of_the_data: false });
        }
        let count = encoded.items.row_count();
        let new = put_items(&mut transaction, encoded.items).await?;
        if encoded.records.row_count() > 0 {
            copy_rows(&transaction, "incoming (box_id, epoch, sequence, at, kind, record)", encoded.records).await?;
            transaction.batch_execute(schema::RECORDS).await.map_err(writing_error)?;
        }
        copy_rows(&transaction, "incoming_latest", encoded.latest).await?;
        transaction.batch_execute(MERGE_LATEST).await.map_err(writing_error)?;
        if moves {
            redate::move_items(&transaction, self.partitioning).await?;
        }
        for (level, rows) in encoded.means {
            copy_rows(&transaction, "incoming_means", rows).await?;
            transaction.batch_execute(&merge_means(level)).await.map_err(writing_error)?;
        }
        transaction.commit().await.map_err(writing_error)?;
        Ok(BatchResult { new, known: count - new + left_out })
    }

    /// Leaves out items that were made from a history once more where the database has them as they were sent first.
    async fn leave_out_known(&self, rows: &mut Vec<NumberedRow<'_>>) -> Result<(), DatabaseError> {
        let mut known = KnownItems::default();
        known.load(&self.client, &self.names, rows.iter().map(|one| one.row)).await?;
        rows.retain(|one| !known.holds(one.row));
        Ok(())
    }

    /// Notes what is not taken.
    pub(super) async fn insert_refused(&self, refused: &[RefusalRecord]) -> Result<(), DatabaseError> {
        let noting = |error| DatabaseError::new("noting what is refused", &error);
        let insert = "INSERT INTO refused (stream_sequence, subject, reason, payload) VALUES ($1, $2, $3, $4) ON CONFLICT DO NOTHING";
        for RefusalRecord { stream_sequence, subject, reason, payload } in refused {
            self.client.execute(insert, &[stream_sequence, subject, reason, payload]).await.map_err(noting)?;
        }
        Ok(())
    }

    async fn create_missing_partitions(&mut self, wanted: &BTreeSet<Partition>) -> Result<(), DatabaseError> {
        let missing: BTreeSet<Partition> = wanted.difference(&self.partitions).cloned().collect();
        if self.partitioning == Partitioning::Timescale || missing.is_empty() {
            return Ok(());
        }
        schema::create_partitions(&mut self.client, &missing).await?;
        self.partitions.extend(missing);
        Ok(())
    }
}

fn encode_rows(rows: &[NumberedRow<'_>], moves: &MovesOfBatch<'_>) -> Encoded {
    let (mut items, mut records) = (CopyRows::new(), CopyRows::new());
    let (mut latest, mut of_levels) = (Latest::default(), [const { None::<MeanRows> }; means::LEVELS.len()]);
    let mut times = BTreeSet::new();
    for NumberedRow { row, arrived_us, box_id, series } in rows {
        let (arrived_us, box_id) = (*arrived_us, *box_id);
        let record = row.record.as_ref().map(serde_json::Value::to_string);
        put_item(&mut items, row, (box_id, arrived_us), series, record.as_deref());
        times.insert(("items", day_of(row.at_us())));
        if let Some(record) = &record {
            let place = records
                .begin_row(6)
                .append_int4(box_id)
                .append_int8(row.epoch)
                .append_int8(row.sequence)
                .append_time(row.at_us());
            place.append_text(&row.kind).append_json(Some(record));
            times.extend(RECORD_TABLES.iter().map(|table| (*table, day_of(row.at_us()))));
            let gap = row.record.as_ref().filter(|_| row.kind == "gap");
            let until_us = gap.and_then(|record| record["until_ns"].as_i64()).map(|ns| ns / 1000);
            times.extend(until_us.map(|until_us| ("state_list", day_of(until_us))));
        }
        latest.add(box_id, row, series, arrived_us);
        if moves.hold(row) {
            continue;
        }
        for (level, rows) in means::LEVELS.iter().zip(&mut of_levels).filter(|(level, _)| *level.kind == *row.kind) {
            rows.get_or_insert_default().add(level, box_id, row, series);
            times.insert((level.table, day_of(row.at_us())));
        }
    }
    let of_time = |(table, day): (&str, i64)| schema::find_partitioned(table)?.partition_at(day * DAY_US);
    let partitions = times.into_iter().filter_map(of_time).collect();
    let of_level = |(level, rows): (&'static means::MeanLevel, Option<MeanRows>)| Some((level, copy_means(&rows?)));
    let means = means::LEVELS.iter().zip(of_levels).filter_map(of_level).collect();
    Encoded { items, records, latest: copy_latest(&latest), means, partitions }
}

/// Tables of records that are partitioned by the time of the record.
const RECORD_TABLES: [&str; 3] = ["state_list", "part_list", "operation_list"];
const DAY_US: i64 = 86_400_000_000;

fn day_of(at_us: i64) -> i64 {
    at_us.div_euclid(DAY_US)
}

fn put_item(
    items: &mut CopyRows,
    row: &FleetRow<'_>,
    (box_id, arrived_us): (i32, i64),
    series: &[i32],
    record: Option<&str>,
) {
    items
        .begin_row(14)
        .append_int8(row.sequence)
        .append_int8(row.epoch)
        .append_time(row.at_us())
        .append_int8(row.at_ns)
        .append_time(arrived_us)
        .append_int4(box_id);
    items.append_flag(row.historical).append_int8(row.redated_ns).append_text(&row.kind);
    if row.kind == "sample" {
        let texts: Vec<&str> = row.texts.iter().map(|(_, text)| &**text).collect();
        let reasons: Vec<&str> = row.missing.iter().map(|(_, reason)| &**reason).collect();
        let numbers: Vec<f64> = row.numbers.iter().map(|(_, number)| *number).collect();
        items.int4_list(series).float8_list(&numbers).text_list(&texts).text_list(&reasons);
    } else {
        items.append_null().append_null().append_null().append_null();
    }
    items.append_json(record);
}

fn copy_means(rows: &MeanRows) -> CopyRows {
    let mut copied = CopyRows::new();
    for ((series, box_id, start_us), places) in &rows.rows {
        copied.begin_row(7).append_int4(*series).append_int4(*box_id).append_time(*start_us);
        places.iter().for_each(|column| {
            copied.float4_list(column);
        });
    }
    copied
}

fn copy_latest(latest: &Latest<'_>) -> CopyRows {
    let mut copied = CopyRows::new();
    for (box_id, one) in &latest.boxes {
        copied.begin_row(6).append_int4(*box_id).append_time(one.first_us);
        // A batch that tells nothing of now leaves the time as it is.
        if one.last_us == i64::MIN {
            copied.append_null()
        } else {
            copied.append_time(one.last_us)
        };
        copied.append_time(one.arrived_us).append_int8(one.sequence).append_json(Some(&one.to_json()));
    }
    copied
}

/// A box that is new has the time of whatever came first; one that is known keeps its time where a batch tells nothing of now.
const MERGE_LATEST: &str = "
INSERT INTO box_latest AS known (box_id, last_at, last_arrival, last_sequence, cells)
SELECT box_id, coalesce(last_at, first_at), last_arrival, last_sequence, cells FROM incoming_latest
ON CONFLICT (box_id) DO UPDATE SET
  last_at = greatest(known.last_at, (SELECT last_at FROM incoming_latest WHERE incoming_latest.box_id = known.box_id)),
  last_arrival = greatest(known.last_arrival, excluded.last_arrival),
  last_sequence = greatest(known.last_sequence, excluded.last_sequence),
  cells = coalesce(fleet_cells(known.cells, excluded.cells), '{}')";

/// Of two rows of the same place the one that knows more seconds.
fn merge_means(level: &means::MeanLevel) -> String {
    let means::MeanLevel { table, row, .. } = level;
    let newer = "coalesce(s1, -1) >= coalesce(s2, -1)";
    let column =
        |letter: char| format!("array_agg(CASE WHEN {newer} THEN {letter}1 ELSE {letter}2 END ORDER BY place)");
    let columns: Vec<String> = ['m', 'l', 'g', 's'].map(column).into();
    format!(
        "INSERT INTO {table} AS known (series_id, box_id, {row}, mean, least, greatest, seconds)
         SELECT series_id, box_id, start, mean, least, greatest, seconds FROM incoming_means
         ON CONFLICT (series_id, box_id, {row}) DO UPDATE SET (mean, least, greatest, seconds) = (
           SELECT {} FROM unnest(excluded.mean, excluded.least, excluded.greatest, excluded.seconds,
             known.mean, known.least, known.greatest, known.seconds) WITH ORDINALITY AS each (m1, l1, g1, s1, m2, l2, g2, s2, place));
         DELETE FROM incoming_means;",
        columns.join(", ")
    )
}

/// Copies the items into their table; where some of them are there already, those are left out. The rows that are new.
async fn put_items(transaction: &mut Transaction<'_>, items: CopyRows) -> Result<u64, DatabaseError> {
    let count = items.row_count();
    let trying = transaction.savepoint("direct").await.map_err(writing_error)?;
    match copy_raw(&trying, &format!("items ({ITEM_COLUMNS})"), items.clone()).await {
        Ok(()) => {
            trying.commit().await.map_err(writing_error)?;
            return Ok(count);
        }
        Err(error) if error.code() == Some(&SqlState::UNIQUE_VIOLATION) => {
            trying.rollback().await.map_err(writing_error)?
        }
        Err(error) => return Err(writing_error(error)),
    }
    copy_rows(transaction, &format!("incoming_items ({ITEM_COLUMNS})"), items).await?;
    let merge =
        format!("INSERT INTO items ({ITEM_COLUMNS}) SELECT {ITEM_COLUMNS} FROM incoming_items ON CONFLICT DO NOTHING");
    transaction.execute(&merge, &[]).await.map_err(writing_error)
}

async fn copy_rows(transaction: &Transaction<'_>, table: &str, rows: CopyRows) -> Result<(), DatabaseError> {
    copy_raw(transaction, table, rows).await.map_err(writing_error)
}

async fn copy_raw(transaction: &Transaction<'_>, table: &str, rows: CopyRows) -> Result<(), tokio_postgres::Error> {
    use futures_util::SinkExt;
    let statement = format!("COPY {table} FROM STDIN BINARY");
    let mut sink = Box::pin(transaction.copy_in::<_, bytes::Bytes>(&statement).await?);
    sink.send(rows.into_bytes().into()).await?;
    sink.close().await
}
