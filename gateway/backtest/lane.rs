//! What one set of scripts did on its way through the history.

use super::compare::{Spell, SpellKind};

use adapter_core::clock::{SECOND_NS, TimeNs};
use gateway_pipeline::Tally;
use rules::estimators::State;
use rules::script::{Decision, OverrideRequest, ScriptProblem, StopRequest};
use std::sync::Arc;

/// A longer step between two samples is a gap.
pub(super) const STEP_MAX_NS: i64 = 10 * SECOND_NS;
/// At most so many alarms and stops are listed; further ones are counted.
const SPELLS_MAX: usize = 100_000;
/// Requests nearer to each other than this are the same, %.
const SAME_PCT: f64 = 0.5;
/// Further problems of the scripts are not kept.
const PROBLEMS_MAX: usize = 20;

/// What was asked for in all.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RequestTotals {
    /// For how long, ns.
    asked_ns: i64,
    /// Least request of a feed override, %; `None`: nothing was asked for.
    pub least_pct: Option<f64>,
    /// Greatest request of a feed override, %; `None`: nothing was asked for.
    pub greatest_pct: Option<f64>,
    integral: f64,
    /// How often a request began.
    pub times: u64,
}

impl RequestTotals {
    fn add(&mut self, pct: Option<f64>, before: Option<f64>, step_ns: i64) {
        let Some(pct) = pct.filter(|pct| pct.is_finite()) else { return };
        self.times += u64::from(before.is_none());
        self.asked_ns += step_ns;
        self.integral += pct * to_seconds(step_ns);
        self.least_pct = Some(self.least_pct.map_or(pct, |least| least.min(pct)));
        self.greatest_pct = Some(self.greatest_pct.map_or(pct, |greatest| greatest.max(pct)));
    }

    /// For how long, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        to_seconds(self.asked_ns)
    }

    /// Mean over that time, %.
    #[must_use]
    pub fn mean_pct(&self) -> Option<f64> {
        (self.asked_ns > 0).then(|| self.integral / self.duration_s())
    }
}

/// What one set of scripts did so far.
pub struct Lane {
    from_ns: TimeNs,
    scripts: usize,
    tally: Tally,
    spells: Vec<Spell>,
    /// Spells that have begun, by place in `spells`.
    open: Vec<usize>,
    left_out: u64,
    request_totals: RequestTotals,
    pct: Option<f64>,
    notes: u64,
    problems: Vec<ScriptProblem>,
}

impl Lane {
    /// Of so many scripts, compared from `from_ns` on; what happens before counts for nothing.
    pub(super) fn new(from_ns: TimeNs, scripts: usize) -> Self {
        Self {
            from_ns,
            scripts,
            tally: Tally::default(),
            spells: Vec::new(),
            open: Vec::new(),
            left_out: 0,
            request_totals: RequestTotals::default(),
            pct: None,
            notes: 0,
            problems: Vec::new(),
        }
    }

    /// What the parts of the set have decided together at this time.
    pub(super) fn record_tick(&mut self, at_ns: TimeNs, step_ns: i64, state: State, decisions: &[&Decision]) {
        for decision in decisions {
            self.record_decision(at_ns, decision);
        }
        self.update_stops(at_ns, decisions);
        let requests = decisions.iter().filter_map(|decision| decision.request.as_ref());
        let pct = OverrideRequest::find_least(requests).map(|request| request.pct);
        let before = std::mem::replace(&mut self.pct, pct);
        if at_ns >= self.from_ns {
            self.tally.count_tick(at_ns, state);
            self.request_totals.add(self.pct, before, step_ns);
        }
    }

    fn record_decision(&mut self, at_ns: TimeNs, decision: &Decision) {
        for change in &decision.alarms {
            let named = |spell: &Spell| {
                spell.kind == SpellKind::Alarm && *spell.name == *change.name && *spell.script == *change.script
            };
            if change.raised {
                let (script, name, text) = (change.script.clone(), change.name.clone(), change.en.clone());
                let level = change.level.as_word();
                self.begin_spell(Spell {
                    kind: SpellKind::Alarm,
                    script,
                    name,
                    text,
                    level,
                    from_ns: at_ns,
                    to_ns: None,
                });
            } else {
                self.finish_spells(at_ns, named);
            }
        }
        if at_ns >= self.from_ns {
            self.notes += decision.notes.len() as u64;
        }
        let room = PROBLEMS_MAX.saturating_sub(self.problems.len());
        self.problems.extend(decision.problems.iter().take(room).cloned());
    }

    /// A stop lasts for as long as it is asked for; of requests that are the same, the first script's words count.
    fn update_stops(&mut self, at_ns: TimeNs, decisions: &[&Decision]) {
        let mut asked: Vec<&StopRequest> = decisions.iter().flat_map(|decision| &decision.stops).collect();
        asked.sort_by_key(|request| request.script.clone());
        self.finish_spells(at_ns, |spell| {
            spell.kind == SpellKind::Stop && !asked.iter().any(|request| is_spell_of(spell, request))
        });
        for request in asked {
            if !self.open.iter().any(|at| is_spell_of(&self.spells[*at], request)) {
                self.begin_spell(Spell {
                    kind: SpellKind::Stop,
                    script: request.script.clone(),
                    name: Arc::from(request.stop.as_word()),
                    text: request.reason.clone(),
                    level: "",
                    from_ns: at_ns,
                    to_ns: None,
                });
            }
        }
    }

    fn begin_spell(&mut self, spell: Spell) {
        if self.spells.len() >= SPELLS_MAX {
            self.left_out += 1;
            return;
        }
        self.open.push(self.spells.len());
        self.spells.push(spell);
    }

    fn finish_spells(&mut self, at_ns: TimeNs, which: impl Fn(&Spell) -> bool) {
        let spells = &mut self.spells;
        self.open.retain(|at| {
            let over = which(&spells[*at]);
            if over {
                spells[*at].to_ns = Some(at_ns);
            }
            !over
        });
    }

    /// The stretch is over; what ended before it began is forgotten.
    pub(super) fn clip_to_stretch(&mut self) {
        let from_ns = self.from_ns;
        self.spells.retain(|spell| spell.to_ns.is_none_or(|to_ns| to_ns >= from_ns));
        self.spells.iter_mut().for_each(|spell| spell.from_ns = spell.from_ns.max(from_ns));
        self.open.clear();
    }

    pub(super) fn requested_pct(&self) -> Option<f64> {
        self.pct
    }

    /// Alarms and stops, in the order in which they began.
    #[must_use]
    pub fn spells(&self) -> &[Spell] {
        &self.spells
    }

    /// What was asked for.
    #[must_use]
    pub fn request_totals(&self) -> &RequestTotals {
        &self.request_totals
    }

    /// Every state with its seconds.
    #[must_use]
    pub fn seconds_per_state(&self) -> Vec<(&'static str, f64)> {
        self.tally.seconds_per_state()
    }

    /// Number of notes that the scripts wrote in the compared stretch.
    #[must_use]
    pub fn note_count(&self) -> u64 {
        self.notes
    }

    /// Scripts that failed on the way.
    #[must_use]
    pub fn problems(&self) -> &[ScriptProblem] {
        &self.problems
    }

    /// How many scripts there are.
    #[must_use]
    pub fn script_count(&self) -> usize {
        self.scripts
    }

    /// Alarms and stops beyond those that are listed.
    #[must_use]
    pub fn left_out(&self) -> u64 {
        self.left_out
    }
}

/// Is it another request? No request is the programmed feed.
pub(super) fn requests_differ(a: Option<f64>, b: Option<f64>) -> bool {
    let (a, b) = (a.unwrap_or(100.0), b.unwrap_or(100.0));
    (a - b).abs() > SAME_PCT || a.is_finite() != b.is_finite()
}
/// Is this the time in which this request is made?
fn is_spell_of(spell: &Spell, request: &StopRequest) -> bool {
    spell.kind == SpellKind::Stop
        && *spell.name == *request.stop.as_word()
        && request.stop.is_same_request(&spell.text, &request.reason)
}

#[expect(clippy::cast_precision_loss, reason = "2^53 ns are a hundred days; beyond that microseconds suffice")]
pub(crate) fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}
