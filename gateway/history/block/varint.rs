//! Variable-length integers: seven bits per byte, least significant first, as in Protocol Buffers; signed numbers are
//! zigzagged first so that small magnitudes stay small.

/// Appends `value` in groups of 7 bits, the lowest first; bit 7 marks that another byte follows.
#[inline]
pub(crate) fn append_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Signed to unsigned: 0, -1, 1, -2 become 0, 1, 2, 3.
#[inline]
pub(crate) fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

/// The inverse of [`zigzag`].
#[inline]
pub(crate) fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// Reads from the front of a slice; every method is `None` when the bytes end too early.
#[derive(Debug, Clone)]
pub(crate) struct Bytes<'a>(pub(crate) &'a [u8]);

impl<'a> Bytes<'a> {
    #[inline]
    pub(crate) fn read_byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    #[inline]
    pub(crate) fn read_varint(&mut self) -> Option<u64> {
        let first = self.read_byte()?;
        if first < 0x80 {
            return Some(u64::from(first));
        }
        let mut value = u64::from(first & 0x7f);
        for shift in (7..64).step_by(7) {
            let byte = self.read_byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// A count or length; `None` also when it does not fit into memory.
    pub(crate) fn read_count(&mut self) -> Option<usize> {
        usize::try_from(self.read_varint()?).ok()
    }

    pub(crate) fn read_bytes(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    pub(crate) fn read_f64(&mut self) -> Option<f64> {
        Some(f64::from_le_bytes(self.read_bytes(8)?.try_into().ok()?))
    }

    pub(crate) fn read_text(&mut self) -> Option<&'a str> {
        let length = self.read_count()?;
        std::str::from_utf8(self.read_bytes(length)?).ok()
    }
}

/// Appends text with its length.
pub(crate) fn put_text(out: &mut Vec<u8>, text: &str) {
    append_varint(out, text.len() as u64);
    out.extend_from_slice(text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_integer_survives(values in prop::collection::vec(any::<i64>(), 0..50)) {
            let mut out = Vec::new();
            values.iter().for_each(|value| append_varint(&mut out, zigzag(*value)));
            let mut bytes = Bytes(&out);
            for value in values {
                prop_assert_eq!(bytes.read_varint().map(unzigzag), Some(value));
            }
            prop_assert_eq!(bytes.read_varint(), None);
        }

        #[test]
        fn no_bytes_make_it_panic(input in prop::collection::vec(any::<u8>(), 0..40)) {
            let mut bytes = Bytes(&input);
            while bytes.read_varint().is_some() || bytes.read_text().is_some() || bytes.read_f64().is_some() {}
        }
    }
}
