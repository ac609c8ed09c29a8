//! Temperatures of the box's own sensors: chips of the kernel's hwmon, and 1-wire sensors, by names of the user's.
//!
//! ```toml
//! format = "temperatures/1"
//! period_s = 5.0
//!
//! [[point]]
//! channel = "bearing_temperature_c"
//! name = "front spindle bearing"
//! one_wire = "28-0316a2795aff"
//!
//! [[point]]
//! channel = "ambient_temperature_c"
//! name = "air behind the machine"
//! hwmon = "max31865/temp1"         # name of the chip, and of its input
//! offset_c = -0.4                  # as calibrated; 0 when left out
//! ```
//!
//! Sources: kernel documentation, hwmon/sysfs-interface (`tempN_input` in thousandths of a degree) and w1/slaves/w1_therm
//! (`w1_slave`: a first line that ends in YES when the CRC was good, then `t=` in thousandths). A DS18B20 that was just
//! powered says 85.000 °C until it has measured (data sheet, table 1): that is no temperature of a machine in the shop
//! and is given as absent. A point that fails is absent with its reason; the others go on.
//!
//! Limits: 32 points, 64 kB of file, 4 kB per sensor file.

use crate::channel::{self, ChannelId};
use crate::clock::Clock;
use crate::driver::{Fact, Source, SourceError};
use crate::reading::{Absence, Reading, Stamp};
use serde::Deserialize;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;
use thiserror::Error;

const POINTS_MAX: usize = 32;
const FILE_MAX: u64 = 64 * 1024;
const SENSOR_MAX: u64 = 4096;
/// What a DS18B20 says before its first measurement, °C.
const POWER_ON_C: f64 = 85.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    format: String,
    #[serde(default = "five")]
    period_s: f64,
    point: Vec<RawPoint>,
}

fn five() -> f64 {
    5.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPoint {
    channel: String,
    #[serde(default)]
    name: String,
    hwmon: Option<String>,
    one_wire: Option<String>,
    #[serde(default)]
    offset_c: f64,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Sensor {
    /// With the chip's directory of this start of the system, once it has been found.
    Hwmon {
        chip: String,
        input: String,
        found: Option<PathBuf>,
    },
    OneWire(String),
}

struct ProbeChannel {
    channel: ChannelId,
    name: String,
    sensor: Sensor,
    offset_c: f64,
}

/// The sensors of one file as a source.
pub struct Temperatures {
    address: String,
    sys: PathBuf,
    points: Vec<ProbeChannel>,
    channels: Vec<ChannelId>,
    period: Duration,
}

/// Why a file names no sensors.
#[derive(Debug, Error)]
pub enum TemperatureFileError {
    /// The file cannot be read.
    #[error("{}: {error}; write temperature:FILE with a file that names the sensors", .file.display())]
    Unread {
        /// The file of the address.
        file: PathBuf,
        /// What the system said.
        error: io::Error,
    },
    /// Its text is not TOML, or has other keys.
    #[error("{}: {error}", .file.display())]
    NoToml {
        /// The file of the address.
        file: PathBuf,
        /// Line and reason, as the parser says them.
        error: toml::de::Error,
    },
    /// Its values make no sensors.
    #[error("{}: {}", .file.display(), .problems.join("; "))]
    Wrong {
        /// The file of the address.
        file: PathBuf,
        /// Each problem, with what to do.
        problems: Vec<String>,
    },
}

impl Temperatures {
    /// The sensors that `file` names, below `sys` (`/sys` on every Linux).
    ///
    /// # Errors
    /// Everything that is wrong with the file.
    pub fn open(address: &str, file: &Path, sys: &Path) -> Result<Self, TemperatureFileError> {
        let place = || file.to_owned();
        let text = text_of(file, FILE_MAX).map_err(|error| TemperatureFileError::Unread { file: place(), error })?;
        let raw: Raw = toml::from_str(&text).map_err(|error| TemperatureFileError::NoToml { file: place(), error })?;
        let mut problems = Vec::new();
        if raw.format != "temperatures/1" {
            problems.push(format!("format = {:?}: this version reads temperatures/1", raw.format));
        }
        if !(0.1..=3600.0).contains(&raw.period_s) {
            problems.push(format!("period_s = {}: give 0.1 to 3600", raw.period_s));
        }
        if !(1..=POINTS_MAX).contains(&raw.point.len()) {
            problems.push(format!("{} points: there are 1 to {POINTS_MAX}", raw.point.len()));
        }
        let mut points: Vec<ProbeChannel> = Vec::new();
        for (index, raw) in raw.point.iter().enumerate() {
            match parse_point(raw) {
                Ok(point) if points.iter().any(|other| other.channel == point.channel) => {
                    problems.push(format!("point {}: {} is given twice", index + 1, raw.channel));
                }
                Ok(point) => points.push(point),
                Err(problem) => problems.push(format!("point {}: {problem}", index + 1)),
            }
        }
        if !problems.is_empty() {
            return Err(TemperatureFileError::Wrong { file: place(), problems });
        }
        let channels = points.iter().map(|point| point.channel).collect();
        let period = Duration::from_secs_f64(raw.period_s);
        Ok(Self { address: address.to_owned(), sys: sys.to_owned(), points, channels, period })
    }
}

fn parse_point(raw: &RawPoint) -> Result<ProbeChannel, String> {
    let channel = ChannelId::from_name(&raw.channel).filter(|id| id.channel().unit == "°C").ok_or_else(|| {
        let names = channel::CHANNELS.iter().filter(|known| known.unit == "°C").map(|known| known.name);
        let hint = channel::find_nearest_name(&raw.channel, names).map(|near| format!("; did you mean {near}?"));
        format!("no temperature channel {:?}{}", raw.channel, hint.unwrap_or_default())
    })?;
    let plain = |part: &str| !part.is_empty() && !part.contains('/') && !part.starts_with('.');
    let sensor = match (&raw.hwmon, &raw.one_wire) {
        (Some(text), None) => match text.split_once('/').filter(|(chip, input)| plain(chip) && plain(input)) {
            Some((chip, input)) => Sensor::Hwmon { chip: chip.to_owned(), input: input.to_owned(), found: None },
            None => return Err(format!("hwmon = {text:?}: write chip/temp1, see: sensors -u")),
        },
        (None, Some(id)) if plain(id) => Sensor::OneWire(id.clone()),
        (None, Some(id)) => return Err(format!("one_wire = {id:?}: write an entry of /sys/bus/w1/devices")),
        _ => return Err("give hwmon or one_wire, one of the two".to_owned()),
    };
    if !raw.offset_c.is_finite() {
        return Err("offset_c is no number".to_owned());
    }
    Ok(ProbeChannel { channel, name: raw.name.clone(), sensor, offset_c: raw.offset_c })
}

fn text_of(file: &Path, most: u64) -> io::Result<String> {
    let mut text = String::new();
    File::open(file)?.take(most).read_to_string(&mut text)?;
    Ok(text)
}

impl Sensor {
    /// The temperature of the sensor, °C.
    fn read(&mut self, sys: &Path) -> Result<f64, Absence> {
        match self {
            Self::Hwmon { chip, input, found } => {
                if !found.as_deref().is_some_and(|directory| is_chip(directory, chip)) {
                    *found = chip_of(sys, chip);
                }
                read_hwmon(found.as_deref().ok_or(Absence::Disconnected)?, input)
            }
            Self::OneWire(id) => one_wire(sys, id),
        }
    }

    fn describe_location(&self) -> String {
        match self {
            Self::Hwmon { chip, input, .. } => format!("hwmon {chip}/{input}"),
            Self::OneWire(id) => format!("1-wire {id}"),
        }
    }
}

/// The numbers of hwmon directories change from start to start, and when a chip is plugged in; its name does not.
fn chip_of(sys: &Path, chip: &str) -> Option<PathBuf> {
    let entries = std::fs::read_dir(sys.join("class/hwmon")).ok()?;
    entries.filter_map(|entry| Some(entry.ok()?.path())).find(|directory| is_chip(directory, chip))
}

fn is_chip(directory: &Path, chip: &str) -> bool {
    text_of(&directory.join("name"), SENSOR_MAX).is_ok_and(|name| name.trim() == chip)
}

fn read_hwmon(directory: &Path, input: &str) -> Result<f64, Absence> {
    let text =
        text_of(&directory.join(format!("{input}_input")), SENSOR_MAX).map_err(|error| classify_io_error(&error))?;
    parse_thousandths(&text)
}

fn one_wire(sys: &Path, id: &str) -> Result<f64, Absence> {
    let file = sys.join("bus/w1/devices").join(id).join("w1_slave");
    let text = text_of(&file, SENSOR_MAX).map_err(|error| classify_io_error(&error))?;
    let (first, second) = text.trim_end().split_once('\n').ok_or(Absence::OutOfRange)?;
    if !first.trim_end().ends_with("YES") {
        return Err(Absence::OutOfRange);
    }
    let number = parse_thousandths(second.rsplit_once("t=").map(|(_, number)| number).ok_or(Absence::OutOfRange)?)?;
    if (number - POWER_ON_C).abs() < 1e-9 { Err(Absence::NotYetRead) } else { Ok(number) }
}

fn parse_thousandths(text: &str) -> Result<f64, Absence> {
    text.trim().parse::<i32>().map(|number| f64::from(number) / 1000.0).map_err(|_| Absence::OutOfRange)
}

fn classify_io_error(error: &io::Error) -> Absence {
    match error.kind() {
        ErrorKind::NotFound => Absence::Disconnected,
        ErrorKind::PermissionDenied => Absence::Refused,
        _ => Absence::Timeout,
    }
}

impl Source for Temperatures {
    fn name(&self) -> &str {
        &self.address
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let begin = out.len();
        for point in &mut self.points {
            let began_ns = clock.now_ns();
            let read = point.sensor.read(&self.sys);
            let stamp = Stamp::of_request(began_ns, clock.now_ns());
            out.push(match read {
                Ok(number) => Reading::from_number(point.channel, stamp, number + point.offset_c),
                Err(reason) => Reading::from_absence(point.channel, stamp, reason),
            });
        }
        if out[begin..].iter().any(|reading| reading.value.is_ok()) {
            return Ok(());
        }
        Err(SourceError::Line {
            source_name: self.address.clone(),
            what: format!("none of the {} sensors can be read", self.points.len()),
            next: "Look at /sys/class/hwmon/*/name and /sys/bus/w1/devices; is the driver of the sensor loaded?"
                .to_owned(),
        })
    }

    fn collect_facts(&self) -> Vec<Fact> {
        let told = |point: &ProbeChannel| {
            Fact::from_text(point.channel.name(), format!("{} ({})", point.name, point.sensor.describe_location()))
        };
        self.points.iter().map(told).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::ManualClock;

    fn write(path: &Path, text: &str) {
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("made");
        std::fs::write(path, text).expect("written");
    }

    const FILE: &str = "format = \"temperatures/1\"\n\
        [[point]]\nchannel = \"bearing_temperature_c\"\nname = \"front\"\none_wire = \"28-01\"\n\
        [[point]]\nchannel = \"motor_temperature_c\"\none_wire = \"28-02\"\n\
        [[point]]\nchannel = \"ambient_temperature_c\"\nhwmon = \"max31865/temp1\"\noffset_c = -0.5\n";

    #[test]
    fn sensors_are_read_and_what_is_no_temperature_is_absent() {
        let directory = tempfile::tempdir().expect("a directory");
        let (sys, file) = (directory.path().join("sys"), directory.path().join("points.toml"));
        write(&file, FILE);
        let (w1, hwmon) = (sys.join("bus/w1/devices"), sys.join("class/hwmon"));
        write(&w1.join("28-01/w1_slave"), "a2 01 4b 46 7f ff 0c 10 d8 : crc=d8 YES\na2 01 4b t=38125\n");
        write(&w1.join("28-02/w1_slave"), "50 05 4b 46 7f ff 0c 10 1c : crc=1c YES\n50 05 t=85000\n");
        write(&hwmon.join("hwmon0/name"), "coretemp\n");
        write(&hwmon.join("hwmon3/name"), "max31865\n");
        write(&hwmon.join("hwmon3/temp1_input"), "22250\n");
        let mut source = Temperatures::open("temperature:x", &file, &sys).expect("a good file");
        let mut read = || {
            let mut out = Vec::new();
            source.read(&ManualClock::with_time(5), &mut out).map(|()| out)
        };
        let values: Vec<_> = read().expect("some answer").iter().map(|reading| reading.value.clone()).collect();
        let number = |number| Ok(crate::reading::Value::Number(number));
        assert_eq!(values, [number(38.125), Err(Absence::NotYetRead), number(21.75)]);
        write(&w1.join("28-01/w1_slave"), "a2 01 4b 46 7f ff 0c 10 d8 : crc=00 NO\na2 01 4b t=38125\n");
        assert_eq!(read().expect("one answers")[0].value, Err(Absence::OutOfRange));
        std::fs::remove_dir_all(&sys).expect("gone");
        assert!(read().expect_err("nothing answers").to_string().contains("driver of the sensor"));
        assert!(format!("{:?}", source.collect_facts()).contains("front (1-wire 28-01)"));
    }

    #[test]
    fn everything_wrong_with_the_file_is_told_at_once() {
        let directory = tempfile::tempdir().expect("a directory");
        let file = directory.path().join("points.toml");
        let text = FILE.replace("temperatures/1", "temperatures/9").replace("motor_temp", "moter_temp");
        write(&file, &text.replace("max31865/temp1", "../../etc/passwd"));
        let error = Temperatures::open("x", &file, Path::new("/sys")).err().expect("refused").to_string();
        for part in ["temperatures/1", "did you mean motor_temperature_c", "chip/temp1"] {
            assert!(error.contains(part), "{part}: {error}");
        }
    }
}
