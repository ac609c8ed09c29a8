//! Every view held against the history.

use super::playing::Moment;
use super::recorded::{Course, agrees_with_source, channels, is_continuous, is_empty, is_silent};
use super::views::{self, Tick, Ticks};
use crate::whole::browser::Browser;
use serde_json::{Value as Json, json};
use std::collections::BTreeMap;
use std::path::Path;
use testkit::process::{run, stdout, text};

/// What disagrees, and how much was compared, by view.
#[derive(Debug, Default)]
pub(super) struct Compared {
    pub(super) values: BTreeMap<&'static str, usize>,
    pub(super) wrong: Vec<String>,
}

impl Compared {
    pub(super) fn compare_value(&mut self, view: &'static str, what: &dyn Fn() -> String, found: &Json, stored: &Json) {
        *self.values.entry(view).or_default() += 1;
        let equal = match (found.as_f64(), stored.as_f64()) {
            (Some(found), Some(stored)) => found.to_bits() == stored.to_bits() || found == stored,
            _ => found == stored,
        };
        if !equal {
            self.wrong.push(format!("{view}, {}: {found}, the history {stored}", what()));
        }
    }

    pub(super) fn compare_ticks(&mut self, view: &'static str, found: &Ticks, stored: &Ticks) {
        for (at_ms, tick) in found {
            match stored.get(at_ms) {
                Some(known) => self.compare_tick(view, *at_ms, tick, known),
                None => self.wrong.push(format!("{view}: nothing is stored at {at_ms}")),
            }
        }
    }

    pub(super) fn compare_tick(&mut self, view: &'static str, at_ms: i64, found: &Tick, stored: &Tick) {
        for (name, value) in found {
            self.compare_value(view, &|| format!("{name} at {at_ms}"), value, &stored[name]);
        }
    }

    pub(super) fn assert_agreement(self) {
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
pub(super) fn compare_live(compared: &mut Compared, seen: &[Moment], by_ms: i64, stored: &Ticks, names: &[&str]) {
    let mut found = 0;
    for moment in seen {
        let at_ms = moment.status["at_ms"].as_i64().expect("a time") + if moment.dated { 0 } else { by_ms };
        // The last ticks of a run that ends may be told and not be stored any more; a sum of two times that were cut to ms is 1 ms less.
        let Some(known) = stored.get(&at_ms).or_else(|| stored.get(&(at_ms + 1))) else { continue };
        found += 1;
        compared.compare_tick("status (Now)", at_ms, &views::by_status(&moment.status, names), known);
        let Some(metrics) = &moment.metrics else { continue };
        for name in names.iter().filter(|name| known[**name].is_number()) {
            let expected = known[*name].as_f64().map(|number| views::to_base_unit(name, number));
            let told = views::in_metrics(metrics, name);
            compared.compare_value("Prometheus", &|| format!("{name} at {at_ms}"), &json!(told), &json!(expected));
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
pub(super) fn compare_driver(compared: &mut Compared, stored: &Ticks, course: Course) {
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
            match agrees_with_source(name, value, step, course) {
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
pub(super) fn list_intervals(rows: &[Json], since: Option<&str>, moves: &[Json]) -> Vec<String> {
    let line = |row: &Json| match since {
        Some(key) => format!("{} {}", row[key].as_i64().expect("ms"), row["state"].as_str().expect("a word")),
        None => format!("{} {}", views::moved_ms(row, moves), row["record"]["state"].as_str().expect("a word")),
    };
    let mut lines: Vec<String> = rows.iter().map(line).collect();
    lines.sort();
    lines.dedup();
    lines
}

/// What was told of the states, beside what is stored.
pub(super) struct States<'a> {
    pub(super) of_api: &'a Json,
    pub(super) items: &'a [Json],
    pub(super) moves: &'a [Json],
}

/// The changes of state: in the samples, as intervals in SQL, API and command, and as items; how many there were.
pub(super) fn compare_states(compared: &mut Compared, told: &States<'_>, database: &Path, stored: &Ticks) -> usize {
    let sql = views::select_rows(database, "SELECT state, since_ns / 1000000 AS since_ms FROM states");
    let output = run(&["history", "query", "--history", text(database), "--records", "states", "--json"]);
    let command: Json = serde_json::from_str(&stdout(&output)).expect("JSON");
    let of_items: Vec<Json> = told.items.iter().filter(|item| item["kind"] == "state").cloned().collect();
    let rows = |document: &Json| document["rows"].as_array().expect("rows").clone();
    let wanted = list_intervals(&sql, Some("since_ms"), told.moves);
    let found = [
        ("states: command", list_intervals(&rows(&command), Some("from_ms"), told.moves)),
        ("states: API", list_intervals(&rows(told.of_api), Some("from_ms"), told.moves)),
        ("states: MQTT", list_intervals(&of_items, None, told.moves)),
    ];
    for (view, lines) in found {
        compared.compare_value(view, &|| "intervals".to_owned(), &json!(lines), &json!(wanted));
    }
    let mut changes = 0;
    let mut last = Json::Null;
    for (at_ms, tick) in stored {
        if tick["machine_state"] != last && !tick["machine_state"].is_null() {
            last = tick["machine_state"].clone();
            changes += 1;
            let known = wanted.contains(&format!("{at_ms} {}", last.as_str().unwrap_or("?")));
            compared.compare_value("states: samples", &|| format!("{last} at {at_ms}"), &json!(known), &json!(true));
        }
    }
    changes
}

/// The figures on the page Now, as a person reads them, with the time at which they were.
pub(super) fn read_page(browser: &mut Browser) -> Json {
    browser.value(
        "(() => ({ at: Number(document.getElementById('state').dataset.ms),
            shown: [...document.querySelectorAll('[data-quantity]')].map((it) => [it.dataset.quantity, it.dataset.value ?? null, it.textContent]) }))()",
    )
}

/// What is printed on the page is the stored number in the page's own digits.
pub(super) fn compare_page(compared: &mut Compared, browser: &mut Browser, moments: &[Json], stored: &Ticks) {
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
            Some(_) => compared.compare_value("page Now", &|| what.clone(), &shown[2], text),
            None => compared.compare_value("page Now", &|| what.clone(), &json!(shown[1].is_null()), &json!(true)),
        }
    }
}
