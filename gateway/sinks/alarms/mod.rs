//! Alarms to people: what a webhook and a mail have in common.
//!
//! Each alarm that begins is one message. It counts as delivered when the receiver says that it has it;
//! until then it waits in the outbox and is tried again. `severity` says which alarms are wanted. In the quiet hours alarms wait;
//! with `pass` those of this severity and graver ones go all the same.

mod quiet;

pub use quiet::QuietHours;

use super::{Batch, DeliveryHold, Pending, Sink, SinkError};
use adapter_core::address::Keys;
use adapter_core::clock::TimeNs;
use gateway_history::{Alarm, Content, Item, Record};
use std::collections::BTreeSet;
use std::time::Duration;

/// After a failure of a receiver that can be reached: the first pause, and the longest.
const PAUSE_FIRST: Duration = Duration::from_millis(500);
const PAUSE_MAX: Duration = Duration::from_secs(30);
/// Alarms that are known to have arrived although the position of the sink does not say so: they are not sent again.
const CONFIRMED_MAX: usize = 4096;
/// Items of one batch. A mail may take seconds, and a batch has a minute.
const ITEMS_MAX: usize = 32;

/// How grave an alarm is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AlarmSeverity {
    /// It is worth knowing.
    Info,
    /// Somebody has to look.
    Warning,
    /// Somebody has to act.
    Critical,
}

impl AlarmSeverity {
    const WORDS: [(&'static str, Self); 3] =
        [("info", Self::Info), ("warning", Self::Warning), ("critical", Self::Critical)];

    /// A word that is none of the three is told: an alarm more is better than one too few.
    fn from_word(word: &str) -> Self {
        Self::WORDS.iter().find(|(known, _)| *known == word).map_or(Self::Critical, |(_, severity)| *severity)
    }
}

/// Which alarms are sent, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct AlarmChoice {
    /// Lesser alarms are not sent.
    pub severity: AlarmSeverity,
    /// The hours in which alarms wait.
    pub quiet: Option<QuietHours>,
    /// Alarms of this severity and graver ones do not wait.
    pub pass: Option<AlarmSeverity>,
}

impl AlarmChoice {
    /// The keys `severity`, `quiet`, `zone` and `pass`.
    pub(super) fn from_keys(keys: &mut Keys) -> Self {
        let severity = keys.take_choice("severity", &AlarmSeverity::WORDS);
        let quiet = QuietHours::from_keys(keys);
        let words = AlarmSeverity::WORDS.map(|(word, severity)| (word, Some(severity)));
        let none = [("none", None)];
        let pass = keys.take_choice("pass", &[&none[..], &words[..]].concat());
        if pass.is_some() && quiet.is_none() {
            keys.add_problem("pass counts only with quiet=22:00-06:00".to_owned());
        }
        Self { severity, quiet, pass }
    }

    /// The alarm of this item, where it is one that is sent.
    fn find_alarm<'a>(&self, item: &'a Item) -> Option<&'a Alarm> {
        let Content::Record(record) = &item.content else { return None };
        let Record::Alarm(alarm) = &**record else { return None };
        (AlarmSeverity::from_word(&alarm.severity) >= self.severity).then_some(alarm)
    }

    fn is_held(&self, item: &Item) -> bool {
        let passes = |alarm: &Alarm| self.pass.is_some_and(|pass| AlarmSeverity::from_word(&alarm.severity) >= pass);
        self.find_alarm(item).is_some_and(|alarm| !passes(alarm))
    }

    fn find_hold(&self, now_ns: TimeNs) -> Option<DeliveryHold> {
        let until_ns = self.quiet.as_ref()?.end_after(now_ns)?;
        Some(DeliveryHold { until_ns, some_pass: self.pass.is_some() })
    }
}

/// An alarm on its way.
#[derive(Debug, Clone, Copy)]
pub(super) struct AlarmMessage<'a> {
    pub(super) item: &'a Item,
    pub(super) alarm: &'a Alarm,
    /// It has waited for the line, or for the end of the quiet hours.
    pub(super) historical: bool,
}

/// The line to one receiver of alarms.
pub(super) trait AlarmLine: Send {
    /// Opens the connection; leaves nothing of an older one behind.
    fn open_line(&mut self) -> Pending<'_, Result<(), SinkError>>;

    /// Returns when the receiver has the alarm. An idle connection that the receiver has closed meanwhile is opened again.
    fn send_alarm<'a>(&'a mut self, message: AlarmMessage<'a>) -> Pending<'a, Result<(), SinkError>>;

    /// Waits until something is to be done about an idle connection.
    fn wait_idle(&mut self) -> Pending<'_, ()> {
        Box::pin(std::future::pending())
    }

    /// Says goodbye, where a connection stands.
    fn close_line(&mut self) -> Pending<'_, ()> {
        Box::pin(std::future::ready(()))
    }

    /// For `doctor`: connects and asks what the receiver would take, without sending anything.
    fn probe_line(&mut self) -> Pending<'_, Result<(), SinkError>> {
        self.open_line()
    }

    /// What is wrong although alarms arrive.
    fn find_fault(&self) -> Option<SinkError> {
        None
    }
}

/// A connection that is kept between alarms.
pub(super) trait KeptConnection: Send {
    /// Does it still stand? Its receiver may have closed it meanwhile.
    fn is_ready(&mut self) -> impl Future<Output = bool> + Send;
}

/// The connection of the last alarm, where it still stands.
pub(super) async fn reuse_connection<C: KeptConnection>(kept: Option<C>) -> Option<C> {
    let mut kept = kept?;
    kept.is_ready().await.then_some(kept)
}

/// The number of an item over every run of the box.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct AlarmKey {
    sequence: u64,
    epoch: u64,
}

/// A sink of alarms over one line.
pub(super) struct AlarmSink<L> {
    choice: AlarmChoice,
    line: L,
    /// Failures since the last alarm that arrived.
    failures: u32,
    confirmed: BTreeSet<AlarmKey>,
}

impl<L: AlarmLine> AlarmSink<L> {
    pub(super) fn new(choice: AlarmChoice, line: L) -> Self {
        Self { choice, line, failures: 0, confirmed: BTreeSet::new() }
    }

    async fn open_line(&mut self) -> Result<(), SinkError> {
        // A receiver that can be reached and takes nothing is left alone for a while.
        let pause = match self.failures {
            0 => Duration::ZERO,
            failures => PAUSE_FIRST.saturating_mul(1 << failures.min(10)).min(PAUSE_MAX),
        };
        tokio::time::sleep(pause).await;
        self.line.open_line().await
    }

    async fn send_alarms(&mut self, batch: Batch<'_>) -> Result<(), SinkError> {
        for item in batch.items {
            let key = AlarmKey { sequence: item.sequence, epoch: item.epoch };
            let Some(alarm) = self.choice.find_alarm(item).filter(|_| !self.confirmed.contains(&key)) else { continue };
            let sent = self.line.send_alarm(AlarmMessage { item, alarm, historical: batch.historical }).await;
            self.failures = if sent.is_ok() { 0 } else { self.failures.saturating_add(1) };
            sent?;
            self.confirmed.insert(key);
            while self.confirmed.len() > CONFIRMED_MAX {
                self.confirmed.pop_first();
            }
        }
        Ok(())
    }
}

impl<L: AlarmLine> Sink for AlarmSink<L> {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.open_line())
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(self.send_alarms(batch))
    }

    fn wait_for_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async {
            self.line.wait_idle().await;
            Ok(())
        })
    }

    fn serve_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async {
            self.line.close_line().await;
            Ok(())
        })
    }

    fn close(&mut self) -> Pending<'_, ()> {
        self.line.close_line()
    }

    fn probe_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        self.line.probe_line()
    }

    fn find_hold(&self, now_ns: TimeNs) -> Option<DeliveryHold> {
        self.choice.find_hold(now_ns)
    }

    fn is_held(&self, item: &Item) -> bool {
        self.choice.is_held(item)
    }

    fn find_fault(&self) -> Option<SinkError> {
        self.line.find_fault()
    }

    /// An answer says what becomes of an alarm, and most items are none.
    fn tells_refusals(&self) -> bool {
        true
    }

    fn items_max(&self) -> usize {
        ITEMS_MAX
    }
}
