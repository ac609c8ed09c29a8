//! Ports for servers that are told theirs and bind it later: brokers, programs, children.

use std::net::TcpListener;
use std::sync::atomic::{AtomicU16, Ordering};

/// The first port and how many are taken from: below every system's ports for outgoing connections (Linux from 32768,
/// RFC 6335 section 6 from 49152), which would otherwise take one between its choice and its use.
const FIRST: u16 = 21_000;
const COUNT: u16 = 11_000;

/// How many have been given out.
static GIVEN: AtomicU16 = AtomicU16::new(0);

/// A port at which nothing listens, given out once only by this program: two tests at a time never get the same.
pub fn free_port() -> u16 {
    // Programs that run at a time begin at different places.
    let begin = std::process::id().wrapping_mul(97) % u32::from(COUNT);
    for _ in 0..COUNT {
        let step = u32::from(GIVEN.fetch_add(1, Ordering::SeqCst));
        let offset = u16::try_from((begin + step) % u32::from(COUNT)).expect("below the count");
        if TcpListener::bind(("127.0.0.1", FIRST + offset)).is_ok() {
            return FIRST + offset;
        }
    }
    panic!("all {COUNT} ports from {FIRST} on are taken");
}
