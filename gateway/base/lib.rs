//! What every part of the box needs: its clock, its messages, its files.

pub mod cannot_run;
pub mod clock;
pub mod convert;
pub mod limits;
pub mod log;
pub mod machine_path;
pub mod moment;
pub mod problem;
pub mod state_file;
pub mod usage;

pub use gateway_files::{files, owner};
