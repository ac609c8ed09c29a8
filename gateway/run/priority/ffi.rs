//! The two system calls behind [`super`]; glibc has a wrapper for one of them only.
#![allow(unsafe_code, reason = "calls of the kernel")]

use std::io;

/// `struct sched_attr` of the kernel, in its first published size (48 bytes).
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SchedAttr {
    pub(super) size: u32,
    pub(super) policy: u32,
    pub(super) flags: u64,
    pub(super) nice: i32,
    pub(super) priority: u32,
    /// Of an ordinary thread: the slice it asks for, ns.
    pub(super) runtime: u64,
    pub(super) deadline: u64,
    pub(super) period: u64,
}

/// Bytes of [`SchedAttr`], by which the kernel knows its version.
const SIZE: u32 = 48;

/// Sets how the calling thread is scheduled.
pub(super) fn set_attr(attr: SchedAttr) -> io::Result<()> {
    const {
        assert!(
            size_of::<SchedAttr>() == SIZE as usize,
            "the kernel tells versions of the structure apart by its size"
        );
    }
    let attr = SchedAttr { size: SIZE, ..attr };
    // SAFETY: thread 0 is the calling one; `attr` outlives the call, and the kernel reads no more than its `size`.
    let answer = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attr, 0) };
    if answer == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Timers of the calling thread fire at most so much later than asked for, ns.
pub(super) fn set_timer_slack(ns: u64) -> io::Result<()> {
    // SAFETY: this call takes a number and touches no memory.
    let answer = unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, ns, 0, 0, 0) };
    if answer == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}
