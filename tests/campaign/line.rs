//! A line that faults are made on: a relay of bytes between the box and its partner.

use rand::{Rng, RngCore, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::time::Duration;

/// What the line does to bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Fault {
    /// It passes them on.
    None,
    /// Connections are ended, new ones at once.
    Cut,
    /// Connections stay, nothing passes.
    Hang,
    /// The partner's answers are replaced by random bytes.
    Garbage,
    /// One piece of twenty has a few bytes changed, either way.
    Change,
}

#[derive(Debug, Default)]
struct State {
    fault: AtomicU8,
    /// Connections of before the last cut end.
    cuts: AtomicU64,
    connections: AtomicU64,
    changed: AtomicU64,
    stop: AtomicBool,
}

/// A line to a partner of this computer.
pub(crate) struct Line {
    pub(crate) port: u16,
    state: Arc<State>,
}

impl Line {
    /// To the partner at `target`, HOST:PORT.
    pub(crate) fn to(target: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let port = listener.local_addr().expect("bound").port();
        let line = Self { port, state: Arc::default() };
        let (state, target) = (line.state.clone(), target.to_owned());
        std::thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                if state.stop.load(Ordering::SeqCst) {
                    return;
                }
                if state.fault.load(Ordering::SeqCst) == Fault::Cut as u8 {
                    continue;
                }
                let Ok(partner) = TcpStream::connect(&target) else { continue };
                state.connections.fetch_add(1, Ordering::SeqCst);
                relay(&client, &partner, &state, false);
                relay(&partner, &client, &state, true);
            }
        });
        line
    }

    /// Pieces that were changed until now.
    pub(crate) fn changed(&self) -> u64 {
        self.state.changed.load(Ordering::SeqCst)
    }

    /// Connections until now.
    pub(crate) fn connections(&self) -> u64 {
        self.state.connections.load(Ordering::SeqCst)
    }

    /// From now on.
    pub(crate) fn set(&self, fault: Fault) {
        self.state.fault.store(fault as u8, Ordering::SeqCst);
        if fault == Fault::Cut {
            self.state.cuts.fetch_add(1, Ordering::SeqCst);
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.state.stop.store(true, Ordering::SeqCst);
        self.set(Fault::Cut);
        let _woken = TcpStream::connect(("127.0.0.1", self.port));
    }
}

/// One direction of a connection, until either end or the line ends it.
fn relay(from: &TcpStream, to: &TcpStream, state: &Arc<State>, answers: bool) {
    let (Ok(mut from), Ok(mut to)) = (from.try_clone(), to.try_clone()) else { return };
    let (state, born) = (state.clone(), state.cuts.load(Ordering::SeqCst));
    let _set = (from.set_read_timeout(Some(Duration::from_millis(20))), to.set_nodelay(true));
    std::thread::spawn(move || {
        let number = state.connections.load(Ordering::SeqCst);
        let (mut bytes, mut random) = (vec![0; 65_536], Pcg64Mcg::seed_from_u64(2 * number + u64::from(answers)));
        while state.cuts.load(Ordering::SeqCst) == born {
            if state.fault.load(Ordering::SeqCst) == Fault::Hang as u8 {
                std::thread::sleep(Duration::from_millis(20));
                continue;
            }
            match from.read(&mut bytes) {
                Ok(0) => break,
                Ok(count) => {
                    let fault = state.fault.load(Ordering::SeqCst);
                    if answers && fault == Fault::Garbage as u8 {
                        random.fill_bytes(&mut bytes[..count]);
                    } else if fault == Fault::Change as u8 && random.random_bool(0.05) {
                        (0..random.random_range(1..4))
                            .for_each(|_| bytes[random.random_range(0..count)] = random.random());
                        state.changed.fetch_add(1, Ordering::SeqCst);
                    }
                    if to.write_all(&bytes[..count]).is_err() {
                        break;
                    }
                }
                Err(error) if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {
                }
                Err(_) => break,
            }
        }
        let _ended = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
    });
}
