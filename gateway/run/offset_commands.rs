//! Thermal offsets on their way to the control and into the history, and what is left in the controls when the gateway ends.

use super::health::Health;
use adapters::SourceError;
use adapters::offset::{Axis, Left, OffsetSink};
use gateway_base::cannot_run::CannotRun;
use gateway_base::log::{Notice, Severity};
use gateway_gate::offset::{Moved, OffsetAccount, OffsetJournal, OffsetOrder, OffsetTrail};
use gateway_gate::{Gate, OffsetVerdict};
use gateway_history::{Audit, Command};
use gateway_status::StatusProblem;
use rules::script::OffsetProposal;
use std::path::{Path, PathBuf};

const SOURCE: &str = "gate";

/// Thermal offsets on their way to the control and into the history.
#[derive(Debug, Default)]
pub struct OffsetCommands {
    /// The control that is written to; none where nothing can be.
    target: Option<String>,
    /// What is left in each control.
    left: Vec<(String, Axis, Left)>,
    /// A book that could not be read, where it was put.
    unreadable: Option<PathBuf>,
    trail: OffsetTrail,
    refused: Option<String>,
}

impl OffsetCommands {
    /// With what an earlier run has left in this control, which the gate is told; it is looked at before anything is written.
    ///
    /// # Errors
    /// The book of what is left cannot be read, nor put aside.
    pub fn resume_from_journal(
        data_dir: &Path,
        sink: Box<dyn OffsetSink>,
        gate: &mut Gate,
    ) -> Result<(Self, OffsetAccount), CannotRun> {
        let target = sink.name().to_owned();
        let (book, unreadable) = match OffsetJournal::open(data_dir, &target) {
            Ok(book) => (book, None),
            Err(_) => OffsetJournal::begin_anew(data_dir, &target).map(|(book, aside)| (book, Some(aside))).map_err(
                |error| CannotRun::new(format!("{}: {error}", data_dir.display()), "look at the permissions"),
            )?,
        };
        for axis in Axis::ALL {
            if let Some(left) = book.find_leftover(axis) {
                gate.offsets_mut().resume_shift(axis, left.shift_um());
                gate.offsets_mut().mark_unsettled(axis);
            }
        }
        let shifting = Self { target: Some(target), left: list_left_shifts(&book), unreadable, ..Self::default() };
        Ok((shifting, OffsetAccount::new(sink, book)))
    }

    /// Nothing can be written; but an earlier run may have left something, which a person has to see to.
    #[must_use]
    pub fn without_sink(data_dir: &Path) -> Self {
        Self {
            left: OffsetJournal::open(data_dir, "").map(|book| list_left_shifts(&book)).unwrap_or_default(),
            ..Self::default()
        }
    }

    /// The rows of this tick's verdicts that say something new.
    pub fn build_audit_rows(
        &mut self,
        proposals: &[OffsetProposal],
        verdicts: &[OffsetVerdict],
        gate: &Gate,
    ) -> Vec<Audit> {
        let limits = &gate.limits().offset;
        let of = |axis: Axis| proposals.iter().find(|proposal| proposal.axis == axis);
        verdicts.iter().filter_map(|verdict| self.trail.audit_proposal(of(verdict.axis), verdict, limits)).collect()
    }

    /// The row of the audit.
    #[must_use]
    pub fn build_audit_row(&self, moved: &Moved) -> Option<Audit> {
        self.trail.audit_move(moved)
    }

    /// The control has answered: for the gate, for the operator.
    pub fn accept_answer(&mut self, moved: &Moved, gate: &mut Gate, health: &mut Health) {
        gate.offsets_mut().accept_answer(moved);
        if let Some(target) = &self.target {
            let axis = moved.order.axis();
            self.left.retain(|(of, known, _)| (of, *known) != (target, axis));
            self.left.extend(moved.left.map(|left| (target.clone(), axis, left)));
        }
        if let Err(why) = &moved.kept {
            let text = format!(
                "what is shifted in the control could not be kept ({why}); after a restart the control is looked at again"
            );
            health.record_event(moved.at_ns, SOURCE, &Notice::new(Severity::Error, "offset_not_kept", text));
        }
        self.tell_refusal(moved, health);
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
            health.record_event(moved.at_ns, SOURCE, &Notice::new(Severity::Warning, "offset_refused", text.clone()));
        }
        self.refused = refused;
    }

    /// Shifts that stay in a control although nobody follows them up.
    pub fn list_problems(&self, gate: &Gate) -> impl Iterator<Item = StatusProblem> {
        let unreadable = self.unreadable.as_ref().map(|path| StatusProblem {
            what: format!("{}: what an earlier run has left in the control cannot be read", path.display()),
            next: "look at the external offsets at the control, set them right there, and delete the file".to_owned(),
        });
        let own = self.describe_abandoned(|target, axis| self.is_own(target) && !self.is_followed_up(axis, gate)).map(
            |shifts| StatusProblem {
                what: format!("the external offset in the control is still shifted: {shifts}"),
                next: "arm the gate again, or set the offset back at the control".to_owned(),
            },
        );
        let others = self.describe_abandoned(|target, _| !self.is_own(target)).map(|shifts| StatusProblem {
            what: format!("the external offset is still shifted in a control that is no longer written to: {shifts}"),
            next: "name that control again as `source` under [gate.offset], or set the offset back there".to_owned(),
        });
        [unreadable, own, others].into_iter().flatten()
    }

    /// Of this gateway's control; where none is written to, any.
    fn is_own(&self, target: &str) -> bool {
        self.target.as_ref().is_none_or(|own| own == target)
    }

    /// Will somebody move it, or give it back?
    fn is_followed_up(&self, axis: Axis, gate: &Gate) -> bool {
        let limits = &gate.limits().offset;
        self.target.is_some() && (limits.restore || (gate.current_arming().is_ok() && limits.axes.contains(&axis)))
    }

    fn describe_abandoned(&self, counts: impl Fn(&str, Axis) -> bool) -> Option<String> {
        let of = |(target, axis, left): &(String, Axis, Left)| {
            let place = if self.is_own(target) { String::new() } else { format!("{target} ") };
            format!("{place}{} by {:+.0} um, to {:.0} um", axis.as_word(), left.shift_um(), left.written_um)
        };
        let shifts: Vec<String> = self.left.iter().filter(|(target, axis, _)| counts(target, *axis)).map(of).collect();
        (!shifts.is_empty()).then(|| shifts.join(", "))
    }
}

fn list_left_shifts(book: &OffsetJournal) -> Vec<(String, Axis, Left)> {
    book.list_leftovers().map(|(target, axis, left)| (target.to_owned(), axis, left)).collect()
}

/// The row of the table of commands; nothing where nothing was to be written.
#[must_use]
pub fn build_command(moved: &Moved, row: &Audit, target: &str) -> Option<Command> {
    let verb = match moved.order {
        OffsetOrder::Shift { .. } => "shift",
        OffsetOrder::Restore(_) => "restore",
        OffsetOrder::Look(_) => return None,
    };
    let outcome = match row.outcome.as_str() {
        "written" => "done",
        "settled" | "replaced" => return None,
        _ => "failed",
    };
    Some(row.as_command(&format!("{}_offset_{verb}", moved.order.axis().as_word()), target, outcome))
}
