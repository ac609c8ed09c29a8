//! The hand that writes: the only thing in the process that holds an actuator, on a thread of its own because a controller
//! may take seconds to answer. The tick lays its verdict down and goes on; only the newest counts. Whatever stops the tick
//! stops the verdicts, with them the signs of life, and with those the override at the machine.

use super::priority;
use crate::config;
use crate::gate::offset::{Moved, Order, carry_out};
use crate::gate::{Ask, Fault, Reaction, Verdict, Writer, Written};
use adapters::clock::{Clock, ManualClock, TimeNs};
use adapters::{Actuator, OffsetSink};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What is told but not yet listened to; beyond that the hand lets go.
const SAID_MAX: usize = 1024;
/// Requests to the ladder that wait.
const ASKS_MAX: usize = 8;
/// Orders to shift an axis that wait; each axis has at most one.
const ORDERS_MAX: usize = 8;
/// While a change has not been seen in force it is looked for this often.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Without a verdict for this long the hand looks whether it shall end.
const REST: Duration = Duration::from_millis(500);
/// A controller that does not answer is not waited for at the end; the ladder falls back by itself.
const LET_GO_WITHIN: Duration = Duration::from_secs(3);

/// What the hand tells.
#[derive(Debug)]
pub enum Said {
    /// It wrote.
    Written(Written),
    /// A change was seen in force.
    Seen(Reaction),
    /// What was written is not in force, or the machine cannot be reached.
    Fault(Fault),
    /// A request went to the ladder, or could not be handed over.
    Asked(Ask, Option<String>),
    /// An order to shift an axis was carried out, or could not be.
    Moved(Box<Moved>),
}

/// What the hand may touch.
#[derive(Default)]
pub struct Tools {
    /// The way to the feed override.
    pub actuator: Option<Box<dyn Actuator>>,
    /// The way to the offsets.
    pub offsets: Option<Box<dyn OffsetSink>>,
}

/// The same with the account of what was written.
pub struct Holding {
    writer: Option<AnyWriter>,
    offsets: Option<Box<dyn OffsetSink>>,
}

impl Holding {
    fn of(tools: Tools, limits: &config::Gate) -> Self {
        Self { writer: tools.actuator.map(|actuator| Writer::new(actuator, limits)), offsets: tools.offsets }
    }

    fn is_waiting(&self) -> bool {
        self.writer.as_ref().is_some_and(Writer::is_waiting)
    }

    fn release(&mut self, clock: &dyn Clock) -> Option<Written> {
        self.writer.as_mut()?.release(clock)
    }
}

type AnyWriter = Writer<Box<dyn Actuator>>;

/// See the [module](self).
pub enum Hand {
    /// Nothing can be written: the default.
    None,
    /// A machine in accelerated time: written at the tick, on the machine's clock.
    Inline(Box<Holding>, ManualClock),
    /// A thread.
    Thread(Remote),
}

impl Hand {
    /// On a thread, by this clock.
    ///
    /// # Errors
    /// There is no thread to be had.
    pub fn start(tools: Tools, limits: &config::Gate, clock: Arc<dyn Clock>) -> std::io::Result<Self> {
        let holding = Holding::of(tools, limits);
        let desk = Arc::new(Desk::default());
        let (say, said) = sync_channel(SAID_MAX);
        let of_thread = desk.clone();
        let thread = std::thread::Builder::new()
            .name("gate".to_owned())
            .spawn(move || work(holding, &of_thread, &*clock, &say))?;
        Ok(Self::Thread(Remote { desk, said, thread: Some(thread) }))
    }

    /// At the tick, for accelerated time.
    #[must_use]
    pub fn inline(tools: Tools, limits: &config::Gate) -> Self {
        Self::Inline(Box::new(Holding::of(tools, limits)), ManualClock::default())
    }

    /// Hands over what was decided at `now_ns`. What is told about it comes with [`Hand::listen`].
    pub fn step(&mut self, verdict: &Verdict, asks: &[Ask], now_ns: TimeNs, mut tell: impl FnMut(Said)) {
        match self {
            Self::None => {}
            Self::Inline(holding, clock) => {
                clock.set(now_ns);
                act(holding, asks, Some(verdict), clock, &mut tell);
            }
            Self::Thread(remote) => remote.lay_down(verdict, asks),
        }
    }

    /// Orders shifts of axes. What came of them is told here or with [`Hand::listen`].
    pub fn shift(&mut self, orders: &[Order], now_ns: TimeNs, mut tell: impl FnMut(Said)) {
        match self {
            Self::None => {}
            Self::Inline(holding, clock) => {
                clock.set(now_ns);
                shift(holding, orders, clock, &mut tell);
            }
            Self::Thread(remote) => remote.order(orders),
        }
    }

    /// What the hand has told since.
    pub fn listen(&mut self, mut tell: impl FnMut(Said)) {
        if let Self::Thread(remote) = self {
            remote.said.try_iter().for_each(&mut tell);
        }
    }

    /// Gives the machine back and ends.
    pub fn close(&mut self, mut tell: impl FnMut(Said)) {
        match self {
            Self::None => {}
            Self::Inline(holding, clock) => holding.release(clock).into_iter().for_each(|it| tell(Said::Written(it))),
            Self::Thread(remote) => remote.close(&mut tell),
        }
    }
}

/// The tick's end of the thread.
pub struct Remote {
    desk: Arc<Desk>,
    said: Receiver<Said>,
    thread: Option<JoinHandle<()>>,
}

impl Remote {
    fn lay_down(&self, verdict: &Verdict, asks: &[Ask]) {
        let mut paper = self.desk.lock();
        paper.verdict = Some(*verdict);
        let room = ASKS_MAX.saturating_sub(paper.asks.len());
        paper.asks.extend(asks.iter().take(room).cloned());
        self.desk.arrived.notify_one();
    }

    fn order(&self, orders: &[Order]) {
        if orders.is_empty() {
            return;
        }
        let mut paper = self.desk.lock();
        let room = ORDERS_MAX.saturating_sub(paper.orders.len());
        paper.orders.extend(orders.iter().take(room).copied());
        self.desk.arrived.notify_one();
    }

    fn close(&mut self, tell: &mut dyn FnMut(Said)) {
        self.desk.lock().closing = true;
        self.desk.arrived.notify_one();
        let until = Instant::now() + LET_GO_WITHIN;
        // The sender goes with the thread.
        while let Ok(said) = self.said.recv_timeout(until.saturating_duration_since(Instant::now())) {
            tell(said);
        }
        if let Some(thread) = self.thread.take().filter(JoinHandle::is_finished) {
            // A panic of the thread has been printed by then; the ladder has fallen back.
            let _ended = thread.join();
        }
    }
}

#[derive(Debug, Default)]
struct Paper {
    verdict: Option<Verdict>,
    asks: Vec<Ask>,
    orders: Vec<Order>,
    closing: bool,
}

/// Where the tick lays its verdicts down.
#[derive(Debug, Default)]
struct Desk {
    paper: Mutex<Paper>,
    arrived: Condvar,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, Paper> {
        // A paper is complete whenever the lock is free.
        self.paper.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits at most so long for a paper, and takes it.
    fn take(&self, limit: Duration) -> Paper {
        let empty = |paper: &mut Paper| paper.verdict.is_none() && paper.orders.is_empty() && !paper.closing;
        let waited = self.arrived.wait_timeout_while(self.lock(), limit, empty);
        let mut paper = waited.unwrap_or_else(PoisonError::into_inner).0;
        let closing = paper.closing;
        Paper { closing, ..std::mem::take(&mut *paper) }
    }
}

fn work(mut holding: Holding, desk: &Desk, clock: &dyn Clock, say: &SyncSender<Said>) {
    // The tick tells what is granted; it is the same for both.
    let _granted = priority::ask();
    let mut heard = true;
    while heard {
        let paper = desk.take(if holding.is_waiting() { LOOK_EVERY } else { REST });
        let mut tell = |said| heard &= say.try_send(said).is_ok();
        act(&mut holding, &paper.asks, paper.verdict.as_ref(), clock, &mut tell);
        shift(&mut holding, &paper.orders, clock, &mut tell);
        if paper.closing {
            break;
        }
    }
    // Nobody listens any more, or it is over: the machine is given back.
    let released = holding.release(clock);
    if let Some(written) = released {
        let _nobody = say.try_send(Said::Written(written));
    }
}

fn act(holding: &mut Holding, asks: &[Ask], verdict: Option<&Verdict>, clock: &dyn Clock, tell: &mut dyn FnMut(Said)) {
    let Some(writer) = &mut holding.writer else { return };
    for ask in asks {
        let failed = writer.ask(ask.request, clock).err().map(|error| error.to_string());
        tell(Said::Asked(ask.clone(), failed));
    }
    if let Some(written) = verdict.and_then(|verdict| writer.step(verdict, clock)) {
        tell(Said::Written(written));
    }
    match writer.look(clock) {
        None => {}
        Some(Ok(reaction)) => tell(Said::Seen(reaction)),
        Some(Err(fault)) => tell(Said::Fault(fault)),
    }
}

fn shift(holding: &mut Holding, orders: &[Order], clock: &dyn Clock, tell: &mut dyn FnMut(Said)) {
    let Some(sink) = &mut holding.offsets else { return };
    orders.iter().for_each(|order| tell(Said::Moved(Box::new(carry_out(sink.as_mut(), *order, clock)))));
}
