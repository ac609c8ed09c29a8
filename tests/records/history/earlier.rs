//! The copy of the history that is kept before a newer version changes its tables, and the way back to it.

use crate::history::damage::{OLDER_EXPORT, export, older};
use crate::history::machine::Machine;
use crate::history::round_trip::{options, write};
use gateway::history::{
    Options, Outbox, OutboxSettings, Reader, RecordSpan, Writer, go_back, is_going_back, remove_old_copies,
};
use std::fs;

/// The history as it was, beside the one with newer tables; and the way back to it.
#[test]
fn a_copy_is_kept_before_the_tables_change_and_an_older_version_goes_back_to_it() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, copy) = (dir.path().join("h.db"), dir.path().join("h.db.schema-4"));
    older(&path);
    // Somebody who reads keeps the log from being emptied.
    let reading = rusqlite::Connection::open(&path).expect("opens");
    reading.execute_batch("BEGIN; SELECT count(*) FROM segments").expect("reads");
    drop(Writer::open(&path, Options::default()).expect("gets the newer schema"));
    drop(reading);
    assert_eq!(export(&copy), OLDER_EXPORT, "the copy");
    let schema: i64 = rusqlite::Connection::open(&copy)
        .and_then(|db| db.query_row("PRAGMA user_version", [], |row| row.get(0)))
        .expect("reads");
    assert_eq!(schema, 4);
    let told = Reader::open(&path).and_then(|reader| reader.read_events(RecordSpan::newest(10))).expect("reads");
    let told: Vec<&str> =
        told.iter().filter(|event| event.kind == "history_schema").map(|event| &*event.text).collect();
    assert!(told.len() == 1 && told[0].contains("h.db.schema-4"), "{told:?}");
    drop(Writer::open(&path, Options::default()).expect("opens"));
    let again = Reader::open(&path).and_then(|reader| reader.read_events(RecordSpan::newest(10))).expect("reads");
    assert_eq!(again.iter().filter(|event| event.kind == "history_schema").count(), 1, "only once");

    // A week after a confirmed clock has met it first it is gone, not a day earlier.
    let now_ns = gateway::clock::now_ns() + 3_000 * 86_400_000_000_000;
    let day_ns = 86_400_000_000_000;
    remove_old_copies(&path, now_ns);
    remove_old_copies(&path, now_ns + 6 * day_ns);
    assert!(copy.is_file());
    remove_old_copies(&path, now_ns + 8 * day_ns);
    assert!(!copy.exists());

    assert_eq!(go_back(&path).expect("nothing to do"), None, "without a copy nothing is changed");
}

/// A newer version has changed the tables, has sent items, and was taken back.
#[test]
fn an_older_version_goes_on_with_the_copy_and_uses_no_number_twice() {
    let dir = tempfile::tempdir().expect("a directory");
    let (path, copy) = (dir.path().join("h.db"), dir.path().join("h.db.schema-6"));
    let outbox = || Outbox::new("lathe", OutboxSettings::default(), ["plant".to_owned()]);
    let next_number = |lines: std::ops::Range<i64>| {
        let outbox = outbox();
        let writer = Writer::open(&path, Options { outbox: Some(outbox.clone()), ..options() }).expect("opens");
        write(&writer, &Machine::new(), lines);
        writer.flush().expect("durable");
        drop(writer);
        (outbox.epoch(), outbox.watch_head().borrow().next_sequence)
    };
    let (first, kept) = next_number(0..500);
    fs::copy(&path, &copy).expect("copies");
    let (second, sent) = next_number(500..1_500);
    assert!(sent > kept, "{sent}");
    crate::sealed::connect(&path).pragma_update(None, "user_version", 99).expect("changes");
    let newer = go_back(&path).expect("renames").expect("there is a copy");
    assert!(newer.is_file() && newer.to_string_lossy().contains("h.db.newer-"), "{newer:?}");
    assert!(!copy.exists());
    let (third, _) = next_number(500..600);
    assert!(third != second && third != first && second != first, "numbers that were sent name other items: {third}");

    // The power fails between the two names.
    fs::rename(&path, &copy).expect("renamed");
    assert!(is_going_back(&path));
    assert!(go_back(&path).expect("renames").is_some() && path.is_file() && !copy.exists());
    assert!(!is_going_back(&path));
}
