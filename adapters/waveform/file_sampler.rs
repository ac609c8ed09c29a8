//! A file of samples as a sampler: CSV with a header, `time_s` first, then one column per channel in ampere.

use super::frame::{COUNT_MAX, WaveformHeader};
use super::producer::Sampler;
use crate::clock::{Clock, SECOND_NS, TimeNs};
use adapter_core::integer::length_to_i64;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Error, ErrorKind};
use std::path::Path;
use std::sync::Arc;

const CHANNELS_MAX: usize = 8;
const FULL_SCALE: i16 = 32767;

/// Plays a file at the pace of its own times, once.
pub struct Recorded {
    lines: io::Lines<BufReader<File>>,
    place: String,
    line: usize,
    names: Vec<String>,
    scale_a: f64,
    rate_hz: f64,
    block: usize,
    clock: Arc<dyn Clock>,
    origin_ns: TimeNs,
    sent: i64,
}

impl Recorded {
    /// The samples of `file`, taken at `rate_hz` and at most `peak_a` in size.
    ///
    /// # Errors
    /// A file that cannot be read, or has no columns.
    pub fn open(file: &Path, rate_hz: f64, peak_a: f64, clock: Arc<dyn Clock>) -> io::Result<Self> {
        let mut lines = BufReader::new(File::open(file)?).lines();
        let place = file.display().to_string();
        let bad = |what: &str| Error::new(ErrorKind::InvalidData, format!("{place}: {what}"));
        let header = lines.next().ok_or_else(|| bad("is empty"))??;
        let names: Vec<String> = header.trim().split(',').skip(1).map(|name| name.trim().to_owned()).collect();
        let times = header.trim_start().starts_with("time_s,");
        if !times || !(1..=CHANNELS_MAX).contains(&names.len()) {
            return Err(bad("the first line must be time_s and one to eight names"));
        }
        if !((1.0..=1e6).contains(&rate_hz) && peak_a.is_finite() && peak_a > 0.0) {
            return Err(bad("give a rate from 1 to 1000000 Hz and a greatest current above 0"));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 20 000")]
        let block = ((rate_hz / 50.0).ceil() as usize).clamp(1, usize::from(COUNT_MAX));
        let (origin_ns, scale_a) = (clock.now_ns(), peak_a / f64::from(FULL_SCALE));
        Ok(Self { lines, place, line: 1, names, scale_a, rate_hz, block, clock, origin_ns, sent: 0 })
    }

    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "samples of years fit")]
    fn time_ns(&self, sample: i64) -> TimeNs {
        self.origin_ns + (sample as f64 * SECOND_NS as f64 / self.rate_hz).round() as i64
    }

    #[expect(clippy::cast_possible_truncation, reason = "a cast from a double saturates, as a converter does")]
    fn read_row(&mut self, out: &mut Vec<i16>) -> io::Result<bool> {
        let Some(text) = self.lines.next() else { return Ok(false) };
        self.line += 1;
        let text = text?;
        let bad = || {
            let what = format!("{} line {}: not {} numbers", self.place, self.line, self.names.len() + 1);
            Error::new(ErrorKind::InvalidData, what)
        };
        let numbers: Vec<f64> = text.trim().split(',').skip(1).map_while(|cell| cell.trim().parse().ok()).collect();
        if numbers.len() != self.names.len() || numbers.iter().any(|number| !number.is_finite()) {
            return Err(bad());
        }
        out.extend(numbers.iter().map(|number| (number / self.scale_a).round().clamp(-32767.0, 32767.0) as i16));
        Ok(true)
    }
}

impl Sampler for Recorded {
    fn header(&self) -> WaveformHeader {
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        WaveformHeader::with_currents(self.rate_hz, &names, self.scale_a, FULL_SCALE)
    }

    fn next(&mut self) -> io::Result<Option<(i64, Vec<i16>)>> {
        let (mut samples, first_ns, mut count) = (Vec::new(), self.time_ns(self.sent), 0);
        while count < self.block && self.read_row(&mut samples)? {
            count += 1;
        }
        if count == 0 {
            return Ok(None);
        }
        self.sent += length_to_i64(count);
        self.clock.sleep_until(self.time_ns(self.sent));
        Ok(Some((first_ns, samples)))
    }
}
