//! One number through every view: what a recording delivers, the status that the page draws, the page itself, the API, SQL, the
//! command line, the export, MQTT and Prometheus tell the same digits, through changes of state, outages of the source and of
//! the broker, and a clock that is dated anew.

mod compare;
mod playing;
mod recorded;
mod views;

use super::browser::{self, Browser};
use compare::{Compared, States, compare_driver, compare_live, compare_page, compare_states, read_page};
use playing::{Heard, Moment, Story, watch_box};
use recorded::{Course, channels};
use serde_json::Value as Json;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use testkit::process::{get, wait_for};
use views::Ticks;

/// So many times as fast as it was recorded.
const SPEED: f64 = 60.0;

/// What the live views and the running box said.
struct Told {
    moments: Vec<Moment>,
    /// The figures of the page, as a person reads them.
    shown: Vec<Json>,
    samples: Ticks,
    states: Json,
}

/// The wrong clock is put right, and the box begins again with it.
fn set_clock(story: &Story) -> Option<String> {
    let clock = story.clock.as_ref()?;
    std::thread::sleep(Duration::from_secs(8));
    let beside = clock.with_extension("new");
    std::fs::write(&beside, "+0s").expect("written");
    std::fs::rename(&beside, clock).expect("in its place");
    Some(wait_for("the box begins again", Duration::from_secs(90), || story.pages().get(1).cloned()))
}

/// Waits until the recording is over. Where there is a browser it looks at the page, and the broker is away for a while.
fn play_to_end(story: &mut Story, course: Course, browser: Option<&mut Browser>) -> Vec<Json> {
    let whole_s = course.steps as f64 * course.rows as f64 / SPEED;
    let (mut shown, began) = (Vec::<Json>::new(), Instant::now());
    let Some(browser) = browser else {
        std::thread::sleep(Duration::from_secs_f64(whole_s + 0.5));
        return shown;
    };
    let mut outage = true;
    while began.elapsed().as_secs_f64() < whole_s + 0.5 {
        if outage && began.elapsed().as_secs_f64() > whole_s / 3.0 {
            story.broker.kill();
            std::thread::sleep(Duration::from_secs(2));
            story.broker.run();
            outage = false;
        }
        let moment = read_page(browser);
        if shown.last().is_none_or(|last| last["at"] != moment["at"]) {
            shown.push(moment);
        }
    }
    shown
}

/// Plays the recording while everybody looks.
fn play_recording(story: &mut Story, course: Course, names: &[&str], browser: Option<&mut Browser>) -> Told {
    let mut address = story.gateway.address();
    let (seen, over) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
    let begin = |address: String, dated: bool| {
        let (seen, over) = (seen.clone(), over.clone());
        std::thread::spawn(move || watch_box(&address, dated, &over, &seen))
    };
    let mut watching = vec![begin(address.clone(), story.clock.is_none())];
    if let Some(again) = set_clock(story) {
        watching.push(begin(again.clone(), true));
        address = again;
    }
    let mut browser = browser;
    if let Some(browser) = &mut browser {
        browser.open(&format!("http://{address}/now?lang=en"));
        browser.wait_until("document.getElementById('state')?.dataset.ms");
    }
    let shown = play_to_end(story, course, browser);
    wait_for("everything is delivered", Duration::from_secs(30), || {
        let sink = get(&address, "/api/v1/status").json()["sinks"][0].clone();
        (sink["failing"] == false && sink["behind_items"].as_u64() < Some(5)).then_some(())
    });
    let samples = views::by_api(&address, names);
    let states = get(&address, "/api/v1/states?from=1970-01-01").json();
    over.store(true, Ordering::SeqCst);
    watching.into_iter().for_each(|it| it.join().expect("no panic"));
    let moments = std::mem::take(&mut *seen.lock().expect("whole"));
    Told { moments, shown, samples, states }
}

/// By how much the rows of a wrong clock were moved, ms, and which items that had been sent before move with them.
fn find_moves(database: &Path) -> (i64, Vec<Json>) {
    let sql = "SELECT detail FROM events WHERE kind = 'clock_redated'";
    let details = views::select_rows(database, sql).into_iter();
    let parsed: Vec<Json> = details.filter_map(|row| serde_json::from_str(row["detail"].as_str()?).ok()).collect();
    println!("dated anew: {parsed:?}");
    let each = parsed.iter().flat_map(|detail| detail["by_ns"].as_array().cloned().unwrap_or_default());
    let by_ns = each.filter_map(|it| it.as_i64()).max_by_key(|it| it.abs()).unwrap_or(0);
    let moves = parsed.iter().flat_map(|detail| detail["moves"].as_array().cloned().unwrap_or_default());
    (by_ns.div_euclid(1_000_000), moves.collect())
}

/// Plays the recording, looks at every view, and compares.
fn follow_numbers(course: Course, changes_least: usize, wrong_clock: bool, look: bool) {
    let Some(mut story) = Story::start(course, SPEED, wrong_clock) else { return };
    let heard = Heard::of(story.broker.port);
    let names: Vec<&str> = channels().into_iter().chain(["machine_state"]).collect();
    let mut browser = look.then(|| Browser::start(story.directory.path()));
    let told = play_recording(&mut story, course, &names, browser.as_mut());
    let (database, directory) = (story.database(), story.directory);
    story.gateway.stop();
    std::thread::sleep(Duration::from_millis(300));
    let stored = views::by_sql(&database, &names);
    let items = heard.lines.lock().expect("whole").clone();
    let (by_ms, moves) = find_moves(&database);
    assert_eq!(by_ms == 0, !wrong_clock, "rows were dated anew by {by_ms} ms: {moves:?}");
    let mut compared = Compared::default();
    if let Some(browser) = &mut browser {
        compare_page(&mut compared, browser, &told.shown, &stored);
    }
    compare_driver(&mut compared, &stored, course);
    compared.compare_ticks("command", &views::by_command(&database, &names), &stored);
    compared.compare_ticks("API", &told.samples, &stored);
    compared.compare_ticks("export", &views::by_export(&database, &names, &directory.path().join("all.csv")), &stored);
    compared.compare_ticks("MQTT", &views::by_items(&items, stored.keys().copied(), &names, &moves), &stored);
    compare_live(&mut compared, &told.moments, by_ms, &stored, &names);
    let states = States { of_api: &told.states, items: &items, moves: &moves };
    let changes = compare_states(&mut compared, &states, &database, &stored);
    println!("{} ticks, {changes} changes of state, {} items", stored.len(), items.len());
    compared.assert_agreement();
    assert!(changes >= changes_least, "{changes} changes");
}

#[test]
fn a_number_is_the_same_in_every_view() {
    follow_numbers(Course { steps: 12, rows: 15, state_steps: 3 }, 3, false, false);
}

/// `cargo test --test box whole::story -- --ignored --nocapture`
#[test]
#[ignore = "2 minutes: an hour of a machine at sixty times its speed, with a wrong clock, outages and the page"]
fn an_hour_with_a_wrong_clock_and_outages_is_the_same_in_every_view() {
    if !browser::is_there() {
        return;
    }
    follow_numbers(Course { steps: 240, rows: 15, state_steps: 8 }, 30, true, true);
}
