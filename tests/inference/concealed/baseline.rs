//! What the simulation knows: no-load polynomial and specific cutting force (contract model/1), and its refit.

use crate::concealed::dice::Dice;
use crate::concealed::least_squares::Basis;
use crate::concealed::tick::Tick;

/// How material is removed, which decides the chip thickness and the removal rate.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Process {
    Turning,
    Milling,
    Drilling,
}

/// The true values of the parameters that the nominal model also has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Baseline {
    pub(crate) process: Process,
    /// No-load power in W, W/rpm, W/rpm2.
    pub(crate) no_load: [f64; 3],
    pub(crate) kc11: f64,
    pub(crate) mc: f64,
    /// Linear load loss that the model knows exactly; 0 when the model does not mention it.
    pub(crate) load_loss: f64,
    /// Inertia that the model knows; 0 when the model does not mention it.
    pub(crate) inertia_kg_m2: f64,
}

/// The two quantities of a row in which cutting power is kc11 * volume * thickness^-mc.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chip {
    /// Removal rate / 60 in cm3/s scaled to W per N/mm2; 0 when not engaged.
    pub(crate) volume: f64,
    pub(crate) ln_thickness: f64,
}

impl Baseline {
    /// A machine and a material drawn at random.
    pub(crate) fn draw(process: Process, dice: &mut Dice) -> Self {
        let milling = if process == Process::Turning { 1.0 } else { 0.5 };
        Self {
            process,
            no_load: [
                dice.uniform(80.0, 220.0),
                dice.uniform(0.10, 0.35) * milling,
                dice.uniform(1.2e-5, 5e-5) * milling * milling,
            ],
            kc11: dice.uniform(1450.0, 2300.0),
            mc: dice.uniform(0.17, 0.29),
            load_loss: if dice.chance(0.5) { dice.uniform(0.15, 0.22) } else { 0.0 },
            inertia_kg_m2: 0.0,
        }
    }

    /// Power at speed without cutting, W.
    pub(crate) fn no_load_w(&self, speed_rpm: f64) -> f64 {
        let [p0, p1, p2] = self.no_load;
        p0 + (p1 + p2 * speed_rpm) * speed_rpm
    }

    /// Everything that the nominal model can state, W.
    pub(crate) fn total_w(&self, tick: &Tick) -> f64 {
        self.machine_w(tick) + self.cutting_w(tick) * (1.0 + self.load_loss)
    }

    /// The part of it that is there without a cut, W.
    pub(crate) fn machine_w(&self, tick: &Tick) -> f64 {
        self.no_load_w(tick.speed_rpm) + self.inertia_kg_m2 * kinetic_w(tick)
    }

    /// Cutting power of the instant, W, losses not included.
    pub(crate) fn cutting_w(&self, tick: &Tick) -> f64 {
        let chip = chip(self.process, tick);
        self.kc11 * chip.volume * (-self.mc * chip.ln_thickness).exp()
    }
}

/// Kinetic power of one kg m2, W.
pub(crate) fn kinetic_w(tick: &Tick) -> f64 {
    tick.omega() * tick.alpha()
}

/// Chip of one instant.
pub(crate) fn chip(process: Process, tick: &Tick) -> Chip {
    if !tick.engaged || tick.feed_mm_rev <= 0.0 || tick.depth_mm <= 0.0 {
        return Chip { volume: 0.0, ln_thickness: 0.0 };
    }
    let feed_mm_min = tick.feed_mm_rev * tick.speed_rpm;
    let per_tooth = tick.feed_mm_rev / tick.teeth.max(1.0);
    let (removal_cm3_min, thickness) = match process {
        Process::Turning => (tick.depth_mm * tick.feed_mm_rev * tick.cutting_speed_m_min(), tick.feed_mm_rev),
        Process::Milling => (
            tick.depth_mm * tick.width_mm * feed_mm_min / 1000.0,
            per_tooth * (tick.width_mm / tick.diameter_mm).sqrt(),
        ),
        Process::Drilling => (
            std::f64::consts::PI * tick.diameter_mm.powi(2) * feed_mm_min / 4000.0,
            per_tooth * (tick.width_mm / tick.diameter_mm).sqrt(),
        ),
    };
    Chip { volume: removal_cm3_min / 60.0, ln_thickness: thickness.ln() }
}

/// The nominal model as it can be refitted to recorded rows.
pub(crate) struct Refit {
    fixed: Vec<Vec<f64>>,
    chips: Vec<Chip>,
}

impl Refit {
    /// From the recorded speed and chip of every row.
    pub(crate) fn new(baseline: &Baseline, recorded: &[Tick]) -> Self {
        let column = |f: fn(&Tick) -> f64| recorded.iter().map(f).collect::<Vec<_>>();
        let mut fixed = vec![column(|_| 1.0), column(|t| t.speed_rpm), column(|t| t.speed_rpm.powi(2))];
        if baseline.inertia_kg_m2 > 0.0 {
            fixed.push(column(kinetic_w));
        }
        Self { fixed, chips: recorded.iter().map(|r| chip(baseline.process, r)).collect() }
    }

    /// What of `y` the refitted model cannot follow; the exponent is searched between 0.01 and 0.6.
    pub(crate) fn remainder(&self, y: &[f64]) -> Vec<f64> {
        let (mut low, mut high) = (0.01_f64, 0.6_f64);
        let golden = 0.618_033_988_75;
        for _ in 0..22 {
            let (a, b) = (high - golden * (high - low), low + golden * (high - low));
            if self.left_over(y, a) < self.left_over(y, b) {
                high = b;
            } else {
                low = a;
            }
        }
        self.basis((low + high) / 2.0).remainder(y)
    }

    fn left_over(&self, y: &[f64], mc: f64) -> f64 {
        crate::concealed::least_squares::rms(&self.basis(mc).remainder(y))
    }

    fn basis(&self, mc: f64) -> Basis {
        let cut = self.chips.iter().map(|c| c.volume * (-mc * c.ln_thickness).exp()).collect();
        let mut columns = self.fixed.clone();
        columns.push(cut);
        Basis::of(&columns)
    }

    /// The model's tangent at `mc`: what a small change of any parameter can take away.
    pub(crate) fn tangent(&self, mc: f64) -> Vec<Vec<f64>> {
        let cut: Vec<f64> = self.chips.iter().map(|c| c.volume * (-mc * c.ln_thickness).exp()).collect();
        let slope = self.chips.iter().zip(&cut).map(|(c, p)| c.ln_thickness * p).collect();
        let mut columns = self.fixed.clone();
        columns.extend([cut, slope]);
        columns
    }
}
