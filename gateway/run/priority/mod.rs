//! How promptly the threads between a sample and a write are woken: the tick, and the worker that writes.
//!
//! What a loaded box adds to the latency is the time that a thread which has been woken waits for a processor. A thread of
//! real-time priority does not wait: it is asked for, and granted where the process may (root, `CAP_SYS_NICE`, or
//! `LimitRTPRIO=40` in the unit). Both threads do a bounded amount of work per tick, scripts are stopped after 50 ms, and
//! the kernel leaves 5 % of every second to others in any case. Where it is refused, a short slice is asked for, which
//! needs no permission (Linux 6.12): a thread that wants little is woken sooner, at the cost of nothing but more switches.

#[cfg(target_os = "linux")]
mod ffi;

use gateway_base::log::{Notice, Severity};
use std::fmt;

/// Below the kernel's own threads (50) and above everything ordinary.
const PRIORITY: u32 = 40;
/// The shortest slice that the kernel takes, ns.
const SLICE_NS: u64 = 100_000;

/// How polite the threads of the page are: about a third of the share of an ordinary thread when both want a processor.
#[cfg(target_os = "linux")]
const NICE_OF_PAGE: i32 = 5;

/// What was granted to a thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Granted {
    /// Tick and writing go before every ordinary thread.
    RealTime,
    /// A short slice among ordinary threads.
    ShortSlice,
    /// The priority of any other thread.
    Nothing,
}

impl fmt::Display for Granted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RealTime => "tick and writing have real-time priority",
            Self::ShortSlice => {
                "tick and writing have no real-time priority (LimitRTPRIO=40 in the unit would grant it); they ask for short \
                 slices instead"
            }
            Self::Nothing => "tick and writing have the priority of any other thread",
        })
    }
}

impl Granted {
    /// Writes one notice of severity `info` to both logs.
    pub fn tell_operator(self) {
        Notice::new(Severity::Info, "priority", self.to_string()).write_to_logs();
    }
}

/// Asks for the calling thread; what it starts afterwards inherits nothing of it.
#[cfg(target_os = "linux")]
#[must_use]
pub fn request_priority() -> Granted {
    use ffi::{SchedAttr, set_attr, set_timer_slack};
    const FIFO: u32 = 1;
    const RESET_ON_FORK: u64 = 1;
    // A refusal leaves 50 us.
    let _slack = set_timer_slack(1_000);
    let real_time = SchedAttr { policy: FIFO, flags: RESET_ON_FORK, priority: PRIORITY, ..SchedAttr::default() };
    if set_attr(real_time).is_ok() {
        return Granted::RealTime;
    }
    // Whoever started the gateway more politely meant it.
    let nice = rustix::process::nice(0).unwrap_or(0);
    match set_attr(SchedAttr { nice, runtime: SLICE_NS, ..SchedAttr::default() }) {
        Ok(()) => Granted::ShortSlice,
        Err(_) => Granted::Nothing,
    }
}

/// Elsewhere nothing is asked for.
#[cfg(not(target_os = "linux"))]
#[must_use]
pub fn request_priority() -> Granted {
    Granted::Nothing
}

/// The calling thread lets others go first: it serves the page, and whatever clients do, the tick comes before it.
pub fn give_way() {
    // Linux takes "this process" as the calling thread. Where it is refused, the thread has the priority of any other.
    #[cfg(target_os = "linux")]
    let _as_it_is = rustix::process::setpriority_process(None, NICE_OF_PAGE);
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn whatever_is_granted_the_thread_goes_on() {
        let granted = std::thread::spawn(|| (request_priority(), 1 + 1)).join().expect("no panic");
        println!("{}", granted.0);
        assert_eq!(granted.1, 2);
    }
}
