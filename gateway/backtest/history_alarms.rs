//! The alarms that scripts really raised, as the history has them, and which versions of the scripts raised them.
//!
//! A sample is rounded when it is stored, the estimators begin with empty memory, and a live script may be left out: an alarm
//! that was raised on the machine need not be raised over the stored samples. What the edited scripts lose is therefore told
//! against what was raised, as far as the scripts that raised it are the running ones.

use super::compare::{Spell, SpellKind};
use adapter_core::clock::TimeNs;
use gateway_history::{AlarmEntry, Event, HistoryError, Reader, RecordSpan};
use gateway_scripts::active_scripts::{self, Versions};
use rules::script::{AlarmLevel, SCRIPT_STOPPED, ScriptSet};
use std::collections::BTreeMap;

/// At most so many alarms and so many changes of scripts are read, the newest.
const READ_MAX: u32 = 100_000;
/// How the file names of scripts end, which is what tells their alarms from those of other parts of the box.
const END: &str = ".rhai";

/// Alarms of a script that are not compared, or a time in which it was another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Other {
    /// Alarms that the history holds of another version, or of a script that is not among the running ones.
    pub alarms: u64,
    /// Until when another version was in charge, or none; `None`: at no time in the stretch.
    pub until_ns: Option<TimeNs>,
}

/// What the history holds.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recorded {
    spells: Vec<Spell>,
    /// By file name: what was raised by others.
    pub others: BTreeMap<String, Other>,
    /// Until this time the history does not say which versions were in charge; its alarms are taken for theirs.
    pub unknown_until_ns: Option<TimeNs>,
    /// There are more alarms than are read.
    pub more: bool,
}

/// The running scripts that an edit can concern: all of them when the settings of the estimators differ, otherwise those that
/// are not the same in both sets.
pub(super) struct Concerned {
    running: Versions,
    same: Vec<String>,
}

impl Concerned {
    pub(super) fn from_sets(running: &ScriptSet, edited: &ScriptSet) -> Self {
        let versions = |set: &ScriptSet| -> Versions {
            set.versions().map(|(file, version)| (file.to_owned(), version)).collect()
        };
        let (running_versions, edited_versions) = (versions(running), versions(edited));
        let shared = running.settings() == edited.settings();
        let same = |file: &&String| shared && running_versions.get(*file) == edited_versions.get(*file);
        Self { same: running_versions.keys().filter(same).cloned().collect(), running: running_versions }
    }

    fn is_same(&self, file: &str) -> bool {
        self.same.iter().any(|same| same == file)
    }

    /// The running scripts that are not the same in both sets.
    fn changed_files(&self) -> impl Iterator<Item = &String> {
        self.running.keys().filter(|file| !self.is_same(file))
    }
}

/// Which versions were in charge from when on.
struct Timeline(Vec<(TimeNs, Versions)>);

impl Timeline {
    fn read(reader: &Reader, from_ns: TimeNs, to_ns: TimeNs) -> Result<Self, HistoryError> {
        let before = reader.events_of(active_scripts::KIND, RecordSpan::between(TimeNs::MIN, from_ns, 1))?;
        let within = reader.events_of(active_scripts::KIND, RecordSpan::between(from_ns, to_ns, READ_MAX))?;
        let versions = |event: Event| Some((event.at_ns, active_scripts::parse_versions(&event)?));
        Ok(Self(before.into_iter().chain(within).filter_map(versions).collect()))
    }

    /// The versions in charge at this time; `None` where the history does not say.
    fn versions_at(&self, at_ns: TimeNs) -> Option<&Versions> {
        let after = self.0.partition_point(|(since_ns, _)| *since_ns <= at_ns);
        Some(&self.0.get(after.checked_sub(1)?)?.1)
    }

    fn begins_ns(&self) -> Option<TimeNs> {
        self.0.first().map(|(since_ns, _)| *since_ns)
    }

    /// Until when the script of this name was not this version.
    fn other_until_ns(&self, file: &str, version: u64, from_ns: TimeNs, to_ns: TimeNs) -> Option<TimeNs> {
        let ends = self.0.iter().skip(1).map(|(since_ns, _)| *since_ns).chain([to_ns]);
        let spells = self.0.iter().zip(ends).filter(|(_, end_ns)| *end_ns > from_ns);
        spells.filter(|((_, versions), _)| versions.get(file) != Some(&version)).map(|(_, end_ns)| end_ns).last()
    }
}

/// Reads what was raised from `from_ns` to `to_ns`, both included, and what was raised before and stood then.
pub(super) fn read(
    reader: &Reader,
    concerned: &Concerned,
    from_ns: TimeNs,
    to_ns: TimeNs,
) -> Result<Recorded, HistoryError> {
    let after_ns = to_ns.saturating_add(1);
    let timeline = Timeline::read(reader, from_ns, after_ns)?;
    let mut recorded = Recorded::default();
    let alarms = reader.read_alarms(RecordSpan::between(from_ns, after_ns, READ_MAX))?;
    recorded.more = alarms.len() >= READ_MAX as usize;
    for alarm in alarms {
        if alarm.source.ends_with(END) && alarm.code != SCRIPT_STOPPED {
            recorded.record_alarm(concerned, &timeline, alarm, to_ns);
        }
    }
    for (file, version) in concerned.changed_files().filter_map(|file| Some((file, *concerned.running.get(file)?))) {
        if let Some(until_ns) = timeline.other_until_ns(file, version, from_ns, to_ns) {
            recorded.others.entry(file.clone()).or_default().until_ns = Some(until_ns);
        }
    }
    let known_ns = timeline.begins_ns().unwrap_or(TimeNs::MAX);
    let unknown = known_ns > from_ns && concerned.changed_files().next().is_some();
    recorded.unknown_until_ns = unknown.then_some(known_ns.min(to_ns));
    Ok(recorded)
}

impl Recorded {
    /// Alarms of the running scripts that the edit can concern, in the order in which they were raised; the first ones may
    /// have been raised before the stretch.
    #[must_use]
    pub fn spells(&self) -> &[Spell] {
        &self.spells
    }

    fn record_alarm(&mut self, concerned: &Concerned, timeline: &Timeline, alarm: AlarmEntry, to_ns: TimeNs) {
        if concerned.is_same(&alarm.source) {
            return;
        }
        let running = concerned.running.get(&alarm.source);
        let raised_by = timeline.versions_at(alarm.raised_ns).map(|versions| versions.get(&alarm.source));
        if running.is_none() || raised_by.is_some_and(|version| version != running) {
            self.others.entry(alarm.source).or_default().alarms += 1;
        } else {
            self.spells.push(spell_from_alarm(&alarm, to_ns));
        }
    }
}

/// What stood at the end of the stretch has no end, as in the lanes.
fn spell_from_alarm(alarm: &AlarmEntry, to_ns: TimeNs) -> Spell {
    Spell {
        kind: SpellKind::Alarm,
        script: alarm.source.as_str().into(),
        name: alarm.code.as_str().into(),
        text: alarm.en.as_str().into(),
        level: AlarmLevel::from_word(&alarm.severity).map_or("", AlarmLevel::as_word),
        from_ns: alarm.raised_ns,
        to_ns: alarm.cleared_ns.filter(|cleared_ns| *cleared_ns <= to_ns),
    }
}
