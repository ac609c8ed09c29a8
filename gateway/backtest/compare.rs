//! Alarms and stops that one side has and the other has not.

use adapters::clock::{SECOND_NS, TimeNs};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Two spells that begin and end within this of each other are the same.
const SAME_NS: i64 = SECOND_NS;

/// What a spell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// An alarm that stands.
    Alarm,
    /// A feed hold or tool change that is asked for.
    Stop,
}

/// Something that a script kept up for a while.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spell {
    /// What it is.
    pub kind: Kind,
    /// Which script.
    pub script: Arc<str>,
    /// Name of the alarm, or `feed_hold`, `tool_change`.
    pub name: Arc<str>,
    /// What the operator reads, or why it was asked for.
    pub text: Arc<str>,
    /// Level of the alarm; empty for a stop.
    pub level: &'static str,
    /// When it began.
    pub from_ns: TimeNs,
    /// When it ended; `None`: not within the stretch.
    pub to_ns: Option<TimeNs>,
}

impl Spell {
    fn end_ns(&self) -> TimeNs {
        self.to_ns.unwrap_or(TimeNs::MAX)
    }

    fn key(&self) -> (Kind, Arc<str>, Arc<str>) {
        (self.kind, self.script.clone(), self.name.clone())
    }
}

/// One difference.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Difference {
    /// The running scripts have it, the edited ones do not.
    Lost(Spell),
    /// The edited scripts have it, the running ones do not.
    Gained(Spell),
    /// Both have it, not at the same time: running, edited.
    Shifted(Spell, Spell),
}

impl Difference {
    /// When it begins.
    #[must_use]
    pub fn at_ns(&self) -> TimeNs {
        match self {
            Self::Lost(spell) | Self::Gained(spell) | Self::Shifted(spell, _) => spell.from_ns,
        }
    }

    /// The word in JSON.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Lost(_) => "lost",
            Self::Gained(_) => "gained",
            Self::Shifted(..) => "shifted",
        }
    }
}

type Table<'a> = BTreeMap<(Kind, Arc<str>, Arc<str>), Vec<&'a Spell>>;

fn table(spells: &[Spell]) -> Table<'_> {
    let mut table = Table::new();
    for spell in spells {
        table.entry(spell.key()).or_default().push(spell);
    }
    table
}

/// Every difference, in the order of time. Spells of one name do not overlap and come in the order of time.
#[must_use]
pub(super) fn differences(running: &[Spell], edited: &[Spell]) -> Vec<Difference> {
    let (before, after) = (table(running), table(edited));
    let none = Vec::new();
    let mut found = Vec::new();
    for (key, spells) in &before {
        let others = after.get(key).unwrap_or(&none);
        found.extend(spells.iter().filter_map(|spell| of_running(spell, others)));
    }
    for (key, spells) in &after {
        let others = before.get(key).unwrap_or(&none);
        let gained = spells.iter().filter(|spell| meeting(spell, others).is_none());
        found.extend(gained.map(|spell| Difference::Gained((*spell).clone())));
    }
    found.sort_by_key(Difference::at_ns);
    found
}

fn of_running(spell: &Spell, edited: &[&Spell]) -> Option<Difference> {
    match meeting(spell, edited) {
        None => Some(Difference::Lost(spell.clone())),
        Some(other) => {
            let far = |a: TimeNs, b: TimeNs| a.abs_diff(b) > SAME_NS.unsigned_abs();
            let shifted = far(spell.from_ns, other.from_ns) || far(spell.end_ns(), other.end_ns());
            shifted.then(|| Difference::Shifted(spell.clone(), other.clone()))
        }
    }
}

/// Of the others that stand at the same time, the one that does so for longest.
fn meeting<'a>(spell: &Spell, others: &[&'a Spell]) -> Option<&'a Spell> {
    let first = others.partition_point(|other| other.end_ns().saturating_add(SAME_NS) < spell.from_ns);
    let meets = |other: &&&Spell| other.from_ns <= spell.end_ns().saturating_add(SAME_NS);
    let common_ns = |other: &Spell| other.end_ns().min(spell.end_ns()).saturating_sub(other.from_ns.max(spell.from_ns));
    others[first..].iter().take_while(meets).max_by_key(|other| common_ns(other)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spell(name: &str, from_s: i64, to_s: Option<i64>) -> Spell {
        let (script, text) = (Arc::from("a.rhai"), Arc::from(""));
        let to_ns = to_s.map(|to_s| to_s * SECOND_NS);
        Spell {
            kind: Kind::Alarm,
            script,
            name: name.into(),
            text,
            level: "warning",
            from_ns: from_s * SECOND_NS,
            to_ns,
        }
    }

    #[test]
    fn lost_gained_and_shifted() {
        let running =
            [spell("a", 0, Some(10)), spell("a", 100, Some(110)), spell("b", 50, None), spell("c", 5, Some(9))];
        let edited =
            [spell("a", 104, Some(111)), spell("b", 50, None), spell("d", 70, Some(71)), spell("c", 5, Some(9))];
        let found = differences(&running, &edited);
        let words: Vec<(&str, i64)> = found.iter().map(|it| (it.word(), it.at_ns() / SECOND_NS)).collect();
        assert_eq!(words, [("lost", 0), ("gained", 70), ("shifted", 100)]);
        assert!(differences(&running, &running).is_empty());
    }

    #[test]
    fn a_second_is_the_same_moment() {
        let (a, b) = ([spell("a", 10, Some(20))], [spell("a", 11, Some(19))]);
        assert!(differences(&a, &b).is_empty());
        let both = [spell("a", 0, Some(10)), spell("a", 11, Some(30))];
        assert!(differences(&both, &both).is_empty(), "the one before is near, but this one is the same");
        let (a, b) = ([spell("a", 10, Some(20))], [spell("a", 23, Some(25))]);
        assert_eq!(differences(&a, &b).len(), 2);
    }
}
