//! What happens on the bench, every 10 ms, with the truth beside it.

use super::Scenario;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rules::estimators::State;

/// Resolution of the course, s.
pub const STEP_S: f64 = 0.01;

/// The surge at the start of the spindle, W.
const SURGE_W: f64 = 3000.0;

/// Share of no-load power below which the surge counts as over.
const SETTLED: f64 = 0.02;

/// One instruction of the programme; durations in s.
#[derive(Debug, Clone, Copy)]
enum Step {
    Off(f64),
    Standby(f64),
    /// Start, or change, to this speed; as long as it takes.
    Speed(f64),
    /// Turning without feed.
    Dwell(f64),
    Rapid(f64),
    /// Feed without touching.
    Air(f64),
    /// Electrical power of the cut over no-load power.
    Cut(f64, f64),
    Stop,
}

/// The truth at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// What the machine does.
    pub state: State,
    /// Of the spindle.
    pub speed_rpm: f64,
    /// Of the axes.
    pub feed_mm_min: f64,
    /// Rapid traverse?
    pub rapid: bool,
    /// Electrical, of the spindle drive.
    pub spindle_power_w: f64,
    /// Electrical, of the whole machine.
    pub total_power_w: f64,
    /// What the spindle would take at this moment without a cut.
    pub no_load_power_w: f64,
    /// Voltage of the mains.
    pub supply_v: f64,
}

/// A programme that has run.
pub struct Course {
    /// One per [`STEP_S`].
    pub moments: Vec<Moment>,
    speed_rpm: f64,
    target_rpm: f64,
    started: bool,
    surge_w: f64,
    tau_s: f64,
    warm_up: f64,
    mains: Mains,
}

/// Mains of 400 V: a slow swing of 3 %, and 1 % whenever a large consumer of the neighbourhood switches.
struct Mains {
    exponent: Option<f64>,
    period_s: f64,
    phase: f64,
    consumer_s: f64,
}

impl Mains {
    /// Voltage over 400 V.
    fn at(&self, time_s: f64) -> f64 {
        if self.exponent.is_none() {
            return 1.0;
        }
        let slow = 0.03 * (std::f64::consts::TAU * time_s / self.period_s + self.phase).sin();
        let consumer = if (time_s / self.consumer_s) as i64 % 2 == 0 { 0.01 } else { -0.01 };
        1.0 + slow + consumer
    }
}

impl Course {
    /// Runs a programme drawn from `seed` for this scenario.
    pub fn run(scenario: &Scenario, seed: u64) -> Self {
        let mut dice = Pcg64Mcg::seed_from_u64(seed);
        let warm_up = dice.random_range(0.04..0.10);
        let programme = programme(scenario, &mut dice);
        let mains = Mains {
            exponent: scenario.supply_exponent,
            period_s: dice.random_range(60.0..240.0),
            phase: dice.random_range(0.0..std::f64::consts::TAU),
            consumer_s: dice.random_range(20.0..60.0),
        };
        let mut course = Self {
            moments: Vec::new(),
            speed_rpm: 0.0,
            target_rpm: 0.0,
            started: false,
            surge_w: 0.0,
            tau_s: scenario.tau_s,
            warm_up,
            mains,
        };
        for step in programme {
            course.step(step);
        }
        course
    }

    /// The truth at `time_s`.
    pub fn at(&self, time_s: f64) -> Option<&Moment> {
        self.moments.get((time_s / STEP_S).round().max(0.0) as usize)
    }

    /// Does the meter show the voltage of the mains?
    pub fn tells_voltage(&self) -> bool {
        self.mains.exponent.is_some()
    }

    /// Length, s.
    pub fn length_s(&self) -> f64 {
        self.moments.len() as f64 * STEP_S
    }

    fn step(&mut self, step: Step) {
        match step {
            Step::Off(s) => self.hold(s, |course| course.rest(State::Off, 0.3)),
            Step::Standby(s) => self.hold(s, |course| course.rest(State::Standby, 350.0)),
            Step::Speed(rpm) => self.change(rpm),
            Step::Dwell(s) => self.hold(s, |course| course.turn(0.0, false, 0.0)),
            Step::Rapid(s) => self.hold(s, |course| course.turn(6000.0, true, 0.0)),
            Step::Air(s) => self.hold(s, |course| course.turn(150.0, false, 0.0)),
            Step::Cut(s, share) => self.hold(s, |course| course.turn(150.0, false, share)),
            Step::Stop => {
                self.target_rpm = 0.0;
                self.surge_w = -200.0;
                while self.speed_rpm > 5.0 {
                    self.turn(0.0, false, 0.0);
                }
                self.speed_rpm = 0.0;
                self.started = false;
            }
        }
    }

    fn hold(&mut self, seconds: f64, mut tick: impl FnMut(&mut Self)) {
        (0..(seconds / STEP_S) as usize).for_each(|_| tick(self));
    }

    /// The controller waits for the speed, not for the power, as real ones do.
    fn change(&mut self, rpm: f64) {
        self.surge_w = SURGE_W * (rpm - self.target_rpm) / rpm.max(self.target_rpm);
        self.target_rpm = rpm;
        while (self.speed_rpm - rpm).abs() > 0.01 * rpm {
            self.turn(0.0, false, 0.0);
        }
    }

    fn mains_now(&self) -> f64 {
        self.mains.at(self.moments.len() as f64 * STEP_S)
    }

    fn no_load_w(&self) -> f64 {
        let n = self.speed_rpm.abs();
        let minutes = self.moments.len() as f64 * STEP_S / 60.0;
        let cold = 1.0 + self.warm_up * (-minutes / 3.0).exp();
        let mains = self.mains_now().powf(self.mains.exponent.unwrap_or(0.0));
        if n < 1.0 { 0.0 } else { (90.0 + 0.3 * n + 0.006 * n.powf(1.5)) * cold * mains }
    }

    fn rest(&mut self, state: State, total_power_w: f64) {
        self.moments.push(Moment {
            state,
            speed_rpm: 0.0,
            feed_mm_min: 0.0,
            rapid: false,
            spindle_power_w: 0.0,
            total_power_w,
            no_load_power_w: 0.0,
            supply_v: 400.0 * self.mains_now(),
        });
    }

    fn turn(&mut self, feed_mm_min: f64, rapid: bool, share: f64) {
        self.speed_rpm += (self.target_rpm - self.speed_rpm) * STEP_S / (self.tau_s / 4.0).min(0.4);
        self.surge_w *= (-STEP_S / self.tau_s).exp();
        let no_load_power_w = self.no_load_w();
        let settled = (self.speed_rpm - self.target_rpm).abs() <= 0.02 * self.target_rpm
            && self.surge_w.abs() <= SETTLED * no_load_power_w;
        self.started |= settled;
        let state = match (settled, share > 0.0, rapid) {
            (_, true, _) => State::Cutting,
            (false, ..) if !self.started => State::SpindleStart,
            (false, ..) => State::SpeedChange,
            (true, _, true) => State::Rapid,
            (true, _, false) => State::Idle,
        };
        let spindle_power_w = no_load_power_w * (1.0 + share) + self.surge_w;
        self.moments.push(Moment {
            state,
            speed_rpm: self.speed_rpm,
            feed_mm_min,
            rapid,
            spindle_power_w,
            total_power_w: 350.0 + spindle_power_w + if feed_mm_min > 0.0 { 80.0 } else { 0.0 },
            no_load_power_w,
            supply_v: 400.0 * self.mains_now(),
        });
    }
}

fn programme(scenario: &Scenario, dice: &mut Pcg64Mcg) -> Vec<Step> {
    let speeds = if scenario.speed_changes { vec![800.0, 1200.0, 600.0] } else { vec![800.0] };
    let mut steps = vec![Step::Off(dice.random_range(4.0..8.0)), Step::Standby(dice.random_range(4.0..8.0))];
    for part in 0..3 {
        for (k, speed) in speeds.iter().enumerate() {
            steps.push(Step::Speed(*speed));
            // The first start is followed by a warm-up; later ones by whatever the programme leaves.
            let pause = if part == 0 { 8.0 * scenario.tau_s + 8.0 } else { dice.random_range(0.5..4.0) };
            steps.push(Step::Dwell(pause));
            for _ in 0..if k == 0 { 3 } else { 2 } {
                steps.push(Step::Rapid(dice.random_range(0.8..2.0)));
                steps.push(Step::Air(dice.random_range(0.6..2.0)));
                steps.push(Step::Cut(dice.random_range(6.0..15.0), scenario.cut_share * dice.random_range(0.9..1.1)));
                steps.push(Step::Air(dice.random_range(0.3..1.0)));
                steps.push(Step::Rapid(dice.random_range(0.8..2.0)));
                steps.push(Step::Dwell(dice.random_range(0.2..3.0)));
            }
        }
        steps.push(Step::Stop);
        steps.push(Step::Standby(dice.random_range(5.0..12.0)));
    }
    steps.push(Step::Off(dice.random_range(3.0..6.0)));
    steps
}
