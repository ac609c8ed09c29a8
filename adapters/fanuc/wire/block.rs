//! The blocks of a body: questions and their answers.

use super::{BLOCKS_MAX, Cursor, WireError};
use adapter_core::integer::{convert_bounded, length_to_i64};

/// Bytes of a question without what is written.
const REQUEST_LEN: usize = 28;
/// Bytes of an answer without its data.
const REPLY_LEN: usize = 16;

/// Which half of the controller is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CncOrPmc {
    /// The numerical control, number 1 on the wire.
    Cnc,
    /// The programmable machine controller, where the ladder runs.
    Pmc,
}

impl CncOrPmc {
    fn wire_number(self) -> u16 {
        match self {
            Self::Cnc => 1,
            Self::Pmc => 2,
        }
    }

    fn from_number(number: u16) -> Result<Self, WireError> {
        match number {
            1 => Ok(Self::Cnc),
            2 => Ok(Self::Pmc),
            other => Err(WireError::Mismatch { what: "device of a block", expected: 1, found: i64::from(other) }),
        }
    }
}

/// A question as a block of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// The half of the controller that is asked.
    pub device: CncOrPmc,
    /// Path of the control from 1; PMC blocks always carry 1.
    pub path: u16,
    /// Number of the function that is asked for.
    pub function: u16,
    /// Its arguments; the last one counts the bytes that are written.
    pub arguments: [i32; 5],
    /// What is written; empty when reading.
    pub data: Vec<u8>,
}

impl Request {
    /// A question to the control with its first arguments, on path 1.
    #[must_use]
    pub fn new_cnc(function: u16, first: &[i32]) -> Self {
        Self { device: CncOrPmc::Cnc, path: 1, function, arguments: pad_arguments(first), data: Vec::new() }
    }

    /// A question to the PMC.
    #[must_use]
    pub fn new_pmc(function: u16, first: &[i32]) -> Self {
        Self { device: CncOrPmc::Pmc, ..Self::new_cnc(function, first) }
    }

    /// The same, writing these bytes.
    #[must_use]
    pub fn with_data(mut self, data: Vec<u8>) -> Self {
        self.arguments[4] = convert_bounded(data.len(), i32::MAX);
        self.data = data;
        self
    }

    /// The same on another path; a question to the PMC has none.
    #[must_use]
    pub fn on_path(mut self, path: u16) -> Self {
        if self.device == CncOrPmc::Cnc {
            self.path = path;
        }
        self
    }

    /// Bytes on the wire.
    #[must_use]
    pub fn wire_len(&self) -> usize {
        REQUEST_LEN + self.data.len()
    }

    fn write(&self, bytes: &mut Vec<u8>) {
        let length: u16 = convert_bounded(self.wire_len(), u16::MAX);
        for word in [length, self.device.wire_number(), self.path, self.function] {
            bytes.extend_from_slice(&word.to_be_bytes());
        }
        self.arguments.iter().for_each(|argument| bytes.extend_from_slice(&argument.to_be_bytes()));
        bytes.extend_from_slice(&self.data);
    }

    fn read(cursor: &mut Cursor<'_>) -> Result<Self, WireError> {
        let length = usize::from(cursor.read_u16()?);
        let data_len = compute_data_len("length of a question", length, REQUEST_LEN)?;
        let (device, path, function) =
            (CncOrPmc::from_number(cursor.read_u16()?)?, cursor.read_u16()?, cursor.read_u16()?);
        let mut arguments = [0; 5];
        for argument in &mut arguments {
            *argument = cursor.read_i32()?;
        }
        let data = cursor.read_bytes(data_len)?.to_vec();
        Ok(Self { device, path, function, arguments, data })
    }
}

fn pad_arguments(first: &[i32]) -> [i32; 5] {
    std::array::from_fn(|index| first.get(index).copied().unwrap_or(0))
}

/// Bytes of a block beyond its fixed part.
fn compute_data_len(what: &'static str, length: usize, fixed: usize) -> Result<usize, WireError> {
    let short = || WireError::Mismatch { what, expected: length_to_i64(fixed), found: length_to_i64(length) };
    length.checked_sub(fixed).ok_or_else(short)
}

/// The body of a request.
#[must_use]
pub fn request_body(requests: &[Request]) -> Vec<u8> {
    let mut bytes = encode_count(requests.len());
    requests.iter().for_each(|request| request.write(&mut bytes));
    bytes
}

fn encode_count(blocks: usize) -> Vec<u8> {
    convert_bounded(blocks, u16::MAX).to_be_bytes().to_vec()
}

/// The questions of a body.
///
/// # Errors
/// The bytes contradict themselves.
pub fn parse_requests(body: &[u8]) -> Result<Vec<Request>, WireError> {
    let mut cursor = Cursor::new("questions", body);
    let blocks = read_block_count(&mut cursor)?;
    let requests = (0..blocks).map(|_| Request::read(&mut cursor)).collect::<Result<_, _>>()?;
    cursor.check_end()?;
    Ok(requests)
}

fn read_block_count(cursor: &mut Cursor<'_>) -> Result<usize, WireError> {
    let blocks = usize::from(cursor.read_u16()?);
    let most = length_to_i64(BLOCKS_MAX);
    let many = WireError::Mismatch { what: "number of blocks", expected: most, found: length_to_i64(blocks) };
    if blocks > BLOCKS_MAX { Err(many) } else { Ok(blocks) }
}

/// One answer, within the body that carried it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reply<'a> {
    /// The half of the controller that answers.
    pub device: CncOrPmc,
    /// Path of the control, the same as in the question.
    pub path: u16,
    /// Number of the function, the same as in the question.
    pub function: u16,
    /// Return code; 0 when the data are good.
    pub code: i16,
    /// More about a return code.
    pub detail: i16,
    /// What was asked for.
    pub data: &'a [u8],
}

impl<'a> Reply<'a> {
    fn read(cursor: &mut Cursor<'a>) -> Result<Self, WireError> {
        let length = usize::from(cursor.read_u16()?);
        let room = compute_data_len("length of an answer", length, REPLY_LEN)?;
        let (device, path, function) =
            (CncOrPmc::from_number(cursor.read_u16()?)?, cursor.read_u16()?, cursor.read_u16()?);
        let (code, detail, _unused) = (cursor.read_i16()?, cursor.read_i16()?, cursor.read_i16()?);
        let data_len = usize::from(cursor.read_u16()?);
        if data_len != room {
            let what = "length of the data of an answer";
            return Err(WireError::Mismatch { what, expected: length_to_i64(room), found: length_to_i64(data_len) });
        }
        Ok(Self { device, path, function, code, detail, data: cursor.read_bytes(data_len)? })
    }

    /// Is this the answer to that question?
    ///
    /// # Errors
    /// It answers another one.
    pub fn check_request(&self, request: &Request) -> Result<(), WireError> {
        let differs = |what, expected: u16, found: u16| {
            let (expected, found) = (i64::from(expected), i64::from(found));
            if expected == found { Ok(()) } else { Err(WireError::Mismatch { what, expected, found }) }
        };
        differs("device of an answer", request.device.wire_number(), self.device.wire_number())?;
        differs("path of an answer", request.path, self.path)?;
        differs("function of an answer", request.function, self.function)
    }
}

/// The answers of a body.
///
/// # Errors
/// The bytes contradict themselves.
pub fn parse_replies(body: &[u8]) -> Result<Vec<Reply<'_>>, WireError> {
    let mut cursor = Cursor::new("answers", body);
    let blocks = read_block_count(&mut cursor)?;
    let replies = (0..blocks).map(|_| Reply::read(&mut cursor)).collect::<Result<_, _>>()?;
    cursor.check_end()?;
    Ok(replies)
}

/// An answer to be sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplyBlock {
    /// Return code; 0 means that the data are good.
    pub code: i16,
    /// The detail beside the return code.
    pub detail: i16,
    /// What was asked for; empty unless the code is 0.
    pub data: Vec<u8>,
}

/// The body that answers these questions, block by block.
#[must_use]
pub fn reply_body(answers: &[(&Request, ReplyBlock)]) -> Vec<u8> {
    let mut bytes = encode_count(answers.len());
    for (request, answer) in answers {
        let length: u16 = convert_bounded(answer.data.len(), u16::MAX);
        let head = [length.saturating_add(16), request.device.wire_number(), request.path, request.function];
        head.iter().for_each(|word| bytes.extend_from_slice(&word.to_be_bytes()));
        [answer.code, answer.detail, 0].iter().for_each(|word| bytes.extend_from_slice(&word.to_be_bytes()));
        bytes.extend_from_slice(&length.to_be_bytes());
        bytes.extend_from_slice(&answer.data);
    }
    bytes
}
