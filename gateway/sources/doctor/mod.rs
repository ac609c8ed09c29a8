//! One address examined: opened, named, read twice, timed, and everything that is wrong told with what to do next.
//! Contract: sources of the project, section on `doctor`.

mod compare;
mod computer;

pub use compare::{ChannelDifference, Comparison, compare_backends};
pub use computer::{ComputerReport, SystemFiles, examine_computer};

use crate::open::open_source;
use adapters::address::AddressError;
use adapters::channel::quantity::space_unit;
use adapters::clock::{Clock, SystemClock};
use adapters::driver::{Fact, FactValue};
use adapters::open::OpenError;
use adapters::plausibility::Plausibility;
use adapters::{Absence, Address, ChannelId, Offer, Reading, Source, SourceError, Value};
use serde_json::{Map, json};
use std::fmt;
use std::time::Instant;

/// Something that is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trouble {
    /// What happened, and where.
    pub what: String,
    /// What to do next.
    pub next: String,
}

/// A value with its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct ValueWithUnit(ChannelId, Value);

impl fmt::Display for ValueWithUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.1 {
            // Seven digits are what a meter's single-precision numbers hold.
            Value::Number(number) => {
                let rounded = format!("{number:.6e}").parse().unwrap_or(*number);
                write!(f, "{rounded}{}", space_unit(self.0.channel().unit))
            }
            Value::Text(text) => write!(f, "{text:?}"),
        }
    }
}

/// Who answers at an address, what the channels say, and what is wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct DoctorReport {
    /// The address in the form in which it was given.
    pub address: String,
    /// Whether anything answered at the address.
    pub reachable: bool,
    /// What the device says of itself; empty where nothing answered.
    pub identity: Vec<Fact>,
    /// What the channels say, in the order of the sources.
    pub readings: Vec<(ChannelId, Result<ValueWithUnit, Absence>)>,
    /// From nothing to the first values.
    pub open_ms: f64,
    /// Reading everything once on the open connection.
    pub read_ms: f64,
    /// What is wrong, each with what to do.
    pub problems: Vec<Trouble>,
    /// Everything that the device offers, where that was asked for; `None` where it was not.
    pub offers: Option<Vec<Offer>>,
}

/// Why nothing can be examined.
#[derive(Debug, thiserror::Error)]
pub enum ExamineError {
    /// What was typed is no address.
    #[error("{0}")]
    Address(AddressError),
    /// It cannot be opened.
    #[error("{0}")]
    Open(OpenError),
    /// There is nothing to compare: a FANUC controller that we talk to by ourselves is needed.
    #[error("{address}: give a fanuc:// address without backend=vendor to compare with a library")]
    NotNative {
        /// The address as typed.
        address: String,
    },
}

/// Examines an address, with the channels that a configuration adds to it. Takes as long as its sources' own deadlines at most.
///
/// # Errors
/// It cannot be opened, in words.
pub fn examine_address(address: &Address) -> Result<DoctorReport, ExamineError> {
    begin_at(address, &SystemClock::new()).map(|(report, _)| report)
}

/// Examines what somebody has typed.
///
/// # Errors
/// It is no address, or cannot be opened, in words.
pub fn examine_text(address: &str) -> Result<DoctorReport, ExamineError> {
    let address: Address = address.parse().map_err(ExamineError::Address)?;
    examine_address(&address)
}

/// The same, and asks for everything that the device offers, mapped to a channel or not.
///
/// # Errors
/// It cannot be opened, in words.
pub fn examine_all(address: &Address) -> Result<DoctorReport, ExamineError> {
    let clock = SystemClock::new();
    let (mut report, mut sources) = begin_at(address, &clock)?;
    let mut offers = Vec::new();
    for source in &mut sources {
        match source.list_offers(&clock) {
            Ok(found) => offers.extend(found),
            Err(error) => report.record_failure(&error),
        }
    }
    report.offers = Some(offers);
    Ok(report)
}

/// Examines an address and leaves open what works.
fn begin_examination(text: &str, clock: &SystemClock) -> Result<(DoctorReport, Vec<Box<dyn Source>>), ExamineError> {
    let address: Address = text.parse().map_err(ExamineError::Address)?;
    begin_at(&address, clock)
}

fn begin_at(address: &Address, clock: &SystemClock) -> Result<(DoctorReport, Vec<Box<dyn Source>>), ExamineError> {
    let began = Instant::now();
    let opened = open_source(address, clock.now_ns()).map_err(ExamineError::Open)?;
    let mut report = DoctorReport {
        address: address.text().to_owned(),
        reachable: false,
        identity: Vec::new(),
        readings: Vec::new(),
        open_ms: 0.0,
        read_ms: 0.0,
        problems: Vec::new(),
        offers: None,
    };
    let mut sources = opened.sources;
    sources.retain_mut(|source| report.read_first(source.as_mut(), clock));
    report.open_ms = elapsed_ms(began);
    let began = Instant::now();
    sources.iter_mut().for_each(|source| report.read_again(source.as_mut(), clock));
    report.read_ms = elapsed_ms(began);
    Ok((report, sources))
}

fn elapsed_ms(since: Instant) -> f64 {
    (since.elapsed().as_secs_f64() * 1e4).round() / 10.0
}

/// A device that needs so many times the wanted period is told; one late answer of a busy network is not.
const SLOW: f64 = 2.0;

impl DoctorReport {
    /// The first look at a source: does it work at all?
    fn read_first(&mut self, source: &mut dyn Source, clock: &dyn Clock) -> bool {
        let mut readings = Vec::new();
        match source.read(clock, &mut readings) {
            Ok(()) => {
                self.reachable = true;
                true
            }
            Err(error) => {
                self.record_failure(&error);
                false
            }
        }
    }

    /// The second look, whose values are shown.
    fn read_again(&mut self, source: &mut dyn Source, clock: &dyn Clock) {
        let mut readings = Vec::new();
        if let Err(error) = source.read(clock, &mut readings) {
            self.record_failure(&error);
        }
        self.check_pace(source);
        let named = source.query_identity().into_iter().map(|(name, value)| Fact::from_text(name, value));
        let new = |fact: &Fact| self.identity.iter().all(|known| known.name != fact.name);
        let fresh: Vec<Fact> = named.chain(source.collect_facts()).filter(new).collect();
        self.identity.extend(fresh);
        self.judge_readings(source, &readings);
        self.readings.extend(readings.into_iter().map(attach_unit));
    }

    /// What is wrong with a source that answers: what it says itself, what is not believed, and what has no value for a reason
    /// that neither of them has told; one sentence per reason.
    fn judge_readings(&mut self, source: &dyn Source, readings: &[Reading]) {
        let mut plausibility = Plausibility::default();
        plausibility.record_readings(readings);
        let own = source.list_problems();
        let told_refusals = !own.is_empty();
        for problem in own.into_iter().chain(plausibility.list_problems()) {
            self.add_trouble(Trouble { what: problem.what, next: problem.next });
        }
        for reason in [Absence::OutOfRange, Absence::Refused, Absence::Timeout] {
            let silent = |reading: &&Reading| reading.value == Err(reason) && reading.implausible.is_none();
            let names: Vec<&str> = readings.iter().filter(silent).map(|reading| reading.channel.name()).collect();
            let is_told = reason == Absence::Refused && told_refusals;
            if !names.is_empty() && !is_told {
                self.add_trouble(Trouble {
                    what: format!("no value ({reason}): {}", names.join(", ")),
                    next: next(reason),
                });
            }
        }
    }

    fn add_trouble(&mut self, trouble: Trouble) {
        if !self.problems.contains(&trouble) {
            self.problems.push(trouble);
        }
    }

    /// A device that answers too slowly for the period that is wanted.
    fn check_pace(&mut self, source: &dyn Source) {
        let (wanted_s, kept_s) = (source.period().as_secs_f64(), source.achievable_period().as_secs_f64());
        if kept_s > wanted_s * SLOW {
            let name = source.name();
            self.problems.push(Trouble {
                what: format!(
                    "{name} answers too slowly to be read every {wanted_s:.2} s; it will be read every {kept_s:.2} s, and its values \
                     will count as fresh for {:.2} s",
                    2.0 * kept_s
                ),
                next: "Nothing is lost by it. A quicker network board, a greater duty_pct= or a longer period_ms= in the \
                       address changes it"
                    .to_owned(),
            });
        }
    }

    fn record_failure(&mut self, error: &SourceError) {
        // A machine that refuses or answers nonsense is there all the same.
        self.reachable |= matches!(error, SourceError::Refused { .. } | SourceError::Decode { .. });
        self.add_trouble(trouble_from_error(error));
    }

    /// The report as the contract lays it out.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        let identity: Map<String, serde_json::Value> =
            self.identity.iter().map(|fact| (fact.name.clone(), fact_json(&fact.value))).collect();
        let reading = |(channel, value): &(ChannelId, Result<ValueWithUnit, Absence>)| match value {
            Ok(ValueWithUnit(_, Value::Number(number))) => {
                json!({"channel": channel.name(), "value": number, "unit": channel.channel().unit})
            }
            Ok(ValueWithUnit(_, Value::Text(text))) => json!({"channel": channel.name(), "value": &**text, "unit": ""}),
            Err(absence) => json!({"channel": channel.name(), "missing": absence.as_word()}),
        };
        let mut report = json!({
            "address": self.address,
            "reachable": self.reachable,
            "identity": identity,
            "readings": self.readings.iter().map(reading).collect::<Vec<_>>(),
            "timing": {"open_ms": self.open_ms, "read_ms": self.read_ms},
            "problems": self.problems.iter().map(|one| json!({"what": one.what, "next": one.next})).collect::<Vec<_>>(),
        });
        if let Some(offers) = &self.offers {
            report["offers"] = offers.iter().map(offer_json).collect();
        }
        report
    }
}

fn offer_json(offer: &Offer) -> serde_json::Value {
    let (key, text) = match &offer.says {
        Ok(text) => ("says", text),
        Err(text) => ("missing", text),
    };
    json!({"name": offer.name, key: text, "channel": offer.channel.map(ChannelId::name)})
}

fn fact_json(value: &FactValue) -> serde_json::Value {
    match value {
        FactValue::Number(number) => json!(number),
        FactValue::Text(text) => json!(text),
    }
}

fn attach_unit(reading: Reading) -> (ChannelId, Result<ValueWithUnit, Absence>) {
    (reading.channel, reading.value.map(|value| ValueWithUnit(reading.channel, value)))
}

fn next(absence: Absence) -> String {
    let next = match absence {
        Absence::OutOfRange => {
            "Compare with the machine's own screen; if that is right, report the address and both values"
        }
        Absence::Refused => "Try again; if it lasts, look what the state of the machine forbids",
        _ => "Try again; if it lasts, look at cable and switch",
    };
    next.to_owned()
}

fn trouble_from_error(error: &SourceError) -> Trouble {
    let (what, next) = match error {
        SourceError::Line { what, next, .. } => (what.clone(), next.clone()),
        SourceError::Timeout { request, deadline_ms, next, .. } => {
            (format!("no answer to {request} within {deadline_ms} ms"), next.clone())
        }
        SourceError::Refused { request, what, next, .. } => (format!("{request} refused: {what}"), next.clone()),
        SourceError::Decode { request, what, .. } => {
            (format!("the answer to {request} makes no sense: {what}"), "Is this the right device and port?".to_owned())
        }
        SourceError::Off { .. } => ("the machine is off".to_owned(), "Switch it on".to_owned()),
        SourceError::End { .. } => ("the recording is over".to_owned(), "Give a longer one".to_owned()),
    };
    Trouble { what, next }
}
