//! A machine's signals for the history: repeating cycles of rapid, cut and pause, quantised as controllers and meters
//! quantise, with noise. A pure function of the row, so that any row read back can be compared with what went in.

use adapters::{Absence, ChannelId, Sample, Slot, Value};
use gateway::history::{ExtraSeries, ExtraValue};
use std::sync::Arc;

/// 2026-01-05 00:00:00 UTC, a Monday.
pub(crate) const START_NS: i64 = 1_767_571_200_000_000_000;
/// Ten ticks a second.
pub(crate) const TICK_NS: i64 = 100_000_000;

/// The twenty quantities, with the decimal places they are delivered in.
pub(crate) const QUANTITIES: [(&str, i32); 20] = [
    ("spindle_programmed_rpm", 0),
    ("feed_programmed_mm_min", 0),
    ("spindle_speed_rpm", 0),
    ("feed_mm_min", 1),
    ("feed_override_pct", 0),
    ("spindle_override_pct", 0),
    ("x_axis_position_mm", 3),
    ("z_axis_position_mm", 3),
    ("x_axis_velocity_mm_min", 1),
    ("z_axis_velocity_mm_min", 1),
    ("spindle_power_w", 1),
    ("total_power_w", 1),
    ("spindle_current_a", 3),
    ("spindle_load_pct", 0),
    ("x_axis_current_a", 3),
    ("z_axis_current_a", 3),
    ("bearing_temperature_c", 1),
    ("motor_temperature_c", 1),
    ("ambient_temperature_c", 1),
    ("supply_voltage_v", 1),
];

/// The machine: channels looked up once.
pub(crate) struct Machine {
    channels: Vec<ChannelId>,
    texts: [ChannelId; 4],
    words: [[Arc<str>; 2]; 4],
    /// Leave a value out now and then, with a reason.
    gaps: bool,
    /// Full mantissas as the merge's interpolation leaves them, instead of quantised readings.
    interpolated: bool,
}

/// A number from 0 to 1 that depends on nothing but its arguments (splitmix64).
pub(crate) fn uniform(row: i64, channel: u64) -> f64 {
    let mut x = (row as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ channel.wrapping_mul(0xd1b5_4a32_d192_ed03);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ (x >> 31)) as f64 / u64::MAX as f64
}

/// Roughly normal, standard deviation 1: the sum of four uniforms.
fn noise(row: i64, channel: u64) -> f64 {
    let sum: f64 = (0..4).map(|part| uniform(row, channel * 4 + part)).sum();
    (sum - 2.0) * 3f64.sqrt()
}

fn channel(name: &str) -> ChannelId {
    ChannelId::from_name(name).expect("in the table of channels")
}

impl Machine {
    pub(crate) fn new() -> Self {
        let pair = |a: &str, b: &str| [Arc::from(a), Arc::from(b)];
        Self {
            channels: QUANTITIES.iter().map(|(name, _)| channel(name)).collect(),
            texts: ["program", "tool", "mode", "execution"].map(channel),
            words: [pair("O1234", "O2345"), pair("T1", "T2"), pair("MEM", "MDI"), pair("START", "STOP")],
            gaps: false,
            interpolated: false,
        }
    }

    /// The same with values missing now and then, each for a reason.
    pub(crate) fn with_gaps(self) -> Self {
        Self { gaps: true, ..self }
    }

    /// The same with full mantissas.
    pub(crate) fn interpolated(self) -> Self {
        Self { interpolated: true, ..self }
    }

    /// The quantity number `index` of [`QUANTITIES`] in `row`.
    pub(crate) fn quantity(&self, row: i64, index: usize) -> f64 {
        let exact = exact(row, index);
        let scale = 10f64.powi(QUANTITIES[index].1);
        if self.interpolated { exact } else { (exact * scale).round() / scale }
    }

    /// What the history must give back for it: quantised readings bit for bit.
    pub(crate) fn missing(&self, row: i64, index: usize) -> Option<Absence> {
        if !self.gaps {
            return None;
        }
        match (index, row.rem_euclid(97)) {
            (10, 5..9) => Some(Absence::Timeout),
            (12, 40) => Some(Absence::OutOfRange),
            (16, _) if row.rem_euclid(2000) < 700 => Some(Absence::NotProvided),
            _ => None,
        }
    }

    pub(crate) fn word(&self, row: i64, index: usize) -> Option<&Arc<str>> {
        if self.gaps && index == 1 && row.rem_euclid(500) < 20 {
            return None;
        }
        Some(&self.words[index][usize::from(row.rem_euclid(900 * (index as i64 + 1)) < 300)])
    }

    pub(crate) fn at_ns(row: i64) -> i64 {
        START_NS + row * TICK_NS
    }

    /// Fills `sample` with the quantities of `row`.
    pub(crate) fn fill_quantities(&self, row: i64, sample: &mut Sample) {
        sample.at_ns = Self::at_ns(row);
        for (index, channel) in self.channels.iter().enumerate() {
            let value = self.missing(row, index).map_or_else(|| Ok(Value::Number(self.quantity(row, index))), Err);
            sample.set_slot(*channel, Slot { value, age_ns: 0 });
        }
    }

    /// Fills `sample` with the signals of `row`.
    pub(crate) fn fill(&self, row: i64, sample: &mut Sample) {
        self.fill_quantities(row, sample);
        for (index, channel) in self.texts.iter().enumerate() {
            let value = self.word(row, index).map(|word| Value::Text(word.clone())).ok_or(Absence::Stale);
            sample.set_slot(*channel, Slot { value, age_ns: 0 });
        }
    }
}

/// The signal before a meter quantises it.
fn exact(row: i64, index: usize) -> f64 {
    let phase = row.rem_euclid(600) as f64 / 600.0;
    let cycle = row.div_euclid(600).rem_euclid(7) as f64;
    let cutting = f64::from(u8::from((0.2..0.7).contains(&phase)));
    let running = f64::from(u8::from(phase < 0.9));
    let speed = running * (800.0 + 100.0 * cycle);
    let feed = running * if cutting > 0.0 { 240.0 } else { 3000.0 };
    let hours = row as f64 / 36_000.0;
    match index {
        0 => speed,
        1 => feed,
        2 => speed + running * 1.5 * noise(row, 2),
        3 => feed + running * 0.4 * noise(row, 3),
        4 | 5 => 100.0 - 10.0 * f64::from(u8::from(cycle > 5.0)),
        6 => 40.0 + 5.0 * cycle,
        7 => 200.0 - 150.0 * phase,
        8 => running * noise(row, 8) * 0.2,
        9 => -running * 900.0 + running * noise(row, 9),
        10 => running * (300.0 + 0.2 * speed) + cutting * 900.0 + 12.0 * noise(row, 10),
        11 => 450.0 + running * (300.0 + 0.2 * speed) + cutting * 950.0 + 15.0 * noise(row, 11),
        12 => 1.2 + running * 2.5 + cutting * 3.0 + 0.02 * noise(row, 12),
        13 => running * 8.0 + cutting * 22.0 + 0.7 * noise(row, 13),
        14 => 0.4 + 0.03 * noise(row, 14),
        15 => 0.6 + cutting * 0.8 + 0.03 * noise(row, 15),
        16 => 35.0 + 4.0 * (hours / 3.0).sin() + 0.05 * noise(row, 16),
        17 => 41.0 + 6.0 * (hours / 2.0).sin() + 0.05 * noise(row, 17),
        18 => 21.0 + 2.0 * (hours / 4.0).sin() + 0.03 * noise(row, 18),
        _ => 399.0 + 0.8 * noise(row, 19),
    }
}

/// The estimates stored beside the channels.
pub(crate) fn extras() -> Vec<ExtraSeries> {
    vec![
        ExtraSeries::new_text("machine_state", "State of the machine", "机床状态"),
        ExtraSeries::new_number("no_load_power_w", "W", "No-load power", "空载功率"),
        ExtraSeries::new_number("cutting_power_w", "W", "Cutting power", "切削功率"),
        ExtraSeries::new_number("cutting_power_sd_w", "W", "Standard deviation of the cutting power", "切削功率标准差"),
    ]
}

/// Their values in `row`.
pub(crate) fn extra_values(row: i64) -> [ExtraValue<'static>; 4] {
    let state = if row.rem_euclid(600) < 420 { "cutting" } else { "idle" };
    let learned = row.rem_euclid(3000) >= 100;
    let power = |channel| {
        let watts = (noise(row, channel) * 20.0 + 400.0) * 10.0;
        if learned { ExtraValue::Number(watts.round() / 10.0) } else { ExtraValue::Missing("not_learned") }
    };
    [ExtraValue::Text(state), power(30), power(31), power(32)]
}
