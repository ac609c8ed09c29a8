//! From the configuration to samples at their pace, and what an address answers before it is configured.

pub mod doctor;
pub mod open;
pub mod pace;
pub mod sample_feed;
pub mod waveform;
