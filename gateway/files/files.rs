//! Files that people edit while the box runs, and files of its own: noticed, read, replaced.
//!
//! One mechanism for the scripts, the operations recipe and the twin's model. A thread looks once a second, so that a slow
//! disk never delays a tick; a change is taken when it has stood still for one look, so that no file is read while an editor
//! is writing it. What the box writes itself takes its place in one step, so that nobody ever finds half a file.

use crate::owner;
use adapter_core::threads::receive_work_within;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, SystemTime};

/// Time between two looks.
pub const LOOK_EVERY: Duration = Duration::from_secs(1);

/// What a file is recognised by without reading it: its path, when it was written, its length. Nothing where it is not there.
pub type Mark = (PathBuf, Option<(Option<SystemTime>, u64)>);

/// The mark of this file as it is now.
#[must_use]
pub fn read_mark(path: &Path) -> Mark {
    let metadata = std::fs::metadata(path).ok();
    (path.to_owned(), metadata.map(|metadata| (metadata.modified().ok(), metadata.len())))
}

/// Files of a directory whose names are `ours`, in the order of their names.
///
/// # Errors
/// The directory cannot be read.
pub fn list_named(directory: &Path, ours: impl Fn(&str) -> bool) -> std::io::Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(directory)?.flatten();
    let mut found: Vec<PathBuf> =
        entries.filter(|entry| ours(&entry.file_name().to_string_lossy())).map(|entry| entry.path()).collect();
    found.sort();
    Ok(found)
}

/// Removes all of them but the last `keep`. One that cannot be removed keeps no other.
///
/// # Errors
/// The directory cannot be read, or the first file that could not be removed.
pub fn keep_last(directory: &Path, keep: usize, ours: impl Fn(&str) -> bool) -> std::io::Result<()> {
    let all = list_named(directory, ours)?;
    let surplus = all.len().saturating_sub(keep);
    let removed: Vec<std::io::Result<()>> = all[..surplus].iter().map(std::fs::remove_file).collect();
    removed.into_iter().collect()
}

/// Tells when marks that change have come to rest.
#[derive(Debug)]
pub struct Rest<M> {
    seen: Option<M>,
    taken: Option<M>,
}

impl<M: PartialEq + Clone> Rest<M> {
    /// Nothing has been seen; the first look finds everything at rest.
    #[must_use]
    pub fn new() -> Self {
        Self { seen: None, taken: None }
    }

    /// What is like this has been read already.
    #[must_use]
    pub fn from_known_mark(mark: M) -> Self {
        Self { seen: Some(mark.clone()), taken: Some(mark) }
    }

    /// Is what is marked so to be read now? When it has changed and is as it was at the look before; when `asked`, as soon as
    /// it has changed.
    pub fn should_read(&mut self, now: M, asked: bool) -> bool {
        let still = self.seen.replace(now.clone()).is_none_or(|before| before == now);
        if self.taken.as_ref() == Some(&now) || !(still || asked) {
            return false;
        }
        self.taken = Some(now);
        true
    }
}

impl<M: PartialEq + Clone> Default for Rest<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// Looks about once a second on a thread of its own; ends when it is dropped.
#[derive(Debug)]
pub struct Lookout<T> {
    newest: Receiver<T>,
    request: SyncSender<()>,
}

impl<T: Send + 'static> Lookout<T> {
    /// Starts a thread of this name. `look` is told whether somebody asked, and gives what it found. Without `poll` it looks
    /// only when it is asked.
    ///
    /// # Errors
    /// No thread could be started.
    pub fn start(
        name: &str,
        poll: bool,
        mut look: impl FnMut(bool) -> Option<T> + Send + 'static,
    ) -> std::io::Result<Self> {
        let (send, newest) = sync_channel(1);
        let (asked, asks) = sync_channel(1);
        let thread = name.to_owned();
        let work = move || {
            while let Some(asked) = wait_for_look(&thread, &asks, poll) {
                if look(asked).is_some_and(|found| send.send(found).is_err()) {
                    return;
                }
            }
        };
        std::thread::Builder::new().name(name.to_owned()).spawn(work)?;
        Ok(Self { newest, request: asked })
    }

    /// Makes it look now. Returns at once.
    pub fn request_look(&self) {
        // A full queue means that it has been asked already.
        let _asked_before = self.request.try_send(());
    }

    /// What was found since the last call, if anything was.
    pub fn take_newest(&self) -> Option<T> {
        self.newest.try_recv().ok()
    }
}

/// Waits for the next look; tells whether somebody asked for it. `None` when nobody is there any more.
fn wait_for_look(thread: &str, asks: &Receiver<()>, poll: bool) -> Option<bool> {
    loop {
        match receive_work_within(thread, asks, LOOK_EVERY) {
            Ok(()) => return Some(true),
            Err(RecvTimeoutError::Timeout) if poll => return Some(false),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
}

/// The text of a file, but of a longer one only `limit` bytes and one more, by which its reader sees that it is longer.
///
/// # Errors
/// It cannot be read, is a pipe or a device, or is no UTF-8.
pub fn read_text(path: &Path, limit: usize) -> std::io::Result<String> {
    let mut text = String::new();
    if !std::fs::metadata(path)?.is_file() {
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, "it is no regular file"));
    }
    std::fs::File::open(path)?.take(limit as u64 + 1).read_to_string(&mut text)?;
    Ok(text)
}

/// What to do about a file that is there and cannot be read.
#[must_use]
pub fn advise_on_read_error(error: &std::io::Error) -> &'static str {
    match error.kind() {
        std::io::ErrorKind::InvalidData => "save the file as UTF-8",
        _ => "look at the permissions",
    }
}

/// A whole file in one step: written beside its place, then renamed. Its directory is made if need be. Who owns the file and who may
/// read it stays as it was, see [`crate::owner`].
///
/// # Errors
/// The file or its directory cannot be written; what was there before stays.
pub fn replace_file(path: &Path, text: &str) -> std::io::Result<()> {
    let fresh = write_beside(path, text.as_bytes(), Readers::AsBefore)?;
    std::fs::rename(&fresh.path, path)
}

/// The same, and returns only when it would survive a power cut.
///
/// # Errors
/// As for [`replace_file`].
pub fn replace_durably(path: &Path, content: impl AsRef<[u8]>) -> std::io::Result<()> {
    rename_durably(&write_beside(path, content.as_ref(), Readers::AsBefore)?, path)
}

/// The same as [`replace_durably`], for a file that nobody but its owner may read (mode 600).
///
/// # Errors
/// As for [`replace_file`].
pub fn replace_privately(path: &Path, text: &str) -> std::io::Result<()> {
    rename_durably(&write_beside(path, text.as_bytes(), Readers::OwnerAlone)?, path)
}

/// Who may read a file that is replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Readers {
    /// Those who could before; of a new file, as the process makes files.
    AsBefore,
    /// The owner of the file and nobody else, whoever could before.
    OwnerAlone,
}

/// A file that is written and has not taken its place.
#[derive(Debug)]
pub struct FreshFile {
    path: PathBuf,
    file: std::fs::File,
}

impl FreshFile {
    /// It takes its place, in one step, and returns only when it would survive a power cut.
    ///
    /// # Errors
    /// The system refuses; what was there before stays, and this file is removed.
    pub fn take_place(self, path: &Path) -> std::io::Result<()> {
        rename_durably(&self, path).inspect_err(|_| self.remove())
    }

    /// It is not wanted.
    pub fn discard(self) {
        self.remove();
    }

    fn remove(&self) {
        // What is left costs space only; the next one that is written there removes it.
        let _left = std::fs::remove_file(&self.path);
    }
}

/// Writes a text beside its place, for [`FreshFile::take_place`]: many files that take their places together are all written first.
///
/// # Errors
/// As for [`replace_file`].
pub fn prepare_replacement(path: &Path, text: &str) -> std::io::Result<FreshFile> {
    write_beside(path, text.as_bytes(), Readers::AsBefore)
}

fn write_beside(path: &Path, content: &[u8], readers: Readers) -> std::io::Result<FreshFile> {
    use std::os::unix::fs::OpenOptionsExt;
    let directory = directory_of(path);
    owner::create_directories(directory)?;
    let fresh = temporary_path(path);
    // One that was left behind may have another mode, or be a link to somewhere else.
    let _none_left = std::fs::remove_file(&fresh);
    let mode = if readers == Readers::OwnerAlone { 0o600 } else { 0o666 };
    let mut file = std::fs::OpenOptions::new().write(true).create_new(true).mode(mode).open(&fresh)?;
    file.write_all(content)?;
    owner::give_to_owner(&file, path, directory)?;
    if let (Readers::AsBefore, Ok(before)) = (readers, std::fs::metadata(path)) {
        file.set_permissions(before.permissions())?;
    }
    Ok(FreshFile { path: fresh, file })
}

fn rename_durably(fresh: &FreshFile, path: &Path) -> std::io::Result<()> {
    fresh.file.sync_all()?;
    std::fs::rename(&fresh.path, path)?;
    std::fs::File::open(directory_of(path))?.sync_all()
}

fn directory_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where a file is written before it takes its place.
fn temporary_path(path: &Path) -> PathBuf {
    let mut fresh = path.as_os_str().to_owned();
    fresh.push(".writing");
    fresh.into()
}

/// The digest of nothing, see [`extend_digest`].
pub const EMPTY_DIGEST: u64 = 0xcbf2_9ce4_8422_2325;

/// FNV-1a: tells one text from another, keeps no secret.
#[must_use]
pub fn compute_digest(bytes: &[u8]) -> u64 {
    extend_digest(EMPTY_DIGEST, bytes)
}

/// The digest of what had this digest, with these bytes after it.
#[must_use]
pub fn extend_digest(digest: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(digest, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_change_is_taken_once_when_it_has_come_to_rest() {
        let mut rest = Rest::from_known_mark(1);
        assert!(!rest.should_read(1, false) && !rest.should_read(1, true), "known");
        assert!(!rest.should_read(2, false) && !rest.should_read(3, false), "still being written");
        assert!(rest.should_read(3, false) && !rest.should_read(3, false));
        assert!(rest.should_read(4, true) && !rest.should_read(4, false), "asked, it does not wait");
        assert!(Rest::new().should_read(1, false), "the first look finds everything at rest");
    }

    #[test]
    fn a_file_is_replaced_as_a_whole_and_read_no_further_than_the_limit() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("deeper").join("file.toml");
        let before = read_mark(&path);
        replace_file(&path, "12345").expect("written");
        assert_ne!(read_mark(&path), before);
        assert_eq!(read_text(&path, 3).expect("read"), "1234");
        assert_eq!(std::fs::read_dir(directory.path().join("deeper")).expect("there").count(), 1, "nothing is left");
        let mode = || std::fs::metadata(&path).expect("there").permissions().mode() & 0o777;
        for wanted in [0o640, 0o600, 0o644] {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(wanted)).expect("set");
            replace_file(&path, "1").expect("written");
            replace_durably(&path, "2").expect("written");
            assert_eq!(mode(), wanted, "who may read it stays");
        }
        replace_privately(&path, "3").expect("written");
        assert_eq!(mode(), 0o600);
    }
}
