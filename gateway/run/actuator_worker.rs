//! The worker that writes: the only thing in the process that holds an actuator, on a thread of its own because a controller
//! may take seconds to answer. The tick lays its verdict down and goes on; only the newest counts. Whatever stops the tick
//! stops the verdicts, with them the signs of life, and with those the override at the machine.
//!
//! What waits while the controller takes its time is judged again when its turn comes: a verdict, a request or an order that
//! has grown old, or whose arming has ended meanwhile, goes nowhere, and the tick is told.

use super::priority::{self, Granted};
use super::verdict_mailbox::VerdictMailbox;
use adapters::Actuator;
use adapters::clock::{Clock, ManualClock, TimeNs};
use adapters::threads::reach_fault_point;
use gateway_config as config;
use gateway_gate::offset::{Moved, OffsetAccount, OffsetOrder};
use gateway_gate::{AuditPath, Fault, OverrideWriter, Reaction, ScriptRequest, Verdict, WriteRecord};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What is told but not yet listened to; beyond that the worker ends.
const REPORTS_MAX: usize = 1024;
/// While a change has not been seen in force it is looked for this often.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Without a verdict for this long the worker looks whether it shall end.
const REST: Duration = Duration::from_millis(500);
/// A controller that does not answer is not waited for at the end; the ladder falls back by itself.
const LET_GO_WITHIN: Duration = Duration::from_secs(3);
/// A withdrawal that the machine refuses is tried again for so long at the end.
const WITHDRAW_WITHIN: Duration = Duration::from_millis(2500);
/// Between two of these attempts.
const WITHDRAW_PAUSE: Duration = Duration::from_millis(100);
/// Why a request never reached the ladder.
const NOT_PASSED_ON: &str = "not handed over: the gate was disarmed before the controller had time for it, or it had none for \
                               ten seconds";

/// What the worker reports.
#[derive(Debug)]
pub enum ActuatorReport {
    /// An override was written to the machine.
    Written(WriteRecord),
    /// A change was seen in force.
    Seen(Reaction),
    /// What was written is not in force, or the machine cannot be reached.
    Fault(Fault),
    /// A request went to the ladder, or could not be handed over.
    Asked(ScriptRequest, Option<String>),
    /// An order to shift an axis was carried out, or could not be.
    Moved(Box<Moved>),
    /// An order that was not carried out: the arming ended before its turn came, or it waited too long.
    Withdrawn(OffsetOrder),
}

/// What the worker may write to.
pub struct Tools {
    /// Whether what is written is accounted for.
    pub audit: Arc<dyn AuditPath>,
    /// The way to the feed override.
    pub actuator: Option<Box<dyn Actuator>>,
    /// The way to the offsets.
    pub offsets: Option<OffsetAccount>,
}

/// The same with the account of what was written.
pub struct Writers {
    audit: Arc<dyn AuditPath>,
    writer: Option<AnyWriter>,
    offsets: Option<OffsetAccount>,
}

impl Writers {
    fn from_tools(tools: Tools, limits: &config::GateConfig) -> Self {
        let Tools { audit, actuator, offsets } = tools;
        let of_writer = audit.clone();
        let writer = actuator.map(|actuator| OverrideWriter::new(actuator, Box::new(of_writer), limits));
        Self { audit, writer, offsets }
    }

    fn is_waiting(&self) -> bool {
        self.writer.as_ref().is_some_and(OverrideWriter::is_waiting)
    }

    fn release_override(&mut self, clock: &dyn Clock) -> Option<WriteRecord> {
        self.writer.as_mut()?.release_machine(clock)
    }

    fn owes_withdrawal(&self) -> bool {
        self.writer.as_ref().is_some_and(OverrideWriter::owes_withdrawal)
    }
}

type AnyWriter = OverrideWriter<Box<dyn Actuator>>;

/// What carries out the writes: nothing, the tick itself, or a thread.
pub enum ActuatorWorker {
    /// Nothing can be written: the default.
    None,
    /// A machine in accelerated time: written at the tick, on the machine's clock.
    Inline(Box<Writers>, ManualClock),
    /// A real machine: written by a thread of its own.
    Thread(Remote),
}

impl ActuatorWorker {
    /// On a thread, by this clock, with a verdict at every such period.
    ///
    /// # Errors
    /// There is no thread to be had.
    pub fn start(
        tools: Tools,
        limits: &config::GateConfig,
        clock: Arc<dyn Clock>,
        period: Duration,
    ) -> std::io::Result<Self> {
        let writers = Writers::from_tools(tools, limits);
        let mailbox = Arc::new(VerdictMailbox::new(period));
        let (say, said) = sync_channel(REPORTS_MAX);
        let of_thread = mailbox.clone();
        let thread = std::thread::Builder::new()
            .name("gate".to_owned())
            .spawn(move || run_worker(writers, &of_thread, &*clock, &say))?;
        Ok(Self::Thread(Remote { mailbox, reports: said, thread: Some(thread) }))
    }

    /// At the tick, for accelerated time.
    #[must_use]
    pub fn with_inline_writers(tools: Tools, limits: &config::GateConfig) -> Self {
        Self::Inline(Box::new(Writers::from_tools(tools, limits)), ManualClock::default())
    }

    /// Hands over what was decided at `now_ns`. What is told about it comes with [`ActuatorWorker::receive_reports`].
    pub fn submit_verdict(
        &mut self,
        verdict: &Verdict,
        asks: &[ScriptRequest],
        now_ns: TimeNs,
        mut tell: impl FnMut(ActuatorReport),
    ) {
        match self {
            Self::None => {}
            Self::Inline(writers, clock) => {
                clock.set_time(now_ns);
                asks.iter().for_each(|it| send_request(writers, it, clock, &mut tell));
                write(writers, Some(verdict), clock, &mut tell);
            }
            Self::Thread(remote) => {
                let refused = remote.mailbox.post_verdict(verdict, asks);
                refused.into_iter().for_each(|it| tell(ActuatorReport::Asked(it, Some(NOT_PASSED_ON.to_owned()))));
            }
        }
    }

    /// Orders shifts of axes; `armed` tells whether any may be made. What came of them is told here or with [`ActuatorWorker::receive_reports`].
    pub fn order_shifts(
        &mut self,
        orders: &[OffsetOrder],
        armed: bool,
        now_ns: TimeNs,
        mut tell: impl FnMut(ActuatorReport),
    ) {
        match self {
            Self::None => {}
            Self::Inline(writers, clock) => {
                clock.set_time(now_ns);
                orders.iter().for_each(|order| carry_out_shift(writers, *order, clock, &mut tell));
            }
            Self::Thread(remote) => {
                let withdrawn = remote.mailbox.post_orders(orders, armed);
                withdrawn.into_iter().for_each(|order| tell(ActuatorReport::Withdrawn(order)));
            }
        }
    }

    /// What the worker has reported since; also that it is not there any more.
    pub fn receive_reports(&mut self, mut tell: impl FnMut(ActuatorReport)) {
        let Self::Thread(remote) = self else { return };
        loop {
            match remote.reports.try_recv() {
                Ok(said) => tell(said),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => return tell(ActuatorReport::Fault(Fault::Gone)),
            }
        }
    }

    /// Gives the machine back and ends.
    pub fn close(&mut self, mut tell: impl FnMut(ActuatorReport)) {
        match self {
            Self::None => {}
            Self::Inline(writers, clock) => {
                writers.release_override(clock).into_iter().for_each(|it| tell(ActuatorReport::Written(it)))
            }
            Self::Thread(remote) => remote.close(&mut tell),
        }
    }
}

/// The tick's end of the thread.
pub struct Remote {
    mailbox: Arc<VerdictMailbox>,
    reports: Receiver<ActuatorReport>,
    thread: Option<JoinHandle<()>>,
}

impl Remote {
    fn close(&mut self, tell: &mut dyn FnMut(ActuatorReport)) {
        self.mailbox.close();
        let until = Instant::now() + LET_GO_WITHIN;
        // The sender goes with the thread.
        while let Ok(said) = self.reports.recv_timeout(until.saturating_duration_since(Instant::now())) {
            tell(said);
        }
        if let Some(thread) = self.thread.take().filter(JoinHandle::is_finished) {
            // A panic of the thread has been printed by then; the ladder has fallen back.
            let _ended = thread.join();
        }
    }
}

/// Whatever ends the tick gives the machine back.
impl Drop for Remote {
    fn drop(&mut self) {
        self.close(&mut |_| {});
    }
}

fn run_worker(mut writers: Writers, mailbox: &VerdictMailbox, clock: &dyn Clock, say: &SyncSender<ActuatorReport>) {
    // The tick tells what is granted; it is the same for both.
    let awake = priority::request_priority() == Granted::RealTime;
    let mut heard = true;
    while heard {
        reach_fault_point("gate");
        let (verdict, closing) = mailbox.take_verdict(if writers.is_waiting() { LOOK_EVERY } else { REST }, awake);
        let mut tell = |said| heard &= say.try_send(said).is_ok();
        while let Some((it, in_time)) = mailbox.next_ask() {
            match in_time {
                true => send_request(&mut writers, &it, clock, &mut tell),
                false => tell(ActuatorReport::Asked(it, Some(NOT_PASSED_ON.to_owned()))),
            }
        }
        write(&mut writers, verdict.as_ref(), clock, &mut tell);
        while let Some((order, in_time)) = mailbox.next_order() {
            match in_time {
                true => carry_out_shift(&mut writers, order, clock, &mut tell),
                false => tell(ActuatorReport::Withdrawn(order)),
            }
        }
        if closing {
            break;
        }
    }
    // Nobody listens any more, or it is over: the machine is given back.
    let until = Instant::now() + WITHDRAW_WITHIN;
    while writers.owes_withdrawal() {
        if let Some(written) = writers.release_override(clock) {
            let _nobody = say.try_send(ActuatorReport::Written(written));
        }
        if Instant::now() >= until {
            break;
        }
        if writers.owes_withdrawal() {
            std::thread::sleep(WITHDRAW_PAUSE);
        }
    }
}

fn send_request(writers: &mut Writers, ask: &ScriptRequest, clock: &dyn Clock, tell: &mut dyn FnMut(ActuatorReport)) {
    let Some(writer) = &mut writers.writer else { return };
    let failed = writer.send_request(ask.request, clock).err().map(|error| error.to_string());
    tell(ActuatorReport::Asked(ask.clone(), failed));
}

fn write(writers: &mut Writers, verdict: Option<&Verdict>, clock: &dyn Clock, tell: &mut dyn FnMut(ActuatorReport)) {
    let Some(writer) = &mut writers.writer else { return };
    if let Some(written) = verdict.and_then(|verdict| writer.write_verdict(verdict, clock)) {
        tell(ActuatorReport::Written(written));
    }
    match writer.read_reaction(clock) {
        None => {}
        Some(Ok(reaction)) => tell(ActuatorReport::Seen(reaction)),
        Some(Err(fault)) => tell(ActuatorReport::Fault(fault)),
    }
}

fn carry_out_shift(writers: &mut Writers, order: OffsetOrder, clock: &dyn Clock, tell: &mut dyn FnMut(ActuatorReport)) {
    let Some(offsets) = &mut writers.offsets else { return };
    if matches!(order, OffsetOrder::Shift { .. }) && !writers.audit.is_live() {
        return tell(ActuatorReport::Withdrawn(order));
    }
    tell(ActuatorReport::Moved(Box::new(offsets.carry_out(order, clock))));
}
