//! The library of wear models, and the way of an older file to it.

use crate::history::round_trip::options;
use gateway::history::{Reader, Writer, store_wear_model};
use rules::estimators::wear::{WearKey, WearModel, WearRecord, build_published_surface};
use std::path::Path;

fn record(tool: &str, criterion_mm: f64) -> WearRecord {
    let key = WearKey {
        machine: "CHK460".to_owned(),
        tool: tool.to_owned(),
        work_material: "45# steel".to_owned(),
        operation: "rough".to_owned(),
    };
    WearRecord::new(
        key,
        criterion_mm,
        ("table.csv".to_owned(), 27, 0.9929),
        WearModel::Surface(build_published_surface()),
    )
}

#[test]
fn models_come_back_and_the_newest_of_a_key_is_in_force() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("h.db");
    let writer = Writer::open(&path, options()).expect("opens");
    for (at_ns, tool, criterion_mm) in [(1, "T1", 0.3), (2, "T2", 0.3), (3, "T1", 0.25)] {
        store_wear_model(&path, at_ns, &record(tool, criterion_mm)).expect("stored while a gateway writes");
    }
    let reader = Reader::open(&path).expect("opens");
    let found = reader.wear_models::<WearRecord>().expect("read");
    assert_eq!(found.iter().map(|it| it.in_force).collect::<Vec<_>>(), [false, true, true]);
    assert_eq!((found[2].record.clone(), found[2].at_ns), (record("T1", 0.25), 3));
    assert_eq!(reader.newest_wear_model().expect("read"), 3);
    writer.flush().expect("the gateway goes on");
}

/// A file as the version before wrote it.
fn older(path: &Path) {
    drop(Writer::open(path, options()).expect("opens"));
    let db = crate::sealed::connect(path);
    db.execute_batch(
        "DROP VIEW wear_model_list; DROP TABLE wear_models;
        DROP VIEW audit_list; DROP TABLE audit; DROP VIEW reaction_list; DROP TABLE reactions;
        ALTER TABLE segments DROP COLUMN clock; ALTER TABLE segments DROP COLUMN boot;
         ALTER TABLE segments DROP COLUMN anchor_ns; ALTER TABLE segments DROP COLUMN marks;
         DROP INDEX events_kind; PRAGMA user_version = 1;",
    )
    .expect("older");
}

#[test]
fn an_older_file_is_read_as_it_is_and_gets_the_table_when_it_is_written() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("h.db");
    older(&path);
    let reader = Reader::open(&path).expect("opens");
    assert_eq!(
        (reader.wear_models::<WearRecord>().expect("read"), reader.newest_wear_model().expect("read")),
        (Vec::new(), 0)
    );
    drop(reader);
    drop(Writer::open(&path, options()).expect("migrated"));
    let version: i64 = rusqlite::Connection::open(&path)
        .and_then(|db| db.query_row("PRAGMA user_version", [], |row| row.get(0)))
        .expect("a number");
    assert_eq!(version, 6);
    let plan: String = rusqlite::Connection::open(&path)
        .and_then(|db| {
            let question = "EXPLAIN QUERY PLAN SELECT at_ns FROM events WHERE kind = 'x' AND at_ns >= 0 ORDER BY at_ns DESC, id DESC";
            db.query_row(question, [], |row| row.get(3))
        })
        .expect("a plan");
    assert!(plan.contains("events_kind"), "events of a kind are found by their index: {plan}");
    store_wear_model(&path, 1, &record("T1", 0.3)).expect("stored");
    assert_eq!(Reader::open(&path).expect("opens").wear_models::<WearRecord>().expect("read").len(), 1);
}
