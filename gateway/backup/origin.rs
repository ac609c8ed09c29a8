//! Which box an archive is of. Two boxes may put their archives into one directory; each counts, and removes, its own alone. And what
//! another box has learned comes into force here only when somebody says so.

use super::BackupError;
use adapter_core::unique_id::generate_unique_id;
use gateway_base::files::{read_text, replace_durably};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the file in the data directory. A backup does not hold it: another box that is restored from it stays another one.
const FILE: &str = "box-id";
/// Name of the origin in an archive.
pub(super) const ORIGIN: &str = "box.json";
/// Hexadecimal digits of a number; among a thousand boxes the chance that two have the same one is 1 in 8,000.
const DIGITS: usize = 8;
/// The longest name of a machine in the name of a file, characters.
const NAME_MAX: usize = 30;

/// The box that an archive was taken of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoxOrigin {
    /// Name of its machine.
    pub machine: String,
    /// Its number, made at random when the first backup is taken.
    pub number: String,
}

impl BoxOrigin {
    /// This box. Its number is made where there is none yet.
    ///
    /// # Errors
    /// The number cannot be read or written: without it no archive could be told from those of others.
    pub fn of_box(machine: &str, data_dir: &Path) -> Result<Self, BackupError> {
        let path = data_dir.join(FILE);
        let say = |error| BackupError::File { path: path.clone(), error };
        let number = match read_text(&path, 100) {
            Ok(text) => text.trim().to_owned(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let fresh: String = generate_unique_id().chars().take(DIGITS).collect();
                replace_durably(&path, format!("{fresh}\n")).map_err(say)?;
                fresh
            }
            Err(error) => return Err(say(error)),
        };
        let is_number = number.len() == DIGITS && number.bytes().all(|sign| sign.is_ascii_hexdigit());
        match is_number {
            true => Ok(Self { machine: machine.to_owned(), number }),
            false => Err(say(std::io::Error::other("it holds no number of a box; remove it, and a new one is made"))),
        }
    }

    /// What the names of its archives have in common: machine and number.
    #[must_use]
    pub fn to_file_name_part(&self) -> String {
        let plain = |sign: char| if sign.is_ascii_alphanumeric() { sign } else { '_' };
        let machine: String = self.machine.chars().take(NAME_MAX).map(plain).collect();
        format!("{machine}-{}", self.number)
    }

    /// As it stands in an archive.
    pub(super) fn to_json(&self) -> Vec<u8> {
        serde_json::json!({ "schema": "box/1", "machine": self.machine, "number": self.number })
            .to_string()
            .into_bytes()
    }

    /// What an archive says; `None`: it was taken by an older version, which did not say it.
    pub(super) fn parse(json: &[u8]) -> Option<Self> {
        serde_json::from_slice(json).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_keeps_its_number_and_another_has_another() {
        let (one, two) = (tempfile::tempdir().expect("a directory"), tempfile::tempdir().expect("a directory"));
        let of = |place: &tempfile::TempDir| BoxOrigin::of_box("车床 7/8", place.path());
        let first = of(&one).expect("made");
        assert_eq!(of(&one).expect("read"), first);
        assert_ne!(of(&two).expect("made").number, first.number);
        assert_eq!(BoxOrigin::parse(&first.to_json()), Some(first.clone()));
        let part = first.to_file_name_part();
        assert!(
            part.starts_with("___7_8-") && part.bytes().all(|it| it.is_ascii_alphanumeric() || b"-_".contains(&it)),
            "{part}"
        );
        std::fs::write(one.path().join(FILE), "../../x").expect("written");
        assert!(of(&one).is_err());
        assert_eq!(BoxOrigin::parse(b"nonsense"), None);
    }
}
