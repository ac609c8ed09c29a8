//! Thermal error of a milling spindle with 13 temperature points: the order of the grey relational grades.

use crate::published::Row;
use rules::estimators::thermal::{Normalisation, RHO_USUAL, Series, compute_grades};

/// Point, rank as published, and a warm-up that yields that order: start in °C, rise in K after three hours, time
/// constant in minutes. The temperatures of the publication are lost; its grades rank points by relative rise.
const POINTS: [(&str, f64, [f64; 3]); 13] = [
    ("X1 room", 8.0, [20.0, 5.0, 400.0]),
    ("X2 cover", 11.0, [20.3, 4.3, 180.0]),
    ("X3 screw sleeve", 5.0, [20.6, 6.8, 90.0]),
    ("X4 column", 13.0, [20.1, 3.7, 400.0]),
    ("X5 Z slide", 6.0, [20.4, 6.5, 150.0]),
    ("X6 table", 9.0, [20.2, 4.7, 250.0]),
    ("X7 Z motor", 7.0, [20.8, 5.1, 60.0]),
    ("X8 spindle motor", 1.0, [21.0, 16.0, 25.0]),
    ("X9 guide plate", 10.0, [20.2, 4.5, 200.0]),
    ("X10 Z guide", 4.0, [20.3, 8.4, 120.0]),
    ("X11 bed", 12.0, [20.1, 4.0, 350.0]),
    ("X12 box bearing", 3.0, [20.9, 10.6, 45.0]),
    ("X13 spindle box", 2.0, [20.7, 12.6, 70.0]),
];

/// Three hours, a row every five minutes.
fn warm_up([start, rise, tau_min]: [f64; 3]) -> Vec<f64> {
    let reached = 1.0 - (-180.0 / tau_min).exp();
    (0..=36).map(|row| start + rise * (1.0 - (-f64::from(row) * 5.0 / tau_min).exp()) / reached).collect()
}

pub(crate) fn rows() -> Vec<Row> {
    // The error has the time constant of the spindle box, and was not set to zero at the start.
    let error_um = warm_up([22.0, 38.0, 70.0]);
    let temperatures = POINTS.map(|(_, _, course)| warm_up(course));
    let series: Vec<Series<'_>> =
        POINTS.iter().zip(&temperatures).map(|((name, ..), values)| Series { name, values }).collect();
    let ranks = |normalisation| compute_grades(&error_um, &series, normalisation, RHO_USUAL).expect("gradable").grades;
    let image = ranks(Normalisation::InitialImage);
    let mut rows: Vec<Row> = POINTS
        .iter()
        .zip(&image)
        .map(|((name, published, _), ours)| {
            Row::new(format!("rank by grey grade, {name}"), *published, ours.rank as f64, 0.0, "002, grades (order)")
        })
        .collect();
    let range = ranks(Normalisation::Range);
    rows.push(Row::new(
        "rank of the point with the dynamics of the error, by range",
        1.0,
        range[12].rank as f64,
        0.0,
        "002, weakness, recomputed",
    ));
    rows
}
