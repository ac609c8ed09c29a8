//! The other side: serves what a sampler gives to whoever connects.

use super::frame::{WaveformFrame, WaveformHeader};
use std::io::{self, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

const LISTENERS_MAX: usize = 4;
/// A listener that takes nothing for so long is let go.
const PATIENCE: Duration = Duration::from_secs(1);

/// Something that samples, at its own pace.
pub trait Sampler: Send {
    /// What it samples, at which rate and scale.
    fn header(&self) -> WaveformHeader;

    /// Waits for the next samples: time of the first one, ns since 1970, and the samples, all channels of one instant
    /// together. `None` at the end.
    ///
    /// # Errors
    /// When the device fails.
    fn next(&mut self) -> io::Result<Option<(i64, Vec<i16>)>>;
}

/// A server that sends until it is dropped or the sampler has come to its end.
pub struct Producer {
    at: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

impl Producer {
    /// Serves the sampler at this address; port 0 takes a free one.
    ///
    /// # Errors
    /// When the address cannot be listened on.
    pub fn start(listen: SocketAddr, sampler: Box<dyn Sampler>) -> io::Result<Self> {
        let listener = TcpListener::bind(listen)?;
        listener.set_nonblocking(true)?;
        let at = listener.local_addr()?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopping = stop.clone();
        let thread = std::thread::Builder::new()
            .name("waveform".to_owned())
            .spawn(move || serve_listeners(&listener, sampler, &stopping))?;
        Ok(Self { at, stop, thread: Some(thread) })
    }

    /// Address and port on which it listens.
    #[must_use]
    pub fn listen_address(&self) -> SocketAddr {
        self.at
    }

    /// Has the sampler come to its end, or failed?
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Stops, and tells how the sampler ended.
    ///
    /// # Errors
    /// Why the device failed.
    pub fn stop_sampling(mut self) -> io::Result<()> {
        self.stop.store(true, Ordering::SeqCst);
        let ended = self.thread.take().map(JoinHandle::join);
        ended.map_or(Ok(()), |ended| ended.unwrap_or_else(|_| Err(io::Error::other("the sampler broke off"))))
    }
}

impl Drop for Producer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
    }
}

fn serve_listeners(listener: &TcpListener, mut sampler: Box<dyn Sampler>, stop: &AtomicBool) -> io::Result<()> {
    let header = sampler.header();
    let (channels, mut sequence) = (header.channels.len(), 0_u32);
    let mut listeners: Vec<TcpStream> = Vec::new();
    while !stop.load(Ordering::SeqCst) {
        let Some((first_ns, samples)) = sampler.next()? else { return Ok(()) };
        while let Ok((stream, _)) = listener.accept() {
            listeners.extend(send_header(stream, &header).ok().filter(|_| listeners.len() < LISTENERS_MAX));
        }
        let bytes = WaveformFrame { sequence, first_ns, samples }.to_bytes(channels);
        listeners.retain_mut(|listener| listener.write_all(&bytes).is_ok());
        sequence = sequence.wrapping_add(1);
    }
    Ok(())
}

fn send_header(mut stream: TcpStream, header: &WaveformHeader) -> io::Result<TcpStream> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.write_all(header.encode_line().as_bytes())?;
    Ok(stream)
}
