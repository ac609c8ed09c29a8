//! A TCP stream that is read against a deadline: what every driver that speaks over one does, done once.

use crate::address::Endpoint;
use std::io::{self, ErrorKind, Read};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// A name that has more addresses than this is tried at the first ones.
const ADDRESSES_MAX: usize = 4;
/// A system refuses a timeout of zero.
const LEAST: Duration = Duration::from_millis(1);

/// The addresses of a host, at least one.
///
/// # Errors
/// The name is not known.
pub fn resolve_addresses(at: &Endpoint) -> io::Result<Vec<SocketAddr>> {
    let found: Vec<SocketAddr> = (at.host.as_str(), at.port).to_socket_addrs()?.take(ADDRESSES_MAX).collect();
    match found.is_empty() {
        true => Err(io::Error::new(ErrorKind::NotFound, "the name has no address")),
        false => Ok(found),
    }
}

/// A connection to this host; see [`connect_any`].
///
/// # Errors
/// As there, or the name is not known.
pub fn connect_host(at: &Endpoint, until: Instant) -> io::Result<TcpStream> {
    connect_any(&resolve_addresses(at)?, until)
}

/// The first address that answers, tried one after the other until `until` (a millisecond each when that has passed).
/// `TCP_NODELAY` is on: without it a small request waits for the acknowledgement of the one before.
///
/// # Errors
/// What the system says of the last address.
pub fn connect_any(addresses: &[SocketAddr], until: Instant) -> io::Result<TcpStream> {
    let mut last = io::Error::new(ErrorKind::NotFound, "the name has no address");
    for address in addresses {
        let left = until.saturating_duration_since(Instant::now()).max(LEAST);
        match TcpStream::connect_timeout(address, left) {
            Ok(stream) => return stream.set_nodelay(true).map(|()| stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Why a stream gave less than was asked for.
#[derive(Debug)]
pub enum Short {
    /// Nothing more came in time.
    Silent,
    /// The other side closed it.
    Closed,
    /// The system says so.
    Broken(io::Error),
}

/// Fills all of `into`, waiting until `until` at most.
///
/// # Errors
/// Why it could not.
pub fn fill_buffer(stream: &mut TcpStream, into: &mut [u8], until: Instant) -> Result<(), Short> {
    fill_counting(stream, into, until).map_err(|(_, short)| short)
}

/// The same, for callers to whom an answer that has begun means something.
///
/// # Errors
/// How many bytes had come, and why no more did.
pub fn fill_counting(stream: &mut TcpStream, into: &mut [u8], until: Instant) -> Result<(), (usize, Short)> {
    let mut got = 0;
    while got < into.len() {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err((got, Short::Silent));
        }
        stream.set_read_timeout(Some(left)).map_err(|error| (got, Short::Broken(error)))?;
        match stream.read(&mut into[got..]) {
            Ok(0) => return Err((got, Short::Closed)),
            Ok(count) => got += count,
            Err(error) if is_silence(&error) => return Err((got, Short::Silent)),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err((got, Short::Broken(error))),
        }
    }
    Ok(())
}

/// Appends what comes next, waiting until `until` at most.
///
/// # Errors
/// Why nothing came.
pub fn append_available(stream: &mut TcpStream, into: &mut Vec<u8>, until: Instant) -> Result<(), Short> {
    let mut buffer = [0_u8; 512];
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(Short::Silent);
        }
        stream.set_read_timeout(Some(left)).map_err(Short::Broken)?;
        match stream.read(&mut buffer) {
            Ok(0) => return Err(Short::Closed),
            Ok(count) => {
                into.extend_from_slice(&buffer[..count]);
                return Ok(());
            }
            Err(error) if is_silence(&error) => return Err(Short::Silent),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(Short::Broken(error)),
        }
    }
}

/// Did a read end because its time was over?
pub fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}
