//! FANUC controllers: the adapter against its own server over real sockets, faults on purpose, the commands.

mod commands;
mod faults;
mod flapping;
mod reading;
mod round_trips;
mod support;
mod vendor;
