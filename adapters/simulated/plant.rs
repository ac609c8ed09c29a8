//! The physics between a demanded speed and what meters see: spindle dynamics, losses, heat, supply.

use super::frame::MachineSnapshot;
use rand::Rng;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// What the control asks of the spindle and the auxiliaries.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Demand {
    pub(super) powered: bool,
    pub(super) drives_on: bool,
    pub(super) hydraulics_on: bool,
    pub(super) coolant_on: bool,
    /// Signed.
    pub(super) spindle_rpm: f64,
    pub(super) gear_stage: u8,
    /// Path velocity of the axes.
    pub(super) axis_mm_min: f64,
}

/// Why the spindle is not at a steady speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Spin {
    Still,
    Starting,
    Changing,
    Steady,
}

/// State of the physics.
#[derive(Debug, Clone)]
pub(super) struct Plant {
    snapshot: &'static MachineSnapshot,
    tau_s: f64,
    start_peak_w: f64,
    rng: Pcg64Mcg,
    pub(super) speed_rpm: f64,
    target_rpm: f64,
    pub(super) spin: Spin,
    /// Excess power of a start, decaying.
    excess_w: f64,
    acceleration_w: f64,
    pub(super) no_load_w: f64,
    /// Dry and viscous friction against that of the frame.
    pub(super) friction: f64,
    pub(super) bearing_c: f64,
    housing_c: f64,
    pub(super) motor_c: f64,
    pub(super) ambient_c: f64,
    /// Slow fluctuation of the supply, of its frequency and of the cut, each of unit variance.
    supply_unrest: f64,
    frequency_unrest: f64,
    pub(super) cut_unrest: f64,
    pub(super) supply_v: f64,
    pub(super) mains_hz: f64,
    load_display_w: f64,
}

impl Plant {
    pub(super) fn new(frame: &'static MachineSnapshot, tau_s: f64, start_peak_w: f64, rng: Pcg64Mcg) -> Self {
        Self {
            snapshot: frame,
            tau_s,
            start_peak_w,
            rng,
            speed_rpm: 0.0,
            target_rpm: 0.0,
            spin: Spin::Still,
            excess_w: 0.0,
            acceleration_w: 0.0,
            no_load_w: 0.0,
            friction: 1.0,
            bearing_c: 20.0,
            housing_c: 20.0,
            motor_c: 20.0,
            ambient_c: 20.0,
            supply_unrest: 0.0,
            frequency_unrest: 0.0,
            cut_unrest: 0.0,
            supply_v: 400.0,
            mains_hz: 50.0,
            load_display_w: 0.0,
        }
    }

    /// Moves the spindle on by `dt_s`.
    pub(super) fn advance_spindle(&mut self, demand: &Demand, dt_s: f64) {
        let wanted_rpm = if demand.powered { demand.spindle_rpm } else { 0.0 };
        if (wanted_rpm - self.target_rpm).abs() > 0.5 {
            self.new_target(wanted_rpm);
        }
        let before = self.speed_rpm;
        self.speed_rpm += self.speed_step(dt_s);
        self.acceleration_w = self.acceleration_power(before, dt_s);
        self.excess_w *= (-dt_s / self.tau_s).exp();
        self.no_load_w = self.no_load(demand.gear_stage);
        self.update_spin_state();
    }

    fn new_target(&mut self, wanted_rpm: f64) {
        let from_rest = self.speed_rpm.abs() < 5.0;
        self.spin = if from_rest && wanted_rpm.abs() > 0.0 { Spin::Starting } else { Spin::Changing };
        let faster = wanted_rpm.abs() > self.speed_rpm.abs();
        self.excess_w = match self.spin {
            Spin::Starting => self.start_peak_w,
            _ if faster => 0.3 * self.start_peak_w * (1.0 - self.speed_rpm.abs() / wanted_rpm.abs().max(1.0)),
            _ => 0.0,
        };
        self.target_rpm = wanted_rpm;
    }

    /// First order towards the target, limited by the power of the drive.
    fn speed_step(&self, dt_s: f64) -> f64 {
        let free = (self.target_rpm - self.speed_rpm) * (1.0 - (-dt_s / (0.6 * self.tau_s)).exp());
        let rad_s = (self.speed_rpm.abs() * TAU / 60.0).max(10.0);
        let limit = self.snapshot.acceleration_limit_w / (self.snapshot.inertia_kg_m2 * rad_s) * dt_s * 60.0 / TAU;
        free.clamp(-limit, limit)
    }

    /// `J w dw/dt`; braking returns seven tenths to the supply.
    fn acceleration_power(&self, before_rpm: f64, dt_s: f64) -> f64 {
        let (w0, w1) = (before_rpm * TAU / 60.0, self.speed_rpm * TAU / 60.0);
        let power = self.snapshot.inertia_kg_m2 * (w1 * w1 - w0 * w0) / (2.0 * dt_s);
        if power < 0.0 { 0.7 * power } else { power }
    }

    fn update_spin_state(&mut self) {
        let off = (self.speed_rpm - self.target_rpm).abs();
        if self.target_rpm == 0.0 {
            if self.speed_rpm.abs() < 2.0 {
                (self.speed_rpm, self.spin) = (0.0, Spin::Still);
            }
        } else if off < 0.01 * self.target_rpm.abs() && self.transient_w().abs() < 0.04 * self.no_load_w {
            self.spin = Spin::Steady;
        }
    }

    /// Within 2 % of the commanded speed: the signal the program waits for.
    pub(super) fn at_speed(&self) -> bool {
        (self.speed_rpm - self.target_rpm).abs() <= 0.02 * self.target_rpm.abs() + 1.0
    }

    /// Settled no-load power at the present speed, stage and temperature.
    fn no_load(&self, gear_stage: u8) -> f64 {
        let w = self.speed_rpm.abs() * TAU / 60.0;
        if w < 0.2 {
            return 0.0;
        }
        let stage = self.snapshot.stage(gear_stage);
        let viscosity = (-0.012 * (self.bearing_c - 40.0)).exp();
        let field_w = stage.field_w * (self.supply_v / 400.0).powi(2);
        let friction_w = stage.dry_nm * w + stage.viscous * w.powf(1.6) * viscosity;
        field_w + self.friction * friction_w + stage.windage * w.powf(2.8)
    }

    /// Power that accelerates, and the excess of a start.
    pub(super) fn transient_w(&self) -> f64 {
        if self.speed_rpm == 0.0 { 0.0 } else { self.acceleration_w + self.excess_w }
    }

    /// Everything but the spindle.
    pub(super) fn auxiliary_w(&self, demand: &Demand, since_s: f64) -> f64 {
        if !demand.powered {
            return 0.0;
        }
        let on = |on: bool, power_w: f64| if on { power_w } else { 0.0 };
        // The accumulator of the hydraulics is charged for 6 s in every 41 s.
        let charging = if since_s % 41.0 < 6.0 { 1.9 } else { 1.0 };
        let axes_w = on(demand.drives_on, 0.055 * demand.axis_mm_min);
        self.snapshot.control_w
            + on(demand.drives_on, self.snapshot.drives_w)
            + on(demand.hydraulics_on, self.snapshot.hydraulics_w * charging)
            + on(demand.coolant_on, self.snapshot.coolant_w)
            + axes_w
    }

    /// Heat and supply, for which `dt_s` may be a tenth of a second.
    pub(super) fn advance_drift(&mut self, dt_s: f64, since_s: f64, spindle_w: f64, total_w: f64, load_loss_w: f64) {
        let day = TAU * since_s / 86_400.0;
        self.ambient_c = 20.5 - 2.5 * (day + 0.9).cos() + 0.4 * (day * 7.3).sin();
        let friction_w = 0.55 * self.no_load_w;
        approach_target(&mut self.bearing_c, self.housing_c + 0.042 * friction_w, dt_s, 420.0);
        approach_target(&mut self.housing_c, self.ambient_c + 0.021 * friction_w + 0.01 * load_loss_w, dt_s, 4200.0);
        let motor_w = 0.2 * spindle_w.abs() + load_loss_w;
        approach_target(&mut self.motor_c, self.ambient_c + 0.07 * motor_w, dt_s, 900.0);
        self.advance_noise(dt_s);
        self.supply_v = 400.0 + 2.6 * self.supply_unrest - 0.45e-3 * total_w;
        self.mains_hz = 50.0 + 0.015 * self.frequency_unrest;
        approach_target(&mut self.load_display_w, spindle_w, dt_s, 0.3);
    }

    /// Ornstein-Uhlenbeck processes of unit variance.
    fn advance_noise(&mut self, dt_s: f64) {
        for (state, tau_s) in
            [(&mut self.supply_unrest, 45.0), (&mut self.frequency_unrest, 90.0), (&mut self.cut_unrest, 0.35)]
        {
            let keep = (-dt_s / tau_s).exp();
            let kick: f64 = self.rng.sample(StandardNormal);
            *state = *state * keep + kick * (1.0 - keep * keep).sqrt();
        }
    }

    /// Load display of the drive in percent of its rated power; like a real one it stops at a full scale.
    pub(super) fn load_display_pct(&self) -> f64 {
        (100.0 * self.load_display_w / self.snapshot.rated_w).clamp(-LOAD_DISPLAY_MAX_PCT, LOAD_DISPLAY_MAX_PCT)
    }

    /// Magnetising current and the current that makes torque, at right angles.
    pub(super) fn current_a(&self, spindle_w: f64, drives_on: bool) -> f64 {
        if !drives_on || (self.speed_rpm == 0.0 && spindle_w == 0.0) {
            return 0.0;
        }
        let active_a = spindle_w / (3_f64.sqrt() * self.supply_v * 0.92);
        self.snapshot.magnetising_a.hypot(active_a)
    }

    /// Growth of the spindle nose towards the work, and bending of the bed.
    pub(super) fn thermal_error_um(&self) -> f64 {
        0.85 * (self.bearing_c - 20.0) + 1.9 * (self.housing_c - 20.0) - 0.6 * (self.ambient_c - 20.0)
    }
}

/// Full scale of the load display.
const LOAD_DISPLAY_MAX_PCT: f64 = 300.0;

fn approach_target(state: &mut f64, towards: f64, dt_s: f64, tau_s: f64) {
    *state += (towards - *state) * (1.0 - (-dt_s / tau_s).exp());
}
