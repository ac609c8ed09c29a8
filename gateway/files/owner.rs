//! Who owns the files of a box. A command that root gives writes into a directory of the user that the gateway runs as; what it leaves
//! there must belong to that user, or the gateway cannot read it at its next start.
//!
//! Two rules do that. A file that is replaced keeps its owner, and a new one belongs to the owner of its directory
//! ([`give_to_owner`]). And when a command ends, whatever still belongs to root below a data directory of another user is handed over
//! ([`hand_over`]): a database, its log, a lock.

use rustix::fs::{AtFlags, Dir, FileType, Gid, Mode, OFlags, Stat, Uid};
use std::fs::File;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Folders in folders that are looked at; a data directory has two.
const DEPTH_MAX: usize = 6;
/// A folder of the file system itself, where the data directory is a disk of its own.
const OF_FILE_SYSTEM: &[u8] = b"lost+found";

/// User and group that a file belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Owner {
    user: u32,
    group: u32,
}

impl Owner {
    fn of_metadata(metadata: &std::fs::Metadata) -> Self {
        Self { user: metadata.uid(), group: metadata.gid() }
    }
}

/// Who shall own what takes the place of a file: the one who owned it, but for root the owner of the directory.
fn choose_owner(before: Option<Owner>, directory: Owner) -> Owner {
    before.filter(|owner| owner.user != 0).unwrap_or(directory)
}

/// Gives a new file, which will take the place of `path` in `directory`, to whom it shall belong. A user who may not give files away
/// keeps it.
///
/// # Errors
/// The directory cannot be read, or the system refuses for another reason.
pub fn give_to_owner(file: &File, path: &Path, directory: &Path) -> io::Result<()> {
    let before = std::fs::metadata(path).ok().map(|metadata| Owner::of_metadata(&metadata));
    let owner = choose_owner(before, Owner::of_metadata(&std::fs::metadata(directory)?));
    if Owner::of_metadata(&file.metadata()?) == owner {
        return Ok(());
    }
    match std::os::unix::fs::fchown(file, Some(owner.user), Some(owner.group)) {
        Err(error) if error.kind() != io::ErrorKind::PermissionDenied => Err(error),
        _ => Ok(()),
    }
}

/// Makes a directory and those above it. Each one belongs to the owner of the one that it is in.
///
/// # Errors
/// One cannot be made.
pub fn create_directories(path: &Path) -> io::Result<()> {
    if path.as_os_str().is_empty() || path.is_dir() {
        return Ok(());
    }
    let above = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    create_directories(above)?;
    match std::fs::create_dir(path) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    // A link to a directory that somebody else has made stays theirs.
    match rustix::fs::open(path, flags, Mode::empty()) {
        Ok(made) => give_to_owner(&File::from(made), Path::new(""), above),
        Err(_) => Ok(()),
    }
}

/// Gives what belongs to root below this directory to the owner of the directory. Gives how many files and folders that were; none where
/// this process is not root, or the directory belongs to root.
///
/// Links are not followed, and a file with a second name is left: the owner of the directory may have made both, to be given the file of
/// somebody else.
///
/// # Errors
/// The directory cannot be read, or the system refuses.
pub fn hand_over(directory: &Path) -> io::Result<usize> {
    if !rustix::process::geteuid().is_root() {
        return Ok(0);
    }
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
    let opened = rustix::fs::open(directory, flags, Mode::empty())?;
    let found = rustix::fs::fstat(&opened)?;
    let owner = Owner { user: found.st_uid, group: found.st_gid };
    if owner.user == 0 { Ok(0) } else { hand_over_folder(opened.as_fd(), owner, DEPTH_MAX) }
}

fn hand_over_folder(folder: BorrowedFd<'_>, owner: Owner, depth_left: usize) -> io::Result<usize> {
    let mut count = 0;
    for entry in Dir::read_from(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        if [&b"."[..], b"..", OF_FILE_SYSTEM].contains(&name.to_bytes()) {
            continue;
        }
        let flags = OFlags::PATH | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        // One that has gone meanwhile needs no owner.
        let Ok(opened) = rustix::fs::openat(folder, name, flags, Mode::empty()) else { continue };
        let found = rustix::fs::fstat(&opened)?;
        let kind = FileType::from_raw_mode(found.st_mode);
        if is_to_hand_over(&found, kind) {
            let (user, group) = (Uid::from_raw(owner.user), Gid::from_raw(owner.group));
            rustix::fs::chownat(&opened, c"", Some(user), Some(group), AtFlags::EMPTY_PATH)?;
            count += 1;
        }
        if kind == FileType::Directory && depth_left > 0 {
            let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
            let inside = rustix::fs::openat(folder, name, flags, Mode::empty())?;
            count += hand_over_folder(inside.as_fd(), owner, depth_left - 1)?;
        }
    }
    Ok(count)
}

fn is_to_hand_over(found: &Stat, kind: FileType) -> bool {
    let is_alone = match kind {
        FileType::Directory | FileType::Socket => true,
        FileType::RegularFile => found.st_nlink == 1,
        _ => false,
    };
    found.st_uid == 0 && is_alone
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_keeps_its_owner_and_a_new_one_has_that_of_its_directory() {
        let owner = |user: u32| Owner { user, group: user + 100 };
        for (before, directory, wanted) in [
            (None, 7, 7),
            (Some(7), 7, 7),
            (Some(9), 7, 9),
            (Some(0), 7, 7),
            (Some(0), 0, 0),
            (None, 0, 0),
            (Some(9), 0, 9),
        ] {
            assert_eq!(choose_owner(before.map(owner), owner(directory)), owner(wanted), "{before:?} in {directory}");
        }
    }

    /// The same on a disk; a user who is not root cannot make the files of two users.
    #[test]
    #[ignore = "1 second: files of two users keep their owner; needs root"]
    fn what_root_leaves_in_a_directory_of_a_user_is_handed_over() {
        let directory = tempfile::tempdir().expect("a directory");
        let place = directory.path();
        let chown = |path: &Path| std::os::unix::fs::lchown(path, Some(12_345), Some(12_346)).expect("this needs root");
        chown(place);
        std::fs::create_dir_all(place.join("deeper/still")).expect("made");
        std::fs::write(place.join("deeper/still/file"), "x").expect("written");
        std::fs::write(place.join("twice"), "x").expect("written");
        std::fs::hard_link(place.join("twice"), place.join("two names")).expect("linked");
        let outside = tempfile::NamedTempFile::new().expect("a file");
        std::os::unix::fs::symlink(outside.path(), place.join("link")).expect("linked");
        assert_eq!(hand_over(place).expect("handed over"), 3);
        assert_eq!(hand_over(place).expect("handed over"), 0);
        let user = |path: &Path| std::fs::symlink_metadata(path).expect("there").uid();
        for (name, wanted) in [("deeper", 12_345), ("deeper/still", 12_345), ("deeper/still/file", 12_345)] {
            assert_eq!(user(&place.join(name)), wanted, "{name}");
        }
        assert_eq!((user(outside.path()), user(&place.join("twice")), user(&place.join("link"))), (0, 0, 0));
        // Written anew: the owner stays; a new file and its folder get that of the directory.
        for name in ["deeper/still/file", "new", "folder/new"] {
            crate::files::replace_privately(&place.join(name), "y").expect("written");
            assert_eq!(user(&place.join(name)), 12_345, "{name}");
        }
        assert_eq!(user(&place.join("folder")), 12_345);
    }
}
