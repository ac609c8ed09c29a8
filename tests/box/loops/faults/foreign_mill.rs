//! A mill of another maker. Nothing of it comes from `adapters::simulated`: its laws, its program and its rows are its own.
//!
//! - no-load power: a standing part and windage with the square of the speed, a sixth more while the spindle is cold;
//! - losses under load: copper, with the square of the torque, and a share of the drive;
//! - the cut: shear with the area of the chip, and a force along the edges in the cut, which grows as they wear; the chip of a missing
//!   insert is cut by the next one, so that only the force along its edge is gone;
//! - the meter: a mean that is renewed twice a second, in steps of 10 W; rows come four times a second, unevenly.

use super::kinds::Breakable;
use adapters::words::{execution, mode};
use adapters::{ChannelId, Sample, Slot, Value};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Mean time from row to row, s, and how far one may be off.
pub(super) const ROW_S: f64 = 0.25;
const ROW_OFF_S: f64 = 0.03;
/// Specific work of shear, J/mm3, and force along the edge, N/mm; by how many times it grows per mm of flank wear.
const SHEAR_J_MM3: f64 = 1.7;
const EDGE_N_MM: f64 = 45.0;
const EDGE_BY_WEAR_PER_MM: f64 = 3.0;
/// Flank wear of each tool per part, mm.
const WEAR_MM: f64 = 0.0015;
/// No-load power: what stands, W, and what goes with the square of the speed, W at 1000 rpm.
const STANDING_W: f64 = 95.0;
const WINDAGE_W: f64 = 44.0;
const COLD_SHARE: f64 = 0.16;
const WARMS_S: f64 = 1500.0;
/// Losses under load.
const COPPER_W_PER_N2_M2: f64 = 0.5;
const DRIVE_SHARE: f64 = 0.03;
/// Run-up: time constant, s, and inertia, kg m2.
const RUNS_UP_S: f64 = 0.6;
const INERTIA_KG_M2: f64 = 0.04;
/// Entry and exit of a cut, s.
const ENTRY_S: f64 = 0.4;
/// Parts of a lot; the next one is of another hardness and another program.
const LOT_PARTS: u32 = 12;
const HARDNESS_SD: f64 = 0.04;
const RAPID_MM_MIN: f64 = 24_000.0;

/// A tool and its passes.
struct Cutter {
    name: &'static str,
    teeth: f64,
    diameter_mm: f64,
    speed_rpm: f64,
    feed_mm_min: f64,
    depth_mm: f64,
    width_mm: f64,
    pass_s: f64,
    passes: u32,
}

const CUTTERS: [Cutter; 3] = [
    Cutter {
        name: "FACE80",
        teeth: 4.0,
        diameter_mm: 80.0,
        speed_rpm: 900.0,
        feed_mm_min: 360.0,
        depth_mm: 2.0,
        width_mm: 60.0,
        pass_s: 24.0,
        passes: 2,
    },
    Cutter {
        name: "END20",
        teeth: 3.0,
        diameter_mm: 20.0,
        speed_rpm: 2400.0,
        feed_mm_min: 720.0,
        depth_mm: 8.0,
        width_mm: 6.0,
        pass_s: 9.0,
        passes: 4,
    },
    Cutter {
        name: "DRILL14",
        teeth: 2.0,
        diameter_mm: 14.0,
        speed_rpm: 1800.0,
        feed_mm_min: 288.0,
        depth_mm: 11.0,
        width_mm: 14.0,
        pass_s: 6.0,
        passes: 4,
    },
];

/// What the machine does for a while.
#[derive(Clone, Copy, PartialEq)]
enum Action {
    /// Nothing turns.
    Stand,
    /// The spindle turns.
    Turn,
    Rapid,
    /// It feeds through the air.
    Air,
    Cut,
}

#[derive(Clone, Copy)]
struct Step {
    action: Action,
    seconds: f64,
    cutter: usize,
    block: u32,
}

/// The machine, row by row.
pub(super) struct ForeignMill {
    dice: Pcg64Mcg,
    steps: Vec<Step>,
    at: usize,
    in_step_s: f64,
    pub(super) now_s: f64,
    pub(super) parts: u32,
    speed_rpm: f64,
    bearing_c: f64,
    hardness: f64,
    wear_mm: [f64; 3],
    inserts_lost: [f64; 3],
    cut_factor: f64,
    /// Energy since the meter was renewed, J and s, and what it shows: spindle and all, W.
    metered: (f64, f64),
    shown_w: [f64; 2],
}

impl Breakable for ForeignMill {
    fn change_cut(&mut self, factor: f64) {
        self.cut_factor = factor;
    }

    fn break_insert(&mut self, tool: u8) {
        self.inserts_lost[usize::from(tool) - 1] = 1.0;
    }

    fn change_edge(&mut self, tool: u8) {
        let at = usize::from(tool) - 1;
        (self.inserts_lost[at], self.wear_mm[at]) = (0.0, 0.0);
    }
}

impl ForeignMill {
    /// Switched on, with a warm-up program in front of the first part.
    pub(super) fn new(seed: u64) -> Self {
        let mut dice = Pcg64Mcg::seed_from_u64(77_000 + seed);
        let warm_up = (0..3).map(|cutter| Step { action: Action::Turn, seconds: 40.0, cutter, block: 900 });
        let wear_mm = [0.0; 3].map(|_: f64| dice.random_range(0.01..0.06));
        Self {
            steps: warm_up.collect(),
            at: 0,
            in_step_s: 0.0,
            now_s: 0.0,
            parts: 0,
            speed_rpm: 0.0,
            bearing_c: 20.0,
            hardness: 1.0,
            wear_mm,
            inserts_lost: [0.0; 3],
            cut_factor: 1.0,
            metered: (0.0, 0.0),
            shown_w: [0.0; 2],
            dice,
        }
    }

    fn normal(&mut self) -> f64 {
        self.dice.sample(StandardNormal)
    }

    fn step(&self) -> Step {
        self.steps[self.at]
    }

    /// The tool in the spindle, from 1.
    pub(super) fn tool(&self) -> u8 {
        u8::try_from(self.step().cutter + 1).expect("three tools")
    }

    /// How far the tool is in the work, as a share of its cut.
    pub(super) fn engaged(&self) -> f64 {
        let step = self.step();
        let from_ends_s = self.in_step_s.min(step.seconds - self.in_step_s).max(0.0);
        if step.action == Action::Cut { (from_ends_s / ENTRY_S).min(1.0) } else { 0.0 }
    }

    fn lot(&self) -> u32 {
        self.parts / LOT_PARTS
    }

    /// Goes on to the next row.
    pub(super) fn advance(&mut self) {
        let row_s = ROW_S + self.dice.random_range(-ROW_OFF_S..ROW_OFF_S);
        let slices = 5;
        for _ in 0..slices {
            self.advance_slice(row_s / f64::from(slices));
        }
    }

    fn advance_slice(&mut self, step_s: f64) {
        self.now_s += step_s;
        self.in_step_s += step_s;
        if self.in_step_s >= self.step().seconds {
            (self.in_step_s, self.at) = (0.0, self.at + 1);
        }
        if self.at == self.steps.len() {
            self.begin_part();
        }
        let spindle_w = self.spindle_w(step_s);
        let share = 1.0 + 0.03 * self.normal();
        let load = spindle_w / 2000.0 + (self.speed_rpm / 2400.0).powi(2);
        self.bearing_c += (20.0 + 9.0 * load - self.bearing_c) * step_s / WARMS_S;
        self.metered = (self.metered.0 + spindle_w * share * step_s, self.metered.1 + step_s);
        if self.metered.1 >= 0.5 {
            let mean_w = (self.metered.0 / self.metered.1).max(0.0);
            let rest_w = 640.0 + if self.has_coolant() { 870.0 } else { 0.0 } + 6.0 * self.normal();
            self.shown_w = [mean_w, mean_w + rest_w].map(|watts| (watts / 10.0).round() * 10.0);
            self.metered = (0.0, 0.0);
        }
    }

    /// Power into the drive of the spindle, which runs up to its speed meanwhile.
    fn spindle_w(&mut self, step_s: f64) -> f64 {
        let step = self.step();
        let cutter = &CUTTERS[step.cutter];
        let wanted_rpm = if step.action == Action::Stand { 0.0 } else { cutter.speed_rpm };
        let before = self.speed_rpm * TAU / 60.0;
        self.speed_rpm += (wanted_rpm - self.speed_rpm) * (1.0 - (-step_s / RUNS_UP_S).exp());
        let omega = self.speed_rpm * TAU / 60.0;
        let run_up_w = 0.5 * INERTIA_KG_M2 * (omega * omega - before * before) / step_s;
        let turns = self.speed_rpm / 1000.0;
        let cold = 1.0 + COLD_SHARE * (-self.now_s / WARMS_S).exp();
        let no_load_w = if self.speed_rpm > 5.0 { (STANDING_W + WINDAGE_W * turns * turns) * cold } else { 0.0 };
        let cut_w = self.engaged() * self.cut_w(step.cutter);
        let torque = cut_w / omega.max(1.0);
        // What braking gives back is burnt in a resistor.
        (no_load_w + run_up_w + cut_w * (1.0 + DRIVE_SHARE) + COPPER_W_PER_N2_M2 * torque * torque).max(0.0)
    }

    fn cut_w(&self, at: usize) -> f64 {
        let cutter = &CUTTERS[at];
        let shear_w = SHEAR_J_MM3 * cutter.depth_mm * cutter.width_mm * cutter.feed_mm_min / 60.0;
        let in_cut = (1.0 - 2.0 * cutter.width_mm / cutter.diameter_mm).acos() / TAU;
        let edges = (cutter.teeth - self.inserts_lost[at]) * in_cut;
        let speed_m_s = PI * cutter.diameter_mm * cutter.speed_rpm / 60_000.0;
        let edge_n = EDGE_N_MM * (1.0 + EDGE_BY_WEAR_PER_MM * self.wear_mm[at]);
        self.cut_factor * self.hardness * (shear_w + edge_n * cutter.depth_mm * edges * speed_m_s)
    }

    fn begin_part(&mut self) {
        let warmed_up = self.steps.first().is_some_and(|step| step.block != 900);
        self.parts += u32::from(warmed_up);
        if self.parts.is_multiple_of(LOT_PARTS) {
            self.hardness = 1.0 + HARDNESS_SD * self.normal();
        }
        if warmed_up {
            self.wear_mm.iter_mut().for_each(|wear| *wear += WEAR_MM);
        }
        self.steps = list_steps(self.lot());
        self.at = 0;
    }

    fn has_coolant(&self) -> bool {
        matches!(self.step().action, Action::Air | Action::Cut)
    }

    /// What control and meter say at this row.
    pub(super) fn fill(&mut self, sample: &mut Sample) {
        let step = self.step();
        let cutter = &CUTTERS[step.cutter];
        let turns = step.action != Action::Stand;
        let feeds = matches!(step.action, Action::Air | Action::Cut);
        let (feed, programmed) = match step.action {
            Action::Rapid => (RAPID_MM_MIN, cutter.feed_mm_min),
            _ if feeds => (cutter.feed_mm_min, cutter.feed_mm_min),
            _ => (0.0, 0.0),
        };
        let speed_rpm = (self.speed_rpm + self.normal()).max(0.0).round();
        let supply_v = 401.0 + 0.8 * self.normal();
        let bearing_c = self.bearing_c + 0.2 * self.normal();
        let flag = |on: bool| f64::from(u8::from(on));
        let numbers = [
            ("spindle_speed_rpm", if self.speed_rpm > 5.0 { speed_rpm } else { 0.0 }),
            ("spindle_programmed_rpm", if turns { cutter.speed_rpm } else { 0.0 }),
            ("feed_mm_min", feed),
            ("feed_programmed_mm_min", programmed),
            ("feed_override_pct", 100.0),
            ("rapid", flag(step.action == Action::Rapid)),
            ("coolant_on", flag(self.has_coolant())),
            ("part_count", f64::from(self.parts)),
            ("teeth", cutter.teeth),
            ("spindle_power_w", self.shown_w[0]),
            ("total_power_w", self.shown_w[1]),
            ("supply_voltage_v", supply_v),
            ("bearing_temperature_c", bearing_c),
        ];
        for (name, number) in numbers {
            set(sample, name, Value::Number(number));
        }
        let program = if step.block == 900 { "WARM".to_owned() } else { format!("P-10{}", self.lot() % 2) };
        let works = step.action != Action::Stand || step.block > 0;
        let texts = [
            ("program", program),
            ("block", format!("N{}", step.block)),
            ("tool", cutter.name.to_owned()),
            ("execution", if works { execution::ACTIVE } else { execution::READY }.to_owned()),
            ("mode", mode::AUTOMATIC.to_owned()),
        ];
        for (name, text) in texts {
            set(sample, name, Value::Text(Arc::from(text)));
        }
    }
}

fn set(sample: &mut Sample, name: &str, value: Value) {
    let id = ChannelId::from_name(name).expect("a channel");
    sample.set_slot(id, Slot { value: Ok(value), age_ns: 0 });
}

/// One part: loaded at rest, then every tool with its passes. Programs of odd lots have two passes more of the end mill.
fn list_steps(lot: u32) -> Vec<Step> {
    let mut steps = vec![Step { action: Action::Stand, seconds: 25.0, cutter: 2, block: 0 }];
    for (cutter, of) in CUTTERS.iter().enumerate() {
        let first = 100 * (u32::try_from(cutter).expect("three tools") + 1);
        let mut add = |action, seconds, block| steps.push(Step { action, seconds, cutter, block });
        add(Action::Stand, 4.0, first);
        add(Action::Turn, 5.0, first + 1);
        let more = if cutter == 1 { 2 * (lot % 2) } else { 0 };
        for pass in 0..of.passes + more {
            let block = first + 10 * (pass + 1);
            add(Action::Rapid, 1.0, block);
            add(Action::Air, 1.5, block + 1);
            add(Action::Cut, of.pass_s, block + 1);
            add(Action::Air, 0.8, block + 1);
        }
    }
    steps
}
