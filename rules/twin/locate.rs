//! Where: the region of time and of operating space in which a missing effect acts.

use crate::physics::{Role, Scene};
use crate::statistics::{count, quantile};

/// Share of the usual greatest size above which a row counts as affected: a fifth is a change that is seen beside it. Lower: noise
/// of the estimate and the tails of a curve are called affected; higher: only the peak is.
const ACTIVE_SHARE: f64 = 0.2;
/// Share of the rows that are smaller than the usual greatest size: single rows say nothing of a size.
const USUAL: f64 = 0.99;
/// Conditions that describe a region, at most.
const CONDITIONS_MAX: usize = 3;
/// What a condition must add to the agreement between region and description.
const CONDITION_GAIN: f64 = 0.02;

/// A condition on one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Condition {
    /// The column lies between these bounds; open where `None`.
    Range {
        /// The column.
        column: String,
        /// Lower bound.
        min: Option<f64>,
        /// Upper bound.
        max: Option<f64>,
    },
    /// The text column is one of these words.
    Equals {
        /// The column.
        column: String,
        /// The words.
        words: Vec<String>,
    },
}

impl Condition {
    /// The column it is on.
    #[must_use]
    pub fn column(&self) -> &str {
        match self {
            Self::Range { column, .. } | Self::Equals { column, .. } => column,
        }
    }
}

/// Is the column an output measured beside this one, and no input of anything? Its height says nothing of how the
/// machine was run.
fn is_measured(scene: &Scene, column: &str) -> bool {
    let measured = ["power", "current", "load", "torque", "force"].iter().any(|word| column.contains(word));
    measured && !Role::ALL.iter().any(|role| scene.role_name(*role) == Some(column))
}

/// A stretch of affected rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Span {
    /// The run.
    pub run: String,
    /// Time of its first row.
    pub from_s: f64,
    /// Time of its last row.
    pub to_s: f64,
}

/// Since when, with an interval.
#[derive(Debug, Clone, PartialEq)]
pub struct OnsetInterval {
    /// The run.
    pub run: String,
    /// Time within the recording.
    pub time_s: f64,
    /// Earliest plausible time.
    pub low_s: f64,
    /// Latest plausible time.
    pub high_s: f64,
}

/// Where a missing effect acts.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The missing effect that acts here, by the name the report uses.
    pub effect: String,
    /// Share of the missing effects' sum of squares that lies here.
    pub share: f64,
    /// Mean contribution here, in the output's unit.
    pub mean: f64,
    /// Conditions that hold together.
    pub conditions: Vec<Condition>,
    /// Every stretch of affected rows.
    pub spans: Vec<Span>,
    /// Since when, where it was not there from the start.
    pub onset: Option<OnsetInterval>,
}

/// The usual greatest size of a contribution.
#[must_use]
pub fn usual_size(contribution: &[f64]) -> f64 {
    quantile(contribution.iter().map(|x| x.abs()), USUAL).unwrap_or(0.0)
}

/// Rows in which a contribution is noticeable beside this size.
#[must_use]
pub fn active_rows(contribution: &[f64], size: f64) -> Vec<bool> {
    contribution.iter().map(|x| x.abs() > ACTIVE_SHARE * size && size > 0.0).collect()
}

/// Every stretch of affected rows, run by run; gaps of one row are bridged.
#[must_use]
pub fn spans(scene: &Scene, active: &[bool]) -> Vec<Span> {
    let mut spans = Vec::new();
    for (run, name) in scene.runs().iter().zip(scene.run_names()) {
        let mut open: Option<(usize, usize)> = None;
        for row in run.clone().filter(|row| active[*row]) {
            open = match open {
                Some((first, last)) if row <= last + 2 => Some((first, row)),
                Some(done) => {
                    spans.push(span(scene, name, done));
                    Some((row, row))
                }
                None => Some((row, row)),
            };
        }
        spans.extend(open.map(|done| span(scene, name, done)));
    }
    spans
}

fn span(scene: &Scene, run: &str, (first, last): (usize, usize)) -> Span {
    Span { run: run.to_owned(), from_s: scene.time_s()[first], to_s: scene.time_s()[last] }
}

/// Conditions that together describe the affected rows, the most telling first.
#[must_use]
pub fn conditions(scene: &Scene, active: &[bool]) -> Vec<Condition> {
    let mut chosen: Vec<Condition> = Vec::new();
    let mut accepted = vec![true; active.len()];
    let mut agreement = overlap(&accepted, active);
    while chosen.len() < CONDITIONS_MAX {
        let mut candidates = candidates(scene, active, &accepted);
        candidates.retain(|candidate| chosen.iter().all(|known| known.column() != candidate.column()));
        let judged = candidates.into_iter().map(|condition| {
            let rows = holds(scene, &condition);
            let both: Vec<bool> = rows.iter().zip(&accepted).map(|(a, b)| *a && *b).collect();
            (overlap(&both, active), condition, both)
        });
        let Some((better, condition, both)) =
            judged.reduce(|best, next| if next.0 > best.0 + 1e-9 { next } else { best })
        else {
            break;
        };
        if better < agreement + CONDITION_GAIN {
            break;
        }
        agreement = better;
        accepted = both;
        chosen.push(condition);
    }
    chosen
}

/// Rows in both over rows in either.
fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
    let either = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
    count(both) / count(either.max(1))
}

fn candidates(scene: &Scene, active: &[bool], accepted: &[bool]) -> Vec<Condition> {
    let mut all = Vec::new();
    let names: Vec<String> = scene
        .column_names()
        .filter(|name| *name != scene.output() && !is_measured(scene, name))
        .map(str::to_owned)
        .collect();
    for name in names {
        if let Some(values) = scene.column(&name) {
            all.extend(ranges(&name, values, active, accepted));
        }
    }
    for name in ["operation", "tool", "lot", "program", "run"] {
        if let Some(words) = scene.words(name) {
            all.extend(equals(name, words, active, accepted));
        }
    }
    all
}

/// Three ranges of a column: from below, from above, and both, at the edges of the affected rows (their outer two
/// percent left out).
fn ranges(name: &str, values: &[f64], active: &[bool], accepted: &[bool]) -> Vec<Condition> {
    let pick = |wanted: bool| -> Vec<f64> {
        let rows = (0..values.len()).filter(|row| accepted[*row] && active[*row] == wanted);
        let mut picked: Vec<f64> = rows.map(|row| values[row]).collect();
        picked.sort_by(f64::total_cmp);
        picked
    };
    let (inside, outside) = (pick(true), pick(false));
    if inside.is_empty() || outside.is_empty() {
        return Vec::new();
    }
    let trim = inside.len() / 50;
    let (low, high) = (inside[trim], inside[inside.len() - 1 - trim]);
    let range = |min: Option<f64>, max: Option<f64>| Condition::Range { column: name.to_owned(), min, max };
    let below = outside.iter().rev().find(|x| **x < low).map(|x| midway(*x, low));
    let above = outside.iter().find(|x| **x > high).map(|x| midway(*x, high));
    let mut all = Vec::new();
    if below.is_some() {
        all.push(range(below, None));
    }
    if above.is_some() {
        all.push(range(None, above));
    }
    if below.is_some() && above.is_some() {
        all.push(range(below, above));
    }
    all
}

fn midway(a: f64, b: f64) -> f64 {
    f64::midpoint(a, b)
}

fn equals(name: &str, words: &adapters::recording::Words, active: &[bool], accepted: &[bool]) -> Option<Condition> {
    if words.words().len() < 2 || words.words().len() > 64 {
        return None;
    }
    let mut inside = vec![0_usize; words.words().len()];
    let mut total = inside.clone();
    for row in (0..active.len()).filter(|row| accepted[*row]) {
        if let Some(code) = words.code(row) {
            total[code as usize] += 1;
            inside[code as usize] += usize::from(active[row]);
        }
    }
    // A word belongs to the region when its rows are affected more often than rows are overall.
    let all_inside: usize = inside.iter().sum();
    let all: usize = total.iter().sum();
    let mostly = |index: &usize| total[*index] > 0 && inside[*index] * all > total[*index] * all_inside;
    let kept: Vec<String> = (0..total.len()).filter(mostly).map(|index| words.words()[index].clone()).collect();
    let some = !kept.is_empty() && kept.len() < total.iter().filter(|total| **total > 0).count();
    some.then(|| Condition::Equals { column: name.to_owned(), words: kept })
}

/// Rows in which a condition holds.
#[must_use]
pub fn holds(scene: &Scene, condition: &Condition) -> Vec<bool> {
    match condition {
        Condition::Range { column, min, max } => match scene.column(column) {
            Some(values) => {
                let fits = |x: &f64| min.is_none_or(|min| *x >= min) && max.is_none_or(|max| *x <= max);
                values.iter().map(fits).collect()
            }
            None => vec![false; scene.rows()],
        },
        Condition::Equals { column, words } => match scene.words(column) {
            Some(cells) => (0..scene.rows())
                .map(|row| cells.get(row).is_some_and(|word| words.iter().any(|known| known == word)))
                .collect(),
            None => vec![false; scene.rows()],
        },
    }
}
