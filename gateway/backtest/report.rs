//! What a backtest found, in words and as JSON (`backtest/1`).

use super::compare::{Evidence, Spell, SpellDifference};
use super::lane::{Lane, RequestTotals};
use super::recorded::Recorded;
use super::seconds;
use crate::moment::utc;
use rules::script::ScriptProblem;
use serde_json::{Value, json};
use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

/// Differences written out in words; the JSON has all of them.
const SHOWN: usize = 200;

/// What a backtest found; written out as words, and as `backtest/1`.
pub struct BacktestReport {
    /// The history.
    pub history: PathBuf,
    /// First sample that was compared.
    pub from_ns: i64,
    /// Last sample.
    pub to_ns: i64,
    /// Samples compared.
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
    pub fn worse(&self) -> bool {
        !self.trials.is_empty() || !self.edited.problems().is_empty() || self.count("lost") > 0
    }

    fn count(&self, word: &str) -> usize {
        self.differences.iter().filter(|difference| difference.word() == word).count()
    }

    #[expect(clippy::cast_precision_loss, reason = "a rate")]
    fn rows_per_s(&self) -> f64 {
        self.rows as f64 / self.took.as_secs_f64().max(1e-9)
    }

    /// The whole report.
    #[must_use]
    pub fn json(&self) -> Value {
        let listed = |word: &str| -> Vec<Value> {
            self.differences.iter().filter(|difference| difference.word() == word).map(difference).collect()
        };
        json!({
            "schema": "backtest/1",
            "history": self.history.display().to_string(),
            "from": utc(self.from_ns),
            "to": utc(self.to_ns),
            "rows": self.rows,
            "covered_s": self.covered_s,
            "recorded": recorded_to_json(&self.recorded),
            "running": lane(&self.running),
            "edited": lane(&self.edited),
            "failing_trials": self.trials.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "lost": listed("lost"),
            "gained": listed("gained"),
            "shifted": listed("shifted"),
            "override_differs_s": self.differing_s,
            "seconds_per_state": self.states().map(|(state, running, edited)| {
                json!({ "state": state, "running_s": running, "edited_s": edited })
            }).collect::<Vec<_>>(),
            "took_s": self.took.as_secs_f64(),
            "rows_per_s": self.rows_per_s().round(),
        })
    }

    /// State, seconds with the running scripts, seconds with the edited ones.
    fn states(&self) -> impl Iterator<Item = (&'static str, f64, f64)> {
        let (running, edited) = (self.running.seconds_per_state(), self.edited.seconds_per_state());
        running.into_iter().zip(edited).map(|((state, running), (_, edited))| (state, running, edited))
    }
}

fn recorded_to_json(recorded: &Recorded) -> Value {
    let others = recorded
        .others
        .iter()
        .map(|(script, other)| json!({ "script": script, "alarms": other.alarms, "until": other.until_ns.map(utc) }));
    json!({
        "alarms": recorded.spells().len(),
        "others": others.collect::<Vec<_>>(),
        "unknown_until": recorded.unknown_until_ns.map(utc),
        "more": recorded.more,
    })
}

fn lane(lane: &Lane) -> Value {
    let RequestTotals { least_pct, greatest_pct, times, .. } = *lane.asked();
    json!({
        "scripts": lane.scripts(),
        "alarms_and_stops": lane.spells().len(),
        "left_out": lane.left_out(),
        "notes": lane.notes(),
        "override": {
            "times": times,
            "seconds": lane.asked().seconds(),
            "mean_pct": lane.asked().mean_pct(),
            "least_pct": least_pct,
            "greatest_pct": greatest_pct,
        },
        "failed": lane.problems().iter().map(ScriptProblem::to_string).collect::<Vec<_>>(),
    })
}

fn difference(difference: &SpellDifference) -> Value {
    match difference {
        SpellDifference::Lost(one, evidence) => {
            let mut told = spell(one);
            told["evidence"] = evidence.word().into();
            told
        }
        SpellDifference::Gained(one) => spell(one),
        SpellDifference::Shifted(running, edited) => json!({ "running": spell(running), "edited": spell(edited) }),
    }
}

fn spell(spell: &Spell) -> Value {
    json!({
        "name": &*spell.name, "script": &*spell.script, "level": spell.level, "text": &*spell.text,
        "from": utc(spell.from_ns), "to": spell.to_ns.map(utc),
        "seconds": spell.to_ns.map(|to_ns| seconds(to_ns - spell.from_ns)),
    })
}

fn line(spell: &Spell) -> String {
    let lasted =
        spell.to_ns.map_or_else(|| "to the end".to_owned(), |to_ns| format!("{:.1} s", seconds(to_ns - spell.from_ns)));
    format!("{} ({}) at {}, {lasted}: {}", spell.name, spell.script, utc(spell.from_ns), spell.text)
}

fn remark(evidence: Evidence) -> &'static str {
    match evidence {
        Evidence::Both => "",
        Evidence::History => " (raised then; over the stored samples the running scripts do not raise it either)",
        Evidence::Samples => " (over the stored samples; the history does not have it)",
    }
}

impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(until_ns) = self.unknown_until_ns {
            let until = utc(until_ns);
            writeln!(
                f,
                "  until {until} the history does not say whose its alarms are: they are taken for the running scripts'"
            )?;
        }
        for (script, other) in &self.others {
            if let Some(until_ns) = other.until_ns {
                let until = utc(until_ns);
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
        let (from, to, hours) = (utc(self.from_ns), utc(self.to_ns), self.covered_s / 3600.0);
        writeln!(f, "{from} to {to}: {} samples, {hours:.2} h ({:.0} samples/s)", self.rows, self.rows_per_s())?;
        let [lost, gained, shifted] = ["lost", "gained", "shifted"].map(|word| self.count(word));
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
                    writeln!(f, "  lost    {}{}", line(spell), remark(*evidence))?
                }
                SpellDifference::Gained(spell) => writeln!(f, "  gained  {}", line(spell))?,
                SpellDifference::Shifted(running, edited) => {
                    let later_s = seconds(edited.from_ns - running.from_ns);
                    writeln!(f, "  shifted {}; with the edited scripts {later_s:+.1} s", line(running))?;
                }
            }
        }
        if self.differences.len() > SHOWN {
            writeln!(f, "  and {} more: --json has all of them", self.differences.len() - SHOWN)?;
        }
        for (name, lane) in [("running", &self.running), ("edited", &self.edited)] {
            let asked = lane.asked();
            let pct = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |pct| format!("{pct:.1} %"));
            let (mean, least) = (pct(asked.mean_pct()), pct(asked.least_pct));
            writeln!(f, "override, {name}: {:.0} s, mean {mean}, least {least}", asked.seconds())?;
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
        for (state, running, edited) in self.states().filter(|(_, a, b)| *a > 0.0 || *b > 0.0) {
            writeln!(f, "{state:>14} {running:>12.1} s {:>+12.1} s", edited - running)?;
        }
        Ok(())
    }
}
