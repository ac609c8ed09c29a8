//! What only a person can measure: flank wear under the microscope, a gauge, a probe, the file of a torque sensor.
//!
//! One line of JSON each in `annotations.jsonl` of the data directory; lines are added and never changed.

use super::torque_file::{TorqueFileError, torque_course};
use adapter_core::clock::TimeNs;
use clap::ValueEnum;
use gateway_base::moment::{self, MomentError};
use serde::{Deserialize, Serialize};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The file, in the data directory.
pub const FILE: &str = "annotations.jsonl";
/// More lines than this are not read: nobody measures so much by hand.
const LINES_MAX: usize = 100_000;

/// What a person can measure at the machine; each quantity has a unit and a range of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Flank wear of the edge in use, under the microscope.
    FlankWear,
    /// Displacement of the tool against the work, on a dial gauge.
    Gauge,
    /// The same, by a probe.
    Probe,
    /// The file of a torque sensor at the spindle, on its own clock.
    Torque,
}

impl Quantity {
    /// The word on the command line.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::FlankWear => "flank-wear",
            Self::Gauge => "gauge",
            Self::Probe => "probe",
            Self::Torque => "torque",
        }
    }

    /// Unit in which it is kept.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::FlankWear => "mm",
            Self::Gauge | Self::Probe => "um",
            Self::Torque => "N·m",
        }
    }

    /// Values that can be, in that unit, and where the limits come from.
    fn allowed_range(self) -> (f64, f64, &'static str) {
        match self {
            Self::FlankWear => (0.0, 2.0, "an edge with more flank wear than 2 mm has broken"),
            Self::Gauge | Self::Probe => (-2000.0, 2000.0, "no machine tool grows by more than 2 mm"),
            Self::Torque => (-100_000.0, 100_000.0, "the range of the channel torque_nm"),
        }
    }
}

/// One reading that a person noted, as one line of the notes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Annotation {
    /// What was measured; decides unit and range of `value`.
    pub quantity: Quantity,
    /// When, ns since 1970; for a file when it was given, its own clock says the rest.
    pub at_ns: TimeNs,
    /// The value in the unit of [`Quantity::unit`]; none for a file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Standard deviation of the reading, same unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
    /// The file of a torque sensor; `None` for every other quantity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Edge, axis or sensor, in the person's words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub of: String,
}

/// What a person typed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TypedAnnotation {
    /// The number in `unit`; `None` for a file.
    pub value: Option<f64>,
    /// Unit symbol as typed; `None` where none was given.
    pub unit: Option<String>,
    /// Instant as typed; `None` only where `file` is given.
    pub at: Option<String>,
    /// Standard deviation, same unit.
    pub sd: Option<f64>,
    /// The file of a torque sensor, as typed.
    pub file: Option<PathBuf>,
    /// Edge, axis or sensor.
    pub of: String,
}

/// How a torque file is noted, for messages.
const TORQUE_USAGE: &str =
    "write annotate torque --file sensor.csv --unit Nm; the file has columns time_s (its own clock) and torque_nm";

/// Why a reading is not noted, or the notes cannot be read.
#[derive(Debug, Error)]
pub enum AnnotationError {
    /// Neither a value nor a file was given.
    #[error("{name}: the value is missing: write annotate {name} 0.12 --unit mm")]
    NoValue {
        /// Word of the quantity on the command line.
        name: &'static str,
    },
    /// A number without a unit means nothing.
    #[error("{name} {value}: the unit is missing, and 0.12 mm is not 0.12 um: add --unit mm or --unit um")]
    NoUnit {
        /// Word of the quantity on the command line.
        name: &'static str,
        /// The number as typed, in no unit.
        value: f64,
    },
    /// The unit is none of a length.
    #[error("{name} {value} {unit}: {unit:?} is no unit of length that is known here: write mm, um or in")]
    UnknownUnit {
        /// Word of the quantity on the command line.
        name: &'static str,
        /// The number as typed.
        value: f64,
        /// The unit that was typed.
        unit: String,
    },
    /// A reading without a time belongs to no cut.
    #[error(
        "{name} {value} {unit}: the time is missing: a reading without it belongs to no cut; add --at now, --at -10m or --at 2026-01-31T08:15:00Z"
    )]
    NoTime {
        /// Word of the quantity on the command line.
        name: &'static str,
        /// The number as typed, in `unit`.
        value: f64,
        /// The unit that was typed.
        unit: String,
    },
    /// The time is none.
    #[error("{name} --at {at}: {error}")]
    Moment {
        /// Word of the quantity on the command line.
        name: &'static str,
        /// The instant as typed.
        at: String,
        /// What is wrong with it.
        error: MomentError,
    },
    /// No such value is read on a machine.
    #[error("{name}: {value} {unit} lies outside {least} to {greatest} {unit}: {why}; is the unit right?")]
    OutOfRange {
        /// Word of the quantity on the command line.
        name: &'static str,
        /// The value, in the unit that is kept.
        value: f64,
        /// The unit that is kept.
        unit: &'static str,
        /// The least possible value.
        least: f64,
        /// The greatest possible value.
        greatest: f64,
        /// Where the range comes from.
        why: &'static str,
    },
    /// A deviation of 0 or less.
    #[error("{name}: the standard deviation of a reading is greater than 0")]
    Deviation {
        /// Word of the quantity on the command line.
        name: &'static str,
    },
    /// Torques come in a file.
    #[error("torque: the file is missing: {TORQUE_USAGE}")]
    NoTorqueFile,
    /// The unit of the torques is not said.
    #[error("torque {}: the unit is missing: {TORQUE_USAGE}", file.display())]
    NoTorqueUnit {
        /// Path of the torque file, as typed.
        file: PathBuf,
    },
    /// Torques are kept in N·m.
    #[error("torque: {unit:?} is not N·m: convert the file, then {TORQUE_USAGE}")]
    TorqueUnit {
        /// The unit that was typed.
        unit: String,
    },
    /// The file of the torques cannot be used.
    #[error(transparent)]
    TorqueFile(#[from] TorqueFileError),
    /// A file cannot be found, read or written.
    #[error("{}: {error}", path.display())]
    File {
        /// Path of the notes or of a torque file.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// A reading that cannot be written as a line.
    #[error(transparent)]
    Line(#[from] serde_json::Error),
    /// A line of the notes that is none.
    #[error("{}, line {number}: {error}; put the line right or take it out", path.display())]
    WrongLine {
        /// Path of the notes.
        path: PathBuf,
        /// Its number, from 1.
        number: usize,
        /// What is wrong with it.
        error: serde_json::Error,
    },
}

/// An annotation of what a person typed; `newest_ns` is the time of the newest sample of the history.
///
/// # Errors
/// What is missing or impossible, and what to write.
pub fn parse_annotation(
    quantity: Quantity,
    given: TypedAnnotation,
    newest_ns: TimeNs,
) -> Result<Annotation, AnnotationError> {
    if quantity == Quantity::Torque {
        return parse_torque(given, newest_ns);
    }
    let name = quantity.as_word();
    let value = given.value.ok_or(AnnotationError::NoValue { name })?;
    let unit = given.unit.as_deref().ok_or(AnnotationError::NoUnit { name, value })?;
    let factor = length_factor(unit, quantity.unit()).ok_or_else(|| AnnotationError::UnknownUnit {
        name,
        value,
        unit: unit.to_owned(),
    })?;
    let at = given.at.as_deref().ok_or_else(|| AnnotationError::NoTime { name, value, unit: unit.to_owned() })?;
    let at_ns =
        moment::parse(at, newest_ns).map_err(|error| AnnotationError::Moment { name, at: at.to_owned(), error })?;
    let value = value * factor;
    let (least, greatest, why) = quantity.allowed_range();
    if !(least..=greatest).contains(&value) {
        let unit = quantity.unit();
        return Err(AnnotationError::OutOfRange { name, value, unit, least, greatest, why });
    }
    let sd = given.sd.map(|sd| sd * factor);
    if sd.is_some_and(|sd| !(sd.is_finite() && sd > 0.0)) {
        return Err(AnnotationError::Deviation { name });
    }
    Ok(Annotation { quantity, at_ns, value: Some(value), sd, file: None, of: given.of })
}

fn parse_torque(given: TypedAnnotation, newest_ns: TimeNs) -> Result<Annotation, AnnotationError> {
    let file = given.file.ok_or(AnnotationError::NoTorqueFile)?;
    match given.unit.as_deref() {
        None => return Err(AnnotationError::NoTorqueUnit { file }),
        Some("Nm" | "N·m" | "N*m" | "N m") => {}
        Some(other) => return Err(AnnotationError::TorqueUnit { unit: other.to_owned() }),
    }
    let file = std::path::absolute(&file).map_err(|error| AnnotationError::File { path: file.clone(), error })?;
    torque_course(&file)?;
    Ok(Annotation {
        quantity: Quantity::Torque,
        at_ns: newest_ns,
        value: None,
        sd: None,
        file: Some(file),
        of: given.of,
    })
}

/// Lengths of `from` in those of `to`.
fn length_factor(from: &str, to: &str) -> Option<f64> {
    let in_um = match from {
        "mm" => 1000.0,
        "um" | "µm" | "μm" => 1.0,
        "in" | "inch" => 25_400.0,
        _ => return None,
    };
    Some(if to == "mm" { in_um / 1000.0 } else { in_um })
}

/// Adds a line.
///
/// # Errors
/// What the system said, with the path.
pub fn add(data_dir: &Path, annotation: &Annotation) -> Result<(), AnnotationError> {
    let path = data_dir.join(FILE);
    let say = |error| AnnotationError::File { path: path.clone(), error };
    let line = serde_json::to_string(annotation)?;
    std::fs::create_dir_all(data_dir).map_err(say)?;
    let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&path).map_err(say)?;
    file.write_all(format!("{line}\n").as_bytes()).and_then(|()| file.sync_data()).map_err(say)
}

/// Every annotation, by time.
///
/// # Errors
/// A line that is none, with its number.
pub fn read(data_dir: &Path) -> Result<Vec<Annotation>, AnnotationError> {
    let path = data_dir.join(FILE);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(AnnotationError::File { path, error }),
    };
    let lines = text.lines().take(LINES_MAX).enumerate().filter(|(_, line)| !line.trim().is_empty());
    let one = |(index, line): (usize, &str)| {
        serde_json::from_str::<Annotation>(line).map_err(|error| AnnotationError::WrongLine {
            path: path.clone(),
            number: index + 1,
            error,
        })
    };
    let mut all = lines.map(one).collect::<Result<Vec<_>, _>>()?;
    all.sort_by_key(|annotation| annotation.at_ns);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(value: f64, unit: Option<&str>, at: Option<&str>) -> TypedAnnotation {
        TypedAnnotation {
            value: Some(value),
            unit: unit.map(str::to_owned),
            at: at.map(str::to_owned),
            ..TypedAnnotation::default()
        }
    }

    #[test]
    fn a_reading_needs_unit_and_time_and_must_be_possible() {
        let refused = |given| parse_annotation(Quantity::Gauge, given, 0).expect_err("refused").to_string();
        assert!(refused(given(12.0, None, Some("now"))).contains("unit is missing"));
        assert!(refused(given(12.0, Some("um"), None)).contains("time is missing"));
        assert!(refused(given(12.0, Some("kg"), Some("now"))).contains("mm, um or in"));
        assert!(refused(given(12.0, Some("mm"), Some("now"))).contains("is the unit right?"));
        assert!(refused(TypedAnnotation::default()).contains("value is missing"));
        let torque =
            parse_annotation(Quantity::Torque, TypedAnnotation::default(), 0).expect_err("no file").to_string();
        assert!(torque.contains("--file"), "{torque}");
    }

    #[test]
    fn what_was_added_is_read_by_time() {
        let directory = tempfile::tempdir().expect("a directory");
        for (value, at) in [(0.2, "2026-01-02"), (0.1, "2026-01-01")] {
            let one = parse_annotation(Quantity::FlankWear, given(value, Some("mm"), Some(at)), 0).expect("fine");
            add(directory.path(), &one).expect("written");
        }
        let all = read(directory.path()).expect("readable");
        assert_eq!(all.iter().filter_map(|it| it.value).collect::<Vec<f64>>(), [0.1, 0.2]);
        std::fs::write(directory.path().join(FILE), "{}\n").expect("written");
        assert!(read(directory.path()).expect_err("not one").to_string().contains("line 1"));
    }
}
