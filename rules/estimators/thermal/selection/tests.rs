//! The right sensors, twins left out with the reason, and grades that would have chosen badly.

use super::*;
use crate::thermal::bed::{self, ROUGH};
use crate::thermal::course::Sensor;

fn course(seed: u64) -> Course {
    let mut random = bed::create_random(seed);
    let course = bed::warm_ups(&mut random, 5, 200);
    let law = (-50.0, &[("temperature_1_c", 4.0), ("ambient_temperature_c", -2.0)][..]);
    bed::with_error(&mut random, &course, law, 0.0, ROUGH)
}

fn names(course: &Course, chosen: &[usize]) -> Vec<String> {
    chosen.iter().map(|at| course.sensors()[*at].name.clone()).collect()
}

#[test]
fn the_sensors_of_the_law_are_chosen_and_a_twin_is_left_out_with_the_reason() {
    let course = course(3);
    let selection = select_sensors(&course, SelectionSettings::default()).expect("a selection");
    let chosen = names(&course, &selection.chosen);
    let of = |name: &str| selection.sensors.iter().find(|it| it.sensor == name).expect("a verdict");
    let twin = if chosen.contains(&"temperature_1_c".to_owned()) { "temperature_2_c" } else { "temperature_1_c" };
    assert!(chosen.contains(&"ambient_temperature_c".to_owned()), "{chosen:?}");
    assert!(of(twin).reason.contains("repeats the chosen sensors"), "{}", of(twin).reason);
    assert!(of(&chosen[0]).reason.contains("lowers the error of blocks left out"), "{}", of(&chosen[0]).reason);
    assert!(selection.held_out.rms_um < 0.5 * selection.held_out_mean.rms_um, "{selection:?}");
    assert!(selection.sensors.iter().all(|it| !it.reason.is_empty()));
}

#[test]
fn grades_alone_choose_worse_and_more_alike() {
    let mut better = 0;
    for seed in 0..8 {
        let course = course(seed);
        let selection = select_sensors(&course, SelectionSettings::default()).expect("a selection");
        let grades = selection.by_grades.expect("grades");
        let by_grades = grades.held_out_rms_um.unwrap_or(f64::MAX);
        better += usize::from(selection.held_out.rms_um < by_grades);
    }
    assert!(better >= 7, "{better} of 8");
}

#[test]
fn a_constant_sensor_is_out_and_kelvin_stops_everything() {
    let course = course(3);
    let rebuilt = |name: &str, values: Vec<f64>| {
        let mut sensors = course.sensors().to_vec();
        sensors.push(Sensor::new(name, values));
        Course::new(course.clock_s().to_vec(), course.runs().to_vec(), true, course.error_um().to_vec(), sensors)
    };
    let with_constant = rebuilt("temperature_9_c", vec![22.0; course.rows()]);
    let selection = select_sensors(&with_constant, SelectionSettings::default()).expect("a selection");
    assert!(selection.sensors.last().expect("the constant one").reason.contains("changes by 0.000 K only"));
    let kelvin = course.sensors()[0].values.iter().map(|c| c + 273.15).collect();
    let refused =
        select_sensors(&rebuilt("temperature_9_c", kelvin), SelectionSettings::default()).expect_err("kelvin");
    assert!(refused.to_string().contains("looks like K"), "{refused}");
}

#[test]
fn an_error_that_no_temperature_explains_is_refused() {
    let mut random = bed::create_random(8);
    let course = bed::warm_ups(&mut random, 5, 120);
    let rough = bed::Rough { slow_um: 5.0, memory_s: 600.0, white_um: 1.0 };
    let course = bed::with_error(&mut random, &course, (0.0, &[]), 0.0, rough);
    let refused = select_sensors(&course, SelectionSettings::default()).expect_err("nothing to be found");
    assert_eq!(refused.kind, RefusalKind::NotIdentifiable);
}
