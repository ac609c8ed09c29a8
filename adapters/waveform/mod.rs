//! Waveforms: currents (or anything else) at 1 kHz and more, as one framed stream.
//!
//! The stream, over TCP, from the one who samples to the one who listens:
//!
//! 1. One line of JSON, ended by a line feed, at most 4096 bytes:
//!    `{"format":"waveform/1","rate_hz":1000,"channels":["i_u","i_v","i_w"],"unit":"A","scale":[0.01,0.01,0.01],"full_scale":32767}`.
//!    A sample is 16 bits with sign; times `scale` it is in `unit`. A sample whose size is `full_scale` or more was clipped.
//! 2. Frames, little-endian: `57 31` (the letters W1), `sequence u32`, `first_ns u64` (time of the first sample on the
//!    sampler's clock, nanoseconds since 1970), `count u16` (samples per channel, 1 to 4096), then the samples, all channels
//!    of one instant together.
//!
//! The sequence counts frames and wraps. A number left out is a gap, told with its length in samples from the times;
//! nothing is interpolated over it, and whatever follows (a filter, a feature) begins anew. The sampler's clock is mapped
//! to the gateway's by the lower envelope of arrival minus time of the last sample: a packet can be late, never early.
//!
//! | file | what |
//! |---|---|
//! | `frame` | the stream, both directions |
//! | `receiver` | a connection to a stream with its deadline |
//! | `control_sampler` | a controller's own sampling (NC-Link, HNC) as the same blocks |
//! | `intake` | what every stream goes through: gaps, clipping, clock, counts |
//! | `timebase` | the sampler's clock on the gateway's |
//! | `producer` | the other side: serves blocks from anything that samples |
//! | `iio` | a Linux IIO device as a sampler |
//! | `file_sampler` | a file of samples as a sampler |
//! | `machine_sampler` | the built-in machine's spindle current as a sampler |
//!
//! Limits: 8 channels, 4096 samples per frame, 1 MHz; 4 listeners.

mod control_sampler;
mod file_sampler;
mod frame;
mod iio;
mod intake;
mod machine_sampler;
mod producer;
mod receiver;
mod timebase;

pub use control_sampler::SampledCurrent;
pub use file_sampler::Recorded;
pub use frame::{AMPLITUDE, FrameError, WaveformFrame, WaveformHeader};
pub use iio::Iio;
pub use intake::{Block, Counts, Intake};
pub use machine_sampler::SimulatedCurrent;
pub use producer::{Producer, Sampler};
pub use receiver::Receiver;
pub use timebase::TimeBase;
