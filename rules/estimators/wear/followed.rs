//! What the filter keeps of edges and operations, and what it tells.

use super::work::{WorkKey, WorkReference};
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
}

/// An operation of a tool in a program; `at` is the number of its constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct OperationGroup {
    pub(super) key: WorkKey,
    pub(super) at: usize,
    pub(super) path_mm: f64,
    pub(super) used: u64,
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
