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
mod running;
mod shifting;
mod threads;
mod unread;
