//! Ticks gathered into seconds: the mean of every number, the last of every word, and how many ticks had one.

use adapter_core::channel::{ChannelId, Kind};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::state::State;
use adapter_core::{Absence, Sample, Value};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One second of the merged sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// Begin of the second, ns since 1970.
    pub at_ns: TimeNs,
    /// Means of the channels that had a number in at least half of the ticks.
    pub numbers: Vec<Option<f64>>,
    /// Words of the channels that had one at the last tick.
    pub words: BTreeMap<usize, Arc<str>>,
    /// The machine is switched off.
    pub off: bool,
    /// Why the output that is compared has no value.
    pub no_output: Option<Absence>,
}

impl Row {
    /// The mean of a channel.
    #[must_use]
    pub fn read_number(&self, name: &str) -> Option<f64> {
        self.numbers.get(ChannelId::from_name(name)?.index()).copied().flatten()
    }

    /// The word of a channel.
    #[must_use]
    pub fn read_word(&self, name: &str) -> Option<&str> {
        self.words.get(&ChannelId::from_name(name)?.index()).map(|word| &**word)
    }

    /// Tool in the work, 0 to 1: as the controller says it, or as the program does, where a depth is planned and the
    /// axis feeds. `None` when neither is known.
    #[must_use]
    pub fn read_engagement(&self) -> Option<f64> {
        self.read_number("engaged").or_else(|| {
            let (depth, feed) = (self.read_number("depth_of_cut_mm")?, self.read_number("feed_mm_min")?);
            let rapid = self.read_number("rapid").unwrap_or(0.0);
            Some(f64::from(u8::from(depth > 0.0 && feed > 0.0 && rapid == 0.0)))
        })
    }
}

/// Gathers the ticks of one second into a row.
#[derive(Debug, Clone)]
pub struct Seconds {
    output: Option<ChannelId>,
    second: Option<i64>,
    ticks: u32,
    sums: Vec<(f64, u32)>,
    row: Row,
}

impl Seconds {
    /// Gathers for a model with this output.
    #[must_use]
    pub fn new(output: &str) -> Self {
        Self {
            output: ChannelId::from_name(output),
            second: None,
            ticks: 0,
            sums: vec![(0.0, 0); ChannelId::count_channels()],
            row: Row::default(),
        }
    }

    /// Takes a tick; gives the second before, when the tick begins a new one. Ticks come in the order of time.
    pub fn add_sample(&mut self, sample: &Sample, state: State) -> Option<Row> {
        let second = sample.at_ns.div_euclid(SECOND_NS);
        let finished = match self.second.replace(second) {
            Some(before) if before != second => Some(self.finish_second(before)),
            _ => None,
        };
        self.accumulate_sample(sample, state);
        finished
    }

    fn accumulate_sample(&mut self, sample: &Sample, state: State) {
        self.ticks += 1;
        self.row.off |= state == State::Off;
        for (id, slot) in sample.provided_slots() {
            match &slot.value {
                Ok(Value::Number(number)) => {
                    // A channel that was declared later is not gathered.
                    if let Some(sum) = self.sums.get_mut(id.index()) {
                        *sum = (sum.0 + number, sum.1 + 1);
                    }
                }
                Ok(Value::Text(text)) if self.row.words.get(&id.index()) != Some(text) => {
                    self.row.words.insert(id.index(), text.clone());
                }
                Ok(Value::Text(_)) => {}
                Err(_) if id.channel().kind == Kind::Text => drop(self.row.words.remove(&id.index())),
                Err(_) => {}
            }
        }
        self.row.no_output = self.output.and_then(|output| sample.slot(output).value.as_ref().err().copied());
    }

    fn finish_second(&mut self, second: i64) -> Row {
        let half = self.ticks.div_ceil(2);
        let mean = |(sum, ticks): &(f64, u32)| (*ticks >= half).then(|| sum / f64::from(*ticks));
        let words = self.row.words.clone();
        let numbers = self.sums.iter().map(mean).collect();
        let row = Row { at_ns: second.saturating_mul(SECOND_NS), numbers, ..std::mem::take(&mut self.row) };
        self.row.words = words;
        self.sums.iter_mut().for_each(|sum| *sum = (0.0, 0));
        self.ticks = 0;
        row
    }
}
