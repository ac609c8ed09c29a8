//! The box: what a user reads, who may ask, what scripts decide, what reaches the machine, and the whole of it as a process.

mod access;
mod check;
mod gate;
mod live_twin;
mod loops;
mod messages;
mod scripts;
#[path = "../records/sealed.rs"]
mod sealed;
mod whole;
