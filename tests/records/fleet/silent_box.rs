//! A box that has recorded for long and sent nothing: what it has recorded, by rule.

use adapters::{Absence, ChannelId, Sample, Slot, Value};
use gateway::history::{
    Alarm, AlarmClear, Event, ExtraSeries, ExtraValue, Options, Part, Retention, StateChange, WhenFull, Writer,
};
use std::path::Path;

pub(crate) const SECOND_NS: i64 = 1_000_000_000;
pub(crate) const DAY_NS: i64 = 86_400 * SECOND_NS;
/// 2025-01-01 00:00:00 UTC.
pub(crate) const START_NS: i64 = 1_735_689_600 * SECOND_NS;
pub(crate) const TICK_NS: i64 = 30 * SECOND_NS;
pub(crate) const CHANNELS: [&str; 8] = [
    "spindle_power_w",
    "total_power_w",
    "spindle_speed_rpm",
    "feed_mm_min",
    "feed_override_pct",
    "spindle_load_pct",
    "z_axis_position_mm",
    "spindle_current_a",
];

/// A number between 0 and 1 that looks random and is the same at every run.
fn scatter(tick: i64, salt: i64) -> f64 {
    let mixed =
        (tick.wrapping_mul(0x5851_f42d_4c95_7f2d) ^ salt.wrapping_mul(0x2545_f491_4f6c_dd1d)).wrapping_mul(0x9e37_79b9);
    (mixed.unsigned_abs() >> 11) as f64 / (1_u64 << 53) as f64
}

/// What a channel says at a tick: some tremble, some stand still for hours, one is missing from one full hour to the next.
pub(crate) fn slot_at(channel: usize, tick: i64) -> Slot {
    let cuts = tick / 16 % 4 >= 2;
    let tenths = |value: f64| (value * 10.0).round() / 10.0;
    let number = match channel {
        0 | 1 => tenths(if cuts { 4000.0 + 900.0 * scatter(tick, 1) } else { 350.0 } + 400.0 * channel as f64),
        2 => {
            if cuts {
                2400.0
            } else {
                0.0
            }
        }
        3 => {
            if cuts {
                150.0 + tenths(10.0 * scatter(tick, 3))
            } else {
                0.0
            }
        }
        4 => 100.0 - 10.0 * (tick / 2880 % 3) as f64,
        5 if tick / 120 % 24 == 7 => return Slot::from_absence(Absence::Stale),
        5 => tenths(40.0 + 20.0 * scatter(tick / 8, 5)),
        6 => tenths(300.0 * scatter(tick, 6)),
        _ => tenths(8.0 + scatter(tick / 3, 7)),
    };
    Slot { value: Ok(Value::Number(number)), age_ns: 0 }
}

fn queue_records(writer: &Writer, tick: i64, at_ns: i64) {
    if tick % 16 == 0 {
        let state =
            ["standby", "idle", "cutting", "cutting"][usize::try_from(tick / 16 % 4).expect("small")].to_owned();
        writer.queue_record(StateChange {
            at_ns,
            state,
            program: format!("O{}", tick / 2880 % 9),
            ..StateChange::default()
        });
    }
    let (code, source) = (format!("A{}", tick / 960 % 7), "own.rhai".to_owned());
    match tick % 960 {
        30 => drop(writer.queue_record(Alarm { at_ns, code, source, severity: "warning".into(), ..Alarm::default() })),
        90 => drop(writer.queue_record(AlarmClear { at_ns, code, source })),
        // A storm: more of them in one moment than a number has places.
        500 if tick / 960 % 60 == 1 => (0..300).for_each(|index| {
            writer.queue_record(Event { at_ns, kind: "mark".into(), text: format!("{index}"), ..Event::default() });
        }),
        _ => {}
    }
    if tick % 40 == 39 {
        let part = Part {
            began_ns: at_ns - 38 * TICK_NS,
            ended_ns: at_ns,
            count: 1,
            energy_j: Some(1e5 * (1.0 + scatter(tick, 9))),
            ..Part::default()
        };
        writer.queue_record(part);
    }
}

/// Writes so many days as a box without any sink does; every second Sunday it is off for three hours.
pub(crate) fn write_history(path: &Path, days: i64) -> u64 {
    let retention = Retention { raw_days: 3660.0, ..Retention::default() };
    let extras = vec![ExtraSeries::new_text("machine_state", "state", "状态")];
    let writer = Writer::open(path, Options { extras, when_full: WhenFull::Wait, retention, ..Options::default() })
        .expect("opens");
    let channels = CHANNELS.map(|name| ChannelId::from_name(name).expect("in the table"));
    let mut ticks = 0;
    for tick in 0..days * DAY_NS / TICK_NS {
        let (day, of_day) = (tick / 2880, tick % 2880);
        if day % 14 == 4 && (960..1320).contains(&of_day) {
            continue;
        }
        let at_ns = START_NS + tick * TICK_NS;
        queue_records(&writer, tick, at_ns);
        let mut sample = Sample::new_empty(at_ns);
        channels.iter().enumerate().for_each(|(index, channel)| sample.set_slot(*channel, slot_at(index, tick)));
        writer.queue_sample(&sample, &[ExtraValue::Text(if tick / 16 % 4 >= 2 { "cutting" } else { "idle" })]);
        ticks += 1;
    }
    writer.flush().expect("durable");
    ticks
}
