//! From an address to a source and, where a mailbox is named, an actuator.

use super::actuator::HncActuator;
use super::line::{HncLine, HncSettings};
use super::offsets::{HncRegisters, ZeroOffsets};
use super::source::HncSource;
use crate::address::{HncNetTarget, HncOffset};
use adapter_core::OpenedDevice;
use adapter_core::driver::Actuator;
use adapter_core::offset::OffsetSink;
use nclink::BlockSink;
use nclink::offset_mailbox::LadderOffsets;
use std::time::Duration;

/// A call on a dead link takes the library 3 s.
const DEADLINE: Duration = Duration::from_millis(4500);

/// Opens the controller under this name; the child is started with the first poll.
#[must_use]
pub fn open_address(name: &str, target: &HncNetTarget) -> OpenedDevice {
    open_sampled(name, target, None)
}

/// The same; whole blocks of the controller's sampling go to `sink`.
#[must_use]
pub fn open_sampled(name: &str, target: &HncNetTarget, sink: Option<BlockSink>) -> OpenedDevice {
    let line = HncLine::new(HncSettings {
        name: name.to_owned(),
        vendor_library: target.vendor_library.clone(),
        endpoint: target.endpoint.clone(),
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
    OpenedDevice { sources: vec![Box::new(source)], actuator, offsets }
}

/// The way to the offsets that the address names.
#[must_use]
pub fn build_offset_sink(line: &HncLine, how: HncOffset) -> Box<dyn OffsetSink> {
    match how {
        HncOffset::Registers(first) => Box::new(LadderOffsets::new(HncRegisters(line.clone()), first)),
        HncOffset::Zero { unit_um } => Box::new(ZeroOffsets::new(line.clone(), unit_um)),
    }
}
