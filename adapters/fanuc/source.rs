//! The groups of a controller as sources.

use super::details;
use super::extra::{Extra, append_extra_readings};
use super::facts::Facts;
use super::item::{FocasItem, Question};
use super::line::{Asked, FanucLine};
use super::manner::Manner;
use super::poll;
use super::poll_period::{GroupPace, SharedPace};
use super::readings::{self, FastColumn};
use crate::address::FanucOptions;
use adapter_core::channel::{ChannelId, on_path};
use adapter_core::clock::Clock;
use adapter_core::driver::{Fact, Source, SourceError, SourceProblem};
use adapter_core::integer::widen_to_u64;
use adapter_core::reading::{Absence, Reading};
use adapter_core::text::TextEncoding;
use std::sync::Arc;
use std::time::Duration;

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
    /// Each path with the channels of the fast group; the slow group has none here.
    paths: Vec<(Manner, Vec<FastColumn>)>,
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
    pub fn with_fast_group(
        name: &str,
        line: FanucLine,
        manner: Manner,
        options: &FanucOptions,
        shared: &SharedPace,
        extras: Vec<Extra>,
    ) -> Self {
        let power = manner.power_diagnosis;
        // Whatever its number, the path that is written to has the plain names.
        let own = readings::list_columns(None, power.is_some());
        let further =
            options.further.iter().map(|path| (manner.of_further(*path), readings::list_columns(Some(*path), false)));
        let paths: Vec<_> = std::iter::once((manner, own)).chain(further).collect();
        let mut questions = poll::list_fast_questions(manner.path);
        questions.extend(power.map(|number| poll::build_power_item(number).to_question(manner.path)));
        questions.extend(manner.dial.map(|dial| FocasItem::Pmc(dial.to_stretch()).to_question(manner.path)));
        questions.extend(options.further.iter().flat_map(|path| poll::list_further_questions(*path)));
        add(&mut questions, &extras);
        let own = paths.iter().flat_map(|(_, columns)| columns.iter().map(|column| column.channel));
        let channels = own.chain(extras.iter().map(|extra| extra.channel)).collect();
        let (name, pace) = (name.to_owned(), shared.add_group(options.period));
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
    pub fn with_slow_group(
        name: &str,
        line: FanucLine,
        manner: Manner,
        options: &FanucOptions,
        shared: &SharedPace,
        extras: Vec<Extra>,
    ) -> Self {
        let joint = if name.contains('?') { '&' } else { '?' };
        let mut channels = details::list_channels(options.details);
        channels.extend(extras.iter().map(|extra| extra.channel));
        let mut questions = details::list_questions(manner.path, options.details);
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
            pace: shared.add_group(options.slow),
            facts: None,
            encoding: options.encoding,
            warning: None,
        }
    }

    /// The alarms of the paths that say that they have some; one more frame.
    fn ask_alarms(&self, clock: &dyn Clock, asked: &Asked) -> Result<Option<Asked>, SourceError> {
        let paths = self.paths.iter().map(|(manner, _)| manner.path);
        let questions: Vec<Question> =
            paths.filter(|path| readings::has_alarm(asked, *path)).map(|path| poll::ALARMS.to_question(path)).collect();
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
        self.pace.wanted_period()
    }

    fn achievable_period(&self) -> Duration {
        self.pace.period()
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let asked = self.line.ask_on(clock, &self.questions)?;
        self.facts = Some(asked.facts.clone());
        if self.group == PolledGroup::Slow {
            let further = details::list_further_questions(&asked);
            let further = if further.is_empty() { None } else { Some(self.line.ask_on(clock, &further)?) };
            self.pace.record_busy_time(
                compute_busy_time(&asked) + further.as_ref().map(compute_busy_time).unwrap_or_default(),
            );
            details::append_readings(&asked, further.as_ref(), self.details, out);
            append_extra_readings(&self.extras, &asked, self.encoding, out);
            return Ok(());
        }
        let alarms = self.ask_alarms(clock, &asked)?;
        self.pace
            .record_busy_time(compute_busy_time(&asked) + alarms.as_ref().map_or(Duration::ZERO, compute_busy_time));
        self.warning = readings::describe_warning(&asked, asked.path);
        for (manner, columns) in &self.paths {
            readings::append_fast_readings(columns, &asked, alarms.as_ref(), *manner, out);
        }
        append_extra_readings(&self.extras, &asked, self.encoding, out);
        Ok(())
    }

    fn collect_facts(&self) -> Vec<Fact> {
        let paced = collect_pace_facts(&self.pace, self.group);
        match (&self.facts, self.group) {
            (Some(facts), PolledGroup::Fast) => collect_identity_facts(facts, self.line.path())
                .into_iter()
                .chain(collect_line_facts(&self.line))
                .chain(paced)
                .collect(),
            (Some(_), PolledGroup::Slow) => paced.collect(),
            (None, _) => Vec::new(),
        }
    }

    fn list_problems(&self) -> Vec<SourceProblem> {
        let essential = self.group == PolledGroup::Fast;
        let refusals = self.line.list_refusals(&self.questions);
        let mut problems = super::refusals::list_problems(&refusals, self.questions.len(), essential);
        problems.extend(self.warning.iter().map(|(warning, next)| SourceProblem {
            what: format!("the control warns: {warning}"),
            next: (*next).to_owned(),
        }));
        problems
    }
}

/// The channels that a control delivers by itself, of the path with the plain names.
#[must_use]
pub fn list_delivered(options: &FanucOptions) -> Vec<ChannelId> {
    let columns = readings::list_columns(None, options.power_diagnosis.is_some());
    let mut channels: Vec<ChannelId> = columns.into_iter().map(|column| column.channel).collect();
    channels.extend(details::list_channels(options.details));
    channels
}

/// How long the control was busy with these questions.
fn compute_busy_time(asked: &Asked) -> Duration {
    Duration::from_nanos((asked.ended_ns - asked.began_ns).max(0).unsigned_abs())
}

/// How long the control takes to answer a group, and the period that it can therefore keep.
fn collect_pace_facts(pace: &GroupPace, group: PolledGroup) -> impl Iterator<Item = Fact> {
    let word = match group {
        PolledGroup::Fast => "fast",
        PolledGroup::Slow => "slow",
    };
    let ms = |name: &str, time: Duration| {
        Fact::from_number(format!("{word}_group_{name}_ms"), (time.as_secs_f64() * 1e4).round() / 10.0)
    };
    let (wanted, period) = (pace.wanted_period(), pace.period());
    let answered = pace.busy_time().map(|busy| ms("answer", busy));
    answered.into_iter().chain([ms("period", period), ms("period_wanted", wanted)])
}

/// What further channels need, each question once.
fn add(questions: &mut Vec<Question>, extras: &[Extra]) {
    for question in extras.iter().flat_map(Extra::list_questions) {
        if !questions.contains(&question) {
            questions.push(question);
        }
    }
}

/// In the place of a fact.
fn not_told(reason: Absence) -> String {
    format!("not told ({})", reason.as_word())
}

/// Who answers. The path `own` has the plain names.
fn collect_identity_facts(facts: &Facts, own: u8) -> Vec<Fact> {
    let opening = &facts.opening;
    let mut known = vec![Fact::from_text("make", "FANUC")];
    if let Some(system) = &facts.system {
        known.push(Fact::from_text("control", format!("{}-{}", system.kind, system.machine)));
        known.push(Fact::from_text("series", system.series.clone()));
        known.push(Fact::from_text("version", system.version.clone()));
    }
    known.push(Fact::from_text("generation", opening.generation.version().to_string()));
    if opening.paths > 1 {
        known.push(Fact::from_number("paths", f64::from(opening.paths)));
    }
    for (path, axes) in facts.list_axes() {
        let name = if path == own { "axes".to_owned() } else { on_path("axes", path) };
        known.push(Fact::from_text(name, axes.map_or_else(not_told, |axes| axes.join(" "))));
    }
    let unit = facts.inch.map_or_else(not_told, |inch| if inch { "inch" } else { "mm" }.to_owned());
    known.push(Fact::from_text("unit", unit));
    if !facts.open.is_empty() {
        let open = facts.open.iter().map(|(question, why)| format!("{:?}: {why}", question.item));
        known.push(Fact::from_text("not_answered_yet", open.collect::<Vec<_>>().join("; ")));
    }
    known
}

/// How the line has been doing.
fn collect_line_facts(line: &FanucLine) -> Vec<Fact> {
    #[expect(clippy::cast_precision_loss, reason = "a count that is shown")]
    let count = |name, count: u64| Fact::from_number(name, count as f64);
    let (counts, unsupported) = (line.counts(), line.list_unsupported().len());
    vec![
        count("connections", counts.connections),
        count("connections_broken", counts.broken),
        count("connections_refused", counts.refused),
        count("items_not_supported", widen_to_u64(unsupported)),
    ]
}
