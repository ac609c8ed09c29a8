//! How observations come: as the parts of an answer that does not end, or as the answers to one question at every poll.

use crate::body::BodyDecoder;
use crate::http::{HttpError, READ_BYTES, Response, to_error};
use crate::multipart::{MultipartSplitter, find_boundary};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// At most so many bytes are taken at one poll: more than an agent sends in one, and little enough that a poll ends.
const BYTES_MAX: usize = 64 << 20;

/// An answer in parts that has come for so long is one that goes on. An agent that sends nothing while nothing changes is quiet once in such a time
/// on any machine.
const STEADY: Duration = Duration::from_secs(60);
/// Pause between two looks while a part is waited for.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// Of so many parts the usual distance is known.
const DISTANCES: usize = 9;

/// The way in which a device tells its observations.
pub(crate) enum ObservationFeed {
    Stream(Box<LiveStream>),
    /// The agent answers a question for parts with one document: it is asked at every poll.
    Questions,
}

/// An answer that does not end.
pub(crate) struct LiveStream {
    stream: TcpStream,
    decoder: BodyDecoder,
    splitter: MultipartSplitter,
    began: Instant,
    last_part: Instant,
    /// Longest time without a part.
    silence: Duration,
    /// Parts that have come.
    pub(crate) parts: u64,
    has_ended: bool,
    /// Times from part to part, of the last ones.
    distances: VecDeque<Duration>,
    /// What is read at once: a look comes every few milliseconds.
    bytes: Vec<u8>,
}

impl LiveStream {
    /// Goes on with an answer in parts; gives one in a single part back.
    pub(crate) fn from_response(response: Response, silence: Duration) -> Result<Result<Self, Response>, HttpError> {
        let Some(boundary) = find_boundary(&response.content_type) else { return Ok(Err(response)) };
        let Response { stream, mut decoder, rest, .. } = response;
        stream.set_nonblocking(true).map_err(|error| to_error(&error))?;
        let mut splitter = MultipartSplitter::new(&boundary);
        decoder.decode_into(&rest, splitter.tail()).map_err(|error| HttpError::Nonsense(error.to_string()))?;
        Ok(Ok(Self {
            stream,
            decoder,
            splitter,
            began: Instant::now(),
            last_part: Instant::now(),
            silence,
            parts: 0,
            has_ended: false,
            distances: VecDeque::new(),
            bytes: vec![0; READ_BYTES],
        }))
    }

    /// The parts that have come since the last look. Where there is none it waits for one, at most so long: a poll that comes right behind
    /// another one has its values too.
    ///
    /// # Errors
    /// The connection has ended and every part was taken, nothing has come for too long, or what comes makes no sense.
    pub(crate) fn take_parts(&mut self, wait: Duration) -> Result<Vec<Vec<u8>>, HttpError> {
        let began = Instant::now();
        let mut parts = self.take_available()?;
        while parts.is_empty() && !self.has_ended && began.elapsed() < wait {
            std::thread::sleep(LOOK_EVERY);
            parts = self.take_available()?;
        }
        if !parts.is_empty() {
            self.note_distance(parts.len());
            self.last_part = Instant::now();
            self.parts += adapter_core::integer::widen_to_u64(parts.len());
            return Ok(parts);
        }
        if self.has_ended || self.decoder.is_complete() {
            return Err(HttpError::Line("the agent ended its answer".to_owned()));
        }
        if self.last_part.elapsed() > self.silence { Err(HttpError::Timeout) } else { Ok(parts) }
    }

    /// Has it brought parts for so long that its agent certainly keeps sending?
    pub(crate) fn is_steady(&self) -> bool {
        self.parts > 1 && self.began.elapsed() > STEADY
    }

    fn note_distance(&mut self, parts: usize) {
        let distance = self.last_part.elapsed() / adapter_core::integer::convert_bounded(parts.min(1 << 20), u32::MAX);
        if self.distances.len() >= DISTANCES {
            self.distances.pop_front();
        }
        self.distances.push_back(distance);
    }

    /// The median time from part to part: an agent may send less often than it was asked to. `None` before there were some.
    pub(crate) fn find_part_interval(&self) -> Option<Duration> {
        let mut sorted: Vec<Duration> = self.distances.iter().copied().collect();
        sorted.sort_unstable();
        sorted.get(sorted.len() / 2).copied().filter(|_| sorted.len() >= DISTANCES / 2)
    }

    fn take_available(&mut self) -> Result<Vec<Vec<u8>>, HttpError> {
        self.read_available()?;
        let mut parts = Vec::new();
        while let Some(part) = self.splitter.next_part().map_err(|error| HttpError::Nonsense(error.to_string()))? {
            if !part.trim_ascii().is_empty() {
                parts.push(part);
            }
        }
        Ok(parts)
    }

    fn read_available(&mut self) -> Result<(), HttpError> {
        let mut taken = 0;
        while !self.has_ended && taken < BYTES_MAX {
            match self.stream.read(&mut self.bytes) {
                Ok(0) => self.has_ended = true,
                Ok(count) => {
                    taken += count;
                    let framed = self.decoder.decode_into(&self.bytes[..count], self.splitter.tail());
                    framed.map_err(|error| HttpError::Nonsense(error.to_string()))?;
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if self.parts > 0 && error.kind() == ErrorKind::ConnectionReset => self.has_ended = true,
                Err(error) => return Err(to_error(&error)),
            }
        }
        Ok(())
    }
}
