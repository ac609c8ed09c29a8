//! What is remembered besides samples: one struct per kind, one row each.

use super::fact::Fact;
use adapter_core::clock::TimeNs;
use serde::{Deserialize, Serialize};

/// Something that happened at one moment, for the operator's list.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Event {
    /// When it happened, ns since 1970.
    pub at_ns: TimeNs,
    /// One word: `started`, `script_reloaded`, `source_lost`, ...
    pub kind: String,
    /// Who says so: a source, a script, `gateway`.
    pub source: String,
    /// For the operator, in words.
    pub text: String,
    /// For the engineer, JSON; empty when there is nothing to add.
    pub detail: String,
}

/// An alarm that begins. Raising one that is already raised counts up and changes nothing else; with another text or severity the
/// row of the old one ends, and a new row begins.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Alarm {
    /// When it was raised.
    pub at_ns: TimeNs,
    /// Identifies it until it is cleared, together with the source.
    pub code: String,
    /// Who raises it: the controller, a script, `gateway`.
    pub source: String,
    /// One of `info`, `warning`, `critical`.
    pub severity: String,
    /// For the operator, English.
    pub en: String,
    /// For the operator, Chinese.
    pub zh: String,
}

/// An alarm that ends.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct AlarmClear {
    /// When it was cleared.
    pub at_ns: TimeNs,
    /// Code of the alarm.
    pub code: String,
    /// Source of the alarm.
    pub source: String,
}

/// The machine enters a state; the one before ends at this moment.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StateChange {
    /// When the state began, ns since 1970.
    pub at_ns: TimeNs,
    /// `off`, `standby`, `spindle_start`, `idle`, `cutting`, ...
    pub state: String,
    /// Programme running then; empty when unknown.
    pub program: String,
    /// Tool in use then; empty when unknown.
    pub tool: String,
}

/// A finished part or cycle.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Part {
    /// Beginning of the cycle.
    pub began_ns: TimeNs,
    /// End of the cycle.
    pub ended_ns: TimeNs,
    /// Name or number of the part; empty when unknown.
    pub part: String,
    /// Programme; empty when unknown.
    pub program: String,
    /// Parts finished in this cycle.
    pub count: i64,
    /// Time in cut, seconds.
    pub cutting_s: Option<f64>,
    /// Energy drawn, J; `None` where no power was known.
    pub energy_j: Option<f64>,
    /// Further figures, JSON; empty when there are none.
    pub detail: String,
}

/// What a script wanted, and what the gate made of it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Decision {
    /// Time of the tick, ns since 1970.
    pub at_ns: TimeNs,
    /// Name of the script that decided, or of the part of the box.
    pub script: String,
    /// Version (hash) of that script.
    pub script_version: String,
    /// What was wanted: `feed_override_pct`, `alarm`, ...
    pub wanted: String,
    /// The value wanted, in `unit`.
    pub value: Option<f64>,
    /// Unit of the value.
    pub unit: String,
    /// The script's reason, in words.
    pub reason: String,
    /// `written`, `shadow`, `held`, `limited`, `refused`.
    pub outcome: String,
    /// Why the gate did so.
    pub outcome_reason: String,
}

/// A command to the machine, as sent and as read back.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Command {
    /// When it was sent.
    pub at_ns: TimeNs,
    /// Name of what was set, for example `feed_override_pct`.
    pub command: String,
    /// Which machine or controller.
    pub target: String,
    /// Value before, as read.
    pub before: Option<f64>,
    /// The value that was asked for.
    pub asked: Option<f64>,
    /// Value after, as read back.
    pub after: Option<f64>,
    /// Unit of the three.
    pub unit: String,
    /// `done`, `failed`, `refused`, `shadow`.
    pub outcome: String,
    /// Why it was sent, or why it failed.
    pub reason: String,
    /// Script that asked, empty when the gateway did by itself.
    pub script: String,
    /// Version (hash) of that script.
    pub script_version: String,
}

/// A model in force from now on.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Model {
    /// When it came into force, ns since 1970.
    pub at_ns: TimeNs,
    /// The name that stands in the model.
    pub name: String,
    /// Where it came from: a file, `identify`, `diagnose --accept`.
    pub origin: String,
    /// The model itself, TOML.
    pub toml: String,
}

/// What a finished diagnosis of a stretch has found.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Diagnosis {
    /// When it was finished.
    pub at_ns: TimeNs,
    /// Beginning of the stretch that was examined.
    pub from_ns: TimeNs,
    /// End of the stretch that was examined.
    pub to_ns: TimeNs,
    /// Word of the verdict: `explained`, `ambiguous`, ...
    pub verdict: String,
    /// What was found, in English sentences.
    pub summary: String,
    /// The whole diagnosis, `diagnosis/1`.
    pub json: String,
}

/// A row of the gate's audit: what was asked for, what became of it, who or which script was behind it. See the table `audit`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Audit {
    /// When it happened, ns since 1970.
    pub at_ns: TimeNs,
    /// `started`, `request`, `write`, `reaction`, `feed_hold`, `stop`, `armed`, `disarmed`, `acknowledged`;
    /// of offsets `z_offset_request`, `z_offset_write`, `z_offset_restore`, and so for `x` and `y`.
    pub kind: String,
    /// What became of it, in one word.
    pub outcome: String,
    /// Value in force before.
    pub before: Option<f64>,
    /// Value asked for; `None` also where it was no number.
    pub asked: Option<f64>,
    /// Value let through (request) or in force after (write, reaction).
    pub after: Option<f64>,
    /// Unit of the three.
    pub unit: String,
    /// The reason of this row, in words.
    pub reason: String,
    /// Script that asked; empty when none did.
    pub script: String,
    /// Version (hash) of that script.
    pub script_version: String,
    /// Person who ordered it; empty when none did.
    pub person: String,
}

impl Audit {
    /// The same as a row of the table of commands: what was written to which machine, and what became of it there.
    #[must_use]
    pub fn as_command(&self, command: &str, target: &str, outcome: &str) -> Command {
        let Self { at_ns, before, asked, after, unit, reason, script, script_version, .. } = self.clone();
        let [command, target, outcome] = [command, target, outcome].map(str::to_owned);
        Command { at_ns, command, target, before, asked, after, unit, outcome, reason, script, script_version }
    }

    /// As it comes back from the file: numbers that are none become absent, and -0 becomes 0.
    pub fn to_storable(&self) -> Self {
        let number = |value: Option<f64>| value.filter(|value| value.is_finite()).map(|value| value + 0.0);
        Self { before: number(self.before), asked: number(self.asked), after: number(self.after), ..self.clone() }
    }
}

/// How long a step of the override took to be seen in force.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ReactionTime {
    /// When it was seen.
    pub at_ns: TimeNs,
    /// What was written, percent.
    pub asked_pct: f64,
    /// What is in force, percent.
    pub found_pct: f64,
    /// From the sample to the write, ms.
    pub sample_to_write_ms: f64,
    /// From the write to the machine showing it, ms.
    pub write_to_seen_ms: f64,
    /// Programme; empty when unknown.
    pub program: String,
    /// NC block; empty when unknown.
    pub block: String,
    /// Tool; empty when unknown.
    pub tool: String,
}

/// Any of them, on its way to the writer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Record {
    /// Something that happened at one moment.
    Event(Event),
    /// An alarm was raised.
    Alarm(Alarm),
    /// An alarm was cleared.
    AlarmClear(AlarmClear),
    /// The machine entered a state.
    State(StateChange),
    /// A part or cycle was finished.
    Part(Part),
    /// A script wanted something, and the gate decided.
    Decision(Decision),
    /// The machine was sent a command.
    Command(Command),
    /// A model came into force.
    Model(Model),
    /// A diagnosis of a stretch was finished.
    Diagnosis(Diagnosis),
    /// A row of the gate's audit.
    Audit(Audit),
    /// An override was seen in force at the machine.
    Reaction(ReactionTime),
    /// The plant has told a fact of its production.
    Fact(Fact),
}

impl Record {
    /// When it happened; of a part, when it was finished.
    #[must_use]
    pub fn at_ns(&self) -> TimeNs {
        match self {
            Self::Event(record) => record.at_ns,
            Self::Alarm(record) => record.at_ns,
            Self::AlarmClear(record) => record.at_ns,
            Self::State(record) => record.at_ns,
            Self::Part(record) => record.ended_ns,
            Self::Decision(record) => record.at_ns,
            Self::Command(record) => record.at_ns,
            Self::Model(record) => record.at_ns,
            Self::Diagnosis(record) => record.at_ns,
            Self::Audit(record) => record.at_ns,
            Self::Reaction(record) => record.at_ns,
            Self::Fact(record) => record.at_ns,
        }
    }
}

impl Record {
    /// Moves every time of it by so much.
    pub fn shift_times(&mut self, by_ns: i64) {
        let move_ns = |at_ns: &mut TimeNs| *at_ns = at_ns.saturating_add(by_ns);
        match self {
            Self::Event(record) => move_ns(&mut record.at_ns),
            Self::Alarm(record) => move_ns(&mut record.at_ns),
            Self::AlarmClear(record) => move_ns(&mut record.at_ns),
            Self::State(record) => move_ns(&mut record.at_ns),
            Self::Part(record) => [&mut record.began_ns, &mut record.ended_ns].into_iter().for_each(move_ns),
            Self::Decision(record) => move_ns(&mut record.at_ns),
            Self::Command(record) => move_ns(&mut record.at_ns),
            Self::Model(record) => move_ns(&mut record.at_ns),
            Self::Diagnosis(record) => {
                [&mut record.at_ns, &mut record.from_ns, &mut record.to_ns].into_iter().for_each(move_ns);
            }
            Self::Audit(record) => move_ns(&mut record.at_ns),
            Self::Reaction(record) => move_ns(&mut record.at_ns),
            // The times of whoever told it.
            Self::Fact(_) => {}
        }
    }
}

macro_rules! into_record {
    ($($kind:ident => $variant:ident),*) => {
        $(impl From<$kind> for Record {
            fn from(record: $kind) -> Self {
                Self::$variant(record)
            }
        })*
    };
}

into_record!(Event => Event, Alarm => Alarm, AlarmClear => AlarmClear, StateChange => State, Part => Part,
    Decision => Decision, Command => Command, Model => Model, Diagnosis => Diagnosis, Audit => Audit,
    ReactionTime => Reaction, Fact => Fact);
