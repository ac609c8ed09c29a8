//! The vendor's library, in a child process.
//!
//! The library aborts when its log cannot be written, hangs on a silent line, writes far beyond its structures when an
//! answer is malformed, leaves garbage behind on errors, and binds its handle to a thread. So it is loaded only in a
//! [child process](device_line::child) whose one thread owns the handle. All questions of a poll are one request to the child,
//! which answers each as soon as it has it: when it dies or hangs, the one it was at is told as failed, a fresh child goes
//! on with the next one of the same poll, and a question that has killed the child twice is left alone until the next
//! connection.
//!
//! A call to the library is a round trip to the controller. The call for the positions of every axis
//! (`cnc_rddynamic2`) asks in its one frame for feed, spindle speed, program numbers and sequence too, so they are taken
//! from it where it was made; what the control has refused for good is not asked again. Several paths: the library is
//! told the path before the first question of each, which sends nothing.
//!
//! | file | what |
//! |---|---|
//! | `message` | what parent and child say |
//! | `client` | the parent's side: [`Focas`](super::focas::Focas) through the child |
//! | `child` | the child's side: the connection of the library |
//! | `calls`, `texts` | items as calls, structures as answers |
//! | `dynamic` | the call for the positions, and what it answers besides |
//! | `layout` | the structures as the library lays them out, with their sizes asserted |
//! | `structure` | a structure that was filled in, read field by field |
//! | `ffi` | loading, symbols and calls: the only `unsafe` |
//!
//! A symbol that the library does not have makes its items *not offered*; nothing else suffers. Layouts were measured
//! against version 1.0.5 for Linux, in which `long` has 32 bits whatever the header says.

mod calls;
mod child;
mod client;
mod dynamic;
mod ffi;
mod layout;
mod message;
mod structure;
mod texts;

pub use child::serve_parent;
pub use client::{Vendor, VendorSettings};

/// What the hidden subcommand calls this child.
pub const KIND: &str = "fanuc";
