//! The loops closed on the simulated machine: sample, estimates, script, gate, ladder, machine, and what comes of it. What is
//! true is asked of the machine, never of the gateway.

mod bench;
mod constant_load;
mod faults;
mod healthy;
mod recipe;
mod steps;
mod stops;
mod thermal;
mod wear;
mod wear_shift;
mod work_done;
