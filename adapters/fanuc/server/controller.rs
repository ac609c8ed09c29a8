//! What a control holds, as plain values.

use super::Memory;
use crate::fanuc::answer::{Alarm, Status, System};
use crate::fanuc::opening::{Generation, Opening};
use crate::fanuc::wire::Number;
use std::collections::BTreeMap;

/// One axis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axis {
    /// Its letter.
    pub name: char,
    /// Load meter, percent; signed.
    pub load: Number,
    /// Speed of the motor.
    pub speed: Number,
    /// Current.
    pub current: Number,
    /// Absolute, machine, relative, still to go.
    pub positions: [Number; 4],
}

impl Axis {
    /// A standing axis at zero.
    #[must_use]
    pub fn new(name: char) -> Self {
        let zero = Number::decimal(0, 0);
        Self { name, load: zero, speed: zero, current: zero, positions: [Number::decimal(0, 3); 4] }
    }
}

/// One spindle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpindleState {
    /// The six quantities in the order of their numbers: plain load, greatest speed, gear, speed, load, motor speed.
    pub quantities: [Number; 6],
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
    /// Kind and series.
    pub system: System,
    /// What the control does.
    pub status: Status,
    /// Feed along the path.
    pub feed: Number,
    /// Units of feed and spindle speed as numbered on the wire.
    pub speed_units: [i16; 2],
    /// Its spindles.
    pub spindles: Vec<SpindleState>,
    /// Its axes.
    pub axes: Vec<Axis>,
    /// Numbers of the running and the main program.
    pub program: (i32, i32),
    /// Path of the running program.
    pub program_path: String,
    /// Sequence number.
    pub sequence: i32,
    /// Blocks run.
    pub blocks: i32,
    /// One bit per kind of alarm.
    pub alarm_bits: i32,
    /// Alarms that are on.
    pub alarms: Vec<Alarm>,
    /// Modal words by their number.
    pub modal_words: BTreeMap<i32, i32>,
    /// Modal codes by their group.
    pub modal_groups: BTreeMap<i32, u8>,
    /// Custom macro variables; `None` is vacant. What is not here does not exist.
    pub macros: BTreeMap<i32, Option<f64>>,
    /// Parameters.
    pub parameters: BTreeMap<i32, Data>,
    /// Diagnosis numbers.
    pub diagnoses: BTreeMap<i32, Data>,
    /// PMC memory.
    pub memory: Memory,
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
    pub fn new(version: u16, axes: &[char]) -> Self {
        let generation = Generation::of(version);
        let older = matches!(generation, Generation::Older(_));
        let (family, axes_max, spindles_max) = if older { (3, 8, 4) } else { (5, 32, 8) };
        let count = u16::try_from(axes.len()).unwrap_or(0);
        let opening = Opening { generation, family, axes_max, spindles_max, paths: 1, axes: count, spindles: 1 };
        let zero = Number::decimal(0, 0);
        Self {
            opening,
            system: system(older, axes.len()),
            status: Status { automatic: 1, ..Status::default() },
            feed: zero,
            speed_units: [0, 2],
            spindles: vec![SpindleState { quantities: [zero; 6] }],
            axes: axes.iter().map(|name| Axis::new(*name)).collect(),
            program: (0, 0),
            program_path: String::new(),
            sequence: 0,
            blocks: 0,
            alarm_bits: 0,
            alarms: Vec::new(),
            modal_words: (0..=28).map(|word| (word, 0)).collect(),
            modal_groups: (0..=40).map(|group| (group, 0)).collect(),
            macros: (1..=33).chain(100..=199).chain(500..=999).map(|number| (number, None)).collect(),
            parameters: BTreeMap::new(),
            diagnoses: BTreeMap::new(),
            memory: Memory::default(),
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

    /// One path more, with these axes and a spindle of its own.
    #[must_use]
    pub fn with_path(mut self, axes: &[char]) -> Self {
        self.further.push(Self::new(self.opening.generation.version(), axes));
        self.opening.paths = u16::try_from(self.further.len() + 1).unwrap_or(u16::MAX);
        self
    }

    /// What a path from 1 has for itself.
    pub(super) fn path(&mut self, path: u16) -> Option<&mut Self> {
        match usize::from(path).checked_sub(2) {
            Some(further) => self.further.get_mut(further),
            None => Some(self),
        }
    }

    /// The body of the answer to an opening.
    pub(super) fn opened(&self) -> Vec<u8> {
        let further = |path: u16| self.further.get(usize::from(path).checked_sub(2)?);
        self.opening.body_with(|path| {
            let own = further(path).map_or(&self.opening, |path| &path.opening);
            (own.axes, own.spindles)
        })
    }

    /// Puts a parameter without axes there.
    pub fn parameter(&mut self, number: i32, kind: i16, value: Number) {
        self.parameters.insert(number, Data { kind, values: vec![value] });
    }

    /// Puts a diagnosis number of one axis or spindle there.
    pub fn diagnosis(&mut self, number: i32, kind: i16, value: Number) {
        self.diagnoses.insert(number, Data { kind, values: vec![value] });
    }
}

fn system(older: bool, axes: usize) -> System {
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
