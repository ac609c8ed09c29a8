//! The audit: only appended, hash-chained, checked, and whole after a kill.

use gateway::history::{Audit, Options, Reader, Writer};
use std::path::{Path, PathBuf};
use testkit::process::{Gateway, run, stdout, text};

fn row(number: i64) -> Audit {
    Audit {
        at_ns: number * 1_000_000,
        kind: "request".to_owned(),
        outcome: "limited".to_owned(),
        asked: Some(80.0 + number as f64 / 3.0),
        after: (number % 2 == 0).then_some(-0.0),
        before: Some(f64::NAN),
        unit: "%".to_owned(),
        reason: "constant load, \"负载\"".to_owned(),
        ..Audit::default()
    }
}

fn written(directory: &Path, numbers: std::ops::RangeInclusive<i64>) -> PathBuf {
    let path = directory.join("history.db");
    let writer = Writer::open(&path, Options::default()).expect("opens");
    numbers.for_each(|number| assert!(writer.queue_record(row(number)).is_some()));
    writer.flush().expect("durable");
    path
}

fn change(path: &Path, sql: &str) {
    let db = crate::sealed::connect(path);
    db.execute_batch(&format!("DROP TRIGGER audit_is_never_changed; DROP TRIGGER audit_is_never_removed; {sql}"))
        .expect("somebody with the file in his hands");
}

#[test]
fn the_chain_holds_across_openings_and_names_the_first_row_that_does_not() {
    for (sql, number, part) in [
        ("", 0, ""),
        ("UPDATE audit SET asked = 99 WHERE number = 3", 3, "not as it was written"),
        ("UPDATE audit SET outcome = 'permitted' WHERE number = 6", 6, "not as it was written"),
        ("DELETE FROM audit WHERE number = 4", 5, "4 to 4"),
        ("DELETE FROM audit WHERE number = 1", 1, "1 to 1"),
        ("DELETE FROM audit WHERE number > 5", 6, "ends before it"),
        ("UPDATE audit SET previous = hash WHERE number = 2", 2, "does not follow"),
        ("UPDATE audit SET reason = x'ff00' WHERE number = 2", 2, "cannot be read"),
    ] {
        let directory = tempfile::tempdir().expect("a directory");
        written(directory.path(), 1..=4);
        let path = written(directory.path(), 5..=7);
        if !sql.is_empty() {
            change(&path, sql);
        }
        let check = Reader::open(&path).expect("opens").verify_audit().expect("read");
        match &check.broken {
            None => assert_eq!((sql, check.rows, check.first, check.last), ("", 7, 1, 7)),
            Some(broken) => {
                assert_eq!(broken.number, number, "{sql}: {broken:?}");
                assert!(!sql.is_empty() && broken.what.contains(part), "{sql}: {broken:?}");
            }
        }
        let told = run(&["history", "audit", "--verify", "--history", text(&path)]);
        assert_eq!(told.status.code(), Some(i32::from(!sql.is_empty())), "{}", stdout(&told));
        assert!(sql.is_empty() || stdout(&told).contains(&format!("BROKEN at row {number}")), "{}", stdout(&told));
    }
}

#[test]
fn rows_cannot_be_changed_or_removed_by_accident() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = written(directory.path(), 1..=3);
    let db = rusqlite::Connection::open(&path).expect("opens");
    for sql in ["UPDATE audit SET asked = 1", "DELETE FROM audit", "DELETE FROM audit WHERE number = 1"] {
        let refused = db.execute_batch(sql).expect_err("refused").to_string();
        assert!(refused.contains("only ever appended"), "{sql}: {refused}");
    }
    let rows = Reader::open(&path).expect("opens").read_audit(i64::MIN, i64::MAX, 2).expect("read");
    assert_eq!(rows.iter().map(|row| row.number).collect::<Vec<_>>(), [2, 3]);
    assert_eq!(rows[0].audit.asked, row(2).asked);
    assert_eq!((rows[0].audit.before, rows[0].audit.after), (None, Some(0.0)));
}

#[test]
fn retention_takes_the_oldest_and_the_chain_stays_checkable() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = written(directory.path(), 1..=2500);
    let options = Options::default();
    let day_ns = 86_400_000_000_000_i64;
    let retention = gateway::history::Retention { audit_days: 1.0, ..options.retention };
    let writer = Writer::open(&path, Options { retention, ..Options::default() }).expect("opens");
    let now_ns = day_ns + 2_000 * 1_000_000;
    writer.maintain_and_wait(now_ns, std::time::Duration::from_secs(30)).expect("done");
    let check = Reader::open(&path).expect("opens").verify_audit().expect("read");
    assert_eq!(check.broken, None, "{check:?}");
    // Each step of retention is a row.
    assert!(check.first > 1 && check.rows < 2500 && (2501..=2505).contains(&check.last), "{check:?}");
    assert_eq!(check.removed.as_ref().map(|removed| removed.through), Some(check.first - 1));
    drop(writer);
    written(directory.path(), 2501..=2502);
    let after = Reader::open(&path).expect("opens").verify_audit().expect("read");
    assert_eq!((after.broken, after.last, after.rows), (None, check.last + 2, check.rows + 2));
}

#[test]
fn a_history_of_the_version_before_gets_its_audit_when_it_is_written() {
    let directory = tempfile::tempdir().expect("a directory");
    let path = written(directory.path(), 1..=1);
    let db = crate::sealed::connect(&path);
    db.execute_batch(
        "DROP VIEW audit_list; DROP TABLE audit; DROP VIEW reaction_list; DROP TABLE reactions;
         ALTER TABLE segments DROP COLUMN clock; ALTER TABLE segments DROP COLUMN boot;
         ALTER TABLE segments DROP COLUMN anchor_ns; ALTER TABLE segments DROP COLUMN marks;
         DELETE FROM meta WHERE key = 'audit_head'; PRAGMA user_version = 2;",
    )
    .expect("older");
    drop(db);
    let before = Reader::open(&path).expect("read as it is").verify_audit().expect("read");
    assert_eq!((before.rows, before.broken), (0, None));
    written(directory.path(), 1..=2);
    let after = Reader::open(&path).expect("opens").verify_audit().expect("read");
    assert_eq!((after.rows, after.broken), (2, None));
}

#[test]
fn a_killed_gateway_leaves_a_whole_chain_and_goes_on_with_it() {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let database = data.join("history.db");
    let mut rows = 0;
    for _ in 0..4 {
        let mut gateway = Gateway::start(&data, &["--speed", "60"]);
        gateway.address();
        std::thread::sleep(std::time::Duration::from_millis(1500));
        gateway.kill();
        let check = Reader::open(&database).expect("opens").verify_audit().expect("read");
        assert_eq!(check.broken, None);
        assert!(check.rows >= rows, "{rows} rows became {}", check.rows);
        rows = check.rows;
    }
    assert!(rows >= 3, "every start is a row: {rows}");
}
