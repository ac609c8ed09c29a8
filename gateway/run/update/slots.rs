//! The versions on the disk. Everything that changes which one runs is one rename.

use super::UpdateError;
use std::fs;
use std::io::Write;
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};

/// The file in the data directory in which the service confirms a version: the name of its slot.
pub(super) const CONFIRMED: &str = "confirmed";

/// Name of the slot that belongs to the package.
pub const PACKAGE_SLOT: &str = "package";
/// The program in a slot.
const PROGRAM: &str = "cnc-gateway";
/// Starts that a version on trial has. A folder holds one empty file for each that is left: the guard removes one before each start, which
/// needs no room on the disk.
pub(super) const TRIAL_STARTS: u32 = 3;
/// The folder of these files.
const STARTS_LEFT: &str = "starts-left";
/// The link that takes the place of `current` when a trial fails: laid ready before the trial, so that going back is one rename.
const WAY_BACK: &str = "way-back";
/// What the guard makes of the file of a trial that has failed.
const ROLLED_BACK: &str = "rolled-back";

/// A version that runs for the first time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trial {
    /// The slot that ran before. It is one that was confirmed, or that of the package.
    pub before: String,
    /// The slot on trial.
    pub new: String,
}

impl Trial {
    /// `before new 0`. The third word is for the guard of an older package, which counts the starts in it.
    fn to_line(&self) -> String {
        format!("{} {} 0\n", self.before, self.new)
    }

    fn parse(text: &str) -> Option<Self> {
        let mut words = text.split_whitespace();
        let (before, new, _starts) = (words.next()?, words.next()?, words.next()?.parse::<u32>().ok()?);
        let is_whole = words.next().is_none() && is_slot_name(before) && is_slot_name(new);
        is_whole.then(|| Self { before: before.to_owned(), new: new.to_owned() })
    }
}

/// May a folder below `versions` be called so? The guard asks the same.
fn is_slot_name(name: &str) -> bool {
    let part = |c: char| c.is_ascii_alphanumeric() || ".+~_-".contains(c);
    name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.chars().all(part) && name.len() <= 60
}

/// Nobody else updates this box while it lives. The lock ends with the process, however that ends.
#[derive(Debug)]
pub struct UpdateLock {
    _file: fs::File,
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
        match slots.linked_slot() {
            Some(_) => Ok(slots),
            None => Err(UpdateError::NotInstalled { path: home.join("current") }),
        }
    }

    /// The folder that all slots lie below.
    #[must_use]
    pub fn home(&self) -> &Path {
        &self.home
    }

    /// Takes the lock of updates.
    ///
    /// # Errors
    /// Another update holds it, or this user may not write there.
    pub fn lock_updates(&self) -> Result<UpdateLock, UpdateError> {
        let path = self.home.join("update.lock");
        let file = fs::OpenOptions::new().create(true).truncate(false).write(true).open(&path);
        let file = file.map_err(UpdateError::file_error(&path))?;
        match file.try_lock() {
            Ok(()) => Ok(UpdateLock { _file: file }),
            Err(fs::TryLockError::WouldBlock) => Err(UpdateError::Busy),
            Err(fs::TryLockError::Error(error)) => Err(UpdateError::File { path, error }),
        }
    }

    /// Name of the slot that the link names: what the next start runs. What runs now is another question, see
    /// [`super::ServiceState`].
    #[must_use]
    pub fn linked_slot(&self) -> Option<String> {
        let target = fs::read_link(self.home.join("current")).ok()?;
        let name = target.strip_prefix("versions").ok()?.to_str()?.to_owned();
        (is_slot_name(&name) && self.program_path(&name).is_file()).then_some(name)
    }

    /// The slot that an update goes back to: the linked one, unless it is on trial and has not been confirmed; then the one before it.
    #[must_use]
    pub fn confirmed_slot(&self, data_dir: &Path) -> String {
        let linked = self.linked_slot();
        let package = || PACKAGE_SLOT.to_owned();
        let Some(trial) = self.read_trial() else { return linked.unwrap_or_else(package) };
        let is_confirmed = linked.as_ref() == Some(&trial.new) && read_confirmed(data_dir).as_ref() == Some(&trial.new);
        match is_confirmed {
            true => trial.new,
            false if self.program_path(&trial.before).is_file() => trial.before,
            false => package(),
        }
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

    /// Makes the staged program a version. One of this name that is not linked is replaced.
    ///
    /// # Errors
    /// It is linked, or the system refuses.
    pub fn keep_staged(&self, slot: &str) -> Result<(), UpdateError> {
        let versions = self.home.join("versions");
        let (staged, kept) = (versions.join(".staged"), versions.join(slot));
        if !is_slot_name(slot) || slot == PACKAGE_SLOT {
            return Err(UpdateError::DoesNotRun(format!("its version {slot:?} is no name of a folder")));
        }
        if self.linked_slot().as_deref() == Some(slot) {
            return Err(UpdateError::InPlace { slot: slot.to_owned() });
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

    /// The trial that is noted, where there is one. It is under way only while the link names its new version.
    #[must_use]
    pub fn read_trial(&self) -> Option<Trial> {
        Trial::parse(&fs::read_to_string(self.home.join("trial")).ok()?)
    }

    /// Starts that the version on trial still has.
    #[must_use]
    pub fn count_starts_left(&self) -> u32 {
        let is_left = |number: &u32| self.home.join(STARTS_LEFT).join(number.to_string()).exists();
        (1..=TRIAL_STARTS).filter(is_left).fold(0, |count, _| count + 1)
    }

    /// Notes that a version is on trial, and lays the way back ready. Must stand on the disk before the link is moved; from then on going
    /// back needs no room on the disk.
    ///
    /// # Errors
    /// The disk is full, or this user may not write there.
    pub fn begin_trial(&self, trial: &Trial) -> Result<(), UpdateError> {
        let (note, starts) = (self.home.join("trial"), self.home.join(STARTS_LEFT));
        self.lay_way_back(&trial.before)?;
        let counted = || -> std::io::Result<()> {
            fs::create_dir_all(&starts)?;
            (1..=TRIAL_STARTS).try_for_each(|number| fs::write(starts.join(number.to_string()), ""))?;
            sync_folder(&starts)
        };
        counted().map_err(UpdateError::file_error(&starts))?;
        gateway_base::files::replace_durably(&note, trial.to_line()).map_err(UpdateError::file_error(&note))?;
        remove_if_there(&self.home.join(ROLLED_BACK))
    }

    fn lay_way_back(&self, slot: &str) -> Result<(), UpdateError> {
        let way_back = self.home.join(WAY_BACK);
        remove_if_there(&way_back)?;
        symlink(Path::new("versions").join(slot), &way_back).map_err(UpdateError::file_error(&way_back))
    }

    /// Makes the version before the one that the next start runs. Needs no room on the disk where the way back is laid ready.
    ///
    /// # Errors
    /// The system refuses.
    pub fn go_back(&self, before: &str) -> Result<(), UpdateError> {
        if self.linked_slot().as_deref() == Some(before) {
            return Ok(());
        }
        let (way_back, current) = (self.home.join(WAY_BACK), self.home.join("current"));
        if fs::read_link(&way_back).ok() != Some(Path::new("versions").join(before)) {
            self.lay_way_back(before)?;
        }
        let moved = fs::rename(&way_back, &current).and_then(|()| sync_folder(&self.home));
        moved.map_err(UpdateError::file_error(&current))
    }

    /// The trial is over.
    ///
    /// # Errors
    /// This user may not write there.
    pub fn end_trial(&self) -> Result<(), UpdateError> {
        let starts = self.home.join(STARTS_LEFT);
        remove_if_there(&self.home.join("trial"))?;
        remove_if_there(&self.home.join(WAY_BACK))?;
        match fs::remove_dir_all(&starts) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(UpdateError::File { path: starts, error });
            }
            _ => {}
        }
        sync_folder(&self.home).map_err(UpdateError::file_error(&self.home))
    }

    /// The version that the guard has taken back since the last update, where there is one.
    #[must_use]
    pub fn read_rolled_back(&self) -> Option<Trial> {
        Trial::parse(&fs::read_to_string(self.home.join(ROLLED_BACK)).ok()?)
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

/// The slot that the service has confirmed last. A name in a file of the service, which is compared and nothing else.
pub(super) fn read_confirmed(data_dir: &Path) -> Option<String> {
    let text = gateway_base::files::read_text(&data_dir.join(CONFIRMED), 100).ok()?;
    is_slot_name(&text).then_some(text)
}

fn remove_if_there(path: &Path) -> Result<(), UpdateError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(UpdateError::File { path: path.to_owned(), error })
        }
        _ => Ok(()),
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

    fn on_trial(slots: &VersionSlots, new: &str) {
        slots.stage_program(b"new").expect("staged");
        slots.keep_staged(new).expect("kept");
        let trial = Trial { before: PACKAGE_SLOT.to_owned(), new: new.to_owned() };
        slots.begin_trial(&trial).expect("noted");
        slots.switch_to(new).expect("switched");
        assert_eq!(slots.read_trial(), Some(trial));
    }

    #[test]
    fn a_version_is_staged_kept_tried_and_taken_back() {
        let (home, slots) = installed();
        on_trial(&slots, "0.3.0");
        assert_eq!((slots.linked_slot().as_deref(), slots.count_starts_left()), (Some("0.3.0"), TRIAL_STARTS));
        assert_eq!(fs::read(home.path().join("current").join(PROGRAM)).expect("read"), b"new");
        for _ in 0..2 {
            slots.go_back(PACKAGE_SLOT).expect("back, however often");
            slots.end_trial().expect("over, however often");
        }
        slots.remove_others(&[PACKAGE_SLOT]);
        assert_eq!((slots.linked_slot().as_deref(), slots.read_trial()), (Some(PACKAGE_SLOT), None));
        assert!(!slots.program_path("0.3.0").exists() && slots.count_starts_left() == 0);
    }

    #[test]
    fn only_a_confirmed_version_is_gone_back_to() {
        let ((_home, slots), data) = (installed(), tempfile::tempdir().expect("a directory"));
        assert_eq!(slots.confirmed_slot(data.path()), PACKAGE_SLOT);
        on_trial(&slots, "0.3.0");
        assert_eq!(slots.confirmed_slot(data.path()), PACKAGE_SLOT, "on trial");
        for other in ["", "0.4.0", "../0.3.0"] {
            fs::write(data.path().join(CONFIRMED), other).expect("written");
            assert_eq!(slots.confirmed_slot(data.path()), PACKAGE_SLOT, "{other:?} is confirmed");
        }
        fs::write(data.path().join(CONFIRMED), "0.3.0").expect("written");
        assert_eq!(slots.confirmed_slot(data.path()), "0.3.0");
        slots.end_trial().expect("over");
        assert_eq!(slots.confirmed_slot(data.path()), "0.3.0");
    }

    #[test]
    fn one_update_at_a_time() {
        let (_home, slots) = installed();
        let first = slots.lock_updates().expect("free");
        assert!(matches!(slots.lock_updates(), Err(UpdateError::Busy)));
        drop(first);
        assert!(slots.lock_updates().is_ok());
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
