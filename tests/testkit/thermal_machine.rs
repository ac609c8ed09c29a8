//! A milling machine that warms: lumped heat nodes with friction that falls with temperature, convection that grows with
//! speed, a spindle shaft that no sensor touches, and an expansion of that shaft, the box and the column.
//!
//! Nothing here is a law of the estimators: the error is a sum over nodes, most of them not measured, and is not linear in
//! any choice of sensors.

use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Temperature points as in the publication, X1 to X13.
pub const SENSORS: usize = 13;
/// Seconds between rows.
pub const STEP_S: f64 = 60.0;

const INNER_S: f64 = 10.0;

#[derive(Clone, Copy)]
enum Node {
    Cover,
    Sleeve,
    Column,
    Slide,
    Table,
    ScrewMotor,
    Motor,
    Plate,
    Guide,
    Bed,
    Bearing,
    Box,
    Shaft,
}

/// Heat capacity in J/K and conductance to the air in W/K, by node.
const NODES: [(f64, f64); 13] = [
    (9e3, 6.0),
    (7e3, 1.5),
    (4.5e5, 22.0),
    (6e4, 7.0),
    (2e5, 20.0),
    (1.2e4, 3.0),
    (2.4e4, 7.0),
    (3e4, 5.0),
    (4e4, 5.0),
    (6e5, 30.0),
    (5e3, 0.8),
    (9e4, 9.0),
    (1.6e4, 0.7),
];

/// Conductances between nodes, W/K.
const LINKS: [(Node, Node, f64); 13] = [
    (Node::Motor, Node::Box, 6.0),
    (Node::Bearing, Node::Box, 9.0),
    (Node::Bearing, Node::Shaft, 5.0),
    (Node::Shaft, Node::Motor, 1.5),
    (Node::Box, Node::Slide, 5.0),
    (Node::Slide, Node::Guide, 4.0),
    (Node::Guide, Node::Column, 6.0),
    (Node::Sleeve, Node::Slide, 2.0),
    (Node::ScrewMotor, Node::Sleeve, 0.8),
    (Node::Plate, Node::Guide, 2.0),
    (Node::Column, Node::Bed, 8.0),
    (Node::Bed, Node::Table, 5.0),
    (Node::Cover, Node::Plate, 1.0),
];

/// Node that each sensor touches; the first one hangs in the air.
const TOUCHED: [Option<Node>; SENSORS] = [
    None,
    Some(Node::Cover),
    Some(Node::Sleeve),
    Some(Node::Column),
    Some(Node::Slide),
    Some(Node::Table),
    Some(Node::ScrewMotor),
    Some(Node::Motor),
    Some(Node::Plate),
    Some(Node::Guide),
    Some(Node::Bed),
    Some(Node::Bearing),
    Some(Node::Box),
];

/// Expansion towards the work, um/K above 20 °C.
const GROWTH: [(Node, f64); 4] = [(Node::Shaft, 1.9), (Node::Box, 1.1), (Node::Slide, 0.8), (Node::Column, -0.9)];

/// Rows of several tests.
#[derive(Default)]
pub struct Recorded {
    /// By row.
    pub time_s: Vec<f64>,
    /// Name of the test, by row.
    pub runs: Vec<String>,
    /// Of the spindle, by row.
    pub speed_rpm: Vec<f64>,
    /// By sensor, then by row.
    pub temperature_c: Vec<Vec<f64>>,
    /// What the gauge reads, by row.
    pub error_um: Vec<f64>,
}

/// The machine, its day and its instruments.
pub struct ThermalMachine {
    random: Pcg64,
    nodes: [f64; 13],
    air: f64,
    wander: f64,
    clock_s: f64,
    gauge_um: f64,
}

impl ThermalMachine {
    /// A cold machine on a day of its own per seed.
    pub fn new(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let start: f64 = random.random_range(18.0..24.0);
        let clock_s = random.random_range(0.0..86_400.0);
        Self { random, nodes: [start; 13], air: start, wander: 0.0, clock_s, gauge_um: 0.0 }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.random)
    }

    fn inner(&mut self, speed_rpm: f64, feeding: bool) {
        let day = (self.clock_s / 86_400.0 * std::f64::consts::TAU).sin();
        self.wander = 0.9995 * self.wander + 0.02 * self.normal();
        self.air = 21.0 + 2.2 * day + self.wander;
        let krpm = speed_rpm / 1000.0;
        let mut watts = [0.0; 13];
        let at = |node: Node| node as usize;
        // Grease that thins as it warms, losses of copper and iron, a screw that only warms when it moves.
        watts[at(Node::Bearing)] = 26.0 * krpm.powf(1.6) * (-0.022 * (self.nodes[at(Node::Bearing)] - 20.0)).exp();
        watts[at(Node::Motor)] = if krpm > 0.0 { 30.0 + 14.0 * krpm + 2.2 * krpm * krpm } else { 0.0 };
        watts[at(Node::ScrewMotor)] = if feeding { 55.0 } else { 0.0 };
        watts[at(Node::Sleeve)] = if feeding { 18.0 } else { 0.0 };
        for (a, b, conductance) in LINKS {
            let flow = conductance * (self.nodes[a as usize] - self.nodes[b as usize]);
            watts[a as usize] -= flow;
            watts[b as usize] += flow;
        }
        for (index, (capacity, to_air)) in NODES.into_iter().enumerate() {
            let turning = matches!(index, i if i == at(Node::Shaft) || i == at(Node::Cover));
            let stirred = if turning { 1.0 + 0.25 * krpm } else { 1.0 };
            let lost = to_air * stirred * (self.nodes[index] - self.air);
            self.nodes[index] += (watts[index] - lost) * INNER_S / capacity;
        }
        self.clock_s += INNER_S;
    }

    fn pass(&mut self, seconds: f64, speed_rpm: f64, feeding: bool) {
        for _ in 0..(seconds / INNER_S) as usize {
            self.inner(speed_rpm, feeding);
        }
    }

    fn row(&mut self, into: &mut Recorded, run: &str, speed_rpm: f64) {
        into.time_s.push(self.clock_s);
        into.runs.push(run.to_owned());
        into.speed_rpm.push(speed_rpm);
        for (sensor, node) in TOUCHED.into_iter().enumerate() {
            let truth = node.map_or(self.air, |node| self.nodes[node as usize]);
            let noisy = truth + 0.04 * self.normal() + 0.15 * (sensor as f64 * 2.4).sin();
            into.temperature_c[sensor].push((noisy * 20.0).round() / 20.0);
        }
        self.gauge_um = 0.98 * self.gauge_um + 0.08 * self.normal();
        let grown: f64 = GROWTH.iter().map(|(node, um)| um * (self.nodes[*node as usize] - 20.0)).sum();
        let white = 0.25 * self.normal();
        into.error_um.push(grown + self.gauge_um + white);
    }

    /// Tests of `rows` rows each at random speeds, with random pauses at rest in between; the clock goes on.
    pub fn tests(&mut self, tests: usize, rows: usize) -> Recorded {
        let mut recorded = Recorded { temperature_c: vec![Vec::new(); SENSORS], ..Recorded::default() };
        for test in 1..=tests {
            let (mut speed_rpm, mut feeding, mut left) = (0.0, false, 0);
            for _ in 0..rows {
                if left == 0 {
                    left = self.random.random_range(20..80);
                    let rests = self.random.random_bool(0.25);
                    speed_rpm = if rests { 0.0 } else { self.random.random_range(10..60) as f64 * 100.0 };
                    feeding = self.random.random_bool(0.5);
                }
                left -= 1;
                self.pass(STEP_S, speed_rpm, feeding);
                self.row(&mut recorded, &format!("test-{test}"), speed_rpm);
            }
            let pause_s = self.random.random_range(1800.0..30_000.0);
            self.pass(pause_s, 0.0, false);
        }
        recorded
    }
}

impl Recorded {
    /// How many rows.
    pub fn rows(&self) -> usize {
        self.time_s.len()
    }

    /// Some of the rows.
    pub fn rows_of(&self, rows: std::ops::Range<usize>) -> Self {
        let of = |values: &[f64]| values[rows.clone()].to_vec();
        Self {
            time_s: of(&self.time_s),
            runs: self.runs[rows.clone()].to_vec(),
            speed_rpm: of(&self.speed_rpm),
            temperature_c: self.temperature_c.iter().map(|sensor| of(sensor)).collect(),
            error_um: of(&self.error_um),
        }
    }

    /// The same with a row every second, in a straight line between rows a minute apart.
    pub fn every_second(&self) -> Self {
        let between = |values: &[f64]| {
            let pairs = values.windows(2);
            pairs
                .flat_map(|pair| (0..60).map(|s| pair[0] + (pair[1] - pair[0]) * f64::from(s) / 60.0))
                .collect::<Vec<f64>>()
        };
        let time_s = between(&self.time_s);
        Self {
            runs: vec![self.runs[0].clone(); time_s.len()],
            speed_rpm: between(&self.speed_rpm),
            temperature_c: self.temperature_c.iter().map(|sensor| between(sensor)).collect(),
            error_um: between(&self.error_um),
            time_s,
        }
    }

    /// The recording as CSV.
    pub fn csv(&self) -> String {
        let mut text = String::from("time_s,run,spindle_speed_rpm,thermal_error_um");
        (1..=self.temperature_c.len()).for_each(|n| text.push_str(&format!(",temperature_{n}_c")));
        text.push('\n');
        for row in 0..self.rows() {
            text.push_str(&format!("{:.1},{},{:.0},", self.time_s[row], self.runs[row], self.speed_rpm[row]));
            text.push_str(&format!("{:.4}", self.error_um[row]));
            self.temperature_c.iter().for_each(|sensor| text.push_str(&format!(",{:.4}", sensor[row])));
            text.push('\n');
        }
        text
    }

    /// Another error in place of the machine's: a constant and um/K on sensors (from 1), each late by `tau_s` unless that
    /// is zero, with slow noise of `slow_um` that forgets in twenty minutes and white noise.
    pub fn with_law(mut self, constant_um: f64, law: &[(usize, f64)], tau_s: f64, seed: u64, slow_um: f64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let mut states: Vec<f64> = law.iter().map(|(sensor, _)| self.temperature_c[sensor - 1][0]).collect();
        let mut slow = slow_um * normal();
        for row in 0..self.rows() {
            let dt_s = if row == 0 { 0.0 } else { self.time_s[row] - self.time_s[row - 1] };
            let mut error = constant_um;
            for ((sensor, um_per_k), state) in law.iter().zip(&mut states) {
                let now = self.temperature_c[sensor - 1][row];
                let before = if row == 0 { now } else { self.temperature_c[sensor - 1][row - 1] };
                *state = if tau_s > 0.0 { follow(*state, before, now, dt_s, tau_s) } else { now };
                error += um_per_k * *state;
            }
            let kept = (-dt_s / 1200.0).exp();
            slow = kept * slow + (1.0 - kept * kept).sqrt() * slow_um * normal();
            self.error_um[row] = error + slow + 0.2 * slow_um * normal();
        }
        self
    }
}

/// The state of `dw/dt = (T - w) / tau` by a thousand small steps along the straight line between two temperatures.
fn follow(state: f64, before: f64, now: f64, dt_s: f64, tau_s: f64) -> f64 {
    let pieces = 1000;
    (0..pieces).fold(state, |state, piece| {
        let input = before + (now - before) * (f64::from(piece) + 0.5) / f64::from(pieces);
        input + (state - input) * (-dt_s / f64::from(pieces) / tau_s).exp()
    })
}
