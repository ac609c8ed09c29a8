//! Rows in the binary format of `COPY`. Pure.
//!
//! Source: PostgreSQL documentation, `COPY`, "Binary Format"; the formats of the types are those of their `recv` functions.

/// Begins a stream: signature, no flags, no extension.
const SIGNATURE: &[u8] = b"PGCOPY\n\xff\r\n\0\0\0\0\0\0\0\0\0";
/// Numbers of the types of elements of lists.
const INT4: i32 = 23;
const TEXT: i32 = 25;
const FLOAT4: i32 = 700;
const FLOAT8: i32 = 701;
/// From 1970 to 2000, from which on PostgreSQL counts, microseconds.
const EPOCH_US: i64 = 946_684_800_000_000;

/// Rows of one table.
#[derive(Debug, Clone)]
pub(super) struct CopyRows {
    bytes: Vec<u8>,
    rows: u64,
}

/// A length as the protocol writes it. The server refuses the whole statement where a length does not fit what follows, so that
/// the bound stores nothing wrong.
fn to_wire_length(length: usize) -> i32 {
    debug_assert!(
        i32::try_from(length).is_ok(),
        "a field is part of a message of NATS, and those are of megabytes: {length} bytes or items"
    );
    i32::try_from(length).unwrap_or(i32::MAX)
}

impl CopyRows {
    pub(super) fn new() -> Self {
        Self { bytes: SIGNATURE.to_vec(), rows: 0 }
    }

    pub(super) fn row_count(&self) -> u64 {
        self.rows
    }

    /// A row of so many fields begins.
    pub(super) fn begin_row(&mut self, fields: i16) -> &mut Self {
        self.rows += 1;
        self.bytes.extend(fields.to_be_bytes());
        self
    }

    /// Everything, with the mark of the end.
    pub(super) fn into_bytes(mut self) -> Vec<u8> {
        self.bytes.extend((-1_i16).to_be_bytes());
        self.bytes
    }

    fn append_field(&mut self, bytes: &[u8]) -> &mut Self {
        self.bytes.extend(to_wire_length(bytes.len()).to_be_bytes());
        self.bytes.extend(bytes);
        self
    }

    pub(super) fn append_null(&mut self) -> &mut Self {
        self.bytes.extend((-1_i32).to_be_bytes());
        self
    }

    pub(super) fn append_int4(&mut self, number: i32) -> &mut Self {
        self.append_field(&number.to_be_bytes())
    }

    pub(super) fn append_int8(&mut self, number: i64) -> &mut Self {
        self.append_field(&number.to_be_bytes())
    }

    pub(super) fn append_flag(&mut self, flag: bool) -> &mut Self {
        self.append_field(&[u8::from(flag)])
    }

    pub(super) fn append_text(&mut self, text: &str) -> &mut Self {
        self.append_field(text.as_bytes())
    }

    /// A time, in microseconds since 1970.
    pub(super) fn append_time(&mut self, at_us: i64) -> &mut Self {
        self.append_int8(at_us.saturating_sub(EPOCH_US))
    }

    pub(super) fn append_json(&mut self, text: Option<&str>) -> &mut Self {
        match text {
            None => self.append_null(),
            Some(text) => self.append_field(&[b"\x01", text.as_bytes()].concat()),
        }
    }

    /// A list without holes.
    fn append_list<T, const N: usize>(&mut self, kind: i32, items: &[T], bytes: impl Fn(&T) -> [u8; N]) -> &mut Self {
        self.list_of(kind, items.iter().map(|item| Some(bytes(item))))
    }

    fn list_of<B: AsRef<[u8]>>(&mut self, kind: i32, items: impl ExactSizeIterator<Item = Option<B>>) -> &mut Self {
        let start = self.bytes.len();
        self.bytes.extend(0_i32.to_be_bytes());
        let count = to_wire_length(items.len());
        // Dimensions, whether there may be holes, type; then of the only dimension length and first index.
        let head: &[i32] = if count == 0 { &[0, 0, kind] } else { &[1, 1, kind, count, 1] };
        head.iter().for_each(|number| self.bytes.extend(number.to_be_bytes()));
        for item in items {
            match item {
                None => self.bytes.extend((-1_i32).to_be_bytes()),
                Some(item) => {
                    self.bytes.extend(to_wire_length(item.as_ref().len()).to_be_bytes());
                    self.bytes.extend(item.as_ref());
                }
            }
        }
        let length = to_wire_length(self.bytes.len() - start - 4);
        self.bytes[start..start + 4].copy_from_slice(&length.to_be_bytes());
        self
    }

    pub(super) fn int4_list(&mut self, items: &[i32]) -> &mut Self {
        self.append_list(INT4, items, |number| number.to_be_bytes())
    }

    pub(super) fn float8_list(&mut self, items: &[f64]) -> &mut Self {
        self.append_list(FLOAT8, items, |number| number.to_be_bytes())
    }

    /// Single precision, with holes.
    pub(super) fn float4_list(&mut self, items: &[Option<f32>]) -> &mut Self {
        self.list_of(FLOAT4, items.iter().map(|number| number.map(f32::to_be_bytes)))
    }

    pub(super) fn text_list<S: AsRef<str>>(&mut self, items: &[S]) -> &mut Self {
        self.list_of(TEXT, items.iter().map(|text| Some(text.as_ref().as_bytes())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_what_the_format_says() {
        let mut rows = CopyRows::new();
        rows.begin_row(4).append_int4(7).append_null().int4_list(&[5]).append_time(946_684_800_000_001);
        assert_eq!(rows.row_count(), 1);
        let bytes = rows.into_bytes();
        let expected = [
            SIGNATURE,
            b"\0\x04\0\0\0\x04\0\0\0\x07\xff\xff\xff\xff",
            b"\0\0\0\x1c\0\0\0\x01\0\0\0\x01\0\0\0\x17\0\0\0\x01\0\0\0\x01\0\0\0\x04\0\0\0\x05",
            b"\0\0\0\x08\0\0\0\0\0\0\0\x01\xff\xff",
        ]
        .concat();
        assert_eq!(bytes, expected);
    }
}
