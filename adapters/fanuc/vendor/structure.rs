//! A structure that the library filled in, read field by field.

use super::layout::LoadElm;
use crate::answer::{FocasItemError, Refusal};
use crate::code::FocasReturnCode;
use adapter_core::text::TextEncoding;
use device_line::child::{Guarded, Missing};
use std::mem::offset_of;

/// Decimals of offsets that the library gives without them (increment system IS-B, millimetres).
pub(super) const POSITION_PLACES: i16 = 3;

/// Why a call has no structure.
fn convert_missing(_: Missing) -> FocasItemError {
    FocasItemError::NotOffered
}

pub(super) fn check_code(code: Result<i16, Missing>) -> Result<(), FocasItemError> {
    match code.map_err(convert_missing)? {
        0 => Ok(()),
        code => Err(FocasItemError::Refused(Refusal { code: FocasReturnCode(code), detail: 0 })),
    }
}

/// A structure that a call fills in; on any code but 0 nothing of it is looked at.
pub(super) fn fill_structure(
    length: usize,
    call: impl FnOnce(&mut Guarded) -> Result<i16, Missing>,
) -> Result<Bytes, FocasItemError> {
    let mut buffer = Guarded::new(length);
    check_code(call(&mut buffer))?;
    buffer.read_bytes().map(Bytes).map_err(|overrun| FocasItemError::Malformed(overrun.to_string()))
}

/// The bytes of a structure, read little-endian by offset; what lies beyond the end is zero.
pub(super) struct Bytes(Vec<u8>);

impl Bytes {
    pub(super) fn read_array<const N: usize>(&self, at: usize) -> [u8; N] {
        self.0.get(at..).and_then(|rest| rest.first_chunk::<N>()).copied().unwrap_or([0; N])
    }

    pub(super) fn read_i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.read_array(at))
    }

    pub(super) fn read_i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.read_array(at))
    }

    /// A name in ASCII.
    pub(super) fn read_text(&self, at: usize, length: usize) -> String {
        self.text_in(at, length, TextEncoding::default())
    }

    /// A text in the character set of the controller.
    pub(super) fn text_in(&self, at: usize, length: usize, encoding: TextEncoding) -> String {
        encoding.decode_trimmed(self.0.get(at..(at + length).min(self.0.len())).unwrap_or_default())
    }

    /// A number with its decimals.
    pub(super) fn read_element(&self, at: usize) -> Option<f64> {
        scale_decimal(self.read_i32(at), self.read_i16(at + offset_of!(LoadElm, dec)))
    }
}

pub(super) fn scale_decimal(data: i32, places: i16) -> Option<f64> {
    (0..=9).contains(&places).then(|| f64::from(data) / 10f64.powi(i32::from(places)))
}
