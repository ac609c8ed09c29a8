//! A controller's own 1 ms sampling of the spindle's load current, on the way of every stream.
//!
//! The driver of the controller hands over whole blocks as they come (`on_block`); they wait in a bounded queue for this
//! source, which has a thread and a pace of its own: the controller uploads every 200 ms, and what it samples is merged
//! before what is polled of the same current.

use super::features::Features;
use adapters::address::{Address, HncNetTarget, NcLinkTarget, Target, WaveformKeep};
use adapters::clock::{Clock, TimeNs};
use adapters::driver::Fact;
use adapters::nclink::BlockSink;
use adapters::nclink::sample::SampleBlock;
use adapters::open::{OpenError, Opened};
use adapters::waveform::SampledCurrent;
use adapters::{ChannelId, Reading, Source, SourceError};
use gateway_base::convert::{saturate_to_ms, saturate_to_ns};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often the devices seen so far upload.
const PERIOD: Duration = Duration::from_millis(200);
/// Blocks that wait; then the oldest goes, and shows as a gap.
const WAITING_MAX: usize = 64;
/// No block for so long is a failure.
const SILENT: Duration = Duration::from_secs(3);
/// The spindle among the axes of an HNC-8, where the address does not say.
const SPINDLE_AXIS: u32 = 5;

type SampleQueue = Arc<Mutex<VecDeque<(SampleBlock, Instant)>>>;

/// A controller whose sampling is wanted, opened with it; `None` for every other address.
pub(super) fn open_sampled_source(address: &Address) -> Option<Result<Opened, OpenError>> {
    match address.target() {
        Target::NcLink(target) if target.sample => Some(open_nclink(address, target)),
        Target::HncNet(target) => target.sample_scale_a.map(|scale_a| Ok(open_hnc(address, target, scale_a))),
        _ => None,
    }
}

fn open_nclink(address: &Address, target: &NcLinkTarget) -> Result<Opened, OpenError> {
    let (waiting, sink) = create_queue();
    let current = SampledCurrent::new(Some(target.spindle_axis.unwrap_or(SPINDLE_AXIS)), 1.0);
    let opened = adapters::nclink::open_sampled(address.text(), target, Some(sink))?;
    Ok(join_sources(ControllerSamples::new(address.text(), current, waiting, target.keep.as_ref()), opened.into()))
}

fn open_hnc(address: &Address, target: &HncNetTarget, scale_a: f64) -> Opened {
    let (waiting, sink) = create_queue();
    // The driver lets the spindle be the first of the load currents.
    let current = SampledCurrent::new(None, scale_a);
    let opened = adapters::hnc::open_sampled(address.text(), target, Some(sink));
    join_sources(ControllerSamples::new(address.text(), current, waiting, target.keep.as_ref()), opened.into())
}

/// What is sampled goes before what is polled.
fn join_sources(samples: ControllerSamples, mut opened: Opened) -> Opened {
    opened.sources.insert(0, Box::new(samples));
    opened
}

fn create_queue() -> (SampleQueue, BlockSink) {
    let waiting = SampleQueue::default();
    let filled = waiting.clone();
    let sink = move |block: &SampleBlock, arrived: Instant| {
        let mut waiting = filled.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.push_back((block.clone(), arrived));
        if waiting.len() > WAITING_MAX {
            waiting.pop_front();
        }
    };
    (waiting, Box::new(sink))
}

/// The sampled load current as a source.
pub struct ControllerSamples {
    name: String,
    current: SampledCurrent,
    queue: SampleQueue,
    features: Features,
    heard: Option<Instant>,
}

impl ControllerSamples {
    fn new(address: &str, current: SampledCurrent, waiting: SampleQueue, keep: Option<&WaveformKeep>) -> Self {
        Self { name: format!("{address}#samples"), current, queue: waiting, features: Features::new(keep), heard: None }
    }

    fn receive_blocks(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<bool, SourceError> {
        let waiting = std::mem::take(&mut *self.queue.lock().unwrap_or_else(PoisonError::into_inner));
        let some = !waiting.is_empty();
        for (block, arrived) in waiting {
            let blocks = self.current.extract_blocks(&block, arrived_ns(clock, arrived));
            let Some(header) = self.current.intake().header().cloned() else { continue };
            for block in &blocks {
                self.features.feed_block(&self.name, &header, block)?;
            }
            // One reading for every block of the controller's.
            out.extend(self.features.take_reading());
        }
        Ok(some)
    }

    fn timeout_error(&self) -> SourceError {
        SourceError::Timeout {
            source_name: self.name.clone(),
            request: "the sampled load current of the spindle".to_owned(),
            deadline_ms: saturate_to_ms(SILENT),
            next: "Does the controller's model have a sample channel with the spindle's MOTOR/CURRENT, and is nobody using \
                   the oscilloscope at its panel?"
                .to_owned(),
        }
    }
}

/// When it arrived, on the clock of the readings.
fn arrived_ns(clock: &dyn Clock, arrived: Instant) -> TimeNs {
    clock.now_ns().saturating_sub(saturate_to_ns(arrived.elapsed()))
}

impl Source for ControllerSamples {
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
        let now = Instant::now();
        let heard = *self.heard.get_or_insert(now);
        if self.receive_blocks(clock, out)? {
            self.heard = Some(now);
        } else if now.saturating_duration_since(heard) > SILENT {
            self.features.reset_stream();
            return Err(self.timeout_error());
        }
        Ok(())
    }

    fn collect_facts(&self) -> Vec<Fact> {
        self.features.list_facts(self.current.intake())
    }
}
