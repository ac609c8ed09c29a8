//! Waveforms on their way to the tick: filter and feature make a channel of a stream, raw samples stay around what is
//! remarkable.
//!
//! | file | what |
//! |---|---|
//! | `chain` | filter and feature of one stream |
//! | `features` | blocks in, one value per poll out, whoever sends the blocks |
//! | `keep` | raw samples around what is remarkable |
//! | `control_sampling` | a controller's own sampling (NC-Link, HNC) as such a sender |
//!
//! The receiver (`adapters::waveform`) knows nothing of features and the estimator (`rules::estimators::spindle_current`)
//! nothing of sockets; here they meet, on the source's own thread. Each poll takes every block that has arrived and gives
//! one `spindle_current_a`: the root mean square over whole periods, mean of the phases, stamped in the middle of the
//! periods it comes from with half their length as its half-width. Where samples are missing, filter and feature begin
//! anew; a poll with clipped samples has no value, because its value would be too low.

mod chain;
mod control_sampling;
mod excerpt_writer;
mod features;

pub use control_sampling::ControllerSamples;

use adapters::address::{Address, Endpoint, Target, WaveformKeep};
use adapters::clock::Clock;
use adapters::driver::Fact;
use adapters::open::{OpenError, Opened, Refused};
use adapters::waveform::Receiver;
use adapters::{ChannelId, Reading, Source, SourceError};
use features::Features;
use std::time::Duration;

/// One value per poll.
const PERIOD: Duration = Duration::from_millis(100);
/// A poll that is behind takes at most so many blocks to catch up.
const BLOCKS_MAX: usize = 512;

/// An address whose samples become a channel only here: a stream, or a controller whose own sampling is wanted. `None` for
/// every other address.
#[must_use]
pub fn open_source(address: &Address) -> Option<Result<Opened, OpenError>> {
    let Target::Waveform { at, keep } = address.target() else { return control_sampling::open_sampled_source(address) };
    let source: Box<dyn Source> = Box::new(SpindleCurrent::new(address.text(), at, keep.as_ref()));
    Some(Ok(Opened {
        sources: vec![source],
        actuator: None,
        offsets: None,
        simulated: None,
        refused: Refused::default(),
    }))
}

/// A stream of spindle current as a source.
pub struct SpindleCurrent {
    name: String,
    receiver: Receiver,
    features: Features,
}

impl SpindleCurrent {
    /// The stream at this address; it is connected to at the first poll. `keep` says whether raw samples stay around high
    /// currents.
    #[must_use]
    pub fn new(name: &str, at: &Endpoint, keep: Option<&WaveformKeep>) -> Self {
        Self { name: name.to_owned(), receiver: Receiver::new(name, at), features: Features::new(keep) }
    }

    /// Takes what has arrived; stops with the block that reaches the beginning of this poll.
    fn receive_blocks(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        let began_ns = clock.now_ns();
        for _ in 0..BLOCKS_MAX {
            let block = self.receiver.read(clock)?;
            let Some(header) = self.receiver.intake().header().cloned() else { break };
            let instants = block.raw.len() / header.channels.len();
            let length_ns = header.duration_ns(instants as f64);
            let end_ns = block.first_ns + length_ns;
            self.features.feed_block(&self.name, &header, &block)?;
            if end_ns + length_ns >= began_ns {
                break;
            }
        }
        Ok(())
    }
}

impl Source for SpindleCurrent {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        self.features.channels()
    }

    fn period(&self) -> Duration {
        PERIOD
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        self.receive_blocks(clock).inspect_err(|_| self.features.reset_stream())?;
        out.extend(self.features.take_reading());
        Ok(())
    }

    fn collect_facts(&self) -> Vec<Fact> {
        self.features.list_facts(self.receiver.intake())
    }
}
