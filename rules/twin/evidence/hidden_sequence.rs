//! Hidden sequences: something that is on or off and that nobody records, such as a pump or a chip conveyor.
//!
//! A residual is split into two levels with a probability of changing from row to row (a hidden Markov chain with noise
//! that has a memory). The evidence of a sequence is the sum over all paths; rows that are held out follow the state from
//! earlier rows only.

use super::inputs::RecordingInputs;
use numerics::statistics::{count_to_f64, median, robust_deviation};

/// Steps between the levels that are tried, in deviations of the residual.
const STEPS: [f64; 3] = [1.2, 2.2, 3.5];
/// Rounds of the fit.
const ROUNDS: usize = 5;
/// Deviations beyond which a row says no more: they are cut off before they are squared.
const FARTHEST: f64 = 5.0;
/// Changes below which nothing switches, and rows that each level must have.
const CHANGES_MIN: usize = 4;
const ROWS_MIN: usize = 8;
/// Longest memory of the noise from row to row.
const PHI_MAX: f64 = 0.95;
/// Bounds of the probability of a change.
const CHANGE: (f64, f64) = (5e-4, 0.1);
/// Prior of a sequence beside its evidence.
const SEQUENCE: f64 = -2.0;

/// A sequence that was found.
pub(super) struct Sequence {
    /// One where it is on.
    pub(super) on: Vec<f64>,
    /// How often it changes in the fitted rows.
    pub(super) changes: usize,
    /// Logarithm of the evidence of all paths over that of this one, and the prior.
    pub(super) ln: f64,
}

/// Bins of a channel in which a sequence may be on or off as a whole.
const BINS: usize = 12;
/// Share of the rows that a channel must tell on from off in, and the share of what it leaves to chance that it may be wrong in.
const TOLD: f64 = 0.3;
/// Rows by which a change may be before or after a change of the process, and the share of the changes that may be.
const BESIDE: usize = 2;
const AT_CHANGES: f64 = 0.6;

/// Is a sequence something of the process: told by the value of a channel, or changing when the process does? A consumer of
/// its own knows nothing of either.
pub(super) fn follows_inputs(inputs: &RecordingInputs<'_>, on: &[f64]) -> bool {
    let rows: Vec<usize> = inputs.fitted_rows(false).collect();
    let all = count_to_f64(rows.len().max(1));
    let high = rows.iter().filter(|row| on[**row] > 0.5).count();
    let by_chance = count_to_f64(high.min(rows.len() - high)) / all;
    let channels = [&inputs.speed, &inputs.depth, &inputs.feed, &inputs.width, &inputs.velocity, &inputs.position];
    let told = channels.into_iter().flatten().any(|channel| {
        let mut sorted = rows.clone();
        sorted.sort_by(|a, b| channel[*a].total_cmp(&channel[*b]));
        let size = sorted.len().div_ceil(BINS).max(1);
        let wrong: usize = sorted
            .chunks(size)
            .map(|bin| {
                let high = bin.iter().filter(|row| on[**row] > 0.5).count();
                high.min(bin.len() - high)
            })
            .sum();
        count_to_f64(wrong) / all < TOLD * by_chance
    });
    told || coincides_with_changes(inputs, on)
}

/// Do most changes of a sequence fall on changes of speed, feed or engagement, which are few?
fn coincides_with_changes(inputs: &RecordingInputs<'_>, on: &[f64]) -> bool {
    let differ = |values: &[f64], row: usize| {
        let (a, b) = (values[row - 1], values[row]);
        (a - b).abs() > 0.02 * a.abs().max(b.abs())
    };
    let feed = inputs.scene.column("feed_mm_min");
    let paces = [inputs.speed.as_deref(), feed, inputs.engaged.as_deref()];
    let paced = |row: usize| row > 0 && paces.iter().flatten().any(|pace| differ(pace, row));
    let near = |row: usize| (row.saturating_sub(BESIDE)..(row + BESIDE + 1).min(inputs.rows)).any(paced);
    let rows = || inputs.fitted_rows(false).filter(|row| *row > 0 && inputs.fitted[row - 1]);
    let changes: Vec<usize> = rows().filter(|row| (on[*row] - on[row - 1]).abs() > 0.5).collect();
    let share = |near: usize, all: usize| count_to_f64(near) / count_to_f64(all.max(1));
    let usual = share(rows().filter(|row| near(*row)).count(), rows().count());
    share(changes.iter().filter(|row| near(**row)).count(), changes.len()) > AT_CHANGES.max(2.0 * usual)
}

struct Chain<'a> {
    inputs: &'a RecordingInputs<'a>,
    /// Innovations of the residual.
    innovations: Vec<f64>,
    /// Memory from the row before; zero at the start of a block.
    memory: Vec<f64>,
}

/// Two levels with what they are and how noisy.
#[derive(Debug, Clone, Copy)]
struct ChainLevels {
    low: f64,
    step: f64,
    deviation: f64,
    change: f64,
}

/// The likeliest sequence in a residual whose noise has this memory from row to row; `None` where nothing switches.
pub(super) fn find_hidden_sequence(
    inputs: &RecordingInputs<'_>,
    residual: &[f64],
    scale: &[f64],
    phi: f64,
) -> Option<Sequence> {
    let phi = phi.min(PHI_MAX);
    let x = inputs.build_column(|row| if inputs.comparable[row] { residual[row] / scale[row] } else { 0.0 });
    let starts = |row: usize| row == 0 || inputs.block[row] != inputs.block[row - 1];
    let memory = inputs.build_column(|row| if starts(row) { 0.0 } else { phi });
    let innovations = inputs.build_column(|row| x[row] - if starts(row) { 0.0 } else { memory[row] * x[row - 1] });
    let chain = Chain { inputs, innovations, memory };
    let deviation = inputs.compute_deviation(&x, false);
    let middle = median(inputs.fitted_rows(false).map(|row| x[row]).collect())?;
    let mut best: Option<(f64, Vec<f64>, ChainLevels, usize)> = None;
    for size in STEPS {
        for sign in [1.0, -1.0] {
            let step = sign * size * deviation;
            let low = if size > 1.5 { middle } else { middle - 0.5 * step };
            let spread = robust_deviation(inputs.fitted_rows(false).map(|row| chain.innovations[row]))? + 1e-12;
            let fitted = chain.fit_chain(ChainLevels { low, step, deviation: spread, change: 0.01 });
            if let Some(fitted) = fitted
                && best.as_ref().is_none_or(|best| fitted.0 > best.0)
            {
                best = Some(fitted);
            }
        }
    }
    let (_, mut on, levels, changes) = best?;
    if changes < CHANGES_MIN {
        return None;
    }
    let ln = chain.compute_path_evidence(&on, levels).min(-3.0) + SEQUENCE;
    chain.filter_held_out_rows(&mut on, levels);
    Some(Sequence { on, changes, ln })
}

impl Chain<'_> {
    /// Log likelihoods of a row for (now, before) = (off, off), (off, on), (on, off), (on, on).
    fn compute_ln_likelihoods(&self, row: usize, levels: ChainLevels) -> [f64; 4] {
        let memory = self.memory[row];
        let z = self.innovations[row] - levels.low * (1.0 - memory);
        let of = |shift: f64| -0.5 * ((z - shift) / levels.deviation).clamp(-FARTHEST, FARTHEST).powi(2);
        let step = levels.step;
        [of(0.0), of(-step * memory), of(step), of(step - step * memory)]
    }

    /// Levels and the likeliest path, in turns.
    fn fit_chain(&self, start: ChainLevels) -> Option<(f64, Vec<f64>, ChainLevels, usize)> {
        let mut levels = start;
        let mut on = Vec::new();
        let mut changes = 0;
        for _ in 0..ROUNDS {
            on = self.decode_viterbi_path(levels);
            let high = self.inputs.fitted_rows(false).filter(|row| on[*row] > 0.5).count();
            let all = self.inputs.fitted_rows(false).count();
            if high < ROWS_MIN || all - high < ROWS_MIN {
                return None;
            }
            levels = self.estimate_levels(&on, levels);
            changes = self.count_changes(&on);
            levels.change = (count_to_f64(changes + 1) / count_to_f64(all)).clamp(CHANGE.0, CHANGE.1);
        }
        let rows = count_to_f64(self.inputs.fitted_rows(false).count());
        let loss = |row: usize| {
            let [off, _, _, _] = self.compute_path_likelihoods(row, &on, levels);
            off
        };
        let fit: f64 = self.inputs.fitted_rows(false).map(loss).sum();
        let told = fit
            - rows * levels.deviation.ln()
            - count_to_f64(changes) * ((rows / count_to_f64(changes.max(1))).ln() + 1.0);
        Some((told, on, levels, changes))
    }

    /// The likelihood of a row on a given path, four times.
    fn compute_path_likelihoods(&self, row: usize, on: &[f64], levels: ChainLevels) -> [f64; 4] {
        let before = row.checked_sub(1).is_some_and(|before| on[before] > 0.5);
        let all = self.compute_ln_likelihoods(row, levels);
        let own = all[2 * usize::from(on[row] > 0.5) + usize::from(before)];
        [own; 4]
    }

    fn count_changes(&self, on: &[f64]) -> usize {
        let mut before = None;
        let mut changes = 0;
        for row in self.inputs.fitted_rows(false) {
            changes += usize::from(before.is_some_and(|before: f64| (before - on[row]).abs() > 0.5));
            before = Some(on[row]);
        }
        changes
    }

    /// The likeliest path through the fitted rows (Viterbi).
    fn decode_viterbi_path(&self, levels: ChainLevels) -> Vec<f64> {
        let (turn, stay) = (levels.change.ln(), (1.0 - levels.change).ln());
        let rows = self.inputs.rows;
        let mut from = vec![[0_u8, 1]; rows];
        let (mut off, mut on) = (0.0, 0.0);
        for (row, from) in from.iter_mut().enumerate().filter(|(row, _)| self.inputs.fitted[*row]) {
            let [off_off, off_on, on_off, on_on] = self.compute_ln_likelihoods(row, levels);
            let (a, b) = (off + stay + off_off, on + turn + off_on);
            let (c, d) = (off + turn + on_off, on + stay + on_on);
            *from = [u8::from(b > a), u8::from(d >= c)];
            (off, on) = (a.max(b), c.max(d));
        }
        let mut path = vec![0.0; rows];
        let mut state = u8::from(off <= on);
        for row in (0..rows).rev() {
            path[row] = f64::from(state);
            state = from[row][state as usize];
        }
        path
    }

    /// Levels and noise by least squares along a path.
    fn estimate_levels(&self, on: &[f64], old: ChainLevels) -> ChainLevels {
        let limit = 6.0 * old.deviation + old.step.abs();
        let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let of = |row: usize| {
            let memory = self.memory[row];
            let before = row.checked_sub(1).map_or(0.0, |before| on[before]);
            (1.0 - memory, on[row] - memory * before)
        };
        for row in self.inputs.fitted_rows(false) {
            let ((a, b), y) = (of(row), self.innovations[row].clamp(-limit, limit));
            (aa, ab, bb, ay, by) = (aa + a * a, ab + a * b, bb + b * b, ay + a * y, by + b * y);
        }
        let determinant = aa * bb - ab * ab;
        if determinant.abs() < 1e-12 * aa * bb {
            return old;
        }
        let low = (bb * ay - ab * by) / determinant;
        let step = (aa * by - ab * ay) / determinant;
        let left = self.inputs.fitted_rows(false).map(|row| {
            let (a, b) = of(row);
            self.innovations[row] - a * low - b * step
        });
        let deviation = robust_deviation(left).unwrap_or(old.deviation) + 1e-12;
        ChainLevels { low, step, deviation, change: old.change }
    }

    /// Logarithm of the sum over all paths, less that of this path.
    fn compute_path_evidence(&self, on: &[f64], levels: ChainLevels) -> f64 {
        let (stay, turn) = (1.0 - levels.change, levels.change);
        let (mut off_share, mut on_share) = (0.5, 0.5);
        let mut ln = 0.0;
        for row in self.inputs.fitted_rows(false) {
            let all = self.compute_ln_likelihoods(row, levels);
            let top = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let [a, b, c, d] = all.map(|l| (l - top).exp());
            let off = off_share * stay * a + on_share * turn * b;
            let here = off_share * turn * c + on_share * stay * d;
            let sum = off + here + 1e-300;
            let own = self.compute_path_likelihoods(row, on, levels)[0];
            ln += sum.ln() + top - own;
            (off_share, on_share) = (off / sum, here / sum);
        }
        ln
    }

    /// Held-out rows follow the state from earlier rows only.
    fn filter_held_out_rows(&self, on: &mut [f64], levels: ChainLevels) {
        let fitted: Vec<f64> = self.inputs.fitted_rows(false).map(|row| on[row]).collect();
        let usual = numerics::statistics::mean(&fitted);
        let (stay, turn) = (1.0 - levels.change, levels.change);
        let mut share = usual;
        for (row, on) in on.iter_mut().enumerate() {
            if self.inputs.fitted[row] {
                share = *on;
                continue;
            }
            if self.memory[row] == 0.0 && (row == 0 || self.inputs.block[row] != self.inputs.block[row - 1]) {
                share = usual;
            }
            let expected = share * stay + (1.0 - share) * turn;
            *on = f64::from(u8::from(expected > 0.5));
            if !self.inputs.comparable[row] {
                continue;
            }
            let [a, b, c, d] = self.compute_ln_likelihoods(row, levels).map(f64::exp);
            let off = (1.0 - share) * stay * a + share * turn * b;
            let here = (1.0 - share) * turn * c + share * stay * d;
            share = here / (off + here + 1e-300);
        }
    }
}
