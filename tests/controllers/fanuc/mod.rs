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
mod options;
mod paths;
mod pyfanuc;
mod reading;
mod round_trips;
mod slow;
mod support;
mod units;
mod vendor;
