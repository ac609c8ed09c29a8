//! Commissioning as one guided job: what is known of this machine, what is missing, which cut or idle run to make next and why.
//!
//! Recordings come from the box's own history, what only a person can measure from [`annotations`]. What can be identified is
//! identified with the functions behind `identify`, and written where the box reads it: settings as scripts, wear models into the
//! library, the thermal law as a model file. Nothing is remembered but the annotations and what was written: every call looks
//! at the history anew, so the job goes on where it stopped.
//!
//! | file | what |
//! |---|---|
//! | `annotations` | what a person has measured, one line each in `annotations.jsonl` |
//! | `columns` | the history as a recording, with what was annotated as columns |
//! | `torque_file` | the file of a torque sensor |
//! | `learn` | the parts of the job: learned, or why not |
//! | `plan` | the cuts and idle runs to make |
//! | `picture` | the fits as a page |

pub mod annotations;
pub mod columns;
pub mod identification;
pub mod learn;
pub mod picture;
pub mod plan;
pub mod pulses;
mod torque_file;

pub use torque_file::TorqueFileError;
