//! FANUC controllers: the adapter against its own server over real sockets, faults on purpose, the commands.

mod closed_loop;
mod commands;
mod faults;
mod flapping;
#[path = "../support/library.rs"]
mod library;
mod paths;
#[path = "../box/process.rs"]
#[allow(dead_code, reason = "the suite of the box uses more of it")]
mod process;
mod reading;
mod round_trips;
#[path = "../support/served.rs"]
mod served;
mod slow;
mod support;
mod vendor;
