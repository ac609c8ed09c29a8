//! Two water tanks: square-root outflow without the overflow. The level of the upper tank is simulated here, since a
//! model of columns cannot carry it.

use std::path::Path;

use crate::concealed::least_squares::{Basis, rms};
use crate::concealed::real::machines::{Line, ask, fit};
use crate::concealed::real::sheet::Sheet;
use crate::concealed::score::answer::Answer;

const STEP_S: f64 = 4.0;
/// Level at which the tank is full, V.
const FULL_V: f64 = 9.7;

/// The overflow must be found where the tank is full.
pub(crate) fn line(data: &Path) -> Line {
    let expected = "mismatch located at level 10 V; unknown with an empirical form is right";
    match Sheet::read(&data.join("cascaded-tanks/recording.csv")).and_then(|sheet| prepared(&sheet)) {
        Ok((answer, level)) => judge(expected, &answer, &level),
        Err(error) => Line::new("cascaded-tanks", expected, format!("FAILED {error}"), false),
    }
}

fn prepared(sheet: &Sheet) -> Result<(Answer, Vec<f64>), String> {
    let (pump, level) = (sheet.numbers("pump_v"), sheet.numbers("level_v"));
    let change: Vec<f64> = level.windows(2).map(|w| (w[1] - w[0]) / STEP_S).collect();
    let upper = best_upper(&pump, &level, &change);
    let rows = change.len();
    let mut out = sheet.filter(|row| row < rows);
    out.set("run", (0..rows).map(|row| format!("w{}", row * 8 / rows)));
    out.set_numbers("root_upper", &upper[..rows]);
    out.set_numbers("root_level", &level[..rows].iter().map(|v| v.max(0.0).sqrt()).collect::<Vec<_>>());
    out.set_numbers("level_change_v_s", &change);
    let model = "schema = \"model/1\"\nname = \"two tanks\"\noutput = \"level_change_v_s\"\n\n[[effect]]\nkind = \"linear\"\n\
                 columns = { root_upper = 0.05, root_level = -0.05 }\n";
    Ok((ask("cascaded-tanks", model, &out)?, level[..rows].to_vec()))
}

/// Root of the upper level for the outflow and pump constants that explain the lower tank best below the brim.
fn best_upper(pump: &[f64], level: &[f64], change: &[f64]) -> Vec<f64> {
    let low: Vec<usize> = (0..change.len()).filter(|row| level[*row] < 9.0).collect();
    let pick = |values: &[f64]| low.iter().map(|row| values[*row]).collect::<Vec<f64>>();
    let root: Vec<f64> = level.iter().map(|v| v.max(0.0).sqrt()).collect();
    let error = |upper: &[f64]| rms(&Basis::of(&[pick(upper), pick(&root)]).remainder(&pick(change)));
    let grid = (0..40).flat_map(|i| (0..30).map(move |j| (0.01 + 0.004 * f64::from(i), 0.01 + 0.004 * f64::from(j))));
    let candidates = grid.map(|(outflow, inflow)| simulate(pump, outflow, inflow));
    candidates.min_by(|a, b| error(a).total_cmp(&error(b))).unwrap_or_default()
}

fn simulate(pump: &[f64], outflow: f64, inflow: f64) -> Vec<f64> {
    let mut level = 5.0_f64;
    let step = |u: &f64| {
        let root = level.sqrt();
        level = (level + STEP_S * (inflow * u - outflow * root)).max(0.01);
        root
    };
    pump.iter().map(step).collect()
}

fn judge(expected: &'static str, answer: &Answer, level: &[f64]) -> Line {
    let claimed = answer.rows.effects();
    let full: Vec<f64> = level.iter().map(|v| f64::from(u8::from(*v >= FULL_V))).collect();
    let size = |wanted: bool| {
        let rows = claimed.iter().zip(level).filter(|(_, v)| (**v >= FULL_V) == wanted);
        rms(&rows.map(|(c, _)| *c).collect::<Vec<_>>())
    };
    let auc = crate::concealed::score::outcome::area(&claimed, &full).unwrap_or(0.0);
    let got = format!(
        "{}; {}; effect {:.4} when full, {:.4} below; AUC {auc:.2}",
        answer.summary(),
        fit(answer),
        size(true),
        size(false)
    );
    Line::new("cascaded-tanks", expected, got, answer.reports() && size(true) > 3.0 * size(false))
}
