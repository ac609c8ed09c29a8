//! The depth of cut changes along the pass: a tapered blank, or tool and work that bend away.

use crate::cut::{estimate_cut_load, multiply_cut, integrate_way_mm};
use crate::excitation::has_variation;
use crate::{Bound, Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Role, Scene, Texts};
use std::borrow::Cow;
use std::ops::Range;

/// Depth that changes along the pass.
#[derive(Debug, Clone, Copy)]
pub struct DepthTaper;

static DOC: EffectDoc = EffectDoc {
    kind: "depth_taper",
    family: "cutting",
    law: "y = (slope * s + curve * (s^2 - 1/12)) * L; s from -1/2 to 1/2 along the pass, by axis position where it moves, else by feed or time; distance: y = (slope * d + curve * d^2) * L, d from the start of the pass in lengths of the longest one",
    parameters: &[
        ParameterDoc::new_linear(
            "slope",
            "1",
            (-0.5, 0.5),
            "change of the cut from one end of the pass to the other, as a share",
            "走刀两端之间切削量变化的比例",
        ),
        ParameterDoc::new_linear(
            "curve",
            "1",
            (-2.0, 2.0),
            "how much the ends differ from the middle",
            "两端与中部之差的比例",
        ),
    ],
    needs: &["load | engaged"],
    source: "ap(z) = ap0 (1 + k1 z + k2 z^2), 2-15 % over a pass",
    experiment_minutes: 4.0,
    rivals: &["entry_exit", "clock_lag", "bearing_warm_up"],
    en: Texts {
        name: "taper along the pass",
        statement: "The depth of cut changes along each pass: the blank is tapered, or tool and work bend away",
        absence: "within every pass the residual rises or falls steadily, and starts again in the next pass",
        confused_with: "a late meter (only at the ends), warm-up (does not start again with each pass)",
        experiment: "cut one pass in the opposite direction",
    },
    zh: Texts {
        name: "沿走刀的切深变化",
        statement: "每次走刀中切深逐渐变化：毛坯带锥度，或刀具工件让刀",
        absence: "每次走刀内残差稳定上升或下降，下一次走刀重新开始",
        confused_with: "仪表滞后（仅在两端）、热机（不随每次走刀重新开始）",
        experiment: "反向走刀一次",
    },
};

impl Effect for DepthTaper {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn bound(&self) -> Bound {
        // a depth that varies by more than itself is another operation
        Bound::Cut(0.8)
    }

    fn form_names(&self) -> &'static [&'static str] {
        &["linear", "quadratic", "distance", "distance_quadratic"]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        if estimate_cut_load(scene).is_none() || !scene.passes().iter().any(|pass| pass.len() >= 5) {
            return Vec::new();
        }
        let named = |name| Form { name, ..Form::without_shape() };
        let mut forms = vec![named("linear"), named("quadratic")];
        // Where another drive settles in each pass, what fades by the time in the pass has been asked for by name.
        if lengths_differ(scene) && scene.feed_load_growth().is_none() {
            forms.extend([named("distance"), named("distance_quadratic")]);
        }
        forms
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let by_distance = form.name.starts_with("distance");
        let (along, middle) = if by_distance { (compute_start_distance(scene), 0.0) } else { (compute_pass_position(scene), 1.0 / 12.0) };
        let mut columns = vec![("slope", multiply_cut(scene, |row| along[row].unwrap_or(0.0))?)];
        if form.name.ends_with("quadratic") {
            let curve = |row: usize| along[row].map_or(0.0, |s| s * s - middle);
            columns.push(("curve", multiply_cut(scene, curve)?));
        }
        Some(columns)
    }
}

/// Where each row stands along its pass, -1/2 to 1/2; `None` out of the cut.
fn compute_pass_position(scene: &Scene) -> Vec<Option<f64>> {
    let mut along = vec![None; scene.rows()];
    for pass in scene.passes() {
        let places = read_places(scene, pass);
        let low = places.iter().copied().fold(f64::INFINITY, f64::min);
        let length = measure_length(&places).max(f64::MIN_POSITIVE);
        along[pass.clone()]
            .iter_mut()
            .zip(places.iter())
            .for_each(|(along, at)| *along = Some((at - low) / length - 0.5));
    }
    along
}

/// How far each row stands from the start of its pass, in lengths of the longest one; `None` out of the cut. A tool or a
/// work piece that bends away does so by the place, not by the share of a pass.
fn compute_start_distance(scene: &Scene) -> Vec<Option<f64>> {
    let mut along = vec![None; scene.rows()];
    let longest = measure_pass_lengths(scene).into_iter().fold(0.0, f64::max);
    for pass in scene.passes() {
        let places = read_places(scene, pass);
        let start = places.first().copied().unwrap_or(0.0);
        let from = |at: &f64| Some((at - start).abs() / longest.max(f64::MIN_POSITIVE));
        along[pass.clone()].iter_mut().zip(places.iter()).for_each(|(along, at)| *along = from(at));
    }
    along
}

/// Is there a pass that is shorter by more than a tenth than the longest?
fn lengths_differ(scene: &Scene) -> bool {
    let lengths = measure_pass_lengths(scene);
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    lengths.iter().any(|length| *length < 0.9 * longest)
}

/// How long each pass is.
fn measure_pass_lengths(scene: &Scene) -> Vec<f64> {
    scene.passes().iter().map(|pass| measure_length(&read_places(scene, pass))).collect()
}

/// Positions of a pass where the axis moves, else the way that the feed tells, else times.
fn read_places<'s>(scene: &'s Scene, pass: &Range<usize>) -> Cow<'s, [f64]> {
    let position = scene.role_values(Role::Position).map(|position| &position[pass.clone()]);
    let time_s = &scene.time_s()[pass.clone()];
    match (position.filter(|position| has_variation(position)), scene.column("feed_mm_min")) {
        (Some(position), _) => Cow::Borrowed(position),
        (None, Some(feed)) if feed[pass.clone()].iter().all(|feed| *feed > 0.0) => {
            Cow::Owned(integrate_way_mm(time_s, &feed[pass.clone()]))
        }
        _ => Cow::Borrowed(time_s),
    }
}

fn measure_length(places: &[f64]) -> f64 {
    let low = places.iter().copied().fold(f64::INFINITY, f64::min);
    places.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
}
