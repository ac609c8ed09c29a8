//! What the machine does with the program: jerk-limited spindle ramps, rapids, cuts, a facing pass that shrinks the
//! diameter, a door that opens between parts. Ten instants per second.

use crate::concealed::dice::Dice;
use crate::concealed::schedule::{Part, Pass, Plan};
use crate::concealed::tick::{STEP_S, Tick};

const RAPID_MM_MIN: f64 = 6000.0;

/// Every recorded instant of the day, in order.
pub(crate) fn ticks(plan: &Plan, dice: &mut Dice) -> Vec<Tick> {
    let mut machine = Machine::new(plan);
    for (run, part) in plan.parts.iter().enumerate() {
        machine.part(run, part);
    }
    let mut ticks = machine.ticks;
    surroundings(&mut ticks, plan.start_ambient_c, dice);
    ticks
}

struct Machine<'a> {
    plan: &'a Plan,
    ticks: Vec<Tick>,
    now: Tick,
    pass: usize,
}

impl<'a> Machine<'a> {
    fn new(plan: &'a Plan) -> Self {
        let now = Tick { supply_v: 400.0, position_mm: 180.0, ..Tick::default() };
        Self { plan, ticks: Vec::new(), now, pass: 0 }
    }

    fn push(&mut self) {
        self.now.gear_stage = if self.now.speed_rpm < self.plan.gear_rpm { 1 } else { 2 };
        self.ticks.push(self.now);
        self.now.t_s += STEP_S;
        self.now.gap_s = 0.0;
    }

    fn hold(&mut self, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as usize {
            self.push();
        }
    }

    fn part(&mut self, run: usize, part: &Part) {
        self.now.run = run;
        self.now.lot = part.lot;
        if run > 0 {
            self.now.gap_s = part.pause_s;
            self.now.t_s += part.pause_s;
        }
        if let Some(first) = part.passes.first() {
            self.prepare(first);
        }
        self.now.door_open = true;
        self.now.coolant = false;
        self.hold(part.door_s);
        self.now.door_open = false;
        for pass in &part.passes {
            self.pass(pass);
        }
        self.now.coolant = false;
        self.ramp(0.0);
        self.now.door_open = true;
        self.hold(part.door_s * 0.7);
    }

    fn pass(&mut self, pass: &Pass) {
        self.now.pass = self.pass;
        self.pass += 1;
        self.prepare(pass);
        self.ramp(pass.speed_rpm);
        self.now.coolant = pass.coolant;
        self.traverse(-RAPID_MM_MIN, 1.3);
        self.hold(pass.air_s);
        if pass.cut_s > 0.0 {
            self.cut(pass);
        }
        self.traverse(RAPID_MM_MIN, 1.3);
        self.hold(pass.air_s * 0.4);
    }

    /// The tool and the geometry of a pass, as the program states them before it begins.
    fn prepare(&mut self, pass: &Pass) {
        self.now.tool = pass.tool;
        self.now.operation = pass.operation;
        self.now.depth_mm = pass.depth_mm;
        self.now.width_mm = pass.width_mm;
        self.now.diameter_mm = pass.diameter_mm;
        self.now.teeth = pass.teeth;
        self.set_feed(pass, 1.0);
    }

    fn set_feed(&mut self, pass: &Pass, factor: f64) {
        self.now.programmed_mm_rev = pass.feed_mm_rev;
        self.now.commanded_mm_rev = pass.feed_mm_rev * factor;
        self.now.feed_mm_rev = self.now.commanded_mm_rev;
    }

    fn cut(&mut self, pass: &Pass) {
        self.now.engaged = true;
        let steps = (pass.cut_s / STEP_S).round() as usize;
        for step in 0..steps {
            let elapsed = step as f64 * STEP_S;
            self.now.since_entry_s = elapsed;
            self.now.until_exit_s = pass.cut_s - elapsed;
            self.now.progress = elapsed / pass.cut_s;
            self.now.diameter_mm = pass.diameter_mm + (pass.end_diameter_mm - pass.diameter_mm) * self.now.progress;
            if pass.override_to != 1.0 && elapsed >= pass.override_at_s {
                self.set_feed(pass, pass.override_to);
            }
            self.now.velocity_mm_min = -self.now.feed_mm_rev * self.now.speed_rpm;
            self.push();
            self.now.position_mm += self.now.velocity_mm_min / 60.0 * STEP_S;
        }
        self.now = Tick { engaged: false, since_entry_s: 0.0, until_exit_s: 0.0, progress: 0.0, ..self.now };
        self.now.velocity_mm_min = 0.0;
    }

    /// A rapid with ramps of 0.3 s; it ends where the next cut begins or at the clearance.
    fn traverse(&mut self, velocity_mm_min: f64, seconds: f64) {
        let steps = (seconds / STEP_S).round() as usize;
        for step in 0..steps {
            let from_end = step.min(steps - 1 - step) as f64;
            self.now.velocity_mm_min = velocity_mm_min * (from_end / 3.0).min(1.0);
            self.push();
            self.now.position_mm += self.now.velocity_mm_min / 60.0 * STEP_S;
        }
        self.now.velocity_mm_min = 0.0;
        self.now.position_mm = if velocity_mm_min < 0.0 { 100.0 } else { 180.0 };
    }

    /// Spindle speed change with limited jerk: the acceleration rises and falls like 30 u2 (1-u)2.
    fn ramp(&mut self, target_rpm: f64) {
        let (from, change) = (self.now.speed_rpm, target_rpm - self.now.speed_rpm);
        if change.abs() < 0.5 {
            return;
        }
        let seconds = (change.abs() / self.plan.ramp_rpm_s).max(0.6);
        let steps = (seconds / STEP_S).ceil() as usize;
        for step in 1..=steps {
            let u = step as f64 / steps as f64;
            let bell = 30.0 * u * u * (1.0 - u) * (1.0 - u);
            self.now.speed_rpm = from + change * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            self.now.acceleration_rpm_s = change * bell / (steps as f64 * STEP_S);
            self.push();
        }
        self.now.acceleration_rpm_s = 0.0;
    }
}

/// Hall temperature and mains voltage: slow, and no business of the machine.
fn surroundings(ticks: &mut [Tick], start_c: f64, dice: &mut Dice) {
    let (mut warm, mut volt, mut sag) = (0.0_f64, dice.normal(), 0.0_f64);
    let trend = dice.uniform(0.5, 3.0) / 3600.0;
    for tick in ticks {
        let dt = tick.elapsed_s();
        warm += trend * dt + 0.004 * dt.sqrt() * dice.normal();
        let keep = (-dt / 240.0).exp();
        volt = keep * volt + (1.0 - keep * keep).sqrt() * dice.normal();
        let keep = (-dt / 25.0).exp();
        sag = keep * sag + (1.0 - keep * keep).sqrt() * dice.normal();
        tick.ambient_c = start_c + warm;
        tick.supply_v = 400.0 * (1.0 + 0.022 * volt + 0.006 * sag);
    }
}
