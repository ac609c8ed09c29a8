//! The newest value of every series of the boxes of a batch. Pure.

use super::means;
use super::row::FleetRow;
use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;

/// A value as its row has it, or why there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
enum LatestCell<'r> {
    Number(f64),
    Text(&'r str),
    Missing(&'r str),
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct LatestOfBox<'r> {
    /// The oldest of the values.
    pub(super) first_us: i64,
    pub(super) last_us: i64,
    pub(super) arrived_us: i64,
    pub(super) sequence: i64,
    /// Time and value by series.
    cells: BTreeMap<i32, (i64, LatestCell<'r>)>,
}

impl LatestOfBox<'_> {
    /// Time and value by number of the series, as in `{"12":[microseconds,2249.5],"13":[microseconds,null,"stale"]}`.
    pub(super) fn to_json(&self) -> String {
        let cell = |(id, (at_us, cell)): (&i32, &(i64, LatestCell<'_>))| {
            let cell = match cell {
                LatestCell::Number(number) => json!([at_us, number]),
                LatestCell::Text(text) => json!([at_us, text]),
                LatestCell::Missing(reason) => json!([at_us, null, reason]),
            };
            (id.to_string(), cell)
        };
        Json::Object(self.cells.iter().map(cell).collect::<Map<String, Json>>()).to_string()
    }
}

/// Of all boxes of a batch, by their numbers.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Latest<'r> {
    pub(super) boxes: BTreeMap<i32, LatestOfBox<'r>>,
}

impl<'r> Latest<'r> {
    /// Takes the cells of a row on, whose series have these numbers: those of numbers, texts and missing values in this order.
    pub(super) fn add(&mut self, box_id: i32, row: &'r FleetRow<'_>, series: &[i32], arrived_us: i64) {
        let at_us = row.at_us();
        // What is told of a time that is over says nothing about now.
        let live = row.kind != "gap" && means::LEVELS.iter().all(|level| *level.kind != *row.kind);
        let fresh = || LatestOfBox {
            first_us: at_us,
            last_us: i64::MIN,
            arrived_us: i64::MIN,
            sequence: 0,
            cells: BTreeMap::new(),
        };
        let latest = self.boxes.entry(box_id).or_insert_with(fresh);
        latest.arrived_us = latest.arrived_us.max(arrived_us);
        latest.sequence = latest.sequence.max(row.sequence);
        if !live {
            return;
        }
        latest.first_us = latest.first_us.min(at_us);
        latest.last_us = latest.last_us.max(at_us);
        let numbers = row.numbers.iter().map(|(_, number)| LatestCell::Number(*number));
        let texts = row.texts.iter().map(|(_, text)| LatestCell::Text(text));
        let missing = row.missing.iter().map(|(_, reason)| LatestCell::Missing(reason));
        for (id, cell) in series.iter().zip(numbers.chain(texts).chain(missing)) {
            let known = latest.cells.entry(*id).or_insert((at_us, cell));
            if known.0 <= at_us {
                *known = (at_us, cell);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::SeriesName;

    #[test]
    fn the_newest_value_stays_whatever_comes_last() {
        let series = || SeriesName { name: "p".into(), unit: "W".into() };
        let row = |at_ns: i64, number: f64, historical: bool| FleetRow {
            box_name: "b".into(),
            machine: "m".into(),
            path: None,
            sequence: at_ns,
            epoch: 1,
            redated_ns: 0,
            at_ns: at_ns * 1000,
            kind: "sample".into(),
            historical,
            numbers: vec![(series(), number)],
            texts: Vec::new(),
            missing: Vec::new(),
            means: Vec::new(),
            record: None,
        };
        let (newer, older) = (row(20, 5.0, false), row(10, 4.0, true));
        // Means of a time that is over, with their values and without (a clock was put right), say nothing of now.
        let over = ["gap", "minute", "hour", "day"].map(|kind| FleetRow {
            kind: kind.into(),
            numbers: Vec::new(),
            ..row(90, 0.0, false)
        });
        let mut latest = Latest::default();
        latest.add(1, &newer, &[3], 21);
        latest.add(1, &older, &[3], 22);
        let found = &latest.boxes[&1];
        assert_eq!((found.first_us, found.last_us, found.arrived_us, found.sequence), (10, 20, 22, 20));
        assert_eq!(found.to_json(), r#"{"3":[20,5.0]}"#);
        for row in &over {
            latest.add(1, row, &[], 23);
            assert_eq!(latest.boxes[&1].last_us, 20, "{}", row.kind);
        }
    }
}
