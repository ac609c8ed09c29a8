//! The numbers that boxes and series have in the database.

use super::database::DatabaseError;
use super::row::SeriesName;
use super::write::Arrived;
use std::collections::HashMap;
use tokio_postgres::Client;

/// Names that are remembered; beyond that they are asked for again. A thousand boxes of a hundred series each.
const REMEMBERED_MAX: usize = 100_000;

#[derive(Debug, Default)]
pub(super) struct Names {
    /// Number and name of the machine.
    boxes: HashMap<String, (i32, String)>,
    /// By name, then by unit: few names have several.
    series: HashMap<String, Vec<(String, i32)>>,
}

impl Names {
    /// The number of a box that has been learnt.
    pub(super) fn box_id(&self, name: &str) -> Option<i32> {
        self.boxes.get(name).map(|(id, _)| *id)
    }

    /// The number of a series that has been learnt.
    pub(super) fn series_id(&self, series: &SeriesName<'_>) -> Option<i32> {
        let units = self.series.get(&*series.name)?;
        units.iter().find(|(unit, _)| *unit == series.unit).map(|(_, id)| *id)
    }

    /// Asks for what is not known yet, and notes a machine that has another name now.
    pub(super) async fn resolve_names(&mut self, client: &Client, rows: &[Arrived<'_>]) -> Result<(), DatabaseError> {
        if self.boxes.len() > REMEMBERED_MAX || self.series.len() > REMEMBERED_MAX {
            *self = Self::default();
        }
        let naming = |error| DatabaseError::new("naming boxes and series", &error);
        for Arrived { row, .. } in rows {
            let known = self.boxes.get(&*row.box_name).is_some_and(|(_, machine)| *machine == row.machine);
            if !known {
                let found = client
                    .query_one(NAME_BOX, &[&&*row.box_name, &&*row.machine, &row.at_us()])
                    .await
                    .map_err(naming)?;
                self.boxes.insert(row.box_name.to_string(), (found.get(0), row.machine.to_string()));
            }
            for series in row.series_names() {
                if self.series_id(series).is_none() {
                    let found =
                        client.query_one(NAME_SERIES, &[&&*series.name, &&*series.unit]).await.map_err(naming)?;
                    let units = self.series.entry(series.name.to_string()).or_default();
                    units.push((series.unit.to_string(), found.get(0)));
                }
            }
        }
        Ok(())
    }
}

/// A name counts from the time of the item that brings it; an item that comes late does not bring the old one back.
const NAME_BOX: &str = "
WITH named AS (
  INSERT INTO boxes AS known (box, machine, named_at) VALUES ($1, $2, fleet_time($3::bigint * 1000))
  ON CONFLICT (box) DO UPDATE SET
    named_at = CASE WHEN excluded.named_at > known.named_at AND excluded.machine <> known.machine THEN excluded.named_at ELSE known.named_at END,
    machine = CASE WHEN excluded.named_at > known.named_at THEN excluded.machine ELSE known.machine END
  RETURNING box_id, machine, named_at
), noted AS (
  INSERT INTO box_names (box_id, since, machine) SELECT box_id, named_at, machine FROM named ON CONFLICT DO NOTHING
)
SELECT box_id FROM named";

const NAME_SERIES: &str = "INSERT INTO series (name, unit) VALUES ($1, $2) ON CONFLICT (name, unit) DO UPDATE SET unit = excluded.unit RETURNING series_id";
