//! How many rows of the audit there may be.

use adapter_core::clock::{SECOND_NS, TimeNs};

/// Rows of requests per second on average; twenty times as many may come at once.
const ROWS_PER_S: f64 = 10.0;
const ROWS_AT_ONCE: f64 = 200.0;

/// How many rows of requests there may be.
#[derive(Debug)]
pub struct RowRate {
    per_s: f64,
    at_once: f64,
    tokens: f64,
    at_ns: TimeNs,
    left_out: u64,
}

impl Default for RowRate {
    fn default() -> Self {
        Self::new(ROWS_PER_S, ROWS_AT_ONCE)
    }
}

impl RowRate {
    /// So many per second on average, and at most so many at once.
    pub fn new(per_s: f64, at_once: f64) -> Self {
        Self { per_s, at_once, tokens: at_once, at_ns: 0, left_out: 0 }
    }

    /// May there be one now? Then how many before it were left out.
    pub fn may_pass(&mut self, at_ns: TimeNs) -> Option<u64> {
        let elapsed_s = at_ns.saturating_sub(self.at_ns).max(0) as f64 / SECOND_NS as f64;
        self.at_ns = at_ns;
        self.tokens = (self.tokens + elapsed_s * self.per_s).min(self.at_once);
        if self.tokens < 1.0 {
            self.left_out += 1;
            return None;
        }
        self.tokens -= 1.0;
        debug_assert!((0.0..self.at_once.max(1.0)).contains(&self.tokens), "no more rows at once than allowed");
        Some(std::mem::take(&mut self.left_out))
    }

    /// The same; the text says how many before it were left out.
    pub fn may_tell(&mut self, at_ns: TimeNs) -> Option<String> {
        let left_out = self.may_pass(at_ns)?;
        Some(if left_out > 0 { format!("; {left_out} requests before it were left out") } else { String::new() })
    }
}
