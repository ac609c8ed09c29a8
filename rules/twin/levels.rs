//! Levels of their own: no two passes cut quite the same (another blank, another grip, another place), no two tools or
//! runs either. Where that is so, a pass and a run are one draw each, not as many as they have rows, and whoever takes
//! their steps for slow noise loses what happens within a pass.
//!
//! A level common to rows with whitened ones `w` and of standard deviation `r` innovations has covariance
//! `I + r^2 w w'`; multiplying by `I - (1 - 1 / sqrt(1 + r^2 w'w)) u u'`, `u = w / |w|`, whitens it (mixed model with
//! random intercepts). Runs nest passes: theirs is the same on top.

use super::frame::Frame;
use super::linear::{dot, subtract};
use super::noise::{Arma, fit_near};
use crate::physics::Scene;
use crate::statistics::median;
use std::ops::Range;

/// Passes below which scatter between them cannot be told from an effect.
const PASSES_MIN: usize = 10;
/// Runs or tools below which the same holds for them.
const TOOLS_MIN: usize = 4;
/// Rows below which the restlessness of a pass cannot be told.
const ROWS_MIN: usize = 8;
/// Standard deviations that are tried, in innovations.
const SIZES: [f64; 8] = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

/// Least standard deviation of the level of a tool, in innovations: what tools differ by is not to be explained.
const TOOL_SIZE_MIN: f64 = 8.0;

/// Levels of passes and of tools.
#[derive(Debug, Clone, Default)]
pub struct PassAndToolLevels {
    /// Per stretch: does it have a level (is the tool in the work)?
    in_pass: Vec<bool>,
    /// Stretches of each tool or run.
    tools: Vec<Vec<usize>>,
    /// Standard deviations of the level of a pass and of a tool, in innovations.
    size: (f64, f64),
}

impl PassAndToolLevels {
    /// Whitens columns that are white but for the levels.
    pub fn whiten(&self, frame: &Frame, column: &mut [f64], noise: Arma) {
        let mut ones = frame.evened(&vec![1.0; column.len()], noise);
        for (stretch, _) in frame.stretches.iter().zip(&self.in_pass).filter(|(_, in_pass)| **in_pass) {
            let share = shrink(self.size.0, dot(&ones[stretch.clone()], &ones[stretch.clone()]));
            centre(&ones[stretch.clone()], &mut column[stretch.clone()], share);
            ones[stretch.clone()].iter_mut().for_each(|w| *w *= 1.0 - share);
        }
        for tool in &self.tools {
            let rows = || tool.iter().map(|index| frame.stretches[*index].clone());
            let whole: f64 = rows().map(|rows| dot(&ones[rows.clone()], &ones[rows])).sum();
            let along: f64 = rows().map(|rows| dot(&ones[rows.clone()], &column[rows])).sum();
            let factor = shrink(self.size.1, whole) * along / whole.max(f64::MIN_POSITIVE);
            rows().for_each(|rows| subtract(&mut column[rows.clone()], factor, &ones[rows]));
        }
    }

    /// Logarithm of the determinant of what [`PassAndToolLevels::whiten`] multiplies by.
    #[must_use]
    pub fn log_determinant(&self, frame: &Frame, noise: Arma) -> f64 {
        let ones = frame.evened(&vec![1.0; frame.len()], noise);
        let square = |index: usize| dot(&ones[frame.stretches[index].clone()], &ones[frame.stretches[index].clone()]);
        let (pass, tool) = self.size;
        let left = |index: usize| {
            let whole = square(index);
            if self.in_pass[index] { whole * (1.0 - shrink(pass, whole)).powi(2) } else { whole }
        };
        let passes = (0..self.in_pass.len()).filter(|index| self.in_pass[*index]);
        let of_passes: f64 = passes.map(|index| (pass * pass * square(index)).ln_1p()).sum();
        let of_tool = |stretches: &Vec<usize>| -> f64 {
            (tool * tool * stretches.iter().map(|index| left(*index)).sum::<f64>()).ln_1p()
        };
        -0.5 * (of_passes + self.tools.iter().map(of_tool).sum::<f64>())
    }
}

/// Share of the part along a level's ones that is taken out.
fn shrink(size: f64, whole: f64) -> f64 {
    1.0 - 1.0 / (1.0 + size * size * whole).sqrt()
}

fn centre(ones: &[f64], column: &mut [f64], share: f64) {
    let whole = dot(ones, ones);
    if whole > 0.0 {
        subtract(column, share * dot(ones, column) / whole, ones);
    }
}

/// The frame with levels of passes and tools, sized by what makes a residual likeliest; `None` for too few of them.
#[must_use]
pub(super) fn found(scene: &Scene, frame: &Frame, residual: &[f64]) -> Option<Frame> {
    let mut broken = frame.broken_at(scene.passes());
    broken.even_by(quiet(&broken, residual));
    let in_pass: Vec<bool> = broken.stretches.iter().map(|groups| within(scene, &broken, groups.start)).collect();
    let passes = in_pass.iter().filter(|in_pass| **in_pass).count();
    let tools = tools(scene, &broken);
    if passes < PASSES_MIN || tools.len() < TOOLS_MIN {
        return None;
    }
    let start = Arma { phi: 0.5, theta: 0.0 };
    let mut best: Option<(f64, Frame)> = None;
    // A handful of tools says little of how much tools differ: never less than TOOL_SIZE_MIN.
    let sizes = SIZES.iter().flat_map(|pass| [1.0, 4.0].map(|times| (*pass, times * TOOL_SIZE_MIN)));
    for size in sizes {
        broken.levels = Some(PassAndToolLevels { in_pass: in_pass.clone(), tools: tools.clone(), size });
        let (likelihood, _) = fit_near(residual, &broken, start);
        if best.as_ref().is_none_or(|(known, _)| likelihood > *known) {
            best = Some((likelihood, broken.clone()));
        }
    }
    best.map(|(_, frame)| frame)
}

/// Passes are taken to be at most this many times quieter or more restless than the middle one.
const QUIET_MAX: f64 = 4.0;

/// How quiet each group's stretch is, from the changes between neighbours, the middle one at one.
fn quiet(frame: &Frame, residual: &[f64]) -> Vec<f64> {
    let typical = |rows: &Range<usize>| {
        median(residual[rows.clone()].windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect()).filter(|x| *x > 0.0)
    };
    let Some(middle) = median(frame.stretches.iter().filter_map(typical).collect()) else { return Vec::new() };
    let mut quiet = vec![1.0; residual.len()];
    for rows in frame.stretches.iter().filter(|rows| rows.len() >= ROWS_MIN) {
        let weight = typical(rows).map_or(1.0, |typical| (middle / typical).clamp(1.0 / QUIET_MAX, QUIET_MAX));
        quiet[rows.clone()].fill(weight);
    }
    quiet
}

fn within(scene: &Scene, frame: &Frame, group: usize) -> bool {
    let row = frame.rows(group).start;
    scene.passes().iter().any(|pass| pass.contains(&row))
}

/// The stretches of each tool, or of each run where tools have no names.
fn tools(scene: &Scene, frame: &Frame) -> Vec<Vec<usize>> {
    let mut known: Vec<(String, Vec<usize>)> = Vec::new();
    for (index, groups) in frame.stretches.iter().enumerate() {
        let row = frame.rows(groups.start).start;
        let named = scene.words("tool").and_then(|words| words.get(row));
        let name = named.map_or_else(|| format!("unit {}", frame.unit[groups.start]), str::to_owned);
        match known.iter_mut().find(|(known, _)| *known == name) {
            Some((_, stretches)) => stretches.push(index),
            None => known.push((name, vec![index])),
        }
    }
    known.into_iter().map(|(_, stretches)| stretches).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::frame::units;
    use adapters::recording::read_csv;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use std::collections::BTreeMap;

    /// Four runs of five passes of twenty rows; each pass has a level of its own of this standard deviation.
    fn recording(level: f64) -> (Scene, Frame) {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let mut csv = String::from("time_s,run,pass,engaged,spindle_power_w\n");
        for row in 0..400 {
            let (run, pass) = (row / 100, row / 20);
            let draw: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            let own = level * (f64::from(pass) * 2.1).sin() * std::f64::consts::SQRT_2;
            csv += &format!("{},{run},p{pass},1,{}\n", row % 100, 500.0 + own + draw[0]);
        }
        let read = read_csv(csv.as_bytes(), "t.csv").expect("readable").recording;
        let scene = Scene::new(&read, "spindle_power_w", &BTreeMap::new()).expect("a scene");
        let frame = Frame::new(&scene, &units(&scene), 1, |_| true);
        (scene, frame)
    }

    fn pass_size(level: f64) -> f64 {
        let (scene, frame) = recording(level);
        let residual: Vec<f64> = scene.recorded().iter().map(|x| x - 500.0).collect();
        found(&scene, &frame, &residual).and_then(|frame| frame.levels).expect("enough passes").size.0
    }

    #[test]
    fn levels_of_passes_are_sized() {
        assert!((2.0..=16.0).contains(&pass_size(5.0)), "{}", pass_size(5.0));
        assert!(pass_size(0.0) <= 1.0, "{}", pass_size(0.0));
    }

    #[test]
    fn what_is_whitened_has_the_length_that_its_covariance_says() {
        let (_, mut frame) = recording(0.0);
        let levels = PassAndToolLevels { in_pass: vec![true], tools: vec![vec![0]], size: (3.0, 2.0) };
        // Only the first stretch has levels; the frame behind it is longer.
        frame.stretches.truncate(1);
        frame.stretches[0] = 0..20;
        let mut ones = vec![1.0; 20];
        levels.whiten(&frame, &mut ones, Arma::WHITE);
        // Along the ones the variance is 1 + (3^2 + 2^2) * 20.
        assert!((dot(&ones, &ones) - 20.0 / (1.0 + 13.0 * 20.0)).abs() < 1e-9);
        let ln_det = levels.log_determinant(&frame, Arma::WHITE);
        assert!((ln_det + 0.5 * 261.0_f64.ln()).abs() < 1e-9, "{ln_det}");
    }
}
