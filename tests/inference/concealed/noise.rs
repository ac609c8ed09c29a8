//! Disturbance of the meter. None of it is Gaussian ARMA(1,1) with the parameters a tool might assume.

use crate::concealed::dice::Dice;
use crate::concealed::least_squares::{mean, rms};

/// A kind of disturbance.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Noise {
    /// Independent from row to row.
    Independent,
    /// First order 0.7 under white noise.
    Short,
    /// First order 0.92 under white noise.
    Long,
    /// First order 0.97 under white noise.
    Longest,
    /// A sum of processes with times from 2 to 90 s: nearly 1/f.
    Flicker,
    /// Short noise over a nominal law that is wrong by a ripple of 0.4 % over speed and feed.
    Dirty,
    /// Student's t with three degrees of freedom and some memory.
    HeavyTails,
    /// Short noise, single spikes, missing, zero and repeated values, a faint beat of the mains.
    Faulty,
    /// Standard deviation half in air and double in the cut.
    LoadDependent,
}

impl Noise {
    pub(crate) const ALL: [Self; 9] = [
        Self::Independent,
        Self::Short,
        Self::Long,
        Self::Longest,
        Self::Flicker,
        Self::Dirty,
        Self::HeavyTails,
        Self::Faulty,
        Self::LoadDependent,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Independent => "iid",
            Self::Short => "ar70",
            Self::Long => "ar92",
            Self::Longest => "ar97",
            Self::Flicker => "flicker",
            Self::Dirty => "dirty",
            Self::HeavyTails => "heavy",
            Self::Faulty => "faulty",
            Self::LoadDependent => "load",
        }
    }

    /// The kinds that a case with an effect is drawn from.
    pub(crate) fn draw(dice: &mut Dice) -> Self {
        *dice.pick(&[
            Self::Independent,
            Self::Independent,
            Self::Short,
            Self::Short,
            Self::Short,
            Self::Long,
            Self::Longest,
            Self::Flicker,
            Self::HeavyTails,
            Self::LoadDependent,
        ])
    }
}

/// One row as the noise sees it.
#[derive(Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) t_s: f64,
    pub(crate) clean: f64,
    pub(crate) engaged: bool,
    pub(crate) speed_rpm: f64,
    pub(crate) ln_thickness: f64,
}

/// What happened to the rows.
pub(crate) struct Spoiled {
    /// Recorded value; none where the meter gave nothing.
    pub(crate) values: Vec<Option<f64>>,
    /// Rows with a spike or a dropout.
    pub(crate) faults: Vec<usize>,
}

/// The clean output with noise of standard deviation `sd` on top.
pub(crate) fn spoil(kind: Noise, moments: &[Moment], sd: f64, dice: &mut Dice) -> Spoiled {
    let unit = unit_noise(kind, moments, dice);
    let mut values: Vec<Option<f64>> = moments.iter().zip(&unit).map(|(m, u)| Some(m.clean + sd * u)).collect();
    let mut faults = Vec::new();
    if kind == Noise::Dirty {
        wiggle(moments, &mut values, dice);
    }
    if kind == Noise::Faulty {
        beat(moments, sd, &mut values, dice);
        faults = break_rows(sd, &mut values, dice);
    }
    Spoiled { values, faults }
}

/// Noise of unit variance of the given kind, without faults.
pub(crate) fn unit_noise(kind: Noise, moments: &[Moment], dice: &mut Dice) -> Vec<f64> {
    let seconds = |phi: f64| -1.0 / phi.ln();
    let white_share = dice.uniform(0.2, 0.6_f64);
    let mut under_white = |tau_s: f64, white: f64| {
        let slow = wandering(moments, tau_s, dice);
        slow.iter().map(|x| (1.0 - white).sqrt() * x + white.sqrt() * dice.normal()).collect::<Vec<_>>()
    };
    match kind {
        Noise::Independent => under_white(1.0, 1.0),
        Noise::Short | Noise::Dirty | Noise::Faulty => under_white(seconds(0.7), white_share),
        Noise::Long => under_white(seconds(0.92), white_share),
        Noise::Longest => under_white(seconds(0.97), white_share.max(0.4)),
        Noise::Flicker => flicker(moments, dice),
        Noise::HeavyTails => heavy(moments, dice),
        Noise::LoadDependent => {
            let level = |m: &Moment| if m.engaged { 1.2 } else { 0.55 };
            let unit = under_white(seconds(0.6), white_share);
            unit.iter().zip(moments).map(|(u, m)| u * level(m)).collect()
        }
    }
}

/// A stationary first-order process of unit variance in real time.
fn wandering(moments: &[Moment], tau_s: f64, dice: &mut Dice) -> Vec<f64> {
    let mut x = dice.normal();
    let mut last = moments.first().map_or(0.0, |m| m.t_s);
    let step = |m: &Moment| {
        let keep = (-(m.t_s - last).max(0.0) / tau_s).exp();
        last = m.t_s;
        x = keep * x + (1.0 - keep * keep).sqrt() * dice.normal();
        x
    };
    moments.iter().map(step).collect()
}

fn flicker(moments: &[Moment], dice: &mut Dice) -> Vec<f64> {
    let times = [0.3, 2.0, 8.0, 30.0, 90.0];
    let parts: Vec<Vec<f64>> = times.iter().map(|t| wandering(moments, *t, dice)).collect();
    let shares = [0.36, 0.22, 0.18, 0.14, 0.10_f64];
    (0..moments.len()).map(|i| parts.iter().zip(shares).map(|(p, s)| s.sqrt() * p[i]).sum()).collect()
}

fn heavy(moments: &[Moment], dice: &mut Dice) -> Vec<f64> {
    let mut memory = 0.0;
    let step = |_: &Moment| {
        let shock = dice.student(3.0) / 3f64.sqrt();
        memory = 0.5 * memory + 0.75f64.sqrt() * shock;
        memory
    };
    moments.iter().map(step).collect()
}

/// The nominal law itself is wrong: by 0.4 % of the mean output, root mean square.
fn wiggle(moments: &[Moment], values: &mut [Option<f64>], dice: &mut Dice) {
    let (wave_rpm, phase, feed) = (dice.uniform(500.0, 1100.0), dice.uniform(0.0, 6.3), dice.uniform(1.0, 2.5));
    let clean: Vec<f64> = moments.iter().map(|m| m.clean).collect();
    let size = 0.004 * std::f64::consts::SQRT_2 * mean(&clean) / rms(&clean).max(1e-12);
    for (m, v) in moments.iter().zip(values) {
        let angle = std::f64::consts::TAU * m.speed_rpm / wave_rpm + feed * m.ln_thickness + phase;
        *v = v.map(|v| v + size * m.clean * angle.sin());
    }
}

fn beat(moments: &[Moment], sd: f64, values: &mut [Option<f64>], dice: &mut Dice) {
    let (hz, phase) = (dice.uniform(0.02, 0.4), dice.uniform(0.0, 6.3));
    for (m, v) in moments.iter().zip(values) {
        *v = v.map(|v| v + 0.2 * sd * (std::f64::consts::TAU * hz * m.t_s + phase).sin());
    }
}

fn break_rows(sd: f64, values: &mut [Option<f64>], dice: &mut Dice) -> Vec<usize> {
    let last = values.len() - 1;
    let mut faults = Vec::new();
    for _ in 0..dice.whole(4, 12) {
        let row = dice.whole(1, last);
        values[row] = values[row].map(|v| v + dice.sign() * sd * dice.uniform(9.0, 40.0));
        faults.push(row);
    }
    for _ in 0..dice.whole(3, 7) {
        let (start, kind) = (dice.whole(1, last), dice.whole(0, 2));
        let end = (start + dice.whole(1, 9)).min(last);
        let held = values[start - 1];
        for (row, value) in values.iter_mut().enumerate().take(end).skip(start) {
            *value = [None, Some(0.0), held][kind];
            faults.push(row);
        }
    }
    faults.sort_unstable();
    faults.dedup();
    faults
}
