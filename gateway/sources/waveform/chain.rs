//! Filter and feature of one stream.

use adapters::Stamp;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::waveform::{AMPLITUDE, Block, WaveformHeader};
use rules::estimators::spindle_current::{
    Feature, FeatureKind, LowPass, LowPassDesign, PhaseFeature, ThreePhase, WindowSpan,
};

/// The low-pass of the source of the method, Hz, and its greatest share of the rate.
const CUTOFF_HZ: f64 = 350.0;
const CUTOFF_SHARE: f64 = 0.35;
/// Currents below this share of full scale are none.
const LEAST_SHARE: f64 = 0.002;
/// Half periods of a window: a whole period.
const HALVES: usize = 2;
/// The window of an amplitude is a period of this, Hz: a tenth of a second.
const AMPLITUDE_HZ: f64 = 10.0;

enum Phases {
    One(Box<(LowPass, PhaseFeature)>),
    Three(Box<ThreePhase>),
}

pub(super) struct WaveformChain {
    header: WaveformHeader,
    phases: Phases,
    delay_s: f64,
    least_a: f64,
}

/// Why a stream is no spindle current.
#[derive(Debug, thiserror::Error)]
pub(super) enum UnsuitableStream {
    /// Its rate allows no filter or no window.
    #[error("{0}")]
    Rate(#[from] rules::estimators::regression::Refusal),
    /// It has other channels, or another unit.
    #[error("{channels} channels in {unit:?}: spindle current is 1 or 3 in \"A\"")]
    Channels { channels: usize, unit: String },
}

/// Features of one poll.
#[derive(Debug, Default)]
pub(super) struct Sums {
    features: f64,
    square_a2: f64,
    /// Sum of the middles, ns after the first one.
    middle_ns: f64,
    first_ns: Option<TimeNs>,
    length_s: f64,
    /// Of the raw samples: for a current that is none.
    raw_square_a2: f64,
    raw_samples: f64,
    peak_a: f64,
    least_a: f64,
    raw_ns: (TimeNs, TimeNs),
}

impl WaveformChain {
    pub(super) fn new(header: &WaveformHeader) -> Result<Self, UnsuitableStream> {
        let rate_hz = header.rate_hz;
        let least_a = LEAST_SHARE * f64::from(header.full_scale) * header.scale[0].abs();
        let design = LowPassDesign::low_pass(CUTOFF_HZ.min(CUTOFF_SHARE * rate_hz), rate_hz)?;
        // An amplitude passes no zero: its window has a length of its own.
        let amplitude = header.unit == AMPLITUDE;
        let span = if amplitude { WindowSpan::Known { hz: AMPLITUDE_HZ } } else { WindowSpan::Crossings { least_a } };
        let phase = PhaseFeature::new(FeatureKind::Rms, span, HALVES, rate_hz)?;
        let phases = match (header.channels.len(), header.unit.as_str()) {
            (1, "A" | AMPLITUDE) => Phases::One(Box::new((design.build_filter(), phase))),
            (3, "A") => Phases::Three(Box::new(ThreePhase::new(&design, phase))),
            (channels, unit) => {
                return Err(UnsuitableStream::Channels { channels, unit: unit.to_owned() });
            }
        };
        Ok(Self { header: header.clone(), phases, delay_s: design.delay_s(), least_a })
    }

    pub(super) fn matches_header(&self, header: &WaveformHeader) -> bool {
        self.header == *header
    }

    /// How uneven the phases are, once known.
    pub(super) fn unbalance(&self) -> Option<f64> {
        match &self.phases {
            Phases::One(_) => None,
            Phases::Three(three) => three.unbalance(),
        }
    }

    /// Takes a block; the greatest feature in it.
    pub(super) fn push(&mut self, block: &Block, sums: &mut Sums) -> Option<f64> {
        let (channels, sample_s) = (self.header.channels.len(), 1.0 / self.header.rate_hz);
        let (mut time_s, mut greatest) = (0.0, None::<f64>);
        sums.least_a = self.least_a;
        for instant in block.raw.chunks_exact(channels) {
            time_s += sample_s;
            let ampere = |at: usize| f64::from(instant[at]) * self.header.scale[at];
            for at in 0..channels {
                sums.add_raw_sample(ampere(at));
            }
            let feature = match &mut self.phases {
                Phases::One(one) => one.0.push(ampere(0)).and_then(|filtered| one.1.push(filtered)),
                Phases::Three(three) => three.push([ampere(0), ampere(1), ampere(2)]),
            };
            if let Some(feature) = feature {
                greatest = Some(greatest.map_or(feature.value, |known| known.max(feature.value)));
                let middle_s = time_s - self.delay_s - 0.5 * feature.window_s;
                sums.add_feature(&feature, block.first_ns + to_nanoseconds(middle_s));
            }
        }
        let from_ns = if sums.raw_ns.0 == 0 { block.first_ns } else { sums.raw_ns.0 };
        sums.raw_ns = (from_ns, block.first_ns + to_nanoseconds(time_s));
        greatest
    }
}

impl Sums {
    fn add_raw_sample(&mut self, ampere: f64) {
        self.raw_square_a2 += ampere * ampere;
        self.raw_samples += 1.0;
        self.peak_a = self.peak_a.max(ampere.abs());
    }

    #[expect(clippy::cast_precision_loss, reason = "times within one poll")]
    fn add_feature(&mut self, feature: &Feature, middle_ns: TimeNs) {
        let first_ns = *self.first_ns.get_or_insert(middle_ns);
        self.features += 1.0;
        self.square_a2 += feature.value * feature.value;
        self.middle_ns += (middle_ns - first_ns) as f64;
        self.length_s += feature.window_s;
    }

    /// One value for the poll. Without a whole period in it there is one only if there is no current at all.
    #[expect(clippy::cast_possible_truncation, reason = "times within one poll")]
    pub(super) fn compute_reading(&self) -> Option<(Stamp, f64)> {
        if let Some(first_ns) = self.first_ns {
            let mid_ns = first_ns + (self.middle_ns / self.features) as i64;
            let stamp = Stamp { mid_ns, half_width_ns: to_nanoseconds(0.5 * self.length_s) };
            return Some((stamp, (self.square_a2 / self.features).sqrt()));
        }
        if self.raw_samples == 0.0 || self.peak_a > self.least_a {
            return None;
        }
        Some((Stamp::of_request(self.raw_ns.0, self.raw_ns.1), (self.raw_square_a2 / self.raw_samples).sqrt()))
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a cast from a double saturates")]
pub(crate) fn to_nanoseconds(seconds: f64) -> TimeNs {
    (seconds * SECOND_NS as f64) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// One second of three phases of 10 A rms at 47 Hz.
    fn block(header: &WaveformHeader) -> Block {
        let sample = |k: i32, phase: i32| {
            let angle = TAU * (47.0 * f64::from(k) / header.rate_hz - f64::from(phase) / 3.0);
            #[expect(clippy::cast_possible_truncation, reason = "within sixteen bits")]
            let counts = (10.0 * 2.0_f64.sqrt() * angle.sin() / 0.01).round() as i16;
            counts
        };
        let raw = (0..1000).flat_map(|k| (0..3).map(move |phase| (k, phase))).map(|(k, phase)| sample(k, phase));
        Block { first_ns: 0, gap: 0, clipped: 0, raw: raw.collect() }
    }

    #[test]
    fn a_sine_gives_its_root_mean_square_in_the_middle() {
        let header = WaveformHeader::with_currents(1000.0, &["u", "v", "w"], 0.01, 32767);
        let mut chain = WaveformChain::new(&header).expect("three phases");
        let mut sums = Sums::default();
        chain.push(&block(&header), &mut sums);
        let (stamp, value_a) = sums.compute_reading().expect("many periods");
        assert!((value_a - 10.0).abs() < 0.05, "{value_a}");
        assert!((stamp.mid_ns - 500_000_000).abs() < 20_000_000, "{stamp:?}");
        assert!(chain.unbalance().is_some_and(|unbalance| unbalance < 0.01));
    }

    #[test]
    fn an_amplitude_is_its_own_root_mean_square() {
        let mut chain = WaveformChain::new(&WaveformHeader::with_amplitude(1000.0, 0.01, 32767)).expect("an amplitude");
        let mut sums = Sums::default();
        chain.push(&Block { first_ns: 0, gap: 0, clipped: 0, raw: vec![-1234; 1000] }, &mut sums);
        let (stamp, value_a) = sums.compute_reading().expect("a second");
        assert!((value_a - 12.34).abs() < 0.2, "{value_a}");
        assert!((stamp.mid_ns - 500_000_000).abs() < 60_000_000, "{stamp:?}");
    }

    #[test]
    fn no_current_is_a_value_and_two_phases_are_refused() {
        let header = WaveformHeader::with_currents(1000.0, &["u"], 0.01, 32767);
        let mut sums = Sums::default();
        let still = Block { first_ns: 10, gap: 0, clipped: 0, raw: vec![1; 100] };
        WaveformChain::new(&header).expect("one phase").push(&still, &mut sums);
        assert!(sums.compute_reading().is_some_and(|(_, value_a)| value_a < 0.02));
        assert!(WaveformChain::new(&WaveformHeader::with_currents(1000.0, &["u", "v"], 0.01, 32767)).is_err());
    }
}
