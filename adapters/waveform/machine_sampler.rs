//! The built-in machine's spindle current: three phases of an inverter, as a sampler sees them.

use super::frame::WaveformHeader;
use super::producer::Sampler;
use crate::clock::{Clock, SECOND_NS, TimeNs};
use crate::simulated::Simulated;
use adapter_core::integer::take_low_u32;
use std::f64::consts::TAU;
use std::io;
use std::sync::Arc;

/// A per count; full scale is 163 A.
const SCALE_A: f64 = 0.005;
/// Pole pairs of the motor behind a 1:1 belt.
const POLE_PAIRS: f64 = 2.0;
/// Share of the fifth harmonic, and noise in counts.
const FIFTH: f64 = 0.03;
const NOISE_COUNTS: f64 = 3.0;

/// Three phases of the built-in machine's spindle current.
pub struct SimulatedCurrent {
    machine: Simulated,
    clock: Arc<dyn Clock>,
    rate_hz: f64,
    block: i64,
    /// Number of the next sample since `origin_ns`.
    next: i64,
    origin_ns: TimeNs,
    angle_rad: f64,
    noise: u64,
}

impl SimulatedCurrent {
    /// The machine's currents at this rate, `block` instants at a time.
    #[must_use]
    pub fn new(machine: &Simulated, clock: Arc<dyn Clock>, rate_hz: f64, block: u16) -> Self {
        let origin_ns = clock.now_ns();
        let block = i64::from(block.max(1));
        Self { machine: machine.clone(), clock, rate_hz, block, next: 0, origin_ns, angle_rad: 0.0, noise: 1 }
    }

    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "samples of years fit")]
    fn time_ns(&self, sample: i64) -> TimeNs {
        self.origin_ns + (sample as f64 * SECOND_NS as f64 / self.rate_hz).round() as i64
    }

    /// Uniform within one count either side, by a xorshift.
    fn sample_noise(&mut self) -> f64 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        let share = f64::from(take_low_u32(self.noise >> 40)) / f64::from(1_u32 << 24);
        2.0 * share - 1.0
    }

    #[expect(clippy::cast_possible_truncation, reason = "a cast from a double saturates, as a converter does")]
    fn sample_instant(&mut self, peak_a: f64, out: &mut Vec<i16>) {
        for phase in 0..3 {
            let angle = self.angle_rad - TAU / 3.0 * f64::from(phase);
            let current_a = peak_a * (angle.sin() + FIFTH * (5.0 * angle).sin());
            let counts = current_a / SCALE_A + NOISE_COUNTS * self.sample_noise();
            out.push(counts.round().clamp(-32767.0, 32767.0) as i16);
        }
    }
}

impl Sampler for SimulatedCurrent {
    fn header(&self) -> WaveformHeader {
        WaveformHeader::with_currents(self.rate_hz, &["i_u", "i_v", "i_w"], SCALE_A, 32767)
    }

    fn next(&mut self) -> io::Result<Option<(i64, Vec<i16>)>> {
        let (first_ns, end_ns) = (self.time_ns(self.next), self.time_ns(self.next + self.block));
        self.clock.sleep_until(end_ns);
        let mut samples = Vec::new();
        for sample in self.next..self.next + self.block {
            let moment = self.machine.moment(self.time_ns(sample));
            // The true root mean square over a period, the harmonic included.
            let peak_a = 2.0_f64.sqrt() * moment.electric.spindle_current_a / (1.0 + FIFTH * FIFTH).sqrt();
            let hz = moment.truth.spindle_speed_rpm.abs() / 60.0 * POLE_PAIRS;
            self.angle_rad = (self.angle_rad + TAU * hz / self.rate_hz) % TAU;
            self.sample_instant(peak_a, &mut samples);
        }
        self.next += self.block;
        Ok(Some((first_ns, samples)))
    }
}
