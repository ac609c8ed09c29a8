//! The bench as two sources: a controller and a meter, each with its own pace, latency, noise and silences.

use super::Course;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{ChannelId, Pull, Reading, SourceError, Stamp};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;
use std::time::Duration;

/// How the meter disturbs what it measures.
#[derive(Debug, Clone, Copy)]
pub struct Disturbance {
    /// White noise, relative.
    pub noise: f64,
    /// Slow ripple, relative amplitude.
    pub ripple: f64,
    /// Pulses per second.
    pub pulses_per_s: f64,
    /// Averaging window of the meter, s.
    pub window_s: f64,
    /// Zero error, W.
    pub zero_w: f64,
}

impl Default for Disturbance {
    fn default() -> Self {
        Self { noise: 0.015, ripple: 0.004, pulses_per_s: 0.05, window_s: 0.2, zero_w: 2.0 }
    }
}

struct Device {
    name: &'static str,
    channels: Vec<ChannelId>,
    course: Arc<Course>,
    disturbance: Disturbance,
    dice: Pcg64Mcg,
    /// Silences, s.
    silent: Vec<(f64, f64)>,
    next_s: f64,
}

/// Controller and meter of a course. Silences are drawn when `dropouts` is set.
pub fn sources(course: &Arc<Course>, disturbance: Disturbance, dropouts: bool, seed: u64) -> Vec<Box<dyn Pull>> {
    let controller = ["spindle_speed_rpm", "feed_mm_min", "rapid"];
    let meter: &[&str] = if course.tells_voltage() {
        &["spindle_power_w", "total_power_w", "supply_voltage_v"]
    } else {
        &["spindle_power_w", "total_power_w"]
    };
    vec![
        Box::new(Device::new("controller", &controller, course, disturbance, dropouts, 2 * seed)),
        Box::new(Device::new("meter", meter, course, disturbance, dropouts, 2 * seed + 1)),
    ]
}

impl Device {
    fn new(
        name: &'static str,
        channels: &[&str],
        course: &Arc<Course>,
        disturbance: Disturbance,
        dropouts: bool,
        seed: u64,
    ) -> Self {
        let mut dice = Pcg64Mcg::seed_from_u64(seed);
        let silent = if dropouts { silences(course.length_s(), &mut dice) } else { Vec::new() };
        let channels = channels.iter().map(|name| ChannelId::from_name(name).expect("in the table")).collect();
        let next_s = dice.random_range(0.0..0.1);
        Self { name, channels, course: course.clone(), disturbance, dice, silent, next_s }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.dice)
    }

    fn value(&mut self, name: &str, time_s: f64) -> f64 {
        let Some(moment) = self.course.at(time_s).copied() else { return 0.0 };
        match name {
            "spindle_speed_rpm" if moment.speed_rpm > 1.0 => (moment.speed_rpm + 0.5 * self.normal()).round(),
            "spindle_speed_rpm" => 0.0,
            "feed_mm_min" => moment.feed_mm_min,
            "rapid" => f64::from(u8::from(moment.rapid)),
            "supply_voltage_v" => moment.supply_v + 0.1 * self.normal(),
            "spindle_power_w" => self.measured(time_s, |moment| moment.spindle_power_w),
            _ => self.measured(time_s, |moment| moment.total_power_w),
        }
    }

    fn measured(&mut self, time_s: f64, of: impl Fn(&super::Moment) -> f64) -> f64 {
        let Disturbance { noise, ripple, pulses_per_s, window_s, zero_w } = self.disturbance;
        let steps = (window_s / super::STEP_S).max(1.0) as usize;
        let window = (0..steps).filter_map(|k| self.course.at(time_s - k as f64 * super::STEP_S)).map(of);
        let mean = window.sum::<f64>() / steps as f64;
        let pulse = if self.dice.random_bool(0.1 * pulses_per_s) { 800.0 } else { 0.0 };
        let wave = ripple * (2.3 * time_s).sin();
        mean * (1.0 + wave + noise * self.normal()) + zero_w + pulse + 0.3 * self.normal()
    }
}

fn silences(length_s: f64, dice: &mut Pcg64Mcg) -> Vec<(f64, f64)> {
    let mut silent = Vec::new();
    let mut at_s = dice.random_range(10.0..30.0);
    while at_s < length_s {
        let end_s = at_s + dice.random_range(0.3..4.0);
        silent.push((at_s, end_s));
        at_s = end_s + dice.random_range(10.0..40.0);
    }
    silent
}

impl Pull for Device {
    fn name(&self) -> &str {
        self.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        Duration::from_millis(100)
    }

    fn next_ns(&self) -> Option<TimeNs> {
        (self.next_s < self.course.length_s()).then(|| nanoseconds(self.next_s))
    }

    fn pull_readings(&mut self, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let arrives_s = self.next_s;
        let half_trip_s = self.dice.random_range(0.005..0.025);
        let mid_s = arrives_s - half_trip_s;
        self.next_s += 0.1 + self.dice.random_range(-0.008..0.008);
        if self.silent.iter().any(|(from, to)| (*from..*to).contains(&arrives_s)) {
            let source_name = self.name.to_owned();
            let (what, next) = ("silence".to_owned(), String::new());
            return Err(SourceError::Line { source_name, what, next });
        }
        let stamp = Stamp { mid_ns: nanoseconds(mid_s), half_width_ns: nanoseconds(half_trip_s) };
        for channel in self.channels.clone() {
            out.push(Reading::from_number(channel, stamp, self.value(channel.name(), mid_s)));
        }
        Ok(())
    }
}

fn nanoseconds(seconds: f64) -> TimeNs {
    (seconds * SECOND_NS as f64) as TimeNs
}
