//! Requests in commands of a host (NCMD, DCMD), and their answer. Pure.
//!
//! | metric | type | meaning |
//! |---|---|---|
//! | `request/feed_override_pct` | Double | ask the gate for this feed override; null: no longer |
//! | `request/acknowledge_alarm` | String | the alarm of this code has been seen |
//! | `request/answer` | String | JSON: `done`, `text` with what is made of it, and `id` |
//! | `request/outcome` | String | JSON: whether the machine has followed, under the same `id` |
//!
//! A host may name a metric by its alias alone, as the birth gave it.

use super::births::REBIRTH;
use super::payload::{Metric, MetricValue, Payload, datatype};
use crate::requests::format_outcome;
use gateway_control::{Reply, RequestOrigin, RequestOutcome, RequestRefusal, RequestedChange};
use serde_json::{Value as Json, json};

const FEED_OVERRIDE: (&str, u64) = ("request/feed_override_pct", 9);
const ACKNOWLEDGE_ALARM: (&str, u64) = ("request/acknowledge_alarm", 10);
const ANSWER: (&str, u64) = ("request/answer", 11);
const OUTCOME: (&str, u64) = ("request/outcome", 12);

/// Requests in one message; what is more is refused as a whole.
const CHANGES_MAX: usize = 4;

/// What a birth says of them: where requests are not allowed, only the answer and the outcome, because a refusal is told too.
pub(super) fn build_request_metrics(allowed: bool, at_ms: u64) -> Vec<Metric> {
    let null = |(name, alias): (&str, u64), datatype| Metric {
        alias: Some(alias),
        value: None,
        is_null: Some(true),
        ..Metric::with_name(name, datatype, at_ms, MetricValue::Boolean(false))
    };
    let asked = [null(FEED_OVERRIDE, datatype::DOUBLE), null(ACKNOWLEDGE_ALARM, datatype::STRING)];
    let asked = asked.into_iter().filter(|_| allowed);
    asked.chain([ANSWER, OUTCOME].map(|told| null(told, datatype::STRING))).collect()
}

/// What is answered to a request.
pub(super) fn build_answer_metric(reply: &Reply, id: Option<&str>, at_ms: u64) -> Metric {
    build_told_metric(ANSWER.1, &json!({"done": reply.done, "text": reply.text, "id": id}), at_ms)
}

/// What became of a request in the end.
pub(super) fn build_outcome_metric(outcome: &RequestOutcome, at_ms: u64) -> Metric {
    build_told_metric(OUTCOME.1, &format_outcome(outcome), at_ms)
}

fn build_told_metric(alias: u64, document: &Json, at_ms: u64) -> Metric {
    Metric {
        alias: Some(alias),
        timestamp: Some(at_ms),
        value: Some(MetricValue::Text(document.to_string())),
        ..Metric::default()
    }
}

/// What one metric of a command asks for, and who asks.
#[derive(Debug, PartialEq)]
pub(super) struct AskedChange {
    pub(super) origin: RequestOrigin,
    pub(super) change: Result<RequestedChange, RequestRefusal>,
}

/// What a command asks for; empty where every metric of it is one that the node itself obeys. A metric that nobody may write is refused,
/// so that it is told and accounted for. A message that the broker has kept is refused: it would come again at every connection.
pub(super) fn parse_changes(payload: &Payload, retained: bool) -> Vec<AskedChange> {
    let asked = || payload.metrics.iter().filter(|metric| !is_own(metric));
    let parse = |metric: &Metric| AskedChange {
        origin: origin_of(metric, payload.timestamp),
        change: if retained { Err(RequestRefusal::RetainedCommand) } else { parse_change(metric) },
    };
    let count = asked().count();
    let beyond = asked().nth(CHANGES_MAX).map(|metric| AskedChange {
        origin: origin_of(metric, payload.timestamp),
        change: Err(RequestRefusal::TooMany { count, most: CHANGES_MAX }),
    });
    asked().take(CHANGES_MAX).map(parse).chain(beyond).collect()
}

/// A command that is no payload at all.
pub(super) fn refuse_unreadable(error: &str) -> AskedChange {
    let refused = RequestRefusal::Unreadable { error: error.to_owned(), forms: "send a payload of Sparkplug B" };
    AskedChange { origin: RequestOrigin::default(), change: Err(refused) }
}

/// What the node does without the gate.
fn is_own(metric: &Metric) -> bool {
    metric.name.as_deref() == Some(REBIRTH)
}

/// A command names nobody and has no mark; the time of its metric stands for both, so that the same command is not obeyed twice.
fn origin_of(metric: &Metric, of_message: Option<u64>) -> RequestOrigin {
    let Some(at_ms) = metric.timestamp.or(of_message) else { return RequestOrigin::default() };
    let issued_ns = i64::try_from(at_ms).ok().map(|at_ms| at_ms.saturating_mul(1_000_000));
    RequestOrigin::from_words(Some(&format!("{} at {at_ms}", name_of(metric))), None, issued_ns)
}

fn name_of(metric: &Metric) -> String {
    let alias = || {
        let known = [FEED_OVERRIDE, ACKNOWLEDGE_ALARM].into_iter().find(|(_, alias)| metric.alias == Some(*alias));
        known.map_or_else(|| format!("alias {}", metric.alias.unwrap_or(0)), |(name, _)| name.to_owned())
    };
    metric.name.clone().filter(|name| !name.is_empty()).unwrap_or_else(alias)
}

fn parse_change(metric: &Metric) -> Result<RequestedChange, RequestRefusal> {
    let name = name_of(metric);
    if name == FEED_OVERRIDE.0 {
        return match (&metric.value, metric.is_null) {
            (None, _) | (_, Some(true)) => Ok(RequestedChange::Withdraw),
            (Some(value), _) => to_number(value).map_or_else(
                || Err(RequestRefusal::NoNumber { metric: FEED_OVERRIDE.0 }),
                |pct| RequestedChange::feed_override(pct, ""),
            ),
        };
    }
    if name != ACKNOWLEDGE_ALARM.0 {
        return Err(RequestRefusal::NotWritable {
            metric: name.chars().filter(|it| !it.is_control()).take(120).collect(),
        });
    }
    match &metric.value {
        Some(MetricValue::Text(code)) => Ok(RequestedChange::acknowledge_alarm(code)),
        _ => Err(RequestRefusal::NoText { metric: ACKNOWLEDGE_ALARM.0 }),
    }
}

/// Whole numbers are without sign in the payload: a negative one is far above what can be asked for, and refused there.
fn to_number(value: &MetricValue) -> Option<f64> {
    match value {
        MetricValue::Int(number) => Some(f64::from(*number)),
        MetricValue::Long(number) => Some(*number as f64),
        MetricValue::Float(number) => Some(f64::from(*number)),
        MetricValue::Double(number) => Some(*number),
        MetricValue::Boolean(_) | MetricValue::Text(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn payload(metrics: Vec<Metric>) -> Payload {
        Payload { timestamp: None, metrics, seq: None }
    }

    #[test]
    fn a_request_is_known_by_name_or_alias_and_everything_else_is_refused() {
        let named = |name: &str, value| Metric::with_name(name, datatype::DOUBLE, 0, value);
        let by_alias = Metric { alias: Some(9), value: Some(MetricValue::Int(70)), ..Metric::default() };
        let all = payload(vec![
            named("request/feed_override_pct", MetricValue::Double(80.0)),
            by_alias,
            named("request/acknowledge_alarm", MetricValue::Text("overload".to_owned())),
            named("spindle_power_w", MetricValue::Double(1.0)),
            named("Node Control/Rebirth", MetricValue::Boolean(true)),
        ]);
        let expected = [
            RequestedChange::feed_override(80.0, ""),
            RequestedChange::feed_override(70.0, ""),
            Ok(RequestedChange::acknowledge_alarm("overload")),
            Err(RequestRefusal::NotWritable { metric: "spindle_power_w".to_owned() }),
        ];
        let asked = parse_changes(&all, false);
        let origin = asked[0].origin.clone();
        assert_eq!((origin.id.as_deref(), origin.issued_ns), (Some("request/feed_override_pct at 0"), Some(0)));
        assert_eq!(asked.into_iter().map(|it| it.change).collect::<Vec<_>>(), expected);
        assert!(parse_changes(&all, true).iter().all(|it| it.change.is_err()), "retained");
        let many = payload((0..9).map(|_| named("spindle_power_w", MetricValue::Double(1.0))).collect());
        let last = parse_changes(&many, false).pop().map(|it| it.change);
        assert_eq!(last, Some(Err(RequestRefusal::TooMany { count: 9, most: CHANGES_MAX })));
    }

    #[test]
    fn what_is_no_number_is_refused_and_null_withdraws() {
        let of = |value: Option<MetricValue>| {
            let metric = Metric { name: Some(FEED_OVERRIDE.0.to_owned()), value, ..Metric::default() };
            parse_changes(&payload(vec![metric]), false).remove(0).change
        };
        assert_eq!(of(None), Ok(RequestedChange::Withdraw));
        for bad in [
            MetricValue::Text("80".to_owned()),
            MetricValue::Boolean(true),
            MetricValue::Int(u32::MAX),
            MetricValue::Double(f64::NAN),
        ] {
            assert!(of(Some(bad.clone())).is_err(), "{bad:?}");
        }
    }
}
