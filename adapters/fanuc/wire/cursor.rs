//! Big-endian integers out of bytes, without ever reading beyond them.

use super::WireError;

/// Reads from the front of a slice.
#[derive(Debug, Clone, Copy)]
pub struct Cursor<'a> {
    what: &'static str,
    rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    /// `what` is named in errors.
    #[must_use]
    pub fn new(what: &'static str, bytes: &'a [u8]) -> Self {
        Self { what, rest: bytes }
    }

    /// Bytes that are left.
    #[must_use]
    pub fn bytes_left(&self) -> usize {
        self.rest.len()
    }

    /// The next `count` bytes.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn read_bytes(&mut self, count: usize) -> Result<&'a [u8], WireError> {
        let short = WireError::Short { what: self.what, needed: count, left: self.rest.len() };
        let (head, rest) = self.rest.split_at_checked(count).ok_or(short)?;
        self.rest = rest;
        Ok(head)
    }

    fn read_array<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        let short = WireError::Short { what: self.what, needed: N, left: self.rest.len() };
        let (head, rest) = self.rest.split_first_chunk::<N>().ok_or(short)?;
        self.rest = rest;
        Ok(*head)
    }

    /// The next byte.
    ///
    /// # Errors
    /// Nothing is left.
    pub fn read_u8(&mut self) -> Result<u8, WireError> {
        self.read_array().map(u8::from_be_bytes)
    }

    /// The next two bytes.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn read_u16(&mut self) -> Result<u16, WireError> {
        self.read_array().map(u16::from_be_bytes)
    }

    /// The next two bytes, signed.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn read_i16(&mut self) -> Result<i16, WireError> {
        self.read_array().map(i16::from_be_bytes)
    }

    /// The next four bytes, signed.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn read_i32(&mut self) -> Result<i32, WireError> {
        self.read_array().map(i32::from_be_bytes)
    }

    /// Nothing may be left.
    ///
    /// # Errors
    /// Something is.
    pub fn check_end(self) -> Result<(), WireError> {
        if self.rest.is_empty() { Ok(()) } else { Err(WireError::Long { what: self.what, left: self.rest.len() }) }
    }
}
