//! Limits that a child process sets itself before it reads what a stranger or a person has written.

use rustix::process::{Resource, Rlimit, setrlimit};
use std::time::Duration;

/// Memory that a child allocates at most, bytes. The program itself and its stack come on top, together less than the 512 MB that are told.
const MEMORY_MAX: u64 = 448 << 20;
/// Memory that is told to a user, MB.
pub const MEMORY_TOLD_MB: u64 = 512;
/// Time of the processor that a child has for every [`BYTES_OF_LIMIT`] that are begun of what it reads, s. As much of a recording takes less
/// than two.
const PROCESSOR_S: u64 = 20;
const BYTES_OF_LIMIT: u64 = 32 << 20;
/// The same on the wall, however busy the box is.
const WALL_S: u64 = 50;

/// How long a child may take that reads a file of so many bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeLimits {
    /// Of the processor, s.
    pub processor_s: u64,
    wall: Duration,
}

impl TimeLimits {
    /// The longer the file, the longer.
    #[must_use]
    pub fn from_bytes(bytes: u64) -> Self {
        let parts = bytes.div_ceil(BYTES_OF_LIMIT).max(1);
        Self { processor_s: PROCESSOR_S * parts, wall: Duration::from_secs(WALL_S * parts) }
    }
}

fn limit(most: u64) -> Rlimit {
    Rlimit { current: Some(most), maximum: Some(most) }
}

/// This process may take so much memory from now on, and not more; it leaves no image of it behind when it breaks off.
pub fn limit_memory() {
    // Where the system refuses a limit, the others hold.
    let _refused = setrlimit(Resource::Data, limit(MEMORY_MAX));
    let _refused = setrlimit(Resource::Core, limit(0));
}

/// The same, and it ends when it has taken more time than this.
///
/// # Errors
/// No thread could be started that watches the time.
pub fn limit_memory_and_time(limits: TimeLimits) -> std::io::Result<()> {
    limit_memory();
    let _refused = setrlimit(Resource::Cpu, limit(limits.processor_s));
    let watch = move || {
        std::thread::sleep(limits.wall);
        std::process::exit(3);
    };
    std::thread::Builder::new().name("limit".to_owned()).spawn(watch).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_file_has_as_much_more_time_as_it_is_longer() {
        let seconds = |bytes: u64| TimeLimits::from_bytes(bytes).processor_s;
        assert_eq!((seconds(0), seconds(32 << 20), seconds((32 << 20) + 1), seconds(200 << 20)), (20, 20, 40, 140));
    }
}
