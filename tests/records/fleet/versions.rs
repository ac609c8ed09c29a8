//! Tables of another version, a database with an extension, what is too old, and a reader that is not ours.

use crate::fleet::pipeline::Plant;
use gateway::fleet::parse_cluster;
use gateway::nats::{Connection, Outgoing};
use serde_json::{Value as Json, json};
use std::path::Path;
use std::process::Command;
use testkit::process::{run, stderr, stdout};

/// The version that this program writes.
const VERSION: &str = "5";

#[test]
fn tables_of_version_3_are_brought_up_with_everything_in_them() {
    let Some(plant) = Plant::start() else { return };
    plant.postgres.sql(include_str!("version_3.sql"));
    publish(&plant, &[sample(8, 0)]);
    assert!(plant.ingest().contains("1 rows written"));
    let sql = |statement: &str| plant.postgres.sql(statement);
    assert_eq!(sql("SELECT max(version) FROM fleet_schema"), VERSION);
    assert_eq!(sql("SELECT sequence FROM items ORDER BY at"), "7\n8");
    assert_eq!(sql("SELECT state, program, path FROM states"), "cutting|O1|");
    assert_eq!(sql("SELECT label, path FROM placements"), "Lathe 8|", "a box without a path is its machine");
    assert_eq!(sql("SELECT count(*) FROM readings"), "3");
}

#[test]
fn tables_of_version_2_are_brought_up_with_everything_in_them() {
    let Some(plant) = Plant::start() else { return };
    plant.postgres.sql(include_str!("version_2.sql"));
    publish(&plant, &[sample(8, 0)]);
    assert!(plant.ingest().contains("1 rows written"));
    let sql = |statement: &str| plant.postgres.sql(statement);
    assert_eq!(sql("SELECT max(version) FROM fleet_schema"), VERSION);
    assert_eq!(sql("SELECT sequence, epoch, redated_ns FROM items ORDER BY at"), "7|0|0\n8|0|0");
    assert_eq!(sql("SELECT state, program FROM states"), "cutting|O1");
    assert_eq!(sql("SELECT count(*) FROM readings"), "3");
}

/// A message of a box, made so many days ago.
fn sample(sequence: u64, days_ago: i64) -> Outgoing {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    let at_ns = i64::try_from(since.as_nanos()).expect("before 2262") - days_ago * 86_400_000_000_000;
    let document = json!({"schema": "item/1", "sequence": sequence, "at_ns": at_ns, "kind": "sample", "machine": "Lathe 8", "box": "Lathe-8-3fa9c1",
        "historical": false, "values": [{"name": "spindle_power_w", "value": sequence, "unit": "W"}, {"name": "program", "value": "O2", "unit": ""}]});
    let payload = document.to_string().into_bytes();
    Outgoing { subject: "cnc.Lathe-8-3fa9c1.sample".to_owned(), id: format!("x-{sequence}"), payload }
}

fn publish(plant: &Plant, messages: &[Outgoing]) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    let (target, _) = parse_cluster(&plant.address).expect("an address");
    runtime.block_on(async {
        let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
        connection.publish_all(messages).await.map_err(|(_, failure)| failure).expect("stored");
    });
}

#[test]
fn tables_of_version_1_are_brought_up_with_everything_in_them() {
    let Some(plant) = Plant::start() else { return };
    plant.postgres.sql(include_str!("version_1.sql"));
    publish(&plant, &[sample(7, 0)]);
    assert!(plant.ingest().contains("1 rows written"));
    let sql = |statement: &str| plant.postgres.sql(statement);
    assert_eq!(sql("SELECT max(version) FROM fleet_schema"), VERSION);
    assert_eq!(
        sql("SELECT box, machine FROM boxes ORDER BY box"),
        "Lathe-8-3fa9c1|Lathe 8\nMill-2-00ff00|Mill 2",
        "renamed, not two"
    );
    assert_eq!(sql("SELECT box_names.machine FROM box_names JOIN boxes USING (box_id) WHERE box = 'Lathe-8-3fa9c1' ORDER BY since").lines().next(), Some("Lathe 7"));
    assert_eq!(
        sql("SELECT count(*), max(sequence) FROM items JOIN boxes USING (box_id) WHERE box = 'Lathe-8-3fa9c1'"),
        "7|7"
    );
    let readings = "SELECT name, unit, number, text, missing_reason, at_ns FROM readings WHERE at_ns < 1769900000000000000 ORDER BY at_ns, name";
    assert_eq!(
        sql(readings),
        "coolant_temperature_c||||stale|1769767200100000000\nfeed_mm_min|mm/min|200|||1769767200100000000\nprogram|||O1||1769767200100000000\n\
         spindle_power_w|W|100.5|||1769767200100000000\nfeed_mm_min|mm/min|||machine_off|1769853600200000000\nspindle_power_w|W|101.5|||1769853600200000000"
    );
    assert_eq!(sql("SELECT energy_j, seconds FROM parts"), "5000|300");
    assert_eq!(sql("SELECT operation, energy_j FROM operations"), "rough|4000");
    assert_eq!(
        sql("SELECT state, extract(epoch FROM until - since) FROM state_list ORDER BY since"),
        "cutting|600.000000\nstandby|"
    );
    assert_eq!(sql("SELECT detail FROM events"), "\"plain words\"");
    assert_eq!(sql("SELECT diagnosis -> 'missing' -> 0 ->> 'effect' FROM diagnoses"), "friction");
    assert_eq!(sql("SELECT count(*) FROM refused"), "2");
    assert_eq!(sql("SELECT to_regclass('items_1') IS NULL"), "t", "nothing is left of the old tables");
    // A newer version than this program knows is left alone.
    sql("INSERT INTO fleet_schema (version) VALUES (99)");
    let said = run(&["fleet", "ingest", &plant.address, "--once", "--database", &plant.postgres.address()]);
    assert!(said.status.code() == Some(2) && stderr(&said).contains("version 99"), "{}", stderr(&said));
}

#[test]
fn what_is_too_old_goes_and_a_dry_run_changes_nothing() {
    let Some(plant) = Plant::start() else { return };
    publish(&plant, &[sample(1, 40), sample(2, 31), sample(3, 10), sample(4, 0)]);
    plant.ingest();
    let retain = |more: &[&str]| {
        let address = plant.postgres.address();
        let arguments = [&["fleet", "retain", "--items-d", "30", "--database", &address], more].concat();
        let said = run(&arguments);
        assert!(said.status.success(), "{}", stderr(&said));
        stdout(&said)
    };
    let would = retain(&["--dry-run"]);
    assert!(would.matches("items_").count() == 2 && would.contains("dry run"), "{would}");
    assert_eq!(plant.postgres.number("SELECT count(*) FROM items"), 4);
    let document: Json = serde_json::from_str(&retain(&["--json"])).expect("JSON");
    assert_eq!(document["removed"].as_array().map(Vec::len), Some(2), "{document}");
    assert_eq!(plant.postgres.number("SELECT count(*) FROM items"), 2);
    assert!(retain(&[]).contains("nothing is too old"));
}

/// What the extension TimescaleDB would be asked to do: it is no package of Debian, so its functions are played here. They only write
/// down with what they are called.
#[test]
fn a_database_with_the_extension_gets_hypertables() {
    let Some(plant) = Plant::start() else { return };
    plant.postgres.sql(
        "CREATE TABLE called (what text);
         CREATE FUNCTION create_hypertable(relation regclass, time_column_name name, chunk_time_interval interval) RETURNS void LANGUAGE sql AS
           $$INSERT INTO called VALUES (relation || ' ' || time_column_name || ' ' || chunk_time_interval)$$;
         CREATE FUNCTION drop_chunks(relation regclass, older_than interval) RETURNS SETOF text LANGUAGE sql AS
           $$INSERT INTO called VALUES ('drop ' || relation || ' ' || older_than); SELECT 'chunk_1'$$;
         SET allow_system_table_mods = on;
         INSERT INTO pg_extension SELECT 99999, 'timescaledb', 10, 2200, true, '2.15', NULL, NULL;",
    );
    publish(&plant, &[sample(1, 0), sample(2, 3)]);
    assert!(plant.ingest().contains("2 rows written"));
    let called = plant.postgres.sql("SELECT what FROM called ORDER BY what");
    println!("{called}");
    assert!(called.contains("items at 1 day") && called.contains("minute_means hour 1 mon"), "{called}");
    assert_eq!(called.lines().count(), 7);
    assert_eq!(plant.postgres.number("SELECT count(*) FROM pg_partitioned_table"), 0, "the extension divides them");
    let said = run(&["fleet", "retain", "--items-d", "30", "--database", &plant.postgres.address()]);
    assert!(said.status.success() && stdout(&said).contains("chunk_1"), "{}{}", stdout(&said), stderr(&said));
    assert!(plant.postgres.sql("SELECT what FROM called").contains("drop items 30 days"));
}

/// The example of the handbook, as it stands there.
#[test]
fn the_reader_of_the_handbook_gets_every_number_once() {
    let Some(plant) = Plant::start() else { return };
    let has = Command::new("python3").args(["-c", "import nats"]).output().expect("python3 runs");
    if !has.status.success() {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "nats-py is not installed");
        eprintln!("SKIPPED: nats-py is not installed (python3 -m pip install nats-py)");
        return;
    }
    let messages: Vec<Outgoing> = (1..=1500).map(|sequence| sample(sequence, 0)).collect();
    publish(&plant, &messages);
    plant.ingest();
    let chapter = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("gateway/handbook/fleet.md"))
        .expect("there");
    let (_, rest) = chapter.split_once("```python\n").expect("an example");
    let (script, _) = rest.split_once("```").expect("an end");
    assert!(script.lines().count() <= 22, "{} lines", script.lines().count());
    let address = plant.address.trim_end_matches("/cnc");
    let said = Command::new("python3").args(["-c", script, address]).output().expect("python3 runs");
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    let text = String::from_utf8_lossy(&said.stdout).into_owned();
    let mut numbers: Vec<u64> = text
        .lines()
        .filter(|line| line.contains("spindle_power_w"))
        .filter_map(|line| line.split(' ').nth(1)?.parse().ok())
        .collect();
    numbers.sort_unstable();
    assert_eq!(numbers, (1..=1500).collect::<Vec<u64>>(), "beside `fleet ingest`, which has had them, too");
}
