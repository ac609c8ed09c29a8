//! The table of what is survived: one row per fault.

use std::fmt::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// How often faults are repeated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    factor: f64,
}

impl Scale {
    /// As in the chapter, unless `CAMPAIGN_SCALE` says otherwise.
    pub(crate) fn of_environment() -> Self {
        let factor = std::env::var("CAMPAIGN_SCALE").ok().and_then(|text| text.parse().ok());
        Self { factor: factor.unwrap_or(1.0) }
    }

    /// For every run of the tests.
    pub(crate) fn short() -> Self {
        Self { factor: 0.04 }
    }

    /// So many of `count`, at least `least`.
    pub(crate) fn of(&self, count: usize, least: usize) -> usize {
        ((count as f64 * self.factor).round() as usize).max(least)
    }

    /// So long of this time, at least `least`.
    pub(crate) fn time(&self, usual: Duration, least: Duration) -> Duration {
        usual.mul_f64(self.factor).max(least)
    }
}

/// What a fault did. Counts are of rows or items, unless `note` says of what.
#[derive(Debug, Clone, Default)]
pub(crate) struct Row {
    /// How the fault was made, and where the truth was counted.
    pub(crate) how: &'static str,
    /// How often.
    pub(crate) n: usize,
    /// Acknowledged and not there.
    pub(crate) lost: Option<u64>,
    /// There more than once, and how many of these are left where the receiver knows numbers.
    pub(crate) repeated: Option<(u64, u64)>,
    /// There and not as they were.
    pub(crate) wrong: Option<u64>,
    /// Writes outside the band, or overrides in force that should not be.
    pub(crate) out_of_band: Option<u64>,
    /// Longest time until all was as before.
    pub(crate) recovers: Option<Duration>,
    /// What else there is to say.
    pub(crate) note: String,
    /// What must not be.
    pub(crate) failures: Vec<String>,
    /// A partner is not installed.
    pub(crate) skipped: bool,
}

impl Row {
    pub(crate) fn new(how: &'static str) -> Self {
        Self { how, ..Self::default() }
    }

    /// A row whose partner is missing.
    pub(crate) fn skipped(how: &'static str) -> Self {
        let failures = std::env::var_os("CNC_GATEWAY_CI").map(|_| "the partner is not installed".to_owned());
        Self {
            how,
            skipped: true,
            note: "SKIPPED: the partner is not installed".to_owned(),
            failures: failures.into_iter().collect(),
            ..Self::default()
        }
    }

    /// Notes a failure unless it is so.
    pub(crate) fn must(&mut self, holds: bool, what: impl fmt::Display) {
        if !holds {
            self.failures.push(what.to_string());
        }
    }

    /// The longest recovery until now.
    pub(crate) fn recovered(&mut self, within: Duration) {
        self.recovers = self.recovers.max(Some(within));
    }
}

/// All rows.
#[derive(Debug, Default)]
pub(crate) struct Table {
    rows: Vec<(&'static str, Row, Duration)>,
}

impl Table {
    /// Makes a fault. One that panics is a row that failed.
    pub(crate) fn run(&mut self, name: &'static str, fault: impl FnOnce() -> Row) {
        let began = Instant::now();
        let row = catch_unwind(AssertUnwindSafe(fault)).unwrap_or_else(|panic| {
            let words = panic.downcast_ref::<String>().cloned();
            let words = words.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            let mut row = Row::new("");
            row.must(false, words.unwrap_or_else(|| "it broke off".to_owned()));
            row
        });
        println!("{name}: {} in {:.0} s; {row:?}", verdict(&row), began.elapsed().as_secs_f64());
        self.rows.push((name, row, began.elapsed()));
    }

    /// Fails with everything that must not be.
    pub(crate) fn assert_passed(&self) {
        let failed: Vec<String> = self
            .rows
            .iter()
            .filter(|(_, row, _)| !row.failures.is_empty())
            .map(|(name, row, _)| format!("{name}: {}", row.failures.join("; ")))
            .collect();
        assert!(failed.is_empty(), "{} of {} rows failed:\n{}", failed.len(), self.rows.len(), failed.join("\n"));
    }
}

fn verdict(row: &Row) -> &'static str {
    match (row.skipped, row.failures.is_empty()) {
        (true, _) => "skipped",
        (false, true) => "survived",
        (false, false) => "FAILED",
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| fault | how | n | lost | twice: sent, kept | wrong | out of band | recovers | |")?;
        writeln!(f, "|---|---|---|---|---|---|---|---|---|")?;
        for (name, row, _) in &self.rows {
            let count = |count: Option<u64>| count.map_or("-".to_owned(), |count| count.to_string());
            let twice = row.repeated.map_or("-".to_owned(), |(sent, kept)| format!("{sent}, {kept}"));
            let recovers = row.recovers.map_or("-".to_owned(), |within| format!("{:.1} s", within.as_secs_f64()));
            let mut note = row.note.clone();
            if !row.failures.is_empty() {
                let _infallible = write!(note, " **FAILED: {}**", row.failures.join("; "));
            }
            writeln!(
                f,
                "| {name} | {} | {} | {} | {twice} | {} | {} | {recovers} | {} |",
                row.how,
                row.n,
                count(row.lost),
                count(row.wrong),
                count(row.out_of_band),
                note.trim()
            )?;
        }
        Ok(())
    }
}
