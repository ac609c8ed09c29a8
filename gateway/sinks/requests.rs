//! Requests to the gate that come over a sink's connection: who may ask, how often, and what is answered.
//!
//! A sink hands every message that looks like a request to [`Requests::submit_change`], whether it is allowed or not: the tick writes
//! all of them into the audit, carries out what is allowed, and says what became of it.

use gateway_base::clock;
use gateway_base::row_rate::RowRate;
use gateway_control::{NetworkRequest, OrderSender, Reply, RequestRefusal, RequestedChange};

/// Requests per second on average, and at once. A plant's system asks a few times an hour and repeats once in half a minute;
/// whoever sends more fills the audit and holds up data: each waits for the tick, at most a tenth of a second. What is beyond is
/// thrown away unanswered, and counted.
const PER_S: f64 = 1.0;
const AT_ONCE: f64 = 10.0;

/// The way of one sink to the gate.
#[derive(Debug)]
pub struct Requests {
    sink: String,
    allowed: bool,
    orders: Option<OrderSender>,
    rate: RowRate,
}

impl Requests {
    /// Of the sink of this name; `allowed` is what its configuration says.
    #[must_use]
    pub fn new(sink: &str, allowed: bool, orders: Option<OrderSender>) -> Self {
        Self { sink: sink.to_owned(), allowed, orders, rate: RowRate::new(PER_S, AT_ONCE) }
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
    pub async fn submit_change(&mut self, change: Result<RequestedChange, RequestRefusal>) -> Option<Reply> {
        let left_out = self.rate.may_pass(clock::now_ns())?;
        let Some(post) = &self.orders else { return Some(Reply::from_refusal("there is no gate here")) };
        let change = if self.allowed { change } else { Err(refuse_change(&self.sink, change)) };
        Some(post.send_request(NetworkRequest { sink: self.sink.clone(), change, left_out }).await)
    }
}

fn refuse_change(sink: &str, change: Result<RequestedChange, RequestRefusal>) -> RequestRefusal {
    let what = change.map_or_else(|_| "a message that is no request".to_owned(), |change| change.to_string());
    RequestRefusal::ClosedSink { sink: sink.to_owned(), what }
}
