//! Waveforms on their way to the tick: filter and feature make a channel of a stream, raw samples stay around what is
//! remarkable.
//!
//! The receiver (`adapters::waveform`) knows nothing of features and the estimator (`rules::estimators::spindle_current`)
//! nothing of sockets; here they meet, on the source's own thread. Each poll takes every block that has arrived and gives
//! one `spindle_current_a`: the root mean square over whole periods, mean of the phases, stamped in the middle of the
//! periods it comes from with half their length as its half-width. Where samples are missing, filter and feature begin
//! anew; a poll with clipped samples has no value, because its value would be too low.

mod chain;
mod keep;

use adapters::address::{Endpoint, WaveformKeep};
use adapters::clock::{Clock, SECOND_NS, TimeNs};
use adapters::driver::Fact;
use adapters::waveform::{Block, Header, Receiver};
use adapters::{Absence, ChannelId, Reading, Source, SourceError};
use chain::Chain;
use keep::Keeper;
use std::time::Duration;

/// One value per poll.
const PERIOD: Duration = Duration::from_millis(100);
/// A poll that is behind takes at most so many blocks to catch up.
const BLOCKS_MAX: usize = 512;

/// A stream of spindle current as a source.
pub struct SpindleCurrent {
    name: String,
    receiver: Receiver,
    chain: Option<Chain>,
    keeper: Option<Keeper>,
    channels: Vec<ChannelId>,
}

impl SpindleCurrent {
    /// The stream at this address; it is connected to at the first poll. `keep` says whether raw samples stay around high
    /// currents.
    #[must_use]
    pub fn new(name: &str, at: &Endpoint, keep: Option<&WaveformKeep>) -> Self {
        Self {
            name: name.to_owned(),
            receiver: Receiver::new(name, at),
            chain: None,
            keeper: keep.map(|keep| Keeper::new(&keep.directory, keep.above_a)),
            channels: ChannelId::of("spindle_current_a").into_iter().collect(),
        }
    }

    /// Takes what has arrived; stops with the block that reaches the beginning of this poll.
    fn take(&mut self, clock: &dyn Clock) -> Result<Taken, SourceError> {
        let began_ns = clock.now_ns();
        let mut taken = Taken::default();
        for _ in 0..BLOCKS_MAX {
            let block = self.receiver.read(clock)?;
            let Some(header) = self.receiver.header().cloned() else { break };
            let instants = block.raw.len() / header.channels.len();
            let length_ns = header.duration_ns(f64::from(u32::try_from(instants).unwrap_or(u32::MAX)));
            let end_ns = block.first_ns + length_ns;
            self.feed(&header, &block, &mut taken)?;
            if end_ns + length_ns >= began_ns {
                break;
            }
        }
        Ok(taken)
    }

    fn feed(&mut self, header: &Header, block: &Block, taken: &mut Taken) -> Result<(), SourceError> {
        if block.gap > 0 || self.chain.as_ref().is_none_or(|chain| !chain.fits(header)) {
            let chain = Chain::new(header).map_err(|what| self.unsuitable(what))?;
            self.chain = Some(chain);
        }
        let Some(chain) = &mut self.chain else { return Ok(()) };
        taken.clipped |= block.clipped > 0;
        let features = chain.push(block, &mut taken.sums);
        if let Some(keeper) = &mut self.keeper {
            keeper.push(header, block, features);
        }
        Ok(())
    }

    fn unsuitable(&self, what: String) -> SourceError {
        SourceError::Decode { source_name: self.name.clone(), request: "the header of the stream".to_owned(), what }
    }
}

/// What the blocks of one poll gave.
#[derive(Debug, Default)]
struct Taken {
    sums: chain::Sums,
    clipped: bool,
}

impl Source for SpindleCurrent {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        PERIOD
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let taken = self.take(clock).inspect_err(|_| self.chain = None)?;
        let found = taken.sums.reading();
        for channel in &self.channels {
            match found {
                Some((stamp, _)) if taken.clipped => {
                    out.push(Reading::absent(*channel, stamp, Absence::OutOfRange));
                }
                Some((stamp, value_a)) => out.push(Reading::number(*channel, stamp, value_a)),
                None => {}
            }
        }
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        #[expect(clippy::cast_precision_loss, reason = "counts of samples stay far below 2^53 for centuries")]
        let count = |name: &str, count: u64| Fact::number(name, count as f64);
        let counts = self.receiver.counts();
        let mut facts = vec![
            count("waveform_samples", counts.samples),
            count("waveform_gaps", counts.gaps),
            count("waveform_missing_samples", counts.missing),
            count("waveform_clipped_samples", counts.clipped),
            count("waveform_connections", counts.connections),
        ];
        facts.extend(self.receiver.header().map(|header| Fact::number("waveform_rate_hz", header.rate_hz)));
        facts.extend(self.receiver.drift_ppm().map(|ppm| Fact::number("waveform_clock_drift_ppm", ppm)));
        if let Some(unbalance) = self.chain.as_ref().and_then(Chain::unbalance) {
            facts.push(Fact::number("phase_unbalance_pct", 100.0 * unbalance));
        }
        facts.extend(self.keeper.as_ref().map(|keeper| count("waveform_files_kept", keeper.written())));
        facts
    }
}

/// Seconds as nanoseconds.
#[expect(clippy::cast_possible_truncation, reason = "a cast from a double saturates")]
fn nanoseconds(seconds: f64) -> TimeNs {
    (seconds * SECOND_NS as f64) as i64
}
