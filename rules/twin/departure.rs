//! How a machine departs from the law of a textbook: by a factor that changes with a channel, `law * (1 + d(x))`.
//!
//! The factor is linear between knots and constant beyond them, so that nothing is said where nothing was seen. At the middle
//! knot it is one: what is the same everywhere belongs to the size of the law.

use super::channel::{TIME, read_channel_values};
use super::model::{Parameter, Part};
use physics::{Entry, Scene};

/// How the names of the values at the knots begin.
pub(super) const DEPARTURE: &str = "departure[";
/// Usual deviation of a machine from the law at a knot: a third, as the forms of the laws differ among the sources of the
/// catalogue. Larger: the departure takes what belongs to other laws; smaller: the law stays stiff.
pub(super) const DEPARTURE_USUAL: f64 = 0.3;
/// Least and greatest departure: the law keeps its sign, and is at most four times itself.
const RANGE: (f64, f64) = (-1.0, 3.0);

/// A factor over a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Departure {
    /// The channel; of those that a formula may read.
    pub over: String,
    /// Knots in rising order, in the unit of the channel.
    pub x: Vec<f64>,
}

/// The name of the value at a knot of a departure, both counted from 0.
pub(super) fn name_knot(departure: usize, knot: usize) -> String {
    format!("{DEPARTURE}{departure}][{knot}]")
}

/// Is it the value of a departure at a knot, and no parameter of the law?
pub(super) fn is_of_departure(parameter: &Parameter) -> bool {
    parameter.name.starts_with(DEPARTURE)
}

impl Departure {
    /// Its values at the knots, as parameters; those that are none at `middle`, where the law is as it stands, are fitted.
    pub(super) fn build_parameters(&self, number: usize, y: &[f64], middle: Option<usize>) -> Vec<Parameter> {
        let of = |(knot, value): (usize, &f64)| Parameter {
            name: name_knot(number, knot),
            value: *value,
            fixed: middle == Some(knot),
            entry: Entry::Shape,
            range: RANGE,
            unit: "1".to_owned(),
        };
        y.iter().enumerate().map(of).collect()
    }

    /// Linear between the knots, constant beyond.
    pub(super) fn interpolate(&self, y: &[f64], x: f64) -> f64 {
        let above = self.x.partition_point(|knot| *knot <= x);
        match (above.checked_sub(1), self.x.get(above)) {
            (None, _) => y.first().copied().unwrap_or(0.0),
            (Some(below), None) => y[below],
            (Some(below), Some(next)) => {
                let share = (x - self.x[below]) / (next - self.x[below]);
                y[below] + share * (y[above] - y[below])
            }
        }
    }
}

impl Part {
    /// The factor by which the machine departs from the law, row by row; nothing inside where it does not. `None` when a
    /// channel is missing.
    #[expect(clippy::option_option, reason = "a missing input is another thing than no departure")]
    pub(super) fn compute_departure_factor(&self, scene: &Scene) -> Option<Option<Vec<f64>>> {
        if self.departures.is_empty() {
            return Some(None);
        }
        let mut factor = vec![1.0; scene.rows()];
        for (number, departure) in self.departures.iter().enumerate() {
            let values = read_channel_values(scene, &departure.over)?;
            let y = self.list_knot_values(number);
            if y.len() == departure.x.len() {
                factor.iter_mut().zip(values.iter()).for_each(|(factor, x)| *factor += departure.interpolate(&y, *x));
            }
        }
        Some(Some(factor))
    }

    /// Keeps what a departure over the time of a recording came to at its end: the clock of another recording starts anew.
    pub(super) fn hold_departures_over_time(&mut self) {
        for number in 0..self.departures.len() {
            let Some(last) = self.list_knot_values(number).last().copied() else { continue };
            if self.departures[number].over == TIME {
                let names: Vec<String> =
                    (0..self.departures[number].x.len()).map(|knot| name_knot(number, knot)).collect();
                let own = self.parameters.iter_mut().filter(|parameter| names.contains(&parameter.name));
                own.for_each(|parameter| parameter.value = last);
            }
        }
    }

    /// Values at the knots of a departure.
    pub(super) fn list_knot_values(&self, number: usize) -> Vec<f64> {
        let value = |knot| self.find_parameter(&name_knot(number, knot)).map(|parameter| parameter.value);
        (0..self.departures[number].x.len()).map_while(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_is_linear_between_knots_and_constant_beyond() {
        let departure = Departure { over: "x".to_owned(), x: vec![1.0, 2.0, 4.0] };
        let at = |x| departure.interpolate(&[-0.5, 0.0, 1.0], x);
        assert_eq!([0.0, 1.0, 1.5, 2.0, 3.0, 9.0].map(at), [-0.5, -0.5, -0.25, 0.0, 0.5, 1.0]);
    }
}
