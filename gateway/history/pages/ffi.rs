//! Between `SQLite` and the file: a layer ("VFS") over that of the system, which seals pages when they are written and checks them
//! when they are read. Only the main file of a database is looked at; everything else goes straight to the system.
#![allow(unsafe_code, reason = "SQLite calls these functions through C and hands over plain memory")]

use super::SEALED_APPLICATION;
use super::sum::{self, FileHeader, HEADER, ROOM};
use rusqlite::{Connection, ffi};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::null_mut;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Name of the layer.
pub(crate) const VFS: &CStr = c"cnc-gateway";

/// The page that was last found damaged; 0: none.
static DAMAGED: AtomicU32 = AtomicU32::new(0);

/// The page that was last found damaged in this process.
pub(crate) fn damaged_page() -> Option<u32> {
    Some(DAMAGED.load(Ordering::Relaxed)).filter(|page| *page > 0)
}

/// A file of ours as `SQLite` holds it; behind it in the same memory lies that of the system.
#[repr(C)]
struct SealedFile {
    /// First, as C expects.
    base: ffi::sqlite3_file,
    /// The file of the system.
    real: *mut ffi::sqlite3_file,
    header: FileHeader,
}

/// Bytes of [`SealedFile`], so that what lies behind it is aligned like anything else.
const OWN: usize = size_of::<SealedFile>().next_multiple_of(16);

/// Makes the layer known to `SQLite`, once in a process.
///
/// # Errors
/// The code of `SQLite`: there is no layer of the system to lie over.
pub(crate) fn register_layer() -> Result<(), c_int> {
    static DONE: OnceLock<c_int> = OnceLock::new();
    // SAFETY: the layer of the system lives as long as the process. Ours is a copy of it that is leaked, so it does too; the
    // functions that are taken over look at no field of it but the longest name of a path, which the copy has.
    let code = *DONE.get_or_init(|| unsafe {
        let real = ffi::sqlite3_vfs_find(std::ptr::null());
        if real.is_null() {
            return ffi::SQLITE_NOTFOUND;
        }
        let mut own = *real;
        own.pNext = null_mut();
        own.zName = VFS.as_ptr();
        own.pAppData = real.cast();
        own.szOsFile = (*real).szOsFile + OWN as c_int;
        own.xOpen = Some(open);
        ffi::sqlite3_vfs_register(Box::leak(Box::new(own)), 0)
    });
    if code == ffi::SQLITE_OK { Ok(()) } else { Err(code) }
}

/// Leaves room for the sums in a database that is about to be created.
///
/// # Errors
/// The code of `SQLite`.
pub(crate) fn reserve_room(db: &Connection) -> Result<(), c_int> {
    let mut bytes = ROOM as c_int;
    // SAFETY: the handle lives as long as the connection, and the argument is the one integer that this request reads and writes.
    let code = unsafe {
        ffi::sqlite3_file_control(
            db.handle(),
            c"main".as_ptr(),
            ffi::SQLITE_FCNTL_RESERVE_BYTES,
            (&raw mut bytes).cast::<c_void>(),
        )
    };
    if code == ffi::SQLITE_OK { Ok(()) } else { Err(code) }
}

unsafe extern "C" fn open(
    vfs: *mut ffi::sqlite3_vfs,
    name: *const c_char,
    file: *mut ffi::sqlite3_file,
    flags: c_int,
    out: *mut c_int,
) -> c_int {
    // SAFETY: `SQLite` hands over the layer that was registered above, and memory of `szOsFile` bytes for the file.
    unsafe {
        let real_vfs = (*vfs).pAppData.cast::<ffi::sqlite3_vfs>();
        let Some(real_open) = (*real_vfs).xOpen else { return ffi::SQLITE_ERROR };
        if flags & ffi::SQLITE_OPEN_MAIN_DB == 0 {
            return real_open(real_vfs, name, file, flags, out);
        }
        let own = file.cast::<SealedFile>();
        let real = file.cast::<u8>().add(OWN).cast::<ffi::sqlite3_file>();
        let header = FileHeader { sealed: false, page: 4_096 };
        own.write(SealedFile { base: ffi::sqlite3_file { pMethods: std::ptr::null() }, real, header });
        let code = real_open(real_vfs, name, real, flags, out);
        if code != ffi::SQLITE_OK {
            return code;
        }
        (*own).base.pMethods = &raw const METHODS;
        let mut bytes = [0; HEADER];
        // A file that is shorter than its header is new: its first page says what it will be.
        if real_read(real, bytes.as_mut_ptr().cast(), HEADER as c_int, 0) == ffi::SQLITE_OK {
            (*own).header = FileHeader::from_header(&bytes, SEALED_APPLICATION);
        }
        ffi::SQLITE_OK
    }
}

/// Calls the function of the system of this name for the same file.
macro_rules! system {
    ($file:expr, $function:ident $(, $argument:expr)*) => {{
        // SAFETY: `SQLite` calls only with files that `open` has made, whose system file is open.
        unsafe {
            let real = (*$file.cast::<SealedFile>()).real;
            match (*(*real).pMethods).$function {
                Some(function) => function(real $(, $argument)*),
                None => ffi::SQLITE_NOTFOUND,
            }
        }
    }};
}

/// Reads from a file of the system.
///
/// # Safety
/// The file is open, and `to` has room for `length` bytes.
unsafe fn real_read(real: *mut ffi::sqlite3_file, to: *mut c_void, length: c_int, offset: i64) -> c_int {
    // SAFETY: as the caller promises.
    unsafe {
        match (*(*real).pMethods).xRead {
            Some(read) => read(real, to, length, offset),
            None => ffi::SQLITE_IOERR,
        }
    }
}

fn note_damaged_page(number: u32) -> c_int {
    DAMAGED.store(number, Ordering::Relaxed);
    ffi::SQLITE_IOERR_DATA
}

unsafe extern "C" fn read(file: *mut ffi::sqlite3_file, to: *mut c_void, length: c_int, offset: i64) -> c_int {
    // SAFETY: `SQLite` calls only with files that `open` has made, and with room for `length` bytes.
    unsafe {
        let SealedFile { real, header, .. } = *file.cast::<SealedFile>();
        let code = real_read(real, to, length, offset);
        let (Ok(bytes), Ok(place)) = (usize::try_from(length), u64::try_from(offset)) else { return code };
        // The header alone is read before anybody knows the length of a page; its page is checked when it is read.
        if code != ffi::SQLITE_OK || !header.sealed || place + bytes as u64 <= HEADER as u64 {
            return code;
        }
        let target = std::slice::from_raw_parts_mut(to.cast::<u8>(), bytes);
        if sum::is_page(bytes, place) {
            let number = sum::page_number(bytes, place);
            return if sum::unseal_page(target, number) { code } else { note_damaged_page(number) };
        }
        check_around(real, header.page, bytes as u64, place)
    }
}

/// Checks the pages of which a part was read.
///
/// # Safety
/// The file is open.
unsafe fn check_around(real: *mut ffi::sqlite3_file, page: usize, bytes: u64, place: u64) -> c_int {
    let length = page as u64;
    let mut whole = vec![0; page];
    for index in place / length..(place + bytes).div_ceil(length) {
        let (Ok(of_page), Ok(offset)) = (c_int::try_from(page), i64::try_from(index * length)) else { continue };
        // SAFETY: the vector has room for a page, and the file is open.
        let code = unsafe { real_read(real, whole.as_mut_ptr().cast(), of_page, offset) };
        if code != ffi::SQLITE_OK {
            return code;
        }
        let number = sum::page_number(page, index * length);
        if !sum::unseal_page(&mut whole, number) {
            return note_damaged_page(number);
        }
    }
    ffi::SQLITE_OK
}

unsafe extern "C" fn write(file: *mut ffi::sqlite3_file, from: *const c_void, length: c_int, offset: i64) -> c_int {
    // No caller writes before the file; one that did would get an error, and no page a wrong number.
    let (Ok(bytes), Ok(place)) = (usize::try_from(length), u64::try_from(offset)) else {
        return ffi::SQLITE_IOERR_WRITE;
    };
    // SAFETY: `SQLite` calls with `length` bytes to write, which stay as they are meanwhile.
    let source = unsafe { std::slice::from_raw_parts(from.cast::<u8>(), bytes) };
    if let Some(header) = source.first_chunk::<HEADER>().filter(|_| place == 0) {
        // SAFETY: `SQLite` calls only with files that `open` has made.
        unsafe { (*file.cast::<SealedFile>()).header = FileHeader::from_header(header, SEALED_APPLICATION) };
    }
    // SAFETY: as above.
    let sealed = unsafe { (*file.cast::<SealedFile>()).header.sealed };
    if !sealed || !sum::is_page(source.len(), place) {
        return system!(file, xWrite, from, length, offset);
    }
    let mut page = source.to_vec();
    sum::seal_page(&mut page, sum::page_number(source.len(), place));
    system!(file, xWrite, page.as_ptr().cast(), length, offset)
}

unsafe extern "C" fn close(file: *mut ffi::sqlite3_file) -> c_int {
    system!(file, xClose)
}

unsafe extern "C" fn truncate(file: *mut ffi::sqlite3_file, size: i64) -> c_int {
    system!(file, xTruncate, size)
}

unsafe extern "C" fn sync(file: *mut ffi::sqlite3_file, flags: c_int) -> c_int {
    system!(file, xSync, flags)
}

unsafe extern "C" fn file_size(file: *mut ffi::sqlite3_file, size: *mut i64) -> c_int {
    system!(file, xFileSize, size)
}

unsafe extern "C" fn lock(file: *mut ffi::sqlite3_file, level: c_int) -> c_int {
    system!(file, xLock, level)
}

unsafe extern "C" fn unlock(file: *mut ffi::sqlite3_file, level: c_int) -> c_int {
    system!(file, xUnlock, level)
}

unsafe extern "C" fn check_reserved_lock(file: *mut ffi::sqlite3_file, held: *mut c_int) -> c_int {
    system!(file, xCheckReservedLock, held)
}

unsafe extern "C" fn file_control(file: *mut ffi::sqlite3_file, what: c_int, argument: *mut c_void) -> c_int {
    system!(file, xFileControl, what, argument)
}

unsafe extern "C" fn sector_size(file: *mut ffi::sqlite3_file) -> c_int {
    system!(file, xSectorSize)
}

/// Whatever the system can do, parts of pages are not read past the check.
unsafe extern "C" fn device_characteristics(file: *mut ffi::sqlite3_file) -> c_int {
    system!(file, xDeviceCharacteristics) & !ffi::SQLITE_IOCAP_SUBPAGE_READ
}

unsafe extern "C" fn shm_map(
    file: *mut ffi::sqlite3_file,
    region: c_int,
    size: c_int,
    extend: c_int,
    at: *mut *mut c_void,
) -> c_int {
    system!(file, xShmMap, region, size, extend, at)
}

unsafe extern "C" fn shm_lock(file: *mut ffi::sqlite3_file, offset: c_int, count: c_int, flags: c_int) -> c_int {
    system!(file, xShmLock, offset, count, flags)
}

unsafe extern "C" fn shm_barrier(file: *mut ffi::sqlite3_file) {
    // SAFETY: `SQLite` calls only with files that `open` has made, whose system file is open.
    unsafe {
        let real = (*file.cast::<SealedFile>()).real;
        if let Some(function) = (*(*real).pMethods).xShmBarrier {
            function(real);
        }
    }
}

unsafe extern "C" fn shm_unmap(file: *mut ffi::sqlite3_file, delete: c_int) -> c_int {
    system!(file, xShmUnmap, delete)
}

/// Pages in mapped memory would be read past the check: there are none.
unsafe extern "C" fn fetch(_: *mut ffi::sqlite3_file, _: i64, _: c_int, at: *mut *mut c_void) -> c_int {
    // SAFETY: `SQLite` hands over the place of one pointer.
    unsafe { *at = null_mut() };
    ffi::SQLITE_OK
}

unsafe extern "C" fn unfetch(_: *mut ffi::sqlite3_file, _: i64, _: *mut c_void) -> c_int {
    ffi::SQLITE_OK
}

static METHODS: ffi::sqlite3_io_methods = ffi::sqlite3_io_methods {
    iVersion: 3,
    xClose: Some(close),
    xRead: Some(read),
    xWrite: Some(write),
    xTruncate: Some(truncate),
    xSync: Some(sync),
    xFileSize: Some(file_size),
    xLock: Some(lock),
    xUnlock: Some(unlock),
    xCheckReservedLock: Some(check_reserved_lock),
    xFileControl: Some(file_control),
    xSectorSize: Some(sector_size),
    xDeviceCharacteristics: Some(device_characteristics),
    xShmMap: Some(shm_map),
    xShmLock: Some(shm_lock),
    xShmBarrier: Some(shm_barrier),
    xShmUnmap: Some(shm_unmap),
    xFetch: Some(fetch),
    xUnfetch: Some(unfetch),
};
