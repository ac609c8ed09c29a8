//! What every stream of spindle current gives, whoever sends it: filter, feature, raw samples around what is remarkable.

use super::chain::{Sums, UnsuitableStream, WaveformChain};
use super::excerpt_writer::ExcerptWriter;
use adapters::address::WaveformKeep;
use adapters::driver::Fact;
use adapters::waveform::{Block, Intake, WaveformHeader};
use adapters::{Absence, ChannelId, Reading, SourceError};

/// Blocks in, one reading of `spindle_current_a` out whenever it is asked for.
pub(super) struct Features {
    chain: Option<WaveformChain>,
    excerpt_writer: Option<ExcerptWriter>,
    channels: Vec<ChannelId>,
    sums: Sums,
    clipped: bool,
}

impl Features {
    /// `keep` says whether raw samples stay around high currents.
    pub(super) fn new(keep: Option<&WaveformKeep>) -> Self {
        Self {
            chain: None,
            excerpt_writer: keep.map(|keep| ExcerptWriter::new(&keep.directory, keep.above_a)),
            channels: ChannelId::from_name("spindle_current_a").into_iter().collect(),
            sums: Sums::default(),
            clipped: false,
        }
    }

    pub(super) fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    /// Takes a block. Behind a gap, and with another header, filter and feature begin anew.
    ///
    /// # Errors
    /// [`SourceError::Decode`]: a stream that is no spindle current.
    pub(super) fn feed_block(
        &mut self,
        source_name: &str,
        header: &WaveformHeader,
        block: &Block,
    ) -> Result<(), SourceError> {
        if block.gap > 0 || self.chain.as_ref().is_none_or(|chain| !chain.matches_header(header)) {
            let unsuitable = |error: UnsuitableStream| SourceError::Decode {
                source_name: source_name.to_owned(),
                request: "the header of the stream".to_owned(),
                what: error.to_string(),
            };
            self.chain = Some(WaveformChain::new(header).map_err(unsuitable)?);
        }
        let Some(chain) = &mut self.chain else { return Ok(()) };
        self.clipped |= block.clipped > 0;
        let feature_a = chain.push(block, &mut self.sums);
        if let Some(excerpt_writer) = &mut self.excerpt_writer {
            excerpt_writer.push(header, block, feature_a);
        }
        Ok(())
    }

    /// The stream is interrupted: what comes next has nothing to do with what was.
    pub(super) fn reset_stream(&mut self) {
        (self.chain, self.sums, self.clipped) = (None, Sums::default(), false);
    }

    /// The value of the blocks since the last one, where they give one. With a clipped sample among them there is none,
    /// because it would be too low.
    pub(super) fn take_reading(&mut self) -> Option<Reading> {
        let (sums, clipped) = (std::mem::take(&mut self.sums), std::mem::take(&mut self.clipped));
        let (channel, (stamp, value_a)) = (*self.channels.first()?, sums.compute_reading()?);
        Some(if clipped {
            Reading::from_absence(channel, stamp, Absence::OutOfRange)
        } else {
            Reading::from_number(channel, stamp, value_a)
        })
    }

    /// What is known of the stream.
    pub(super) fn list_facts(&self, intake: &Intake) -> Vec<Fact> {
        let counts = intake.counts();
        #[expect(clippy::cast_precision_loss, reason = "counts of samples stay far below 2^53 for centuries")]
        let count = |name: &str, count: u64| Fact::from_number(name, count as f64);
        let mut facts = vec![
            count("waveform_samples", counts.samples),
            count("waveform_gaps", counts.gaps),
            count("waveform_missing_samples", counts.missing),
            count("waveform_clipped_samples", counts.clipped),
            count("waveform_connections", counts.connections),
        ];
        facts.extend(intake.header().map(|header| Fact::from_number("waveform_rate_hz", header.rate_hz)));
        facts.extend(intake.drift_ppm().map(|ppm| Fact::from_number("waveform_clock_drift_ppm", ppm)));
        if let Some(unbalance) = self.chain.as_ref().and_then(WaveformChain::unbalance) {
            facts.push(Fact::from_number("phase_unbalance_pct", 100.0 * unbalance));
        }
        facts.extend(
            self.excerpt_writer
                .as_ref()
                .map(|excerpt_writer| count("waveform_files_kept", excerpt_writer.count_files())),
        );
        facts
    }
}
