//! Recordings of spindle power: an effect or several planted so that a stated part of them survives the refit.

use crate::concealed::baseline::{Baseline, Process, Refit, chip};
use crate::concealed::case::{Case, Expect, Hiding};
use crate::concealed::dice::Dice;
use crate::concealed::law::Entry;
use crate::concealed::laws::KNOWN_INERTIA_KG_M2;
use crate::concealed::least_squares::{mean, rms};
use crate::concealed::motion;
use crate::concealed::nearest::{Court, ENOUGH};
use crate::concealed::noise::{Moment, Noise, spoil};
use crate::concealed::schedule::{Mode, Needs, Plan};
use crate::concealed::spindle_record::{Style, model, table, write_current};
use crate::concealed::tick::Tick;
use crate::concealed::world::{Day, Seeded, Stage, rows};

/// What a case of spindle power shall be.
#[derive(Clone)]
pub(crate) struct CaseSpec {
    pub(crate) group: String,
    pub(crate) name: String,
    pub(crate) seed: u64,
    pub(crate) mode: Mode,
    pub(crate) process: Process,
    pub(crate) entries: Vec<Entry>,
    /// Wished remainder over noise of every effect.
    pub(crate) rho: f64,
    pub(crate) noise: Noise,
    pub(crate) expect: Expect,
    pub(crate) needs: Needs,
    pub(crate) seconds: f64,
    /// With the spindle current as a second channel.
    pub(crate) current: bool,
}

/// Least and greatest standard deviation of the noise, as a share of the mean output.
const NOISE_SHARE: (f64, f64) = (0.003, 0.05);
/// A remainder below 0.3 deviations and below this share of the mean output need not be claimed.
const CLAIMABLE_SHARE: f64 = 0.0054;

impl CaseSpec {
    /// The case, or none when no plausible strength leaves the wished remainder in any of five days.
    pub(crate) fn build(&self) -> Option<Case> {
        (0..5).find_map(|attempt| self.attempt(attempt))
    }

    fn label(&self, attempt: u64) -> String {
        format!("{}/{}/{attempt}", self.group, self.name)
    }

    fn stage(&self, label: &str) -> Stage {
        let dice = |purpose: &str| Dice::seeded(&format!("{label}/{purpose}"), self.seed);
        let needs = self.entries.iter().fold(self.needs, |n, e| n.with(e.needs));
        let plan = Plan::draw(self.mode, self.process, needs, self.seconds, &mut dice("plan"));
        let ticks = motion::ticks(&plan, &mut dice("motion"));
        let mut baseline = Baseline::draw(self.process, &mut dice("baseline"));
        if self.entries.iter().any(|e| matches!(e.name, "load_loss" | "copper_loss" | "inverter_loss")) {
            baseline.load_loss = 0.0;
        }
        if self.entries.iter().any(|e| e.name == "regeneration") {
            baseline.inertia_kg_m2 = KNOWN_INERTIA_KG_M2;
        }
        Stage { plan, baseline, ticks, seed: self.seed }
    }

    fn attempt(&self, attempt: u64) -> Option<Case> {
        let label = self.label(attempt);
        let (stage, laws, sd) = self.plant(&label)?;
        let day = stage.play(&laws);
        Some(self.record(&stage, &laws, &day, sd, &label))
    }

    fn plant(&self, label: &str) -> Option<(Stage, Vec<Seeded>, f64)> {
        let stage = self.stage(label);
        let mut dice = Dice::seeded(&format!("{label}/laws"), self.seed);
        let mut seeded = |entry: &Entry| {
            let seed = self.seed ^ (dice.whole(0, 1 << 40) as u64);
            Seeded { entry: entry.clone(), seed, strength: 1.0 }
        };
        let laws: Vec<Seeded> = self.entries.iter().map(&mut seeded).collect();
        let (laws, sd) = self.balance(&stage, laws, &mut dice)?;
        Some((stage, laws, sd))
    }

    /// Strengths and a noise level so that each effect leaves the wished remainder.
    fn balance(&self, stage: &Stage, mut laws: Vec<Seeded>, dice: &mut Dice) -> Option<(Vec<Seeded>, f64)> {
        let level = mean(&stage.play(&[]).power_w);
        let least = if self.rho < 0.3 { CLAIMABLE_SHARE / self.rho } else { NOISE_SHARE.0 };
        let loudest = NOISE_SHARE.1 * level;
        let (mut low, mut high) = (least * level, loudest);
        if laws.is_empty() || self.rho == 0.0 {
            let least = if self.noise == Noise::Dirty { 0.016 } else { 0.006 };
            return self.swallowed(stage, laws, level * dice.log_uniform(least, 0.035));
        }
        let mut units = Vec::new();
        for law in &laws {
            let unit = self.left_over(stage, std::slice::from_ref(law), 0);
            low = low.max(law.entry.reach.0 * unit / self.rho);
            high = high.min(law.entry.reach.1 * unit / self.rho);
            units.push(unit);
        }
        let sd = self.choose(low, high, loudest, dice)?;
        for (law, unit) in laws.iter_mut().zip(&units) {
            law.strength = (self.rho * sd / unit).clamp(law.entry.reach.0, law.entry.reach.1);
        }
        if laws.len() > 1 {
            return Some((laws, sd));
        }
        let exact = self.left_over(stage, &laws, 0) / self.rho;
        (exact <= 1.6 * loudest || self.rho >= 2.0).then_some((laws, exact.min(loudest)))
    }

    /// Nothing to balance: nothing is hidden, or what is hidden must vanish in the refit.
    fn swallowed(&self, stage: &Stage, laws: Vec<Seeded>, sd: f64) -> Option<(Vec<Seeded>, f64)> {
        let vanishes = laws.is_empty() || self.left_over(stage, &laws, 0) < 0.12 * sd;
        vanishes.then_some((laws, sd))
    }

    /// A level of noise between the bounds; a single effect that is too strong gets the loudest noise.
    fn choose(&self, low: f64, high: f64, loudest: f64, dice: &mut Dice) -> Option<f64> {
        if low <= high {
            return Some(dice.log_uniform(low, high));
        }
        (self.entries.len() == 1 && low > loudest && high >= loudest * 0.999).then_some(loudest)
    }

    fn left_over(&self, stage: &Stage, laws: &[Seeded], which: usize) -> f64 {
        let day = stage.play(laws);
        let rows = rows(&day.record, 10);
        let record: Vec<Tick> = rows.iter().map(|&i| day.record[i]).collect();
        let refit = Refit::new(&stage.baseline, &record);
        rms(&remainder(stage, &refit, &record, &pick(&day.contributions_w[which], &rows)))
    }

    fn record(&self, stage: &Stage, laws: &[Seeded], day: &Day, sd: f64, label: &str) -> Case {
        let dice = |purpose: &str| Dice::seeded(&format!("{label}/{purpose}"), self.seed);
        let rows = rows(&day.record, 10);
        let record: Vec<Tick> = rows.iter().map(|&i| day.record[i]).collect();
        let clean = pick(&day.power_w, &rows);
        let refit = Refit::new(&stage.baseline, &record);
        let hidden: Vec<Hiding> = (0..laws.len())
            .map(|i| hiding(stage, &refit, &record, &laws[i], pick(&day.contributions_w[i], &rows), sd))
            .collect();
        let moments = moments(self.process, &record, &clean);
        let mut spoiled = spoil(self.noise, &moments, sd, &mut dice("noise"));
        let mut extra_noise = dice("unrest");
        for (value, &i) in spoiled.values.iter_mut().zip(&rows) {
            *value = value.map(|v| v + day.jitter_w[i] * extra_noise.normal());
        }
        if laws.iter().any(|law| law.entry.name == "saturation") {
            clip(&mut spoiled.values, &clean, sd, &mut extra_noise);
        }
        let style = Style::draw(self, &mut dice("style"));
        let mut table = table(self, &style, stage, &record, &spoiled.values);
        if self.current {
            write_current(&mut table, &record, &pick(&day.machine_w, &rows), &mut dice("current"));
        }
        let mut case = Case {
            group: self.group.clone(),
            name: self.name.clone(),
            seed: self.seed,
            expect: self.expect,
            noise: self.noise.name().into(),
            noise_sd: sd,
            table,
            model: model(self, &style, stage, &mut dice("model")),
            hidden,
            clean,
            faults: spoiled.faults,
            tangent: refit.tangent(stage.baseline.mc),
            rivals: Vec::new(),
        };
        self.compare(&mut case, stage, laws, day, &rows, &moments);
        case
    }

    /// Where another law of the generator follows the effect as closely as the noise allows, only a class is right.
    fn compare(&self, case: &mut Case, stage: &Stage, laws: &[Seeded], day: &Day, rows: &[usize], moments: &[Moment]) {
        if !matches!(self.expect, Expect::Named | Expect::Unknown) {
            return;
        }
        for (i, one) in case.hidden.iter().enumerate() {
            let others = case.hidden.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, h)| h.contribution.clone());
            let span = case.tangent.iter().cloned().chain(others).collect();
            let (sd, noise, record) = (case.noise_sd, self.noise, day.record.as_slice());
            let court = Court { stage, laws, record, rows, span, remainder: &one.remainder, sd, noise, moments };
            let rivals = court.rivals().into_iter().enumerate();
            case.rivals.extend(rivals.filter(|(k, r)| *k < 3 || r.evidence < ENOUGH).map(|(_, r)| r));
        }
        if case.rivals.iter().any(|rival| rival.evidence < ENOUGH) {
            case.expect = if self.expect == Expect::Unknown { Expect::Near } else { Expect::Class };
            case.group = format!("alike-{}", case.group);
        }
    }
}

/// An input that is full passes neither signal nor noise; a little of the converter's own noise remains.
fn clip(values: &mut [Option<f64>], clean: &[f64], sd: f64, dice: &mut Dice) {
    let ceiling = clean.iter().copied().fold(f64::MIN, f64::max);
    values.iter_mut().for_each(|value| *value = value.map(|v| v.min(ceiling) + 0.05 * sd * dice.normal()));
}

fn moments(process: Process, record: &[Tick], clean: &[f64]) -> Vec<Moment> {
    let moment = |(tick, clean): (&Tick, &f64)| Moment {
        t_s: tick.t_s,
        clean: *clean,
        engaged: tick.engaged,
        speed_rpm: tick.speed_rpm,
        ln_thickness: chip(process, tick).ln_thickness,
    };
    record.iter().zip(clean).map(moment).collect()
}

fn pick(values: &[f64], rows: &[usize]) -> Vec<f64> {
    rows.iter().map(|&i| values[i]).collect()
}

/// What of a contribution is left when the nominal model is refitted to the machine with it.
fn remainder(stage: &Stage, refit: &Refit, record: &[Tick], contribution: &[f64]) -> Vec<f64> {
    let output: Vec<f64> = record.iter().zip(contribution).map(|(t, c)| stage.baseline.total_w(t) + c).collect();
    refit.remainder(&output)
}

fn hiding(stage: &Stage, refit: &Refit, record: &[Tick], law: &Seeded, contribution: Vec<f64>, sd: f64) -> Hiding {
    let remainder = remainder(stage, refit, record, &contribution);
    let left = rms(&remainder);
    let absorbed = 1.0 - (left / rms(&contribution).max(1e-9)).powi(2);
    let planted = law.plant(&stage.plan);
    Hiding {
        name: law.entry.name.into(),
        also: law.entry.also.iter().map(ToString::to_string).collect(),
        form: law.entry.form.into(),
        rho: left / sd,
        absorbed,
        onset_row: onset(law, record, &contribution),
        parameters: planted.parameters.iter().map(|(n, v)| (n.to_string(), *v)).collect(),
        contribution,
        remainder,
    }
}

/// For effects that begin at a moment: the first row that they touch.
fn onset(law: &Seeded, record: &[Tick], contribution: &[f64]) -> Option<usize> {
    let begins = match law.entry.name {
        "hardness_batch" => record.iter().position(|t| t.lot > 0 && t.engaged),
        "sensor_gain" if law.entry.form == "step" => contribution.iter().position(|c| c.abs() > 1e-9),
        _ => None,
    };
    begins.filter(|row| *row > 0)
}
