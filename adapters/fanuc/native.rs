//! FOCAS2/Ethernet spoken by ourselves.
//!
//! One TCP connection (the vendor's library takes two), one question outstanding, every answer checked against its
//! question: kind of frame, number of blocks, device, path, function, every length. Whatever does not fit ends the
//! connection, because there is no other way to find the beginning of the next frame. The deadline holds for the whole
//! exchange, also when the answer comes byte by byte. Leaving says so: a controller has only a few connections.

use super::answer::{FocasItemError, FocasItemResult, Refusal};
use super::code::FocasReturnCode;
use super::decode::{self, Dialect};
use super::focas::{Focas, FocasError};
use super::generation::{Generation, Opening};
use super::item::{FocasItem, Question, Write};
use super::request;
use super::statistics::Statistics;
use super::wire::{
    FocasFrame, FocasHeader, FrameKind, HEADER_LEN, Reply, Request, WireError, encode_frame, parse_replies,
    request_body,
};
use adapter_core::address::Endpoint;
use adapter_core::stream::{self, Short};
use adapter_core::text::TextEncoding;
use std::io::{ErrorKind, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longest request that is sent; older controllers take 1450 bytes.
const REQUEST_MAX: usize = 1400;

/// Version word of a client.
const CLIENT: u16 = 1;

/// Connection of the second kind: questions, no program transfer.
const FOR_QUESTIONS: [u8; 2] = [0, 2];

/// How a native connection is made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NativeSettings {
    /// Where the controller is.
    pub endpoint: Endpoint,
    /// Path from 1 that is written to; every path can be asked.
    pub path: u8,
    /// Longest time for connecting, and for one exchange.
    pub timeout: Duration,
    /// Character set of its texts.
    pub encoding: TextEncoding,
}

/// A connection to a controller.
#[derive(Debug)]
pub struct Native {
    stream: TcpStream,
    settings: NativeSettings,
    opening: Opening,
    statistics: Statistics,
}

impl Native {
    /// Connects and opens.
    ///
    /// # Errors
    /// See [`FocasError`].
    pub fn connect(settings: NativeSettings) -> Result<Self, FocasError> {
        let deadline = Instant::now() + settings.timeout;
        let mut stream = connect_tcp(&settings.endpoint, deadline)?;
        send_bytes(&mut stream, &encode_frame(CLIENT, FrameKind::Open, &FOR_QUESTIONS), settings.timeout)?;
        let answer = receive_frame(&mut stream, deadline, settings.timeout)?;
        let opening = match answer.kind {
            FrameKind::Opened => {
                Opening::read(Generation::from_version(answer.version), &answer.body, u16::from(settings.path))
            }
            FrameKind::OpenRefused => return Err(FocasError::NoSession),
            other => return Err(FocasError::Protocol(format!("{other:?} in answer to the opening"))),
        };
        let opening = opening.map_err(|error| build_protocol_error(&error))?;
        if u16::from(settings.path) > opening.paths.max(1) {
            return Err(FocasError::Refused(Refusal { code: FocasReturnCode::PATH, detail: 0 }));
        }
        Ok(Self { stream, settings, opening, statistics: Statistics::default() })
    }

    /// Frames and bytes so far.
    #[must_use]
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// One frame there and one back; shows every answer to `take`.
    fn exchange_frame(
        &mut self,
        requests: &[Request],
        mut take: impl FnMut(usize, &Reply<'_>),
    ) -> Result<(), FocasError> {
        let began = Instant::now();
        let bytes = encode_frame(CLIENT, FrameKind::Request, &request_body(requests));
        send_bytes(&mut self.stream, &bytes, self.settings.timeout)?;
        let answer = receive_frame(&mut self.stream, began + self.settings.timeout, self.settings.timeout)?;
        self.statistics.count_frame(requests.len(), bytes.len(), HEADER_LEN + answer.body.len(), began.elapsed());
        check_answer(&answer, self.opening.generation, requests, &mut take)
    }

    /// How many of the questions fit into one frame in both directions; at least one.
    fn count_fitting(&self, questions: &[Question]) -> usize {
        let (mut asked, mut answered) = (2, 2);
        let fits = |question: &&Question| {
            asked += request::build_read_request(question.item, self.opening.generation).wire_len();
            answered += request::answer_len(question.item, &self.opening);
            asked <= REQUEST_MAX && answered <= self.opening.generation.answer_max()
        };
        questions.iter().take_while(fits).count().max(1)
    }

    /// Every block carries its own path, so that one frame asks several.
    fn build_requests(&self, questions: &[Question]) -> Vec<Request> {
        let block = |question: &Question| {
            request::build_read_request(question.item, self.opening.generation).on_path(u16::from(question.path))
        };
        questions.iter().map(block).collect()
    }
}

/// Is the frame the answer to these questions? Shows each answer to `take`, or none.
fn check_answer(
    answer: &FocasFrame,
    generation: Generation,
    requests: &[Request],
    take: &mut impl FnMut(usize, &Reply<'_>),
) -> Result<(), FocasError> {
    let differs = |what: String| Err(FocasError::Protocol(what));
    if answer.kind != FrameKind::Answer {
        return differs(format!("{:?} in answer to a request", answer.kind));
    }
    if answer.version != generation.version() {
        return differs(format!("version word {} where {} was before", answer.version, generation.version()));
    }
    let found = parse_replies(&answer.body).map_err(|error| build_protocol_error(&error))?;
    if found.len() != requests.len() {
        return differs(format!("{} answers to {} questions", found.len(), requests.len()));
    }
    for (reply, request) in found.iter().zip(requests) {
        reply.check_request(request).map_err(|error| build_protocol_error(&error))?;
    }
    found.iter().enumerate().for_each(|(index, reply)| take(index, reply));
    Ok(())
}

impl Focas for Native {
    fn opening(&self) -> &Opening {
        &self.opening
    }

    fn ask_questions(&mut self, questions: &[Question], out: &mut Vec<FocasItemResult>) -> Result<(), FocasError> {
        let before = out.len();
        let mut rest = questions;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(self.count_fitting(rest));
            let dialect = Dialect { generation: self.opening.generation, encoding: self.settings.encoding };
            let requests = self.build_requests(now);
            let asked =
                self.exchange_frame(&requests, |index, reply| out.push(decode_result(now[index].item, dialect, reply)));
            asked.inspect_err(|_| out.truncate(before))?;
            rest = later;
        }
        Ok(())
    }

    fn write(&mut self, write: &Write) -> Result<(), FocasError> {
        let request =
            request::build_write_request(write, self.opening.generation).on_path(u16::from(self.settings.path));
        let mut refusal = None;
        self.exchange_frame(std::slice::from_ref(&request), |_, reply| refusal = find_refusal(reply))?;
        refusal.map_or(Ok(()), |refusal| Err(FocasError::Refused(refusal)))
    }
}

impl Drop for Native {
    fn drop(&mut self) {
        let _gone_already = self.stream.write_all(&encode_frame(CLIENT, FrameKind::Close, &[]));
    }
}

fn find_refusal(reply: &Reply<'_>) -> Option<Refusal> {
    (reply.code != 0).then_some(Refusal { code: FocasReturnCode(reply.code), detail: reply.detail })
}

fn decode_result(item: FocasItem, dialect: Dialect, reply: &Reply<'_>) -> FocasItemResult {
    match find_refusal(reply) {
        Some(refusal) => Err(FocasItemError::Refused(refusal)),
        None => {
            decode::read_answer(item, dialect, reply.data).map_err(|error| FocasItemError::Malformed(error.to_string()))
        }
    }
}

fn build_protocol_error(error: &WireError) -> FocasError {
    FocasError::Protocol(error.to_string())
}

fn connect_tcp(at: &Endpoint, until: Instant) -> Result<TcpStream, FocasError> {
    let addresses = stream::resolve_addresses(at).map_err(|error| FocasError::Name(error.to_string()))?;
    stream::connect_any(&addresses, until).map_err(|error| match error.kind() {
        ErrorKind::ConnectionRefused => FocasError::NobodyThere(error.to_string()),
        _ => FocasError::Unreachable(error.to_string()),
    })
}

fn io_error(error: &std::io::Error, timeout: Duration) -> FocasError {
    if stream::is_silence(error) { FocasError::Timeout(timeout) } else { FocasError::Broken(error.to_string()) }
}

fn send_bytes(stream: &mut TcpStream, bytes: &[u8], timeout: Duration) -> Result<(), FocasError> {
    let line = |error| io_error(&error, timeout);
    stream.set_write_timeout(Some(timeout)).map_err(line)?;
    stream.write_all(bytes).map_err(line)
}

fn receive_frame(stream: &mut TcpStream, deadline: Instant, timeout: Duration) -> Result<FocasFrame, FocasError> {
    let mut head = [0; HEADER_LEN];
    fill_from_stream(stream, &mut head, deadline, 0, timeout)?;
    let header = FocasHeader::from_bytes(&head).map_err(|error| build_protocol_error(&error))?;
    let mut body = vec![0; header.body_len];
    fill_from_stream(stream, &mut body, deadline, HEADER_LEN, timeout)?;
    Ok(FocasFrame { version: header.version, kind: header.kind, body })
}

/// Reads until the buffer is full or the deadline is over; `before` bytes of the same answer have come already.
fn fill_from_stream(
    stream: &mut TcpStream,
    buffer: &mut [u8],
    deadline: Instant,
    before: usize,
    timeout: Duration,
) -> Result<(), FocasError> {
    stream::fill_counting(stream, buffer, deadline).map_err(|(got, short)| match (before + got, short) {
        (0, Short::Silent) => FocasError::Timeout(timeout),
        (0, Short::Closed) => FocasError::Broken("the controller closed it".to_owned()),
        (0, Short::Broken(error)) => FocasError::Broken(error.to_string()),
        (got, Short::Silent) => FocasError::Cut { got, waited: Some(timeout) },
        (got, Short::Closed | Short::Broken(_)) => FocasError::Cut { got, waited: None },
    })
}
