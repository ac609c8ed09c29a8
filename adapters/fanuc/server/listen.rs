//! Connections, sessions and frames of the server: one thread per connection, at most [`ServerSettings::sessions_max`].

use super::answer::answer_body;
use super::controller::Controller;
use super::fault::InjectedFault;
use fanuc::wire::{FocasFrame, FocasHeader, FrameKind, HEADER_LEN, encode_frame, parse_requests};
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A control that is served.
pub trait ServedControl: Send {
    /// Brings the values up to date and shows them; `None` while the control is switched off.
    fn update_controller(&mut self) -> Option<&mut Controller>;
}

impl ServedControl for Controller {
    fn update_controller(&mut self) -> Option<&mut Controller> {
        Some(self)
    }
}

/// Limits of a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServerSettings {
    /// Connections at a time; a client of the vendor's library takes two.
    pub sessions_max: usize,
    /// A connection without a request for this long is closed.
    pub idle: Duration,
}

impl Default for ServerSettings {
    fn default() -> Self {
        Self { sessions_max: 10, idle: Duration::from_secs(60) }
    }
}

struct ServerState {
    served: Mutex<Box<dyn ServedControl>>,
    settings: ServerSettings,
    fault: Mutex<InjectedFault>,
    stop: AtomicBool,
    /// Does it listen? A control that is switched off does not.
    listens: AtomicBool,
    sessions: AtomicUsize,
    opened: AtomicU64,
    frames: AtomicU64,
}

/// A server on its own threads; they end when it is dropped.
pub struct Server {
    shared: Arc<ServerState>,
    address: SocketAddr,
}

/// How often a waiting thread looks whether it shall end.
const LOOK: Duration = Duration::from_millis(50);

impl Server {
    /// Serves on this listener from now on.
    ///
    /// # Errors
    /// The system gives no thread, or the listener is broken.
    pub fn start(
        listener: TcpListener,
        served: Box<dyn ServedControl>,
        settings: ServerSettings,
    ) -> std::io::Result<Self> {
        let address = listener.local_addr()?;
        listener.set_nonblocking(true)?;
        let shared = Arc::new(ServerState {
            served: Mutex::new(served),
            settings,
            fault: Mutex::new(InjectedFault::None),
            stop: AtomicBool::new(false),
            listens: AtomicBool::new(true),
            sessions: AtomicUsize::new(0),
            opened: AtomicU64::new(0),
            frames: AtomicU64::new(0),
        });
        let own = shared.clone();
        std::thread::Builder::new()
            .name("focas-listen".to_owned())
            .spawn(move || accept_connections(listener, address, &own))?;
        Ok(Self { shared, address })
    }

    /// Address and port on which it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// From now on this goes wrong. Returns when a control that is to be off does not listen any more, and one that is to be on
    /// does.
    pub fn inject_fault(&self, fault: InjectedFault) {
        *self.shared.fault.lock().unwrap_or_else(PoisonError::into_inner) = fault;
        let until = Instant::now() + Duration::from_secs(2);
        while self.shared.listens.load(Ordering::SeqCst) == self.shared.is_off() && Instant::now() < until {
            std::thread::sleep(ACCEPT_LOOK);
        }
    }

    /// Connections at this moment.
    #[must_use]
    pub fn count_sessions(&self) -> usize {
        self.shared.sessions.load(Ordering::SeqCst)
    }

    /// Connections that were opened since the start.
    #[must_use]
    pub fn count_opened(&self) -> u64 {
        self.shared.opened.load(Ordering::SeqCst)
    }

    /// Requests that were answered since the start.
    #[must_use]
    pub fn count_frames(&self) -> u64 {
        self.shared.frames.load(Ordering::SeqCst)
    }

    /// Looks at the control, or changes it.
    pub fn with<T>(&self, look: impl FnOnce(Option<&mut Controller>) -> T) -> T {
        look(self.shared.served.lock().unwrap_or_else(PoisonError::into_inner).update_controller())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::SeqCst);
    }
}

/// How often it is looked for new connections.
const ACCEPT_LOOK: Duration = Duration::from_millis(2);

/// How often it is looked whether the control has been switched on or off.
const POWER_LOOK: Duration = Duration::from_millis(100);

impl ServerState {
    /// A computer that is switched off refuses connections.
    fn is_off(&self) -> bool {
        *self.fault.lock().unwrap_or_else(PoisonError::into_inner) == InjectedFault::PowerOff
            || self.served.lock().unwrap_or_else(PoisonError::into_inner).update_controller().is_none()
    }
}

fn accept_connections(listener: TcpListener, address: SocketAddr, shared: &Arc<ServerState>) {
    let (mut listener, mut looked, mut fault) = (Some(listener), Instant::now(), InjectedFault::None);
    while !shared.stop.load(Ordering::SeqCst) {
        let injected = *shared.fault.lock().unwrap_or_else(PoisonError::into_inner);
        if injected != fault || looked.elapsed() >= POWER_LOOK {
            (fault, looked) = (injected, Instant::now());
            listener = if shared.is_off() { None } else { listener.or_else(|| listen_again(address)) };
            shared.listens.store(listener.is_some(), Ordering::SeqCst);
        }
        match listener.as_ref().map(TcpListener::accept) {
            Some(Ok((stream, _))) => begin_session(stream, shared),
            Some(Err(_)) | None => std::thread::sleep(ACCEPT_LOOK),
        }
    }
}

/// The same address once more; another program may hold it by now.
fn listen_again(address: SocketAddr) -> Option<TcpListener> {
    let listener = TcpListener::bind(address).ok()?;
    listener.set_nonblocking(true).ok()?;
    Some(listener)
}

fn begin_session(stream: TcpStream, shared: &Arc<ServerState>) {
    let own = shared.clone();
    // Without a thread for it the connection is closed, which is what a busy controller does.
    let _no_thread = std::thread::Builder::new().name("focas-session".to_owned()).spawn(move || {
        let mut session = ClientSession { stream, shared: own, counted: false };
        let _ended = session.run();
    });
}

struct ClientSession {
    stream: TcpStream,
    shared: Arc<ServerState>,
    counted: bool,
}

impl Drop for ClientSession {
    fn drop(&mut self) {
        if self.counted {
            self.shared.sessions.fetch_sub(1, Ordering::SeqCst);
        }
        let _closed_already = self.stream.shutdown(Shutdown::Both);
    }
}

/// Why a session ends.
enum End {
    Closed,
    Line,
}

impl From<std::io::Error> for End {
    fn from(_: std::io::Error) -> Self {
        Self::Line
    }
}

impl ClientSession {
    fn run(&mut self) -> Result<(), End> {
        self.stream.set_nonblocking(false)?;
        self.stream.set_nodelay(true)?;
        self.stream.set_read_timeout(Some(LOOK))?;
        self.stream.set_write_timeout(Some(Duration::from_secs(2)))?;
        loop {
            let request = self.receive_frame()?;
            self.answer_request(&request)?;
        }
    }

    fn current_fault(&self) -> InjectedFault {
        *self.shared.fault.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn receive_frame(&mut self) -> Result<FocasFrame, End> {
        let mut head = [0; HEADER_LEN];
        self.fill_buffer(&mut head)?;
        let header = FocasHeader::from_bytes(&head).map_err(|_| End::Closed)?;
        let mut body = vec![0; header.body_len];
        self.fill_buffer(&mut body)?;
        Ok(FocasFrame { version: header.version, kind: header.kind, body })
    }

    fn fill_buffer(&mut self, mut buffer: &mut [u8]) -> Result<(), End> {
        let mut waited = Duration::ZERO;
        while !buffer.is_empty() {
            match self.stream.read(buffer) {
                Ok(0) => return Err(End::Closed),
                Ok(count) => buffer = &mut buffer[count..],
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    waited += LOOK;
                    let over = waited >= self.shared.settings.idle || self.current_fault() == InjectedFault::PowerOff;
                    if over || self.shared.stop.load(Ordering::SeqCst) {
                        return Err(End::Closed);
                    }
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    fn answer_request(&mut self, request: &FocasFrame) -> Result<(), End> {
        let fault = self.current_fault();
        if fault == InjectedFault::PowerOff {
            return Err(End::Closed);
        }
        if fault == InjectedFault::Blackhole {
            return Ok(());
        }
        let reply = self.build_reply(request)?;
        let opening = !matches!(request.kind, FrameKind::Request);
        self.send_reply(reply, if opening { InjectedFault::None } else { fault })?;
        if matches!(request.kind, FrameKind::Close) { Err(End::Closed) } else { Ok(()) }
    }

    fn build_reply(&mut self, request: &FocasFrame) -> Result<Vec<u8>, End> {
        let shared = self.shared.clone();
        let mut served = shared.served.lock().unwrap_or_else(PoisonError::into_inner);
        let controller = served.update_controller().ok_or(End::Closed)?;
        let version = controller.opening.generation.version();
        match request.kind {
            FrameKind::Open => {
                let free = self.counted || self.take_place();
                let body = if free { controller.encode_opening() } else { Vec::new() };
                Ok(encode_frame(version, if free { FrameKind::Opened } else { FrameKind::OpenRefused }, &body))
            }
            FrameKind::Close => Ok(encode_frame(version, FrameKind::Closed, &[])),
            FrameKind::Request if self.counted => {
                shared.frames.fetch_add(1, Ordering::SeqCst);
                let Ok(asked) = parse_requests(&request.body) else {
                    return Ok(encode_frame(version, FrameKind::Error, &[]));
                };
                Ok(encode_frame(version, FrameKind::Answer, &answer_body(controller, &asked)))
            }
            _ => Err(End::Closed),
        }
    }

    fn take_place(&mut self) -> bool {
        if self.current_fault() == InjectedFault::NoSession {
            return false;
        }
        let most = self.shared.settings.sessions_max;
        let more = |now: usize| (now < most).then_some(now + 1);
        self.counted = self.shared.sessions.fetch_update(Ordering::SeqCst, Ordering::SeqCst, more).is_ok();
        self.shared.opened.fetch_add(u64::from(self.counted), Ordering::SeqCst);
        self.counted
    }

    fn send_reply(&mut self, bytes: Vec<u8>, fault: InjectedFault) -> Result<(), End> {
        let bytes = fault.spoil_bytes(bytes);
        match fault {
            InjectedFault::Silence => Ok(()),
            InjectedFault::Reset => {
                self.stream.write_all(&bytes)?;
                Err(End::Closed)
            }
            InjectedFault::ByteByByte(pause) => bytes.iter().try_for_each(|byte| {
                std::thread::sleep(pause);
                self.stream.write_all(&[*byte]).map_err(End::from)
            }),
            InjectedFault::Delay(delay) => {
                std::thread::sleep(delay);
                self.stream.write_all(&bytes).map_err(End::from)
            }
            _ => self.stream.write_all(&bytes).map_err(End::from),
        }
    }
}
