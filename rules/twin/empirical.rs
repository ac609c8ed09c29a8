//! Empirical forms: what remains is described over one input, without claiming a cause.
//!
//! A form is a bent line over one channel (slope and three hinges at its quartiles), a peak at one speed, something
//! that fades through each pass, a wave (`periodic`), or pulses that come again and again (`recurring_pulses`); by itself, in the
//! cut only, or in proportion to the removal rate or the speed. It is the yardstick for "something real remains that no
//! candidate explains".

use super::channel::{ACCELERATION, DIRECTION, channel_values};
use super::designs::Design;
use super::diagnosis::UNKNOWN;
use super::frame::Frame;
use super::model::{Parameter, Part, PartFunction};
use crate::physics::{Entry, OutputKind, Role, Scene};
use std::borrow::Cow;
use std::f64::consts::TAU;

/// By what the bent line is multiplied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Multiplier {
    /// Nothing: it acts always.
    Always,
    /// The engagement: it acts in the cut.
    InTheCut,
    /// Removal rate: it grows with the cut.
    WithTheCut,
    /// Running spindle.
    Turning,
    /// The speed of the spindle, in thousands of turns a minute.
    WithTheSpeed,
    /// Its square: what stirs or flings.
    WithTheSpeedSquared,
    /// The acceleration of a slide, in its own unit: it is a mass.
    WithTheAcceleration,
    /// Direction in which a slide moves: it is a friction.
    AgainstMotion,
}

/// What is drawn over a channel.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A line that bends at these values, increasing.
    Bent(Vec<f64>),
    /// A peak at one value, of this half width: the power that a resonance takes over the speed that excites it.
    Peak(f64, f64),
    /// What is there at first and fades over this distance.
    Fading(f64),
    /// A wave of this period, one of so many that can be told apart.
    Wave(f64, usize),
    /// A jump at one value and again after every interval, each of which fades.
    RecurringPulses {
        /// From one to the next.
        every: f64,
        /// The first.
        from: f64,
        /// The distance over which it fades.
        over: f64,
        /// Intervals and places that can be told apart.
        among: usize,
    },
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
    pub factor: Multiplier,
}

/// Sampling periods below which what fades is an edge.
pub(super) const FADING_PERIODS: f64 = 4.0;

impl Empirical {
    /// Is it one height of a given shape, rather than a line that bends where the recording asks for it?
    #[must_use]
    pub fn is_simple(&self) -> bool {
        !matches!(self.shape, Shape::Bent(_))
    }

    /// The same form with its place, width or time constant moved by this share of itself; nothing for a bent line.
    #[must_use]
    pub(super) fn neighbours(&self, step: f64) -> Vec<Self> {
        let (up, down) = (1.0 + step, 1.0 / (1.0 + step));
        let shapes = match self.shape {
            Shape::Bent(_) => Vec::new(),
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
            Shape::RecurringPulses { every, from, over, among } => {
                let pulses = |every: f64, from: f64, over: f64| Shape::RecurringPulses { every, from, over, among };
                // An interval is known by where the last shot stands.
                let (place, interval) = (step * over, step * over * every / self.scale);
                vec![
                    pulses(every, (from + place).rem_euclid(every), over),
                    pulses(every, (from - place).rem_euclid(every), over),
                    pulses(every + interval, from, over),
                    pulses(every - interval, from, over),
                    pulses(every, from, up * over),
                    pulses(every, from, down * over),
                ]
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
            Shape::RecurringPulses { every, from, over, .. } => {
                let (from, every, over) = (along(*from), every / self.scale, over / self.scale);
                let since = |x: f64| (x - from).rem_euclid(every);
                return Some(vec![("level".to_owned(), column(&|x| (-since(x) / over).exp()))]);
            }
        };
        let mut columns = vec![("slope".to_owned(), column(&|x| x))];
        if self.factor != Multiplier::Always {
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
            Multiplier::Always => "",
            Multiplier::InTheCut => "engaged * ",
            Multiplier::WithTheCut => "removal rate * ",
            Multiplier::Turning => "(spindle turning) * ",
            Multiplier::WithTheSpeed => "spindle krpm * ",
            Multiplier::WithTheSpeedSquared => "spindle krpm^2 * ",
            Multiplier::WithTheAcceleration => "acceleration * ",
            Multiplier::AgainstMotion => "(direction of motion) * ",
        };
        let shape = match &self.shape {
            Shape::Bent(knots) if knots.is_empty() => format!("line over {}", self.channel),
            Shape::Bent(knots) => {
                let knots: Vec<String> = knots.iter().map(|knot| format!("{knot:.4}")).collect();
                format!("bent line over {} with bends at {}", self.channel, knots.join(", "))
            }
            Shape::Peak(centre, width) => format!("peak over {} at {centre:.4}, half width {width:.4}", self.channel),
            Shape::Fading(over) => format!("exp(-{} / {over:.4})", self.channel),
            Shape::Wave(period, _) => format!("wave over {} with a period of {period:.4}", self.channel),
            Shape::RecurringPulses { every, from, over, .. } => {
                format!("exp(-(({} - {from:.4}) mod {every:.4}) / {over:.4})", self.channel)
            }
        };
        format!("y = {factor}{shape}")
    }

    /// The form as a `rhai` expression over columns and the part's parameters, so that a model can carry it.
    #[must_use]
    pub fn expression(&self) -> String {
        let x = format!("(({} - {:?}) / {:?})", self.channel, self.origin, self.scale);
        let form = self.shape_expression(&x);
        let factor = match self.factor {
            Multiplier::Always => "1.0",
            Multiplier::InTheCut => "engaged",
            Multiplier::WithTheCut => "engaged * removal_rate_cm3_min",
            Multiplier::Turning => "(if spindle_speed_rpm > 1.0 { 1.0 } else { 0.0 })",
            Multiplier::WithTheSpeed => "abs(spindle_speed_rpm) / 1000.0",
            Multiplier::WithTheSpeedSquared => "(spindle_speed_rpm / 1000.0) ** 2.0",
            Multiplier::WithTheAcceleration => ACCELERATION,
            Multiplier::AgainstMotion => DIRECTION,
        };
        format!("({factor}) * ({form})")
    }

    fn shape_expression(&self, x: &str) -> String {
        let along = |value: f64| (value - self.origin) / self.scale;
        let knots = match &self.shape {
            Shape::Bent(knots) => knots,
            Shape::Peak(centre, width) => {
                return format!("level / (1.0 + (({x} - {:?}) / {:?}) ** 2.0)", along(*centre), width / self.scale);
            }
            Shape::Fading(over) => return format!("level * exp(-{x} / {:?})", over / self.scale),
            Shape::Wave(period, _) => {
                let turns = TAU * self.scale / period;
                return format!("cosine * cos({turns:?} * {x}) + sine * sin({turns:?} * {x})");
            }
            Shape::RecurringPulses { every, from, over, .. } => {
                // The remainder of what is negative is negative.
                let (from, every, over) = (along(*from), every / self.scale, over / self.scale);
                return format!("level * exp(-(((({x} - {from:?}) % {every:?}) + {every:?}) % {every:?}) / {over:?})");
            }
        };
        let mut terms = vec![format!("slope * {x}")];
        if self.factor != Multiplier::Always {
            terms.insert(0, "level".to_owned());
        }
        for (index, knot) in knots.iter().enumerate() {
            let bend = along(*knot);
            terms.push(format!("bend_{} * (if {x} > {bend:?} {{ {x} - {bend:?} }} else {{ 0.0 }})", index + 1));
        }
        terms.join(" + ")
    }
}

pub(super) fn factor_values(scene: &Scene, factor: Multiplier) -> Option<Vec<f64>> {
    let speed = || scene.role(Role::Speed);
    match factor {
        Multiplier::Always => Some(vec![1.0; scene.rows()]),
        Multiplier::InTheCut => scene.role(Role::Engaged).map(<[f64]>::to_vec),
        Multiplier::AgainstMotion => {
            let force = scene.output_kind() == OutputKind::Force;
            force.then(|| channel_values(scene, DIRECTION))?.map(Cow::into_owned)
        }
        Multiplier::WithTheSpeed => speed().map(|n| n.iter().map(|n| n.abs() / 1000.0).collect()),
        Multiplier::WithTheSpeedSquared => speed().map(|n| n.iter().map(|n| (n / 1000.0).powi(2)).collect()),
        Multiplier::WithTheAcceleration => channel_values(scene, ACCELERATION).map(Cow::into_owned),
        Multiplier::Turning => speed().map(|n| n.iter().map(|n| f64::from(u8::from(n.abs() > 1.0))).collect()),
        Multiplier::WithTheCut => {
            let (engaged, rate) = (scene.role(Role::Engaged)?, scene.column("removal_rate_cm3_min")?);
            Some(engaged.iter().zip(rate).map(|(engaged, rate)| engaged * rate).collect())
        }
    }
}

/// A form as a hypothesis over these rows; `None` without its channel.
pub(super) fn as_design(form: Empirical, scene: &Scene, frame: &Frame) -> Option<Design> {
    let columns = form.columns(scene)?;
    let any = (f64::NEG_INFINITY, f64::INFINITY);
    // Where a peak stands and how wide it is has been chosen, as has how fast something fades.
    let chosen = match form.shape {
        Shape::Bent(_) => 0,
        Shape::Peak(..) => 2,
        Shape::RecurringPulses { .. } => 3,
        Shape::Fading(_) | Shape::Wave(..) => 1,
    };
    let among = match form.shape {
        Shape::Wave(_, among) | Shape::RecurringPulses { among, .. } => among,
        _ => 1,
    };
    let parameters = columns.iter().map(|(name, _)| Parameter {
        name: name.clone(),
        value: 0.0,
        fixed: false,
        entry: Entry::Linear,
        range: any,
        unit: "output".to_owned(),
    });
    let part = Part {
        kind: UNKNOWN.to_owned(),
        name: None,
        parameters: parameters.collect(),
        body: PartFunction::Empirical(form),
        line: 0,
    };
    let columns: Vec<Vec<f64>> = columns.iter().map(|(_, column)| frame.reduce(column)).collect();
    Some(Design {
        kind: UNKNOWN.to_owned(),
        ranges: vec![any; columns.len()],
        freedom: columns.len() + chosen,
        ln_choices: crate::statistics::count(among).ln(),
        reluctance: 0.0,
        noise: None,
        part,
        columns,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_without_a_bend_is_a_line() {
        let over = |knots: Vec<f64>| Empirical {
            channel: "depth_mm".to_owned(),
            shape: Shape::Bent(knots),
            origin: 0.0,
            scale: 1.0,
            factor: Multiplier::InTheCut,
        };
        assert_eq!(over(Vec::new()).equation(), "y = engaged * line over depth_mm");
        assert_eq!(over(vec![1.5]).equation(), "y = engaged * bent line over depth_mm with bends at 1.5000");
    }
}
