//! Limits that a child process sets itself before it reads what a stranger or a person has written.

use rustix::process::{Resource, Rlimit, setrlimit};
use std::time::Duration;

/// Memory that a child allocates at most, bytes. The program itself and its stack come on top, together less than the 512 MB that are told.
const MEMORY_MAX: u64 = 448 << 20;
/// Memory that is told to a user, MB.
pub const MEMORY_TOLD_MB: u64 = 512;
/// Time of the processor that reading may take, s. A recording of 32 MB takes less than two.
pub const PROCESSOR_S: u64 = 20;

/// Time on the wall that a child has, however busy the box is.
pub const WALL_MAX: Duration = Duration::from_secs(50);

fn limit(most: u64) -> Rlimit {
    Rlimit { current: Some(most), maximum: Some(most) }
}

/// This process may take so much memory from now on, and not more; it leaves no image of it behind when it breaks off.
pub fn limit_memory() {
    // Where the system refuses a limit, the others hold.
    let _refused = setrlimit(Resource::Data, limit(MEMORY_MAX));
    let _refused = setrlimit(Resource::Core, limit(0));
}

/// The same, and it ends when it has had [`PROCESSOR_S`] of the processor, or [`WALL_MAX`] has passed.
///
/// # Errors
/// No thread could be started that watches the time.
pub fn limit_memory_and_time() -> std::io::Result<()> {
    limit_memory();
    let _refused = setrlimit(Resource::Cpu, limit(PROCESSOR_S));
    let watch = || {
        std::thread::sleep(WALL_MAX);
        std::process::exit(3);
    };
    std::thread::Builder::new().name("limit".to_owned()).spawn(watch).map(drop)
}
