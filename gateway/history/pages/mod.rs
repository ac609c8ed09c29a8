//! A checksum at the end of every page of the file, so that a bit that the disk has changed is never taken for a value.
//!
//! # Why pages, and not rows
//! A changed bit in a value gives another number, one in an index or in an inner node of a tree hides rows, one in the header
//! gives a file that nobody knows. Only a sum over the page finds all of them, in every table and for every statement. `SQLite`
//! leaves room for it: bytes at the end of each page that it neither reads nor writes. Any other client reads such a file.
//!
//! # Form
//! The last eight bytes of a page are its CRC-32 (ISO-HDLC) and its number, little endian; the sum covers the rest of the page and
//! the number, so that a page in the wrong place is found, too. Zeros mean that nobody has sealed the page: another program that
//! opened the file after a crash may have copied pages from the log into it, which is its right. They are sealed when they are
//! next written.
//!
//! Sums are written when pages are copied from the log into the file, and checked whenever a page is read from there. The log has
//! sums of its own, which `SQLite` checks after a crash.
//!
//! A program that *changes* the file other than through this one leaves the sum of what was there before: its change is told as
//! damage.
//!
//! | file | what |
//! |---|---|
//! | `sum` | seal a page, check a page; pure |
//! | `ffi` | between `SQLite` and the file: what it calls to read and write |

mod ffi;
mod sum;

/// `cncs`, stored as `application_id` of files whose pages have sums (the [module](self)).
pub(super) const SEALED_APPLICATION: u32 = 0x636e_6373;

pub(super) use ffi::{VFS, damaged_page, register_layer, reserve_room};

/// Has the page of this number a sum, and is it right?
pub(super) fn is_sealed_page(page: &mut [u8], number: u32) -> bool {
    sum::is_sealed(page) && sum::unseal_page(page, number)
}
