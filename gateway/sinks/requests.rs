//! Requests to the gate that come over a sink's connection: who may ask, how often, and what is answered.
//!
//! A sink hands every message that looks like a request to [`Requests::submit_change`], whether it is allowed or not: the tick writes
//! all of them into the audit, carries out what is allowed, and says what became of it: an answer at once, and one outcome when
//! the machine has followed or will not ([`RequestOutcome`]), which the sink fetches with [`Requests::wait_for_outcome`].

use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_base::{clock, moment};
use gateway_control::{
    FactSender, FactsTaken, NetworkRequest, OUTCOMES_MAX, OrderSender, OutcomeSender, Reply, RequestOrigin,
    RequestOutcome, RequestRefusal, RequestedChange, read_facts_json,
};
use gateway_records::RowRate;
use serde_json::{Value as Json, json};
use std::collections::VecDeque;
use tokio::sync::mpsc::{Receiver, channel};

/// Requests per second on average, and at once. A plant's system asks a few times an hour and repeats once in half a minute;
/// whoever sends more fills the audit and holds up data: each waits for the tick, at most a tenth of a second. What is beyond is
/// thrown away unanswered, and counted.
const PER_S: f64 = 1.0;
const AT_ONCE: f64 = 10.0;

/// Messages of facts per second on average, and at once: a plant tells a week of shifts in one message, and counts scrap by hand.
const FACTS_PER_S: f64 = 2.0;
const FACTS_AT_ONCE: f64 = 50.0;
/// A longer message is cut and read as what it is then: no document.
const FACTS_BYTES_MAX: usize = 200_000;

/// A request that is older is not obeyed: whoever asked for it may have gone, and wishes otherwise by now. Clocks of a plant differ by
/// less, and a broker hands on within a second.
const AGE_MAX_S: i64 = 30;
/// The asker's clock may be ahead of that of the box by so much.
const AHEAD_MAX_NS: i64 = 5 * SECOND_NS;

/// The way of one sink to the gate.
#[derive(Debug)]
pub struct Requests {
    sink: String,
    allowed: bool,
    orders: Option<OrderSender>,
    rate: RowRate,
    /// What was issued before is refused: it may have been obeyed by the run before.
    began_ns: TimeNs,
    /// Marks of the requests that are young enough to come again.
    recent_ids: VecDeque<(TimeNs, String)>,
    /// How outcomes come, and the oldest that is not told yet.
    outcomes: OutcomeSender,
    coming: Receiver<RequestOutcome>,
    untold: Option<RequestOutcome>,
    /// Facts of production, where the sink takes any.
    facts_rate: Option<RowRate>,
}

impl Requests {
    /// Of the sink of this name; `allowed` is what its configuration says.
    #[must_use]
    pub fn new(sink: &str, allowed: bool, orders: Option<OrderSender>) -> Self {
        let (outcomes, coming) = channel(OUTCOMES_MAX);
        Self {
            sink: sink.to_owned(),
            allowed,
            outcomes,
            coming,
            untold: None,
            orders,
            rate: RowRate::new(PER_S, AT_ONCE),
            began_ns: clock::now_ns(),
            recent_ids: VecDeque::new(),
            facts_rate: None,
        }
    }

    /// The same for a sink whose network may tell facts, or may not.
    #[must_use]
    pub fn with_facts(self, allowed: bool) -> Self {
        Self { facts_rate: allowed.then(|| RowRate::new(FACTS_PER_S, FACTS_AT_ONCE)), ..self }
    }

    /// May facts be told?
    #[must_use]
    pub fn takes_facts(&self) -> bool {
        self.facts_rate.is_some()
    }

    /// Tells the facts of a message, and gives what became of it; `None` for what came too fast, which is not answered. A retained message
    /// would come again at every connection, long after somebody has put it right.
    pub async fn submit_facts(&mut self, payload: &[u8], retained: bool) -> Option<Reply> {
        let now_ns = clock::now_ns();
        self.facts_rate.as_mut()?.may_pass(now_ns)?;
        if retained {
            return Some(Reply::from_refusal("a retained message is no fact: publish it without the retain flag"));
        }
        let sender = FactSender { way: self.sink.clone(), author: String::new() };
        let facts = match read_facts_json(payload.get(..FACTS_BYTES_MAX).unwrap_or(payload), &sender, now_ns) {
            Ok(facts) => facts,
            Err(error) => return Some(Reply::from_refusal(error.to_string())),
        };
        let Some(post) = &self.orders else { return Some(Reply::from_refusal("there is no box behind this sink")) };
        Some(match post.send_facts(facts).await {
            Ok(FactsTaken { new, known }) => Reply::from_success(format!("{new} stored, {known} known already")),
            Err(error) => Reply::from_refusal(error.to_string()),
        })
    }

    /// Of a sink behind which there is no gate.
    #[must_use]
    pub fn without_gate() -> Self {
        Self::new("", false, None)
    }

    /// May anything be asked for?
    #[must_use]
    pub fn is_allowed(&self) -> bool {
        self.allowed
    }

    /// Asks, and gives what became of it; `None` for what came too fast, which is not answered.
    pub async fn submit_change(
        &mut self,
        origin: RequestOrigin,
        change: Result<RequestedChange, RequestRefusal>,
    ) -> Option<Reply> {
        let now_ns = clock::now_ns();
        let left_out = self.rate.may_pass(now_ns)?;
        let change = match (self.allowed, change) {
            (false, change) => Err(refuse_change(&self.sink, change)),
            (true, change) => change.and_then(|change| self.check_fresh(&origin, now_ns).map(|()| change)),
        };
        let Some(post) = &self.orders else { return Some(Reply::from_refusal("there is no gate here")) };
        let request = NetworkRequest { sink: self.sink.clone(), origin, change, left_out };
        Some(post.send_request(request, &self.outcomes).await)
    }

    /// Waits until an outcome is to be told. It may be dropped and called again.
    pub async fn wait_for_outcome(&mut self) {
        if self.untold.is_none() {
            self.untold = self.coming.recv().await;
        }
    }

    /// The oldest outcome that is to be told, if there is one; it stays until [`Requests::forget_outcome`].
    pub fn next_outcome(&mut self) -> Option<&RequestOutcome> {
        if self.untold.is_none() {
            self.untold = self.coming.try_recv().ok();
        }
        self.untold.as_ref()
    }

    /// It has been told.
    pub fn forget_outcome(&mut self) {
        self.untold = None;
    }

    /// Is it asked for now, and for the first time? What the run before may have obeyed is older than this run, so nothing needs to be
    /// remembered beyond a restart.
    fn check_fresh(&mut self, origin: &RequestOrigin, now_ns: TimeNs) -> Result<(), RequestRefusal> {
        let (Some(issued_ns), Some(id)) = (origin.issued_ns, &origin.id) else {
            return Err(RequestRefusal::WithoutOrigin);
        };
        let age_ns = now_ns.saturating_sub(issued_ns);
        if !(-AHEAD_MAX_NS..=AGE_MAX_S * SECOND_NS).contains(&age_ns) {
            return Err(RequestRefusal::NotFresh { age_s: age_ns as f64 / SECOND_NS as f64, most_s: AGE_MAX_S });
        }
        if issued_ns < self.began_ns {
            return Err(RequestRefusal::BeforeStart);
        }
        // The rate bounds how many there are.
        let gone_ns = now_ns.saturating_sub(AGE_MAX_S * SECOND_NS);
        self.recent_ids.retain(|(issued_ns, _)| *issued_ns >= gone_ns);
        if self.recent_ids.iter().any(|(_, known)| known == id) {
            return Err(RequestRefusal::Repeated { id: id.clone() });
        }
        self.recent_ids.push_back((issued_ns, id.clone()));
        Ok(())
    }
}

/// An outcome as a document.
pub(crate) fn format_outcome(outcome: &RequestOutcome) -> Json {
    let RequestOutcome { origin, ending, why, text, asked_pct, in_force_pct, at_ns } = outcome;
    json!({
        "id": origin.id, "from": origin.asker, "outcome": ending.as_word(), "why": why, "text": text,
        "asked_pct": asked_pct, "in_force_pct": in_force_pct, "time_utc": moment::format_utc(*at_ns),
    })
}

fn refuse_change(sink: &str, change: Result<RequestedChange, RequestRefusal>) -> RequestRefusal {
    let what = change.map_or_else(|_| "a message that is no request".to_owned(), |change| change.to_string());
    RequestRefusal::ClosedSink { sink: sink.to_owned(), what }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin(id: &str, issued_ns: TimeNs) -> RequestOrigin {
        RequestOrigin::from_words(Some(id), Some("mes"), Some(issued_ns))
    }

    #[test]
    fn a_request_is_obeyed_once_and_only_while_it_is_young() {
        let mut requests = Requests::new("plant", true, None);
        let began_ns = requests.began_ns;
        let now_ns = began_ns + 100 * SECOND_NS;
        let mut ask = |id: &str, age_s: i64| requests.check_fresh(&origin(id, now_ns - age_s * SECOND_NS), now_ns);
        assert_eq!(ask("a", 0), Ok(()));
        assert_eq!(ask("a", 0), Err(RequestRefusal::Repeated { id: "a".to_owned() }));
        assert_eq!(ask("b", 30), Ok(()));
        assert!(matches!(ask("c", 31), Err(RequestRefusal::NotFresh { .. })));
        assert!(matches!(ask("c", -6), Err(RequestRefusal::NotFresh { .. })), "of the future");
        assert_eq!(ask("c", -4), Ok(()));
        let unsigned = RequestOrigin { id: Some("d".to_owned()), ..RequestOrigin::default() };
        assert_eq!(requests.check_fresh(&unsigned, now_ns), Err(RequestRefusal::WithoutOrigin));
        // Over a restart: what was obeyed before it is older than the new run.
        let mut after = Requests::new("plant", true, None);
        after.began_ns = now_ns + SECOND_NS;
        let later_ns = after.began_ns + SECOND_NS;
        assert_eq!(after.check_fresh(&origin("a", now_ns), later_ns), Err(RequestRefusal::BeforeStart));
        assert_eq!(after.check_fresh(&origin("a", later_ns), later_ns), Ok(()));
        assert!(after.recent_ids.len() == 1 && requests.recent_ids.len() == 3);
    }
}
