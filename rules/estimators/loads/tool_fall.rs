//! A tool that suddenly takes less power than it did: an insert that is missing or broken.
//!
//! The tooth behind a missing one takes the chip of both, so the power falls less than by the share of the teeth: of `z` teeth to
//! `(z - 2 + 2^(1 - m)) / z` with Kienzle's exponent `m`; by 6 % of five teeth and 8 % of four, where `m` is 0.25. The once-per-turn
//! ripple is far above what a poll of 10 Hz shows; the fall of the mean is all that is left.
//!
//! A fall is compared with what leaves everything else as it is. Two witnesses, both from one part to the next of the same program, so
//! that wear, to which each place answers in its own way, has no time to act:
//!
//! - *along the cuts of the tool*: the change since the part before, of the logarithm of the power over the learned one, is the same at all
//!   places of a tool, whatever the lot. Where it steps, one side of the step below no change, an insert broke there, in this part (after the
//!   step) or in the part before (ahead of it). The step that explains the changes best, `difference x sqrt(n1 n2 / (n1 + n2))` (the
//!   least-squares statistic of one change point), is held against the greatest one of the parts before.
//! - *beside the other tools*: the change of the whole tool against that of the others, for a fall that has come before the tool
//!   has cut for some seconds.
//!
//! What cannot be told: a fall that is smaller than what unchanged parts show twice over, and one across a pause, in which somebody
//! may have changed the edge. A thinner allowance of one cut looks the same.

use super::fall_chain::{ChangeChain, Mean};
use adapter_core::clock::{SECOND_NS, TimeNs};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Places that are kept; beyond, the one that was not used for longest is forgotten.
pub const PLACES_MAX: usize = 1024;

/// No cutter with inserts has more teeth than makes a smaller fall than this: ten.
const LEAST_FALL: f64 = 0.03;
/// A step within a part is clear beyond so many times the greatest, and so many times the mean, of unchanged parts. Of noise the mean of
/// the statistic is 2.1 to 2.5 standard deviations in cuts of 24 to 48 s, so that these are six and more.
const CLEAR_OF_GREATEST: f64 = 1.5;
const CLEAR_OF_MEAN: f64 = 3.0;
/// The same of a change from part to part, whose mean size is 0.8 standard deviations.
const CHANGE_CLEAR_OF_GREATEST: f64 = 2.0;
const CHANGE_CLEAR_OF_MEAN: f64 = 5.0;
/// Parts that show what is usual of a tool. Of three, the mean is off by a sixth, and one noise in 200 parts passed for a fall.
const KNOWN_PARTS: u32 = 8;
/// The greatest of the parts before fades by this share with every part, so that one bad part does not blind for good.
const FADE: f64 = 0.97;
/// The mean is over so many parts.
const MEAN_PARTS: u32 = 32;
/// Without a cut for longer than this somebody may have changed an edge: levels begin anew, s. A part is loaded in less.
const PAUSE_S: i64 = 45;
/// Time of a tool in the cut that counts as its level in a part, s.
const LEVEL_S: f64 = 3.0;
/// Moments below this share of the learned power, and above this multiple, are no cut of this place but air, an outlier of the meter, or
/// another fault. A finishing cut takes up to twice as much with a worn edge in a hard lot.
const RATIO_LEAST: f64 = 0.5;
const RATIO_MOST: f64 = 3.0;
/// After them the filtered power needs so long, s.
const SETTLES_S: i64 = 1;
/// A place that the part before has cut for less is not compared, s.
const PLACE_S: f64 = 1.0;
/// Tools of one part.
const TOOLS_MAX: usize = 64;

/// Sizes that were seen where nothing had happened.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Sizes {
    count: u32,
    greatest: f64,
    mean: f64,
}

impl Sizes {
    fn add(&mut self, size: f64) {
        self.count = self.count.saturating_add(1);
        self.greatest = (FADE * self.greatest).max(size);
        self.mean += (size - self.mean) / f64::from(self.count.min(MEAN_PARTS));
    }

    /// Beyond this a size is no usual one; `None` while too few were seen.
    fn limit(&self, of_greatest: f64, of_mean: f64) -> Option<f64> {
        (self.count >= KNOWN_PARTS).then(|| (of_greatest * self.greatest).max(of_mean * self.mean))
    }
}

/// What parts show that nothing has happened to.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct UsualSizes {
    /// Statistics of a step within a part.
    steps: Sizes,
    /// Time of the tool in the cut of the last part, s.
    seconds: f64,
    /// Changes against the other tools from one part to the next.
    changes: Sizes,
}

impl UsualSizes {
    fn step_limit(&self) -> Option<f64> {
        self.steps.limit(CLEAR_OF_GREATEST, CLEAR_OF_MEAN)
    }

    fn change_limit(&self) -> Option<f64> {
        Some(self.changes.limit(CHANGE_CLEAR_OF_GREATEST, CHANGE_CLEAR_OF_MEAN)?.max(LEAST_FALL))
    }
}

/// A tool whose power has fallen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Fallen {
    edge: String,
    share: f64,
}

/// A tool in one part.
#[derive(Debug, Clone, PartialEq, Default)]
struct ToolInPart {
    edge: Arc<str>,
    /// Logarithm of the power over the learned one, in all of its cuts.
    level: Mean,
    /// Its change since the part before, place by place.
    chain: ChangeChain,
    /// What it should have taken, J: the weight of the tool among the others.
    work_j: f64,
}

/// The tools of the part that is being made, and of the one before.
#[derive(Debug, Clone, PartialEq, Default)]
struct Levels {
    program: Arc<str>,
    tools: BTreeMap<String, ToolInPart>,
    before: BTreeMap<String, ToolInPart>,
    /// Levels of the places of both parts.
    places: BTreeMap<String, Mean>,
    places_before: BTreeMap<String, Mean>,
    in_use: String,
    last_ns: TimeNs,
    /// Until then the power still answers to something else than the cut.
    settles_ns: TimeNs,
}

/// A moment of a cut at a learned place.
#[derive(Debug, Clone, Copy)]
pub(super) struct FallMoment<'a> {
    pub(super) at_ns: TimeNs,
    pub(super) step_s: f64,
    pub(super) program: &'a Arc<str>,
    /// The tool with its edge.
    pub(super) edge: &'a Arc<str>,
    /// The key of the place.
    pub(super) place: &'a str,
    pub(super) power_w: f64,
    pub(super) expected_w: f64,
}

/// Follows the levels of all tools.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct FallWatch {
    /// Of each tool, whatever the program: its noise is that of its cut.
    usual: BTreeMap<String, UsualSizes>,
    fallen: BTreeMap<String, Fallen>,
    #[serde(skip)]
    levels: Levels,
}

impl FallWatch {
    /// The levels of the parts of this program are of no use any more.
    pub(super) fn forget_program(&mut self, program: &str) {
        if *self.levels.program == *program {
            self.levels = Levels::default();
        }
    }

    /// The cut is left: its last moments are already those of the exit.
    pub(super) fn leave_cut(&mut self) {
        if let Some(tool) = self.levels.tools.get_mut(&self.levels.in_use) {
            tool.chain.drop_newest();
        }
    }

    /// Another part begins: what the one before has shown becomes usual.
    pub(super) fn begin_part(&mut self) {
        self.levels.in_use.clear();
        self.compare_parts();
        for (tool, now) in &self.levels.tools {
            let unusual = self.fallen.contains_key(tool) || now.level.seconds < LEVEL_S;
            if unusual || (!self.usual.contains_key(tool) && self.usual.len() >= PLACES_MAX) {
                continue;
            }
            let change = self.levels.change_against_others(tool);
            let usual = self.usual.entry(tool.clone()).or_default();
            if let Some(step) = now.chain.greatest_step() {
                usual.seconds = now.chain.level().seconds;
                usual.steps.add(step);
            }
            if let Some(change) = change {
                usual.changes.add(change.against_others.abs());
            }
        }
        self.levels.before = std::mem::take(&mut self.levels.tools);
        self.levels.places_before = std::mem::take(&mut self.levels.places);
    }

    /// Takes a moment of a cut that is under way, at the feed at which the place was learned.
    pub(super) fn add_moment(&mut self, now: &FallMoment<'_>) {
        let levels = &mut self.levels;
        if *levels.program != **now.program {
            *levels = Levels { program: now.program.clone(), ..Levels::default() };
        }
        if now.at_ns - levels.last_ns > PAUSE_S * SECOND_NS {
            *levels = Levels { program: now.program.clone(), ..Levels::default() };
        }
        levels.last_ns = now.at_ns;
        let tool = crate::wear::tool_of(now.edge);
        if levels.in_use != tool {
            tool.clone_into(&mut levels.in_use);
            self.compare_parts();
        }
        self.follow_edge(tool, now.edge);
        if self.levels.add_moment(tool, now) {
            self.judge_step(tool, now.edge);
        }
    }

    /// By how much the power of this tool has fallen, as a share; 0 where it has not, `None` where that is not known.
    pub(super) fn fallen_share(&self, edge: &str) -> Option<f64> {
        let tool = crate::wear::tool_of(edge);
        match self.fallen.get(tool) {
            Some(fallen) if fallen.edge == edge => Some(fallen.share),
            _ => self.usual.get(tool)?.step_limit().map(|_| 0.0),
        }
    }

    /// The least fall in the middle of a part of this tool that would be told, as a share.
    pub(super) fn visible_share(&self, edge: &str) -> Option<f64> {
        let usual = self.usual.get(crate::wear::tool_of(edge))?;
        let limit = usual.step_limit().filter(|_| usual.seconds > 0.0)?;
        Some(to_share(limit / (usual.seconds / 4.0).sqrt()).max(LEAST_FALL))
    }

    /// Another edge has not fallen.
    fn follow_edge(&mut self, tool: &str, edge: &str) {
        if self.fallen.get(tool).is_some_and(|fallen| fallen.edge != edge) {
            self.fallen.remove(tool);
        }
    }

    fn judge_step(&mut self, tool: &str, edge: &str) {
        if self.fallen.contains_key(tool) {
            return;
        }
        let limit = self.usual.get(tool).and_then(UsualSizes::step_limit);
        let step = self.levels.tools.get(tool).and_then(|now| now.chain.greatest_fall());
        let (Some(limit), Some(step)) = (limit, step) else { return };
        if step.statistic >= limit && step.size() >= LEAST_FALL {
            self.fallen.insert(tool.to_owned(), Fallen { edge: edge.to_owned(), share: to_share(step.size()) });
        }
    }

    /// Every tool that is not in use any more, against the others.
    fn compare_parts(&mut self) {
        let done: Vec<String> = self.levels.tools.keys().filter(|tool| **tool != self.levels.in_use).cloned().collect();
        for tool in done {
            let limit = self.usual.get(&tool).and_then(UsualSizes::change_limit);
            let (Some(clear), Some(change)) = (limit, self.levels.change_against_others(&tool)) else { continue };
            let fallen = self.fallen.contains_key(&tool);
            if !fallen && -change.against_others >= clear && -change.own >= 0.5 * clear {
                let edge = self.levels.tools.get(&tool).map_or_else(String::new, |now| now.edge.to_string());
                let share = to_share(-change.against_others);
                self.fallen.insert(tool, Fallen { edge, share });
            } else if fallen && change.against_others >= clear && change.own >= 0.5 * clear {
                // An insert was put in, and no other edge named.
                self.fallen.remove(&tool);
            }
        }
    }
}

/// Change of a level from the part before to this one, as a logarithm.
struct Change {
    own: f64,
    against_others: f64,
}

impl Levels {
    /// Takes a moment; true when another entry counts in the chain of the tool.
    fn add_moment(&mut self, tool: &str, now: &FallMoment<'_>) -> bool {
        let ratio = now.power_w / now.expected_w;
        if !(RATIO_LEAST..RATIO_MOST).contains(&ratio) {
            self.settles_ns = now.at_ns + SETTLES_S * SECOND_NS;
            if let Some(here) = self.tools.get_mut(tool) {
                here.chain.drop_newest();
            }
        }
        let room = self.tools.len() < TOOLS_MAX && self.places.len() < PLACES_MAX;
        let known = self.tools.contains_key(tool) && self.places.contains_key(now.place);
        if now.at_ns <= self.settles_ns || !(room || known) {
            return false;
        }
        let here = self.tools.entry(tool.to_owned()).or_default();
        if here.edge != *now.edge {
            *here = ToolInPart { edge: now.edge.clone(), ..ToolInPart::default() };
        }
        let level = ratio.ln();
        here.work_j += now.expected_w * now.step_s;
        here.level.add(level, now.step_s);
        self.places.entry(now.place.to_owned()).or_default().add(level, now.step_s);
        let same_edge = self.before.get(tool).is_some_and(|before| before.edge == *now.edge);
        let before = self.places_before.get(now.place).filter(|before| same_edge && before.seconds >= PLACE_S);
        before.is_some_and(|before| here.chain.add_moment(level - before.value, now.step_s))
    }

    /// The change of this tool, by itself and less that of the other tools; `None` where one of them is not known.
    fn change_against_others(&self, tool: &str) -> Option<Change> {
        let change_of = |tool: &str| {
            let (now, before) = (self.tools.get(tool)?, self.before.get(tool)?);
            let (level, level_before) = (now.level, before.level);
            let same = now.edge == before.edge && level.seconds.min(level_before.seconds) >= LEVEL_S;
            same.then_some(level.value - level_before.value)
        };
        let own = change_of(tool)?;
        let (mut sum, mut work_j) = (0.0, 0.0);
        for (other, now) in self.tools.iter().filter(|(other, _)| *other != tool && **other != self.in_use) {
            if let Some(change) = change_of(other) {
                sum += change * now.work_j;
                work_j += now.work_j;
            }
        }
        (work_j > 0.0).then(|| Change { own, against_others: own - sum / work_j })
    }
}

/// A fall of the logarithm as a share of the power before.
fn to_share(fall: f64) -> f64 {
    1.0 - (-fall).exp()
}

#[cfg(test)]
#[path = "tool_fall_tests.rs"]
mod tests;
