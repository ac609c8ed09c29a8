//! The groups of a controller as sources.

use super::line::{Facts, Line};
use super::poll;
use super::readings::{self, Manner};
use crate::address::FanucOptions;
use crate::channel::ChannelId;
use crate::clock::Clock;
use crate::driver::{Source, SourceError};
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
        Self::of(name.to_owned(), line, Group::Fast, manner, items, readings::ids(names), options.period)
    }

    /// What changes slowly: parts, temperature of the spindle motor, gear stage.
    #[must_use]
    pub fn slow(name: &str, line: Line, manner: Manner, options: &FanucOptions) -> Self {
        let joint = if name.contains('?') { '&' } else { '?' };
        let name = format!("{name}{joint}group=slow");
        Self::of(name, line, Group::Slow, manner, poll::slow(), readings::ids(readings::SLOW), options.slow)
    }

    fn of(
        name: String,
        line: Line,
        group: Group,
        manner: Manner,
        items: Vec<super::item::Item>,
        channels: Vec<ChannelId>,
        period: Duration,
    ) -> Self {
        Self { name, line, group, manner, items, channels, period, facts: None }
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

    fn identity(&self) -> Vec<(&'static str, String)> {
        self.facts.as_ref().filter(|_| self.group == Group::Fast).map_or_else(Vec::new, |facts| identity(facts))
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
}

fn identity(facts: &Facts) -> Vec<(&'static str, String)> {
    let opening = &facts.opening;
    let mut known = vec![("make", "FANUC".to_owned())];
    if let Some(system) = &facts.system {
        known.push(("control", format!("{}-{}", system.kind, system.machine)));
        known.push(("series", system.series.clone()));
        known.push(("version", system.version.clone()));
    }
    known.push(("generation", opening.generation.version().to_string()));
    known.push(("paths", opening.paths.to_string()));
    known.push(("axes", facts.axes.join(" ")));
    known.push(("spindles", opening.spindles.to_string()));
    known.push(("unit", if facts.inch { "inch" } else { "mm" }.to_owned()));
    known
}
