//! The task of a sink: connects, sends live data first and old data between, tries again with growing pauses.

mod hold;

use super::board::{Board, to_seconds};
use super::isolation::{Isolation, Turn};
use super::{Batch, Requests, Sink, SinkError, open_sink};
use crate::sink_config::SinkConfig;
use gateway_base::clock;
use gateway_base::log::{Notice, Severity};
use gateway_control::OrderSender;
use gateway_history::{Item, Outbox, OutboxHead, OutboxReader, OutboxStretch};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};

/// Pauses between two tries: the first, and the longest.
const PAUSE_FIRST: Duration = Duration::from_millis(500);
const PAUSE_MAX: Duration = Duration::from_secs(20);
/// A sink that is slower than this at connecting or sending a batch has failed. Sinks have deadlines of their own; this one
/// is for those that forgot.
const DEADLINE: Duration = Duration::from_secs(60);
/// How long a farewell may take.
const FAREWELL: Duration = Duration::from_secs(2);
/// With more items than this waiting when the connection stands, the sink goes on with live data and fills the gap later;
/// fewer are sent in their order. At ten items a second this is the delay of a second.
const JUMP_ITEMS: u64 = 10;

/// The tasks of all sinks, and how they are told to end.
#[derive(Debug)]
pub struct Sinks {
    stop: watch::Sender<bool>,
    tasks: Vec<JoinHandle<()>>,
}

/// Starts a task for each of these sinks, which must be known to outbox and board in this order. The history at `path` may be
/// opened later. What the network asks for goes by `orders`. Call it within a runtime.
#[must_use]
pub fn start_sinks(
    sinks: &[SinkConfig],
    orders: &OrderSender,
    (outbox, board): (&Outbox, &Board),
    path: &Path,
) -> Sinks {
    let opened = sinks.iter().map(|SinkConfig { name, address, allow_requests, allow_facts }| {
        let requests = Requests::new(name, *allow_requests, Some(orders.clone())).with_facts(*allow_facts);
        (name.clone(), open_sink(address, (name, requests), outbox, path))
    });
    start_with(opened.collect(), outbox, board, path)
}

/// The same for sinks that are open already, each with its name.
#[must_use]
pub fn start_with(sinks: Vec<(String, Box<dyn Sink>)>, outbox: &Outbox, board: &Board, path: &Path) -> Sinks {
    let (stop, stopping) = watch::channel(false);
    let task = |(index, (name, sink)): (usize, (String, Box<dyn Sink>))| {
        // Until the first connection has failed it is about to be there.
        outbox.set_linked(&name, true);
        let task = SinkTask {
            index,
            name,
            outbox: outbox.clone(),
            board: board.clone(),
            path: path.to_owned(),
            stopping: stopping.clone(),
            outbox_reader: None,
            isolation: Isolation::default(),
            walked_to: 0,
        };
        tokio::spawn(task.run(sink))
    };
    let tasks = sinks.into_iter().enumerate().map(task).collect();
    Sinks { stop, tasks }
}

impl Sinks {
    /// Lets every sink finish its batch and say goodbye; takes at most a few seconds.
    pub async fn stop(self) {
        self.stop.send_replace(true);
        for mut task in self.tasks {
            if timeout(2 * FAREWELL, &mut task).await.is_err() {
                task.abort();
            }
        }
    }
}

struct SinkTask {
    index: usize,
    name: String,
    outbox: Outbox,
    board: Board,
    path: PathBuf,
    stopping: watch::Receiver<bool>,
    /// With the name of the history that it reads.
    outbox_reader: Option<(String, OutboxReader)>,
    isolation: Isolation,
    /// Below this number everything that is not delivered is held back.
    walked_to: u64,
}

/// Why a connection was left.
enum Left {
    Stop,
    Failed(SinkError),
}

impl From<SinkError> for Left {
    fn from(error: SinkError) -> Self {
        Self::Failed(error)
    }
}

impl SinkTask {
    async fn run(mut self, mut sink: Box<dyn Sink>) {
        let mut stopping = self.stopping.clone();
        let mut head = self.outbox.watch_head();
        tokio::select! {
            ready = head.wait_for(|head| head.ready) => if ready.is_err() { return },
            _ = stopping.wait_for(|stop| *stop) => return,
        }
        let mut tries = 0;
        loop {
            let left = self.serve_connection(sink.as_mut(), &mut head, &mut tries).await;
            let error = match left {
                Left::Stop => break,
                Left::Failed(error) => error,
            };
            self.outbox.set_linked(&self.name, false);
            if self.board.record_failure(self.index, &error) {
                let text = format!("sink {}: {error}", self.name);
                Notice::new(Severity::Warning, "sink_failed", text).with_detail(format!("{error:?}")).write_to_logs();
            }
            tries += 1;
            tokio::select! {
                () = sleep(compute_retry_pause(&self.name, tries)) => {}
                _ = stopping.wait_for(|stop| *stop) => break,
            }
        }
        self.outbox.set_linked(&self.name, false);
        // The receiver finds out by itself where the farewell does not reach it.
        let _late = timeout(FAREWELL, sink.close()).await;
        self.board.update_progress(self.index, |progress| progress.state = Some("stopped"));
    }

    /// From connecting to the end of the connection.
    async fn serve_connection(
        &mut self,
        sink: &mut dyn Sink,
        head: &mut watch::Receiver<OutboxHead>,
        tries: &mut u32,
    ) -> Left {
        self.board.update_progress(self.index, |progress| progress.state = Some("connecting"));
        let mut stopping = self.stopping.clone();
        let connected = tokio::select! {
            connected = timeout(DEADLINE, sink.connect()) => connected,
            _ = stopping.wait_for(|stop| *stop) => return Left::Stop,
        };
        if let Err(error) = connected.unwrap_or_else(|_| Err(too_slow("connecting"))) {
            return Left::Failed(error);
        }
        (*tries, self.walked_to) = (0, 0);
        self.outbox.set_linked(&self.name, true);
        let mut failed = false;
        self.board.update_progress(self.index, |progress| {
            failed = std::mem::replace(&mut progress.failing, false);
            if failed {
                progress.error = None;
            }
            progress.state = Some("connected");
            progress.connections += 1;
        });
        let text = format!("sink {}: {}", self.name, if failed { "connected again" } else { "connected" });
        Notice::new(Severity::Info, "sink_connected", text).write_to_logs();
        self.begin_live_data(sink, head);
        loop {
            if *self.stopping.borrow() {
                return Left::Stop;
            }
            if let Err(left) = self.deliver_next(sink, head).await {
                return left;
            }
        }
    }

    /// Live data begins now.
    fn begin_live_data(&self, sink: &dyn Sink, head: &watch::Receiver<OutboxHead>) {
        let next = head.borrow().next_sequence;
        let Some(standing) = self.outbox.delivery_state(&self.name) else { return };
        let waiting = standing.position.count_waiting(next);
        if !sink.takes_history() {
            self.outbox.give_up(&self.name, 0, next);
        } else if waiting > JUMP_ITEMS {
            // With too many gaps it goes on in the order of the numbers until one is closed.
            let _jumped = self.outbox.jump_to_head(&self.name);
        }
    }

    /// One batch of live data, or else one of old data, or else waits for something to happen.
    async fn deliver_next(&mut self, sink: &mut dyn Sink, head: &mut watch::Receiver<OutboxHead>) -> Result<(), Left> {
        if let Some(hold) = sink.find_hold(clock::now_ns()) {
            return self.serve_held(sink, head, hold).await;
        }
        self.walked_to = 0;
        let newest = *head.borrow_and_update();
        let Some(standing) = self.outbox.delivery_state(&self.name) else { return Err(Left::Stop) };
        let next = standing.position.next();
        if next < newest.next_sequence {
            return self.deliver_batch(sink, (next, newest.next_sequence), false).await;
        }
        if let Some(gap) = standing.position.oldest_gap() {
            return self.deliver_batch(sink, gap, true).await;
        }
        let wanted = tokio::select! {
            changed = head.changed() => return changed.map_err(|_| Left::Stop),
            wanted = sink.wait_for_receiver() => wanted,
            _ = self.stopping.wait_for(|stop| *stop) => return Err(Left::Stop),
        };
        serve_within_deadline(sink, wanted).await
    }

    async fn deliver_batch(
        &mut self,
        sink: &mut dyn Sink,
        (from, to): (u64, u64),
        historical: bool,
    ) -> Result<(), Left> {
        let (turn, stretch) = self.next_items(from, to, sink.items_max().max(1)).await?;
        let Some(last) = stretch.items.last().map(|item| item.sequence) else {
            self.outbox.mark_delivered(&self.name, from, stretch.to.max(from + 1));
            return Ok(());
        };
        let items = &stretch.items;
        debug_assert!(
            items.is_sorted_by(|one, next| one.sequence < next.sequence),
            "the numbers of a batch grow: what a receiver confirms is everything up to a number"
        );
        let from = self.skip_missing(turn, from, items);
        let sent = timeout(DEADLINE, sink.send_batch(Batch { items, historical })).await;
        self.board.record_fault(self.index, sink.find_fault());
        match (turn, sent.unwrap_or_else(|_| Err(too_slow("sending")))) {
            // It is sent once more when it is its turn.
            (Turn::Past(_), Ok(()) | Err(SinkError::Item { .. })) => self.isolation.carried_witness(),
            (_, Ok(())) => {
                self.isolation.record_arrival(from, last);
                self.record_delivery(&stretch, from, historical);
            }
            (_, Err(error @ SinkError::Item { sequence, .. })) => self.record_refusal(&error, from, sequence),
            (turn, Err(error)) => {
                if !sink.tells_refusals() && self.isolation.record_break(turn, from, last) {
                    self.record_refusal(&breaks_line(from), from, from);
                }
                return Err(error.into());
            }
        }
        // What the receiver wants is looked at between two batches as well.
        match timeout(Duration::ZERO, sink.wait_for_receiver()).await {
            Ok(wanted) => serve_within_deadline(sink, wanted).await,
            Err(_nothing) => Ok(()),
        }
    }

    /// Numbers before the first item that is there were dropped; the number from which there is something to deliver.
    fn skip_missing(&self, turn: Turn, from: u64, items: &[Item]) -> u64 {
        match items.first() {
            Some(first) if first.sequence > from && !matches!(turn, Turn::Past(_)) => {
                self.outbox.mark_delivered(&self.name, from, first.sequence);
                first.sequence
            }
            _ => from,
        }
    }

    /// What is to be sent of the items `from..to`.
    async fn next_items(&mut self, from: u64, to: u64, items_max: usize) -> Result<(Turn, OutboxStretch), Left> {
        let turn = self.isolation.choose_turn(from);
        if let Turn::Past(item) = turn {
            // At the end of a gap the witness has been delivered before: it is sent once more.
            let newest = self.outbox.watch_head().borrow().next_sequence;
            let stretch = self.read(item + 1, newest, 1).await?;
            if !stretch.items.is_empty() {
                return Ok((turn, stretch));
            }
            self.isolation.without_witness();
        }
        // Nothing comes after the newest item yet: it is tried again.
        let (turn, items_max) = if turn == Turn::Many { (turn, items_max) } else { (Turn::Alone, 1) };
        Ok((turn, self.read(from, to, items_max).await?))
    }

    async fn read(&mut self, from: u64, to: u64, items_max: usize) -> Result<OutboxStretch, Left> {
        // Another history lies there when the one before was damaged or removed.
        let box_id = self.outbox.box_id();
        let (feed, path) = (self.outbox_reader.take().filter(|(of, _)| *of == box_id), self.path.clone());
        let reading = tokio::task::spawn_blocking(move || {
            let mut feed = feed.map_or_else(|| OutboxReader::open(&path), |(_, feed)| Ok(feed))?;
            feed.read(from, to, items_max).map(|stretch| (feed, stretch))
        });
        let failed =
            |text: String| Left::Failed(SinkError::failed_line(format!("the outbox cannot be read: {text}"), ""));
        let read = reading.await.map_err(|error| failed(error.to_string()))?;
        let (feed, stretch) = read.map_err(|error| failed(error.to_string()))?;
        self.outbox_reader = Some((box_id, feed));
        Ok(stretch)
    }

    fn record_delivery(&self, stretch: &OutboxStretch, from: u64, historical: bool) {
        self.outbox.mark_delivered(&self.name, from, stretch.to);
        let reached_ns = stretch.items.iter().rev().find(|item| item.is_live()).map(|item| item.at_ns);
        let gap =
            self.outbox.delivery_state(&self.name).is_some_and(|standing| standing.position.oldest_gap().is_some());
        // A record may have no time; an accelerated machine is ahead of the clock.
        let delay_s = reached_ns.filter(|at_ns| *at_ns > 0).map(|at_ns| to_seconds(clock::now_ns() - at_ns).max(0.0));
        self.board.update_progress(self.index, |progress| {
            progress.delivered += stretch.items.len() as u64;
            if historical || !gap {
                progress.reached_ns = reached_ns.or(progress.reached_ns);
            }
            if !historical {
                progress.delay_s = delay_s.or(progress.delay_s);
                delay_s.into_iter().for_each(|delay_s| progress.delays.add_s(delay_s));
            }
        });
    }

    fn record_refusal(&self, error: &SinkError, from: u64, sequence: u64) {
        debug_assert!(sequence >= from, "an item that is not of this batch is refused");
        self.outbox.mark_delivered(&self.name, from, sequence);
        self.outbox.mark_delivered(&self.name, sequence, sequence + 1);
        let mut first = false;
        self.board.update_progress(self.index, |progress| {
            progress.refused += 1;
            progress.delivered += sequence.saturating_sub(from);
            first = progress.refusal.replace(error.to_string()).is_none();
        });
        if first {
            Notice::new(Severity::Warning, "sink_refused", format!("sink {}: {error}", self.name)).write_to_logs();
        }
    }
}

/// A receiver hangs up at this item, and not at a later one.
fn breaks_line(sequence: u64) -> SinkError {
    let what = "the receiver ended the connection whenever it was sent, and not at a later one".to_owned();
    let next = "raise the greatest message that the receiver takes; with protocol=5 a broker says why".to_owned();
    SinkError::Item { sequence, what, next }
}

/// The receiver wants something, or the connection is over.
async fn serve_within_deadline(sink: &mut dyn Sink, wanted: Result<(), SinkError>) -> Result<(), Left> {
    wanted?;
    timeout(DEADLINE, sink.serve_receiver()).await.unwrap_or_else(|_| Err(too_slow("answering"))).map_err(Left::Failed)
}

fn too_slow(doing: &str) -> SinkError {
    let what = format!("{doing} took longer than {} s", DEADLINE.as_secs());
    SinkError::failed_line(what, "look whether the receiver is overloaded")
}

/// Doubles from try to try, and differs by up to a quarter between sinks, so that many boxes do not come back in the same
/// instant.
fn compute_retry_pause(name: &str, tries: u32) -> Duration {
    let doubled = PAUSE_FIRST.saturating_mul(1 << tries.saturating_sub(1).min(10)).min(PAUSE_MAX);
    let spread = name.bytes().fold(u64::from(tries), |sum, byte| sum.wrapping_mul(31).wrapping_add(u64::from(byte)));
    doubled.mul_f64(1.0 - (spread % 256) as f64 / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_grow_to_a_bound() {
        let pauses: Vec<Duration> = (1..20).map(|tries| compute_retry_pause("plant", tries)).collect();
        assert!(pauses[0] <= PAUSE_FIRST && pauses[0] >= PAUSE_FIRST.mul_f64(0.75));
        assert!(pauses.iter().all(|pause| *pause <= PAUSE_MAX));
        assert!(pauses[18] >= PAUSE_MAX.mul_f64(0.75));
    }
}
