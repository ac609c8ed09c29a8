//! What the filter keeps of edges and operations, and what it tells.

use super::prior::{CHANGE_SHARE, CHANGES_MAX, EARLY_SHARE};
use super::work::{Reference, WorkKey};
use serde::{Deserialize, Serialize};

/// Something to tell once.
#[derive(Debug, Clone, PartialEq)]
pub enum WearNews {
    /// The wear of this edge is not known well enough any more to be acted upon.
    NotObservable {
        /// The edge.
        edge: String,
    },
    /// It is known again.
    Observable {
        /// The edge.
        edge: String,
    },
    /// The power fell as with a new edge, and nobody had announced one.
    NewEdge {
        /// The tool.
        tool: String,
    },
}

/// The edge of a tool that is in use. `wear` and `rate` are numbers of states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Edge {
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
    pub(super) reference: Reference,
    pub(super) blind: bool,
    /// Measurements in a row that no wear of before explains.
    pub(super) odd: u32,
    pub(super) rates: Vec<f64>,
    /// Wear of earlier edges of this tool when the shop changed them, typical mm.
    #[serde(default)]
    pub(super) changed_mm: Vec<f64>,
}

impl Edge {
    /// The wear at which this edge counts as worn, mm. Typical millimetres are those of steel on a typical edge; on another machine
    /// the same wear may take half the power. So without a model the shop's own changes say what worn is, where they come before the
    /// criterion: the greatest of them, because an edge may also be changed early, and a little before it.
    pub(super) fn worn_mm(&self) -> f64 {
        let changed = self.changed_mm.iter().copied().fold(0.0, f64::max);
        let by_model = self.reference == Reference::Model;
        if by_model || changed == 0.0 { self.criterion_mm } else { self.criterion_mm.min(CHANGE_SHARE * changed) }
    }

    /// The shop has changed the edge at this wear. Far before the criterion it was broken, or exchanged for another reason.
    pub(super) fn remember_change(&mut self, wear_mm: f64) {
        if self.reference == Reference::Model || wear_mm < EARLY_SHARE * self.criterion_mm {
            return;
        }
        self.changed_mm.push(wear_mm);
        let surplus = self.changed_mm.len().saturating_sub(CHANGES_MAX);
        self.changed_mm.drain(..surplus);
    }
}

/// An operation of a tool in a program; `at` is the number of its constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Group {
    pub(super) key: WorkKey,
    pub(super) at: usize,
    pub(super) path_mm: f64,
    pub(super) used: u64,
}

/// A measurement, with the states that it depends on.
pub(super) struct Measured {
    pub(super) group: usize,
    pub(super) edge: usize,
    pub(super) level: bool,
    pub(super) excess: f64,
    pub(super) rise: f64,
    pub(super) half_m: f64,
    pub(super) variance: f64,
}
