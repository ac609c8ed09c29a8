//! A serial line: opened raw, read against a deadline, shared by every device that hangs on it.
//!
//! RS-485 is a party line: two meters on one cable are two sources and one line. [`Bus::from_target`] gives every address that
//! names the same device file the same [`Bus`]; one exchange at a time holds it. After a request that got no answer, or
//! half of one, the line is kept quiet until the late answer has come or can hardly come any more: on a line without
//! transaction numbers that is the only way not to take an old answer for a new one.

use adapter_core::address::{Parity, SerialTarget};
use adapter_core::integer::count_to_f64;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, OFlags, flock};
use rustix::termios::{ControlModes, OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Modbus over Serial Line 1.02, 2.5.1.1: above 19 200 Bd the silence of 3.5 characters is fixed.
const SILENCE_MIN: Duration = Duration::from_micros(1750);

/// Bits of one character on the wire: start, eight data, parity if there is one, stop.
fn bits_per_character(parity: Parity) -> u32 {
    if parity == Parity::None { 10 } else { 11 }
}

/// How long so many characters take on the wire.
#[must_use]
pub fn wire_time(target: &SerialTarget, characters: usize) -> Duration {
    let bits = f64::from(bits_per_character(target.parity)) * count_to_f64(characters);
    Duration::from_secs_f64(bits / f64::from(target.baud))
}

/// The silence that ends a frame: 3.5 characters, 1.75 ms at least.
#[must_use]
pub fn compute_silence(target: &SerialTarget) -> Duration {
    (wire_time(target, 7) / 2).max(SILENCE_MIN)
}

#[derive(Debug)]
struct OpenPort {
    file: File,
    last_byte: Instant,
}

fn open_port(target: &SerialTarget) -> io::Result<OpenPort> {
    // Without NONBLOCK the open itself waits for a modem's carrier.
    let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits();
    let mut options = OpenOptions::new();
    options.read(true).write(true).custom_flags(flags.cast_signed());
    let file = options.open(&target.port)?;
    flock(&file, FlockOperation::NonBlockingLockExclusive)
        .map_err(|_| io::Error::new(ErrorKind::ResourceBusy, "another program holds the line"))?;
    set_up(&file, target)?;
    Ok(OpenPort { file, last_byte: Instant::now() })
}

fn set_up(file: &File, target: &SerialTarget) -> io::Result<()> {
    let mut settings = tcgetattr(file)?;
    settings.make_raw();
    settings.set_speed(target.baud)?;
    let odd = target.parity == Parity::Odd;
    settings.control_modes.set(ControlModes::PARENB, target.parity != Parity::None);
    settings.control_modes.set(ControlModes::PARODD, odd);
    settings.control_modes.remove(ControlModes::CSTOPB | ControlModes::CRTSCTS);
    settings.control_modes.insert(ControlModes::CLOCAL | ControlModes::CREAD);
    tcsetattr(file, OptionalActions::Now, &settings)?;
    tcflush(file, QueueSelector::IOFlush)?;
    Ok(())
}

/// One serial line with everything that hangs on it.
#[derive(Debug)]
pub struct Bus {
    target: SerialTarget,
    open: Option<OpenPort>,
    quiet_until: Option<Instant>,
    late_answers: u64,
}

/// A line that several sources share.
pub type SharedBus = Arc<Mutex<Bus>>;

/// Two addresses name one serial line and differ in its speed or parity.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("two addresses use {} with different baud or parity; one line has one of each", .port.display())]
pub struct LineConflict {
    /// The device file that both name.
    pub port: PathBuf,
}

static LINES: Mutex<Option<HashMap<PathBuf, Weak<Mutex<Bus>>>>> = Mutex::new(None);

fn lock_mutex<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Bus {
    /// The line of this address; the same one for every address that names the same device file.
    ///
    /// # Errors
    /// When another address uses the same line at another speed or parity.
    pub fn from_target(target: &SerialTarget) -> Result<SharedBus, LineConflict> {
        let mut lines = lock_mutex(&LINES);
        let lines = lines.get_or_insert_with(HashMap::new);
        lines.retain(|_, line| line.strong_count() > 0);
        let Some(shared) = lines.get(&target.port).and_then(Weak::upgrade) else {
            let new = Self { target: target.clone(), open: None, quiet_until: None, late_answers: 0 };
            let shared = Arc::new(Mutex::new(new));
            lines.insert(target.port.clone(), Arc::downgrade(&shared));
            return Ok(shared);
        };
        if lock_mutex(&shared).target != *target {
            return Err(LineConflict { port: target.port.clone() });
        }
        Ok(shared)
    }

    /// How the line is set up.
    #[must_use]
    pub fn target(&self) -> &SerialTarget {
        &self.target
    }

    /// Answers that came after their request had been given up, and were thrown away.
    #[must_use]
    pub fn late_answers(&self) -> u64 {
        self.late_answers
    }

    /// Sends a request on a line that is open and silent; returns when the system has taken it.
    ///
    /// # Errors
    /// When the line cannot be opened or written.
    pub fn send_request(&mut self, request: &[u8]) -> io::Result<()> {
        self.discard_late_answer()?;
        let gap = compute_silence(&self.target);
        let sent = self.open_line().and_then(|line| {
            std::thread::sleep(gap.saturating_sub(line.last_byte.elapsed()));
            tcflush(&line.file, QueueSelector::IFlush)?;
            line.file.write_all(request)
        });
        if sent.is_err() {
            self.open = None;
        }
        sent
    }

    /// Appends what arrives before `until`; returns as soon as anything did. `false`: nothing came.
    ///
    /// # Errors
    /// When the line fails; it is then opened anew by the next request.
    pub fn receive_bytes(&mut self, until: Instant, into: &mut Vec<u8>) -> io::Result<bool> {
        let received = self.open_line().and_then(|line| read_port(line, until, into));
        if received.is_err() {
            self.open = None;
        }
        received
    }

    /// The answer did not come, or not whole: the line is kept quiet for so long, or until it has come.
    pub fn keep_quiet(&mut self, wait: Duration) {
        self.quiet_until = Some(Instant::now() + wait);
    }

    fn open_line(&mut self) -> io::Result<&mut OpenPort> {
        if self.open.is_none() {
            self.open = Some(open_port(&self.target)?);
        }
        self.open.as_mut().ok_or_else(|| io::Error::other("the line is not open"))
    }

    /// Waits for the answer that is still out, and throws it away.
    fn discard_late_answer(&mut self) -> io::Result<()> {
        let Some(until) = self.quiet_until.take() else { return Ok(()) };
        let gap = compute_silence(&self.target);
        let mut late = Vec::new();
        if !self.receive_bytes(until, &mut late)? {
            return Ok(());
        }
        self.late_answers += 1;
        // The rest of it, up to the silence behind it; a line that never falls silent is given up with its buffer full.
        while late.len() < 4096 && self.receive_bytes(Instant::now() + gap.max(Duration::from_millis(20)), &mut late)? {
        }
        Ok(())
    }
}

fn read_port(line: &mut OpenPort, until: Instant, into: &mut Vec<u8>) -> io::Result<bool> {
    let mut buffer = [0_u8; 512];
    loop {
        match line.file.read(&mut buffer) {
            Ok(0) => return Err(io::Error::new(ErrorKind::UnexpectedEof, "the line was closed")),
            Ok(count) => {
                into.extend_from_slice(&buffer[..count]);
                line.last_byte = Instant::now();
                return Ok(true);
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
            Err(error) => return Err(error),
        }
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(false);
        }
        // A time that no `Timespec` holds is waited for in parts of a second.
        let wait = Timespec::try_from(left).unwrap_or(Timespec { tv_sec: 1, tv_nsec: 0 });
        match poll(&mut [PollFd::new(&line.file, PollFlags::IN)], Some(&wait)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(baud: u32) -> SerialTarget {
        SerialTarget { port: PathBuf::from("/dev/no-such-line"), baud, parity: Parity::None }
    }

    #[test]
    fn the_silence_is_three_and_a_half_characters() {
        assert!((compute_silence(&target(9600)).as_secs_f64() - 3.5 * 10.0 / 9600.0).abs() < 1e-6);
        assert_eq!(compute_silence(&target(115_200)), SILENCE_MIN);
    }

    #[test]
    fn one_line_has_one_speed() {
        let first = Bus::from_target(&target(9600)).expect("the first one");
        let second = Bus::from_target(&target(9600)).expect("the same");
        assert!(Arc::ptr_eq(&first, &second));
        assert!(Bus::from_target(&target(19200)).is_err());
        drop((first, second));
        assert!(Bus::from_target(&target(19200)).is_ok());
    }

    #[test]
    fn a_line_that_is_not_there_is_an_error() {
        let line = SerialTarget { port: PathBuf::from("/dev/no-such-line-2"), ..target(9600) };
        let bus = Bus::from_target(&line).expect("a bus");
        assert!(lock_mutex(&bus).send_request(&[1]).is_err());
    }
}
