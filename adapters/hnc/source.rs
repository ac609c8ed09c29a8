//! A controller behind the vendor's library as a source.

use super::answer::{HncItemError, HncItemResult};
use super::decode::{Answers, alarms, number, text, whole};
use super::item::{self, HncItem, HncWidth, axis, channel, flag, real};
use super::line::{Alive, HncLine};
use super::own::OwnValue;
use super::sampling::{Sampled, Sampling};
use crate::channel::ChannelId;
use crate::clock::Clock;
use crate::driver::{Fact, Source, SourceError};
use crate::nclink::sample::SampleBlock;
use crate::nclink::{BlockSink, last_part};
use crate::own::Own;
use crate::reading::{Absence, Reading, Stamp};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Items of the channel that are numbers of a channel of ours.
const NUMBERS: [(HncItem, &str); 8] = [
    (real(channel::ACT_FEEDRATE), "feed_mm_min"),
    (real(channel::PROG_FEEDRATE), "feed_programmed_mm_min"),
    (flag(channel::FEED_OVERRIDE), "feed_override_pct"),
    (flag(channel::SPDL_OVERRIDE), "spindle_override_pct"),
    (real(channel::CMD_SPDL_SPEED), "spindle_programmed_rpm"),
    (real(channel::ACT_SPDL_SPEED), "spindle_speed_rpm"),
    (flag(channel::PART_CNTR), "part_count"),
    (flag(channel::MODE), "mode"),
];

/// Flags behind the state words.
const FLAGS: [i32; 8] = [
    channel::CYCLE,
    channel::HOLD,
    channel::IS_MDI,
    channel::IS_THREADING,
    channel::IS_RIGID,
    channel::IS_ESTOP,
    channel::IS_RESETTING,
    channel::VERIFY,
];

/// Ending of an axis' channels with the item: position in counts, speed, load current.
const AXIS: [(&str, i32, HncWidth); 3] = [
    ("axis_position_mm", axis::ACT_POS, HncWidth::Whole),
    ("axis_velocity_mm_min", axis::ACT_VEL, HncWidth::Real),
    ("axis_current_a", axis::LOAD_CUR, HncWidth::Real),
];

/// Counts per millimetre where the controller does not tell.
const MOVE_UNIT: f64 = 100_000.0;
/// Logical axis of the spindle where the controller does not tell.
const SPINDLE: i32 = 5;

/// What is found out once per connection.
#[derive(Debug, Clone, Default)]
struct HncLayout {
    generation: u64,
    move_unit: f64,
    spindle: i32,
    /// Letter and number of X, Y and Z.
    axes: Vec<(char, i32)>,
}

/// What one poll has answered.
struct HncPoll(HashMap<HncItem, HncItemResult>);

impl Answers for HncPoll {
    fn of(&self, item: HncItem) -> HncItemResult {
        self.0.get(&item).cloned().unwrap_or(Err(HncItemError::NotOffered))
    }
}

/// Reads a controller through the vendor's library.
pub struct HncSource {
    line: HncLine,
    period: Duration,
    channels: Vec<ChannelId>,
    own: Vec<Own<OwnValue>>,
    layout: HncLayout,
    alive: Alive,
    sampling: Option<Sampling>,
    sink: Option<BlockSink>,
}

impl HncSource {
    /// A source on this line. With `sample` it also runs the controller's sampling channels.
    #[must_use]
    pub fn new(line: HncLine, period: Duration, sample: bool) -> Self {
        let sampling = sample.then(Sampling::default);
        Self {
            line,
            period,
            channels: channels(),
            own: Vec::new(),
            layout: HncLayout::default(),
            alive: Alive::default(),
            sampling,
            sink: None,
        }
    }

    /// The user's own channels besides.
    #[must_use]
    pub fn with_channels(mut self, own: Vec<Own<OwnValue>>) -> Self {
        self.channels.extend(own.iter().map(|own| own.id));
        self.own = own;
        self
    }

    /// Whole blocks of samples go there from now on.
    pub fn on_block(&mut self, sink: BlockSink) {
        self.sink = Some(sink);
    }

    /// How the sampling has been doing.
    #[must_use]
    pub fn sampled(&self) -> Option<Sampled> {
        self.sampling.as_ref().map(Sampling::counts)
    }

    /// Looks once per connection what the controller is.
    fn look(&mut self, generation: u64) -> Result<(), SourceError> {
        if self.layout.generation == generation {
            return Ok(());
        }
        let read = |item| self.line.read(item);
        let unit = number(&read(item::MOVE_UNIT)?).ok().filter(|unit| *unit > 0.0).unwrap_or(MOVE_UNIT);
        let spindle = whole(&read(flag(channel::SPDL_LAX))?).unwrap_or(SPINDLE);
        let mut axes = Vec::new();
        for (index, usual) in (0..).zip(['X', 'Y', 'Z']) {
            let name = read(HncItem::Axis(axis::NAME, index, HncWidth::Text))?;
            let letter = match text(&name) {
                Ok(name) => name.chars().next().map(|letter| letter.to_ascii_uppercase()),
                // An axis that is not there; a library without names has the usual ones.
                Err(Absence::NotSupported) if name == Err(HncItemError::NotOffered) => Some(usual),
                Err(_) => None,
            };
            axes.extend(letter.filter(|letter| "XYZ".contains(*letter)).map(|letter| (letter, index)));
        }
        self.layout = HncLayout { generation, move_unit: unit, spindle, axes };
        self.begin_sampling()
    }

    /// A controller that cannot sample, or whose operator looks at the oscilloscope, is read without.
    fn begin_sampling(&mut self) -> Result<(), SourceError> {
        let Some(before) = &self.sampling else { return Ok(()) };
        let axes: Vec<i32> = self.layout.axes.iter().map(|(_, number)| *number).collect();
        let sampling = Sampling::of(self.layout.spindle, &axes).continuing(before);
        match self.line.sample(sampling.items()) {
            Ok(()) => self.sampling = Some(sampling),
            Err(SourceError::Refused { .. } | SourceError::Decode { .. }) => self.sampling = None,
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn items(&self) -> Vec<HncItem> {
        let mut items: Vec<HncItem> = NUMBERS.iter().map(|(item, _)| *item).collect();
        items.extend(FLAGS.map(flag));
        items.extend([flag(channel::TOOL_USE), flag(channel::RUN_ROW), HncItem::Program, HncItem::Alarms]);
        items.push(HncItem::Axis(axis::LOAD_CUR, self.layout.spindle, HncWidth::Real));
        for (_, number) in &self.layout.axes {
            items.extend(AXIS.map(|(_, kind, width)| HncItem::Axis(kind, *number, width)));
        }
        // Two bits of one register ask for it once.
        for item in self.own.iter().map(|own| own.item.item) {
            if !items.contains(&item) {
                items.push(item);
            }
        }
        items
    }

    fn readings(&self, poll: &HncPoll, stamp: Stamp, out: &mut Vec<Reading>) {
        for own in &self.own {
            out.push(own.reading(stamp, own.found(&poll.of(own.item.item))));
        }
        let of_table = self.channels.len() - self.own.len();
        for channel in &self.channels[..of_table] {
            let value = self.value(channel.name(), poll);
            out.push(match value {
                Ok(HncValue::Number(number)) => Reading::number(*channel, stamp, number),
                Ok(HncValue::Text(text)) => Reading::text(*channel, stamp, Arc::from(text)),
                Err(reason) => Reading::absent(*channel, stamp, reason),
            });
        }
    }

    fn value(&self, name: &str, poll: &HncPoll) -> Result<HncValue, Absence> {
        match name {
            "mode" => return poll.mode().map(HncValue::text),
            "execution" => return poll.execution().map(HncValue::text),
            "operation" => return poll.operation().map(HncValue::text),
            "alarm" => return alarms(&poll.of(HncItem::Alarms)).map(HncValue::Text),
            "program" => return text(&poll.of(HncItem::Program)).map(|name| HncValue::text(last_part(name))),
            "block" => return poll.flag(channel::RUN_ROW).map(|row| HncValue::Text(format!("N{row}"))),
            "tool" => return poll.flag(channel::TOOL_USE).map(|tool| HncValue::Text(format!("T{tool}"))),
            "spindle_current_a" => {
                let item = HncItem::Axis(axis::LOAD_CUR, self.layout.spindle, HncWidth::Real);
                return number(&poll.of(item)).map(HncValue::Number);
            }
            _ => {}
        }
        if let Some((item, _)) = NUMBERS.iter().find(|(_, channel)| *channel == name) {
            return number(&poll.of(*item)).map(HncValue::Number);
        }
        self.axis_value(name, poll)
    }

    fn axis_value(&self, name: &str, poll: &HncPoll) -> Result<HncValue, Absence> {
        let (letter, ending) = name.split_once('_').ok_or(Absence::NotSupported)?;
        let upper = letter.to_ascii_uppercase();
        let known = self.layout.axes.iter().find(|(letter, _)| upper.starts_with(*letter));
        let (_, axis_number) = known.ok_or(Absence::NotSupported)?;
        let row = AXIS.iter().find(|(channel, ..)| *channel == ending).ok_or(Absence::NotSupported)?;
        let found = number(&poll.of(HncItem::Axis(row.1, *axis_number, row.2)))?;
        Ok(HncValue::Number(if row.1 == axis::ACT_POS { found / self.layout.move_unit } else { found }))
    }

    fn take_samples(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        let Some(sampling) = &mut self.sampling else { return Ok(()) };
        let columns = self.line.sampled()?;
        let blocks: Vec<SampleBlock> = sampling.blocks(&columns, clock.now_ns().div_euclid(1_000_000));
        if let Some(sink) = &mut self.sink {
            let arrived = Instant::now();
            blocks.iter().for_each(|block| sink(block, arrived));
        }
        Ok(())
    }
}

enum HncValue {
    Number(f64),
    Text(String),
}

impl HncValue {
    fn text(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// Every channel that a control delivers by itself.
#[must_use]
pub fn channels() -> Vec<ChannelId> {
    let words = ["execution", "operation", "alarm", "program", "block", "tool", "spindle_current_a"];
    let axes = ["x", "y", "z"].into_iter().flat_map(|axis| AXIS.iter().map(move |(name, ..)| format!("{axis}_{name}")));
    let numbers = NUMBERS.iter().map(|(_, name)| (*name).to_owned());
    let names = numbers.chain(words.map(str::to_owned)).chain(axes);
    names.filter_map(|name| ChannelId::of(&name)).collect()
}

impl Source for HncSource {
    fn name(&self) -> &str {
        self.line.name()
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn identity(&self) -> Vec<(&'static str, String)> {
        let named = [("nc version", item::NC_VERSION), ("serial", item::SERIAL)];
        let ask = |(name, item)| Some((name, text(&self.line.read(item).ok()?).ok()?.to_owned()));
        named.into_iter().filter_map(ask).collect()
    }

    #[expect(clippy::cast_precision_loss, reason = "counts")]
    fn facts(&self) -> Vec<Fact> {
        let counts = self.line.counts();
        let mut facts = vec![
            Fact::number("library_starts", counts.starts as f64),
            Fact::number("connections", self.alive.connected as f64),
            Fact::number("lost_connections", self.alive.lost as f64),
        ];
        if let Some(sampled) = self.sampled() {
            facts.push(Fact::number("sampled_instants", sampled.instants as f64));
            facts.push(Fact::number("missing_instants", sampled.missing as f64));
        }
        facts
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        self.alive = self.line.alive()?;
        self.look(self.alive.generation)?;
        let began_ns = clock.now_ns();
        let items = self.items();
        let results = self.line.read_each(&items)?;
        let answers: HashMap<HncItem, HncItemResult> = items.into_iter().zip(results).collect();
        let stamp = Stamp::of_request(began_ns, clock.now_ns());
        self.readings(&HncPoll(answers), stamp, out);
        self.take_samples(clock)
    }
}
