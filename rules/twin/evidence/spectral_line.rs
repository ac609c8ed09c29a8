//! A wave that nobody records: the ripple of the mains folded by slow sampling, or any other tone of one frequency. Its
//! phase and size wander, so each spell of some rows has its own (`families/waves.rs`).

use super::gram::Comparison;
use super::inputs::RecordingInputs;
use super::noise::NoiseModel;
use numerics::statistics::count_to_f64;
use std::f64::consts::TAU;
use std::ops::Range;

/// Rows of a segment of the spectrum, and segments at least.
const SEGMENT_ROWS: usize = 64;
const SEGMENTS_MIN: usize = 6;
/// How many times the mean a line stands above it: of 32 bins averaged over six segments chance brings 3.
const PEAK_MIN: f64 = 3.0;
/// Bins beside a line from which and to which its neighbourhood reaches: a tapered line is three bins wide, while noise that rings
/// stands on a wide foot. A narrower neighbourhood would be the line itself; a wider one lets ringing noise pass for a line.
const BESIDE: std::ops::RangeInclusive<usize> = 2..=5;
/// Lowest bin that is a line and no drift.
const FIRST_BIN: usize = 3;
/// Steps of a bin in which the frequency of a line is refined.
const REFINED: usize = 40;

/// A line of the spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpectralLine {
    /// Turns per recorded row.
    pub(super) frequency: f64,
    /// Logarithm of the number of frequencies that were looked at.
    pub(super) ln_choices: f64,
}

/// The line that stands out most in what is left over.
pub(super) fn find_spectral_line(comparison: &Comparison<'_>, left: &[f64], noise: NoiseModel) -> Option<SpectralLine> {
    let innovations = comparison.whiten_column(left, noise);
    let segments = split_into_segments(&comparison.blocks);
    if segments.len() < SEGMENTS_MIN {
        return None;
    }
    let power = |frequency: f64| {
        segments.iter().map(|rows| compute_bin_power(&innovations[rows.clone()], frequency)).sum::<f64>()
    };
    let bins: Vec<f64> =
        (FIRST_BIN..SEGMENT_ROWS / 2).map(|bin| count_to_f64(bin) / count_to_f64(SEGMENT_ROWS)).collect();
    let powers: Vec<f64> = bins.iter().map(|frequency| power(*frequency)).collect();
    let mean = numerics::statistics::mean(&powers);
    let (at, most) = powers.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    if *most < PEAK_MIN * mean.max(average_neighbour_bins(&powers, at)) {
        return None;
    }
    let best = bins[at];
    let width = 1.0 / count_to_f64(SEGMENT_ROWS);
    let near = (0..=REFINED).map(|k| best + width * (2.0 * count_to_f64(k) / count_to_f64(REFINED) - 1.0));
    let refined = near.map(|frequency| (power(frequency), frequency)).max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(SpectralLine {
        frequency: refined.1 / count_to_f64(comparison.group),
        ln_choices: count_to_f64(bins.len()).ln(),
    })
}

/// Mean power of the bins beside one.
fn average_neighbour_bins(powers: &[f64], at: usize) -> f64 {
    let beside = (0..powers.len()).filter(|bin| BESIDE.contains(&bin.abs_diff(at))).map(|bin| powers[bin]);
    numerics::statistics::mean(&beside.collect::<Vec<_>>())
}

/// Angle of a line in every row, rad: by the clock, so that gaps do not shift it.
pub(super) fn compute_line_angle(inputs: &RecordingInputs<'_>, line: SpectralLine) -> Vec<f64> {
    inputs.build_column(|row| TAU * line.frequency * (inputs.clock_s[row] - inputs.clock_s[0]) / inputs.period_s)
}

/// Segments of unbroken rows, each half over the next.
fn split_into_segments(blocks: &[Range<usize>]) -> Vec<Range<usize>> {
    let of = |block: &Range<usize>| {
        let last = block.end.saturating_sub(SEGMENT_ROWS);
        let starts: Vec<usize> = if block.len() < SEGMENT_ROWS {
            Vec::new()
        } else {
            (block.start..=last).step_by(SEGMENT_ROWS / 2).collect()
        };
        starts.into_iter().map(|start| start..start + SEGMENT_ROWS).collect::<Vec<_>>()
    };
    blocks.iter().flat_map(of).collect()
}

/// Power of a tapered segment at one frequency.
fn compute_bin_power(segment: &[f64], frequency: f64) -> f64 {
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (row, x) in segment.iter().enumerate() {
        let taper = (0.5 * TAU * (count_to_f64(row) + 0.5) / count_to_f64(segment.len())).sin();
        let (s, c) = (TAU * frequency * count_to_f64(row)).sin_cos();
        cosine += x * taper * c;
        sine += x * taper * s;
    }
    cosine * cosine + sine * sine
}
