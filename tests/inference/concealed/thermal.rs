//! Thermal error of a machine over days of tests, a row a minute: growth with hidden states, room, coolant, screw.

use crate::concealed::bench::{Bench, Part, follow};
use crate::concealed::case::{Case, Expect, Table, short};
use crate::concealed::dice::Dice;
use crate::concealed::noise::Noise;

const STEP_S: f64 = 60.0;
const RUNS: usize = 8;
const ROWS: usize = 190;

/// Eight tests of about three hours each, one after the other.
struct Tests {
    speed: Vec<f64>,
    feed: Vec<f64>,
    position: Vec<f64>,
    ambient: Vec<f64>,
    coolant: Vec<f64>,
    coolant_on: Vec<f64>,
    bearing: Vec<f64>,
}

impl Tests {
    fn draw(dice: &mut Dice) -> Self {
        let total = RUNS * ROWS;
        let (speed, feed, position) =
            (steps(dice, total, 4500.0), steps(dice, total, 9000.0), steps(dice, total, 600.0));
        let phase = dice.uniform(0.0, 6.3);
        let mut wander = 0.0;
        let ambient: Vec<f64> = (0..total)
            .map(|i| {
                wander = 0.995 * wander + 0.06 * dice.normal();
                21.0 + 2.6 * (std::f64::consts::TAU * i as f64 / 1440.0 + phase).sin() + wander
            })
            .collect();
        let coolant_on: Vec<f64> = steps(dice, total, 1.0).iter().map(|x| f64::from(u8::from(*x > 0.45))).collect();
        let drawn: Vec<f64> = coolant_on.iter().zip(&ambient).map(|(on, a)| a + on * 4.0).collect();
        let coolant = follow(&drawn, 3000.0, STEP_S);
        let heat: Vec<f64> = speed.iter().map(|n| 13.0 * (n / 3000.0).powf(1.5)).collect();
        let warmth = follow(&heat, 1100.0, STEP_S);
        let bearing = warmth.iter().zip(&ambient).map(|(w, a)| w + a + 0.05 * dice.normal()).collect();
        Self { speed, feed, position, ambient, coolant, coolant_on, bearing }
    }
}

/// Levels that hold for 10 to 70 minutes, a quarter of them zero.
fn steps(dice: &mut Dice, total: usize, top: f64) -> Vec<f64> {
    let mut values = Vec::new();
    while values.len() < total {
        let level = if dice.chance(0.25) { 0.0 } else { (dice.uniform(0.15, 1.0) * top * 10.0).round() / 10.0 };
        values.extend(std::iter::repeat_n(level, dice.whole(10, 70)));
    }
    values.truncate(total);
    values
}

/// A thermal case that can be built.
pub(crate) struct Order {
    pub(crate) group: String,
    pub(crate) name: String,
    seed: u64,
    index: usize,
    rho: f64,
}

type Law = fn(&mut Dice, &Tests) -> Part;

const NAMES: [&str; 7] =
    ["spindle_growth", "ambient_drift", "coolant_temperature", "screw_growth", "sun", "drawbar", "plain"];

const LAWS: [(Law, &[&str], Expect); 7] = [
    (spindle, &["ambient_temperature_c"], Expect::Named),
    (room, &["bearing_temperature_c"], Expect::Named),
    (coolant, &["bearing_temperature_c", "ambient_temperature_c"], Expect::Named),
    (screw, &["bearing_temperature_c", "ambient_temperature_c"], Expect::Named),
    (sun, &["bearing_temperature_c", "ambient_temperature_c"], Expect::Unknown),
    (clamp, &["bearing_temperature_c", "ambient_temperature_c"], Expect::Unknown),
    (none, &["bearing_temperature_c", "ambient_temperature_c"], Expect::Nothing),
];

/// Every thermal case of one seed.
pub(crate) fn orders(seed: u64) -> Vec<Order> {
    let mut list = Vec::new();
    for rho in [1.0, 2.0] {
        for (i, (_, _, expect)) in LAWS.iter().enumerate() {
            let group = match expect {
                Expect::Unknown => format!("unlisted-thermal-rho{rho}"),
                Expect::Nothing => "nothing-thermal".into(),
                _ => format!("thermal-rho{rho}"),
            };
            list.push(Order { group, name: format!("{}-rho{rho}-s{seed}", NAMES[i]), seed, index: i, rho });
        }
    }
    list
}

/// The case, or none when no plausible strength leaves the wished remainder.
pub(crate) fn build(order: &Order) -> Option<Case> {
    let Order { group, name, seed, index, rho } = order;
    let seed = *seed;
    let (law, known, expect) = LAWS[*index];
    let mut dice = Dice::seeded(&format!("thermal/{group}/{name}"), seed);
    let tests = Tests::draw(&mut dice);
    let mut span = vec![vec![1.0; tests.speed.len()]];
    let mut nominal = vec![dice.uniform(-20.0, 20.0); tests.speed.len()];
    let mut coefficients = vec![format!("one = {}", short(nominal[0] * 1.1, 3))];
    for column in known {
        let (values, slope) = if *column == "bearing_temperature_c" {
            (&tests.bearing, dice.uniform(0.8, 1.8))
        } else {
            (&tests.ambient, dice.uniform(-2.5, 2.5))
        };
        nominal.iter_mut().zip(values).for_each(|(n, v)| *n += slope * v);
        coefficients.push(format!("{column} = {}", short(slope * (1.0 + dice.sign() * dice.uniform(0.03, 0.15)), 4)));
        span.push(values.clone());
    }
    let parts = if expect == Expect::Nothing { vec![] } else { vec![law(&mut dice, &tests)] };
    let rows = tests.speed.len();
    Bench {
        group: group.clone(),
        name: name.clone(),
        seed,
        expect,
        rho: *rho,
        noise: *dice.pick(&[Noise::Independent, Noise::Short, Noise::Short]),
        noise_share: (0.005, 0.3),
        table: table(&tests),
        output: "thermal_error_um",
        model: format!(
            "schema = \"model/1\"\nname   = \"thermal error, nominal regression\"\noutput = \"thermal_error_um\"\n\n\
             [[effect]]\nkind = \"linear\"\ncolumns = {{ {} }}\n",
            coefficients.join(", ")
        ),
        span,
        nominal,
        parts,
        noise_time_s: (0..rows).map(|i| i as f64).collect(),
    }
    .finish()
}

fn table(tests: &Tests) -> Table {
    let mut table = Table::default();
    table.number("time_s", 0, (0..tests.speed.len()).map(|i| i as f64 * STEP_S));
    table.text("run", (0..tests.speed.len()).map(|i| format!("test{}", i / ROWS + 1)));
    for (name, decimals, values) in [
        ("spindle_speed_rpm", 0, &tests.speed),
        ("axis_velocity_mm_min", 0, &tests.feed),
        ("axis_position_mm", 1, &tests.position),
        ("ambient_temperature_c", 3, &tests.ambient),
        ("coolant_temperature_c", 3, &tests.coolant),
        ("coolant_on", 0, &tests.coolant_on),
        ("bearing_temperature_c", 3, &tests.bearing),
    ] {
        table.number(name, decimals, values.iter().copied());
    }
    table
}

fn part(name: &'static str, form: &'static str, contribution: Vec<f64>) -> Part {
    Part { name, also: &[], form, reach: (0.1, 3.0), contribution, parameters: Vec::new() }
}

/// Shaft and housing grow with their own times, driven by speed to the power 1.7.
fn spindle(dice: &mut Dice, tests: &Tests) -> Part {
    let heat: Vec<f64> = tests.speed.iter().map(|n| (n / 3000.0).powf(1.7)).collect();
    let fast = follow(&heat, dice.uniform(240.0, 560.0), STEP_S);
    let slow = follow(&heat, dice.uniform(2600.0, 5200.0), STEP_S);
    let (a, b) = (dice.uniform(6.0, 14.0), dice.uniform(12.0, 30.0));
    part("spindle_growth", "two times", fast.iter().zip(&slow).map(|(f, s)| a * f + b * s).collect())
}

/// The bed follows the hall through two masses.
fn room(dice: &mut Dice, tests: &Tests) -> Part {
    let casting = follow(&tests.ambient, dice.uniform(1800.0, 4200.0), STEP_S);
    let bed = follow(&casting, dice.uniform(2400.0, 6000.0), STEP_S);
    let slope = dice.sign() * dice.uniform(2.0, 5.0);
    part("ambient_drift", "two masses", bed.iter().map(|t| slope * (t - 21.0)).collect())
}

fn coolant(dice: &mut Dice, tests: &Tests) -> Part {
    let wet: Vec<f64> =
        tests.coolant.iter().zip(&tests.coolant_on).map(|(c, on)| (c - 21.0) * (0.35 + 0.65 * on)).collect();
    let table = follow(&wet, dice.uniform(200.0, 600.0), STEP_S);
    let slope = dice.uniform(1.5, 4.0);
    part("coolant_temperature", "table behind the coolant", table.iter().map(|t| slope * t).collect())
}

/// The screw stretches with its own warmth, more so far from the fixed bearing.
fn screw(dice: &mut Dice, tests: &Tests) -> Part {
    let friction: Vec<f64> = tests.feed.iter().map(|v| (v.abs() / 6000.0).powf(1.2)).collect();
    let warm = follow(&friction, dice.uniform(1400.0, 3200.0), STEP_S);
    let kelvin = dice.uniform(3.0, 7.0);
    let length = |x: &f64| 0.0115 * (x + 120.0);
    part(
        "screw_growth",
        "from the fixed bearing",
        warm.iter().zip(&tests.position).map(|(w, x)| kelvin * w * length(x)).collect(),
    )
}

/// Sun through a window, every day at the same hour.
fn sun(dice: &mut Dice, tests: &Tests) -> Part {
    let (hour, width, height) = (dice.uniform(300.0, 1100.0), dice.uniform(50.0, 120.0), dice.uniform(6.0, 14.0));
    let shine = (0..tests.speed.len()).map(|i| {
        let minute = i as f64 % 1440.0;
        height * (-((minute - hour) / width).powi(2)).exp()
    });
    part("unlisted", "sun at an hour", shine.collect())
}

/// The drawbar settles after every start of the spindle.
fn clamp(dice: &mut Dice, tests: &Tests) -> Part {
    let (height, settle_min) = (dice.uniform(4.0, 9.0), dice.uniform(6.0, 18.0));
    let mut since = 1e3;
    let mut last = 0.0;
    let settle = tests.speed.iter().map(|n| {
        if (*n > 0.0) != (last > 0.0) {
            since = 0.0;
        }
        since += 1.0;
        last = *n;
        if *n > 0.0 { height * (-since / settle_min).exp() } else { 0.0 }
    });
    part("unlisted", "drawbar settles", settle.collect())
}

fn none(_: &mut Dice, tests: &Tests) -> Part {
    part("none", "none", vec![0.0; tests.speed.len()])
}
