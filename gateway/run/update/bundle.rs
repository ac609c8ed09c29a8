//! The archive of an update: a `.tar.gz` with the program in it, and a detached signature of minisign beside it.

use super::{UpdateError, UpdateKey};
use flate2::read::GzDecoder;
use minisign_verify::Signature;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Greatest size of an archive, and of the program in it: several times that of today, so that a wrong file is refused
/// before it fills the memory or the disk.
const BYTES_MAX: u64 = 256 * 1024 * 1024;
/// Files that are looked at before an archive is refused; a real one has less than ten.
const ENTRIES_MAX: usize = 64;
/// The file that is the program.
const PROGRAM: &str = "cnc-gateway";

/// An archive whose signature fits.
#[derive(Debug)]
pub struct Bundle {
    /// The executable as it was unpacked.
    pub program: Vec<u8>,
    /// What the signer wrote beside it.
    pub comment: String,
}

/// Reads an archive and its signature (`FILE.minisig`), and unpacks the program only when the signature fits.
///
/// # Errors
/// See [`UpdateError`].
pub fn read_bundle(path: &Path, key: &UpdateKey) -> Result<Bundle, UpdateError> {
    let signature = read_signature(path)?;
    let bytes = read_limited(path)?;
    key.key.verify(&bytes, &signature, false).map_err(|_| UpdateError::Refused)?;
    let program = find_program(path, &bytes)?;
    Ok(Bundle { program, comment: signature.trusted_comment().to_owned() })
}

fn read_signature(path: &Path) -> Result<Signature, UpdateError> {
    let mut name = path.as_os_str().to_owned();
    name.push(".minisig");
    let beside = PathBuf::from(name);
    let wrong = |reason: String| UpdateError::Signature { path: beside.clone(), reason };
    let text = fs::read_to_string(&beside).map_err(|error| wrong(format!("the signature cannot be read: {error}")))?;
    Signature::decode(&text).map_err(|_| wrong("this is no signature of minisign".to_owned()))
}

fn read_limited(path: &Path) -> Result<Vec<u8>, UpdateError> {
    let mut bytes = Vec::new();
    let file = fs::File::open(path).map_err(UpdateError::file_error(path))?;
    file.take(BYTES_MAX + 1).read_to_end(&mut bytes).map_err(UpdateError::file_error(path))?;
    match bytes.len() as u64 > BYTES_MAX {
        true => Err(content_error(path, format!("it is larger than {} MB", BYTES_MAX / 1024 / 1024))),
        false => Ok(bytes),
    }
}

fn content_error(path: &Path, reason: impl Into<String>) -> UpdateError {
    UpdateError::Content { path: path.to_owned(), reason: reason.into() }
}

fn find_program(path: &Path, bytes: &[u8]) -> Result<Vec<u8>, UpdateError> {
    let mut archive = tar::Archive::new(GzDecoder::new(bytes));
    let entries = archive.entries().map_err(|error| content_error(path, error.to_string()))?;
    for entry in entries.take(ENTRIES_MAX) {
        let entry = entry.map_err(|error| content_error(path, error.to_string()))?;
        let is_file = entry.header().entry_type().is_file();
        let named = entry.path().is_ok_and(|name| name.file_name().is_some_and(|name| name == PROGRAM));
        if is_file && named {
            let mut program = Vec::new();
            entry
                .take(BYTES_MAX + 1)
                .read_to_end(&mut program)
                .map_err(|error| content_error(path, error.to_string()))?;
            return match program.len() as u64 > BYTES_MAX {
                true => Err(content_error(path, "the program in it is too large")),
                false => Ok(program),
            };
        }
    }
    Err(content_error(path, "there is no file cnc-gateway in it"))
}
