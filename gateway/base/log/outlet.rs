//! A stream that nobody may wait for: lines go to it on a thread of its own.
//!
//! A pipe whose reader has stopped reading takes no more, and whoever writes to it waits for as long as that lasts. The tick
//! must not: a line that finds no room is left out and counted, and when the stream takes lines again it says how many.

use adapter_core::threads::receive_work;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Lines that wait for the stream.
const WAITING_MAX: usize = 1024;
/// Whoever waits for the end of the lines looks this often.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// Where the lines go.
type LogStream = Box<dyn Write + Send>;

#[derive(Debug, Default)]
struct LineCounts {
    /// Lines handed in, those left out included.
    handed: AtomicU64,
    /// Lines written or left out.
    settled: AtomicU64,
    /// Lines left out since the start.
    dropped: AtomicU64,
}

#[derive(Debug)]
pub(super) struct Outlet {
    lines: Option<SyncSender<Vec<u8>>>,
    counts: Arc<LineCounts>,
}

impl Outlet {
    /// Starts the thread of this name. Without one, nothing is written.
    pub(super) fn start(name: &str, stream: LogStream) -> Self {
        let (lines, waiting) = sync_channel(WAITING_MAX);
        let counts = Arc::new(LineCounts::default());
        let (of_thread, own_name) = (counts.clone(), name.to_owned());
        let write = move || write_lines(&own_name, &waiting, stream, &of_thread);
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(write);
        Self { lines: thread.is_ok().then_some(lines), counts }
    }

    /// Hands in a line with its end. Never waits.
    pub(super) fn queue_line(&self, line: Vec<u8>) {
        self.counts.handed.fetch_add(1, Ordering::AcqRel);
        if self.lines.as_ref().is_none_or(|lines| lines.try_send(line).is_err()) {
            self.counts.dropped.fetch_add(1, Ordering::AcqRel);
            self.counts.settled.fetch_add(1, Ordering::AcqRel);
        }
    }

    /// Returns when everything handed in so far is written, or after `limit`.
    pub(super) fn flush(&self, limit: Duration) {
        let (until, handed) = (Instant::now() + limit, self.counts.handed.load(Ordering::Acquire));
        while self.counts.settled.load(Ordering::Acquire) < handed && Instant::now() < until {
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// Lines left out since the start.
    pub(super) fn dropped_lines(&self) -> u64 {
        self.counts.dropped.load(Ordering::Acquire)
    }
}

fn write_lines(thread: &str, waiting: &Receiver<Vec<u8>>, mut stream: LogStream, counts: &LineCounts) {
    let mut told = 0;
    while let Some(line) = receive_work(thread, waiting) {
        // Whoever closed the terminal is no reason to stop the box.
        let _closed = stream.write_all(&line).and_then(|()| stream.flush());
        let dropped = counts.dropped.load(Ordering::Acquire);
        if dropped > told {
            let text = format!("  {} lines are missing here: nobody was reading\n", dropped - told);
            let _closed = stream.write_all(text.as_bytes()).and_then(|()| stream.flush());
            told = dropped;
        }
        counts.settled.fetch_add(1, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{PipeReader, Read};

    const LIMIT: Duration = Duration::from_secs(30);

    /// An outlet into a pipe that takes no more.
    fn blocked() -> (Outlet, PipeReader, usize) {
        let (reader, mut writer) = std::io::pipe().expect("a pipe");
        let room = 65_536;
        writer.write_all(&vec![b'.'; room]).expect("room");
        (Outlet::start("test", Box::new(writer)), reader, room)
    }

    #[test]
    fn what_nobody_reads_is_counted_and_keeps_nobody_waiting() {
        let (outlet, mut reader, room) = blocked();
        let began = Instant::now();
        let lines = 2 * WAITING_MAX;
        (0..lines).for_each(|number| outlet.queue_line(format!("line {number}\n").into_bytes()));
        outlet.flush(Duration::from_millis(50));
        assert!(began.elapsed() < LIMIT / 2, "the pipe is full, and nobody reads");
        let dropped = outlet.dropped_lines();
        // One may be with the thread already.
        assert!((WAITING_MAX as u64 - 1..=WAITING_MAX as u64).contains(&dropped), "{dropped}");
        reader.read_exact(&mut vec![0; room]).expect("what was there");
        let rest = std::thread::spawn(move || {
            let mut rest = String::new();
            reader.read_to_string(&mut rest).map(|_| rest)
        });
        outlet.flush(LIMIT);
        outlet.queue_line(b"the last\n".to_vec());
        outlet.flush(LIMIT);
        drop(outlet);
        let rest = rest.join().expect("no panic").expect("text");
        assert!(rest.starts_with(&format!("line 0\n  {dropped} lines are missing here")), "{}", &rest[..80]);
        assert!(rest.ends_with("the last\n"), "and the lines that waited are there");
        assert_eq!(rest.matches("line ").count() as u64, lines as u64 - dropped);
    }

    #[test]
    fn lines_come_in_order_and_are_there_after_a_flush() {
        let (mut reader, writer) = std::io::pipe().expect("a pipe");
        let outlet = Outlet::start("test", Box::new(writer));
        (0..100).for_each(|number| outlet.queue_line(format!("{number}\n").into_bytes()));
        outlet.flush(LIMIT);
        assert_eq!(outlet.dropped_lines(), 0);
        drop(outlet);
        let mut text = String::new();
        reader.read_to_string(&mut text).expect("text");
        assert_eq!(text, (0..100).map(|number| format!("{number}\n")).collect::<String>());
    }
}
