//! Stamps of a controller, steadied: the beat of the polling is often steadier than the moment at which the controller
//! answers, and a stamp that is wrong by some tens of milliseconds is an error of every predictor. Left in, it does not
//! move the lag, because it is wrong to either side; but a window that is too long averages it away and explains the power
//! better than the true one.
//!
//! Whether the beat is steadier is seen in the readings themselves: on a ramp a stamp that is wrong shows as a point beside
//! the line through its neighbours.

use super::speed::SpeedPoint;
use numerics::statistics::count_to_f64;

/// Readings to either side through which the beat is drawn.
const REACH: usize = 8;
/// Stamps that scatter less than this are left as they are, s.
const SCATTER_MIN_S: f64 = 0.005;
/// A longer pause than so many usual ones is no beat.
const PAUSES_MAX: f64 = 2.5;
/// A point counts where the speed changes at this share of its fastest change or more.
const STEEP_SHARE: f64 = 0.5;

/// The same readings with stamps on the beat, where that brings them nearer to straight ramps; else as they are.
pub(super) fn regularize_stamps(speed: &[SpeedPoint]) -> Vec<SpeedPoint> {
    let as_it_is = || speed.to_vec();
    let Some(before_s) = scatter_s(speed).filter(|scatter_s| *scatter_s > SCATTER_MIN_S) else { return as_it_is() };
    let beat: Vec<SpeedPoint> =
        (0..speed.len()).map(|at| SpeedPoint { time_s: on_beat(speed, at), ..speed[at] }).collect();
    let in_order = beat.windows(2).all(|pair| pair[0].time_s < pair[1].time_s);
    let better = scatter_s(&beat).is_some_and(|after_s| after_s < 0.7 * before_s);
    if in_order && better { beat } else { as_it_is() }
}

/// Where the straight line through the stamps around a reading puts it, s.
fn on_beat(speed: &[SpeedPoint], at: usize) -> f64 {
    let usual_s = (speed[speed.len() - 1].time_s - speed[0].time_s) / count_to_f64(speed.len() - 1).max(1.0);
    let pause = |a: usize, b: usize| speed[b].time_s - speed[a].time_s > PAUSES_MAX * usual_s;
    // As far to one side as to the other, so that the ends are not bent.
    let reach = REACH.min(at).min(speed.len() - 1 - at);
    let whole = (1..=reach).take_while(|far| !pause(at - far, at - far + 1) && !pause(at + far - 1, at + far)).count();
    let around = &speed[at - whole..=at + whole];
    around.iter().map(|point| point.time_s).sum::<f64>() / count_to_f64(around.len())
}

/// How far stamps scatter on steep ramps, standard deviation by the median, s; `None` without a ramp.
fn scatter_s(speed: &[SpeedPoint]) -> Option<f64> {
    let slope = |a: &SpeedPoint, b: &SpeedPoint| {
        (b.speed_rpm.abs() - a.speed_rpm.abs()) / (b.time_s - a.time_s).max(f64::MIN_POSITIVE)
    };
    let steepest = speed.windows(3).map(|three| slope(&three[0], &three[2]).abs()).fold(0.0, f64::max);
    let beside = |three: &[SpeedPoint]| {
        let rate = slope(&three[0], &three[2]);
        let off_s = (three[1].speed_rpm.abs() - three[0].speed_rpm.abs()) / rate - (three[1].time_s - three[0].time_s);
        // The two neighbours are as wrong as the one between them: 1 + 1/4 + 1/4 of its variance.
        (steepest > 0.0 && rate.abs() >= STEEP_SHARE * steepest).then_some(off_s.abs() / 1.5_f64.sqrt())
    };
    let mut offs_s: Vec<f64> = speed.windows(3).filter_map(beside).collect();
    offs_s.sort_by(f64::total_cmp);
    // The median of the absolute value of a normal distribution of standard deviation 1 is 0.6745.
    offs_s.get(offs_s.len() / 2).map(|median_s| median_s / 0.6745)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp of 1000 rpm/s between two rests.
    fn ramp(time_s: f64) -> f64 {
        1000.0 * (time_s - 3.0).clamp(0.0, 2.0)
    }

    /// Wrong by up to 50 ms to either side.
    fn wrong_s(k: i32) -> f64 {
        0.05 * (f64::from((k * k * 17 + k * 5) % 41) / 20.0 - 1.0)
    }

    fn most_wrong_s(speed: &[SpeedPoint]) -> f64 {
        let on_ramp = speed.iter().filter(|point| (100.0..1900.0).contains(&point.speed_rpm));
        on_ramp.map(|point| (point.time_s - 3.0 - point.speed_rpm / 1000.0).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn stamps_that_scatter_about_a_beat_are_put_on_it() {
        let true_s = |k: i32| 0.1 * f64::from(k);
        let point = |k: i32| SpeedPoint { time_s: true_s(k) + wrong_s(k), speed_rpm: ramp(true_s(k)) };
        let mut speed: Vec<SpeedPoint> = (0..80).map(point).collect();
        speed.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let steady = regularize_stamps(&speed);
        assert!(most_wrong_s(&speed) > 0.04 && most_wrong_s(&steady) < 0.025, "{}", most_wrong_s(&steady));
    }

    #[test]
    fn stamps_that_are_right_are_left_though_the_beat_is_not_even() {
        let true_s = |k: i32| 0.1 * f64::from(k) + wrong_s(k);
        let mut speed: Vec<SpeedPoint> =
            (0..80).map(|k| SpeedPoint { time_s: true_s(k), speed_rpm: ramp(true_s(k)) }).collect();
        speed.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        assert_eq!(regularize_stamps(&speed), speed);
        assert_eq!(regularize_stamps(&[]), []);
    }
}
