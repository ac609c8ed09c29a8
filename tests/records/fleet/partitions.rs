//! Days as Parquet files of a data lake, read by `DuckDB`.

use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{DAY_NS, Diagnosis, ExtraSeries, ExtraValue, Options, Outbox, OutboxSettings, Writer};
use gateway::machine_path::NamedMachine;
use gateway::sinks::{Board, SinkAddress, drive};
use serde_json::{Value as Json, json};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use testkit::process::{run, stderr, stdout, text};

/// Midnight between two days of UTC.
const MIDNIGHT_NS: i64 = 19_700 * DAY_NS;
const TICK_NS: i64 = 100_000_000;

/// What `DuckDB` answers to a statement in this directory, as rows; `None` where it is not installed.
pub(crate) fn duckdb(directory: &Path, statement: &str) -> Option<Vec<Vec<Json>>> {
    let script = "import duckdb, json, sys\nrows = duckdb.sql(sys.argv[1]).fetchall()\n\
                  print(json.dumps([[v.decode() if isinstance(v, bytes) else v for v in row] for row in rows], default=str))";
    let said =
        Command::new("python3").args(["-c", script, statement]).current_dir(directory).output().expect("python3 runs");
    let error = String::from_utf8_lossy(&said.stderr).into_owned();
    if error.contains("No module named 'duckdb'") {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "duckdb is not installed");
        eprintln!("SKIPPED: duckdb is not installed (python3 -m pip install duckdb)");
        return None;
    }
    assert!(said.status.success(), "{statement}: {error}");
    Some(serde_json::from_slice(&said.stdout).expect("rows"))
}

/// The folders of machines that hold the finished day of a box.
fn folders_of(lake: &Path, box_id: &str) -> Vec<String> {
    let machines = std::fs::read_dir(lake.join("samples")).into_iter().flatten().filter_map(Result::ok);
    let holds = |machine: &std::fs::DirEntry| {
        machine.path().join("date=2023-12-08").join(format!("{box_id}.parquet")).is_file()
    };
    machines.filter(holds).map(|machine| machine.file_name().to_string_lossy().into_owned()).collect()
}

/// A minute of a machine around midnight, with a diagnosis that names this effect, through the sink `parquet:`.
fn run_over_midnight(lake: &Path, machine: impl Into<NamedMachine>, effect: &str, own: &Path) {
    let path = own.join("history.db");
    let outbox = Outbox::new(machine, OutboxSettings::default(), ["lake".to_owned()]);
    let extras = vec![ExtraSeries::new_text("machine_state", "state", "状态")];
    let group_commit = Duration::from_millis(50);
    let options = Options { extras, group_commit, outbox: Some(outbox.clone()), ..Options::default() };
    let writer = Writer::open(&path, options).expect("opens");
    let board = Board::new(outbox.clone(), [("lake".to_owned(), "parquet".to_owned())]);
    let address: SinkAddress = format!("parquet:{}", text(lake)).parse().expect("an address");
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("threads");
    let sink =
        gateway::config::SinkConfig { name: "lake".to_owned(), address, allow_requests: false, allow_facts: false };
    let (post, _inbox) = gateway::control::create_queues();
    let sinks = runtime.block_on(async { drive::start_sinks(&[sink], &post, (&outbox, &board), &path) });
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    for tick in -300..300 {
        let mut sample = Sample::new_empty(MIDNIGHT_NS + tick * TICK_NS);
        sample.set_slot(power, Slot { value: Ok(Value::Number(1000.0 + tick as f64 / 10.0)), age_ns: 0 });
        writer.queue_sample(&sample, &[ExtraValue::Text("cutting")]);
        if tick == -100 {
            let json = json!({"missing": [{"effect": effect}]}).to_string();
            let at_ns = MIDNIGHT_NS + tick * TICK_NS;
            writer.queue_record(Diagnosis { at_ns, verdict: "explained".to_owned(), json, ..Diagnosis::default() });
        }
    }
    writer.flush().expect("durable");
    let until = Instant::now() + Duration::from_secs(30);
    while folders_of(lake, &outbox.box_id()).is_empty() || board.list_sinks()[0].behind_items > 0 {
        assert!(Instant::now() < until, "no partition: {:?}", board.list_sinks());
        std::thread::sleep(Duration::from_millis(20));
    }
    runtime.block_on(sinks.stop());
    drop(writer);
}

#[test]
fn a_day_is_written_by_itself_and_duckdb_reads_equal_values_units_and_findings() {
    let lake = tempfile::tempdir().expect("a directory");
    let own = [tempfile::tempdir().expect("a directory"), tempfile::tempdir().expect("a directory")];
    run_over_midnight(lake.path(), "Lathe 7", "bearing_friction", own[0].path());
    run_over_midnight(lake.path(), "Mill 2", "bearing_friction", own[1].path());
    let files = "SELECT machine, date, count(*), min(spindle_power_w), max(spindle_power_w)
        FROM read_parquet('samples/*/*/*.parquet', hive_partitioning = true) GROUP BY ALL ORDER BY ALL";
    let Some(rows) = duckdb(lake.path(), files) else { return };
    assert_eq!(
        json!(rows),
        json!([["Lathe 7", "2023-12-08", 300, 970.0, 999.9], ["Mill 2", "2023-12-08", 300, 970.0, 999.9]]),
        "the finished day only"
    );
    // On demand: every day so far, the running one too, and every value as `history query` gives it.
    let database = own[0].path().join("history.db");
    let demanded =
        run(&["history", "--history", text(&database), "partitions", text(lake.path()), "--machine", "Lathe 7"]);
    assert!(demanded.status.success(), "{}", stderr(&demanded));
    assert!(stdout(&demanded).contains("2023-12-09: 300 samples, 0 diagnoses"), "{}", stdout(&demanded));
    let select = "SELECT epoch_ns(time_utc) // 1000000, spindle_power_w FROM read_parquet('samples/*/*/*.parquet', hive_partitioning = true)
        WHERE machine = 'Lathe 7' ORDER BY 1";
    let read = duckdb(lake.path(), select).expect("installed");
    let said = run(&["history", "--history", text(&database), "query", "--channels", "spindle_power_w", "--json"]);
    let said: Json = serde_json::from_str(&stdout(&said)).expect("JSON");
    let points: Vec<Json> = said["series"][0]["points"].as_array().expect("points").clone();
    assert_eq!(read.len(), 600);
    for (read, point) in read.iter().zip(&points) {
        assert_eq!((read[0].as_i64(), read[1].as_f64()), (point[0].as_i64(), point[1].as_f64()));
    }
    the_questions_of_the_lake(lake.path());
    let units = duckdb(
        lake.path(),
        "SELECT DISTINCT decode(value) FROM parquet_kv_metadata('samples/*/*/*.parquet') WHERE decode(key) = 'unit.spindle_power_w'",
    );
    assert_eq!(json!(units.expect("installed")), json!([["W"]]));
    let question = stdout(&run(&["fleet", "sql", "same-finding-parquet"]));
    // Python wants a further package for times with a zone.
    let question = question.trim_end().trim_end_matches(';');
    let select = format!("SELECT effect, machines, diagnoses, which FROM ({question})");
    let found = duckdb(lake.path(), &select).expect("installed");
    println!("{found:?}");
    assert_eq!(
        json!([found[0][0], found[0][1], found[0][2], found[0][3]]),
        json!(["bearing_friction", 2, 2, "Lathe 7, Mill 2"])
    );
}

#[test]
fn a_machine_with_a_path_has_a_folder_of_it_and_a_day_is_written_once_whatever_the_machine_is_called_later() {
    let (lake, fresh) = (tempfile::tempdir().expect("a directory"), tempfile::tempdir().expect("a directory"));
    let own = tempfile::tempdir().expect("a directory");
    let placed =
        || NamedMachine { name: "Lathe 7".to_owned(), path: Some("shanghai/line-2/lathe-7".parse().expect("a path")) };
    run_over_midnight(lake.path(), "Lathe 7", "bearing_friction", own.path());
    run_over_midnight(lake.path(), placed(), "bearing_friction", own.path());
    let box_id = gateway::history::box_id(&own.path().join("history.db"), "Lathe 7").expect("named");
    assert_eq!(folders_of(lake.path(), &box_id), ["machine=Lathe%207"], "the day is there already");
    run_over_midnight(fresh.path(), placed(), "bearing_friction", own.path());
    assert_eq!(folders_of(fresh.path(), &box_id), ["machine=shanghai%2Fline-2%2Flathe-7"]);
    let select = "SELECT DISTINCT machine FROM read_parquet('samples/*/*/*.parquet', hive_partitioning = true)";
    let Some(rows) = duckdb(fresh.path(), select) else { return };
    assert_eq!(json!(rows), json!([["shanghai/line-2/lathe-7"]]));
}

/// The same mean from two engines that are not ours, and from what was recorded: 300 ticks from 970 to 999.9 W on the first day, from 1000 on the
/// second.
fn the_questions_of_the_lake(lake: &Path) {
    let question = |name: &str| stdout(&run(&["fleet", "sql", name])).trim_end().trim_end_matches(';').to_owned();
    let expected = json!([
        ["Lathe 7", "2023-12-08", 984.95, 300],
        ["Lathe 7", "2023-12-09", 1014.95, 300],
        ["Mill 2", "2023-12-08", 984.95, 300]
    ]);
    let near = |rows: Vec<Vec<Json>>| {
        let row = |row: Vec<Json>| {
            json!([row[0], row[1], (row[2].as_f64().expect("a mean") * 100.0).round() / 100.0, row[3]])
        };
        Json::Array(rows.into_iter().map(row).collect())
    };
    assert_eq!(near(duckdb(lake, &question("mean-by-machine-parquet")).expect("installed")), expected, "DuckDB");
    let script = "import chdb, json, sys\nprint(json.dumps([list(row.values()) for row in json.loads(str(chdb.query(sys.argv[1], 'JSON')))['data']]))";
    let sql = question("mean-by-machine-clickhouse");
    let said = Command::new("python3").args(["-c", script, &sql]).current_dir(lake).output().expect("python3 runs");
    let error = String::from_utf8_lossy(&said.stderr).into_owned();
    if error.contains("No module named 'chdb'") {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "chdb is not installed");
        eprintln!("SKIPPED: chdb is not installed (python3 -m pip install chdb)");
        return;
    }
    assert!(said.status.success(), "{error}");
    let rows: Vec<Vec<Json>> = serde_json::from_slice(&said.stdout).expect("rows");
    // ClickHouse writes 64-bit integers as texts.
    let whole = |cell: Json| cell.as_str().and_then(|text| text.parse::<u64>().ok()).map_or(cell.clone(), Json::from);
    let rows = rows.into_iter().map(|row| row.into_iter().map(whole).collect()).collect();
    assert_eq!(near(rows), expected, "ClickHouse");
    println!("the mean of a day: DuckDB, ClickHouse and what was recorded agree");
}

#[test]
fn a_directory_that_cannot_be_written_is_told() {
    let examined = run(&["doctor", "parquet:/proc/no-such-place"]);
    let said = stdout(&examined);
    assert!(
        examined.status.code() == Some(1) && said.contains("cannot be written to") && said.contains("next:"),
        "{said}"
    );
}
