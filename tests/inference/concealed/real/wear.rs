//! Six tools on a lathe: wear reported from the drive's own signals against the microscope.

use std::path::Path;

use crate::concealed::least_squares::{mean, quantile};
use crate::concealed::real::machines::Line;
use crate::concealed::real::sheet::Sheet;
use crate::concealed::score::answer::Answer;
use crate::concealed::score::tool;

/// Growth at the microscope's readings of one tool: seconds in the cut, um, and what an indicator says.
struct Tool {
    name: String,
    seconds: Vec<f64>,
    growth_um: Vec<f64>,
    reported: Vec<f64>,
    level: Vec<f64>,
}

/// Both expectations on this recording.
pub(crate) fn lines(data: &Path) -> Vec<Line> {
    let folder = data.join("turning-wear");
    let out = tool::workshop().0.join("real/turning-wear");
    let asked = std::fs::create_dir_all(&out).map_err(|e| e.to_string()).and_then(|()| {
        let answer = tool::diagnose(&folder.join("model.toml"), &[folder.join("recording.csv")], &out)?;
        let tools =
            tools(&Sheet::read(&folder.join("recording.csv"))?, &Sheet::read(&folder.join("withheld.csv"))?, &answer);
        Ok((answer, tools))
    });
    match asked {
        Ok((answer, tools)) => vec![separated(&answer), growth(&tools)],
        Err(error) => vec![Line::new("turning-wear", "in-pass decay and late wear", format!("FAILED {error}"), false)],
    }
}

fn separated(answer: &Answer) -> Line {
    let names: Vec<&str> = answer.missing.iter().map(|m| m.effect.as_str()).collect();
    let right = answer.names() && names.contains(&"flank_wear") && names.len() >= 2;
    Line::new("turning-wear", "the in-pass decay and the late wear, separated", answer.summary(), right)
}

fn growth(tools: &[Tool]) -> Line {
    let score = |value: fn(&Tool) -> &Vec<f64>| left_out(tools, value);
    let (reported, clock, level) = (score(|t| &t.reported), score(|t| &t.seconds), score(|t| &t.level));
    let summary = |errors: &[f64]| format!("{:.0} and {:.0}", quantile_middle(errors), mean(errors));
    let ranks: Vec<String> =
        tools.iter().map(|t| format!("{} {:.2}", t.name, spearman(&t.reported, &t.growth_um))).collect();
    let got = format!(
        "reported {}; clock {}; plain level {} um; Spearman by tool: {}",
        summary(&reported),
        summary(&clock),
        summary(&level),
        ranks.join(", ")
    );
    let right = quantile_middle(&reported) < 56.0 && mean(&reported) < 63.0;
    Line::new("turning-wear", "growth on tools left out, rms: median < 56 and mean < 63 um", got, right)
}

/// Median, the mean of the middle two for an even count.
fn quantile_middle(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let half = sorted.len() / 2;
    match sorted.len() {
        0 => quantile(values, 0.5),
        n if n % 2 == 0 => (sorted[half - 1] + sorted[half]) / 2.0,
        _ => sorted[half],
    }
}

fn tools(recording: &Sheet, withheld: &Sheet, answer: &Answer) -> Vec<Tool> {
    let names = recording.text("tool").to_vec();
    let (time, power) = (recording.numbers("time_s"), recording.numbers("spindle_power_counts"));
    let (wear, read) = (withheld.numbers("flank_wear_um"), withheld.numbers("is_microscope_reading"));
    let claimed = answer.rows.filled("effect_flank_wear").unwrap_or_else(|| vec![0.0; names.len()]);
    let mut order: Vec<String> = names.clone();
    order.dedup();
    let one = |name: &String| {
        let rows: Vec<usize> = (0..names.len()).filter(|row| names[*row] == *name && read[*row] == 1.0).collect();
        let since =
            |values: &[f64]| rows.iter().skip(1).map(|row| values[*row] - values[rows[0]]).collect::<Vec<f64>>();
        Tool {
            name: name.clone(),
            seconds: since(&time),
            growth_um: since(&wear),
            reported: since(&claimed),
            level: since(&power),
        }
    };
    order.iter().map(one).collect()
}

/// Error of each tool when the scale (um per unit of the indicator) comes from the others.
fn left_out(tools: &[Tool], value: fn(&Tool) -> &Vec<f64>) -> Vec<f64> {
    let error = |out: usize| {
        let others = tools.iter().enumerate().filter(|(i, _)| *i != out).map(|(_, t)| t);
        let (top, bottom) = others.fold((0.0, 0.0), |sums, tool| {
            let pairs = value(tool).iter().zip(&tool.growth_um);
            pairs.fold(sums, |(top, bottom), (x, y)| (top + x * y, bottom + x * x))
        });
        let scale = if bottom > 0.0 { top / bottom } else { 0.0 };
        let tool = &tools[out];
        let errors: Vec<f64> = value(tool).iter().zip(&tool.growth_um).map(|(x, y)| scale * x - y).collect();
        crate::concealed::least_squares::rms(&errors)
    };
    (0..tools.len()).map(error).collect()
}

/// Rank correlation; 0 when one side does not vary.
fn spearman(a: &[f64], b: &[f64]) -> f64 {
    let ranks = |values: &[f64]| {
        let below = |x: &f64| {
            let (less, same) = (values.iter().filter(|y| *y < x).count(), values.iter().filter(|y| *y == x).count());
            less as f64 + (same as f64 - 1.0) / 2.0
        };
        crate::concealed::bench::centred(&values.iter().map(below).collect::<Vec<f64>>())
    };
    let (a, b) = (ranks(a), ranks(b));
    let dot: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
    let size = crate::concealed::least_squares::rms(&a) * crate::concealed::least_squares::rms(&b) * a.len() as f64;
    if size > 0.0 { dot / size } else { 0.0 }
}
