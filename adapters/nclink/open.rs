//! From an address to a source and, where a mailbox is named, an actuator.

use super::actuator::NcLinkActuator;
use super::connection::Link;
use super::mailbox::ControllerRegister;
use super::offset_mailbox::LadderOffsets;
use super::offsets::NcLinkRegisters;
use super::source::{BlockSink, NcLinkSource};
use crate::address::NcLinkTarget;
use adapter_core::driver::Actuator;
use adapter_core::offset::OffsetSink;
use adapter_core::{OpenedDevice, UnreadableSecret};

/// Opens an NC-Link address; nothing is connected before the first poll.
///
/// # Errors
/// A password file that cannot be read.
pub fn open_address(name: &str, target: &NcLinkTarget) -> Result<OpenedDevice, UnreadableSecret> {
    open_sampled(name, target, None)
}

/// The same; whole blocks of its sample channels go to `sink`.
///
/// # Errors
/// See [`open_address`].
pub fn open_sampled(
    name: &str,
    target: &NcLinkTarget,
    sink: Option<BlockSink>,
) -> Result<OpenedDevice, UnreadableSecret> {
    let login = target
        .login
        .read()
        .map_err(|(file, error)| UnreadableSecret { file: file.display().to_string(), what: error.to_string() })?;
    let link = Link::from_target(name, target, login.clone());
    let mut source = NcLinkSource::new(name, target, login);
    if let Some(sink) = sink {
        source.on_block(sink);
    }
    let offsets = target.offset.map(|first| build_offset_sink(link.clone(), target.f_channel, first));
    let actuator = target.mailbox.map(|first| Box::new(NcLinkActuator::new(link, first)) as Box<dyn Actuator>);
    Ok(OpenedDevice { sources: vec![Box::new(source)], actuator, offsets })
}

fn build_offset_sink(link: Link, f_channel: u32, first: ControllerRegister) -> Box<dyn OffsetSink> {
    Box::new(LadderOffsets::new(NcLinkRegisters::new(link, f_channel), first))
}
