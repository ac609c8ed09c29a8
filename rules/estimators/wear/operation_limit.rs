//! The limit of an operation as new edges have shown it.
//!
//! A model is of the cuts that it was learned from. An operation with other entries, corners and paths takes some percent more or less with
//! every edge, and a limit that does not know that is passed at half the wear, or never. What an edge that was put in new takes in its
//! first parts beside the model is what its operation takes. One edge may have come into a hard lot, so that one of them says nothing;
//! the middle of two and more says it within the hardness of a lot over the root of their number. Then the limit of the operation goes by
//! it. Until then the limit is that of the model.
//!
//! An edge that was there at the start may be worn, and an edge that nobody announced is a guess: neither counts. So nothing is held back for
//! an edge that was worn from the start.

use super::follow::WearFollower;
use super::prior::{HARDNESS_SD, NEW_MM, RATES_MAX};
use super::record::WearRecord;
use super::work::{EdgeWork, WorkKey, WorkReference};
use crate::estimate::Estimate;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The first parts of an edge show its operation: in more of them it wears by a tenth of its life, in fewer a part that was interrupted counts
/// for too much.
const FRESH_PARTS: u32 = 3;
/// Edges that were put in new before their middle counts.
const EDGES_LEAST: usize = 2;

/// What edges that were put in new took in this operation beside the model, as logarithms, the newest last.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FreshLevels {
    levels: Vec<f64>,
    /// The edge of the newest one, by its number, and the parts that it is the mean of.
    edge: u32,
    parts: u32,
}

impl FreshLevels {
    /// Takes what the edge of this number took in the part of this number of its life.
    pub(super) fn add_part(&mut self, edge: u32, part: u32, level: f64) {
        if part > FRESH_PARTS || !level.is_finite() {
            return;
        }
        if self.edge != edge || self.levels.is_empty() {
            (self.edge, self.parts) = (edge, 0);
            self.levels.push(level);
            let surplus = self.levels.len().saturating_sub(RATES_MAX);
            self.levels.drain(..surplus);
        }
        self.parts += 1;
        if let Some(newest) = self.levels.last_mut() {
            *newest += (level - *newest) / f64::from(self.parts);
        }
    }

    /// What this operation takes beside the model, as a logarithm; `None` while too few edges have shown it.
    pub(super) fn learned_level(&self) -> Option<Estimate> {
        let count = self.levels.len();
        if count < EDGES_LEAST {
            return None;
        }
        let mut levels = self.levels.clone();
        levels.sort_unstable_by(f64::total_cmp);
        let value = 0.5 * (levels[(count - 1) / 2] + levels[count / 2]);
        Some(Estimate { value, sd: HARDNESS_SD / numerics::statistics::count_to_f64(count).sqrt() })
    }
}

impl WearFollower {
    /// Of an edge that somebody has put in, its first parts.
    pub(super) fn note_fresh_level(&mut self, group: usize, edge: usize, excess: f64, work: &EdgeWork) {
        let edge = &self.edges[edge];
        if work.key.reference != WorkReference::Model || edge.number <= 1 || !self.edges_named {
            return;
        }
        let middle_m = (edge.slide_m - 0.5 * work.slide_m).max(0.0);
        let wear_mm = NEW_MM.0 + self.joint.mean(edge.rate) * middle_m;
        let level = excess - (1.0 + work.rise_per_mm() * wear_mm).ln();
        self.groups[group].fresh.add_part(edge.number, edge.parts, level);
    }

    /// What the operation of this key takes beside the model, as new edges have shown it.
    #[must_use]
    pub fn learned_level(&self, key: &WorkKey) -> Option<Estimate> {
        self.groups.iter().find(|group| group.key == *key)?.fresh.learned_level()
    }

    /// The same of the cut under way: of this edge, work material and operation.
    pub(super) fn find_level_of_cut(
        &self,
        works: &[EdgeWork],
        [edge, material, operation]: [&str; 3],
    ) -> Option<Estimate> {
        let is_of_cut = |work: &&EdgeWork| {
            let key = &work.key;
            let texts = [&*work.edge, &key.work_material, &key.operation];
            key.reference == WorkReference::Model && texts == [edge, material, operation]
        };
        self.learned_level(&works.iter().rev().find(is_of_cut)?.key)
    }

    /// What operations took beside models that are replaced says nothing of those that replace them. `known` tells the models by the
    /// sum of their texts.
    pub(super) fn keep_levels_of(&mut self, models: &[Arc<WearRecord>], known: &mut u64) {
        let now = sum_texts(models);
        if std::mem::replace(known, now) != now {
            self.groups.iter_mut().for_each(|group| group.fresh = FreshLevels::default());
        }
    }
}

/// FNV-1a over the models as they are written.
fn sum_texts(models: &[Arc<WearRecord>]) -> u64 {
    let texts = models.iter().filter_map(|record| record.to_toml().ok());
    let bytes: Vec<u8> = texts.flat_map(String::into_bytes).collect();
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
#[path = "operation_limit_tests.rs"]
mod tests;
