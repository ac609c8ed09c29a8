//! The file of a torque sensor.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the file of a torque sensor cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum TorqueFileError {
    /// It is no recording; every problem on a line of its own.
    #[error("{0}")]
    Unreadable(String),
    /// It has no torques.
    #[error(
        "{}: there is no column torque_nm; the file needs time_s, on the sensor's own clock, and torque_nm in N·m",
        file.display()
    )]
    NoTorque {
        /// Absolute path of the torque file.
        file: PathBuf,
    },
    /// It is too short to be laid on the clock of the history.
    #[error("{}: fewer than 10 torques", file.display())]
    TooFew {
        /// Absolute path of the torque file.
        file: PathBuf,
    },
}

/// A torque sensor's file: times on its own clock, s, and torques, N·m.
///
/// # Errors
/// What is wrong with the file.
pub(super) fn torque_course(file: &Path) -> Result<Vec<(f64, f64)>, TorqueFileError> {
    let read = gateway_diagnosis::read_recordings(&[file.display().to_string()], gateway_diagnosis::Copies::Keep)
        .map_err(|problems| TorqueFileError::Unreadable(problems.join("\n")))?;
    let torque =
        read.recording.find_numbers("torque_nm").ok_or_else(|| TorqueFileError::NoTorque { file: file.to_owned() })?;
    let rows = read.recording.time_s.iter().zip(torque.iter());
    let course: Vec<(f64, f64)> = rows.filter_map(|(time_s, torque)| Some((*time_s, torque?))).collect();
    if course.len() < 10 { Err(TorqueFileError::TooFew { file: file.to_owned() }) } else { Ok(course) }
}
