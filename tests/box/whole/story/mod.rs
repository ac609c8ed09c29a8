//! One number through every view: what a recording delivers, the status that the page draws, the page itself, the API, SQL, the
//! command line, the export, MQTT and Prometheus tell the same digits, through changes of state, outages of the source and of
//! the broker, and a clock that is dated anew.

mod recorded;
mod views;

use super::browser::{self, Browser};
use recorded::{Course, agrees, channels, csv, is_continuous, is_empty, is_silent};
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use testkit::broker::{Broker, program as find_program};
use testkit::process::{Gateway, get, program, run, stdout, text, try_get, wait_for};
use views::{Tick, Ticks};

/// So many times as fast as it was recorded.
const SPEED: f64 = 60.0;
const FAKETIME: &str = "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1";

/// `mosquitto_sub`, and every document that it has heard.
struct Heard {
    child: Child,
    lines: Arc<Mutex<Vec<Json>>>,
}

impl Heard {
    fn of(port: u16) -> Self {
        let mut command = Command::new(find_program("mosquitto_sub").expect("beside mosquitto"));
        command.args(["-h", "127.0.0.1", "-p", &port.to_string(), "-t", "works/#", "-q", "1"]);
        command.args(["-i", "story", "-c"]).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("it runs");
        let lines = Arc::new(Mutex::new(Vec::new()));
        let (output, heard) = (child.stdout.take().expect("piped"), lines.clone());
        std::thread::spawn(move || {
            let documents = BufReader::new(output).lines().map_while(Result::ok);
            for line in documents.filter_map(|line| serde_json::from_str(&line).ok()) {
                heard.lock().expect("whole").push(line);
            }
        });
        Self { child, lines }
    }
}

impl Drop for Heard {
    fn drop(&mut self) {
        let _already_gone = self.child.kill();
        let _reaped = self.child.wait();
    }
}

/// What the live views said at one moment.
#[derive(Debug)]
struct Moment {
    /// Whether the clock of the box was right by then.
    dated: bool,
    status: Json,
    /// Of the same status; `None` where another one came in between.
    metrics: Option<String>,
}

/// A box that plays the recording.
struct Story {
    directory: tempfile::TempDir,
    broker: Broker,
    gateway: Gateway,
    clock: Option<PathBuf>,
}

impl Story {
    /// `None`, with a word about it, where something is not installed.
    fn start(course: Course, speed: f64, wrong_clock: bool) -> Option<Self> {
        if wrong_clock && !Path::new(FAKETIME).exists() {
            assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "no libfaketime: install the package faketime");
            eprintln!("SKIPPED: no libfaketime here; install the package faketime");
            return None;
        }
        let broker = Broker::start()?;
        let directory = tempfile::tempdir().expect("a directory");
        let recording = directory.path().join("hour.csv");
        std::fs::write(&recording, csv(course)).expect("written");
        let config = format!(
            "[gateway]\nname = \"Story\"\n[[source]]\naddress = \"replay:{}?speed={speed}\"\n[[sink]]\nname = \"plant\"\n\
             address = \"mqtt://127.0.0.1:{}/works/story\"\n",
            recording.display(),
            broker.port
        );
        std::fs::write(directory.path().join("box.toml"), config).expect("written");
        let clock = wrong_clock.then(|| directory.path().join("clock"));
        let mut command = program();
        command.arg("run").arg("--config").arg(directory.path().join("box.toml"));
        command.arg("--data-dir").arg(directory.path().join("data")).args(["--listen", "127.0.0.1:0"]);
        if let Some(clock) = &clock {
            std::fs::write(clock, "@1970-01-01 00:00:10").expect("written");
            command.env("LD_PRELOAD", FAKETIME).env("FAKETIME_TIMESTAMP_FILE", clock).env("FAKETIME_NO_CACHE", "1");
            command.env("FAKETIME_DONT_FAKE_MONOTONIC", "1").env("DONT_FAKE_MONOTONIC", "1").env("TZ", "UTC");
        }
        Some(Self { broker, gateway: Gateway::spawn(command), clock, directory })
    }

    fn database(&self) -> PathBuf {
        self.directory.path().join("data/history.db")
    }

    /// The addresses of the page, one for each time that the box has begun.
    fn pages(&self) -> Vec<String> {
        let said = self.gateway.said();
        let pages = said.lines().filter_map(|line| line.split_once("live page: http://"));
        pages.map(|it| it.1.trim_end_matches('/').to_owned()).collect()
    }
}

/// Looks at a running box until it is told to stop.
fn watch(address: &str, dated: bool, over: &AtomicBool, seen: &Mutex<Vec<Moment>>) {
    let mut last = Json::Null;
    while !over.load(Ordering::SeqCst) {
        let Ok(status) = try_get(address, "/api/v1/status").map(|it| it.json()) else { return };
        if status["at_ms"].is_i64() && status["at_ms"] != last {
            last = status["at_ms"].clone();
            let metrics = try_get(address, "/metrics").map(|it| it.body).ok();
            let after = try_get(address, "/api/v1/status").map(|it| it.json());
            let same = after.is_ok_and(|after| after["at_ms"] == last);
            seen.lock().expect("whole").push(Moment { dated, status, metrics: metrics.filter(|_| same) });
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// What disagrees, and how much was compared, by view.
#[derive(Debug, Default)]
struct Compared {
    values: BTreeMap<&'static str, usize>,
    wrong: Vec<String>,
}

impl Compared {
    fn same(&mut self, view: &'static str, what: &dyn Fn() -> String, found: &Json, stored: &Json) {
        *self.values.entry(view).or_default() += 1;
        let equal = match (found.as_f64(), stored.as_f64()) {
            (Some(found), Some(stored)) => found.to_bits() == stored.to_bits() || found == stored,
            _ => found == stored,
        };
        if !equal {
            self.wrong.push(format!("{view}, {}: {found}, the history {stored}", what()));
        }
    }

    fn ticks(&mut self, view: &'static str, found: &Ticks, stored: &Ticks) {
        for (at_ms, tick) in found {
            match stored.get(at_ms) {
                Some(known) => self.tick(view, *at_ms, tick, known),
                None => self.wrong.push(format!("{view}: nothing is stored at {at_ms}")),
            }
        }
    }

    fn tick(&mut self, view: &'static str, at_ms: i64, found: &Tick, stored: &Tick) {
        for (name, value) in found {
            self.same(view, &|| format!("{name} at {at_ms}"), value, &stored[name]);
        }
    }

    fn finish(self) {
        println!("values compared, by view: {:?}", self.values);
        assert!(
            self.wrong.is_empty(),
            "{} disagree:\n{}",
            self.wrong.len(),
            self.wrong[..self.wrong.len().min(40)].join("\n")
        );
    }
}

/// Every moment of the live views; moments of a wrong clock are moved as the box says that they are.
fn compare_live(compared: &mut Compared, seen: &[Moment], by_ms: i64, stored: &Ticks, names: &[&str]) {
    let mut found = 0;
    for moment in seen {
        let at_ms = moment.status["at_ms"].as_i64().expect("a time") + if moment.dated { 0 } else { by_ms };
        // The last ticks of a run that ends may be told and not be stored any more; a sum of two times that were cut to ms is 1 ms less.
        let Some(known) = stored.get(&at_ms).or_else(|| stored.get(&(at_ms + 1))) else { continue };
        found += 1;
        compared.tick("status (Now)", at_ms, &views::by_status(&moment.status, names), known);
        let Some(metrics) = &moment.metrics else { continue };
        for name in names.iter().filter(|name| known[**name].is_number()) {
            let expected = known[*name].as_f64().map(|number| views::to_base_unit(name, number));
            let told = views::in_metrics(metrics, name);
            compared.same("Prometheus", &|| format!("{name} at {at_ms}"), &json!(told), &json!(expected));
        }
    }
    let times: Vec<(bool, i64)> = seen.iter().map(|it| (it.dated, it.status["at_ms"].as_i64().unwrap_or(0))).collect();
    let span = (stored.keys().next(), stored.keys().next_back());
    assert!(
        found * 10 >= seen.len() * 9,
        "only {found} of {} moments are stored: {by_ms} {span:?} {times:?}",
        seen.len()
    );
}

/// What the source has delivered: at every tick the value of its step, or on the way to it.
fn compare_driver(compared: &mut Compared, stored: &Ticks, course: Course) {
    let mut exact: BTreeMap<&str, usize> = BTreeMap::new();
    for (at_ms, tick) in stored {
        let Some(step) = tick["block"].as_str().and_then(|text| text[1..].parse::<usize>().ok()) else { continue };
        for name in channels() {
            // Beside a silence or an empty step a quantity may already be gone.
            let value = &tick[name];
            if value.is_null()
                && (is_continuous(name) || [step, step + 1].iter().any(|it| is_silent(*it) || is_empty(*it)))
            {
                continue;
            }
            match agrees(name, value, step, course) {
                Some(true) => *exact.entry(name).or_default() += 1,
                Some(false) => compared.wrong.push(format!("source, {name} at {at_ms}, step {step}: {value}")),
                None => {}
            }
        }
    }
    println!("ticks at which the source's own number is stored, by channel: {exact:?}");
    let least = channels().iter().map(|name| exact.get(name).copied().unwrap_or(0)).min().unwrap_or(0);
    compared.values.insert("source", exact.values().sum());
    assert!(least * 3 >= stored.len(), "only {least} of {} ticks hold what the source delivered", stored.len());
}

/// Beginnings and words of the states, in ms since 1970, as `since` says; without a key those of items.
fn intervals(rows: &[Json], since: Option<&str>, moves: &[Json]) -> Vec<String> {
    let line = |row: &Json| match since {
        Some(key) => format!("{} {}", row[key].as_i64().expect("ms"), row["state"].as_str().expect("a word")),
        None => format!("{} {}", views::moved_ms(row, moves), row["record"]["state"].as_str().expect("a word")),
    };
    let mut lines: Vec<String> = rows.iter().map(line).collect();
    lines.sort();
    lines.dedup();
    lines
}

/// The changes of state: in the samples, as intervals in SQL, API and command, and as items.
fn compare_states(
    compared: &mut Compared,
    of_api: &Json,
    database: &Path,
    items: &[Json],
    moves: &[Json],
    stored: &Ticks,
) -> usize {
    let sql = views::rows(database, "SELECT state, since_ns / 1000000 AS since_ms FROM states");
    let output = run(&["history", "query", "--history", text(database), "--records", "states", "--json"]);
    let command: Json = serde_json::from_str(&stdout(&output)).expect("JSON");
    let of_items: Vec<Json> = items.iter().filter(|item| item["kind"] == "state").cloned().collect();
    let rows = |document: &Json| document["rows"].as_array().expect("rows").clone();
    let wanted = intervals(&sql, Some("since_ms"), moves);
    let found = [
        ("states: command", intervals(&rows(&command), Some("from_ms"), moves)),
        ("states: API", intervals(&rows(of_api), Some("from_ms"), moves)),
        ("states: MQTT", intervals(&of_items, None, moves)),
    ];
    for (view, lines) in found {
        compared.same(view, &|| "intervals".to_owned(), &json!(lines), &json!(wanted));
    }
    let mut changes = 0;
    let mut last = Json::Null;
    for (at_ms, tick) in stored {
        if tick["machine_state"] != last && !tick["machine_state"].is_null() {
            last = tick["machine_state"].clone();
            changes += 1;
            let known = wanted.contains(&format!("{at_ms} {}", last.as_str().unwrap_or("?")));
            compared.same("states: samples", &|| format!("{last} at {at_ms}"), &json!(known), &json!(true));
        }
    }
    changes
}

/// The figures on the page Now, as a person reads them, with the time at which they were.
fn read_page(browser: &mut Browser) -> Json {
    browser.value(
        "(() => ({ at: Number(document.getElementById('state').dataset.ms),
            shown: [...document.querySelectorAll('[data-quantity]')].map((it) => [it.dataset.quantity, it.dataset.value ?? null, it.textContent]) }))()",
    )
}

/// What is printed on the page is the stored number in the page's own digits.
fn compare_page(compared: &mut Compared, browser: &mut Browser, moments: &[Json], stored: &Ticks) {
    let mut figures: Vec<(String, &Json, &Json)> = Vec::new();
    for moment in moments {
        let at_ms = moment["at"].as_i64().expect("a time");
        let Some(known) = stored.get(&at_ms) else { continue };
        for shown in moment["shown"].as_array().expect("figures") {
            if let Some(value) = shown[0].as_str().and_then(|name| known.get(name)) {
                figures.push((format!("{} at {at_ms}", shown[0]), shown, value));
            }
        }
    }
    let asked: Vec<Json> = figures.iter().map(|(_, shown, value)| json!([shown[0], value])).collect();
    let texts = browser.value(&format!(
        "import('/web/format.js').then((it) => {}.map(([name, value]) => typeof value !== 'number' ? null :
            it.number(value, {{ w: 'W', pct: '%', min: 'mm/min', rpm: 'rpm' }}[name.split('_').pop()])))",
        Json::from(asked)
    ));
    for ((what, shown, value), text) in figures.iter().zip(texts.as_array().expect("texts")) {
        match value.as_f64() {
            Some(_) => compared.same("page Now", &|| what.clone(), &shown[2], text),
            None => compared.same("page Now", &|| what.clone(), &json!(shown[1].is_null()), &json!(true)),
        }
    }
}

/// Plays the recording, looks at every view, and compares.
fn follow(course: Course, changes_least: usize, wrong_clock: bool, look: bool) {
    let speed = SPEED;
    let Some(mut story) = Story::start(course, speed, wrong_clock) else { return };
    let heard = Heard::of(story.broker.port);
    let mut address = story.gateway.address();
    let (seen, over) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
    let begin = |address: String, dated: bool| {
        let (seen, over) = (seen.clone(), over.clone());
        std::thread::spawn(move || watch(&address, dated, &over, &seen))
    };
    let mut watching = vec![begin(address.clone(), !wrong_clock)];
    if let Some(clock) = story.clock.clone() {
        std::thread::sleep(Duration::from_secs(8));
        let beside = clock.with_extension("new");
        std::fs::write(&beside, "+0s").expect("written");
        std::fs::rename(&beside, &clock).expect("in its place");
        address = wait_for("the box begins again", Duration::from_secs(90), || story.pages().get(1).cloned());
        watching.push(begin(address.clone(), true));
    }
    let mut browser = look.then(|| Browser::start(story.directory.path()));
    let (mut shown, began) = (Vec::new(), Instant::now());
    if let Some(browser) = &mut browser {
        browser.open(&format!("http://{address}/now?lang=en"));
        browser.wait_until("document.getElementById('state')?.dataset.ms");
    }
    let whole_s = course.steps as f64 * course.rows as f64 / speed;
    let mut outage = look;
    while began.elapsed().as_secs_f64() < whole_s + 0.5 {
        if outage && began.elapsed().as_secs_f64() > whole_s / 3.0 {
            story.broker.kill();
            std::thread::sleep(Duration::from_secs(2));
            story.broker.run();
            outage = false;
        }
        match &mut browser {
            Some(browser) => {
                let moment = read_page(browser);
                if shown.last().is_none_or(|last: &Json| last["at"] != moment["at"]) {
                    shown.push(moment);
                }
            }
            None => std::thread::sleep(Duration::from_millis(100)),
        }
    }
    wait_for("everything is delivered", Duration::from_secs(30), || {
        let sink = get(&address, "/api/v1/status").json()["sinks"][0].clone();
        (sink["failing"] == false && sink["behind_items"].as_u64() < Some(5)).then_some(())
    });
    let names: Vec<&str> = channels().into_iter().chain(["machine_state"]).collect();
    let of_api = views::by_api(&address, &names);
    let states_of_api = get(&address, "/api/v1/states?from=1970-01-01").json();
    over.store(true, Ordering::SeqCst);
    watching.into_iter().for_each(|it| it.join().expect("no panic"));
    let mut compared = Compared::default();
    let database = story.database();
    story.gateway.stop();
    std::thread::sleep(Duration::from_millis(300));
    let stored = views::by_sql(&database, &names);
    if let Some(browser) = &mut browser {
        compare_page(&mut compared, browser, &shown, &stored);
    }
    let items = heard.lines.lock().expect("whole").clone();
    let redated = views::rows(&database, "SELECT detail FROM events WHERE kind = 'clock_redated'");
    let detail: Json =
        redated.first().and_then(|row| serde_json::from_str(row["detail"].as_str()?).ok()).unwrap_or_default();
    assert_eq!(detail.is_null(), !wrong_clock, "{detail}");
    let moves = detail["moves"].as_array().cloned().unwrap_or_default();
    let by_ms = detail["by_ns"][0].as_i64().unwrap_or(0).div_euclid(1_000_000);
    compare_driver(&mut compared, &stored, course);
    compared.ticks("command", &views::by_command(&database, &names), &stored);
    compared.ticks("API", &of_api, &stored);
    compared.ticks("export", &views::by_export(&database, &names, &story.directory.path().join("all.csv")), &stored);
    compared.ticks("MQTT", &views::by_items(&items, stored.keys().copied(), &names, &moves), &stored);
    compare_live(&mut compared, &seen.lock().expect("whole"), by_ms, &stored, &names);
    let changes = compare_states(&mut compared, &states_of_api, &database, &items, &moves, &stored);
    println!(
        "{} ticks, {changes} changes of state, {} items, {} moments of the page",
        stored.len(),
        items.len(),
        shown.len()
    );
    compared.finish();
    assert!(changes >= changes_least, "{changes} changes");
}

#[test]
fn a_number_is_the_same_in_every_view() {
    follow(Course { steps: 12, rows: 15, state_steps: 3 }, 3, false, false);
}

/// `cargo test --test box whole::story -- --ignored --nocapture`
#[test]
#[ignore = "2 minutes: an hour of a machine at sixty times its speed, with a wrong clock, outages and the page"]
fn an_hour_with_a_wrong_clock_and_outages_is_the_same_in_every_view() {
    if !browser::is_there() {
        return;
    }
    follow(Course { steps: 240, rows: 15, state_steps: 8 }, 30, true, true);
}
