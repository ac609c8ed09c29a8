//! What is asked of temperatures and thermal errors before anything is inferred from them.

use crate::regression::{Mistake, Plausible, Refusal, RefusalKind};

/// A named series, one value per row; the name ends in the unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Series<'a> {
    /// Name of the column, as messages tell it.
    pub name: &'a str,
    /// One finite number per row.
    pub values: &'a [f64],
}

/// Name of the error, as in a recording.
pub(super) const THERMAL_ERROR: &str = "thermal_error_um";

/// Rows below which nothing is said.
pub(super) const ROWS_MIN: usize = 8;

/// A temperature that changes by less than this, in kelvin, did not change: sensors resolve no better.
pub(super) const CHANGE_MIN_K: f64 = 0.2;

/// How much of a thermal error is seen on a machine tool, from the least to the greatest value of a recording: 1 um
/// (finer than most gauges) to 2 mm.
const ERROR_SPAN_UM: Plausible = Plausible {
    quantity: "thermal error (from least to greatest)",
    unit: "um",
    range: (1.0, 2000.0),
    mistakes: &[
        Mistake { unit: "mm", scale: 1000.0, offset: 0.0 },
        Mistake { unit: "nm", scale: 1e-3, offset: 0.0 },
        Mistake { unit: "m", scale: 1e6, offset: 0.0 },
    ],
};

/// Refuses what no law can be learned from: too few rows, values that are none, unequal lengths, a temperature that did
/// not change, kelvin for degrees Celsius, millimetres for micrometres.
///
/// # Errors
/// The first obstacle, with the series that it is in.
pub(super) fn check_series(error_um: &[f64], sensors: &[Series<'_>]) -> Result<(), Refusal> {
    let rows = error_um.len();
    if sensors.is_empty() {
        let next = "record temperatures as temperature_1_c, temperature_2_c, ... or bearing_temperature_c";
        return Err(Refusal::new(RefusalKind::Missing, "there is no temperature", next));
    }
    enough_rows(rows)?;
    error_is_usable(error_um)?;
    sensors.iter().try_for_each(|sensor| temperature_is_usable(*sensor, rows))
}

/// The part of [`check_series`] that concerns the number of rows.
///
/// # Errors
/// See [`check_series`].
pub(super) fn enough_rows(rows: usize) -> Result<(), Refusal> {
    if rows >= ROWS_MIN {
        return Ok(());
    }
    let next = format!("record at least {ROWS_MIN} rows, better an hour of warm-up at one a minute");
    Err(Refusal::new(RefusalKind::TooFew, format!("{rows} rows"), next).with_place(THERMAL_ERROR))
}

/// The part of [`check_series`] that concerns the error.
///
/// # Errors
/// See [`check_series`].
pub(super) fn error_is_usable(error_um: &[f64]) -> Result<(), Refusal> {
    check_finite(THERMAL_ERROR, error_um)?;
    let (least, greatest) = find_extremes(error_um);
    if greatest <= least {
        let next = "let the machine warm up while the gauge measures, and check the gauge";
        let what = format!("is {least} um in every row");
        return Err(Refusal::new(RefusalKind::Constant, what, next).with_place(THERMAL_ERROR));
    }
    ERROR_SPAN_UM.check_values([greatest - least]).map_err(|refusal| refusal.with_place(THERMAL_ERROR))
}

/// The part of [`check_series`] that concerns one temperature.
///
/// # Errors
/// See [`check_series`].
pub(super) fn temperature_is_usable(sensor: Series<'_>, rows: usize) -> Result<(), Refusal> {
    if sensor.values.len() != rows {
        let what = format!("{} rows where the error has {rows}", sensor.values.len());
        return Err(Refusal::new(RefusalKind::Mismatch, what, "give one temperature per row").with_place(sensor.name));
    }
    check_finite(sensor.name, sensor.values)?;
    Plausible::TEMPERATURE_C
        .check_values(sensor.values.iter().copied())
        .map_err(|refusal| refusal.with_place(sensor.name))?;
    let (least, greatest) = find_extremes(sensor.values);
    if greatest - least < CHANGE_MIN_K {
        let what = format!("changes by {:.3} K only", greatest - least);
        let next = "record a warm-up or cool-down that this sensor sees, or leave it out";
        return Err(Refusal::new(RefusalKind::Constant, what, next).with_place(sensor.name));
    }
    Ok(())
}

fn check_finite(name: &str, values: &[f64]) -> Result<(), Refusal> {
    let Some(row) = values.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let what = format!("no number in row {}", row + 1);
    Err(Refusal::new(RefusalKind::NotFinite, what, "leave rows without a value out").with_place(name))
}

/// Least and greatest of finite values; zeros for none.
#[must_use]
pub(super) fn find_extremes(values: &[f64]) -> (f64, f64) {
    let Some(first) = values.first() else { return (0.0, 0.0) };
    values.iter().fold((*first, *first), |(least, greatest), value| (least.min(*value), greatest.max(*value)))
}

/// Pearson's correlation of two series of the same length; 0 where one of them is constant.
#[must_use]
pub(super) fn correlate_series(a: &[f64], b: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(x, y)| f(x - mean_a, y - mean_b)).sum::<f64>();
    let size = (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt();
    if size > 0.0 { sum(&|x, y| x * y) / size } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(error_um: &[f64], temperature_c: &[f64]) -> Refusal {
        let sensors = [Series { name: "temperature_1_c", values: temperature_c }];
        check_series(error_um, &sensors).expect_err("nothing can be learned from it")
    }

    fn ramp(from: f64, to: f64) -> Vec<f64> {
        (0..=20).map(|row| from + (to - from) * f64::from(row) / 20.0).collect()
    }

    #[test]
    fn kelvin_and_millimetres_are_said() {
        let kelvin = refused(&ramp(0.0, 40.0), &ramp(293.0, 310.0));
        assert_eq!((kelvin.kind, kelvin.place.as_str()), (RefusalKind::Unit, "temperature_1_c"));
        assert!(kelvin.to_string().contains("looks like K"), "{kelvin}");
        let millimetres = refused(&ramp(0.0, 0.04), &ramp(20.0, 37.0));
        assert!(millimetres.to_string().contains("looks like mm"), "{millimetres}");
    }

    #[test]
    fn what_does_not_change_teaches_nothing() {
        assert_eq!(refused(&ramp(0.0, 40.0), &ramp(20.0, 20.1)).kind, RefusalKind::Constant);
        assert_eq!(refused(&[3.0; 21], &ramp(20.0, 37.0)).kind, RefusalKind::Constant);
        assert_eq!(refused(&[3.0; 4], &ramp(20.0, 37.0)).kind, RefusalKind::TooFew);
        assert_eq!(refused(&ramp(0.0, 40.0), &[20.0, 21.0]).kind, RefusalKind::Mismatch);
        let mut holed = ramp(20.0, 37.0);
        holed[3] = f64::NAN;
        assert_eq!(refused(&ramp(0.0, 40.0), &holed).kind, RefusalKind::NotFinite);
        assert_eq!(check_series(&ramp(0.0, 40.0), &[]).expect_err("none").kind, RefusalKind::Missing);
    }
}
