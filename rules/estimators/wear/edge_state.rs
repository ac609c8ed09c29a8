//! What the filter keeps of edges and operations, and what it tells.

use super::operation_limit::FreshLevels;
use super::prior::RATES_MAX;
use super::work::{WorkKey, WorkReference};
use serde::{Deserialize, Serialize};

/// Something to tell once.
#[derive(Debug, Clone, PartialEq)]
pub enum WearNews {
    /// The wear of this edge is not known well enough any more to be acted upon.
    NotObservable {
        /// The edge, as the controller names it.
        edge: String,
    },
    /// It is known again.
    Observable {
        /// The edge, as the controller names it.
        edge: String,
    },
    /// The power fell as with a new edge, and nobody had announced one.
    NewEdge {
        /// The tool whose power fell.
        tool: String,
    },
    /// All tools take more or less than before: another lot of material. What was taken for it might have been wear.
    OtherMaterial {
        /// By how much the material takes more than before, as a share.
        change: f64,
        /// Edges in use with their wear before and after, mm.
        edges: Vec<(String, f64, f64)>,
    },
    /// An edge has taken more than its limit in several parts, and is believed to have far less wear than the criterion.
    LimitByMaterial {
        /// The edge, as the controller names it.
        edge: String,
        /// Its wear as believed, mm.
        wear_mm: f64,
        /// By how much the material takes more than usual, as a share.
        material: f64,
    },
}

/// The edge of a tool that is in use. `wear` and `rate` are numbers of states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct CuttingEdge {
    pub(super) tool: String,
    /// As the controller names it.
    pub(super) name: String,
    /// Edges of this tool so far.
    pub(super) number: u32,
    pub(super) wear: usize,
    pub(super) rate: usize,
    pub(super) slide_m: f64,
    pub(super) parts: u32,
    pub(super) part_m: f64,
    pub(super) criterion_mm: f64,
    pub(super) reference: WorkReference,
    pub(super) blind: bool,
    /// Measurements in a row that no wear of before explains.
    pub(super) odd: u32,
    pub(super) rates: Vec<f64>,
    /// Parts in a row in which it took more than its limit in every operation that has one, with enough wear for it; `None`: no operation
    /// has one.
    #[serde(default)]
    pub(super) limit_parts: Option<u32>,
    /// Parts in a row in which it took more although it is believed to have far less wear.
    #[serde(default)]
    pub(super) material_parts: u32,
    /// What slid along the edges of this tool until they were changed, m, the newest last.
    #[serde(default)]
    pub(super) lives_m: Vec<f64>,
}

impl CuttingEdge {
    /// What has slid along it over what slid along the edges before it until they were changed; `None` without two of them.
    pub(super) fn life_share(&self) -> Option<f64> {
        // Asked at every tick: on the stack, and there are no more of them.
        let count = self.lives_m.len().min(RATES_MAX);
        if count < 2 {
            return None;
        }
        let mut lives = [0.0; RATES_MAX];
        let lives = &mut lives[..count];
        lives.copy_from_slice(&self.lives_m[self.lives_m.len() - count..]);
        lives.sort_unstable_by(f64::total_cmp);
        let middle = 0.5 * (lives[(count - 1) / 2] + lives[count / 2]);
        (middle > 0.0).then(|| self.slide_m / middle)
    }
}

/// An operation of a tool in a program; `at` is the number of its constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct OperationGroup {
    pub(super) key: WorkKey,
    pub(super) at: usize,
    pub(super) path_mm: f64,
    pub(super) used: u64,
    /// What new edges have shown of it.
    #[serde(default)]
    pub(super) fresh: FreshLevels,
}

/// A measurement, with the states that it depends on.
pub(super) struct EdgeMeasurement {
    pub(super) group: usize,
    pub(super) edge: usize,
    pub(super) level: bool,
    pub(super) excess: f64,
    pub(super) rise: f64,
    pub(super) half_m: f64,
    pub(super) variance: f64,
}
