//! The stream, both directions.

use adapter_core::integer::convert_bounded;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The header line is no longer than this.
pub(super) const HEADER_MAX: usize = 4096;
/// Marker, sequence, time, count.
pub(super) const FRAME_HEAD: usize = 16;
const MARK: [u8; 2] = *b"W1";
const CHANNELS_MAX: usize = 8;
/// Samples per channel in one frame.
pub(super) const COUNT_MAX: u16 = 4096;
const FORMAT: &str = "waveform/1";
/// Unit of a current that is an amplitude already.
pub const AMPLITUDE: &str = "A rms";

/// What a stream carries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WaveformHeader {
    /// The version of the stream: `waveform/1`.
    pub format: String,
    /// Samples per second and channel.
    pub rate_hz: f64,
    /// What each column is.
    pub channels: Vec<String>,
    /// Unit of a sample times its scale.
    pub unit: String,
    /// One factor per channel.
    pub scale: Vec<f64>,
    /// A sample of this size or more was clipped.
    pub full_scale: i16,
}

/// Why bytes are no stream.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FrameError {
    /// The first line cannot be used.
    #[error("the header line cannot be used: {0}")]
    Header(String),
    /// A frame does not begin with its mark, or counts too many samples.
    #[error("no frame where one should begin: {0}")]
    Frame(String),
}

impl WaveformHeader {
    /// Currents of a number of phases.
    #[must_use]
    pub fn with_currents(rate_hz: f64, channels: &[&str], scale_a: f64, full_scale: i16) -> Self {
        Self {
            format: FORMAT.to_owned(),
            rate_hz,
            channels: channels.iter().map(|name| (*name).to_owned()).collect(),
            unit: "A".to_owned(),
            scale: vec![scale_a; channels.len()],
            full_scale,
        }
    }

    /// One current whose amplitude is sampled, not its course: the load current as a drive knows it.
    #[must_use]
    pub fn with_amplitude(rate_hz: f64, scale_a: f64, full_scale: i16) -> Self {
        Self { unit: AMPLITUDE.to_owned(), ..Self::with_currents(rate_hz, &["load_current"], scale_a, full_scale) }
    }

    /// The header in a line.
    ///
    /// # Errors
    /// [`FrameError::Header`]: what is wrong.
    pub fn parse(line: &str) -> Result<Self, FrameError> {
        let header: Self = serde_json::from_str(line).map_err(|error| FrameError::Header(error.to_string()))?;
        let refuse = |what: String| Err(FrameError::Header(what));
        if header.format != FORMAT {
            return refuse(format!("format {:?}, this version reads {FORMAT}", header.format));
        }
        if !(1.0..=1e6).contains(&header.rate_hz) {
            return refuse(format!("rate_hz {}: 1 to 1000000", header.rate_hz));
        }
        let channels = header.channels.len();
        if !(1..=CHANNELS_MAX).contains(&channels) || header.scale.len() != channels {
            return refuse(format!("{channels} channels and {} scales: 1 to 8, as many as scales", header.scale.len()));
        }
        if header.scale.iter().any(|scale| !scale.is_finite() || *scale == 0.0) || header.full_scale <= 0 {
            return refuse("a scale that is 0 or no number, or a full_scale that is not above 0".to_owned());
        }
        Ok(header)
    }

    /// The line, with its line feed.
    #[must_use]
    pub fn encode_line(&self) -> String {
        let text = serde_json::to_string(self).unwrap_or_default();
        text + "\n"
    }

    /// Nanoseconds of so many samples.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a cast from a double saturates")]
    pub fn duration_ns(&self, samples: f64) -> i64 {
        (samples * 1e9 / self.rate_hz).round() as i64
    }
}

/// Some samples of every channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WaveformFrame {
    /// Counts frames and wraps.
    pub sequence: u32,
    /// Time of the first sample on the sampler's clock, ns.
    pub first_ns: i64,
    /// All channels of one instant together.
    pub samples: Vec<i16>,
}

/// Sequence, time and bytes behind the head of a frame.
pub(super) fn parse_head(bytes: &[u8; FRAME_HEAD], channels: usize) -> Result<(u32, i64, usize), FrameError> {
    let [m0, m1, s0, s1, s2, s3, t0, t1, t2, t3, t4, t5, t6, t7, c0, c1] = *bytes;
    let count = u16::from_le_bytes([c0, c1]);
    if [m0, m1] != MARK || !(1..=COUNT_MAX).contains(&count) {
        return Err(FrameError::Frame(format!("{bytes:02X?}")));
    }
    let first_ns = u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
    let first_ns = i64::try_from(first_ns).map_err(|_| FrameError::Frame(format!("a time of {first_ns} ns")))?;
    Ok((u32::from_le_bytes([s0, s1, s2, s3]), first_ns, 2 * usize::from(count) * channels))
}

impl WaveformFrame {
    /// The frame on the wire. At most 4096 samples per channel are sent.
    #[must_use]
    pub fn to_bytes(&self, channels: usize) -> Vec<u8> {
        let count = (self.samples.len() / channels.max(1)).min(usize::from(COUNT_MAX));
        let count: u16 = convert_bounded(count, COUNT_MAX);
        let mut bytes = Vec::with_capacity(FRAME_HEAD + 2 * self.samples.len());
        bytes.extend(MARK);
        bytes.extend(self.sequence.to_le_bytes());
        bytes.extend(self.first_ns.max(0).to_le_bytes());
        bytes.extend(count.to_le_bytes());
        let used = usize::from(count) * channels;
        bytes.extend(self.samples[..used].iter().flat_map(|sample| sample.to_le_bytes()));
        bytes
    }
}

/// The samples in the body of a frame.
pub(super) fn decode_samples(body: &[u8]) -> Vec<i16> {
    body.chunks_exact(2).map(|pair| i16::from_le_bytes([pair[0], pair[1]])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_survives_the_wire() {
        let frame = WaveformFrame {
            sequence: 7,
            first_ns: 1_700_000_000_123_456_789,
            samples: vec![1, -2, 3, -4, 32767, -32768],
        };
        let bytes = frame.to_bytes(3);
        let (sequence, first_ns, body) = parse_head(bytes.first_chunk().expect("a head"), 3).expect("a frame");
        assert_eq!((sequence, first_ns, body), (7, frame.first_ns, 12));
        assert_eq!(decode_samples(&bytes[FRAME_HEAD..]), frame.samples);
        assert!(parse_head(b"HTTP/1.1 400 Bad", 3).is_err());
    }

    #[test]
    fn a_header_says_what_is_wrong_with_it() {
        let header = WaveformHeader::with_currents(1000.0, &["i_u", "i_v", "i_w"], 0.01, 32767);
        assert_eq!(WaveformHeader::parse(header.encode_line().trim()), Ok(header.clone()));
        for (from, to, part) in
            [("waveform/1", "waveform/2", "format"), ("1000", "0", "rate_hz"), ("[0.01,", "[", "scales")]
        {
            let error = WaveformHeader::parse(&header.encode_line().replacen(from, to, 1)).expect_err(part).to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(0_u8.., 16), text in "\\PC{0,80}") {
            let _ = parse_head(bytes.first_chunk().expect("sixteen"), 3);
            let _ = WaveformHeader::parse(&text);
        }
    }
}
