//! The key that updates of this box are verified with: the first one that verified an update is kept, and only an explicit command changes
//! it. It lies beside the versions, where the service cannot write.

use super::UpdateError;
use gateway_base::files::{read_text, replace_durably};
use minisign_verify::PublicKey;
use std::fs;
use std::path::{Path, PathBuf};

/// The file of the key that is kept.
const FILE: &str = "update-key";
/// A key and its comment are some hundred bytes.
const BYTES_MAX: usize = 4096;

/// Where the public key comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PublicKeySource {
    /// A file as minisign writes it, with its comment.
    File(PathBuf),
    /// The key itself, the second line of that file.
    Text(String),
}

/// The public key of whoever signs updates.
#[derive(Debug, Clone)]
pub struct UpdateKey {
    /// As minisign writes it, without the comment.
    text: String,
    pub(super) key: PublicKey,
}

impl UpdateKey {
    /// The key of this source.
    ///
    /// # Errors
    /// The file cannot be read, or it is no key.
    pub fn read(source: &PublicKeySource) -> Result<Self, UpdateError> {
        match source {
            PublicKeySource::Text(text) => Self::parse(text, text),
            PublicKeySource::File(path) => {
                let text = fs::read_to_string(path).map_err(UpdateError::file_error(path))?;
                Self::parse(&text, &path.display().to_string())
            }
        }
    }

    /// The last line that is not empty: before it stands the comment, where there is one.
    fn parse(text: &str, named: &str) -> Result<Self, UpdateError> {
        let bad = || UpdateError::Key(named.to_owned());
        let text = text.lines().map(str::trim).rfind(|line| !line.is_empty()).ok_or_else(bad)?;
        let key = PublicKey::from_base64(text).map_err(|_| bad())?;
        Ok(Self { text: text.to_owned(), key })
    }

    /// The key that this box keeps; `None`: no update was verified here yet.
    ///
    /// # Errors
    /// The file is there and cannot be read, or holds no key: that is no reason to take another one.
    pub fn read_kept(home: &Path) -> Result<Option<Self>, UpdateError> {
        let path = home.join(FILE);
        match read_text(&path, BYTES_MAX) {
            Ok(text) => Self::parse(&text, &path.display().to_string()).map(Some),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(UpdateError::File { path, error }),
        }
    }

    /// Keeps it for this box, in the place of the one before.
    ///
    /// # Errors
    /// The disk is full, or this user may not write there.
    pub fn keep(&self, home: &Path) -> Result<(), UpdateError> {
        let path = home.join(FILE);
        replace_durably(&path, format!("{}\n", self.text)).map_err(UpdateError::file_error(&path))
    }

    /// The key to verify with: the one that is kept. Another one is refused.
    ///
    /// # Errors
    /// There is none, or the given one is not the one that is kept.
    pub fn choose(given: Option<Self>, kept: Option<Self>) -> Result<Self, UpdateError> {
        match (given, kept) {
            (None, None) => Err(UpdateError::NoKey),
            (Some(given), Some(kept)) if given.text != kept.text => {
                Err(UpdateError::OtherKey { given: given.text, kept: kept.text })
            }
            (_, Some(key)) | (Some(key), None) => Ok(key),
        }
    }

    /// As minisign writes it, without the comment.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: &str = "RWQf6LRCGA9i53mlYecO4IzT51TGPpvWucNSCh1CBM0QTaLn73Y7GFO3";
    /// The same with another last byte of the key.
    const OTHER: &str = "RWQf6LRCGA9i53mlYecO4IzT51TGPpvWucNSCh1CBM0QTaLn73Y7GFO4";

    fn key(text: &str) -> UpdateKey {
        UpdateKey::read(&PublicKeySource::Text(text.to_owned())).expect("a key")
    }

    #[test]
    fn the_first_key_stays_until_it_is_changed_on_purpose() {
        let home = tempfile::tempdir().expect("a directory");
        assert!(UpdateKey::read_kept(home.path()).expect("read").is_none());
        assert!(matches!(UpdateKey::choose(None, None), Err(UpdateError::NoKey)));
        assert_eq!(UpdateKey::choose(Some(key(ONE)), None).expect("the first").text(), ONE);
        key(&format!("untrusted comment: of a file\n{ONE}\n")).keep(home.path()).expect("kept");
        let kept = || UpdateKey::read_kept(home.path()).expect("read");
        assert_eq!(UpdateKey::choose(None, kept()).expect("the kept one").text(), ONE);
        assert!(UpdateKey::choose(Some(key(ONE)), kept()).is_ok());
        assert!(matches!(UpdateKey::choose(Some(key(OTHER)), kept()), Err(UpdateError::OtherKey { .. })));
        key(OTHER).keep(home.path()).expect("changed");
        assert!(matches!(UpdateKey::choose(Some(key(ONE)), kept()), Err(UpdateError::OtherKey { .. })));
        for damaged in ["", "no key", &"x".repeat(10_000)] {
            fs::write(home.path().join(FILE), damaged).expect("written");
            assert!(UpdateKey::read_kept(home.path()).is_err(), "a key that cannot be read is no missing one");
        }
    }
}
