//! A connection to a stream, with deadline, gaps, clipping and clock.

use super::frame::{FRAME_HEAD, FrameError, HEADER_MAX, WaveformHeader, decode_samples, parse_head};
use super::intake::{Block, Intake, count_missing, end_ns};
use crate::address::Endpoint;
use crate::clock::{Clock, TimeNs};
use crate::driver::SourceError;
use adapter_core::stream::{self, Short};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// No block within this time is a failure.
const DEADLINE: Duration = Duration::from_secs(2);

struct OpenStream {
    stream: TcpStream,
    header: WaveformHeader,
    next: Option<(u32, i64)>,
}

/// Reads a stream and keeps it open.
pub struct Receiver {
    name: String,
    endpoint: Endpoint,
    open: Option<OpenStream>,
    intake: Intake,
}

impl Receiver {
    /// A receiver that connects at the first read. `name` is the address.
    #[must_use]
    pub fn new(name: &str, at: &Endpoint) -> Self {
        Self { name: name.to_owned(), endpoint: at.clone(), open: None, intake: Intake::default() }
    }

    /// What has come so far.
    #[must_use]
    pub fn intake(&self) -> &Intake {
        &self.intake
    }

    /// The next block. Blocks for two seconds at most.
    ///
    /// # Errors
    /// See [`SourceError`]; the stream is connected to anew by the next read.
    pub fn read(&mut self, clock: &dyn Clock) -> Result<Block, SourceError> {
        let until = Instant::now() + DEADLINE;
        let mut open = match self.open.take() {
            Some(open) => open,
            None => self.connect_sampler(until)?,
        };
        let block = self.receive_block(&mut open, clock, until)?;
        self.open = Some(open);
        Ok(block)
    }

    fn connect_sampler(&mut self, until: Instant) -> Result<OpenStream, SourceError> {
        let connected = stream::connect_host(&self.endpoint, until);
        let mut stream = connected.map_err(|error| self.build_line_error(&format!("cannot connect: {error}")))?;
        let header = self.header_line(&mut stream, until)?;
        self.intake.record_connection(header.clone());
        Ok(OpenStream { stream, header, next: None })
    }

    fn header_line(&self, stream: &mut TcpStream, until: Instant) -> Result<WaveformHeader, SourceError> {
        let mut line = Vec::new();
        while line.last() != Some(&b'\n') {
            if line.len() >= HEADER_MAX {
                return Err(self.build_decode_error(&FrameError::Header(format!("no line feed in {HEADER_MAX} bytes"))));
            }
            let mut byte = [0];
            stream::fill_buffer(stream, &mut byte, until).map_err(|short| self.convert_short(short))?;
            line.extend(byte);
        }
        WaveformHeader::parse(String::from_utf8_lossy(&line).trim()).map_err(|error| self.build_decode_error(&error))
    }

    fn receive_block(
        &mut self,
        open: &mut OpenStream,
        clock: &dyn Clock,
        until: Instant,
    ) -> Result<Block, SourceError> {
        let mut bytes = [0; FRAME_HEAD];
        stream::fill_buffer(&mut open.stream, &mut bytes, until).map_err(|short| self.convert_short(short))?;
        let channels = open.header.channels.len();
        let (sequence, first_ns, length) =
            parse_head(&bytes, channels).map_err(|error| self.build_decode_error(&error))?;
        let mut body = vec![0; length];
        stream::fill_buffer(&mut open.stream, &mut body, until).map_err(|short| self.convert_short(short))?;
        Ok(self.accept_samples(open, sequence, first_ns, decode_samples(&body), clock.now_ns()))
    }

    fn accept_samples(
        &mut self,
        open: &mut OpenStream,
        sequence: u32,
        first_ns: i64,
        raw: Vec<i16>,
        arrived_ns: TimeNs,
    ) -> Block {
        let out_of_turn = open.next.filter(|(wanted, _)| *wanted != sequence);
        let gap =
            out_of_turn.map_or(0, |(_, due_ns)| count_missing(&open.header, due_ns, first_ns).max(1).unsigned_abs());
        let count = raw.len() / open.header.channels.len();
        open.next = Some((sequence.wrapping_add(1), end_ns(&open.header, first_ns, count)));
        self.intake.accept_samples(&open.header, first_ns, gap, raw, arrived_ns)
    }

    fn convert_short(&self, short: Short) -> SourceError {
        match short {
            Short::Silent => self.build_timeout_error(),
            Short::Closed => self.build_line_error("the sampler closed the stream"),
            Short::Broken(error) => self.build_line_error(&format!("the stream broke: {error}")),
        }
    }

    fn build_timeout_error(&self) -> SourceError {
        SourceError::Timeout {
            source_name: self.name.clone(),
            request: "the next samples".to_owned(),
            deadline_ms: 2000,
            next: "Is the sampler running?".to_owned(),
        }
    }

    fn build_line_error(&self, what: &str) -> SourceError {
        let next = "Start the sampler (cnc-gateway serve waveform), or check its address.".to_owned();
        SourceError::Line { source_name: self.name.clone(), what: what.to_owned(), next }
    }

    fn build_decode_error(&self, error: &FrameError) -> SourceError {
        let (source_name, request) = (self.name.clone(), "the stream".to_owned());
        SourceError::Decode { source_name, request, what: error.to_string() }
    }
}
