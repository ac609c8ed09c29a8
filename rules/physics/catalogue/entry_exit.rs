//! The cut builds up when the tool enters and fades when it leaves.

use crate::physics::cut::{cut, cut_times};
use crate::physics::{Columns, Effect, EffectDoc, Entry, Form, ParameterDoc, Scene, Texts};
use std::ops::Range;

/// Build-up and fading of the cut.
#[derive(Debug, Clone, Copy)]
pub struct EntryExit;

static DOC: EffectDoc = EffectDoc {
    kind: "entry_exit",
    family: "cutting",
    law: "y = (entry * exp(-(t - t_entry) / T) + exit * exp(-(t_exit - t) / T)) * L in each pass; settling: y = settling * exp(-(t - t_entry) / T) * L; ramp: y = (entry * max(0, 1 - (t - t_entry) / T) + exit * max(0, 1 - (t_exit - t) / T_exit)) * L",
    parameters: &[
        ParameterDoc {
            name: "entry",
            unit: "1",
            entry: Entry::Linear,
            range: (-1.0, 0.0),
            en: "share by which the cut differs on entry",
            zh: "切入时的差异比例",
        },
        ParameterDoc {
            name: "exit",
            unit: "1",
            entry: Entry::Linear,
            range: (-1.0, 0.0),
            en: "share by which it differs on exit",
            zh: "切出时的差异比例",
        },
        ParameterDoc {
            name: "settling",
            unit: "1",
            entry: Entry::Linear,
            range: (-1.0, 1.0),
            en: "share by which the cut differs at first and then settles",
            zh: "走刀初期的差异比例，随后稳定",
        },
        ParameterDoc {
            name: "length_s",
            unit: "s",
            entry: Entry::Shape,
            range: (0.05, 120.0),
            en: "how long entry and exit last",
            zh: "切入切出持续时间",
        },
        ParameterDoc {
            name: "exit_length_s",
            unit: "s",
            entry: Entry::Shape,
            range: (0.05, 120.0),
            en: "how long the exit lasts where it differs from the entry",
            zh: "切出持续时间（与切入不同时）",
        },
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
        &["ramp", "settling"]
    }

    fn forms(&self, scene: &Scene) -> Vec<Form> {
        if cut(scene).is_none() || scene.passes().len() < 3 {
            return Vec::new();
        }
        let longest_s = scene.passes().iter().map(|pass| length_s(scene, pass)).fold(0.0, f64::max);
        let told = |length_s: &f64| (scene.period_s()..=longest_s / 3.0).contains(length_s);
        let lengths_s = || [1.0, 3.0, 10.0, 30.0].into_iter().filter(told);
        let mut forms: Vec<Form> = lengths_s().map(|length_s| Form::of(&[("length_s", length_s)])).collect();
        let ramps = |length_s: f64| {
            let shares = [0.5, 1.0].into_iter();
            shares.map(move |share| Form {
                name: "ramp",
                ..Form::of(&[("length_s", length_s), ("exit_length_s", share * length_s)])
            })
        };
        forms.extend([2.0, 6.0].into_iter().filter(told).flat_map(ramps));
        // Over a good part of a pass nearly anything bends: only where another drive settles as well.
        let shown = scene.feed_load_growth().is_some();
        let long = lengths_s().filter(|_| shown).filter(|length_s| *length_s >= SETTLING_PERIODS * scene.period_s());
        forms.extend(long.map(|length_s| Form { name: "settling", ..Form::of(&[("length_s", length_s)]) }));
        forms
    }

    fn columns(&self, scene: &Scene, form: &Form) -> Option<Columns> {
        let over_s = form.value("length_s").unwrap_or(1.0).max(f64::MIN_POSITIVE);
        let exit_over_s = form.value("exit_length_s").unwrap_or(over_s).max(f64::MIN_POSITIVE);
        let fades =
            |s: f64, over_s: f64| if form.name == "ramp" { (1.0 - s / over_s).max(0.0) } else { (-s / over_s).exp() };
        let (mut entry, mut exit) = (vec![0.0; scene.rows()], vec![0.0; scene.rows()]);
        let time_s = scene.time_s();
        for pass in scene.passes() {
            for row in pass.clone() {
                entry[row] = fades(time_s[row] - time_s[pass.start], over_s);
                exit[row] = fades(time_s[pass.end - 1] - time_s[row], exit_over_s);
            }
        }
        if form.name == "settling" {
            return Some(vec![("settling", cut_times(scene, |row| entry[row])?)]);
        }
        Some(vec![("entry", cut_times(scene, |row| entry[row])?), ("exit", cut_times(scene, |row| exit[row])?)])
    }

    fn reads_load(&self) -> bool {
        true
    }

    fn default_form(&self, _scene: &Scene) -> Form {
        Form::of(&[("length_s", 1.0)])
    }
}

/// Sampling periods from which on the entry is more than an edge: tool, chip and work settle over a good part of a pass.
const SETTLING_PERIODS: f64 = 8.0;

fn length_s(scene: &Scene, pass: &Range<usize>) -> f64 {
    scene.time_s()[pass.end - 1] - scene.time_s()[pass.start]
}
