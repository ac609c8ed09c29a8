//! A directory of backups: archives of this box, and maybe of others. Which are whole, which go when there are too many.

use super::archive::unpack;
use super::origin::{BoxOrigin, ORIGIN};
use super::{BackupError, archive_name};
use gateway_base::files::list_named;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Head of a file of `SQLite`, and where it says the size of a page and their number (<https://www.sqlite.org/fileformat.html>).
const DATABASE: &[u8; 16] = b"SQLite format 3\0";
const DATABASE_HEAD: usize = 32;

/// A kind of file in the directory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BackupKind {
    /// An archive, see [`super::archive`].
    Archive,
    /// A copy of the history.
    History,
}

impl BackupKind {
    pub(super) const ALL: [Self; 2] = [Self::Archive, Self::History];

    fn word(self) -> &'static str {
        match self {
            Self::Archive => "backup",
            Self::History => "history",
        }
    }

    fn ending(self) -> &'static str {
        match self {
            Self::Archive => ".tar.gz",
            Self::History => ".db",
        }
    }

    /// Name of a file of this kind that is made at this time, seconds since 1970.
    pub(super) fn file_name(self, origin: &BoxOrigin, at_s: u64) -> String {
        let name = archive_name(&format!("{}-{}", self.word(), origin.to_file_name_part()), at_s);
        match self {
            Self::Archive => name,
            Self::History => name.replace(".tar.gz", self.ending()),
        }
    }

    /// What the names of all files of this kind and box begin with.
    fn begin(self, origin: &BoxOrigin) -> String {
        format!("cnc-gateway-{}-{}-", self.word(), origin.to_file_name_part())
    }

    /// Is it of this box, and can it come back?
    fn is_whole(self, path: &Path, origin: &BoxOrigin) -> bool {
        match self {
            Self::Archive => fs::read(path).and_then(|bytes| unpack(&bytes)).is_ok_and(|files| {
                let found = files.iter().find(|(name, _)| name == ORIGIN);
                found.and_then(|(_, json)| BoxOrigin::parse(json)).is_some_and(|it| it.number == origin.number)
            }),
            Self::History => is_whole_database(path).unwrap_or(false),
        }
    }
}

/// Has the file as many pages as its head says?
fn is_whole_database(path: &Path) -> std::io::Result<bool> {
    let mut head = [0; DATABASE_HEAD];
    let mut file = fs::File::open(path)?;
    file.read_exact(&mut head)?;
    let page = match u16::from_be_bytes([head[16], head[17]]) {
        1 => 65_536,
        size => u64::from(size),
    };
    let pages = u64::from(u32::from_be_bytes([head[28], head[29], head[30], head[31]]));
    Ok(head.starts_with(DATABASE) && pages > 0 && file.metadata()?.len() == page * pages)
}

/// Files of this kind and box, in the order of their names, which is that of the times in them.
pub(super) fn list_own(directory: &Path, kind: BackupKind, origin: &BoxOrigin) -> std::io::Result<Vec<PathBuf>> {
    let begin = kind.begin(origin);
    list_named(directory, |name| name.starts_with(&begin) && name.ends_with(kind.ending()))
}

/// Removes what is left of backups of this box that were cut: they have no name of their own yet.
pub(super) fn remove_half_written(directory: &Path, origin: &BoxOrigin) {
    for kind in BackupKind::ALL {
        let begin = kind.begin(origin);
        let halves = list_named(directory, |name| name.starts_with(&begin) && name.contains(".writing"));
        for half in halves.unwrap_or_default() {
            // One that cannot be removed costs space only; the next backup tries again.
            let _left = fs::remove_file(half);
        }
    }
}

/// Removes whole files of this kind and box until `keep` are left. `newest` has just been taken and always stays; all others were taken before
/// it, also those whose names say a later time: the clock was wrong then, and they go first. A file that is not whole does not count and
/// stays.
///
/// # Errors
/// The directory cannot be read, or the first file that could not be removed.
pub(super) fn keep_newest(
    directory: &Path,
    kind: BackupKind,
    origin: &BoxOrigin,
    (newest, keep): (&Path, usize),
) -> Result<(), BackupError> {
    let say = |error| BackupError::File { path: directory.to_owned(), error };
    let mut others = list_own(directory, kind, origin).map_err(say)?;
    others.retain(|path| path != newest && kind.is_whole(path, origin));
    others.sort_by_key(|path| (path.as_path() < newest, path.clone()));
    let surplus = others.len().saturating_sub(keep.saturating_sub(1));
    let removed: Vec<std::io::Result<()>> = others[..surplus].iter().map(fs::remove_file).collect();
    removed.into_iter().collect::<std::io::Result<()>>().map_err(say)
}
