//! The load of each place of a program, learned from the first parts: program, tool, operation and block make a place.

use super::Loads;
use super::follower::{FedShare, OverrideFollower};
use super::last_multiples::LastMultiples;
use super::limits::LearnedLimits;
use super::load_inputs::{LoadChannels, LoadMoment};
use super::place::Place;
use super::tool_fall::{FallMoment, FallWatch, PLACES_MAX};
use crate::NoEstimate;
use crate::signals::seconds_between;
use adapter_core::clock::TimeNs;
use adapter_core::{Sample, is_same_text};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Characters of a block that count.
const BLOCK_MAX: usize = 24;
/// Standard deviations of the cutting power by which an excess must exceed its limit.
const SURE_SD: f64 = 2.0;

/// Feeds that differ by no more than this share are the same: the law of the feed is not exact enough for a fall of some percent.
const SAME_FEED_SHARE: f64 = 0.03;

/// Less than this share of the mean power of a place, beyond doubt, is none of its cut.
const AIR_SHARE: f64 = 0.5;

/// The texts that make a place, as they were seen last.
#[derive(Debug, Clone, PartialEq, Default)]
struct PlaceTexts([Option<Arc<str>>; 4]);

/// What was learned, and where the machine is.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct LearnedLoad {
    places: BTreeMap<String, Place>,
    /// Changes of place so far.
    changes: u64,
    fall: FallWatch,
    #[serde(skip)]
    texts: PlaceTexts,
    #[serde(skip)]
    key: Option<String>,
    #[serde(skip)]
    path_mm: f64,
    #[serde(skip)]
    part: Option<f64>,
    /// When the machine came to this place, or a part began there.
    #[serde(skip)]
    here_since_ns: TimeNs,
    /// Path through the air where no cut has made a place yet.
    #[serde(skip)]
    air_before: f64,
    #[serde(skip)]
    follower: OverrideFollower,
    #[serde(skip)]
    multiples: LastMultiples,
}

impl LearnedLoad {
    pub(super) fn forget_program(&mut self, program: &str) {
        let beginning = format!("{program}/");
        self.places.retain(|key, _| !key.starts_with(&beginning));
        self.fall.forget_program(program);
        self.leave_cut();
    }

    pub(super) fn update_loads(
        &mut self,
        now: &LoadMoment<'_>,
        sample: &Sample,
        channels: &LoadChannels,
        limits: &LearnedLimits,
        loads: &mut Loads,
    ) {
        self.follow_part(sample, channels);
        self.follow_place(sample, channels);
        self.watch_part(now, limits, loads);
        let power = now.cutting_power_w.filter(|_| now.cutting);
        let (Some((power_w, sd_w)), Some(key), Some(step_s)) = (power, &self.key, now.step_s) else {
            self.leave_cut();
            self.fall.leave_cut();
            return;
        };
        // Along the path where the feed is known, otherwise along the time, as far as the place goes.
        self.path_mm += step_s * now.feed_mm_min.map_or(1.0, |feed| feed / 60.0);
        let part = self.part.unwrap_or(0.0);
        let place = self.places.get_mut(key);
        let learned = place.as_ref().is_some_and(|place| place.is_learned(part, limits.parts));
        let feed = now.in_force_pct.map_or(1.0, |pct| pct / 100.0);
        match place {
            Some(place) if learned => {
                let place = place.clone();
                self.compare_with_place(&place, now, (power_w, sd_w, step_s, feed), limits, loads);
                return;
            }
            Some(place) if now.state_s >= limits.entry_s => {
                // A counter that was reset begins anew; what was seen before counts on.
                place.first_part = place.first_part.min(part);
                place.learn_moment(self.path_mm, power_w, feed, step_s);
            }
            None if now.state_s >= limits.entry_s => {
                let (key, used) = (key.clone(), self.changes);
                self.make_room();
                let mut place = Place::new(part, used);
                place.parts.add_air(part, std::mem::take(&mut self.air_before));
                place.learn_moment(self.path_mm, power_w, feed, step_s);
                self.places.insert(key, place);
            }
            _ => {}
        }
        self.leave_cut();
        let none = Err(NoEstimate::PlaceNotLearned);
        (loads.learned_power_w, loads.learned_band_w, loads.learned_peak_w) = (none, none, none);
        loads.learned_override_pct = none;
    }

    fn compare_with_place(
        &mut self,
        place: &Place,
        now: &LoadMoment<'_>,
        (power_w, sd_w, step_s, feed): (f64, f64, f64, f64),
        limits: &LearnedLimits,
        loads: &mut Loads,
    ) {
        let expected = place.predict_power(self.path_mm);
        let feed = place.to_relative_feed(feed);
        let by_feed = feed.powf(limits.exponent);
        loads.learned_power_w = Ok(expected.power_w * by_feed);
        loads.learned_band_w = Ok(expected.band_w * by_feed);
        loads.learned_peak_w = Ok(place.peak_w);
        // At the entry, and where the machine has just come from another place, the power is not yet that of this one.
        if now.state_s.min(seconds_between(self.here_since_ns, now.at_ns)) < limits.entry_s {
            self.leave_cut();
            return;
        }
        self.watch_fall(now, (power_w, step_s, feed), expected.power_w * by_feed, loads);
        let multiple = (power_w - SURE_SD * sd_w) / (place.peak_w.max(expected.power_w) * by_feed.max(1.0));
        loads.learned_multiple = self.multiples.push(multiple, limits.sure_samples).ok_or(NoEstimate::NotYet);
        // The shares between which nothing is asked for; what the meter cannot tell is inside.
        let doubt = (expected.band_w + SURE_SD * sd_w / by_feed) / expected.power_w;
        let high = limits.high_share.max(1.0 + doubt);
        let low = limits.low_share.min(1.0 - doubt);
        let wanted = |share: f64| match share {
            share if share > high => place.feed_pct() * (high / share).powf(1.0 / limits.exponent),
            share if share < low && low > 0.0 => place.feed_pct() * (low / share.max(1e-6)).powf(1.0 / limits.exponent),
            _ => 100.0,
        };
        let share = power_w / expected.power_w;
        let actual_pct = now.actual_pct().unwrap_or(f64::INFINITY);
        let at = FedShare { at_ns: now.at_ns, step_s, share, feed, actual_pct, exponent: limits.exponent };
        let pct = self.follower.step_override(at, &limits.range, wanted);
        loads.learned_override_pct =
            if (pct - 100.0).abs() < 1e-9 { Err(NoEstimate::NothingToChange) } else { Ok(pct) };
    }

    /// Nothing that was seen of a cut so far counts any longer.
    fn leave_cut(&mut self) {
        self.follower.reset_cut();
        self.multiples.clear();
    }

    /// Has the tool in use come to take less?
    fn watch_fall(
        &mut self,
        now: &LoadMoment<'_>,
        (power_w, step_s, feed): (f64, f64, f64),
        expected_w: f64,
        loads: &mut Loads,
    ) {
        let ([Some(program), Some(edge), ..], Some(place)) = (&self.texts.0, &self.key) else { return };
        // Axes that slow down or run up again are at another feed than the one in force.
        let off =
            now.actual_pct().zip(now.in_force_pct).map_or(0.0, |(actual, in_force)| actual / in_force.max(1.0) - 1.0);
        if (feed - 1.0).abs().max(off.abs()) <= SAME_FEED_SHARE {
            let at_ns = now.at_ns;
            self.fall.add_moment(&FallMoment { at_ns, step_s, program, edge, place, power_w, expected_w });
        }
        let figure = |share: Option<f64>| share.ok_or(NoEstimate::PlaceNotLearned);
        loads.learned_fall_share = figure(self.fall.fallen_share(edge));
        loads.learned_visible_fall_share = figure(self.fall.visible_share(edge));
    }

    /// What this part does at the place besides taking power: how far it feeds through the air, whether the coolant runs.
    fn watch_part(&mut self, now: &LoadMoment<'_>, limits: &LearnedLimits, loads: &mut Loads) {
        let (Some(key), Some(step_s), Some((power_w, sd_w))) = (&self.key, now.step_s, now.cutting_power_w) else {
            return;
        };
        let per_s = now.feed_mm_min.map_or(1.0, |feed| feed / 60.0);
        let part = self.part.unwrap_or(0.0);
        let Some(place) = self.places.get_mut(key) else {
            self.air_before += if now.feeds_in_air { step_s * per_s } else { 0.0 };
            return;
        };
        let learned = place.is_learned(part, limits.parts);
        place.parts.follow_part(part, learned);
        // Power near that of the cut is no air, whatever the state is called.
        let missing = power_w + SURE_SD * sd_w < AIR_SHARE * place.mean_power_w();
        if now.feeds_in_air && missing {
            place.parts.add_air(part, step_s * per_s);
        } else if now.cutting {
            place.parts.add_cut(step_s * per_s, step_s, now.coolant_on.filter(|_| !learned));
        }
        if learned {
            loads.learned_air_share = place.parts.missing_share(per_s).ok_or(NoEstimate::PlaceNotLearned);
            loads.learned_coolant_share = place.parts.coolant_share().ok_or(NoEstimate::PlaceNotLearned);
        }
    }

    fn follow_part(&mut self, sample: &Sample, channels: &LoadChannels) {
        let part = sample.number(channels.part_count).ok();
        if part.is_some() && part != self.part {
            self.part = part;
            self.fall.begin_part();
            self.begin_here(sample.at_ns);
        }
    }

    /// The path begins anew, and what was seen before is of another place or part.
    fn begin_here(&mut self, at_ns: TimeNs) {
        self.path_mm = 0.0;
        self.here_since_ns = at_ns;
        self.leave_cut();
    }

    /// The key is put together only where one of its texts has changed.
    fn follow_place(&mut self, sample: &Sample, channels: &LoadChannels) {
        let ids = [channels.program, channels.tool, channels.operation, channels.block];
        let same =
            ids.iter().zip(&self.texts.0).all(|(id, known)| is_same_text(sample.shared_text(*id), known.as_ref()));
        if same {
            return;
        }
        let block_before = self.texts.0[3].clone();
        self.texts = PlaceTexts(ids.map(|id| sample.shared_text(id).cloned()));
        let [program, tool, operation, block] = &self.texts.0;
        let (other_block, key_before) = (*block != block_before, self.key.take());
        self.key = program.as_ref().zip(tool.as_ref()).map(|(program, tool)| {
            let block: String = block.as_deref().unwrap_or_default().chars().take(BLOCK_MAX).collect();
            format!("{program}/{}/{}/{block}", crate::wear::tool_of(tool), operation.as_deref().unwrap_or_default())
        });
        // The path of a place goes on where only an operation begins in its block.
        if other_block {
            self.path_mm = 0.0;
        }
        if self.key != key_before {
            self.here_since_ns = sample.at_ns;
            self.air_before = 0.0;
            self.fall.leave_cut();
            self.leave_cut();
        }
        self.changes += 1;
        if let Some(place) = self.key.as_ref().and_then(|key| self.places.get_mut(key)) {
            place.used = self.changes;
        }
    }

    /// Forgets the place that was not used for longest, where there is no room.
    fn make_room(&mut self) {
        if self.places.len() < PLACES_MAX {
            return;
        }
        let oldest = self.places.iter().min_by_key(|(_, place)| place.used).map(|(key, _)| key.clone());
        if let Some(key) = oldest {
            self.places.remove(&key);
        }
    }
}
