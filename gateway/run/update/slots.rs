//! The versions on the disk. Everything that changes which one runs is one rename.

use super::UpdateError;
use std::fs;
use std::io::Write;
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};

/// Name of the slot that belongs to the package.
pub const PACKAGE_SLOT: &str = "package";
/// The program in a slot.
const PROGRAM: &str = "cnc-gateway";

/// A version that runs for the first time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trial {
    /// The slot that ran before.
    pub before: String,
    /// The slot on trial.
    pub new: String,
    /// Starts of the service since.
    pub starts: u32,
}

impl Trial {
    /// `before new starts`, as the script `guard` reads it.
    fn to_line(&self) -> String {
        format!("{} {} {}\n", self.before, self.new, self.starts)
    }

    fn parse(text: &str) -> Option<Self> {
        let mut words = text.split_whitespace();
        let (before, new, starts) = (words.next()?, words.next()?, words.next()?);
        let is_whole = words.next().is_none() && is_slot_name(before) && is_slot_name(new);
        is_whole.then_some(())?;
        Some(Self { before: before.to_owned(), new: new.to_owned(), starts: starts.parse().ok()? })
    }
}

/// May a folder below `versions` be called so? The guard asks the same.
fn is_slot_name(name: &str) -> bool {
    let part = |c: char| c.is_ascii_alphanumeric() || ".+~_-".contains(c);
    name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(part) && name.len() <= 60
}

/// The folder of versions of an installed package.
#[derive(Debug, Clone)]
pub struct VersionSlots {
    home: PathBuf,
}

impl VersionSlots {
    /// The slots below this folder.
    ///
    /// # Errors
    /// No package put anything there.
    pub fn open(home: &Path) -> Result<Self, UpdateError> {
        let slots = Self { home: home.to_owned() };
        match slots.running_slot() {
            Some(_) => Ok(slots),
            None => Err(UpdateError::NotInstalled { path: home.join("current") }),
        }
    }

    /// Name of the slot that the link names.
    #[must_use]
    pub fn running_slot(&self) -> Option<String> {
        let target = fs::read_link(self.home.join("current")).ok()?;
        let name = target.strip_prefix("versions").ok()?.to_str()?.to_owned();
        (is_slot_name(&name) && self.program_path(&name).is_file()).then_some(name)
    }

    /// The program of a slot.
    #[must_use]
    pub fn program_path(&self, slot: &str) -> PathBuf {
        self.home.join("versions").join(slot).join(PROGRAM)
    }

    /// Writes a program where it can be tried, but is not a version yet.
    ///
    /// # Errors
    /// The disk is full, or this user may not write there.
    pub fn stage_program(&self, program: &[u8]) -> Result<PathBuf, UpdateError> {
        let folder = self.home.join("versions").join(".staged");
        let _none_left = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).map_err(UpdateError::file_error(&folder))?;
        let path = folder.join(PROGRAM);
        let written = || -> std::io::Result<()> {
            let mut file = fs::OpenOptions::new().write(true).create_new(true).mode(0o755).open(&path)?;
            file.write_all(program)?;
            file.sync_all()?;
            sync_folder(&folder)
        };
        written().map_err(UpdateError::file_error(&path))?;
        Ok(path)
    }

    /// Makes the staged program a version. One of this name that does not run is replaced.
    ///
    /// # Errors
    /// It runs, or the system refuses.
    pub fn keep_staged(&self, slot: &str) -> Result<(), UpdateError> {
        let versions = self.home.join("versions");
        let (staged, kept) = (versions.join(".staged"), versions.join(slot));
        if !is_slot_name(slot) || slot == PACKAGE_SLOT {
            return Err(UpdateError::DoesNotRun(format!("its version {slot:?} is no name of a folder")));
        }
        if self.running_slot().as_deref() == Some(slot) {
            return Err(UpdateError::Older { new: slot.to_owned(), running: slot.to_owned() });
        }
        let replaced = || -> std::io::Result<()> {
            if kept.exists() {
                fs::remove_dir_all(&kept)?;
            }
            fs::rename(&staged, &kept)?;
            sync_folder(&versions)
        };
        replaced().map_err(UpdateError::file_error(&kept))
    }

    /// The version on trial, where there is one.
    #[must_use]
    pub fn read_trial(&self) -> Option<Trial> {
        Trial::parse(&fs::read_to_string(self.home.join("trial")).ok()?)
    }

    /// Notes that a version is on trial. Must stand on the disk before the link is moved.
    ///
    /// # Errors
    /// The disk is full, or this user may not write there.
    pub fn begin_trial(&self, trial: &Trial) -> Result<(), UpdateError> {
        let path = self.home.join("trial");
        gateway_base::files::replace_durably(&path, &trial.to_line()).map_err(UpdateError::file_error(&path))
    }

    /// The trial is over.
    ///
    /// # Errors
    /// This user may not write there.
    pub fn end_trial(&self) -> Result<(), UpdateError> {
        let path = self.home.join("trial");
        match fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(UpdateError::File { path, error }),
            _ => sync_folder(&self.home).map_err(UpdateError::file_error(&self.home)),
        }
    }

    /// Makes a slot the one that runs at the next start, in one step.
    ///
    /// # Errors
    /// The system refuses.
    pub fn switch_to(&self, slot: &str) -> Result<(), UpdateError> {
        let (fresh, current) = (self.home.join("current.new"), self.home.join("current"));
        let moved = || -> std::io::Result<()> {
            let _none_left = fs::remove_file(&fresh);
            symlink(Path::new("versions").join(slot), &fresh)?;
            fs::rename(&fresh, &current)?;
            sync_folder(&self.home)
        };
        moved().map_err(UpdateError::file_error(&current))
    }

    /// Removes versions that neither run nor ran before, but never that of the package.
    pub fn remove_others(&self, keep: &[&str]) {
        let Ok(entries) = fs::read_dir(self.home.join("versions")) else { return };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if name != PACKAGE_SLOT && !keep.contains(&name.as_str()) {
                // What cannot be removed costs disk space only; the next update tries again.
                let _left = fs::remove_dir_all(entry.path());
            }
        }
    }
}

fn sync_folder(path: &Path) -> std::io::Result<()> {
    fs::File::open(path)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn installed() -> (tempfile::TempDir, VersionSlots) {
        let home = tempfile::tempdir().expect("a directory");
        let package = home.path().join("versions").join(PACKAGE_SLOT);
        fs::create_dir_all(&package).expect("made");
        fs::write(package.join(PROGRAM), "old").expect("written");
        symlink("versions/package", home.path().join("current")).expect("linked");
        let slots = VersionSlots::open(home.path()).expect("installed");
        (home, slots)
    }

    #[test]
    fn a_version_is_staged_kept_tried_and_taken_back() {
        let (home, slots) = installed();
        slots.stage_program(b"new").expect("staged");
        slots.keep_staged("0.3.0").expect("kept");
        let trial = Trial { before: PACKAGE_SLOT.to_owned(), new: "0.3.0".to_owned(), starts: 0 };
        slots.begin_trial(&trial).expect("noted");
        slots.switch_to("0.3.0").expect("switched");
        assert_eq!(slots.running_slot().as_deref(), Some("0.3.0"));
        assert_eq!(slots.read_trial(), Some(trial));
        assert_eq!(fs::read(home.path().join("current").join(PROGRAM)).expect("read"), b"new");
        slots.switch_to(PACKAGE_SLOT).expect("switched");
        slots.end_trial().expect("over");
        slots.end_trial().expect("over twice");
        slots.remove_others(&[PACKAGE_SLOT]);
        assert_eq!((slots.running_slot().as_deref(), slots.read_trial()), (Some(PACKAGE_SLOT), None));
        assert!(!slots.program_path("0.3.0").exists());
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        let (_home, slots) = installed();
        slots.stage_program(b"new").expect("staged");
        for name in ["../evil", "", ".hidden", "a/b", PACKAGE_SLOT] {
            assert!(slots.keep_staged(name).is_err(), "{name}");
        }
        assert_eq!(Trial::parse("package ../../x 0"), None);
        assert_eq!(Trial::parse("package 0.3.0 1 more"), None);
        assert!(Trial::parse("package 0.3.0 1").is_some());
    }
}
