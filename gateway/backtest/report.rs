//! What a backtest found, in words and as JSON (`backtest/1`).

use super::compare::{Evidence, Spell, SpellDifference};
use super::history_alarms::Recorded;
use super::lane::{Lane, RequestTotals};
use crate::lane::to_seconds;
use gateway_base::moment::format_utc;
use rules::script::ScriptProblem;
use serde_json::{Value, json};
use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

/// Differences written out in words; the JSON has all of them.
const SHOWN: usize = 200;

/// What a backtest found; written out as words, and as `backtest/1`.
pub struct BacktestReport {
    /// Path of the database that was read.
    pub history: PathBuf,
    /// First sample that was compared.
    pub from_ns: i64,
    /// Last sample that was compared, ns since 1970.
    pub to_ns: i64,
    /// Number of samples that were compared.
    pub rows: u64,
    /// Time they cover, gaps left out, s.
    pub covered_s: f64,
    /// Time in which the two ask for another feed, s.
    pub differing_s: f64,
    /// Alarms and stops, in the order of time.
    pub differences: Vec<SpellDifference>,
    /// Trials of the edited scripts that fail: with them they would not come into charge.
    pub trials: Vec<ScriptProblem>,
    /// The alarms that were raised then.
    pub recorded: Recorded,
    /// The scripts in charge.
    pub running: Lane,
    /// The scripts that were tried.
    pub edited: Lane,
    /// How long it took.
    pub took: Duration,
}

impl BacktestReport {
    /// Did the edited scripts lose an alarm or a stop, or fail?
    #[must_use]
    pub fn is_worse(&self) -> bool {
        !self.trials.is_empty() || !self.edited.problems().is_empty() || self.count_differences("lost") > 0
    }

    fn count_differences(&self, word: &str) -> usize {
        self.differences.iter().filter(|difference| difference.as_word() == word).count()
    }

    #[expect(clippy::cast_precision_loss, reason = "a rate")]
    fn rows_per_s(&self) -> f64 {
        self.rows as f64 / self.took.as_secs_f64().max(1e-9)
    }

    /// The document `backtest/1`, with every difference listed.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let listed = |word: &str| -> Vec<Value> {
            self.differences.iter().filter(|difference| difference.as_word() == word).map(difference_to_json).collect()
        };
        json!({
            "schema": "backtest/1",
            "history": self.history.display().to_string(),
            "from": format_utc(self.from_ns),
            "to": format_utc(self.to_ns),
            "rows": self.rows,
            "covered_s": self.covered_s,
            "recorded": recorded_to_json(&self.recorded),
            "running": lane_to_json(&self.running),
            "edited": lane_to_json(&self.edited),
            "failing_trials": self.trials.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "lost": listed("lost"),
            "gained": listed("gained"),
            "shifted": listed("shifted"),
            "override_differs_s": self.differing_s,
            "seconds_per_state": self.compare_state_seconds().map(|(state, running, edited)| {
                json!({ "state": state, "running_s": running, "edited_s": edited })
            }).collect::<Vec<_>>(),
            "took_s": self.took.as_secs_f64(),
            "rows_per_s": self.rows_per_s().round(),
        })
    }

    /// State, seconds with the running scripts, seconds with the edited ones.
    fn compare_state_seconds(&self) -> impl Iterator<Item = (&'static str, f64, f64)> {
        let (running, edited) = (self.running.seconds_per_state(), self.edited.seconds_per_state());
        running.into_iter().zip(edited).map(|((state, running), (_, edited))| (state, running, edited))
    }
}

fn recorded_to_json(recorded: &Recorded) -> Value {
    let others = recorded.others.iter().map(
        |(script, other)| json!({ "script": script, "alarms": other.alarms, "until": other.until_ns.map(format_utc) }),
    );
    json!({
        "alarms": recorded.spells().len(),
        "others": others.collect::<Vec<_>>(),
        "unknown_until": recorded.unknown_until_ns.map(format_utc),
        "more": recorded.more,
    })
}

fn lane_to_json(lane: &Lane) -> Value {
    let RequestTotals { least_pct, greatest_pct, times, .. } = *lane.request_totals();
    json!({
        "scripts": lane.script_count(),
        "alarms_and_stops": lane.spells().len(),
        "left_out": lane.left_out(),
        "notes": lane.note_count(),
        "override": {
            "times": times,
            "seconds": lane.request_totals().duration_s(),
            "mean_pct": lane.request_totals().mean_pct(),
            "least_pct": least_pct,
            "greatest_pct": greatest_pct,
        },
        "failed": lane.problems().iter().map(ScriptProblem::to_string).collect::<Vec<_>>(),
    })
}

fn difference_to_json(difference: &SpellDifference) -> Value {
    match difference {
        SpellDifference::Lost(one, evidence) => {
            let mut told = spell_to_json(one);
            told["evidence"] = evidence.as_word().into();
            told
        }
        SpellDifference::Gained(one) => spell_to_json(one),
        SpellDifference::Shifted(running, edited) => {
            json!({ "running": spell_to_json(running), "edited": spell_to_json(edited) })
        }
    }
}

fn spell_to_json(spell: &Spell) -> Value {
    json!({
        "name": &*spell.name, "script": &*spell.script, "level": spell.level, "text": &*spell.text,
        "from": format_utc(spell.from_ns), "to": spell.to_ns.map(format_utc),
        "seconds": spell.to_ns.map(|to_ns| to_seconds(to_ns - spell.from_ns)),
    })
}

fn format_spell(spell: &Spell) -> String {
    let lasted = spell
        .to_ns
        .map_or_else(|| "to the end".to_owned(), |to_ns| format!("{:.1} s", to_seconds(to_ns - spell.from_ns)));
    format!("{} ({}) at {}, {lasted}: {}", spell.name, spell.script, format_utc(spell.from_ns), spell.text)
}

fn describe_evidence(evidence: Evidence) -> &'static str {
    match evidence {
        Evidence::Both => "",
        Evidence::History => " (raised then; over the stored samples the running scripts do not raise it either)",
        Evidence::Samples => " (over the stored samples; the history does not have it)",
    }
}

impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(until_ns) = self.unknown_until_ns {
            let until = format_utc(until_ns);
            writeln!(
                f,
                "  until {until} the history does not say whose its alarms are: they are taken for the running scripts'"
            )?;
        }
        for (script, other) in &self.others {
            if let Some(until_ns) = other.until_ns {
                let until = format_utc(until_ns);
                writeln!(
                    f,
                    "  until {until} {script} was another one or not in charge: compared is what it does over the stored samples"
                )?;
            }
            if other.alarms > 0 {
                writeln!(f, "  not compared: {} alarms of another {script} in the history", other.alarms)?;
            }
        }
        if self.more {
            writeln!(f, "  the history has more alarms than are compared, the newest: take a shorter stretch")?;
        }
        Ok(())
    }
}

impl fmt::Display for BacktestReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (from, to, hours) = (format_utc(self.from_ns), format_utc(self.to_ns), self.covered_s / 3600.0);
        writeln!(f, "{from} to {to}: {} samples, {hours:.2} h ({:.0} samples/s)", self.rows, self.rows_per_s())?;
        let [lost, gained, shifted] = ["lost", "gained", "shifted"].map(|word| self.count_differences(word));
        writeln!(f, "alarms and stops: {lost} lost, {gained} gained, {shifted} at another time")?;
        for trial in &self.trials {
            writeln!(f, "  FAILED  {}", trial.to_string().replace('\n', "\n  "))?;
        }
        if !self.trials.is_empty() {
            writeln!(f, "  {} trials fail: the edited scripts would not come into charge", self.trials.len())?;
        }
        write!(f, "{}", self.recorded)?;
        for difference in self.differences.iter().take(SHOWN) {
            match difference {
                SpellDifference::Lost(spell, evidence) => {
                    writeln!(f, "  lost    {}{}", format_spell(spell), describe_evidence(*evidence))?
                }
                SpellDifference::Gained(spell) => writeln!(f, "  gained  {}", format_spell(spell))?,
                SpellDifference::Shifted(running, edited) => {
                    let later_s = to_seconds(edited.from_ns - running.from_ns);
                    writeln!(f, "  shifted {}; with the edited scripts {later_s:+.1} s", format_spell(running))?;
                }
            }
        }
        if self.differences.len() > SHOWN {
            writeln!(f, "  and {} more: --json has all of them", self.differences.len() - SHOWN)?;
        }
        for (name, lane) in [("running", &self.running), ("edited", &self.edited)] {
            let asked = lane.request_totals();
            let pct = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |pct| format!("{pct:.1} %"));
            let (mean, least) = (pct(asked.mean_pct()), pct(asked.least_pct));
            writeln!(f, "override, {name}: {:.0} s, mean {mean}, least {least}", asked.duration_s())?;
            if lane.left_out() > 0 {
                writeln!(
                    f,
                    "  {} further alarms and stops, {name}, were not kept: take a shorter stretch",
                    lane.left_out()
                )?;
            }
            lane.problems().iter().try_for_each(|problem| writeln!(f, "  {name} scripts failed: {problem}"))?;
        }
        writeln!(f, "another feed is asked for during {:.0} s", self.differing_s)?;
        for (state, running, edited) in self.compare_state_seconds().filter(|(_, a, b)| *a > 0.0 || *b > 0.0) {
            writeln!(f, "{state:>14} {running:>12.1} s {:>+12.1} s", edited - running)?;
        }
        Ok(())
    }
}
