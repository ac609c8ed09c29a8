//! What was learned, in words and tables.

use super::learn::{CandidateLaw, ThermalLearned};
use super::regression::ThermalCoefficient;
use super::selection::{GradeChoice, Selection, SensorVerdict};
use std::fmt;

impl fmt::Display for ThermalLearned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.selection)?;
        let kind = if self.blocks_are_runs { "whole runs" } else { "contiguous blocks" };
        let means = match self.rows_averaged {
            0 | 1 => String::new(),
            rows => format!(" (means over {rows} rows)"),
        };
        writeln!(f, "\nErrors in {} {kind} that were left out one at a time, um{means}:", self.blocks)?;
        write_line(f, "mean of the others", self.selection.held_out_mean.rms_um, None)?;
        write_line(f, "law without lag", self.without_lag.held_out.rms_um, self.without_lag.hysteresis_um)?;
        match &self.with_lag {
            Ok(late) => write_line(f, "law with lag", late.held_out.rms_um, late.hysteresis_um)?,
            Err(refusal) => writeln!(f, "  law with lag            none: {refusal}")?,
        }
        writeln!(f, "Chosen: {}\n", self.reason)?;
        write!(f, "{}", self.best_candidate())
    }
}

fn write_line(f: &mut fmt::Formatter<'_>, name: &str, rms_um: f64, loop_um: Option<f64>) -> fmt::Result {
    let hysteresis = loop_um.map_or_else(String::new, |um| format!("   loop warming against cooling {um:+.2}"));
    writeln!(f, "  {name:<22} {rms_um:>8.2}{hysteresis}")
}

impl fmt::Display for Selection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "sensor                       in   r       grade image  range   inflation  why")?;
        self.sensors.iter().try_for_each(|sensor| writeln!(f, "{sensor}"))?;
        writeln!(f, "Condition number of the chosen: {:.0}", self.condition_number)?;
        self.by_grades.as_ref().map_or(Ok(()), |grades| writeln!(f, "{grades}"))
    }
}

fn format_number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

impl fmt::Display for SensorVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:<28} {:<4} {:>6}  {:>11}  {:>5}  {:>10}  {}",
            self.sensor,
            if self.chosen { "yes" } else { "no" },
            format_number(self.correlation, 3),
            format_number(self.grade_initial_image, 3),
            format_number(self.grade_range, 3),
            format_number(self.variance_inflation, 1),
            self.reason
        )
    }
}

impl fmt::Display for GradeChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "Grades alone would choose {}: inflation {}, condition {}, blocks left out {} um",
            self.sensors.join(", "),
            format_number(self.variance_inflation, 0),
            format_number(self.condition_number, 0),
            format_number(self.held_out_rms_um, 2)
        )
    }
}

impl fmt::Display for CandidateLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "coefficient                        value    95 % interval             all together")?;
        self.fit.coefficients.iter().try_for_each(|coefficient| writeln!(f, "{coefficient}"))?;
        let memory = &self.fit.memory;
        writeln!(
            f,
            "Residual {:.2} um rms over {} rows, R2 {:.4}; it remembers for {:.0} s, so the rows count as {:.0} independent ones",
            self.fit.residual_rms_um, self.fit.rows, self.fit.r2, memory.memory_s, memory.effective_rows
        )
    }
}

impl fmt::Display for ThermalCoefficient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.own.name.as_str() {
            "intercept" => "um",
            "tau_s" => "s",
            _ => "um/K",
        };
        let between = |(least, greatest): (f64, f64)| format!("{least:.3} to {greatest:.3}");
        let (own, joint) = (between(self.own.interval), between(self.joint_interval));
        write!(f, "{:<28} {:>11.3} {unit:<4} {own:<25} {joint}", self.own.name, self.own.value)
    }
}
