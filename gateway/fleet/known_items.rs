//! Items that were made from the history of a box once more (`fleet resend`): which of them the database has already, as the box had sent
//! them first, under another epoch and number.

use super::database::DatabaseError;
use super::names::Names;
use super::row::FleetRow;
use gateway_history::RESENT_EPOCH;
use serde_json::Value as Json;
use std::collections::{BTreeMap, HashMap, HashSet};
use tokio_postgres::Client;

/// What names an item whatever its number: box, time, kind. Of records also what they say.
#[derive(Debug, PartialEq, Eq, Hash)]
struct ItemKey {
    box_id: i32,
    at_ns: i64,
    kind: String,
    record: Option<String>,
}

/// The items of a few boxes and stretches of time.
#[derive(Debug, Default)]
pub(super) struct KnownItems {
    keys: HashSet<ItemKey>,
    box_ids: HashMap<String, i32>,
}

fn is_resent(row: &FleetRow<'_>) -> bool {
    row.epoch.unsigned_abs() == RESENT_EPOCH
}

/// A gap is known by its beginning: how it ended may be told later.
fn key_of_record(kind: &str, record: Option<&Json>) -> Option<String> {
    record.filter(|_| kind != "gap").map(format_sorted)
}

/// The same text for the same content: the database keeps the fields of an object in another order.
fn format_sorted(json: &Json) -> String {
    match json {
        Json::Array(items) => format!("[{}]", items.iter().map(format_sorted).collect::<Vec<_>>().join(",")),
        Json::Object(fields) => {
            let sorted: BTreeMap<&String, String> =
                fields.iter().map(|(name, value)| (name, format_sorted(value))).collect();
            format!("{sorted:?}")
        }
        one => one.to_string(),
    }
}

impl KnownItems {
    /// Looks for the neighbours of those rows that were made once more; without any it asks nothing.
    pub(super) async fn load<'r>(
        &mut self,
        client: &Client,
        names: &Names,
        rows: impl Iterator<Item = &'r FleetRow<'r>>,
    ) -> Result<(), DatabaseError> {
        let mut spans: HashMap<&str, (i64, i64)> = HashMap::new();
        for row in rows.filter(|row| is_resent(row)) {
            let span = spans.entry(&row.box_name).or_insert((row.at_us(), row.at_us()));
            *span = (span.0.min(row.at_us()), span.1.max(row.at_us()));
        }
        let select = "SELECT at_ns, kind, record::text FROM items
            WHERE box_id = $1 AND at >= fleet_time($2::bigint * 1000) AND at <= fleet_time($3::bigint * 1000) AND epoch <> $4";
        let epoch = gateway_base::convert::clamp_to_signed(RESENT_EPOCH);
        for (name, (from_us, to_us)) in spans {
            let Some(box_id) = names.box_id(name) else { continue };
            self.box_ids.insert(name.to_owned(), box_id);
            let found = client.query(select, &[&box_id, &from_us, &to_us, &epoch]).await;
            for row in found.map_err(|error| DatabaseError::new("looking for items that are there", &error))? {
                let kind: String = row.get(1);
                let record = row.get::<_, Option<&str>>(2).and_then(|text| serde_json::from_str(text).ok());
                let record = key_of_record(&kind, record.as_ref());
                self.keys.insert(ItemKey { box_id, at_ns: row.get(0), kind, record });
            }
        }
        Ok(())
    }

    /// Is it one that was made once more, and is it there as it was sent first?
    pub(super) fn holds(&self, row: &FleetRow<'_>) -> bool {
        let Some(box_id) = self.box_ids.get(&*row.box_name).filter(|_| is_resent(row)) else { return false };
        let record = key_of_record(&row.kind, row.record.as_ref());
        self.keys.contains(&ItemKey { box_id: *box_id, at_ns: row.at_ns, kind: row.kind.to_string(), record })
    }
}
