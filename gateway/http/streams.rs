//! Who listens to streams: not too many in all, and none of one client alone.

use super::problem::ApiProblem;
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};

/// Streams of all addresses at once.
pub(super) const STREAMS_MAX: usize = 32;
/// Streams of one address at once: some tabs of some persons behind it.
pub(super) const STREAMS_OF_ONE_MAX: usize = 8;

/// How many each address has.
#[derive(Debug, Clone, Default)]
pub(super) struct Streams(Arc<Mutex<HashMap<IpAddr, usize>>>);

/// One of them; it is given back when this goes.
#[derive(Debug)]
pub(super) struct OpenStream {
    streams: Streams,
    from: IpAddr,
}

impl Streams {
    /// Another one for this address.
    ///
    /// # Errors
    /// There are too many.
    pub(super) fn open_stream(&self, from: IpAddr) -> Result<OpenStream, ApiProblem> {
        let mut counts = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let own = counts.get(&from).copied().unwrap_or(0);
        let refuse =
            |title: String| Err(ApiProblem::unavailable(title, "close a page, or read /api/v1/status instead"));
        if own >= STREAMS_OF_ONE_MAX {
            return refuse(format!("{STREAMS_OF_ONE_MAX} pages listen from {from} already"));
        }
        if counts.values().sum::<usize>() >= STREAMS_MAX {
            return refuse(format!("{STREAMS_MAX} clients listen already"));
        }
        counts.insert(from, own + 1);
        Ok(OpenStream { streams: self.clone(), from })
    }
}

impl Drop for OpenStream {
    fn drop(&mut self) {
        let mut counts = self.streams.0.lock().unwrap_or_else(PoisonError::into_inner);
        match counts.get_mut(&self.from) {
            Some(count) if *count > 1 => *count -= 1,
            _ => drop(counts.remove(&self.from)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_takes_all_and_what_is_closed_is_free_again() {
        let streams = Streams::default();
        let address = |n: u8| IpAddr::from([10, 0, 0, n]);
        let of_one: Vec<_> = (0..40).filter_map(|_| streams.open_stream(address(1)).ok()).collect();
        assert_eq!(of_one.len(), STREAMS_OF_ONE_MAX);
        let others: Vec<_> = (0..40).filter_map(|n| streams.open_stream(address(2 + n)).ok()).collect();
        assert_eq!(of_one.len() + others.len(), STREAMS_MAX);
        drop((of_one, others));
        assert!(streams.open_stream(address(1)).is_ok() && streams.0.lock().expect("free").is_empty());
    }
}
