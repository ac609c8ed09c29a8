//! Alarms and stops that one side has and the other has not.

use adapter_core::clock::{SECOND_NS, TimeNs};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Two spells that begin and end within this of each other are the same.
const SAME_NS: i64 = SECOND_NS;

/// What a spell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SpellKind {
    /// An alarm that stands.
    Alarm,
    /// A feed hold or tool change that is asked for.
    Stop,
}

/// Something that a script kept up for a while.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spell {
    /// An alarm that stands, or a stop that is asked for.
    pub kind: SpellKind,
    /// File name of the script that raised the alarm or asked for the stop.
    pub script: Arc<str>,
    /// Name of the alarm, or `feed_hold`, `tool_change`.
    pub name: Arc<str>,
    /// What the operator reads, or why it was asked for.
    pub text: Arc<str>,
    /// Level of the alarm; empty for a stop.
    pub level: &'static str,
    /// When it began, ns since 1970.
    pub from_ns: TimeNs,
    /// When it ended; `None`: not within the stretch.
    pub to_ns: Option<TimeNs>,
}

impl Spell {
    fn end_ns(&self) -> TimeNs {
        self.to_ns.unwrap_or(TimeNs::MAX)
    }

    fn key(&self) -> (SpellKind, Arc<str>, Arc<str>) {
        (self.kind, self.script.clone(), self.name.clone())
    }
}

/// By what it is known that the running scripts have an alarm or a stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Evidence {
    /// The history has it, and the running scripts have it over the stored samples too.
    Both,
    /// It was raised, but over the stored samples the running scripts do not raise it either.
    History,
    /// The running scripts have it over the stored samples; the history does not.
    Samples,
}

impl Evidence {
    /// The word in JSON.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Both => "both",
            Self::History => "history",
            Self::Samples => "samples",
        }
    }
}

/// A spell that only one of the two sets has, or that both have at other times.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SpellDifference {
    /// The running scripts have it, the edited ones do not.
    Lost(Spell, Evidence),
    /// The edited scripts have it, the running ones do not.
    Gained(Spell),
    /// Both have it, not at the same time: running, edited.
    Shifted(Spell, Spell),
}

impl SpellDifference {
    /// Beginning of the spell, ns since 1970; of a shifted one that of the running scripts.
    #[must_use]
    pub fn at_ns(&self) -> TimeNs {
        match self {
            Self::Lost(spell, _) | Self::Gained(spell) | Self::Shifted(spell, _) => spell.from_ns,
        }
    }

    /// The word in JSON.
    #[must_use]
    pub fn as_word(&self) -> &'static str {
        match self {
            Self::Lost(..) => "lost",
            Self::Gained(_) => "gained",
            Self::Shifted(..) => "shifted",
        }
    }
}

type SpellKey = (SpellKind, Arc<str>, Arc<str>);
type SpellTable<'a> = BTreeMap<SpellKey, Vec<&'a Spell>>;

fn group_by_key(spells: &[Spell]) -> SpellTable<'_> {
    let mut table = SpellTable::new();
    for spell in spells {
        table.entry(spell.key()).or_default().push(spell);
    }
    table
}

/// What is compared. Spells of one name do not overlap and come in the order of time.
pub(super) struct Sides<'a> {
    /// What the history says was raised. What was raised before the stretch cannot be lost to it.
    pub(super) recorded: &'a [Spell],
    /// What the running scripts did over the stored samples.
    pub(super) running: &'a [Spell],
    /// What the edited ones did over them.
    pub(super) edited: &'a [Spell],
    /// Beginning of the stretch.
    pub(super) from_ns: TimeNs,
    /// What begins and ends within this time of each other, or within a second, is the same.
    pub(super) near_ns: i64,
}

impl Sides<'_> {
    /// Every difference, in the order of time.
    #[must_use]
    pub(super) fn find_differences(&self) -> Vec<SpellDifference> {
        let tables = [self.recorded, self.running, self.edited].map(group_by_key);
        let keys: BTreeSet<&SpellKey> = tables.iter().flat_map(BTreeMap::keys).collect();
        let (from_ns, near_ns) = (self.from_ns, self.near_ns.max(SAME_NS));
        let mut found = Vec::new();
        for key in keys {
            let [recorded, running, edited] =
                tables.each_ref().map(|table| table.get(key).cloned().unwrap_or_default());
            Named { recorded, running, edited, from_ns, near_ns }.append_differences(&mut found);
        }
        found.sort_by_key(SpellDifference::at_ns);
        found
    }
}

/// The spells of one name.
struct Named<'a> {
    recorded: Vec<&'a Spell>,
    running: Vec<&'a Spell>,
    edited: Vec<&'a Spell>,
    from_ns: TimeNs,
    near_ns: i64,
}

impl Named<'_> {
    fn append_differences(&self, found: &mut Vec<SpellDifference>) {
        let mut named = BTreeSet::new();
        for spell in self.recorded.iter().filter(|spell| spell.from_ns >= self.from_ns) {
            let over_samples = self.find_longest_overlap(spell, &self.running);
            match self.find_longest_overlap(spell, &self.edited) {
                None => {
                    let evidence = if over_samples.is_some() { Evidence::Both } else { Evidence::History };
                    found.push(SpellDifference::Lost((*spell).clone(), evidence));
                    named.extend(over_samples);
                }
                // Where both sets have it over the stored samples, these are compared: storage has done the same to both.
                Some(at) if over_samples.is_none() => found.extend(self.find_shift(spell, self.edited[at])),
                Some(_) => {}
            }
        }
        for spell in self.running.iter().enumerate().filter(|(at, _)| !named.contains(at)).map(|(_, spell)| spell) {
            found.extend(self.of_running(spell));
        }
        let known = |spell: &&&Spell| {
            [&self.running, &self.recorded].into_iter().any(|others| self.find_longest_overlap(spell, others).is_some())
        };
        found.extend(self.edited.iter().filter(|it| !known(it)).map(|it| SpellDifference::Gained((*it).clone())));
    }

    fn of_running(&self, spell: &Spell) -> Option<SpellDifference> {
        match self.find_longest_overlap(spell, &self.edited) {
            Some(at) => self.find_shift(spell, self.edited[at]),
            None => {
                let raised = self.find_longest_overlap(spell, &self.recorded).is_some();
                let evidence = if raised { Evidence::Both } else { Evidence::Samples };
                Some(SpellDifference::Lost(spell.clone(), evidence))
            }
        }
    }

    fn find_shift(&self, spell: &Spell, edited: &Spell) -> Option<SpellDifference> {
        let far = |a: TimeNs, b: TimeNs| a.abs_diff(b) > self.near_ns.unsigned_abs();
        let shifted = far(spell.from_ns, edited.from_ns) || far(spell.end_ns(), edited.end_ns());
        shifted.then(|| SpellDifference::Shifted(spell.clone(), edited.clone()))
    }

    /// Of the others that stand at the same time, the place of the one that does so for longest.
    fn find_longest_overlap(&self, spell: &Spell, others: &[&Spell]) -> Option<usize> {
        let first = others.partition_point(|other| other.end_ns().saturating_add(self.near_ns) < spell.from_ns);
        let meets = |other: &Spell| other.from_ns <= spell.end_ns().saturating_add(self.near_ns);
        let common_ns =
            |other: &Spell| other.end_ns().min(spell.end_ns()).saturating_sub(other.from_ns.max(spell.from_ns));
        (first..others.len()).take_while(|at| meets(others[*at])).max_by_key(|at| common_ns(others[*at]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spell(name: &str, from_s: i64, to_s: Option<i64>) -> Spell {
        let (script, text) = (Arc::from("a.rhai"), Arc::from(""));
        let to_ns = to_s.map(|to_s| to_s * SECOND_NS);
        Spell {
            kind: SpellKind::Alarm,
            script,
            name: name.into(),
            text,
            level: "warning",
            from_ns: from_s * SECOND_NS,
            to_ns,
        }
    }

    fn differences(recorded: &[Spell], running: &[Spell], edited: &[Spell], near_ns: i64) -> Vec<SpellDifference> {
        Sides { recorded, running, edited, from_ns: 0, near_ns }.find_differences()
    }

    #[test]
    fn lost_gained_and_shifted() {
        let running =
            [spell("a", 0, Some(10)), spell("a", 100, Some(110)), spell("b", 50, None), spell("c", 5, Some(9))];
        let edited =
            [spell("a", 104, Some(111)), spell("b", 50, None), spell("d", 70, Some(71)), spell("c", 5, Some(9))];
        let found = differences(&[], &running, &edited, 0);
        let words: Vec<(&str, i64)> = found.iter().map(|it| (it.as_word(), it.at_ns() / SECOND_NS)).collect();
        assert_eq!(words, [("lost", 0), ("gained", 70), ("shifted", 100)]);
        assert!(differences(&[], &running, &running, 0).is_empty());
    }

    #[test]
    fn a_second_is_the_same_moment() {
        let (a, b) = ([spell("a", 10, Some(20))], [spell("a", 11, Some(19))]);
        assert!(differences(&[], &a, &b, 0).is_empty());
        let both = [spell("a", 0, Some(10)), spell("a", 11, Some(30))];
        assert!(differences(&[], &both, &both, 0).is_empty(), "the one before is near, but this one is the same");
        let (a, b) = ([spell("a", 10, Some(20))], [spell("a", 23, Some(25))]);
        assert_eq!(differences(&[], &a, &b, 0).len(), 2);
    }

    #[test]
    fn what_was_raised_is_lost_when_the_edited_scripts_do_not_raise_it_whatever_the_running_ones_do() {
        let recorded = [spell("a", 10, Some(12)), spell("a", 20, Some(22)), spell("a", 30, Some(32))];
        let running = [spell("a", 10, Some(12)), spell("a", 30, Some(32)), spell("a", 40, Some(42))];
        let edited = [spell("a", 30, Some(32)), spell("a", 50, Some(52))];
        let found = differences(&recorded, &running, &edited, 0);
        let words: Vec<(&str, i64)> = found.iter().map(|it| (it.as_word(), it.at_ns() / SECOND_NS)).collect();
        assert_eq!(words, [("lost", 10), ("lost", 20), ("lost", 40), ("gained", 50)]);
        let evidence =
            |it: &SpellDifference| if let SpellDifference::Lost(_, evidence) = it { Some(*evidence) } else { None };
        let by: Vec<_> = found.iter().filter_map(evidence).collect();
        assert_eq!(by, [Evidence::Both, Evidence::History, Evidence::Samples]);
        let before = [spell("a", -10, Some(12))];
        assert!(differences(&before, &[], &[], 0).is_empty(), "raised before the stretch");
        let found = differences(&before, &running[..1], &[], 0);
        assert!(matches!(found[..], [SpellDifference::Lost(_, Evidence::Both)]), "but it stood in it: {found:?}");
    }

    #[test]
    fn what_was_raised_is_not_gained_and_is_at_another_time_only_if_the_edit_did_that() {
        let (recorded, edited) = ([spell("a", 10, Some(20))], [spell("a", 10, Some(20))]);
        assert!(differences(&recorded, &[], &edited, 0).is_empty(), "the edited scripts raise what the rounding hid");
        let late = [spell("a", 14, Some(20))];
        assert!(differences(&recorded, &late, &late, 0).is_empty(), "both are late over the stored samples");
        let found = differences(&recorded, &[], &late, 0);
        assert!(matches!(&found[..], [SpellDifference::Shifted(..)]), "{found:?}");
        assert!(differences(&recorded, &[], &late, 5 * SECOND_NS).is_empty(), "within the pace of the samples");
    }
}
