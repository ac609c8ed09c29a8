//! The groups of a controller as sources.

use super::line::{Facts, Line};
use super::poll;
use super::readings::{self, Manner};
use crate::address::FanucOptions;
use crate::channel::ChannelId;
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

/// One group of a controller.
pub struct FanucSource {
    name: String,
    line: Line,
    group: Group,
    manner: Manner,
    items: Vec<super::item::Item>,
    channels: Vec<ChannelId>,
    period: Duration,
    facts: Option<Arc<Facts>>,
}

impl FanucSource {
    /// What changes quickly: motion, loads, states, program. One frame per poll, and a second one while there is an
    /// alarm.
    #[must_use]
    pub fn fast(name: &str, line: Line, manner: Manner, options: &FanucOptions) -> Self {
        let power = manner.power_diagnosis;
        let names = readings::FAST.into_iter().chain([readings::OPERATION]).chain(power.map(|_| readings::POWER));
        let mut items = poll::fast(manner.path);
        items.extend(power.map(poll::power));
        Self {
            name: name.to_owned(),
            line,
            group: Group::Fast,
            manner,
            items,
            channels: readings::ids(names),
            period: options.period,
            facts: None,
        }
    }

    /// What changes slowly and holds in between: parts, gear stage.
    #[must_use]
    pub fn slow(name: &str, line: Line, manner: Manner, options: &FanucOptions) -> Self {
        let joint = if name.contains('?') { '&' } else { '?' };
        Self {
            name: format!("{name}{joint}group=slow"),
            line,
            group: Group::Slow,
            manner,
            items: poll::slow(),
            channels: readings::ids(readings::SLOW),
            period: options.slow,
            facts: None,
        }
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
        self.period
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let asked = self.line.ask(clock, &self.items)?;
        self.facts = Some(asked.facts.clone());
        if self.group == Group::Slow {
            readings::slow(&self.channels, &asked, out);
            return Ok(());
        }
        let alarmed = readings::alarmed(&asked);
        let alarms = if alarmed { Some(self.line.ask(clock, &[poll::ALARMS])?) } else { None };
        readings::fast(&self.channels, &asked, alarms.as_ref(), self.manner, out);
        Ok(())
    }

    fn facts(&self) -> Vec<Fact> {
        match (&self.facts, self.group) {
            (Some(facts), Group::Fast) => identity(facts).into_iter().chain(experience(&self.line)).collect(),
            _ => Vec::new(),
        }
    }
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
    known.push(Fact::text("axes", facts.axes.join(" ")));
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
