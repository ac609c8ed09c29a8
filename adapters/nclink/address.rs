//! What an `nclink://` or `nclinks://` address says; the keys of mailboxes are those of `hncnet://` too.

use crate::OwnPath;
use crate::mailbox::{ControllerRegister, Mailbox};
use crate::offset_mailbox::OffsetMailbox;
use adapter_core::address::{
    AddressProblem, Endpoint, Keys, Login, WaveformKeep, parse_encoding, parse_endpoint, parse_waveform_keep,
};
use adapter_core::own::Own;
use adapter_core::text::TextEncoding;
use device_line::tls::TlsFiles;
use thiserror::Error;

/// A Huazhong controller behind a broker.
#[derive(Debug, Clone, PartialEq)]
pub struct NcLinkTarget {
    /// Host and port of the broker.
    pub endpoint: Endpoint,
    /// Serial number of the device.
    pub serial: String,
    /// The files of TLS, where the line is secured.
    pub tls: Option<TlsFiles>,
    /// User and password at the broker.
    pub login: Login,
    /// Pace of the queries, ms.
    pub period_ms: u64,
    /// Index of the channel's first F word: 2560 in configuration HNC-30, 6400 in HNC-80.
    pub f_channel: u32,
    /// Number of the spindle among the axes, where it is not 5.
    pub spindle_axis: Option<u32>,
    /// First register of the mailbox for the feed override; without one nothing is ever written.
    pub mailbox: Option<ControllerRegister>,
    /// First register of the mailbox for offsets; without one no axis is ever shifted.
    pub offset: Option<ControllerRegister>,
    /// Make the spindle's current out of the device's sample channel?
    pub sample: bool,
    /// Keep its raw samples around high currents?
    pub keep: Option<WaveformKeep>,
    /// Character set of its messages.
    pub encoding: TextEncoding,
    /// The user's own channels, which the configuration adds.
    pub own: Vec<Own<OwnPath>>,
}

/// Why an address names no device.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NcLinkAddressError {
    /// No serial number stands behind the broker, or one that would be a pattern of topics.
    #[error("no serial number; write nclink://BROKER:1883/SERIAL")]
    NoSerialNumber,
    /// The broker or a key that other schemes have as well.
    #[error(transparent)]
    Address(#[from] AddressProblem),
}

/// The device that the address names.
///
/// # Errors
/// What is missing.
pub fn parse_nclink(body: &str, keys: &mut Keys, tls: bool) -> Result<NcLinkTarget, NcLinkAddressError> {
    let (login, files) = (Login::from_keys(keys), TlsFiles::from_keys(keys, tls));
    let period_ms = keys.take_number("period_ms", 100, 10, 60_000);
    let f_channel = keys.take_number("f_channel", 2560, 0, 65_535);
    let spindle_axis = keys.take_optional_number("spindle_axis", 0, 63);
    let mailbox = parse_mailbox(keys);
    let offset = keys.take_text("offset").and_then(|text| parse_offset_register(keys, &text, mailbox));
    let sample = keys.take_choice("sample", &[("no", false), ("yes", true)]);
    let keep = parse_sampled_keep(keys, sample, "sample=yes")?;
    let encoding = parse_encoding(keys);
    let rest = body.strip_prefix("//").unwrap_or(body);
    let (broker, serial) = rest.split_once('/').unwrap_or((rest, ""));
    if serial.is_empty() || serial.contains(['+', '#']) {
        return Err(NcLinkAddressError::NoSerialNumber);
    }
    let at = parse_endpoint(broker, Some(if tls { 8883 } else { 1883 }))?;
    let serial = serial.to_owned();
    Ok(NcLinkTarget {
        endpoint: at,
        serial,
        tls: files,
        login,
        period_ms,
        f_channel,
        spindle_axis,
        mailbox,
        offset,
        sample,
        keep,
        encoding,
        own: Vec::new(),
    })
}

/// Where the mailbox for offsets begins; it must not lie over the one for the feed override.
pub fn parse_offset_register(
    keys: &mut Keys,
    text: &str,
    mailbox: Option<ControllerRegister>,
) -> Option<ControllerRegister> {
    let first =
        text.parse::<ControllerRegister>().map_err(|problem| keys.add_problem(format!("offset={problem}"))).ok()?;
    if !OffsetMailbox::may_begin(first) {
        keys.add_problem(format!(
            "offset={first}: name a W or D register; others are too short or keep their contents"
        ));
        return None;
    }
    let overlaps = |other: &ControllerRegister| {
        let apart = other.index + Mailbox::LENGTH <= first.index || first.index + OffsetMailbox::LENGTH <= other.index;
        other.kind == first.kind && !apart
    };
    if let Some(other) = mailbox.filter(overlaps) {
        keys.add_problem(format!("offset={first} lies over the mailbox at {other}: name eight registers of their own"));
        return None;
    }
    Some(first)
}

/// `keep=` and `keep_above_a=`, where there are samples to be kept.
pub fn parse_sampled_keep(keys: &mut Keys, sampled: bool, next: &str) -> Result<Option<WaveformKeep>, AddressProblem> {
    let keep = parse_waveform_keep(keys)?;
    if keep.is_some() && !sampled {
        keys.add_problem(format!("keep needs samples: write {next} as well"));
    }
    Ok(keep)
}

/// `write=mailbox`, and where it begins.
pub fn parse_mailbox(keys: &mut Keys) -> Option<ControllerRegister> {
    let wanted = keys.take_choice("write", &[("none", false), ("mailbox", true)]);
    let text = keys.take_text("mailbox");
    if !wanted {
        if text.is_some() {
            keys.add_problem("mailbox= counts only with write=mailbox".to_owned());
        }
        return None;
    }
    match text.as_deref().unwrap_or("D100").parse::<ControllerRegister>() {
        Ok(first) if Mailbox::may_begin(first) => Some(first),
        Ok(first) => {
            keys.add_problem(format!(
                "mailbox={first}: name an R, W or D register; others are not free or keep their contents"
            ));
            None
        }
        Err(problem) => {
            keys.add_problem(format!("mailbox={problem}"));
            None
        }
    }
}
