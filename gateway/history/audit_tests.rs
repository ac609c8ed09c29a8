//! The chain of the audit where the file that it stands in is not what was written.

use super::audit::append_row;
use super::schema::open_for_writing;
use gateway_records::Audit;

#[test]
fn a_number_that_no_row_has_is_an_error_and_no_panic() {
    let directory = tempfile::tempdir().expect("a directory");
    let db = open_for_writing(&directory.path().join("history.db")).expect("a file");
    let row = Audit { kind: "started".to_owned(), ..Audit::default() };
    append_row(&db, &row).expect("row 1");
    // Who damages a file asks no trigger.
    let mut triggers =
        db.prepare("SELECT name FROM sqlite_master WHERE type = 'trigger' AND tbl_name = 'audit'").expect("asked");
    let names: Vec<String> =
        triggers.query_map([], |row| row.get(0)).expect("read").map(|name| name.expect("text")).collect();
    drop(triggers);
    names.iter().for_each(|name| db.execute_batch(&format!("DROP TRIGGER {name}")).expect("dropped"));
    for number in [i64::MAX, -7, -1] {
        db.execute("UPDATE audit SET number = ?1", [number]).expect("damaged");
        assert!(append_row(&db, &row).is_err(), "after {number}");
    }
    db.execute("UPDATE audit SET number = 1", []).expect("mended");
    append_row(&db, &row).expect("row 2");
}
