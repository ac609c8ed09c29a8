//! Part programmes: blocks that the simulated control works through.

mod control;
mod experiment;
mod lathe;
mod mill;
mod planner;
mod short_day;

pub(super) use control::{Control, Motion};
pub use experiment::{EXPERIMENT_PROGRAM, ExperimentCut, ExperimentStep};
pub(super) use planner::Planner;

use adapter_core::words::{execution, mode};

/// Feed of a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rate {
    /// mm/min.
    PerMinute(f64),
    /// mm per revolution.
    PerTurn(f64),
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Cut {
    pub(super) depth_mm: f64,
    /// 0 in turning.
    pub(super) width_mm: f64,
    /// Diameter at the edge where the cut begins and where it ends.
    pub(super) diameter_from_mm: f64,
    pub(super) diameter_to_mm: f64,
    /// 0 in turning.
    pub(super) teeth: f64,
    /// Path before the tool meets the work, and behind it.
    pub(super) air_mm: f64,
}

/// What a block does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Action {
    /// Main switch; a control that is switched on starts for twelve seconds.
    Mains(bool),
    Drives(bool),
    Hydraulics(bool),
    Coolant(bool),
    /// Nothing moves for so many seconds.
    Wait(f64),
    /// The spindle goes to a signed speed in a stage; waits until it is there.
    Spindle(f64, u8),
    /// M5; waits until the spindle stands.
    Stop,
    Rapid([f64; 3]),
    Feed {
        to: [f64; 3],
        rate: Rate,
        cut: Option<Cut>,
        /// Threading and tapping: the override is without effect.
        locked: bool,
    },
    ToolChange(u8),
    /// A fresh edge for the tool in use.
    NewEdge,
    PartDone,
    /// An alarm appears, or goes with an empty text.
    Alarm(&'static str),
    /// The material of the parts to come, against the plan.
    Hardness(f64),
    /// The operator turns the feed override.
    Override(u8),
}

/// One block with what the control shows while it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NcBlock {
    pub(super) mode: &'static str,
    pub(super) execution: &'static str,
    pub(super) program: u16,
    pub(super) number: u16,
    pub(super) operation: &'static str,
    pub(super) action: Action,
}

/// Writes blocks one after the other.
pub(super) struct ProgramWriter<'a> {
    blocks: &'a mut std::collections::VecDeque<NcBlock>,
    pub(super) mode: &'static str,
    pub(super) execution: &'static str,
    pub(super) program: u16,
    pub(super) operation: &'static str,
    number: u16,
}

impl<'a> ProgramWriter<'a> {
    pub(super) fn new(blocks: &'a mut std::collections::VecDeque<NcBlock>, program: u16) -> Self {
        Self { blocks, mode: mode::AUTOMATIC, execution: execution::ACTIVE, program, operation: "", number: 0 }
    }

    /// The next blocks have this number.
    pub(super) fn set_number(&mut self, number: u16) {
        self.number = number;
    }

    /// Appends an action under the present block number.
    pub(super) fn append_to_block(&mut self, action: Action) -> &mut Self {
        let (mode, execution, program, number) = (self.mode, self.execution, self.program, self.number);
        self.blocks.push_back(NcBlock { mode, execution, program, number, operation: self.operation, action });
        self
    }

    /// Appends an action; the block number grows by ten.
    pub(super) fn append_action(&mut self, action: Action) -> &mut Self {
        self.number += 10;
        self.append_to_block(action)
    }

    /// Appends an action that no program has: the operator, or the machine itself.
    pub(super) fn append_aside(&mut self, mode: &'static str, execution: &'static str, action: Action) -> &mut Self {
        let (program, number) = (self.program, self.number);
        self.blocks.push_back(NcBlock { mode, execution, program, number, operation: "", action });
        self
    }
}
