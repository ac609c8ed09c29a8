use super::super::sample::SampleBlock;
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

/// A model of one item, and the sample channel that holds it.
fn model_of(path: &str, unit: &str) -> Model {
    let parts: Vec<&str> = path.split('/').collect();
    let numbered = |part: &str| match part.split_once('@') {
        Some((kind, number)) => json!({"type": kind, "number": number}),
        None => json!({"type": part}),
    };
    let (last, above) = parts.split_last().expect("a path");
    let mut item = numbered(last);
    (item["id"], item["units"]) = (json!("it"), json!(unit));
    let mut node = json!({"dataItems": [item]});
    for part in above.iter().rev() {
        let mut outer = numbered(part);
        outer.as_object_mut().expect("an object").extend(node.as_object().expect("an object").clone());
        node = json!({"components": [outer]});
    }
    node["type"] = json!("MACHINE");
    node["configs"] = json!([{"id": "s1", "type": "SAMPLE_CHANNEL", "sampleInterval": 1, "ids": [{"id": "it"}]}]);
    Model::parse(&json!({"devices": [node]})).expect("a model")
}

fn list_paths(rows: [(&'static str, &'static str, &'static str); 3], number: u32) -> impl Iterator<Item = String> {
    rows.into_iter().flat_map(move |(item, other, _)| [item, other].map(|item| format!("AXIS@{number}/{item}")))
}

/// What is sampled says the same as what is asked for: for every channel that has a number, in every unit of the table.
#[test]
fn polled_and_sampled_numbers_are_right_or_absent_in_every_unit() {
    let fixed = FIXED.iter().filter(|(.., how)| matches!(how, How::Number)).map(|(path, ..)| (*path).to_owned());
    let paths: Vec<String> = fixed.chain(list_paths(LINEAR, 0)).chain(list_paths(SPINDLE, 5)).collect();
    let (mut right, mut absent) = (0, 0);
    for path in &paths {
        for unit in adapter_core::channel::unit::list_symbols().chain(["furlong"]) {
            let model = model_of(path, unit);
            let plan = NcLinkPoll::from_model(&model, LAYOUT, &[], false);
            let channel = plan.items.first().unwrap_or_else(|| panic!("{path} feeds a channel")).channel;
            let wanted = channel.channel().unit;
            let truth = adapter_core::conversion::find_conversion(unit, wanted).map(|to| to.convert_number(3.0));
            let polled = of(&answered(&plan, &[("it", json!(3))]), channel.name());
            let message = json!({"beginTime": 5, "data": [{"data": [3, "3", [3]]}]});
            let block = SampleBlock::parse(&message, "s1", &model).expect("sense");
            let sampled = block.columns[0].convert_values(wanted);
            match truth {
                Some(truth) => {
                    let believed = Reading::from_number(channel, Stamp::from_exact_time(0), truth).value;
                    assert_eq!(polled, believed, "{path} in {unit}");
                    assert_eq!(sampled, Ok(vec![Some(truth); 3]), "{path} in {unit}");
                    right += 1;
                }
                None => {
                    assert_eq!(polled, Err(Absence::UnknownUnit), "{path} in {unit}");
                    assert!(sampled.is_err() && plan.problems().len() == 1, "{path} in {unit}");
                    absent += 1;
                }
            }
        }
    }
    assert!(right >= 150 && absent >= 2500, "{right} right, {absent} absent");
}

#[test]
fn texts_with_their_unit_and_tools_with_their_letter_are_read() {
    let model = model_of("FEED_OVERRIDE", "%");
    let plan = NcLinkPoll::from_model(&model, LAYOUT, &[], false);
    assert_eq!(of(&answered(&plan, &[("it", json!("85%"))]), "feed_override_pct"), Ok(Held::Number(85.0)));
    for (said, tool) in
        [(json!("T07"), Some("T7")), (json!("t7"), Some("T7")), (json!("07"), Some("T7")), (json!("TX"), None)]
    {
        assert_eq!(format_tool(&said).as_deref(), tool, "{said}");
    }
    assert_eq!(format_line(&json!("N0120")).as_deref(), Some("N120"));
    let current = model_of("AXIS@5/MOTOR/CURRENT", "mA");
    let message = json!({"beginTime": 5, "data": [{"data": ["200 mA", "0.3 A", 400]}]});
    let block = SampleBlock::parse(&message, "s1", &current).expect("sense");
    assert_eq!(block.columns[0].convert_values("A"), Ok(vec![Some(0.2), Some(0.3), Some(0.4)]));
}
