//! What a control holds, as plain values.

use super::Memory;
use adapter_core::integer::convert_bounded;
use fanuc::answer::{Alarm, OperatorMessage, PastAlarm, SpeedUnit, Status, System};
use fanuc::generation::{Generation, Opening};
use fanuc::item::BlockWord;
use fanuc::poll;
use fanuc::wire::Number;
use std::collections::BTreeMap;

/// The modal group of feed per minute and per revolution, and the parameter that shows the feed per revolution.
const FEED_GROUP: i32 = 4;
const FEED_CODES: i16 = 4;
const FEED_SHOWN: i32 = 3107;

/// An axis as the control shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ControllerAxis {
    /// Its name: a letter, or a letter and a number.
    pub name: String,
    /// Does it turn? Its positions are degrees then.
    pub rotary: bool,
    /// Load meter, percent; signed.
    pub load: Number,
    /// Speed of the motor.
    pub speed: Number,
    /// Current of its motor.
    pub current: Number,
    /// Absolute, machine, relative, still to go.
    pub positions: [Number; 4],
}

impl ControllerAxis {
    /// A standing axis at zero. A, B and C turn, by custom.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let zero = Number::from_decimal(0, 0);
        let rotary = name.starts_with(['A', 'B', 'C']);
        Self {
            name: name.to_owned(),
            rotary,
            load: zero,
            speed: zero,
            current: zero,
            positions: [Number::from_decimal(0, 3); 4],
        }
    }
}

/// A spindle as the control shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpindleState {
    /// The six quantities in the order of their numbers: plain load, greatest speed, gear, speed, load, motor speed.
    pub quantities: [Number; 6],
}

/// A file in the memory for programs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProgramFile {
    /// Number, as in O1234.
    pub number: i32,
    /// Its length in bytes.
    pub bytes: i32,
    /// Comment behind the number.
    pub comment: String,
}

/// A group of tools whose life is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ToolGroup {
    /// Tools of the group.
    pub tools: i32,
    /// Their life, in uses or minutes.
    pub life: i32,
    /// How much of it is used.
    pub count: i32,
}

/// A parameter or diagnosis number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Data {
    /// Kind as on the wire.
    pub kind: i16,
    /// One value, or one per axis.
    pub values: Vec<Number>,
}

/// Everything a client can ask for.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    /// Generation, axes, spindles, paths.
    pub opening: Opening,
    /// Kind, series and version that the control tells.
    pub system: System,
    /// The number of the control, four words.
    pub id: [u32; 4],
    /// Does the machine measure in inches?
    pub inch: bool,
    /// Year, month, day, hour, minute and second of the control's clock.
    pub clock: [i16; 6],
    /// What the control does.
    pub status: Status,
    /// Feed along the path.
    pub feed: Number,
    /// Unit of `feed`, as newer controls tell it; see [`Controller::feed_in`].
    pub feed_unit: SpeedUnit,
    /// The spindles, in the order of their numbers.
    pub spindles: Vec<SpindleState>,
    /// The controlled axes, in the order of their numbers.
    pub axes: Vec<ControllerAxis>,
    /// Numbers of the running and the main program.
    pub program: (i32, i32),
    /// Path of the running program.
    pub program_path: String,
    /// Sequence number N of the block that runs.
    pub sequence: i32,
    /// Number that the question for the block count is answered with.
    pub blocks: i32,
    /// One bit per kind of alarm.
    pub alarm_bits: i32,
    /// Alarms that are on.
    pub alarms: Vec<Alarm>,
    /// Alarms that have been, the oldest first.
    pub alarm_history: Vec<PastAlarm>,
    /// Messages to the operator.
    pub messages: Vec<OperatorMessage>,
    /// The files in the memory for programs.
    pub programs: Vec<ProgramFile>,
    /// G codes in force by their group, as the program writes them.
    pub g_codes: BTreeMap<i16, Number>,
    /// The value in force of each modal word.
    pub modal_words: BTreeMap<BlockWord, Number>,
    /// Modal codes by their group.
    pub modal_groups: BTreeMap<i32, u8>,
    /// Custom macro variables; `None` is vacant. What is not here does not exist.
    pub macros: BTreeMap<i32, Option<f64>>,
    /// Parameters by their number; others do not exist.
    pub parameters: BTreeMap<i32, Data>,
    /// Diagnosis data by their number; others do not exist.
    pub diagnoses: BTreeMap<i32, Data>,
    /// All areas of PMC memory.
    pub memory: Memory,
    /// How many tool offsets there are.
    pub tool_offset_count: i32,
    /// Groups of tools by their number.
    pub tool_groups: BTreeMap<i32, ToolGroup>,
    /// The group of tools that comes next, the one in use and the one selected; 0 none.
    pub tool_group: [i32; 3],
    /// Tool offsets by number and type, least input increments.
    pub tool_offsets: BTreeMap<(i32, i32), i32>,
    /// Work offsets by number and axis, least input increments.
    pub work_offsets: BTreeMap<(i32, i32), i32>,
    /// Are work offsets refused while a program runs?
    pub offsets_only_at_rest: bool,
    /// Number and text of the block that runs, with what follows.
    pub executed: (i32, String),
    /// Minutes and milliseconds of the four meters of time.
    pub timers: [(i32, i32); 4],
    /// Signals of the operator's panel.
    pub panel: [i16; 16],
    /// Functions that are refused, with code and detail.
    pub refusals: BTreeMap<u16, (i16, i16)>,
    /// Paths from 2 on, each with what a path has for itself. PMC memory is one: that of the first path counts.
    pub further: Vec<Controller>,
    /// How many writes were taken.
    pub writes: u64,
}

impl Controller {
    /// A control with these axes and one spindle, of the generation of this version word.
    #[must_use]
    pub fn new(version: u16, axes: &[impl ToString]) -> Self {
        let generation = Generation::from_version(version);
        let older = matches!(generation, Generation::Older(_));
        let (family, axes_max, spindles_max) = if older { (3, 8, 4) } else { (5, 32, 8) };
        let count = convert_bounded(axes.len(), u16::MAX);
        let opening = Opening { generation, family, axes_max, spindles_max, paths: 1, axes: count, spindles: 1 };
        let zero = Number::from_decimal(0, 0);
        Self {
            opening,
            system: build_system(older, axes.len()),
            id: [0x0001_0002, 0x0003_0004, 0x0005_0006, 0x0007_0008],
            inch: false,
            clock: [2026, 1, 1, 0, 0, 0],
            status: Status { automatic: 1, ..Status::default() },
            feed: zero,
            feed_unit: SpeedUnit::MmMin,
            spindles: vec![SpindleState { quantities: [zero; 6] }],
            axes: axes.iter().map(|name| ControllerAxis::new(&name.to_string())).collect(),
            program: (0, 0),
            program_path: String::new(),
            sequence: 0,
            blocks: 0,
            alarm_bits: 0,
            alarms: Vec::new(),
            alarm_history: Vec::new(),
            messages: Vec::new(),
            programs: Vec::new(),
            g_codes: BTreeMap::new(),
            modal_words: BlockWord::ALL.into_iter().map(|(word, _)| (word, zero)).collect(),
            modal_groups: (0..=40).map(|group| (group, 0)).collect(),
            macros: (1..=33).chain(100..=199).chain(500..=999).map(|number| (number, None)).collect(),
            parameters: BTreeMap::new(),
            diagnoses: BTreeMap::new(),
            memory: Memory::default(),
            tool_offset_count: 99,
            tool_groups: BTreeMap::new(),
            tool_group: [0; 3],
            tool_offsets: BTreeMap::new(),
            work_offsets: BTreeMap::new(),
            offsets_only_at_rest: false,
            executed: (0, String::new()),
            timers: [(0, 0); 4],
            panel: [0; 16],
            refusals: BTreeMap::new(),
            further: Vec::new(),
            writes: 0,
        }
    }

    /// The same with these axes in the place of its own; they stand at zero.
    #[must_use]
    pub fn with_axes(mut self, axes: &[impl ToString]) -> Self {
        self.axes = axes.iter().map(|name| ControllerAxis::new(&name.to_string())).collect();
        self.opening.axes = convert_bounded(axes.len(), u16::MAX);
        self.system.axes = format!("{:02}", axes.len());
        self
    }

    /// One path more, with these axes and a spindle of its own.
    #[must_use]
    pub fn with_path(mut self, axes: &[impl ToString]) -> Self {
        self.further.push(Self::new(self.opening.generation.version(), axes));
        self.opening.paths = convert_bounded(self.further.len() + 1, u16::MAX);
        self
    }

    /// What a path from 1 has for itself.
    pub(super) fn find_path(&mut self, path: u16) -> Option<&mut Self> {
        match usize::from(path).checked_sub(2) {
            Some(further) => self.further.get_mut(further),
            None => Some(self),
        }
    }

    /// The body of the answer to an opening.
    pub(super) fn encode_opening(&self) -> Vec<u8> {
        let further = |path: u16| self.further.get(usize::from(path).checked_sub(2)?);
        self.opening.body_with(|path| {
            let own = further(path).map_or(&self.opening, |path| &path.opening);
            (own.axes, own.spindles)
        })
    }

    /// Puts a feed in this unit there, and what an older control is asked for besides: the bit of the parameter that
    /// shows it per revolution, and the modal group.
    pub fn feed_in(&mut self, unit: SpeedUnit, feed: Number) {
        (self.feed, self.feed_unit) = (feed, unit);
        let group = if unit.is_per_revolution() { poll::PER_REVOLUTION } else { 0 };
        self.modal_groups.insert(FEED_GROUP, group);
        let code = if unit.is_per_revolution() { 95 } else { 94 };
        self.g_codes.insert(FEED_CODES, Number::from_decimal(code, 0));
        self.set_parameter(FEED_SHOWN, 0, Number::from_decimal(8, 0));
    }

    /// Puts modal words without decimals there.
    pub fn set_modal_words(&mut self, words: impl IntoIterator<Item = (BlockWord, i32)>) {
        self.modal_words.extend(words.into_iter().map(|(word, value)| (word, Number::from_decimal(value, 0))));
    }

    /// Puts the machine into inches or millimetres, with the parameter that says so.
    pub fn measure_in_inches(&mut self, inch: bool) {
        self.inch = inch;
        self.set_parameter(1001, 0, Number::from_decimal(i32::from(inch), 0));
    }

    /// Puts a value of every axis into a diagnosis number.
    pub fn diagnosis_of_axes(&mut self, number: i32, kind: i16, values: Vec<Number>) {
        self.diagnoses.insert(number, Data { kind, values });
    }

    /// Puts a parameter without axes there.
    pub fn set_parameter(&mut self, number: i32, kind: i16, value: Number) {
        self.parameters.insert(number, Data { kind, values: vec![value] });
    }

    /// Puts a diagnosis number of one axis or spindle there.
    pub fn set_diagnosis(&mut self, number: i32, kind: i16, value: Number) {
        self.diagnoses.insert(number, Data { kind, values: vec![value] });
    }
}

fn build_system(older: bool, axes: usize) -> System {
    let (kind, series, version) = if older { ("16", "B0F1", "21.0") } else { ("31", "G421", "27.0") };
    System {
        additional: 0x0402,
        axes_max: if older { 8 } else { 32 },
        kind: kind.to_owned(),
        machine: "M".to_owned(),
        series: series.to_owned(),
        version: version.to_owned(),
        axes: format!("{axes:02}"),
    }
}
