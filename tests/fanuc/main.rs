//! FANUC controllers: the adapter against its own server over real sockets, faults on purpose, the commands.

mod ages;
mod bytes;
mod channels;
mod closed_loop;
mod commands;
mod connecting;
mod faults;
mod flapping;
mod handbook;
mod interop;
mod layouts;
#[path = "../support/library.rs"]
mod library;
mod options;
mod paths;
#[path = "../box/process.rs"]
#[allow(dead_code, reason = "the suite of the box uses more of it")]
mod process;
mod pyfanuc;
mod reading;
mod round_trips;
#[path = "../support/served.rs"]
mod served;
mod slow;
mod support;
mod units;
mod vendor;
