//! From an address to something that can be read.

use crate::address::{
    Address, FanucBackend, MtConnectTarget, ReplayTarget, SimulatedDevice, SimulatedTarget, Speed, Target,
};
use crate::clock::TimeNs;
use crate::driver::{Actuator, Pull, Source};
use crate::eda9033a::Eda9033a;
use crate::modbus::ModbusMeter;
use crate::mtconnect::MtConnectSource;
use crate::offset::OffsetSink;
use crate::recording::{RecordingError, RowProblem, read_path};
use crate::replay::{LiveReplay, Replay};
use crate::simulated::{Simulated, SimulatedSettings};
use crate::temperature::Temperatures;
use adapter_core::integer::widen_to_u64;
use adapter_core::{OpenedDevice, UnreadableSecret};
use std::fmt::Display;
use thiserror::Error;

/// Why an address could not be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A file with a password cannot be read.
    #[error(transparent)]
    Secret(#[from] UnreadableSecret),
    /// What the address says does not go together, or names something that is not there.
    #[error("{address}: {what}")]
    Refused {
        /// The address, as in the configuration.
        address: String,
        /// Why, and what to do.
        what: String,
    },
    /// The address needs another way of running.
    #[error("{address}: {what}")]
    Unsuitable {
        /// The address, as in the configuration.
        address: String,
        /// Why, and what to do.
        what: &'static str,
    },
}

/// What an address opens: sources that live by the clock.
pub struct Opened {
    /// In the order of precedence.
    pub sources: Vec<Box<dyn Source>>,
    /// The way to the feed override, where there is one. Only the gate may hold it.
    pub actuator: Option<Box<dyn Actuator>>,
    /// The way to the external work offsets, where there is one. Only the gate may hold it.
    pub offsets: Option<Box<dyn OffsetSink>>,
    /// The built-in machine, for serving it and for scoring.
    pub simulated: Option<Simulated>,
    /// Refused rows of a recording.
    pub refused: Refused,
}

impl From<OpenedDevice> for Opened {
    fn from(device: OpenedDevice) -> Self {
        let OpenedDevice { sources, actuator, offsets } = device;
        Self { sources, actuator, offsets, simulated: None, refused: Refused::default() }
    }
}

/// What an address opens for a run as fast as possible.
pub struct OpenedPull {
    /// In the order of precedence.
    pub sources: Vec<Box<dyn Pull>>,
    /// The way to the feed override, where there is one.
    pub actuator: Option<Box<dyn Actuator>>,
    /// The way to the external work offsets, where there is one.
    pub offsets: Option<Box<dyn OffsetSink>>,
    /// The built-in machine, for scoring.
    pub simulated: Option<Simulated>,
    /// Refused rows of a recording.
    pub refused: Refused,
    /// Rows of the recordings, for a progress bar; 0 for the built-in machine, which never ends.
    pub rows: u64,
    /// Columns of the recording that are no channel of the gateway.
    pub ignored: Vec<String>,
}

/// Rows of a recording that could not be used.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Refused {
    /// How many rows were refused.
    pub rows: u64,
    /// At most a hundred of them, with line, column and reason.
    pub problems: Vec<RowProblem>,
}

/// Opens an address for a live run. `now_ns` is where the built-in machine begins its day. A recording is replayed at
/// its speed from the first poll on.
///
/// # Errors
/// See [`OpenError`]; a recording at `speed=max` cannot live by a clock.
pub fn open_address(address: &Address, now_ns: TimeNs) -> Result<Opened, OpenError> {
    match address.target() {
        Target::Simulated(target) => Ok(open_simulated(address, target, now_ns)),
        Target::Replay(target) => open_replay(address, target, now_ns),
        Target::Fanuc { at, path, backend, options } => {
            let opened = match backend {
                FanucBackend::Native => crate::fanuc::open::open_native(address.text(), at, *path, options),
                FanucBackend::Vendor(library) => {
                    crate::fanuc::open::open_vendor(address.text(), library, at, *path, options)
                }
            };
            if let Some(what) = opened.refused {
                return Err(OpenError::Refused { address: address.text().to_owned(), what });
            }
            let (sources, actuator, offsets) = (opened.sources, opened.actuator, opened.offsets);
            Ok(Opened { sources, actuator, offsets, simulated: None, refused: Refused::default() })
        }
        Target::NcLink(target) => Ok(crate::nclink::open_address(address.text(), target)?.into()),
        Target::HncNet(target) => Ok(crate::hnc::open_address(address.text(), target).into()),
        Target::MtConnect(target) => Ok(open_agent(address, target)),
        Target::ModbusTcp { at, meter } => read_only(address, ModbusMeter::with_tcp_line(address.text(), at, meter)),
        Target::ModbusRtu { line, meter } => {
            read_only(address, ModbusMeter::with_rtu_line(address.text(), line, meter))
        }
        Target::Eda9033a { line, meter } => read_only(address, Eda9033a::new(address.text(), line, meter)),
        Target::Temperature { file, sys } => read_only(address, Temperatures::open(address.text(), file, sys)),
        other => Err(not_built(address, other)),
    }
}

/// A device behind an agent, which is connected to at the first poll.
fn open_agent(address: &Address, target: &MtConnectTarget) -> Opened {
    let sources: Vec<Box<dyn Source>> = vec![Box::new(MtConnectSource::new(address.text(), target))];
    OpenedDevice { sources, actuator: None, offsets: None }.into()
}

/// A device that is read and never written.
fn read_only<S, E>(address: &Address, source: Result<S, E>) -> Result<Opened, OpenError>
where
    S: Source + 'static,
    E: Display,
{
    let refused = |error: E| OpenError::Refused { address: address.text().to_owned(), what: error.to_string() };
    let sources: Vec<Box<dyn Source>> = vec![Box::new(source.map_err(refused)?)];
    Ok(Opened { sources, actuator: None, offsets: None, simulated: None, refused: Refused::default() })
}

/// Opens an address for a run as fast as possible, where a recording without dates and the built-in machine begin at
/// `origin_ns`.
///
/// # Errors
/// See [`OpenError`]; a real device cannot be read faster than it lives.
pub fn open_pull(address: &Address, origin_ns: TimeNs) -> Result<OpenedPull, OpenError> {
    match address.target() {
        Target::Simulated(target) => Ok(simulated_pull(address, target, origin_ns)),
        Target::Replay(target) => {
            let (replay, refused) = read(address, target, origin_ns)?;
            let (rows, ignored) = (widen_to_u64(replay.count_rows()), replay.ignored_columns().to_vec());
            let sources: Vec<Box<dyn Pull>> = vec![Box::new(replay)];
            Ok(OpenedPull { sources, actuator: None, offsets: None, simulated: None, refused, rows, ignored })
        }
        other => Err(not_built(address, other)),
    }
}

fn open_simulated(address: &Address, target: &SimulatedTarget, now_ns: TimeNs) -> Opened {
    let machine =
        Simulated::new(address.text(), SimulatedSettings::from_target(target), compute_day_start_ns(target, now_ns));
    let mut sources: Vec<Box<dyn Source>> = Vec::new();
    if target.device != SimulatedDevice::Meter {
        sources.push(Box::new(machine.controller()));
    }
    if target.device != SimulatedDevice::Controller {
        sources.push(Box::new(machine.meter()));
    }
    let (actuator, offsets) = (build_actuator(&machine, target), build_offset_sink(&machine, target));
    Opened { sources, actuator, offsets, simulated: Some(machine), refused: Refused::default() }
}

/// When the machine's day began.
pub fn compute_day_start_ns(target: &SimulatedTarget, now_ns: TimeNs) -> TimeNs {
    #[expect(clippy::cast_possible_truncation, reason = "at most a day")]
    let begun_ns = (target.begun_s * 1e9) as i64;
    now_ns.saturating_sub(begun_ns)
}

fn simulated_pull(address: &Address, target: &SimulatedTarget, origin_ns: TimeNs) -> OpenedPull {
    let machine =
        Simulated::new(address.text(), SimulatedSettings::from_target(target), compute_day_start_ns(target, origin_ns));
    let mut sources: Vec<Box<dyn Pull>> = Vec::new();
    if target.device != SimulatedDevice::Meter {
        sources.push(Box::new(machine.controller()));
    }
    if target.device != SimulatedDevice::Controller {
        sources.push(Box::new(machine.meter()));
    }
    OpenedPull {
        sources,
        actuator: build_actuator(&machine, target),
        offsets: build_offset_sink(&machine, target),
        simulated: Some(machine),
        refused: Refused::default(),
        rows: 0,
        ignored: Vec::new(),
    }
}

fn build_actuator(machine: &Simulated, target: &SimulatedTarget) -> Option<Box<dyn Actuator>> {
    (target.device != SimulatedDevice::Meter).then(|| Box::new(machine.feed_override()) as Box<dyn Actuator>)
}

fn build_offset_sink(machine: &Simulated, target: &SimulatedTarget) -> Option<Box<dyn OffsetSink>> {
    (target.device != SimulatedDevice::Meter).then(|| Box::new(machine.offsets()) as Box<dyn OffsetSink>)
}

fn open_replay(address: &Address, target: &ReplayTarget, now_ns: TimeNs) -> Result<Opened, OpenError> {
    let Speed::Times(speed) = target.speed else {
        let what = "speed=max needs the replay command; give a factor here, for example speed=10";
        return Err(OpenError::Unsuitable { address: address.text().to_owned(), what });
    };
    let (replay, refused) = read(address, target, now_ns)?;
    let sources: Vec<Box<dyn Source>> = vec![Box::new(LiveReplay::new(replay, speed))];
    Ok(Opened { sources, actuator: None, offsets: None, simulated: None, refused })
}

fn read(address: &Address, target: &ReplayTarget, origin_ns: TimeNs) -> Result<(Replay, Refused), RecordingError> {
    let read = read_path(&target.file)?;
    let replay = Replay::new(address.text(), &read.recording, origin_ns);
    Ok((replay, Refused { rows: read.refused, problems: read.problems }))
}

fn not_built(address: &Address, target: &Target) -> OpenError {
    let address = address.text().to_owned();
    let what = match target {
        Target::Waveform { .. } => "a stream of samples becomes a channel in the box only: run and doctor read it",
        _ => "a real device keeps its own pace: run reads it, without --speed",
    };
    OpenError::Unsuitable { address, what }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn address(text: &str) -> Address {
        text.parse().expect("usable")
    }

    fn file(text: &str) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
        file.write_all(text.as_bytes()).expect("writable");
        file
    }

    #[test]
    fn the_simulated_machine_opens_as_two_sources_and_an_actuator() {
        let opened = open_address(&address("simulated://mill?seed=3"), 0).expect("opens");
        let names: Vec<&str> = opened.sources.iter().map(|source| source.name()).collect();
        assert_eq!(names, ["simulated://mill?seed=3&device=controller", "simulated://mill?seed=3&device=meter"]);
        assert!(opened.actuator.is_some() && opened.simulated.is_some());
        let meter = open_pull(&address("simulated://lathe?device=meter"), 0).expect("opens");
        assert!(meter.sources.len() == 1 && meter.actuator.is_none());
    }

    #[test]
    fn a_recording_opens_with_its_refused_rows() {
        let file = file("time_s,spindle_speed_rpm,odd_v\n0,1,1\n1,x,1\n2,3,1\n");
        let address = address(&format!("replay:{}?speed=max", file.path().display()));
        let opened = open_pull(&address, 0).expect("opens");
        assert_eq!((opened.rows, opened.refused.rows, opened.ignored), (2, 1, vec!["odd_v".to_owned()]));
        assert!(open_address(&address, 0).is_err_and(|error| error.to_string().contains("speed=10")));
    }

    #[test]
    fn what_cannot_be_opened_says_why() {
        let of = |text: &str| open_address(&address(text), 0).err().map(|error| error.to_string()).unwrap_or_default();
        let stream = of("waveform://cnc:5000");
        assert!(stream.contains("waveform://cnc") && stream.contains("doctor"), "{stream}");
        assert!(
            open_address(&address("nclinks://broker:8883/SIM0001"), 0).is_ok(),
            "a broker over TLS is connected to later"
        );
        assert!(open_pull(&address("replay:/does/not/exist.csv"), 0).is_err());
    }
}
