//! What repeats over a distance: the pitch of a screw, the poles of a linear motor, the teeth of a rack or a belt leave
//! a wave over the position of the slide, at whatever speed it moves; what rocks leaves one over the time since the edge
//! went into the cut. The ripple of the mains repeats in time and knows neither.
//!
//! The periods that stand out in what a fit leaves over are found by a periodogram over the position (Lomb,
//! Astrophysics and Space Science 39 (1976)), the noise's own colour taken into account, and become empirical forms.

use super::channel::{TIME, TIME_IN_CUT, channel_values, positions};
use super::empirical::{Empirical, Multiplier, Shape, factor_values};
use super::frame::Frame;
use super::linear::dot;
use super::noise::{Arma, unwhiten};
use crate::physics::Scene;
use crate::statistics::{count, median};
use std::f64::consts::TAU;
use std::ops::Range;

/// Cells into which the positions are sorted.
const CELLS: usize = 512;
/// Turns over the whole distance: with fewer, what repeats cannot be told from what bends; with more the cells blur.
const TURNS: Range<usize> = 4..128;
/// Steps per turn at which the periodogram is taken.
const STEPS_PER_TURN: usize = 3;
/// Rows that one turn must take, in the middle of the rows.
const ROWS_PER_TURN: f64 = 3.0;
/// Rows in which a factor must act.
const ROWS_MIN: usize = 60;
/// Lines that are looked at closer, per position and factor.
const LINES: usize = 2;
/// Places of the periodogram at which the noise is weighed in full.
const WEIGHED: usize = 6;

/// The waves over a recorded position, or over the time in the cut, that explain most of this residual, per group, of
/// this noise.
#[must_use]
pub(super) fn waves(scene: &Scene, frame: &Frame, residual: &[f64], noise: Arma) -> Vec<Empirical> {
    let factors = [Multiplier::Always, Multiplier::InTheCut, Multiplier::WithTheCut];
    let tracks = positions(scene).chain([TIME_IN_CUT]).flat_map(|position| factors.map(|factor| (position, factor)));
    waves_along(tracks, scene, frame, residual, noise)
}

/// The waves over a recorded position of a friction: a nut that is tighter at one place of every turn.
#[must_use]
pub(super) fn waves_of_friction(scene: &Scene, frame: &Frame, residual: &[f64], noise: Arma) -> Vec<Empirical> {
    let tracks = positions(scene).chain([TIME]).map(|over| (over, Multiplier::AgainstMotion));
    waves_along(tracks, scene, frame, residual, noise)
}

/// The waves over the clock that explain most of this residual, per group, of this noise: what comes again and again,
/// whatever the machine does.
#[must_use]
pub(super) fn waves_in_time(scene: &Scene, frame: &Frame, residual: &[f64], noise: Arma) -> Vec<Empirical> {
    waves_along([(TIME, Multiplier::Always)], scene, frame, residual, noise)
}

fn waves_along<'s>(
    tracks: impl IntoIterator<Item = (&'s str, Multiplier)>,
    scene: &Scene,
    frame: &Frame,
    residual: &[f64],
    noise: Arma,
) -> Vec<Empirical> {
    if frame.levels.is_some() {
        return Vec::new();
    }
    let white = frame.whiten(residual, noise);
    let weighted: Vec<f64> = white.iter().enumerate().map(|(row, e)| e * frame.weight(row)).collect();
    let sought = unwhiten(&weighted, &frame.stretches, noise);
    let tracks = tracks.into_iter().filter_map(|(over, factor)| Track::new(scene, frame, over, factor));
    tracks.flat_map(|track| track.strongest(&sought, frame, noise)).collect()
}

/// The rows of a frame along a position, in so far as a factor acts.
struct Track<'a> {
    position: &'a str,
    factor: Multiplier,
    /// Share of the way, 0 to 1, per group.
    along: Vec<f64>,
    /// The factor, per group.
    acts: Vec<f64>,
    from: f64,
    length: f64,
    /// Steps of the periodogram.
    steps: Range<usize>,
}

impl<'a> Track<'a> {
    /// `None` where there are too few rows to tell a wave.
    fn new(scene: &Scene, frame: &Frame, position: &'a str, factor: Multiplier) -> Option<Self> {
        let at = frame.reduce(&channel_values(scene, position)?);
        let acts = frame.reduce(&factor_values(scene, factor)?);
        let inside = |group: &usize| acts[*group] != 0.0;
        let low = (0..at.len()).filter(inside).map(|group| at[group]).fold(f64::INFINITY, f64::min);
        let high = (0..at.len()).filter(inside).map(|group| at[group]).fold(f64::NEG_INFINITY, f64::max);
        let length = high - low;
        let moves: Vec<f64> =
            (1..at.len()).filter(inside).map(|group| (at[group] - at[group - 1]).abs()).filter(|x| *x > 0.0).collect();
        let enough = moves.len() >= ROWS_MIN;
        let per_row = median(moves)?;
        if !enough || length.is_nan() || length <= 0.0 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number of turns")]
        let turns_max = (length / (ROWS_PER_TURN * per_row)).min(count(TURNS.end)) as usize;
        let steps = STEPS_PER_TURN * TURNS.start..STEPS_PER_TURN * turns_max;
        let along = at.iter().map(|x| ((x - low) / length).clamp(0.0, 1.0)).collect();
        (steps.len() > 2).then_some(Self { position, factor, along, acts, from: low, length, steps })
    }

    /// The forms of the lines that stand out most.
    fn strongest(&self, sought: &[f64], frame: &Frame, noise: Arma) -> Vec<Empirical> {
        let power = self.periodogram(sought);
        let floor = self.floor(frame, noise);
        let steps: Vec<usize> = self.steps.clone().collect();
        let height = |index: usize| power[index] / floor(steps[index]);
        let is_peak = |index: &usize| {
            height(*index) >= height(index.saturating_sub(1))
                && height(*index) >= height((index + 1).min(steps.len() - 1))
        };
        let mut peaks: Vec<usize> = (0..steps.len()).filter(is_peak).collect();
        peaks.sort_by(|a, b| height(*b).total_cmp(&height(*a)));
        peaks.truncate(LINES);
        let form = |index: usize| Empirical {
            channel: self.position.to_owned(),
            shape: Shape::Wave(self.length / turns(steps[index]), steps.len()),
            origin: self.from,
            scale: self.length,
            factor: self.factor,
        };
        peaks.into_iter().map(form).collect()
    }

    /// Per step: squared inner product of what is sought with a cosine and a sine.
    fn periodogram(&self, sought: &[f64]) -> Vec<f64> {
        let mut cells = vec![0.0; CELLS];
        for ((along, acts), x) in self.along.iter().zip(&self.acts).zip(sought) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the cells")]
            let cell = (along * count(CELLS - 1)).round() as usize;
            cells[cell] += acts * x;
        }
        // A step is a part of a turn over all cells, so that every angle needed is one of these.
        let angles = STEPS_PER_TURN * (CELLS - 1);
        let table: Vec<(f64, f64)> = (0..angles).map(|angle| (TAU * count(angle) / count(angles)).sin_cos()).collect();
        let at = |step: usize| {
            let (mut cosine, mut sine) = (0.0, 0.0);
            for (cell, x) in cells.iter().enumerate() {
                let (s, c) = table[step * cell % angles];
                cosine += x * c;
                sine += x * s;
            }
            cosine * cosine + sine * sine
        };
        self.steps.clone().map(at).collect()
    }

    /// What the noise alone would leave in the periodogram, up to a factor: a few places in full, the nearest one for
    /// the others.
    fn floor(&self, frame: &Frame, noise: Arma) -> impl Fn(usize) -> f64 {
        let places = (0..WEIGHED).map(|place| self.steps.start + place * (self.steps.len() - 1) / (WEIGHED - 1));
        let size = |step: usize| {
            let wave = |phase: f64| -> f64 {
                let angle = |along: &f64| TAU * turns(step) * along + phase;
                let column: Vec<f64> =
                    self.along.iter().zip(&self.acts).map(|(along, acts)| acts * angle(along).sin()).collect();
                let white = frame.whiten(&column, noise);
                dot(&white, &white)
            };
            (wave(0.0) + wave(0.25 * TAU)).max(f64::MIN_POSITIVE)
        };
        let weighed: Vec<(usize, f64)> = places.map(|step| (step, size(step))).collect();
        move |step| {
            let nearest = weighed.iter().min_by_key(|(place, _)| place.abs_diff(step));
            nearest.map_or(1.0, |(_, size)| *size)
        }
    }
}

fn turns(step: usize) -> f64 {
    count(step) / count(STEPS_PER_TURN)
}

#[cfg(test)]
mod tests {
    use super::super::frame::units;
    use super::*;
    use adapters::Recording;
    use adapters::recording::{Cells, Numbers};
    use rand::{Rng, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};

    /// A slide that goes to and fro over 100 mm, each time at another speed, and slow noise of unit innovations.
    fn ride(rows: usize, seed: u64) -> (Scene, Frame, Vec<f64>, Vec<f64>) {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let (mut x, mut step, mut slow): (f64, f64, f64) = (0.0, 1.0, 0.0);
        let mut next = |_| {
            x += step;
            if !(0.0..=100.0).contains(&x) {
                x = x.clamp(0.0, 100.0);
                step = -step.signum() * rng.random_range(0.5..2.0);
            }
            let e: f64 = StandardNormal.sample(&mut rng);
            slow = 0.8 * slow + e;
            (x, slow)
        };
        let (position, noise): (Vec<f64>, Vec<f64>) = (0..rows).map(&mut next).unzip();
        let mut recording = Recording::new("test", (0..rows).map(count).collect(), None);
        recording.set_column("force_n", Cells::Numbers(Numbers::full(vec![1.0; rows])));
        recording.set_column("position_mm", Cells::Numbers(Numbers::full(position.clone())));
        let moved = position.windows(2).map(|pair| 60.0 * (pair[1] - pair[0]));
        let velocity = std::iter::once(60.0).chain(moved).collect();
        recording.set_column("axis_velocity_mm_min", Cells::Numbers(Numbers::full(velocity)));
        let scene = Scene::new(&recording, "force_n", &Default::default()).expect("a scene");
        let frame = Frame::new(&scene, &units(&scene), 1, |_| true);
        (scene, frame, position, noise)
    }

    const SLOW: Arma = Arma { phi: 0.8, theta: 0.0 };

    #[test]
    fn the_pitch_of_a_screw_is_found_below_the_noise() {
        for (seed, pitch_mm) in [(1, 7.3), (2, 12.0), (3, 21.7)] {
            let (scene, frame, position, noise) = ride(2000, seed);
            // The noise has a deviation of 1.7.
            let wave = |x: &f64| 0.8 * (TAU * x / pitch_mm + 0.4).sin();
            let residual: Vec<f64> = position.iter().zip(&noise).map(|(x, e)| wave(x) + e).collect();
            let found = waves(&scene, &frame, &residual, SLOW);
            let Shape::Wave(period, among) = found[0].shape else { panic!("{:?}", found[0]) };
            assert!((period / pitch_mm - 1.0).abs() < 0.02 && among > 20, "{period} of {pitch_mm}, one of {among}");
        }
    }

    #[test]
    fn a_nut_that_is_tight_once_in_every_turn_is_found_as_a_friction() {
        let (scene, frame, position, noise) = ride(2000, 5);
        let direction = |row: usize| if row == 0 { 1.0 } else { (position[row] - position[row - 1]).signum() };
        let tight = |row: usize| direction(row) * (TAU * position[row] / 10.0 + 0.4).sin();
        let residual: Vec<f64> = (0..2000).map(|row| 1.2 * tight(row) + noise[row]).collect();
        let found = waves_of_friction(&scene, &frame, &residual, SLOW);
        assert_eq!(found[0].factor, Multiplier::AgainstMotion);
        let Shape::Wave(period, _) = found[0].shape else { panic!("{:?}", found[0]) };
        assert!((period / 10.0 - 1.0).abs() < 0.02, "{period}");
    }

    #[test]
    fn a_form_takes_its_columns_from_the_origin_it_is_written_with() {
        let (scene, frame, position, noise) = ride(400, 4);
        let form = &waves(&scene, &frame, &noise, SLOW)[0];
        let columns = form.columns(&scene).expect("columns");
        let Shape::Wave(period, _) = form.shape else { panic!("{form:?}") };
        let angle = TAU * (position[123] - form.origin) / period;
        assert!((columns[0].1[123] - angle.cos()).abs() < 1e-9 && (columns[1].1[123] - angle.sin()).abs() < 1e-9);
    }

    #[test]
    fn a_slide_that_stands_has_no_waves() {
        let rows = 300;
        let mut recording = Recording::new("test", (0..rows).map(count).collect(), None);
        recording.set_column("force_n", Cells::Numbers(Numbers::full(vec![1.0; rows])));
        recording.set_column("position_mm", Cells::Numbers(Numbers::full(vec![5.0; rows])));
        let scene = Scene::new(&recording, "force_n", &Default::default()).expect("a scene");
        let frame = Frame::new(&scene, &units(&scene), 1, |_| true);
        assert_eq!(waves(&scene, &frame, &vec![1.0; rows], SLOW), []);
    }
}
