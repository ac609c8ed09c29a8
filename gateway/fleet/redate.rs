//! Items that a box has sent with the time of a clock that was wrong. The event `clock_redated` says which of them are of another time: what
//! is in the database moves with it, and so does what comes later and was sent before.
//!
//! An item says of itself by how much the box has moved it already, and the table `clock_moves` by how much it has to move in all. So a
//! batch may come twice, and item and event in any order. Several writers share a lock while they write items, and one that moves some has
//! it alone.

use super::database::DatabaseError;
use super::row::FleetRow;
use super::schema::{self, Partitioning};
use serde_json::Value as Json;
use std::collections::HashMap;
use tokio_postgres::{Client, Transaction};

/// Of the advisory lock: any number that nothing else uses.
const LOCK: i64 = 0x636e_6367_7732;

/// A row of the table `clock_moves`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct KnownMove {
    epoch: i64,
    from_sequence: i64,
    to_sequence: i64,
    by_ns: i64,
}

impl KnownMove {
    fn holds(&self, row: &FleetRow<'_>) -> bool {
        self.epoch == row.epoch && (self.from_sequence..self.to_sequence).contains(&row.sequence)
    }
}

/// The moves that the database knows.
#[derive(Debug, Default)]
pub(super) struct KnownMoves {
    count: i64,
    of_boxes: HashMap<String, Vec<KnownMove>>,
}

fn moving_error(error: tokio_postgres::Error) -> DatabaseError {
    DatabaseError::new("moving items of a wrong clock", &error)
}

impl KnownMoves {
    /// Reads them where there are others than before.
    pub(super) async fn renew(&mut self, client: &Client) -> Result<(), DatabaseError> {
        let count: i64 = client.query_one(COUNT, &[]).await.map_err(moving_error)?.get(0);
        if count == self.count {
            return Ok(());
        }
        let select = "SELECT box, epoch, from_sequence, to_sequence, by_ns FROM clock_moves JOIN boxes USING (box_id)";
        let rows = client.query(select, &[]).await.map_err(moving_error)?;
        *self = Self { count: gateway_base::convert::clamp_to_signed(rows.len() as u64), of_boxes: HashMap::new() };
        for row in rows {
            let (epoch, from_sequence, to_sequence, by_ns) = (row.get(1), row.get(2), row.get(3), row.get(4));
            let known = KnownMove { epoch, from_sequence, to_sequence, by_ns };
            self.of_boxes.entry(row.get(0)).or_default().push(known);
        }
        Ok(())
    }

    /// Moves an item by what it has not been moved yet.
    pub(super) fn settle_time(&self, row: &mut FleetRow<'_>) {
        let Some(moves) = self.of_boxes.get(&*row.box_name) else { return };
        let total =
            moves.iter().filter(|known| known.holds(row)).fold(0_i64, |sum, known| sum.saturating_add(known.by_ns));
        let by_ns = total.saturating_sub(row.redated_ns);
        // What no move names has the time that the box gave it.
        if total != 0 && by_ns != 0 {
            row.shift_time(by_ns);
        }
    }

    /// Waits until nobody moves items, or, to move some, until nobody writes any. False where others have been moved meanwhile.
    pub(super) async fn lock(&self, transaction: &Transaction<'_>, alone: bool) -> Result<bool, DatabaseError> {
        let how = if alone { "pg_advisory_xact_lock" } else { "pg_advisory_xact_lock_shared" };
        transaction.execute(&format!("SELECT {how}($1)"), &[&LOCK]).await.map_err(moving_error)?;
        let count: i64 = transaction.query_one(COUNT, &[]).await.map_err(moving_error)?.get(0);
        Ok(count == self.count)
    }
}

const COUNT: &str = "SELECT count(*) FROM clock_moves";

/// Does the item tell that others move?
fn tells_moves(row: &FleetRow<'_>) -> bool {
    let moves = |record: &Json| record["kind"] == "clock_redated" && record["detail"]["moves"].is_array();
    row.kind == "event" && row.record.as_ref().is_some_and(moves)
}

/// Items that an event of the same batch moves: their means are of other minutes.
#[derive(Debug, Default)]
pub(super) struct MovesOfBatch<'r>(Vec<(&'r str, KnownMove)>);

impl<'r> MovesOfBatch<'r> {
    /// Those that these items tell.
    pub(super) fn from_rows(rows: impl Iterator<Item = &'r FleetRow<'r>>) -> Self {
        let mut moves = Vec::new();
        for row in rows.filter(|row| tells_moves(row)) {
            let told = row.record.as_ref().and_then(|record| record["detail"]["moves"].as_array());
            for one in told.into_iter().flatten() {
                let number = |name: &str| one[name].as_i64().unwrap_or(0);
                let [epoch, from_sequence, to_sequence, by_ns] =
                    ["epoch", "from_sequence", "to_sequence", "by_ns"].map(number);
                moves.push((&*row.box_name, KnownMove { epoch, from_sequence, to_sequence, by_ns }));
            }
        }
        Self(moves)
    }

    /// Does none of them tell a move?
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Does one of them move this item?
    pub(super) fn hold(&self, row: &FleetRow<'_>) -> bool {
        self.0.iter().any(|(name, known)| *name == row.box_name && known.holds(row))
    }
}

/// Moves the items that the events of this batch name, and everything that was made of them.
pub(super) async fn move_items(transaction: &Transaction<'_>, partitioning: Partitioning) -> Result<(), DatabaseError> {
    let [which, rows] = schema::REDATE;
    transaction.batch_execute(which).await.map_err(moving_error)?;
    if partitioning == Partitioning::Declared {
        create_partitions(transaction).await?;
    }
    let text = format!("{rows}{}{JOIN_STATES}", schema::RECORDS);
    transaction.batch_execute(&text).await.map_err(moving_error)
}

/// Those of the new times.
async fn create_partitions(transaction: &Transaction<'_>) -> Result<(), DatabaseError> {
    let days = "SELECT DISTINCT (extract(epoch FROM date_trunc('day', at)) * 1000000)::bigint FROM (
        SELECT new_at AS at FROM moving UNION ALL
        SELECT fleet_time((fleet_shifted(record, by_ns) ->> 'until_ns')::bigint) FROM moving WHERE kind = 'gap') AS times WHERE at IS NOT NULL";
    let days: Vec<i64> =
        transaction.query(days, &[]).await.map_err(moving_error)?.iter().map(|row| row.get(0)).collect();
    schema::create_within(transaction, &schema::list_partitions(&days)).await
}

/// Where stretches were taken away, the ones before them end elsewhere.
const JOIN_STATES: &str = "
SELECT fleet_join_states(box_id, min(least(at, new_at)) - interval '1 second',
  max(greatest(at, new_at, fleet_time((record ->> 'until_ns')::bigint), fleet_time((fleet_shifted(record, by_ns) ->> 'until_ns')::bigint))))
FROM moving WHERE kind IN ('state', 'gap') GROUP BY box_id ORDER BY box_id;";
