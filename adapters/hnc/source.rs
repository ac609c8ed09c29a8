//! A controller behind the vendor's library as a source.

use super::answer::{HncItemError, HncItemResult};
use super::decode::{Answers, extract_number, extract_text, extract_whole, format_alarms};
use super::item::{self, HncItem, HncWidth, axis, channel, define_real_item, define_whole_item};
use super::line::{Alive, HncLine};
use super::own_value::OwnValue;
use super::sampling::{Sampled, Sampling};
use adapter_core::channel::ChannelId;
use adapter_core::clock::Clock;
use adapter_core::driver::{Fact, Source, SourceError};
use adapter_core::own::Own;
use adapter_core::reading::{Absence, Reading, Stamp};
use adapter_core::text::last_part;
use nclink::BlockSink;
use nclink::sample::SampleBlock;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Items of the channel that are numbers of a channel of ours.
const NUMBERS: [(HncItem, &str); 8] = [
    (define_real_item(channel::ACT_FEEDRATE), "feed_mm_min"),
    (define_real_item(channel::PROG_FEEDRATE), "feed_programmed_mm_min"),
    (define_whole_item(channel::FEED_OVERRIDE), "feed_override_pct"),
    (define_whole_item(channel::SPDL_OVERRIDE), "spindle_override_pct"),
    (define_real_item(channel::CMD_SPDL_SPEED), "spindle_programmed_rpm"),
    (define_real_item(channel::ACT_SPDL_SPEED), "spindle_speed_rpm"),
    (define_whole_item(channel::PART_CNTR), "part_count"),
    (define_whole_item(channel::MODE), "mode"),
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
    fn find_answer(&self, item: HncItem) -> HncItemResult {
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
            channels: list_channels(),
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
    pub fn sampling_counts(&self) -> Option<Sampled> {
        self.sampling.as_ref().map(Sampling::counts)
    }

    /// Looks once per connection what the controller is.
    fn read_layout(&mut self, generation: u64) -> Result<(), SourceError> {
        if self.layout.generation == generation {
            return Ok(());
        }
        let read = |item| self.line.read(item);
        let unit = extract_number(&read(item::MOVE_UNIT)?).ok().filter(|unit| *unit > 0.0).unwrap_or(MOVE_UNIT);
        let spindle = extract_whole(&read(define_whole_item(channel::SPDL_LAX))?).unwrap_or(SPINDLE);
        let mut axes = Vec::new();
        for (index, usual) in (0..).zip(['X', 'Y', 'Z']) {
            let name = read(HncItem::Axis(axis::NAME, index, HncWidth::Text))?;
            let letter = match extract_text(&name) {
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
        let sampling = Sampling::from_axes(self.layout.spindle, &axes).with_counts_of(before);
        match self.line.start_sampling(sampling.items()) {
            Ok(()) => self.sampling = Some(sampling),
            Err(SourceError::Refused { .. } | SourceError::Decode { .. }) => self.sampling = None,
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn list_items(&self) -> Vec<HncItem> {
        let mut items: Vec<HncItem> = NUMBERS.iter().map(|(item, _)| *item).collect();
        items.extend(FLAGS.map(define_whole_item));
        items.extend([
            define_whole_item(channel::TOOL_USE),
            define_whole_item(channel::RUN_ROW),
            HncItem::Program,
            HncItem::Alarms,
        ]);
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

    fn append_readings(&self, poll: &HncPoll, stamp: Stamp, out: &mut Vec<Reading>) {
        for own in &self.own {
            out.push(own.to_reading(stamp, own.item.extract_value(&poll.find_answer(own.item.item))));
        }
        let of_table = self.channels.len() - self.own.len();
        for channel in &self.channels[..of_table] {
            let value = self.find_value(channel.name(), poll);
            out.push(match value {
                Ok(HncValue::Number(number)) => Reading::from_number(*channel, stamp, number),
                Ok(HncValue::Text(text)) => Reading::from_text(*channel, stamp, Arc::from(text)),
                Err(reason) => Reading::from_absence(*channel, stamp, reason),
            });
        }
    }

    fn find_value(&self, name: &str, poll: &HncPoll) -> Result<HncValue, Absence> {
        match name {
            "mode" => return poll.find_mode().map(HncValue::from_text),
            "execution" => return poll.find_execution().map(HncValue::from_text),
            "operation" => return poll.find_operation().map(HncValue::from_text),
            "alarm" => return format_alarms(&poll.find_answer(HncItem::Alarms)).map(HncValue::Text),
            "program" => {
                return extract_text(&poll.find_answer(HncItem::Program))
                    .map(|name| HncValue::from_text(last_part(name)));
            }
            "block" => return poll.find_number(channel::RUN_ROW).map(|row| HncValue::Text(format!("N{row}"))),
            "tool" => return poll.find_number(channel::TOOL_USE).map(|tool| HncValue::Text(format!("T{tool}"))),
            "spindle_current_a" => {
                let item = HncItem::Axis(axis::LOAD_CUR, self.layout.spindle, HncWidth::Real);
                return extract_number(&poll.find_answer(item)).map(HncValue::Number);
            }
            _ => {}
        }
        if let Some((item, _)) = NUMBERS.iter().find(|(_, channel)| *channel == name) {
            return extract_number(&poll.find_answer(*item)).map(HncValue::Number);
        }
        self.axis_value(name, poll)
    }

    fn axis_value(&self, name: &str, poll: &HncPoll) -> Result<HncValue, Absence> {
        let (letter, ending) = name.split_once('_').ok_or(Absence::NotSupported)?;
        let upper = letter.to_ascii_uppercase();
        let known = self.layout.axes.iter().find(|(letter, _)| upper.starts_with(*letter));
        let (_, axis_number) = known.ok_or(Absence::NotSupported)?;
        let row = AXIS.iter().find(|(channel, ..)| *channel == ending).ok_or(Absence::NotSupported)?;
        let found = extract_number(&poll.find_answer(HncItem::Axis(row.1, *axis_number, row.2)))?;
        Ok(HncValue::Number(if row.1 == axis::ACT_POS { found / self.layout.move_unit } else { found }))
    }

    fn take_samples(&mut self, clock: &dyn Clock) -> Result<(), SourceError> {
        let Some(sampling) = &mut self.sampling else { return Ok(()) };
        let columns = self.line.read_samples()?;
        let blocks: Vec<SampleBlock> = sampling.build_blocks(&columns, clock.now_ns().div_euclid(1_000_000));
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
    fn from_text(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// Every channel that a control delivers by itself.
#[must_use]
pub fn list_channels() -> Vec<ChannelId> {
    let words = ["execution", "operation", "alarm", "program", "block", "tool", "spindle_current_a"];
    let axes = ["x", "y", "z"].into_iter().flat_map(|axis| AXIS.iter().map(move |(name, ..)| format!("{axis}_{name}")));
    let numbers = NUMBERS.iter().map(|(_, name)| (*name).to_owned());
    let names = numbers.chain(words.map(str::to_owned)).chain(axes);
    names.filter_map(|name| ChannelId::from_name(&name)).collect()
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

    fn query_identity(&self) -> Vec<(&'static str, String)> {
        let named = [("nc version", item::NC_VERSION), ("serial", item::SERIAL)];
        let ask = |(name, item)| Some((name, extract_text(&self.line.read(item).ok()?).ok()?.to_owned()));
        named.into_iter().filter_map(ask).collect()
    }

    #[expect(clippy::cast_precision_loss, reason = "counts")]
    fn collect_facts(&self) -> Vec<Fact> {
        let counts = self.line.counts();
        let mut facts = vec![
            Fact::from_number("library_starts", counts.starts as f64),
            Fact::from_number("connections", self.alive.connected as f64),
            Fact::from_number("lost_connections", self.alive.lost as f64),
        ];
        if let Some(sampled) = self.sampling_counts() {
            facts.push(Fact::from_number("sampled_instants", sampled.instants as f64));
            facts.push(Fact::from_number("missing_instants", sampled.missing as f64));
        }
        facts
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        self.alive = self.line.query_connection()?;
        self.read_layout(self.alive.generation)?;
        let began_ns = clock.now_ns();
        let items = self.list_items();
        let results = self.line.read_each(&items)?;
        let answers: HashMap<HncItem, HncItemResult> = items.into_iter().zip(results).collect();
        let stamp = Stamp::of_request(began_ns, clock.now_ns());
        self.append_readings(&HncPoll(answers), stamp, out);
        self.take_samples(clock)
    }
}
