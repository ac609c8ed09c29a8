//! A TCP connection, with or without TLS, that one thread reads while others write.

use super::words;
use rustls::pki_types::ServerName;
use rustls::{ClientConfig, ClientConnection};
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How a line is secured: not at all, or with this configuration.
pub type Lines = Option<Arc<ClientConfig>>;

/// Bytes read from the network at a time; a TLS record holds at most so many.
const CHUNK: usize = 16 * 1024;

/// A TCP connection, with or without TLS, that one thread reads while others write.
#[derive(Debug)]
pub struct TcpConnection {
    tcp: TcpStream,
    host: String,
    tls: Option<Mutex<ClientConnection>>,
}

impl TcpConnection {
    /// Takes over a connection to `host`, and with TLS agrees with the other side. The time limits are those of the
    /// connection.
    ///
    /// # Errors
    /// What the system or TLS says; [`TlsError::from_io_error`](super::TlsError::from_io_error) puts the latter into words.
    pub fn from_tcp(mut tcp: TcpStream, host: &str, lines: &Lines) -> io::Result<Self> {
        let Some(config) = lines else { return Ok(Self { tcp, host: host.to_owned(), tls: None }) };
        let name = ServerName::try_from(host.to_owned()).map_err(io::Error::other)?;
        let mut connection = ClientConnection::new(config.clone(), name).map_err(io::Error::other)?;
        connection.set_buffer_limit(None);
        while connection.is_handshaking() {
            connection.complete_io(&mut tcp).map_err(|error| hung_up(error, host))?;
        }
        Ok(Self { tcp, host: host.to_owned(), tls: Some(Mutex::new(connection)) })
    }

    /// Is the line TLS, or plain TCP?
    #[must_use]
    pub fn is_secured(&self) -> bool {
        self.tls.is_some()
    }

    /// Some bytes; none when the other side has closed. Silence longer than the time limit of the connection is an error of
    /// the kinds that a socket gives. For one thread.
    ///
    /// # Errors
    /// What the system or TLS says.
    pub fn read(&self, into: &mut [u8]) -> io::Result<usize> {
        let Some(tls) = &self.tls else { return (&self.tcp).read(into) };
        let mut chunk = [0; CHUNK];
        loop {
            match lock_connection(tls).reader().read(into) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                // Closed without the farewell of TLS: the packets inside have lengths of their own.
                Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(0),
                read => return read,
            }
            let count = (&self.tcp).read(&mut chunk)?;
            self.feed_bytes(&mut lock_connection(tls), &chunk[..count])?;
        }
    }

    fn feed_bytes(&self, connection: &mut ClientConnection, mut bytes: &[u8]) -> io::Result<()> {
        loop {
            connection.read_tls(&mut bytes)?;
            let taken = connection.process_new_packets().map(drop);
            // An alert for the other side goes out even if nothing else does.
            let told = self.flush(connection);
            taken.map_err(|error| io::Error::other(words::build_tls_error(&error, &self.host)))?;
            told?;
            if bytes.is_empty() {
                return Ok(());
            }
        }
    }

    /// All of `bytes`, as one piece.
    ///
    /// # Errors
    /// What the system says; nothing can follow a piece that was cut.
    pub fn write_all(&self, bytes: &[u8]) -> io::Result<()> {
        let Some(tls) = &self.tls else { return (&self.tcp).write_all(bytes) };
        let mut connection = lock_connection(tls);
        connection.writer().write_all(bytes)?;
        self.flush(&mut connection)
    }

    fn flush(&self, connection: &mut ClientConnection) -> io::Result<()> {
        while connection.wants_write() {
            connection.write_tls(&mut &self.tcp)?;
        }
        Ok(())
    }

    /// Ends the connection in both directions; a thread that reads ends by it.
    pub fn shut_connection(&self) {
        if let Some(tls) = &self.tls {
            let mut connection = lock_connection(tls);
            connection.send_close_notify();
            let _already_gone = self.flush(&mut connection);
        }
        let _already_gone = self.tcp.shutdown(Shutdown::Both);
    }
}

/// Something that does not speak TLS takes our greeting for nonsense and goes.
fn hung_up(error: io::Error, host: &str) -> io::Error {
    use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, UnexpectedEof};
    let gone = matches!(error.kind(), BrokenPipe | ConnectionAborted | ConnectionReset | UnexpectedEof);
    if gone { io::Error::other(words::no_tls(host)) } else { error }
}

fn lock_connection(connection: &Mutex<ClientConnection>) -> MutexGuard<'_, ClientConnection> {
    // rustls leaves no half-done work behind a panic, and panics at none of our inputs.
    connection.lock().unwrap_or_else(PoisonError::into_inner)
}
