//! Lines of SHDR: a time, then names and values, with bars between. Pure.
//!
//! Source: MTConnect agent, "Adapter Agent Protocol" (SHDR): data items, conditions, assets, heartbeat.

use super::devices::uuid;
use super::model::{ALARMS, AVAILABILITY, UNAVAILABLE, of_channel};
use crate::history::{Alarm, Cell, Content, Item, Reading, Record};
use crate::moment;
use std::collections::{BTreeMap, BTreeSet};

/// What an agent that connects now must be told.
#[derive(Debug, Default)]
pub(super) struct Machine {
    name: String,
    at_utc: String,
    values: BTreeMap<&'static str, String>,
    /// Alarms that stand, by code.
    alarms: BTreeMap<String, Alarm>,
    tools: BTreeSet<String>,
}

impl Machine {
    pub(super) fn new(name: &str, latest: &[Reading], at_ns: i64) -> Self {
        let mut machine = Self { name: name.to_owned(), at_utc: moment::utc(at_ns), ..Self::default() };
        machine.take(latest);
        machine
    }

    /// Everything that an agent must know at the beginning.
    pub(super) fn greeting(&self) -> String {
        let at = &self.at_utc;
        let mut text = format!("* shdrVersion: 2.0\n{at}|{AVAILABILITY}|AVAILABLE\n");
        text += &line(at, self.values.iter().map(|(name, value)| (*name, value.as_str())));
        text += &format!("{at}|{ALARMS}|NORMAL||||\n");
        self.alarms.values().for_each(|alarm| text += &condition(alarm));
        self.tools.iter().for_each(|tool| text += &self.asset(tool));
        text
    }

    /// The lines of an item; empty where the standard has no counterpart.
    pub(super) fn lines(&mut self, item: &Item) -> String {
        self.at_utc = moment::utc(item.at_ns);
        match &item.content {
            Content::Sample(readings) => {
                let (changed, tool) = (self.take(readings), self.new_tool(readings));
                let values = changed.iter().map(|(name, value)| (*name, value.as_str()));
                let asset = tool.map(|tool| self.asset(&tool)).unwrap_or_default();
                [line(&self.at_utc, values), asset].concat()
            }
            Content::Record(record) => match &**record {
                Record::Alarm(alarm) => {
                    self.alarms.insert(alarm.code.clone(), alarm.clone());
                    condition(alarm)
                }
                Record::AlarmClear(clear) => {
                    self.alarms.remove(&clear.code);
                    format!("{}|{ALARMS}|NORMAL|{}|||\n", self.at_utc, plain(&clear.code))
                }
                _ => String::new(),
            },
        }
    }

    fn take(&mut self, readings: &[Reading]) -> Vec<(&'static str, String)> {
        let changed = readings.iter().filter_map(|reading| {
            let item = of_channel(&reading.series.name).filter(|_| !reading.series.estimated)?;
            // What the machine has never delivered need not stand in its `devices.xml`.
            let never = matches!(&reading.value, Cell::Missing(reason) if **reason == *"not_provided");
            let known = self.values.contains_key(item.channel);
            (known || !never).then(|| (item.channel, shown(&reading.value)))
        });
        let changed: Vec<(&'static str, String)> = changed.collect();
        self.values.extend(changed.iter().cloned());
        changed
    }

    fn new_tool(&mut self, readings: &[Reading]) -> Option<String> {
        let tool = readings.iter().find_map(|reading| match &reading.value {
            Cell::Text(tool) if &*reading.series.name == "tool" && !tool.is_empty() => Some(tool.to_string()),
            _ => None,
        })?;
        self.tools.insert(tool.clone()).then_some(tool)
    }

    /// A tool that was in use, as an asset of the standard.
    fn asset(&self, tool: &str) -> String {
        let (at, device, tool) = (&self.at_utc, uuid(&self.name), attribute(tool));
        let id = format!("{device}.{tool}");
        format!(
            "{at}|@ASSET@|{id}|CuttingTool|<CuttingTool serialNumber=\"{tool}\" toolId=\"{tool}\" timestamp=\"{at}\" \
             assetId=\"{id}\" deviceUuid=\"{device}\"><CuttingToolLifeCycle><CutterStatus><Status>USED</Status></CutterStatus>\
             </CuttingToolLifeCycle></CuttingTool>\n"
        )
    }
}

fn line<'a>(at: &str, values: impl Iterator<Item = (&'a str, &'a str)>) -> String {
    let cells: String = values.map(|(name, value)| format!("|{name}|{value}")).collect();
    if cells.is_empty() { cells } else { format!("{at}{cells}\n") }
}

fn condition(alarm: &Alarm) -> String {
    let level = if alarm.severity == "critical" { "FAULT" } else { "WARNING" };
    let (at, code) = (moment::utc(alarm.at_ns), plain(&alarm.code));
    format!("{at}|{ALARMS}|{level}|{code}|{}||{}\n", plain(&alarm.severity), plain(&alarm.en))
}

fn shown(value: &Cell) -> String {
    match value {
        Cell::Number(number) => number.to_string(),
        // An empty word is a value that the agent would take for none.
        Cell::Text(text) if !text.is_empty() => plain(text),
        Cell::Text(_) | Cell::Missing(_) => UNAVAILABLE.to_owned(),
    }
}

/// Bars and ends of lines have a meaning of their own.
fn plain(text: &str) -> String {
    text.replace(['|', '\n', '\r'], " ")
}

/// Text within an attribute of XML.
fn attribute(text: &str) -> String {
    plain(text).replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
