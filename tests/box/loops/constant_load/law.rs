//! The laws that are compared: the curves they learn from, the module's own law, and the shipped script.

use super::{DEPTHS_MM, MAX_PCT, MIN_PCT, over, settings};
use crate::loops::bench::{Bench, limits, script};
use crate::loops::steps::{SPEED_RPM, air, cut};
use adapters::channel::Kind;
use adapters::recording::{Cells, Numbers, Words};
use adapters::{ChannelId, Recording, Sample, Value};
use rules::estimators::spindle_current::{FeedCurves, identify_feed_curve};
use rules::script::ScriptFile;
use std::fmt::Write as _;

/// Sweeps at every depth, recorded through the same line as the control will be.
pub(super) fn curves() -> FeedCurves {
    let mut steps = vec![air(15.0)];
    for depth in DEPTHS_MM {
        for feed in [80.0, 120.0, 160.0, 210.0, 260.0, 310.0, 370.0] {
            steps.push(cut(7.0, feed, depth));
        }
    }
    let quiet = [script("nothing.rhai", "const EVERY_S = 10.0;")];
    let mut bench = Bench::new(settings(99), &steps, &quiet, &limits(MIN_PCT, MAX_PCT));
    let mut samples = Vec::new();
    while !over(&bench) {
        let sample = bench.tick().clone();
        samples.push(sample);
    }
    identify_feed_curve(&table(&samples), "feed_mm_min", "spindle_power_w").expect("curves")
}

fn table(samples: &[Sample]) -> Recording {
    let time_s = (0..samples.len()).map(|row| row as f64 / 10.0).collect();
    let mut recording = Recording::new("sweeps", time_s, None);
    for id in ChannelId::list_all() {
        let values = || samples.iter().map(|sample| sample.slot(id).value.as_ref().ok());
        if values().flatten().next().is_none() {
            continue;
        }
        let cells = match id.channel().kind {
            Kind::Text => Cells::Words(values().map(|it| it.and_then(Value::as_text).unwrap_or("")).collect::<Words>()),
            _ => Cells::Numbers(values().map(|it| it.and_then(Value::as_number)).collect::<Numbers>()),
        };
        recording.set_column(id.name(), cells);
    }
    recording
}

/// The curves as rows of a script.
fn rows(learned: &FeedCurves) -> String {
    let family = learned.build_family(SPEED_RPM).expect("curves that do not cross");
    let mut rows = String::new();
    for it in family.curves() {
        let [c0, c1, c2, c3] = it.curve.coefficients;
        let _ = writeln!(
            rows,
            "[{:.4}, {:.4}, {:.4}, {c0:.6}, {c1:.6}, {c2:.10}, {c3:.12}, {:.4}],",
            it.depth_mm, it.curve.feed_min, it.curve.feed_max, it.sd
        );
    }
    rows
}

/// The shipped script with other constants, as an integrator would write them.
pub(super) fn shipped(name: &str, constants: &[(&str, String)]) -> ScriptFile {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/rules/scripts/constant_load.rhai");
    let mut text = std::fs::read_to_string(path).expect("the shipped script");
    for (constant, value) in constants {
        let begin = text.find(&format!("const {constant} = ")).expect("a constant of the script");
        let end = begin + text[begin..].find(";\n").expect("it ends");
        text.replace_range(begin..end, &format!("const {constant} = {value}"));
    }
    script(name, text)
}

/// The shipped script by its exponent, aiming at this cutting power.
pub(super) fn by_exponent(target_w: f64) -> ScriptFile {
    let [least, most] = [MIN_PCT, MAX_PCT].map(|pct| format!("{pct:.1}"));
    shipped("constant_load.rhai", &[("TARGET_W", format!("{target_w:.1}")), ("MIN_PCT", least), ("MAX_PCT", most)])
}

/// The shipped script by learned curves, aiming at this power of the whole spindle.
pub(super) fn by_curves(learned: &FeedCurves, target_w: f64) -> ScriptFile {
    let [least, most] = [MIN_PCT, MAX_PCT].map(|pct| format!("{pct:.1}"));
    let curves = learned.map(SPEED_RPM, &learned.build_family(SPEED_RPM).expect("curves that do not cross"));
    let constants = [("TARGET_W", format!("{target_w:.1}")), ("MIN_PCT", least), ("MAX_PCT", most), ("CURVES", curves)];
    shipped("constant_load.rhai", &constants)
}

/// The law of the module, with these curves and this target.
pub(super) fn law(learned: &FeedCurves, target_w: f64) -> ScriptFile {
    let rows = rows(learned);
    let text = format!(
        r#"
const CURVES = [{rows}];
const TARGET_W = {target_w:.1};
const MIN_PCT = {MIN_PCT:.1};
const MAX_PCT = {MAX_PCT:.1};
// Longer than meter and controller lag behind each other. 切入后等待
const SETTLE_S = 0.5;

let pct = 100.0;
let known = has(spindle_power_w) && has(feed_mm_min) && has(feed_programmed_mm_min);
if state == "cutting" && state_s >= SETTLE_S && known && feed_mm_min > 10.0 && feed_programmed_mm_min > 10.0 {{
    // Smoothed over a few ticks: the meter is noisy, and feed and power are not of quite the same moment. 平滑
    let power_w = memory.power_w ?? spindle_power_w;
    let feed = memory.feed ?? feed_mm_min;
    power_w += 0.5 * (spindle_power_w - power_w);
    feed += 0.5 * (feed_mm_min - feed);
    memory.power_w = power_w;
    memory.feed = feed;
    let depth_mm = feed_curve_depth_mm(CURVES, feed, power_w);
    if has(depth_mm) {{
        let wanted = feed_curve_feed(CURVES, depth_mm, TARGET_W);
        // No feed of the curves gives the target: then the nearest that they have. 曲线范围内无解
        let wanted = if has(wanted) {{ wanted }} else if power_w > TARGET_W {{ 0.0 }} else {{ 1e6 }};
        pct = clamp(100.0 * wanted / feed_programmed_mm_min, MIN_PCT, MAX_PCT);
    }} else if power_w > TARGET_W {{
        // Above every curve: worn, hard, or deeper than anything tried. 超出曲线上限
        pct = MIN_PCT;
    }}
    request_feed_override(pct, "constant load");
}} else {{
    memory.power_w = ();
    memory.feed = ();
}}
"#
    );
    script("constant_load.rhai", text)
}
