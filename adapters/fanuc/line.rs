//! The one connection to a controller, shared by everything that reads or writes it: opened when it is needed, given
//! up when it breaks, never open twice. A controller that answered before and cannot be reached now is switched off,
//! which is a state and not a fault.

use super::allow::AllowList;
use super::answer::{Answer, ItemError, ItemResult, System};
use super::code::Consequence;
use super::focas::{Focas, FocasError};
use super::item::{Item, Write};
use super::opening::Opening;
use crate::clock::{Clock, TimeNs};
use crate::driver::SourceError;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

/// Makes a connection.
pub type Connect = Box<dyn FnMut() -> Result<Box<dyn Focas>, FocasError> + Send>;

/// A controller that refuses connections this long after it was lost is starting or off; afterwards something is wrong
/// with it.
const STARTING_NS: i64 = 180 * crate::clock::SECOND_NS;

/// Parameter 1001, bit 0: the machine measures in inches.
const INCH_MACHINE: Item = Item::Parameter(1001, 0);

/// What does not change while a connection lasts.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    /// Generation, axes, spindles.
    pub opening: Opening,
    /// Kind and series, if the control says them.
    pub system: Option<System>,
    /// Names of the axes, in the order of every answer about axes.
    pub axes: Vec<String>,
    /// Does the machine measure in inches?
    pub inch: bool,
}

/// How a line has been doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LineCounts {
    /// Connections opened.
    pub connections: u64,
    /// Connections that could not be opened.
    pub refused: u64,
    /// Connections that broke.
    pub broken: u64,
}

struct Inner {
    name: String,
    connect: Connect,
    focas: Option<Box<dyn Focas>>,
    facts: Option<Arc<Facts>>,
    /// Items that this control does not have, found out once per connection.
    unsupported: HashSet<Item>,
    allow: AllowList,
    duty_pct: u8,
    not_before_ns: TimeNs,
    lost_ns: Option<TimeNs>,
    known: bool,
    counts: LineCounts,
}

/// A handle on the connection; clones are handles on the same one.
#[derive(Clone)]
pub struct Line {
    inner: Arc<Mutex<Inner>>,
}

/// What one round of questions gave.
#[derive(Debug, Clone)]
pub struct Asked {
    /// The facts of the connection.
    pub facts: Arc<Facts>,
    /// The items.
    pub items: Vec<Item>,
    /// One result per item.
    pub results: Vec<ItemResult>,
    /// When it began, on the gateway's clock.
    pub began_ns: TimeNs,
    /// When it was over.
    pub ended_ns: TimeNs,
}

impl Asked {
    /// What became of an item.
    #[must_use]
    pub fn of(&self, item: Item) -> Option<&ItemResult> {
        let at = self.items.iter().position(|asked| *asked == item)?;
        self.results.get(at)
    }
}

impl Line {
    /// A line that is opened when it is first needed. `name` is the address.
    #[must_use]
    pub fn new(name: &str, connect: Connect, allow: AllowList, duty_pct: u8) -> Self {
        let inner = Inner {
            name: name.to_owned(),
            connect,
            focas: None,
            facts: None,
            unsupported: HashSet::new(),
            allow,
            duty_pct: duty_pct.clamp(1, 100),
            not_before_ns: TimeNs::MIN,
            lost_ns: None,
            known: false,
            counts: LineCounts::default(),
        };
        Self { inner: Arc::new(Mutex::new(inner)) }
    }

    fn locked<T>(&self, act: impl FnOnce(&mut Inner) -> T) -> T {
        act(&mut self.inner.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Asks for all items; what this control does not have is not asked for again.
    ///
    /// # Errors
    /// The poll as a whole failed; the next one opens a new connection.
    pub fn ask(&self, clock: &dyn Clock, items: &[Item]) -> Result<Asked, SourceError> {
        self.locked(|inner| inner.ask(clock, items))
    }

    /// Writes, if the address is allowed.
    ///
    /// # Errors
    /// It is not, the controller refused, or the line failed.
    pub fn write(&self, clock: &dyn Clock, write: &Write) -> Result<(), SourceError> {
        self.locked(|inner| inner.write(clock, write))
    }

    /// How the line has been doing.
    #[must_use]
    pub fn counts(&self) -> LineCounts {
        self.locked(|inner| inner.counts)
    }

    /// Items that this control does not have.
    #[must_use]
    pub fn unsupported(&self) -> Vec<Item> {
        self.locked(|inner| inner.unsupported.iter().copied().collect())
    }
}

impl Inner {
    fn ask(&mut self, clock: &dyn Clock, items: &[Item]) -> Result<Asked, SourceError> {
        let facts = self.connected(clock)?;
        let wanted: Vec<Item> = items.iter().copied().filter(|item| !self.unsupported.contains(item)).collect();
        let (began_ns, found) = self.round(clock, &wanted)?;
        self.learn(&wanted, &found);
        let mut found = wanted.iter().zip(found);
        let results = items.iter().map(|item| {
            let asked = !self.unsupported.contains(item) || wanted.contains(item);
            let own = if asked { found.next().map(|(_, result)| result) } else { None };
            own.unwrap_or(Err(ItemError::NotOffered))
        });
        let results = results.collect();
        Ok(Asked { facts, items: items.to_vec(), results, began_ns, ended_ns: clock.now_ns() })
    }

    /// One round of questions on an open connection, not before the duty cycle allows it.
    fn round(&mut self, clock: &dyn Clock, items: &[Item]) -> Result<(TimeNs, Vec<ItemResult>), SourceError> {
        self.rest(clock);
        let began_ns = clock.now_ns();
        let mut found = Vec::with_capacity(items.len());
        let outcome = match &mut self.focas {
            Some(focas) => focas.ask(items, &mut found),
            None => Err(FocasError::Broken("there is no connection".to_owned())),
        };
        self.busy(began_ns, clock.now_ns());
        if let Err(error) = outcome {
            return Err(self.lost(&error, "the values", clock.now_ns()));
        }
        let dead = |result: &ItemResult| matches!(result, Err(ItemError::Refused(refusal)) if refusal.code.consequence() == Consequence::Reconnect);
        if let Some(Err(ItemError::Refused(refusal))) = found.iter().find(|result| dead(result)) {
            return Err(self.lost(&FocasError::Broken(refusal.code.to_string()), "the values", clock.now_ns()));
        }
        Ok((began_ns, found))
    }

    /// Waits until the controller has had its share of time for itself.
    fn rest(&self, clock: &dyn Clock) {
        if clock.now_ns() < self.not_before_ns {
            clock.sleep_until(self.not_before_ns);
        }
    }

    fn busy(&mut self, began_ns: TimeNs, ended_ns: TimeNs) {
        let (took_ns, duty) = ((ended_ns - began_ns).max(0), i64::from(self.duty_pct));
        self.not_before_ns = ended_ns + took_ns.min(60 * crate::clock::SECOND_NS) * (100 - duty) / duty;
    }

    fn learn(&mut self, items: &[Item], results: &[ItemResult]) {
        let missing = |result: &ItemResult| match result {
            Err(ItemError::Refused(refusal)) => refusal.code.consequence() == Consequence::NotSupported,
            Err(ItemError::NotOffered) => true,
            _ => false,
        };
        let absent = items.iter().zip(results).filter(|(_, result)| missing(result));
        self.unsupported.extend(absent.map(|(item, _)| *item));
    }

    fn connected(&mut self, clock: &dyn Clock) -> Result<Arc<Facts>, SourceError> {
        if let (Some(_), Some(facts)) = (&self.focas, &self.facts) {
            return Ok(facts.clone());
        }
        let focas = (self.connect)().map_err(|error| self.not_opened(&error, clock.now_ns()))?;
        let opening = *focas.opening();
        self.focas = Some(focas);
        self.unsupported.clear();
        let items = [Item::System, Item::AxisNames, INCH_MACHINE];
        let (_, found) = self.round(clock, &items)?;
        let facts = Arc::new(facts(opening, &found));
        self.facts = Some(facts.clone());
        self.counts.connections += 1;
        self.lost_ns = None;
        self.known = true;
        Ok(facts)
    }

    fn write(&mut self, clock: &dyn Clock, write: &Write) -> Result<(), SourceError> {
        let what = super::allow::address(write);
        if let Err(error) = self.allow.permit(write) {
            return Err(self.error(&error, &what));
        }
        self.connected(clock)?;
        let began_ns = clock.now_ns();
        let outcome = match &mut self.focas {
            Some(focas) => focas.write(write),
            None => Err(FocasError::Broken("there is no connection".to_owned())),
        };
        self.busy(began_ns, clock.now_ns());
        match outcome {
            Ok(()) => Ok(()),
            Err(error @ FocasError::Refused(refusal)) if refusal.code.consequence() != Consequence::Reconnect => {
                Err(self.error(&error, &format!("writing {what}")))
            }
            Err(error) => Err(self.lost(&error, &format!("writing {what}"), clock.now_ns())),
        }
    }

    /// The connection is of no use any more.
    fn lost(&mut self, error: &FocasError, request: &str, now_ns: TimeNs) -> SourceError {
        self.focas = None;
        self.facts = None;
        self.counts.broken += 1;
        self.lost_ns.get_or_insert(now_ns);
        self.error(error, request)
    }

    /// No connection could be opened.
    fn not_opened(&mut self, error: &FocasError, now_ns: TimeNs) -> SourceError {
        self.counts.refused += 1;
        let lost_ns = *self.lost_ns.get_or_insert(now_ns);
        let off = match error {
            FocasError::Unreachable(_) => true,
            FocasError::NobodyThere(_) | FocasError::Broken(_) | FocasError::Timeout(_) => {
                now_ns - lost_ns < STARTING_NS
            }
            _ => false,
        };
        if off && self.known {
            return SourceError::Off { source_name: self.name.clone() };
        }
        self.error(error, "the opening of a connection")
    }

    fn error(&self, error: &FocasError, request: &str) -> SourceError {
        source_error(&self.name, error, request)
    }
}

/// A failure in the words of every driver.
#[must_use]
pub fn source_error(name: &str, error: &FocasError, request: &str) -> SourceError {
    let (source_name, request, what, next) = (name.to_owned(), request.to_owned(), error.to_string(), error.next());
    match error {
        FocasError::Timeout(waited) => SourceError::Timeout {
            source_name,
            request,
            deadline_ms: u64::try_from(waited.as_millis()).unwrap_or(u64::MAX),
            next,
        },
        FocasError::Protocol(_) => SourceError::Decode { source_name, request, what: format!("{what}. {next}") },
        FocasError::NoSession | FocasError::Refused(_) | FocasError::NotAllowed(_) => {
            SourceError::Refused { source_name, request, what, next }
        }
        _ => SourceError::Line { source_name, what, next },
    }
}

fn facts(opening: Opening, found: &[ItemResult]) -> Facts {
    let mut facts = Facts { opening, system: None, axes: Vec::new(), inch: false };
    for answer in found.iter().flatten() {
        match answer {
            Answer::System(system) => facts.system = Some(system.clone()),
            Answer::Names(names) => facts.axes.clone_from(names),
            Answer::Data { values, .. } => {
                let bits = values.first().copied().flatten().unwrap_or(0.0);
                facts.inch = bits.rem_euclid(2.0) >= 1.0;
            }
            _ => {}
        }
    }
    facts
}
