//! The view of the simulation beside the machine holds together: what the page shows adds up at every tick, and what the watch
//! finds is what the diagnosis of the same window says.

#[path = "../access/client.rs"]
#[expect(dead_code, reason = "the tests of the access use the rest of it")]
mod client;
#[path = "../box/process.rs"]
#[expect(dead_code, reason = "the tests of the box use the rest of it")]
mod process;

mod machine;
mod one_opinion;
mod sums;
