//! The parent's side: start, ask, give up, kill, start again.

use super::message;
use super::serve::SUBCOMMAND;
use std::io::{ErrorKind, Read};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use thiserror::Error;

/// How a child is run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChildSettings {
    /// The program; `None` is this one.
    pub program: Option<PathBuf>,
    /// What stands behind the hidden subcommand: the kind of child, then its own arguments.
    pub arguments: Vec<String>,
    /// Environment variables besides those of the parent.
    pub environment: Vec<(String, String)>,
    /// Longest wait for an answer; then the child is killed.
    pub deadline: Duration,
    /// Pause before the second start in a row.
    pub pause_min: Duration,
    /// Longest pause between starts.
    pub pause_max: Duration,
}

impl ChildSettings {
    /// This program as a child of this kind.
    #[must_use]
    pub fn new(kind: &str, arguments: &[String], deadline: Duration) -> Self {
        Self {
            program: None,
            arguments: std::iter::once(kind.to_owned()).chain(arguments.iter().cloned()).collect(),
            environment: Vec::new(),
            deadline,
            pause_min: Duration::from_millis(100),
            pause_max: Duration::from_secs(4),
        }
    }
}

/// Why a request has no answer. The next request starts another child.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ChildError {
    /// The child could not be started.
    #[error("the child process could not be started: {0}")]
    Start(String),
    /// It ended in the middle of a request.
    #[error("the child process ended: {0}")]
    Died(String),
    /// It did not answer in time and was killed.
    #[error("the child process did not answer within {} ms and was killed", .0.as_millis())]
    Hung(Duration),
    /// It sent something that is no answer and was killed.
    #[error("the child process sent no answer: {0}")]
    NoAnswer(String),
    /// It died a moment ago and is not started again yet.
    #[error("the child process is started again in {} ms", .0.as_millis())]
    Pausing(Duration),
}

/// How a child has been doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ChildCounts {
    /// Starts of the process, the first one included.
    pub starts: u64,
    /// Ends in the middle of a request.
    pub died: u64,
    /// Kills because no answer came.
    pub hung: u64,
    /// Kills because of an answer that was none.
    pub no_answer: u64,
    /// Requests that were sent.
    pub requests: u64,
    /// Answers; one request may have several.
    pub answers: u64,
}

struct Running {
    child: Child,
    stream: UnixStream,
    /// What has come of answers that are not whole yet, or not looked at yet.
    arrived: Vec<u8>,
}

impl Running {
    /// Waits for one answer and shows it.
    fn wait_for_answer(&mut self, deadline: Instant, take: &mut impl FnMut(&[u8]) -> bool) -> std::io::Result<bool> {
        loop {
            if let Some((bytes, end)) = message::split_first_message(&self.arrived)? {
                let more = take(bytes);
                self.arrived.drain(..end);
                return Ok(more);
            }
            self.receive_more(deadline)?;
        }
    }

    /// What has come, or comes before the deadline.
    fn receive_more(&mut self, deadline: Instant) -> std::io::Result<()> {
        let mut chunk = [0; 16 * 1024];
        self.stream.set_read_timeout(Some(compute_remaining_time(deadline)?))?;
        match self.stream.read(&mut chunk) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => {
                self.arrived.extend_from_slice(&chunk[..count]);
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// Ends the child, whatever it does, and waits until the system has let go of it.
    fn kill_child(mut self) -> Option<ExitStatus> {
        let _ended_already = self.child.kill();
        self.child.wait().ok()
    }
}

/// A child process and what is known of it.
pub struct Supervised {
    settings: ChildSettings,
    running: Option<Running>,
    /// Deaths since the last answer.
    deaths: u32,
    not_before: Option<Instant>,
    counts: ChildCounts,
    /// Starts and restarts are told apart by the one who keeps a session in the child.
    generation: u64,
}

impl Supervised {
    /// Nothing is started before the first request.
    #[must_use]
    pub fn new(settings: ChildSettings) -> Self {
        let counts = ChildCounts::default();
        Self { settings, running: None, deaths: 0, not_before: None, counts, generation: 0 }
    }

    /// How it has been doing.
    #[must_use]
    pub fn counts(&self) -> ChildCounts {
        self.counts
    }

    /// Increases with every start: whatever an earlier child knew is gone.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Process number of the child, while there is one.
    #[must_use]
    pub fn process_id(&self) -> Option<u32> {
        self.running.as_ref().map(|running| running.child.id())
    }

    /// Asks, within the deadline.
    ///
    /// # Errors
    /// See [`ChildError`]; afterwards there is no child, until the next request starts one.
    pub fn request_answer(&mut self, bytes: &[u8]) -> Result<Vec<u8>, ChildError> {
        let mut answer = Vec::new();
        self.request_each(bytes, 1, |bytes| {
            answer = bytes.to_vec();
            true
        })?;
        Ok(answer)
    }

    /// Asks once and takes so many answers, each within the deadline, or fewer: `take` says whether to wait for more. What
    /// came before a failure has been taken: who asks for several things at a time knows which one the child did not
    /// survive.
    ///
    /// # Errors
    /// As [`Supervised::request_answer`].
    pub fn request_each(
        &mut self,
        bytes: &[u8],
        answers: usize,
        mut take: impl FnMut(&[u8]) -> bool,
    ) -> Result<(), ChildError> {
        let mut running = match self.running.take() {
            Some(running) => running,
            None => self.start_child()?,
        };
        let patience = self.settings.deadline;
        self.counts.requests += 1;
        let mut taken = 0;
        let mut exchange = || {
            running.stream.set_write_timeout(Some(patience))?;
            message::send(&mut running.stream, bytes)?;
            while taken < answers {
                let more = running.wait_for_answer(Instant::now() + patience, &mut take)?;
                taken += 1;
                if !more {
                    break;
                }
            }
            Ok(())
        };
        let outcome = exchange();
        self.counts.answers += taken as u64;
        if taken > 0 {
            self.deaths = 0;
        }
        match outcome {
            Ok(()) => {
                self.running = Some(running);
                Ok(())
            }
            Err(error) => Err(self.give_up(running, &error)),
        }
    }

    /// Ends the child; the next request starts another one at once.
    pub fn end_child(&mut self) {
        self.running.take().map(Running::kill_child);
        self.not_before = None;
    }

    fn start_child(&mut self) -> Result<Running, ChildError> {
        if let Some(left) = self.not_before.map(|at| at.saturating_duration_since(Instant::now()))
            && !left.is_zero()
        {
            return Err(ChildError::Pausing(left));
        }
        let running = spawn_child(&self.settings).map_err(|error| {
            self.schedule_pause();
            ChildError::Start(error.to_string())
        })?;
        self.counts.starts += 1;
        self.generation += 1;
        Ok(running)
    }

    fn schedule_pause(&mut self) {
        let doublings = self.deaths.min(16);
        self.deaths = self.deaths.saturating_add(1);
        let pause = (self.settings.pause_min * (1 << doublings)).min(self.settings.pause_max);
        self.not_before = Some(Instant::now() + pause);
    }

    fn give_up(&mut self, running: Running, error: &std::io::Error) -> ChildError {
        self.schedule_pause();
        match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                running.kill_child();
                self.counts.hung += 1;
                ChildError::Hung(self.settings.deadline)
            }
            ErrorKind::UnexpectedEof | ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => {
                self.counts.died += 1;
                ChildError::Died(last_words(running))
            }
            _ => {
                running.kill_child();
                self.counts.no_answer += 1;
                ChildError::NoAnswer(error.to_string())
            }
        }
    }
}

impl Drop for Supervised {
    fn drop(&mut self) {
        self.end_child();
    }
}

/// How a child ended that closed its end of the line by itself.
fn last_words(mut running: Running) -> String {
    for _ in 0..50 {
        match running.child.try_wait() {
            Ok(Some(status)) => return status.to_string(),
            Ok(None) => std::thread::sleep(Duration::from_millis(2)),
            Err(error) => return error.to_string(),
        }
    }
    running.kill_child().map_or_else(|| "unknown".to_owned(), |status| status.to_string())
}

fn spawn_child(settings: &ChildSettings) -> std::io::Result<Running> {
    let (stream, theirs) = UnixStream::pair()?;
    let program = settings.program.clone().map_or_else(own_program, Ok)?;
    let child = Command::new(program)
        .arg(SUBCOMMAND)
        .args(&settings.arguments)
        .envs(settings.environment.iter().map(|(name, value)| (name, value)))
        .stdin(Stdio::from(OwnedFd::from(theirs)))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    Ok(Running { child, stream, arrived: Vec::new() })
}

/// This program as it runs, also after an update has put another file in its place.
fn own_program() -> std::io::Result<PathBuf> {
    let running = PathBuf::from("/proc/self/exe");
    if running.exists() { Ok(running) } else { std::env::current_exe() }
}

fn compute_remaining_time(deadline: Instant) -> std::io::Result<Duration> {
    let left = deadline.saturating_duration_since(Instant::now());
    if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
}
