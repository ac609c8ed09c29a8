//! Raw samples around what is remarkable: a file for every time the current goes beyond a limit, with five seconds before
//! and five behind. The files are CSV as `serve waveform --file` plays them. Bounded: one file at a time, fifty files in the
//! directory, the oldest go.

use crate::waveform::chain::to_nanoseconds;
use adapters::clock::TimeNs;
use adapters::waveform::{Block, WaveformHeader};
use gateway_base::files::keep_last;
use gateway_base::log::{Notice, Severity};
use std::collections::VecDeque;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const BEFORE_S: f64 = 5.0;
const BEHIND_S: f64 = 5.0;
const FILES_MAX: usize = 50;
/// A block that is kept, of all blocks together, in samples.
const SAMPLES_MAX: usize = 2_000_000;

pub(super) struct ExcerptWriter {
    directory: PathBuf,
    above_a: f64,
    blocks: VecDeque<Block>,
    samples: usize,
    /// Write when samples of this time have come.
    due_ns: Option<TimeNs>,
    /// The current must have been below the limit in between.
    over: bool,
    written: u64,
}

impl ExcerptWriter {
    pub(super) fn new(directory: &Path, above_a: f64) -> Self {
        let (blocks, directory) = (VecDeque::new(), directory.to_owned());
        Self { directory, above_a, blocks, samples: 0, due_ns: None, over: false, written: 0 }
    }

    /// Files written since the start.
    pub(super) fn count_files(&self) -> u64 {
        self.written
    }

    /// Takes a block and the greatest feature in it, A.
    pub(super) fn push(&mut self, header: &WaveformHeader, block: &Block, feature_a: Option<f64>) {
        let now_ns = block.first_ns;
        self.samples += block.raw.len();
        self.blocks.push_back(block.clone());
        let from_ns = now_ns - to_nanoseconds(BEFORE_S + BEHIND_S);
        while self.samples > SAMPLES_MAX || self.blocks.front().is_some_and(|oldest| oldest.first_ns < from_ns) {
            let Some(oldest) = self.blocks.pop_front() else { break };
            self.samples -= oldest.raw.len();
        }
        if let Some(feature_a) = feature_a {
            let over = feature_a > self.above_a;
            if over && !self.over && self.due_ns.is_none() {
                self.due_ns = Some(now_ns + to_nanoseconds(BEHIND_S));
            }
            self.over = over;
        }
        if self.due_ns.is_some_and(|due_ns| now_ns >= due_ns) {
            self.due_ns = None;
            self.write(header, now_ns);
        }
    }

    fn write(&mut self, header: &WaveformHeader, now_ns: TimeNs) {
        let file = self.directory.join(format!("waveform-{now_ns}.csv"));
        let done = std::fs::create_dir_all(&self.directory)
            .and_then(|()| std::fs::write(&file, self.format_csv(header)))
            .and_then(|()| self.forget_oldest());
        match done {
            Ok(()) => self.written += 1,
            Err(error) => {
                let text = format!("a waveform could not be kept: {}: {error}", file.display());
                Notice::new(Severity::Warning, "waveform_not_kept", text).write_to_logs();
            }
        }
    }

    fn format_csv(&self, header: &WaveformHeader) -> String {
        let mut text = format!("time_s,{}\n", header.channels.join(","));
        let sample_s = 1.0 / header.rate_hz;
        let begin_ns = self.blocks.front().map_or(0, |block| block.first_ns);
        for block in &self.blocks {
            #[expect(clippy::cast_precision_loss, reason = "seconds")]
            let mut time_s = (block.first_ns - begin_ns) as f64 / 1e9;
            for instant in block.raw.chunks_exact(header.channels.len()) {
                // Writing into a text does not fail.
                let _ = write!(text, "{time_s:.6}");
                for (sample, scale) in instant.iter().zip(&header.scale) {
                    let _ = write!(text, ",{:.4}", f64::from(*sample) * scale);
                }
                text.push('\n');
                time_s += sample_s;
            }
        }
        text
    }

    fn forget_oldest(&self) -> std::io::Result<()> {
        keep_last(&self.directory, FILES_MAX, |name| name.starts_with("waveform-") && name.ends_with(".csv"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_high_current_leaves_one_file_with_what_was_before_and_behind() {
        let directory = tempfile::tempdir().expect("a directory");
        let header = WaveformHeader::with_currents(1000.0, &["u"], 0.01, 32767);
        let mut excerpt_writer = ExcerptWriter::new(directory.path(), 20.0);
        for k in 0_i64..1000 {
            let block = Block { first_ns: k * 20_000_000, gap: 0, clipped: 0, raw: vec![100; 20] };
            let high = (500..520).contains(&k);
            excerpt_writer.push(&header, &block, Some(if high { 30.0 } else { 5.0 }));
        }
        assert_eq!(excerpt_writer.count_files(), 1);
        let file = std::fs::read_dir(directory.path()).expect("there").next().expect("one").expect("readable").path();
        let text = std::fs::read_to_string(file).expect("text");
        let rows = text.lines().count() - 1;
        assert!((9_900..=10_100).contains(&rows), "{rows}");
        assert!(text.starts_with("time_s,u\n0.000000,1.0000\n"), "{}", &text[..40]);
    }
}
