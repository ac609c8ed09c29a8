//! The curve of a feature over feed from a recording of cuts: one per speed and depth.
//!
//! Least squares by QR on powers of the feed over its greatest value. The degree is at most three, as in the source, and
//! lower where the highest term neither stands out of the scatter (F test) nor helps to predict a plateau that was left out.

use super::cubic::Cubic;
use super::family::{CurveAtDepth, CurveFamily};
use super::plateaus::{Plateau, SAME, find_plateaus};
use crate::regression::{
    Coefficient, Column, FTest, Intercept, Refusal, RefusalKind, Regression, f_upper_tail, fit_weighted,
};
use numerics::statistics::count_to_f64;
use recording::Recording;
use serde::Serialize;

/// Distinct feeds that a curve needs.
const FEEDS_MIN: usize = 4;
/// A term whose F is exceeded by chance more often than this does not stand out.
const CHANCE: f64 = 0.05;
/// Points of the range at which the standard error of a curve is taken.
const POINTS: u32 = 20;

/// How cuts scatter about their curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scatter {
    /// By the same amount everywhere; the residual standard deviation is in the unit of the feature.
    Constant,
    /// In proportion to the feature; the residual standard deviation is a share of it.
    Proportional,
}

/// A curve of the feature over the feed at one speed and depth, with what it takes to believe it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurveLearned {
    /// Spindle speed of the plateaus, rpm.
    pub speed_rpm: f64,
    /// Depth of cut of the plateaus, mm.
    pub depth_mm: f64,
    /// Plateaus, and how many different feeds they have.
    pub plateaus: usize,
    /// How many different feeds the plateaus have.
    pub feeds: usize,
    /// Degree that was chosen.
    pub degree: usize,
    /// The highest term of each degree tried against the curve without it, cubic first.
    pub highest_term: Vec<FTest>,
    /// Coefficients with intervals, constant first; zero beyond the degree.
    pub coefficients: Vec<Coefficient>,
    /// How the cuts scatter; the likelier of the two decides how they are weighed.
    pub scatter: Scatter,
    /// Residual standard deviation from cut to cut.
    pub residual_sd: f64,
    /// Share of the feature's variation that the curve explains, at most 1.
    pub r2: f64,
    /// Share explained of plateaus left out one at a time.
    pub predicted_r2: Option<f64>,
    /// Does the curve miss the repeated feeds by more than their scatter? Probability of that by chance.
    pub lack_of_fit_p: Option<f64>,
    /// The curve and the feeds that it holds for.
    pub curve: Cubic,
    /// Greatest standard deviation of one cut about the curve in its range, the error of the curve counted, in the unit of
    /// the feature.
    pub sd: f64,
    /// Does the feature rise with feed in the whole range?
    pub rises: bool,
    /// Discriminant of the derivative; negative where the cubic is monotone everywhere.
    pub discriminant: f64,
}

/// The curves of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeedCurves {
    /// Column of the feed.
    pub feed: String,
    /// Column of the feature.
    pub feature: String,
    /// Material of the work, where the recording names one and only one.
    pub material: Option<String>,
    /// By speed and depth.
    pub curves: Vec<CurveLearned>,
    /// The plateaus they rest on.
    pub plateaus: Vec<Plateau>,
    /// Groups of plateaus that make no curve, and why; and why curves of a speed make no family.
    pub refused: Vec<Refusal>,
    /// What the reader should know.
    pub notes: Vec<String>,
}

impl FeedCurves {
    /// The curves of a speed, where they make a family.
    ///
    /// # Errors
    /// See [`CurveFamily::new`].
    pub fn build_family(&self, speed_rpm: f64) -> Result<CurveFamily, Refusal> {
        let near = |curve: &&CurveLearned| (curve.speed_rpm / speed_rpm - 1.0).abs() <= SAME;
        let at = |curve: &CurveLearned| CurveAtDepth { depth_mm: curve.depth_mm, curve: curve.curve, sd: curve.sd };
        CurveFamily::new(self.curves.iter().filter(near).map(at).collect())
    }

    /// The speeds for which there are curves, in order.
    #[must_use]
    pub fn speeds_rpm(&self) -> Vec<f64> {
        let mut speeds: Vec<f64> = Vec::new();
        for curve in &self.curves {
            if !speeds.iter().any(|known| (curve.speed_rpm / known - 1.0).abs() <= SAME) {
                speeds.push(curve.speed_rpm);
            }
        }
        speeds
    }
}

/// Finds the cuts of a recording and fits a curve of `feature` (a column such as `spindle_current_a`) over `feed`
/// (`feed_mm_min` or `feed_per_rev_mm`) for every speed and depth.
///
/// # Errors
/// A [`Refusal`] where no group of cuts makes a curve, or a column or unit is wrong.
pub fn identify_feed_curve(recording: &Recording, feed: &str, feature: &str) -> Result<FeedCurves, Refusal> {
    let plateaus = find_plateaus(recording, feed, feature)?;
    let mut learned = FeedCurves {
        feed: feed.to_owned(),
        feature: feature.to_owned(),
        material: one_word(recording, "work_material"),
        curves: Vec::new(),
        plateaus: Vec::new(),
        refused: Vec::new(),
        notes: Vec::new(),
    };
    for group in group_plateaus(&plateaus) {
        let place = format!("{:.0} rpm, depth {:.2} mm", group[0].speed_rpm, group[0].depth_mm);
        learned.notes.extend(mixed_tools(&group).map(|tools| format!("{place}: tools {tools} are mixed")));
        match fit_curve(&group, feature) {
            Ok(curve) => learned.curves.push(curve),
            Err(refusal) => learned.refused.push(refusal.with_place(place)),
        }
    }
    if learned.curves.is_empty() {
        return Err(learned.refused.into_iter().next().unwrap_or_else(refuse_without_cuts));
    }
    for speed_rpm in learned.speeds_rpm() {
        if let Err(refusal) = learned.build_family(speed_rpm) {
            learned.refused.push(refusal.with_place(format!("{speed_rpm:.0} rpm")));
        }
    }
    learned.plateaus = plateaus;
    Ok(learned)
}

/// The word that every row of a column has that has one.
fn one_word(recording: &Recording, column: &str) -> Option<String> {
    let words = recording.find_words(column)?;
    let mut found = (0..recording.count_rows()).filter_map(|row| words.get(row)).filter(|word| !word.is_empty());
    let first = found.next()?;
    found.all(|word| word == first).then(|| first.to_owned())
}

fn refuse_without_cuts() -> Refusal {
    Refusal::new(
        RefusalKind::TooFew,
        "no cut of constant speed, depth and feed that lasts 4 s or longer",
        "cut at one speed and depth with at least four feeds, some of them twice, 10 s each",
    )
}

/// Plateaus of one speed and depth.
fn group_plateaus(plateaus: &[Plateau]) -> Vec<Vec<&Plateau>> {
    let same = |a: f64, b: f64| (a - b).abs() <= SAME * b.abs();
    let mut groups: Vec<Vec<&Plateau>> = Vec::new();
    for plateau in plateaus {
        let fits = |group: &&mut Vec<&Plateau>| {
            same(plateau.speed_rpm, group[0].speed_rpm) && same(plateau.depth_mm, group[0].depth_mm)
        };
        match groups.iter_mut().find(fits) {
            Some(group) => group.push(plateau),
            None => groups.push(vec![plateau]),
        }
    }
    groups.sort_by(|a, b| a[0].speed_rpm.total_cmp(&b[0].speed_rpm).then(a[0].depth_mm.total_cmp(&b[0].depth_mm)));
    groups
}

fn mixed_tools(group: &[&Plateau]) -> Option<String> {
    let mut tools: Vec<&str> = group.iter().filter_map(|plateau| plateau.tool.as_deref()).collect();
    tools.sort_unstable();
    tools.dedup();
    (tools.len() > 1).then(|| tools.join(", "))
}

fn fit_curve(group: &[&Plateau], feature: &str) -> Result<CurveLearned, Refusal> {
    let mut sorted: Vec<&Plateau> = group.to_vec();
    sorted.sort_by(|a, b| a.feed.total_cmp(&b.feed));
    let feeds: Vec<f64> = sorted.iter().map(|plateau| plateau.feed).collect();
    let levels: Vec<&[&Plateau]> = sorted.chunk_by(|a, b| b.feed <= a.feed * (1.0 + SAME)).collect();
    if levels.len() < FEEDS_MIN || sorted.len() < FEEDS_MIN + 1 {
        let what = format!("{} cuts at {} different feeds", sorted.len(), levels.len());
        let next = "a cubic with intervals needs at least 5 cuts at 4 different feeds; repeat some of them";
        return Err(Refusal::new(RefusalKind::TooFew, what, next));
    }
    let scale = feeds[feeds.len() - 1];
    let y = Column::new(feature, sorted.iter().map(|plateau| plateau.level.mean).collect());
    let (scatter, weights) = choose_weights(&y, &feeds, scale)?;
    let (regression, highest_term) = choose_degree(&y, &feeds, scale, &weights)?;
    let degree = regression.coefficients.len() - 1;
    let coefficients = rescale_coefficients(&regression, scale);
    let value = |k: usize| coefficients.get(k).map_or(0.0, |coefficient| coefficient.value);
    let curve = Cubic { coefficients: [value(0), value(1), value(2), value(3)], feed_min: feeds[0], feed_max: scale };
    Ok(CurveLearned {
        speed_rpm: average_over_group(group, |plateau| plateau.speed_rpm),
        depth_mm: average_over_group(group, |plateau| plateau.depth_mm),
        plateaus: group.len(),
        feeds: levels.len(),
        degree,
        highest_term,
        residual_sd: regression.residual_sd,
        r2: regression.r2,
        predicted_r2: regression.predicted_r2,
        lack_of_fit_p: lack_of_fit(&levels, &regression, &weights),
        sd: greatest_sd(&regression, &curve, scatter),
        scatter,
        rises: curve.is_rising(),
        discriminant: curve.discriminant(),
        coefficients,
        curve,
    })
}

fn average_over_group(group: &[&Plateau], of: fn(&Plateau) -> f64) -> f64 {
    group.iter().map(|plateau| of(plateau)).sum::<f64>() / count_to_f64(group.len())
}

fn of_degree(y: &Column, feeds: &[f64], scale: f64, weights: &[f64], degree: i32) -> Result<Regression, Refusal> {
    let power = |k: i32| Column::new(format!("feed^{k}"), feeds.iter().map(|f| (f / scale).powi(k)).collect());
    fit_weighted(y, &(1..=degree).map(power).collect::<Vec<Column>>(), Intercept::Fitted, weights)
}

/// The likelier scatter about a cubic, and the weight of each cut.
fn choose_weights(y: &Column, feeds: &[f64], scale: f64) -> Result<(Scatter, Vec<f64>), Refusal> {
    let equal = vec![1.0; feeds.len()];
    let plain = of_degree(y, feeds, scale, &equal, 3)?;
    if plain.fitted.iter().any(|fitted| *fitted <= 0.0) {
        return Ok((Scatter::Constant, equal));
    }
    let inverse: Vec<f64> = plain.fitted.iter().map(|fitted| fitted.powi(-2)).collect();
    let weighed = of_degree(y, feeds, scale, &inverse, 3)?;
    // Minus twice the logarithm of the likelihood, without what both have in common.
    let rows = count_to_f64(feeds.len());
    let log_sizes: f64 = plain.fitted.iter().map(|fitted| 2.0 * fitted.ln()).sum();
    let (constant, proportional) = (rows * plain.rss.ln(), rows * weighed.rss.ln() + log_sizes);
    Ok(if proportional < constant { (Scatter::Proportional, inverse) } else { (Scatter::Constant, equal) })
}

/// The fit of the degree that the data bear, and the test of the highest term of each degree tried.
fn choose_degree(y: &Column, feeds: &[f64], scale: f64, weights: &[f64]) -> Result<(Regression, Vec<FTest>), Refusal> {
    let mut tests = Vec::new();
    let mut longer = of_degree(y, feeds, scale, weights, 3)?;
    for degree in (1..3).rev() {
        let shorter = of_degree(y, feeds, scale, weights, degree)?;
        let Some(test) = longer.test_against(&shorter) else { break };
        tests.push(test);
        let predicts = longer.predicted_r2 > shorter.predicted_r2;
        if test.p <= CHANCE || (predicts && test.p <= 2.0 * CHANCE) {
            break;
        }
        longer = shorter;
    }
    Ok((longer, tests))
}

/// Coefficients of the feed itself.
fn rescale_coefficients(regression: &Regression, scale: f64) -> Vec<Coefficient> {
    let mut unit = 1.0;
    let mut found = Vec::new();
    for (power, scaled) in regression.coefficients.iter().enumerate() {
        let (low, high) = scaled.interval;
        found.push(Coefficient {
            name: format!("c{power}"),
            value: scaled.value / unit,
            standard_error: scaled.standard_error / unit,
            interval: (low / unit, high / unit),
            ..scaled.clone()
        });
        unit *= scale;
    }
    found
}

/// Scatter of cuts about their feed's mean against how far the curve misses those means. The cuts are in the order of
/// feed, as the weights are.
fn lack_of_fit(levels: &[&[&Plateau]], regression: &Regression, weights: &[f64]) -> Option<f64> {
    let mut rest = weights;
    let mut pure = 0.0;
    for level in levels {
        let (own, after) = rest.split_at(level.len());
        pure += own[0] * about_mean(level);
        rest = after;
    }
    let pure_df = count_to_f64(regression.rows) - count_to_f64(levels.len());
    let df = regression.degrees_of_freedom - pure_df;
    if pure_df < 1.0 || df < 1.0 || pure <= 0.0 {
        return None;
    }
    let f = ((regression.rss - pure).max(0.0) / df) / (pure / pure_df);
    Some(f_upper_tail(f, df, pure_df))
}

fn about_mean(level: &[&Plateau]) -> f64 {
    let middle = average_over_group(level, |plateau| plateau.level.mean);
    level.iter().map(|plateau| (plateau.level.mean - middle).powi(2)).sum()
}

fn greatest_sd(regression: &Regression, curve: &Cubic, scatter: Scatter) -> f64 {
    let degree = regression.coefficients.len() - 1;
    let at = |step: u32| {
        let feed = curve.feed_min + (curve.feed_max - curve.feed_min) * f64::from(step) / f64::from(POINTS);
        let share = feed / curve.feed_max;
        let point: Vec<f64> = std::iter::successors(Some(share), |power| Some(power * share)).take(degree).collect();
        let size = if scatter == Scatter::Proportional { curve.evaluate_at(feed).abs() } else { 1.0 };
        let error = regression.predict_value(&point).map_or(0.0, |prediction| prediction.standard_error);
        error.hypot(size * regression.residual_sd)
    };
    (0..=POINTS).map(at).fold(0.0, f64::max)
}
