//! The spindle and its motor: friction, windage, inertia, warm-up, stages and losses.

use crate::evidence::inputs::RecordingInputs;
use crate::evidence::variant_bank::{Family, VariantBank};
use physics::OutputKind;

const SPEED: &[&str] = &["spindle_speed_rpm"];
const SPEED_AND_TORQUE: &[&str] = &["spindle_speed_rpm", "torque"];

const WINDAGE: Family = Family::from_kind("windage").with_sign(1.0).with_channels(SPEED);
const VISCOUS: Family = Family::from_kind("viscous_friction").with_sign(1.0);
const DRY: Family = Family::from_kind("dry_friction").with_sign(1.0);
const IRON: Family = Family::from_kind("iron_loss").with_sign(1.0).with_channels(SPEED).with_rarity(-1.0);
const STRIBECK: Family = Family::from_kind("stribeck").with_catalogue_forms().with_sign(1.0).with_channels(SPEED);
const INERTIA: Family = Family::from_kind("spindle_inertia").with_sign(1.0).with_edge_action();
const REGENERATION: Family = Family::from_kind("regeneration").with_catalogue_forms().with_rarity(-0.7);
const WARM_UP: Family = Family::from_kind("bearing_warm_up").with_sign(1.0).with_channels(&["bearing_temperature_c"]);
const PRELOAD: Family = Family::from_kind("preload_growth").with_catalogue_forms().with_sign(1.0);
const GEAR: Family = Family::from_kind("gear_stage").with_channels(SPEED).without_widening();
const FIELD: Family = Family::from_kind("field_weakening").with_sign(1.0).with_channels(SPEED_AND_TORQUE);
const COPPER: Family = Family::from_kind("copper_loss").with_sign(1.0).with_channels(&["torque"]);
const INVERTER: Family = Family::from_kind("inverter_loss").with_sign(1.0).with_channels(&["torque"]);

/// Time constants of a bearing, s.
const WARMING_S: [f64; 4] = [240.0, 600.0, 1200.0, 2400.0];
/// Speeds from which a field may weaken, rpm.
const BASE_SPEEDS: [f64; 6] = [750.0, 1100.0, 1500.0, 2000.0, 3000.0, 4500.0];
/// Stages that are tried at most.
const STAGES_MAX: usize = 40;

struct Spindle<'a> {
    inputs: &'a RecordingInputs<'a>,
    rpm: &'a [f64],
    /// Share of the greatest speed.
    pace: Vec<f64>,
    top_rpm: f64,
    /// Is the output a torque, current or load, in which a power appears divided by the speed?
    is_torque: bool,
}

/// The families of an output that the spindle drives.
pub(super) fn add_variants(inputs: &RecordingInputs<'_>, bank: &mut VariantBank) {
    let Some(rpm) = &inputs.speed else { return };
    if inputs.is_axis || inputs.kind == OutputKind::Displacement {
        return;
    }
    let top_rpm = rpm.iter().fold(1.0_f64, |top, n| top.max(*n));
    let pace = rpm.iter().map(|n| n / top_rpm).collect();
    let spindle = Spindle { inputs, rpm, pace, top_rpm, is_torque: inputs.kind == OutputKind::Force };
    spindle.add_friction(bank);
    spindle.add_inertia(bank);
    spindle.add_warm_up(bank);
    spindle.add_gear_stages(bank);
    spindle.add_motor_losses(bank);
}

impl Spindle<'_> {
    /// A power of this size in the output's own kind.
    fn convert_to_output(&self, power: impl Fn(usize) -> f64) -> Vec<f64> {
        let law = |row: usize| match (self.is_torque, self.pace[row] > 1e-3) {
            (false, _) => power(row),
            (true, true) => power(row) / self.pace[row].max(0.02),
            (true, false) => 0.0,
        };
        self.inputs.build_column(law)
    }

    fn add_friction(&self, bank: &mut VariantBank) {
        let power = |exponent: f64| self.convert_to_output(|row| self.pace[row].powf(exponent));
        for exponent in [2.6, 2.8, 3.0] {
            bank.begin_variant(WINDAGE, exponent).add_column(self.inputs, power(exponent));
        }
        bank.begin_variant(VISCOUS, 2).add_column(self.inputs, power(2.0));
        bank.begin_variant(DRY, 1).add_column(self.inputs, power(1.0));
        for exponent in [1.0, 1.3, 2.0] {
            let law = |row: usize| if self.is_torque { self.pace[row] } else { self.pace[row].powf(exponent) };
            bank.begin_variant(IRON, exponent).add_column(self.inputs, self.inputs.build_column(law));
        }
        for width in [50.0, 100.0, 180.0, 300.0] {
            let law = self.convert_to_output(|row| self.pace[row] * (-(self.rpm[row] / width).powi(2)).exp());
            bank.begin_variant(STRIBECK, width).add_column(self.inputs, law);
        }
    }

    fn add_inertia(&self, bank: &mut VariantBank) {
        let recorded = self.inputs.scene.column("spindle_acceleration_rpm_per_s").map(<[f64]>::to_vec);
        let rate = recorded.unwrap_or_else(|| self.inputs.differentiate_values(self.rpm));
        let whole = self.inputs.build_column(|row| if self.is_torque { rate[row] } else { self.pace[row] * rate[row] });
        let braking: Vec<f64> = whole.iter().map(|x| x.min(0.0)).collect();
        let both = |share: f64| [(whole.clone(), 1.0), (braking.clone(), share)];
        bank.begin_variant(INERTIA, "ramps").add_columns(self.inputs, both(0.15));
        bank.begin_variant(INERTIA, "braking apart").with_ln_prior(-1.5).add_columns(self.inputs, both(1.0));
        bank.begin_variant(REGENERATION, "braking").add_column(self.inputs, braking);
    }

    /// Warmth: as recorded, or as a state that the speed drives.
    fn list_warmth_states(&self) -> Vec<(String, Vec<f64>)> {
        let mut all = Vec::new();
        if let Some(recorded) = &self.inputs.temperature {
            let low = self.inputs.sort_fitted_values(recorded, false).first().copied().unwrap_or(0.0);
            let spread = self.inputs.compute_deviation(recorded, false).max(0.1);
            all.push(("recorded".to_owned(), recorded.iter().map(|t| (t - low) / spread).collect()));
        }
        for tau_s in WARMING_S.into_iter().filter(|tau_s| *tau_s < 4.0 * self.inputs.span_s()) {
            all.push((format!("{tau_s} s"), self.inputs.simulate_slow_state(&self.pace, tau_s, 0.0)));
        }
        all
    }

    fn add_warm_up(&self, bank: &mut VariantBank) {
        for (label, warmth) in self.list_warmth_states() {
            let top = self.inputs.fitted_rows(false).map(|row| warmth[row]).fold(1e-9, f64::max);
            for exponent in [1.0, 5.0 / 3.0] {
                let drag = |factor: &dyn Fn(f64) -> f64| {
                    self.convert_to_output(|row| self.pace[row].powf(exponent) * factor(warmth[row]))
                };
                let thin = drag(&|z| (-1.2 * z / top).exp());
                let columns = [(thin, 1.0), (drag(&|z| z), 0.25), (drag(&|z| z * z), 0.15)];
                bank.begin_variant(WARM_UP, format!("{label}, {exponent:.2}")).add_columns(self.inputs, columns);
            }
            let square = |power: i32| self.convert_to_output(|row| self.pace[row].powi(2) * warmth[row].powi(power));
            bank.begin_variant(PRELOAD, label).add_columns(self.inputs, [(square(1), 1.0), (square(2), 0.25)]);
        }
    }

    fn add_gear_stages(&self, bank: &mut VariantBank) {
        let turning = |row: usize| f64::from(u8::from(self.pace[row] > 0.01));
        for (label, low) in self.build_stage_columns() {
            let here = self.inputs.build_column(|row| low[row] * turning(row));
            let slope = self.inputs.build_column(|row| here[row] * self.pace[row]);
            let mut columns = vec![(here.clone(), 1.0), (slope, 1.0)];
            if let Some(cut) = self.inputs.cut.as_ref().filter(|_| self.inputs.knows_cut) {
                columns.push((self.inputs.build_column(|row| here[row] * cut[row]), 1.0));
            }
            bank.begin_variant(GEAR, label).add_columns(self.inputs, columns);
        }
    }

    /// Where the lower stage is engaged: as recorded, or below a speed between those that are kept for a while.
    fn build_stage_columns(&self) -> Vec<(String, Vec<f64>)> {
        let below = |limit: f64| self.inputs.build_column(|row| f64::from(u8::from(self.rpm[row] < limit)));
        if let Some(stage) = self.inputs.scene.column("gear_stage") {
            let known = self.inputs.sort_fitted_values(stage, false);
            if let (Some(low), Some(high)) = (known.first(), known.last())
                && low < high
            {
                return vec![(
                    "recorded".to_owned(),
                    self.inputs.build_column(|row| f64::from(u8::from(stage[row] == *low))),
                )];
            }
        }
        self.list_speed_limits().into_iter().map(|limit| (format!("{limit:.0} rpm"), below(limit))).collect()
    }

    fn list_speed_limits(&self) -> Vec<f64> {
        let kept = self.list_steady_speeds();
        let least = 0.005 * self.top_rpm;
        let mut between: Vec<f64> = if kept.len() > 3 {
            kept.windows(2).map(|pair| f64::midpoint(pair[0], pair[1])).collect()
        } else {
            let mut all: Vec<f64> = self.inputs.fitted_rows(false).map(|row| self.rpm[row]).collect();
            all.retain(|n| *n > 0.02 * self.top_rpm);
            (0..12)
                .filter_map(|k| numerics::statistics::quantile(all.iter().copied(), 0.12 + 0.069 * f64::from(k)))
                .collect()
        };
        between.dedup_by(|b, a| *b - *a < least);
        let size = between.len();
        if size > STAGES_MAX {
            between = (0..STAGES_MAX).map(|k| between[1 + k * (size - 3) / (STAGES_MAX - 1)]).collect();
        }
        between
    }

    /// Speeds that are kept for five rows, in rising order.
    fn list_steady_speeds(&self) -> Vec<f64> {
        let mut kept = Vec::new();
        let mut stretch: Vec<f64> = Vec::new();
        for row in 0..=self.inputs.rows {
            let breaks = row == self.inputs.rows
                || row > 0
                    && ((self.rpm[row] - self.rpm[row - 1]).abs() > 0.01 * self.top_rpm
                        || self.inputs.block[row] != self.inputs.block[row - 1]);
            if breaks {
                let rows = stretch.len();
                kept.extend(numerics::statistics::median(std::mem::take(&mut stretch)).filter(|_| rows >= 5));
            }
            if row < self.inputs.rows && self.inputs.fitted[row] {
                stretch.push(self.rpm[row]);
            }
        }
        kept.retain(|n| *n > 0.02 * self.top_rpm);
        kept.sort_by(f64::total_cmp);
        kept
    }

    fn add_motor_losses(&self, bank: &mut VariantBank) {
        let Some(cut) = self.inputs.cut.as_ref().filter(|_| self.inputs.knows_cut) else { return };
        let torque: Vec<f64> = if self.is_torque {
            cut.clone()
        } else {
            self.inputs
                .build_column(|row| if self.pace[row] > 0.01 { cut[row] / self.pace[row].max(0.02) } else { 0.0 })
        };
        let weak = |row: usize, base: f64| ((self.rpm[row] / base).powi(2) - 1.0).max(0.0);
        for base in BASE_SPEEDS.into_iter().filter(|base| *base < 0.9 * self.top_rpm) {
            let loss = self.inputs.build_column(|row| torque[row].powi(2) * weak(row, base));
            let idle = self.inputs.build_column(|row| (self.rpm[row] / base - 1.0).max(0.0));
            bank.begin_variant(FIELD, base).add_columns(self.inputs, [(loss.clone(), 1.0), (idle.clone(), 0.4)]);
            bank.begin_variant(FIELD, format!("{base}, idle"))
                .with_ln_prior(-0.5)
                .add_columns(self.inputs, [(idle, 1.0), (loss, 0.4)]);
        }
        let square: Vec<f64> = torque.iter().map(|t| t * t).collect();
        let warmth = self.inputs.temperature.as_ref().map(|t| {
            let middle = self.inputs.compute_mean(t, false);
            (self.inputs.build_column(|row| square[row] * (t[row] - middle)), 0.12)
        });
        for base in [0.0, 1000.0, 1600.0, 2400.0].into_iter().filter(|base| *base < 0.8 * self.top_rpm) {
            let beyond = (base > 0.0).then(|| (self.inputs.build_column(|row| square[row] * weak(row, base)), 0.5));
            let columns = [(square.clone(), 1.0)].into_iter().chain(warmth.clone()).chain(beyond);
            bank.begin_variant(COPPER, base).add_columns(self.inputs, columns);
        }
        bank.begin_variant(INVERTER, "").add_columns(self.inputs, [(torque, 1.0), (square, 0.3)]);
    }
}
