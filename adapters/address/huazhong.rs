//! Addresses of Huazhong controllers: `nclink://`, `nclinks://` and `hncnet://`.

use super::keys::{self, Keys};
use super::meter::{self, WaveformKeep};
use super::secured::{Login, tls_files};
use super::target::{Endpoint, Target, parse_endpoint, parse_library};
use crate::hnc::OwnValue;
use crate::nclink::OwnPath;
use crate::nclink::mailbox::{ControllerRegister, Mailbox};
use crate::nclink::offset_mailbox::OffsetMailbox;
use crate::own::Own;
use crate::text::TextEncoding;
use crate::tls::TlsFiles;
use std::path::PathBuf;

/// A Huazhong controller behind a broker.
#[derive(Debug, Clone, PartialEq)]
pub struct NcLinkTarget {
    /// The broker.
    pub at: Endpoint,
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

/// A Huazhong controller through its vendor's library.
#[derive(Debug, Clone, PartialEq)]
pub struct HncNetTarget {
    /// Where.
    pub at: Endpoint,
    /// The vendor's library.
    pub vendor_library: PathBuf,
    /// Number of this computer in the controller's network; found out when not given.
    pub local_host: Option<String>,
    /// Port of the library's own listener; the controller dials back to it.
    pub local_port: u16,
    /// Bytes of the header's `Bit32` in arrays: 8 where `long` has 64 bits, else 4.
    pub long_bytes: usize,
    /// Pace of the polls, ms.
    pub period_ms: u64,
    /// Run the controller's 1 ms sampling?
    pub sample: bool,
    /// What a sampled load current of 1 is, A; without it the samples are only counted. It is not published and has to be
    /// compared once with the load current that is polled.
    pub sample_scale_a: Option<f64>,
    /// Keep raw samples of the spindle's current around high ones?
    pub keep: Option<WaveformKeep>,
    /// First register of the mailbox for the feed override; without one none is ever written.
    pub mailbox: Option<ControllerRegister>,
    /// How axes are shifted; without it none ever is.
    pub offset: Option<HncOffset>,
    /// The user's own channels, which the configuration adds.
    pub own: Vec<Own<OwnValue>>,
}

/// How the vendor's library shifts an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HncOffset {
    /// Through registers that the ladder reads, from this one on.
    Registers(ControllerRegister),
    /// By the channel's external zero offset.
    Zero {
        /// What a count is, µm.
        unit_um: f64,
    },
}

pub(super) fn parse_nclink(body: &str, keys: &mut Keys, tls: bool) -> Result<Target, String> {
    let (login, files) = (Login::from_keys(keys), tls_files(keys, tls));
    let period_ms = keys.take_number("period_ms", 100, 10, 60_000);
    let f_channel = keys.take_number("f_channel", 2560, 0, 65_535);
    let spindle_axis = keys.take_optional_number("spindle_axis", 0, 63);
    let mailbox = parse_mailbox(keys);
    let offset = keys.take_text("offset").and_then(|text| parse_offset_register(keys, &text, mailbox));
    let sample = keys.take_choice("sample", &[("no", false), ("yes", true)]);
    let keep = parse_sampled_keep(keys, sample, "sample=yes")?;
    let encoding = keys::parse_encoding(keys);
    let rest = body.strip_prefix("//").unwrap_or(body);
    let (broker, serial) = rest.split_once('/').unwrap_or((rest, ""));
    if serial.is_empty() || serial.contains(['+', '#']) {
        return Err("no serial number; write nclink://BROKER:1883/SERIAL".to_owned());
    }
    let at = parse_endpoint(broker, Some(if tls { 8883 } else { 1883 }))?;
    let serial = serial.to_owned();
    Ok(Target::NcLink(NcLinkTarget {
        at,
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
    }))
}

pub(super) fn parse_hncnet(body: &str, keys: &mut Keys) -> Result<Target, String> {
    let vendor_library = parse_library(keys);
    let (local_host, local_port) = (keys.take_text("local_host"), keys.take_number("local_port", 10001, 1, u16::MAX));
    let long_bytes = match keys.take_text("long_bytes").as_deref() {
        None => size_of::<std::ffi::c_long>(),
        Some("4") => 4,
        Some("8") => 8,
        Some(other) => {
            keys.add_problem(format!("long_bytes={other}: give 4 or 8"));
            4
        }
    };
    let period_ms = keys.take_number("period_ms", 100, 10, 60_000);
    let sample = keys.take_choice("sample", &[("no", false), ("yes", true)]);
    let sample_scale_a = keys.take_optional_number("sample_scale_a", 1e-9, 1e3);
    if sample_scale_a.is_some() && !sample {
        keys.add_problem("sample_scale_a counts only with sample=yes".to_owned());
    }
    let keep = parse_sampled_keep(keys, sample_scale_a.is_some(), "sample=yes&sample_scale_a=A")?;
    let mailbox = parse_mailbox(keys);
    let offset = hnc_offset(keys, mailbox);
    let (at, vendor_library) = (parse_endpoint(body, Some(10001))?, vendor_library?);
    Ok(Target::HncNet(HncNetTarget {
        at,
        vendor_library,
        local_host,
        local_port,
        long_bytes,
        period_ms,
        sample,
        sample_scale_a,
        keep,
        mailbox,
        offset,
        own: Vec::new(),
    }))
}

/// `offset=D110`, or `offset=zero` with what a count is.
fn hnc_offset(keys: &mut Keys, mailbox: Option<ControllerRegister>) -> Option<HncOffset> {
    let text = keys.take_text("offset");
    let unit_um = keys.take_optional_number("offset_unit_um", 1e-4, 100.0);
    match (text.as_deref(), unit_um) {
        (Some("zero"), Some(unit_um)) => return Some(HncOffset::Zero { unit_um }),
        (Some("zero"), None) => {
            let next = "say what a count of the external zero offset is, after comparing one shift at the panel";
            keys.add_problem(format!("offset=zero needs offset_unit_um= (0.01 on most controls): {next}"));
        }
        (Some(text), None) => return parse_offset_register(keys, text, mailbox).map(HncOffset::Registers),
        (_, Some(_)) => keys.add_problem("offset_unit_um= counts only with offset=zero".to_owned()),
        (None, None) => {}
    }
    None
}

/// Where the mailbox for offsets begins; it must not lie over the one for the feed override.
fn parse_offset_register(
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
fn parse_sampled_keep(keys: &mut Keys, sampled: bool, next: &str) -> Result<Option<WaveformKeep>, String> {
    let keep = meter::parse_waveform_keep(keys)?;
    if keep.is_some() && !sampled {
        keys.add_problem(format!("keep needs samples: write {next} as well"));
    }
    Ok(keep)
}

/// `write=mailbox`, and where it begins.
fn parse_mailbox(keys: &mut Keys) -> Option<ControllerRegister> {
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
