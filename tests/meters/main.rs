//! Meters over real sockets, real pseudo terminals and against an implementation that is not ours: pymodbus.

mod faults;
mod modbus;
mod partner;
mod serial_faults;
mod served;
