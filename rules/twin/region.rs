//! Where: the region of time and of operating space in which a missing effect acts.

use super::text_report::{format_short_number, format_signed_number, space_unit};
use numerics::statistics::{count_to_f64, quantile};
use physics::Scene;
use physics::explain::Language;

/// Share of the usual greatest size above which a row counts as affected: a fifth is a change that is seen beside it. Lower: noise
/// of the estimate and the tails of a curve are called affected; higher: only the peak is.
const ACTIVE_SHARE: f64 = 0.2;
/// Share of the rows that are smaller than the usual greatest size: single rows say nothing of a size.
const USUAL: f64 = 0.99;
/// A condition on one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Condition {
    /// The column lies between these bounds; open where `None`.
    Range {
        /// Name of a column of numbers.
        column: String,
        /// Least value; `None`: however small.
        min: Option<f64>,
        /// Greatest value; `None`: however large.
        max: Option<f64>,
    },
    /// The text column is one of these words.
    Equals {
        /// Name of a column of words.
        column: String,
        /// The words, any of which it may be.
        words: Vec<String>,
    },
}

impl Condition {
    /// The condition in words, with the column's name as it stands in the recording.
    #[must_use]
    pub fn describe(&self, language: Language) -> String {
        let words = |en: String, zh: String| language.select_text(en, zh);
        match self {
            Self::Range { column, min, max } => match (min.map(format_short_number), max.map(format_short_number)) {
                (Some(min), Some(max)) => {
                    words(format!("{column} is between {min} and {max}"), format!("{column}在{min}与{max}之间"))
                }
                (Some(min), None) => words(format!("{column} is above {min}"), format!("{column}大于{min}")),
                (None, Some(max)) => words(format!("{column} is below {max}"), format!("{column}小于{max}")),
                (None, None) => words(format!("{column} has any value"), format!("{column}任意")),
            },
            Self::Equals { column, words: any_of } => {
                words(format!("{column} is {}", any_of.join(" or ")), format!("{column}为{}", any_of.join("或")))
            }
        }
    }

    /// The column it is on.
    #[must_use]
    pub fn column(&self) -> &str {
        match self {
            Self::Range { column, .. } | Self::Equals { column, .. } => column,
        }
    }
}

/// A stretch of affected rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Span {
    /// Name of the run that it lies in.
    pub run: String,
    /// Time of its first row.
    pub from_s: f64,
    /// Time of its last row.
    pub to_s: f64,
}

/// Since when, with an interval.
#[derive(Debug, Clone, PartialEq)]
pub struct OnsetInterval {
    /// Name of the run that it lies in.
    pub run: String,
    /// Time within the recording.
    pub time_s: f64,
    /// Earliest plausible time of the onset, s.
    pub low_s: f64,
    /// Latest plausible time of the onset, s.
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
    /// Root mean square here of an effect that has both signs, in the output's unit: its mean tells nothing.
    pub both_signs: Option<f64>,
    /// Conditions that hold together.
    pub conditions: Vec<Condition>,
    /// Every stretch of affected rows.
    pub spans: Vec<Span>,
    /// Since when, where it was not there from the start.
    pub onset: Option<OnsetInterval>,
}

/// Share of the squares that the rarer sign of an effect must have for it to be one of both signs: less is the noise of the
/// estimate about a level.
const OTHER_SIGN: f64 = 0.05;

/// The root mean square of an effect over these rows where it has both signs there.
#[must_use]
pub fn measure_both_signs(contribution: &[f64], active: &[bool]) -> Option<f64> {
    let inside = || contribution.iter().zip(active).filter(|(_, active)| **active).map(|(x, _)| *x);
    let square = |above: bool| inside().filter(|x| (*x > 0.0) == above).map(|x| x * x).sum::<f64>();
    let (up, down) = (square(true), square(false));
    (up.min(down) > OTHER_SIGN * (up + down)).then(|| ((up + down) / count_to_f64(inside().count())).sqrt())
}

impl Region {
    /// How much it is here, in words: a mean, or what is typical where both signs would cancel.
    #[must_use]
    pub fn describe_amount(&self, language: Language, unit: &str) -> String {
        let unit = space_unit(unit);
        match self.both_signs.map(format_short_number) {
            Some(size) => language.select_text(
                format!("of both signs, typically ±{size}{unit}"),
                format!("正负交替，典型大小±{size}{unit}"),
            ),
            None => {
                let mean = format_signed_number(self.mean);
                language.select_text(format!("on average {mean}{unit}"), format!("平均{mean}{unit}"))
            }
        }
    }
}

/// The usual greatest size of a contribution.
#[must_use]
pub fn compute_usual_size(contribution: &[f64]) -> f64 {
    quantile(contribution.iter().map(|x| x.abs()), USUAL).unwrap_or(0.0)
}

/// Rows in which a contribution is noticeable beside this size.
#[must_use]
pub fn mark_active_rows(contribution: &[f64], size: f64) -> Vec<bool> {
    contribution.iter().map(|x| x.abs() > ACTIVE_SHARE * size && size > 0.0).collect()
}

/// Every stretch of affected rows, run by run; gaps of one row are bridged.
#[must_use]
pub fn list_spans(scene: &Scene, active: &[bool]) -> Vec<Span> {
    let mut spans = Vec::new();
    for (run, name) in scene.runs().iter().zip(scene.run_names()) {
        let mut open: Option<(usize, usize)> = None;
        for row in run.clone().filter(|row| active[*row]) {
            open = match open {
                Some((first, last)) if row <= last + 2 => Some((first, row)),
                Some(done) => {
                    spans.push(build_span(scene, name, done));
                    Some((row, row))
                }
                None => Some((row, row)),
            };
        }
        spans.extend(open.map(|done| build_span(scene, name, done)));
    }
    spans
}

fn build_span(scene: &Scene, run: &str, (first, last): (usize, usize)) -> Span {
    Span { run: run.to_owned(), from_s: scene.time_s()[first], to_s: scene.time_s()[last] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_friction_is_of_both_signs_and_a_level_is_not() {
        let friction: Vec<f64> = (0..100).map(|row| if row % 4 == 0 { 40.0 } else { -40.0 }).collect();
        let level: Vec<f64> = (0..100).map(|row| if row % 10 == 0 { -2.0 } else { 40.0 }).collect();
        assert_eq!(measure_both_signs(&friction, &[true; 100]), Some(40.0));
        assert_eq!(measure_both_signs(&level, &[true; 100]), None);
        let region = Region {
            effect: "dry_friction".to_owned(),
            share: 1.0,
            mean: -20.0,
            both_signs: Some(40.0),
            conditions: Vec::new(),
            spans: Vec::new(),
            onset: None,
        };
        assert_eq!(region.describe_amount(Language::En, "N"), "of both signs, typically ±40 N");
    }

    #[test]
    fn limits_of_a_condition_keep_their_digits_in_both_languages() {
        let small = Condition::Range { column: "feed_per_tooth_mm".to_owned(), min: Some(0.000_412_34), max: None };
        assert_eq!(small.describe(Language::En), "feed_per_tooth_mm is above 0.0004123");
        assert_eq!(small.describe(Language::Zh), "feed_per_tooth_mm大于0.0004123");
    }
}
