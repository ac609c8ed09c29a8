//! What this process costs: memory and processor time, from the system's own accounts.

use std::time::Duration;

/// Memory and processor time of this process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Usage {
    /// Resident memory of the process, bytes.
    pub resident_bytes: u64,
    /// User and system time since the start.
    pub cpu_s: f64,
}

/// Reads the accounts; `None` where the system does not keep them (`/proc`).
#[must_use]
pub fn read() -> Option<Usage> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes: u64 =
        status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?.trim().split(' ').next()?.parse().ok()?;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The command in parentheses may hold blanks; user and system time are the 12th and 13th fields after it.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let ticks: u64 = fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?;
    #[expect(clippy::cast_precision_loss, reason = "2^53 ticks are three million years")]
    let cpu_s = ticks as f64 / TICKS_PER_S;
    Some(Usage { resident_bytes: kilobytes * 1024, cpu_s })
}

/// Linux reports processor time to user space in hundredths of a second on every architecture.
const TICKS_PER_S: f64 = 100.0;

/// Processor time of the calling thread so far; `None` where the system does not keep it. Unlike the time on the wall
/// it does not count what other programs take.
#[must_use]
pub fn thread_cpu() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split(' ').next()?.parse().ok().map(Duration::from_nanos)
}

#[cfg(test)]
mod tests {
    #[test]
    fn this_process_costs_something() {
        let usage = super::read().expect("/proc is there");
        assert!(usage.resident_bytes > 100_000 && usage.cpu_s >= 0.0);
    }
}
