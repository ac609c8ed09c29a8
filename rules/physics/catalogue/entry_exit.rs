//! The cut builds up when the tool enters and fades when it leaves.

use crate::cut::{estimate_cut_load, multiply_cut, integrate_way_mm};
use crate::{Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::count_to_f64;
use std::ops::Range;

/// Build-up and fading of the cut.
#[derive(Debug, Clone, Copy)]
pub struct EntryExit;

static DOC: EffectDoc = EffectDoc {
    kind: "entry_exit",
    family: "cutting",
    law: "y = (entry * exp(-(t - t_entry) / T) + exit * exp(-(t_exit - t) / T)) * L in each pass; settling: y = settling * exp(-(t - t_entry) / T) * L; ramp: y = (entry * max(0, 1 - (t - t_entry) / T) + exit * max(0, 1 - (t_exit - t) / T_exit)) * L; travel: the same over the way s at the feed, from entry and to exit, in place of the time",
    parameters: &[
        ParameterDoc::new_linear("entry", "1", (-1.0, 0.0), "share by which the cut differs on entry", "切入时的差异比例"),
        ParameterDoc::new_linear("exit", "1", (-1.0, 0.0), "share by which it differs on exit", "切出时的差异比例"),
        ParameterDoc::new_linear(
            "settling",
            "1",
            (-1.0, 1.0),
            "share by which the cut differs at first and then settles",
            "走刀初期的差异比例，随后稳定",
        ),
        ParameterDoc::new_shape("length_s", "s", (0.05, 120.0), "how long entry and exit last", "切入切出持续时间"),
        ParameterDoc::new_shape(
            "exit_length_s",
            "s",
            (0.05, 120.0),
            "how long the exit lasts where it differs from the entry",
            "切出持续时间（与切入不同时）",
        ),
        ParameterDoc::new_shape(
            "length_mm",
            "mm",
            (0.02, 200.0),
            "way at the feed over which the cut builds up",
            "切削建立所经进给行程",
        ),
        ParameterDoc::new_shape(
            "exit_length_mm",
            "mm",
            (0.02, 200.0),
            "way at the feed over which it fades",
            "切削消退所经进给行程",
        ),
    ],
    needs: &["engaged"],
    source: "the engagement ramps over (ap / tan kappa) / (f n); first and last 1-3 s of a pass",
    experiment_minutes: 2.0,
    rivals: &["clock_lag", "engagement_timing", "meter_window", "depth_taper"],
    en: Texts {
        name: "entry and exit",
        statement: "The cut builds up when the tool enters and fades when it leaves",
        absence: "in the first and last seconds of every pass the recording lies below the simulation",
        confused_with: "a late meter (also where speed changes), a late engagement flag (a full step, not a ramp)",
        experiment: "cut one pass with half the feed: the ramps last twice as long",
    },
    zh: Texts {
        name: "切入切出",
        statement: "刀具切入时切削逐渐建立，切出时逐渐消失",
        absence: "每次走刀最初和最后几秒实测低于仿真",
        confused_with: "仪表滞后（转速变化处也有）、切入标志滞后（整体跳变而非斜坡）",
        experiment: "进给减半走刀一次：斜坡持续时间加倍",
    },
};

impl Effect for EntryExit {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["ramp", TRAVEL, "settling"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if estimate_cut_load(scene).is_none() || scene.passes().len() < 3 {
            return Vec::new();
        }
        let longest_s = scene.passes().iter().map(|pass| compute_length_s(scene, pass)).fold(0.0, f64::max);
        let told = |length_s: &f64| (scene.period_s()..=longest_s / 3.0).contains(length_s);
        let lengths_s = || [1.0, 3.0, 10.0, 30.0].into_iter().filter(told);
        let mut forms: Vec<Form> = lengths_s().map(|length_s| Form::from_shape(&[("length_s", length_s)])).collect();
        forms.extend([2.0, 6.0].into_iter().filter(told).flat_map(|length_s| build_entry_forms("ramp", TIMES, length_s)));
        forms.extend(list_entry_ways_mm(scene).into_iter().flat_map(|length_mm| build_entry_forms(TRAVEL, WAYS, length_mm)));
        // Over a good part of a pass nearly anything bends: only where another drive settles as well.
        let shown = scene.feed_load_growth().is_some();
        let long = lengths_s().filter(|_| shown).filter(|length_s| *length_s >= SETTLING_PERIODS * scene.period_s());
        forms.extend(long.map(|length_s| Form { name: "settling", ..Form::from_shape(&[("length_s", length_s)]) }));
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let travels = form.name == TRAVEL;
        let [length, exit_length] = if travels { WAYS } else { TIMES };
        let over = form.shape_value(length).unwrap_or(1.0).max(f64::MIN_POSITIVE);
        let exit_over = form.shape_value(exit_length).unwrap_or(over).max(f64::MIN_POSITIVE);
        let ramps = travels || form.name == "ramp";
        let fades = |s: f64, over: f64| if ramps { (1.0 - s / over).max(0.0) } else { (-s / over).exp() };
        let (time_s, feed) = (scene.time_s(), scene.column("feed_mm_min"));
        let (mut entry, mut exit) = (vec![0.0; scene.rows()], vec![0.0; scene.rows()]);
        for pass in scene.passes() {
            let along = if travels {
                integrate_way_mm(&time_s[pass.clone()], &feed?[pass.clone()])
            } else {
                time_s[pass.clone()].to_vec()
            };
            let (first, last) = (along[0], along[along.len() - 1]);
            // Between what is entered and the first row lies half a row's way in the mean: a fast feed is through by then.
            let half = if travels { 0.5 * (last - first) / count_to_f64((along.len() - 1).max(1)) } else { 0.0 };
            for (row, at) in pass.clone().zip(&along) {
                entry[row] = fades(at - first + half, over);
                exit[row] = fades(last - at + half, exit_over);
            }
        }
        if form.name == "settling" {
            return Some(vec![("settling", multiply_cut(scene, |row| entry[row])?)]);
        }
        Some(vec![("entry", multiply_cut(scene, |row| entry[row])?), ("exit", multiply_cut(scene, |row| exit[row])?)])
    }

    fn reads_load(&self) -> bool {
        true
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::from_shape(&[("length_s", 1.0)])
    }
}

/// Sampling periods from which on the entry is more than an edge: tool, chip and work settle over a good part of a pass.
const SETTLING_PERIODS: f64 = 8.0;

/// Names of the lengths of entry and exit, as times and as ways.
const TIMES: [&str; 2] = ["length_s", "exit_length_s"];
const WAYS: [&str; 2] = ["length_mm", "exit_length_mm"];

/// Forms of this name with an entry of this length, and an exit half as long and as long.
fn build_entry_forms(name: &'static str, [entry, exit]: [&'static str; 2], length: f64) -> [Form; 2] {
    [0.5, 1.0].map(|share| Form { name, ..Form::from_shape(&[(entry, length), (exit, share * length)]) })
}

/// The form over the way at the feed.
const TRAVEL: &str = "travel";
/// Ways over which a cut may build up, mm.
const WAYS_MM: [f64; 4] = [0.5, 1.5, 5.0, 15.0];
/// Passes in which a way must last a row at least.
const TOLD_IN: usize = 3;
/// Ratio of the feeds at which a way is something else than a time.
const FEEDS_APART: f64 = 1.3;

/// The ways that this recording can tell: they last for a row or more, and for no more than a third of the pass.
fn list_entry_ways_mm(scene: &Scene) -> Vec<f64> {
    let Some(feed) = scene.column("feed_mm_min") else { return Vec::new() };
    let mm_s = |pass: &Range<usize>| feed[pass.start + pass.len() / 2] / 60.0;
    let passes = || scene.passes().iter().filter(|pass| feed[(*pass).clone()].iter().all(|feed| *feed > 0.0));
    let (slowest, fastest) = passes().map(mm_s).fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
    if passes().count() < scene.passes().len() || fastest < FEEDS_APART * slowest {
        return Vec::new();
    }
    let tells = |way_mm: &f64| {
        let lasts =
            |pass: &&Range<usize>| (scene.period_s()..=compute_length_s(scene, pass) / 3.0).contains(&(way_mm / mm_s(pass)));
        passes().filter(lasts).count() >= TOLD_IN
    };
    WAYS_MM.into_iter().filter(tells).collect()
}

fn compute_length_s(scene: &Scene, pass: &Range<usize>) -> f64 {
    scene.time_s()[pass.end - 1] - scene.time_s()[pass.start]
}
