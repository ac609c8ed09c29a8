//! A law as a script that the gateway runs.

use super::law::{Path, ThermalLaw};
use super::learn::ThermalLearned;
use crate::format_script_number;
use std::fmt::Write;

impl ThermalLearned {
    /// A script with the chosen law: predicted error, residual where the error is measured, and alarms where the
    /// temperatures leave the range of identification or the law is contradicted.
    #[must_use]
    pub fn format_script(&self) -> String {
        let law = &self.best_candidate().fit.law;
        let mut text = format_heading(self, law);
        text.push_str(&format_lag_states(law));
        text.push_str(&format_prediction(law));
        text
    }
}

/// Names of the channels, each once.
fn list_sensors(law: &ThermalLaw) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for term in &law.terms {
        if !names.contains(&term.sensor.as_str()) {
            names.push(&term.sensor);
        }
    }
    names
}

fn format_heading(learned: &ThermalLearned, law: &ThermalLaw) -> String {
    let best = learned.best_candidate();
    let mut text =
        String::from("// Thermal error from temperatures, identified from recordings. 热误差预测（由记录辨识）\n");
    let _ = writeln!(
        text,
        "// Residual {:.2} um; in {} blocks left out one at a time {:.2} um.",
        best.fit.residual_rms_um, learned.blocks, best.held_out.rms_um
    );
    for term in &law.terms {
        let late = if term.path == Path::Lagged { "late, " } else { "" };
        let (least, greatest) = term.interval;
        let _ = writeln!(text, "// {}: {late}{least:.3} to {greatest:.3} um/K", term.sensor);
    }
    let present: Vec<String> = list_sensors(law).iter().map(|name| format!("has({name})")).collect();
    let _ = writeln!(text, "\nif {} {{", present.join(" && "));
    text
}

/// The state of every lagged sensor, kept from run to run; at the beginning and after a pause it stands at the temperature,
/// and nothing is judged until that is forgotten.
fn format_lag_states(law: &ThermalLaw) -> String {
    let Some(tau_s) = law.tau_s else { return String::new() };
    let lagged = || law.terms.iter().filter(|term| term.path == Path::Lagged).map(|term| &term.sensor);
    let mut text = String::from("    if dt_s == 0.0 {\n        memory.seen_s = 0.0;\n");
    for name in lagged() {
        let _ = write!(text, "        memory.late_{name} = {name};\n        memory.before_{name} = {name};\n");
    }
    text.push_str("    }\n    memory.seen_s += dt_s;\n");
    for name in lagged() {
        let _ = write!(
            text,
            "    memory.late_{name} = first_order_c(memory.late_{name}, memory.before_{name}, {name}, dt_s, {});\n    memory.before_{name} = {name};\n",
            format_script_number(tau_s)
        );
    }
    text
}

/// How long a state remembers that its beginning was guessed, in time constants.
const SETTLED_TAUS: f64 = 3.0;

fn format_prediction(law: &ThermalLaw) -> String {
    let value = |at: usize| match law.terms[at].path {
        Path::Direct => law.terms[at].sensor.clone(),
        Path::Lagged => format!("memory.late_{}", law.terms[at].sensor),
    };
    let list = |of: &dyn Fn(usize) -> String| (0..law.terms.len()).map(of).collect::<Vec<String>>().join(", ");
    let values = list(&value);
    let coefficients = list(&|at| format_script_number(law.terms[at].um_per_k));
    let temperatures = list(&|at| law.terms[at].sensor.clone());
    let least = list(&|at| format_script_number(law.terms[at].range_c.0));
    let greatest = list(&|at| format_script_number(law.terms[at].range_c.1));
    format!(
        "    let predicted_um = predicted_thermal_error_um([{values}], [{coefficients}], {});\n    \
         let outside_k = temperature_outside_k([{temperatures}], [{least}], [{greatest}]);\n    \
         if has(outside_k) {{\n        \
         alarm_when(\"thermal_outside\", outside_k > {}, 60.0, \"temperatures outside the range of identification: identify thermal again\");\n    }}\n    \
         if has(thermal_error_um) && has(predicted_um){settled} {{\n        \
         let residual_um = thermal_error_um - predicted_um;\n        \
         alarm_when(\"thermal_contradicted\", residual_um > {limit} || residual_um < -{limit}, 600.0, \"measured and predicted thermal error disagree: identify thermal again\");\n    }}\n}}\n",
        format_script_number(law.intercept_um),
        format_script_number(margin_k(law)),
        limit = format_script_number(3.0 * law.residual_sd_um),
        settled =
            law.tau_s.map_or_else(String::new, |tau_s| format!(" && memory.seen_s > {:.0}", SETTLED_TAUS * tau_s)),
    )
}

/// The least margin beyond the range of identification among the sensors.
fn margin_k(law: &ThermalLaw) -> f64 {
    let margin = |(least, greatest): (f64, f64)| super::predictor::margin_k(least, greatest);
    law.terms.iter().map(|term| margin(term.range_c)).fold(f64::MAX, f64::min)
}
