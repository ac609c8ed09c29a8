//! What cannot be learned is refused with words.

use super::*;
use crate::thermal::bed::{self, ROUGH};
use crate::thermal::course::Sensor;

fn course() -> Course {
    let mut random = bed::create_random(5);
    let course = bed::warm_ups(&mut random, 3, 150);
    bed::with_error(&mut random, &course, (-50.0, &[("temperature_1_c", 4.0)]), 0.0, ROUGH)
}

fn rebuilt(course: &Course, error: Vec<f64>, sensors: Vec<Sensor>) -> Course {
    Course::new(course.clock_s().to_vec(), course.runs().to_vec(), true, error, sensors)
}

#[test]
fn every_mistake_has_its_words() {
    let course = course();
    let (error, sensors) = (course.error_um().to_vec(), course.sensors().to_vec());
    let refused = |error: Vec<f64>, sensors: Vec<Sensor>| {
        learn_law(&rebuilt(&course, error, sensors), SelectionSettings::default(), None)
            .expect_err("refused")
            .to_string()
    };
    let millimetres = error.iter().map(|um| um / 1000.0).collect();
    assert!(refused(millimetres, sensors.clone()).contains("looks like mm"));
    let kelvin = vec![Sensor::new("temperature_1_c", sensors[2].values.iter().map(|c| c + 273.15).collect())];
    assert!(refused(error.clone(), kelvin).contains("looks like K"));
    let still = vec![Sensor::new("temperature_1_c", vec![21.5; course.rows()])];
    assert!(refused(error.clone(), still).contains("changes by 0.000 K only"));
    assert!(refused(error.clone(), Vec::new()).contains("no temperature"));
    assert!(refused(vec![4.0; course.rows()], sensors).contains("is 4 um in every row"));
    let unknown = learn_law(&course, SelectionSettings::default(), Some(&["oil_c".to_owned()])).expect_err("unknown");
    assert!(unknown.to_string().starts_with("oil_c: is not among"), "{unknown}");
}

#[test]
fn a_law_is_learned_with_everything_that_is_shown() {
    let learned = learn_law(&course(), SelectionSettings::default(), None).expect("a law");
    assert!(learned.blocks_are_runs && learned.blocks == 3);
    let json = serde_json::to_value(&learned).expect("JSON");
    assert!(json["without_lag"]["fit"]["coefficients"][1]["interval"][0].is_number(), "{json}");
    assert!(json["selection"]["sensors"][0]["reason"].is_string());
}
