//! Many files take their places, or none does. All of them are written beside their places first, which is where a full disk stops it; then
//! each is renamed into its place, and what was there is kept until the last one is. When one fails the kept ones come back, by a rename
//! that needs no room.

use super::{PutBack, RestoreError};
use gateway_base::files::{FreshFile, prepare_replacement};
use std::fs;
use std::path::{Path, PathBuf};

/// Folder in the data directory for what is being replaced.
const KEPT: &str = "restore-kept";

/// A file that is being replaced or removed.
struct ReplacedFile {
    path: PathBuf,
    /// Where what was there is kept; `None`: there was nothing.
    path_before: Option<PathBuf>,
}

/// Files on their way to their places.
pub(super) struct Replacement {
    folder: PathBuf,
    fresh: Vec<(PathBuf, FreshFile)>,
    surplus: Vec<PathBuf>,
    done: Vec<ReplacedFile>,
}

impl Replacement {
    /// Writes all new texts beside their places. `surplus` are files that go. Nothing is changed yet.
    ///
    /// # Errors
    /// One cannot be written; none is left beside its place then.
    pub(super) fn prepare(
        data_dir: &Path,
        texts: &[(PathBuf, String)],
        surplus: Vec<PathBuf>,
    ) -> Result<Self, RestoreError> {
        let folder = data_dir.join(KEPT);
        let _none_left = fs::remove_dir_all(&folder);
        let mut fresh = Vec::new();
        for (path, text) in texts {
            // A folder in the place of a file would be found only by the rename.
            let written = match path.is_dir() {
                true => Err(std::io::ErrorKind::IsADirectory.into()),
                false => prepare_replacement(path, text),
            };
            match written {
                Ok(file) => fresh.push((path.clone(), file)),
                Err(error) => {
                    fresh.into_iter().for_each(|(_, file): (PathBuf, FreshFile)| file.discard());
                    return Err(RestoreError::File { path: path.clone(), error });
                }
            }
        }
        Ok(Self { folder, fresh, surplus, done: Vec::new() })
    }

    /// All of them take their places, then `last` is done. When that or a file fails, everything comes back.
    ///
    /// # Errors
    /// See [`RestoreError::BrokeOff`].
    pub(super) fn put_all<T>(mut self, last: impl FnOnce() -> Result<T, RestoreError>) -> Result<T, RestoreError> {
        match self.put_files().and_then(|()| last()) {
            Ok(given) => {
                for kept in self.done.iter().filter_map(|replaced| replaced.path_before.as_ref()) {
                    let _left = fs::remove_file(kept);
                }
                // What is left of it costs space only; the next restore removes it.
                let _left = fs::remove_dir_all(&self.folder);
                Ok(given)
            }
            Err(error) => Err(RestoreError::BrokeOff { error: Box::new(error), put_back: self.take_back() }),
        }
    }

    fn put_files(&mut self) -> Result<(), RestoreError> {
        let say = RestoreError::of_file;
        fs::create_dir_all(&self.folder).map_err(say(&self.folder.clone()))?;
        while let Some((path, file)) = self.fresh.pop() {
            let kept = self.keep_before(&path)?;
            if let Err(error) = file.take_place(&path) {
                return Err(RestoreError::File { path, error });
            }
            self.done.push(ReplacedFile { path, path_before: kept });
        }
        for path in std::mem::take(&mut self.surplus) {
            let kept = self.keep_before(&path)?;
            fs::remove_file(&path).map_err(say(&path))?;
            self.done.push(ReplacedFile { path, path_before: kept });
        }
        Ok(())
    }

    /// A second name for what is there, which takes no room; where the folder is on another disk, a copy beside.
    fn keep_before(&self, path: &Path) -> Result<Option<PathBuf>, RestoreError> {
        if !path.exists() {
            return Ok(None);
        }
        let kept = self.folder.join(self.done.len().to_string());
        if fs::hard_link(path, &kept).is_ok() {
            return Ok(Some(kept));
        }
        let mut beside = path.as_os_str().to_owned();
        // Not the name under which the new text waits.
        beside.push(".before-restore");
        let beside = PathBuf::from(beside);
        fs::copy(path, &beside).map_err(RestoreError::of_file(path))?;
        Ok(Some(beside))
    }

    fn take_back(self) -> PutBack {
        self.fresh.into_iter().for_each(|(_, file)| file.discard());
        let count = self.done.len();
        let mut left = Vec::new();
        for place in self.done.into_iter().rev() {
            let back = match &place.path_before {
                Some(kept) => fs::rename(kept, &place.path),
                None => fs::remove_file(&place.path),
            };
            if back.is_err() {
                left.push(place.path);
            }
        }
        let _left = fs::remove_dir_all(&self.folder);
        if left.is_empty() { PutBack::All(count) } else { PutBack::AllBut(left) }
    }
}
