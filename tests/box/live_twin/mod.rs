//! The view of the simulation beside the machine holds together: what the page shows adds up at every tick, and what the watch
//! finds is what the diagnosis of the same window says.

mod machine;
mod one_opinion;
mod sums;
