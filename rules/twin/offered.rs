//! The empirical forms that a recording offers: a bent line over every channel, peaks over the speed, and what fades
//! through every pass - the yardstick that names are held against.

use super::channel::{
    SIMULATED_CUT, SIMULATED_CUT_PER_KRPM, SIMULATED_OUTPUT, TIME, TIME_IN_CUT, TIME_IN_RUN, channel_values,
};
use super::designs::{Design, wanted};
use super::empirical::{Empirical, FADING_PERIODS, Multiplier, Shape, as_design, factor_values};
use super::frame::Frame;
use super::model::Model;
use crate::physics::{Role, Scene};
use crate::statistics::count;

/// Places at which a peak is tried, before neighbours are joined.
const PEAKS: usize = 12;

/// Every empirical form this scene offers.
pub(super) fn empirical_designs(scene: &Scene, frame: &Frame, model: &Model) -> Vec<Design> {
    let mut channels = empirical_channels(scene);
    channels.extend([TIME_IN_RUN, TIME, TIME_IN_CUT, SIMULATED_CUT, SIMULATED_CUT_PER_KRPM].map(str::to_owned));
    // Where there is a cut, it is the cut that bends.
    channels.extend(scene.load().is_none().then(|| SIMULATED_OUTPUT.to_owned()));
    let factors = [Multiplier::Always, Multiplier::InTheCut, Multiplier::WithTheCut, Multiplier::Turning];
    let bent = channels.iter().flat_map(|channel| factors.map(|factor| form(scene, frame, channel, factor)));
    // How friction bends over the speed has names.
    let of_motion = [Role::Velocity, Role::Acceleration].map(|role| scene.role_name(role));
    let elsewhere = channels.iter().filter(|channel| !of_motion.contains(&Some(channel.as_str())));
    let friction = elsewhere.map(|channel| form(scene, frame, channel, Multiplier::AgainstMotion));
    let forms =
        bent.chain(friction).chain(peaks(scene).into_iter().map(Some)).chain(fading(scene).into_iter().map(Some));
    // What always drifts has a name.
    let drift = crate::physics::effect("zero_drift").is_some_and(|effect| wanted(effect, model));
    let unnamed = |form: &Empirical| !(drift && form.channel == TIME && form.factor == Multiplier::Always);
    forms.flatten().filter(unnamed).filter_map(|form| as_design(form, scene, frame)).collect()
}

/// Bent lines that grow with the speed or the acceleration: two drivers together, where nothing simpler tells.
pub(super) fn products(scene: &Scene, frame: &Frame) -> Vec<Design> {
    let mut channels = empirical_channels(scene);
    channels.extend([SIMULATED_CUT, SIMULATED_CUT_PER_KRPM].map(str::to_owned));
    let factors = [Multiplier::WithTheSpeed, Multiplier::WithTheSpeedSquared, Multiplier::WithTheAcceleration];
    let forms = channels.iter().flat_map(|channel| factors.map(|factor| form(scene, frame, channel, factor)));
    forms.flatten().filter_map(|form| as_design(form, scene, frame)).collect()
}

/// The recorded channels over which a form may be drawn.
pub(super) fn empirical_channels(scene: &Scene) -> Vec<String> {
    scene.column_names().filter(|name| !is_output(scene, name)).map(str::to_owned).collect()
}

/// Measured outputs beside the simulated one must not explain it.
fn is_output(scene: &Scene, name: &str) -> bool {
    let measured = ["power", "current", "load_pct", "force_n", "torque", "thermal_error", "_counts"];
    name == scene.output() || measured.iter().any(|word| name.contains(word))
}

fn form(scene: &Scene, frame: &Frame, name: &str, factor: Multiplier) -> Option<Empirical> {
    let weights = frame.reduce(&factor_values(scene, factor)?);
    let values = frame.reduce(&channel_values(scene, name)?);
    let mut inside: Vec<f64> =
        values.iter().zip(&weights).filter(|(_, weight)| **weight != 0.0).map(|(x, _)| *x).collect();
    inside.sort_by(f64::total_cmp);
    let at = |share: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
        let index = (share * count(inside.len().saturating_sub(1))) as usize;
        inside.get(index).copied()
    };
    let (low, high) = (at(0.0)?, at(1.0)?);
    if inside.len() < 20 || high - low <= 1e-9 * high.abs().max(low.abs()) {
        return None;
    }
    let mut knots: Vec<f64> =
        [0.25, 0.5, 0.75].iter().filter_map(|share| at(*share)).filter(|knot| *knot > low && *knot < high).collect();
    knots.dedup();
    Some(Empirical { channel: name.to_owned(), shape: Shape::Bent(knots), origin: low, scale: high - low, factor })
}

/// Peaks over the spindle speed, at the speeds that the recording visits.
fn peaks(scene: &Scene) -> Vec<Empirical> {
    let (Some(name), Some(speed)) = (scene.role_name(Role::Speed), scene.role(Role::Speed)) else {
        return Vec::new();
    };
    let mut turning: Vec<f64> = speed.iter().map(|n| n.abs()).filter(|n| *n > 1.0).collect();
    turning.sort_by(f64::total_cmp);
    let Some(top) = turning.last().copied() else { return Vec::new() };
    let mut centres: Vec<f64> = (0..PEAKS).map(|k| turning[k * (turning.len() - 1) / (PEAKS - 1)]).collect();
    centres.dedup_by(|a, b| (*a - *b).abs() < 0.04 * *b);
    let one = |centre: f64, share: f64, factor: Multiplier| Empirical {
        channel: name.to_owned(),
        shape: Shape::Peak(centre, share * centre),
        origin: 0.0,
        scale: top,
        factor,
    };
    let of = |centre: &f64| [0.06, 0.12, 0.25].map(|share| (*centre, share));
    let visited: Vec<(f64, f64)> = centres.iter().flat_map(of).collect();
    // What resonates need not stand at a speed that the work asks for.
    let between: Vec<f64> = centres.windows(2).map(|pair| (pair[0] * pair[1]).sqrt()).collect();
    let between = between.iter().flat_map(of).map(|(centre, share)| one(centre, share, Multiplier::Turning));
    let factors = [Multiplier::Turning, Multiplier::InTheCut, Multiplier::WithTheCut];
    let at_visited = visited.iter().flat_map(|(centre, share)| factors.map(|factor| one(*centre, *share, factor)));
    at_visited.chain(between).collect()
}

/// What each pass begins with and loses over seconds.
fn fading(scene: &Scene) -> Vec<Empirical> {
    let told = |over_s: &f64| *over_s >= FADING_PERIODS * scene.period_s();
    let one = |over_s: f64, factor: Multiplier| Empirical {
        channel: TIME_IN_CUT.to_owned(),
        shape: Shape::Fading(over_s),
        origin: 0.0,
        scale: 1.0,
        factor,
    };
    let times = [3.0, 4.5, 6.0, 9.0, 12.0, 18.0, 24.0].into_iter().filter(told);
    times.flat_map(|over_s| [Multiplier::InTheCut, Multiplier::WithTheCut].map(|factor| one(over_s, factor))).collect()
}
