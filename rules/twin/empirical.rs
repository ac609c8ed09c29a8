//! Empirical forms: what remains is described over one input, without claiming a cause.
//!
//! A form is a bent line over one channel (slope and three hinges at its quartiles), a peak at one speed, something
//! that fades through each pass, or a wave over the position of a slide or the time in the cut (`periodic`); by itself,
//! in the cut only, or in proportion to the removal rate. It is the yardstick for "something real remains that no
//! candidate explains".

use super::channel::{
    DIRECTION, SIMULATED_CUT, SIMULATED_CUT_PER_KRPM, TIME, TIME_IN_CUT, TIME_IN_RUN, channel_values,
};
use super::designs::Design;
use super::frame::Frame;
use super::model::{Body, Model, Parameter, Part};
use crate::physics::{Entry, OutputKind, Role, Scene};
use std::borrow::Cow;
use std::f64::consts::TAU;

/// By what the bent line is multiplied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Factor {
    /// Nothing: it acts always.
    Always,
    /// The engagement: it acts in the cut.
    InTheCut,
    /// Removal rate: it grows with the cut.
    WithTheCut,
    /// Running spindle.
    Turning,
    /// Direction in which a slide moves: it is a friction.
    AgainstMotion,
}

/// What is drawn over a channel.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A line that bends at these values, increasing.
    Bent(Vec<f64>),
    /// Nothing up to this value, a line from there upwards.
    Above(f64),
    /// Nothing down to this value, a line from there downwards.
    Below(f64),
    /// A peak at one value, of this half width: the power that a resonance takes over the speed that excites it.
    Peak(f64, f64),
    /// What is there at first and fades over this distance.
    Fading(f64),
    /// A wave of this period, one of so many that can be told apart.
    Wave(f64, usize),
}

/// A shape over one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Empirical {
    /// The name of the channel, which need not have been recorded (`channel.rs`).
    pub channel: String,
    /// What is drawn over the channel.
    pub shape: Shape,
    /// Channel value that counts as zero.
    pub origin: f64,
    /// Channel distance that counts as one.
    pub scale: f64,
    /// What multiplies it.
    pub factor: Factor,
}

/// Places at which a peak is tried, before neighbours are joined.
const PEAKS: usize = 12;
/// Sampling periods below which what fades is an edge.
const FADING_PERIODS: f64 = 4.0;

impl Empirical {
    /// Is it one height of a given shape, rather than a line that bends where the recording asks for it?
    #[must_use]
    pub fn is_simple(&self) -> bool {
        !matches!(self.shape, Shape::Bent(_) | Shape::Above(_) | Shape::Below(_))
    }

    /// The same form with its place, width or time constant moved by this share of itself; nothing for a bent line.
    #[must_use]
    pub(super) fn neighbours(&self, step: f64) -> Vec<Self> {
        let (up, down) = (1.0 + step, 1.0 / (1.0 + step));
        let shapes = match self.shape {
            Shape::Bent(_) | Shape::Above(_) | Shape::Below(_) => Vec::new(),
            Shape::Peak(centre, width) => vec![
                Shape::Peak(centre + step * width.max(0.2 * centre), width),
                Shape::Peak(centre - step * width.max(0.2 * centre), width),
                Shape::Peak(centre, up * width),
                Shape::Peak(centre, down * width),
            ],
            Shape::Fading(over) => vec![Shape::Fading(up * over), Shape::Fading(down * over)],
            Shape::Wave(period, among) => {
                // What a period is known by: a part of a turn over the whole distance.
                let turns = self.scale / period;
                vec![Shape::Wave(self.scale / (turns + step), among), Shape::Wave(self.scale / (turns - step), among)]
            }
        };
        shapes.into_iter().map(|shape| Self { shape, ..self.clone() }).collect()
    }

    /// One column per coefficient: level, slope and hinges.
    #[must_use]
    pub fn columns(&self, scene: &Scene) -> Option<Vec<(String, Vec<f64>)>> {
        let values = channel_values(scene, &self.channel)?;
        let factor = factor_values(scene, self.factor)?;
        let along = |x: f64| (x - self.origin) / self.scale;
        let column =
            |law: &dyn Fn(f64) -> f64| values.iter().zip(&factor).map(|(x, factor)| factor * law(along(*x))).collect();
        let knots = match &self.shape {
            Shape::Bent(knots) => knots,
            Shape::Above(knot) => return Some(vec![("slope".to_owned(), column(&|x| (x - along(*knot)).max(0.0)))]),
            Shape::Below(knot) => return Some(vec![("slope".to_owned(), column(&|x| (along(*knot) - x).max(0.0)))]),
            Shape::Peak(centre, width) => {
                let (centre, width) = (along(*centre), width / self.scale);
                return Some(vec![("level".to_owned(), column(&|x| 1.0 / (1.0 + ((x - centre) / width).powi(2))))]);
            }
            Shape::Fading(over) => {
                let over = over / self.scale;
                return Some(vec![("level".to_owned(), column(&|x| (-x / over).exp()))]);
            }
            Shape::Wave(period, _) => {
                let turns = TAU * self.scale / period;
                let (cosine, sine) = (column(&|x| (turns * x).cos()), column(&|x| (turns * x).sin()));
                return Some(vec![("cosine".to_owned(), cosine), ("sine".to_owned(), sine)]);
            }
        };
        let mut columns = vec![("slope".to_owned(), column(&|x| x))];
        if self.factor != Factor::Always {
            columns.insert(0, ("level".to_owned(), column(&|_| 1.0)));
        }
        for (index, knot) in knots.iter().enumerate() {
            let bend = along(*knot);
            columns.push((format!("bend_{}", index + 1), column(&|x| (x - bend).max(0.0))));
        }
        Some(columns)
    }

    /// The form in words, for the report.
    #[must_use]
    pub fn equation(&self) -> String {
        let factor = match self.factor {
            Factor::Always => "",
            Factor::InTheCut => "engaged * ",
            Factor::WithTheCut => "removal rate * ",
            Factor::Turning => "(spindle turning) * ",
            Factor::AgainstMotion => "(direction of motion) * ",
        };
        let shape = match &self.shape {
            Shape::Bent(knots) => {
                let knots: Vec<String> = knots.iter().map(|knot| format!("{knot:.4}")).collect();
                format!("bent line over {} with bends at {}", self.channel, knots.join(", "))
            }
            Shape::Above(knot) => format!("line over {} above {knot:.4}, nothing below", self.channel),
            Shape::Below(knot) => format!("line over {} below {knot:.4}, nothing above", self.channel),
            Shape::Peak(centre, width) => format!("peak over {} at {centre:.4}, half width {width:.4}", self.channel),
            Shape::Fading(over) => format!("exp(-{} / {over:.4})", self.channel),
            Shape::Wave(period, _) => format!("wave over {} with a period of {period:.4}", self.channel),
        };
        format!("y = {factor}{shape}")
    }

    /// The form as a `rhai` expression over columns and the part's parameters, so that a model can carry it.
    #[must_use]
    pub fn expression(&self) -> String {
        let x = format!("(({} - {:?}) / {:?})", self.channel, self.origin, self.scale);
        let form = self.shape_expression(&x);
        let factor = match self.factor {
            Factor::Always => "1.0",
            Factor::InTheCut => "engaged",
            Factor::WithTheCut => "engaged * removal_rate_cm3_min",
            Factor::Turning => "(if spindle_speed_rpm > 1.0 { 1.0 } else { 0.0 })",
            Factor::AgainstMotion => DIRECTION,
        };
        format!("({factor}) * ({form})")
    }

    fn shape_expression(&self, x: &str) -> String {
        let along = |value: f64| (value - self.origin) / self.scale;
        let knots = match &self.shape {
            Shape::Bent(knots) => knots,
            Shape::Above(knot) => {
                let knot = along(*knot);
                return format!("slope * (if {x} > {knot:?} {{ {x} - {knot:?} }} else {{ 0.0 }})");
            }
            Shape::Below(knot) => {
                let knot = along(*knot);
                return format!("slope * (if {x} < {knot:?} {{ {knot:?} - {x} }} else {{ 0.0 }})");
            }
            Shape::Peak(centre, width) => {
                return format!("level / (1.0 + (({x} - {:?}) / {:?}) ** 2.0)", along(*centre), width / self.scale);
            }
            Shape::Fading(over) => return format!("level * exp(-{x} / {:?})", over / self.scale),
            Shape::Wave(period, _) => {
                let turns = TAU * self.scale / period;
                return format!("cosine * cos({turns:?} * {x}) + sine * sin({turns:?} * {x})");
            }
        };
        let mut terms = vec![format!("slope * {x}")];
        if self.factor != Factor::Always {
            terms.insert(0, "level".to_owned());
        }
        for (index, knot) in knots.iter().enumerate() {
            let bend = along(*knot);
            terms.push(format!("bend_{} * (if {x} > {bend:?} {{ {x} - {bend:?} }} else {{ 0.0 }})", index + 1));
        }
        terms.join(" + ")
    }
}

pub(super) fn factor_values(scene: &Scene, factor: Factor) -> Option<Vec<f64>> {
    let speed = || scene.role(Role::Speed);
    match factor {
        Factor::Always => Some(vec![1.0; scene.rows()]),
        Factor::InTheCut => scene.role(Role::Engaged).map(<[f64]>::to_vec),
        Factor::AgainstMotion => {
            let force = scene.output_kind() == OutputKind::Force;
            force.then(|| channel_values(scene, DIRECTION))?.map(Cow::into_owned)
        }
        Factor::Turning => speed().map(|n| n.iter().map(|n| f64::from(u8::from(n.abs() > 1.0))).collect()),
        Factor::WithTheCut => {
            let (engaged, rate) = (scene.role(Role::Engaged)?, scene.column("removal_rate_cm3_min")?);
            Some(engaged.iter().zip(rate).map(|(engaged, rate)| engaged * rate).collect())
        }
    }
}

/// Every empirical form this scene offers.
#[must_use]
pub fn empirical_designs(scene: &Scene, frame: &Frame, model: &Model) -> Vec<Design> {
    let mut channels = empirical_channels(scene);
    channels.extend([TIME_IN_RUN, TIME, TIME_IN_CUT, SIMULATED_CUT, SIMULATED_CUT_PER_KRPM].map(str::to_owned));
    let factors = [Factor::Always, Factor::InTheCut, Factor::WithTheCut, Factor::Turning];
    let bent = channels.iter().flat_map(|channel| factors.map(|factor| form(scene, frame, channel, factor)));
    // How friction bends over the speed has names.
    let of_motion = [Role::Velocity, Role::Acceleration].map(|role| scene.role_name(role));
    let elsewhere = channels.iter().filter(|channel| !of_motion.contains(&Some(channel.as_str())));
    let friction = elsewhere.map(|channel| form(scene, frame, channel, Factor::AgainstMotion));
    let forms =
        bent.chain(friction).chain(peaks(scene).into_iter().map(Some)).chain(fading(scene).into_iter().map(Some));
    // What always drifts has a name.
    let drift = crate::physics::effect("zero_drift").is_some_and(|effect| super::designs::wanted(effect, model));
    let unnamed = |form: &Empirical| !(drift && form.channel == TIME && form.factor == Factor::Always);
    forms.flatten().filter(unnamed).filter_map(|form| as_design(form, scene, frame)).collect()
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

fn form(scene: &Scene, frame: &Frame, name: &str, factor: Factor) -> Option<Empirical> {
    let weights = frame.reduce(&factor_values(scene, factor)?);
    let values = frame.reduce(&channel_values(scene, name)?);
    let mut inside: Vec<f64> =
        values.iter().zip(&weights).filter(|(_, weight)| **weight != 0.0).map(|(x, _)| *x).collect();
    inside.sort_by(f64::total_cmp);
    let at = |share: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
        let index = (share * crate::statistics::count(inside.len().saturating_sub(1))) as usize;
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
    let one = |centre: f64, share: f64, factor: Factor| Empirical {
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
    let between = between.iter().flat_map(of).map(|(centre, share)| one(centre, share, Factor::Turning));
    let factors = [Factor::Turning, Factor::InTheCut, Factor::WithTheCut];
    let at_visited = visited.iter().flat_map(|(centre, share)| factors.map(|factor| one(*centre, *share, factor)));
    at_visited.chain(between).collect()
}

/// What each pass begins with and loses over seconds.
fn fading(scene: &Scene) -> Vec<Empirical> {
    let told = |over_s: &f64| *over_s >= FADING_PERIODS * scene.period_s();
    let one = |over_s: f64, factor: Factor| Empirical {
        channel: TIME_IN_CUT.to_owned(),
        shape: Shape::Fading(over_s),
        origin: 0.0,
        scale: 1.0,
        factor,
    };
    let times = [3.0, 4.5, 6.0, 9.0, 12.0, 18.0, 24.0].into_iter().filter(told);
    times.flat_map(|over_s| [Factor::InTheCut, Factor::WithTheCut].map(|factor| one(over_s, factor))).collect()
}

/// A form as a hypothesis over these rows; `None` without its channel.
pub(super) fn as_design(form: Empirical, scene: &Scene, frame: &Frame) -> Option<Design> {
    let columns = form.columns(scene)?;
    let any = (f64::NEG_INFINITY, f64::INFINITY);
    // Where a peak stands and how wide it is has been chosen, as has how fast something fades.
    let chosen = match form.shape {
        Shape::Bent(_) => 0,
        Shape::Peak(..) => 2,
        Shape::Above(_) | Shape::Below(_) | Shape::Fading(_) | Shape::Wave(..) => 1,
    };
    let among = if let Shape::Wave(_, among) = form.shape { among } else { 1 };
    let parameters = columns.iter().map(|(name, _)| Parameter {
        name: name.clone(),
        value: 0.0,
        fixed: false,
        entry: Entry::Linear,
        range: any,
        unit: "output".to_owned(),
    });
    let part = Part {
        kind: "unknown".to_owned(),
        name: None,
        parameters: parameters.collect(),
        body: Body::Empirical(form),
        line: 0,
    };
    let columns: Vec<Vec<f64>> = columns.iter().map(|(_, column)| frame.reduce(column)).collect();
    Some(Design {
        kind: "unknown".to_owned(),
        ranges: vec![any; columns.len()],
        freedom: columns.len() + chosen,
        ln_choices: crate::statistics::count(among).ln(),
        reluctance: 0.0,
        noise: None,
        part,
        columns,
    })
}
