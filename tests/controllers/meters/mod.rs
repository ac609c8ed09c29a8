//! Meters over real sockets, real pseudo terminals and against an implementation that is not ours: pymodbus.

mod alignment;
mod eda9033a;
mod faults;
mod joint;
mod modbus;
mod partner;
mod serial_faults;
mod served;
mod shop;
mod waveforms;
