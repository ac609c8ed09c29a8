//! Lines of SHDR: a time, then names and values, with bars between. Pure.
//!
//! Source: MTConnect agent, "Adapter Agent Protocol" (SHDR): data items, conditions, assets, heartbeat.

use super::conditions::{self, AlarmKind, OWN};
use super::model::{AVAILABILITY, UNAVAILABLE, of_channel, replace_separators};
use adapter_core::clock::TimeNs;
use gateway_base::moment;
use gateway_history::{Alarm, Cell, Content, Item, Reading, Record};
use std::collections::{BTreeMap, BTreeSet};

/// A line without its time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Line {
    pub(super) at_ns: TimeNs,
    pub(super) body: String,
}

/// The lines with their times. Each agent is told times that never go back, from `least_ns` on: an agent that has lost its
/// adapter notes every value as unavailable with the time of its own clock, and what it is told then must come after that.
pub(super) fn format_lines(lines: &[Line], least_ns: &mut TimeNs) -> String {
    let mut text = String::new();
    for Line { at_ns, body } in lines {
        *least_ns = (*least_ns).max(*at_ns);
        text += &moment::format_utc(*least_ns);
        text.push('|');
        text += body;
        text.push('\n');
    }
    text
}

/// What an agent that connects now must be told.
#[derive(Debug, Default)]
pub(super) struct Machine {
    device: String,
    at_ns: TimeNs,
    values: BTreeMap<&'static str, String>,
    /// Does the controller tell whether there are alarms?
    alarms_known: bool,
    /// Alarms that stand, by source and code.
    alarms: BTreeMap<(String, String), Alarm>,
    tools: BTreeSet<String>,
}

impl Machine {
    pub(super) fn new(device: &str, latest: &[Reading], at_ns: TimeNs) -> Self {
        let mut machine = Self { device: device.to_owned(), at_ns, ..Self::default() };
        machine.update_values(latest);
        machine
    }

    /// Everything that an agent must know at the beginning, as of `now_ns`.
    pub(super) fn build_initial_lines(&self, now_ns: TimeNs) -> Vec<Line> {
        let at_ns = self.at_ns.max(now_ns);
        let line = |body| Line { at_ns, body };
        let mut lines = vec![line(self.availability_line())];
        let values = join_cells(self.values.iter().map(|(name, value)| (*name, value.as_str())));
        lines.extend(values.map(line));
        lines.extend(self.list_conditions().into_iter().map(line));
        lines.extend(self.tools.iter().map(|tool| line(self.format_tool_asset(tool, at_ns))));
        lines
    }

    /// Is there a machine behind the box? It is there while the controller or a meter tells something of it.
    fn is_available(&self) -> bool {
        self.values.values().any(|value| value != UNAVAILABLE)
    }

    fn availability_line(&self) -> String {
        format!("{AVAILABILITY}|{}", if self.is_available() { "AVAILABLE" } else { UNAVAILABLE })
    }

    /// Every condition as it stands.
    fn list_conditions(&self) -> Vec<String> {
        let level = if self.alarms_known { "NORMAL" } else { UNAVAILABLE };
        let basis = conditions::ALL.iter().map(|condition| {
            let level = if *condition == OWN { "NORMAL" } else { level };
            format!("{}|{level}||||", condition.name)
        });
        basis.chain(self.alarms.values().flat_map(build_alarm_lines)).collect()
    }

    /// The lines of an item; none where the standard has no counterpart.
    pub(super) fn build_item_lines(&mut self, item: &Item) -> Vec<Line> {
        self.at_ns = self.at_ns.max(item.at_ns);
        let available = self.is_available();
        let mut bodies = match &item.content {
            Content::Sample(readings) => self.build_sample_lines(readings, item.at_ns),
            Content::Record(record) => match &**record {
                Record::Alarm(alarm) => {
                    self.alarms.insert((alarm.source.clone(), alarm.code.clone()), alarm.clone());
                    build_alarm_lines(alarm)
                }
                Record::AlarmClear(clear) => {
                    self.alarms.remove(&(clear.source.clone(), clear.code.clone()));
                    let normal = |(condition, code, _): (&AlarmKind, String, String)| {
                        format!("{}|NORMAL|{code}|||", condition.name)
                    };
                    conditions::split_alarm(&clear.source, &clear.code, "").map(normal).collect()
                }
                _ => Vec::new(),
            },
            Content::Gap(_) => self.clear_values(),
            Content::Means { .. } => Vec::new(),
        };
        if available != self.is_available() {
            bodies.insert(0, self.availability_line());
        }
        bodies.into_iter().map(|body| Line { at_ns: item.at_ns, body }).collect()
    }

    fn build_sample_lines(&mut self, readings: &[Reading], at_ns: TimeNs) -> Vec<String> {
        let known = self.alarms_known;
        let (changed, tool) = (self.update_values(readings), self.new_tool(readings));
        let mut lines: Vec<String> = join_cells(changed.iter().map(|(name, value)| (*name, value.as_str()))).collect();
        if known != self.alarms_known {
            lines.extend(self.list_conditions());
        }
        lines.extend(tool.map(|tool| self.format_tool_asset(&tool, at_ns)));
        lines
    }

    /// There were no samples from here on.
    fn clear_values(&mut self) -> Vec<String> {
        self.values.values_mut().for_each(|value| UNAVAILABLE.clone_into(value));
        join_cells(self.values.iter().map(|(name, value)| (*name, value.as_str()))).collect()
    }

    fn update_values(&mut self, readings: &[Reading]) -> Vec<(&'static str, String)> {
        let mut changed = Vec::new();
        for reading in readings.iter().filter(|reading| !reading.series.estimated) {
            if &*reading.series.name == "alarm" {
                self.alarms_known = matches!(reading.value, Cell::Text(_));
            }
            let Some(item) = of_channel(&reading.series.name) else { continue };
            // What the machine has never delivered need not stand in its `devices.xml`.
            let never = matches!(&reading.value, Cell::Missing(reason) if **reason == *"not_provided");
            if self.values.contains_key(item.channel) || !never {
                changed.push((item.channel, item.form.format_value(&reading.value)));
            }
        }
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
    fn format_tool_asset(&self, tool: &str, at_ns: TimeNs) -> String {
        let (at, device, tool) = (moment::format_utc(at_ns), &self.device, escape_attribute(tool));
        let id = format!("{device}.{tool}");
        format!(
            "@ASSET@|{id}|CuttingTool|<CuttingTool serialNumber=\"{tool}\" toolId=\"{tool}\" timestamp=\"{at}\" \
             assetId=\"{id}\" deviceUuid=\"{device}\"><CuttingToolLifeCycle><CutterStatus><Status>USED</Status></CutterStatus>\
             </CuttingToolLifeCycle></CuttingTool>"
        )
    }
}

/// Names and values on one line; none for no values.
fn join_cells<'a>(values: impl Iterator<Item = (&'a str, &'a str)>) -> impl Iterator<Item = String> {
    let cells: Vec<String> = values.map(|(name, value)| format!("{name}|{value}")).collect();
    Some(cells.join("|")).filter(|line| !line.is_empty()).into_iter()
}

/// An alarm is one condition for each alarm of the control that it names.
fn build_alarm_lines(alarm: &Alarm) -> Vec<String> {
    let level = if alarm.severity == "critical" { "FAULT" } else { "WARNING" };
    let severity = replace_separators(&alarm.severity);
    let line = |(condition, code, text): (&AlarmKind, String, String)| {
        format!("{}|{level}|{code}|{severity}||{text}", condition.name)
    };
    conditions::split_alarm(&alarm.source, &alarm.code, &alarm.en).map(line).collect()
}

/// Text within an attribute of XML.
fn escape_attribute(text: &str) -> String {
    replace_separators(text).replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use gateway_history::{AlarmClear, Gap};

    #[test]
    fn times_never_go_back() {
        let lines: Vec<Line> =
            [5, 9, 7].map(|second| Line { at_ns: second * 1_000_000_000, body: "a|1".to_owned() }).into();
        let mut least_ns = 6_000_000_000;
        let text = format_lines(&lines, &mut least_ns);
        let seconds: Vec<&str> = text.lines().map(|line| &line[17..19]).collect();
        assert_eq!((seconds, least_ns), (vec!["06", "09", "09"], 9_000_000_000));
    }

    #[test]
    fn an_alarm_of_the_control_is_a_condition_of_its_kind_and_cleared_there() {
        let mut machine = Machine::new("box-1", &[], 0);
        let code = "SV0417 (Y) SERVO ALARM; PS0010 IMPROPER G-CODE".to_owned();
        let alarm = Alarm {
            code: code.clone(),
            source: "controller".to_owned(),
            severity: "critical".to_owned(),
            en: code.clone(),
            ..Alarm::default()
        };
        let bodies = |lines: Vec<Line>| lines.into_iter().map(|line| line.body).collect::<Vec<_>>();
        let of = |sequence, at_ns, content| Item { sequence, epoch: 1, redated_ns: 0, at_ns, content };
        let item = |record| of(1, 5, Content::Record(Box::new(record)));
        assert_eq!(
            bodies(machine.build_item_lines(&item(alarm.into()))),
            ["servo|FAULT|SV0417|critical||(Y) SERVO ALARM", "motion_program|FAULT|PS0010|critical||IMPROPER G-CODE"]
        );
        let clear = AlarmClear { code, source: "controller".to_owned(), at_ns: 6 };
        assert_eq!(
            bodies(machine.build_item_lines(&item(clear.into()))),
            ["servo|NORMAL|SV0417|||", "motion_program|NORMAL|PS0010|||"]
        );
        let greeting = bodies(machine.build_initial_lines(9));
        assert!(greeting.contains(&"servo|UNAVAILABLE||||".to_owned()), "nobody tells of alarms: {greeting:?}");
        assert!(greeting.contains(&"alarms|NORMAL||||".to_owned()), "{greeting:?}");
        let gap = of(2, 8, Content::Gap(Gap { until_ns: None, reason: "stopped".into() }));
        assert_eq!(machine.build_item_lines(&gap), [], "there were no values");
    }
}
