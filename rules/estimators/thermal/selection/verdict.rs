//! Why a sensor is in or out, in words.

use super::{Graded, SensorSelection, with};
use crate::regression::Refusal;
use crate::thermal::course::Course;
use crate::thermal::grey::Grades;
use crate::thermal::quantities;
use serde::Serialize;

/// One sensor and why it is in or out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorVerdict {
    /// Name of the sensor's channel.
    pub sensor: String,
    /// Is it one of the sensors to use?
    pub chosen: bool,
    /// Why it is in or out, in words.
    pub reason: String,
    /// Correlation with the error; none where the sensor cannot be used.
    pub correlation: Option<f64>,
    /// Grey relational grade with the initial image; none where it cannot be had.
    pub grade_initial_image: Option<f64>,
    /// The same with the range.
    pub grade_range: Option<f64>,
    /// Greatest variance inflation of the chosen sensors with this one; none where they depend on each other.
    pub variance_inflation: Option<f64>,
    /// Error in blocks left out with the chosen sensors and this one, um.
    pub held_out_rms_um: Option<f64>,
}

pub(super) fn judge_sensors(
    search: &SensorSelection,
    course: &Course,
    chosen: &[usize],
    graded: &Graded,
) -> Vec<SensorVerdict> {
    (0..course.sensors().len()).map(|at| judge_sensor(search, course, chosen, graded, at)).collect()
}

fn judge_sensor(
    search: &SensorSelection,
    course: &Course,
    chosen: &[usize],
    graded: &Graded,
    at: usize,
) -> SensorVerdict {
    let sensor = &course.sensors()[at];
    let is_chosen = chosen.contains(&at);
    let list = if is_chosen { chosen.to_vec() } else { with(chosen, at) };
    let unusable = quantities::temperature_is_usable(sensor.as_series(), course.rows()).err();
    let usable = unusable.is_none();
    let grade = |grades: &Option<Grades>| {
        grades.as_ref()?.grades.iter().find(|grade| grade.sensor == sensor.name).map(|grade| grade.grade)
    };
    let inflation = if usable { search.compute_inflation(&list).map(|it| it.0) } else { None };
    let error = if usable { search.score_sensors(&list).map(|it| it.rms_um) } else { None };
    let reason = match (unusable, is_chosen) {
        (Some(refusal), _) => without_place(refusal),
        (None, true) => explain_inclusion(search, chosen, at),
        (None, false) => explain_exclusion(search, course, chosen, at, inflation, error),
    };
    SensorVerdict {
        sensor: sensor.name.clone(),
        chosen: is_chosen,
        reason,
        correlation: usable.then(|| quantities::correlate_series(&sensor.values, course.error_um())),
        grade_initial_image: grade(&graded.image),
        grade_range: grade(&graded.range),
        variance_inflation: inflation,
        held_out_rms_um: error,
    }
}

fn without_place(refusal: Refusal) -> String {
    Refusal { place: String::new(), ..refusal }.to_string()
}

fn explain_inclusion(search: &SensorSelection, chosen: &[usize], at: usize) -> String {
    let others: Vec<usize> = chosen.iter().copied().filter(|other| *other != at).collect();
    let error = |list: &[usize]| search.score_sensors(list).map_or(f64::NAN, |it| it.rms_um);
    let without = error(&others);
    let what = if others.is_empty() { "the mean alone" } else { "the others alone" };
    format!("lowers the error of blocks left out to {:.2} um; {what} leave {without:.2} um", error(chosen))
}

fn explain_exclusion(
    search: &SensorSelection,
    course: &Course,
    chosen: &[usize],
    at: usize,
    inflation: Option<f64>,
    error: Option<f64>,
) -> String {
    let limit = search.settings.inflation_max;
    let twin = || {
        let like = |other: &&usize| correlate_sensors(course, at, **other).abs();
        let nearest = chosen.iter().max_by(|a, b| like(a).total_cmp(&like(b)));
        nearest.map_or_else(String::new, |other| {
            let (name, r) = (&course.sensors()[*other].name, correlate_sensors(course, at, *other));
            format!(", nearest {name} (correlation {r:.3})")
        })
    };
    match (inflation, error) {
        (None, _) => format!("is a linear combination of the chosen sensors{}", twin()),
        (Some(inflation), _) if inflation > limit => {
            format!("repeats the chosen sensors: variance inflation {inflation:.0}, allowed {limit:.0}{}", twin())
        }
        (_, None) => "the rows that remain without a block do not identify its coefficient".to_owned(),
        (_, Some(_)) if chosen.len() >= search.settings.sensors_max => {
            format!("{} sensors are enough as asked, and these predict better", chosen.len())
        }
        (_, Some(error)) => {
            let before = search.score_sensors(chosen).map_or(f64::NAN, |it| it.rms_um);
            format!("adds too little: the error of blocks left out would go from {before:.2} to {error:.2} um")
        }
    }
}

fn correlate_sensors(course: &Course, a: usize, b: usize) -> f64 {
    quantities::correlate_series(&course.sensors()[a].values, &course.sensors()[b].values)
}
