//! From an address to a source and, where a mailbox is named, an actuator.

use super::actuator::NcLinkActuator;
use super::connection::Link;
use super::mailbox::Register;
use super::offset_mailbox::LadderOffsets;
use super::offsets::NcLinkRegisters;
use super::source::{BlockSink, NcLinkSource};
use crate::address::{Address, NcLinkTarget};
use crate::driver::Actuator;
use crate::offset::OffsetSink;
use crate::open::{OpenError, Opened, Refused};

/// What `nclinks://` is answered with.
pub const NO_TLS: &str = "this build has no TLS for MQTT; use nclink:// to a broker on this box or behind a tunnel";

/// Opens an NC-Link address; nothing is connected before the first poll.
///
/// # Errors
/// TLS, which this build does not have; a password file that cannot be read.
pub fn open(address: &Address, target: &NcLinkTarget) -> Result<Opened, OpenError> {
    open_sampled(address, target, None)
}

/// The same; whole blocks of its sample channels go to `sink`.
///
/// # Errors
/// See [`open`].
pub fn open_sampled(address: &Address, target: &NcLinkTarget, sink: Option<BlockSink>) -> Result<Opened, OpenError> {
    if target.tls {
        return Err(OpenError::Unsuitable { address: address.text().to_owned(), what: NO_TLS });
    }
    let login = login(target)?;
    let link = Link::of(address.text(), target, login.clone());
    let mut source = NcLinkSource::new(address.text(), target, login);
    if let Some(sink) = sink {
        source.on_block(sink);
    }
    let offsets = target.offset.map(|first| offsets(link.clone(), target.f_channel, first));
    let actuator = target.mailbox.map(|first| Box::new(NcLinkActuator::new(link, first)) as Box<dyn Actuator>);
    Ok(Opened { sources: vec![Box::new(source)], actuator, offsets, simulated: None, refused: Refused::default() })
}

fn offsets(link: Link, f_channel: u32, first: Register) -> Box<dyn OffsetSink> {
    Box::new(LadderOffsets::new(NcLinkRegisters::new(link, f_channel), first))
}

fn login(target: &NcLinkTarget) -> Result<Option<(String, String)>, OpenError> {
    let Some(user) = &target.user else { return Ok(None) };
    let password = match &target.password_file {
        Some(file) => std::fs::read_to_string(file)
            .map_err(|error| OpenError::Secret { file: file.display().to_string(), what: error.to_string() })?,
        None => String::new(),
    };
    Ok(Some((user.clone(), password.trim_end_matches(['\r', '\n']).to_owned())))
}
