//! A tone in step with the spindle: work or tool that runs out of true. Where in its turn each cut begins nobody records,
//! and from a recorded speed the turns of a minute cannot be counted: size and phase are each spell's own, two numbers that
//! every spell draws from one bell, whose width is estimated (random effects: Laird and Ware, Biometrics 38, 1982).

use super::frame::Frame;
use super::linear::dot;
use super::noise::{Arma, fit_near, whiten};
use crate::statistics::count;
use std::f64::consts::{LN_2, TAU};
use std::ops::Range;

/// Rows over which the recorded speed keeps count of the turns; a cut may keep it for longer.
const SPELLS_ROWS: [usize; 2] = [48, usize::MAX];
/// Turns, as they show in the rows, from which a spell tells two numbers: less is what drifts or differs from cut to cut.
const TURNS_MIN: f64 = 1.5;
/// Spells that must be seen.
const SPELLS_MIN: usize = 4;
/// Variances of the two numbers that are tried, over what a spell tells of them.
const SIZES: [f64; 7] = [0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0];
/// Factors by which the best of them is refined.
const REFINED: [f64; 4] = [1.7, 1.3, 1.15, 1.07];
/// Turns per row by which other tones are off: what swells at these as well is no tone of the spindle. One of them may be
/// its mirror image at half the sampling rate.
const OTHERS: [f64; 8] = [-0.16, -0.11, -0.07, -0.04, 0.04, 0.07, 0.11, 0.16];
/// Share of what it brings that it must bring beyond them.
const OTHERS_SHARE: f64 = 0.5;
/// Information that it must bring beyond other tones and every price: noise that grows with the cut swells at every
/// frequency, here more and there less.
const INFORMATION_MIN: f64 = 30.0;

/// Cosine and sine of the angle of the spindle, each times what swells with it, per group; zero where nothing does.
pub(super) type Turning = [Vec<f64>; 2];

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Tone {
    /// The noise beside it.
    pub noise: Arma,
    /// Twice the gain in log-likelihood over the noise alone, less its price.
    pub information: f64,
    /// Spells that told.
    pub spells: usize,
    /// Standard deviation of cosine and sine, in what swells.
    pub deviation: f64,
    /// Variance of cosine and sine over that of an innovation.
    size: f64,
    /// Longest spell, in rows.
    rows_max: usize,
}

/// A spell, and what it tells of its two numbers.
struct ToneSpell {
    rows: Range<usize>,
    cc: f64,
    cs: f64,
    ss: f64,
    cx: f64,
    sx: f64,
}

impl ToneSpell {
    fn new(rows: Range<usize>, [c, s]: [&[f64]; 2], x: &[f64]) -> Self {
        Self { cc: dot(c, c), cs: dot(c, s), ss: dot(s, s), cx: dot(c, x), sx: dot(s, x), rows }
    }

    /// Cosine and sine as expected from the spell, drawn from a bell of this variance; what they explain, and the logarithm
    /// of how much narrower they are known than the bell.
    fn told(&self, size: f64) -> ([f64; 2], f64, f64) {
        let (a, b) = (self.cc + 1.0 / size, self.ss + 1.0 / size);
        let determinant = a * b - self.cs * self.cs;
        let cosine = (b * self.cx - self.cs * self.sx) / determinant;
        let sine = (a * self.sx - self.cs * self.cx) / determinant;
        ([cosine, sine], cosine * self.cx + sine * self.sx, (determinant * size * size).ln())
    }
}

/// Finds the tone in a residual of this noise, whose likelihood without a tone has this logarithm.
#[must_use]
pub(super) fn find(residual: &[f64], frame: &Frame, noise: Arma, without: f64, turning: &Turning) -> Option<Tone> {
    let looks = SPELLS_ROWS.map(|rows_max| Look { residual, frame, turning, rows_max });
    let settled = looks.iter().filter_map(|look| Some((look, look.settled(noise)?)));
    let (look, (likelihood, tone)) = settled.max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let price = count(residual.len()).ln() + 2.0 * LN_2;
    let information = 2.0 * (likelihood - without) - price;
    let mut others: Vec<f64> = OTHERS.iter().filter_map(|off| look.off_by(*off, tone.noise)).collect();
    others.sort_by(|a, b| b.total_cmp(a));
    let least = INFORMATION_MIN.max(OTHERS_SHARE * information);
    let beyond = others.get(1).is_none_or(|other| 2.0 * (likelihood - other) > least);
    (beyond && information > INFORMATION_MIN).then_some(Tone { information, ..tone })
}

/// The tone in every group, as its spells tell it.
#[must_use]
pub(super) fn values(residual: &[f64], frame: &Frame, turning: &Turning, tone: &Tone) -> Vec<f64> {
    Look { residual, frame, turning, rows_max: tone.rows_max }.values(tone)
}

/// The tone expected in each row of a stretch, from earlier rows of its spell only.
#[must_use]
pub(super) fn follow(residual: &[f64], turning: &Turning, tone: &Tone) -> Vec<f64> {
    let [c, s] = turning;
    let mut expected = vec![0.0; residual.len()];
    for rows in spells(0..residual.len(), turning, tone.rows_max) {
        let whole = 0..rows.len();
        let white = |values: &[f64]| whiten(&values[rows.clone()], std::slice::from_ref(&whole), tone.noise);
        let (white_c, white_s, white_x) = (white(c), white(s), white(residual));
        let mut spell = ToneSpell { rows: rows.clone(), cc: 0.0, cs: 0.0, ss: 0.0, cx: 0.0, sx: 0.0 };
        for (row, ((wc, ws), wx)) in rows.zip(white_c.iter().zip(&white_s).zip(&white_x)) {
            let ([cosine, sine], ..) = spell.told(tone.size);
            expected[row] = cosine * c[row] + sine * s[row];
            spell.cc += wc * wc;
            spell.cs += wc * ws;
            spell.ss += ws * ws;
            spell.cx += wc * wx;
            spell.sx += ws * wx;
        }
    }
    expected
}

/// Rows in which something swells, cut into spells of at most so many; those that turn too little to tell are left out.
fn spells(stretch: Range<usize>, turning: &Turning, rows_max: usize) -> Vec<Range<usize>> {
    let swells = |row: &usize| turning[0][*row] != 0.0 || turning[1][*row] != 0.0;
    let mut spells: Vec<Range<usize>> = Vec::new();
    for row in stretch.filter(swells) {
        match spells.last_mut().filter(|spell| spell.end == row && spell.len() < rows_max) {
            Some(spell) => spell.end = row + 1,
            None => spells.push(row..row + 1),
        }
    }
    spells.retain(|spell| turns(spell, turning) >= TURNS_MIN);
    spells
}

/// Turns as they show in these rows: at most half a turn per row.
fn turns(rows: &Range<usize>, [c, s]: &Turning) -> f64 {
    let turned =
        |row: usize| (c[row - 1] * s[row] - s[row - 1] * c[row]).atan2(c[row - 1] * c[row] + s[row - 1] * s[row]);
    (rows.start + 1..rows.end).map(|row| turned(row).abs() / TAU).sum()
}

/// What a look tells in one noise.
#[derive(Clone, Copy)]
struct Fitted {
    /// Logarithm of the likelihood.
    likelihood: f64,
    /// See [`Tone::size`].
    size: f64,
    /// Variance of an innovation.
    variance: f64,
    /// Spells that told.
    spells: usize,
}

impl Fitted {
    fn or_likelier(self, other: Self) -> Self {
        if other.likelihood > self.likelihood { other } else { self }
    }
}

/// One way to look for it.
struct Look<'a> {
    residual: &'a [f64],
    frame: &'a Frame,
    turning: &'a Turning,
    rows_max: usize,
}

impl Look<'_> {
    /// The spells, and the sum of the squares of all innovations without a tone.
    fn spells(&self, turning: &Turning, noise: Arma) -> (Vec<ToneSpell>, f64) {
        let x = self.frame.whiten(self.residual, noise);
        let [c, s] = [0, 1].map(|of| self.frame.whiten(&turning[of], noise));
        let stretches = self.frame.stretches.iter();
        let rows = stretches.flat_map(|stretch| spells(stretch.clone(), turning, self.rows_max));
        let told =
            rows.map(|rows| ToneSpell::new(rows.clone(), [&c[rows.clone()], &s[rows.clone()]], &x[rows])).collect();
        (told, dot(&x, &x))
    }

    /// The best size in this noise.
    fn likeliest(&self, turning: &Turning, noise: Arma) -> Option<Fitted> {
        let (spells, squares) = self.spells(turning, noise);
        if spells.len() < SPELLS_MIN {
            return None;
        }
        let typical = spells.iter().map(|spell| spell.cc + spell.ss).sum::<f64>() / (2.0 * count(spells.len()));
        let of = |size: f64| {
            let (mut left, mut narrower) = (squares, 0.0);
            for (_, explained, ln) in spells.iter().map(|spell| spell.told(size)) {
                left -= explained;
                narrower += ln;
            }
            let likelihood = self.frame.log_likelihood(left, noise) - 0.5 * narrower;
            Fitted { likelihood, size, variance: left / count(self.residual.len()), spells: spells.len() }
        };
        let first = SIZES.map(|size| of(size / typical)).into_iter().reduce(Fitted::or_likelier)?;
        let refined = |best: Fitted, by: f64| {
            [best.size * by, best.size / by].map(of).into_iter().fold(best, Fitted::or_likelier)
        };
        Some(REFINED.into_iter().fold(first, refined))
    }

    /// Tone and noise in turn.
    fn settled(&self, noise: Arma) -> Option<(f64, Tone)> {
        let tone_in = |noise: Arma| {
            let Fitted { likelihood, size, variance, spells } = self.likeliest(self.turning, noise)?;
            let deviation = (size * variance).sqrt();
            Some((likelihood, Tone { noise, information: 0.0, spells, deviation, size, rows_max: self.rows_max }))
        };
        let first = tone_in(noise)?;
        let beside: Vec<f64> = self.residual.iter().zip(self.values(&first.1)).map(|(x, tone)| x - tone).collect();
        let again = tone_in(fit_near(&beside, self.frame, noise).1)?;
        Some(if again.0 > first.0 { again } else { first })
    }

    /// Logarithm of the likelihood with a tone that is off by so many turns per row.
    fn off_by(&self, turns: f64, noise: Arma) -> Option<f64> {
        let [c, s] = self.turning;
        let turned = |row: usize| {
            let (sine, cosine) = (TAU * turns * count(row)).sin_cos();
            (c[row] * cosine - s[row] * sine, s[row] * cosine + c[row] * sine)
        };
        let (c, s) = (0..c.len()).map(turned).unzip();
        self.likeliest(&[c, s], noise).map(|found| found.likelihood)
    }

    fn values(&self, tone: &Tone) -> Vec<f64> {
        let mut values = vec![0.0; self.residual.len()];
        for spell in self.spells(self.turning, tone.noise).0 {
            let ([cosine, sine], ..) = spell.told(tone.size);
            for row in spell.rows {
                values[row] = cosine * self.turning[0][row] + sine * self.turning[1][row];
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 1500;

    /// A cut of 60 rows in every 75, at speeds of its own each.
    fn turning() -> Turning {
        let mut angle = 0.0;
        let mut turned = |row: usize| {
            angle += TAU * (0.09 + 0.02 * f64::from(u32::try_from(row / 75 % 9).expect("small")));
            if row % 75 < 60 { (f64::cos(angle), f64::sin(angle)) } else { (0.0, 0.0) }
        };
        let (c, s) = (0..ROWS).map(&mut turned).unzip();
        [c, s]
    }

    /// White noise, and a tone of this height off by so many turns per row, that begins anywhere in each cut.
    fn residual(height: f64, off: f64) -> Vec<f64> {
        let [c, s] = turning();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(8);
        let mut phase = 0.0;
        let mut recorded = |row: usize| {
            if row.is_multiple_of(75) {
                phase = rng.random_range(0.0..TAU);
            }
            let e: f64 = StandardNormal.sample(&mut rng);
            let (sine, cosine) = (phase + TAU * off * count(row)).sin_cos();
            e + height * (c[row] * cosine - s[row] * sine)
        };
        (0..ROWS).map(&mut recorded).collect()
    }

    fn found(residual: &[f64]) -> Option<Tone> {
        let frame = Frame::one_run(ROWS);
        let without = frame.log_likelihood(dot(residual, residual), Arma::WHITE);
        find(residual, &frame, Arma::WHITE, without, &turning())
    }

    #[test]
    fn a_tone_that_begins_anywhere_in_each_cut_is_found_and_followed() {
        let residual = residual(0.8, 0.0);
        let tone = found(&residual).expect("a tone");
        assert!((tone.deviation * 2.0_f64.sqrt() - 0.8).abs() < 0.15, "{tone:?}");
        let squares = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        let left = |tone: Vec<f64>| residual.iter().zip(tone).map(|(x, tone)| x - tone).collect::<Vec<f64>>();
        let as_told = squares(&left(values(&residual, &Frame::one_run(ROWS), &turning(), &tone)));
        let as_expected = squares(&left(follow(&residual, &turning(), &tone)));
        assert!(as_told < as_expected && as_expected < 0.93 * squares(&residual), "{as_told} {as_expected}");
    }

    #[test]
    fn noise_and_a_tone_that_does_not_follow_the_spindle_are_none() {
        assert_eq!(found(&residual(0.0, 0.0)), None);
        assert_eq!(found(&residual(0.8, 0.09)), None);
    }

    #[test]
    fn a_cut_that_is_restless_at_every_frequency_is_no_tone() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(9);
        let mut noise = |row: usize| {
            let e: f64 = StandardNormal.sample(&mut rng);
            if row % 75 < 60 { 4.0 * e } else { e }
        };
        let restless: Vec<f64> = (0..ROWS).map(&mut noise).collect();
        assert_eq!(found(&restless), None);
    }
}
