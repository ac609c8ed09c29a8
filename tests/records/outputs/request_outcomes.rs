//! What became of each request in the end: one outcome to whoever asked, and the audit says the same.

use crate::outputs::plain::Listener;
use crate::outputs::requests::{publish, stamp_request_of, start};
use serde_json::Value as Json;
use std::time::Duration;
use testkit::box_under_test::Sending;
use testkit::broker::Broker;
use testkit::process::wait_for;

const PATIENCE: Duration = Duration::from_secs(60);
const REQUEST: &str = "works/lathe/request";

/// One line of what was told or accounted for: id, who asks, how it ended, what was in force.
type Line = (String, String, String, Option<f64>);

struct Asking {
    broker: Broker,
    listener: Listener,
    sending: Sending,
}

impl Asking {
    fn start() -> Option<Self> {
        let broker = Broker::start()?;
        let listener = Listener::plain(broker.port)?;
        let more = "allow_requests = true\n[gate]\nmode = \"armed\"\nsource = \"lathe\"\nslew_down_pct_per_s = 5.0\n";
        let sending = start(&format!("mqtt://127.0.0.1:{}/works/lathe", broker.port), more);
        Some(Self { broker, listener, sending })
    }

    fn outcomes(&self) -> Vec<Json> {
        self.listener.messages("works/lathe/request/outcome")
    }

    /// Sends these lines at once and gives the outcomes that come then, one for each.
    fn ask(&self, lines: &[String]) -> Vec<String> {
        let before = self.outcomes().len();
        publish(self.broker.port, REQUEST, &lines.concat(), &[]);
        let come = || Some(self.outcomes().split_off(before)).filter(|come| come.len() >= lines.len());
        let come = wait_for("the outcomes", PATIENCE, come);
        assert_eq!(come.len(), lines.len(), "{come:?}");
        let brief = |it: &Json| {
            let word = |name: &str| it[name].as_str().unwrap_or("-").to_owned();
            let pct = it["in_force_pct"].as_f64().map_or("-".to_owned(), |pct| pct.to_string());
            format!("{} {} {} {} {pct}", word("id"), word("from"), word("outcome"), word("why"))
        };
        come.iter().map(brief).collect()
    }
}

fn feed(asker: &str, pct: f64, id: &str) -> String {
    stamp_request_of(asker, &format!("{{\"request\":\"feed_override\",\"pct\":{pct}}}"), id, 0)
}

fn withdraw(asker: &str, id: &str, ago_s: i64) -> String {
    stamp_request_of(asker, "{\"request\":\"withdraw\"}", id, ago_s)
}

#[test]
fn each_request_has_one_outcome_and_the_audit_says_the_same() {
    let Some(mut asking) = Asking::start() else { return };
    assert_eq!(asking.ask(&[feed("mes", 70.0, "n1")]), ["n1 mes not_written start -"]);
    assert_eq!(asking.ask(&[feed("mes", 70.0, "n1")]), ["n1 mes refused replayed -"]);
    assert_eq!(asking.ask(&[withdraw("mes", "o1", 40)]), ["o1 mes refused expired -"]);
    let much = stamp_request_of("mes", "{\"request\":\"feed_override\",\"pct\":\"much\"}", "m1", 0);
    assert_eq!(asking.ask(&[much]), ["m1 mes refused malformed -"]);
    let broken = "{\"request\":\"feed_override\",\"pct\":,\"id\":\"m2\"}\n".to_owned();
    assert_eq!(asking.ask(&[broken]), ["m2 - refused malformed -"]);
    assert_eq!(asking.ask(&[withdraw("mes", "n2", 0)]), ["n2 mes not_written start -"]);
    asking.sending.wait_spindle();
    let armed = asking.sending.order(&["arm", "--for", "5m", "--by", "fitter"]);
    assert!(armed.contains("armed by fitter"), "{armed}");
    // Two askers at once: the least counts, and each is told of his own.
    let mut two = asking.ask(&[feed("mes", 80.0, "a1"), feed("cell", 60.0, "a2")]);
    two.sort_unstable();
    assert_eq!(two, ["a1 mes limited less_is_asked_for 60", "a2 cell followed  60"]);
    assert_eq!(asking.ask(&[feed("cell", 75.0, "a3")]), ["a3 cell followed  75"]);
    assert_eq!(asking.ask(&[feed("mes", 80.0, "b1")]), ["b1 mes limited less_is_asked_for 75"]);
    assert_eq!(asking.ask(&[withdraw("cell", "a4", 0)]), ["a4 cell limited less_is_asked_for 80"]);
    assert_eq!(asking.ask(&[withdraw("mes", "a5", 0)]), ["a5 mes followed  -"]);
    let disarmed = asking.sending.order(&["disarm", "--by", "fitter"]);
    assert!(disarmed.contains("given back"), "{disarmed}");
    assert_eq!(asking.ask(&[feed("cell", 60.0, "d1")]), ["d1 cell not_written person -"]);
    let answers = asking.listener.messages("works/lathe/request/answer");
    let done: Vec<&Json> = answers.iter().filter(|answer| answer["done"] == true).map(|answer| &answer["id"]).collect();
    assert_eq!(done, ["a1", "a2", "a3", "b1", "a4", "a5"], "nothing is done while it is not armed");
    let told = asking.outcomes();
    asking.sending.stop();
    assert_eq!(list_rows(&asking.sending.audit()), list_outcomes(&told));
}

fn list_outcomes(told: &[Json]) -> Vec<Line> {
    let word = |it: &Json, name: &str| it[name].as_str().unwrap_or_default().to_owned();
    told.iter().map(|it| (word(it, "id"), word(it, "from"), word(it, "outcome"), it["in_force_pct"].as_f64())).collect()
}

/// The rows that say how a request ended, as the messages do.
fn list_rows(audit: &[Json]) -> Vec<Line> {
    let ends = |row: &&Json| match row["kind"].as_str() {
        Some("network_outcome") => true,
        Some("network_request") => row["outcome"] != "accepted",
        _ => false,
    };
    let between = |text: &str, from: &str| {
        text.split_once(from)
            .and_then(|(_, rest)| rest.split_once('"'))
            .map_or(String::new(), |(word, _)| word.to_owned())
    };
    let line = |row: &Json| {
        let reason = row["reason"].as_str().unwrap_or_default();
        let outcome = row["outcome"].as_str().unwrap_or_default().to_owned();
        (between(reason, "id \""), between(reason, "asked by \""), outcome, row["after"].as_f64())
    };
    audit.iter().filter(ends).map(line).collect()
}
