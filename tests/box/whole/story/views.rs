//! What each view says: channel by channel and moment by moment, as it was printed.

use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::path::Path;
use testkit::process::{get, run, stderr, stdout, text};

/// The values of one tick by channel; `null` where there is none.
pub(super) type Tick = BTreeMap<String, Json>;
/// Ticks by their time, ms since 1970.
pub(super) type Ticks = BTreeMap<i64, Tick>;

fn document(output: &std::process::Output) -> Json {
    serde_json::from_str(&stdout(output)).unwrap_or_else(|error| panic!("{error}: {}", stderr(output)))
}

/// The virtual table `samples`.
pub(super) fn by_sql(database: &Path, channels: &[&str]) -> Ticks {
    let sql = format!("SELECT at_ns, {} FROM samples ORDER BY at_ns", channels.join(", "));
    let answer = document(&run(&["history", "query", "--history", text(database), "--json", "--sql", &sql]));
    let rows = answer["rows"].as_array().expect("rows").iter();
    let tick = |row: &Json| {
        let values = channels.iter().map(|name| ((*name).to_owned(), row[*name].clone())).collect();
        (row["at_ns"].as_i64().expect("a time").div_euclid(1_000_000), values)
    };
    rows.map(tick).collect()
}

/// The rows of one SELECT.
pub(super) fn select_rows(database: &Path, sql: &str) -> Vec<Json> {
    let answer = document(&run(&["history", "query", "--history", text(database), "--json", "--sql", sql]));
    answer["rows"].as_array().expect("rows").clone()
}

/// Points of `samples/1`, turned into ticks.
fn from_points(document: &Json, ticks: &mut Ticks) {
    for series in document["series"].as_array().unwrap_or_else(|| panic!("no series: {document}")) {
        let name = series["channel"].as_str().expect("a name");
        for point in series["points"].as_array().expect("points") {
            let at_ms = point[0].as_i64().expect("a time");
            ticks.entry(at_ms).or_default().insert(name.to_owned(), point[1].clone());
        }
    }
}

/// `history query --channels`.
pub(super) fn by_command(database: &Path, channels: &[&str]) -> Ticks {
    let names = channels.join(",");
    let mut ticks = Ticks::new();
    from_points(
        &document(&run(&["history", "query", "--history", text(database), "--channels", &names, "--json"])),
        &mut ticks,
    );
    ticks
}

/// `GET /api/v1/samples`, from which the page draws History.
pub(super) fn by_api(address: &str, channels: &[&str]) -> Ticks {
    let mut ticks = Ticks::new();
    for names in channels.chunks(7) {
        let path = format!("/api/v1/samples?from=1970-01-01&channels={}&resolution_s=0", names.join(","));
        from_points(&get(address, &path).json(), &mut ticks);
    }
    ticks
}

/// `history export FILE.csv`.
pub(super) fn by_export(database: &Path, channels: &[&str], file: &Path) -> Ticks {
    let output =
        run(&["history", "export", text(file), "--history", text(database), "--channels", &channels.join(",")]);
    assert!(output.status.success(), "{}", stderr(&output));
    let table = std::fs::read_to_string(file).expect("written");
    let mut lines = table.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let time = header.iter().position(|name| *name == "time_utc").expect("a time");
    let tick = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let value = |cell: &str| match cell {
            "" => Json::Null,
            _ => cell.parse::<f64>().map_or_else(|_| Json::from(cell), Json::from),
        };
        let of = |name: &&str| header.iter().position(|known| known == name).map_or("", |at| cells[at]);
        let values = channels.iter().map(|name| ((*name).to_owned(), value(of(name)))).collect();
        let at: jiff::Timestamp = cells[time].parse().expect("a time");
        (at.as_nanosecond().div_euclid(1_000_000) as i64, values)
    };
    lines.map(tick).collect()
}

/// `GET /api/v1/status`, which the page draws as Now.
pub(super) fn by_status(status: &Json, channels: &[&str]) -> Tick {
    let known = status["channels"].as_array().expect("channels");
    let value = |name: &&str| match *name {
        "machine_state" => status["state"]["word"].clone(),
        _ => known.iter().find(|it| it["name"] == **name).map_or(Json::Null, |it| it["value"].clone()),
    };
    channels.iter().map(|name| ((*name).to_owned(), value(name))).collect()
}

/// Suffixes of our units, those of Prometheus, and the factor, as chapter `outputs` says.
const BASE_UNITS: [(&str, &str, f64); 9] = [
    ("_mm_min", "_meters_per_second", 1e-3 / 60.0),
    ("_mm", "_meters", 1e-3),
    ("_pct", "_ratio", 1e-2),
    ("_w", "_watts", 1.0),
    ("_a", "_amperes", 1.0),
    ("_v", "_volts", 1.0),
    ("_c", "_celsius", 1.0),
    ("_rpm", "_rpm", 1.0),
    ("_state", "_state", 1.0),
];

/// What `/metrics` says of a number of this channel: the value in base units, or nothing.
pub(super) fn in_metrics(metrics: &str, channel: &str) -> Option<f64> {
    let name = BASE_UNITS.iter().find_map(|it| Some(format!("cncgw_{}{} ", channel.strip_suffix(it.0)?, it.1)))?;
    metrics.lines().find_map(|line| line.strip_prefix(name.as_str())?.parse().ok())
}

/// The same of a stored number.
pub(super) fn to_base_unit(channel: &str, number: f64) -> f64 {
    let factor = BASE_UNITS.iter().find_map(|it| channel.strip_suffix(it.0).map(|_| it.2)).expect("a unit");
    number * factor
}

/// The ticks that the items of MQTT tell, carried forward over the times that the history has.
pub(super) fn by_items(items: &[Json], times: impl Iterator<Item = i64>, channels: &[&str], moves: &[Json]) -> Ticks {
    let mut sent: BTreeMap<i64, Vec<&Json>> = BTreeMap::new();
    for item in items.iter().filter(|item| item["kind"] == "sample") {
        sent.entry(moved_ms(item, moves)).or_default().push(item);
    }
    let mut now: Tick = channels.iter().map(|name| ((*name).to_owned(), Json::Null)).collect();
    let mut ticks = Ticks::new();
    for at_ms in times {
        for item in sent.get(&at_ms).into_iter().flatten() {
            for value in item["values"].as_array().expect("values") {
                let name = value["name"].as_str().expect("a name");
                if let Some(known) = now.get_mut(name) {
                    *known = value["value"].clone();
                }
            }
        }
        ticks.insert(at_ms, now.clone());
    }
    ticks
}

/// The time of an item, as the box says that it is by now: `clock_redated` moves what was sent before.
pub(super) fn moved_ms(item: &Json, moves: &[Json]) -> i64 {
    let number = |of: &Json, key: &str| of[key].as_i64().unwrap_or(-1);
    let sequence = number(item, "sequence");
    let of_item = |it: &&Json| {
        it["epoch"] == item["epoch"]
            && (number(it, "from_sequence")..number(it, "to_sequence")).contains(&sequence)
            && item["redated_ns"].is_null()
    };
    let by_ns = moves.iter().find(of_item).map_or(0, |it| number(it, "by_ns"));
    (number(item, "at_ns") + by_ns).div_euclid(1_000_000)
}
