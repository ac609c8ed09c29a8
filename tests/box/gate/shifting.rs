//! Thermal offsets of a running gateway against a served control: written between programs only, accounted for, given back
//! after the gateway was killed. The control is another process, which refuses an offset while a program runs.

use adapters::clock::SystemClock;
use adapters::fanuc::item::FocasItem;
use adapters::fanuc::{answer::FocasAnswer, open::open_native};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Duration;
use testkit::process::{Gateway, get, run, stderr, stdout, text, wait_for};
use testkit::served::{Serving, prepared, started};

/// A machine in its warm-up, whose program ends within half a minute.
const WARMING_UP: [&str; 2] = ["--machine", "simulated://lathe?begun_s=85"];

const SCRIPT: &str =
    "propose_offset_um(\"z\", 7.3, \"thermal error\"); request_feed_override(80, \"must not be written\");";

/// The external offset of Z as the control tells it, um: asked over a connection of the test's own.
fn z_offset_um(address: &str) -> Option<f64> {
    let address: adapters::Address = address.parse().expect("an address");
    let adapters::address::Target::Fanuc { at, path, options, .. } = address.target() else { return None };
    let line = open_native("test", at, *path, options).line;
    let item = FocasItem::WorkOffset(0, 2);
    let asked = line.ask_items(&SystemClock::new(), &[item]).ok()?;
    match asked.find_item_result(item)? {
        Ok(FocasAnswer::Number(Some(mm))) => Some(mm * 1000.0),
        _ => None,
    }
}

fn configured(directory: &Path, address: &str) -> PathBuf {
    let sections = format!(
        "[[source]]\naddress = \"{address}?allow=EXT\"\nname = \"lathe\"\n[gate]\nstale_s = 2.0\n\
         [gate.offset]\nmode = \"armed\"\nsource = \"lathe\"\naxes = \"z\"\nmin_interval_s = 1.0\n"
    );
    prepared(directory, SCRIPT, &sections)
}

fn deciding(config: &Path) -> (Gateway, String) {
    let (gateway, address) = started(config);
    wait_for("a decision", Duration::from_secs(60), || {
        get(&address, "/api/v1/status").json()["gate"]["permitted_pct"].is_number().then_some(())
    });
    (gateway, address)
}

fn shift_um(address: &str) -> f64 {
    get(address, "/api/v1/status").json()["gate"]["offset"]["axes"][0]["shift_um"].as_f64().unwrap_or(f64::NAN)
}

/// The whole audit by pages of three, through the interface on the network.
fn audit(address: &str) -> Vec<Value> {
    let (mut rows, mut since) = (Vec::new(), 0);
    loop {
        let page = get(address, &format!("/api/v1/audit?since={since}&limit=3")).json();
        rows.extend(page["rows"].as_array().expect("rows").iter().cloned());
        match page["last"].as_i64() {
            Some(last) => since = last,
            None => return rows,
        }
    }
}

fn of<'a>(rows: &'a [Value], kind: &str) -> Vec<&'a Value> {
    rows.iter().filter(|row| row["kind"] == kind).collect()
}

#[test]
fn an_external_offset_is_written_between_programs_only_and_given_back_after_a_kill() {
    let served = Serving::start(&WARMING_UP);
    let directory = tempfile::tempdir().expect("a directory");
    let config = configured(directory.path(), &served.address);
    let (gateway, address) = deciding(&config);
    assert_eq!(get(&address, "/api/v1/audit?sinse=1").status, 400, "a misspelt key is refused");
    let told = run(&["arm", "--for", "30m", "--by", "fitter", "--config", text(&config)]);
    assert!(
        told.status.success() && stdout(&told).contains("offsets are written"),
        "{}{}",
        stdout(&told),
        stderr(&told)
    );
    let (first, then) = wait_for("a shift of 7 um", Duration::from_secs(400), || {
        (shift_um(&address) == 7.0).then(|| (z_offset_um(&served.address), shift_um(&address)))
    });
    println!("in the control: {first:?} um, by the gateway's account {then} um");
    assert_eq!(first, Some(7.0));
    wait_for("the rows to be stored", Duration::from_secs(20), || {
        (of(&audit(&address), "z_offset_write").len() >= 2).then_some(())
    });
    gateway.kill();
    assert_eq!(z_offset_um(&served.address), Some(7.0), "nothing takes an offset back by itself");

    let (gateway, address) = deciding(&config);
    wait_for("given back", Duration::from_secs(500), || (shift_um(&address) == 0.0).then_some(()));
    assert_eq!(z_offset_um(&served.address), Some(0.0), "what the operator had set");
    wait_for("the row to be stored", Duration::from_secs(20), || {
        (!of(&audit(&address), "z_offset_restore").is_empty()).then_some(())
    });
    let rows = audit(&address);
    gateway.stop();
    let writes: Vec<(f64, f64)> = of(&rows, "z_offset_write")
        .iter()
        .map(|row| (row["before"].as_f64().expect("um"), row["after"].as_f64().expect("um")))
        .collect();
    assert_eq!(writes, [(0.0, 5.0), (5.0, 7.0)], "by steps of at most 5 um");
    for row in rows.iter().filter(|row| row["kind"].as_str().is_some_and(|kind| kind.contains("offset_"))) {
        println!("{} {} {} {}", row["number"], row["kind"], row["outcome"], row["reason"]);
        let refused = row["outcome"] == "refused" || row["outcome"] == "failed";
        assert!(!refused, "the control, which refuses while a program runs, was never asked then: {row}");
    }
    assert!(of(&rows, "write").is_empty(), "no override is written where only offsets are armed");
    let database = directory.path().join("data/history.db");
    let printed = stdout(&run(&["history", "audit", "--json", "--history", text(&database)]));
    let document: Value = serde_json::from_str(&printed).expect("JSON");
    let printed = document["rows"].as_array().expect("rows");
    assert_eq!(printed[..rows.len()], rows[..], "the same rows on the command line");
    assert!(run(&["history", "audit", "--verify", "--history", text(&database)]).status.success());
}
