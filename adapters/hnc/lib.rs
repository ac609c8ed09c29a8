//! Huazhong HNC-8 through the flat C interface of its vendor's library (HncNetDll, V1), in a child process.
//!
//! ```text
//!   HncSource, HncActuator ── Line ──► child process ──► the vendor's library ──► controller, port 10001
//!                                        └ also listens itself, local port 10001: the controller dials back
//! ```
//!
//! | file | what |
//! |---|---|
//! | `item` | what can be asked: the numbers of the vendor's headers with the width of each value |
//! | `answer` | values, and why there is none |
//! | `decode` | values to units, words and GBK text |
//! | `message` | what parent and child say |
//! | `child` | the child's side: one session, items to calls |
//! | `ffi` | loading, symbols and calls: the only `unsafe` |
//! | `line` | the parent's side: the child, its deaths, the state of the connection |
//! | `source` | the [`Source`](adapter_core::Source) |
//! | `actuator` | the [`Actuator`](adapter_core::Actuator): the register mailbox of [`nclink::mailbox`] |
//! | `offsets` | shifts of axes: registers of the ladder, or the external zero offset |
//! | `sampling` | the 1 ms sampling channels: which, and whether a millisecond is missing; blocks go to whoever asked for them |
//!
//! **What the library does**, and what follows (measured logs and headers of the vendor's SDK, "V1"):
//! - `HNC_NetInit` opens a local TCP and UDP listener; it is called once per child. A second process on the same port
//!   fails with 1009, which is told as such.
//! - A call on a dead link blocks 3 s: after one such call the poll ends as a timeout, it does not wait for the others.
//! - It reconnects by itself and posts an event for it; while `HNC_NetIsConnect` is not 0 the line has failed.
//! - Registers and variables return 1 for "not there yet": that is a reason, and never the zero that stands in the buffer.
//! - On any code but 0 nothing of the buffer is looked at. Every buffer has a margin that shows an overrun.
//! - Texts are GBK.
//! - Its threads are not documented: one thread of one child makes every call.
//!
//! **Certain and not.** The functions, numbers and widths are those of the V1 headers. `Bit32` is `long` there: four bytes
//! on Windows, eight on 64-bit Linux; arguments, results and single values are right either way, arrays are read with
//! `long_bytes` of the address. No public build for Linux exists; here the driver is proven against a library with the
//! same functions that the tests compile and really load. To be checked on a machine: the unit of the load current (taken
//! as A) and of the axis speed (taken as mm/min); that the external zero offset is in counts of the positions (its count has
//! to be said in the address), is taken up with the next program, and is forgotten without power while nobody saves it; and
//! whether reading samples takes them away (the controller's own counter of milliseconds shows it either way).

mod actuator;
pub mod address;
pub mod answer;
mod child;
mod decode;
mod ffi;
pub mod item;
pub mod line;
mod message;
mod offsets;
mod open;
mod own_value;
pub mod sampling;
mod source;

pub use actuator::HncActuator;
pub use child::serve_parent;
pub use open::{build_offset_sink, open_address, open_sampled};
pub use own_value::OwnValue;
pub use source::{HncSource, list_channels as delivered};

/// What the hidden subcommand calls this child.
pub const KIND: &str = "hnc";
