//! Recurring pulses: what comes again at a fixed interval and fades - oil for a bearing, grease for a slide, a pump that refills.
//!
//! A jump that fades is a spike to the noise that remembers it, so that pulses stand out of the innovations: these are
//! folded at every interval (epoch folding: Leahy et al., Astrophysical Journal 266 (1983)), and the interval and place
//! at which most of them meet become an empirical form.

use super::channel::TIME;
use super::empirical::{Empirical, FADING_PERIODS, Multiplier, Shape};
use super::frame::Frame;
use super::noise::Arma;
use crate::physics::Scene;
use crate::statistics::{count, robust_deviation};

/// Intervals are at least so many sampling periods long.
const ROWS_MIN: f64 = 15.0;
/// Pulses that the whole time must hold, at least.
const PULSES_MIN: f64 = 5.0;
/// Width of a place in the interval, in sampling periods.
const PLACE_ROWS: f64 = 2.0;
/// Deviations at which an innovation is cut off: one stray row is no pulse.
const CUT_OFF: f64 = 3.0;
/// Deviations of chance that innovations must stand out by to be looked at closer.
const STANDS_OUT: f64 = 5.0;
/// Places that are folded into, over all intervals, at most.
const PLACES_MAX: f64 = 4e6;
/// Sampling periods over which a pulse may fade.
const OVER_ROWS: [f64; 4] = [4.0, 12.0, 36.0, 108.0];

/// The pulses that stand out of this residual, per group, of this noise: fading at several paces, always there or in
/// proportion to the speed.
pub(super) fn recurring_pulses(scene: &Scene, frame: &Frame, residual: &[f64], noise: Arma) -> Vec<Empirical> {
    let clock_s = frame.reduce(scene.clock_s());
    let whole_s = scene.clock_s().last().copied().unwrap_or(0.0);
    let Some(found) = fold(&clock_s, &cut_off(frame.whiten(residual, noise)), scene.period_s(), whole_s) else {
        return Vec::new();
    };
    let form = |rows: f64, factor: Multiplier| Empirical {
        channel: TIME.to_owned(),
        shape: Shape::RecurringPulses {
            every: found.every_s,
            from: found.from_s,
            over: rows * scene.period_s(),
            among: found.among,
        },
        origin: 0.0,
        scale: whole_s,
        factor,
    };
    let paces = OVER_ROWS.into_iter().filter(|rows| *rows >= FADING_PERIODS && rows * scene.period_s() < found.every_s);
    paces.flat_map(|rows| [Multiplier::Always, Multiplier::WithTheSpeed].map(|factor| form(rows, factor))).collect()
}

/// Innovations in deviations, cut off.
fn cut_off(innovations: Vec<f64>) -> Vec<f64> {
    let deviation = robust_deviation(innovations.iter().copied()).filter(|deviation| *deviation > 0.0);
    let one = deviation.map_or(0.0, f64::recip);
    innovations.into_iter().map(|e| (e * one).clamp(-CUT_OFF, CUT_OFF)).collect()
}

/// An interval, a place in it, and among how many both were chosen.
struct Folded {
    every_s: f64,
    from_s: f64,
    among: usize,
}

/// The interval and the place in it at which innovations agree most; `None` where none stand out.
fn fold(clock_s: &[f64], innovations: &[f64], period_s: f64, whole_s: f64) -> Option<Folded> {
    let width_s = PLACE_ROWS * period_s;
    let (shortest_s, longest_s) = (ROWS_MIN * period_s, whole_s / PULSES_MIN);
    // From one interval to the next the last shot moves by half a place.
    let steps = 2.0 * whole_s / width_s;
    let places = steps * (longest_s - shortest_s) / width_s;
    if width_s.is_nan() || width_s <= 0.0 || longest_s <= shortest_s || places > PLACES_MAX {
        return None;
    }
    let (mut best, mut among) = ((STANDS_OUT, 0.0, 0.0), 0);
    let mut every_s = shortest_s;
    while every_s < longest_s {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred places")]
        let places = (every_s / width_s).floor() as usize;
        let mut sums = vec![(0.0, 0.0); places];
        for (at_s, e) in clock_s.iter().zip(innovations) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the places")]
            let place = ((at_s / every_s).fract() * count(places)) as usize;
            let sum = &mut sums[place.min(places - 1)];
            *sum = (sum.0 + e, sum.1 + 1.0);
        }
        for (place, (sum, rows)) in sums.iter().enumerate().filter(|(_, sum)| sum.1 >= PULSES_MIN) {
            let agree = sum.abs() / rows.sqrt();
            if agree > best.0 {
                best = (agree, every_s, every_s * count(place) / count(places));
            }
        }
        among += places;
        every_s += every_s * width_s / (2.0 * whole_s);
    }
    (best.1 > 0.0).then_some(Folded { every_s: best.1, from_s: best.2, among })
}

#[cfg(test)]
mod tests {
    use super::super::frame::units;
    use super::*;
    use adapters::Recording;
    use adapters::recording::{Cells, Numbers};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const MEMORY: Arma = Arma { phi: 0.5, theta: 0.0 };

    /// Noise that remembers, of unit innovations, and pulses of this height: as scene, rows and what is recorded of them.
    fn oiled(height: f64, every_s: f64, from_s: f64, seed: u64) -> (Scene, Frame, Vec<f64>) {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut slow = 0.0;
        let mut next = |row: usize| {
            let e: f64 = StandardNormal.sample(&mut rng);
            slow = MEMORY.phi * slow + e;
            let since_s = (count(row) - from_s).rem_euclid(every_s);
            slow + height * (-since_s / 12.0).exp()
        };
        let residual: Vec<f64> = (0..2000).map(&mut next).collect();
        let mut recording = Recording::new("test", (0..2000).map(count).collect(), None);
        recording.set_column("spindle_power_w", Cells::Numbers(Numbers::full(vec![1.0; 2000])));
        let scene = Scene::new(&recording, "spindle_power_w", &Default::default()).expect("a scene");
        let frame = Frame::new(&scene, &units(&scene), 1, |_| true);
        (scene, frame, residual)
    }

    #[test]
    fn the_interval_of_a_lubricator_is_found() {
        for (seed, every_s, from_s) in [(1, 61.7, 20.0), (2, 137.3, 5.0), (3, 240.0, 100.0)] {
            let (scene, frame, residual) = oiled(6.0, every_s, from_s, seed);
            let found = recurring_pulses(&scene, &frame, &residual, MEMORY);
            let Some(Shape::RecurringPulses { every, from, .. }) = found.first().map(|form| form.shape.clone()) else {
                panic!("nothing of {every_s}")
            };
            // By where the last of them stands.
            let last = (2000.0 / every_s).floor();
            let off_s = (from + last * every) - (from_s + last * every_s);
            assert!((every / every_s - 1.0).abs() < 0.01 && off_s.abs() < 4.0, "{every} of {every_s}, {off_s} s off");
        }
    }

    #[test]
    fn noise_alone_has_no_interval() {
        let found = (10..20).filter(|seed| {
            let (scene, frame, residual) = oiled(0.0, 100.0, 0.0, *seed);
            !recurring_pulses(&scene, &frame, &residual, MEMORY).is_empty()
        });
        assert!(found.count() <= 2, "five deviations among some thousand places");
    }

    #[test]
    fn too_short_a_recording_is_not_folded() {
        assert!(fold(&[0.0, 1.0, 2.0], &[1.0, -1.0, 1.0], 1.0, 2.0).is_none());
        assert!(fold(&[], &[], f64::NAN, 0.0).is_none());
    }
}
