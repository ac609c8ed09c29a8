//! How worn each tool is, as far as the feed drives tell: their load grows with the flank.
//!
//! The passive and feed forces rise several times more steeply with flank wear than the cutting force, so the drive of
//! the feeding axis sees what the spindle hardly shows. The load of one tool is followed by a Kalman filter, from that
//! tool's own earlier rows only: `y = level + pass + decay exp(-t/T) + growth`, all relative to the channel's median;
//! `level` belongs to the tool, `pass` to each pass (no two blanks and diameters are alike), `decay` is the settling at
//! the start of every pass, `growth` starts at zero with a new edge and has a rate that wanders.

use super::Scene;
use numerics::statistics::quantile;
use std::collections::BTreeMap;
use std::ops::Range;

/// Scatter of the load from pass to pass, relative, beyond which a channel tells where the axis stands or what is cut
/// rather than how worn the tool is.
const SCATTER_MAX: f64 = 0.15;
/// Least standard deviation of a pass's own level, relative.
const PASS_SPREAD: f64 = 0.03;
/// Standard deviation of a tool's own level, relative.
const LEVEL_SPREAD: f64 = 0.1;
/// Settling at the start of a pass: expected size, its standard deviation, relative, and its time constant in seconds.
const SETTLING: (f64, f64, f64) = (0.1, 0.1, 6.0);
/// Rows of a drive's load are not independent: their variance counts this many times.
const INFLATION: f64 = 6.0;
/// How fast the rate of growth may wander: variance of the rate, 1/s2 per second, that is chosen from by likelihood.
const WANDER: [f64; 6] = [1e-10, 1e-9, 1e-8, 4e-8, 1.6e-7, 6.4e-7];
/// Growth, as a mean over the tools at their ends, below which the drives tell nothing of wear.
const GROWTH_MIN: f64 = 0.03;
/// Gain in log-likelihood over no growth at all below which the drives tell nothing of wear.
const GAIN_MIN: f64 = 10.0;
/// Passes below which scatter cannot be judged.
const PASSES_MIN: usize = 6;

/// Growth of the feed load in the first minute of a new edge's life, before the drives can tell it from pass to pass:
/// break-in to VB 0.05-0.1 mm, at 15-25 % of the feed force per 0.1 mm. The figure may be off by a factor of two
/// either way without much harm.
const BREAK_IN: f64 = 0.15;

/// How worn an edge is, in growth of the feed load: break-in and steady wear with the root of the cutting time, and what
/// the drive tells on top of it.
pub(crate) fn estimate_wear(minutes: f64, growth: f64) -> f64 {
    BREAK_IN * minutes.max(0.0).sqrt() + growth
}

/// Names of the load of a feed drive: an axis, and a quantity that follows its force.
fn is_feed_drive(name: &str) -> bool {
    let axis = ["x_", "y_", "z_", "axis_"].iter().any(|prefix| name.starts_with(prefix));
    axis && ["torque", "current", "load", "force"].iter().any(|word| name.contains(word))
}

/// Relative growth of the feed load since each tool's edge was new, per row, followed causally; `None` when no feed
/// drive is recorded, or none whose load grows with the use of the tools.
pub(crate) fn estimate_growth(scene: &Scene) -> Option<Vec<f64>> {
    if scene.passes().len() < PASSES_MIN {
        return None;
    }
    let names: Vec<&str> =
        scene.column_names().filter(|name| is_feed_drive(name) && *name != scene.output_name()).collect();
    let grown = names.into_iter().filter_map(|name| estimate_channel_growth(scene, scene.column(name)?));
    let best = grown.fold(None, |best: Option<(f64, Vec<f64>)>, next| match best {
        Some(best) if best.0 >= next.0 => Some(best),
        _ => Some(next),
    });
    best.map(|(_, growth)| growth)
}

/// The growth that one channel tells, after its mean over the tools.
fn estimate_channel_growth(scene: &Scene, load: &[f64]) -> Option<(f64, Vec<f64>)> {
    let unit = quantile(scene.passes().iter().flat_map(|pass| load[pass.clone()].iter().map(|x| x.abs())), 0.5)?;
    if unit <= 0.0 {
        return None;
    }
    let relative: Vec<f64> = load.iter().map(|x| x.abs() / unit).collect();
    let scatter = estimate_pass_scatter(scene, &relative)?;
    let steps = scene.passes().iter().flat_map(|pass| relative[pass.clone()].windows(2).map(|p| (p[1] - p[0]).abs()));
    let deviation = quantile(steps, 0.5)? / (0.6745 * std::f64::consts::SQRT_2);
    if scatter > SCATTER_MAX || deviation <= 0.0 {
        return None;
    }
    let filter = Filter {
        pass_variance: PASS_SPREAD.max(0.5 * scatter).powi(2),
        row_variance: deviation * deviation * INFLATION,
        wander: 0.0,
    };
    let still = filter.filter_scene(scene, &relative);
    let moving = WANDER.map(|wander| Filter { wander, ..filter }.filter_scene(scene, &relative));
    let best = moving.into_iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
    let mean = compute_mean_end_growth(scene, &best.growth);
    (best.log_likelihood - still.log_likelihood >= GAIN_MIN && mean >= GROWTH_MIN).then_some((mean, best.growth))
}

/// Robust standard deviation of a pass's level, from neighbours of the same tool.
fn estimate_pass_scatter(scene: &Scene, relative: &[f64]) -> Option<f64> {
    let level = |pass: &Range<usize>| quantile(relative[pass.clone()].iter().copied(), 0.5);
    let same = |a: &Range<usize>, b: &Range<usize>| find_tool(scene, a.start) == find_tool(scene, b.start);
    let neighbours = scene.passes().windows(2).filter(|pair| same(&pair[0], &pair[1]));
    let steps = neighbours.filter_map(|pair| Some((level(&pair[1])? - level(&pair[0])?).abs()));
    Some(quantile(steps, 0.5)? / (0.6745 * std::f64::consts::SQRT_2))
}

/// The tool in a row: its name, or the run where tools have none.
fn find_tool(scene: &Scene, row: usize) -> Option<&str> {
    let run = || scene.runs().iter().position(|run| run.contains(&row)).map(|run| scene.run_names()[run].as_str());
    scene.text_column("tool").and_then(|words| words.get(row)).or_else(run)
}

/// Mean over the tools of the growth at their last row.
fn compute_mean_end_growth(scene: &Scene, growth: &[f64]) -> f64 {
    let ends: BTreeMap<_, _> =
        scene.passes().iter().map(|pass| (find_tool(scene, pass.start), growth[pass.end - 1])).collect();
    ends.values().sum::<f64>() / (ends.len().max(1) as f64)
}

/// What a filter says of a recording.
struct Followed {
    growth: Vec<f64>,
    log_likelihood: f64,
}

#[derive(Clone, Copy)]
struct Filter {
    pass_variance: f64,
    row_variance: f64,
    wander: f64,
}

/// Level, pass, growth, rate of growth, size of the settling.
const STATES: usize = 5;
const PASS: usize = 1;
const GROWTH: usize = 2;
const RATE: usize = 3;

/// Mean and covariance of what is known of one tool.
#[derive(Clone, Copy)]
struct Tool {
    mean: [f64; STATES],
    covariance: [[f64; STATES]; STATES],
}

impl Filter {
    fn filter_scene(&self, scene: &Scene, relative: &[f64]) -> Followed {
        let mut tools: BTreeMap<Option<&str>, Tool> = BTreeMap::new();
        let mut followed = Followed { growth: vec![0.0; relative.len()], log_likelihood: 0.0 };
        let mut done = 0;
        let mut last: BTreeMap<Option<&str>, f64> = BTreeMap::new();
        for pass in scene.passes() {
            let name = find_tool(scene, pass.start);
            let known = tools.entry(name).or_insert_with(|| self.build_fresh_tool());
            known.begin_pass(self.pass_variance);
            // Out of the cut a tool is as worn as when it left it.
            (done..pass.start).for_each(|row| {
                followed.growth[row] = last.get(&find_tool(scene, row)).copied().unwrap_or(0.0);
            });
            followed.log_likelihood += self.filter_pass(scene, relative, pass, known, &mut followed.growth);
            last.insert(name, known.mean[GROWTH]);
            done = pass.end;
        }
        (done..relative.len()).for_each(|row| {
            followed.growth[row] = last.get(&find_tool(scene, row)).copied().unwrap_or(0.0);
        });
        followed
    }

    fn build_fresh_tool(&self) -> Tool {
        let mut covariance = [[0.0; STATES]; STATES];
        let spread = [LEVEL_SPREAD, 0.0, 0.0, 0.0, SETTLING.1];
        (0..STATES).for_each(|i| covariance[i][i] = spread[i] * spread[i]);
        Tool { mean: [1.0, 0.0, 0.0, 0.0, SETTLING.0], covariance }
    }

    fn filter_pass(
        &self,
        scene: &Scene,
        relative: &[f64],
        pass: &Range<usize>,
        known: &mut Tool,
        growth: &mut [f64],
    ) -> f64 {
        let time_s = scene.time_s();
        let mut log_likelihood = 0.0;
        for row in pass.clone() {
            let before_s = if row == pass.start { time_s[row] - scene.period_s() } else { time_s[row - 1] };
            let dt_s = (time_s[row] - before_s).max(0.0);
            known.predict_state(dt_s, self.wander);
            let in_pass_s = time_s[row] - time_s[pass.start];
            // The first row of a pass may still hold some of what was before.
            if row > pass.start && scene.usable_rows()[row] {
                let sees = [1.0, 1.0, 1.0, 0.0, (-in_pass_s / SETTLING.2).exp()];
                log_likelihood += known.update_with_measurement(relative[row], sees, self.row_variance);
            }
            growth[row] = known.mean[GROWTH];
        }
        log_likelihood
    }
}

impl Tool {
    fn begin_pass(&mut self, variance: f64) {
        self.mean[PASS] = 0.0;
        for i in 0..STATES {
            self.covariance[PASS][i] = 0.0;
            self.covariance[i][PASS] = 0.0;
        }
        self.covariance[PASS][PASS] = variance;
    }

    /// Growth goes on at its rate, the rate wanders.
    fn predict_state(&mut self, dt_s: f64, wander: f64) {
        self.mean[GROWTH] += self.mean[RATE] * dt_s;
        let c = &mut self.covariance;
        let rate = c[RATE];
        c[GROWTH].iter_mut().zip(rate).for_each(|(growth, rate)| *growth += dt_s * rate);
        for row in c.iter_mut() {
            row[GROWTH] += dt_s * row[RATE];
        }
        c[RATE][RATE] += wander * dt_s;
    }

    /// Takes in one row; returns its log-likelihood.
    fn update_with_measurement(&mut self, value: f64, sees: [f64; STATES], variance: f64) -> f64 {
        let along: [f64; STATES] = std::array::from_fn(|i| (0..STATES).map(|j| self.covariance[i][j] * sees[j]).sum());
        let expected: f64 = self.mean.iter().zip(sees).map(|(mean, sees)| mean * sees).sum();
        let total = variance + along.iter().zip(sees).map(|(along, sees)| along * sees).sum::<f64>();
        let error = value - expected;
        for i in 0..STATES {
            self.mean[i] += along[i] / total * error;
            for j in 0..STATES {
                self.covariance[i][j] -= along[i] * along[j] / total;
            }
        }
        -0.5 * (total.ln() + error * error / total)
    }
}

/// Steps of a standing axis's load, in deviations of its ordinary change, that mean another place.
const MOVED_DEVIATIONS: f64 = 20.0;
/// Share of the load's size that such a step must reach as well.
const MOVED_SHARE: f64 = 0.1;

/// Rows in which the load of an axis steps: it has been moved since the row before.
pub(crate) fn mark_moved_rows(scene: &Scene) -> Vec<bool> {
    let mut moved = Vec::new();
    let drives = scene.column_names().filter(|name| is_feed_drive(name) && *name != scene.output_name());
    for load in drives.filter_map(|name| scene.column(name)) {
        let steps: Vec<f64> = load.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let usual = quantile(steps.iter().copied(), 0.5).unwrap_or(0.0) / 0.6745;
        let size = quantile(load.iter().map(|x| x.abs()), 0.5).unwrap_or(0.0);
        let least = (MOVED_DEVIATIONS * usual).max(MOVED_SHARE * size);
        if usual > 0.0 {
            moved.resize(load.len(), false);
            // The last of several steps in a row starts the pass: the axis has arrived.
            let arrived =
                (0..steps.len()).filter(|at| steps[*at] > least && steps.get(at + 1).is_none_or(|x| *x <= least));
            arrived.for_each(|at| moved[at + 1] = true);
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::read_csv;
    use std::collections::BTreeMap as Roles;

    /// Four tools of five passes of thirty seconds, the load of each growing by `growth` from the third pass on; rows
    /// from `spoilt` on are tripled.
    fn recording(growth: f64, spoilt: usize) -> Scene {
        let mut csv = String::from("time_s,run,tool,engaged,spindle_speed_rpm,spindle_power_w,z_torque_nm\n");
        for row in 0..600 {
            let (tool, second) = (row / 150, row % 150);
            let (pass, in_pass_s) = (second / 30, f64::from(second % 30));
            let grown = growth * f64::from(second - 60).max(0.0) / 90.0;
            let own = [0.0, 0.02, -0.015, 0.01, -0.02][pass as usize] + 0.05 * f64::from(tool);
            let wiggle = 0.01 * (f64::from(row) * 2.4).sin();
            let load = 4.0 * (1.0 + own + wiggle + grown + 0.1 * (-in_pass_s / 6.0).exp());
            let load = if row as usize >= spoilt { 3.0 * load } else { load };
            csv += &format!("{second},{tool},{tool},1,{},500,{load}\n", 800 + 100 * (pass % 2));
        }
        let read = read_csv(csv.as_bytes(), "t.csv").expect("readable").recording;
        Scene::new(&read, "spindle_power_w", &Roles::new()).expect("a scene")
    }

    #[test]
    fn growth_is_followed_tool_by_tool() {
        let scene = recording(0.4, usize::MAX);
        let growth = scene.feed_load_growth().expect("grows");
        for tool in 0..4 {
            assert!(growth[150 * tool + 59].abs() < 0.1, "{}", growth[150 * tool + 59]);
            assert!((growth[150 * tool + 149] - 0.4).abs() < 0.12, "{}", growth[150 * tool + 149]);
        }
    }

    #[test]
    fn a_load_that_does_not_grow_tells_nothing() {
        assert_eq!(recording(0.0, usize::MAX).feed_load_growth(), None);
    }

    #[test]
    fn later_rows_do_not_change_what_was_said() {
        let (whole, spoilt) = (recording(0.4, usize::MAX), recording(0.4, 590));
        let filter = Filter { pass_variance: 1e-3, row_variance: 1e-3, wander: 1e-7 };
        let follow = |scene: &Scene| filter.filter_scene(scene, scene.column("z_torque_nm").expect("there")).growth;
        assert_eq!(follow(&whole)[..590], follow(&spoilt)[..590]);
    }
}
