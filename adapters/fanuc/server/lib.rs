//! The other side of the wire: a controller that answers FOCAS2/Ethernet, for integrators without a machine, for other
//! people's clients and for the tests.
//!
//! | file | what |
//! |---|---|
//! | `controller` | what a control holds, as plain values |
//! | `memory` | PMC memory |
//! | `answer` | one question to one answer, in the encoding of the generation |
//! | `axes`, `program`, `message`, `tool` | what it shows of them |
//! | `encode` | values as bytes |
//! | `write` | what a question writes |
//! | `listen` | connections, sessions, frames |
//! | `fault` | faults on purpose |
//! | `ladder` | the ladder of the sample machine: who decides about the feed override |
//! | `machine` | the simulated machine behind a control |
//! | `screen` | what its control shows besides motion and states |
//! | `second_path` | what its second turret shows |

mod answer;
mod answer_form;
mod axes;
mod controller;
mod encode;
mod fault;
pub mod ladder;
mod listen;
mod machine;
mod memory;
mod message;
mod panel_status;
mod program;
mod screen;
mod second_path;
mod tool;
mod write;

pub use answer::answer_body;
pub use controller::{Controller, ControllerAxis, Data, ProgramFile, SpindleState, ToolGroup};
pub use fault::InjectedFault;
pub use listen::{ServedControl, Server, ServerSettings};
pub use machine::SimulatedControl;
pub use memory::Memory;

#[cfg(test)]
mod captures;
#[cfg(test)]
mod tests;
