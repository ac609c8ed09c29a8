//! What happens between two ticks and has a handler of its own: state, part, program, tool, alarm of the controller.
//!
//! The first value is no change, and silence is none either: a tool that is reported again after a gap as what it was
//! has not been changed.

use super::problem::ScriptProblem;
use adapter_core::channel::find_nearest_name;
use adapter_core::{ChannelId, Sample};
use estimators::{Estimates, State};
use rhai::{Dynamic, Position};
use std::sync::Arc;

/// What a handler is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum EventKind {
    State,
    Part,
    Program,
    Tool,
    Alarm,
}

impl EventKind {
    /// The word of the vocabulary whose values the parameters of the handler have.
    pub(super) fn vocabulary_word(self) -> &'static str {
        match self {
            Self::State => "state",
            Self::Part => "part_count",
            Self::Program => "program",
            Self::Tool => "tool",
            Self::Alarm => "alarm",
        }
    }
}

/// A function of a script that is called when something happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Handler {
    /// How it is written.
    pub signature: &'static str,
    /// When it is called, in English.
    pub en: &'static str,
    /// When it is called, in Chinese.
    pub zh: &'static str,
    kind: EventKind,
}

/// Every handler that a script may define, with its parameters.
pub const HANDLERS: [Handler; 5] = [
    Handler {
        signature: "on_state_change(before, now)",
        en: "The state of the machine has changed; both are words as in `state`",
        zh: "机床状态改变时",
        kind: EventKind::State,
    },
    Handler {
        signature: "on_part_finished(count)",
        en: "The part counter has risen, to this count",
        zh: "工件完成时（计数增加）",
        kind: EventKind::Part,
    },
    Handler {
        signature: "on_program_change(before, now)",
        en: "Another program runs",
        zh: "程序更换时",
        kind: EventKind::Program,
    },
    Handler {
        signature: "on_tool_change(before, now)",
        en: "Another tool is in use",
        zh: "换刀时",
        kind: EventKind::Tool,
    },
    Handler {
        signature: "on_alarm(text)",
        en: "The controller shows an alarm, or another one than before",
        zh: "数控系统报警时",
        kind: EventKind::Alarm,
    },
];

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Event {
    State(State, State),
    Part(f64),
    Program(Arc<str>, Arc<str>),
    Tool(Arc<str>, Arc<str>),
    Alarm(Arc<str>),
}

impl Event {
    pub(super) fn kind(&self) -> EventKind {
        match self {
            Self::State(..) => EventKind::State,
            Self::Part(_) => EventKind::Part,
            Self::Program(..) => EventKind::Program,
            Self::Tool(..) => EventKind::Tool,
            Self::Alarm(_) => EventKind::Alarm,
        }
    }

    /// The values of the handler's parameters, in their order.
    pub(super) fn to_parameter_values(&self) -> Vec<Dynamic> {
        let text = |text: &str| Dynamic::from(text.to_owned());
        match self {
            Self::State(before, now) => vec![text(before.as_word()), text(now.as_word())],
            Self::Part(count) => vec![Dynamic::from_float(*count)],
            Self::Program(before, now) | Self::Tool(before, now) => vec![text(before), text(now)],
            Self::Alarm(shown) => vec![text(shown)],
        }
    }
}

/// Follows the machine from tick to tick.
#[derive(Debug, Default)]
pub(super) struct Happenings {
    channels: Option<EventChannels>,
    state: Option<State>,
    count: Option<f64>,
    program: Option<Arc<str>>,
    tool: Option<Arc<str>>,
    alarm: Option<Arc<str>>,
    events: Vec<Event>,
}

#[derive(Debug, Clone, Copy)]
struct EventChannels {
    count: ChannelId,
    program: ChannelId,
    tool: ChannelId,
    alarm: ChannelId,
}

impl Happenings {
    /// What has happened since the tick before.
    pub(super) fn detect_events(&mut self, sample: &Sample, estimates: &Estimates) -> &[Event] {
        self.events.clear();
        let Some(channels) = self.channels.or_else(find_channels) else { return &self.events };
        self.channels = Some(channels);
        if let Some(before) = self.state.replace(estimates.state).filter(|before| *before != estimates.state) {
            self.events.push(Event::State(before, estimates.state));
        }
        if let Ok(count) = sample.number(channels.count) {
            let risen = self.count.replace(count).is_some_and(|before| count > before);
            self.events.extend(risen.then_some(Event::Part(count)));
        }
        let program = detect_change(&mut self.program, sample.text(channels.program));
        self.events.extend(program.map(|(before, now)| Event::Program(before, now)));
        let tool = detect_change(&mut self.tool, sample.text(channels.tool));
        self.events.extend(tool.map(|(before, now)| Event::Tool(before, now)));
        let alarm = detect_change(&mut self.alarm, sample.text(channels.alarm));
        self.events.extend(alarm.filter(|(_, now)| !now.is_empty()).map(|(_, now)| Event::Alarm(now)));
        &self.events
    }
}

fn find_channels() -> Option<EventChannels> {
    let of = ChannelId::from_name;
    Some(EventChannels { count: of("part_count")?, program: of("program")?, tool: of("tool")?, alarm: of("alarm")? })
}

/// Before and now, when `now` is another text than the one before.
fn detect_change(last: &mut Option<Arc<str>>, now: Option<&str>) -> Option<(Arc<str>, Arc<str>)> {
    let now = now.filter(|now| last.as_deref() != Some(*now))?;
    let now: Arc<str> = Arc::from(now);
    let before = last.replace(now.clone())?;
    Some((before, now))
}

/// The kind of event that a function of this name handles; a problem when its name or its parameters are wrong. Functions
/// that do not begin with `on_` are the script's own.
pub(super) fn classify_handler(
    file: &str,
    name: &str,
    parameters: usize,
    at: Position,
) -> Result<Option<EventKind>, ScriptProblem> {
    if !name.starts_with("on_") {
        return Ok(None);
    }
    let name_of = |handler: &Handler| handler.signature.split('(').next().unwrap_or_default();
    let Some(handler) = HANDLERS.iter().find(|handler| name_of(handler) == name) else {
        let near = find_nearest_name(name, HANDLERS.iter().map(name_of));
        let all: Vec<&str> = HANDLERS.iter().map(name_of).collect();
        let next = near
            .map_or_else(|| format!("these are called: {}", all.join(", ")), |near| format!("did you mean `{near}`?"));
        return Err(ScriptProblem::new(file, at, format!("nothing ever calls `{name}`"), next));
    };
    let wanted = handler.signature.matches(',').count() + 1;
    if parameters != 0 && parameters != wanted {
        let what = format!("`{name}` has {parameters} parameters");
        return Err(ScriptProblem::new(file, at, what, format!("write fn {} {{ ... }}", handler.signature)));
    }
    Ok(Some(handler.kind))
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::{Absence, Slot, Value};

    fn sample(tool: Option<&str>, count: Option<f64>) -> Sample {
        let mut sample = Sample::new_empty(0);
        let text = tool.map(|tool| Value::Text(tool.into())).ok_or(Absence::Timeout);
        sample.set_slot(ChannelId::from_name("tool").expect("a channel"), Slot { value: text, age_ns: 0 });
        let number = count.map(Value::Number).ok_or(Absence::Timeout);
        sample.set_slot(ChannelId::from_name("part_count").expect("a channel"), Slot { value: number, age_ns: 0 });
        sample
    }

    #[test]
    fn the_first_value_and_silence_are_no_change() {
        let mut happenings = Happenings::default();
        let mut step = |tool, count, state| {
            let estimates = Estimates { state, ..Estimates::without_samples(0) };
            happenings.detect_events(&sample(tool, count), &estimates).to_vec()
        };
        assert_eq!(step(Some("T1"), Some(3.0), State::Idle), []);
        assert_eq!(step(None, None, State::Idle), []);
        assert_eq!(step(Some("T1"), Some(3.0), State::Cutting), [Event::State(State::Idle, State::Cutting)]);
        let both = step(Some("T2"), Some(4.0), State::Cutting);
        assert_eq!(both, [Event::Part(4.0), Event::Tool("T1".into(), "T2".into())]);
        assert_eq!(step(Some("T2"), Some(0.0), State::Cutting), [], "a counter that is reset finishes nothing");
    }

    #[test]
    fn a_handler_that_nothing_calls_is_told() {
        let problem = classify_handler("a.rhai", "on_tool_chnage", 2, Position::NONE).expect_err("misspelt");
        assert!(problem.to_string().contains("did you mean `on_tool_change`?"), "{problem}");
        assert!(classify_handler("a.rhai", "on_alarm", 3, Position::NONE).is_err());
        assert_eq!(classify_handler("a.rhai", "on_alarm", 0, Position::NONE), Ok(Some(EventKind::Alarm)));
        assert_eq!(classify_handler("a.rhai", "once", 0, Position::NONE), Ok(None));
    }
}
