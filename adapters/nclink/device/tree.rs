//! The model of the simulated machine, laid out and numbered like Huazhong's default model.

use serde_json::{Value, json};
use simulated::address::SimulatedMachine;

/// Number of the spindle's axis.
const SPINDLE: u32 = 5;

pub(super) fn build_tree(machine: SimulatedMachine, serial: &str) -> Value {
    let (name, axes): (&str, &[(u32, &str)]) = match machine {
        SimulatedMachine::Lathe => ("simulated lathe", &[(0, "X"), (2, "Z")]),
        SimulatedMachine::Mill => ("simulated mill", &[(0, "X"), (1, "Y"), (2, "Z")]),
    };
    let mut components: Vec<Value> = axes.iter().map(|(number, letter)| build_linear_axis(*number, letter)).collect();
    components.extend([build_spindle(), build_controller()]);
    json!({
        "id": "01", "type": "NC_LINK_ROOT", "name": name, "version": "1.0.0", "uniqueID": serial,
        "devices": [{
            "id": "0103", "type": "MACHINE", "name": name, "version": "1.0",
            "configs": sample_channels(axes),
            "dataItems": [
                build_item("010302", "STATUS"), build_item("010303", "FEED_SPEED"), build_item("010305", "FEED_OVERRIDE"),
                build_item("010306", "SPDL_OVERRIDE"), build_item("010307", "PART_COUNT"),
            ],
            "components": components,
        }],
    })
}

fn build_item(id: &str, kind: &str) -> Value {
    json!({"id": id, "type": kind})
}

/// The ids of one axis: `0103` + 50 + number, then the part, then the item.
fn build_id(number: u32, rest: &str) -> String {
    let axis = if number == SPINDLE { 53 } else { 50 + number };
    format!("0103{axis}{rest}")
}

fn build_axis(number: u32, letter: &str, kind: &str, components: &Value) -> Value {
    json!({
        "type": "AXIS", "number": number.to_string(), "id": build_id(number, ""), "name": letter,
        "configs": [
            {"id": build_id(number, "01"), "type": "NAME", "value": letter},
            {"id": build_id(number, "02"), "type": "NUMBER", "value": number},
            {"id": build_id(number, "03"), "type": "TYPE", "value": kind},
        ],
        "components": components,
    })
}

fn build_linear_axis(number: u32, letter: &str) -> Value {
    let part = |kind: &str, own: &str, items: Vec<Value>| json!({"type": kind, "id": build_id(number, own), "dataItems": items});
    build_axis(
        number,
        letter,
        "linear",
        &json!([
            part(
                "SERVO_DRIVER",
                "20",
                vec![build_item(&build_id(number, "2001"), "POSITION"), build_item(&build_id(number, "2003"), "SPEED")]
            ),
            part(
                "SCREW",
                "22",
                vec![build_item(&build_id(number, "2201"), "POSITION"), build_item(&build_id(number, "2202"), "SPEED")]
            ),
        ]),
    )
}

fn build_spindle() -> Value {
    let part = |kind: &str, own: &str, items: Vec<Value>| json!({"type": kind, "id": build_id(SPINDLE, own), "dataItems": items});
    build_axis(
        SPINDLE,
        "C",
        "rotary",
        &json!([
            part("SERVO_DRIVER", "20", vec![build_item(&build_id(SPINDLE, "2002"), "SPEED")]),
            part(
                "MOTOR",
                "21",
                vec![
                    build_item(&build_id(SPINDLE, "2102"), "SPEED"),
                    build_item(&build_id(SPINDLE, "2103"), "CURRENT")
                ]
            ),
        ]),
    )
}

/// Registers: letter, last digits of the id, may it be written?
const REGISTERS: [(&str, &str, bool); 7] = [
    ("REG_F", "32", false),
    ("REG_G", "33", false),
    ("REG_R", "34", true),
    ("REG_W", "35", true),
    ("REG_D", "36", true),
    ("REG_B", "37", true),
    ("REG_P", "38", false),
];

fn build_controller() -> Value {
    let mut items: Vec<Value> =
        [("09", "PROGRAM"), ("11", "LINE_NUMBER"), ("12", "WARNING"), ("13", "TOOL_NUMBER"), ("14", "PROGRAM_NUMBER")]
            .iter()
            .map(|(own, kind)| build_item(&format!("010354{own}"), kind))
            .collect();
    let register = |(number, own, settable): &(&str, &str, bool)| json!({"id": format!("010354{own}"), "type": "VARIABLE", "number": number, "datatype": "LIST", "setable": settable});
    items.extend(REGISTERS.iter().map(register));
    items.push(json!({"id": "01035450", "type": "VARIABLE", "number": "CHAN_0", "datatype": "LIST"}));
    json!({"type": "CONTROLLER", "id": "010354", "name": "controller", "dataItems": items})
}

/// A slow channel of states, and the fast one: axes, spindle and where the program is, every millisecond.
fn sample_channels(axes: &[(u32, &str)]) -> Value {
    let named = |ids: Vec<String>| ids.into_iter().map(|id| json!({"id": id})).collect::<Vec<Value>>();
    let slow = ["010302", "010303", "010305", "010306", "010307", "01035412"].map(str::to_owned).to_vec();
    let of_axis = |(number, _): &(u32, &str)| ["2001", "2201", "2202"].map(|own| build_id(*number, own));
    let mut fast: Vec<String> = axes.iter().flat_map(of_axis).collect();
    fast.extend(["2002", "2102", "2103"].map(|own| build_id(SPINDLE, own)));
    fast.extend(["01035411", "01035413", "01035414", "010302"].map(str::to_owned));
    json!([
        {"id": "sample_channel0", "type": "SAMPLE_CHANNEL", "sampleInterval": 2000, "uploadInterval": 2000, "ids": named(slow)},
        {"id": "sample_channel1", "type": "SAMPLE_CHANNEL", "sampleInterval": 1, "uploadInterval": 200, "ids": named(fast)},
    ])
}
