//! Results as text and as a script's settings.

use super::accuracy::{Accuracy, FIXED_LOSSES};
use super::load_loss::{LoadLossLearned, StageLearned};
use super::no_load::{NoLoadLearned, SpeedLearned};
use crate::format_script_number as number;
use crate::{SPEEDS_PER_STAGE, STAGES};
use std::fmt::{self, Write as _};

impl NoLoadLearned {
    /// The powers as settings that a script returns; the file can stand beside the other scripts as it is.
    #[must_use]
    pub fn format_script(&self) -> String {
        let mut text = String::from(
            "// No-load power by gear stage, identified from recordings: pairs of speed in rpm and power in W. 空载功率\n\nfn settings() {\n    #{\n",
        );
        for stage in 0..STAGES {
            let own = select_spread_speeds(self.speeds.iter().filter(|speed| speed.stage == stage).collect());
            if own.is_empty() {
                continue;
            }
            let pairs: Vec<String> =
                own.iter().map(|it| format!("[{}, {}]", number(it.speed_rpm), number(it.power_w))).collect();
            let _ = writeln!(text, "        no_load_stage_{stage}: [{}],", pairs.join(", "));
        }
        if let Some(drift) = self.drift {
            let _ = writeln!(text, "        no_load_drift: {},", number(drift.clamp(0.0, 0.5)));
        }
        text + "    }\n}\n"
    }
}

/// As many speeds as the gateway keeps, from the slowest to the fastest.
fn select_spread_speeds(speeds: Vec<&SpeedLearned>) -> Vec<&SpeedLearned> {
    let (last, kept) = (speeds.len().saturating_sub(1), SPEEDS_PER_STAGE - 1);
    if last <= kept {
        return speeds;
    }
    (0..=kept).map(|at| speeds[at * last / kept]).collect()
}

impl fmt::Display for NoLoadLearned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "stage      rpm   no-load W      95 % interval W  visits  between W  settled s  drift W")?;
        for speed in &self.speeds {
            let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1}"));
            writeln!(
                f,
                "{:>5} {:>8.1} {:>11.1} {:>20} {:>7} {:>10} {:>10.0} {:>8}",
                speed.stage,
                speed.speed_rpm,
                speed.power_w,
                format!("{:.1} to {:.1}", speed.interval_w.0, speed.interval_w.1),
                speed.visits,
                number(speed.between_visits_w),
                speed.settled_s,
                number(speed.drift_w),
            )?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

/// A deviation of 0 stands for a load loss that nobody has measured.
const LEAST_SD: f64 = 1e-6;

impl LoadLossLearned {
    /// The coefficients as settings that a script returns; the file can stand beside the other scripts as it is.
    #[must_use]
    pub fn format_script(&self) -> String {
        let mut text = String::from(
            "// Load loss by gear stage, identified from recordings: Pad = a0 Pc + a1 Pc^2. 附加载荷损耗系数\n\
             // load_loss_speed_rpm: the speed at which a1 is as given; elsewhere it goes with 1/n^2. 0: the same at every speed. a1 对应的转速\n\
             // load_loss_sd: standard deviation of a0 + a1 Pc at Pc = load_loss_sd_at_w; load_loss_quadratic_sd_per_w: that of a1. 标准不确定度\n\n\
             fn settings() {\n    #{\n",
        );
        for StageLearned { stage, linear, quadratic_per_w, speed_rpm, doubt, .. } in &self.stages {
            let settings = [
                ("linear", linear.value),
                ("quadratic_per_w", quadratic_per_w.value),
                ("speed_rpm", speed_rpm.unwrap_or(0.0)),
                ("sd", doubt.share_sd.clamp(LEAST_SD, 0.5)),
                ("sd_at_w", doubt.at_w),
                ("quadratic_sd_per_w", doubt.quadratic_sd_per_w.min(0.01)),
                ("only_speed_rpm", doubt.only_speed_rpm.unwrap_or(0.0)),
            ];
            for (name, value) in settings {
                let _ = writeln!(text, "        load_loss_{name}_stage_{stage}: {},", number(value));
            }
        }
        text + "    }\n}\n"
    }
}

/// How a1 goes with the speed, and what the other form would leave.
fn describe_form(stage: &StageLearned) -> String {
    match (stage.form_residuals, stage.speed_rpm) {
        (None, _) => "not known, the cuts were made at one speed; taken as the same at every speed".to_owned(),
        (Some(left), Some(speed_rpm)) => format!(
            "({speed_rpm:.0} rpm / n)^2, residual {:.2} W; the same at every speed would leave {:.2} W",
            left.with_torque_squared_w, left.same_at_every_speed_w
        ),
        (Some(left), None) => format!(
            "the same at every speed, residual {:.2} W; with 1/n^2 it would leave {:.2} W",
            left.same_at_every_speed_w, left.with_torque_squared_w
        ),
    }
}

/// E of every cut, in percent.
fn write_accuracy_table(f: &mut fmt::Formatter<'_>, accuracy: &Accuracy) -> fmt::Result {
    let [first, second] = FIXED_LOSSES;
    writeln!(
        f,
        "  accuracy of cutting power, each cut with coefficients of the others; E = |estimated - measured| / measured"
    )?;
    writeln!(f, "      rpm  measured W  estimated W     E %   fixed {first}: E %   fixed {second}: E %")?;
    for it in &accuracy.groups {
        let [a, b] = it.error_fixed.map(|error| 100.0 * error);
        let (measured, estimated, error) = (it.measured_w, it.estimated_w, 100.0 * it.error);
        writeln!(f, "  {:>7.0} {measured:>11.1} {estimated:>12.1} {error:>7.2} {a:>17.2} {b:>17.2}", it.speed_rpm)?;
    }
    let [a, b] = accuracy.mean_fixed.map(|error| 100.0 * error);
    writeln!(
        f,
        "  mean of {} cuts {:>25.2} {a:>17.2} {b:>17.2}   greatest {:.2}",
        accuracy.groups.len(),
        100.0 * accuracy.mean,
        100.0 * accuracy.greatest
    )
}

impl fmt::Display for LoadLossLearned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for stage in &self.stages {
            let (low, high, _) = stage.cutting_power_w;
            writeln!(
                f,
                "gear stage {}: {} cuts of {low:.0} to {high:.0} W, {} idle stretches, residual {:.2} W",
                stage.stage, stage.cuts, stage.idle, stage.residual_sd_w
            )?;
            for (name, told) in [
                ("a0", stage.linear),
                ("a1, 1/W", stage.quadratic_per_w),
                ("load loss over cutting power at the mean cut", stage.share_at_mean),
            ] {
                writeln!(f, "  {name} = {:.6e}   95 % {:.6e} to {:.6e}", told.value, told.interval.0, told.interval.1)?;
            }
            writeln!(f, "  a1 over speed: {}", describe_form(stage))?;
            stage.accuracy.iter().try_for_each(|accuracy| write_accuracy_table(f, accuracy))?;
        }
        self.refused.iter().try_for_each(|refusal| writeln!(f, "cannot tell: {refusal}"))?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}
