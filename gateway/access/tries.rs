//! Wrong tokens are counted, and whoever gives too many has to wait.
//!
//! Five wrong tokens for one name from one address, and this address has to wait before it may try that name again; twenty
//! for any names, and it has to wait before it may try at all. The name itself is never locked for everybody: otherwise
//! anybody on the network could keep a person from signing in. A token has 100 random bits, so the wait is not what keeps
//! guessers away; it bounds what they cost in processor time and in rows of the audit.

use std::collections::HashMap;
use std::net::IpAddr;
use std::time::{Duration, Instant};

/// Wrong tokens for one name from one address.
pub const TRIES_MAX: u32 = 5;
/// Wrong tokens for any names from one address.
const TRIES_OF_ADDRESS_MAX: u32 = 20;
/// The wait, and the time after which wrong ones are forgotten.
pub const LOCKED_FOR: Duration = Duration::from_secs(15 * 60);
/// Pairs of address and name that are remembered; beyond that the one that was seen longest ago is forgotten.
const REMEMBERED_MAX: usize = 4096;

#[derive(Debug, Clone, Copy)]
struct Count {
    wrong: u32,
    last: Instant,
}

/// What has been tried so far.
#[derive(Debug, Default)]
pub(super) struct Tries {
    counts: HashMap<(IpAddr, Option<String>), Count>,
}

impl Tries {
    /// How long this address has to wait before it may try this name.
    #[must_use]
    pub(super) fn remaining_wait(&self, from: IpAddr, name: &str, now: Instant) -> Option<Duration> {
        let of_name = self.wait_of(&(from, Some(name.to_owned())), TRIES_MAX, now);
        let of_address = self.wait_of(&(from, None), TRIES_OF_ADDRESS_MAX, now);
        of_name.max(of_address)
    }

    fn wait_of(&self, key: &(IpAddr, Option<String>), most: u32, now: Instant) -> Option<Duration> {
        let count = self.counts.get(key).filter(|count| count.wrong >= most)?;
        (count.last + LOCKED_FOR).checked_duration_since(now).filter(|left| !left.is_zero())
    }

    /// A wrong token was given; gives how many are left before the wait.
    pub(super) fn record_failure(&mut self, from: IpAddr, name: &str, now: Instant) -> u32 {
        let (own, all) =
            (self.count_failure((from, Some(name.to_owned())), now), self.count_failure((from, None), now));
        TRIES_MAX.saturating_sub(own).min(TRIES_OF_ADDRESS_MAX.saturating_sub(all))
    }

    /// The right token was given: what was wrong before is forgotten.
    pub(super) fn clear_failures(&mut self, from: IpAddr, name: &str) {
        self.counts.remove(&(from, Some(name.to_owned())));
        self.counts.remove(&(from, None));
    }

    fn count_failure(&mut self, key: (IpAddr, Option<String>), now: Instant) -> u32 {
        if self.counts.len() >= REMEMBERED_MAX && !self.counts.contains_key(&key) {
            let oldest = self.counts.iter().min_by_key(|(_, count)| count.last).map(|(key, _)| key.clone());
            oldest.map(|oldest| self.counts.remove(&oldest));
        }
        let count = self.counts.entry(key).or_insert(Count { wrong: 0, last: now });
        if now.saturating_duration_since(count.last) >= LOCKED_FOR {
            count.wrong = 0;
        }
        (count.wrong, count.last) = (count.wrong.saturating_add(1), now);
        count.wrong
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    const HERE: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 168, 1, 7));
    const THERE: IpAddr = IpAddr::V4(Ipv4Addr::new(192, 168, 1, 8));

    #[test]
    fn the_fifth_wrong_token_makes_the_address_wait_and_nobody_else() {
        let (mut tries, now) = (Tries::default(), Instant::now());
        let left: Vec<u32> = (0..5).map(|_| tries.record_failure(HERE, "Li", now)).collect();
        assert_eq!(left, [4, 3, 2, 1, 0]);
        assert_eq!(tries.remaining_wait(HERE, "Li", now), Some(LOCKED_FOR));
        assert_eq!(tries.remaining_wait(THERE, "Li", now), None, "Li can sign in from elsewhere");
        assert_eq!(tries.remaining_wait(HERE, "Wang", now), None);
        assert_eq!(tries.remaining_wait(HERE, "Li", now + LOCKED_FOR), None, "over");
        assert_eq!(tries.record_failure(HERE, "Li", now + LOCKED_FOR), 4, "and forgotten");
    }

    #[test]
    fn names_that_change_do_not_help_and_a_right_token_ends_it() {
        let (mut tries, now) = (Tries::default(), Instant::now());
        for n in 0..20 {
            tries.record_failure(HERE, &format!("p{n}"), now);
        }
        assert!(tries.remaining_wait(HERE, "anybody", now).is_some());
        tries.clear_failures(HERE, "p1");
        assert_eq!(tries.remaining_wait(HERE, "anybody", now), None);
        for n in 0..10_000 {
            tries.record_failure(HERE, &format!("q{n}"), now + Duration::from_secs(1));
        }
        assert!(tries.counts.len() <= REMEMBERED_MAX);
    }
}
