//! What does not change while a connection lasts: kind of control, names of the axes, inches or millimetres. Pure.
//!
//! A control that is busy, locked or has its paths turned over at the moment of connecting refuses some of this. It is
//! asked again with every poll until it has answered; until then what depends on it is absent with the reason, because
//! a guess would be silently wrong (an inch machine read as millimetres).

use super::alarms::AlarmTable;
use super::answer::{FocasAnswer, FocasItemError, FocasItemResult, System};
use super::code::{Consequence, FocasReturnCode};
use super::generation::{Generation, Opening};
use super::item::{FocasItem, Question};
use adapter_core::reading::Absence;

/// Parameter 1001, bit 0 (INM): the machine measures in inches.
pub const INCH_MACHINE: FocasItem = FocasItem::Parameter(1001, 0);

/// Parameter 3107 of older controls; bit 3 (GSC): the actual feed is shown per revolution while G95 (G99) is active.
/// Source: `libfwlib32` 1.0.5, which asks for it in `cnc_rdspeed` and makes mm/rev of the feed by this bit.
pub const FEED_SHOWN: FocasItem = FocasItem::Parameter(3107, 0);
const FEED_SHOWN_BIT: u8 = 3;

/// Parameter 1006, bit 0 (ROT) of every axis: it turns, and its positions are degrees.
pub const ROTARY: FocasItem = FocasItem::Parameter(1006, -1);

/// A fact, or why it is not known.
pub type KnownFact<T> = Result<T, Absence>;

/// What does not change while a connection lasts.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    /// Generation, axes and spindles, known since the connection was opened.
    pub opening: Opening,
    /// Kind and series, if the control says them.
    pub system: Option<System>,
    /// Does the machine measure in inches? A control without the parameter measures in millimetres.
    pub inch: KnownFact<bool>,
    /// Is the actual feed shown per revolution while feed per revolution is active? Asked of older controls only; newer
    /// ones tell the unit itself.
    pub feed_follows_mode: KnownFact<bool>,
    /// What is known of each path.
    paths: Vec<PathFacts>,
    /// What has not been answered yet, with the reason.
    pub open: Vec<(Question, String)>,
}

/// What is known of one path.
#[derive(Debug, Clone, PartialEq)]
struct PathFacts {
    path: u8,
    /// Names of the axes, in the order of every answer about axes.
    axes: KnownFact<Vec<String>>,
    /// Which of them turn.
    rotary: KnownFact<Vec<bool>>,
}

impl Facts {
    /// Nothing is known yet. `paths` are those that are read, the one that is written to first.
    #[must_use]
    pub fn from_opening(opening: Opening, paths: &[u8]) -> Self {
        let none =
            |path: &u8| PathFacts { path: *path, axes: Err(Absence::NotYetRead), rotary: Err(Absence::NotYetRead) };
        let older = matches!(opening.generation, Generation::Older(_));
        let own = paths.first().copied().unwrap_or(1);
        let mut questions = vec![FocasItem::System.to_question(own), INCH_MACHINE.to_question(own)];
        questions.extend(older.then(|| FEED_SHOWN.to_question(own)));
        questions
            .extend(paths.iter().flat_map(|path| [FocasItem::AxisNames, ROTARY].map(|item| item.to_question(*path))));
        Self {
            opening,
            system: None,
            inch: Err(Absence::NotYetRead),
            feed_follows_mode: if older { Err(Absence::NotYetRead) } else { Ok(false) },
            paths: paths.iter().map(none).collect(),
            open: questions.into_iter().map(|question| (question, "not asked yet".to_owned())).collect(),
        }
    }

    fn find_path(&self, path: u8) -> Option<&PathFacts> {
        self.paths.iter().find(|facts| facts.path == path)
    }

    /// Names of the axes of a path.
    ///
    /// # Errors
    /// Why they are not known.
    pub fn axes_of(&self, path: u8) -> KnownFact<&[String]> {
        let facts = self.find_path(path).ok_or(Absence::NotSupported)?;
        facts.axes.as_deref().map_err(|reason| *reason)
    }

    /// Every path with the names of its axes, the one that is written to first.
    pub fn list_axes(&self) -> impl Iterator<Item = (u8, KnownFact<&[String]>)> {
        self.paths.iter().map(|facts| (facts.path, facts.axes.as_deref().map_err(|reason| *reason)))
    }

    /// Which table of alarm types it has. The vendor's library does not tell the generation; the series does.
    #[must_use]
    pub fn alarm_table(&self) -> AlarmTable {
        let older = match (self.opening.generation, &self.system) {
            (Generation::Older(_), _) => true,
            (Generation::Newer(0), Some(system)) => {
                let zero_of_b = system.kind.trim_start_matches('0').is_empty() && system.series.starts_with('B');
                zero_of_b || matches!(system.kind.as_str(), "16" | "18" | "21")
            }
            _ => false,
        };
        if older { AlarmTable::Older } else { AlarmTable::Newer }
    }

    /// Does this axis, counted from 0, turn? A control that does not tell is taken for one without axes that turn.
    ///
    /// # Errors
    /// Why it is not known.
    pub fn is_rotary(&self, path: u8, axis: usize) -> KnownFact<bool> {
        let facts = self.find_path(path).ok_or(Absence::NotSupported)?;
        match &facts.rotary {
            Ok(rotary) => Ok(rotary.get(axis).copied().unwrap_or(false)),
            Err(reason) => Err(*reason),
        }
    }

    /// Takes the answer to one of the open questions.
    pub fn record_result(&mut self, question: Question, result: &FocasItemResult) {
        let settled = match result {
            Ok(answer) => self.record_answer(question, answer),
            Err(error) => is_final(error) && self.record_refusal(question),
        };
        self.open.retain(|(open, _)| *open != question);
        if !settled {
            let (why, reason) = match result {
                Ok(_) => ("another kind of answer".to_owned(), Absence::OutOfRange),
                Err(error) => (error.to_string(), error.to_absence()),
            };
            self.record_missing(question, reason);
            self.open.push((question, why));
        }
    }

    fn record_answer(&mut self, question: Question, answer: &FocasAnswer) -> bool {
        let bits = |value: &Option<f64>| value.unwrap_or(0.0).rem_euclid(256.0) as u8;
        match (question.item, answer) {
            (FocasItem::System, FocasAnswer::System(system)) => self.system = Some(system.clone()),
            (INCH_MACHINE, FocasAnswer::Data { values, .. }) => self.inch = Ok(values.first().map_or(0, bits) & 1 == 1),
            (FEED_SHOWN, FocasAnswer::Data { values, .. }) => {
                self.feed_follows_mode = Ok(values.first().map_or(0, bits) >> FEED_SHOWN_BIT & 1 == 1);
            }
            (FocasItem::AxisNames, FocasAnswer::Names(names)) => {
                self.update_path(question.path, |facts| facts.axes = Ok(names.clone()))
            }
            (ROTARY, FocasAnswer::Data { values, .. }) => {
                let rotary = values.iter().map(|value| bits(value) & 1 == 1).collect();
                self.update_path(question.path, |facts| facts.rotary = Ok(rotary));
            }
            _ => return false,
        }
        true
    }

    /// The control does not have it and never will: what that means.
    fn record_refusal(&mut self, question: Question) -> bool {
        match question.item {
            INCH_MACHINE => self.inch = Ok(false),
            FEED_SHOWN => self.feed_follows_mode = Ok(false),
            FocasItem::AxisNames => self.update_path(question.path, |facts| facts.axes = Err(Absence::NotSupported)),
            ROTARY => self.update_path(question.path, |facts| facts.rotary = Ok(Vec::new())),
            _ => {}
        }
        true
    }

    fn record_missing(&mut self, question: Question, reason: Absence) {
        match question.item {
            INCH_MACHINE => self.inch = Err(reason),
            FEED_SHOWN => self.feed_follows_mode = Err(reason),
            FocasItem::AxisNames => self.update_path(question.path, |facts| facts.axes = Err(reason)),
            ROTARY => self.update_path(question.path, |facts| facts.rotary = Err(reason)),
            _ => {}
        }
    }

    fn update_path(&mut self, path: u8, change: impl FnOnce(&mut PathFacts)) {
        if let Some(facts) = self.paths.iter_mut().find(|facts| facts.path == path) {
            change(facts);
        }
    }
}

/// Is there no use in asking again?
fn is_final(error: &FocasItemError) -> bool {
    match error {
        FocasItemError::Refused(refusal) if refusal.code == FocasReturnCode::PATH => false,
        FocasItemError::Refused(refusal) => {
            matches!(refusal.code.consequence(), Consequence::NotSupported | Consequence::Wrong)
        }
        FocasItemError::NotOffered => true,
        FocasItemError::Malformed(_) | FocasItemError::Failed(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::Refusal;

    fn facts(version: u16) -> Facts {
        let generation = Generation::from_version(version);
        let opening = Opening { generation, family: 5, axes_max: 8, spindles_max: 4, paths: 2, axes: 2, spindles: 1 };
        Facts::from_opening(opening, &[1, 2])
    }

    fn refusal(code: i16) -> FocasItemResult {
        Err(FocasItemError::Refused(Refusal { code: FocasReturnCode(code), detail: 0 }))
    }

    #[test]
    fn what_is_refused_for_now_stays_open_and_is_absent() {
        for code in [-1, -2, 7, 10, 11, 13] {
            let mut facts = facts(4);
            let open = facts.open.len();
            facts.record_result(INCH_MACHINE.to_question(1), &refusal(code));
            assert_eq!((facts.inch, facts.open.len()), (Err(Absence::Refused), open), "code {code}");
            facts.record_result(
                INCH_MACHINE.to_question(1),
                &Ok(FocasAnswer::Data { kind: 0, values: vec![Some(1.0)] }),
            );
            assert_eq!((facts.inch, facts.open.len()), (Ok(true), open - 1));
        }
    }

    #[test]
    fn what_a_control_never_has_is_settled() {
        for code in [1, 3, 6] {
            let mut facts = facts(2);
            for (question, _) in facts.open.clone() {
                facts.record_result(question, &refusal(code));
            }
            assert!(facts.open.is_empty(), "{:?}", facts.open);
            assert_eq!((facts.inch, facts.feed_follows_mode), (Ok(false), Ok(false)));
            assert_eq!(facts.axes_of(2), Err(Absence::NotSupported));
        }
    }

    #[test]
    fn bits_of_parameters() {
        let mut facts = facts(2);
        facts.record_result(FEED_SHOWN.to_question(1), &Ok(FocasAnswer::Data { kind: 0, values: vec![Some(8.0)] }));
        assert_eq!(facts.feed_follows_mode, Ok(true));
        facts.record_result(
            ROTARY.to_question(2),
            &Ok(FocasAnswer::Data { kind: 0, values: vec![Some(0.0), Some(5.0)] }),
        );
        assert_eq!((facts.is_rotary(2, 0), facts.is_rotary(2, 1)), (Ok(false), Ok(true)));
        assert_eq!(facts.is_rotary(1, 0), Err(Absence::NotYetRead));
    }
}
