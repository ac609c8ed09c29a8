//! From an address to sources and the way to the feed override.

use super::actuator::FanucActuator;
use super::allow_list::{AllowList, Allowed};
use super::extra;
use super::feed_override;
use super::item::Area;
use super::line::{Connect, FanucLine};
use super::manner::Manner;
use super::native::{Native, NativeSettings};
use super::poll;
use super::poll_period::SharedPace;
use super::source::FanucSource;
use super::vendor::{Vendor, VendorSettings};
use super::work_offset::ExternalOffsets;
use crate::address::{FanucOptions, WriteMethod};
use adapter_core::address::Endpoint;
use adapter_core::driver::{Actuator, Source};
use adapter_core::offset::OffsetSink;
use adapter_core::own::ReadWith;
use std::path::Path;

/// What an address opens.
pub struct OpenedFanuc {
    /// The groups, the quick one first.
    pub sources: Vec<Box<dyn Source>>,
    /// The way to the feed override, where the address names one.
    pub actuator: Option<Box<dyn Actuator>>,
    /// The way to the external work offsets, where the address allows `EXT`.
    pub offsets: Option<Box<dyn OffsetSink>>,
    /// The connection they share.
    pub line: FanucLine,
    /// Why further channels could not be added; none of them is read then.
    pub refused: Option<String>,
}

/// Opens a controller that we talk to ourselves. Nothing is sent before the first poll.
#[must_use]
pub fn open_native(name: &str, at: &Endpoint, path: u8, options: &FanucOptions) -> OpenedFanuc {
    let settings = NativeSettings { endpoint: at.clone(), path, timeout: options.timeout, encoding: options.encoding };
    let connect: Connect = Box::new(move || Ok(Box::new(Native::connect(settings.clone())?)));
    open_controller(name, connect, path, options)
}

/// Opens a controller through the vendor's library, in a child process. Nothing is loaded before the first poll.
#[must_use]
pub fn open_vendor(name: &str, library: &Path, at: &Endpoint, path: u8, options: &FanucOptions) -> OpenedFanuc {
    let settings = VendorSettings {
        vendor_library: library.to_owned(),
        endpoint: at.clone(),
        path,
        timeout: options.timeout,
        encoding: options.encoding,
        deadline: None,
        program: None,
        environment: Vec::new(),
    };
    let connect: Connect = Box::new(move || Ok(Box::new(Vendor::connect(settings.clone())?)));
    open_controller(name, connect, path, options)
}

/// Opens a controller through any way of talking to it.
#[must_use]
pub fn open_controller(name: &str, connect: Connect, path: u8, options: &FanucOptions) -> OpenedFanuc {
    let line = FanucLine::new(
        name,
        connect,
        (path, options.further.clone()),
        build_allow_list(options, path),
        options.duty_pct,
    );
    let manner = Manner {
        path,
        second_override: matches!(options.write, WriteMethod::SecondOverride { .. }),
        power_diagnosis: options.power_diagnosis,
        dial: options.dial,
    };
    let pace = SharedPace::new(options.duty_pct);
    let (extras, refused) = match extra::declare_channels(options, path) {
        Ok(extras) => (extras, None),
        Err((channel, error)) => (Vec::new(), Some(format!("channel {channel}: {error}"))),
    };
    let of = |pace| extras.iter().filter(move |(own, _)| *own == pace).map(|(_, extra)| extra.clone()).collect();
    let sources: Vec<Box<dyn Source>> = vec![
        Box::new(FanucSource::with_fast_group(name, line.clone(), manner, options, &pace, of(ReadWith::Fast))),
        Box::new(FanucSource::with_slow_group(name, line.clone(), manner, options, &pace, of(ReadWith::Slow))),
    ];
    let actuator = FanucActuator::new(name, line.clone(), path, options);
    let actuator = actuator.map(|actuator| Box::new(actuator) as Box<dyn Actuator>);
    let shiftable = options.allow.iter().any(|text| Allowed::read(text) == Some(Allowed::ExternalOffset));
    let offsets = shiftable.then(|| Box::new(ExternalOffsets::new(name, line.clone())) as Box<dyn OffsetSink>);
    OpenedFanuc { sources, actuator, offsets, line, refused }
}

/// What the way of writing needs, and what the address allows besides. Without a way of writing the feed override there is
/// nothing but the external offset.
fn build_allow_list(options: &FanucOptions, path: u8) -> AllowList {
    let own = match options.write {
        WriteMethod::None => {
            return AllowList(parse_allowed(options).filter(|it| *it == Allowed::ExternalOffset).collect());
        }
        WriteMethod::Mailbox { area, at } => Allowed::from_byte_range(area, at, 3),
        WriteMethod::SecondOverride { area, at } => Allowed::from_byte_range(area, at, 1),
        WriteMethod::Macro { variable } => Allowed::Macros { from: variable, to: variable },
        WriteMethod::Direct => Allowed::from_byte_range(Area::G, poll::find_signal_address(feed_override::AT, path), 1),
    };
    let request = options.request.map(|(area, at)| Allowed::from_byte_range(area, at, 1));
    AllowList(std::iter::once(own).chain(request).chain(parse_allowed(options)).collect())
}

fn parse_allowed(options: &FanucOptions) -> impl Iterator<Item = Allowed> {
    options.allow.iter().filter_map(|text| Allowed::read(text))
}
