//! From an address to a source and, where a mailbox is named, an actuator.

use super::actuator::HncActuator;
use super::line::{HncLine, HncSettings};
use super::offsets::{HncRegisters, ZeroOffsets};
use super::source::HncSource;
use crate::address::{Address, HncNetTarget, HncOffset};
use crate::driver::Actuator;
use crate::nclink::BlockSink;
use crate::nclink::offset_mailbox::LadderOffsets;
use crate::offset::OffsetSink;
use crate::open::{Opened, Refused};
use std::time::Duration;

/// A call on a dead link takes the library 3 s.
const DEADLINE: Duration = Duration::from_millis(4500);

/// Opens an address; the child is started with the first poll.
#[must_use]
pub fn open_address(address: &Address, target: &HncNetTarget) -> Opened {
    open_sampled(address, target, None)
}

/// The same; whole blocks of the controller's sampling go to `sink`.
#[must_use]
pub fn open_sampled(address: &Address, target: &HncNetTarget, sink: Option<BlockSink>) -> Opened {
    let line = HncLine::new(HncSettings {
        name: address.text().to_owned(),
        vendor_library: target.vendor_library.clone(),
        at: target.at.clone(),
        local_host: target.local_host.clone(),
        local_port: target.local_port,
        long_bytes: target.long_bytes,
        deadline: DEADLINE,
        program: None,
        environment: Vec::new(),
    });
    let source = HncSource::new(line.clone(), Duration::from_millis(target.period_ms), target.sample);
    let mut source = source.with_channels(target.own.clone());
    if let Some(sink) = sink {
        source.on_block(sink);
    }
    let offsets = target.offset.map(|how| build_offset_sink(&line, how));
    let actuator = target.mailbox.map(|first| Box::new(HncActuator::new(line, first)) as Box<dyn Actuator>);
    Opened { sources: vec![Box::new(source)], actuator, offsets, simulated: None, refused: Refused::default() }
}

/// The way to the offsets that the address names.
#[must_use]
pub fn build_offset_sink(line: &HncLine, how: HncOffset) -> Box<dyn OffsetSink> {
    match how {
        HncOffset::Registers(first) => Box::new(LadderOffsets::new(HncRegisters(line.clone()), first)),
        HncOffset::Zero { unit_um } => Box::new(ZeroOffsets::new(line.clone(), unit_um)),
    }
}
