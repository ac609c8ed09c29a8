//! FANUC controllers: the adapter against its own server over real sockets, faults on purpose, the commands.

mod faults;
mod reading;
mod support;
