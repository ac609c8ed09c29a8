//! The body of an HTTP answer: with a length, in chunks (RFC 9112, 7.1), or up to the end of the connection.

/// Longest line with the size of a chunk, bytes.
const CHUNK_LINE_MAX: usize = 1024;

/// The framing of a body is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the size of a part of the answer (chunk) is no number")]
pub(crate) struct BrokenChunk;

#[derive(Debug, Clone, PartialEq, Eq)]
enum Framing {
    /// So many bytes are still to come.
    Length(u64),
    UntilClosed,
    /// A line with the size of the next chunk comes, of which this is the beginning.
    ChunkSize(Vec<u8>),
    /// So many bytes of the chunk are still to come, then the end of its line.
    ChunkData(u64),
    ChunkEnd(Vec<u8>),
    Complete,
}

/// Takes the framing off.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct BodyDecoder {
    framing: Framing,
}

impl BodyDecoder {
    pub(crate) fn with_length(length: u64) -> Self {
        Self { framing: if length == 0 { Framing::Complete } else { Framing::Length(length) } }
    }

    pub(crate) fn in_chunks() -> Self {
        Self { framing: Framing::ChunkSize(Vec::new()) }
    }

    pub(crate) fn until_closed() -> Self {
        Self { framing: Framing::UntilClosed }
    }

    /// Has everything come? A body without a length is complete when the connection ends.
    pub(crate) fn is_complete(&self) -> bool {
        self.framing == Framing::Complete
    }

    /// May the connection end here?
    pub(crate) fn may_end(&self) -> bool {
        matches!(self.framing, Framing::Complete | Framing::UntilClosed)
    }

    /// Appends what `bytes` hold of the body to `out`.
    ///
    /// # Errors
    /// The size of a chunk is no number.
    pub(crate) fn decode_into(&mut self, mut bytes: &[u8], out: &mut Vec<u8>) -> Result<(), BrokenChunk> {
        while !bytes.is_empty() {
            match &mut self.framing {
                Framing::Complete => return Ok(()),
                Framing::UntilClosed => {
                    out.extend_from_slice(bytes);
                    return Ok(());
                }
                Framing::Length(left) => {
                    bytes = take_bytes(left, bytes, out);
                    if *left == 0 {
                        self.framing = Framing::Complete;
                    }
                }
                Framing::ChunkData(left) => {
                    bytes = take_bytes(left, bytes, out);
                    if *left == 0 {
                        self.framing = Framing::ChunkEnd(Vec::new());
                    }
                }
                Framing::ChunkSize(line) | Framing::ChunkEnd(line) => {
                    let end = bytes.iter().position(|byte| *byte == b'\n');
                    let (here, rest) = bytes.split_at(end.map_or(bytes.len(), |end| end + 1));
                    bytes = rest;
                    line.extend_from_slice(here);
                    if line.len() > CHUNK_LINE_MAX {
                        return Err(BrokenChunk);
                    }
                    if end.is_some() {
                        self.end_line()?;
                    }
                }
            }
        }
        Ok(())
    }

    fn end_line(&mut self) -> Result<(), BrokenChunk> {
        self.framing = match &self.framing {
            Framing::ChunkSize(line) => match parse_chunk_size(line).ok_or(BrokenChunk)? {
                0 => Framing::Complete,
                size => Framing::ChunkData(size),
            },
            Framing::ChunkEnd(line) if line.trim_ascii().is_empty() => Framing::ChunkSize(Vec::new()),
            _ => return Err(BrokenChunk),
        };
        Ok(())
    }
}

fn take_bytes<'a>(left: &mut u64, bytes: &'a [u8], out: &mut Vec<u8>) -> &'a [u8] {
    let count = usize::try_from(*left).map_or(bytes.len(), |left| left.min(bytes.len()));
    out.extend_from_slice(&bytes[..count]);
    *left -= adapter_core::integer::widen_to_u64(count);
    &bytes[count..]
}

/// `1A0;name=value`: the number before the semicolon, hexadecimal.
fn parse_chunk_size(line: &[u8]) -> Option<u64> {
    let text = std::str::from_utf8(line).ok()?;
    let digits = text.split(';').next()?.trim();
    (!digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_hexdigit()))
        .then(|| u64::from_str_radix(digits, 16).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_come_out_as_one_body_however_they_are_cut() {
        let wire = b"5\r\nhello\r\n1;x=y\r\n \r\n00006\nworld!\r\n0\r\n\r\n";
        for step in 1..wire.len() {
            let (mut decoder, mut out) = (BodyDecoder::in_chunks(), Vec::new());
            wire.chunks(step).for_each(|part| decoder.decode_into(part, &mut out).expect("well framed"));
            assert!(decoder.is_complete() && out == b"hello world!", "{step}");
        }
    }

    #[test]
    fn a_length_ends_the_body_and_nonsense_is_refused() {
        let (mut decoder, mut out) = (BodyDecoder::with_length(3), Vec::new());
        assert!(!decoder.may_end());
        decoder.decode_into(b"abcdef", &mut out).expect("well framed");
        assert!(decoder.is_complete() && out == b"abc");
        for wrong in [&b"zz\r\n"[..], b"\r\n", b"-1\r\n", b"3\r\nabcd\r\n", b"ffffffffffffffffff\r\n"] {
            assert_eq!(BodyDecoder::in_chunks().decode_into(wrong, &mut Vec::new()), Err(BrokenChunk), "{wrong:?}");
        }
        assert_eq!(BodyDecoder::in_chunks().decode_into(&[b'1'; 2000], &mut Vec::new()), Err(BrokenChunk));
    }
}
