//! What every stream of samples goes through, whoever sends it: gap, clipping, clock, counts.

use super::frame::WaveformHeader;
use super::timebase::TimeBase;
use crate::clock::TimeNs;
use adapter_core::integer::{convert_bounded, count_to_f64, widen_to_u64};

/// Some samples of every channel, in the header's unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// When the first sample was taken, on the gateway's clock.
    pub first_ns: TimeNs,
    /// Samples that are missing before this block.
    pub gap: u64,
    /// Samples of any channel that were clipped.
    pub clipped: u32,
    /// As they came; all channels of one instant together.
    pub raw: Vec<i16>,
}

/// What a stream has gone through since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Blocks of samples that came.
    pub blocks: u64,
    /// Instants that were sampled; all channels count once.
    pub samples: u64,
    /// Times at which blocks were missing.
    pub gaps: u64,
    /// Instants that were missing.
    pub missing: u64,
    /// Samples at or beyond full scale, of all channels.
    pub clipped: u64,
    /// Connections, the first one included.
    pub connections: u64,
}

/// Header, clock and counts of one stream.
#[derive(Debug, Clone, Default)]
pub struct Intake {
    header: Option<WaveformHeader>,
    time: TimeBase,
    counts: Counts,
}

impl Intake {
    /// The sampler begins anew with this header, perhaps on another clock.
    pub(super) fn record_connection(&mut self, header: WaveformHeader) {
        self.header = Some(header);
        self.time = TimeBase::default();
        self.counts.connections += 1;
    }

    /// What the stream carries, once it has come.
    #[must_use]
    pub fn header(&self) -> Option<&WaveformHeader> {
        self.header.as_ref()
    }

    /// What it has gone through.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// How slow the sampler's clock runs, ppm, once known.
    #[must_use]
    pub fn drift_ppm(&self) -> Option<f64> {
        self.time.drift_ppm()
    }

    /// Takes samples whose first was taken at `first_ns` on the sampler's clock, with `gap` missing before them.
    pub(super) fn accept_samples(
        &mut self,
        header: &WaveformHeader,
        first_ns: TimeNs,
        gap: u64,
        raw: Vec<i16>,
        arrived_ns: TimeNs,
    ) -> Block {
        let count = raw.len() / header.channels.len().max(1);
        let full = header.full_scale.unsigned_abs();
        let clipped = raw.iter().filter(|sample| sample.unsigned_abs() >= full).count();
        let clipped = convert_bounded(clipped, u32::MAX);
        self.time.push(end_ns(header, first_ns, count), arrived_ns);
        self.counts.blocks += 1;
        self.counts.samples += widen_to_u64(count);
        self.counts.gaps += u64::from(gap > 0);
        self.counts.missing += gap;
        self.counts.clipped += u64::from(clipped);
        Block { first_ns: self.time.gateway_ns(first_ns), gap, clipped, raw }
    }
}

/// When the sample behind `count` of them is due.
pub(super) fn end_ns(header: &WaveformHeader, first_ns: TimeNs, count: usize) -> TimeNs {
    first_ns.saturating_add(header.duration_ns(count_to_f64(count)))
}

/// How many samples are missing between the time that was due and the time that came; rounded, and negative where some came
/// again.
pub(super) fn count_missing(header: &WaveformHeader, due_ns: TimeNs, first_ns: TimeNs) -> i64 {
    let sample_ns = header.duration_ns(1.0).max(1);
    (first_ns.saturating_sub(due_ns) + sample_ns / 2).div_euclid(sample_ns)
}
