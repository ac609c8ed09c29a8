//! The groups of a controller as sources.

use super::details;
use super::extra::Extra;
use super::facts::Facts;
use super::item::{FocasItem, Question};
use super::line::{Asked, FanucLine};
use super::pace::{GroupPace, SharedPace};
use super::poll;
use super::readings::{self, Manner};
use crate::address::FanucOptions;
use crate::channel::{ChannelId, on_path};
use crate::clock::Clock;
use crate::driver::{Fact, Source, SourceError, SourceProblem};
use crate::reading::{Absence, Reading};
use crate::text::TextEncoding;
use std::sync::Arc;
use std::time::Duration;

/// Which group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PolledGroup {
    Fast,
    Slow,
}

/// One group of a controller, of all paths that are read.
pub struct FanucSource {
    name: String,
    line: FanucLine,
    group: PolledGroup,
    questions: Vec<Question>,
    /// Each path with its channels at the places of [`readings::columns`]; the slow group has them in its order.
    paths: Vec<(Manner, Vec<Option<ChannelId>>)>,
    channels: Vec<ChannelId>,
    /// Channels that the address and the configuration add to this group.
    extras: Vec<Extra>,
    /// Does the slow group read more than parts and gear stage?
    details: bool,
    pace: GroupPace,
    facts: Option<Arc<Facts>>,
    /// Character set of texts that the user has read.
    encoding: TextEncoding,
    /// Warning of the last poll, with what to do.
    warning: Option<(String, &'static str)>,
}

impl FanucSource {
    /// What changes quickly: motion, loads, states, program. One frame per poll where it holds all paths, and another
    /// one while there is an alarm.
    #[must_use]
    pub fn fast(
        name: &str,
        line: FanucLine,
        manner: Manner,
        options: &FanucOptions,
        shared: &SharedPace,
        extras: Vec<Extra>,
    ) -> Self {
        let power = manner.power_diagnosis;
        // Whatever its number, the path that is written to has the plain names.
        let own = readings::columns(None, power.map(|_| readings::POWER));
        let further = options.further.iter().map(|path| (manner.of_further(*path), readings::columns(Some(*path), [])));
        let paths: Vec<_> = std::iter::once((manner, own)).chain(further).collect();
        let mut questions = poll::fast(manner.path);
        questions.extend(power.map(|number| poll::power(number).on(manner.path)));
        questions.extend(manner.dial.map(|dial| FocasItem::Pmc(dial.stretch()).on(manner.path)));
        questions.extend(options.further.iter().flat_map(|path| poll::further(*path)));
        add(&mut questions, &extras);
        let own = paths.iter().flat_map(|(_, columns)| columns.iter().copied().flatten());
        let channels = own.chain(extras.iter().map(|extra| extra.channel)).collect();
        let (name, pace) = (name.to_owned(), shared.group(options.period));
        Self {
            name,
            line,
            group: PolledGroup::Fast,
            questions,
            paths,
            channels,
            extras,
            details: false,
            pace,
            facts: None,
            encoding: options.encoding,
            warning: None,
        }
    }

    /// What changes slowly and holds in between: parts, times, texts, codes. Of the first path only.
    #[must_use]
    pub fn slow(
        name: &str,
        line: FanucLine,
        manner: Manner,
        options: &FanucOptions,
        shared: &SharedPace,
        extras: Vec<Extra>,
    ) -> Self {
        let joint = if name.contains('?') { '&' } else { '?' };
        let mut channels = details::channels(options.details);
        channels.extend(extras.iter().map(|extra| extra.channel));
        let mut questions = details::questions(manner.path, options.details);
        add(&mut questions, &extras);
        Self {
            name: format!("{name}{joint}group=slow"),
            line,
            group: PolledGroup::Slow,
            questions,
            paths: Vec::new(),
            channels,
            extras,
            details: options.details,
            pace: shared.group(options.slow),
            facts: None,
            encoding: options.encoding,
            warning: None,
        }
    }

    /// The alarms of the paths that say that they have some; one more frame.
    fn alarms(&self, clock: &dyn Clock, asked: &Asked) -> Result<Option<Asked>, SourceError> {
        let paths = self.paths.iter().map(|(manner, _)| manner.path);
        let questions: Vec<Question> =
            paths.filter(|path| readings::alarmed(asked, *path)).map(|path| poll::ALARMS.on(path)).collect();
        if questions.is_empty() { Ok(None) } else { self.line.ask_on(clock, &questions).map(Some) }
    }
}

impl Source for FanucSource {
    fn name(&self) -> &str {
        &self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.pace.wanted()
    }

    fn pace(&self) -> Duration {
        self.pace.period()
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let asked = self.line.ask_on(clock, &self.questions)?;
        self.facts = Some(asked.facts.clone());
        if self.group == PolledGroup::Slow {
            let further = details::further(&asked);
            let further = if further.is_empty() { None } else { Some(self.line.ask_on(clock, &further)?) };
            self.pace.took(busy(&asked) + further.as_ref().map(busy).unwrap_or_default());
            details::readings(&asked, further.as_ref(), self.details, out);
            readings::extra(&self.extras, &asked, self.encoding, out);
            return Ok(());
        }
        let alarms = self.alarms(clock, &asked)?;
        self.pace.took(busy(&asked) + alarms.as_ref().map_or(Duration::ZERO, busy));
        self.warning = readings::warning(&asked, asked.path);
        for (manner, columns) in &self.paths {
            readings::fast(columns, &asked, alarms.as_ref(), *manner, out);
        }
        readings::extra(&self.extras, &asked, self.encoding, out);
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        let paced = paced(&self.pace, self.group);
        match (&self.facts, self.group) {
            (Some(facts), PolledGroup::Fast) => {
                identity(facts, self.line.path()).into_iter().chain(experience(&self.line)).chain(paced).collect()
            }
            (Some(_), PolledGroup::Slow) => paced.collect(),
            (None, _) => Vec::new(),
        }
    }

    fn problems(&self) -> Vec<SourceProblem> {
        let essential = self.group == PolledGroup::Fast;
        let refusals = self.line.refusals(&self.questions);
        let mut problems = super::refusals::problems(&refusals, self.questions.len(), essential);
        problems.extend(self.warning.iter().map(|(warning, next)| SourceProblem {
            what: format!("the control warns: {warning}"),
            next: (*next).to_owned(),
        }));
        problems
    }
}

/// The channels that a control delivers by itself, of the path with the plain names.
#[must_use]
pub fn delivered(options: &FanucOptions) -> Vec<ChannelId> {
    let power = options.power_diagnosis.map(|_| readings::POWER);
    let mut channels: Vec<ChannelId> = readings::columns(None, power).into_iter().flatten().collect();
    channels.extend(details::channels(options.details));
    channels
}

/// How long the control was busy with these questions.
fn busy(asked: &Asked) -> Duration {
    Duration::from_nanos((asked.ended_ns - asked.began_ns).max(0).unsigned_abs())
}

/// How long the control takes to answer a group, and the period that it can therefore keep.
fn paced(pace: &GroupPace, group: PolledGroup) -> impl Iterator<Item = Fact> {
    let word = match group {
        PolledGroup::Fast => "fast",
        PolledGroup::Slow => "slow",
    };
    let ms = |name: &str, time: Duration| {
        Fact::number(format!("{word}_group_{name}_ms"), (time.as_secs_f64() * 1e4).round() / 10.0)
    };
    let (wanted, period) = (pace.wanted(), pace.period());
    let answered = pace.busy().map(|busy| ms("answer", busy));
    answered.into_iter().chain([ms("period", period), ms("period_wanted", wanted)])
}

/// What further channels need, each question once.
fn add(questions: &mut Vec<Question>, extras: &[Extra]) {
    for question in extras.iter().flat_map(Extra::questions) {
        if !questions.contains(&question) {
            questions.push(question);
        }
    }
}

/// In the place of a fact.
fn not_told(reason: Absence) -> String {
    format!("not told ({})", reason.word())
}

/// Who answers. The path `own` has the plain names.
fn identity(facts: &Facts, own: u8) -> Vec<Fact> {
    let opening = &facts.opening;
    let mut known = vec![Fact::text("make", "FANUC")];
    if let Some(system) = &facts.system {
        known.push(Fact::text("control", format!("{}-{}", system.kind, system.machine)));
        known.push(Fact::text("series", system.series.clone()));
        known.push(Fact::text("version", system.version.clone()));
    }
    known.push(Fact::text("generation", opening.generation.version().to_string()));
    if opening.paths > 1 {
        known.push(Fact::number("paths", f64::from(opening.paths)));
    }
    for (path, axes) in facts.axes() {
        let name = if path == own { "axes".to_owned() } else { on_path("axes", path) };
        known.push(Fact::text(name, axes.map_or_else(not_told, |axes| axes.join(" "))));
    }
    let unit = facts.inch.map_or_else(not_told, |inch| if inch { "inch" } else { "mm" }.to_owned());
    known.push(Fact::text("unit", unit));
    if !facts.open.is_empty() {
        let open = facts.open.iter().map(|(question, why)| format!("{:?}: {why}", question.item));
        known.push(Fact::text("not_answered_yet", open.collect::<Vec<_>>().join("; ")));
    }
    known
}

/// How the line has been doing.
fn experience(line: &FanucLine) -> Vec<Fact> {
    #[expect(clippy::cast_precision_loss, reason = "a count that is shown")]
    let count = |name, count: u64| Fact::number(name, count as f64);
    let (counts, unsupported) = (line.counts(), line.unsupported().len());
    vec![
        count("connections", counts.connections),
        count("connections_broken", counts.broken),
        count("connections_refused", counts.refused),
        count("items_not_supported", u64::try_from(unsupported).unwrap_or(u64::MAX)),
    ]
}
