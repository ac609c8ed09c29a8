//! The outer frame.

use super::{BODY_MAX, Cursor, WireError};
use adapter_core::integer::convert_bounded;

/// Bytes before the body.
pub const HEADER_LEN: usize = 10;

const MAGIC: [u8; 4] = [0xA0; 4];

/// What a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FrameKind {
    /// A client wants a connection.
    Open,
    /// The controller has opened the connection.
    Opened,
    /// It is not: every connection the controller has is in use.
    OpenRefused,
    /// A client ends the connection.
    Close,
    /// The controller confirms the end.
    Closed,
    /// Questions in one or several blocks.
    Request,
    /// The answers, a block for each question.
    Answer,
    /// The controller could not make sense of the request.
    Error,
}

impl FrameKind {
    /// Every kind with its number.
    pub const ALL: [(Self, u16); 8] = [
        (Self::Open, 0x0101),
        (Self::Opened, 0x0102),
        (Self::OpenRefused, 0x0103),
        (Self::Close, 0x0201),
        (Self::Closed, 0x0202),
        (Self::Request, 0x2101),
        (Self::Answer, 0x2102),
        (Self::Error, 0x2103),
    ];

    /// The number on the wire.
    #[must_use]
    pub fn wire_number(self) -> u16 {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or(0, |(_, number)| *number)
    }

    fn from_number(number: u16) -> Result<Self, WireError> {
        let known = Self::ALL.iter().find(|(_, known)| *known == number);
        known.map(|(kind, _)| *kind).ok_or(WireError::Kind(number))
    }
}

/// What stands before the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FocasHeader {
    /// 1 from a client; from a controller its generation.
    pub version: u16,
    /// What the frame is.
    pub kind: FrameKind,
    /// Bytes of the body.
    pub body_len: usize,
}

impl FocasHeader {
    /// Looks at the first bytes of a frame.
    ///
    /// # Errors
    /// They are of something else, or announce more than is accepted.
    pub fn from_bytes(bytes: &[u8; HEADER_LEN]) -> Result<Self, WireError> {
        let [a, b, c, d, ..] = *bytes;
        if [a, b, c, d] != MAGIC {
            return Err(WireError::Magic([a, b, c, d]));
        }
        let mut rest = Cursor::new("header", &bytes[4..]);
        let version = rest.read_u16()?;
        let kind = FrameKind::from_number(rest.read_u16()?)?;
        let body_len = usize::from(rest.read_u16()?);
        if body_len > BODY_MAX { Err(WireError::TooLong(body_len)) } else { Ok(Self { version, kind, body_len }) }
    }
}

/// A frame with its whole body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FocasFrame {
    /// The same as [`FocasHeader::version`] of its header.
    pub version: u16,
    /// What the frame is for.
    pub kind: FrameKind,
    /// The bytes behind the header, at most [`BODY_MAX`].
    pub body: Vec<u8>,
}

impl FocasFrame {
    /// Exactly one frame.
    ///
    /// # Errors
    /// The bytes are something else, too few or too many.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, WireError> {
        let short = WireError::Short { what: "header", needed: HEADER_LEN, left: bytes.len() };
        let (head, body) = bytes.split_first_chunk::<HEADER_LEN>().ok_or(short)?;
        let header = FocasHeader::from_bytes(head)?;
        let mut rest = Cursor::new("body", body);
        let body = rest.read_bytes(header.body_len)?.to_vec();
        rest.check_end()?;
        Ok(Self { version: header.version, kind: header.kind, body })
    }
}

/// The bytes of a frame. A body beyond [`BODY_MAX`] is cut off there; no builder here makes one.
#[must_use]
pub fn encode_frame(version: u16, kind: FrameKind, body: &[u8]) -> Vec<u8> {
    let body = &body[..body.len().min(BODY_MAX)];
    let mut bytes = Vec::with_capacity(HEADER_LEN + body.len());
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&version.to_be_bytes());
    bytes.extend_from_slice(&kind.wire_number().to_be_bytes());
    bytes.extend_from_slice(&convert_bounded(body.len(), u16::MAX).to_be_bytes());
    bytes.extend_from_slice(body);
    bytes
}
