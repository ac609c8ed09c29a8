//! From the configuration to samples at their pace, and what an address answers before it is configured.

pub mod doctor;
pub mod open;
pub mod origin_log;
pub mod pace;
pub mod sample_feed;
mod stand_in;
pub mod waveform;
