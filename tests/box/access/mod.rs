//! What stands around every route of the page: who may ask, how slowly, how much, from where; persons, tokens, sessions; and
//! what a crowd of bad clients does to the rest of the box.

pub(crate) mod client;
mod crowd;
mod described;
mod far;
mod signed_in;
mod walk;
