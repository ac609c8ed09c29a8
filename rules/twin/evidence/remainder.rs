//! What is left where nothing is told to be missing: before "it agrees" is said, what is left is looked at under every switch,
//! over every position and angle, and for its slow part. Each is a figure of the recording; none of them is a name.

use super::report::EvidenceReport;
use crate::diagnosis::Verdict;
use crate::text_report::{format_short_number, space_unit};
use adapter_core::bilingual::Bilingual;
use adapter_core::channel::quantity::Quantity;
use numerics::statistics::{count_to_f64, mean, rms};

/// Rows that a state of a switch must have: of fewer the size of what is left is too rough for [`STATE_RATIO`]. More cost silence
/// about states that are rare.
const STATE_ROWS_MIN: usize = 30;
/// Share of all rows that it must have. Chosen by hand, not measured: lower tells of states that hardly occur, higher is silent about rare ones.
const STATE_SHARE_MIN: f64 = 0.05;
/// Ratio of what is left in one state and in the other from which both are told: of 30 independent rows each chance alone
/// makes as much in one recording of three hundred.
const STATE_RATIO: f64 = 1.7;
/// Rows in a bin of a position, and bins at most: a screw of 5 mm over half a metre has a hundred turns.
const BIN_ROWS_MIN: usize = 12;
/// Bins at most, by the same screw: two to a turn and some to spare. Fewer cost sight of short waves, more cost rows in each.
const BINS_MAX: usize = 240;
/// Share of the squares of what is left that follows a position in runs that took no part, from which it is told. Chosen by hand, not measured: lower
/// tells of chance, higher is silent about a weak error of the screw.
const POSITION_SHARE: f64 = 0.15;
/// Windows in which the slow part is looked for. Chosen by hand, not measured: fewer miss what changes within a window, more take noise for it.
const WINDOWS: usize = 24;
/// Rows in each at least. Chosen by hand, not measured: of fewer the mean is too rough, more cost sight of a slow part in short recordings.
const WINDOW_ROWS_MIN: usize = 20;
/// The slow part is told from this share of the noise and of the output's size on: less is below what is told at all.
const SLOW_NOISE: f64 = 0.5;
/// The same share of the output's size. Chosen by hand, not measured: lower tells of what nobody would act on, higher is silent about drift.
const SLOW_OUTPUT: f64 = 0.01;

/// A figure, and its share of all that is left.
struct Finding {
    share: f64,
    text: Bilingual,
}

impl EvidenceReport<'_, '_> {
    /// What is left besides white noise, the greatest first; empty where something is told to be missing.
    pub(super) fn list_remainder(&self) -> Vec<Bilingual> {
        if self.answer.verdict != Verdict::NoMismatch {
            return Vec::new();
        }
        let recorded = self.inputs.scene.recorded_output();
        let rows: Vec<usize> = (0..self.inputs.rows).filter(|row| self.inputs.comparable[*row]).collect();
        let left: Vec<f64> = rows.iter().map(|row| recorded[*row] - self.answer.after[*row]).collect();
        let whole = rms(&left);
        if rows.len() < 2 * STATE_ROWS_MIN || whole <= 0.0 {
            return Vec::new();
        }
        let mut found: Vec<Finding> = Vec::new();
        for name in self.inputs.scene.column_names().filter(|name| *name != self.inputs.scene.output_name()) {
            let Some(column) = self.inputs.scene.column(name) else { continue };
            let values: Vec<f64> = rows.iter().map(|row| column[*row]).collect();
            found.extend(self.compare_states(name, &values, &left));
            if is_way(name) {
                found.extend(self.follow_position(name, &rows, &values, &left));
            }
        }
        found.sort_by(|a, b| b.share.total_cmp(&a.share));
        let mut told: Vec<Bilingual> = found.into_iter().take(2).map(|finding| finding.text).collect();
        told.extend(self.measure_slow_part(&rows, &left));
        told
    }

    fn output_unit(&self) -> &'static str {
        crate::diagnosis::find_output_unit(self.inputs.scene.output_name())
    }

    /// What is left in each of two states of a column.
    fn compare_states(&self, name: &str, values: &[f64], left: &[f64]) -> Option<Finding> {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low >= high || values.iter().any(|x| *x != low && *x != high) {
            return None;
        }
        let of = |state: f64| -> Vec<f64> {
            values.iter().zip(left).filter(|(x, _)| **x == state).map(|(_, left)| *left).collect()
        };
        let states = [of(low), of(high)];
        let enough = |rows: &Vec<f64>| {
            rows.len() >= STATE_ROWS_MIN && count_to_f64(rows.len()) > STATE_SHARE_MIN * count_to_f64(values.len())
        };
        let [off, on] = [rms(&states[0]), rms(&states[1])];
        if !states.iter().all(enough) || off.max(on) < STATE_RATIO * off.min(on) {
            return None;
        }
        let share = (off * off - on * on).abs() / (off * off + on * on);
        let [off, on, low, high] = [off, on, low, high].map(format_short_number);
        let unit = space_unit(self.output_unit());
        Some(Finding {
            share,
            text: Bilingual::new(
                format!("{on}{unit} while {name} is {high}, {off}{unit} while it is {low}"),
                format!("{name}为{high}时{on}{unit}，为{low}时{off}{unit}"),
            ),
        })
    }

    /// What follows a position: the bins of one half of the runs against those of the other half, so that slow noise, which a run
    /// meets on its own way, does not count.
    fn follow_position(&self, name: &str, rows: &[usize], values: &[f64], left: &[f64]) -> Option<Finding> {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let bins = (rows.len() / (2 * BIN_ROWS_MIN)).min(BINS_MAX);
        if low >= high || bins < 4 {
            return None;
        }
        let width = (high - low) / count_to_f64(bins);
        let mut sums = vec![[(0.0, 0.0); 2]; bins];
        let middle = mean(left);
        for ((row, x), left) in rows.iter().zip(values).zip(left) {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between 0 and the number of bins"
            )]
            let bin = (((x - low) / width) as usize).min(bins - 1);
            let sum = &mut sums[bin][self.inputs.unit[*row] % 2];
            *sum = (sum.0 + left - middle, sum.1 + 1.0);
        }
        let known = || sums.iter().filter(|[a, b]| a.1 > 0.0 && b.1 > 0.0);
        let product: f64 = known().map(|[a, b]| (a.0 / a.1) * (b.0 / b.1) * (a.1 + b.1)).sum();
        let squares: f64 = left.iter().map(|x| (x - middle) * (x - middle)).sum();
        let share = product / squares.max(f64::MIN_POSITIVE);
        if share < POSITION_SHARE {
            return None;
        }
        let size = format_short_number((product / count_to_f64(left.len())).max(0.0).sqrt());
        let (unit, percent) = (space_unit(self.output_unit()), 100.0 * share);
        Some(Finding {
            share,
            text: Bilingual::new(
                format!("{size}{unit} follow {name} ({percent:.0} % of it)"),
                format!("{size}{unit}随{name}变化（占{percent:.0} %）"),
            ),
        })
    }

    /// What changes slowly: the means of windows of a twenty-fourth of the recording, less what as many independent rows make.
    fn measure_slow_part(&self, rows: &[usize], left: &[f64]) -> Option<Bilingual> {
        let size = (rows.len() / WINDOWS).max(WINDOW_ROWS_MIN);
        let windows: Vec<&[f64]> = left.chunks(size).filter(|window| window.len() == size).collect();
        if windows.len() < 4 {
            return None;
        }
        let means: Vec<f64> = windows.iter().map(|window| mean(window)).collect();
        let middle = mean(&means);
        let between: f64 = means.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / count_to_f64(means.len() - 1);
        let within =
            means.iter().zip(&windows).flat_map(|(mean, window)| window.iter().map(move |x| (x - mean).powi(2)));
        let within: f64 = within.sum::<f64>() / count_to_f64(windows.len() * (size - 1));
        let slow = (between - within / count_to_f64(size)).max(0.0).sqrt();
        if slow < SLOW_NOISE * within.sqrt() || slow < SLOW_OUTPUT * self.comparison.size {
            return None;
        }
        let (slow, unit) = (format_short_number(slow), space_unit(self.output_unit()));
        Some(Bilingual::new(
            format!("{slow}{unit} of slow change that I cannot tell from noise"),
            format!("{slow}{unit}的缓慢变化，无法与噪声区分"),
        ))
    }
}

/// Is it a place along a way, or an angle?
fn is_way(name: &str) -> bool {
    Quantity::from_column_name(name) == Quantity::Position
        || name.contains("angle")
        || name.ends_with("_deg")
        || name.ends_with("_rad")
}
