//! What stands around every route of the page: who may ask, how slowly, how much, from where; persons, tokens, sessions; and
//! what a crowd of bad clients does to the rest of the box.

mod client;
mod crowd;
mod described;
mod far;
#[path = "../box/process.rs"]
#[allow(dead_code, reason = "the suite of the box uses more of it")]
mod process;
mod signed_in;
mod walk;
