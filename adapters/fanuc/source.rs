//! The groups of a controller as sources.

use super::item::{Item, Question};
use super::line::{Asked, Facts, Line};
use super::pace::{GroupPace, SharedPace};
use super::poll;
use super::readings::{self, Manner};
use crate::address::FanucOptions;
use crate::channel::{ChannelId, on_path};
use crate::clock::Clock;
use crate::driver::{Fact, Source, SourceError};
use crate::reading::Reading;
use std::sync::Arc;
use std::time::Duration;

/// Which group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Group {
    Fast,
    Slow,
}

/// One group of a controller, of all paths that are read.
pub struct FanucSource {
    name: String,
    line: Line,
    group: Group,
    questions: Vec<Question>,
    /// Each path with its channels at the places of [`readings::columns`]; the slow group has them in its order.
    paths: Vec<(Manner, Vec<Option<ChannelId>>)>,
    channels: Vec<ChannelId>,
    pace: GroupPace,
    facts: Option<Arc<Facts>>,
}

impl FanucSource {
    /// What changes quickly: motion, loads, states, program. One frame per poll where it holds all paths, and another
    /// one while there is an alarm.
    #[must_use]
    pub fn fast(name: &str, line: Line, manner: Manner, options: &FanucOptions, shared: &SharedPace) -> Self {
        let power = manner.power_diagnosis;
        // Whatever its number, the path that is written to has the plain names.
        let own = readings::columns(None, power.map(|_| readings::POWER));
        let further = options.further.iter().map(|path| (manner.of_further(*path), readings::columns(Some(*path), [])));
        let paths: Vec<_> = std::iter::once((manner, own)).chain(further).collect();
        let mut questions = poll::fast(manner.path);
        questions.extend(power.map(|number| poll::power(number).on(manner.path)));
        questions.extend(manner.dial.map(|dial| Item::Pmc(dial.stretch()).on(manner.path)));
        questions.extend(options.further.iter().flat_map(|path| poll::further(*path)));
        let channels = paths.iter().flat_map(|(_, columns)| columns.iter().copied().flatten()).collect();
        let (name, pace) = (name.to_owned(), shared.group(options.period));
        Self { name, line, group: Group::Fast, questions, paths, channels, pace, facts: None }
    }

    /// What changes slowly and holds in between: parts, gear stage. Of the first path only.
    #[must_use]
    pub fn slow(name: &str, line: Line, manner: Manner, options: &FanucOptions, shared: &SharedPace) -> Self {
        let joint = if name.contains('?') { '&' } else { '?' };
        let channels = readings::ids(readings::SLOW);
        Self {
            name: format!("{name}{joint}group=slow"),
            line,
            group: Group::Slow,
            questions: poll::slow(manner.path),
            paths: Vec::new(),
            channels,
            pace: shared.group(options.slow),
            facts: None,
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
        if self.group == Group::Slow {
            self.pace.took(busy(&asked));
            readings::slow(&self.channels, &asked, out);
            return Ok(());
        }
        let alarms = self.alarms(clock, &asked)?;
        self.pace.took(busy(&asked) + alarms.as_ref().map_or(Duration::ZERO, busy));
        for (manner, columns) in &self.paths {
            readings::fast(columns, &asked, alarms.as_ref(), *manner, out);
        }
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        let paced = paced(&self.pace, self.group);
        match (&self.facts, self.group) {
            (Some(facts), Group::Fast) => {
                identity(facts).into_iter().chain(experience(&self.line)).chain(paced).collect()
            }
            (Some(_), Group::Slow) => paced.collect(),
            (None, _) => Vec::new(),
        }
    }
}

/// How long the control was busy with these questions.
fn busy(asked: &Asked) -> Duration {
    Duration::from_nanos((asked.ended_ns - asked.began_ns).max(0).unsigned_abs())
}

/// How long the control takes to answer a group, and the period that it can therefore keep.
fn paced(pace: &GroupPace, group: Group) -> impl Iterator<Item = Fact> {
    let word = match group {
        Group::Fast => "fast",
        Group::Slow => "slow",
    };
    let ms = |name: &str, time: Duration| {
        Fact::number(format!("{word}_group_{name}_ms"), (time.as_secs_f64() * 1e4).round() / 10.0)
    };
    let (wanted, period) = (pace.wanted(), pace.period());
    let answered = pace.busy().map(|busy| ms("answer", busy));
    answered.into_iter().chain([ms("period", period), ms("period_wanted", wanted)])
}

/// Who answers.
fn identity(facts: &Facts) -> Vec<Fact> {
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
    known.push(Fact::text("axes", facts.axes.join(" ")));
    known.extend(facts.further.iter().map(|(path, axes)| Fact::text(on_path("axes", *path), axes.join(" "))));
    known.push(Fact::text("unit", if facts.inch { "inch" } else { "mm" }));
    known
}

/// How the line has been doing.
fn experience(line: &Line) -> Vec<Fact> {
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
