//! The parts of an answer that does not end (`multipart/x-mixed-replace`, RFC 2046): each is a document.

use memchr::memmem;

/// Longest document of an agent, bytes: 10,000 data items take about three million. A longer one is refused; what a lower limit would cost is a
/// device that is not read, what a higher one costs is memory of the box.
pub const DOCUMENT_BYTES_MAX: usize = 32 << 20;
/// Longest head of a part, bytes.
const HEAD_BYTES_MAX: usize = 16 << 10;

/// Why parts cannot be told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum MultipartError {
    #[error("a part is longer than {DOCUMENT_BYTES_MAX} bytes")]
    TooLong,
    #[error("the head of a part has no end")]
    Head,
}

/// Cuts a body into its parts.
#[derive(Debug)]
pub(crate) struct MultipartSplitter {
    delimiter: Vec<u8>,
    buffer: Vec<u8>,
    /// Bytes of the buffer that belong to parts that have been taken.
    done: usize,
    /// Where to go on looking for the end of a part without a length, from `done`.
    searched_to: usize,
}

/// The boundary that a content type names; `None` for an answer in one part.
pub(crate) fn find_boundary(content_type: &str) -> Option<String> {
    let mut words = content_type.split(';').map(str::trim);
    let is_multipart = words.next()?.to_ascii_lowercase().starts_with("multipart/");
    let value = words.find_map(|word| {
        let (name, value) = word.split_once('=')?;
        name.trim().eq_ignore_ascii_case("boundary").then(|| value.trim().trim_matches('"').to_owned())
    })?;
    (is_multipart && !value.is_empty() && value.len() <= 200).then_some(value)
}

impl MultipartSplitter {
    pub(crate) fn new(boundary: &str) -> Self {
        // Some agents name the boundary with the hyphens that stand before it.
        let delimiter = [b"--", boundary.strip_prefix("--").unwrap_or(boundary).as_bytes()].concat();
        Self { delimiter, buffer: Vec::new(), done: 0, searched_to: 0 }
    }

    /// The place where bytes of the body are appended.
    pub(crate) fn tail(&mut self) -> &mut Vec<u8> {
        self.buffer.drain(..std::mem::take(&mut self.done));
        &mut self.buffer
    }

    /// The next whole part.
    ///
    /// # Errors
    /// A part has no end.
    pub(crate) fn next_part(&mut self) -> Result<Option<Vec<u8>>, MultipartError> {
        let rest = &self.buffer[self.done..];
        let Some(begin) = memmem::find(rest, &self.delimiter) else { return self.wait_for(rest.len()) };
        let head_at = begin + self.delimiter.len();
        let Some((head, body_at)) = split_head(&rest[head_at..]) else {
            return if rest.len() - head_at > HEAD_BYTES_MAX { Err(MultipartError::Head) } else { Ok(None) };
        };
        let body = &rest[head_at + body_at..];
        let end = match find_length(head) {
            Some(length) if length > DOCUMENT_BYTES_MAX => return Err(MultipartError::TooLong),
            Some(length) if body.len() < length => None,
            Some(length) => Some(length),
            None => {
                let from = self.searched_to.min(body.len());
                let found = memmem::find(&body[from..], &self.delimiter).map(|at| from + at);
                self.searched_to = body.len().saturating_sub(self.delimiter.len());
                found
            }
        };
        let Some(end) = end else { return self.wait_for(body.len()) };
        let part = body[..end].to_vec();
        self.done += head_at + body_at + end;
        self.searched_to = 0;
        Ok(Some(part))
    }

    fn wait_for(&self, length: usize) -> Result<Option<Vec<u8>>, MultipartError> {
        if length > DOCUMENT_BYTES_MAX { Err(MultipartError::TooLong) } else { Ok(None) }
    }
}

/// The head behind a delimiter, and where the body begins.
fn split_head(bytes: &[u8]) -> Option<(&[u8], usize)> {
    let looked_at = &bytes[..bytes.len().min(HEAD_BYTES_MAX)];
    let ends = [&b"\r\n\r\n"[..], b"\n\n"];
    let found = ends.iter().filter_map(|end| Some((memmem::find(looked_at, end)?, end.len()))).min()?;
    Some((&bytes[..found.0], found.0 + found.1))
}

fn find_length(head: &[u8]) -> Option<usize> {
    let text = std::str::from_utf8(head).ok()?;
    text.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.trim().eq_ignore_ascii_case("content-length").then(|| value.trim().parse().ok())?
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(wire: &[u8], step: usize) -> Vec<Vec<u8>> {
        let (mut splitter, mut parts) = (MultipartSplitter::new("edge"), Vec::new());
        for bytes in wire.chunks(step) {
            splitter.tail().extend_from_slice(bytes);
            while let Some(part) = splitter.next_part().expect("well framed") {
                parts.push(part.trim_ascii().to_vec());
            }
        }
        parts
    }

    #[test]
    fn parts_with_and_without_a_length_are_found_however_they_are_cut() {
        let wire = b"\r\n--edge\r\nContent-type: text/xml\r\nContent-length: 8\r\n\r\n<a>--</a\r\n--edge\r\nContent-type: text/xml\r\n\r\n<b/>\r\n\
            --edge\nContent-Length: 4\n\n<c/>\n--edge--\n";
        for step in 1..wire.len() {
            let parts = split(wire, step);
            assert_eq!(parts, [b"<a>--</a".to_vec(), b"<b/>".to_vec(), b"<c/>".to_vec()], "{step}");
        }
    }

    #[test]
    fn a_part_without_end_is_refused() {
        let mut splitter = MultipartSplitter::new("edge");
        splitter.tail().extend_from_slice(b"--edge\r\nContent-length: 99999999999\r\n\r\n");
        assert_eq!(splitter.next_part(), Err(MultipartError::TooLong));
        let mut splitter = MultipartSplitter::new("edge");
        splitter.tail().extend_from_slice(&[&b"--edge\r\n"[..], &[b'x'; HEAD_BYTES_MAX + 1]].concat());
        assert_eq!(splitter.next_part(), Err(MultipartError::Head));
    }

    #[test]
    fn the_boundary_stands_in_the_content_type() {
        let of = |text| find_boundary(text);
        assert_eq!(of("multipart/x-mixed-replace;boundary=a1"), Some("a1".to_owned()));
        assert_eq!(of("Multipart/X-Mixed-Replace; charset=utf-8; Boundary=\"--a 1\""), Some("--a 1".to_owned()));
        assert_eq!(of("text/xml; boundary=a"), None);
        assert_eq!(of("multipart/x-mixed-replace"), None);
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in "(--edge|\r\n|\n|Content-length: [0-9]{0,20}|<a/>|-){0,40}", step in 1_usize..9) {
            let mut splitter = MultipartSplitter::new("edge");
            for part in bytes.as_bytes().chunks(step) {
                splitter.tail().extend_from_slice(part);
                for _ in 0..50 {
                    if !matches!(splitter.next_part(), Ok(Some(_))) {
                        break;
                    }
                }
            }
        }
    }
}
