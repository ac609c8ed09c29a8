//! Empirical forms: what remains is described over one input, without claiming a cause.
//!
//! A form is a bent line over one channel (slope and three hinges at its quartiles), by itself, in the cut only, or in
//! proportion to the removal rate. It is the yardstick for "something real remains that no candidate explains".

use super::designs::Design;
use super::frame::Frame;
use super::model::{Body, Parameter, Part};
use crate::physics::{Entry, Role, Scene};

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
}

/// A bent line over one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Empirical {
    /// The channel, or one of the words `time in the run`, `time`.
    pub channel: String,
    /// Where the line bends, increasing.
    pub knots: Vec<f64>,
    /// Channel value that counts as zero.
    pub origin: f64,
    /// Channel distance that counts as one.
    pub scale: f64,
    /// What multiplies it.
    pub factor: Factor,
}

/// Seconds since the first row of the run.
const TIME_IN_RUN: &str = "time_in_run_s";
/// Seconds as recorded.
const TIME: &str = "time_s";

impl Empirical {
    /// One column per coefficient: level, slope and hinges.
    #[must_use]
    pub fn columns(&self, scene: &Scene) -> Option<Vec<(String, Vec<f64>)>> {
        let values = channel_values(scene, &self.channel)?;
        let factor = factor_values(scene, self.factor)?;
        let along = |x: f64| (x - self.origin) / self.scale;
        let column =
            |law: &dyn Fn(f64) -> f64| values.iter().zip(&factor).map(|(x, factor)| factor * law(along(*x))).collect();
        let mut columns = vec![("slope".to_owned(), column(&|x| x))];
        if self.factor != Factor::Always {
            columns.insert(0, ("level".to_owned(), column(&|_| 1.0)));
        }
        for (index, knot) in self.knots.iter().enumerate() {
            let bend = along(*knot);
            columns.push((format!("bend_{}", index + 1), column(&|x| (x - bend).max(0.0))));
        }
        Some(columns)
    }

    /// The form in words, for the report.
    #[must_use]
    pub fn equation(&self) -> String {
        let knots: Vec<String> = self.knots.iter().map(|knot| format!("{knot:.4}")).collect();
        let factor = match self.factor {
            Factor::Always => "",
            Factor::InTheCut => "engaged * ",
            Factor::WithTheCut => "removal rate * ",
            Factor::Turning => "(spindle turning) * ",
        };
        format!("y = {factor}bent line over {} with bends at {}", self.channel, knots.join(", "))
    }

    /// The form as a `rhai` expression over columns and the part's parameters, so that a model can carry it.
    #[must_use]
    pub fn expression(&self) -> String {
        let x = format!("(({} - {:?}) / {:?})", self.channel, self.origin, self.scale);
        let mut terms = vec![format!("slope * {x}")];
        if self.factor != Factor::Always {
            terms.insert(0, "level".to_owned());
        }
        for (index, knot) in self.knots.iter().enumerate() {
            let bend = (knot - self.origin) / self.scale;
            terms.push(format!("bend_{} * (if {x} > {bend:?} {{ {x} - {bend:?} }} else {{ 0.0 }})", index + 1));
        }
        let factor = match self.factor {
            Factor::Always => "1.0",
            Factor::InTheCut => "engaged",
            Factor::WithTheCut => "engaged * removal_rate_cm3_min",
            Factor::Turning => "(if spindle_speed_rpm > 1.0 { 1.0 } else { 0.0 })",
        };
        format!("({factor}) * ({})", terms.join(" + "))
    }
}

fn channel_values(scene: &Scene, channel: &str) -> Option<Vec<f64>> {
    match channel {
        TIME => Some(scene.clock_s().to_vec()),
        TIME_IN_RUN => {
            let mut values = scene.time_s().to_vec();
            for run in scene.runs() {
                let start = scene.time_s()[run.start];
                values[run.clone()].iter_mut().for_each(|x| *x -= start);
            }
            Some(values)
        }
        _ => scene.column(channel).map(<[f64]>::to_vec),
    }
}

fn factor_values(scene: &Scene, factor: Factor) -> Option<Vec<f64>> {
    let speed = || scene.role(Role::Speed);
    match factor {
        Factor::Always => Some(vec![1.0; scene.rows()]),
        Factor::InTheCut => scene.role(Role::Engaged).map(<[f64]>::to_vec),
        Factor::Turning => speed().map(|n| n.iter().map(|n| f64::from(u8::from(n.abs() > 1.0))).collect()),
        Factor::WithTheCut => {
            let (engaged, rate) = (scene.role(Role::Engaged)?, scene.column("removal_rate_cm3_min")?);
            Some(engaged.iter().zip(rate).map(|(engaged, rate)| engaged * rate).collect())
        }
    }
}

/// Every empirical form this scene offers.
#[must_use]
pub fn empirical_designs(scene: &Scene, frame: &Frame) -> Vec<Design> {
    let mut channels: Vec<String> =
        scene.column_names().filter(|name| !is_output(scene, name)).map(str::to_owned).collect();
    channels.push(TIME_IN_RUN.to_owned());
    channels.push(TIME.to_owned());
    let factors = [Factor::Always, Factor::InTheCut, Factor::WithTheCut, Factor::Turning];
    let forms = channels.iter().flat_map(|channel| factors.map(|factor| form(scene, frame, channel, factor)));
    forms.flatten().filter_map(|form| design(form, scene, frame)).collect()
}

/// Measured outputs beside the simulated one must not explain it.
fn is_output(scene: &Scene, name: &str) -> bool {
    let measured = ["power", "current", "load_pct", "force_n", "torque", "thermal_error", "_counts"];
    name == scene.output() || measured.iter().any(|word| name.contains(word))
}

fn form(scene: &Scene, frame: &Frame, channel: &str, factor: Factor) -> Option<Empirical> {
    let weights = frame.reduce(&factor_values(scene, factor)?);
    let values = frame.reduce(&channel_values(scene, channel)?);
    let mut inside: Vec<f64> =
        values.iter().zip(&weights).filter(|(_, weight)| **weight > 0.0).map(|(x, _)| *x).collect();
    inside.sort_by(f64::total_cmp);
    let at = |share: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
        let index = (share * super::noise::count(inside.len().saturating_sub(1))) as usize;
        inside.get(index).copied()
    };
    let (low, high) = (at(0.0)?, at(1.0)?);
    if inside.len() < 20 || high - low <= 1e-9 * high.abs().max(low.abs()) {
        return None;
    }
    let mut knots: Vec<f64> =
        [0.25, 0.5, 0.75].iter().filter_map(|share| at(*share)).filter(|knot| *knot > low && *knot < high).collect();
    knots.dedup();
    Some(Empirical { channel: channel.to_owned(), knots, origin: low, scale: high - low, factor })
}

fn design(form: Empirical, scene: &Scene, frame: &Frame) -> Option<Design> {
    let columns = form.columns(scene)?;
    let any = (f64::NEG_INFINITY, f64::INFINITY);
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
        freedom: columns.len(),
        ln_choices: 0.0,
        reluctance: 0.0,
        part,
        columns,
    })
}
