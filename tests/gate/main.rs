//! The gate: what is decided, what reaches the machine, what stands in the audit, and what happens when the gateway dies.

mod audit;
mod cut;
mod day;
mod decisions;
mod idle;
mod killed;
mod late;
mod latency;
mod offsets;
mod outputs;
#[path = "../support/port.rs"]
mod port;
#[path = "../box/process.rs"]
#[allow(dead_code, reason = "the suite of the box uses more of it")]
mod process;
mod running;
#[path = "../support/sealed.rs"]
mod sealed;
#[path = "../support/served.rs"]
#[allow(dead_code, reason = "the suite of FANUC uses more of it")]
mod served;
mod shifting;
mod unread;
