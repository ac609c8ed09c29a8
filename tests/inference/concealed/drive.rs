//! A linear drive on its own: position, velocity, acceleration and force at 100 Hz.

use std::f64::consts::TAU;

use crate::concealed::bench::{Bench, Part, centred, follow};
use crate::concealed::case::{Case, Expect, Table, short};
use crate::concealed::dice::Dice;
use crate::concealed::noise::Noise;

const STEP_S: f64 = 0.01;
const RUNS: usize = 8;

/// The motion of the carriage, row by row.
struct Ride {
    run: Vec<usize>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl Ride {
    /// Eight runs of moves to and fro with jerk-limited ramps, dwells, and a slow creep now and then.
    fn draw(dice: &mut Dice) -> Self {
        let mut ride = Self { run: vec![], position: vec![], velocity: vec![], acceleration: vec![] };
        let mut position = 0.0;
        for run in 0..RUNS {
            let until = (run + 1) * 265;
            while ride.run.len() < until {
                let direction = if position > 0.12 { -1.0 } else { 1.0 };
                let top =
                    direction * if dice.chance(0.3) { dice.uniform(0.004, 0.03) } else { dice.uniform(0.05, 0.24) };
                let (ramp_s, cruise_s) = (dice.uniform(0.08, 0.2), dice.uniform(0.1, 0.5));
                ride.go(run, &mut position, top, ramp_s, cruise_s);
                ride.rest(run, position, dice.uniform(0.05, 0.35));
            }
        }
        ride
    }

    fn push(&mut self, run: usize, position: f64, velocity: f64, acceleration: f64) {
        self.run.push(run);
        self.position.push(position);
        self.velocity.push(velocity);
        self.acceleration.push(acceleration);
    }

    fn go(&mut self, run: usize, position: &mut f64, top: f64, ramp_s: f64, cruise_s: f64) {
        let total = 2.0 * ramp_s + cruise_s;
        for step in 1..=(total / STEP_S).round() as usize {
            let t = step as f64 * STEP_S;
            let edge = (t.min(total - t) / ramp_s).clamp(0.0, 1.0);
            let velocity = top * edge * edge * (3.0 - 2.0 * edge);
            let slope = if t < total / 2.0 { 1.0 } else { -1.0 };
            let acceleration = slope * top * 6.0 * edge * (1.0 - edge) / ramp_s;
            *position += velocity * STEP_S;
            self.push(run, *position, velocity, acceleration);
        }
    }

    fn rest(&mut self, run: usize, position: f64, seconds: f64) {
        for _ in 0..(seconds / STEP_S) as usize {
            self.push(run, position, 0.0, 0.0);
        }
    }

    fn force(&self, law: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
        let rows = 0..self.run.len();
        rows.map(|i| law(self.position[i], self.velocity[i], self.acceleration[i])).collect()
    }
}

/// Which terms the nominal model has.
#[derive(Clone, Copy)]
struct Known {
    mass: bool,
    viscous: bool,
    dry: bool,
}

const ALL: Known = Known { mass: true, viscous: true, dry: true };
const NO_DRY: Known = Known { dry: false, ..ALL };

/// A drive case that can be built.
pub(crate) struct Order {
    pub(crate) group: String,
    pub(crate) name: String,
    seed: u64,
    laws: Vec<Law>,
    known: Known,
    expect: Expect,
    rho: f64,
}

type Law = fn(&mut Dice, &Ride, &[f64]) -> Part;

/// Hidden law, what the model knows, expectation.
const SINGLES: [(&str, Law, Known, Expect); 13] = [
    ("dry_friction", dry, NO_DRY, Expect::Named),
    ("presliding", presliding, NO_DRY, Expect::Named),
    ("offset", offset, ALL, Expect::Named),
    ("direction_asymmetry", asymmetry, ALL, Expect::Named),
    ("stribeck", stribeck, ALL, Expect::Named),
    ("viscous_friction", viscous, Known { viscous: false, ..ALL }, Expect::Named),
    ("axis_inertia", inertia, Known { mass: false, ..ALL }, Expect::Named),
    ("clock_lag", late, ALL, Expect::Named),
    ("meter_window", smeared, ALL, Expect::Named),
    ("zero_drift", drifting, ALL, Expect::Named),
    ("cogging", cogging, ALL, Expect::Unknown),
    ("cable_chain", cable_chain, ALL, Expect::Unknown),
    ("cushion", cushion, ALL, Expect::Unknown),
];

/// Every drive case of one seed.
pub(crate) fn orders(seed: u64) -> Vec<Order> {
    let mut list = Vec::new();
    let mut add = |group: String, name: &str, laws: &[Law], known: Known, expect: Expect, rho: f64| {
        list.push(Order { group, name: format!("{name}-s{seed}"), seed, laws: laws.to_vec(), known, expect, rho });
    };
    for rho in [0.5, 1.0] {
        for (name, law, known, expect) in SINGLES {
            let group = if expect == Expect::Unknown { "unlisted-drive" } else { "drive" };
            add(format!("{group}-rho{rho}"), name, &[law], known, expect, rho);
        }
    }
    let named = Expect::Named;
    add("drive-pair".into(), "dry+offset", &[dry, offset], NO_DRY, named, 1.0);
    add("drive-pair".into(), "dry+stribeck", &[dry, stribeck], NO_DRY, named, 1.0);
    add("drive-triple".into(), "dry+offset+asymmetry", &[dry, offset, asymmetry], NO_DRY, named, 1.0);
    add("nothing-drive".into(), "plain", &[], ALL, Expect::Nothing, 1.0);
    list
}

/// The case, or none when no plausible strength leaves the wished remainder.
pub(crate) fn build(order: &Order) -> Option<Case> {
    let Order { group, name, seed, laws, known, expect, rho } = order;
    let seed = *seed;
    let mut dice = Dice::seeded(&format!("drive/{group}/{name}"), seed);
    let ride = Ride::draw(&mut dice);
    let (mass, viscous, dry) = (dice.uniform(60.0, 140.0), dice.uniform(160.0, 380.0), dice.uniform(12.0, 28.0));
    let sign = |v: f64| if v == 0.0 { 0.0 } else { v.signum() };
    let terms: [(bool, &str, f64, Vec<f64>); 3] = [
        (known.mass, "acceleration_m_s2", mass, ride.force(|_, _, a| a)),
        (known.viscous, "velocity_m_s", viscous, ride.force(|_, v, _| v)),
        (known.dry, "\"sign(velocity_m_s)\"", dry, ride.force(|_, v, _| sign(v))),
    ];
    let kept: Vec<_> = terms.into_iter().filter(|t| t.0).collect();
    let nominal = (0..ride.run.len()).map(|i| kept.iter().map(|t| t.2 * t.3[i]).sum()).collect::<Vec<f64>>();
    let coefficients: Vec<String> = kept
        .iter()
        .map(|t| format!("{} = {}", t.1, short(t.2 * (1.0 + dice.sign() * dice.uniform(0.03, 0.15)), 3)))
        .collect();
    let parts = laws.iter().map(|law| law(&mut dice, &ride, &nominal)).collect();
    let noise = *dice.pick(&[Noise::Independent, Noise::Short, Noise::Short, Noise::Long]);
    Bench {
        group: group.clone(),
        name: name.clone(),
        seed,
        expect: *expect,
        rho: *rho,
        noise,
        noise_share: (0.005, 0.2),
        table: table(&ride),
        output: "force_n",
        model: model(&coefficients.join(", ")),
        span: kept.into_iter().map(|t| t.3).collect(),
        nominal,
        parts,
        noise_time_s: (0..ride.run.len()).map(|i| i as f64).collect(),
    }
    .finish()
}

fn model(coefficients: &str) -> String {
    format!(
        "schema = \"model/1\"\nname   = \"linear drive, nominal\"\noutput = \"force_n\"\n\n\
         [[effect]]\nkind = \"linear\"\ncolumns = {{ {coefficients} }}\n\n\
         [roles]\nvelocity = \"velocity_m_s\"\nacceleration = \"acceleration_m_s2\"\nposition = \"position_m\"\n"
    )
}

fn table(ride: &Ride) -> Table {
    let mut table = Table::default();
    table.number("time_s", 3, (0..ride.run.len()).map(|i| i as f64 * STEP_S));
    table.text("run", ride.run.iter().map(|r| format!("d{r}")));
    table.number("position_m", 6, ride.position.iter().copied());
    table.number("velocity_m_s", 6, ride.velocity.iter().copied());
    table.number("acceleration_m_s2", 5, ride.acceleration.iter().copied());
    table
}

fn part(name: &'static str, form: &'static str, contribution: Vec<f64>) -> Part {
    Part { name, also: &[], form, reach: (0.1, 3.0), contribution, parameters: Vec::new() }
}

/// Dry friction, smooth through zero and a little different along the rail.
fn dry(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let (force, creep, wave) = (dice.uniform(14.0, 30.0), dice.uniform(0.0006, 0.002), dice.uniform(0.0, 6.0));
    let law = |x: f64, v: f64, _| force * (v / creep).tanh() * (1.0 + 0.04 * (9.0 * x + wave).sin());
    Part { parameters: vec![("level", force)], ..part("dry_friction", "hyperbolic tangent", ride.force(law)) }
}

/// Dry friction of a preloaded rail with seals: what touches bends before it slips, harder or softer the farther, and stays
/// bent at rest.
fn presliding(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    const STEPS: usize = 50;
    let (force, way, softening) = (dice.uniform(14.0, 30.0), dice.uniform(0.0003, 0.003), dice.uniform(0.6, 1.6));
    let mut bent: f64 = 0.0;
    let mut at = |velocity: &f64| {
        let dx = velocity * STEP_S / STEPS as f64;
        for _ in 0..STEPS {
            bent = (bent + dx / way * (1.0 - bent * dx.signum()).max(0.0).powf(softening)).clamp(-1.0, 1.0);
        }
        force * bent
    };
    let contribution = ride.velocity.iter().map(&mut at).collect();
    Part { parameters: vec![("level", force)], ..part("dry_friction", "bends before it slips", contribution) }
}

fn offset(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let force = dice.sign() * dice.uniform(5.0, 20.0);
    Part { parameters: vec![("level", force)], ..part("offset", "constant", ride.force(|_, _, _| force)) }
}

/// Another level forwards than backwards, none at rest.
fn asymmetry(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let (force, slope) = (dice.sign() * dice.uniform(4.0, 12.0), dice.uniform(0.0, 0.5));
    let law = |_, v: f64, _| force * (v / 0.0015).tanh().powi(2) * (1.0 + slope * v.abs());
    part("direction_asymmetry", "level while moving", ride.force(law))
}

fn stribeck(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let (force, speed) = (dice.uniform(8.0, 22.0), dice.uniform(0.01, 0.03));
    let law = |_, v: f64, _| force * (v / 0.0006).tanh() * (1.0 - (v.abs() / speed).tanh());
    part("stribeck", "hyperbolic tangent", ride.force(law))
}

fn viscous(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let (slope, bend) = (dice.uniform(150.0, 350.0), dice.uniform(0.9, 1.05));
    let law = |_, v: f64, _| slope * 0.1 * v.signum() * (v.abs() / 0.1).powf(bend);
    part("viscous_friction", "power about one", ride.force(law))
}

fn inertia(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let mass = dice.uniform(50.0, 130.0);
    let whole = part("axis_inertia", "mass", ride.force(|_, _, a| mass * a));
    Part { also: &["spindle_inertia"], parameters: vec![("mass_kg", mass)], reach: (0.02, 3.0), ..whole }
}

/// The force comes late by up to three samples.
fn late(dice: &mut Dice, ride: &Ride, nominal: &[f64]) -> Part {
    let rows = dice.uniform(0.6, 3.0);
    let at = |i: usize| {
        let back = (i as f64 - rows).max(0.0);
        let (j, share) = (back as usize, back.fract());
        nominal[j] + share * (nominal[(j + 1).min(nominal.len() - 1)] - nominal[j])
    };
    let contribution = (0..ride.run.len()).map(|i| at(i) - nominal[i]).collect();
    Part { reach: (1.0, 1.0), parameters: vec![("lag_s", rows * STEP_S)], ..part("clock_lag", "late", contribution) }
        .fixed()
}

/// A current filter of two stages.
fn smeared(dice: &mut Dice, _: &Ride, nominal: &[f64]) -> Part {
    let first = follow(nominal, dice.uniform(0.012, 0.04), STEP_S);
    let both = follow(&first, dice.uniform(0.004, 0.01), STEP_S);
    let contribution = both.iter().zip(nominal).map(|(b, n)| b - n).collect();
    part("meter_window", "two filters", contribution).fixed()
}

fn drifting(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let mut walk = 0.0;
    let white: Vec<f64> = ride
        .run
        .iter()
        .map(|_| {
            walk += 0.02 * dice.normal();
            walk
        })
        .collect();
    let slow = follow(&white, 1.5, STEP_S);
    let scale = dice.uniform(8.0, 16.0) / crate::concealed::least_squares::rms(&centred(&slow)).max(1e-9);
    part("zero_drift", "filtered walk", centred(&slow).iter().map(|s| s * scale).collect())
}

fn cogging(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let (force, pitch) = (dice.uniform(8.0, 20.0), dice.uniform(0.012, 0.032));
    let law = |x: f64, _, _| force * ((TAU * x / pitch).sin() + 0.3 * (2.0 * TAU * x / pitch).cos());
    part("unlisted", "cogging over position", ride.force(law))
}

fn cable_chain(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let (stiffness, middle) = (dice.uniform(120.0, 300.0), dice.uniform(0.05, 0.15));
    part("unlisted", "cable chain spring", ride.force(|x, _, _| stiffness * (x - middle)))
}

fn cushion(dice: &mut Dice, ride: &Ride, _: &[f64]) -> Part {
    let (force, reach) = (dice.uniform(30.0, 60.0), dice.uniform(0.01, 0.03));
    let end = ride.position.iter().copied().fold(f64::MIN, f64::max);
    part("unlisted", "end cushion", ride.force(|x, _, _| force * ((x - end) / reach).exp()))
}

impl Part {
    /// Not scalable: its shape depends on its size, so only the noise adapts.
    fn fixed(mut self) -> Self {
        self.reach = (1.0, 1.0);
        self
    }
}
