//! Numbers of items on their way into the table and back. A number names an item for ever, so one that does not fit is an error and
//! never the nearest that does: another number would name another item.

use rusqlite::{Error, Row};

/// Reads the number of an item, or how many items a row holds. A negative one was never stored: the disk has changed it.
pub(super) fn read_item_number(row: &Row<'_>, index: usize) -> Result<u64, Error> {
    let stored: i64 = row.get(index)?;
    u64::try_from(stored).map_err(|_| Error::IntegralValueOutOfRange(index, stored))
}

/// The number of an item as `SQLite` holds it.
pub(super) fn to_stored_number(number: u64) -> Result<i64, Error> {
    i64::try_from(number).map_err(|error| Error::ToSqlConversionFailure(Box::new(error)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Doing;
    use rusqlite::Connection;

    fn read(stored: i64) -> Result<u64, Error> {
        let db = Connection::open_in_memory()?;
        db.query_row("SELECT ?1", [stored], |row| read_item_number(row, 0))
    }

    #[test]
    fn every_number_comes_back_and_an_impossible_one_is_damage() {
        for number in [0, 1, i64::MAX.unsigned_abs()] {
            let stored = to_stored_number(number).expect("it fits");
            assert_eq!(read(stored).expect("whole"), number);
        }
        assert!(to_stored_number(i64::MAX.unsigned_abs() + 1).is_err(), "no other number is stored in its place");
        let changed = read(-5).with_activity("reading the outbox").expect_err("never stored");
        assert!(changed.is_damage(), "{changed}");
    }
}
