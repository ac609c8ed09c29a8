//! What an `hncnet://` address says.

use crate::OwnValue;
use adapter_core::address::{AddressProblem, Endpoint, Keys, WaveformKeep, parse_endpoint, parse_library};
use adapter_core::own::Own;
use nclink::address::{parse_mailbox, parse_offset_register, parse_sampled_keep};
use nclink::mailbox::ControllerRegister;
use std::path::PathBuf;

/// A Huazhong controller through its vendor's library.
#[derive(Debug, Clone, PartialEq)]
pub struct HncNetTarget {
    /// Host and port of the controller; 10001 where none is named.
    pub endpoint: Endpoint,
    /// The file of the vendor's library.
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

/// The controller that the address names.
///
/// # Errors
/// What is missing.
pub fn parse_hncnet(body: &str, keys: &mut Keys) -> Result<HncNetTarget, AddressProblem> {
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
    Ok(HncNetTarget {
        endpoint: at,
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
    })
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
