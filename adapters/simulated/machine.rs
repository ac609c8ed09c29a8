//! The simulated machine as a whole: one step after the other from its origin, whatever is asked of it and when.

use super::cutting::{self, Circumstances, Load};
use super::frame::MachineSnapshot;
use super::ladder::{Ladder, LadderCounts, LadderInput};
use super::moment::{Electric, Integrals, Moment, Panel, TrueState, Truth};
use super::plant::{Plant, Spin};
use super::program::{Control, Cut, ExperimentStep, Motion, Planner};
use super::settings::{CutLevel, LaterChange, LostInsert, SimulatedSettings};
use crate::address::SimulatedMachine;
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::integer::{clamp_count, convert_bounded, length_to_i64};
use adapter_core::offset::Axis;
use adapter_core::override_pct::OverridePct;
use adapter_core::words::{execution, mode};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// One step of the physics.
const STEP_NS: i64 = 5_000_000;
const STEP_S: f64 = 0.005;

/// Heat and supply move on every so many steps.
const DRIFT_STEPS: i64 = 20;

/// So many steps are remembered: four seconds.
const REMEMBERED: usize = 800;

pub(super) struct Machine {
    settings: SimulatedSettings,
    snapshot: &'static MachineSnapshot,
    origin_ns: TimeNs,
    /// Steps made so far; the newest moment is that of step `steps - 1`.
    steps: i64,
    moments: VecDeque<Moment>,
    plant: Plant,
    control: Control,
    ladder: Ladder,
    /// External work offsets of X, Y, Z, um; locked by the operator.
    offsets_um: [f64; 3],
    offsets_protected: bool,
    cut: Cut,
    /// The edge that has lost an insert, by its number.
    broken_edge: Option<u16>,
    diameter_mm: f64,
    engaged: f64,
    load: Load,
    spindle_w: f64,
    total_w: f64,
    current_a: f64,
    integrals: Integrals,
}

impl Machine {
    /// A machine at work, or on an experiment in place of its day.
    pub(super) fn new(settings: SimulatedSettings, origin_ns: TimeNs, experiment: Option<&[ExperimentStep]>) -> Self {
        let frame = MachineSnapshot::from_machine(settings.machine);
        let rng = |stream: u64| Pcg64Mcg::seed_from_u64(settings.seed.wrapping_mul(31).wrapping_add(stream));
        let planner = Planner::new(settings, rng(1));
        let planner = match experiment {
            Some(steps) => planner.of_experiment(steps.to_vec()),
            None => planner,
        };
        let mut machine = Self {
            settings,
            snapshot: frame,
            origin_ns,
            steps: 0,
            moments: VecDeque::with_capacity(REMEMBERED),
            plant: Plant::new(frame, settings.tau_s, settings.start_peak_w, rng(2)),
            control: Control::new(planner, rng(3), frame, settings.wear_mm),
            ladder: Ladder::new(settings.ladder),
            offsets_um: [0.0; 3],
            offsets_protected: false,
            cut: Cut::default(),
            broken_edge: None,
            diameter_mm: 0.0,
            engaged: 0.0,
            load: Load::default(),
            spindle_w: 0.0,
            total_w: 0.0,
            current_a: 0.0,
            integrals: Integrals::default(),
        };
        machine.run_step();
        machine
    }

    /// The ladder takes a letter at `at_ns`, or at once when the machine is already further.
    pub(super) fn post_letter(&mut self, at_ns: TimeNs, letter: LadderInput) {
        self.ladder.post_letter(at_ns, letter);
    }

    pub(super) fn offset_um(&self, axis: Axis) -> f64 {
        self.offsets_um[axis.index()]
    }

    /// The operator sets an offset.
    pub(super) fn set_offset(&mut self, axis: Axis, offset_um: f64) {
        self.offsets_um[axis.index()] = offset_um;
    }

    pub(super) fn protect_offsets(&mut self, protected: bool) {
        self.offsets_protected = protected;
    }

    /// The gateway writes an offset.
    pub(super) fn write_offset(&mut self, axis: Axis, offset_um: f64) {
        self.ladder.count_offset();
        if !self.offsets_protected {
            self.set_offset(axis, offset_um);
        }
    }

    pub(super) fn change_now(&mut self, cut: f64, friction: f64) {
        self.settings.change = LaterChange { after_s: 0.0, cut, friction };
    }

    pub(super) fn break_insert(&mut self, tool: u8) {
        self.settings.lost_insert = LostInsert { after_s: 0.0, tool };
        self.broken_edge = None;
    }

    pub(super) fn change_edge(&mut self, tool: u8) {
        self.control.fresh_edge(usize::from(tool));
    }

    pub(super) fn ladder_counts(&self) -> LadderCounts {
        self.ladder.counts()
    }

    fn time_of(&self, step: i64) -> TimeNs {
        self.origin_ns + step * STEP_NS
    }

    /// Makes every step up to and including the one after `at_ns`.
    fn advance_beyond(&mut self, at_ns: TimeNs) {
        while self.time_of(self.steps - 1) <= at_ns {
            self.run_step();
        }
    }

    /// The machine at `at_ns`. Before its origin it is as at its origin; more than four seconds before the furthest
    /// time ever asked for it is as then.
    pub(super) fn compute_moment(&mut self, at_ns: TimeNs) -> Moment {
        self.advance_beyond(at_ns);
        let step = (at_ns - self.origin_ns).max(0) / STEP_NS;
        self.remembered_step(step)
    }

    fn remembered_step(&self, step: i64) -> Moment {
        let first = self.steps - length_to_i64(self.moments.len());
        let index = clamp_count(step - first, self.moments.len() - 1);
        self.moments[index]
    }

    /// The running integrals at exactly `at_ns`.
    pub(super) fn integrals_at(&mut self, at_ns: TimeNs) -> Integrals {
        self.advance_beyond(at_ns);
        let since_ns = (at_ns - self.origin_ns).max(0);
        let (step, rest_ns) = (since_ns / STEP_NS, since_ns % STEP_NS);
        let (a, b) = (self.remembered_step(step).integrals, self.remembered_step(step + 1).integrals);
        let share = f64::from(convert_bounded(rest_ns, i32::MAX)) / (STEP_S * 1e9);
        let mix = |a: f64, b: f64| a + (b - a) * share;
        Integrals {
            spindle_j: mix(a.spindle_j, b.spindle_j),
            total_j: mix(a.total_j, b.total_j),
            current_squared_a2s: mix(a.current_squared_a2s, b.current_squared_a2s),
            mains_rad: mix(a.mains_rad, b.mains_rad),
        }
    }

    fn run_step(&mut self) {
        let at_ns = self.time_of(self.steps);
        self.ladder.run_scan(at_ns);
        let since_s = to_seconds(at_ns - self.origin_ns);
        self.control.hold_asked = self.ladder.is_holding_feed(at_ns);
        self.control.stop_asked = self.ladder.stop_asked();
        self.control.run_step(&self.plant, self.ladder.in_force().percent(), since_s, STEP_S);
        if let Some(stood_s) = self.control.stood_s {
            self.control.attended = self.ladder.acknowledge_stop(stood_s);
        }
        if let Some(dial) = self.control.dial_request.take().and_then(OverridePct::new) {
            self.ladder.turn_dial(dial);
        }
        if since_s >= self.settings.change.after_s {
            self.plant.friction = self.settings.change.friction;
        }
        if since_s >= self.settings.lost_insert.after_s && self.broken_edge.is_none() {
            self.broken_edge = self.control.edges.get(usize::from(self.settings.lost_insert.tool)).copied();
        }
        self.plant.advance_spindle(&self.control.demand, STEP_S);
        self.update_engagement(since_s);
        self.update_power(since_s);
        if self.steps % DRIFT_STEPS == 0 {
            let dt_s = STEP_S * 20.0;
            self.plant.advance_drift(dt_s, since_s, self.spindle_w, self.total_w, self.load.load_loss_w);
        }
        self.record_moment(at_ns);
        self.steps += 1;
    }

    /// The tool enters and leaves the work within about a turn of the spindle.
    fn update_engagement(&mut self, since_s: f64) {
        let contact = self.control.find_contact();
        if let Some((cut, share)) = contact {
            self.cut = cut;
            self.diameter_mm = cut.diameter_from_mm + (cut.diameter_to_mm - cut.diameter_from_mm) * share;
        }
        let turn_s = 60.0 / self.plant.speed_rpm.abs().max(30.0);
        let towards = if contact.is_some() { 1.0 } else { 0.0 };
        self.engaged += (towards - self.engaged) * (1.0 - (-STEP_S / (0.4 * turn_s)).exp());
        if towards == 0.0 && self.engaged < 0.01 {
            self.engaged = 0.0;
        }
        let now = self.collect_circumstances();
        let stage = self.snapshot.stage(self.control.demand.gear_stage);
        self.load = cutting::compute_load(self.snapshot, stage, &self.cut, &now, self.cut_level(since_s));
        let lathe = self.settings.machine == SimulatedMachine::Lathe;
        let tool = self.control.tool_index();
        self.control.wear_mm[tool] += STEP_S * self.settings.day.wear_factor * cutting::wear_rate_mm_s(lathe, &now);
    }

    fn cut_level(&self, since_s: f64) -> CutLevel {
        let factor = if since_s >= self.settings.change.after_s { self.settings.change.cut } else { 1.0 };
        match self.settings.cut {
            CutLevel::Planned(planned) => CutLevel::Planned(planned * factor),
            CutLevel::OfNoLoad(share) => CutLevel::OfNoLoad(share * factor),
        }
    }

    fn collect_circumstances(&self) -> Circumstances {
        Circumstances {
            speed_rad_s: self.plant.speed_rpm.abs() * TAU / 60.0,
            feed_mm_min: if self.control.holding { 0.0 } else { self.cutting_feed() },
            diameter_mm: self.diameter_mm,
            engaged: self.engaged,
            wear_mm: self.control.wear_mm[self.control.tool_index()],
            hardness: self.control.hardness * (1.0 + 0.02 * self.plant.cut_unrest),
            no_load_w: self.plant.no_load_w,
            insert_lost: self.has_lost_insert(),
        }
    }

    /// Has the edge in use lost an insert?
    fn has_lost_insert(&self) -> bool {
        self.control.tool == self.settings.lost_insert.tool
            && self.broken_edge == Some(self.control.edges[self.control.tool_index()])
    }

    fn cutting_feed(&self) -> f64 {
        if matches!(self.control.motion, Motion::Feed { .. }) { self.control.feed_mm_min } else { 0.0 }
    }

    fn update_power(&mut self, since_s: f64) {
        let demand = self.control.demand;
        let running = demand.powered && demand.drives_on;
        let spindle_w =
            self.plant.no_load_w + self.plant.transient_w() + self.load.cutting_power_w + self.load.load_loss_w;
        self.spindle_w = if running { spindle_w } else { 0.0 };
        self.total_w = self.plant.auxiliary_w(&demand, since_s) + self.spindle_w;
        self.current_a = self.plant.current_a(self.spindle_w, running);
        self.integrals.spindle_j += self.spindle_w * STEP_S;
        self.integrals.total_j += self.total_w * STEP_S;
        self.integrals.current_squared_a2s += self.current_a * self.current_a * STEP_S;
        self.integrals.mains_rad += TAU * self.plant.mains_hz * STEP_S;
    }

    fn record_moment(&mut self, at_ns: TimeNs) {
        if self.moments.len() >= REMEMBERED {
            self.moments.pop_front();
        }
        let moment = Moment {
            panel: self.build_panel(),
            electric: self.build_electric(),
            truth: self.build_truth(at_ns),
            integrals: self.integrals,
        };
        self.moments.push_back(moment);
    }

    fn classify_state(&self) -> TrueState {
        match self.plant.spin {
            _ if !self.control.demand.powered => TrueState::Off,
            _ if self.load.cutting_power_w > 0.0 && self.engaged > 0.1 => TrueState::Cutting,
            Spin::Still => TrueState::Standby,
            Spin::Starting => TrueState::SpindleStart,
            Spin::Changing => TrueState::SpeedChange,
            Spin::Steady if self.control.motion == Motion::Rapid => TrueState::Rapid,
            Spin::Steady => TrueState::Idle,
        }
    }

    fn build_truth(&self, at_ns: TimeNs) -> Truth {
        Truth {
            at_ns,
            state: self.classify_state(),
            spindle_speed_rpm: self.plant.speed_rpm,
            spindle_power_w: self.spindle_w,
            total_power_w: self.total_w,
            no_load_power_w: self.plant.no_load_w,
            cutting_power_w: self.load.cutting_power_w,
            load_loss_w: self.load.load_loss_w,
            transient_power_w: self.plant.transient_w(),
            engaged: self.engaged,
            flank_wear_mm: self.control.wear_mm[self.control.tool_index()],
            cutting_force_n: self.load.force_n,
            thermal_error_um: self.plant.thermal_error_um(),
            hardness: self.control.hardness,
        }
    }

    fn build_electric(&self) -> Electric {
        Electric {
            supply_voltage_v: self.plant.supply_v,
            spindle_current_a: self.current_a,
            bearing_temperature_c: self.plant.bearing_c,
            motor_temperature_c: self.plant.motor_c,
            ambient_temperature_c: self.plant.ambient_c,
            spindle_load_pct: self.plant.load_display_pct(),
        }
    }

    fn build_panel(&self) -> Panel {
        let control = &self.control;
        let block = control.block.as_ref();
        let (cut, locked, programmed) = match control.motion {
            Motion::Feed { cut, locked, programmed_mm_min } => (cut, locked, programmed_mm_min),
            Motion::Rapid | Motion::None => (None, false, 0.0),
        };
        let execution = if control.holding {
            execution::FEED_HOLD
        } else {
            block.map_or(execution::READY, |block| block.execution)
        };
        Panel {
            booted: control.has_booted(),
            drives_on: control.demand.drives_on,
            mode: block.map_or(mode::MANUAL, |block| block.mode),
            execution,
            program: block.map_or(0, |block| block.program),
            block: block.map_or(0, |block| block.number),
            operation: block.map_or("", |block| block.operation),
            tool: control.tool,
            edge: control.edges[control.tool_index()],
            part_count: control.part_count,
            alarm: control.alarm,
            spindle_programmed_rpm: control.demand.spindle_rpm,
            spindle_speed_rpm: self.plant.speed_rpm,
            feed_programmed_mm_min: programmed,
            feed_mm_min: control.feed_mm_min,
            feed_override_pct: self.ladder.in_force().percent(),
            dial_pct: self.ladder.dial().percent(),
            rapid: control.motion == Motion::Rapid,
            override_locked: locked,
            gear_stage: control.demand.gear_stage,
            coolant_on: control.demand.coolant_on,
            hydraulics_on: control.demand.hydraulics_on,
            position_mm: control.position_mm,
            velocity_mm_min: control.velocity_mm_min,
            depth_of_cut_mm: cut.map_or(0.0, |cut| cut.depth_mm),
            width_of_cut_mm: cut.map_or(0.0, |cut| cut.width_mm),
            diameter_mm: self.planned_diameter(cut),
            teeth: cut.map_or(0.0, |cut| cut.teeth),
        }
    }

    /// What the program says, which follows the tool also before it meets the work.
    fn planned_diameter(&self, cut: Option<Cut>) -> f64 {
        match cut {
            Some(_) if self.engaged > 0.0 => self.diameter_mm,
            Some(cut) => cut.diameter_from_mm,
            None => self.diameter_mm,
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "a double counts nanoseconds exactly for 104 days")]
fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}
