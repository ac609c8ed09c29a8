//! A device's own clock and the line to it.

use super::noise::{Purpose, sample_uniform};
use super::settings::DeviceSettings;
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::driver::SourceError;
use adapter_core::integer::saturate_to_wait_ns;
use std::time::Duration;

/// A request is given up after this time.
pub(super) const DEADLINE: Duration = Duration::from_millis(200);

/// A device that is polled: when requests begin and end, and which of the device's own beats an answer shows.
#[derive(Debug, Clone)]
pub(super) struct PolledDevice {
    settings: DeviceSettings,
    seed: u64,
    origin_ns: TimeNs,
    /// Number of the next poll on the beat of the one who asks.
    poll: i64,
}

impl PolledDevice {
    pub(super) fn new(settings: DeviceSettings, seed: u64, origin_ns: TimeNs) -> Self {
        Self { settings, seed, origin_ns, poll: 0 }
    }

    pub(super) fn period(&self) -> Duration {
        self.settings.period
    }

    /// When the next poll begins if it keeps its beat.
    pub(super) fn next_begin_ns(&self) -> TimeNs {
        self.origin_ns + self.poll * saturate_to_wait_ns(self.settings.period)
    }

    /// How long the next request takes.
    pub(super) fn round_trip_ns(&self) -> i64 {
        let excess = -(1.0 - sample_uniform(self.seed, Purpose::RoundTrip, self.poll)).ln();
        let slow = if sample_uniform(self.seed, Purpose::SlowRoundTrip, self.poll) < 0.01 { 5.0 } else { 1.0 };
        let jitter = self.settings.jitter.mul_f64((excess * slow).min(20.0));
        saturate_to_wait_ns((self.settings.round_trip + jitter).min(DEADLINE))
    }

    /// The next poll is the first one that begins at or after `after_ns`.
    pub(super) fn schedule_next_poll(&mut self, after_ns: TimeNs) {
        let period_ns = saturate_to_wait_ns(self.settings.period).max(1);
        let beats = (after_ns - self.origin_ns + period_ns - 1).div_euclid(period_ns);
        self.poll = (self.poll + 1).max(beats);
    }

    /// Number of the newest beat of the device's own clock that is published by `at_ns`.
    pub(super) fn newest_beat(&self, at_ns: TimeNs) -> i64 {
        let published_ns = at_ns - saturate_to_wait_ns(self.settings.latency);
        #[expect(clippy::cast_possible_truncation, reason = "beats of centuries fit")]
        let beat = (self.device_s(published_ns) / self.settings.refresh.as_secs_f64()).floor() as i64;
        beat
    }

    /// When the device's clock strikes this beat.
    pub(super) fn beat_ns(&self, beat: i64) -> TimeNs {
        #[expect(clippy::cast_precision_loss, reason = "beats of centuries fit a double")]
        let device_s = beat as f64 * self.settings.refresh.as_secs_f64();
        let since_s = (device_s - self.settings.clock_offset_s) / self.clock_rate();
        #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
        let since_ns = (since_s * SECOND_NS as f64).round() as i64;
        self.origin_ns + since_ns
    }

    /// The device's own clock, s.
    #[expect(clippy::cast_precision_loss, reason = "a double counts nanoseconds exactly for 104 days")]
    pub(super) fn device_s(&self, at_ns: TimeNs) -> f64 {
        (at_ns - self.origin_ns) as f64 / SECOND_NS as f64 * self.clock_rate() + self.settings.clock_offset_s
    }

    fn clock_rate(&self) -> f64 {
        1.0 + 1e-6 * self.settings.clock_drift_ppm
    }
}

pub(super) fn build_timeout_error(name: &str) -> SourceError {
    SourceError::Timeout {
        source_name: name.to_owned(),
        request: "the measured values".to_owned(),
        deadline_ms: 200,
        next: "It is a simulated one that is silent now and then on purpose (dropouts_per_h); nothing is to be done."
            .to_owned(),
    }
}
