//! What the network asks of the gate, at the tick: each request is one row of the audit, and a feed override stands for a
//! limited time as if a script asked for it at every tick. The gate judges it like one. What became of a request that stands is
//! told once, when the control shows it or will not: a second row, and a message to whoever asked.

mod account;
mod settle;

pub use account::{RequestJudgement, SettledRequest, build_audit_row, build_outcome, format_author};
pub use settle::{ControlState, GateSituation};

use adapters::clock::{SECOND_NS, TimeNs};
use gateway_control::{Ending, NetworkRequest, OutcomeSender, Reply, RequestOrigin, RequestOutcome, RequestedChange};
use gateway_gate::Disarmed;
use rules::script::OverrideRequest;
use settle::{RequestEnding, settle_request, settle_unarmed};

/// A feed override stands for so long after it was asked for; whoever wants it to stay asks again before. Longer, and a machine
/// stays slow after the system that asked has died; shorter, and a network that loses a message for a moment lets the feed jump.
const STANDS_S: i64 = 60;
/// One asker's feed override.
#[derive(Debug, Clone)]
struct ActiveRequest {
    asker: Asker,
    request: OverrideRequest,
    until_ns: TimeNs,
}

/// Who asks, as far as one can tell: the sink, and what the message says.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Asker {
    sink: String,
    name: Option<String>,
}

impl Asker {
    fn of_request(request: &NetworkRequest) -> Self {
        Self { sink: request.sink.clone(), name: request.origin.asker.clone() }
    }
}

/// A request that was taken, whose outcome is not known yet.
#[derive(Debug)]
struct PendingRequest {
    asker: Asker,
    origin: RequestOrigin,
    /// The feed override that was asked for; 100 where none is wanted any more.
    pct: f64,
    until_ns: TimeNs,
    outcomes: OutcomeSender,
}

/// See the [module](self). At most one request per asker.
#[derive(Debug, Default)]
pub struct NetworkRequests {
    active: Vec<ActiveRequest>,
    pending: Vec<PendingRequest>,
}

impl NetworkRequests {
    /// Takes a request for a feed override or its end; gives what became of it, or `None` where the control has to show it first:
    /// then [`NetworkRequests::settle_requests`] says it. `why_disarmed`: why nothing is written at present. The gate judges the request
    /// all the same, and it is never written later. An alarm is acknowledged by whoever holds the alarms.
    pub fn accept_change(
        &mut self,
        (request, outcomes): (&NetworkRequest, &OutcomeSender),
        change: &RequestedChange,
        why_disarmed: Option<Disarmed>,
        at_ns: TimeNs,
    ) -> RequestJudgement {
        let asker = Asker::of_request(request);
        self.active.retain(|standing| standing.asker != asker);
        let until_ns = at_ns.saturating_add(STANDS_S * SECOND_NS);
        let (wanted_pct, what) = match change {
            RequestedChange::FeedOverride { pct, reason } => {
                self.active.push(ActiveRequest {
                    request: build_script_request(request, *pct, reason),
                    until_ns,
                    asker: asker.clone(),
                });
                (*pct, format!("the gate is asked for {pct} % for {STANDS_S} s; it decides at every tick"))
            }
            _ => (100.0, "nothing is asked for any more".to_owned()),
        };
        if let Some(why) = why_disarmed {
            let text = format!(
                "nothing is written: {why}; the gate only judges {wanted_pct} %. Ask again when somebody has armed it"
            );
            return RequestJudgement {
                reply: Reply::from_refusal(text),
                ending: Some((Ending::NotWritten, why.as_word())),
            };
        }
        let (origin, outcomes) = (request.origin.clone(), outcomes.clone());
        self.pending.push(PendingRequest { asker, origin, pct: wanted_pct, until_ns, outcomes });
        RequestJudgement { reply: Reply::from_success(what), ending: None }
    }

    /// What this asker has asked for before is over: he asks for something else.
    pub fn replace_pending(&mut self, request: &NetworkRequest, at_ns: TimeNs) -> Vec<SettledRequest> {
        let asker = Asker::of_request(request);
        let text = "the same asker has asked for something else";
        self.settle_each(
            |pending| (pending.asker == asker).then(|| RequestEnding::new(Ending::Replaced, "", text, None)),
            at_ns,
        )
    }

    /// Nothing that was asked for until now is written any more, even when somebody arms the gate.
    pub fn end_requests(&mut self, why: Disarmed, at_ns: TimeNs) -> Vec<SettledRequest> {
        self.active.clear();
        self.settle_each(|_| Some(settle_unarmed(why)), at_ns)
    }

    /// The box ends: nobody will see what the control makes of what was asked for.
    pub fn close_requests(&mut self, at_ns: TimeNs) -> Vec<SettledRequest> {
        self.settle_each(
            |_| Some(RequestEnding::new(Ending::NotFollowed, "stopped", "the box was stopped", None)),
            at_ns,
        )
    }

    /// The outcomes that are known at this tick.
    pub fn settle_requests(&mut self, situation: &GateSituation<'_>) -> Vec<SettledRequest> {
        self.settle_each(|pending| settle_request(pending, situation), situation.verdict.at_ns)
    }

    fn settle_each(
        &mut self,
        settle: impl Fn(&PendingRequest) -> Option<RequestEnding>,
        at_ns: TimeNs,
    ) -> Vec<SettledRequest> {
        let (mut settled, mut left) = (Vec::new(), Vec::new());
        for pending in self.pending.drain(..) {
            let Some(RequestEnding { ending, why, text, in_force_pct }) = settle(&pending) else {
                left.push(pending);
                continue;
            };
            let PendingRequest { asker, origin, pct, outcomes, .. } = pending;
            let outcome = RequestOutcome { origin, ending, why, text, asked_pct: Some(pct), in_force_pct, at_ns };
            settled.push(SettledRequest { sink: asker.sink, outcome, outcomes });
        }
        self.pending = left;
        settled
    }

    /// The least of what stands at this tick; what is over goes.
    pub fn find_least_override(&mut self, at_ns: TimeNs) -> Option<OverrideRequest> {
        // A clock that went back ends it too: it would stand for longer than it may.
        let stands = |standing: &ActiveRequest| is_within(standing.until_ns, at_ns);
        self.active.retain(stands);
        OverrideRequest::find_least(self.active.iter().map(|standing| &standing.request)).cloned()
    }
}

fn is_within(until_ns: TimeNs, at_ns: TimeNs) -> bool {
    at_ns < until_ns && until_ns.saturating_sub(at_ns) <= STANDS_S * SECOND_NS
}

/// As if a script asked, with who asks beside the reason.
fn build_script_request(request: &NetworkRequest, pct: f64, reason: &str) -> OverrideRequest {
    let reason = if reason.is_empty() { "asked over the network" } else { reason };
    let reason = format!("{reason} ({})", request.origin);
    OverrideRequest { pct, reason: reason.as_str().into(), script: format_author(&request.sink).into(), version: 0 }
}

#[cfg(test)]
mod tests {
    use super::account::REASON_MAX;
    use super::*;
    use adapters::override_pct::OverridePct;
    use gateway_control::{OUTCOMES_MAX, RequestRefusal};
    use gateway_gate::{Bound, GateOutcome, Hold, Reaction, Verdict};
    use gateway_history::Audit;
    use tokio::sync::mpsc::{Receiver, channel};

    fn change(pct: f64) -> RequestedChange {
        RequestedChange::feed_override(pct, "").expect("allowed")
    }

    fn asked_by(sink: &str, asker: &str, id: &str, change: &RequestedChange) -> NetworkRequest {
        let origin = RequestOrigin::from_words(Some(id), Some(asker), None);
        NetworkRequest { sink: sink.to_owned(), origin, change: Ok(change.clone()), left_out: 0 }
    }

    /// The requests with the way back to the askers.
    struct Askers {
        requests: NetworkRequests,
        outcomes: OutcomeSender,
        told: Receiver<RequestOutcome>,
        rows: Vec<Audit>,
    }

    impl Askers {
        fn new() -> Self {
            let (outcomes, told) = channel(OUTCOMES_MAX);
            Self { requests: NetworkRequests::default(), outcomes, told, rows: Vec::new() }
        }

        fn ask(
            &mut self,
            asker: &str,
            id: &str,
            change: &RequestedChange,
            why_disarmed: Option<Disarmed>,
            at_s: i64,
        ) -> RequestJudgement {
            let request = asked_by("plant", asker, id, change);
            let replaced = self.requests.replace_pending(&request, at_s * SECOND_NS);
            self.keep(replaced);
            self.requests.accept_change((&request, &self.outcomes), change, why_disarmed, at_s * SECOND_NS)
        }

        fn keep(&mut self, settled: Vec<SettledRequest>) {
            for it in settled {
                self.rows.push(it.build_audit_row());
                it.tell_asker();
            }
        }

        /// One tick; gives `ID ENDING WHY` of what is told.
        fn tick(&mut self, situation: GateSituation<'_>) -> Vec<String> {
            let settled = self.requests.settle_requests(&situation);
            self.keep(settled);
            self.told()
        }

        fn told(&mut self) -> Vec<String> {
            let format = |it: RequestOutcome| {
                let shown = it.in_force_pct.map_or("-".to_owned(), |pct| format!("{pct}"));
                format!("{} {} {} {shown}", it.origin.id.unwrap_or_default(), it.ending.as_word(), it.why)
            };
            std::iter::from_fn(|| self.told.try_recv().ok()).map(format).collect()
        }
    }

    fn verdict(at_s: i64, wanted: Option<f64>, permitted: u8, outcome: GateOutcome) -> Verdict {
        let permitted = OverridePct::from_nearest_percent(f64::from(permitted)).expect("a percentage");
        Verdict { at_ns: at_s * SECOND_NS, wanted_pct: wanted, permitted, outcome, armed: true }
    }

    fn shows(pct: u8) -> ControlState {
        let pct = OverridePct::from_nearest_percent(f64::from(pct)).expect("a percentage");
        ControlState::Shows(Reaction { asked: pct, found: pct, sample_ns: 0, issued_ns: 0, seen_ns: 0 })
    }

    fn situation(verdict: &Verdict, control: ControlState) -> GateSituation<'_> {
        GateSituation { verdict, why_disarmed: None, control, ramping: false, author: Some("sink plant") }
    }

    #[test]
    fn a_request_stands_for_a_minute_and_the_least_counts() {
        let mut askers = Askers::new();
        askers.ask("plan", "a", &change(80.0), None, 0);
        askers.ask("cell", "b", &change(60.0), None, 10);
        let pct =
            |askers: &mut Askers, at_s: i64| askers.requests.find_least_override(at_s * SECOND_NS).map(|it| it.pct);
        assert_eq!(pct(&mut askers, 11), Some(60.0));
        askers.ask("cell", "c", &RequestedChange::Withdraw, None, 12);
        assert_eq!(pct(&mut askers, 12), Some(80.0));
        askers.ask("plan", "d", &change(90.0), None, 50);
        assert_eq!(pct(&mut askers, 109), Some(90.0), "asked again");
        assert_eq!(pct(&mut askers, 110), None);
        askers.ask("plan", "e", &change(90.0), None, 200);
        assert_eq!(pct(&mut askers, 100), None, "a clock that went back");
        assert_eq!(askers.told(), ["b replaced  -", "a replaced  -", "d replaced  -"]);
    }

    #[test]
    fn while_nothing_is_written_it_is_not_done_and_never_written_later() {
        let mut askers = Askers::new();
        for change in [change(80.0), RequestedChange::Withdraw, change(70.0)] {
            let judgement = askers.ask("mes", "a", &change, Some(Disarmed::Start), 0);
            assert!(
                !judgement.reply.done && judgement.reply.text.contains("not armed since the start"),
                "{judgement:?}"
            );
            assert_eq!(judgement.ending, Some((Ending::NotWritten, "start")));
        }
        assert_eq!(
            askers.requests.find_least_override(1).map(|it| it.pct),
            Some(70.0),
            "the gate sees it all the same"
        );
        assert!(askers.requests.end_requests(Disarmed::Start, 2).is_empty(), "its outcome was told");
        assert_eq!(askers.requests.find_least_override(3), None, "whoever arms now lets nothing of before pass");
    }

    #[test]
    fn the_control_says_what_became_of_it() {
        let mut askers = Askers::new();
        askers.ask("mes", "a", &change(80.0), None, 0);
        let wanted = verdict(1, Some(80.0), 90, GateOutcome::Limited(Bound::Slew));
        assert!(askers.tick(GateSituation { ramping: true, ..situation(&wanted, shows(90)) }).is_empty(), "on its way");
        let wanted = verdict(2, Some(80.0), 80, GateOutcome::Permitted);
        assert!(askers.tick(situation(&wanted, ControlState::AtDial)).is_empty());
        assert!(askers.tick(situation(&wanted, ControlState::Written)).is_empty());
        assert_eq!(askers.tick(situation(&wanted, shows(80))), ["a followed  80"]);
        assert!(askers.tick(situation(&wanted, shows(80))).is_empty(), "once");
        askers.ask("mes", "b", &change(20.0), None, 3);
        let least = verdict(4, Some(20.0), 50, GateOutcome::Limited(Bound::Least));
        assert_eq!(askers.tick(situation(&least, shows(50))), ["b limited limited 50"]);
        askers.ask("mes", "c", &RequestedChange::Withdraw, None, 5);
        let nothing = verdict(6, None, 100, GateOutcome::Permitted);
        assert!(askers.tick(situation(&nothing, shows(50))).is_empty(), "it is still in force");
        assert_eq!(askers.tick(situation(&nothing, ControlState::AtDial)), ["c followed  -"]);
        let outcomes: Vec<&str> = askers.rows.iter().map(|row| row.outcome.as_str()).collect();
        assert_eq!(outcomes, ["followed", "limited", "followed"]);
        assert_eq!((askers.rows[1].asked, askers.rows[1].after), (Some(20.0), Some(50.0)));
        assert!(
            askers.rows[1].reason.starts_with("asked by \"mes\", id \"b\"; the control shows 50 %"),
            "{:?}",
            askers.rows[1]
        );
    }

    #[test]
    fn two_askers_are_told_each_what_became_of_his_own() {
        let mut askers = Askers::new();
        askers.ask("mes", "m", &change(80.0), None, 0);
        askers.ask("cell", "c", &change(60.0), None, 0);
        let wanted = verdict(1, Some(60.0), 60, GateOutcome::Permitted);
        let told = askers.tick(situation(&wanted, shows(60)));
        assert_eq!(told, ["m limited less_is_asked_for 60", "c followed  60"]);
        askers.ask("cell", "w", &RequestedChange::Withdraw, None, 2);
        let wanted = verdict(3, Some(80.0), 80, GateOutcome::Permitted);
        assert_eq!(askers.tick(situation(&wanted, shows(80))), ["w limited less_is_asked_for 80"]);
    }

    #[test]
    fn what_the_control_does_not_show_is_told_when_its_time_is_over_or_the_arming_is() {
        let mut askers = Askers::new();
        askers.ask("mes", "held", &change(80.0), None, 0);
        askers.ask("cell", "lost", &change(70.0), None, 30);
        let held = verdict(59, Some(70.0), 100, GateOutcome::Held(Hold::Off));
        assert!(askers.tick(situation(&held, ControlState::AtDial)).is_empty());
        let held = verdict(60, Some(70.0), 100, GateOutcome::Held(Hold::Off));
        assert_eq!(askers.tick(situation(&held, ControlState::AtDial)), ["held not_followed held -"]);
        let disarmed =
            GateSituation { why_disarmed: Some(Disarmed::ReadBack), ..situation(&held, ControlState::AtDial) };
        assert_eq!(askers.tick(disarmed), ["lost failed read_back -"]);
        askers.ask("mes", "end", &change(80.0), None, 61);
        let ended = askers.requests.close_requests(62 * SECOND_NS);
        askers.keep(ended);
        assert_eq!(askers.told(), ["end not_followed stopped -"]);
    }

    #[test]
    fn a_row_says_who_what_and_why() {
        let change = Err(RequestRefusal::Unreadable { error: "x".repeat(400), forms: "write one" });
        let request =
            NetworkRequest { change, left_out: 7, ..asked_by("plant", "mes", "a1", &RequestedChange::Withdraw) };
        let judgement = RequestJudgement::from_refusal("malformed", "no request".to_owned());
        let row = build_audit_row(&request, &judgement, 5);
        assert_eq!(
            (row.kind.as_str(), row.outcome.as_str(), row.script.as_str()),
            ("network_request", "refused", "sink plant")
        );
        let begins = "asked by \"mes\", id \"a1\"; 7 messages before it came too fast and were thrown away; malformed: this is no request";
        assert!(row.reason.starts_with(begins) && row.reason.chars().count() <= REASON_MAX, "{}", row.reason);
        let outcome = build_outcome(&request, &judgement, 5).expect("known at once");
        assert_eq!((outcome.ending, outcome.why), (Ending::Refused, "malformed"));
    }
}
