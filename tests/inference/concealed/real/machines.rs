//! The real machines: what is known to be missing in the simulation of each, and whether the tool says so.

use std::path::Path;

use crate::concealed::least_squares::{Basis, rms};
use crate::concealed::real::sheet::Sheet;
use crate::concealed::real::{tanks, wear};
use crate::concealed::score::answer::Answer;
use crate::concealed::score::tool;

/// One line of the table of real recordings.
pub(crate) struct Line {
    pub(crate) recording: &'static str,
    pub(crate) expected: &'static str,
    pub(crate) got: String,
    pub(crate) right: bool,
}

impl Line {
    pub(crate) fn new(recording: &'static str, expected: &'static str, got: String, right: bool) -> Self {
        Self { recording, expected, got, right }
    }

    fn failed(recording: &'static str, expected: &'static str, error: &str) -> Self {
        Self::new(recording, expected, format!("FAILED {error}"), false)
    }
}

/// Asks about a sheet under a model; the files are written to a folder of their own.
pub(crate) fn ask(name: &str, model: &str, sheet: &Sheet) -> Result<Answer, String> {
    let folder = tool::workshop().0.join("real").join(name);
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let (model_file, recording) = (folder.join("model.toml"), folder.join("recording.csv"));
    std::fs::write(&model_file, model).map_err(|e| e.to_string())?;
    std::fs::write(&recording, sheet.csv()).map_err(|e| e.to_string())?;
    tool::diagnose(&model_file, &[recording], &folder)
}

/// Every real recording that is there.
pub(crate) fn lines(data: &Path) -> Vec<Line> {
    let mut lines = vec![feed_axis(data), servo_ramp(data)];
    lines.extend(["x", "y"].into_iter().flat_map(|axis| milling_axis(data, axis)));
    lines.push(milling_spindle(data));
    lines.extend(wear::lines(data));
    lines.push(tanks::line(data));
    lines
}

fn with<T>(
    answer: Result<T, String>,
    recording: &'static str,
    expected: &'static str,
    judge: impl Fn(T) -> (String, bool),
) -> Line {
    match answer {
        Ok(answer) => {
            let (got, right) = judge(answer);
            Line::new(recording, expected, got, right)
        }
        Err(error) => Line::failed(recording, expected, &error),
    }
}

fn names(answer: &Answer) -> Vec<&str> {
    answer.missing.iter().map(|m| m.effect.as_str()).collect()
}

/// Estimates of one effect in one line.
fn estimates(answer: &Answer, effect: &str) -> String {
    let found = answer.missing.iter().find(|m| m.effect == effect);
    let text = |e: &crate::concealed::score::answer::Estimate| {
        format!("{} {:.3} ({:.3?} to {:.3?}) {}", e.name, e.value, e.low, e.high, e.unit)
    };
    found.map_or(String::new(), |m| m.parameters.iter().map(text).collect::<Vec<_>>().join(", "))
}

fn feed_axis(data: &Path) -> Line {
    let expected = "dry_friction about 20 N first, then offset, then direction_asymmetry; no stribeck";
    let folder = data.join("feed-axis");
    let answer = tool::diagnose(&folder.join("model.toml"), &[folder.join("recording.csv.gz")], &out("feed-axis"));
    with(answer, "feed-axis", expected, |answer| {
        let names = names(&answer);
        let place = |effect: &str| names.iter().position(|n| *n == effect);
        let ordered = matches!((place("dry_friction"), place("offset"), place("direction_asymmetry")), (Some(0), Some(a), Some(b)) if a < b);
        (
            format!("{}; {}", answer.summary(), estimates(&answer, "dry_friction")),
            ordered && place("stribeck").is_none(),
        )
    })
}

fn out(name: &str) -> std::path::PathBuf {
    let folder = tool::workshop().0.join("real").join(name);
    if let Err(error) = std::fs::create_dir_all(&folder) {
        println!("{}: {error}", folder.display());
    }
    folder
}

/// Slope of a straight line through `half` samples on either side.
fn slope(values: &[f64], step_s: f64, half: usize) -> Vec<f64> {
    let at = |i: usize| {
        let (from, to) = (i.saturating_sub(half), (i + half).min(values.len() - 1));
        let middle = (from + to) as f64 / 2.0;
        let rows = from..=to;
        let (top, bottom) = rows.fold((0.0, 0.0), |(top, bottom), j| {
            let x = j as f64 - middle;
            (top + x * values[j], bottom + x * x)
        });
        top / bottom.max(1e-12) / step_s
    };
    (0..values.len()).map(at).collect()
}

/// One ramp down and up again: cut into stretches so that something can be held out.
fn servo_ramp(data: &Path) -> Line {
    let expected = "stribeck, from inertia + viscous + dry friction";
    let answer = Sheet::read(&data.join("servo-ramp/recording.csv")).and_then(|mut sheet| {
        let speed = sheet.numbers("motor_speed_rpm");
        sheet.set_numbers("motor_acceleration_rpm_s", &slope(&speed, 1.0 / 1500.0, 6));
        let rows = sheet.rows();
        sheet.set("run", (0..rows).map(|row| format!("s{:02}", row * 24 / rows)));
        let model = "schema = \"model/1\"\nname = \"servo motor\"\noutput = \"torque_pct\"\n\n[[effect]]\nkind = \"linear\"\n\
                     columns = { motor_acceleration_rpm_s = 0.0, motor_speed_rpm = 0.0, \"sign(motor_speed_rpm)\" = 0.0 }\n\n\
                     [roles]\nvelocity = \"motor_speed_rpm\"\nacceleration = \"motor_acceleration_rpm_s\"\n";
        ask("servo-ramp", model, &sheet)
    });
    with(answer, "servo-ramp", expected, |answer| {
        let named = answer.names() && names(&answer).contains(&"stribeck");
        (format!("{}; held-out {}", answer.summary(), fit(&answer)), named)
    })
}

/// Held-out errors as the tool states them.
pub(crate) fn fit(answer: &Answer) -> String {
    answer.held_out.map_or("not stated".into(), |[b, a, f]| format!("{b:.4} -> {a:.4}, floor {f:.4}"))
}

/// Rows at constant velocity alone, and everything that the machine did.
fn milling_axis(data: &Path, axis: &'static str) -> Vec<Line> {
    let folder = data.join("milling");
    let read = std::fs::read_to_string(folder.join("model.toml")).map_err(|e| e.to_string()).and_then(|model| {
        Ok((model.replace("x_axis", &format!("{axis}_axis")), Sheet::read(&folder.join("recording.csv.gz"))?))
    });
    let (model, sheet) = match read {
        Ok(read) => read,
        Err(error) => return vec![Line::failed("milling", "dry_friction", &error)],
    };
    let acceleration = sheet.numbers(&format!("{axis}_axis_acceleration_mm_s2"));
    let velocity = sheet.numbers(&format!("{axis}_axis_velocity_mm_min"));
    let steady = |row: usize| acceleration[row].abs() <= 20.0 && velocity[row].abs() >= 30.0;
    let cruising = ask(&format!("milling-{axis}-steady"), &model, &sheet.filter(steady));
    let whole = ask(&format!("milling-{axis}"), &model, &sheet);
    let named = |answer: &Answer| answer.names() && names(answer).first() == Some(&"dry_friction");
    let titles = if axis == "x" {
        ["milling x, constant velocity", "milling x, whole"]
    } else {
        ["milling y, constant velocity", "milling y, whole"]
    };
    vec![
        with(cruising, titles[0], "dry_friction first; held-out R2 >= 0.88", |answer| {
            let (before, after) = (r2(&answer, "simulated_before", |_| true), r2(&answer, "simulated_after", |_| true));
            (format!("{}; R2 {before:.2} -> {after:.2}", answer.summary()), named(&answer) && after >= 0.88)
        }),
        with(whole, titles[1], "dry_friction among the missing", |answer| {
            let (before, after) = (r2(&answer, "simulated_before", steady), r2(&answer, "simulated_after", steady));
            let found = answer.names() && names(&answer).contains(&"dry_friction");
            (
                format!(
                    "{}; {:.1} s; R2 at constant velocity {before:.2} -> {after:.2}",
                    answer.summary(),
                    answer.seconds
                ),
                found,
            )
        }),
    ]
}

/// Explained share of the variance on held-out rows for which `wanted` holds.
fn r2(answer: &Answer, column: &str, wanted: impl Fn(usize) -> bool) -> f64 {
    let (Some(simulated), Some(recorded)) = (answer.rows.columns.get(column), answer.rows.columns.get("recorded"))
    else {
        return f64::NEG_INFINITY;
    };
    let rows = (0..simulated.len()).filter(|row| wanted(*row) && answer.held_out_runs.contains(&answer.rows.run[*row]));
    let (errors, values): (Vec<f64>, Vec<f64>) =
        rows.filter_map(|row| simulated[row].zip(recorded[row])).map(|(s, r)| (r - s, r)).unzip();
    let spread = Basis::of(&[vec![1.0; values.len()]]).remainder(&values);
    1.0 - (rms(&errors) / rms(&spread).max(1e-12)).powi(2)
}

fn milling_spindle(data: &Path) -> Line {
    let expected = "no flank_wear in spindle power (wax)";
    let answer = Sheet::read(&data.join("milling/recording.csv.gz")).and_then(|sheet| {
        let speed = sheet.numbers("spindle_speed_rpm");
        let sheet = sheet.filter(|row| speed[row] > 3000.0);
        let model = "schema = \"model/1\"\nname = \"mill spindle\"\noutput = \"spindle_power_w\"\n\n[[effect]]\nkind = \"linear\"\n\
                     columns = { one = 170.0 }\n";
        ask("milling-spindle", model, &sheet)
    });
    with(answer, "milling spindle", expected, |answer| {
        let wear = names(&answer).contains(&"flank_wear");
        (answer.summary(), !wear)
    })
}
