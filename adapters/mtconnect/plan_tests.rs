//! Devices in the shapes in which three makers describe theirs; the documents are our own.

use super::*;
use crate::model::parse_devices;
use adapter_core::address::Endpoint;

/// In the way of Mazak's agents: axes below `Axes`, the spindle a rotary axis with a mode, positions in two coordinate systems, overrides as events.
pub(crate) const TURNING_CENTRE: &str = r#"<MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:1.5"><Header instanceId="1" bufferSize="4096"/><Devices>
<Device id="d1" name="M1" uuid="u1"><DataItems><DataItem category="EVENT" id="avail" type="AVAILABILITY"/></DataItems><Components>
<Axes id="a"><Components>
<Linear id="x" name="X"><DataItems>
 <DataItem category="SAMPLE" coordinateSystem="WORK" id="Xwork" type="POSITION" subType="ACTUAL" units="MILLIMETER" nativeUnits="MILLIMETER"/>
 <DataItem category="SAMPLE" coordinateSystem="MACHINE" id="Xabs" type="POSITION" subType="ACTUAL" units="MILLIMETER" nativeUnits="INCH"/>
 <DataItem category="SAMPLE" id="Xfrt" type="AXIS_FEEDRATE" subType="ACTUAL" units="MILLIMETER/SECOND" nativeUnits="MILLIMETER/MINUTE" nativeScale="10"/>
 <DataItem category="SAMPLE" id="Xmean" type="LOAD" units="PERCENT" statistic="AVERAGE"/>
 <DataItem category="SAMPLE" id="Xload" type="LOAD" units="PERCENT"/><DataItem category="CONDITION" id="Xtravel" type="POSITION"/></DataItems></Linear>
<Rotary id="c" name="C" nativeName="S"><DataItems>
 <DataItem category="EVENT" id="Srmode" type="ROTARY_MODE"><Constraints><Value>SPINDLE</Value></Constraints></DataItem>
 <DataItem category="SAMPLE" id="Srpm" type="ROTARY_VELOCITY" subType="ACTUAL" units="REVOLUTION/MINUTE"/>
 <DataItem category="SAMPLE" id="Scmd" type="ROTARY_VELOCITY" subType="COMMANDED" units="REVOLUTION/MINUTE"/>
 <DataItem category="EVENT" id="Sovr" type="ROTARY_VELOCITY_OVERRIDE"/>
 <DataItem category="SAMPLE" id="Sload" type="LOAD" units="PERCENT"/><DataItem category="SAMPLE" id="Stemp" type="TEMPERATURE" units="CELSIUS"/></DataItems></Rotary>
<Rotary id="b" name="B"><DataItems><DataItem category="SAMPLE" id="Brpm" type="ROTARY_VELOCITY" subType="ACTUAL" units="REVOLUTION/MINUTE"/></DataItems></Rotary>
</Components></Axes>
<Controller id="cont"><DataItems><DataItem category="EVENT" id="estop" type="EMERGENCY_STOP"/><DataItem category="EVENT" id="msg" type="MESSAGE"/><DataItem category="CONDITION" id="sys" type="SYSTEM"/></DataItems>
<Components><Path id="p1" name="path1"><DataItems>
 <DataItem category="SAMPLE" id="Fact" type="PATH_FEEDRATE" subType="ACTUAL" units="MILLIMETER/SECOND"/>
 <DataItem category="SAMPLE" id="Fcmd" type="PATH_FEEDRATE" subType="PROGRAMMED" units="MILLIMETER/SECOND"/>
 <DataItem category="EVENT" id="Fovr" type="PATH_FEEDRATE_OVERRIDE" subType="PROGRAMMED"/><DataItem category="EVENT" id="Frapid" type="PATH_FEEDRATE_OVERRIDE" subType="RAPID"/>
 <DataItem category="EVENT" id="exec" type="EXECUTION"/><DataItem category="EVENT" id="mode" type="CONTROLLER_MODE"/>
 <DataItem category="EVENT" id="pgm" type="PROGRAM"/><DataItem category="EVENT" id="line" type="LINE"/><DataItem category="EVENT" id="tool" type="TOOL_NUMBER"/>
 <DataItem category="EVENT" id="pc" type="PART_COUNT"/></DataItems></Path></Components></Controller>
</Components></Device></Devices></MTConnectDevices>"#;

/// In the way of Okuma's: two paths, several spindles with letters, energy of the machine, coolant and motor.
const TWO_PATHS: &str = r#"<MTConnectDevices><Devices><Device id="d" name="OKUMA.123456" uuid="OKUMA.123456"><DataItems><DataItem category="SAMPLE" id="kw" type="WATTAGE" units="WATT"/></DataItems><Components>
<Axes id="a"><Components>
<Linear id="lx" name="X1"><DataItems><DataItem category="SAMPLE" id="x1" type="POSITION" subType="ACTUAL" nativeUnits="INCH"/></DataItems></Linear>
<Linear id="lx2" name="X"><DataItems><DataItem category="SAMPLE" id="x2" type="POSITION" subType="ACTUAL" units="MILLIMETER"/></DataItems></Linear>
<Rotary id="s1" name="S1"><DataItems><DataItem category="SAMPLE" id="s1v" type="ROTARY_VELOCITY" subType="ACTUAL" units="REVOLUTION/MINUTE"/></DataItems>
 <Components><Motor id="m1"><DataItems><DataItem category="SAMPLE" id="m1t" type="TEMPERATURE" nativeUnits="FAHRENHEIT" nativeScale="10"/></DataItems></Motor></Components></Rotary>
<Rotary id="s2" name="S2"><DataItems><DataItem category="SAMPLE" id="s2v" type="ROTARY_VELOCITY" subType="ACTUAL" units="REVOLUTION/MINUTE"/></DataItems></Rotary>
</Components></Axes>
<Controller id="c"><Components>
<Path id="p1"><DataItems><DataItem category="EVENT" id="e1" type="EXECUTION"/><DataItem category="CONDITION" id="c1" type="SYSTEM"/></DataItems></Path>
<Path id="p2"><DataItems><DataItem category="EVENT" id="e2" type="EXECUTION"/><DataItem category="CONDITION" id="c2" type="SYSTEM"/></DataItems></Path></Components></Controller>
<Systems id="sy"><Components><Electric id="el"><DataItems><DataItem category="SAMPLE" id="ws" type="ELECTRICAL_ENERGY"/></DataItems></Electric>
<Coolant id="co"><DataItems><DataItem category="SAMPLE" id="ct" type="TEMPERATURE" units="CELSIUS"/></DataItems></Coolant></Components></Systems>
</Components></Device></Devices></MTConnectDevices>"#;

/// In the way of small adapters, as for Haas: axes right below the device, names without modes, a position of the path as three numbers.
const SMALL_MILL: &str = r#"<MTConnectDevices><Devices><Device id="d" name="VF2" uuid="v"><Components>
<Rotary id="c1" name="C" nativeName="S"><DataItems><DataItem category="SAMPLE" id="speed" type="SPINDLE_SPEED" subType="ACTUAL" units="REVOLUTION/MINUTE"/></DataItems></Rotary>
<Controller id="c"><Components><Path id="p"><DataItems><DataItem category="SAMPLE" id="pos" type="PATH_POSITION" subType="ACTUAL" units="MILLIMETER_3D"/>
<DataItem category="SAMPLE" id="feed" type="PATH_FEEDRATE" units="FURLONG/FORTNIGHT"/><DataItem category="EVENT" id="m1" type="MESSAGE"/><DataItem category="EVENT" id="m2" type="MESSAGE"/></DataItems></Path></Components></Controller>
</Components></Device></Devices></MTConnectDevices>"#;

fn target() -> MtConnectTarget {
    MtConnectTarget {
        endpoint: Endpoint { host: "127.0.0.1".to_owned(), port: 5000 },
        device: None,
        period_ms: 200,
        timeout_ms: 2000,
        spindle: None,
        paths: vec![1],
        own: Vec::new(),
    }
}

fn plan_of(document: &str, target: &MtConnectTarget) -> ChannelPlan {
    let devices = parse_devices(document.as_bytes()).expect("devices");
    ChannelPlan::from_device(&devices[0], target)
}

/// Item and number 100 in the channel's unit.
fn fed(plan: &ChannelPlan, channel: &str) -> Option<(String, Option<f64>)> {
    let mut all = plan.channels_by_item.iter().flat_map(|(item, fed)| fed.iter().map(move |fed| (item, fed)));
    let (item, fed) = all.find(|(_, fed)| fed.channel.name() == channel)?;
    let number = fed.conversion.map(|conversion| (conversion.convert_number(100.0) * 1e6).round() / 1e6);
    Some((item.clone(), number))
}

#[test]
fn a_turning_centre_feeds_its_channels_in_their_units() {
    let plan = plan_of(TURNING_CENTRE, &target());
    for (channel, item, number) in [
        ("x_axis_position_mm", "Xabs", Some(100.0)),
        ("x_axis_velocity_mm_min", "Xfrt", Some(6000.0)),
        ("x_axis_load_pct", "Xload", Some(100.0)),
        ("spindle_speed_rpm", "Srpm", Some(100.0)),
        ("spindle_programmed_rpm", "Scmd", Some(100.0)),
        ("spindle_override_pct", "Sovr", Some(100.0)),
        ("spindle_load_pct", "Sload", Some(100.0)),
        ("temperature_1_c", "Stemp", Some(100.0)),
        ("feed_mm_min", "Fact", Some(6000.0)),
        ("feed_programmed_mm_min", "Fcmd", Some(6000.0)),
        ("feed_override_pct", "Fovr", Some(100.0)),
        ("rapid_override_pct", "Frapid", Some(100.0)),
        ("part_count", "pc", Some(100.0)),
        ("execution", "exec", None),
        ("mode", "mode", None),
        ("program", "pgm", None),
        ("block", "line", None),
        ("tool", "tool", None),
        ("emergency_stop", "estop", None),
        ("operator_message", "msg", None),
    ] {
        assert_eq!(fed(&plan, channel), Some((item.to_owned(), number)), "{channel}");
    }
    assert_eq!(plan.problems, []);
    assert_eq!(plan.availability.as_deref(), Some("avail"));
    let alarm = plan.conditions.iter().find(|condition| condition.channel.name() == "alarm").expect("alarms");
    assert_eq!(alarm.items, ["Xtravel", "sys"]);
    let total = ChannelId::from_name("total_power_w").expect("in the table");
    assert!(plan.absent.contains(&total) && !plan.absent.contains(&alarm.channel));
}

#[test]
fn two_paths_two_spindles_and_native_units_are_told_apart() {
    let plan = plan_of(TWO_PATHS, &target());
    assert_eq!(fed(&plan, "spindle_speed_rpm"), None, "nobody knows which of the two");
    assert!(
        plan.problems.iter().any(|problem| problem.what.contains("S1, S2") && problem.next.contains("spindle=S1")),
        "{:?}",
        plan.problems
    );
    let named = MtConnectTarget { spindle: Some("S1".to_owned()), paths: vec![2, 1], ..target() };
    let plan = plan_of(TWO_PATHS, &named);
    for (channel, item, number) in [
        ("spindle_speed_rpm", "s1v", Some(100.0)),
        ("motor_temperature_c", "m1t", Some(-12.222222)),
        ("x_axis_position_mm", "x1", Some(2540.0)),
        ("coolant_temperature_c", "ct", Some(100.0)),
        ("total_power_w", "kw", Some(100.0)),
        ("total_energy_kwh", "ws", Some(0.000_028)),
        ("execution", "e2", None),
        ("path1_execution", "e1", None),
    ] {
        assert_eq!(fed(&plan, channel), Some((item.to_owned(), number)), "{channel}");
    }
    let items =
        |name: &str| plan.conditions.iter().find(|known| known.channel.name() == name).map(|known| known.items.clone());
    assert_eq!((items("alarm"), items("path1_alarm")), (Some(vec!["c2".to_owned()]), Some(vec!["c1".to_owned()])));
    let misspelt = MtConnectTarget { spindle: Some("S11".to_owned()), ..target() };
    assert!(
        plan_of(TWO_PATHS, &misspelt).problems.iter().any(|problem| problem.next.contains("Did you mean spindle=S1"))
    );
}

#[test]
fn a_small_mill_has_three_coordinates_and_no_value_of_what_is_not_clear() {
    let plan = plan_of(SMALL_MILL, &target());
    assert_eq!(fed(&plan, "spindle_speed_rpm"), Some(("speed".to_owned(), Some(100.0))));
    for channel in ["x_axis_position_mm", "y_axis_position_mm", "z_axis_position_mm"] {
        assert_eq!(fed(&plan, channel), Some(("pos".to_owned(), Some(100.0))), "{channel}");
    }
    assert_eq!(fed(&plan, "feed_mm_min"), Some(("feed".to_owned(), None)));
    assert_eq!(fed(&plan, "operator_message"), None);
    let told: Vec<&str> = plan.problems.iter().map(|problem| problem.what.as_str()).collect();
    assert!(
        told.iter().any(|what| what.contains("FURLONG/FORTNIGHT") && what.contains("no unit that is known")),
        "{told:?}"
    );
    assert!(
        told.iter().any(|what| what.contains("operator_message") && what.contains("m1") && what.contains("m2")),
        "{told:?}"
    );
}

#[test]
fn every_row_names_a_channel_of_the_table_and_the_list_holds_each_once() {
    let both = MtConnectTarget { paths: vec![1, 2, 3], ..target() };
    let channels = list_channels(&both);
    for row in ROWS {
        let name = if row.place == RowPlace::Axis { format!("x_{}", row.channel) } else { row.channel.to_owned() };
        assert!(ChannelId::from_name(&name).is_some_and(|id| channels.contains(&id)), "{name}");
    }
    let mut unique = channels.clone();
    unique.sort_unstable();
    unique.dedup();
    assert_eq!(unique.len(), channels.len());
}
