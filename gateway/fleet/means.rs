//! Means of minutes, hours and days, packed as the tables hold them: the minutes of an hour in one row. Pure.

use super::row::FleetRow;
use jiff::{Timestamp, civil::DateTime, tz::TimeZone};
use std::collections::BTreeMap;

/// A level of means, and the table that holds it.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct MeanLevel {
    /// Kind of the items.
    pub(super) kind: &'static str,
    pub(super) table: &'static str,
    /// Column that names the row, and what it counts.
    pub(super) row: &'static str,
    /// Places of a row.
    pub(super) places: usize,
}

pub(super) const LEVELS: [MeanLevel; 3] = [
    MeanLevel { kind: "minute", table: "minute_means", row: "hour", places: 60 },
    MeanLevel { kind: "hour", table: "hour_means", row: "day", places: 24 },
    MeanLevel { kind: "day", table: "day_means", row: "month", places: 31 },
];

impl MeanLevel {
    /// Where the row begins that holds this time, in microseconds since 1970, and the place in it.
    fn find_place(&self, at_us: i64) -> Option<(i64, usize)> {
        let at = Timestamp::from_microsecond(at_us).ok()?.to_zoned(TimeZone::UTC).datetime();
        let (start, place) = match self.kind {
            "minute" => (at.date().at(at.hour(), 0, 0, 0), at.minute()),
            "hour" => (at.date().at(0, 0, 0, 0), at.hour()),
            _ => (at.date().first_of_month().at(0, 0, 0, 0), at.day() - 1),
        };
        Some((to_microseconds(start)?, usize::try_from(place).ok()?))
    }
}

fn to_microseconds(at: DateTime) -> Option<i64> {
    at.to_zoned(TimeZone::UTC).ok().map(|at| at.timestamp().as_microsecond())
}

/// Mean, least, greatest value and seconds of each place of a row.
pub(super) type Places = [Vec<Option<f32>>; 4];

/// The rows of one level: series, box and beginning, and their places.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct MeanRows {
    pub(super) rows: BTreeMap<(i32, i32, i64), Places>,
}

impl MeanRows {
    /// Takes on the means of an item, whose series have these numbers. Of two items of the same place the one that knows more seconds
    /// counts, whatever the order: the summaries of a box only grow.
    pub(super) fn add(&mut self, level: &MeanLevel, box_id: i32, row: &FleetRow<'_>, series: &[i32]) {
        let Some((start_us, place)) = level.find_place(row.at_us()) else { return };
        for (id, (_, numbers)) in series.iter().zip(&row.means) {
            let empty = || std::array::from_fn(|_| vec![None; level.places]);
            let places = self.rows.entry((*id, box_id, start_us)).or_insert_with(empty);
            #[expect(clippy::cast_possible_truncation, reason = "single precision is what the tables hold")]
            let numbers = numbers.map(|number| number as f32);
            if places[3][place].is_none_or(|seconds| numbers[3] >= seconds) {
                places.iter_mut().zip(numbers).for_each(|(column, number)| column[place] = Some(number));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_has_its_place_in_hour_day_and_month() {
        let at = |text: &str| text.parse::<Timestamp>().expect("a time").as_microsecond();
        let noon = at("2026-02-28T12:34:00Z");
        assert_eq!(LEVELS[0].find_place(noon), Some((at("2026-02-28T12:00:00Z"), 34)));
        assert_eq!(LEVELS[1].find_place(noon), Some((at("2026-02-28T00:00:00Z"), 12)));
        assert_eq!(LEVELS[2].find_place(noon), Some((at("2026-02-01T00:00:00Z"), 27)));
    }
}
