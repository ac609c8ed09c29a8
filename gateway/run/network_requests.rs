//! What the network asks of the gate, at the tick: each request is one row of the audit, and a feed override stands for a
//! limited time as if a script asked for it at every tick. The gate judges it like one.

use adapters::clock::{SECOND_NS, TimeNs};
use gateway_control::{NetworkRequest, Reply, RequestedChange};
use gateway_gate::audit;
use gateway_history::Audit;
use rules::script::OverrideRequest;

/// A feed override stands for so long after it was asked for; whoever wants it to stay asks again before. Longer, and a machine
/// stays slow after the system that asked has died; shorter, and a network that loses a message for a moment lets the feed jump.
const STANDS_S: i64 = 60;

/// One sink's feed override.
#[derive(Debug, Clone)]
struct ActiveRequest {
    request: OverrideRequest,
    until_ns: TimeNs,
}

/// See the [module](self). At most one request per sink.
#[derive(Debug, Default)]
pub struct NetworkRequests {
    active: Vec<ActiveRequest>,
}

impl NetworkRequests {
    /// Takes a request for a feed override or its end; gives what became of it. An alarm is acknowledged by whoever holds the alarms.
    /// `unarmed`: why nothing is written at present; the gate judges the request all the same, and the reply says that it is not done.
    pub fn accept_change(
        &mut self,
        sink: &str,
        change: &RequestedChange,
        unarmed: Option<&str>,
        at_ns: TimeNs,
    ) -> Reply {
        let author = format_author(sink);
        self.active.retain(|standing| *standing.request.script != *author);
        let RequestedChange::FeedOverride { pct, reason } = change else {
            return Reply::from_success("nothing is asked for any more");
        };
        let reason = if reason.is_empty() { "asked over the network" } else { reason };
        let request = OverrideRequest { pct: *pct, reason: reason.into(), script: author.into(), version: 0 };
        self.active.push(ActiveRequest { request, until_ns: at_ns.saturating_add(STANDS_S * SECOND_NS) });
        match unarmed {
            None => {
                Reply::from_success(format!("the gate is asked for {pct} % for {STANDS_S} s; it decides at every tick"))
            }
            Some(why) => Reply::from_refusal(format!(
                "nothing is written: {why}; the gate judges {pct} % for {STANDS_S} s, and whoever arms it meanwhile lets it pass"
            )),
        }
    }

    /// The least of what stands at this tick; what is over goes.
    pub fn find_least_override(&mut self, at_ns: TimeNs) -> Option<OverrideRequest> {
        // A clock that went back ends it too: it would stand for longer than it may.
        let stands = |standing: &ActiveRequest| {
            at_ns < standing.until_ns && standing.until_ns.saturating_sub(at_ns) <= STANDS_S * SECOND_NS
        };
        self.active.retain(stands);
        OverrideRequest::find_least(self.active.iter().map(|standing| &standing.request)).cloned()
    }
}

/// How a sink is named where scripts and persons are.
#[must_use]
pub fn format_author(sink: &str) -> String {
    format!("sink {sink}")
}

/// The row of the audit.
#[must_use]
pub fn build_audit_row(request: &NetworkRequest, reply: &Reply, at_ns: TimeNs) -> Audit {
    let what = request.change.as_ref().map_or_else(ToString::to_string, |change| format!("{change}: {}", reply.text));
    let also = match request.left_out {
        0 => String::new(),
        count => format!("; {count} messages before it came too fast and were thrown away"),
    };
    let asked = match request.change {
        Ok(RequestedChange::FeedOverride { pct, .. }) => Some(pct),
        _ => None,
    };
    let outcome = match (reply.done, &request.change) {
        (true, _) => "done",
        (false, Ok(RequestedChange::FeedOverride { .. })) => "not_written",
        (false, _) => "refused",
    };
    let row = audit::audit_order("network_request", outcome, &format!("{what}{also}; {}", request.origin), "", at_ns);
    let unit = if asked.is_some() { "%".to_owned() } else { String::new() };
    Audit { asked, unit, script: format_author(&request.sink), ..row }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gateway_control::{RequestOrigin, RequestRefusal};

    fn change(pct: f64) -> RequestedChange {
        RequestedChange::feed_override(pct, "").expect("allowed")
    }

    #[test]
    fn a_request_stands_for_a_minute_and_the_least_counts() {
        let mut requests = NetworkRequests::default();
        requests.accept_change("plant", &change(80.0), None, 0);
        requests.accept_change("cell", &change(60.0), None, 10 * SECOND_NS);
        let pct =
            |requests: &mut NetworkRequests, at_s: i64| requests.find_least_override(at_s * SECOND_NS).map(|it| it.pct);
        assert_eq!(pct(&mut requests, 11), Some(60.0));
        requests.accept_change("cell", &RequestedChange::Withdraw, None, 12 * SECOND_NS);
        assert_eq!(pct(&mut requests, 12), Some(80.0));
        requests.accept_change("plant", &change(90.0), None, 50 * SECOND_NS);
        assert_eq!(pct(&mut requests, 109), Some(90.0), "asked again");
        assert_eq!(pct(&mut requests, 110), None);
        requests.accept_change("plant", &change(90.0), None, 200 * SECOND_NS);
        assert_eq!(pct(&mut requests, 100), None, "a clock that went back");
    }

    #[test]
    fn while_nothing_is_written_it_is_not_done() {
        let mut requests = NetworkRequests::default();
        let reply = requests.accept_change("plant", &change(80.0), Some("it is not armed"), 0);
        assert!(!reply.done && reply.text.contains("it is not armed"), "{reply:?}");
        assert_eq!(requests.find_least_override(1).map(|it| it.pct), Some(80.0), "the gate sees it all the same");
        assert!(requests.accept_change("plant", &RequestedChange::Withdraw, Some("it is not armed"), 2).done);
    }

    #[test]
    fn a_row_says_who_what_and_why() {
        let request = NetworkRequest {
            sink: "plant".to_owned(),
            origin: RequestOrigin::from_words(Some("a1"), Some("mes"), None),
            change: Err(RequestRefusal::Unknown { forms: "write one" }),
            left_out: 7,
        };
        let row = build_audit_row(&request, &Reply::from_refusal("no request"), 5);
        assert_eq!(
            (row.kind.as_str(), row.outcome.as_str(), row.script.as_str()),
            ("network_request", "refused", "sink plant")
        );
        assert!(row.reason.contains("no request; write one; 7 messages"), "{}", row.reason);
        assert!(row.reason.ends_with("; asked by \"mes\", id \"a1\""), "{}", row.reason);
    }
}
