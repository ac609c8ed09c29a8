//! Which life of the box has numbered an item.
//!
//! A history can be older than what was sent from it: a copy that was put back, a spare box, a disk that lost its last commits. Its
//! numbers go on from where it stands, and would name other items than those that a receiver has. So every opening of the outbox
//! begins a new epoch: an item is named by box, epoch and number. Items that an earlier life has numbered keep its epoch, so that what
//! is sent once more is recognised.
//!
//! An epoch is a number below 2^53: how many there were before, times 2^32, and 32 random bits, which tell two boxes apart that go on
//! from the same copy. Epoch 0 is what was numbered before there were epochs.

use super::number::to_stored_number;
use super::property::read_property;
use crate::HistoryError;
use crate::error::Doing;
use rusqlite::{Connection, OptionalExtension};
use serde::{Deserialize, Serialize};

/// The epoch of items that are made from the history once more: no life of a box has it.
pub const RESENT_EPOCH: u64 = 1;
/// Key of the table `meta`.
const EPOCHS: &str = "outbox_epochs";
const RANDOM_BITS: u32 = 32;
/// Openings that can be counted: with the random bits the number stays below 2^53, which every reader of JSON holds exactly.
const COUNT_MAX: u64 = 1 << 21;

/// From which number on an epoch counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct EpochStart {
    from: u64,
    epoch: u64,
}

/// The epochs of the items that the outbox may still hold, oldest first.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct Epochs(Vec<EpochStart>);

/// The numbers `from..to` of one epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct EpochStretch {
    pub(super) epoch: u64,
    pub(super) from: u64,
    pub(super) to: u64,
}

impl Epochs {
    /// Reads them; none where there are none, or where they cannot be read.
    pub(super) fn load(db: &Connection) -> Result<Self, HistoryError> {
        let text = read_property(db, EPOCHS)?;
        Ok(text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default())
    }

    /// The epoch that has numbered this item.
    pub(super) fn epoch_of(&self, sequence: u64) -> u64 {
        self.0.iter().rev().find(|start| start.from <= sequence).map_or(0, |start| start.epoch)
    }

    /// The numbers `from..to`, divided where another epoch begins.
    pub(super) fn divide(&self, from: u64, to: u64) -> Vec<EpochStretch> {
        let mut stretches = Vec::new();
        let mut begin = from;
        let starts = self.0.iter().map(|start| start.from).filter(|start| (from + 1..to).contains(start));
        for end in starts.chain([to]).filter(|end| *end > from) {
            stretches.push(EpochStretch { epoch: self.epoch_of(begin), from: begin, to: end });
            begin = end;
        }
        stretches
    }

    fn count(&self) -> u64 {
        self.0.last().map_or(0, |newest| newest.epoch >> RANDOM_BITS)
    }
}

/// A new life begins: numbers from `next` on are of an epoch that nobody has had. Gives it. Those of items that are gone are
/// forgotten; `oldest` is the first number that is still there.
pub(super) fn begin_epoch(db: &Connection, oldest: u64, next: u64) -> Result<u64, HistoryError> {
    let mut epochs = Epochs::load(db)?;
    let random = u64::from_str_radix(&adapter_core::unique_id::generate_unique_id(), 16).unwrap_or(0);
    let epoch = ((epochs.count() + 1) % COUNT_MAX) << RANDOM_BITS | random & ((1 << RANDOM_BITS) - 1);
    // A life that has numbered nothing leaves nothing behind.
    epochs.0.retain(|start| start.from < next);
    let still_there = epochs.0.iter().rposition(|start| start.from <= oldest).unwrap_or(0);
    epochs.0.drain(..still_there);
    epochs.0.push(EpochStart { from: next, epoch });
    let text = serde_json::to_string(&epochs).unwrap_or_default();
    db.execute("INSERT OR REPLACE INTO meta (key, value) VALUES (?1, ?2)", [EPOCHS, &text])
        .with_activity("beginning an epoch of the outbox")?;
    Ok(epoch)
}

/// The first number that the outbox still holds; `next` where it holds none.
pub(super) fn oldest_number(db: &Connection, next: u64) -> Result<u64, HistoryError> {
    let oldest: Option<i64> = db
        .query_row(
            "SELECT min(first_sequence) FROM outbox WHERE first_sequence < ?1",
            [to_stored_number(next).with_activity("looking for the oldest item")?],
            |row| row.get(0),
        )
        .optional()
        .with_activity("looking for the oldest item")?
        .flatten();
    Ok(oldest.and_then(|oldest| u64::try_from(oldest).ok()).unwrap_or(next))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn memory() -> Connection {
        let db = Connection::open_in_memory().expect("opened");
        db.execute_batch("CREATE TABLE meta (key TEXT PRIMARY KEY, value)").expect("made");
        db
    }

    #[test]
    fn every_life_has_its_own_epoch_and_items_keep_that_of_theirs() {
        let db = memory();
        let first = begin_epoch(&db, 1, 1).expect("begun");
        let second = begin_epoch(&db, 1, 100).expect("begun");
        let epochs = Epochs::load(&db).expect("read");
        assert_eq!([99, 100, 5000].map(|number| epochs.epoch_of(number)), [first, second, second]);
        assert_eq!((first >> 32, second >> 32), (1, 2));
        let stretch = |epoch, from, to| EpochStretch { epoch, from, to };
        assert_eq!(epochs.divide(90, 110), [stretch(first, 90, 100), stretch(second, 100, 110)]);
        assert_eq!(epochs.divide(100, 101), [stretch(second, 100, 101)]);
        assert_eq!(epochs.divide(7, 7), []);
    }

    #[test]
    fn two_boxes_that_go_on_from_one_copy_have_different_epochs() {
        let (original, copy) = (memory(), memory());
        let mut begun = std::collections::BTreeSet::new();
        for _ in 0..50 {
            begun.insert(begin_epoch(&original, 1, 2217).expect("begun"));
            begun.insert(begin_epoch(&copy, 1, 2217).expect("begun"));
        }
        assert_eq!(begun.len(), 100);
        assert!(begun.iter().all(|epoch| *epoch < 1 << 53));
    }

    #[test]
    fn what_is_gone_is_forgotten() {
        let db = memory();
        let begun: Vec<u64> =
            [1, 10, 20, 20, 30].iter().map(|next| begin_epoch(&db, 1, *next).expect("begun")).collect();
        assert_eq!(Epochs::load(&db).expect("read").0.len(), 4, "one life has numbered nothing");
        let newest = begin_epoch(&db, 25, 40).expect("begun");
        let epochs = Epochs::load(&db).expect("read");
        assert_eq!([25, 30, 40].map(|number| epochs.epoch_of(number)), [begun[3], begun[4], newest]);
        assert_eq!(epochs.0.len(), 3);
    }
}
