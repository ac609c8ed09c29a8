//! Archives (tar, gzip) that a person takes from the box or gives back: named texts, nothing else. Names are taken from a list, so
//! that no archive decides where a file goes.

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use std::io::{Error, Read, Result};

/// The most that is read out of an archive: a small file may hold a great many zeros.
const UNPACKED_MAX: u64 = 64 << 20;
/// Files in one archive.
const FILES_MAX: usize = 2000;

/// One file: its name in the archive, and its content.
pub type ArchivedFile = (String, Vec<u8>);

/// An archive of these files. `at_s` is the time they get, seconds since 1970.
///
/// # Errors
/// A name that no archive can hold.
pub fn pack(files: &[ArchivedFile], at_s: u64) -> Result<Vec<u8>> {
    let mut archive = tar::Builder::new(GzEncoder::new(Vec::new(), Compression::default()));
    for (name, content) in files {
        let mut header = tar::Header::new_gnu();
        header.set_size(content.len() as u64);
        header.set_mode(0o600);
        header.set_mtime(at_s);
        archive.append_data(&mut header, name, content.as_slice())?;
    }
    archive.into_inner()?.finish()
}

/// The files of an archive. Links, folders and devices are left out.
///
/// # Errors
/// It is no such archive, or it holds too much.
pub fn unpack(bytes: &[u8]) -> Result<Vec<ArchivedFile>> {
    let mut archive = tar::Archive::new(GzDecoder::new(bytes).take(UNPACKED_MAX));
    let mut files = Vec::new();
    for entry in archive.entries()? {
        let mut entry = entry?;
        if !entry.header().entry_type().is_file() {
            continue;
        }
        if files.len() >= FILES_MAX {
            return Err(Error::other(format!("the archive holds more than {FILES_MAX} files")));
        }
        let name = entry.path()?.display().to_string();
        let mut content = Vec::new();
        entry.read_to_end(&mut content)?;
        files.push((name, content));
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_packed_is_unpacked_and_nonsense_is_refused() {
        let files = vec![("a.txt".to_owned(), b"one".to_vec()), ("b/c.txt".to_owned(), vec![0; 100_000])];
        let packed = pack(&files, 0).expect("packed");
        assert!(packed.len() < 2000, "{}", packed.len());
        assert_eq!(unpack(&packed).expect("unpacked"), files);
        for wrong in [&b""[..], b"nonsense", &packed[..packed.len() / 2]] {
            assert!(unpack(wrong).is_err() || unpack(wrong).is_ok_and(|files| files.is_empty()), "{}", wrong.len());
        }
    }
}
