//! What follows the question mark of a `fanuc://` address.

use crate::axis_name::AxisName;
use crate::dial::Dial;
use crate::feed_override;
use crate::item::{Area, Position};
use crate::own_item::OwnItem;
use adapter_core::address::{AddressProblem, Endpoint, Keys, parse_encoding, parse_endpoint, parse_library};
use adapter_core::channel::PATHS;
use adapter_core::own::Own;
use adapter_core::text::TextEncoding;
use std::path::PathBuf;
use std::time::Duration;

/// Most axes that have channels of their own names.
const AXES_MAX: usize = 16;

/// How the feed override reaches the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WriteMethod {
    /// Not at all; nothing is ever written.
    None,
    /// Through a mailbox in PMC memory that the ladder reads, with a heartbeat.
    Mailbox {
        /// Area of the mailbox: R, D or E.
        area: Area,
        /// Address of its first byte.
        at: u16,
    },
    /// Through a byte from which the ladder makes the second override; the operator's dial stays sovereign.
    SecondOverride {
        /// Area of the byte.
        area: Area,
        /// Address of the byte.
        at: u16,
    },
    /// Through a custom macro variable in percent, for programs that say `F[#501*...]` or a ladder that reads it.
    Macro {
        /// Number of the variable.
        variable: u16,
    },
    /// Straight into G012. The ladder usually writes it in every scan and takes it back.
    Direct,
}

/// How FOCAS2 is spoken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FanucBackend {
    /// In Rust over TCP, without the vendor's library.
    Native,
    /// Through this vendor library, in a child process.
    Vendor(PathBuf),
}

/// A controller that an address names.
#[derive(Debug, Clone, PartialEq)]
pub struct FanucTarget {
    /// Host and port of the controller; 8193 where none is named.
    pub endpoint: Endpoint,
    /// Path (channel) of the controller, from 1.
    pub path: u8,
    /// How it is spoken to: natively, or through the vendor's library.
    pub backend: FanucBackend,
    /// Pace, limits and the way of writing.
    pub options: FanucOptions,
}

/// Keys of a `fanuc://` address besides path and backend.
#[derive(Debug, Clone, PartialEq)]
pub struct FanucOptions {
    /// Paths that are read besides the one with the plain channel names, over the same connection.
    pub further: Vec<u8>,
    /// Pace of what changes quickly.
    pub period: Duration,
    /// Pace of what changes slowly.
    pub slow: Duration,
    /// At most this share of the time the controller is busy with us, percent.
    pub duty_pct: u8,
    /// Longest wait for connecting and for an answer.
    pub timeout: Duration,
    /// Diagnosis number in which the control shows the power of the spindle drive in watts, where it does (4902 on
    /// some 30i); without a meter, the only power there is.
    pub power_diagnosis: Option<u16>,
    /// How the feed override is written.
    pub write: WriteMethod,
    /// Byte into which a feed hold or a stop is asked; the ladder answers in the one behind it.
    pub request: Option<(Area, u16)>,
    /// Where the operator's dial stands.
    pub dial: Option<Dial>,
    /// An override is looked at again after this time: several scans of the ladder.
    pub settle: Duration,
    /// Texts of further addresses that may be written.
    pub allow: Vec<String>,
    /// Axes that have channels of their own names.
    pub axes: Vec<AxisName>,
    /// Which positions of those axes are read besides those of the machine.
    pub positions: Vec<Position>,
    /// Spindles that are read; the first one has the plain names.
    pub spindles: u8,
    /// Does the slow group read times, texts, codes and tool life?
    pub details: bool,
    /// The user's own channels, which the configuration adds.
    pub own: Vec<Own<OwnItem>>,
    /// Character set of the control's texts.
    pub encoding: TextEncoding,
}

impl Default for FanucOptions {
    fn default() -> Self {
        Self::read(&mut Keys::from_query(""))
    }
}

impl FanucOptions {
    /// What the keys of an address say.
    pub fn read(keys: &mut Keys) -> Self {
        let ms = |keys: &mut Keys, key, default, least, greatest| {
            Duration::from_millis(keys.take_number(key, default, least, greatest))
        };
        let allow = keys.take_text("allow").map(|text| text.split(',').map(|one| one.trim().to_owned()).collect());
        let allow: Vec<String> = allow.unwrap_or_default();
        for text in allow.iter().filter(|text| crate::allow_list::Allowed::read(text).is_none()) {
            keys.add_problem(format!("allow={text}: write addresses like R900-R904, #500-#509 or EXT"));
        }
        let write = write(keys);
        let (axes, positions) = parse_axes(keys);
        Self {
            axes,
            positions,
            spindles: keys.take_number("spindles", 1, 1, 8),
            details: keys.take_choice("details", &[("yes", true), ("no", false)]),
            own: Vec::new(),
            encoding: parse_encoding(keys),
            further: Vec::new(),
            period: ms(keys, "period_ms", 100, 20, 60_000),
            slow: ms(keys, "slow_ms", 1000, 100, 600_000),
            duty_pct: keys.take_number("duty_pct", 50, 1, 100),
            timeout: ms(keys, "timeout_ms", 2000, 50, 30_000),
            settle: ms(keys, "settle_ms", 50, 0, 2000),
            power_diagnosis: Some(keys.take_number("power_diagnosis", 0, 0, 9999)).filter(|number| *number > 0),
            request: keys.take_text("request").and_then(|text| parse_ladder_byte(keys, "request", &text)),
            dial: parse_dial(keys, write),
            write,
            allow,
        }
    }
}

/// The controller that the address names.
///
/// # Errors
/// No host is named, or no library where one is needed.
pub fn parse_fanuc(body: &str, keys: &mut Keys) -> Result<FanucTarget, AddressProblem> {
    let named = keys.take_optional_number("path", 1, 10);
    let vendor = keys.take_choice("backend", &[("native", false), ("vendor", true)]);
    let backend = if vendor { parse_library(keys).map(FanucBackend::Vendor) } else { Ok(FanucBackend::Native) };
    let mut options = FanucOptions::read(keys);
    let path = match parse_paths(keys) {
        Some((own, further)) => {
            if named.is_some() {
                keys.add_problem("give either path=, for one path under the plain channel names, or paths=".to_owned());
            }
            options.further = further;
            own
        }
        None => named.unwrap_or(1),
    };
    Ok(FanucTarget { endpoint: parse_endpoint(body, Some(8193))?, path, backend: backend?, options })
}

/// `axes=X1,C1,B` and `positions=absolute,relative,to_go`.
fn parse_axes(keys: &mut Keys) -> (Vec<AxisName>, Vec<Position>) {
    let words = [("absolute", Position::Absolute), ("relative", Position::Relative), ("to_go", Position::ToGo)];
    let mut axes = Vec::new();
    for text in keys.take_text("axes").iter().flat_map(|text| text.split(',')).map(str::trim) {
        match AxisName::read(text) {
            Some(axis) if axes.len() < AXES_MAX => axes.push(axis),
            Some(_) => keys.add_problem(format!("axes=: at most {AXES_MAX} axes have channels")),
            None => {
                keys.add_problem(format!("axes={text}: name axes as on the control, for example axes=X1,Z1,C1,W:deg"))
            }
        }
    }
    let mut positions = Vec::new();
    for text in keys.take_text("positions").iter().flat_map(|text| text.split(',')).map(str::trim) {
        match words.iter().find(|(word, _)| *word == text) {
            Some((_, position)) => positions.push(*position),
            None => keys.add_problem(format!("positions={text}: write absolute, relative or to_go, one or several")),
        }
    }
    if axes.is_empty() && !positions.is_empty() {
        keys.add_problem("positions= is about the axes that axes= names; name them".to_owned());
    }
    (axes, positions)
}

/// `paths=2,1`: the first has the plain channel names and is the one that is written to, the others have a prefix.
fn parse_paths(keys: &mut Keys) -> Option<(u8, Vec<u8>)> {
    let text = keys.take_text("paths")?;
    let paths: Option<Vec<u8>> = text.split(',').map(|path| path.trim().parse().ok()).collect();
    let once = |paths: &[u8]| paths.iter().enumerate().all(|(at, path)| !paths[..at].contains(path));
    match paths.as_deref() {
        Some(paths @ [own, further @ ..]) if once(paths) && paths.iter().all(|path| PATHS.contains(path)) => {
            Some((*own, further.to_vec()))
        }
        _ => {
            keys.add_problem(format!(
                "paths={text}: name paths up to {} once each, the one that is written to first, for example paths=1,2",
                PATHS.end()
            ));
            None
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum AddressWord {
    None,
    Mailbox,
    Second,
    Macro,
    Direct,
}

fn write(keys: &mut Keys) -> WriteMethod {
    let words = [
        ("none", AddressWord::None),
        ("mailbox", AddressWord::Mailbox),
        ("second_override", AddressWord::Second),
        ("macro", AddressWord::Macro),
        ("direct", AddressWord::Direct),
    ];
    match keys.take_choice("write", &words) {
        AddressWord::None => WriteMethod::None,
        AddressWord::Mailbox => {
            let (area, at) = place_or(keys, "mailbox", (Area::R, 900));
            WriteMethod::Mailbox { area, at }
        }
        AddressWord::Second => {
            let (area, at) = place_or(keys, "second_override", (Area::R, 910));
            WriteMethod::SecondOverride { area, at }
        }
        AddressWord::Macro => WriteMethod::Macro { variable: keys.take_number("macro", 500, 100, 999) },
        AddressWord::Direct => WriteMethod::Direct,
    }
}

/// A byte that may be left out.
fn place_or(keys: &mut Keys, key: &'static str, default: (Area, u16)) -> (Area, u16) {
    keys.take_text(key).and_then(|text| parse_ladder_byte(keys, key, &text)).unwrap_or(default)
}

/// `R900`: a byte of an area that belongs to the ladder's data.
fn parse_ladder_byte(keys: &mut Keys, key: &str, text: &str) -> Option<(Area, u16)> {
    let mut letters = text.chars();
    let area = letters.next().and_then(Area::of_letter).filter(|area| matches!(area, Area::R | Area::D | Area::E));
    let found = area.zip(letters.as_str().parse::<u16>().ok()).filter(|(_, at)| *at < 60_000);
    if found.is_none() {
        keys.add_problem(format!("{key}={text}: give a byte of R, D or E, for example R900"));
    }
    found
}

/// The dial; with a mailbox or a direct write G012 does not show it.
fn parse_dial(keys: &mut Keys, write: WriteMethod) -> Option<Dial> {
    let text = keys.take_text("dial")?;
    let Some(dial) = Dial::from_text(&text) else {
        keys.add_problem(format!("dial={text}: give the byte with the operator's dial, for example R907 or G12"));
        return None;
    };
    let shared = matches!(write, WriteMethod::Mailbox { .. } | WriteMethod::Direct);
    if shared && dial.area == Area::G && dial.at % 1000 == feed_override::AT {
        keys.add_problem(format!(
            "dial={text}: with this way of writing G12 is what the ladder makes of dial and gateway; let the ladder \
             leave the dial alone in another byte, for example R907"
        ));
        return None;
    }
    Some(dial)
}
