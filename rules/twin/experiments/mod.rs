//! The canned experiments: what is commanded to tell one effect from those it is confused with.

pub mod moves;
