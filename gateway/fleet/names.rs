//! The numbers that boxes and series have in the database, and at which machine each box stands.

use super::database::DatabaseError;
use super::row::{FleetRow, SeriesName};
use crate::row::Arrived;
use gateway_base::machine_path::MachinePath;
use std::collections::HashMap;
use tokio_postgres::Client;
use tokio_postgres::types::ToSql;

/// Names that are remembered; beyond that they are asked for again. A thousand boxes of a hundred series each.
const REMEMBERED_MAX: usize = 100_000;

/// A row with the numbers of its box and, in the order of its cells, of its series.
#[derive(Debug)]
pub(super) struct NumberedRow<'r> {
    pub(super) row: &'r FleetRow<'r>,
    /// When the stream had the row, microseconds since 1970.
    pub(super) arrived_us: i64,
    pub(super) box_id: i32,
    pub(super) series: Vec<i32>,
}

#[derive(Debug, Default)]
pub(super) struct Names {
    boxes: HashMap<String, (i32, String)>,
    /// At which machine each box was last noted.
    places: HashMap<String, Option<MachinePath>>,
    /// By name, then by unit: few names have several.
    series: HashMap<String, Vec<(String, i32)>>,
}

impl Names {
    /// The number of a box that has been learnt.
    pub(super) fn box_id(&self, name: &str) -> Option<i32> {
        self.boxes.get(name).map(|(id, _)| *id)
    }

    /// The number of a series that has been learnt.
    fn series_id(&self, series: &SeriesName<'_>) -> Option<i32> {
        let units = self.series.get(&*series.name)?;
        units.iter().find(|(unit, _)| *unit == series.unit).map(|(_, id)| *id)
    }

    /// The rows with their numbers. Asks for what is not known yet, and notes a machine that has another name now.
    pub(super) async fn number_rows<'r>(
        &mut self,
        client: &Client,
        rows: &[Arrived<'r>],
    ) -> Result<Vec<NumberedRow<'r>>, DatabaseError> {
        if self.boxes.len() > REMEMBERED_MAX || self.series.len() > REMEMBERED_MAX {
            *self = Self::default();
        }
        let naming = |error| DatabaseError::new("naming boxes and series", &error);
        let mut numbered = Vec::with_capacity(rows.len());
        for Arrived { row, arrived_us } in rows {
            let box_id = match self.boxes.get(&*row.box_name) {
                Some((id, machine)) if *machine == row.machine => *id,
                _ => {
                    let named = client.query_one(NAME_BOX, &[&&*row.box_name, &&*row.machine, &row.at_us()]).await;
                    let id = named.map_err(naming)?.get(0);
                    self.boxes.insert(row.box_name.to_string(), (id, row.machine.to_string()));
                    id
                }
            };
            // What comes late was made at a time of which the box does not say where it stood.
            if !row.historical && self.places.get(&*row.box_name) != Some(&row.path) {
                note_place(client, box_id, row.path.as_ref(), row.at_us()).await.map_err(naming)?;
                self.places.insert(row.box_name.to_string(), row.path.clone());
            }
            let mut series =
                Vec::with_capacity(row.numbers.len() + row.texts.len() + row.missing.len() + row.means.len());
            for named in row.series_names() {
                series.push(match self.series_id(named) {
                    Some(id) => id,
                    None => self.name_series(client, named).await.map_err(naming)?,
                });
            }
            numbered.push(NumberedRow { row, arrived_us: *arrived_us, box_id, series });
        }
        Ok(numbered)
    }

    async fn name_series(&mut self, client: &Client, series: &SeriesName<'_>) -> Result<i32, tokio_postgres::Error> {
        let id = client.query_one(NAME_SERIES, &[&&*series.name, &&*series.unit]).await?.get(0);
        self.series.entry(series.name.to_string()).or_default().push((series.unit.to_string(), id));
        Ok(id)
    }
}

/// Notes at which machine a box stands from this time on, where that is another one than before.
async fn note_place(
    client: &Client,
    box_id: i32,
    path: Option<&MachinePath>,
    at_us: i64,
) -> Result<(), tokio_postgres::Error> {
    let machine_id: Option<i32> = match path {
        None => None,
        Some(path) => {
            let level =
                |name: &str| path.list_levels().find(|(level, _)| *level == name).map(|(_, word)| word.to_owned());
            let [enterprise, site, area, line] = ["enterprise", "site", "area", "line"].map(level);
            let values: [&(dyn ToSql + Sync); 6] =
                [&path.format_topic(), &enterprise, &site, &area, &line, &path.machine_word()];
            Some(client.query_one(NAME_MACHINE, &values).await?.get(0))
        }
    };
    client.execute(PLACE_BOX, &[&box_id, &at_us, &machine_id]).await.map(drop)
}

const NAME_MACHINE: &str = "
INSERT INTO machines (path, enterprise, site, area, line, machine) VALUES ($1, $2, $3, $4, $5, $6)
ON CONFLICT (path) DO UPDATE SET path = excluded.path RETURNING machine_id";

/// A box that has never had a path has no row; one whose path was taken away has one without a machine.
const PLACE_BOX: &str = "
INSERT INTO box_machines (box_id, since, machine_id)
SELECT $1, fleet_time($2::bigint * 1000), $3
WHERE (SELECT machine_id FROM box_machines WHERE box_id = $1 AND since <= fleet_time($2::bigint * 1000) ORDER BY since DESC LIMIT 1) IS DISTINCT FROM $3::int
ON CONFLICT (box_id, since) DO UPDATE SET machine_id = excluded.machine_id";

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
