//! What the gateway and the ladder of a machine write for each other. A machine's maker builds the rungs; the simulated
//! control of the crate `fanuc_server` has them.
//!
//! Mailbox, five bytes from a configurable byte on (R900 by default; R is cleared when the power comes on):
//!
//! | byte | written by | what |
//! |---|---|---|
//! | +0 | gateway | 0xA5 while the gateway asks for an override, anything else: it does not |
//! | +1 | gateway | wanted override, % |
//! | +2 | gateway | heartbeat: another number at every write |
//! | +3 | ladder | override taken from the gateway, %; 100 when none is |
//! | +4 | ladder | 0 not asked, 1 taken, 2 heartbeat lost, 3 taken within the ladder's own limits |
//!
//! Requests, two bytes from another configurable byte on (R905 by default), and the dial behind them:
//!
//! | byte | written by | what |
//! |---|---|---|
//! | +0 | gateway | bit 0 feed hold, bit 1 stop after this part; on for a few scans, then off again |
//! | +1 | ladder | the same bits, latched when a bit comes on, until the operator acknowledges |
//! | +2 | ladder | the operator's dial, %, before the gateway's override |
//!
//! A further path has the same bytes 20 higher and its own signals: R920 and G1012 for path 2.

use adapter_core::driver::LadderRequest;

/// Value of the first byte of the mailbox while an override is asked for.
pub const ENABLED: u8 = 0xA5;

/// The bit of a request.
#[must_use]
pub fn request_bit(request: LadderRequest) -> u8 {
    match request {
        LadderRequest::FeedHold => 1,
        LadderRequest::Stop => 2,
    }
}
