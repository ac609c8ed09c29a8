//! A file whose header is damaged is copied, and gets the header that every history has: the rest of it may be whole.

use super::super::error::{Doing, HistoryError, add_path};
use super::super::lock::append_suffix;
use super::super::{damage, pages, schema};
use rusqlite::{Connection, OpenFlags};
use std::fs::{self, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Length of a page, of every history.
const PAGE: u64 = 4_096;

/// A damaged history that can be asked.
pub(super) struct Source {
    /// With checks of its pages.
    pub(super) checked: Connection,
    /// Without, for what has sums of its own; only where the pages have sums.
    pub(super) unchecked: Option<Connection>,
    /// A copy that was made for this, and is not needed afterwards.
    copy: Option<PathBuf>,
}

impl Drop for Source {
    fn drop(&mut self) {
        if let Some(copy) = &self.copy {
            for file in [copy.clone(), append_suffix(copy, "-wal"), append_suffix(copy, "-shm")] {
                // One that is left behind is only in the way.
                let _gone = fs::remove_file(file);
            }
        }
    }
}

/// Opens the history at `from`; `to` says where there is room for a copy.
///
/// # Errors
/// It is none, or not even a new header helps.
pub(super) fn open_source(from: &Path, to: &Path) -> Result<Source, HistoryError> {
    match schema::open_for_reading(from) {
        Ok(checked) => {
            let unchecked = open_unchecked(from).ok();
            Ok(Source { checked, unchecked, copy: None })
        }
        Err(error) if error.is_damage() && damage::was_ours(from) => with_header(from, to),
        Err(error) => Err(error),
    }
}

fn open_unchecked(path: &Path) -> Result<Connection, HistoryError> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    Connection::open_with_flags(path, flags).with_activity("opening the file without checks")
}

fn with_header(from: &Path, to: &Path) -> Result<Source, HistoryError> {
    let copy = append_suffix(to, ".source");
    fs::copy(from, &copy).map_err(add_path(&copy))?;
    if append_suffix(from, "-wal").exists() {
        fs::copy(append_suffix(from, "-wal"), append_suffix(&copy, "-wal")).map_err(add_path(&copy))?;
    }
    put_header(&copy).map_err(add_path(&copy))?;
    let opened = schema::open_for_reading(&copy).and_then(|checked| Ok((checked, open_unchecked(&copy)?)));
    match opened {
        Ok((checked, unchecked)) => Ok(Source { checked, unchecked: Some(unchecked), copy: Some(copy) }),
        Err(error) => {
            let _gone = fs::remove_file(&copy);
            Err(error)
        }
    }
}

/// The header of SQLite's *Database File Format*, 1.3, as this program writes it, over whatever is there; the sum of the first page
/// is taken off.
fn put_header(path: &Path) -> std::io::Result<()> {
    let mut file = OpenOptions::new().read(true).write(true).open(path)?;
    let mut page = vec![0; PAGE as usize];
    file.read_exact(&mut page)?;
    let sealed = pages::is_sealed_page(&mut second_page(&mut file)?, 2);
    let length = file.metadata()?.len();
    page[..16].copy_from_slice(b"SQLite format 3\0");
    page[16..24].copy_from_slice(&[0x10, 0x00, 2, 2, if sealed { 8 } else { 0 }, 64, 32, 32]);
    // SQLite counts pages with 32 bits: a longer file was never a database, and a header that says less would cut it off.
    let pages = u32::try_from(length / PAGE)
        .map_err(|_| std::io::Error::new(std::io::ErrorKind::FileTooLarge, "more pages than a database has"))?;
    page[28..32].copy_from_slice(&pages.to_be_bytes());
    page[44..48].copy_from_slice(&4_u32.to_be_bytes());
    page[56..60].copy_from_slice(&1_u32.to_be_bytes());
    let version = i64::from(u32::from_be_bytes([page[60], page[61], page[62], page[63]]));
    if !(1..=schema::SCHEMA).contains(&version) {
        page[60..64].copy_from_slice(&(schema::SCHEMA as u32).to_be_bytes());
    }
    let application = if sealed { pages::SEALED_APPLICATION } else { schema::APPLICATION as u32 };
    page[68..72].copy_from_slice(&application.to_be_bytes());
    page[72..92].fill(0);
    // The length of the file counts where these two agree.
    let changes: [u8; 4] = [page[24], page[25], page[26], page[27]];
    page[92..96].copy_from_slice(&changes);
    if sealed {
        let end = page.len();
        page[end - 8..].fill(0);
    }
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&page)
}

fn second_page(file: &mut fs::File) -> std::io::Result<Vec<u8>> {
    let mut page = vec![0; PAGE as usize];
    file.seek(SeekFrom::Start(PAGE))?;
    file.read_exact(&mut page)?;
    Ok(page)
}
