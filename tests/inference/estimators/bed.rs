//! A pipeline fed by hand, ten ticks a second.

use adapters::clock::SECOND_NS;
use adapters::{Absence, ChannelId, Sample, Slot, Value};
use rules::estimators::{Estimates, Inference, Settings, State};

/// The inputs of a tick. `None` is an absence with the reason of [`Bed::reason`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Now {
    pub(crate) total_w: Option<f64>,
    pub(crate) power_w: Option<f64>,
    pub(crate) speed_rpm: Option<f64>,
    pub(crate) feed_mm_min: Option<f64>,
    pub(crate) rapid: bool,
    pub(crate) stage: f64,
}

impl Now {
    pub(crate) fn rest() -> Self {
        let zero = Some(0.0);
        Self { total_w: Some(300.0), power_w: zero, speed_rpm: zero, feed_mm_min: zero, rapid: false, stage: 0.0 }
    }

    /// Turning at `speed_rpm` with `power_w` into the spindle.
    pub(crate) fn turning(speed_rpm: f64, power_w: f64) -> Self {
        Self { total_w: Some(300.0 + power_w), power_w: Some(power_w), speed_rpm: Some(speed_rpm), ..Self::rest() }
    }

    pub(crate) fn fed(self, feed_mm_min: f64) -> Self {
        Self { feed_mm_min: Some(feed_mm_min), ..self }
    }
}

pub(crate) struct Bed {
    pub(crate) pipeline: Inference,
    pub(crate) reason: Absence,
    /// Channels the machine does not have.
    pub(crate) lacks: Vec<&'static str>,
    at_ns: i64,
    tick: u64,
}

impl Bed {
    pub(crate) fn new(settings: Settings) -> Self {
        Self { pipeline: Inference::new(settings), reason: Absence::Timeout, lacks: vec![], at_ns: 0, tick: 0 }
    }

    pub(crate) fn sample(&mut self, now: Now) -> Sample {
        self.at_ns += SECOND_NS / 10;
        self.tick += 1;
        let mut sample = Sample::new_empty(self.at_ns);
        let channels = [
            ("total_power_w", now.total_w),
            ("spindle_power_w", now.power_w.map(|power| power * (1.0 + self.noise()))),
            ("spindle_speed_rpm", now.speed_rpm),
            ("feed_mm_min", now.feed_mm_min),
            ("rapid", Some(f64::from(u8::from(now.rapid)))),
            ("gear_stage", Some(now.stage)),
        ];
        for (name, value) in channels.into_iter().filter(|(name, _)| !self.lacks.contains(name)) {
            let slot = Slot { value: value.map(Value::Number).ok_or(self.reason), age_ns: 0 };
            sample.set_slot(ChannelId::from_name(name).expect("in the table"), slot);
        }
        sample
    }

    /// One percent, up and down, the same every time.
    fn noise(&self) -> f64 {
        0.01 * [0.0, 1.0, -0.5, 0.6, -1.0, 0.2, -0.7, 0.9, -0.4, -0.1][(self.tick * 7 % 10) as usize]
    }

    pub(crate) fn tick(&mut self, now: Now) -> Estimates {
        let sample = self.sample(now);
        *self.pipeline.update_with_sample(&sample)
    }

    /// Holds the inputs and returns the states that follow each other, and the last estimates.
    pub(crate) fn hold(&mut self, now: Now, seconds: f64) -> (Vec<State>, Estimates) {
        let mut states: Vec<State> = Vec::new();
        let mut last = Estimates::without_samples(0);
        for _ in 0..(seconds * 10.0).round() as usize {
            last = self.tick(now);
            if states.last() != Some(&last.state) {
                states.push(last.state);
            }
        }
        (states, last)
    }

    /// A pause without samples.
    pub(crate) fn pause(&mut self, seconds: f64) {
        self.at_ns += (seconds * SECOND_NS as f64) as i64;
    }

    /// At rest, then turning at 800 rpm with 500 W until this is learned.
    pub(crate) fn warmed_up() -> Self {
        let mut bed = Self::new(Settings::default());
        bed.hold(Now::rest(), 1.0);
        bed.hold(Now::turning(800.0, 500.0), 15.0);
        bed
    }

    pub(crate) fn learned_w(&self, speed_rpm: f64) -> Option<f64> {
        let near = |known: f64| (known / speed_rpm - 1.0).abs() < 0.03;
        self.pipeline.no_load().points().find(|point| near(point.speed_rpm)).map(|point| point.power_w)
    }
}
