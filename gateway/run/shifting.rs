//! Thermal offsets on their way to the control and into the history, and what is left in the control when the gateway ends.

use super::health::Health;
use crate::files::replace;
use crate::gate::offset::{Moved, OffsetTrail, Order};
use crate::gate::{Gate, OffsetVerdict, offset};
use crate::history::{Audit, Command};
use crate::log::{Notice, Severity};
use crate::status::Problem;
use adapters::SourceError;
use adapters::clock::TimeNs;
use adapters::offset::{Axis, Left, OffsetSink, Shifted};
use rules::script::OffsetProposal;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file in the data directory.
const FILE: &str = "offsets.json";
const SOURCE: &str = "gate";

/// What one axis has in the control that is not the operator's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Kept {
    base_um: f64,
    written_um: f64,
}

/// `offsets/1`: what was written to which control and not given back.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Memory {
    schema: String,
    /// Address of the control.
    target: String,
    axes: BTreeMap<String, Kept>,
}

/// See the [module](self).
#[derive(Debug, Default)]
pub struct Shifting {
    path: Option<PathBuf>,
    memory: Memory,
    trail: OffsetTrail,
    refused: Option<String>,
}

impl Shifting {
    /// With what an earlier run has left in this control, which gate and sink are told.
    #[must_use]
    pub fn resume(data_dir: &Path, sink: &mut dyn OffsetSink, gate: &mut Gate) -> Self {
        let path = data_dir.join(FILE);
        let target = sink.name().to_owned();
        let memory = recall(&path).filter(|memory| memory.target == target).unwrap_or_default();
        for (axis, Kept { base_um, written_um }) in memory.left() {
            sink.resume(axis, Left { base_um, written_um });
            gate.offsets_mut().resume(axis, written_um - base_um);
        }
        let memory = Memory { schema: "offsets/1".to_owned(), target, ..memory };
        Self { path: Some(path), memory, ..Self::default() }
    }

    /// Nothing can be written; but an earlier run may have left something, which a person has to see to.
    #[must_use]
    pub fn idle(data_dir: &Path) -> Self {
        Self { memory: recall(&data_dir.join(FILE)).unwrap_or_default(), ..Self::default() }
    }

    /// The rows of this tick's verdicts that say something new.
    pub fn rows(&mut self, proposals: &[OffsetProposal], verdicts: &[OffsetVerdict], gate: &Gate) -> Vec<Audit> {
        let limits = &gate.limits().offset;
        let of = |axis: Axis| proposals.iter().find(|proposal| proposal.axis == axis);
        verdicts.iter().filter_map(|verdict| self.trail.proposal(of(verdict.axis), verdict, limits)).collect()
    }

    /// The control has answered: for the gate, for the file, for the operator.
    pub fn answered(&mut self, moved: &Moved, gate: &mut Gate, health: &mut Health) {
        let axis = moved.order.axis();
        let shifted = moved.result.as_ref().ok().and_then(Option::as_ref);
        gate.offsets_mut().answered(axis, shifted);
        if let Some(shifted) = shifted {
            self.remember(axis, shifted, moved.at_ns, health);
        }
        self.tell_refusal(moved, health);
    }

    fn remember(&mut self, axis: Axis, shifted: &Shifted, at_ns: TimeNs, health: &mut Health) {
        let kept = Kept { base_um: shifted.base_um, written_um: shifted.after_um };
        if shifted.shift_um() == 0.0 {
            self.memory.axes.remove(axis.word());
        } else {
            self.memory.axes.insert(axis.word().to_owned(), kept);
        }
        let Some(path) = &self.path else { return };
        let text = serde_json::to_string(&self.memory).unwrap_or_default();
        if let Err(error) = replace(path, &text) {
            let text = format!(
                "{}: what is shifted in the control could not be kept ({error}); after a restart it would count as the operator's",
                path.display()
            );
            health.event(at_ns, SOURCE, &Notice::new(Severity::Error, "offset_not_kept", text));
        }
    }

    /// A control that says no is told once; it is asked again.
    fn tell_refusal(&mut self, moved: &Moved, health: &mut Health) {
        let refused = match &moved.result {
            Err(error @ SourceError::Refused { .. }) => Some(error.to_string()),
            _ => None,
        };
        if refused != self.refused
            && let Some(text) = &refused
        {
            health.event(moved.at_ns, SOURCE, &Notice::new(Severity::Warning, "offset_refused", text.clone()));
        }
        self.refused = refused;
    }

    /// A shift that stays in the control although nobody follows it up.
    #[must_use]
    pub fn problem(&self, gate: &Gate) -> Option<Problem> {
        let follows = gate.armed().is_ok() || (self.path.is_some() && gate.limits().offset.restore);
        if follows || self.memory.axes.is_empty() {
            return None;
        }
        let each = |(axis, kept): (&String, &Kept)| {
            format!("{axis} by {:+.0} um, to {:.0} um", kept.written_um - kept.base_um, kept.written_um)
        };
        let shifts: Vec<String> = self.memory.axes.iter().map(each).collect();
        let what = format!("the external offset in the control is still shifted: {}", shifts.join(", "));
        Some(Problem { what, next: "arm the gate again, or set the offset back at the control".to_owned() })
    }
}

impl Memory {
    fn left(&self) -> impl Iterator<Item = (Axis, Kept)> {
        self.axes.iter().filter_map(|(axis, kept)| Some((Axis::of(axis)?, *kept)))
    }
}

fn recall(path: &Path) -> Option<Memory> {
    serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
}

/// The row of the table of commands; nothing where nothing was written.
#[must_use]
pub fn command(moved: &Moved, target: &str) -> Option<Command> {
    let row = offset::moved(moved)?;
    let verb = match moved.order {
        Order::Shift { .. } => "shift",
        Order::Restore(_) => "restore",
    };
    Some(Command {
        at_ns: row.at_ns,
        command: format!("{}_offset_{verb}", moved.order.axis().word()),
        target: target.to_owned(),
        before: row.before,
        asked: row.asked,
        after: row.after,
        unit: row.unit,
        outcome: if row.outcome == "written" { "done" } else { "failed" }.to_owned(),
        reason: row.reason,
        ..Command::default()
    })
}
