//! The hidden world at work: base physics, the planted laws in their order, the controller, the meter.

use crate::concealed::baseline::Baseline;
use crate::concealed::dice::Dice;
use crate::concealed::law::{Entry, Hidden, Law, Meter, Planted, Scene, Terms};
use crate::concealed::schedule::{Mode, Plan};
use crate::concealed::tick::{STEP_S, Tick};

/// A law to be planted: the same seed and strength always give the same law.
#[derive(Clone)]
pub(crate) struct Seeded {
    pub(crate) entry: Entry,
    pub(crate) seed: u64,
    pub(crate) strength: f64,
}

impl Seeded {
    pub(crate) fn plant(&self, plan: &Plan) -> Planted {
        let mut dice = Dice::seeded(self.entry.form, self.seed);
        (self.entry.make)(&mut dice, plan, self.strength)
    }
}

/// One day: what really happened, what the box wrote down, and the power of every instant.
pub(crate) struct Day {
    pub(crate) record: Vec<Tick>,
    pub(crate) power_w: Vec<f64>,
    /// Power before any meter, W: what a second channel sees.
    pub(crate) machine_w: Vec<f64>,
    pub(crate) jitter_w: Vec<f64>,
    /// Power that each law is responsible for, given everything else.
    pub(crate) contributions_w: Vec<Vec<f64>>,
}

/// The machine and its work, before anything is planted.
#[derive(Clone)]
pub(crate) struct Stage {
    pub(crate) plan: Plan,
    pub(crate) baseline: Baseline,
    pub(crate) ticks: Vec<Tick>,
    pub(crate) seed: u64,
}

impl Stage {
    /// The day with `laws` planted.
    pub(crate) fn play(&self, laws: &[Seeded]) -> Day {
        let mut world = self.ticks.clone();
        if self.plan.mode == Mode::ClosedLoop {
            let mut chain = Chain::assemble(&self.plan, laws, None);
            chain.control(&self.baseline, &mut world, &mut Dice::seeded("controller", self.seed));
        }
        let mut record = world.clone();
        for law in laws {
            if let Hidden::Clerk(mut clerk) = law.plant(&self.plan).hidden {
                clerk(&mut world, &mut record);
            }
        }
        let (power_w, jitter_w) = self.power(&world, laws, None);
        let mut bare = Chain::assemble(&self.plan, laws, None);
        bare.meters.clear();
        let (machine_w, _) = bare.run(&self.baseline, &world);
        let mut contributions_w = Vec::new();
        for (i, law) in laws.iter().enumerate() {
            let clerk = matches!(law.plant(&self.plan).hidden, Hidden::Clerk(_));
            let (ticks, without) = if clerk { (&record, None) } else { (&world, Some(i)) };
            let (rest, _) = self.power(ticks, laws, without);
            contributions_w.push(power_w.iter().zip(&rest).map(|(p, r)| p - r).collect());
        }
        Day { record, power_w, machine_w, jitter_w, contributions_w }
    }

    /// What `law` alone adds to the power over given instants; `bare` is the power without it.
    pub(crate) fn added(&self, law: &Seeded, record: &[Tick], bare: &[f64]) -> Vec<f64> {
        let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        if let Hidden::Clerk(mut clerk) = law.plant(&self.plan).hidden {
            let (mut world, mut written) = (record.to_vec(), record.to_vec());
            clerk(&mut world, &mut written);
            return difference(&self.power(&world, &[], None).0, &self.power(&written, &[], None).0);
        }
        difference(&self.power(record, std::slice::from_ref(law), None).0, bare)
    }

    /// Power without any hidden law.
    pub(crate) fn bare(&self, record: &[Tick]) -> Vec<f64> {
        self.power(record, &[], None).0
    }

    fn power(&self, ticks: &[Tick], laws: &[Seeded], without: Option<usize>) -> (Vec<f64>, Vec<f64>) {
        Chain::assemble(&self.plan, laws, without).run(&self.baseline, ticks)
    }
}

struct Chain {
    cut: Vec<Law>,
    machine: Vec<Law>,
    meters: Vec<Meter>,
}

impl Chain {
    fn assemble(plan: &Plan, laws: &[Seeded], without: Option<usize>) -> Self {
        let mut chain = Self { cut: Vec::new(), machine: Vec::new(), meters: Vec::new() };
        for (_, law) in laws.iter().enumerate().filter(|(i, _)| Some(*i) != without) {
            match law.plant(plan).hidden {
                Hidden::Cut(law) => chain.cut.push(law),
                Hidden::Machine(law) => chain.machine.push(law),
                Hidden::Meter(meter) => chain.meters.push(meter),
                Hidden::Clerk(_) => {}
            }
        }
        chain
    }

    fn run(&mut self, baseline: &Baseline, ticks: &[Tick]) -> (Vec<f64>, Vec<f64>) {
        let (mut power, jitter): (Vec<f64>, Vec<f64>) =
            ticks.iter().map(|tick| self.step(baseline, tick)).map(|(p, _, j)| (p, j)).unzip();
        for meter in &mut self.meters {
            power = meter(ticks, &power);
        }
        (power, jitter)
    }

    /// Total power, cutting power and extra noise of one instant.
    fn step(&mut self, baseline: &Baseline, tick: &Tick) -> (f64, f64, f64) {
        let nominal_w = baseline.cutting_w(tick);
        let no_load_w = baseline.no_load_w(tick.speed_rpm);
        let mut scene = Scene { tick, baseline, cutting_w: nominal_w, nominal_w, no_load_w };
        let cut = sum(&mut self.cut, &scene);
        scene.cutting_w = (nominal_w * (1.0 + cut.gain) + cut.power_w).max(0.0);
        let machine = sum(&mut self.machine, &scene);
        let power = baseline.machine_w(tick) + scene.cutting_w * (1.0 + baseline.load_loss) + machine.power_w;
        (power, scene.cutting_w, cut.jitter_w.hypot(machine.jitter_w))
    }

    /// A load controller: an integrator with its own filter drives the feed so that the cutting power holds a target.
    fn control(&mut self, baseline: &Baseline, ticks: &mut [Tick], dice: &mut Dice) {
        let (rate, filter_s) = (dice.uniform(0.10, 0.3), dice.uniform(0.4, 1.2));
        let (mut factor, mut seen_w, mut target_w) = (1.0, 0.0, 1.0);
        for tick in ticks {
            if tick.engaged && tick.since_entry_s == 0.0 {
                target_w = baseline.cutting_w(tick) * dice.uniform(0.85, 1.15);
                (factor, seen_w) = (1.0, target_w);
            }
            tick.feed_mm_rev = tick.programmed_mm_rev * factor;
            let (_, cutting_w, _) = self.step(baseline, tick);
            if tick.engaged {
                seen_w += (cutting_w - seen_w) * (1.0 - (-STEP_S / filter_s).exp());
                factor = (factor + rate * STEP_S * (1.0 - seen_w / target_w)).clamp(0.5, 1.4);
                tick.velocity_mm_min = -tick.feed_mm_rev * tick.speed_rpm;
            }
        }
    }
}

fn sum(laws: &mut [Law], scene: &Scene) -> Terms {
    laws.iter_mut().map(|law| law(scene)).fold(Terms::default(), |a, b| Terms {
        gain: a.gain + b.gain,
        power_w: a.power_w + b.power_w,
        jitter_w: a.jitter_w.hypot(b.jitter_w),
    })
}

/// Indices of the instants that are rows: one per second, beginning with each part.
pub(crate) fn rows(ticks: &[Tick], every: usize) -> Vec<usize> {
    let mut start = 0;
    (0..ticks.len())
        .filter(|&i| {
            if i > 0 && ticks[i].run != ticks[i - 1].run {
                start = i;
            }
            (i - start).is_multiple_of(every)
        })
        .collect()
}
