use super::*;
use adapter_core::reading::Value as Held;
use serde_json::json;

const LAYOUT: NcLinkLayout = NcLinkLayout { f_channel: 2560, spindle_axis: None };

fn model() -> Model {
    let axis = |number: u32, name: &str, motor: Value| {
        json!({"type": "AXIS", "number": number.to_string(), "configs": [{"id": format!("n{number}"), "type": "NAME", "value": name}],
               "components": [{"type": "MOTOR", "dataItems": motor},
                              {"type": "SCREW", "dataItems": [{"id": format!("p{number}"), "type": "POSITION"}]}]})
    };
    let message = json!({"devices": [{"type": "MACHINE",
        "dataItems": [{"id": "01", "type": "STATUS"}, {"id": "02", "type": "FEED_SPEED"}],
        "components": [axis(0, "X", json!([{"id": "c0", "type": "CURRENT"}])),
                       axis(5, "C", json!([{"id": "s5", "type": "SPEED"}, {"id": "c5", "type": "CURRENT"}])),
                       {"type": "CONTROLLER", "dataItems": [
                           {"id": "03", "type": "WARNING"}, {"id": "04", "type": "PROGRAM"},
                           {"id": "05", "type": "VARIABLE", "number": "REG_F"},
                           {"id": "06", "type": "VARIABLE", "number": "CHAN_0"}]}]}]});
    Model::parse(&message).expect("a model")
}

/// What each item of the plan is answered with; what is not named is refused.
fn answered(plan: &NcLinkPoll, said: &[(&str, Value)]) -> Vec<Reading> {
    let answer = |ask: &RequestedItem| {
        let value = said.iter().find(|(id, _)| *id == ask.id).map(|(_, value)| value.clone());
        Some(value.map_or_else(|| Err("NOT_FOUND".to_owned()), |value| Ok(vec![value])))
    };
    let answers: Vec<Option<NcLinkAnswer>> = plan.requested_items().iter().map(answer).collect();
    let mut out = Vec::new();
    plan.append_readings(&answers, Stamp::from_exact_time(7), &mut out);
    out
}

fn of(readings: &[Reading], channel: &str) -> Result<Held, Absence> {
    let found: Vec<&Reading> = readings.iter().filter(|reading| reading.channel.name() == channel).collect();
    assert_eq!(found.len(), 1, "one reading of {channel}");
    found[0].value.clone()
}

fn text(word: &str) -> Result<Held, Absence> {
    Ok(Held::Text(Arc::from(word)))
}

#[test]
fn every_channel_gets_one_reading_or_a_reason() {
    let plan = NcLinkPoll::from_model(&model(), LAYOUT, &[], false);
    let said = [
        ("02", json!("812.5")),
        ("03", json!([])),
        ("04", json!("../prog/O7")),
        ("05", json!(0x21)),
        ("p0", json!(12.5)),
        ("s5", json!(1500)),
        ("c5", json!("hot")),
    ];
    let readings = answered(&plan, &said);
    let mut names: Vec<&str> = readings.iter().map(|reading| reading.channel.name()).collect();
    names.sort_unstable();
    let mut expected: Vec<&str> = list_channels(&[]).iter().map(|channel| channel.name()).collect();
    expected.sort_unstable();
    assert_eq!(names, expected);
    assert_eq!(of(&readings, "feed_mm_min"), Ok(Held::Number(812.5)));
    assert_eq!(of(&readings, "alarm"), text(""));
    assert_eq!(of(&readings, "program"), text("O7"));
    assert_eq!((of(&readings, "mode"), of(&readings, "execution")), (text("AUTOMATIC"), text("ACTIVE")));
    assert_eq!(of(&readings, "x_axis_position_mm"), Ok(Held::Number(12.5)));
    assert_eq!(of(&readings, "spindle_speed_rpm"), Ok(Held::Number(1500.0)));
    assert_eq!(of(&readings, "spindle_current_a"), Err(Absence::OutOfRange));
    assert_eq!(of(&readings, "x_axis_current_a"), Err(Absence::Refused));
    assert_eq!(of(&readings, "feed_override_pct"), Err(Absence::NotSupported), "not in the model");
    assert_eq!(of(&readings, "operation"), Err(Absence::NotSupported));
}

#[test]
fn without_the_channel_word_the_status_speaks_where_it_is_a_word() {
    let plan = NcLinkPoll::from_model(&model(), LAYOUT, &[], false);
    let readings = answered(&plan, &[("01", json!("running"))]);
    assert_eq!((of(&readings, "mode"), of(&readings, "execution")), (Err(Absence::Refused), text("ACTIVE")));
    assert_eq!(of(&answered(&plan, &[("01", json!(1))]), "execution"), Err(Absence::OutOfRange));
}

#[test]
fn threads_and_taps_are_told_to_the_gate() {
    let plan = NcLinkPoll::from_model(&model(), LAYOUT, &[], false);
    assert_eq!(of(&answered(&plan, &[("05", json!(0x221))]), "operation"), text("threading"));
    assert_eq!(of(&answered(&plan, &[("05", json!(0x21)), ("06", json!(1))]), "operation"), text("tapping"));
}

#[test]
fn items_are_asked_for_as_the_device_names_them() {
    let ids: Vec<String> = NcLinkPoll::from_model(&model(), LAYOUT, &[], false)
        .requested_items()
        .iter()
        .map(|ask| ask.id.clone())
        .collect();
    assert!(ids.contains(&"s5".to_owned()) && ids.contains(&"02".to_owned()), "{ids:?}");
    let plan = NcLinkPoll::from_model(&model(), NcLinkLayout { f_channel: 6400, ..LAYOUT }, &[], true);
    let word = plan.requested_items().iter().find(|ask| ask.id == "/CONTROLLER/VARIABLE@REG_F").expect("asked");
    assert_eq!(word.params.indexes, ["6400"]);
}

#[test]
fn another_spindle_can_be_named() {
    let plan = NcLinkPoll::from_model(&model(), NcLinkLayout { spindle_axis: Some(0), ..LAYOUT }, &[], false);
    let readings = answered(&plan, &[("c0", json!(3.5)), ("c5", json!(9.0))]);
    assert_eq!(of(&readings, "spindle_current_a"), Ok(Held::Number(3.5)));
}
