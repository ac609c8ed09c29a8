//! A course of speed, and running integrals of everything that is predicted from it: a mean over any window is a
//! difference of two of them.

use std::f64::consts::TAU;

/// Speed at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedPoint {
    /// Stamp of the controller's reading, s.
    pub time_s: f64,
    /// Speed, rpm; the sign does not matter.
    pub speed_rpm: f64,
}

/// Power at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerPoint {
    /// Stamp of the meter's reading, s, on the same clock.
    pub time_s: f64,
    /// Power that the meter reads, W.
    pub power_w: f64,
}

/// A stretch around a change of speed in which nothing is cut: both courses in the order of their stamps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Transient {
    /// What the controller said.
    pub speed: Vec<SpeedPoint>,
    /// What the meter said.
    pub power: Vec<PowerPoint>,
}

/// Predictors besides the constant: `|n|` in krpm, its square and cube, kinetic energy per inertia put in and taken out,
/// the excess of a run-up, and that it turns at all.
pub(super) const PREDICTORS: usize = 7;

/// Changes of speed over three readings below this share of the greatest speed are noise of the encoder, not a ramp.
const NOISE_SHARE: f64 = 0.002;

/// Above this the spindle turns, krpm.
const TURNING_KRPM: f64 = 0.01;

/// Running integrals at the stamps of the speed.
#[derive(Debug, Clone)]
pub(super) struct RunningIntegrals {
    times_s: Vec<f64>,
    sums: Vec<[f64; PREDICTORS]>,
}

impl RunningIntegrals {
    /// `tau_s`: how fast the excess of a run-up dies away.
    pub(super) fn from_speeds(speed: &[SpeedPoint], top_rpm: f64, tau_s: f64) -> Self {
        let krpm: Vec<f64> = speed.iter().map(|point| point.speed_rpm.abs() / 1000.0).collect();
        let (mut times_s, mut sums) = (Vec::with_capacity(speed.len()), Vec::with_capacity(speed.len()));
        let (mut sum, mut excess) = ([0.0; PREDICTORS], 0.0);
        for index in 0..speed.len() {
            if index > 0 {
                let dt_s = (speed[index].time_s - speed[index - 1].time_s).max(0.0);
                add_levels(&mut sum, krpm[index - 1], krpm[index], dt_s);
                add_energy(&mut sum, &krpm, index, NOISE_SHARE * top_rpm / 1000.0);
                let since_s = if is_run_up_start(&krpm, index, top_rpm) {
                    excess = 1.0;
                    running_s(speed, index)
                } else {
                    dt_s
                };
                let left = (-since_s / tau_s).exp();
                sum[5] += excess * tau_s * (1.0 - left);
                excess *= left;
            }
            times_s.push(speed[index].time_s);
            sums.push(sum);
        }
        Self { times_s, sums }
    }

    /// Means over `[middle - window / 2, middle + window / 2]`; `None` beyond the course.
    pub(super) fn average_window(&self, middle_s: f64, window_s: f64) -> Option<[f64; PREDICTORS]> {
        let half_s = 0.5 * window_s.max(1e-3);
        let (from, to) =
            (self.interpolate_integrals(middle_s - half_s)?, self.interpolate_integrals(middle_s + half_s)?);
        let mut mean = [0.0; PREDICTORS];
        mean.iter_mut().zip(from.iter().zip(to)).for_each(|(mean, (from, to))| *mean = (to - from) / (2.0 * half_s));
        Some(mean)
    }

    fn interpolate_integrals(&self, time_s: f64) -> Option<[f64; PREDICTORS]> {
        let after = self.times_s.partition_point(|known_s| *known_s <= time_s);
        let before = after.checked_sub(1)?;
        if after == self.times_s.len() {
            return (self.times_s[before] == time_s).then(|| self.sums[before]);
        }
        let share = (time_s - self.times_s[before]) / (self.times_s[after] - self.times_s[before]);
        let mut sum = self.sums[before];
        sum.iter_mut().zip(self.sums[after]).for_each(|(sum, next)| *sum += share * (next - *sum));
        Some(sum)
    }
}

/// Integrals over a straight piece between two speeds, krpm.
fn add_levels(sum: &mut [f64; PREDICTORS], from: f64, to: f64, dt_s: f64) {
    sum[0] += 0.5 * (from + to) * dt_s;
    sum[1] += (from * from + from * to + to * to) / 3.0 * dt_s;
    sum[2] += (from + to) * (from * from + to * to) / 4.0 * dt_s;
    sum[6] += if from.max(to) > TURNING_KRPM { dt_s } else { 0.0 };
}

/// Energy per inertia put in or taken out between two readings. Which of the two is judged over three readings, centred so
/// that nothing is delayed: the noise of a steady speed would else be rectified into energy.
fn add_energy(sum: &mut [f64; PREDICTORS], krpm: &[f64], index: usize, noise: f64) {
    let (before, behind) = (krpm[index.saturating_sub(2)], krpm[(index + 1).min(krpm.len() - 1)]);
    let (from, to, rad_s) = (krpm[index - 1], krpm[index], TAU * 1000.0 / 60.0);
    let energy = 0.5 * rad_s * rad_s * (to * to - from * from);
    match behind - before {
        change if change > noise => sum[3] += energy,
        change if change < -noise => sum[4] += energy,
        _ => {}
    }
}

/// How long before this point, the first of a run-up, the run-up began, s: where the energy, put in at the pace of the
/// interval that follows, was that of the point before. At ten readings a second the excess of a run-up would else begin up
/// to a tenth of a second too early, and take the lag with it.
fn running_s(speed: &[SpeedPoint], index: usize) -> f64 {
    let dt_s = (speed[index].time_s - speed[index - 1].time_s).max(0.0);
    let Some(next) = speed.get(index + 1) else { return 0.5 * dt_s };
    let [before, here, behind] = [&speed[index - 1], &speed[index], next].map(|point| point.speed_rpm.powi(2));
    let pace = (behind - here) / (next.time_s - speed[index].time_s);
    if pace > 0.0 { ((here - before) / pace).clamp(0.0, dt_s) } else { 0.5 * dt_s }
}

/// Does a run-up begin with this point?
fn is_run_up_start(krpm: &[f64], index: usize, top_rpm: f64) -> bool {
    let rise = |at: usize| krpm[at] - krpm[at - 1];
    let least = 0.01 * top_rpm / 1000.0;
    rise(index) > least && (index < 2 || rise(index - 1) <= least) && (index < 3 || rise(index - 2) <= least)
}

impl Transient {
    /// Least and greatest speed, rpm.
    pub(super) fn range_rpm(&self) -> (f64, f64) {
        let speeds = self.speed.iter().map(|point| point.speed_rpm.abs());
        speeds.fold((f64::INFINITY, 0.0), |(least, greatest), speed| (least.min(speed), greatest.max(speed)))
    }

    /// Greatest rate of change over a second, rpm/s.
    pub(super) fn steepest_rpm_s(&self) -> f64 {
        let rate = |(at, point): (usize, &SpeedPoint)| {
            let later = self.speed[at..].iter().find(|later| later.time_s >= point.time_s + 1.0)?;
            Some((later.speed_rpm.abs() - point.speed_rpm.abs()).abs() / (later.time_s - point.time_s))
        };
        self.speed.iter().enumerate().filter_map(rate).fold(0.0, f64::max)
    }

    /// Middle of its power readings, s.
    pub(super) fn middle_s(&self) -> f64 {
        let ends = self.power.first().zip(self.power.last());
        ends.map_or(0.0, |(first, last)| 0.5 * (first.time_s + last.time_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_over_a_ramp_is_exact() {
        // 0 to 3000 rpm in 3 s.
        let speed: Vec<SpeedPoint> =
            (0..=30).map(|k| SpeedPoint { time_s: 0.1 * f64::from(k), speed_rpm: 100.0 * f64::from(k) }).collect();
        let running = RunningIntegrals::from_speeds(&speed, 1e-9, 1.0);
        let mean = running.average_window(1.5, 1.0).expect("inside");
        let rad_s2 = TAU * 1000.0 / 60.0;
        let per_inertia = 0.5 * rad_s2 * rad_s2 * (4.0 - 1.0);
        assert!((mean[0] - 1.5).abs() < 1e-9 && (mean[1] - (8.0 - 1.0) / 3.0).abs() < 1e-9);
        assert!((mean[3] - per_inertia).abs() < 1e-6 * per_inertia && mean[4] == 0.0);
        assert_eq!(running.average_window(2.9, 1.0), None);
    }

    #[test]
    fn the_noise_of_a_steady_speed_is_no_energy() {
        let speed: Vec<SpeedPoint> = (0..200)
            .map(|k| SpeedPoint { time_s: 0.05 * f64::from(k), speed_rpm: 3000.0 + f64::from(k % 3) })
            .collect();
        let mean = RunningIntegrals::from_speeds(&speed, 3000.0, 1.0).average_window(5.0, 8.0).expect("inside");
        assert!(mean[3] < 1e-9 && mean[4] > -1e-9);
    }
}
