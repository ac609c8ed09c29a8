//! Kill -9 at random moments, of a replay and of a live box: nothing that was acknowledged is lost, nothing is stored
//! twice, the file is in order, and the next start goes on.

use rand::{Rng, SeedableRng};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use testkit::process::{Gateway, get, program, run, stderr, stdout, text};

const KILLS: usize = 20;

fn answer(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    stdout(&output)
}

/// Samples in the file; killed before its first commit it may be empty or absent.
fn samples(database: &Path) -> u64 {
    if fs::metadata(database).map_or(0, |metadata| metadata.len()) == 0 {
        return 0;
    }
    let info: Value =
        serde_json::from_str(&answer(&["history", "info", "--json", "--history", text(database)])).expect("JSON");
    info["samples"].as_u64().expect("a number")
}

/// `SQLite`'s own check, by its own reader.
fn in_order(database: &Path) {
    if samples(database) == 0 {
        return;
    }
    let reader = gateway::history::Reader::open(database).expect("opens");
    assert_eq!(reader.check_integrity().expect("can be checked"), Vec::<String>::new());
}

fn random() -> rand_pcg::Pcg64Mcg {
    let seed = std::env::var("CNC_GATEWAY_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(20_261_121);
    println!("seed {seed}");
    rand_pcg::Pcg64Mcg::seed_from_u64(seed)
}

/// Forty minutes of the simulated lathe as a recording.
fn recording(directory: &Path) -> std::path::PathBuf {
    let data = directory.join("made");
    let mut gateway = Gateway::start(&data, &["--speed", "max", "--for", "2400"]);
    assert!(gateway.wait().success(), "{}", gateway.said());
    let file = directory.join("recording.csv");
    let channels =
        "spindle_speed_rpm,feed_mm_min,spindle_power_w,total_power_w,spindle_load_pct,rapid,part_count,program,tool";
    answer(&["history", "export", text(&file), "--history", text(&data.join("history.db")), "--channels", channels]);
    file
}

#[test]
fn a_replay_killed_twenty_times_ends_as_if_nothing_had_happened() {
    let directory = tempfile::tempdir().expect("a directory");
    let recording = recording(directory.path());
    let (whole, killed) = (directory.path().join("whole.db"), directory.path().join("killed.db"));
    let storing = storing_takes(&recording, &whole);
    let mut random = random();
    let (mut most, mut kills) = (0, 0);
    while kills < KILLS {
        let mut replay = start(&recording, &killed);
        replay.wait_said("storing in");
        thread::sleep(storing.mul_f64(random.random_range(0.0..1.0)));
        if replay.has_ended() {
            // It got through before it could be killed: the same again, from the beginning.
            remove(&killed);
            most = 0;
            continue;
        }
        replay.kill();
        kills += 1;
        let now = samples(&killed);
        assert!(now >= most, "kill {kills}: {most} rows became {now}");
        most = now;
        in_order(&killed);
    }
    answer(&["replay", text(&recording), "--history", text(&killed)]);
    let rows = |database: &Path| answer(&["history", "query", "--history", text(database)]);
    let (expected, found) = (rows(&whole), rows(&killed));
    assert_eq!(expected.lines().count(), found.lines().count());
    // Where it was killed a new segment begins, which export writes as another run; the values must be the same.
    assert!(without_run(&expected) == without_run(&found), "the samples differ");
    for kind in ["states", "parts", "decisions", "alarms"] {
        let records =
            |database: &Path| answer(&["history", "query", "--history", text(database), "--records", kind, "--json"]);
        assert_eq!(records(&whole), records(&killed), "{kind}");
    }
    println!("{KILLS} kills, {} rows, undisturbed {storing:?}", expected.lines().count() - 1);
}

fn start(recording: &Path, database: &Path) -> Gateway {
    let mut command = program();
    command.args(["replay", text(recording), "--history", text(database)]);
    Gateway::spawn(command)
}

/// Replays undisturbed and tells how long the part that stores took.
fn storing_takes(recording: &Path, database: &Path) -> Duration {
    let mut replay = start(recording, database);
    replay.wait_said("storing in");
    let began = Instant::now();
    assert!(replay.wait().success(), "{}", replay.said());
    began.elapsed()
}

fn remove(database: &Path) {
    for end in ["", "-wal", "-shm"] {
        let _may_be_absent = fs::remove_file(format!("{}{end}", text(database)));
    }
}

fn without_run(table: &str) -> Vec<String> {
    let header: Vec<&str> = table.lines().next().unwrap_or_default().split(',').collect();
    let run = header.iter().position(|name| *name == "run");
    let cut = |line: &str| {
        let cells = line.split(',').enumerate().filter(|(index, _)| Some(*index) != run).map(|(_, cell)| cell);
        cells.collect::<Vec<_>>().join(",")
    };
    table.lines().map(cut).collect()
}

#[test]
fn a_live_box_killed_twenty_times_loses_nothing_it_had_acknowledged() {
    let directory = tempfile::tempdir().expect("a directory");
    let data = directory.path().join("data");
    let database = data.join("history.db");
    let mut random = random();
    let mut most = 0;
    for kill in 1..=KILLS {
        let mut gateway = Gateway::start(&data, &["--speed", "60"]);
        let address = gateway.address();
        let until = Instant::now() + Duration::from_millis(random.random_range(300..1500));
        let mut acknowledged = 0;
        while Instant::now() < until || acknowledged == 0 {
            let answer = get(&address, "/api/v1/status");
            if answer.status == 200 {
                acknowledged = answer.json()["history"]["rows"].as_u64().expect("a number");
            }
        }
        gateway.kill();
        let now = samples(&database);
        assert!(now >= acknowledged, "kill {kill}: {acknowledged} rows were acknowledged, {now} are there");
        assert!(now >= most, "kill {kill}: {most} rows became {now}");
        most = now;
        in_order(&database);
    }
    let mut gateway = Gateway::start(&data, &["--speed", "60"]);
    gateway.address();
    gateway.stop();
    assert!(samples(&database) > most && most > 0, "the box did not go on after {most} rows");
    let sql = "SELECT count(*) AS n FROM states WHERE until_ns IS NULL";
    let open = answer(&["history", "query", "--history", text(&database), "--json", "--sql", sql]);
    assert!(open.contains("\"n\": 0"), "{open}");
    println!("{KILLS} kills, {most} rows");
}
