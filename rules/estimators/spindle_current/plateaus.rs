//! Stretches of constant speed, depth and feed in a recording, and the level of the feature in each.

use crate::power_separation::settled_from;
use crate::regression::{Plausible, Refusal, RefusalKind, SteadyLevel, estimate_level, without_pulses};
use numerics::statistics::count_to_f64;
use recording::Recording;
use serde::Serialize;

/// Values closer than this share are one.
pub(super) const SAME: f64 = 0.02;
/// Left out after the tool enters and before it leaves, s.
const GUARD_S: f64 = 1.0;
/// A shorter plateau says nothing, s.
const LEAST_S: f64 = 2.0;

/// A settled cut at one speed, depth and feed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plateau {
    /// Spindle speed, rpm.
    pub speed_rpm: f64,
    /// Depth of cut, mm.
    pub depth_mm: f64,
    /// Feed, in the unit of its column.
    pub feed: f64,
    /// Where it begins on the clock of the recording, s.
    pub from_s: f64,
    /// Where it ends, s.
    pub to_s: f64,
    /// Tool in use, where the recording says.
    pub tool: Option<String>,
    /// Level of the feature.
    pub level: SteadyLevel,
}

/// One row in the cut.
#[derive(Clone, Copy)]
struct Cutting {
    time_s: f64,
    speed_rpm: f64,
    depth_mm: f64,
    feed: f64,
    feature: f64,
}

/// The plateaus of every run, in the order of time.
///
/// # Errors
/// A column that is missing or whose unit was mistaken.
pub(super) fn find_plateaus(recording: &Recording, feed: &str, feature: &str) -> Result<Vec<Plateau>, Refusal> {
    check_recording(recording, feed, feature)?;
    let mut found = Vec::new();
    for run in recording.list_runs() {
        let mut open: Vec<Cutting> = Vec::new();
        let mut tool = None;
        for row in run.rows {
            let now = read_cutting_row(recording, row, feed, feature);
            if !now.is_some_and(|now| open.last().is_none_or(|last| goes_on(&open[0], last, &now))) {
                found.extend(close_plateau(&open, tool.take()));
                open.clear();
            }
            if let Some(now) = now {
                open.push(now);
                tool = recording.find_words("tool").and_then(|words| words.get(row)).map(str::to_owned);
            }
        }
        found.extend(close_plateau(&open, tool));
    }
    Ok(found)
}

fn check_recording(recording: &Recording, feed: &str, feature: &str) -> Result<(), Refusal> {
    for name in [feed, feature, "spindle_speed_rpm", "depth_of_cut_mm"] {
        if recording.find_numbers(name).is_none() {
            let what = format!("the recording has no column {name}");
            let next = "record it; what the program is annotated with (depth of cut) can be added as a column";
            return Err(Refusal::new(RefusalKind::Missing, what, next));
        }
    }
    let test = |name: &str, plausible: Plausible| {
        let values = recording.find_numbers(name).into_iter().flat_map(|numbers| numbers.present_values());
        plausible.check_values(values).map_err(|refusal| refusal.with_place(name))
    };
    test("spindle_speed_rpm", Plausible::SPINDLE_SPEED_RPM)?;
    if feed == "feed_mm_min" {
        test(feed, Plausible::FEED_MM_MIN)?;
    }
    if feature.ends_with("_a") { test(feature, Plausible::SPINDLE_CURRENT_A) } else { Ok(()) }
}

fn read_cutting_row(recording: &Recording, row: usize, feed: &str, feature: &str) -> Option<Cutting> {
    let number = |name: &str| recording.find_numbers(name).and_then(|numbers| numbers.get(row));
    let engaged = recording.find_numbers("engaged").is_none_or(|numbers| numbers.get(row).is_some_and(|it| it > 0.5));
    let rapid = number("rapid").unwrap_or(0.0) > 0.5;
    let speed_rpm = number("spindle_speed_rpm")?.abs();
    let (depth_mm, feed) = (number("depth_of_cut_mm")?, number(feed)?);
    let cuts = engaged && !rapid && speed_rpm > 1.0 && depth_mm > 0.0 && feed > 0.0;
    let feature = number(feature)?;
    cuts.then_some(Cutting { time_s: recording.time_s[row], speed_rpm, depth_mm, feed, feature })
}

fn goes_on(first: &Cutting, last: &Cutting, now: &Cutting) -> bool {
    let same = |a: f64, b: f64| (a - b).abs() <= SAME * b.abs();
    now.time_s > last.time_s
        && now.time_s - last.time_s < 10.0
        && same(now.speed_rpm, first.speed_rpm)
        && same(now.depth_mm, first.depth_mm)
        && same(now.feed, first.feed)
}

fn close_plateau(open: &[Cutting], tool: Option<String>) -> Option<Plateau> {
    let (begin_s, end_s) = (open.first()?.time_s + GUARD_S, open.last()?.time_s - GUARD_S);
    let inner: Vec<&Cutting> = open.iter().filter(|it| it.time_s >= begin_s && it.time_s <= end_s).collect();
    let time_s: Vec<f64> = inner.iter().map(|it| it.time_s).collect();
    let feature: Vec<f64> = inner.iter().map(|it| it.feature).collect();
    let settled = settled_from(&time_s, &feature);
    let (from_s, to_s) = (*time_s.get(settled)?, *time_s.last()?);
    if to_s - from_s < LEAST_S {
        return None;
    }
    let mean = |of: fn(&Cutting) -> f64| {
        inner[settled..].iter().map(|it| of(it)).sum::<f64>() / count_to_f64(inner.len() - settled)
    };
    let (kept_s, kept) = without_pulses(&time_s[settled..], &feature[settled..]);
    Some(Plateau {
        speed_rpm: mean(|it| it.speed_rpm),
        depth_mm: mean(|it| it.depth_mm),
        feed: mean(|it| it.feed),
        from_s,
        to_s,
        tool,
        level: estimate_level(&kept_s, &kept)?,
    })
}
