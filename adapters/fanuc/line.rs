//! The one connection to a controller, shared by everything that reads or writes it: opened when it is needed, given
//! up when it breaks, never open twice. A controller that answered before and whose computer now refuses connections is
//! starting or off, which is a state and not a fault. One that cannot be reached, that accepts and is silent, or that closes
//! what it has accepted gives no answer: a cable or a switch that failed looks the same as a machine that is off, and only a
//! meter tells them apart.

use super::allow_list::AllowList;
use super::answer::{FocasItemError, FocasItemResult, Refusal};
use super::code::Consequence;
use super::facts::Facts;
use super::focas::{Focas, FocasError};
use super::generation::Opening;
use super::item::{FocasItem, Question, Write};
use adapter_core::clock::{Clock, TimeNs};
use adapter_core::driver::SourceError;
use adapter_core::integer::saturate_to_ms;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};

/// Opens a connection; called again after every one that broke.
pub type Connect = Box<dyn FnMut() -> Result<Box<dyn Focas>, FocasError> + Send>;

/// A controller that refuses connections this long after it was lost is starting or off; afterwards something is wrong
/// with it.
const STARTING_NS: i64 = 180 * adapter_core::clock::SECOND_NS;

/// The control may be owed this much rest before anybody waits: what one answer that takes long costs is paid by the pauses
/// after it, and does not delay the next poll by as much again. As much as one answer costs that comes just within a usual deadline, 3 s
/// at a duty of 50 %: with less, a single long answer made two polls late, which looks like a control that has become slow.
const OWED_NS: i64 = 3 * adapter_core::clock::SECOND_NS;

/// Next step where something listens and has never opened a session: perhaps it is no controller.
const NEVER_OPENED: &str = "Something listens there and opens no session: is it the FOCAS2 port (8193 unless changed), and \
                            has the controller a connection left?";

/// How a line has been doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LineCounts {
    /// Connections that were opened, those that broke later included.
    pub connections: u64,
    /// Connections that could not be opened.
    pub refused: u64,
    /// Connections that broke after they were opened.
    pub broken: u64,
}

struct FanucConnection {
    name: String,
    connect: Connect,
    focas: Option<Box<dyn Focas>>,
    facts: Option<Arc<Facts>>,
    /// The path that is written to and whose items are meant when no path is named; then the further ones.
    paths: (u8, Vec<u8>),
    /// What this control does not have, found out once per connection.
    unsupported: HashSet<Question>,
    /// What was refused when it was last asked for.
    refusals: HashMap<Question, Refusal>,
    allow: AllowList,
    duty_pct: u8,
    /// When the control will have rested for as long as its share of all answers wants.
    rested_ns: TimeNs,
    lost_ns: Option<TimeNs>,
    known: bool,
    counts: LineCounts,
}

/// A handle on the connection; clones are handles on the same one.
#[derive(Clone)]
pub struct FanucLine {
    connection: Arc<Mutex<FanucConnection>>,
}

/// What one round of questions gave.
#[derive(Debug, Clone)]
pub struct Asked {
    /// The facts of the connection.
    pub facts: Arc<Facts>,
    /// The path that is meant when none is named.
    pub path: u8,
    /// The questions, in the order of the results.
    pub questions: Vec<Question>,
    /// One result per question.
    pub results: Vec<FocasItemResult>,
    /// When it began, on the gateway's clock.
    pub began_ns: TimeNs,
    /// When it was over.
    pub ended_ns: TimeNs,
}

impl Asked {
    /// What became of an item of the line's own path.
    #[must_use]
    pub fn find_item_result(&self, item: FocasItem) -> Option<&FocasItemResult> {
        self.find_question_result(item.to_question(self.path))
    }

    /// What became of a question.
    #[must_use]
    pub fn find_question_result(&self, question: Question) -> Option<&FocasItemResult> {
        let at = self.questions.iter().position(|asked| *asked == question)?;
        self.results.get(at)
    }
}

impl FanucLine {
    /// A line that is opened when it is first needed. `name` is the address; of `paths` the first is written to and
    /// the others are read besides.
    #[must_use]
    pub fn new(name: &str, connect: Connect, paths: (u8, Vec<u8>), allow: AllowList, duty_pct: u8) -> Self {
        let inner = FanucConnection {
            name: name.to_owned(),
            connect,
            focas: None,
            facts: None,
            paths,
            unsupported: HashSet::new(),
            refusals: HashMap::new(),
            allow,
            duty_pct: duty_pct.clamp(1, 100),
            rested_ns: TimeNs::MIN,
            lost_ns: None,
            known: false,
            counts: LineCounts::default(),
        };
        Self { connection: Arc::new(Mutex::new(inner)) }
    }

    fn with_connection<T>(&self, act: impl FnOnce(&mut FanucConnection) -> T) -> T {
        act(&mut self.connection.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Asks for all items of the line's own path; see [`FanucLine::ask_on`].
    ///
    /// # Errors
    /// As there.
    pub fn ask_items(&self, clock: &dyn Clock, items: &[FocasItem]) -> Result<Asked, SourceError> {
        self.with_connection(|inner| {
            let path = inner.paths.0;
            inner.ask_questions(clock, items.iter().map(|item| item.to_question(path)).collect())
        })
    }

    /// Asks all questions; what this control does not have is not asked for again.
    ///
    /// # Errors
    /// The poll as a whole failed; the next one opens a new connection.
    pub fn ask_on(&self, clock: &dyn Clock, questions: &[Question]) -> Result<Asked, SourceError> {
        self.with_connection(|inner| inner.ask_questions(clock, questions.to_vec()))
    }

    /// Writes, if the address is allowed.
    ///
    /// # Errors
    /// It is not, the controller refused, or the line failed.
    pub fn write(&self, clock: &dyn Clock, write: &Write) -> Result<(), SourceError> {
        self.with_connection(|inner| inner.write(clock, write))
    }

    /// The path that is meant when none is named.
    #[must_use]
    pub fn path(&self) -> u8 {
        self.with_connection(|inner| inner.paths.0)
    }

    /// How the line has been doing.
    #[must_use]
    pub fn counts(&self) -> LineCounts {
        self.with_connection(|inner| inner.counts)
    }

    /// Which of these questions were refused when they were last asked.
    #[must_use]
    pub fn list_refusals(&self, questions: &[Question]) -> Vec<(Question, Refusal)> {
        let of = |inner: &FanucConnection, question: &Question| Some((*question, *inner.refusals.get(question)?));
        self.with_connection(|inner| questions.iter().filter_map(|question| of(inner, question)).collect())
    }

    /// What this control does not have.
    #[must_use]
    pub fn list_unsupported(&self) -> Vec<Question> {
        self.with_connection(|inner| inner.unsupported.iter().copied().collect())
    }
}

impl FanucConnection {
    fn ask_questions(&mut self, clock: &dyn Clock, questions: Vec<Question>) -> Result<Asked, SourceError> {
        let facts = self.ensure_connection(clock)?;
        let known = |question: &Question| !self.unsupported.contains(question);
        let wanted: Vec<Question> = questions.iter().copied().filter(known).collect();
        // What the control has not told of itself yet travels with every round until it has.
        let open: Vec<Question> = facts.open.iter().map(|(question, _)| *question).collect();
        let both = [wanted.as_slice(), &open].concat();
        let (began_ns, mut found) = self.ask_round(clock, &both)?;
        let facts = self.learn_facts(&open, &found.split_off(wanted.len()), facts);
        self.update_support(&wanted, &found);
        let mut found = wanted.iter().zip(found).peekable();
        let answer = |question: &Question| {
            let own = found.next_if(|(asked, _)| *asked == question);
            own.map_or(Err(FocasItemError::NotOffered), |(_, result)| result)
        };
        let results = questions.iter().map(answer).collect();
        Ok(Asked { facts, path: self.paths.0, questions, results, began_ns, ended_ns: clock.now_ns() })
    }

    /// Takes what has been told at last.
    fn learn_facts(&mut self, open: &[Question], found: &[FocasItemResult], facts: Arc<Facts>) -> Arc<Facts> {
        if open.is_empty() {
            return facts;
        }
        let mut learnt = Facts::clone(&facts);
        open.iter().zip(found).for_each(|(question, result)| learnt.record_result(*question, result));
        let learnt = Arc::new(learnt);
        self.facts = Some(learnt.clone());
        learnt
    }

    /// One round of questions on an open connection, not before the duty cycle allows it.
    fn ask_round(
        &mut self,
        clock: &dyn Clock,
        questions: &[Question],
    ) -> Result<(TimeNs, Vec<FocasItemResult>), SourceError> {
        self.wait_for_rest(clock);
        let began_ns = clock.now_ns();
        let mut found = Vec::with_capacity(questions.len());
        let outcome = match &mut self.focas {
            Some(focas) => focas.ask_questions(questions, &mut found),
            None => Err(FocasError::Broken("there is no connection".to_owned())),
        };
        self.record_busy_time(began_ns, clock.now_ns());
        if let Err(error) = outcome {
            return Err(self.drop_connection(&error, "the values", clock.now_ns()));
        }
        let dead = |result: &FocasItemResult| matches!(result, Err(FocasItemError::Refused(refusal)) if refusal.code.consequence() == Consequence::Reconnect);
        if let Some(Err(FocasItemError::Refused(refusal))) = found.iter().find(|result| dead(result)) {
            return Err(self.drop_connection(
                &FocasError::Broken(refusal.code.to_string()),
                "the values",
                clock.now_ns(),
            ));
        }
        Ok((began_ns, found))
    }

    /// Waits while the control is owed more rest than [`OWED_NS`].
    fn wait_for_rest(&self, clock: &dyn Clock) {
        let until_ns = self.rested_ns.saturating_sub(OWED_NS);
        if clock.now_ns() < until_ns {
            clock.sleep_until(until_ns);
        }
    }

    /// An answer of so long wants a rest of `(100 - duty) / duty` times as long, after what is still owed.
    fn record_busy_time(&mut self, began_ns: TimeNs, ended_ns: TimeNs) {
        let (took_ns, duty) = ((ended_ns - began_ns).max(0), i64::from(self.duty_pct));
        let owed_ns = (self.rested_ns.saturating_sub(began_ns)).clamp(0, OWED_NS);
        self.rested_ns = ended_ns + owed_ns + took_ns.min(60 * adapter_core::clock::SECOND_NS) * (100 - duty) / duty;
    }

    fn update_support(&mut self, questions: &[Question], results: &[FocasItemResult]) {
        let missing = |result: &FocasItemResult| match result {
            Err(FocasItemError::Refused(refusal)) => refusal.code.consequence() == Consequence::NotSupported,
            Err(FocasItemError::NotOffered) => true,
            _ => false,
        };
        for (question, result) in questions.iter().zip(results) {
            match result {
                Err(FocasItemError::Refused(refusal)) => drop(self.refusals.insert(*question, *refusal)),
                _ => drop(self.refusals.remove(question)),
            }
        }
        let absent = questions.iter().zip(results).filter(|(_, result)| missing(result));
        self.unsupported.extend(absent.map(|(question, _)| *question));
    }

    fn ensure_connection(&mut self, clock: &dyn Clock) -> Result<Arc<Facts>, SourceError> {
        if let (Some(_), Some(facts)) = (&self.focas, &self.facts) {
            return Ok(facts.clone());
        }
        let focas = (self.connect)().map_err(|error| self.not_opened(&error, clock.now_ns()))?;
        let opening = *focas.opening();
        self.paths_exist(&opening)?;
        self.focas = Some(focas);
        self.unsupported.clear();
        self.refusals.clear();
        let (own, further) = self.paths.clone();
        let paths: Vec<u8> = std::iter::once(own).chain(further).collect();
        let facts = Arc::new(Facts::from_opening(opening, &paths));
        let open: Vec<Question> = facts.open.iter().map(|(question, _)| *question).collect();
        let (_, found) = self.ask_round(clock, &open)?;
        let facts = self.learn_facts(&open, &found, facts);
        self.counts.connections += 1;
        self.lost_ns = None;
        self.known = true;
        Ok(facts)
    }

    /// A control that says how many paths it has must have all that are named.
    fn paths_exist(&self, opening: &Opening) -> Result<(), SourceError> {
        let greatest = self.paths.1.iter().copied().max().unwrap_or(0);
        if opening.paths == 0 || u16::from(greatest) <= opening.paths {
            return Ok(());
        }
        Err(SourceError::Refused {
            source_name: self.name.clone(),
            request: format!("path {greatest}"),
            what: format!("the controller has {} path(s)", opening.paths),
            next: "Correct paths= in the address".to_owned(),
        })
    }

    fn write(&mut self, clock: &dyn Clock, write: &Write) -> Result<(), SourceError> {
        let what = super::allow_list::format_address(write);
        if let Err(error) = self.allow.check_write(write) {
            return Err(self.build_error(&error, &what));
        }
        self.ensure_connection(clock)?;
        let began_ns = clock.now_ns();
        let outcome = match &mut self.focas {
            Some(focas) => focas.write(write),
            None => Err(FocasError::Broken("there is no connection".to_owned())),
        };
        self.record_busy_time(began_ns, clock.now_ns());
        match outcome {
            Ok(()) => Ok(()),
            Err(error @ FocasError::Refused(refusal)) if refusal.code.consequence() != Consequence::Reconnect => {
                Err(self.build_error(&error, &format!("writing {what}")))
            }
            Err(error) => Err(self.drop_connection(&error, &format!("writing {what}"), clock.now_ns())),
        }
    }

    /// The connection is of no use any more.
    fn drop_connection(&mut self, error: &FocasError, request: &str, now_ns: TimeNs) -> SourceError {
        self.focas = None;
        self.facts = None;
        self.counts.broken += 1;
        self.lost_ns.get_or_insert(now_ns);
        self.build_error(error, request)
    }

    /// No connection could be opened.
    fn not_opened(&mut self, error: &FocasError, now_ns: TimeNs) -> SourceError {
        self.counts.refused += 1;
        let lost_ns = *self.lost_ns.get_or_insert(now_ns);
        // Silence is no evidence: a control that cannot be reached, or that accepts and says nothing, may be cutting.
        let off = match error {
            FocasError::NobodyThere(_) => now_ns - lost_ns < STARTING_NS,
            _ => false,
        };
        if off && self.known {
            return SourceError::Off { source_name: self.name.clone() };
        }
        let next = match error {
            FocasError::Timeout(_) | FocasError::Broken(_) if !self.known => NEVER_OPENED.to_owned(),
            _ => error.next(),
        };
        build_source_error(&self.name, error, "the opening of a connection", next)
    }

    fn build_error(&self, error: &FocasError, request: &str) -> SourceError {
        source_error(&self.name, error, request)
    }
}

/// A failure in the words of every driver.
#[must_use]
pub fn source_error(name: &str, error: &FocasError, request: &str) -> SourceError {
    build_source_error(name, error, request, error.next())
}

fn build_source_error(name: &str, error: &FocasError, request: &str, next: String) -> SourceError {
    let (source_name, request, what) = (name.to_owned(), request.to_owned(), error.to_string());
    match error {
        FocasError::Timeout(waited) => {
            SourceError::Timeout { source_name, request, deadline_ms: saturate_to_ms(*waited), next }
        }
        FocasError::Cut { waited: Some(waited), .. } => SourceError::Timeout {
            source_name,
            request: format!("{request} ({what})"),
            deadline_ms: saturate_to_ms(*waited),
            next,
        },
        FocasError::Protocol(_) => SourceError::Decode { source_name, request, what: format!("{what}. {next}") },
        FocasError::NoSession | FocasError::Refused(_) | FocasError::NotAllowed(_) => {
            SourceError::Refused { source_name, request, what, next }
        }
        _ => SourceError::Line { source_name, what, next },
    }
}
