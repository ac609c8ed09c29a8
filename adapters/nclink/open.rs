//! From an address to a source and, where a mailbox is named, an actuator.

use super::actuator::NcLinkActuator;
use super::connection::Link;
use super::mailbox::ControllerRegister;
use super::offset_mailbox::LadderOffsets;
use super::offsets::NcLinkRegisters;
use super::source::{BlockSink, NcLinkSource};
use crate::address::{Address, NcLinkTarget};
use crate::driver::Actuator;
use crate::offset::OffsetSink;
use crate::open::{OpenError, Opened, Refused};

/// Opens an NC-Link address; nothing is connected before the first poll.
///
/// # Errors
/// A password file that cannot be read.
pub fn open_address(address: &Address, target: &NcLinkTarget) -> Result<Opened, OpenError> {
    open_sampled(address, target, None)
}

/// The same; whole blocks of its sample channels go to `sink`.
///
/// # Errors
/// See [`open_address`].
pub fn open_sampled(address: &Address, target: &NcLinkTarget, sink: Option<BlockSink>) -> Result<Opened, OpenError> {
    let login = target
        .login
        .read()
        .map_err(|(file, error)| OpenError::Secret { file: file.display().to_string(), what: error.to_string() })?;
    let link = Link::from_target(address.text(), target, login.clone());
    let mut source = NcLinkSource::new(address.text(), target, login);
    if let Some(sink) = sink {
        source.on_block(sink);
    }
    let offsets = target.offset.map(|first| build_offset_sink(link.clone(), target.f_channel, first));
    let actuator = target.mailbox.map(|first| Box::new(NcLinkActuator::new(link, first)) as Box<dyn Actuator>);
    Ok(Opened { sources: vec![Box::new(source)], actuator, offsets, simulated: None, refused: Refused::default() })
}

fn build_offset_sink(link: Link, f_channel: u32, first: ControllerRegister) -> Box<dyn OffsetSink> {
    Box::new(LadderOffsets::new(NcLinkRegisters::new(link, f_channel), first))
}
